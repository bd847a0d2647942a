"""Physical constants that every room shares."""

STANDARD_GRAVITY = 9.80665
"""[m/s^2] standard gravity (CGPM 1901), which turns a specific impulse in seconds into an exhaust speed."""

MOON_GRAVITY: tuple[float, float, float] = (0.0, 0.0, -1.62)
"""[m/s^2] lunar surface gravity in the site frame, constant over the descent (the paper's g)."""
