/* The catalogue's chain of N four-bars by hand, in minimal form: one equation of motion in the first upright's angle.
 *
 * Loop after loop the end of one upright and the pin of the next give the coupler and the next upright in closed form (a
 * dyad of two rods of length 1); of its two solutions that is taken whose coupler is nearer to what it was after the last
 * step. The 2 x 2 block of each loop and all sums then run along arrays, so that the compiler makes vectors of them; from
 * loop to loop go only two short recursions, for the rates and for their rates. Nothing is known here of all loops being
 * parallelograms.
 *
 * Usage: chain N [time in s] */

#include "dop853.h"
#include <stdlib.h>

#define G 9.81
#define J (1.0 / 3.0)   /* of an upright about its pin, 1 kg and 1 m */
#define IC (1.0 / 12.0) /* of a coupler about its centre */

/* Directions of uprights (u) and couplers (k), those of the couplers after the last step; per loop the rates of coupler
 * and upright over that of the upright before, and over that of the first. */
typedef struct {
    int loops;
    double *ux, *uy, *kx, *ky, *last_x, *last_y, *coupler, *upright, *a, *ak, *e, *ek;
} Chain;

#define ARRAYS 12

static void positions(double angle, const Chain *chain) {
    double ux = cos(angle), uy = sin(angle);
    chain->ux[0] = ux;
    chain->uy[0] = uy;
    for (int i = 0; i < chain->loops; i++) {
        const double rx = 1.0 - ux, r2 = rx * rx + uy * uy, h = sqrt((1.0 - 0.25 * r2) / r2);
        const double gx = h * uy, gy = h * rx;
        const double sign = copysign(1.0, gx * chain->last_x[i] + gy * chain->last_y[i]);
        const double kx = 0.5 * rx + sign * gx, ky = sign * gy - 0.5 * uy;
        chain->kx[i] = kx;
        chain->ky[i] = ky;
        chain->ux[i + 1] = ux = kx - rx;
        chain->uy[i + 1] = uy = ky + uy;
    }
}

static void field(const double *state, double *rate, void *problem) {
    Chain *chain = problem;
    const int n = chain->loops;
    const double w2 = state[1] * state[1];
    positions(state[0], chain);
    const double *restrict ux = chain->ux, *restrict uy = chain->uy, *restrict kx = chain->kx, *restrict ky = chain->ky;
    double *restrict coupler = chain->coupler, *restrict upright = chain->upright;
    double *restrict a = chain->a, *restrict ak = chain->ak, *restrict e = chain->e, *restrict ek = chain->ek;
    for (int i = 0; i < n; i++) {
        const double over = 1.0 / (kx[i] * uy[i + 1] - ky[i] * ux[i + 1]);
        coupler[i] = -(ux[i] * uy[i + 1] - uy[i] * ux[i + 1]) * over;
        upright[i] = -(ux[i] * ky[i] - uy[i] * kx[i]) * over;
        ek[i] = over;
    }
    a[0] = 1.0;
    for (int i = 0; i < n; i++) a[i + 1] = a[i] * upright[i];
    for (int i = 0; i < n; i++) {
        const double c12 = ux[i] * kx[i] + uy[i] * ky[i], c13 = ux[i] * ux[i + 1] + uy[i] * uy[i + 1];
        const double c23 = kx[i] * ux[i + 1] + ky[i] * uy[i + 1], over = ek[i];
        ak[i] = a[i] * coupler[i];
        const double n1 = a[i] * a[i] * w2, n2 = ak[i] * ak[i] * w2, n3 = a[i + 1] * a[i + 1] * w2;
        ek[i] = (n1 * c13 + n2 * c23 - n3) * over;
        e[i + 1] = (n1 * c12 + n2 - n3 * c23) * over;
    }
    e[0] = 0.0;
    for (int i = 0; i < n; i++) e[i + 1] += e[i] * upright[i];
    double mass = J, inertia = 0.0, weight = 0.5 * ux[0];
#pragma omp simd reduction(+ : mass, inertia, weight)
    for (int i = 0; i < n; i++) {
        const double rest = ek[i] + e[i] * coupler[i];
        const double n1 = a[i] * a[i] * w2, n2 = ak[i] * ak[i] * w2;
        const double dx = -a[i] * uy[i] - 0.5 * ak[i] * ky[i], dy = a[i] * ux[i] + 0.5 * ak[i] * kx[i];
        const double bx = -e[i] * uy[i] - n1 * ux[i] - 0.5 * (rest * ky[i] + n2 * kx[i]);
        const double by = e[i] * ux[i] - n1 * uy[i] + 0.5 * (rest * kx[i] - n2 * ky[i]);
        mass += IC * ak[i] * ak[i] + dx * dx + dy * dy + J * a[i + 1] * a[i + 1];
        inertia += IC * ak[i] * rest + dx * bx + dy * by + J * a[i + 1] * e[i + 1];
        weight += dy + 0.5 * a[i + 1] * ux[i + 1];
    }
    rate[0] = state[1];
    rate[1] = -(G * weight + inertia) / mass;
}

/* The couplers of the last stage, which stands at the end of the step, tell the branches of the next one. */
static void remember(double *state, void *problem) {
    (void)state;
    Chain *chain = problem;
    double *x = chain->last_x, *y = chain->last_y;
    chain->last_x = chain->kx;
    chain->last_y = chain->ky;
    chain->kx = x;
    chain->ky = y;
}

int main(int count, char **words) {
    const int n = count > 1 ? atoi(words[1]) : 40;
    const double end = count > 2 ? atof(words[2]) : 10.0, begun = seconds();
    if (n < 1) return 1;
    const size_t m = (size_t)n + 1;
    double *memory = malloc(ARRAYS * m * sizeof(double));
    if (memory == NULL) return 1;
    Chain chain = {.loops = n};
    double **parts[ARRAYS] = {&chain.ux,      &chain.uy,      &chain.kx, &chain.ky, &chain.last_x, &chain.last_y,
                              &chain.coupler, &chain.upright, &chain.a,  &chain.ak, &chain.e,      &chain.ek};
    for (size_t i = 0; i < ARRAYS; i++) *parts[i] = memory + i * m;
    double y[2], room[MARCH_ROOM(2)], fastest = INFINITY;
    Work work = {0, 0};
    for (int run = 0; run < 3 || seconds() - begun < 0.3; run++) {
        const double start = seconds();
        for (int i = 0; i < n; i++) {
            chain.last_x[i] = 1.0;
            chain.last_y[i] = 0.0;
        }
        y[0] = M_PI / 2.0;
        y[1] = -1.0;
        work = march(2, field, remember, &chain, y, end, 1e-10, 1e-12, room);
        const double took = seconds() - start;
        if (took < fastest) fastest = took;
    }
    tell(fastest, work, y[0], y[1], alone(2, field, &chain, y));
    free(memory);
    return 0;
}
