"""The policies of this package, by name."""

from __future__ import annotations

from guidance.tracking.soft_landing import SoftLandingOptions
from hda.policies.composition import ComposedPolicy, PrivilegedComposition
from hda.policies.deferred_decision import DeferredDecisionOptions, DeferredDecisionPolicy
from hda.policies.entry import PolicyEntry
from hda.policies.hazard_aware import HazardAwareSite
from hda.policies.planned_descent import PlannedDescent
from hda.policies.privileged.hindsight import BestKnownSite
from hda.policies.privileged.oracle import OracleSite
from hda.policies.privileged.oracle_fuel import CheapestSafeSite
from hda.policies.rivals.alhat import AlhatSite
from hda.policies.rivals.polynomial_laws import ApolloGuidance, EGuidance
from hda.policies.rivals.reachability_steering import ReachabilitySteeringSite
from hda.policies.waiting_descent import WaitingDescent
from hda.policies.zem_zev import FixedGainZemZev
from hda.site_selection import NearestSafeSite, NominalSite, SingleDivertSite

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
        lambda: PrivilegedComposition("oracle", OracleSite.informed, FixedGainZemZev()),
        "knows the true map: the nearest truly safe ground with 2 m of clearance",
        privileged=True,
    ),
    PolicyEntry(
        "single-divert+convex",
        lambda: ComposedPolicy("single-divert+convex", SingleDivertSite(), PlannedDescent()),
        "the sites of single-divert, flown by convex guidance",
    ),
    PolicyEntry(
        "nearest-safe+convex",
        lambda: ComposedPolicy("nearest-safe+convex", NearestSafeSite(), PlannedDescent()),
        "the sites of nearest-safe, flown by convex guidance",
    ),
    PolicyEntry(
        "nearest-safe+casadi",
        lambda: ComposedPolicy(
            "nearest-safe+casadi", NearestSafeSite(), PlannedDescent(SoftLandingOptions(method="casadi"))
        ),
        "the same, planned by the nonconvex reference",
        slow=True,
    ),
    PolicyEntry(
        "oracle+convex",
        lambda: PrivilegedComposition("oracle+convex", OracleSite.informed, PlannedDescent()),
        "the sites of oracle, flown by convex guidance",
        privileged=True,
    ),
    PolicyEntry(
        "hazard-aware",
        lambda: ComposedPolicy("hazard-aware", HazardAwareSite(), WaitingDescent()),
        "least propellant and risk by the belief from all looks, flown by convex guidance",
    ),
    PolicyEntry(
        "hazard-aware+zem-zev",
        lambda: ComposedPolicy("hazard-aware+zem-zev", HazardAwareSite(), FixedGainZemZev()),
        "the sites of hazard-aware's objective, flown by ZEM/ZEV",
    ),
    PolicyEntry(
        "deferred-decision",
        DeferredDecisionPolicy,
        "one trunk to several candidate sites, kept as long as a budget of propellant allows, then a branch",
    ),
    PolicyEntry(
        "oracle-fuel",
        lambda: PrivilegedComposition("oracle-fuel", CheapestSafeSite.informed, PlannedDescent()),
        "knows the true map: the cheapest truly safe ground with 2 m of clearance, by convex guidance",
        privileged=True,
    ),
    PolicyEntry(
        "hindsight",
        lambda: PrivilegedComposition("hindsight", BestKnownSite.informed, PlannedDescent()),
        "knows the true map: the cheapest truly safe ground that could have been seen, by convex guidance",
        privileged=True,
    ),
    PolicyEntry(
        "alhat",
        lambda: ComposedPolicy("alhat", AlhatSite(), FixedGainZemZev()),
        "one scan: the safest site with room to the nearest hazard that is cheap to reach",
        rival=True,
    ),
    PolicyEntry(
        "alhat+convex",
        lambda: ComposedPolicy("alhat+convex", AlhatSite(), PlannedDescent()),
        "the site of alhat, flown by convex guidance",
        rival=True,
    ),
    PolicyEntry(
        "reachability-steering",
        lambda: ComposedPolicy("reachability-steering", ReachabilitySteeringSite(), FixedGainZemZev()),
        "steers to the greatest mean safety of what can be reached and will be seen",
        rival=True,
    ),
    PolicyEntry(
        "reachability-steering+convex",
        lambda: ComposedPolicy("reachability-steering+convex", ReachabilitySteeringSite(), PlannedDescent()),
        "the sites of reachability-steering, flown by convex guidance",
        rival=True,
    ),
    PolicyEntry(
        "adaptive-deferred-decision",
        lambda: DeferredDecisionPolicy(
            "adaptive-deferred-decision", DeferredDecisionOptions(candidates=5, sheds=True)
        ),
        "as deferred-decision, but five candidates are given up one after another, down to two",
        rival=True,
    ),
    PolicyEntry(
        "nearest-safe+e-guidance",
        lambda: ComposedPolicy("nearest-safe+e-guidance", NearestSafeSite(), EGuidance()),
        "the sites of nearest-safe, flown by E-guidance: thrust acceleration linear in time",
        rival=True,
    ),
    PolicyEntry(
        "nearest-safe+apollo",
        lambda: ComposedPolicy("nearest-safe+apollo", NearestSafeSite(), ApolloGuidance()),
        "the sites of nearest-safe, flown by Apollo's guidance: acceleration quadratic in time",
        rival=True,
    ),
)
