/* SPDX-License-Identifier: MIT */
/* Embedded hinges: the jump of a point that opens, P(72) to P(75), and its condensation, P(76). */

/* Growth of the jump at which the stress of the bulk equals the resistance, or NAN. s gets the
 * stress and its derivative with the growth condensed.
 *
 * The excess of the stress over the resistance is positive for zero growth, falls, and is concave
 * unless the bulk flows back in tension. So Newton's method approaches the root from above, from a
 * growth that would unload the bulk. Bisection takes over outside the bounds, and if steps
 * alternate without becoming shorter.
 */
static double growth_of_jump(const points *p, double *w, double *s)
{
  double t[2];
  const double *strain = w + p->strain, theta = w[THETA], way = w[DIRECTION], length = w[LENGTH];
  const double bound = fabs(s[0]) / strain[2] * length / theta + DBL_MIN;
  /* If a jump has relieved the strain, the stress of the bulk has the round-off of both. */
  const double far = fmax(fabs(strain[1]), fabs(strain[0])) * length + fabs(w[JUMP]);
  ask(p->resistance, w, 2, t);
  double excess = way * s[0] - t[0], slope = -s[1] / length - t[1];
  if (excess <= 0) return 0; /* the excess is round-off */
  double a = slope < 0 ? fmin(bound, -excess / slope) : bound, low = 0, high = INFINITY;
  double last = INFINITY;
  int turns = 0;
  for (int i = 0; i < 200; ++i) {
    w[GROWTH] = a;
    answer(p, w, s);
    ask(p->resistance, w, 2, t);
    turns = excess > 0;
    excess = way * s[0] - t[0], slope = -s[1] / length - t[1];
    turns = turns != (excess > 0);
    if (excess > 0) low = a;
    else high = a;
    double next = a - excess / slope, step = fabs(next - a);
    /* With a step as small as this, the error of the next iterate is about its square. */
    if (step <= 1e-9 * a || step <= 4 * DBL_EPSILON * (bound + far)) return next > 0 ? next : a;
    const int wanders = turns && step > last / 2;
    last = step;
    if (!(next > low && next < high) || (wanders && high < INFINITY))
      next = high < INFINITY ? (low + high) / 2 : 2 * a;
    a = next;
  }
  return NAN;
}

/* Open a point until its stress equals the resistance; s becomes the stress and its derivative. */
static void condense_hinge(const points *p, double *w, double *s)
{
  double t[2];
  w[DIRECTION] = s[0] < 0 ? -1 : 1;
  w[GROWTH] = growth_of_jump(p, w, s);
  answer(p, w, s);
  ask(p->resistance, w, 2, t);
  s[1] *= t[1] / (s[1] / w[LENGTH] + t[1]); /* P(76) */
}

/* Allow the closed points whose excess in the latest response is at least `least` to open in this
 * step. */
static void allow_opening(const points *p, double least)
{
  double s[3 + 9], *w = p->w;
  for (int i = 0; i < p->cells * p->of_cell; ++i, w += p->width) {
    if (w[FLOWS] != CLOSED || !(w[TRACTION] < INFINITY)) continue;
    answer(p, w, s);
    if (fabs(s[0]) > w[TRACTION] && fabs(s[0]) / w[TRACTION] - 1 >= least) w[FLOWS] = MAY_OPEN;
  }
}
