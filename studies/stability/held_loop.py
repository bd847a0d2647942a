"""The ZEM/ZEV loop with its time to go held constant: margins in closed form and by python-control.

Per axis, with e = r - r_f, the law a = K_R/t_go^2 ZEM - K_V/t_go ZEV for a landing at rest is

    a = -(K_R/t_go^2) e - ((K_R - K_V)/t_go) e' - (K_R/2 - K_V) g,

so that the loop broken at the thrust of a double integrator is

    L(s) = ((K_R - K_V)/t_go s + K_R/t_go^2) / s^2.

With x = crossover * t_go and D = K_R - K_V: x^4 = D^2 x^2 + K_R^2, phase margin atan(D x / K_R), the same at
every time to go; the delay margin, their quotient, shrinks with the time to go. The gain margin is infinite.

Thrust held over a period h makes it a sampled loop. With z = (1 + jw)/(1 - jw), p = K_R h^2/t_go^2 and
q = 2 D h/t_go it is L = (1 - jw)(p + jqw)/(-4 w^2): phase margin atan(q w/p) - atan(w) where |L| = 1, and
gain margin 4/q (at half the sampling rate). It is stable if q < 4 and p < q.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.validation import finite_number

_FREQUENCIES = 600
_EDGE = 1e-13  # relative width to which a threshold is found


@dataclass(frozen=True)
class Gains:
    """Gains of the law; the loop needs K_R > K_V > 0.

    Attributes:
        position: K_R.
        velocity: K_V.

    Raises:
        ValueError: the loop has no damping, or a gain is not positive.
    """

    position: float
    velocity: float

    def __post_init__(self) -> None:
        """Refuse a loop without damping."""
        finite_number("velocity gain", self.velocity, above=0.0)
        finite_number("position gain", self.position, above=self.velocity)

    @property
    def damping(self) -> float:
        """K_R - K_V: feedback of velocity times the time to go."""
        return self.position - self.velocity


@dataclass(frozen=True)
class LoopMargins:
    """What a loop bears before it turns unstable.

    Attributes:
        crossover: [rad/s] where the loop gain is one; nan where it never is.
        phase_margin: [rad] extra lag at the crossover; nan without one.
        gain_margin: factor on the loop gain, upward.
    """

    crossover: float
    phase_margin: float
    gain_margin: float

    @property
    def delay_margin(self) -> float:
        """[s] extra delay; zero if the loop has no phase to lose."""
        return max(0.0, self.phase_margin) / self.crossover

    def meet(self, phase_margin: float, gain_margin: float) -> bool:
        """Whether both margins are at least these, [rad] and a factor."""
        return bool(self.phase_margin >= phase_margin and self.gain_margin >= gain_margin)


def closed_margins(gains: Gains, time_to_go: float) -> LoopMargins:
    """Margins of the continuous loop at a time to go [s], in closed form.

    Raises:
        ValueError: the time to go is not positive.
    """
    finite_number("time_to_go", time_to_go, above=0.0)
    square = gains.damping**2
    x = math.sqrt(0.5 * (square + math.sqrt(square**2 + 4.0 * gains.position**2)))
    return LoopMargins(x / time_to_go, math.atan(gains.damping * x / gains.position), math.inf)


def sampled_margins(gains: Gains, time_to_go: float, period: float) -> LoopMargins:
    """Margins of the loop whose thrust is held over each period [s], in closed form.

    The phase margin is not positive, or nan, exactly where the loop is unstable by its phase; the gain margin
    is below one where it is unstable by its gain.

    Raises:
        ValueError: the time to go or the period is not positive.
    """
    finite_number("time_to_go", time_to_go, above=0.0)
    finite_number("period", period, above=0.0)
    p = gains.position * (period / time_to_go) ** 2
    q = 2.0 * gains.damping * period / time_to_go
    if q >= 4.0:  # |L| stays above one up to half the sampling rate
        return LoopMargins(math.nan, math.nan, 4.0 / q)
    half = 0.5 * (p * p + q * q)
    room = 16.0 - q * q
    w = math.sqrt((half + math.sqrt(half * half + room * p * p)) / room)
    return LoopMargins(2.0 * math.atan(w) / period, math.atan(q * w / p) - math.atan(w), 4.0 / q)


def least_safe_time(gains: Gains, period: float, phase_margin: float, gain_margin: float) -> float:
    """[s] time to go above which the sampled loop keeps both margins ([rad], factor); both grow with it.

    Raises:
        ValueError: the continuous loop itself lacks the phase margin.
    """
    from scipy.optimize import root_scalar

    if closed_margins(gains, 1.0).phase_margin <= phase_margin:
        raise ValueError(
            f"phase_margin {math.degrees(phase_margin):g} deg is more than the gains "
            f"{gains.position:g}/{gains.velocity:g} have at any time to go"
        )

    def spare(time: float) -> float:
        """Above zero where both margins are kept."""
        return 1.0 if sampled_margins(gains, time, period).meet(phase_margin, gain_margin) else -1.0

    low = high = period
    while spare(high) < 0.0:
        low, high = high, 2.0 * high
    while spare(low) > 0.0:
        low *= 0.5
    edge = root_scalar(spare, bracket=(low, high), method="bisect", xtol=1e-15 * high, rtol=_EDGE).root
    return float(edge) * (1.0 + 2.0 * _EDGE)  # on the side that keeps them


def stable_above(gains: Gains, period: float) -> float:
    """[s] time to go above which the sampled loop is stable: h max(D/2, K_R/(2 D))."""
    return period * max(0.5 * gains.damping, 0.5 * gains.position / gains.damping)


def margins_by_control(gains: Gains, time_to_go: float) -> LoopMargins:
    """Margins of the continuous loop as python-control finds them from its transfer function."""
    import control

    loop = control.tf(
        [gains.damping / time_to_go, gains.position / time_to_go**2],
        [1.0, 0.0, 0.0],
    )
    gain, phase, _, _, crossover, _ = control.stability_margins(loop)
    return LoopMargins(float(crossover), math.radians(float(phase)), float(gain))


def sampled_margins_by_control(gains: Gains, time_to_go: float, period: float) -> LoopMargins:
    """Margins of the sampled loop as python-control finds them on its frequency response.

    The gain margin is measured at half the sampling rate, where the phase reaches -180 deg exactly: the
    library looks for sign changes of the phase and finds none there.
    """
    import control

    plant = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    sampled = control.sample_system(plant, period, "zoh")
    feedback = [[gains.position / time_to_go**2, gains.damping / time_to_go]]
    loop = control.ss(sampled.A, sampled.B, feedback, [[0.0]], period)
    nyquist = math.pi / period
    span = np.geomspace(1e-2 * min(nyquist, 1.0 / time_to_go), nyquist * (1.0 - 1e-9), _FREQUENCIES)
    response = control.frd(loop, span)
    _, phase, _, _, crossover, _ = control.stability_margins(response)
    at_nyquist = 1.0 / abs(complex(loop(-1.0 + 0.0j)))
    found = math.isfinite(float(crossover)) and float(crossover) < nyquist * (1.0 - 1e-6)
    return LoopMargins(
        float(crossover) if found else math.nan,
        math.radians(float(phase)) if found else math.nan,
        at_nyquist,
    )
