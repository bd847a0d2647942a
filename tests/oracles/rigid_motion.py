"""Newton's and Euler's equations of a rigid body, as a textbook has them, by rotation matrix and DOP853."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation


def integrate_rigid_motion(start, thrust, torque, duration, body, gravity):
    """Fly commands that change linearly, shape (2, 3) each; states of seventeen numbers."""
    arm = np.array([0.0, 0.0, -body.engine_arm])
    exhaust = 9.80665 * body.lander.specific_impulse

    def commanded(pair, time):
        return pair[0] + (pair[1] - pair[0]) * time / duration

    def rate(time, y):
        spin, force = y[10:13], y[14:17]
        turn = Rotation.from_quat(y[6:10], scalar_first=True).as_matrix()
        inertia = np.diag(body.inertia) * (y[13] / body.inertia_mass) ** body.inertia_exponent
        moment = commanded(torque, time) + np.cross(arm, force)
        quaternion = 0.5 * np.array([-y[7:10] @ spin, *(y[6] * spin + np.cross(y[7:10], spin))])
        return np.concatenate(
            [
                y[3:6],
                turn @ force / y[13] + gravity,
                quaternion,
                np.linalg.solve(inertia, moment - np.cross(spin, inertia @ spin)),
                [-np.linalg.norm(force) / exhaust],
                (commanded(thrust, time) - force) / body.engine_lag,
            ]
        )

    path = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-12)
    assert path.success
    return path.y[:, -1]
