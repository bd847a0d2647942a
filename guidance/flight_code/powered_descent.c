/*
 * See powered_descent.h. Functions bear the names of the Python package `guidance` whose sources they follow,
 * in the same order of operations:
 *
 *   flight_time/extremal.py, primer_equations.py    the extremal (Lawden, 1963; Lu, JGCD 41(4), 2018)
 *   flight_time/first_guess.py, full_burn.py        where it is sought, and the one without a coast
 *   flight_time/path_limits.py                      the limits on its path
 *   flight_time/neighbouring_extremals.py           extremals of other times of flight
 *   lower_bound/dual_function.py, time_grid.py, time_cover.py, neighbour_cover.py    the bound
 *   bulk/certified_flight.py                        the answer
 *
 * Compile without contraction of floating-point expressions (-ffp-contract=off) for answers equal to Python's.
 */
#include "powered_descent.h"

#include <math.h>

#define POINTS 8         /* of a quadrature */
#define LEGS 12          /* parts of an arc in a checked path */
#define NODES (3 * LEGS + 1)
#define ANGLES 4         /* of the numbers of a step: two for each primer; three times follow, and a touch */
#define FREE 7           /* equations and unknowns of a flight */
#define TOUCHING 9       /* of one that touches the ground */
#define FIXED 6          /* equations before the Hamiltonian, unknowns before the time of flight */
#define PRIMER 10        /* numbers of a primer (a, b, c, theta) */
#define THETA 9          /* place of theta, of which c is the kink; INFINITY without one */
#define MOST_STEPS 30    /* of Newton's method */
#define MOST_HALVINGS 12
#define IMPULSE_TIMES 40 /* of flight, tried for two impulses */
#define MOST_PRIMERS 24  /* of a bound */
#define MOST_KINKED 200  /* of one beside a touch of the ground */
#define BURN_PARTS 12    /* of a flight without a coast, in its quadrature */
#define MOST_LEVELS 20   /* of a quadrature towards a short primer */
#define BISECTIONS 60
#define SAMPLES 9        /* of the thrust of a first guess */
#define CLOSER 8         /* marks on each side of a kink */
#define CELLS 70         /* of the grid of times, up to the best time */
#define NEAR 6
#define MOST_TIMES 512   /* 175 even steps, 12 near the best time, 281 stretched ones, and the ends */

static const double PI = 3.14159265358979323846;
static const double LARGEST_NUMBER = 1e9, ROUNDING = 1e-6;
static const double CONVERGED = 1e-10, LATEST_FIRST_BURN = 0.5, UNIT = 1e-6, MOST_TURN = 0.5;
static const double LATEST_IMPULSE = 0.9, SHORTEST_IMPULSES = 0.01;
static const double UNIFORM = 2.5, STRETCH = 1.03, LONGEST = 1e4;
static const double BEYOND = 1.2, GROWTH = 4.0, EARLIEST = 0.1, IMPULSES = 1.02;
static const double TOLERANCE = 2e-6, GRANTED = 1e-7, CLOSE = 1.0 - 1e-9;
static const double STRIDE = 0.06, LONGER = 2.0, LOOSER = 5.0, CLOSER_BY = 0.4;
static const double SHRINK = 0.4, LEAST_HEIGHT = 1e-3, KINK = 10.0, COAST = 1e-8;
static const int TRIES = 2, FAILURES = 2;
static const int NOTHING = -1, KEPT = 0; /* found; beside them a status of the limit that is broken */
static const double NEAR_MARKS[NEAR] = {0.02, 0.05, 0.1, 0.2, 0.35, 0.6};
static const double QUADRATURE_POINTS[POINTS] = {
    -0.9602898564975362, -0.7966664774136267,
    -0.525532409916329, -0.18343464249564978,
    0.18343464249564978, 0.525532409916329,
    0.7966664774136267, 0.9602898564975362,
};
static const double QUADRATURE_WEIGHTS[POINTS] = {
    0.10122853629037706, 0.22238103445337443,
    0.3137066458778869, 0.36268378337836166,
    0.36268378337836166, 0.3137066458778869,
    0.22238103445337443, 0.10122853629037706,
};

typedef struct {
    double position[3], velocity[3], gravity[3], mass_flow;
} primer_problem;

typedef struct {
    double primer[2][3], times[3], touch[3];
} extremal;

typedef struct {
    double begin, end, mass;
} burn;

typedef struct {
    double position[NODES][3], velocity[NODES][3], direction[NODES][3];
} primer_path;

typedef struct {
    extremal at;
    int size;
    double frame[4][3], correction[TOUCHING], rate[TOUCHING];
} neighbours;

typedef struct {
    double position[3], velocity[3], gravity[3], full, full_growth, cosine, sine;
} dual_case;

typedef struct {
    double factor, first, second;
} growth;

typedef struct {
    int burning;
    double duration;
    growth of;
} arc;

typedef struct {
    int size;
    double times[MOST_TIMES];
} time_grid;

static double least(double a, double b) { return a < b ? a : b; }

static double greatest(double a, double b) { return a > b ? a : b; }

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static double norm(const double *values, int count)
{
    double largest = 0.0;
    for (int k = 0; k < count; k++) {
        if (isnan(values[k])) {
            return values[k];
        }
        largest = greatest(largest, fabs(values[k]));
    }
    return largest;
}

static int all_finite(const double *values, int count)
{
    for (int k = 0; k < count; k++) {
        if (!isfinite(values[k])) {
            return 0;
        }
    }
    return 1;
}

/* ---- the extremal ---------------------------------------------------------------------------------------- */

static void set_no_touch(extremal *x)
{
    x->touch[0] = -INFINITY;
    x->touch[1] = x->touch[2] = 0.0;
}

static int touches(const extremal *x) { return x->touch[0] > -INFINITY; }

static void set_primer(const extremal *x, double time, double p[3])
{
    double fraction = (time - x->times[0]) / (x->times[1] - x->times[0]);
    for (int axis = 0; axis < 3; axis++) {
        p[axis] = x->primer[0][axis] + (x->primer[1][axis] - x->primer[0][axis]) * fraction;
    }
    if (time < x->touch[0]) {
        p[2] += x->touch[1] * (x->touch[0] - time);
    }
}

/* Add to (r, v), at the time `then`, what a burn contributes during which the primer has no kink. */
static void add_smooth_burn(const extremal *x, burn part, double mass_flow, double then, double out[6])
{
    double half = 0.5 * (part.end - part.begin), begin = x->times[0], span = x->times[1] - x->times[0];
    double a[3], b[3], p[3];
    for (int axis = 0; axis < 3; axis++) {
        a[axis] = x->primer[0][axis];
        b[axis] = x->primer[1][axis] - a[axis];
    }
    if (part.begin + half < x->touch[0]) {
        a[2] += x->touch[1] * (x->touch[0] - begin);
        b[2] -= x->touch[1] * span;
    }
    for (int k = 0; k < POINTS; k++) {
        double elapsed = half * (1.0 + QUADRATURE_POINTS[k]);
        double fraction = (part.begin + elapsed - begin) / span;
        for (int axis = 0; axis < 3; axis++) {
            p[axis] = a[axis] + b[axis] * fraction;
        }
        double size = sqrt(dot(p, p));
        double impulse = half * QUADRATURE_WEIGHTS[k] / ((part.mass - mass_flow * elapsed) * greatest(size, 1e-12));
        for (int axis = 0; axis < 3; axis++) {
            double gain = impulse * p[axis];
            out[3 + axis] += gain;
            out[axis] += gain * (then - part.begin - elapsed);
        }
    }
}

/* The same next to a touch: the parts of the quadrature shrink towards where the primer is shortest. */
static void add_turning_burn(const extremal *x, burn part, double mass_flow, double then, double out[6])
{
    double first[3], last[3], along = 0.0, square = 0.0, shortest = 0.0, edges[2] = {part.begin, part.end};
    set_primer(x, part.begin, first);
    set_primer(x, part.end, last);
    for (int axis = 0; axis < 3; axis++) {
        double turn = last[axis] - first[axis];
        along -= first[axis] * turn;
        square += turn * turn;
    }
    double share = least(greatest(along / greatest(square, 1e-300), 0.0), 1.0);
    for (int axis = 0; axis < 3; axis++) {
        double p = first[axis] + share * (last[axis] - first[axis]);
        shortest += p * p;
    }
    double outers[MOST_LEVELS + 1];
    int levels = 0;
    outers[0] = 1.0;
    while (levels < MOST_LEVELS && square * (outers[levels] * outers[levels]) > shortest) {
        levels++;
        outers[levels] = outers[levels - 1] * SHRINK;
    }
    double nearest = part.begin + share * (part.end - part.begin);
    for (int side = 0; side < 2; side++) {
        double span = edges[side] - nearest, inner = 0.0;
        for (int level = levels; level >= 0 && span != 0.0; level--) {
            double begin = nearest + span * inner, end = nearest + span * outers[level];
            burn piece = {span < 0.0 ? end : begin, span < 0.0 ? begin : end, 0.0};
            piece.mass = part.mass - mass_flow * (piece.begin - part.begin);
            add_smooth_burn(x, piece, mass_flow, then, out);
            inner = outers[level];
        }
    }
}

