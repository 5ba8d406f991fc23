/* SPDX-License-Identifier: MIT */
/* Return map of material points in cells, see material_points.py. */

static const double unit_cell[6] = {0, 0, 0, 1, 0, 0};

static void ask(kernel *tabulate, const double *w, int answers, double *e)
{
  memset(e, 0, answers * sizeof *e);
  CALL(tabulate, e, w, 0, unit_cell);
}

/* Growth at which the excess of what the bulk bears over the resistance vanishes, or NAN.
 *
 * The excess is positive at zero, falls, and is concave unless the bulk flows back in tension:
 * Newton's method comes to its root from above, from where the bulk would be unloaded. Bisection
 * stands by.
 */
static double growth(kernel *excess, double *w)
{
  double g[2], theta = w[THETA];
  double strain = (1 - theta) * w[BEFORE] + theta * w[STRAIN] - w[JUMP] / w[LENGTH];
  double bound = fabs(strain - w[PLASTIC]) * w[LENGTH] / theta + DBL_MIN;
  /* Where a jump has relieved the strain, what the bulk bears has the last digits of both. */
  double far = fmax(fabs(w[BEFORE]), fabs(w[STRAIN])) * w[LENGTH] + fabs(w[JUMP]);
  w[GROWTH] = 0;
  ask(excess, w, 2, g);
  if (g[0] <= 0) return 0; /* over the limit by a last digit */
  double a = g[1] < 0 ? fmin(bound, -g[0] / g[1]) : bound, low = 0, high = INFINITY;
  for (int i = 0; i < 200; ++i) {
    w[GROWTH] = a;
    ask(excess, w, 2, g);
    if (g[0] > 0) low = a;
    else high = a;
    double next = a - g[0] / g[1], step = fabs(next - a);
    /* So small a relative step was the last but none: the next one would be its square. */
    if (step <= 1e-9 * a || step <= 4 * DBL_EPSILON * (bound + far)) return next > 0 ? next : a;
    if (!(next > low && next < high)) next = high < INFINITY ? (low + high) / 2 : 2 * a;
    a = next;
  }
  return NAN;
}

/* Resultants r of cells whose strains grow from e0 to e1, and their derivatives D.
 *
 * `search` notes that a point opens, and may ask for stiff points: those that do not open answer
 * with their elastic stiffness. Where one opens, those around it unload, which their own tangents
 * do not tell, and Newton's method would close what it just opened, again and again.
 *
 * While `search` asks to hold, closed points stay closed whatever they bear, and `over` is the
 * largest of |stress| / limit - 1 of those that bear more than their limit, else zero.
 */
void respond(const points *p)
{
  double s[2], *w = p->w, *r = p->r, *D = p->D;
  const double *e0 = p->e0, *e1 = p->e1;
  *p->over = 0;
  for (int c = 0; c < p->cells; ++c, e0 += 3, e1 += 3, r += 3, D += 9) {
    memset(D, 0, 9 * sizeof *D);
    for (int k = 0; k < 3; ++k) {
      r[k] = p->rest[k] * ((1 - p->theta) * e0[k] + p->theta * e1[k]);
      D[4 * k] = p->rest[k] * p->theta;
    }
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      const double *b = p->B + 3 * i;
      w[STRAIN] = b[0] * e1[0] + b[1] * e1[1] + b[2] * e1[2];
      w[GROWTH] = w[DIRECTION] = 0;
      ask(p->bulk, w, 2, s);
      const int over = fabs(s[0]) > w[TRACTION]; /* P(51) */
      if (over && p->search[HOLD] && w[FLOWS] == CLOSED && w[TRACTION] > 0) {
        *p->over = fmax(*p->over, fabs(s[0]) / w[TRACTION] - 1);
        p->search[OVER] = 1;
      } else if (over) {
        w[DIRECTION] = s[0] < 0 ? -1 : 1;
        w[GROWTH] = growth(p->excess, w);
        ask(p->opening, w, 2, s);
        p->search[OPENED] = 1;
      } else if (p->search[STIFF]) {
        s[1] = p->theta * w[STIFFNESS];
      }
      for (int k = 0; k < 3; ++k) {
        r[k] += p->weight[i] * s[0] * b[k];
        for (int l = 0; l < 3; ++l) D[3 * k + l] += p->weight[i] * s[1] * b[k] * b[l];
      }
    }
  }
}

/* Let the closed points open, in this step, whose excess in the latest response is so large. */
void release(const points *p, double least)
{
  double s[2], *w = p->w;
  for (int i = 0; i < p->cells * p->of_cell; ++i, w += p->width) {
    if (w[FLOWS] != CLOSED || !(w[TRACTION] < INFINITY)) continue;
    ask(p->bulk, w, 2, s);
    if (fabs(s[0]) > w[TRACTION] && fabs(s[0]) / w[TRACTION] - 1 >= least) w[FLOWS] = RELEASED;
  }
}

