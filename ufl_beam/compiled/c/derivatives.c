/* SPDX-License-Identifier: MIT */
/* Derivatives of the state of a run by parameters: direct differentiation of each solved step, see
 * analysis/derivatives.py.
 *
 * In the step equation R(q1; q0, rates, internal variables, parameters) = 0, all but q1 has a known
 * derivative. Its product with R at constant q1 is the sum of the terms' forces; the tangent at the
 * solution then gives the derivative of q1. All arrays of directions have one row for each parameter.
 */

/* Note the margin by which a term in the step is on one side of a switch, and its derivative by parameter
 * p. The run has another piece where the margin vanishes. */
static void note_margin(const derivatives *d, int p, int place, double margin, double change)
{
  const double far = fabs(margin / change);
  if (!(far < d->range[p])) return;
  d->range[p] = far, d->range_time[p] = d->t;
  d->range_term[p] = d->now, d->range_place[p] = place;
}

/* Difference of a function of time in a neighbouring scene from the same function in the scene itself. */
static double change_of(const time_function *one, const time_function *own, double t)
{
  return value_at(one, t) - value_at(own, t);
}

/* -- inertia and damping ----------------------------------------------------------------------------- */

/* Derivative of the step of the nodes by the configuration at its end, times x. */
static void scale_rotations(const step_product *p, double *x)
{
  for (int k = 0; k < p->rotations; ++k) x[p->rotation[k]] *= 1 + p->half[k] * p->half[k];
}

void add_product_derivative(void *self, const derivatives *d, int p, double *r)
{
  const product_derivative *m = self;
  const step_product *product = m->matrix->product;
  const rates *of = m->matrix->rates;
  const double *row = m->matrix->damps ? of->now->velocity : of->now->inertia, *q0 = d->q0 + (size_t)p * d->size;
  double *x = d->space;
  for (int i = 0; i < d->size; ++i) x[i] = -row[0] * q0[i];
  scale_rotations(product, x);
  for (int j = 1; j < of->number; ++j)
    if (row[j] != 0) {
      const double *rate = d->rates[j] + (size_t)p * d->size;
      for (int i = 0; i < d->size; ++i) x[i] += row[j] * rate[i];
    }
  add_product(product->A, x, r);
  if (m->change[p]) add_product(m->change[p], product->rate, r);
}

/* Derivatives of the rates after the step. */
static void advance_rates(const derivatives *d, const time_loop *m, const step_product *product, int initial)
{
  const rates *of = m->rates;
  const scheme_numbers *now = of->now;
  const size_t all = (size_t)d->parameters * d->size;
  for (int p = 0; p < d->parameters; ++p) {
    const size_t at = (size_t)p * d->size;
    double *s = d->space;
    for (int i = 0; i < d->size; ++i) s[i] = d->q1[at + i] - d->q0[at + i];
    scale_rotations(product, s);
    for (int k = 0; k < m->multipliers; ++k) s[m->multiplier[k]] = 0;
    for (int k = 0; k <= now->gives; ++k)
      for (int i = 0; i < d->size; ++i) {
        double sum = now->rates[k][0] * s[i];
        for (int j = 1; j < of->number; ++j)
          if (now->rates[k][j] != 0) sum += now->rates[k][j] * d->rates[j][at + i];
        d->new_rates[k * all + at + i] = sum;
      }
  }
  if (!initial) {
    memcpy(d->rates[2], d->rates[1], all * sizeof *d->space); /* velocities before the last step */
    memcpy(d->rates[1], d->new_rates, all * sizeof *d->space);
  }
  for (int k = 1; k <= now->gives; ++k) memcpy(d->rates[2 + k], d->new_rates + k * all, all * sizeof *d->space);
}

/* -- loads and prescribed motions ---------------------------------------------------------------------- */

/* Factors of the dead loads at the time of a step, and their derivatives. */
static void find_factors(const load_derivatives *l, const time_step *step)
{
  const int n = l->loads->vectors;
  memset(l->by_factor, 0, (size_t)l->parameters * n * sizeof *l->by_factor);
  for (int v = 0; v < n; ++v) l->factor[v] = value_at(l->loads->factor + v, step->load_time);
  for (int k = 0; k < l->parameters * l->neighbours; ++k)
    for (int v = 0; v < n; ++v)
      l->by_factor[k / l->neighbours * n + v] +=
        l->weight[k] * (value_at(l->neighbour[k]->factor + v, step->load_time) - l->factor[v]);
}

