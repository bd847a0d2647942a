/*
 * Least-propellant powered descent: the flight of the indirect method, and a proved lower bound on the
 * propellant of every flight. C99, <math.h> alone; doubles; no heap, no globals that change, every loop
 * bounded; less than 24 kB of stack. SI units; frame: x east, y north, z up.
 *
 * The flight burns at full thrust, coasts, and burns at full thrust; it may touch the target's altitude once in
 * its first burn, and it may lack the coast. It is the best one under constant gravity where the engine can stop
 * and no other limit on the path binds; a flight that breaks one is refused, and its status says which. This is reference code for study and test, not certified flight software.
 */
#ifndef POWERED_DESCENT_H
#define POWERED_DESCENT_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    DESCENT_OPTIMAL = 0,          /* a flight of least propellant, and a bound */
    DESCENT_INFEASIBLE = 1,       /* proved: the tank pays for no flight */
    DESCENT_NO_FLIGHT = 2,        /* the iteration found no flight; nothing is known */
    DESCENT_TANK_TOO_SMALL = 3,   /* the flight found burns more than the tank holds; not proved of all */
    DESCENT_LEAST_THRUST = 4,     /* least thrust above zero: outside this method */
    DESCENT_NO_GRAVITY = 5,       /* gravity too weak beside the thrust: outside this method */
    DESCENT_WEAK_ENGINE = 6,      /* full thrust does not lift the vehicle: outside this method */
    DESCENT_NOT_ABOVE = 7,        /* the start does not lie above the target, against gravity */
    DESCENT_LEANS = 8,            /* the flight of least propellant breaks the pointing limit */
    DESCENT_BELOW_GROUND = 9,     /* it goes below the target's altitude */
    DESCENT_TOO_FAST = 10,        /* it breaks the speed limit */
    DESCENT_OFF_GLIDE_SLOPE = 11, /* it breaks the glide slope limit */
    DESCENT_NOT_FINITE = 12,      /* refused: an input is NaN or infinite */
    DESCENT_TOO_LARGE = 13,       /* refused: a number beyond 1e9 */
    DESCENT_BAD_VEHICLE = 14,     /* refused: thrust, dry mass, exhaust velocity or a limit out of range */
    DESCENT_NO_PROPELLANT = 15,   /* refused: the mass does not exceed the dry mass */
    DESCENT_BELOW_TARGET = 16,    /* refused: the start lies below the target's altitude */
    DESCENT_NO_TIME = 17          /* refused: no flight to ask, or a time that is not one */
} descent_status;

/* A lander and the world it flies in. A limit that is INFINITY is none. */
typedef struct {
    double max_thrust;        /* [N] above 0 */
    double min_thrust;        /* [N] 0 up to max_thrust */
    double dry_mass;          /* [kg] above 0 */
    double exhaust_velocity;  /* [m/s] above 0 */
    double gravity[3];        /* [m/s^2] constant */
    double pointing_limit;    /* [rad] greatest angle of the thrust from the z axis, in (0, pi] */
    double speed_limit;       /* [m/s] above 0 */
    double glide_slope_limit; /* [rad] greatest angle from the z axis, seen from the target, in (0, pi/2] */
} descent_vehicle;

typedef struct {
    double position[3]; /* [m] */
    double velocity[3]; /* [m/s] */
    double mass;        /* [kg] propellant included */
} descent_state;

/* Numbers are NaN where the status has none. */
typedef struct {
    descent_status status;
    double propellant;     /* [kg] that the flight burns */
    double time_of_flight; /* [s] */
    double lower_bound;    /* [kg] no flight burns less; INFINITY: there is no flight */
    double max_thrust;     /* [N] of its burns */
    double primer[2][3];   /* unit vectors along the thrust at two times; in between and beyond it is affine */
    double primer_times[2]; /* [s] these times; the first may lie before the start */
    double touch[2]; /* [s] time of a touch of the ground, -INFINITY for none; [1/s] slope of its upward part before */
} descent_flight;

/* Plan a descent; returns flight->status. */
descent_status descent_solve(const descent_vehicle *vehicle, const descent_state *state, const double target[3],
                             descent_flight *flight);

/* Thrust [N] at a time [s] since the start: none while coasting and after the landing. */
descent_status descent_thrust(const descent_flight *flight, double time, double thrust[3]);

/* A status in words. */
const char *descent_words(descent_status status);

#ifdef __cplusplus
}
#endif

#endif
