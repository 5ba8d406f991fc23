/* SPDX-License-Identifier: MIT */
/* The floor: one chain of two-node Reissner cells, written by hand for this and nothing else.

   Statics, and the midpoint rule that conserves energy exactly; Newton's method; equations solved
   by banded LU without pivoting, or by eliminating node after node while cells are computed.

       floor banded|fused P1 cells load_steps turns
       floor banded|fused P2|P5 cells steps dt

   A node has (x, y, phi). A cell knows a, b = dx/ds, dy/ds, and phi in its middle. */

#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct { double h, EA, GA, EI, rhoA, rhoI; } Cell;
typedef struct { double A[9], B[9], C[9], D[9], f[6]; } Blocks; /* [A B; C D] of both nodes */

static int n, clamped;             /* cells; whether node 0 is held */
static Cell cell;
static double dt;                  /* 0 in statics */
static double *q0, *q, *v;         /* motion before, now; velocity before */
static double end_force[2][3];     /* on node 0 and node n */
static double *gain, *rest;        /* fused: x_i = rest_i - gain_i x_{i+1} */
static double *band, *right;       /* banded: 11 entries a row */

static double seconds(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static double peak_memory(void) { /* MB */
    char line[256];
    long kB = 0;
    FILE *file = fopen("/proc/self/status", "r");
    while (file && fgets(line, sizeof line, file)) sscanf(line, "VmHWM: %ld", &kB);
    if (file) fclose(file);
    return kB / 1024.0;
}

/* -- cells ------------------------------------------------------------------------------------- */

/* Forces g on (a, b, phi) and their derivatives K: statics. */
static inline void statics(const double *p, double g[3], double K[9]) {
    double a = (p[3] - p[0]) / cell.h, b = (p[4] - p[1]) / cell.h, s, c;
    sincos(0.5 * (p[2] + p[5]), &s, &c);
    double along = c * a + s * b, across = c * b - s * a;
    double N = cell.EA * (along - 1), V = cell.GA * across;
    double dN[3] = {cell.EA * c, cell.EA * s, cell.EA * across};
    double dV[3] = {-cell.GA * s, cell.GA * c, -cell.GA * along};
    g[0] = N * c - V * s, g[1] = N * s + V * c, g[2] = N * across - V * along;
    for (int j = 0; j < 3; j++) {
        K[j] = dN[j] * c - dV[j] * s;
        K[3 + j] = dN[j] * s + dV[j] * c;
        K[6 + j] = dN[j] * across - dV[j] * along;
    }
    K[2] -= g[1], K[5] += g[0];
    K[6] -= g[1], K[7] += g[0], K[8] -= N * along + V * across;
}

/* The same for a step from o to p: mean forces times variations that map the step onto the
   increments of the strains. */
static inline void midpoint(const double *o, const double *p, double g[3], double K[9]) {
    double a0 = (o[3] - o[0]) / cell.h, b0 = (o[4] - o[1]) / cell.h, t0 = 0.5 * (o[2] + o[5]);
    double a1 = (p[3] - p[0]) / cell.h, b1 = (p[4] - p[1]) / cell.h, t1 = 0.5 * (p[2] + p[5]);
    double s0, c0, s1, c1, sm, cm;
    sincos(t0, &s0, &c0), sincos(t1, &s1, &c1), sincos(0.5 * (t0 + t1), &sm, &cm);
    double x = 0.5 * (t1 - t0), S = 1 - x * x / 6, dS = -x / 6; /* sin(x)/x, d/dt1 of it */
    if (fabs(x) > 1e-3) S = sin(x) / x, dS = 0.5 * (cos(x) - S) / x;
    double a = 0.5 * (a0 + a1), b = 0.5 * (b0 + b1), c = 0.5 * (c0 + c1), s = 0.5 * (s0 + s1);
    double along = c1 * a1 + s1 * b1, across = c1 * b1 - s1 * a1;
    double N = cell.EA * (0.5 * (c0 * a0 + s0 * b0 + along) - 1);
    double V = cell.GA * 0.5 * (c0 * b0 - s0 * a0 + across);
    double P = b * cm - a * sm, Q = -a * cm - b * sm; /* variations of both by phi, over S */
    double dN[3] = {0.5 * cell.EA * c1, 0.5 * cell.EA * s1, 0.5 * cell.EA * across};
    double dV[3] = {-0.5 * cell.GA * s1, 0.5 * cell.GA * c1, -0.5 * cell.GA * along};
    g[0] = N * c - V * s, g[1] = N * s + V * c, g[2] = S * (N * P + V * Q);
    for (int j = 0; j < 3; j++) {
        K[j] = dN[j] * c - dV[j] * s;
        K[3 + j] = dN[j] * s + dV[j] * c;
        K[6 + j] = S * (dN[j] * P + dV[j] * Q);
    }
    K[2] -= 0.5 * (N * s1 + V * c1), K[5] += 0.5 * (N * c1 - V * s1);
    K[6] -= 0.5 * S * (N * sm + V * cm), K[7] += 0.5 * S * (N * cm - V * sm);
    K[8] += dS * (N * P + V * Q) + 0.5 * S * (N * Q - V * P);
}

/* Residual and tangent of cell e by the motions of its nodes. */
static inline void blocks(int e, Blocks *out) {
    const double *p = q + 3 * e, *o = q0 + 3 * e, *w = v + 3 * e, h = cell.h;
    double g[3], K[9], M, KM;
    if (dt == 0) {
        statics(p, g, K);
        M = cell.EI * (p[5] - p[2]) / h, KM = cell.EI / h;
    } else {
        midpoint(o, p, g, K);
        M = 0.5 * cell.EI * (p[5] - p[2] + o[5] - o[2]) / h, KM = 0.5 * cell.EI / h;
    }
    double xx = K[0] / h, xy = K[1] / h, yx = K[3] / h, yy = K[4] / h;
    double xt = 0.5 * K[2], yt = 0.5 * K[5], tx = 0.5 * K[6], ty = 0.5 * K[7], tt = 0.25 * h * K[8];
    *out = (Blocks){
        .A = {xx, xy, -xt, yx, yy, -yt, -tx, -ty, tt + KM},
        .B = {-xx, -xy, -xt, -yx, -yy, -yt, tx, ty, tt - KM},
        .C = {-xx, -xy, xt, -yx, -yy, yt, -tx, -ty, tt - KM},
        .D = {xx, xy, xt, yx, yy, yt, tx, ty, tt + KM},
        .f = {-g[0], -g[1], 0.5 * h * g[2] - M, g[0], g[1], 0.5 * h * g[2] + M},
    };
    if (dt == 0) return;
    double k = 2 / (dt * dt), mass[3] = {cell.rhoA * h / 6, cell.rhoA * h / 6, cell.rhoI * h / 6};
    for (int i = 0; i < 3; i++) {
        double m = mass[i], r = k * (p[i] - o[i] - dt * w[i]);
        double R = k * (p[i + 3] - o[i + 3] - dt * w[i + 3]);
        out->f[i] += m * (2 * r + R), out->f[i + 3] += m * (r + 2 * R);
        out->A[4 * i] += 2 * k * m, out->D[4 * i] += 2 * k * m;
        out->B[4 * i] += k * m, out->C[4 * i] += k * m;
    }
}

/* -- equations: Newton's correction is taken off q; its largest entry ---------------------------- */

/* G = D^-1 B, g = D^-1 r */
static inline void divide(const double D[9], const double B[9], const double r[3], double G[9],
                          double g[3]) {
    double m0 = D[4] * D[8] - D[5] * D[7], m1 = D[5] * D[6] - D[3] * D[8];
    double m2 = D[3] * D[7] - D[4] * D[6], w = 1 / (D[0] * m0 + D[1] * m1 + D[2] * m2);
    double I[9] = {m0 * w, (D[2] * D[7] - D[1] * D[8]) * w, (D[1] * D[5] - D[2] * D[4]) * w,
                   m1 * w, (D[0] * D[8] - D[2] * D[6]) * w, (D[2] * D[3] - D[0] * D[5]) * w,
                   m2 * w, (D[1] * D[6] - D[0] * D[7]) * w, (D[0] * D[4] - D[1] * D[3]) * w};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            G[3 * i + j] = I[3 * i] * B[j] + I[3 * i + 1] * B[3 + j] + I[3 * i + 2] * B[6 + j];
        g[i] = I[3 * i] * r[0] + I[3 * i + 1] * r[1] + I[3 * i + 2] * r[2];
    }
}

