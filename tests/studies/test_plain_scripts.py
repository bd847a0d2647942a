"""Studies called from a script as it stands, without a guard around its calls."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.slow


def run_script(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    (folder / "script.py").write_text(text)
    return subprocess.run(
        [sys.executable, "script.py"],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        timeout=500,
    )


def test_a_ratio_can_be_asserted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LUNAR_HDA_CACHE", str(tmp_path / "cache"))  # its tiles are missing
    done = run_script(
        "from studies.testing import assert_safe_ratio\n"
        "import hda.ground.library\n"
        "hda.ground.library.SPLITS['validation'] = range(1000, 1002)\n"
        "print(assert_safe_ratio('single-divert', episodes=10, at_least=0.5).estimate)\n",
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[-1]) > 0.4


def test_a_comparison_says_what_the_script_must_do(tmp_path: Path) -> None:
    """Its workers import the script, since it may register policies; so they cannot do without the guard."""
    text = (
        "from pathlib import Path\n"
        "from studies.compare.command import Comparison, compare\n"
        "options = dict(episodes=20, figures=False, report=False)\n"
        "compare(Comparison(policies=('no-divert',), out=Path('out'), **options))\n"
    )
    done = run_script(text, tmp_path)
    assert done.returncode != 0
    assert "a script must call for a study under `if __name__" in done.stderr.splitlines()[-1]
    guarded = text.replace("compare(Comp", "if __name__ == '__main__':\n    compare(Comp")
    assert run_script(guarded.replace("'out'", "'guarded'"), tmp_path).returncode == 0