/* Add to (r, v), at the time `then`, what a burn contributes. */
static void add_burn(const extremal *x, burn part, double mass_flow, double then, double out[6])
{
    if (!(touches(x) && part.begin < x->times[0])) {
        add_smooth_burn(x, part, mass_flow, then, out);
        return;
    }
    double mark = least(greatest(x->touch[0], part.begin), part.end);
    double ends[3] = {part.begin, mark, part.end};
    for (int k = 0; k < 2; k++) {
        if (ends[k + 1] > ends[k]) {
            burn piece = {ends[k], ends[k + 1], part.mass - mass_flow * (ends[k] - part.begin)};
            add_turning_burn(x, piece, mass_flow, then, out);
        }
    }
}

static void fly_extremal(const extremal *x, const primer_problem *problem, primer_path *path)
{
    double first = greatest(x->times[0], 0.0);
    double ends[4] = {0.0, first, x->times[1], x->times[2]};
    double state[6], p[3], time = 0.0, mass = 1.0;
    for (int axis = 0; axis < 3; axis++) {
        state[axis] = problem->position[axis];
        state[3 + axis] = problem->velocity[axis];
    }
    for (int k = 0; k < NODES; k++) {
        set_primer(x, time, p);
        double size = greatest(sqrt(dot(p, p)), 1e-12);
        for (int axis = 0; axis < 3; axis++) {
            path->position[k][axis] = state[axis];
            path->velocity[k][axis] = state[3 + axis];
            path->direction[k][axis] = p[axis] / size;
        }
        int number = k / LEGS, part = k % LEGS;
        if (number == 3) {
            break;
        }
        double step = (ends[number + 1] - ends[number]) / LEGS;
        double then = ends[number] + (part + 1) * step;
        for (int axis = 0; axis < 3; axis++) {
            state[axis] += state[3 + axis] * step + 0.5 * step * step * problem->gravity[axis];
            state[3 + axis] += step * problem->gravity[axis];
        }
        if (number != 1) {
            burn leg = {time, then, mass};
            add_burn(x, leg, problem->mass_flow, then, state);
            mass -= problem->mass_flow * (then - time);
        }
        time = then;
    }
}

/* The equations of the extremal: FREE of them, or TOUCHING. */
static void residuals(const extremal *x, const primer_problem *problem, int size, double out[TOUCHING])
{
    double t1 = x->times[0], t2 = x->times[1], final = x->times[2];
    double first = greatest(t1, 0.0), here[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, hamiltonian = 0.0;
    const double *r = problem->position, *v = problem->velocity, *g = problem->gravity;
    if (first > 0.0) {
        burn begin = {0.0, first, 1.0};
        add_burn(x, begin, problem->mass_flow, final, here);
    }
    for (int axis = 0; axis < 3; axis++) {
        double q1 = x->primer[0][axis], q2 = x->primer[1][axis];
        double speed = v[axis] + g[axis] * t2 + here[3 + axis];
        hamiltonian += q2 * g[axis] * (t2 - t1) - (q2 - q1) * speed;
    }
    burn last = {t2, final, 1.0 - problem->mass_flow * first};
    add_burn(x, last, problem->mass_flow, final, here);
    for (int axis = 0; axis < 3; axis++) {
        double fall = g[axis] * final;
        out[axis] = r[axis] + (v[axis] + 0.5 * fall) * final + here[axis];
        out[3 + axis] = v[axis] + fall + here[3 + axis];
    }
    out[6] = hamiltonian;
    if (size == TOUCHING) {
        double touch = x->touch[0], up[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
        burn until = {0.0, touch, 1.0};
        add_burn(x, until, problem->mass_flow, touch, up);
        out[7] = r[2] + (v[2] + 0.5 * g[2] * touch) * touch + up[2] - x->touch[2];
        out[8] = v[2] + g[2] * touch + up[5];
    }
}

static void move_extremal(const extremal *x, double frame[4][3], const double step[TOUCHING], int size_of_step,
                          extremal *out)
{
    for (int k = 0; k < 2; k++) {
        double size = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            double value = x->primer[k][axis];
            value += frame[2 * k][axis] * step[2 * k] + frame[2 * k + 1][axis] * step[2 * k + 1];
            out->primer[k][axis] = value;
            size += value * value;
        }
        for (int axis = 0; axis < 3; axis++) {
            out->primer[k][axis] /= sqrt(size);
        }
    }
    for (int k = 0; k < 3; k++) {
        out->times[k] = x->times[k] + step[ANGLES + k];
        out->touch[k] = x->touch[k];
    }
    if (size_of_step == TOUCHING) {
        out->touch[0] += step[FREE];
        out->touch[1] += step[FREE + 1];
    }
}

/* Two unit vectors normal to q1, and two to q2. */
static void set_frame(const extremal *x, double frame[4][3])
{
    for (int k = 0; k < 2; k++) {
        const double *q = x->primer[k];
        double first[3];
        int axis = 0;
        for (int i = 1; i < 3; i++) {
            if (fabs(q[i]) < fabs(q[axis])) {
                axis = i;
            }
        }
        for (int i = 0; i < 3; i++) {
            first[i] = -q[axis] * q[i];
        }
        first[axis] += 1.0;
        double size = sqrt(dot(first, first));
        for (int i = 0; i < 3; i++) {
            first[i] /= size;
        }
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, h = (i + 2) % 3;
            frame[2 * k][i] = first[i];
            frame[2 * k + 1][i] = q[j] * first[h] - q[h] * first[j];
        }
    }
}

/* Whether the times are in order and mass is left. */
static int admitted(const extremal *x, double mass_flow)
{
    double first = greatest(x->times[0], 0.0);
    if (touches(x) && !(0.0 < x->touch[0] && x->touch[0] < first)) {
        return 0;
    }
    return first < x->times[1] && x->times[1] < x->times[2] &&
           mass_flow * (first + x->times[2] - x->times[1]) < 0.95;
}

/* Solve in place by elimination with row exchange; 0 where the matrix is singular. */
static int solve_linear(double matrix[TOUCHING][TOUCHING], double *vector, int size)
{
    for (int k = 0; k < size; k++) {
        int best = k;
        for (int i = k + 1; i < size; i++) {
            if (fabs(matrix[i][k]) > fabs(matrix[best][k])) {
                best = i;
            }
        }
        if (!(fabs(matrix[best][k]) > 1e-14)) {
            return 0;
        }
        if (best != k) {
            for (int j = k; j < size; j++) {
                double kept = matrix[k][j];
                matrix[k][j] = matrix[best][j];
                matrix[best][j] = kept;
            }
            double kept = vector[k];
            vector[k] = vector[best];
            vector[best] = kept;
        }
        for (int i = k + 1; i < size; i++) {
            double factor = matrix[i][k] / matrix[k][k];
            for (int j = k + 1; j < size; j++) {
                matrix[i][j] -= factor * matrix[k][j];
            }
            vector[i] -= factor * vector[k];
        }
    }
    for (int k = size - 1; k >= 0; k--) {
        for (int j = k + 1; j < size; j++) {
            vector[k] -= matrix[k][j] * vector[j];
        }
        vector[k] /= matrix[k][k];
    }
    return 1;
}

static void set_jacobian(const extremal *x, const primer_problem *problem, int size, const double here[TOUCHING],
                         double frame[4][3], double jacobian[TOUCHING][TOUCHING])
{
    double there[TOUCHING], step[TOUCHING] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    extremal trial;
    set_frame(x, frame);
    for (int k = 0; k < size; k++) {
        step[k] = k == ANGLES && x->times[0] < 0.0 ? -1e-7 : 1e-7; /* one side of the kink at t1 = 0 */
        move_extremal(x, frame, step, size, &trial);
        residuals(&trial, problem, size, there);
        for (int i = 0; i < size; i++) {
            jacobian[i][k] = (there[i] - here[i]) / step[k];
        }
        step[k] = 0.0;
    }
}

static double length(const double *values, int count)
{
    double total = 0.0;
    for (int k = 0; k < count; k++) {
        total += values[k] * values[k];
    }
    return sqrt(total);
}