static double fused(void) {
    double D[9] = {0}, r[3], most = 0;
    Blocks k;
    for (int i = 0; i < 3; i++) r[i] = -end_force[0][i];
    for (int e = 0; e < n; e++) {
        double *G = gain + 9 * (size_t)e, *g = rest + 3 * (size_t)e;
        blocks(e, &k);
        if (e == 0 && clamped) {
            memset(G, 0, 9 * sizeof *G), memset(g, 0, 3 * sizeof *g);
        } else {
            for (int i = 0; i < 9; i++) D[i] += k.A[i];
            for (int i = 0; i < 3; i++) r[i] += k.f[i];
            divide(D, k.B, r, G, g);
        }
        for (int i = 0; i < 3; i++) {
            const double *c = k.C + 3 * i;
            for (int j = 0; j < 3; j++)
                D[3 * i + j] = k.D[3 * i + j] - c[0] * G[j] - c[1] * G[3 + j] - c[2] * G[6 + j];
            r[i] = k.f[3 + i] - c[0] * g[0] - c[1] * g[1] - c[2] * g[2];
        }
    }
    double x[3], none[9] = {0}, unused[9];
    for (int i = 0; i < 3; i++) r[i] -= end_force[1][i];
    divide(D, none, r, unused, x);
    for (int e = n;; e--) {
        for (int i = 0; i < 3; i++) q[3 * e + i] -= x[i], most = fmax(most, fabs(x[i]));
        if (e == 0) return most;
        const double *G = gain + 9 * (size_t)(e - 1), *g = rest + 3 * (size_t)(e - 1);
        double y[3];
        for (int i = 0; i < 3; i++)
            y[i] = g[i] - G[3 * i] * x[0] - G[3 * i + 1] * x[1] - G[3 * i + 2] * x[2];
        memcpy(x, y, sizeof x);
    }
}

