"""Plan one descent, check it by flying it, and ask what happens where the target is out of reach.

Run: python examples/solve_pdg.py
"""

import math
import sys

import guidance

STATE = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]  # x y z [m], velocity [m/s], mass [kg]
TARGET = [0.0, 0.0, 50.0]


def main() -> None:
    """Print what a guidance engineer would look at first."""
    plan = guidance.solve_pdg(STATE, TARGET)
    say(f"free time: {plan.propellant:.2f} kg in {plan.time_of_flight:.2f} s, {plan.solves} conic solves")
    say(f"flown through the true motion it misses by {plan.residuals.position:.1e} m")

    upright = guidance.Lander(min_thrust=800.0, pointing_limit=math.radians(35.0))
    limited = guidance.solve_pdg(STATE, TARGET, lander=upright, glide_slope_limit=math.radians(30.0))
    say(f"with pointing, glide slope and least thrust: {limited.propellant:.2f} kg")

    late = plan.position[20].tolist() + plan.velocity[20].tolist() + [float(plan.mass[20])]
    replanned = guidance.solve_pdg(late, TARGET, guess=plan)
    say(f"replanned on the way: {replanned.time_of_flight:.2f} s left, {replanned.solves} conic solves")

    far = [2500.0, 0.0, 50.0]
    try:
        guidance.solve_pdg(STATE, far)
    except guidance.InfeasibleError as error:
        say(f"no flight: {error}")
    nearest = guidance.solve_pdg(STATE, far, unreachable="nearest")
    say(f"nearest soft landing: {nearest.landing_error:.0f} m short of the target")


def say(line: str) -> None:
    """One line of output."""
    sys.stdout.write(line + "\n")


if __name__ == "__main__":
    main()
