"""Common random numbers against numpy's own spawning."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.task.random_streams import EpisodeStreams

SEEDS = st.integers(0, 2**32 - 1)
EPISODES = st.integers(0, 100_000)
SCENARIO, SENSOR, ACTUATOR, POLICY, NAVIGATION = range(5)


def spawned(study_seed: int, episode: int, stream: int, *child: int) -> np.random.Generator:
    """The generator of a stream, made by spawning alone."""
    sequence = np.random.SeedSequence([study_seed, episode]).spawn(5)[stream]
    for k in child:
        sequence = sequence.spawn(k + 1)[k]
    return np.random.default_rng(sequence)


@settings(max_examples=30)
@given(seed=SEEDS, episode=EPISODES, k=st.integers(0, 25))
def test_streams_are_the_spawned_children_of_seed_and_episode(seed, episode, k):
    streams = EpisodeStreams(seed, episode)
    assert streams.scenario().random(5).tolist() == spawned(seed, episode, SCENARIO).random(5).tolist()
    assert streams.policy().random(5).tolist() == spawned(seed, episode, POLICY).random(5).tolist()
    noise = spawned(seed, episode, SENSOR, k).standard_normal((64, 64), dtype=np.float32)
    np.testing.assert_array_equal(streams.look(k, 64), noise)
    error = spawned(seed, episode, ACTUATOR, k).uniform(-0.05, 0.05)
    assert streams.thrust_error(k, 0.05) == error
    navigation = spawned(seed, episode, NAVIGATION)
    assert streams.navigation().standard_normal(16).tolist() == navigation.standard_normal(16).tolist()
    readings = spawned(seed, episode, NAVIGATION, k)
    assert streams.readings(k, 10).normal.tolist() == readings.standard_normal((10, 16)).tolist()
    fix = spawned(seed, episode, NAVIGATION, k, 0)
    assert streams.site_fix(k).normal.tolist() == fix.standard_normal(3).tolist()


def test_millions_of_values_of_looks_are_numpys_to_the_bit():
    """The ziggurat's tail is drawn once in 4000: these looks hold hundreds."""
    tail = 0
    for seed in (0, 1, 2**31, 2**32 - 1, 2**32, 2**70 + 3):
        for episode in range(0, 70, 7):
            streams = EpisodeStreams(seed, episode)
            for k in range(7):
                expected = streams._generator(SENSOR, k).standard_normal((64, 64), dtype=np.float32)
                noise = streams.look(k, 64)
                assert noise.tobytes() == expected.tobytes()
                tail += int((np.abs(noise) > 3.6541528).sum())
    assert tail > 300


def test_compiled_uniform_numbers_are_numpys_to_the_bit():
    differing = 0
    for seed in (0, 7, 2**32 - 1, 2**40, 2**70):
        for episode in range(400):
            streams = EpisodeStreams(seed, episode)
            error = streams._generator(ACTUATOR, episode % 20).uniform(-0.05, 0.05)
            missing = streams._generator(SENSOR, episode % 20, 1).random()
            differing += streams.thrust_error(episode % 20, 0.05) != error
            differing += streams.map_is_missing(episode % 20, missing)  # not below itself
            differing += not streams.map_is_missing(episode % 20, np.nextafter(missing, 1.0))
    assert differing == 0


def test_a_look_is_kept_for_the_next_policy_and_nobody_can_change_it():
    noise = EpisodeStreams(3, 7).look(2, 16)
    assert EpisodeStreams(3, 7).look(2, 16) is noise
    assert not noise.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        noise[0, 0] = 0.0


@given(order=st.permutations(range(6)))
@settings(max_examples=20)
def test_a_look_does_not_depend_on_the_looks_before(order):
    alone = [EpisodeStreams(3, 7).look(k, 8) for k in range(6)]
    streams = EpisodeStreams(3, 7)
    for k in order:
        streams.policy().random(k)
        streams.thrust_error(k, 0.05)
        np.testing.assert_array_equal(streams.look(k, 8), alone[k])


def test_every_stream_and_every_child_is_different():
    firsts = []
    for seed in range(3):
        for episode in range(3):
            streams = EpisodeStreams(seed, episode)
            firsts += [streams.scenario().uniform(-1, 1), streams.policy().uniform(-1, 1)]
            firsts += [streams.thrust_error(k, 1.0) for k in range(20)]
            firsts += [spawned(seed, episode, SENSOR, k).uniform(-1, 1) for k in range(20)]
            firsts += [float(streams.navigation().standard_normal())]
            firsts += [float(streams.readings(k, 1).normal[0, 0]) for k in range(20)]
            firsts += [float(streams.site_fix(k).normal[0]) for k in range(20)]
            looks = [streams.look(k, 2).tobytes() for k in range(20)]
            assert len(set(looks)) == 20
    assert len(set(firsts)) == len(firsts)


