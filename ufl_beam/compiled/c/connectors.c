/* SPDX-License-Identifier: MIT */
/* Connectors: rows of their laws linearized at an iterate, and the violation of the laws. */

/* Motions of the connectors at q. */
void find_motions(const connectors *c, const double *q)
{
  memset(c->e1, 0, (size_t)c->components * c->number * sizeof *c->e1);
  add_cells((void *)c->motion, q, c->e1);
}

/* Write the rows of all connectors into the coefficients of their cells. */
static void put_rows(const connectors *c)
{
  const int all = c->components * (c->components + 2);
  for (int k = 0; k < c->number; ++k) {
    put_in_cell(c->work, k, c->row, all, c->rows + all * k);
    put_in_cell(c->tangent, k, c->row_of_tangent, all, c->rows + all * k);
  }
}

/* Compute the response of springs to their motions e1. */
static void respond_springs(const connectors *c)
{
  for (int i = 0; i < c->number; ++i) c->points->e1[3 * i] = c->e1[i];
  respond(c->points);
}

/* Rows of springs, linearized at the motions e1. */
static void set_rows_of_springs(const connectors *c)
{
  const points *p = c->points;
  respond_springs(c);
  for (int i = 0; i < c->number; ++i) {
    double D = p->D[9 * i], *row = c->rows + 3 * i;
    row[0] = -D, row[1] = 1, row[2] = p->r[3 * i] - D * c->e1[i];
  }
}

/* Evaluate a law; a law without a kernel is zero. */
void ask_law(kernel *law, const double *w, int answers, double *s)
{
  if (law) ask(law, w, answers, s);
  else memset(s, 0, answers * sizeof *s);
}

/* Rows of dry friction at q. A connector sticks while its force is below the limit. It slips until
 * the sliding velocity reverses, in the middle of the step or at its end. In a long step, both slip
 * with a reversed velocity and rest can be solutions; rest is taken if it gives no energy.
 *
 * If the sliding force can be below the limit, both sticking and sliding can be solutions. While
 * HOLD is set, each connector of such a law stays on the branch of the last step until an
 * equilibrium is found. The excess measures the violation of that branch; the time loop lets
 * connectors change by it. */
static void set_rows_of_friction(const connectors *c, const double *q)
{
  friction *f = c->friction;
  const double *e0 = c->e0, *e1 = c->e1;
  for (int i = 0; i < c->number; ++i) {
    const double step = e1[i] - e0[i], λ = q[c->force[i]], limit = *f->limit[i];
    double *slip = f->slip + i, *row = c->rows + 3 * i;
    const int stuck = *slip == 0;
    const int slows = !f->against[i] && *slip * f->way[i] > 0;
    const int back = !stuck && *slip * (slows ? step - f->way[i] : step) < -f->tiny[i];
    /* Coming to rest must not give energy; if it does, the connector is held at once in this step.
     * The force of the initial guess does not decide this, as it belongs to another motion. */
    const int gives = !f->guessed && !f->against[i] && stuck && λ * f->way[i] < 0;
    const int over = stuck && fabs(λ) > limit * (1 + 1e-12);
    if (f->search) f->excess[i] = 0;
    if (f->search && f->search[HOLD] && !f->free[i]) {
      if (back || gives || over) f->search[OVER] = 1;
      f->excess[i] = back || gives ? INFINITY : over ? fabs(λ) / limit - 1 : 0;
    } else {
      f->against[i] |= gives;
      if (back) *slip = 0;
      else if (over) *slip = λ < 0 ? -1 : 1;
    }
    const int sticks = *slip == 0 && limit > 0;
    if (sticks != f->sticks[i]) f->sticks[i] = sticks, *f->switched = 1;
    if (sticks) {
      row[0] = 1, row[1] = -f->creep[i], row[2] = e0[i] + (f->against[i] ? 0 : f->way[i]);
    } else {
      double s[2] = {limit, 0}; /* sliding force, and its derivative */
      if (f->laws) {
        double *w = f->laws->w + i * f->laws->width;
        w[0] = e1[i];
        ask_law(f->laws->force, w, 2, s);
      }
      row[0] = -*slip * s[1], row[1] = 1, row[2] = *slip * (s[0] - s[1] * e1[i]);
    }
  }
  f->guessed = 0;
}

