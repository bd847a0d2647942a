/*
 * Compares a build of powered_descent.c with vectors.csv, the answers of the Python package: statuses must be
 * equal, numbers to 1e-9, thrusts to 1e-8 of the greatest, lower bounds to 1e-6 of the propellant. A bound beside
 * a touch of the ground that lies more than 1 % of the propellant below it need only be a bound: how weak it is
 * hangs on rounding. Exit status 1 where one is not.
 */
#include "powered_descent.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define ASKED 20
#define TOLD 6

static int differs(double found, double expected, double tolerance)
{
    if (isnan(expected) || isinf(expected)) {
        return isnan(expected) ? !isnan(found) : found != expected;
    }
    return !(fabs(found - expected) <= tolerance);
}

static int parse(const char *line, double *numbers, int count)
{
    for (int k = 0; k < count; k++) {
        char *end;
        numbers[k] = strtod(line, &end);
        if (end == line) {
            return 0;
        }
        line = *end == ',' ? end + 1 : end;
    }
    return 1;
}

static int check(const double *asked, int status, const double *told)
{
    descent_vehicle vehicle = {asked[0], asked[1], asked[2], asked[3], {asked[4], asked[5], asked[6]},
                               asked[7], asked[8], asked[9]};
    descent_state state = {{asked[10], asked[11], asked[12]}, {asked[13], asked[14], asked[15]}, asked[16]};
    descent_flight flight;
    double thrust[3], small = 1e-8 * vehicle.max_thrust, close = 1e-6 * told[0];
    if ((int)descent_solve(&vehicle, &state, asked + 17, &flight) != status) {
        return 0;
    }
    if (differs(flight.propellant, told[0], 1e-9 * told[0]) ||
        differs(flight.time_of_flight, told[1], 1e-9 * told[1]) ||
        flight.lower_bound > flight.propellant) {
        return 0;
    }
    if (!(flight.touch[0] > -INFINITY && told[2] < 0.99 * told[0]) && differs(flight.lower_bound, told[2], close)) {
        return 0;
    }
    if (descent_thrust(&flight, 0.0, thrust) != DESCENT_OPTIMAL) {
        return status != DESCENT_OPTIMAL;
    }
    return !differs(thrust[0], told[3], small) && !differs(thrust[1], told[4], small) &&
           !differs(thrust[2], told[5], small);
}

int main(int count, char **arguments)
{
    char line[2048];
    int rows = 0, wrong = 0;
    FILE *file = fopen(count > 1 ? arguments[1] : "vectors.csv", "r");
    if (file == NULL || fgets(line, sizeof line, file) == NULL) {
        fprintf(stderr, "vectors.csv cannot be read\n");
        return 2;
    }
    while (fgets(line, sizeof line, file) != NULL) {
        double numbers[ASKED + 1 + TOLD];
        rows++;
        if (!parse(line, numbers, ASKED + 1 + TOLD) ||
            !check(numbers, (int)numbers[ASKED], numbers + ASKED + 1)) {
            wrong++;
            fprintf(stderr, "row %d differs: %s", rows, line);
        }
    }
    fclose(file);
    printf("%d of %d vectors agree\n", rows - wrong, rows);
    return rows == 0 || wrong > 0;
}