/* Damped Newton, in place; whether it converged. */
static int newton(extremal *x, const primer_problem *problem, int size)
{
    double frame[4][3], jacobian[TOUCHING][TOUCHING], here[TOUCHING], there[TOUCHING], full[TOUCHING];
    double step[TOUCHING];
    extremal trial;
    if (!admitted(x, problem->mass_flow)) {
        return 0;
    }
    residuals(x, problem, size, here);
    for (int iteration = 0; iteration < MOST_STEPS; iteration++) {
        if (norm(here, size) < CONVERGED) {
            return 1;
        }
        set_jacobian(x, problem, size, here, frame, jacobian);
        for (int k = 0; k < size; k++) {
            full[k] = -here[k];
        }
        if (!solve_linear(jacobian, full, size) || !all_finite(full, size)) {
            return 0;
        }
        double turn = norm(full, ANGLES), delay = norm(full + ANGLES + 1, 2);
        double damping = least(least(1.0, 0.7 / greatest(1e-9, turn)), 0.5 / greatest(1e-9, delay));
        double before = length(here, size);
        int better = 0;
        for (int halving = 0; halving < MOST_HALVINGS; halving++) {
            for (int k = 0; k < size; k++) {
                step[k] = damping * full[k];
            }
            move_extremal(x, frame, step, size, &trial);
            if (admitted(&trial, problem->mass_flow)) {
                residuals(&trial, problem, size, there);
                if (length(there, size) < (1.0 - 0.1 * damping) * before) {
                    better = 1;
                    break;
                }
            }
            damping *= 0.5;
        }
        if (!better) {
            return 0;
        }
        *x = trial;
        for (int k = 0; k < size; k++) {
            here[k] = there[k];
        }
    }
    return norm(here, size) < CONVERGED;
}

/* First guess: a suicide burn along the vertical, and two sideways impulses, at the start and in it. */
static int guess_suicide_burn(const primer_problem *problem, int first_burn, extremal *x)
{
    const double *r = problem->position, *v = problem->velocity;
    double g = sqrt(dot(problem->gravity, problem->gravity));
    double up[3], across[3], kick[3], q1[3], q2[3], speed[3];
    for (int axis = 0; axis < 3; axis++) {
        up[axis] = -problem->gravity[axis] / g;
    }
    double height = dot(r, up), climb = dot(v, up);
    double coast = (2.0 * (1.0 - g) * height - climb * climb) / 2.0;
    double ignition_speed = sqrt(greatest(climb * climb + 2.0 * g * coast, 1e-6 * g * fabs(height)));
    double t2 = greatest((ignition_speed + climb) / g, 1e-2 * ignition_speed / g);
    double final = t2 + ignition_speed / (1.0 - g);
    for (int axis = 0; axis < 3; axis++) {
        across[axis] = (r[axis] - height * up[axis]) / (0.5 * (t2 + final));
        kick[axis] = -across[axis] - (v[axis] - climb * up[axis]);
        q2[axis] = across[axis] + (ignition_speed + g * (final - t2)) * up[axis];
    }
    double size = sqrt(dot(kick, kick)), q2_size = sqrt(dot(q2, q2));
    for (int axis = 0; axis < 3; axis++) {
        q2[axis] /= q2_size;
    }
    double t1 = least(t2 - 2.0 * ignition_speed / g, -1e-3 * t2);
    if (first_burn && size > 1e-9 * ignition_speed) {
        t1 = size < 0.8 * t2 ? size : LATEST_FIRST_BURN * t2;
        for (int axis = 0; axis < 3; axis++) {
            speed[axis] = v[axis] + kick[axis];
        }
        double sine = 1.0, cosine = 0.0;
        for (int k = 0; k < 5; k++) { /* the Hamiltonian at t1 */
            double gap = dot(speed, up) - g * (t2 - t1);
            if (gap == 0.0) {
                break;
            }
            cosine = (dot(q2, speed) - sine * dot(kick, speed) / size) / gap;
            cosine = least(greatest(cosine, -0.95), 0.95);
            sine = sqrt(1.0 - cosine * cosine);
        }
        for (int axis = 0; axis < 3; axis++) {
            q1[axis] = sine * kick[axis] / size + cosine * up[axis];
        }
    } else {
        for (int axis = 0; axis < 3; axis++) {
            q1[axis] = 0.1 * kick[axis] / ignition_speed - up[axis];
        }
        double q1_size = sqrt(dot(q1, q1));
        for (int axis = 0; axis < 3; axis++) {
            q1[axis] /= q1_size;
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        x->primer[0][axis] = q1[axis];
        x->primer[1][axis] = q2[axis];
    }
    x->times[0] = t1;
    x->times[1] = t2;
    x->times[2] = final;
    return fabs(dot(q1, q1) - 1.0) < UNIT && fabs(dot(q2, q2) - 1.0) < UNIT;
}

/* Velocity changes of a ballistic flight that begins and ends with one; their cost, gravity losses included. */
static double set_impulses(const primer_problem *problem, double time, double first[3], double last[3])
{
    const double *g = problem->gravity;
    for (int axis = 0; axis < 3; axis++) {
        double there = -problem->position[axis] / time - 0.5 * g[axis] * time;
        first[axis] = there - problem->velocity[axis];
        last[axis] = -there - g[axis] * time;
    }
    double square = dot(first, first), brake = sqrt(dot(last, last));
    return sqrt(square) + brake + 0.5 * (sqrt(dot(g, g)) * brake + square / time);
}

/* Second guess: the cheapest of many ballistic flights between two impulses, each spread over a burn. */
static int guess_impulses(const primer_problem *problem, extremal *x)
{
    const double *r = problem->position, *v = problem->velocity;
    double pull = sqrt(dot(problem->gravity, problem->gravity));
    double longest = 2.0 * (sqrt(dot(v, v)) / pull + sqrt(2.0 * sqrt(dot(r, r)) / pull));
    double first[3], last[3], lowest = INFINITY, best = longest;
    if (!(longest > 0.0)) {
        return 0;
    }
    for (int k = 0; k < IMPULSE_TIMES; k++) {
        double time = longest * pow(SHORTEST_IMPULSES, (double)k / (IMPULSE_TIMES - 1));
        double cost = set_impulses(problem, time, first, last);
        if (cost < lowest) {
            lowest = cost;
            best = time;
        }
    }
    set_impulses(problem, best, first, last);
    double kick = sqrt(dot(first, first)), brake = sqrt(dot(last, last));
    if (!(kick > 0.0 && brake > 0.0)) {
        return 0;
    }
    for (int axis = 0; axis < 3; axis++) {
        x->primer[0][axis] = first[axis] / kick;
        x->primer[1][axis] = last[axis] / brake;
    }
    double final = best + 0.5 * (kick + brake), braking = final - brake;
    x->times[0] = least(kick, LATEST_IMPULSE * braking);
    x->times[1] = braking;
    x->times[2] = final;
    return 1;
}

/* The problem with the time of flight as the unit of time. */
static primer_problem in_units(const primer_problem *problem, double unit)
{
    primer_problem out = *problem;
    for (int axis = 0; axis < 3; axis++) {
        out.position[axis] /= unit * unit;
        out.velocity[axis] /= unit;
    }
    out.mass_flow *= unit;
    return out;
}

/* Newton from a guess, with the time of flight of the guess as the unit of time. */
static int solve_from(extremal *x, const primer_problem *problem, int size)
{
    double unit = x->times[2];
    primer_problem scaled = in_units(problem, unit);
    for (int k = 0; k < 3; k++) {
        x->times[k] /= unit;
    }
    x->touch[0] /= unit;
    x->touch[1] *= unit;
    x->touch[2] /= unit * unit;
    int found = newton(x, &scaled, size);
    for (int k = 0; k < 3; k++) {
        x->times[k] *= unit;
    }
    x->touch[0] *= unit;
    x->touch[1] /= unit;
    x->touch[2] *= unit * unit;
    return found;
}

static int solve_primer(const primer_problem *problem, extremal *x)
{
    set_no_touch(x);
    for (int attempt = 0; attempt < 3; attempt++) {
        int guessed = attempt < 2 ? guess_suicide_burn(problem, attempt == 0, x) : guess_impulses(problem, x);
        if (guessed && solve_from(x, problem, FREE)) {
            return 1;
        }
    }
    return 0;
}

/* ---- a touch of the ground ------------------------------------------------------------------------------- */

/* Stop the fall at the ground by thrust straight up, and go on from there by two impulses. */
static int guess_touch(const primer_problem *problem, extremal *x)
{
    const double *r = problem->position, *v = problem->velocity;
    primer_problem after = *problem;
    if (!(v[2] < 0.0) || !(problem->gravity[2] > -1.0)) {
        return 0;
    }
    double stop = -v[2] / (1.0 + problem->gravity[2]);
    for (int axis = 0; axis < 3; axis++) {
        after.position[axis] = r[axis] + v[axis] * stop;
    }
    after.position[2] = LEAST_HEIGHT * r[2];
    after.velocity[2] = 0.0;
    if (!guess_impulses(&after, x)) {
        return 0;
    }
    for (int k = 0; k < 3; k++) {
        x->times[k] += stop;
    }
    x->touch[0] = stop;
    x->touch[1] = KINK / stop;
    x->touch[2] = 0.0;
    return 1;
}

static int solve_touching(const primer_problem *problem, extremal *x)
{
    return guess_touch(problem, x) && solve_from(x, problem, TOUCHING) && x->touch[1] > 0.0;
}

/* ---- a flight without a coast: y is the primer at both ends, and the time of flight ---------------------- */

static void state_after(const double y[FREE], const primer_problem *problem, double time, double out[6])
{
    extremal x = {{{y[0], y[1], y[2]}, {y[3], y[4], y[5]}}, {0.0, y[6], y[6]}, {-INFINITY, 0.0, 0.0}};
    for (int axis = 0; axis < 3; axis++) {
        double fall = problem->gravity[axis] * time;
        out[axis] = problem->position[axis] + (problem->velocity[axis] + 0.5 * fall) * time;
        out[3 + axis] = problem->velocity[axis] + fall;
    }
    for (int k = 0; k < BURN_PARTS; k++) {
        double begin = time * k / BURN_PARTS, end = time * (k + 1) / BURN_PARTS;
        burn part = {begin, end, 1.0 - problem->mass_flow * begin};
        add_burn(&x, part, problem->mass_flow, time, out);
    }
}

static double sum_of_squares(const double *values, int count)
{
    double total = 0.0;
    for (int k = 0; k < count; k++) {
        total += values[k] * values[k];
    }
    return total;
}

/* What is missed at the end, and the scale of the primer; 0 where no mass is left. */
static int set_misses(const double y[FREE], const primer_problem *problem, double out[FREE])
{
    double final = y[6];
    if (!(final > 0.0 && problem->mass_flow * final < 0.95)) {
        return 0;
    }
    state_after(y, problem, final, out);
    for (int axis = 0; axis < 3; axis++) {
        out[axis] /= final * final;
        out[3 + axis] /= final;
    }
    out[6] = sum_of_squares(y, 6) - 2.0;
    return 1;
}

/* The flight of least energy of the time in which its thrust is full in the mean. */
static int guess_full_burn(const primer_problem *problem, double y[FREE])
{
    const double *r = problem->position, *v = problem->velocity, *g = problem->gravity;
    double pull = sqrt(dot(g, g)), first[3], last[3], low = 0.0;
    double high = 8.0 * (sqrt(dot(v, v)) + sqrt(sqrt(dot(r, r)))) / greatest(1.0 - pull, 1e-3);
    if (!(high > 0.0)) {
        return 0;
    }
    for (int k = 0; k < BISECTIONS; k++) {
        double time = 0.5 * (low + high), mean = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            double way = -6.0 * r[axis] / (time * time);
            first[axis] = way - 4.0 * v[axis] / time - g[axis];
            last[axis] = -way + 2.0 * v[axis] / time - g[axis];
        }
        for (int i = 0; i < SAMPLES; i++) {
            double share = (double)i / (SAMPLES - 1), square = 0.0;
            for (int axis = 0; axis < 3; axis++) {
                double u = first[axis] + (last[axis] - first[axis]) * share;
                square += u * u;
            }
            mean += sqrt(square) / SAMPLES;
        }
        if (mean > 1.0 + 0.5 * problem->mass_flow * time) {
            low = time;
        } else {
            high = time;
        }
    }
    double scale = sqrt(0.5 * (dot(first, first) + dot(last, last)));
    for (int axis = 0; axis < 3; axis++) {
        y[axis] = first[axis] / scale;
        y[3 + axis] = last[axis] / scale;
    }
    y[6] = 0.5 * (low + high);
    return scale > 0.0;
}

