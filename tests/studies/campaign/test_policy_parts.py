"""What is compiled side by side: every part once, the longest first."""

from hda.registry import policy_entry, policy_names
from hda.task.presets import PRESETS
from studies.campaign.monte_carlo import Study
from studies.campaign.policy_parts import PolicyPart, list_parts
from studies.compare.quick import QUICK_POLICIES


def test_the_planner_is_begun_first_and_the_vehicle_beside_it():
    parts = list_parts(Study(PRESETS["paper"], QUICK_POLICIES, 100))
    assert parts[:2] == [PolicyPart("hazard-aware", "law"), PolicyPart("no-divert", "flight")]
    assert PolicyPart("hazard-aware", "site") in parts
    assert {part.policy for part in parts if part.kind == "flight"} == {"no-divert", "td3", "td3-lstm"}


def test_every_policy_has_a_part_and_no_part_comes_twice():
    names = tuple(name for name in policy_names() if not policy_entry(name).slow)
    parts = list_parts(Study(PRESETS["paper"], names, 10))
    assert len(set(parts)) == len(parts)
    laws = [part.kind for part in parts].count("law")
    # planned; with late shifts; of hazard-aware, with a wait for a look as well; E-guidance; Apollo's
    assert laws == 5
    assert parts[0].kind == parts[-1].kind == "law"
    begun = {part.policy for part in parts}
    assert {"no-divert", "hazard-aware", "deferred-decision", "oracle-fuel", "td3"} <= begun
