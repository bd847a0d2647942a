"""One small study with its report, and a browser to look at it with."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from studies.compare.command import Comparison, compare
from tests.studies.compare.pages import EPISODES, POLICIES, open_browser


@pytest.fixture(scope="package")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report") / "study"
    compare(Comparison(episodes=EPISODES, policies=POLICIES, workers=1, out=out, figures=False))
    return out


@pytest.fixture(scope="package")
def page_address(study: Path) -> str:
    return (study / "report.html").as_uri()


@pytest.fixture
def browser() -> Iterator[Any]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        driver = open_browser(profile)
        yield driver
        driver.quit()
