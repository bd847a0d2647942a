"""The lower bounds of the dependencies: each has one, and the constraints made of them are exact."""

import tomllib
from itertools import chain

import pytest
from packaging.requirements import Requirement

from tests.minimum_versions import ROOT, minimum_versions

PROJECT = """
[project]
dependencies = ["numpy>=2.1", "torch>=2.8,<2.14", "pyright[nodejs] >= 1.1"]
optional-dependencies.geo = ["rasterio>=1.4"]
optional-dependencies.dev = ["ruff>=0.12"]
"""


def test_bounds_become_pins_and_tools_stay_free() -> None:
    assert minimum_versions(PROJECT) == ["numpy==2.1", "pyright==1.1", "rasterio==1.4", "torch==2.8"]


@pytest.mark.parametrize("requirement", ["numpy", "numpy<3", "numpy==2.1"])
def test_a_requirement_without_a_lower_bound_is_refused(requirement: str) -> None:
    with pytest.raises(ValueError, match="lower bound"):
        minimum_versions(PROJECT.replace("numpy>=2.1", requirement))


def test_the_least_versions_are_those_that_the_project_allows() -> None:
    """Of each library in one place only: an extra that repeats it asks for the same."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    pins = {pin.name: pin.specifier for pin in map(Requirement, minimum_versions(text))}
    assert len(pins) > 20
    project = tomllib.loads(text)["project"]
    for line in chain(project["dependencies"], *project["optional-dependencies"].values()):
        required = Requirement(line)
        if required.name in pins:
            (exact,) = pins[required.name]
            assert required.specifier.contains(exact.version), line
