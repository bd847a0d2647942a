"""Bounds on every policy: below every flight, tight where they are proved, and penalties of mean zero."""

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.image import imread

import guidance
from guidance.rigid_body.body import DEFAULT_BODY
from hda import registry
from hda.flight.episode import begin_flight, fly, observe
from hda.flight.episode_row import summarize_episode
from hda.policies.beliefs.belief import SafetyBelief
from hda.policies.privileged.oracle import safe_clearance
from hda.registry import make_policy
from hda.sensing.lidar import Lidar, look
from hda.task.presets import find_preset
from hda.task.rules import Range, StartConditions
from hda.task.scenario import sample_scenario
from studies.campaign.claimed_folder import FolderError
from studies.campaign.monte_carlo import Study
from studies.columns import write_csv
from studies.information_bound import Arrival, InformationBound, bound_cheapest, penalised_loss
from studies.information_bound import run_information_bound as run
from studies.information_bound.cheapest_landing import prove_cell
from studies.information_bound.command import main, plan_study
from studies.information_bound.picture import draw_steps
from studies.information_bound.recognition import (
    candidate_tiles,
    log_likelihoods,
    log_odds,
    target_share,
    weigh_tiles,
)
from studies.information_bound.restrictions import (
    FloorRow,
    bound_episode,
    bound_losses,
    lies_in_view,
    list_restrictions,
    safe_places,
)
from studies.information_bound.table import COLUMNS, StepRow, flown_losses, read_steps, tell_recognition
from studies.information_bound.told import tell_map, told_path, true_square
from studies.statistics.ratios import Interval

LANDER, GRAVITY = guidance.PAPER_LANDER, np.array(guidance.MOON_GRAVITY)
START = guidance.State(np.array([200.0, 100.0, 950.0]), np.array([-8.0, -4.0, -30.0]), 1200.0)
SMALL = InformationBound(episodes=3, looks=(0, 99), workers=1)


@pytest.fixture(autouse=True, scope="module")
def own_registry() -> Iterator[None]:
    """The study registers the policies that are told the map; other tests must not see them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
        yield


def spent(propellant: float) -> float:
    """[m/s] velocity change that a propellant [kg] is worth."""
    return -LANDER.exhaust_velocity * math.log1p(-propellant / START.mass)


@settings(max_examples=12, deadline=None)
@given(
    st.tuples(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)),
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    st.floats(0.0, 2.0),
    st.floats(0.0, 2.0),
    st.floats(0.0, 2.0 * math.pi),
)
def test_no_flight_undercuts_what_was_proved_of_another_cell(
    moved: tuple[float, float], beside: tuple[float, float], descent: float, drift: float, heading: float
) -> None:
    """Whatever the cell, the place in it and the soft speed: a planner's own flight is the witness."""
    arrival = Arrival(most_descent=2.0, most_drift=2.0, half_cell=0.5)
    proof = prove_cell(START, np.array([0.0, 0.0, 50.0]), LANDER, GRAVITY, arrival)
    velocity = (drift * math.cos(heading), drift * math.sin(heading), -descent)
    end = (moved[0] + beside[0], moved[1] + beside[1], 50.0)
    plan = guidance.solve_pdg(START, end, target_velocity=velocity)
    assert proof.at(np.array([moved]))[0] <= spent(plan.propellant) + 1e-6


@pytest.mark.parametrize("descent", [0.0, 2.0])
def test_a_bound_is_tight_where_it_is_proved(descent: float) -> None:
    site = np.array([0.0, 0.0, 50.0])
    arrival = Arrival(least_descent=descent, most_descent=descent)
    plan = guidance.solve_pdg(START, site, target_velocity=(0.0, 0.0, -descent))
    bound = prove_cell(START, site, LANDER, GRAVITY, arrival).at(site[None, :2])[0]
    assert 0.0 <= spent(plan.propellant) - bound < 0.02  # [m/s] of 68
    assert plan.certificate is not None
    assert plan.certificate.verified  # by code that shares nothing with the search, and says the same
    assert bound == pytest.approx(spent(plan.certificate.lower_bound), abs=0.02)


