"""Descents with a polynomial acceleration, in closed form: E-guidance's linear and Apollo's quadratic one.

`descent_polynomial` holds both, `flight_time` the rule that chooses their time of flight. It knows the lander
and its state; anyone above may import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.polynomial.descent_polynomial import Arrival, DescentPolynomial, meet_arrival
    from guidance.polynomial.flight_time import cheapest_time_of_flight

_HOMES = {
    "Arrival": "guidance.polynomial.descent_polynomial",
    "DescentPolynomial": "guidance.polynomial.descent_polynomial",
    "cheapest_time_of_flight": "guidance.polynomial.flight_time",
    "meet_arrival": "guidance.polynomial.descent_polynomial",
}

__all__ = ["Arrival", "DescentPolynomial", "cheapest_time_of_flight", "meet_arrival"]

__getattr__, __dir__ = lazy_exports(__name__, _HOMES)