/* Rows of compiled laws, linearized at the motions e1. */
static void set_rows_of_laws(const connectors *c)
{
  const connector_laws *p = c->laws;
  const int n = c->components;
  double *w = p->w, *row = c->rows, s[12]; /* for up to three components */
  const double *e1 = c->e1;
  for (int i = 0; i < c->number; ++i, w += p->width, e1 += n) {
    memcpy(w, e1, n * sizeof *e1);
    ask_law(p->force, w, n + n * n, s);
    for (int j = 0; j < n; ++j, row += n + 2) {
      const double *slope = s + n + n * j;
      row[n] = 1, row[n + 1] = s[j];
      for (int l = 0; l < n; ++l) row[l] = -slope[l], row[n + 1] -= slope[l] * e1[l];
    }
  }
}

/* Outputs of the law of connector i at the end of a step to the latest motions. */
static const double *end_of_law(const connectors *c, int i)
{
  const connector_laws *p = c->laws;
  double *w = p->w + i * p->width;
  memcpy(w, c->e1 + c->components * i, c->components * sizeof *w);
  ask_law(p->end, w, LAW_OUTPUTS + p->variables, p->answer);
  return p->answer;
}

/* Power of the law of connector i after a fraction of the step to the latest motions; J per step. */
static double power_at(const connectors *c, int i, double fraction)
{
  const connector_laws *p = c->laws;
  const int n = c->components;
  double *w = p->w + i * p->width, s[12], power = 0; /* for up to three components */
  const double *e1 = c->e1 + n * i;
  for (int j = 0; j < n; ++j) w[j] = w[n + j] + fraction * (e1[j] - w[n + j]);
  ask_law(p->force, w, n + n * n, s);
  for (int j = 0; j < n; ++j) power += s[j] * (e1[j] - w[n + j]);
  return power;
}

/* Largest number of halvings of a path, and error of Simpson's rule as a fraction of the work. */
enum { HALVINGS = 14 };
static const double WORK_ERROR = 1e-7;

/* Work between the fractions a and b by Simpson's rule, halved where the powers have kinks. */
static double work_between(const connectors *c, int i, double a, double b, double at_a, double at_b, int halvings,
                           double size)
{
  const double middle = (a + b) / 2, at = power_at(c, i, middle), mean = (at_a + at_b) / 2;
  if (halvings >= 3 && (halvings == HALVINGS || fabs(at - mean) * (b - a) <= WORK_ERROR * size))
    return (b - a) * (mean + 2 * at) / 3;
  return work_between(c, i, a, middle, at_a, at, halvings + 1, size)
       + work_between(c, i, middle, b, at, at_b, halvings + 1, size);
}

/* Work of a rate-independent law along the straight path of the step, whose forces are exact. */
static double work_on_path(const connectors *c, int i)
{
  const double before = power_at(c, i, 0), now = power_at(c, i, 1);
  return work_between(c, i, 0, 1, before, now, 0, fabs(before) + fabs(now) + fabs(power_at(c, i, 0.5)));
}

/* Accept the latest motions as the new state of connector i, which has taken the work `work`. */
static void commit_law(const connectors *c, int i, double work)
{
  const connector_laws *p = c->laws;
  const int n = c->components;
  if (p->along_path) work = work_on_path(c, i);
  const double *s = end_of_law(c, i);
  if (p->loses) {
    const double lost = work - (s[LAW_STORED] - p->stored[i]) - s[LAW_NUMERICAL];
    p->lost[n * i] += lost;
    p->sum[0] += lost;
  }
  p->sum[1] += s[LAW_NUMERICAL];
  p->stored[i] = s[LAW_STORED];
  double *w = p->w + i * p->width;
  memcpy(w + 2 * n + 2, s + LAW_OUTPUTS, p->variables * sizeof *s);
  memcpy(w + n, w, n * sizeof *w);
}

