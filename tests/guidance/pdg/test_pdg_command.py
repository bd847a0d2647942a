"""`python -m guidance.pdg` and the example, as a user runs them."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from guidance import Cone, Limits, solve_pdg, solve_pdg_6dof
from guidance.pdg.__main__ import main
from guidance.pdg.body_command import BodyOptions
from guidance.rigid_body import DEFAULT_BODY

STATE = ["--state", "200", "100", "950", "-8", "-4", "-30", "1200", "--target", "0", "0", "50"]
ROOT = Path(__file__).parents[3]


def test_prints_and_draws(capsys, tmp_path):
    picture = tmp_path / "plan.png"
    main([*STATE, "--plot", str(picture), "--pointing-limit-deg", "40", "--glide-slope-limit-deg", "30"])
    out = capsys.readouterr().out
    assert "optimal (convex)" in out
    assert "propellant" in out
    assert picture.stat().st_size > 10_000


def test_arrives_with_the_velocity_that_was_asked_for(capsys):
    fast, up = ([*STATE, "--target-velocity", "0", "0", vertical] for vertical in ("-12", "3"))
    main(fast)
    assert "optimal (convex)" in capsys.readouterr().out
    with pytest.raises(SystemExit) as caught:
        main(up)
    assert caught.value.code == 1
    assert "altitude" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "given"),
    [
        (
            ["--final-thrust-limit-deg", "1"],
            {"limits": Limits(final_thrust_direction=Cone(math.radians(1.0)))},
        ),
        (
            ["--line-of-sight-limit-deg", "1", "--line-of-sight-axis", "2", "1", "9"],
            {"limits": Limits(line_of_sight=Cone(math.radians(1.0), (2.0, 1.0, 9.0)))},
        ),
        (["--thrust-rate-limit", "2000"], {"limits": Limits(thrust_rate=2000.0)}),
        (["--angular-velocity", "0", "0.002", "0.001"], {"angular_velocity": (0.0, 0.002, 0.001)}),
        (["--landing-error-weight", "0.01"], {"landing_error_weight": 0.01}),
    ],
)
def test_every_further_request_reaches_the_planner(capsys, words, given):
    main([*STATE, *words])
    out = capsys.readouterr().out
    plan = solve_pdg([float(number) for number in STATE[1:8]], (0.0, 0.0, 50.0), **given)
    assert f"{plan.propellant:.3f} kg" in out
    assert f"{plan.status.value} ({plan.method})" in out
    assert plan.thrust.tobytes() != solve_pdg([*map(float, STATE[1:8])], (0.0, 0.0, 50.0)).thrust.tobytes()


def test_module_runs_and_explains_itself():
    done = subprocess.run(
        [sys.executable, "-m", "guidance.pdg", "--help"], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert "--glide-slope-limit-deg" in done.stdout
    assert "Greatest thrust [N]" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        ([*STATE[:7], "1160"], 1, "propellant"),
        ([*STATE[:7], "1100"], 2, "dry mass"),
        ([*STATE, "--nodes", "2"], 2, "nodes"),
        ([*STATE, "--plot", "plan.nonsense"], 2, "nonsense"),
    ],
)
def test_failures_are_told_and_set_the_exit_status(arguments, status, words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == status
    assert words in capsys.readouterr().err


def test_example_runs():
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "solve_pdg.py")],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
    )
    assert "free time" in done.stdout
    assert "nearest soft landing" in done.stdout


def test_a_body_that_must_turn_is_planned_and_drawn(capsys, tmp_path):
    picture = tmp_path / "body.png"
    main(
        [
            *STATE,
            "--six-dof",
            "--nodes",
            "31",
            "--body.torque-limit",
            "90",
            "90",
            "90",
            "--plot",
            str(picture),
        ]
    )
    out = capsys.readouterr().out
    body = replace(DEFAULT_BODY, torque_limit=(90.0, 90.0, 90.0))
    plan = solve_pdg_6dof([float(number) for number in STATE[1:8]], (0.0, 0.0, 50.0), body)
    assert "optimal (successive)" in out
    assert f"{plan.propellant:.3f} kg" in out
    assert f"relaxation gap  {plan.relaxation_gap:.3f} kg" in out
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--speed-limit", "30"], "speed_limit"),
        (["--method", "cvxpy"], "method"),
        (["--nodes", "4"], "nodes"),
    ],
)
def test_what_only_a_point_mass_takes_is_refused_with_a_body(words, named, capsys):
    with pytest.raises(SystemExit) as caught:
        main([*STATE, "--six-dof", *words])
    assert caught.value.code == 2
    assert named in capsys.readouterr().err


def test_the_body_of_the_command_is_the_default_one():
    assert BodyOptions().body_of(DEFAULT_BODY.lander, 1200.0) == DEFAULT_BODY


def test_options_of_a_body_are_refused_without_one(capsys):
    with pytest.raises(SystemExit) as caught:
        main([*STATE, "--body.engine-lag", "0.3"])
    assert caught.value.code == 2
    assert "give --six-dof too" in capsys.readouterr().err


def test_a_body_that_cannot_land_is_refused_with_its_proof(capsys):
    with pytest.raises(SystemExit) as caught:
        main([*STATE[:7], "1160", "--target", "0", "0", "50", "--six-dof"])
    assert caught.value.code == 1
    assert "proof" in capsys.readouterr().err