void differentiate_loads(void *self, const time_step *step, const double *q1)
{
  const load_derivatives *l = self;
  const dead_loads *loads = l->loads;
  find_factors(l, step);
  memset(l->end, 0, (size_t)l->parameters * l->size * sizeof *l->end);
  for (int k = 0; k < l->parameters * loads->vectors; ++k)
    for (int i = 0; l->by_factor[k] != 0 && i < loads->size; ++i)
      l->end[(size_t)(k / loads->vectors) * l->size + loads->dof[i]] += l->by_factor[k] * loads->vector[k % loads->vectors][i];
  for (int c = 0; c < l->number; ++c)
    for (int i = 0; i < l->loaded; ++i)
      l->end[(size_t)l->parameter[c] * l->size + l->dof[i]] += l->factor[l->vector[c]] * l->change[(size_t)c * l->loaded + i];
  for (int p = 0; p < l->parameters; ++p)
    for (size_t i = (size_t)p * l->size; l->enters[p] && i < (size_t)(p + 1) * l->size; ++i) {
      l->end[i] = l->before[i] + step->fraction * (l->end[i] - l->before[i]);
      l->now[i] = l->before[i] + step->at * (l->end[i] - l->before[i]);
    }
}

void add_load_derivative(void *self, const derivatives *d, int p, double *r)
{
  const load_derivatives *l = self;
  for (int i = 0; l->enters[p] && i < l->size; ++i) r[i] -= l->now[(size_t)p * l->size + i];
}

void accept_load_derivative(void *self, const derivatives *d)
{
  const load_derivatives *l = self;
  memcpy(l->before, l->end, (size_t)l->parameters * l->size * sizeof *l->end);
}

/* Derivatives of the prescribed motions at the end of the step, in the axes of supports; else zero. */
static void move_supports(const derivatives *d, const time_loop *m, int p, double *v)
{
  const equation *e = m->equation;
  memset(v, 0, d->size * sizeof *v);
  memcpy(d->space, d->q0 + (size_t)p * d->size, d->size * sizeof *v);
  turn_axes(e->turned, e->axes, d->space, 1);
  for (int k = 0; k < m->supports->moving; ++k) {
    const int i = m->supports->dof[k];
    double wanted = 0;
    for (int j = p * d->neighbours; j < (p + 1) * d->neighbours; ++j)
      wanted += d->weight[j] * change_of(d->motion[j] + k, m->supports->motion + k, m->step.motion_time);
    v[i] = d->space[i] + m->step.fraction * (wanted - d->space[i]);
  }
}

/* -- terms of loads by differences between scenes ------------------------------------------------------ */

void begin_neighbours(void *self, const time_step *step, const double *q1)
{
  const term_differences *t = self;
  const call *force = &t->term->force;
  for (int k = 1; k <= t->parameters * t->neighbours; ++k) run(&t->term[k].begin, step, 0, 0);
  memset(t->here, 0, t->size * sizeof *t->here);
  force->add(force->self, q1, t->here);
}

/* Five-point differences of the forces at constant unknowns and rates. */
void add_differences_derivative(void *self, const derivatives *d, int p, double *r)
{
  const term_differences *t = self;
  for (int k = p * t->neighbours; k < (p + 1) * t->neighbours; ++k) {
    const call *force = &t->term[1 + k].force;
    memset(d->space, 0, t->size * sizeof *d->space);
    force->add(force->self, d->x, d->space);
    for (int i = 0; i < t->size; ++i) r[i] += t->weight[k] * (d->space[i] - t->here[i]);
  }
}

void accept_differences_derivative(void *self, const derivatives *d)
{
  const term_differences *t = self;
  for (int k = 0; k < t->parameters * t->neighbours; ++k)
    run(&t->term[1 + k].accept, d->step, d->x, d->s);
}

/* -- the step ------------------------------------------------------------------------------------------ */

/* y += K x for the tangent before supports hold it */
static void add_tangent_product(const derivatives *d, const equation *e, const double *x, double *y)
{
  for (int i = 0; i < e->size; ++i) {
    double sum = 0;
    for (int k = e->indptr[i]; k < e->indptr[i + 1]; ++k) sum += d->tangent[k] * x[d->indices[k]];
    y[i] += sum;
  }
}