@given(bound=st.floats(0.0, 0.9), k=st.integers(0, 20))
def test_thrust_errors_keep_their_bound_and_scale_with_it(bound, k):
    streams = EpisodeStreams(0, 1)
    error = streams.thrust_error(k, bound)
    assert abs(error) <= bound
    assert error == pytest.approx(bound * streams.thrust_error(k, 1.0), rel=1e-9, abs=1e-15)


def test_numpy_integers_count_as_whole_numbers():
    plain = EpisodeStreams(4, 5).scenario().random()
    assert EpisodeStreams(np.int64(4), np.uint8(5)).scenario().random() == plain  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("bad", [-1, 1.0, 0.5, "3", None, True, np.float64(2.0), float("nan")])
@pytest.mark.parametrize("name", ["study_seed", "episode"])
def test_a_bad_seed_is_named(name, bad):
    arguments = {"study_seed": 0, "episode": 0, name: bad}
    with pytest.raises(ValueError, match=f"^{name} must be a whole number"):
        EpisodeStreams(**arguments)


def test_an_episode_that_is_no_word_is_refused():
    with pytest.raises(ValueError, match="episode must be below"):
        EpisodeStreams(0, 2**32 + 1)


def test_no_seed_of_any_size_shares_streams_with_another():
    """Those whose words run into one another where they are only laid side by side, among others."""
    seeds = [
        0,
        1,
        2,
        5,
        2**32 - 1,
        2**32,
        2**32 + 5,
        2**33,
        2 * 2**32 + 5,
        2**40,
        2**63,
        2**64,
        2**64 + 5,
        2**96,
    ]
    seeds += [2**128 + 1, 5 + 2**32 * (1 + 2**32), 5 + 2**64, 1 + 2**32 * 2**32, 2**200 + 17]
    pairs = {(seed, episode) for seed in seeds for episode in (0, 1, 2, 5, 256, 2**32 - 1)}
    draws = {}
    for seed, episode in sorted(pairs):
        streams = EpisodeStreams(seed, episode)
        firsts = [streams.scenario().random(), streams.policy().random()]
        firsts += [streams.thrust_error(k, 0.9) for k in (0, 1, 256)]
        firsts += [float(streams.look(k, 1)[0, 0]) for k in (0, 1, 2)]
        for first in firsts:
            assert draws.setdefault(first, (seed, episode)) == (seed, episode)
    assert len(draws) == 8 * len(pairs)


@given(seed=st.integers(2**32, 2**130), episode=EPISODES)
def test_a_large_seed_is_its_low_word_the_episode_and_the_counted_rest(seed, episode):
    rest = [int(word, 16) for word in _words(seed)[1:]]
    entropy = [seed & 0xFFFFFFFF, episode, len(rest), *rest]
    expected = np.random.default_rng(np.random.SeedSequence(entropy).spawn(4)[SCENARIO])
    assert EpisodeStreams(seed, episode).scenario().random() == expected.random()


def _words(number: int) -> list[str]:
    """Words of 32 bits in hexadecimal, the lowest first."""
    digits = f"{number:x}"
    digits = digits.zfill(-(-len(digits) // 8) * 8)
    return [digits[k : k + 8] for k in range(0, len(digits), 8)][::-1]


@given(seed=st.integers(0, 2**70), episode=EPISODES, branch=st.integers(1, 2**32 - 1), k=st.integers(0, 20))
def test_a_branch_draws_its_own_looks_and_shares_what_is_the_episodes(seed, episode, branch, k):
    own, other = EpisodeStreams(seed, episode), EpisodeStreams(seed, episode, branch)
    rest = [int(word, 16) for word in _words(seed)[1:]] if seed >= 2**32 else []
    entropy = [seed & 0xFFFFFFFF, episode, 2**31 + len(rest), branch, *rest]
    child = np.random.SeedSequence(entropy).spawn(3)[ACTUATOR].spawn(k + 1)[k]
    assert other.thrust_error(k, 0.05) == np.random.default_rng(child).uniform(-0.05, 0.05)
    assert other.thrust_error(k, 0.05) != own.thrust_error(k, 0.05)
    assert other.look(k, 4).tobytes() != own.look(k, 4).tobytes()
    for name in ("scenario", "policy", "navigation", "roulette"):
        assert getattr(other, name)().random() == getattr(own, name)().random()
    error = own.navigation_error(1.0, 1.0)
    assert other.navigation_error(1.0, 1.0).tobytes() == error.tobytes()


def test_a_branch_that_is_no_word_is_refused():
    with pytest.raises(ValueError, match="branch must be below"):
        EpisodeStreams(0, 0, 2**32)
    with pytest.raises(ValueError, match="branch must be a whole number"):
        EpisodeStreams(0, 0, -1)
