/* Andrews' squeezing mechanism by hand: one equation of motion in the crank's angle, the rest in closed form.
 *
 * Three dyads: crank pin F and ground pin B give E; ground pin A and E give G on one side and, as its mirror image, H
 * on the other. Vectors along the links from pin to pin take the place of angles, so that one sine and cosine, two roots
 * and few divisions make an evaluation.
 *
 * Usage: andrews [time in s] */

#include "dop853.h"
#include <stdlib.h>

typedef struct {
    double x, y;
} V;

static inline V sum(V a, V b) { return (V){a.x + b.x, a.y + b.y}; }
static inline V difference(V a, V b) { return (V){a.x - b.x, a.y - b.y}; }
static inline V times(double s, V a) { return (V){s * a.x, s * a.y}; }
static inline V turned(V a) { return (V){-a.y, a.x}; } /* by a right angle */
static inline double dot(V a, V b) { return a.x * b.x + a.y * b.y; }
static inline double cross(V a, V b) { return a.x * b.y - a.y * b.x; }

/* Rates a, b with a turned(p) + b turned(q) = of. */
static inline void rates(V p, V q, V of, double *a, double *b) {
    const double per = 1.0 / cross(p, q);
    *a = dot(of, q) * per;
    *b = -dot(of, p) * per;
}

static const V at_a = {-0.06934, -0.00227}, at_b = {-0.03635, 0.03273}, at_c = {0.014, 0.072};

#define CRANK 0.007
#define EF 0.028
#define EB 0.035
#define AG 0.04 /* AH too */
#define GE 0.02 /* HE too */

typedef struct {
    double mass, inertia, work; /* of the equation mass angle'' + inertia = work */
} Sums;

/* One link: centre of mass at `c` from a point whose rate is `v` and bias `a`; rate and bias of its angle. */
static inline void link(Sums *s, double m, double moment, V c, V v, V a, double rate, double bias) {
    const V n = turned(c), u = sum(v, times(rate, n));
    const V b = sum(a, difference(times(bias, n), times(rate * rate, c)));
    s->mass += m * dot(u, u) + moment * rate * rate;
    s->inertia += m * dot(u, b) + moment * rate * bias;
}

static void field(const double *y, double *rate, void *problem) {
    (void)problem;
    const double w2 = y[1] * y[1];
    const V u = {cos(y[0]), sin(y[0])}, f = times(CRANK, u), none = {0.0, 0.0};
    /* E: to the left of the line from F to B */
    const V fb = difference(at_b, f);
    const double r2 = dot(fb, fb), along = 0.5 * (EF * EF - EB * EB + r2), per = 1.0 / r2;
    const double across = sqrt(EF * EF * r2 - along * along);
    const V fe = times(per, sum(times(along, fb), times(across, turned(fb)))), e = sum(f, fe), be = difference(e, at_b);
    /* G to the left of the line from A to E, H to its right */
    const V ae = difference(e, at_a);
    const double q2 = dot(ae, ae), far = 0.5 * (AG * AG - GE * GE + q2), over = 1.0 / q2;
    const double aside = sqrt(AG * AG * q2 - far * far);
    const V middle = times(far * over, ae), side = times(aside * over, turned(ae));
    const V ag = sum(middle, side), ge = difference(ae, ag), ah = difference(middle, side), he = difference(ae, ah);

    /* per unit rate of the crank */
    double a_ef, a_eb, a_ag, a_ge, a_ah, a_he, b_ef, b_eb, b_ag, b_ge, b_ah, b_he;
    const V fv = turned(f), minus_fe = times(-1.0, fe);
    rates(be, minus_fe, fv, &a_eb, &a_ef);
    const V ev = times(a_eb, turned(be));
    rates(ag, ge, ev, &a_ag, &a_ge);
    rates(ah, he, ev, &a_ah, &a_he);
    /* what is left of accelerations where the crank's is zero, over its squared rate */
    const V fa = times(-1.0, f);
    rates(be, minus_fe, sum(fa, difference(times(a_eb * a_eb, be), times(a_ef * a_ef, fe))), &b_eb, &b_ef);
    const V ea = difference(times(b_eb, turned(be)), times(a_eb * a_eb, be));
    rates(ag, ge, sum(ea, sum(times(a_ag * a_ag, ag), times(a_ge * a_ge, ge))), &b_ag, &b_ge);
    rates(ah, he, sum(ea, sum(times(a_ah * a_ah, ah), times(a_he * a_he, he))), &b_ah, &b_he);

    const V y3 = times(-1.0 / EB, be), x3 = {y3.y, -y3.x};
    Sums s = {0.0, 0.0, 0.033};
    link(&s, 0.04325, 2.194e-6, times(0.00092, u), none, none, 1.0, 0.0);
    link(&s, 0.00365, 4.410e-7, times(-0.0165 / EF, fe), ev, ea, a_ef, b_ef);
    link(&s, 0.02373, 5.255e-6, sum(times(0.01043, x3), times(0.01626, y3)), ev, ea, a_eb, b_eb);
    link(&s, 0.07050, 1.169e-5, sum(times(0.02308 / AG, ag), times(0.00916 / AG, turned(ag))), none, none, a_ag, b_ag);
    link(&s, 0.00706, 5.667e-7, times(0.00579 / GE - 1.0, ge), ev, ea, a_ge, b_ge);
    link(&s, 0.05498, 1.912e-5, sum(times(0.01228 / AG, ah), times(-0.00449 / AG, turned(ah))), none, none, a_ah, b_ah);
    link(&s, 0.00706, 5.667e-7, times(0.00579 / GE - 1.0, he), ev, ea, a_he, b_he);

    const V d = sum(times(0.02, x3), times(0.017, y3)), reach = difference(sum(e, d), at_c);
    const double length = sqrt(dot(reach, reach)), pull = 4530.0 * (length - 0.07785) / length;
    s.work -= pull * dot(reach, sum(ev, times(a_eb, turned(d))));
    rate[0] = y[1];
    rate[1] = (s.work - s.inertia * w2) / s.mass;
}

int main(int count, char **words) {
    const double end = count > 1 ? atof(words[1]) : 0.03, begun = seconds();
    double fastest = INFINITY, y[2], room[MARCH_ROOM(2)];
    Work work = {0, 0};
    for (int run = 0; run < 5 || seconds() - begun < 0.3; run++) {
        const double start = seconds();
        y[0] = -0.0617138900142764496;
        y[1] = 0.0;
        work = march(2, field, NULL, NULL, y, end, 1e-10, 1e-12, room);
        const double took = seconds() - start;
        if (took < fastest) fastest = took;
    }
    tell(fastest, work, y[0], y[1], alone(2, field, NULL, y));
    return 0;
}