static double banded(void) {
    int rows = 3 * (n + 1);
    double most = 0;
    Blocks k;
    memset(band, 0, sizeof *band * 11 * (size_t)rows), memset(right, 0, sizeof *right * rows);
    for (int e = 0; e < n; e++) {
        blocks(e, &k);
        for (int i = 0; i < 3; i++) {
            double *upper = band + 11 * (size_t)(3 * e + i) + 5 - i, *lower = upper + 33;
            for (int j = 0; j < 3; j++) {
                upper[j] += k.A[3 * i + j], upper[3 + j] += k.B[3 * i + j];
                lower[j - 3] += k.C[3 * i + j], lower[j] += k.D[3 * i + j];
            }
            right[3 * e + i] += k.f[i], right[3 * e + 3 + i] += k.f[3 + i];
        }
    }
    for (int i = 0; i < 3; i++) right[i] -= end_force[0][i], right[3 * n + i] -= end_force[1][i];
    for (int i = 0; clamped && i < 3; i++) {
        memset(band + 11 * i, 0, 11 * sizeof *band), band[11 * i + 5] = 1, right[i] = 0;
        for (int j = 0; j < 3; j++) band[11 * (3 + i) + 2 - i + j] = 0;
    }
    for (int r = 0; r < rows; r++) {
        const double *pivot = band + 11 * (size_t)r + 5;
        for (int d = 1; d <= 5 && r + d < rows; d++) {
            double *row = band + 11 * (size_t)(r + d) + 5 - d, factor = row[0] / pivot[0];
            for (int j = 1; j <= 5; j++) row[j] -= factor * pivot[j];
            right[r + d] -= factor * right[r];
        }
    }
    for (int r = rows - 1; r >= 0; r--) {
        const double *row = band + 11 * (size_t)r + 5;
        for (int j = 1; j <= 5 && r + j < rows; j++) right[r] -= row[j] * right[r + j];
        right[r] /= row[0], q[r] -= right[r], most = fmax(most, fabs(right[r]));
    }
    return most;
}