static int newton_of_full_burn(double y[FREE], const primer_problem *problem)
{
    double here[FREE], there[FREE], trial[FREE], full[FREE], jacobian[TOUCHING][TOUCHING];
    if (!set_misses(y, problem, here)) {
        return 0;
    }
    for (int iteration = 0; iteration < MOST_STEPS; iteration++) {
        if (norm(here, FREE) < CONVERGED) {
            return 1;
        }
        for (int k = 0; k < FREE; k++) {
            double step = 1e-7 * (k == 6 ? y[6] : 1.0);
            for (int i = 0; i < FREE; i++) {
                trial[i] = y[i];
            }
            trial[k] += step;
            if (!set_misses(trial, problem, there)) {
                return 0;
            }
            for (int i = 0; i < FREE; i++) {
                jacobian[i][k] = (there[i] - here[i]) / step;
            }
        }
        for (int k = 0; k < FREE; k++) {
            full[k] = -here[k];
        }
        if (!solve_linear(jacobian, full, FREE)) {
            return 0;
        }
        double damping = least(1.0, 0.5 * y[6] / greatest(fabs(full[6]), 1e-300));
        int better = 0;
        for (int halving = 0; halving < MOST_HALVINGS && !better; halving++) {
            for (int k = 0; k < FREE; k++) {
                trial[k] = y[k] + damping * full[k];
            }
            if (set_misses(trial, problem, there)) {
                double less = 1.0 - 0.1 * damping;
                better = sum_of_squares(there, FREE) < less * less * sum_of_squares(here, FREE);
            }
            damping *= 0.5;
        }
        if (!better) {
            return 0;
        }
        for (int k = 0; k < FREE; k++) {
            y[k] = trial[k];
            here[k] = there[k];
        }
    }
    return 0;
}

/* The flight that burns all the way, where no coast would spare propellant; its coast lasts next to nothing. */
static int solve_full_burn(const primer_problem *problem, extremal *x)
{
    double y[FREE], state[6], slope[3], nearest[3];
    if (!guess_full_burn(problem, y) || !newton_of_full_burn(y, problem)) {
        return 0;
    }
    double final = y[6];
    for (int axis = 0; axis < 3; axis++) {
        slope[axis] = (y[3 + axis] - y[axis]) / final;
    }
    double middle = -dot(y, slope) / greatest(dot(slope, slope), 1e-300);
    if (!(middle < (1.0 - COAST) * final)) {
        return 0;
    }
    state_after(y, problem, least(greatest(middle, 0.0), final), state);
    for (int axis = 0; axis < 3; axis++) {
        nearest[axis] = y[axis] + slope[axis] * greatest(middle, 0.0);
    }
    if (!(dot(slope, state + 3) - dot(nearest, problem->gravity) >= 0.0)) {
        return 0;
    }
    if (middle > COAST * final) {
        x->times[0] = middle - 0.5 * COAST * final;
        x->times[1] = middle + 0.5 * COAST * final;
    } else { /* |p| grows from the start on: one burn */
        x->times[0] = least(2.0 * middle, -COAST * final);
        x->times[1] = 0.0;
    }
    x->times[2] = final;
    double size = sqrt(dot(nearest, nearest));
    if (!(size > 0.0)) {
        return 0;
    }
    for (int k = 0; k < 2; k++) {
        for (int axis = 0; axis < 3; axis++) {
            x->primer[k][axis] = (y[axis] + slope[axis] * x->times[k]) / size;
        }
    }
    set_no_touch(x);
    return 1;
}

/* ---- the limits on its path ------------------------------------------------------------------------------ */

/* Share of the start mass that a flight burns. */
static double burnt_share(const extremal *x, double mass_flow)
{
    return mass_flow * (greatest(x->times[0], 0.0) + x->times[2] - x->times[1]);
}

static descent_status keeps_limits(const primer_path *path, const descent_vehicle *vehicle, double unit)
{
    double largest = 0.0, lowest = INFINITY, fastest = 0.0;
    double least_cosine = isinf(vehicle->pointing_limit) ? -INFINITY : cos(vehicle->pointing_limit);
    for (int k = 0; k < NODES; k++) {
        for (int axis = 0; k < NODES - 1 && axis < 3; axis++) {
            largest = greatest(largest, fabs(unit * path->position[k][axis]));
        }
        fastest = greatest(fastest, dot(path->velocity[k], path->velocity[k]));
        if (k < NODES - 1) {
            lowest = least(lowest, unit * path->position[k][2]);
        }
        if ((k <= LEGS || k >= 2 * LEGS) && path->direction[k][2] < least_cosine) {
            return DESCENT_LEANS;
        }
    }
    if (lowest < -1e-6 * largest) {
        return DESCENT_BELOW_GROUND;
    }
    double speed = vehicle->speed_limit / unit;
    if (fastest > speed * speed) {
        return DESCENT_TOO_FAST;
    }
    if (isinf(vehicle->glide_slope_limit)) {
        return DESCENT_OPTIMAL;
    }
    double cosine = cos(vehicle->glide_slope_limit), sine = sin(vehicle->glide_slope_limit);
    for (int k = 0; k < NODES - 1; k++) {
        double across = hypot(unit * path->position[k][0], unit * path->position[k][1]);
        if (across * cosine > unit * path->position[k][2] * sine) {
            return DESCENT_OFF_GLIDE_SLOPE;
        }
    }
    return DESCENT_OPTIMAL;
}