/* Differentiate the solved step, before it is accepted; returns 0 if the tangent is singular. The short
 * step from which the `initial` rates of a scheme are taken changes only these. */
int differentiate_step(derivatives *d, time_loop *m, int initial)
{
  equation *e = m->equation;
  const int n = d->size;
  const step_product *product = m->rates ? d->inertia : 0;
  int failed = 0;
  d->step = &m->step, d->x = m->x;
  memcpy(d->s, m->s, n * sizeof *d->s); /* solutions may write into this array */
  restart(e, EXACT);
  residual(e, e->unknowns, e->residual, e->f);
  fill_tangent(e, m->x);
  memcpy(d->tangent, e->tangent, e->indptr[e->size] * sizeof *d->tangent);
  hold_tangent(e);
  for (int k = 0; k < d->terms; ++k)
    if (d->term[k].linearize) d->term[k].linearize(d->term[k].self, &m->step, m->x);
  for (int p = 0; p < d->parameters && !failed; ++p) {
    double *r = e->residual, *q1 = d->q1 + (size_t)p * n, *reactions = d->reactions + (size_t)p * e->held;
    memset(d->r, 0, n * sizeof *r);
    for (int k = 0; k < d->terms; ++k)
      if (d->term[k].add) d->term[k].add(d->term[k].self, d, p, d->r);
    memcpy(r, d->r, n * sizeof *r);
    move_supports(d, m, p, d->v);
    if (m->supports->moving) {
      memcpy(q1, d->v, n * sizeof *q1);
      turn_axes(e->turned, e->axes, q1, -1);
      add_tangent_product(d, e, q1, r);
    }
    turn_axes(e->turned, e->axes, r, 1);
    for (int k = 0; k < e->held; ++k) r[e->hold[k]] = 0;
    if (p == 0 && (factor_tangent(e, &failed) || failed)) break;
    if (solve_tangent(e, p == 0)) failed = 1;
    for (int i = 0; i < n; ++i) q1[i] = d->v[i] - e->change[i];
    for (int k = 0; k < e->held; ++k) q1[e->hold[k]] = d->v[e->hold[k]];
    turn_axes(e->turned, e->axes, q1, -1);
    add_tangent_product(d, e, q1, d->r);
    turn_axes(e->turned, e->axes, d->r, 1);
    for (int k = 0; k < e->held; ++k) reactions[k] = d->r[e->hold[k]];
  }
  memcpy(m->s, d->s, n * sizeof *d->s);
  if (failed) return 0;
  d->t = m->step.t1, d->initial = initial;
  for (d->now = 0; d->now < d->terms; ++d->now) {
    const term_derivative *term = d->term + d->now;
    void (*accept)(void *, const derivatives *) = initial ? term->accept_trial : term->accept;
    if (accept) accept(term->self, d);
  }
  if (product) advance_rates(d, m, product, initial);
  if (initial) return 1;
  memcpy(d->q0, d->q1, (size_t)d->parameters * n * sizeof *d->q0);
  return 1;
}

/* Store an accepted substep of a step to `end`. */
void keep_substep(derivatives *d, const time_loop *m, double end)
{
  const size_t n = d->size, all = n * d->parameters, k = d->substeps;
  if (d->substeps < 0 || d->substeps == d->room) {
    d->substeps = -1;
    return;
  }
  const double step[] = {m->t, end, m->applies};
  memcpy(d->substep + 3 * k, step, sizeof step);
  memcpy(d->substep_q + k * n, m->q, n * sizeof *m->q);
  memcpy(d->substep_dq + k * all, d->q0, all * sizeof *d->q0);
  ++d->substeps;
}

/* Store the derivatives at the end of a step. */
void keep_derivatives(derivatives *d, const time_loop *m)
{
  const size_t all = (size_t)d->parameters * d->size, held = (size_t)d->parameters * m->equation->held;
  memcpy(d->kept_q + d->kept * all, d->q0, all * sizeof *d->q0);
  if (m->rates) memcpy(d->kept_v + d->kept * all, d->rates[1], all * sizeof *d->q0);
  memcpy(d->kept_reactions + d->kept * held, d->reactions, held * sizeof *d->q0);
  ++d->kept;
}
