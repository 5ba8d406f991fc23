/* SPDX-License-Identifier: MIT */
/* Discrete adjoint of a run: derivatives of one number by many parameters, see analysis/derivatives.py.
 *
 * A recorded step is the linear map of derivatives.c from the derivatives before the step to those at
 * its end. Backwards through the steps, the transposed map takes the derivatives of the number by the
 * state at the end of a step to those by the state before it. Arrays `..._bar` are derivatives of the
 * number. */

static double dot(size_t size, const double *x, const double *y)
{
  double sum = 0;
  for (size_t i = 0; i < size; ++i) sum += x[i] * y[i];
  return sum;
}

/* Add the products of `bar` with the rows of a table, one for each parameter, to the gradient. */
static void add_products(adjoint *a, size_t size, const double *bar, const double *rows)
{
  for (int p = 0; bar && rows && p < a->parameters; ++p) a->gradient[p] += dot(size, bar, rows + p * size);
}

/* -- inertia, damping, loads ----------------------------------------------------------------------------- */

/* The matrices are symmetric. */
void transpose_product(void *self, adjoint *a, const double *λ)
{
  const product_derivative *m = self;
  const step_product *product = m->matrix->product;
  const rates *of = m->matrix->rates;
  const double *row = m->matrix->damps ? of->now->velocity : of->now->inertia;
  double *x = a->values;
  memset(x, 0, a->size * sizeof *x);
  add_product(product->A, λ, x);
  for (int j = 1; j < of->number; ++j)
    for (int i = 0; row[j] != 0 && i < a->size; ++i) a->rates[j][i] += row[j] * x[i];
  scale_rotations(product, x);
  for (int i = 0; i < a->size; ++i) a->q0[i] -= row[0] * x[i];
  for (int p = 0; p < a->parameters; ++p) {
    if (!m->change[p]) continue;
    memset(x, 0, a->size * sizeof *x);
    add_product(m->change[p], product->rate, x);
    a->gradient[p] += dot(a->size, x, λ);
  }
}

/* Rates after the step to rates before it, and to the configurations at both ends. A step from which the
 * `initial` rates are taken changes only rates besides the velocities. */
static void transpose_rates(adjoint *a, const time_loop *m, int initial)
{
  const rates *of = m->rates;
  const scheme_numbers *now = of->now;
  double *s = a->values;
  memset(s, 0, a->size * sizeof *s);
  for (int j = 1; j < of->number; ++j) memcpy(a->new_rates + (size_t)j * a->size, a->rates[j], a->size * sizeof *s);
  for (int j = initial ? 3 : 1; j < of->number; ++j) memset(a->rates[j], 0, a->size * sizeof *s);
  for (int i = 0; !initial && i < a->size; ++i) a->rates[1][i] = a->new_rates[2 * a->size + i]; /* velocities before the last step */
  for (int k = initial; k <= now->gives; ++k) {
    const double *bar = a->new_rates + (size_t)(k ? 2 + k : 1) * a->size;
    for (int j = 0; j < of->number; ++j)
      for (int i = 0; now->rates[k][j] != 0 && i < a->size; ++i)
        *(j ? a->rates[j] + i : s + i) += now->rates[k][j] * bar[i];
  }
  for (int k = 0; k < m->multipliers; ++k) s[m->multiplier[k]] = 0;
  scale_rotations(a->d->inertia, s);
  for (int i = 0; i < a->size; ++i) a->q1[i] += s[i], a->q0[i] -= s[i];
}

/* Dead loads of whole steps, whose derivatives do not depend on the state. */
void transpose_loads(void *self, adjoint *a, const double *λ)
{
  const load_derivatives *l = self;
  const dead_loads *loads = l->loads;
  find_factors(l, a->step);
  for (int v = 0; v < loads->vectors; ++v) {
    double work = 0;
    for (int i = 0; i < l->loaded; ++i) l->vector_bar[(size_t)v * l->loaded + i] -= l->factor[v] * λ[l->dof[i]];
    for (int i = 0; l->neighbours && i < loads->size; ++i) work += loads->vector[v][i] * λ[loads->dof[i]];
    for (int p = 0; l->neighbours && p < l->parameters; ++p) a->gradient[p] -= l->by_factor[p * loads->vectors + v] * work;
  }
}

void finish_loads(void *self, adjoint *a)
{
  const load_derivatives *l = self;
  for (int c = 0; c < l->number; ++c)
    a->gradient[l->parameter[c]] +=
      dot(l->loaded, l->vector_bar + (size_t)l->vector[c] * l->loaded, l->change + (size_t)c * l->loaded);
}

/* Terms of loads by differences between scenes; only their explicit derivatives are differenced. */
void transpose_differences(void *self, adjoint *a, const double *λ)
{
  begin_neighbours(self, a->step, a->d->x);
  for (int p = 0; p < a->parameters; ++p) {
    memset(a->values, 0, a->size * sizeof *a->values);
    add_differences_derivative(self, a->d, p, a->values);
    a->gradient[p] += dot(a->size, a->values, λ);
  }
}

/* -- the steps ------------------------------------------------------------------------------------------- */