/* ---- neighbouring extremals ------------------------------------------------------------------------------ */

/* Write the step, in seconds, that takes all equations but the Hamiltonian's to -right; none where singular. */
static void solve_fixed(double jacobian[TOUCHING][TOUCHING], const double *right, double unit, int size,
                        double step[TOUCHING])
{
    double matrix[TOUCHING][TOUCHING], vector[TOUCHING];
    for (int i = 0; i < size - 1; i++) {
        int row = i < FIXED ? i : i + 1;
        vector[i] = -right[row];
        for (int k = 0; k < size - 1; k++) {
            matrix[i][k] = jacobian[row][k < FIXED ? k : k + 1];
        }
    }
    for (int k = 0; k < size; k++) {
        step[k] = 0.0;
    }
    if (solve_linear(matrix, vector, size - 1) && all_finite(vector, size - 1)) {
        for (int k = 0; k < FIXED; k++) {
            step[k] = k < ANGLES ? vector[k] : vector[k] * unit;
        }
        if (size == TOUCHING) {
            step[FREE] = vector[FIXED] * unit;
            step[FREE + 1] = vector[FIXED + 1] / unit;
        }
    }
}

static int is_near(const double step[TOUCHING], double unit, int size)
{
    for (int k = 0; k < (size == FREE ? FREE : FREE + 1); k++) {
        if (!(fabs(step[k]) < (k < ANGLES ? MOST_TURN : MOST_TURN * unit))) {
            return 0;
        }
    }
    return 1;
}

static void find_neighbours(const extremal *at, const primer_problem *problem, neighbours *out)
{
    double unit = at->times[2], here[TOUCHING], jacobian[TOUCHING][TOUCHING], column[TOUCHING];
    primer_problem scaled = in_units(problem, unit);
    extremal x = *at;
    int size = touches(at) ? TOUCHING : FREE;
    for (int k = 0; k < 3; k++) {
        x.times[k] = at->times[k] / unit;
    }
    if (size == TOUCHING) {
        x.touch[0] = at->touch[0] / unit;
        x.touch[1] = at->touch[1] * unit;
        x.touch[2] = at->touch[2] / (unit * unit);
    }
    out->at = *at;
    out->size = size;
    residuals(&x, &scaled, size, here);
    set_jacobian(&x, &scaled, size, here, out->frame, jacobian);
    solve_fixed(jacobian, here, unit, size, out->correction);
    if (!is_near(out->correction, unit, size)) {
        for (int i = 0; i < size; i++) {
            out->correction[i] = 0.0;
        }
    }
    for (int i = 0; i < size; i++) {
        column[i] = jacobian[i][FIXED];
    }
    solve_fixed(jacobian, column, 1.0, size, out->rate);
    for (int k = 0; k < ANGLES; k++) {
        out->rate[k] /= unit;
    }
    if (size == TOUCHING) {
        out->rate[FREE + 1] /= unit * unit;
    }
    out->rate[FIXED] = 1.0;
}

static void set_neighbour(neighbours *known, double time, extremal *out)
{
    double step[TOUCHING], delay = time - known->at.times[2];
    for (int k = 0; k < known->size; k++) {
        step[k] = known->correction[k] + known->rate[k] * delay;
    }
    move_extremal(&known->at, known->frame, step, known->size, out);
}

/* Let an extremal begin to burn at the start, with the sign of `along` q2; in place, where it can. */
static void begin_first_burn(extremal *x, double along)
{
    double start[3], part = 0.0, square = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double slope = (x->primer[1][axis] - x->primer[0][axis]) / (x->times[1] - x->times[0]);
        start[axis] = x->primer[1][axis] - slope * x->times[1];
        part += start[axis] * x->primer[1][axis];
    }
    for (int axis = 0; axis < 3; axis++) {
        start[axis] -= part * x->primer[1][axis];
        square += start[axis] * start[axis];
    }
    if (!(square < 1.0)) {
        return;
    }
    for (int axis = 0; axis < 3; axis++) {
        x->primer[0][axis] = start[axis] + copysign(sqrt(1.0 - square), along) * x->primer[1][axis];
    }
    x->times[0] = 0.0;
}

static void neighbours_at(neighbours *known, const primer_problem *problem, double time, neighbours *out)
{
    double near = known->at.times[2];
    extremal there, first;
    set_neighbour(known, time, &there);
    if (time != near && (known->at.times[0] < 0.0 || there.times[0] < 0.0) && !touches(&there)) {
        neighbours short_burn;
        set_neighbour(known, near, &first);
        begin_first_burn(&first, time - near);
        find_neighbours(&first, problem, &short_burn);
        set_neighbour(&short_burn, time, &there);
    }
    find_neighbours(&there, problem, out);
}

/* ---- the bound ------------------------------------------------------------------------------------------- */

static growth grow(double rate, double time)
{
    double x = rate * time;
    growth out;
    out.first = fabs(x) < 1e-8 ? time * (1.0 + 0.5 * x) : expm1(x) / rate;
    if (fabs(x) < 1e-2) {
        out.second =
            0.5 * time * time * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0))));
    } else {
        out.second = (out.first - time) / rate;
    }
    out.factor = exp(x);
    return out;
}

/* Greatest p.d over the directions that the engine may take, tau seconds before the landing. */
static double support(const double primer[PRIMER], double tau, const dual_case *problem)
{
    double x = primer[0] + primer[3] * tau, y = primer[1] + primer[4] * tau, z = primer[2] + primer[5] * tau;
    if (tau > primer[THETA]) {
        double late = tau - primer[THETA];
        x += primer[6] * late;
        y += primer[7] * late;
        z += primer[8] * late;
    }
    double across = sqrt(x * x + y * y), size = sqrt(across * across + z * z);
    return z >= size * problem->cosine ? size : problem->sine * across + problem->cosine * z;
}

