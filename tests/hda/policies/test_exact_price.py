"""Sites are priced by a formula: what that costs against the exact propellant of every site."""

import numpy as np

import guidance
from guidance.two_impulse import divert_cost
from hda.flight.episode import begin_flight, observe
from hda.policies.privileged.oracle import safe_clearance
from hda.task.scenario import sample_scenario

CHEAPEST = 2000


def test_the_site_that_the_formula_prefers_is_the_cheapest_within_a_gram() -> None:
    """Over the cheapest clear cells of ten tuning episodes, each priced by a certified flight."""
    regrets, errors = [], []
    for episode in range(10):
        scenario = sample_scenario("paper", 0, episode, "tuning")
        view, look = scenario.view, observe(scenario, begin_flight(scenario))
        size, plane = scenario.tile.deterministic.shape[0], float(look.target[2])
        axis = np.arange(size) + 0.5
        estimate = divert_cost(look.state, axis, axis, plane, view.lander, view.gravity)
        clear = safe_clearance(scenario.tile) >= 2.0
        cells = np.argsort(np.where(clear, estimate, np.inf), axis=None, kind="stable")[:CHEAPEST]
        rows, columns = np.divmod(cells, size)
        sites = np.column_stack([columns + 0.5, rows + 0.5, np.full(CHEAPEST, plane)])
        exact = guidance.solve_pdg_many(look.state, sites, lander=view.lander, gravity=view.gravity)
        assert (exact.status == exact.status[0]).all()
        regrets.append(exact.propellant[0] - exact.propellant.min())
        errors.append(exact.propellant - estimate[rows, columns])
    assert max(regrets) < 1e-3
    assert np.ptp(np.concatenate(errors)) < 0.5  # kg: nearly the same everywhere, so that choices hold
