/* SPDX-License-Identifier: MIT */
/* Beginning of a step: each term computes its loads, rows and coefficients of the step; see term.py. */

/* Interpolate as numpy.interp does; without points and function, the value is the time. */
double value_at(const time_function *f, double t)
{
  const int last = f->points - 1;
  if (last < 0) return f->value ? f->value(f->handle, t) : t;
  if (t <= f->t[0] || last == 0) return f->y[0];
  if (t >= f->t[last]) return f->y[last];
  int low = 0, high = last;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    if (f->t[middle] <= t) low = middle;
    else high = middle;
  }
  if (t == f->t[low]) return f->y[low];
  return (f->y[high] - f->y[low]) / (f->t[high] - f->t[low]) * (t - f->t[low]) + f->y[low];
}

/* forces = sum of factors times vectors of loads */
static void sum_loads(const dead_loads *l, const double *factors, double *forces)
{
  for (int i = 0; i < l->size; ++i) forces[i] = factors[0] * l->vector[0][i];
  for (int k = 1; k < l->vectors; ++k)
    for (int i = 0; i < l->size; ++i) forces[i] += factors[k] * l->vector[k][i];
}

void begin_dead_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  dead_loads *l = self;
  const int whole = step->fraction == 1 && step->at == 1;
  int same = whole && l->whole;
  l->whole = whole;
  for (int k = 0; k < l->vectors; ++k) {
    const double factor = value_at(l->factor + k, step->load_time), before = l->factors_before[k];
    const double change = step->fraction * (factor - before), end = whole ? factor : before + change;
    if (factor != l->asked[k]) l->asked[k] = factor, same = 0;
    l->factors_at_end[k] = end;
    l->factors[k] = step->at == 1 ? end : before + step->at * change;
  }
  if (!same) sum_loads(l, l->factors, l->force);
}

/* out = sum of coefficients times rates, from the index `first` on */
static void combine_rates(const rates *r, const double *numbers, int first, double *out)
{
  int begun = 0;
  for (int j = first; j < r->number; ++j) {
    const double c = numbers[j], *x = r->rate[j];
    if (c == 0) continue;
    if (begun)
      for (int i = 0; i < r->size; ++i) out[i] += c * x[i];
    else
      for (int i = 0; i < r->size; ++i) out[i] = c * x[i];
    begun = 1;
  }
  if (!begun) memset(out, 0, r->size * sizeof *out);
}

int find_numbers(rates *r, double dt)
{
  for (int k = 0; k < r->known; ++k) {
    r->now = r->numbers + k;
    if (r->now->dt == dt && (r->after_any || r->now->last_dt == r->last_dt) && r->now->more == r->more)
      return 1;
  }
  scheme_numbers *n = r->numbers + r->oldest;
  n->dt = dt, n->last_dt = r->last_dt, n->more = r->more;
  if (!r->find(r->handle, n)) {
    n->dt = NAN;
    return 0;
  }
  r->now = n;
  r->oldest = (r->oldest + 1) % MOST_KNOWN;
  if (r->known < MOST_KNOWN) ++r->known;
  return 1;
}

/* Write the coefficients of the rates as factor s - back v. v is a rate, or a sum if several
 * coefficients are nonzero. */
void begin_product(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  step_product *p = m->product;
  const rates *r = m->rates;
  const double *row = m->damps ? r->now->velocity : r->now->inertia;
  int last = 0, some = 0;
  p->q0 = step->q0;
  for (int j = 1; j < r->number; ++j)
    if (row[j] != 0) last = j, ++some;
  p->factor = row[0];
  p->back = some == 1 ? -row[last] : -1;
  p->v = some == 1 ? r->rate[last] : m->v;
  if (some != 1) combine_rates(r, row, 1, m->v);
}

void begin_points(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  points *p = b->inner;
  inelastic *m = b->sections;
  for (int k = 0; k < p->cells * p->of_cell && p->w[k * p->width + DT] != step->dt; ++k)
    p->w[k * p->width + DT] = step->dt;
  p->tried = p->predicts = 0;
  if (!m) return;
  m->latest[0] = NAN; /* compute the next response in any case */
  m->q0 = step->q0, m->q_before = step->q_before, m->ratio = step->ratio;
}
