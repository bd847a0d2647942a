"""The house: each wing says what lives in it, exports what it says, and stays small enough to be known."""

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("guidance", "hda", "rl", "studies")
WINGS = sorted(path.parent for package in PACKAGES for path in (ROOT / package).rglob("__init__.py"))
NAMES = [str(wing.relative_to(ROOT)).replace("/", ".") for wing in WINGS]
MOST_MODULES = 14
MOST_LINES = 300


@pytest.mark.parametrize("name", NAMES)
def test_a_wing_says_what_lives_in_it_and_exports_it(name):
    wing = importlib.import_module(name)
    assert len((wing.__doc__ or "").splitlines()) > 2
    if name == "studies":  # commands, not names
        return
    assert dir(wing) == sorted(wing.__all__)
    for public in wing.__all__:
        assert getattr(wing, public) is not None


@pytest.mark.parametrize("wing", WINGS, ids=NAMES)
def test_a_wing_is_small_enough_to_be_known(wing):
    modules = [path for path in wing.glob("*.py") if path.name != "__init__.py"]
    assert len(modules) <= MOST_MODULES
    long = {path.name: lines for path in modules if (lines := path.read_text().count("\n")) > MOST_LINES}
    assert not long