/* Linearize the rows at q, except those that are constant in a step. */
void find_rows(const connectors *c, const double *q)
{
  if (!c->points && !c->rigid_plastic && !c->laws && !c->friction && !c->asked) return;
  find_motions(c, q);
  if (c->points) set_rows_of_springs(c);
  else if (c->rigid_plastic) set_rows_of_rigid_plastic(c, q);
  else if (c->friction) set_rows_of_friction(c, q);
  else if (c->laws) set_rows_of_laws(c);
  else {
    for (int i = 0; i < c->number; ++i) c->asked->force[i] = q[c->force[i]];
    c->asked->find_rows(c->asked->rows_self);
  }
  put_rows(c);
}

void add_connectors_force(void *self, const double *q, double *r)
{
  const connectors *c = self;
  find_rows(c, q);
  add_cells((void *)c->work, q, r);
}

/* Largest residual of a row. Residuals of motions are divided by 1 % of `moved`, which is at most
 * the size of the scene; residuals of forces are divided by `scale`. Round-off of the motions does
 * not count; it grows with the distance from the initial position and with the number of turns.
 *
 * A law with internal variables computes its force from the elastic part of a motion, which has the
 * round-off of the motions at both ends of the step. Times the elastic stiffness it is all that
 * remains of the force of a spring that has failed, where the slope of the row and `scale` vanish.
 * The law and the unknown force, which is the law of an earlier iterate, err by half a digit each. */
double missed_by_connectors(void *self, const double *q, const double *r, double scale, double moved)
{
  const connectors *c = self;
  const int n = c->components;
  const double amplitude = moved / c->size, *row = c->rows;
  double most = 0;
  for (int i = 0; i < c->number; ++i) {
    const int32_t *dofs = c->dofs + (6 + n) * i;
    const double *length = c->length + n * i;
    double far = amplitude;
    for (int j = 0; j < 4; ++j) far = fmax(far, amplitude + fabs(q[dofs[j]]) / c->size);
    for (int j = 4; j < 6; ++j) far = fmax(far, amplitude + fabs(q[dofs[j]]));
    for (int j = 0; j < n; ++j, row += n + 2) {
      const double weight = fabs(row[n]);
      const double unit = c->rigid_plastic ? c->rigid_plastic->slope[i] : 1;
      const double size = weight * unit < 1 - 1e-12 ? 0.01 * length[j] * amplitude
                                                    : weight * scale * c->size / length[j];
      double reach = 0; /* of the motions in the row */
      for (int l = 0; l < n; ++l) reach += fabs(row[l]) * length[l];
      const double elastic = weight * c->stiffness[n * i + j] * length[j];
      const double farthest = fmax(far, fabs(c->e0[n * i + j]) / length[j]);
      const double round_off = fmax(8 * reach * last_digit(far), elastic * last_digit(farthest));
      const double left = fabs(r[c->force[n * i + j]]) - round_off;
      if (left > 0) most = fmax(most, left / size);
    }
  }
  return most;
}

/* Work that component i takes in a step to the latest motions. */
static double taken_by(const connectors *c, int i, const double *q)
{
  const double a = c->weight_of_before, force = a * c->before[i] + (1 - a) * q[c->force[i]];
  return force * (c->e1[i] - c->e0[i]);
}

/* Accept the end of the step as the new state; returns the work that all connectors have taken in
 * the step. */
static double commit_connectors(const connectors *c, const double *q, double dt)
{
  double sum = 0;
  find_motions(c, q);
  if (c->laws) memset(c->laws->sum, 0, 2 * sizeof *c->laws->sum);
  const int n = c->components;
  for (int i = 0; i < c->number; ++i) {
    double of_all = 0;
    for (int j = n * i; j < n * (i + 1); ++j) {
      const double work = taken_by(c, j, q);
      c->kept[CONNECTOR_WORK][j] += work;
      c->kept[CONNECTOR_RATE][j] = (c->e1[j] - c->e0[j]) / dt;
      c->before[j] = q[c->force[j]];
      c->e0[j] = c->e1[j];
      of_all += work;
    }
    if (c->laws) commit_law(c, i, of_all);
    sum += of_all;
  }
  return sum;
}