def test_the_cheapest_of_many_cells_is_as_good_as_the_least_of_all_plans() -> None:
    places = np.random.default_rng(5).uniform(-150.0, 150.0, (300, 2))
    targets = np.column_stack([places, np.full(300, 50.0)])
    plans = guidance.solve_pdg_many(START, targets)
    burnt = np.array([spent(each) for each in plans.propellant])
    bound = bound_cheapest(START, places, LANDER, GRAVITY, 50.0, Arrival())
    assert (bound <= burnt).all()
    assert bound.min() > burnt.min() - 0.03


def test_every_flight_lies_above_the_bounds_that_hold_for_it() -> None:
    study = plan_study(SMALL)
    names = ("oracle-fuel", "hazard-aware", "nearest-safe")
    _, resting, *_ = list_restrictions(study.preset)
    for episode in range(3):
        floors = bound_episode(study, episode).floors
        assert all(before <= after + 0.01 for before, after in pairwise(floors))
        scenario = sample_scenario("paper", 0, episode)
        flights = [fly(make_policy(name), scenario) for name in names]
        losses = flown_losses([summarize_episode(flight) for flight in flights])
        assert (losses >= floors[0]).all()
        for flight, loss in zip(flights, losses, strict=True):
            assert flight.outcome.success  # so that the loss is what it burnt
            east, north, up = flight.velocity[-1]
            ends = Arrival(-up, -up, math.hypot(east, north), resting.arrival.half_cell)
            assert loss >= bound_losses(scenario, replace(resting, arrival=ends)).least


def test_a_strong_or_weak_engine_flies_above_the_bounds_of_flights() -> None:
    """An engine that errs downward gives less than the least thrust of its specification, and burns less."""
    preset = find_preset("paper")
    lander = replace(preset.lander, min_thrust=3000.0)
    preset = replace(preset, lander=lander, rules=replace(preset.rules, thrust_error=0.3))
    scenario = sample_scenario(preset, 0, 1)
    _, resting, specified, *_ = list_restrictions(preset)
    weak = replace(lander, max_thrust=1.3 * lander.max_thrust, min_thrust=0.7 * 3000.0)
    assert resting.engine(lander) == weak
    assert specified.engine(lander) == lander
    bounded = bound_losses(scenario, resting)
    place = bounded.places[int(bounded.losses.argmin())]
    end = np.array([*place, scenario.nominal_target[2]])
    plan = guidance.solve_pdg(scenario.initial_state, end, lander=weak, gravity=preset.gravity)
    burnt = 100.0 * plan.propellant / (scenario.initial_state.mass - lander.dry_mass)
    assert bounded.least <= burnt < bounded.least + 0.1
    assert bound_losses(scenario, replace(resting, least_thrust=1.0)).least > burnt


def test_the_class_of_a_bound_says_which_cells_it_lands_on() -> None:
    scenario = sample_scenario("paper", 0, 1)
    tile = scenario.tile
    first, *_, clear = list_restrictions(scenario.preset)
    for each in (first, clear):
        places = safe_places(scenario, each)
        row, column = (np.floor(places[:, axis]).astype(int) for axis in (1, 0))
        assert len(places) == (tile.deterministic & (safe_clearance(tile) >= each.clearance)).sum()
        assert (safe_clearance(tile)[row, column] >= each.clearance).all()
        assert len(bound_losses(scenario, each).losses) == len(places)


def test_what_the_first_look_shows_is_what_is_read_in_it() -> None:
    """On ground that is safe everywhere the look reads 0 just where it does not see."""
    scenario = sample_scenario("paper", 0, 1)
    tile, lidar = scenario.tile, Lidar()
    position, target = scenario.initial_state.position, scenario.nominal_target
    silent = np.zeros((lidar.pixels, lidar.pixels), dtype=np.float32)
    seen = look(lidar, position, target, np.ones_like(tile.probability), silent) == 1.0
    offset = ((np.arange(lidar.pixels) + 0.5) / lidar.pixels - 0.5) * lidar.width(position, target)
    for i, j in product(range(0, lidar.pixels, 7), repeat=2):
        assert lies_in_view(scenario, target[:2] + np.array([offset[j], offset[i]])) == seen[i, j]
    assert not lies_in_view(scenario, target[:2] + np.array([0.51 * lidar.width(position, target), 0.0]))