static double linear_part(const double primer[PRIMER], double time, const dual_case *problem)
{
    double total = 0.0;
    if (time >= primer[THETA]) {
        double before = time - primer[THETA];
        for (int axis = 0; axis < 3; axis++) {
            double speed = problem->velocity[axis] + 0.5 * problem->gravity[axis] * before;
            total -= primer[6 + axis] * (problem->position[axis] + speed * before);
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        double fall = problem->gravity[axis] * time;
        total += primer[axis] * (0.0 - problem->velocity[axis] - fall);
        total -= primer[3 + axis] *
                 (problem->position[axis] + (problem->velocity[axis] + 0.5 * fall) * time);
    }
    return total;
}

/* Arcs of one step on which h has a constant slope; the second lasts 0 s where s keeps its sign. */
static void split_step(double s, double slope, double step, const growth whole[2], const dual_case *problem,
                       arc arcs[2])
{
    int burning = s > 0.0 || (s == 0.0 && slope > 0.0);
    double rate = burning ? problem->full_growth : 0.0;
    growth of = whole[burning];
    double end = s * of.factor + slope * of.first;
    arcs[0].burning = burning;
    arcs[1].burning = !burning;
    if ((end >= 0.0) == burning || end == 0.0) {
        growth none = {1.0, 0.0, 0.0};
        arcs[0].duration = step;
        arcs[0].of = of;
        arcs[1].duration = 0.0;
        arcs[1].of = none;
        return;
    }
    double ratio = s / slope;
    double until = rate * fabs(ratio) < 1e-9 ? -ratio : -log1p(rate * ratio) / rate;
    until = least(greatest(until, 0.0), step);
    arcs[0].duration = until;
    arcs[0].of = grow(rate, until);
    arcs[1].duration = step - until;
    arcs[1].of = grow(burning ? 0.0 : problem->full_growth, step - until);
}

/* Places of the grid's times beside and at the kink of a primer; rising. */
static void set_marks_about(double theta, const time_grid *grid, double marks[2 * CLOSER + 1])
{
    int cell = 1;
    while (cell < grid->size - 1 && grid->times[cell] < theta) {
        cell++;
    }
    double away = grid->times[cell] - grid->times[cell - 1];
    marks[CLOSER] = theta;
    for (int k = 0; k < CLOSER; k++) {
        away *= CLOSER_BY;
        marks[k] = theta - away;
        marks[2 * CLOSER - k] = theta + away;
    }
}

/* Raise the envelope, the bound of each cell of the grid, to what a primer bounds. */
static void join_cover(const double primer[PRIMER], const time_grid *grid, const dual_case *problem,
                       double *envelope)
{
    const double *times = grid->times;
    double marks[2 * CLOSER + 1], final = times[grid->size - 1], time = times[0];
    int kinked = (primer[6] != 0.0 || primer[7] != 0.0 || primer[8] != 0.0) && primer[THETA] < final;
    int mark = kinked ? 0 : 2 * CLOSER + 1, cell = 0;
    double bend = -(primer[3] * problem->gravity[0] + primer[4] * problem->gravity[1] +
                    primer[5] * problem->gravity[2]);
    double kink = -(primer[6] * problem->gravity[0] + primer[7] * problem->gravity[1] +
                    primer[8] * problem->gravity[2]);
    double here = support(primer, time, problem), lowest_bound = INFINITY;
    double s = here - 1.0, spent = 0.0, before = linear_part(primer, time, problem), last = NAN;
    growth whole[2] = {{1.0, 0.0, 0.0}, {1.0, 0.0, 0.0}};
    if (kinked) {
        set_marks_about(primer[THETA], grid, marks);
    }
    while (cell < grid->size - 1) {
        while (mark <= 2 * CLOSER && !(marks[mark] > time)) {
            mark++;
        }
        double next = times[cell + 1];
        if (mark <= 2 * CLOSER && marks[mark] < next) {
            next = marks[mark];
        }
        double step = next - time;
        if (!(fabs(step - last) <= 1e-12 * step)) {
            whole[0] = grow(0.0, step);
            whole[1] = grow(problem->full_growth, step);
            last = step;
        }
        double there = support(primer, next, problem), slope = (there - here) / step, lowest = s;
        arc arcs[2];
        split_step(s, slope, step, whole, problem, arcs);
        for (int i = 0; i < 2; i++) {
            double weight = arcs[i].burning ? problem->full : 0.0;
            spent += weight * (s * arcs[i].of.first + slope * arcs[i].of.second);
            s = s * arcs[i].of.factor + slope * arcs[i].of.first;
        }
        lowest = least(lowest, s);
        double after = linear_part(primer, next, problem) - spent;
        if (next > primer[THETA]) {
            bend += kink;
            kink = 0.0;
        }
        double sag = bend + problem->full * greatest(-slope, 0.0) +
                     problem->full * problem->full_growth * greatest(-lowest, 0.0);
        double bound = least(before, after) - 0.125 * step * step * greatest(sag, 0.0);
        if (!(bound >= lowest_bound)) { /* NaN too, which bounds nothing */
            lowest_bound = bound > -INFINITY ? bound : -INFINITY;
        }
        before = after;
        here = there;
        time = next;
        if (time == times[cell + 1]) {
            if (lowest_bound > envelope[cell]) {
                envelope[cell] = lowest_bound;
            }
            lowest_bound = INFINITY;
            cell++;
        }
    }
}

/* The same for a constant primer no longer than one, which lights no engine. */
static void join_constant(const double primer[PRIMER], const time_grid *grid, const dual_case *problem,
                          double *envelope)
{
    double before = linear_part(primer, grid->times[0], problem);
    for (int k = 0; k < grid->size - 1; k++) {
        double after = linear_part(primer, grid->times[k + 1], problem);
        double bound = least(before, after);
        if (bound > envelope[k]) {
            envelope[k] = bound;
        }
        before = after;
    }
}

static void set_no_kink(double primer[PRIMER])
{
    primer[6] = primer[7] = primer[8] = 0.0;
    primer[THETA] = INFINITY;
}

static void unit_primer(const double along[3], double primer[PRIMER])
{
    double size = greatest(sqrt(dot(along, along)), 1e-300);
    for (int axis = 0; axis < 3; axis++) {
        primer[axis] = along[axis] / size;
        primer[3 + axis] = 0.0;
    }
    set_no_kink(primer);
}

static void two_impulse_primer(double time, const dual_case *problem, double primer[PRIMER])
{
    double first[3], last[3];
    for (int axis = 0; axis < 3; axis++) {
        double fall = problem->gravity[axis] * time;
        double after = -problem->position[axis] / time - 0.5 * fall;
        first[axis] = after - problem->velocity[axis];
        last[axis] = 0.0 - after - fall;
    }
    double first_size = greatest(sqrt(dot(first, first)), 1e-300);
    double last_size = greatest(sqrt(dot(last, last)), 1e-300);
    for (int axis = 0; axis < 3; axis++) {
        primer[axis] = last[axis] / last_size;
        primer[3 + axis] = (first[axis] / first_size - primer[axis]) / time;
    }
    set_no_kink(primer);
}

/* Primer of an extremal, of the length that lights the engine where it brakes; with the kink of a touch. */
static void primer_of(const extremal *x, const dual_case *problem, double primer[PRIMER])
{
    double time = x->times[2] - x->times[1], rate = problem->full_growth, total = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double slope = (x->primer[0][axis] - x->primer[1][axis]) / (x->times[1] - x->times[0]);
        primer[axis] = x->primer[1][axis] - slope * time;
        primer[3 + axis] = slope;
    }
    for (int k = 0; k < POINTS; k++) {
        double tau = 0.5 * time * (1.0 + QUADRATURE_POINTS[k]), square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            double p = primer[axis] + primer[3 + axis] * tau;
            square += p * p;
        }
        total += QUADRATURE_WEIGHTS[k] * exp(-rate * tau) * sqrt(square);
    }
    double scale = 1.0 / (exp(-rate * time) + 0.5 * rate * time * total);
    for (int number = 0; number < 6; number++) {
        primer[number] *= scale;
    }
    set_no_kink(primer);
    if (touches(x)) {
        double slope[3];
        for (int axis = 0; axis < 3; axis++) {
            slope[axis] = (x->primer[0][axis] - x->primer[1][axis]) / (x->times[1] - x->times[0]);
        }
        primer[8] = sqrt(dot(primer + 3, primer + 3) / dot(slope, slope)) * greatest(x->touch[1], 0.0);
        primer[THETA] = x->times[2] - x->touch[0];
    }
}

/* Times of flight from 0 to the one beyond which gravity alone spends the target; 0 where they do not fit. */
static int set_grid(const dual_case *problem, double target, double time, time_grid *grid)
{
    double pull = sqrt(dot(problem->gravity, problem->gravity)), longest = LONGEST * time;
    double change = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        change += problem->gravity[axis] * (0.0 - problem->velocity[axis]);
    }
    if (pull > 0.0) {
        longest = greatest(least(longest, (target + change / pull) / pull), time);
    }
    double step = time / CELLS, last = least(UNIFORM * time, longest);
    double even_steps = ceil(last / step);
    double stretched = longest > last ? ceil(log(longest / last) / log(STRETCH)) : 0.0;
    if (!(step > 0.0) || !(even_steps + stretched + 2 * NEAR + 1 <= MOST_TIMES)) {
        return 0;
    }
    int even = (int)even_steps, count = (int)stretched, size = 0, kept = 0;
    double *times = grid->times;
    for (int k = 0; k < even; k++) {
        times[size++] = step * k;
    }
    for (int k = 0; k < NEAR; k++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            double mark = time + sign * step * NEAR_MARKS[k];
            if (mark < last) {
                times[size++] = mark;
            }
        }
    }
    times[size++] = last;
    double ratio = pow(longest / last, 1.0 / (count > 1 ? count : 1));
    for (int k = 0; k < count; k++) {
        times[size++] = k == count - 1 ? longest : last * pow(ratio, k + 1);
    }
    for (int k = even; k < size; k++) { /* insertion sort */
        double value = times[k];
        int place = k;
        while (place > 0 && times[place - 1] > value) {
            times[place] = times[place - 1];
            place--;
        }
        times[place] = value;
    }
    for (int k = 0; k < size; k++) {
        if (k == size - 1 || times[k + 1] - times[k] > 1e-6 * step) {
            times[kept++] = times[k];
        }
    }
    grid->size = kept;
    return kept > 1;
}

static int nearest_open_cell(const double *envelope, const time_grid *grid, double level, double best_time)
{
    int nearest = -1;
    double closest = INFINITY;
    for (int k = 0; k < grid->size - 1; k++) {
        double away = fabs(0.5 * (grid->times[k] + grid->times[k + 1]) - best_time);
        if (envelope[k] < level && away < CLOSE * closest) {
            nearest = k;
            closest = away;
        }
    }
    return nearest;
}

static double middle_of(const time_grid *grid, int cell)
{
    return 0.5 * (grid->times[cell] + grid->times[cell + 1]);
}

