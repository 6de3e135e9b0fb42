/* Prince and Dormand's method of order eight, as Hairer, Norsett and Wanner arrange it (DOP853).
 * The numbers are those of crates/partita-integrate/src/tableau/dop853.rs; so is the norm, the largest component. */

#ifndef DOP853_H
#define DOP853_H

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <time.h>

#define STAGES 12

typedef struct {
    long steps, evaluations;
} Work;

/* y' = f(t, y); `problem` is what f needs to know. */
typedef void (*Field)(const double *y, double *rate, void *problem);

/* What is done to y after an accepted step. */
typedef void (*Accepted)(double *y, void *problem);

static const double A[STAGES][STAGES] = {
    {0.0},
    {0.05260015195876773},
    {0.0197250569845379, 0.0591751709536137},
    {0.02958758547680685, 0.0, 0.08876275643042054},
    {0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792},
    {1.0 / 27.0, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242},
    {0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125},
    {
        0.03709200011850479, 0.0, 0.0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402,
        0.008273789163814023,
    },
    {
        0.6241109587160757, 0.0, 0.0, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894,
        -43.48988418106996,
    },
    {
        0.47766253643826434, 0.0, 0.0, -2.4881146199716677, -0.590290826836843, 21.230051448181193,
        15.279233632882423, -33.28821096898486, -0.020331201708508627,
    },
    {
        -0.9371424300859873, 0.0, 0.0, 5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696,
        22.739487099350505, 2.4936055526796523, -3.0467644718982196,
    },
    {
        2.273310147516538, 0.0, 0.0, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996,
        -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636,
    },
};

static const double B[STAGES] = {
    0.054293734116568765, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259,
};

static const double FIFTH[STAGES] = {
    0.01312004499419488, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
    -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
};

static const double THIRD[STAGES] = {
    -0.18980075407240762, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082,
};

static double largest(double a, double b) { return a > b ? a : b; }

/* Room for a march of n equations. */
#define MARCH_ROOM(n) ((size_t)(STAGES + 1) * (size_t)(n))

/* March y (n) from 0 to `end`; `room` holds MARCH_ROOM(n) numbers. `correct` may move y after an accepted step. Inlined,
 * so that a constant n is unrolled and a large one runs along memory. */
static inline __attribute__((always_inline)) Work march(int n, Field f, Accepted correct, void *problem, double *y,
                                                        double end, double rtol, double atol, double *room) {
    double *const k = room, *const at = room + (size_t)STAGES * (size_t)n;
    double t = 0.0, h = 1e-4;
    Work work = {0, 1};
    int rejected = 0;
    f(y, k, problem);
    while (t < end) {
        if (t + h > end) h = end - t;
#pragma GCC unroll 12
        for (int s = 1; s < STAGES; s++) {
            for (int i = 0; i < n; i++) at[i] = y[i];
#pragma GCC unroll 12
            for (int j = 0; j < s; j++) {
                if (A[s][j] == 0.0) continue;
                const double weight = h * A[s][j], *const of = k + (size_t)j * (size_t)n;
                for (int i = 0; i < n; i++) at[i] += weight * of[i];
            }
            f(at, k + (size_t)s * (size_t)n, problem);
        }
        work.evaluations += STAGES - 1;
        double fifth = 0.0, third = 0.0;
        for (int i = 0; i < n; i++) {
            double sum = 0.0, e5 = 0.0, e3 = 0.0;
#pragma GCC unroll 12
            for (int s = 0; s < STAGES; s++) {
                const double rate = k[(size_t)s * (size_t)n + (size_t)i];
                sum += B[s] * rate;
                e5 += FIFTH[s] * rate;
                e3 += THIRD[s] * rate;
            }
            at[i] = y[i] + h * sum;
            const double over = 1.0 / (atol + rtol * largest(fabs(y[i]), fabs(at[i])));
            fifth = largest(fifth, fabs(e5) * over);
            third = largest(third, fabs(e3) * over);
        }
        const double together = sqrt(fifth * fifth + 0.01 * third * third);
        const double error = together > 0.0 ? h * fifth * fifth / together : 0.0;
        double factor = error > 0.0 ? 0.9 * pow(error, -0.125) : 6.0;
        factor = factor < 1.0 / 3.0 ? 1.0 / 3.0 : factor > 6.0 ? 6.0 : factor;
        if (error <= 1.0) {
            t += h;
            for (int i = 0; i < n; i++) y[i] = at[i];
            work.steps++;
            if (correct) correct(y, problem);
            if (t < end) {
                f(y, k, problem);
                work.evaluations++;
            }
            h *= rejected && factor > 1.0 ? 1.0 : factor;
            rejected = 0;
        } else {
            h *= error > 1.0 ? factor : 0.1; /* or not a number: the step left the mechanism's reach */
            rejected = 1;
        }
        if (h < 1e-14) break;
    }
    return work;
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Seconds of one evaluation alone, at states that differ a little from each other. */
static inline __attribute__((always_inline)) double alone(int n, Field f, void *problem, const double *at) {
    double y[2], rate[2], total = 0.0, fastest = INFINITY;
    for (int round = 0; round < 20; round++) {
        const double start = seconds();
        long count = 0;
        while (seconds() - start < 2e-3) {
            for (int i = 0; i < 16; i++, count++) {
                for (int j = 0; j < n; j++) y[j] = at[j];
                y[0] += 1e-6 * (double)(count % 1024);
                f(y, rate, problem);
                total += rate[n - 1];
            }
        }
        const double each = (seconds() - start) / (double)count;
        if (each < fastest) fastest = each;
    }
    return total == 0.123 ? 0.0 : fastest; /* so that no evaluation is left out */
}

/* One line of JSON: the fastest run, what it did and where it ended; one evaluation alone. */
static void tell(double fastest, Work work, double angle, double rate, double evaluation) {
    printf("{\"seconds\": %.9e, \"steps\": %ld, \"evaluations\": %ld, \"angle\": %.15e, \"rate\": %.15e, "
           "\"evaluation\": %.9e}\n",
           fastest, work.steps, work.evaluations, angle, rate, evaluation);
}

#endif
