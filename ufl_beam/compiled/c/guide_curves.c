/* SPDX-License-Identifier: MIT */
/* Points guided along curves that are Python functions, see guides.py.
 *
 * Python computes five points of a curve at a time. The polynomial through them yields the nearest
 * point. This repeats around the nearest point until that coincides with the middle point up to
 * round-off. The polynomial also yields the derivatives there.
 */

enum { PROJECTIONS = 50, MOST_REFINEMENTS = 20 }; /* largest numbers of polynomials, and of corrections for each */

/* Number of parameter steps up to which a polynomial is trusted; correction that ends Newton's
 * method; tolerance of the last projection, relative to the scene. */
static const double TRUSTED = 32, NOTHING_LEFT = 1e-12, CLOSE_ENOUGH = 1e-9;

/* Largest distances of an end of a chord from the secant of the polynomial up to which the secant is
 * more exact, in last digits: the round-off of points, and its multiple in differences between scenes
 * whose parameters differ by 2^-13. */
static const double SECANT = 8, SECANT_OF_DERIVATIVES = 8192;

static double product_of(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1]; }

/* Compute the polynomial of the curve of guide k around the parameter s. */
static void expand_curve(const guides *g, int k, double s, curve_around *c)
{
  double p[CURVE_POINTS][2];
  g->points(g->curve[k], s, g->step[k], p[0]);
  c->middle = s;
  for (int i = 0; i < 2; ++i) {
    const double odd = p[3][i] - p[1][i], even = p[3][i] + p[1][i] - 2 * p[2][i];
    const double far_odd = p[4][i] - p[0][i], far_even = p[4][i] + p[0][i] - 2 * p[2][i];
    c->a[0][i] = p[2][i];
    c->a[1][i] = (8 * odd - far_odd) / 12;
    c->a[2][i] = (16 * even - far_even) / 24;
    c->a[3][i] = (far_odd - 2 * odd) / 12;
    c->a[4][i] = (far_even - 4 * even) / 24;
  }
}

/* Displacement from the middle point to the point u steps further, and its derivatives by u. */
static void derive(const curve_around *c, double u, double *way, double *slope, double *bend)
{
  for (int i = 0; i < 2; ++i) {
    const double a1 = c->a[1][i], a2 = c->a[2][i], a3 = c->a[3][i], a4 = c->a[4][i];
    way[i] = u * (a1 + u * (a2 + u * (a3 + u * a4)));
    slope[i] = a1 + u * (2 * a2 + u * (3 * a3 + u * 4 * a4));
    bend[i] = 2 * a2 + u * (6 * a3 + u * 12 * a4);
  }
}

/* Steps from the middle to the point nearest to p; beyond the trusted range, steps along the
 * tangent. */
static double steps_to(const curve_around *c, const double *p)
{
  double u = 0, along_tangent = NAN;
  for (int i = 0; i < MOST_REFINEMENTS; ++i) {
    double way[2], slope[2], bend[2];
    derive(c, u, way, slope, bend);
    const double gap[2] = {p[0] - c->a[0][0] - way[0], p[1] - c->a[0][1] - way[1]};
    const double square = product_of(slope, slope), along = product_of(gap, slope);
    const double change = along / fmax(square - product_of(gap, bend), square / 2);
    if (i == 0) along_tangent = along / square;
    u += change;
    if (!(fabs(u) <= TRUSTED)) break;
    if (fabs(change) <= NOTHING_LEFT) return u;
  }
  return along_tangent;
}

/* Find the point of a curve nearest to p, starting from the latest one, and the derivatives there;
 * returns whether there is one. */