def test_a_setting_on_real_ground_is_refused() -> None:
    with pytest.raises(ValueError, match=r"preset: flights must end on the target plane"):
        list_restrictions(find_preset("lidar"))


def test_a_rigid_body_is_refused() -> None:
    with pytest.raises(ValueError, match=r"preset: a point mass must fly; on 'paper' a rigid body does"):
        list_restrictions(replace(find_preset("paper"), body=DEFAULT_BODY))


def test_a_map_is_told_only_where_the_lander_knows_where_it_is() -> None:
    says = r"preset: the lander must know where it is on the map; on 'partial' it errs"
    with pytest.raises(ValueError, match=says):
        plan_study(replace(SMALL, preset="partial"))
    with pytest.raises(ValueError, match=says):
        tell_map(0).informed(sample_scenario("partial", 0, 0))
    navigated = replace(find_preset("paper"), navigation=find_preset("navigated").navigation)
    with pytest.raises(ValueError, match=r"preset: the lander must know where it is"):
        tell_map(0).informed(sample_scenario(navigated, 0, 0))


def joint_chances(tiles: np.ndarray, right: float) -> tuple[list[tuple[int, ...]], np.ndarray]:
    """All readings of the cells, and the chance of each with each of equally likely tiles, shape (m, k)."""
    readings = list(product(range(2), repeat=tiles.shape[1]))
    agree = tiles[:, None, :] == np.array(readings)[None]
    return readings, np.where(agree, right, 1.0 - right).prod(axis=2) / len(tiles)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.5, 0.99), st.floats(-1.0, 2.0))
def test_penalised_bounds_lie_below_the_optimum_and_meet_it_with_the_exact_value(
    seed: int, right: float, share: float
) -> None:
    """A library small enough that dynamic programming over all readings gives the optimum exactly."""
    rng = np.random.default_rng(seed)
    tiles, cost = rng.integers(0, 2, (4, 5)), rng.uniform(0.0, 1.0, 5)
    loss = cost + 3.0 * (1 - tiles)
    readings, joint = joint_chances(tiles, right)
    weights = joint / joint.sum(axis=0)
    optimum = sum(float((joint[:, k] @ loss).min()) for k in range(len(readings)))

    def bound(value: np.ndarray) -> float:
        return sum(
            joint[j, k] * penalised_loss(loss, weights[:, k], j, value)
            for j in range(len(tiles))
            for k in range(len(readings))
        )

    clairvoyant = bound(np.zeros_like(loss))
    assert clairvoyant == pytest.approx(float(loss.min(axis=1).mean()), abs=1e-12)
    assert clairvoyant <= optimum + 1e-12
    assert bound(loss) == pytest.approx(optimum, abs=1e-12)
    assert bound(share * loss + rng.normal(size=loss.shape)) <= optimum + 1e-12


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.5, 0.99))
def test_the_penalty_has_the_mean_zero_for_every_rule_that_goes_by_the_look(seed: int, right: float) -> None:
    rng = np.random.default_rng(seed)
    tiles, value = rng.integers(0, 2, (4, 5)), rng.normal(size=(4, 5))
    readings, joint = joint_chances(tiles, right)
    weights = joint / joint.sum(axis=0)
    likeliest = [int(np.argmin(weights[:, k] @ (1 - tiles))) for k in range(len(readings))]
    any_rule = rng.integers(0, 5, len(readings)).tolist()
    for rule in (likeliest, any_rule, [2] * len(readings)):
        peeks = [value[:, s] - weights[:, k] @ value[:, s] for k, s in enumerate(rule)]
        mean = sum(float(joint[:, k] @ peek) for k, peek in enumerate(peeks))
        assert mean == pytest.approx(0.0, abs=1e-12)


