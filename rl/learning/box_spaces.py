"""The spaces that the learners here can take, checked where an environment comes in."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

_BOUND_THEM = (
    "give actions bounds in your own units with gymnasium.wrappers.TransformAction(env, lambda a: scale * a,"
    " gymnasium.spaces.Box(-1.0, 1.0, env.action_space.shape)); where ClipAction made them infinite, leave it"
    " out: actions keep the bounds here"
)
_FLATTEN = "gymnasium.wrappers.FlattenObservation makes one box of any other space"


def check_environment(env: Any) -> None:
    """Refuse an environment whose spaces a learner with dense layers and tanh cannot take.

    Raises:
        ValueError: it is no single Gymnasium environment; an observation is not a one-dimensional Box; or the
            action space is refused by `check_action_space`.
    """
    if hasattr(env, "num_envs"):
        raise ValueError(f"env must be one environment, got a vector of {env.num_envs}")
    check_boxes(env)


def check_boxes(env: Any) -> None:
    """Refuse spaces that dense layers cannot take, of one environment or of those that a vector holds.

    Raises:
        ValueError: there are none; an observation is not a one-dimensional Box; or the action space is
            refused by `check_action_space`.
    """
    for name in ("observation_space", "action_space"):
        if not isinstance(getattr(env, name, None), spaces.Space):
            raise ValueError(f"env must be a Gymnasium environment, got {env!r} without {name}")
    _check_box("observation_space", env.observation_space, _FLATTEN)
    check_action_space(env.action_space)


def check_action_space(space: spaces.Space[Any]) -> None:
    """Refuse actions that tanh cannot be scaled to.

    Raises:
        ValueError: the space is not a one-dimensional Box of real numbers with a finite width above zero.
    """
    box = _check_box("action_space", space, "this learner's actions are real numbers")
    if box.dtype.kind != "f":
        raise ValueError(f"action_space must hold real numbers, got {box}: its elements are {box.dtype}")
    with np.errstate(over="ignore", invalid="ignore"):
        width = box.high - box.low  # overflows where the bounds stand for infinity
    if not np.isfinite(width).all():
        raise ValueError(f"action_space must have finite bounds, got {box}: {_BOUND_THEM}")
    if (width <= 0.0).any():
        still = np.flatnonzero(width <= 0.0).tolist()
        raise ValueError(
            f"action_space must leave every element room, got {box}: low is not below high at {still};"
            " gymnasium.wrappers.TransformAction can add what is fixed to a smaller action"
        )


def _check_box(name: str, space: spaces.Space[Any], way_out: str) -> spaces.Box:
    if not isinstance(space, spaces.Box) or len(space.shape) != 1 or space.shape[0] == 0:
        raise ValueError(f"env must have a one-dimensional Box as {name}, got {space}: {way_out}")
    return space
