/* The catalogue's four-bar by hand: one equation of motion in the crank's angle, the rest in closed form.
 *
 * Rods as unit vectors u1, u2, u3 (crank, coupler, rocker); s and c are their cross and dot products. The square root of
 * the dyad gives u2 and u3, so that one sine and cosine, one root and few divisions make an evaluation.
 *
 * Usage: four_bar [time in s] */

#include "dop853.h"
#include <stdlib.h>

#define CRANK 0.3
#define COUPLER 0.9
#define ROCKER 0.7
#define GROUND 1.0
#define G 9.81

static void field(const double *y, double *rate, void *problem) {
    (void)problem;
    const double w1 = y[1], x1 = cos(y[0]), y1 = sin(y[0]);
    /* from the crank's end to the rocker's pin, and the coupler's end above that line */
    const double rx = GROUND - CRANK * x1, ry = -CRANK * y1, r2 = rx * rx + ry * ry;
    const double along = 0.5 * (COUPLER * COUPLER - ROCKER * ROCKER + r2), per = 1.0 / r2;
    const double across = sqrt(COUPLER * COUPLER * r2 - along * along);
    const double px = (along * rx - across * ry) * per, py = (along * ry + across * rx) * per;
    const double x2 = px / COUPLER, y2 = py / COUPLER, x3 = (px - rx) / ROCKER, y3 = (py - ry) / ROCKER;

    const double s12 = x1 * y2 - y1 * x2, s13 = x1 * y3 - y1 * x3, s23 = x2 * y3 - y2 * x3, over = 1.0 / s23;
    const double c12 = x1 * x2 + y1 * y2, c13 = x1 * x3 + y1 * y3, c23 = x2 * x3 + y2 * y3;
    const double a2 = -(CRANK / COUPLER) * s13 * over, a3 = -(CRANK / ROCKER) * s12 * over;
    const double w2 = a2 * w1, w3 = a3 * w1;
    const double n1 = CRANK * w1 * w1, n2 = COUPLER * w2 * w2, n3 = ROCKER * w3 * w3;
    const double e2 = (n1 * c13 + n2 * c23 - n3) * over / COUPLER, e3 = (n1 * c12 + n2 - n3 * c23) * over / ROCKER;

    /* rods of 1 kg/m: the mass of each is its length */
    const double j1 = CRANK * CRANK * CRANK / 3.0, j3 = ROCKER * ROCKER * ROCKER / 3.0;
    const double i2 = COUPLER * COUPLER * COUPLER / 12.0, half = 0.5 * COUPLER;
    const double dx = -CRANK * y1 - half * a2 * y2, dy = CRANK * x1 + half * a2 * x2;
    const double bx = -n1 * x1 - half * (e2 * y2 + w2 * w2 * x2), by = -n1 * y1 + half * (e2 * x2 - w2 * w2 * y2);
    const double mass = j1 + j3 * a3 * a3 + i2 * a2 * a2 + COUPLER * (dx * dx + dy * dy);
    const double weight = CRANK * 0.5 * CRANK * x1 + COUPLER * dy + ROCKER * 0.5 * ROCKER * a3 * x3;
    const double inertia = j3 * a3 * e3 + i2 * a2 * e2 + COUPLER * (dx * bx + dy * by);
    rate[0] = w1;
    rate[1] = -(G * weight + inertia) / mass;
}

int main(int count, char **words) {
    const double end = count > 1 ? atof(words[1]) : 10.0, begun = seconds();
    double fastest = INFINITY, y[2], room[MARCH_ROOM(2)];
    Work work = {0, 0};
    for (int run = 0; run < 5 || seconds() - begun < 0.3; run++) {
        const double start = seconds();
        y[0] = M_PI / 3.0;
        y[1] = 2.0;
        work = march(2, field, NULL, NULL, y, end, 1e-10, 1e-12, room);
        const double took = seconds() - start;
        if (took < fastest) fastest = took;
    }
    tell(fastest, work, y[0], y[1], alone(2, field, NULL, y));
    return 0;
}
