"""The policies of this package, by name."""

from __future__ import annotations

from hda.policies.composition import ComposedPolicy, PrivilegedComposition
from hda.policies.zem_zev import FixedGainZemZev
from hda.registry import PolicyEntry
from hda.site_selection import NearestSafeSite, NominalSite, OracleSite, SingleDivertSite

ENTRIES: tuple[PolicyEntry, ...] = (
    PolicyEntry(
        "no-divert",
        lambda: ComposedPolicy("no-divert", NominalSite(), FixedGainZemZev()),
        "flies to the first target, whatever it sees",
    ),
    PolicyEntry(
        "single-divert",
        lambda: ComposedPolicy("single-divert", SingleDivertSite(), FixedGainZemZev()),
        "the paper's baseline: once, at 500 m, to the pixel of greatest observed safety",
    ),
    PolicyEntry(
        "nearest-safe",
        lambda: ComposedPolicy("nearest-safe", NearestSafeSite(), FixedGainZemZev()),
        "keeps a site that looks safe, else goes to the nearest that does",
    ),
    PolicyEntry(
        "oracle",
        lambda: PrivilegedComposition("oracle", OracleSite, FixedGainZemZev()),
        "knows the true map: the nearest truly safe ground with 2 m of clearance",
        privileged=True,
    ),
)
