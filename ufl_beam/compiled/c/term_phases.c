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

void begin_forms(void *self, const time_step *step, const double *q1, const double *s)
{
  const form_of_step *f = self;
  set_cells(f->form, step->q0, f->at);
}

void begin_predicted_strains(void *self, const time_step *step, const double *q1, const double *s)
{
  predicted_strains *p = self;
  p->q0 = step->q0, p->q_before = step->q_before, p->ratio = step->ratio;
  p->begins = 1, p->exact = 0;
}

/* Elastic cells have no branches: forces before the step suffice for the first tangent, and cost
 * less. */
void begin_static_tangent(void *self, const time_step *step, const double *q1, const double *s)
{
  const static_tangent *t = self;
  begin_predicted_strains(t->predicted, step, q1, s);
  t->predicted->ratio = 0;
}

/* Imposed strains change between the ends of a step, as prescribed motions do. */
void begin_imposed_strains(void *self, const time_step *step, const double *q1, const double *s)
{
  const imposed_strains *all = self;
  for (int k = 0; k < all->functions; ++k) {
    const double wanted = value_at(all->factor + k, step->motion_time), before = all->factors[k];
    all->factors_at_end[k] = step->fraction == 1 ? wanted : before + step->fraction * (wanted - before);
  }
  for (int g = 0; g < all->groups; ++g) {
    const imposed_cells *x = all->group[g];
    for (int i = 0; i < x->cells * x->points; ++i)
      for (int k = 0; k < 3; ++k) {
        double before = 0, now = 0;
        for (int f = 0; f < all->functions; ++f) {
          before += all->factors[f] * x->field[f][3 * i + k];
          now += all->factors_at_end[f] * x->field[f][3 * i + k];
        }
        x->strains[6 * i + k] = before, x->strains[6 * i + 3 + k] = now;
      }
    for (int f = 0; f < x->forms; ++f)
      for (int c = 0; c < x->cells; ++c)
        put_in_cell(x->form[f].form, c, x->form[f].at, 6 * x->points, x->strains + 6 * x->points * c);
    if (x->inelastic) {
      const points *p = x->inelastic->points;
      x->inelastic->latest[0] = NAN; /* compute the next response in any case */
      for (int c = 0; c < p->cells; ++c) memcpy(x->before + 3 * c, p->kept + POINT_KEPT * c, 3 * sizeof(double));
    }
  }
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

/* Damping matrix of the step, from the tangents and the configuration of the accepted state. */
void begin_tangent_damping(void *self, const time_step *step, const double *q1, const double *s)
{
  const tangent_damping *t = self;
  for (int g = 0; g < t->groups; ++g) {
    const committed_cells *of = t->group + g;
    for (int k = 0; k < 2; ++k)
      for (int c = 0; c < of->number; ++c)
        put_in_cell(t->form[k].form, of->cell[c], t->form[k].at, of->numbers, of->tangents + of->numbers * c);
  }
  set_cells(t->force, step->q0, t->at_q0);
  memset(t->K, 0, t->entries * sizeof *t->K);
  add_cells((void *)t->stiffness, step->q0, t->K);
  for (int i = 0; i < t->number; ++i) t->C[i] = t->mass[i] + t->factor * t->K[t->at[i]];
  begin_product((void *)t->damping, step, q1, s);
}

void begin_inelastic(void *self, const time_step *step, const double *q1, const double *s)
{
  const inelastic_term *t = self;
  points *p = t->points;
  if (step->dt != *t->dt) {
    *t->dt = step->dt;
    for (int k = 0; k < p->cells * p->of_cell; ++k) p->w[k * p->width + DT] = step->dt;
  }
  p->tried = p->predicts = 0;
  if (t->cells) t->cells->latest[0] = NAN; /* compute the next response in any case */
}

/* Rows of dampers, motors and actuators, which are constant during a step. */
static void put_rows_of_step(const connector_term *t, const time_step *step)
{
  const connectors *c = t->connectors;
  for (int i = 0; i < c->number; ++i) {
    double *row = c->rows + 3 * i;
    row[0] = 0, row[1] = 1;
    if (t->viscosity) {
      row[0] = -t->viscosity[i] / step->dt;
      row[2] = row[0] * c->e0[i];
    } else if (t->wanted_motion) {
      const double wanted = value_at(t->wanted_motion + i, step->motion_time);
      row[0] = 1, row[1] = 0;
      row[2] = c->e0[i] + step->fraction * (wanted - c->e0[i]);
    } else {
      const double wanted = -value_at(t->wanted_force + i, step->load_time);
      t->end[i] = t->reached[i] + step->fraction * (wanted - t->reached[i]);
      row[2] = t->reached[i] + step->at * (t->end[i] - t->reached[i]);
    }
  }
  put_rows(c);
}

static void begin_friction_again(friction *f)
{
  memcpy(f->slip, f->accepted, f->number * sizeof *f->slip);
  memset(f->against, 0, f->number * sizeof *f->against);
  f->guessed = 1;
}

/* A sticking connector moves by `way` in the step, so that its velocity is zero at the end. Without
 * this motion, the previous velocity would come back. */
static void begin_friction(friction *f, const time_step *step)
{
  double way_to_rest = 0;
  memset(f->way, 0, f->number * sizeof *f->way);
  if (f->rates) {
    const double *of = f->rates->now->rates[0]; /* v1 as a function of the step and v, with v instead of
                                                 * v_before */
    way_to_rest = -(of[1] + of[2]) / of[0];
    set_cells(f->rate, f->rates->rate[1], f->at_v);
    add_cells((void *)f->rate, step->q0, f->way);
  }
  for (int i = 0; i < f->number; ++i) {
    if (f->laws) {
      ask_law(f->limit_of_law, f->laws->w + i * f->laws->width, 1, f->limit[i]);
      *f->limit[i] = fmax(*f->limit[i], 0);
    }
    const double limit = *f->limit[i];
    f->way[i] *= way_to_rest;
    f->creep[i] = limit > 0 ? f->softness[i] / limit : 0;
  }
  begin_friction_again(f);
}

void begin_connectors(void *self, const time_step *step, const double *q1, const double *s)
{
  const connector_term *t = self;
  const connectors *c = t->connectors;
  const rigid_plastic *p = c->rigid_plastic;
  const connector_laws *l = c->laws;
  if (t->entry && !c->friction && !c->asked) put_rows_of_step(t, step);
  for (int i = 0; l && i < c->number; ++i) {
    double *w = l->w + i * l->width;
    memcpy(w + c->components, c->e0 + i * c->components, c->components * sizeof *w);
    w[2 * c->components] = step->dt;
  }
  if (c->friction) begin_friction(c->friction, step);
  if (c->asked) {
    /* Substeps go in proportion to the loads of the step. A path has no beginning, as its fractions
     * are 1. */
    const double way = step->fraction * step->at;
    const double t1 = way == 1 ? step->load_time : step->t0 + way * (step->load_time - step->t0);
    c->asked->begin(c->asked->begin_self, t1, step->dt);
  }
  if (c->points) begin_inelastic(t->points, step, q1, s);
  for (int i = 0; p && i < p->number; ++i) {
    p->w[i * p->width + t->dt_of_law] = step->dt;
    p->direction[i] = p->direction_before[i];
  }
}

void begin_connectors_again(void *self, const time_step *step, const double *q1, const double *s)
{
  const connector_term *t = self;
  const connectors *c = t->connectors;
  const rigid_plastic *p = c->rigid_plastic;
  if (p) memcpy(p->direction, p->direction_before, p->number * sizeof *p->direction);
  if (c->friction) begin_friction_again(c->friction);
  if (c->asked) c->asked->again(c->asked->again_self);
}
