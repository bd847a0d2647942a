from __future__ import annotations

import sys
import time

import pytest
import torch

from rl.training_speed import (
    TrainingSpeed,
    UpdateRate,
    count_products,
    main,
    measure_memory_speed,
    measure_products,
    measure_training_speed,
    time_work,
)


def test_training_is_measured_beside_plain_sb3():
    speeds = measure_training_speed(TrainingSpeed(rounds=1, updates=2, batch_size=8))
    assert set(speeds) == {"stable-baselines3", "float32", "bfloat16"}
    for rate in speeds.values():
        assert min(rate.processor, rate.wall) > 0.0


def test_a_gpu_multiplies_in_tf32_and_is_timed_by_the_wall_clock():
    assert TrainingSpeed(device="cuda").precisions == {"float32": "highest", "TF32": "medium"}
    rate = UpdateRate(processor=2.0, wall=3.0)
    assert (rate.on("cpu"), rate.on("cuda")) == (2.0, 3.0)


def test_what_a_gpu_still_computes_is_timed_too(monkeypatch):
    def finish_queue():
        time.sleep(queued.pop())

    queued = [0.05, 0.0]  # before the work nothing waits, behind it 50 ms
    monkeypatch.setattr(torch.cuda, "synchronize", finish_queue)
    processor, wall = time_work(lambda: None, "cuda")
    assert wall >= 0.05 > processor
    assert not queued


@pytest.mark.parametrize(
    ("seen", "words", "message"),
    [
        (False, ["--device", "cuda"], "error: device cuda: torch sees no GPU here"),
        (True, ["--device", "cuda", "--profile"], "error: device must be cpu with --profile, got cuda"),
    ],
)
def test_a_device_that_cannot_be_measured_is_one_line(seen, words, message, monkeypatch, capsys):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: seen)
    monkeypatch.setattr(sys, "argv", ["training_speed", *words])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith(message)
    assert error.count("\n") == 1


def test_the_speed_of_agents_with_memory_is_measured_in_both_precisions():
    options = TrainingSpeed(rounds=1, updates=2, sequences=4, length=3, memory=8)
    speeds = measure_memory_speed(options)
    names = [f"{name} {kind}" for name in ("td3-lstm", "td3-lstm-plus") for kind in ("float32", "bfloat16")]
    assert list(speeds) == names
    for rate in speeds.values():
        assert rate.processor > 0.0
        assert 0.0 < rate.wall <= 1.05 * rate.processor  # one thread: the wall clock runs no slower


def test_the_products_of_an_update_are_those_of_its_networks():
    n, length, m, head, seen, action = 4, 3, 8, 256, 44, 5
    options = TrainingSpeed(sequences=n, length=length, memory=m)
    rows, one_more = length * n, (length + 1) * n
    driving, recurrent = (seen + action) * 4 * m, 4 * m * m
    lstm = driving + recurrent
    present = {"actor": seen * m, "critic": (seen + action) * m}
    joined = {"actor": 2 * m * head + head * action, "critic": 2 * m * head + head}
    learnt_lstm = 2 * rows * lstm + (rows - n) * recurrent  # there and back, but for the zeros before
    target = 3 * one_more * lstm + one_more * (present["actor"] + joined["actor"])
    target += 2 * rows * (present["critic"] + joined["critic"])
    critics = 2 * (learnt_lstm + rows * (2 * present["critic"] + 3 * joined["critic"]))
    actor = learnt_lstm + rows * (2 * present["actor"] + 3 * joined["actor"])
    actor += rows * lstm + 2 * rows * (present["critic"] + joined["critic"])  # the critic shows the way
    assert count_products("td3-lstm", options) == 2 * (target + critics + actor / 2)
    assert measure_products(128, 3) > 1e8