/* Resultants as affine functions b + D e of the strains, for the tangent. */
static void linearise(const inelastic *m)
{
  const points *p = m->points;
  const double *e = p->e1, *r = p->r, *D = p->D;
  for (int c = 0; c < p->cells; ++c, e += 3, r += 3, D += 9) {
    double b[3];
    for (int k = 0; k < 3; ++k)
      b[k] = r[k] - D[3 * k] * e[0] - D[3 * k + 1] * e[1] - D[3 * k + 2] * e[2];
    put_in_cell(m->tangent, c, m->at_b, 3, b);
    put_in_cell(m->tangent, c, m->at_D, 9, D);
  }
}

/* Resultants and their derivatives at q; nothing is to do if q is the latest.
 *
 * First the strains at q, then what responds to them, then where it goes.
 */
void respond_at(const inelastic *m, const double *q)
{
  const points *p = m->points;
  if (!memcmp(q, m->latest, m->size * sizeof *q)) return;
  memcpy(m->latest, q, m->size * sizeof *q);
  memset(p->e1, 0, 3 * p->cells * sizeof *p->e1);
  add_cells((void *)m->strains, q, p->e1);
  respond(p);
  for (int c = 0; c < p->cells; ++c) put_in_cell(m->force, c, m->at_r, 3, p->r + 3 * c);
}

void add_inelastic_force(void *self, const double *q, double *r)
{
  const inelastic *m = self;
  respond_at(m, q);
  add_cells((void *)m->force, q, r);
}

/* The first tangent of a static step is of the forces before it, see beams.py. */
void add_inelastic_tangent(void *self, const double *q, double *tangent)
{
  inelastic *m = self;
  const points *p = m->points;
  respond_at(m, q);
  if (m->begins) {
    for (int c = 0; c < p->cells; ++c) memcpy(p->r + 3 * c, p->kept + POINT_KEPT * c, 3 * sizeof *p->r);
    m->latest[0] = NAN;
  }
  linearise(m);
  add_cells((void *)m->tangent, q, tangent);
  m->begins = 0;
}

/* Take the end of the step as the new state.
 *
 * Each cell keeps what it bears (3), the jump of its last point, and what it dissipated by plastic
 * strains and by discontinuities; sum gets what all cells dissipated so in the step, what they lost
 * numerically at theta = 1, what they store elastically and by hardening, what breaking points let go
 * of, and what mean stresses do more on plastic strains than those at the end, where these are less.
 */
void commit(const points *p)
{
  double s[POINT_OUTPUTS], *e0 = p->e0, *w = p->w, *kept = p->kept, *sum = p->sum;
  const double *e1 = p->e1, *rest = p->rest, *length = p->length, *weight = p->weight;
  memset(sum, 0, POINT_SUMS * sizeof *sum);
  for (int c = 0; c < p->cells; ++c, e0 += 3, e1 += 3, kept += POINT_KEPT) {
    double plastic = 0, broken = 0;
    for (int k = 0; k < 3; ++k) {
      double change = e1[k] - e0[k];
      kept[k] = rest[k] * e1[k];
      sum[2] += rest[k] * change * change / 2 * length[c];
      sum[3] += rest[k] * e1[k] * e1[k] / 2 * length[c];
      e0[k] = e1[k];
    }
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      double volume = weight[i] * length[c];
      ask(p->end, w, POINT_OUTPUTS, s);
      const double before = w[STIFFNESS] * (w[BEFORE] - w[JUMP] / w[LENGTH] - w[PLASTIC]);
      const double change = s[STRESS] - before;
      const double hardened = s[LOST] - change / w[STIFFNESS] * change / 2;
      const double relaxed = hardened - change / 2 * s[FLOW];
      if (s[FLOW] != 0 && relaxed > 0) sum[6] += volume * relaxed;
      w[BEFORE] = w[STRAIN];
      w[PLASTIC] += s[FLOW];
      w[ACCUMULATED] += fabs(s[FLOW]);
      w[JUMP] += w[DIRECTION] * w[GROWTH];
      w[OPENING] += w[GROWTH];
      w[FLOWS] = w[GROWTH] > 0 ? FLOWING : CLOSED;
      w[GROWTH] = w[DIRECTION] = 0;
      if (w[TRACTION] < INFINITY) w[TRACTION] = s[RESISTANCE];
      if (w[TRACTION] == 0) {
        /* Broken: the mean stress of each step is zero from now on, but stresses at the ends may
         * alternate about that. The discontinuity takes the elastic strain, which nothing holds. */
        w[JUMP] += s[STRESS] / w[STIFFNESS] * w[LENGTH];
        sum[5] += volume * s[ELASTIC];
        s[STRESS] = s[ELASTIC] = 0;
      }
      plastic += volume * s[WORKED];
      broken += weight[i] * s[BROKEN];
      sum[2] += volume * s[LOST];
      sum[3] += volume * s[ELASTIC];
      sum[4] += volume * s[HARDENING];
      for (int k = 0; k < 3; ++k) kept[k] += weight[i] * s[STRESS] * p->B[3 * i + k];
    }
    kept[3] = w[JUMP - p->width];
    kept[4] += plastic;
    kept[5] += broken;
    sum[0] += plastic;
    sum[1] += broken;
  }
}