/* Record the solved step, before it is accepted; see differentiate_step on an `initial` one. Returns 0 if
 * the memory is full. */
int record_step(adjoint *a, time_loop *m, int initial)
{
  equation *e = m->equation;
  derivatives *d = a->d;
  if (a->recorded == a->most) return 0;
  memcpy(d->s, m->s, a->size * sizeof *d->s);
  d->x = m->x;
  restart(e, EXACT);
  residual(e, e->unknowns, e->residual, e->f);
  fill_tangent(e, m->x);
  char *to = a->record + (size_t)a->recorded * a->bytes;
  memcpy(to, &initial, sizeof initial), to += sizeof initial;
  memcpy(to, &m->step, sizeof m->step), to += sizeof m->step;
  if (m->rates) memcpy(to, m->rates->now, sizeof *m->rates->now);
  to += sizeof(scheme_numbers);
  for (int k = 0; k < a->blocks; ++k) memcpy(to, *a->block[k], a->length[k]), to += a->length[k];
  ++a->recorded;
  memcpy(m->s, d->s, a->size * sizeof *d->s);
  return 1;
}

/* Go back through the last recorded step; returns 0 if the tangent is singular. */
int go_back(adjoint *a, time_loop *m)
{
  equation *e = m->equation;
  derivatives *d = a->d;
  const char *from = a->record + (size_t)--a->recorded * a->bytes;
  scheme_numbers numbers;
  const rates *of = m->rates;
  int failed = 0, initial;
  memcpy(&initial, from, sizeof initial), from += sizeof initial;
  memcpy(&m->step, from, sizeof m->step), from += sizeof m->step;
  memcpy(&numbers, from, sizeof numbers), from += sizeof numbers;
  if (of) m->rates->now = &numbers;
  for (int k = 0; k < a->blocks; ++k) memcpy(*a->block[k], from, a->length[k]), from += a->length[k];
  d->x = m->x, a->step = &m->step, d->initial = initial;
  memset(a->q0, 0, a->size * sizeof *a->q0);
  memcpy(a->q_bar, a->q1, a->size * sizeof *a->q_bar);
  if (initial) memset(a->q1, 0, a->size * sizeof *a->q1);
  for (int k = d->terms - 1; k >= 0; --k)
    if (a->term[k].state && (!initial || d->term[k].accept_trial)) a->term[k].state(d->term[k].self, a);
  if (of) transpose_rates(a, m, initial);
  /* λ = -K^-T q1_bar, in the axes of supports, where held motions are prescribed */
  memcpy(d->tangent, e->tangent, e->indptr[e->size] * sizeof *d->tangent);
  hold_tangent(e);
  for (int k = 0; k < e->indptr[e->size]; ++k) a->transposed[k] = e->tangent[a->transpose[k]];
  memcpy(e->tangent, a->transposed, e->indptr[e->size] * sizeof *d->tangent);
  double *r = e->residual, *λ = a->lambda;
  memcpy(r, a->q1, a->size * sizeof *r);
  turn_axes(e->turned, e->axes, r, 1);
  memcpy(d->v, r, a->size * sizeof *r);
  for (int k = 0; k < e->held; ++k) r[e->hold[k]] = 0;
  if (factor_tangent(e, &failed) || failed || solve_tangent(e, 1)) return 0;
  for (int i = 0; i < a->size; ++i) λ[i] = -e->change[i];
  for (int k = 0; k < e->held; ++k) λ[e->hold[k]] = 0;
  turn_axes(e->turned, e->axes, λ, -1);
  if (m->supports->moving) { /* derivatives by the prescribed motions */
    memset(d->r, 0, a->size * sizeof *r);
    for (int i = 0; i < e->size; ++i)
      for (int k = e->indptr[i]; k < e->indptr[i + 1]; ++k) d->r[d->indices[k]] += d->tangent[k] * λ[i];
    turn_axes(e->turned, e->axes, d->r, 1);
    for (int p = 0; p < a->parameters; ++p)
      for (int k = 0; k < m->supports->moving; ++k) {
        const int i = m->supports->dof[k];
        double wanted = 0;
        for (int j = 0; j < d->neighbours; ++j)
          wanted += d->weight[p * d->neighbours + j] *
                    change_of(d->motion[p * d->neighbours + j] + k, m->supports->motion + k, m->step.motion_time);
        a->gradient[p] += (d->v[i] + d->r[i]) * wanted;
      }
  }
  for (int k = d->terms - 1; k >= 0; --k) a->term[k].force(d->term[k].self, a, λ);
  /* The configuration at the end of the step before; an initial step does not change it. */
  for (int i = 0; i < a->size; ++i) a->q1[i] = a->q0[i] + (initial ? a->q_bar[i] : 0);
  return 1;
}

/* Derivatives by the parameters, from those by the initial state. */
void finish_adjoint(adjoint *a, time_loop *m)
{
  derivatives *d = a->d;
  for (int k = 0; k < d->terms; ++k)
    if (a->term[k].finish) a->term[k].finish(d->term[k].self, a);
  add_products(a, a->size, a->q1, d->q0);
  for (int j = 1; m->rates && j < m->rates->number; ++j) add_products(a, a->size, a->rates[j], d->rates[j]);
}
