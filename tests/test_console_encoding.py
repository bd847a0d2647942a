"""No console encoding fails a command: every command lets its streams stand in for what they lack."""

from __future__ import annotations

import ast
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from guidance.console import tolerate_encoding

ROOT = Path(__file__).parents[1]
ENCODINGS = ("ascii", "latin-1", "cp1252")
ODD = "results in r\u00e9sultats-\u65e5\u672c \u2026 \udcff \U0001f680"


def commands() -> list[Path]:
    """Every module of the packages that can be run."""
    files = [
        path for package in ("guidance", "hda", "rl", "studies") for path in (ROOT / package).rglob("*.py")
    ]
    return [path for path in sorted(files) if "\nif __name__ == " in path.read_text(encoding="utf-8")]


def run(command: list[str], encoding: str) -> subprocess.CompletedProcess[bytes]:
    env = {**os.environ, "PYTHONIOENCODING": encoding, "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, "-m", *command], capture_output=True, env=env, cwd=ROOT, timeout=300, check=False
    )


def test_every_command_begins_with_it():
    """`main`, or where there is none what the guard runs."""
    found = commands()
    assert len(found) > 15
    for path in found:
        home = path.with_name("command.py") if path.with_name("command.py") in path.parent.iterdir() else path
        tree = ast.parse((home if path.name == "__main__.py" else path).read_text(encoding="utf-8"))
        mains = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"]
        body = mains[0].body if mains else tree.body[-1].body  # type: ignore[attr-defined]
        text = "\n".join(ast.unparse(statement) for statement in body)
        said = text.index("tolerate_encoding()")
        assert said < min(text.find(word) % 10**6 for word in ("tyro.cli(", "Console(", "stdout.write"))


@pytest.mark.parametrize("encoding", [*ENCODINGS, "utf-8", "utf-16", "cp037"])
def test_every_character_can_be_written(encoding, monkeypatch):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding=encoding))
    tolerate_encoding()
    sys.stdout.write(ODD)
    sys.stdout.flush()
    text = raw.getvalue().decode(encoding)
    assert text.startswith("results in r")
    assert r"\udcff" in text
    if encoding == "ascii":
        assert text == r"results in r\xe9sultats-\u65e5\u672c ~ \udcff \U0001f680"


@pytest.mark.parametrize("handler", ["replace", "ignore", "xmlcharrefreplace"])
def test_a_handler_that_the_user_chose_stays(handler, monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors=handler))
    tolerate_encoding()
    assert sys.stdout.errors == handler


@pytest.mark.parametrize("stream", [None, io.StringIO()])
def test_streams_that_encode_nothing_are_left_alone(stream, monkeypatch):
    monkeypatch.setattr(sys, "stdout", stream)
    tolerate_encoding()
    assert sys.stdout is stream


@pytest.mark.parametrize(
    "encoding", ["ascii", *(pytest.param(e, marks=pytest.mark.slow) for e in ENCODINGS[1:])]
)
def test_commands_end_well_in_a_pipe_of_any_encoding(encoding, tmp_path):
    picture = tmp_path / "\u65e5\u672c.png"
    start = ["--state", "100", "0", "900", "0", "0", "-30", "1200"]
    for command, status in (
        (["studies.compare", "--help"], 0),
        (["studies.sample_size", "--out", str(tmp_path / "plan")], 0),
        (["rl.train", "--help"], 0),
        (["hda.terrain", "--help"], 0),
        (["guidance.pdg", *start, "--plot", str(picture)], 0),
        (["studies.compare", "--policies", "n\u00e9arest"], 2),
    ):
        done = run(command, encoding)
        assert done.returncode == status, done.stderr
        assert b"codec" not in done.stderr
    assert picture.exists()


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_comparison_ends_well_in_a_folder_of_any_name(encoding, tmp_path):
    """It ended with exit code 2 after all was written: a character that the console lacks."""
    out = tmp_path / "r\u00e9sultats-\u65e5\u672c"
    sized = ["--episodes", "2", "--workers", "1", "--no-figures", "--no-report", "--out", str(out)]
    done = run(["studies.compare", "--policies", "nearest-safe", "no-divert", *sized], encoding)
    assert done.returncode == 0, done.stderr
    assert (out / "table.csv").exists()
    text = done.stdout.decode(encoding)
    assert r"\u65e5\u672c" in text
