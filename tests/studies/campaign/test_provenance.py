"""A provenance names the software; what no row depends on does not decide whether a study goes on."""

from importlib import metadata

import pytest

from studies.campaign.provenance import describe_run, identify_software
from studies.campaign.run_options import KeepingOptions


def test_training_libraries_are_named_where_they_are_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    identity = identify_software()
    named = describe_run(KeepingOptions())["training_versions"]
    assert named["torch"] == metadata.version("torch")
    assert named["stable-baselines3"] == metadata.version("stable-baselines3")
    version = metadata.version

    def without_torch(name: str) -> str:
        if name == "torch":
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(metadata, "version", without_torch)
    assert set(describe_run(KeepingOptions())["training_versions"]) == {"sb3-contrib", "stable-baselines3"}
    assert identify_software() == identity
