"""`python -m guidance.export_c`: it writes a folder that builds, checks itself, and is not overwritten."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from builds import compiler

from guidance.export_c.__main__ import main
from guidance.export_c.export import SOURCES, VECTORS, export_flight_code
from guidance.flight_code.reference import answer_question
from guidance.flight_code.vectors import draw_questions, write_table


def test_the_exported_folder_builds_and_agrees_with_its_vectors(tmp_path: Path) -> None:
    written = export_flight_code(tmp_path / "code")
    assert sorted(path.name for path in written) == sorted([*SOURCES, VECTORS])
    command = ["make", "check", f"CC={compiler()}"]
    done = subprocess.run(command, cwd=tmp_path / "code", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = (tmp_path / "code" / VECTORS).read_text().count("\n") - 1
    assert rows > 500
    assert f"{rows} of {rows} vectors agree" in done.stdout


def test_a_vector_that_is_wrong_is_found(tmp_path: Path) -> None:
    export_flight_code(tmp_path)
    header, first, *rest = (tmp_path / VECTORS).read_text().splitlines()
    names, cells = header.split(","), first.split(",")
    for name in ("status", "propellant", "time_of_flight", "lower_bound", "thrust_z"):
        spoilt = cells.copy()
        spoilt[names.index(name)] = repr(float(cells[names.index(name)]) * 1.0001 + 1.0)
        (tmp_path / VECTORS).write_text("\n".join([header, ",".join(spoilt), *rest, ""]))
        command = ["make", "check", f"CC={compiler()}"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode != 0
        assert "row 1 differs" in done.stderr
        assert f"{len(rest)} of {len(rest) + 1} vectors agree" in done.stdout


def test_files_that_are_there_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["--out", str(tmp_path)])
    assert "powered_descent.c" in capsys.readouterr().out
    mine = tmp_path / "Makefile"
    mine.write_text("mine")
    (tmp_path / VECTORS).unlink()
    with pytest.raises(SystemExit) as stopped:
        main(["--out", str(tmp_path)])
    assert stopped.value.code == 2
    assert "Makefile" in capsys.readouterr().err
    assert mine.read_text() == "mine"
    assert not (tmp_path / VECTORS).exists()
    main(["--out", str(tmp_path), "--overwrite"])
    assert mine.read_text() != "mine"
    assert (tmp_path / VECTORS).exists()


def test_a_folder_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as stopped:
        main(["--out", str(tmp_path / "file")])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.startswith("error: ")


def test_a_table_holds_every_digit() -> None:
    questions = draw_questions(20, np.random.default_rng(91))
    header, *rows = write_table(questions).splitlines()
    assert len(rows) == 20
    for question, row in zip(questions, rows, strict=True):
        cells = dict(zip(header.split(","), row.split(","), strict=True))
        answer = answer_question(question)
        assert [float(cells[name]) for name in ("x", "y", "z", "vx", "vy", "vz", "mass")] == [*question.state]
        assert int(cells["status"]) == answer.status
        np.testing.assert_equal(float(cells["lower_bound"]), answer.lower_bound)
        np.testing.assert_equal(float(cells["thrust_z"]), answer.first_thrust[2])
