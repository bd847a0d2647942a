"""Policies by name."""

import subprocess
import sys
from dataclasses import replace
from typing import Any

import pytest

import hda
from hda import registry
from hda.policies.composition import ComposedPolicy, PrivilegedComposition
from hda.policies.entry import PolicyEntry
from hda.policies.privileged.oracle import OracleSite
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import PrivilegedPolicy
from hda.registry import policy_entry
from hda.site_selection import NominalSite
from studies.campaign.command_line import choose_policies


@pytest.fixture(autouse=True)
def _own_registry(monkeypatch):
    """A copy to write in, with this package's policies alone."""
    hda.policy_names()
    own = {name: entry for name, entry in registry._entries.items() if name in OWN}
    monkeypatch.setattr(registry, "_entries", own)


OWN = ("no-divert", "single-divert", "nearest-safe", "oracle")


def nominal(name: str) -> ComposedPolicy:
    return ComposedPolicy(name, NominalSite(), FixedGainZemZev())


def privileged(name: str) -> PrivilegedComposition:
    return PrivilegedComposition(name, OracleSite.informed, FixedGainZemZev())


def test_the_policies_that_need_no_learning_are_registered():
    assert set(OWN) <= set(hda.policy_names())


def test_a_made_policy_carries_its_name():
    for name in hda.policy_names():
        assert hda.make_policy(name).name == name
        assert policy_entry(name).name == name
        assert policy_entry(name).summary


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("single-divertt", "single-divert"),
        ("nearest", "nearest-safe"),
        ("orakle", "oracle"),
        ("No-Divert", "no-divert"),
    ],
)
def test_an_unknown_name_suggests_the_nearest(wrong, meant):
    with pytest.raises(ValueError, match=rf"unknown policy '{wrong}'; did you mean .*{meant}"):
        hda.make_policy(wrong)
    with pytest.raises(ValueError, match=r"valid: .*single-divert"):
        policy_entry(wrong)


def without_rl(name: str) -> str:
    """What asking for a policy says in a process that has imported `hda` alone."""
    code = f"import hda\ntry:\n    hda.make_policy({name!r})\nexcept ValueError as error:\n    print(error)"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("name", ["td3", "td3-lstm-plus", "sac", "td3-lsm"])
def test_an_agent_that_nobody_registered_says_how_it_is(name):
    assert without_rl(name).strip().endswith("`import rl` registers the agents")


def test_other_unknown_names_have_no_word_of_agents():
    assert "import rl" not in without_rl("orakle")
    assert "import rl" not in without_rl("xyzzy")
    with pytest.raises(ValueError, match="unknown policy") as caught:
        hda.make_policy("td3-lsm")  # here rl is imported
    assert "import rl" not in str(caught.value)


def test_the_names_of_agents_are_those_that_rl_registers():
    from rl.policies.catalogue import entries

    assert sorted(registry.AGENTS) == sorted(entry.name for entry in entries())


@pytest.mark.parametrize("wrong", ["", "xyzzy", 7, None])
def test_a_name_like_no_other_gets_the_whole_list(wrong: Any):
    with pytest.raises(ValueError, match=r"unknown policy .*\(valid: .*no-divert.*\)"):
        hda.make_policy(wrong)


def test_a_registered_policy_can_be_made_and_comes_last():
    hda.register_policy(PolicyEntry("mine", lambda: nominal("mine"), "a policy of one's own"))
    assert hda.policy_names()[-1] == "mine"
    assert hda.make_policy("mine").name == "mine"
    assert hda.make_policy("mine") is not hda.make_policy("mine")


def test_a_name_is_registered_once():
    with pytest.raises(ValueError, match="'oracle' is registered already"):
        hda.register_policy(PolicyEntry("oracle", lambda: privileged("oracle"), "again", privileged=True))
    entry = PolicyEntry("mine", lambda: nominal("mine"), "once")
    hda.register_policy(entry)
    with pytest.raises(ValueError, match="'mine' is registered already"):
        hda.register_policy(entry)


def test_a_policy_that_calls_itself_otherwise_is_refused():
    with pytest.raises(ValueError, match="entry 'mine' makes a policy that calls itself 'other'"):
        hda.register_policy(PolicyEntry("mine", lambda: nominal("other"), "two names"))
    assert "mine" not in hda.policy_names()


@pytest.mark.parametrize("claim", [True, False])
def test_privilege_must_be_told_as_it_is(claim):
    make = nominal if claim else privileged
    with pytest.raises(ValueError, match="must say whether its policy is privileged"):
        hda.register_policy(PolicyEntry("mine", lambda: make("mine"), "not honest", privileged=claim))
    assert "mine" not in hda.policy_names()


def test_the_privileged_flag_of_every_entry_is_honest():
    for name in hda.policy_names():
        assert policy_entry(name).privileged == isinstance(hda.make_policy(name), PrivilegedPolicy)
    assert [name for name in OWN if policy_entry(name).privileged] == ["oracle"]


def test_a_policy_made_for_a_preset_belongs_there_alone():
    entry = PolicyEntry("mine", lambda: nominal("mine"), "trained on hard ground", preset="hard")
    assert entry.belongs_on("hard")
    assert not entry.belongs_on("paper")
    assert not replace(entry, slow=True).belongs_on("hard")
    assert all(policy_entry(name).belongs_on(preset) for name in OWN for preset in hda.PRESETS)
    hda.register_policy(entry)
    assert "mine" in choose_policies(("default",), "hard")[0]
    assert "mine" not in choose_policies(("default",), "paper")[0]
    assert choose_policies(("mine",), "paper")[0] == ("mine",)
