"""The dual function: for any affine primer, a velocity change that no flight of one duration can undercut.

For every flight of T seconds to the target at the origin, and tau = T - t the time before the landing,

    int u = w - v_0 - g T,    int tau u = -(r_0 + v_0 T + g T^2/2),

so that for any p(tau) = a + b tau, with h(p) the greatest p.d over the directions d that the engine may take,

    J = int |u| = a.(w - v_0 - g T) - b.(r_0 + v_0 T + g T^2/2) - int (p.u - |u|)
     >= a.(w - v_0 - g T) - b.(r_0 + v_0 T + g T^2/2) - int (h - 1) |u|.

Multipliers mu of |u| <= f (1 + kappa B) and nu of |u| >= l (1 + B/c) bound the last integral by f M - l N,

    s = h(p) - 1 + f kappa M - (l/c) N,   mu = max(s, 0),   nu = max(-s, 0),   M' = mu,   N' = nu   in tau.

One pass in tau gives the bound D(T) for every T. h(p(tau)) is convex, so its chords lie above it, and D with
chords is still a bound: each pass here is one, on any grid.

Where every flight keeps n.r >= 0 at theta before its landing (altitude, glide slope), with

    r(T - theta) = r_0 + v_0 (T - theta) + g (T - theta)^2/2 + int_theta^T (tau - theta) u,

a multiplier of that adds to the primer c (tau - theta)_+ with c = n times it, and to D for T >= theta

    -c.(r_0 + v_0 (T - theta) + g (T - theta)^2/2).

Such a primer is (a, b, c, theta), of ten numbers; h(p(tau)) is convex on each side of theta.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_case import DualCase, ThrustBounds

AFFINE = 6
"""Numbers of a primer (a, b); one with a limit on the path has c and theta besides."""
THETA = 9
"""Place of theta in a primer."""


class Growth(NamedTuple):
    """Solutions of s' = c + k s over a step t: s e^{kt} + c first; its integral is s first + c second.

    Attributes:
        factor: e^{kt}.
        first: [s] (e^{kt} - 1)/k.
        second: [s^2] (first - t)/k.
    """

    factor: float
    first: float
    second: float


class StepGrowth(NamedTuple):
    """Growth over one whole step of a grid.

    Attributes:
        burning: where the thrust is full.
        coasting: where it is least.
    """

    burning: Growth
    coasting: Growth


class Arc(NamedTuple):
    """Part of a step on which the switching function s keeps its sign.

    Attributes:
        burning: whether s > 0, so that the thrust is full.
        duration: [s].
        growth: of s over it.
    """

    burning: bool
    duration: float
    growth: Growth


@compile_kernel
def grow(rate: float, time: float) -> Growth:
    """Growth at a rate [1/s] over a time [s]."""
    x = rate * time
    first = time * (1.0 + 0.5 * x) if abs(x) < 1e-8 else math.expm1(x) / rate
    if abs(x) < 1e-2:
        second = 0.5 * time * time * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0))))
    else:
        second = (first - time) / rate
    return Growth(math.exp(x), first, second)


@compile_kernel
def support(primer: Array, time: float, bounds: ThrustBounds, directions: Array, row: int) -> float:
    """h(p(tau)), the greatest p.d over the allowed directions d; writes the best into a row."""
    x, y, z = primer[0] + primer[3] * time, primer[1] + primer[4] * time, primer[2] + primer[5] * time
    if primer.size > AFFINE and time > primer[THETA]:
        late = time - primer[THETA]
        x, y, z = x + primer[6] * late, y + primer[7] * late, z + primer[8] * late
    across = math.sqrt(x * x + y * y)
    size = math.sqrt(across * across + z * z)
    if z >= size * bounds.cosine:
        scale = 1.0 / max(size, 1e-300)
        directions[row, 0], directions[row, 1], directions[row, 2] = x * scale, y * scale, z * scale
        return size
    if across > 0.0:
        directions[row, 0], directions[row, 1] = bounds.sine * x / across, bounds.sine * y / across
    else:
        directions[row, 0], directions[row, 1] = bounds.sine, 0.0
    directions[row, 2] = bounds.cosine
    return bounds.sine * across + bounds.cosine * z


@compile_kernel
def linear_part(primer: Array, time: float, case: DualCase) -> float:
    """[m/s] a.(w - v_0 - g T) - b.(r_0 + v_0 T + g T^2/2), and what a limit on the path adds."""
    total = 0.0
    if primer.size > AFFINE and time >= primer[THETA]:
        before = time - primer[THETA]
        for axis in range(3):
            speed = case.velocity[axis] + 0.5 * case.gravity[axis] * before
            total -= primer[6 + axis] * (case.position[axis] + speed * before)
    for axis in range(3):
        fall = case.gravity[axis] * time
        total += primer[axis] * (case.arrival[axis] - case.velocity[axis] - fall)
        total -= primer[3 + axis] * (case.position[axis] + (case.velocity[axis] + 0.5 * fall) * time)
    return total


@compile_kernel
def step_growth(step: float, bounds: ThrustBounds) -> StepGrowth:
    """Growth over a step [s]."""
    return StepGrowth(grow(bounds.full_growth, step), grow(bounds.least_growth, step))


@compile_kernel
def split_step(
    switching: float, slope: float, step: float, whole: StepGrowth, bounds: ThrustBounds
) -> tuple[Arc, Arc]:
    """Arcs of one step on which h has a constant slope; the second lasts 0 s where s keeps its sign.

    Args:
        switching: s at the beginning of the step.
        slope: [1/s] of h.
        step: [s].
        whole: growth over the step.
        bounds: on the thrust of the relaxed problem.
    """
    burning = switching > 0.0 or (switching == 0.0 and slope > 0.0)
    rate = bounds.full_growth if burning else bounds.least_growth
    growth = whole.burning if burning else whole.coasting
    end = switching * growth.factor + slope * growth.first
    if (end >= 0.0) == burning or end == 0.0:
        return Arc(burning, step, growth), Arc(not burning, 0.0, Growth(1.0, 0.0, 0.0))
    ratio = switching / slope
    until = -ratio if rate * abs(ratio) < 1e-9 else -math.log1p(rate * ratio) / rate
    until = min(max(until, 0.0), step)
    other = bounds.least_growth if burning else bounds.full_growth
    return Arc(burning, until, grow(rate, until)), Arc(not burning, step - until, grow(other, step - until))


@compile_kernel
def sweep_bound(primer: Array, times: Array, case: DualCase, lowest: Array) -> None:
    """Write the least bound within each cell of a grid of times of flight.

    Within a cell D'' <= -b.g + f max(-h', 0) + f f_kappa max(-s, 0): what D may sag below its ends.

    Args:
        primer: (a, b), shape (6,), or (a, b, c, theta), shape (10,); b and c in 1/s.
        times: [s] shape (n + 1,), rising from 0; theta is one of them, or beyond.
        case: the relaxed problem.
        lowest: [m/s] shape (n,), the answer.
    """
    directions, bounds = np.empty((1, 3)), case.thrust
    bend, kink = 0.0, 0.0
    for axis in range(3):
        bend -= primer[3 + axis] * case.gravity[axis]
        if primer.size > AFFINE:
            kink -= primer[6 + axis] * case.gravity[axis]
    here = support(primer, times[0], bounds, directions, 0)
    switching, spent, before = here - 1.0, 0.0, linear_part(primer, times[0], case)
    last = times[1] - times[0]
    whole = step_growth(last, bounds)
    for k in range(lowest.size):
        step = times[k + 1] - times[k]
        if abs(step - last) > 1e-12 * step:
            whole, last = step_growth(step, bounds), step
        there = support(primer, times[k + 1], bounds, directions, 0)
        slope = (there - here) / step
        least = switching
        for arc in split_step(switching, slope, step, whole, bounds):
            growth = arc.growth
            weight = bounds.full if arc.burning else bounds.least
            spent += weight * (switching * growth.first + slope * growth.second)
            switching = switching * growth.factor + slope * growth.first
        least = min(least, switching)
        after = linear_part(primer, times[k + 1], case) - spent
        if primer.size > AFFINE and times[k + 1] > primer[THETA]:
            bend, kink = bend + kink, 0.0
        sag = bend + bounds.full * max(-slope, 0.0) + bounds.full * bounds.full_growth * max(-least, 0.0)
        lowest[k] = min(before, after) - 0.125 * step * step * max(sag, 0.0)
        before, here = after, there