/* Time whose primer is taken for a cell at `mark`: further out it may cover the cell and more. */
static double next_time(double mark, const neighbours *beside, double best_time, double stride, double *farthest)
{
    double time = mark, away = mark - best_time, known = beside->at.times[2];
    if (isinf(*farthest) || *farthest < BEYOND * fabs(away)) {
        *farthest = least(BEYOND * fabs(away), GROWTH * *farthest);
        time = greatest(best_time + copysign(*farthest, away), EARLIEST * best_time);
    }
    return fabs(time - known) > stride ? known + copysign(stride, time - known) : time;
}

/* A primer for a time of flight too short for any: that of the last flight found, made longer. */
static void lengthen(neighbours *last, double time, const dual_case *relaxed, double primer[PRIMER])
{
    double known = last->at.times[2];
    extremal x;
    set_neighbour(last, known, &x);
    primer_of(&x, relaxed, primer);
    primer[THETA] = least(greatest(primer[THETA] + (time - known), 0.0), time);
    for (int number = 0; number < THETA; number++) {
        primer[number] *= LONGER;
    }
}

/* Whether an extremal's times are in order, with that of a touch. */
static int in_order(const extremal *x)
{
    return x->times[0] < x->times[1] && x->times[1] < x->times[2] && x->touch[0] < x->times[0];
}

/* The constant primers of a cover: that for all times beyond the grid, and the one along the change of velocity. */
static void set_constants(const dual_case *relaxed, double last_time, double constant[PRIMER],
                          double change[PRIMER])
{
    double minus[3];
    for (int axis = 0; axis < 3; axis++) {
        minus[axis] = 0.0 - relaxed->velocity[axis];
    }
    unit_primer(minus, change);
    for (int axis = 0; axis < 3; axis++) {
        minus[axis] = -relaxed->gravity[axis];
    }
    unit_primer(minus, constant);
    if (!(dot(change, relaxed->gravity) > 0.0) &&
        linear_part(constant, last_time, relaxed) < linear_part(change, last_time, relaxed)) {
        for (int number = 0; number < PRIMER; number++) {
            constant[number] = change[number];
        }
    }
}

/* The least bound [m/s] over every time of flight, from the primers of neighbouring extremals. */
static double cover_by_neighbours(const extremal *best, const primer_problem *problem, const time_grid *grid,
                                  const dual_case *relaxed, double target, double tolerance)
{
    double envelope[MOST_TIMES], constant[PRIMER], change[PRIMER], primer[PRIMER], longer[PRIMER];
    double best_time = best->times[2], last_time = grid->times[grid->size - 1];
    int touching = touches(best), most = touching ? MOST_KINKED : MOST_PRIMERS;
    int tried = -1, tries = 0, most_tries = touching ? TRIES + FAILURES : TRIES;
    double level = target - tolerance, farthest[2] = {INFINITY, INFINITY};
    double stride[2] = {INFINITY, INFINITY};
    neighbours sides[2], there;
    extremal x;
    if (touching) {
        stride[0] = stride[1] = STRIDE * best_time;
    }
    for (int k = 0; k < grid->size - 1; k++) {
        envelope[k] = -INFINITY;
    }
    set_constants(relaxed, last_time, constant, change);
    join_constant(constant, grid, relaxed, envelope);
    join_constant(change, grid, relaxed, envelope);
    find_neighbours(best, problem, &sides[0]);
    sides[1] = sides[0];
    set_neighbour(&sides[0], best_time, &x);
    primer_of(&x, relaxed, primer);
    for (int count = 2; count < most; count++) {
        join_cover(primer, grid, relaxed, envelope);
        if (count == 2) {
            int before = 0;
            while (before < grid->size - 2 && grid->times[before + 1] < CLOSE * best_time) {
                before++;
            }
            level = least(level, envelope[before] - tolerance);
        }
        int cell = nearest_open_cell(envelope, grid, level, best_time);
        tries = cell == tried ? tries + 1 : 0;
        if (cell >= 0 && tries == most_tries) { /* its own primer does not bound it: no other one will */
            level = envelope[cell];
            tries = 0;
            cell = nearest_open_cell(envelope, grid, level, best_time);
        }
        if (cell < 0) {
            break;
        }
        double mark = middle_of(grid, cell);
        two_impulse_primer(mark, relaxed, primer);
        tried = cell;
        if (linear_part(primer, mark, relaxed) > IMPULSES * level) {
            continue;
        }
        int side = mark < best_time ? 0 : 1;
        double time = next_time(mark, &sides[side], best_time, stride[side], &farthest[side]);
        neighbours_at(&sides[side], problem, time, &there);
        set_neighbour(&there, time, &x);
        if (in_order(&x)) {
            primer_of(&x, relaxed, primer);
            sides[side] = there;
        } else if (touching) {
            lengthen(&sides[side], mark, relaxed, longer);
            join_cover(longer, grid, relaxed, envelope);
            for (int number = 0; number < 6; number++) {
                primer[number] *= LONGER * LONGER;
            }
            count++;
            stride[side] *= 0.5;
            continue;
        }
        tried = time == mark ? cell : -1;
    }
    double lowest = linear_part(constant, last_time, relaxed);
    for (int k = 0; k < grid->size - 1; k++) {
        lowest = least(lowest, envelope[k]);
    }
    return lowest;
}

/* Bound [m/s] what flights that spend at most `most` spend, as well as `target` asks; -INFINITY for none. */
static double bound_start(const primer_problem *problem, double unit, const descent_vehicle *vehicle,
                          const extremal *x, double most, double target)
{
    double exhaust = vehicle->exhaust_velocity;
    double limit = isinf(vehicle->pointing_limit) ? PI : vehicle->pointing_limit;
    dual_case relaxed;
    time_grid grid;
    for (int axis = 0; axis < 3; axis++) {
        relaxed.position[axis] = unit * problem->position[axis];
        relaxed.velocity[axis] = unit * problem->velocity[axis];
        relaxed.gravity[axis] = vehicle->gravity[axis];
    }
    relaxed.full = unit;
    relaxed.full_growth = unit * (most > 0.0 ? expm1(most / exhaust) / most : 1.0 / exhaust);
    relaxed.cosine = isinf(vehicle->pointing_limit) ? -1.0 : cos(limit);
    relaxed.sine = limit < PI ? sin(limit) : 0.0;
    if (!set_grid(&relaxed, target * (1.0 + 1e-12), x->times[2], &grid)) {
        return -INFINITY;
    }
    return cover_by_neighbours(x, problem, &grid, &relaxed, target, (touches(x) ? LOOSER : 1.0) * TOLERANCE * exhaust);
}

/* ---- the answer ------------------------------------------------------------------------------------------ */

static int in_range(double limit, double most) { return isinf(limit) ? limit > 0.0 : limit > 0.0 && limit <= most; }

static descent_status check_vehicle(const descent_vehicle *vehicle)
{
    double engine[4] = {vehicle->max_thrust, vehicle->min_thrust, vehicle->dry_mass, vehicle->exhaust_velocity};
    double limits[3] = {vehicle->pointing_limit, vehicle->speed_limit, vehicle->glide_slope_limit};
    if (!all_finite(engine, 4) || !all_finite(vehicle->gravity, 3) || isnan(norm(limits, 3))) {
        return DESCENT_NOT_FINITE;
    }
    if (norm(vehicle->gravity, 3) > LARGEST_NUMBER) {
        return DESCENT_TOO_LARGE;
    }
    if (!(vehicle->max_thrust > 0.0) || !(vehicle->dry_mass > 0.0) || !(vehicle->exhaust_velocity > 0.0) ||
        !(vehicle->min_thrust >= 0.0) || vehicle->min_thrust > vehicle->max_thrust ||
        !in_range(vehicle->pointing_limit, PI) || !in_range(vehicle->speed_limit, INFINITY) ||
        !in_range(vehicle->glide_slope_limit, 0.5 * PI)) {
        return DESCENT_BAD_VEHICLE;
    }
    return DESCENT_OPTIMAL;
}

static descent_status check_start(const descent_vehicle *vehicle, const descent_state *state,
                                  const double target[3])
{
    double offset[3];
    if (!all_finite(state->position, 3) || !all_finite(state->velocity, 3) || !isfinite(state->mass) ||
        !all_finite(target, 3)) {
        return DESCENT_NOT_FINITE;
    }
    if (norm(state->position, 3) > LARGEST_NUMBER || norm(state->velocity, 3) > LARGEST_NUMBER ||
        fabs(state->mass) > LARGEST_NUMBER || norm(target, 3) > LARGEST_NUMBER) {
        return DESCENT_TOO_LARGE;
    }
    if (state->mass <= vehicle->dry_mass) {
        return DESCENT_NO_PROPELLANT;
    }
    for (int axis = 0; axis < 3; axis++) {
        offset[axis] = state->position[axis] - target[axis];
    }
    if (offset[2] < 0.0 && -offset[2] > ROUNDING * greatest(1.0, sqrt(dot(offset, offset)))) {
        return DESCENT_BELOW_TARGET;
    }
    return DESCENT_OPTIMAL;
}