/* -- problems ---------------------------------------------------------------------------------- */

int main(int count, char **word) {
    if (count < 6) return 1;
    double (*correct)(void) = strcmp(word[1], "fused") ? banded : fused;
    int problem = word[2][1] - '0', steps = atoi(word[4]), iterations = 0;
    double last = atof(word[5]), x0 = 0, angle = 0;
    n = atoi(word[3]), clamped = problem != 2, dt = problem == 1 ? 0 : last;
    double E = 73e9, A = 2e-4, I = 0.1667e-8;
    cell = (Cell){1.0 / n, E * A, 5. / 6 * E / 2.6 * A, E * I, 2700 * A, 2700 * I};
    if (problem == 2) {
        cell = (Cell){10.0 / n, 1e4, 1e4, 100, 1, 10};
        x0 = 6, angle = atan2(8, -6);
    }
    size_t size = 3 * (size_t)(n + 1);
    q0 = calloc(size, 8), q = calloc(size, 8), v = calloc(size, 8);
    if (correct == fused) gain = malloc(72 * (size_t)(n + 1)), rest = malloc(8 * size);
    else band = malloc(88 * (size + 5)), right = malloc(8 * size);
    for (int i = 0; i <= n; i++) {
        q[3 * i] = x0 + i * cell.h * cos(angle), q[3 * i + 1] = i * cell.h * sin(angle);
        q[3 * i + 2] = angle;
    }
    memcpy(q0, q, 8 * size);
    double wall = seconds(CLOCK_MONOTONIC), cpu = seconds(CLOCK_PROCESS_CPUTIME_ID);
    for (int step = 1; step <= steps; step++) {
        double middle = (step - 0.5) * dt, change;
        int on = problem == 2 && middle < 2.5, tries = 0;
        end_force[0][0] = 8 * on, end_force[0][2] = -80 * on;
        if (problem == 1) end_force[1][2] = 2 * M_PI * last * cell.EI * step / steps;
        if (problem == 5) end_force[1][1] = -100 * middle / 0.02;
        for (size_t i = 0; i < size; i++) q[i] += dt * v[i];
        do {
            change = correct(), iterations++;
        } while (change > 1e-7 && ++tries < 40);
        if (!(change <= 1e-7)) return printf("{\"failed\": \"step %d\"}\n", step), 0;
        if (dt == 0) continue;
        for (size_t i = 0; i < size; i++) v[i] = 2 / dt * (q[i] - q0[i]) - v[i], q0[i] = q[i];
    }
    wall = seconds(CLOCK_MONOTONIC) - wall, cpu = seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    double *end = q + size - 3;
    printf("{\"wall\": %.9g, \"cpu\": %.9g, \"steps\": %d, \"newton\": %d, \"memory\": %.2f, "
           "\"memory_before\": 0, \"values\": {\"ends\": [[%.12g, %.12g], [%.12g, %.12g]], \"tip\": [%.15g, %.15g]}}\n",
           wall, cpu, steps, iterations, peak_memory(), q[0], q[1], end[0], end[1], end[0],
           end[1]);
    return 0;
}