static int find_nearest(const guides *g, int k, const double *p, double *on, double *slope, double *bend)
{
  curve_around *c = g->around + k;
  double s = g->s[k], way[2], left = 4 * last_digit(g->size + hypot(p[0], p[1]));
  for (int i = 0; i < PROJECTIONS && isfinite(s); ++i) {
    if (i > 0 || isnan(c->middle)) expand_curve(g, k, s, c);
    const double u = steps_to(c, p);
    s = c->middle + u * g->step[k];
    if (i == PROJECTIONS - 1) left = CLOSE_ENOUGH * g->size;
    if (!(fabs(u) * hypot(c->a[1][0], c->a[1][1]) <= left)) continue;
    g->s[k] = s;
    derive(c, u, way, slope, bend);
    for (int j = 0; j < 2; ++j) on[j] = c->a[0][j] + way[j];
    return 1;
  }
  c->middle = NAN;
  return 0;
}

/* Direction d of the chord of guide k as secant of the polynomial, which ends in the middle, and the
 * derivatives of d by the ways of both ends along the curve. */
static void find_secant(const guides *g, int k, double *d, double *by_end, double *by_start)
{
  const curve_around *c = g->around + k;
  const double u = (g->s0[k] - g->s[k]) / g->step[k], *a1 = c->a[1];
  double way[2], slope[2], bend[2], along[2] = {0, 0};
  derive(c, u, way, slope, bend);
  for (int i = 0; i < 2; ++i) d[i] = a1[i] + u * (c->a[2][i] + u * (c->a[3][i] + u * c->a[4][i]));
  const double length = hypot(d[0], d[1]), end = length * hypot(a1[0], a1[1]), start = length * hypot(slope[0], slope[1]);
  for (int i = 0; i < 2; ++i) {
    d[i] /= length;
    by_end[i] = (c->a[2][i] + u * (c->a[3][i] + u * c->a[4][i])) / end;
    by_start[i] = (c->a[2][i] + u * (2 * c->a[3][i] + u * 3 * c->a[4][i])) / start;
    along[0] += d[i] * by_end[i], along[1] += d[i] * by_start[i];
  }
  for (int i = 0; i < 2; ++i) by_end[i] -= d[i] * along[0], by_start[i] -= d[i] * along[1];
}

/* Compute the frame of guide k at the position p; returns whether p has a nearest point on the
 * curve. */
static int find_frame(const guides *g, int k, const double *p, guide_frame *f)
{
  double bend[2], t[2], d[2], change[2];
  f->at[0] = NAN;
  if (!find_nearest(g, k, p, f->on, f->slope, bend)) return 0;
  const double gap[2] = {p[0] - f->on[0], p[1] - f->on[1]}, square = product_of(f->slope, f->slope);
  for (int i = 0; i < 2; ++i) t[i] = f->slope[i] / sqrt(square);
  f->n[0] = -t[1], f->n[1] = t[0];
  f->distance = product_of(f->n, gap);
  const double chord[2] = {f->on[0] - g->on0[2 * k], f->on[1] - g->on0[2 * k + 1]};
  const double length = sqrt(product_of(chord, chord));
  if (!g->over_step) {
    /* The normal at the end rotates by the curvature: dn = -curvature t t.dp / (1 - curvature
     * distance). */
    const double curvature = product_of(f->n, bend) / square;
    for (int i = 0; i < 2; ++i) d[i] = t[i], change[i] = f->n[i] * curvature / (1 - curvature * f->distance);
  } else {
    /* The round-off of points spoils the direction of a short chord, and still more its derivatives;
     * the secant has an error if the radius is small. */
    find_secant(g, k, d, change, f->by_start);
    f->secant[0] = -d[1], f->secant[1] = d[0];
    double apart = fabs(product_of(f->secant, chord)) / last_digit(g->size + hypot(p[0], p[1]));
    if (length <= g->shortest[k]) apart = 0;
    else if (!(fabs(g->s0[k] - g->s[k]) <= 2 * g->step[k])) apart = INFINITY;
    f->smooth = apart <= SECANT_OF_DERIVATIVES;
    const double way = copysign(length, product_of(chord, t));
    for (int i = 0; i < 2 && apart > SECANT; ++i) d[i] = chord[i] / way;
    /* The direction changes with the point by (I - d d) t t.dp / length. */
    const double along = product_of(d, t);
    for (int i = 0; i < 2 && !f->smooth; ++i) change[i] = (t[i] - d[i] * along) / way;
  }
  f->m[0] = -d[1], f->m[1] = d[0];
  for (int j = 0; j < 2; ++j) f->dm[0][j] = -change[1] * t[j], f->dm[1][j] = change[0] * t[j];
  f->at[0] = p[0], f->at[1] = p[1];
  return 1;
}