def test_the_likelihood_of_a_look_is_that_of_its_pixels_one_by_one() -> None:
    preset = find_preset("paper")
    preset = replace(preset, lidar=replace(preset.lidar, pixels=6, noise=0.4))
    scenario = sample_scenario(preset, 0, 3)
    seen = observe(scenario, begin_flight(scenario))
    position, target, width = seen.state.position, seen.target, seen.width
    known = candidate_tiles(scenario)
    likelihoods, centre = log_likelihoods(scenario, known), np.arange(1000) + 0.5
    about = np.hypot(centre[None, :] - target[0], centre[:, None] - target[1]) <= preset.start.hazard_radius
    admits = [1.0 - tile.deterministic[about].mean() >= preset.start.hazard_share for tile in known.tiles]
    assert any(admits)
    assert not all(admits)
    for k, tile in enumerate(known.tiles):
        if not admits[k]:
            assert likelihoods[k] == -math.inf
            continue
        total = math.log(known.density[k])
        for i, j in product(range(6), repeat=2):
            x, y = (target[k] + ((n + 0.5) / 6 - 0.5) * width for k, n in ((0, j), (1, i)))
            height = position[2] - target[2]
            across = math.hypot(x - position[0], y - position[1])
            if across > math.tan(preset.lidar.off_nadir_limit) * height:
                continue
            sigma = 0.4 * math.hypot(across, height) / 500.0
            true, read = float(tile.probability[int(y), int(x)]), float(seen.safety_map[i, j])
            if 0.0 < read < 1.0:
                total -= 0.5 * ((read - true) / sigma) ** 2 + math.log(sigma * math.sqrt(2.0 * math.pi))
            else:
                beyond = (true - 1.0) / sigma if read >= 1.0 else -true / sigma
                total += math.log(0.5 * math.erfc(-beyond / math.sqrt(2.0)))
        assert likelihoods[k] == pytest.approx(total, rel=1e-6)


def test_the_share_of_first_targets_is_that_of_the_area_and_does_not_lean_to_its_edges() -> None:
    """East of a straight border all is safe: a target's circle may reach beyond it by a fifth of its area."""
    tile = sample_scenario("paper", 0, 1).tile
    start = StartConditions(target_area=Range(250.0, 750.0), hazard_radius=100.0, hazard_share=0.8)
    depth = 0.49186  # of the radius: acos(d) - d sqrt(1 - d^2) = 0.2 pi
    assert math.acos(depth) - depth * math.sqrt(1.0 - depth**2) == pytest.approx(0.2 * math.pi, abs=2e-5)
    off = []
    for border in range(340, 360):  # two periods of the squares, near an edge
        safe = np.broadcast_to(np.arange(1000) >= border, (1000, 1000)).copy()
        exact = (border - 100.0 * depth - 250.0) / 500.0
        off.append(target_share(replace(tile, deterministic=safe), start) - exact)
    assert max(map(abs, off)) <= 0.5 * 10.0 / 500.0 + 0.002
    assert abs(np.mean(off)) < 0.002
    nothing = replace(tile, deterministic=np.ones((1000, 1000), dtype=np.bool_))
    assert target_share(nothing, start) == 1.0 / 50**2


def test_the_first_look_tells_the_tile_and_noise_hides_it() -> None:
    preset = find_preset("paper")
    blind = replace(preset, lidar=replace(preset.lidar, noise=1e6))
    for episode in range(3):
        for setting, least, most in ((preset, 100.0, math.inf), (blind, -4.0, 1.0)):
            scenario = sample_scenario(setting, 0, episode)
            known = candidate_tiles(scenario)
            likelihood = log_likelihoods(scenario, known)
            truth = [tile.number for tile in known.tiles].index(scenario.tile.number)
            assert least < log_odds(likelihood, truth) <= most
            assert weigh_tiles(likelihood).sum() == pytest.approx(1.0)


def test_told_at_no_look_is_hazard_aware_and_told_at_the_first_is_the_map() -> None:
    scenario = sample_scenario("paper", 0, 2)
    never, own = fly(tell_map(99), scenario), fly(make_policy("hazard-aware"), scenario)
    assert np.array_equal(never.outcome.touchdown, own.outcome.touchdown)
    told = fly(tell_map(0), scenario)
    assert told.outcome.success
    belief = SafetyBelief.blank(np.array([20.0, 990.0, 50.0]), 40)
    square, truth = true_square(scenario.tile, belief), scenario.tile.deterministic
    assert square[:, :20].sum() == 0.0
    assert square[50:].sum() == 0.0
    assert np.array_equal(square[:50, 20:] == 1.0, truth[950:, :60])