/* The start seen from the target, moved onto a limit that rounding makes it break. */
static void offset_from(const descent_vehicle *vehicle, const descent_state *state, const double target[3],
                        double offset[3])
{
    double limit = vehicle->glide_slope_limit;
    for (int axis = 0; axis < 3; axis++) {
        offset[axis] = state->position[axis] - target[axis];
    }
    offset[2] = greatest(offset[2], 0.0);
    if (limit < 0.5 * PI - 1e-6) {
        double cosine = cos(limit), sine = sin(limit), across = hypot(offset[0], offset[1]);
        double outside = cosine * across - sine * offset[2];
        if (0.0 < outside && outside <= ROUNDING * greatest(1.0, sqrt(dot(offset, offset)))) {
            offset[0] *= 1.0 - outside * cosine / across;
            offset[1] *= 1.0 - outside * cosine / across;
            offset[2] += outside * sine;
        }
    }
}

/* The first limit that an extremal breaks, as a status: the tank's, or one on its path; else KEPT. */
static int judge_extremal(const extremal *x, const primer_problem *problem, const descent_vehicle *vehicle,
                          double unit, double log_mass_ratio)
{
    primer_path path;
    if (-log1p(-burnt_share(x, problem->mass_flow)) > log_mass_ratio) {
        return DESCENT_TANK_TOO_SMALL;
    }
    fly_extremal(x, problem, &path);
    return keeps_limits(&path, vehicle, unit);
}

/* Find the extremal of the best time: with a coast, without one, or with a touch of the ground; what it breaks. */
static int seek_extremal(const primer_problem *problem, const descent_vehicle *vehicle, double unit,
                         double log_mass_ratio, extremal *x)
{
    int broken = NOTHING;
    extremal other;
    if (solve_primer(problem, x)) {
        broken = judge_extremal(x, problem, vehicle, unit, log_mass_ratio);
    } else if (solve_full_burn(problem, &other)) {
        *x = other;
        broken = judge_extremal(x, problem, vehicle, unit, log_mass_ratio);
    }
    if ((broken == NOTHING || broken == DESCENT_BELOW_GROUND) && solve_touching(problem, &other)) {
        *x = other;
        broken = judge_extremal(x, problem, vehicle, unit, log_mass_ratio);
    }
    return broken;
}

static descent_status answer_start(const descent_vehicle *vehicle, const descent_state *state,
                                   const double target[3], descent_flight *flight)
{
    double exhaust = vehicle->exhaust_velocity, unit = vehicle->max_thrust / state->mass, offset[3];
    primer_problem problem;
    extremal x;
    if (vehicle->min_thrust > 0.0) {
        return DESCENT_LEAST_THRUST;
    }
    offset_from(vehicle, state, target, offset);
    for (int axis = 0; axis < 3; axis++) {
        problem.position[axis] = offset[axis] / unit;
        problem.velocity[axis] = state->velocity[axis] / unit;
        problem.gravity[axis] = vehicle->gravity[axis] / unit;
    }
    problem.mass_flow = vehicle->max_thrust / exhaust / state->mass;
    double pull = dot(problem.gravity, problem.gravity);
    if (!(1e-6 < pull)) {
        return DESCENT_NO_GRAVITY;
    }
    if (!(pull < 0.98)) {
        return DESCENT_WEAK_ENGINE;
    }
    if (!(dot(problem.position, problem.gravity) < 0.0)) {
        return DESCENT_NOT_ABOVE;
    }
    double tank = exhaust * log(state->mass / vehicle->dry_mass);
    int broken = seek_extremal(&problem, vehicle, unit, tank / exhaust, &x);
    if (broken == NOTHING) {
        return DESCENT_NO_FLIGHT;
    }
    if (broken == DESCENT_TANK_TOO_SMALL) {
        double enough = tank + 2.0 * GRANTED * exhaust;
        if (!(bound_start(&problem, unit, vehicle, &x, tank, enough) >= enough)) {
            return DESCENT_TANK_TOO_SMALL;
        }
        flight->lower_bound = INFINITY;
        return DESCENT_INFEASIBLE;
    }
    if (broken != KEPT) {
        return (descent_status)broken;
    }
    double share = burnt_share(&x, problem.mass_flow), spent = -exhaust * log1p(-share);
    double level = bound_start(&problem, unit, vehicle, &x, spent, spent);
    double bound = greatest(least(level - GRANTED * exhaust, spent), 0.0);
    flight->propellant = state->mass * share;
    flight->time_of_flight = x.times[2];
    flight->lower_bound = state->mass * -expm1(-bound / exhaust);
    flight->max_thrust = vehicle->max_thrust;
    for (int k = 0; k < 2; k++) {
        for (int axis = 0; axis < 3; axis++) {
            flight->primer[k][axis] = x.primer[k][axis];
        }
        flight->primer_times[k] = x.times[k];
        flight->touch[k] = x.touch[k];
    }
    return DESCENT_OPTIMAL;
}

descent_status descent_solve(const descent_vehicle *vehicle, const descent_state *state, const double target[3],
                             descent_flight *flight)
{
    flight->propellant = flight->time_of_flight = flight->lower_bound = flight->max_thrust = NAN;
    for (int k = 0; k < 2; k++) {
        for (int axis = 0; axis < 3; axis++) {
            flight->primer[k][axis] = NAN;
        }
        flight->primer_times[k] = flight->touch[k] = NAN;
    }
    flight->status = check_vehicle(vehicle);
    if (flight->status == DESCENT_OPTIMAL) {
        flight->status = check_start(vehicle, state, target);
    }
    if (flight->status == DESCENT_OPTIMAL) {
        flight->status = answer_start(vehicle, state, target, flight);
    }
    return flight->status;
}

descent_status descent_thrust(const descent_flight *flight, double time, double thrust[3])
{
    extremal x;
    thrust[0] = thrust[1] = thrust[2] = 0.0;
    if (flight->status != DESCENT_OPTIMAL || !(time >= 0.0)) {
        return DESCENT_NO_TIME;
    }
    if ((flight->primer_times[0] <= time && time < flight->primer_times[1]) || time > flight->time_of_flight) {
        return DESCENT_OPTIMAL;
    }
    for (int k = 0; k < 2; k++) {
        for (int axis = 0; axis < 3; axis++) {
            x.primer[k][axis] = flight->primer[k][axis];
        }
        x.times[k] = flight->primer_times[k];
        x.touch[k] = flight->touch[k];
    }
    set_primer(&x, time, thrust);
    double size = greatest(sqrt(dot(thrust, thrust)), 1e-12);
    for (int axis = 0; axis < 3; axis++) {
        thrust[axis] *= flight->max_thrust / size;
    }
    return DESCENT_OPTIMAL;
}

const char *descent_words(descent_status status)
{
    switch (status) {
    case DESCENT_OPTIMAL:
        return "optimal";
    case DESCENT_INFEASIBLE:
        return "infeasible: the tank pays for no flight";
    case DESCENT_NO_FLIGHT:
        return "no flight found";
    case DESCENT_TANK_TOO_SMALL:
        return "the flight found burns more than the tank holds";
    case DESCENT_LEAST_THRUST:
        return "the engine cannot stop";
    case DESCENT_NO_GRAVITY:
        return "gravity is too weak";
    case DESCENT_WEAK_ENGINE:
        return "the engine cannot lift the vehicle";
    case DESCENT_NOT_ABOVE:
        return "the start does not lie above the target";
    case DESCENT_LEANS:
        return "the flight breaks the pointing limit";
    case DESCENT_BELOW_GROUND:
        return "the flight goes below the target's altitude";
    case DESCENT_TOO_FAST:
        return "the flight breaks the speed limit";
    case DESCENT_OFF_GLIDE_SLOPE:
        return "the flight breaks the glide slope limit";
    case DESCENT_NOT_FINITE:
        return "an input is not a finite number";
    case DESCENT_TOO_LARGE:
        return "a number is beyond 1e9";
    case DESCENT_BAD_VEHICLE:
        return "the vehicle or a limit is out of range";
    case DESCENT_NO_PROPELLANT:
        return "the mass does not exceed the dry mass";
    case DESCENT_BELOW_TARGET:
        return "the start lies below the target's altitude";
    case DESCENT_NO_TIME:
        return "no flight to ask, or a time that is not one";
    }
    return "unknown status";
}
