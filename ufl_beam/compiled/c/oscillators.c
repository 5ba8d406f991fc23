/* SPDX-License-Identifier: MIT */
/* Oscillators with a bilinear spring, for response spectra. */

/* Largest magnitude of a function in a step, from its values x and rates r at both ends. */
static double peak_in_step(double x0, double x1, double r0, double r1, double dt)
{
  double peak = fmax(fabs(x0), fabs(x1));
  if (r0 * r1 < 0) { /* value of the cubic through both ends where the linear rate is zero */
    const double s = r0 / (r0 - r1), z = 1 - s;
    peak = fmax(peak, fabs((1 + 2 * s) * z * z * x0 + s * z * z * dt * r0
                           + s * s * (1 + 2 * z) * x1 - s * s * z * dt * r1));
  }
  return peak;
}

void oscillator_peaks(const oscillator *o, int number, const double *load, double strength, double *peaks)
{
  const double w = o->omega, hardening = o->hardening, k = (1 - hardening) * w * w;
  const double limit = (1 - hardening) * strength, drag = 2 * o->damping * w;
  const double real = -o->damping * w, imaginary = w * sqrt(1 - o->damping * o->damping);
  const double *E = o->E, *c0 = o->c0, *c1 = o->c1;
  double x = 0, y = 0, u = 0, v = 0, plastic = 0; /* x + i y: complex state */
  double f1 = load[0], acceleration = 0, rate = f1, rate_of_acceleration = -drag * f1;
  peaks[0] = peaks[1] = peaks[2] = 0;
  for (int step = 0; step < (number - 1) * o->substeps; ++step) {
    const int i = step / o->substeps, j = step % o->substeps + 1;
    const double f0 = f1, g0 = f0 + k * plastic;
    f1 = load[i] + (load[i + 1] - load[i]) * j / o->substeps;
    const double g1 = f1 + k * plastic, before = x;
    x = E[0] * x - E[1] * y + c0[0] * g0 + c1[0] * g1;
    y = E[0] * y + E[1] * before + c0[1] * g0 + c1[1] * g1;
    const double force = k * (y / imaginary - plastic), excess = fabs(force) - limit;
    if (excess > 0) {
      /* Plastic flow adds k times its increment to the load at the end of the step. */
      const double flow = copysign(excess / (1 - k * c1[1] / imaginary), force); /* times k */
      x += c1[0] * flow;
      y += c1[1] * flow;
      plastic += flow / k;
    }
    const double u0 = u, v0 = v, a0 = acceleration, r0 = rate, s0 = rate_of_acceleration;
    u = y / imaginary;
    v = x + real * u;
    acceleration = -drag * v - w * w * u + k * plastic;
    rate = acceleration + f1;
    rate_of_acceleration = -drag * rate - (excess > 0 ? hardening : 1) * w * w * v;
    peaks[0] = fmax(peaks[0], peak_in_step(u0, u, v0, v, o->dt));
    peaks[1] = fmax(peaks[1], peak_in_step(v0, v, r0, rate, o->dt));
    peaks[2] = fmax(peaks[2], peak_in_step(a0, acceleration, s0, rate_of_acceleration, o->dt));
  }
}