def test_a_path_that_says_no_look_leads_to_no_policy() -> None:
    import studies.information_bound.told as told

    assert told_path(2).endswith("told:look=2")
    for name in ("look=-1", "look=x", "sight=2", "look"):
        with pytest.raises(AttributeError):
            getattr(told, name)


def test_the_command_writes_the_steps_and_goes_on(tmp_path: Path) -> None:
    options = replace(SMALL, out=tmp_path / "bounded")
    lines = run(options)
    assert [line.proved for line in lines] == [True] * 6 + [False] * 4
    assert lines[-1].step == "hazard-aware"
    assert lines[-1].below.estimate == 0.0
    assert lines[0].below.estimate == pytest.approx(sum(line.rise.estimate for line in lines[1:]))
    assert (options.out / "information-bound.png").read_bytes().startswith(b"\x89PNG")
    table = (options.out / "table.csv").read_bytes()
    assert len(list(csv.DictReader(table.decode().splitlines()))) == len(lines)
    with pytest.raises(FolderError):
        run(options)
    run(replace(options, resume=True))
    assert (options.out / "table.csv").read_bytes() == table


def test_one_tile_is_refused_before_anything_is_flown_and_goes_without_a_picture(tmp_path: Path) -> None:
    one = replace(SMALL, episodes=1, looks=(99,), out=tmp_path / "bounded")
    message = r"episodes must lie on at least two tiles for the picture, got 1 on one: .*--no-figures"
    with pytest.raises(ValueError, match=message):
        run(one)
    assert not one.out.exists()
    lines = run(replace(one, figures=False))
    assert all(math.isinf(line.loss.high) for line in lines)
    assert (one.out / "table.csv").exists()


_NO = Interval(math.nan, math.nan, math.nan)
STEPS = [
    StepRow("every policy", True, Interval(48.0, 47.9, 48.1), _NO, Interval(6.0, 5.9, 6.1), math.nan),
    StepRow(
        "touchdown at rest",
        True,
        Interval(50.5, 50.3, 50.6),
        Interval(2.5, 2.4, 2.6),
        Interval(3.5, 3.4, 3.6),
        math.nan,
    ),
    StepRow(
        "oracle-fuel",
        False,
        Interval(53.0, 52.7, 53.2),
        Interval(2.5, 2.3, 2.7),
        Interval(1.0, 0.9, 1.1),
        0.0,
    ),
    StepRow(
        "hazard-aware",
        False,
        Interval(54.0, 53.8, 54.3),
        Interval(1.0, 0.9, 1.1),
        Interval(0.0, 0.0, 0.0),
        2.0,
    ),
]


def test_the_picture_shows_every_step_and_what_the_difference_consists_of() -> None:
    (axes,) = draw_steps(STEPS).axes
    labels = [tick.get_text() for tick in axes.get_yticklabels()]
    assert labels == ["every policy", "touchdown at rest", "oracle-fuel *", "hazard-aware", "in sum"]
    bars: list[Any] = [bar for held in axes.containers if isinstance(held, BarContainer) for bar in held]
    steps = sorted((bar.get_y() + 0.5 * bar.get_height(), bar.get_x(), bar.get_width()) for bar in bars)
    expected = [(k, STEPS[k - 1].loss.estimate, STEPS[k].rise.estimate) for k in (1, 2, 3)]
    expected += [(4, 48.0, 5.0), (4, 53.0, 1.0)]  # how it flies, and what it does not know
    np.testing.assert_allclose(steps, expected, atol=1e-9)
    points: dict[str, Any] = {
        str(held.get_label()).split(";")[0]: held
        for held in axes.containers
        if isinstance(held, ErrorbarContainer)
    }
    for label, proved in (("bound, proved", True), ("flown", False)):
        own = [line for line in STEPS if line.proved == proved]
        assert points[label].lines[0].get_xdata().tolist() == [line.loss.estimate for line in own]
        segments = np.array(points[label].lines[2][0].get_segments())
        np.testing.assert_allclose(segments[:, 0, 0], [line.loss.low for line in own])
        np.testing.assert_allclose(segments[:, 1, 0], [line.loss.high for line in own])
    assert {"+2.50", "+1.00", "how it flies: 5.00 points", "  what it does not know: 1.00"} == {
        text.get_text() for text in axes.texts
    }


