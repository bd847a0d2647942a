"""The documentation site: docstrings parse, it builds with warnings as errors, it needs no network."""

import logging
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import griffe
import pytest

import guidance
import hda
import rl

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("guidance", "hda", "rl", "studies")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_docstring_parses(package: str, caplog: pytest.LogCaptureFixture) -> None:
    """The site's builder does not count the parser's warnings; here they are."""

    def parse(item: griffe.Object) -> int:
        if item.docstring is not None:
            item.docstring.parse("google")
        members = [member for member in item.members.values() if isinstance(member, griffe.Object)]
        return (item.docstring is not None) + sum(parse(member) for member in members)

    loaded = griffe.load(package, search_paths=[ROOT])
    assert isinstance(loaded, griffe.Object)
    with caplog.at_level(logging.WARNING):
        assert parse(loaded) > 30
    assert [record.getMessage() for record in caplog.records] == []


class Page(HTMLParser):
    """What a built page loads, links to and names."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.loads: list[str] = []
        self.links: list[str] = []
        self.names: set[str] = set()
        self.formulas = 0
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.names.add(values.get("id", ""))
        self.formulas += tag == "math"
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        elif tag == "link" and values.get("rel") not in ("canonical", "prev", "next"):
            self.loads.append(values["href"])
        elif "src" in values:
            self.loads.append(values["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built in strict mode from a copy of what it is made of."""
    folder = tmp_path_factory.mktemp("documentation")
    for name in ("docs", *PACKAGES):
        shutil.copytree(
            ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__", "*.safetensors")
        )
    for name in ("mkdocs.yml", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"):
        shutil.copy(ROOT / name, folder / name)
    # a proxy that nobody answers at: whatever asks the network fails
    closed = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean"]
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, **closed}, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "No issues found" in done.stdout + done.stderr
    return folder / "site"


@pytest.mark.slow
def test_pages_load_nothing_from_elsewhere_and_links_lead_somewhere(site: Path) -> None:
    pages = {path: Page(path) for path in site.rglob("*.html") if path.name != "404.html"}
    assert len(pages) == len(list((ROOT / "docs").rglob("*.md")))
    for path, page in pages.items():
        assert page.loads
        for address in page.loads:
            assert re.match(r"[a-z]+:|//", address) is None, f"{path.name} loads {address}"
            assert (path.parent / address.split("?")[0]).is_file(), f"{path.name} loads {address}"
        for address in page.links:
            file, _, name = address.partition("#")
            target = (path.parent / file).resolve() if file else path
            if re.match(r"[a-z]+:", address) is None and target in pages and name:
                assert name in pages[target].names, f"{path.name} links to {address}"


@pytest.mark.slow
def test_reference_holds_every_public_name(site: Path) -> None:
    for package in (guidance, hda, rl):
        names = Page(site / "reference" / f"{package.__name__}.html").names
        missing = [name for name in package.__all__ if f"{package.__name__}.{name}" not in names]
        assert missing == []
    private = [
        name for path in (site / "reference").glob("*.html") for name in Page(path).names if "._" in name
    ]
    assert private == []


@pytest.mark.slow
def test_every_formula_is_drawn(site: Path) -> None:
    """Each formula of the sources is a MathML element without a command that was not understood."""
    for source in (ROOT / "docs").rglob("*.md"):
        text = re.sub(r"^```.*?^```", "", source.read_text(), flags=re.DOTALL | re.MULTILINE)
        written = len(re.findall(r"\$\$.+?\$\$|\$[^$]+\$", text, re.DOTALL))
        built = (site / source.relative_to(ROOT / "docs")).with_suffix(".html")
        assert Page(built).formulas == written, source.name
        for formula in re.findall(r"<math.*?</math>", built.read_text(), re.DOTALL):
            assert re.search(r"\\|&#x0005C;|&amp;", formula) is None, f"{source.name}: {formula}"
