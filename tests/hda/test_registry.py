"""Policies by name."""

import subprocess
import sys
from dataclasses import replace
from typing import Any

import pytest

import hda
from hda import registry
from hda.policies.catalogue import ENTRIES
from hda.policies.composition import ComposedPolicy, PrivilegedComposition
from hda.policies.entry import PolicyEntry
from hda.policies.privileged.oracle import OracleSite
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import PrivilegedPolicy
from hda.registry import PolicyRegistry, policy_entry
from hda.site_selection import NominalSite
from studies.campaign.command_line import choose_policies

OWN = ("no-divert", "single-divert", "nearest-safe", "oracle")


@pytest.fixture
def policies() -> PolicyRegistry:
    """A registry of this package's policies that need no learning, which nobody else asks."""
    return PolicyRegistry(lambda: tuple(entry for entry in ENTRIES if entry.name in OWN))


def nominal(name: str) -> ComposedPolicy:
    return ComposedPolicy(name, NominalSite(), FixedGainZemZev())


def privileged(name: str) -> PrivilegedComposition:
    return PrivilegedComposition(name, OracleSite.informed, FixedGainZemZev())


def test_the_policies_that_need_no_learning_are_registered(policies):
    assert set(OWN) <= set(policies.names())


def test_a_made_policy_carries_its_name(policies):
    for name in policies.names():
        assert policies.make(name).name == name
        assert policies.entry(name).name == name
        assert policies.entry(name).summary


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("single-divertt", "single-divert"),
        ("nearest", "nearest-safe"),
        ("orakle", "oracle"),
        ("No-Divert", "no-divert"),
    ],
)
def test_an_unknown_name_suggests_the_nearest(wrong, meant, policies):
    with pytest.raises(ValueError, match=rf"unknown policy '{wrong}'; did you mean .*{meant}"):
        policies.make(wrong)
    with pytest.raises(ValueError, match=r"valid: .*single-divert"):
        policies.entry(wrong)


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
def test_a_name_like_no_other_gets_the_whole_list(wrong: Any, policies):
    with pytest.raises(ValueError, match=r"unknown policy .*\(valid: .*no-divert.*\)"):
        policies.make(wrong)


def test_a_registered_policy_can_be_made_and_comes_last(policies):
    policies.register(PolicyEntry("mine", lambda: nominal("mine"), "a policy of one's own"))
    assert policies.names()[-1] == "mine"
    assert policies.make("mine").name == "mine"
    assert policies.make("mine") is not policies.make("mine")


def test_a_name_is_registered_once(policies):
    with pytest.raises(ValueError, match="'oracle' is registered already"):
        policies.register(PolicyEntry("oracle", lambda: privileged("oracle"), "again", privileged=True))
    entry = PolicyEntry("mine", lambda: nominal("mine"), "once")
    policies.register(entry)
    with pytest.raises(ValueError, match="'mine' is registered already"):
        policies.register(entry)


def test_a_policy_that_calls_itself_otherwise_is_refused(policies):
    with pytest.raises(ValueError, match="entry 'mine' makes a policy that calls itself 'other'"):
        policies.register(PolicyEntry("mine", lambda: nominal("other"), "two names"))
    assert "mine" not in policies.names()


@pytest.mark.parametrize("claim", [True, False])
def test_privilege_must_be_told_as_it_is(claim, policies):
    make = nominal if claim else privileged
    with pytest.raises(ValueError, match="must say whether its policy is privileged"):
        policies.register(PolicyEntry("mine", lambda: make("mine"), "not honest", privileged=claim))
    assert "mine" not in policies.names()


def test_the_privileged_flag_of_every_entry_is_honest(policies):
    for name in policies.names():
        assert policies.entry(name).privileged == isinstance(policies.make(name), PrivilegedPolicy)
    assert [name for name in OWN if policies.entry(name).privileged] == ["oracle"]


def test_a_policy_made_for_a_preset_belongs_there_alone(monkeypatch):
    entry = PolicyEntry("mine", lambda: nominal("mine"), "trained on hard ground", preset="hard")
    assert entry.belongs_on("hard")
    assert not entry.belongs_on("paper")
    assert not replace(entry, slow=True).belongs_on("hard")
    assert all(policy_entry(name).belongs_on(preset) for name in OWN for preset in hda.PRESETS)
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
    hda.register_policy(entry)
    assert "mine" in choose_policies(("default",), "hard")[0]
    assert "mine" not in choose_policies(("default",), "paper")[0]
    assert choose_policies(("mine",), "paper")[0] == ("mine",)


def test_a_rival_flies_when_it_is_asked_for():
    rivals = choose_policies(("rivals",), "paper")[0]
    assert {"alhat", "reachability-steering", "adaptive-deferred-decision", "nearest-safe+apollo"} <= set(
        rivals
    )
    assert not set(rivals) & set(choose_policies(("default",), "paper")[0])
    assert set(rivals) <= set(choose_policies(("all",), "paper")[0])


def test_registries_know_nothing_of_one_another(policies):
    other = policies.copy()
    other.register(PolicyEntry("mine", lambda: nominal("mine"), "a policy of one's own"))
    assert other.names() == (*policies.names(), "mine")
    assert "mine" not in hda.policy_names()
    again = other.copy()
    assert again.names() == other.names()
    assert PolicyRegistry(lambda: ()).names() == ()


def test_a_registry_asks_for_its_first_entries_when_it_is_asked():
    asked = []

    def first():
        asked.append(True)
        return [PolicyEntry("mine", lambda: nominal("mine"), "a policy of one's own")]

    late = PolicyRegistry(first)
    assert not asked
    assert late.names() == late.copy().names() == ("mine",)
    assert len(asked) == 1