def test_a_table_that_was_written_is_read_as_it_was(tmp_path: Path) -> None:
    write_csv(tmp_path / "table.csv", COLUMNS, STEPS)
    read = read_steps(tmp_path / "table.csv")
    assert [(line.step, line.proved) for line in read] == [(line.step, line.proved) for line in STEPS]
    for line, other in zip(read, STEPS, strict=True):
        for name in ("loss", "rise", "below"):
            ends = list(vars(getattr(other, name)).values())
            np.testing.assert_allclose(list(vars(getattr(line, name)).values()), ends, rtol=1e-8)
        np.testing.assert_equal(line.failures, other.failures)


@pytest.mark.parametrize(
    "text", ["", "policy,success\na,1\n", "step,kind\na,bound\n", "only bounds", "the wrong order"]
)
def test_another_table_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    lines = {"only bounds": STEPS[:2], "the wrong order": STEPS[::-1]}
    if text in lines:
        write_csv(path, COLUMNS, lines[text])
    else:
        path.write_text(text)
    with pytest.raises(ValueError, match="must hold the table of a finished run of this study"):
        read_steps(path)


@pytest.mark.parametrize(
    ("column", "value"), [("loss_percent", ""), ("loss_percent", "inf"), ("loss_high", "inf")]
)
def test_a_loss_that_is_not_finite_is_refused(column: str, value: str, tmp_path: Path) -> None:
    path = change_table(tmp_path, column, value)
    with pytest.raises(ValueError, match="must hold finite losses and intervals, over at least two tiles"):
        read_steps(path)


def test_an_unknown_kind_is_refused_and_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must hold the table of a finished run of this study") as caught:
        read_steps(change_table(tmp_path, "kind", "flow"))
    assert "unknown kind 'flow'; did you mean flown" in str(caught.value.__cause__)


def change_table(folder: Path, column: str, value: str) -> Path:
    """A table of a run, with one cell of its third line changed."""
    path = folder / "table.csv"
    write_csv(path, COLUMNS, STEPS)
    lines = list(csv.DictReader(path.read_text().splitlines()))
    lines[2][column] = value
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, lines[0].keys())
        writer.writeheader()
        writer.writerows(lines)
    return path


def test_the_command_redraws_a_finished_run_and_touches_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_csv(tmp_path / "table.csv", COLUMNS, STEPS)
    table = (tmp_path / "table.csv").read_bytes()
    monkeypatch.setattr("sys.argv", ["information_bound", "--redraw", "--out", str(tmp_path)])
    main()
    assert {path.name for path in tmp_path.iterdir()} == {"information-bound.png", "table.csv"}
    assert (tmp_path / "table.csv").read_bytes() == table
    drawn = io.BytesIO()
    draw_steps(STEPS).savefig(drawn, dpi=90)
    drawn.seek(0)
    assert np.array_equal(imread(tmp_path / "information-bound.png"), imread(drawn))


@pytest.mark.parametrize(
    ("words", "message"),
    [(["--no-figures"], "redraw must not stand beside --no-figures"), ([], "table.csv")],
)
def test_a_redraw_that_cannot_be_is_one_line(
    words: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.argv", ["information_bound", "--redraw", "--out", str(tmp_path), *words])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert message in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("penalised", "words"), [(51.0, "rises by 1 points"), (49.5, "falls by 0.5 points")])
def test_words_say_which_way_the_first_bound_moves(penalised: float, words: str) -> None:
    floors = [FloorRow(1, (50.0,), True, penalised, log_odds=9.0)]
    assert tell_recognition(floors).endswith(f"the first bound {words}")


@pytest.mark.parametrize("looks", [(2, 1), (1, 1), (-1,)])
def test_looks_that_do_not_rise_are_refused(looks: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"looks must be numbers of at least 0, rising"):
        InformationBound(looks=looks)


def test_a_study_flies_what_it_says() -> None:
    study = plan_study(SMALL)
    assert isinstance(study, Study)
    assert study.policies == ("oracle-fuel", "hazard-aware.told-0", "hazard-aware.told-99", "hazard-aware")
