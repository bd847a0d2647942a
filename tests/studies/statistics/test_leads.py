"""Which of two ratios over the same episodes is the greater, and means clustered by tile."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.statistics.moments import collect_moments, mean_intervals, tiled_mean
from studies.statistics.paired import decide_leads, holm_adjust
from studies.statistics.ratios import mcnemar_p_value

TILES = 6
_OUTCOMES = st.lists(st.tuples(*3 * (st.booleans(),)), min_size=TILES, max_size=80)


@given(_OUTCOMES)
def test_a_lead_turns_round_with_its_pair(outcomes: list[tuple[bool, ...]]) -> None:
    a, b, c = np.array(outcomes).T
    tile = np.arange(len(outcomes)) % TILES
    forth, back = decide_leads([(a, b), (c, b)], tile), decide_leads([(b, a), (b, c)], tile)
    assert [lead.sign for lead in forth] == [-lead.sign for lead in back]
    adjusted = holm_adjust([mcnemar_p_value(a, b), mcnemar_p_value(c, b)])
    np.testing.assert_allclose([lead.holm_p for lead in forth], adjusted)
    for lead, (first, second) in zip(forth, ((a, b), (c, b)), strict=True):
        assert lead.sign == 0 or lead.sign == np.sign(first.mean() - second.mean())
        assert lead.sign == 0 or lead.holm_p < 0.05


def test_one_tile_decides_nothing() -> None:
    """However many episodes differ, nothing shows how another tile would."""
    first, second = np.ones(200, dtype=bool), np.zeros(200, dtype=bool)
    second[0] = True  # else all differ alike
    (lead,) = decide_leads([(first, second)], np.zeros(200, dtype=int))
    assert lead.holm_p < 1e-4
    assert lead.sign == 0


def test_a_great_lead_over_many_tiles_is_decided() -> None:
    tile = np.arange(200) % 20
    (lead,) = decide_leads([(np.ones(200, dtype=bool), tile % 3 > 0)], tile)
    assert lead.sign == 1


def test_nothing_to_compare_gives_no_lead() -> None:
    assert decide_leads([], np.zeros(3)) == []


@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=40))
def test_a_mean_by_tile_has_ends_where_episodes_differ(values: list[float]) -> None:
    tile = np.arange(len(values)) % 5
    mean = tiled_mean(values, tile)
    if len(set(values)) == 1:
        assert mean.estimate == values[0]
        assert math.isnan(mean.low)
        assert math.isnan(mean.high)
    else:
        assert mean == mean_intervals(collect_moments(values, tile), 0)[1]
        assert mean.estimate == pytest.approx(np.mean(values), abs=1e-12)