/* Find the frames of all guides at q, unless they are known; returns whether all are found. Python
 * reports the guide that is lost. */
int find_frames(guides *g, const double *q)
{
  for (int k = 0; k < g->number; ++k) {
    guide_frame *f = g->frame + k;
    const int32_t *dofs = g->dofs + 7 * k;
    const double p[2] = {g->point[2 * k] + q[dofs[1]], g->point[2 * k + 1] + q[dofs[3]]};
    if (f->at[0] == p[0] && f->at[1] == p[1]) continue;
    if (find_frame(g, k, p, f)) continue;
    g->lost = k;
    g->report(g->handle);
    return 0;
  }
  return 1;
}

void add_guides_force(void *self, const double *q, double *r)
{
  guides *g = self;
  const double found = find_frames(g, q) ? 0 : NAN;
  for (int k = 0; k < g->number; ++k) {
    const guide_frame *f = g->frame + k;
    const int32_t *dofs = g->dofs + 7 * k;
    const double force = q[dofs[6]] + found;
    r[dofs[1]] += force * f->m[0];
    r[dofs[3]] += force * f->m[1];
    r[dofs[6]] += f->distance + found;
  }
}

void add_guides_tangent(void *self, const double *q, double *tangent)
{
  guides *g = self;
  const double found = find_frames(g, q) ? 0 : NAN;
  for (int k = 0; k < g->number; ++k) {
    const guide_frame *f = g->frame + k;
    const int32_t *at = g->entries + 8 * k;
    const double force = q[g->dofs[7 * k + 6]] + found;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) tangent[at[2 * i + j]] += force * f->dm[i][j];
      tangent[at[4 + i]] += f->m[i];
      tangent[at[6 + i]] += f->n[i];
    }
  }
}

/* Largest distance from a curve, relative to 1 % of the scene; round-off does not count. */
double missed_by_guides(void *self, const double *q, const double *r, double scale, double moved)
{
  const guides *g = self;
  double most = 0;
  for (int k = 0; k < g->number; ++k) {
    const double *p = g->point + 2 * k, *on0 = g->on0 + 2 * k;
    const double far = g->size + fmax(fabs(p[0] + on0[0]), fabs(p[1] + on0[1]));
    const double left = fabs(r[g->dofs[7 * k + 6]]) - 8 * last_digit(far);
    if (left > 0) most = fmax(most, left / (0.01 * g->size));
  }
  return most;
}

/* Begin at the points of the last step. Later results of iterates are discarded, as a restart from
 * a checkpoint does not have them. */
void begin_guides(void *self, const time_step *step, const double *q1, const double *s)
{
  const guides *g = self;
  for (int k = 0; k < g->number; ++k) {
    g->s[k] = g->s0[k];
    g->around[k].middle = g->frame[k].at[0] = NAN;
  }
}

/* Store the points on the curves as the accepted state, unless a guide is lost. */
void accept_guides(void *self, const time_step *step, const double *q1, const double *s)
{
  guides *g = self;
  if (!find_frames(g, q1)) return;
  for (int k = 0; k < g->number; ++k) {
    const guide_frame *f = g->frame + k;
    memcpy(g->on0 + 2 * k, f->on, sizeof f->on);
    g->step[k] *= g->reach * g->size / sqrt(product_of(f->slope, f->slope));
    g->distance[k] = f->distance;
    g->s0[k] = g->s[k];
  }
  begin_guides(g, step, q1, s);
}
