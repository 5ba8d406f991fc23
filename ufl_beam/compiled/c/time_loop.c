/* SPDX-License-Identifier: MIT */
/* The time loop without Python; see stepper.py.
 *
 * A step that fails leaves the state unchanged and is divided into substeps.
 */

/* Interpolate as numpy.interp does. */
double value_at(const time_function *f, double t)
{
  const int last = f->points - 1;
  if (last < 0) return f->ask(f->handle, t);
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

static void run(const phases *p, const time_step *step, const double *q1, const double *s)
{
  for (int k = 0; k < p->number; ++k) p->call[k].run(p->call[k].self, step, q1, s);
}

static double dot(int size, const double *x, const double *y)
{
  double sum = 0;
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < size; ++i) sum += x[i] * y[i];
  return sum;
}

/* Work in a step s of the weighted mean of the forces in the previous equation (weight a) and in
 * the equation of this step. The forces are at the degrees of freedom `dof`, or at all if that is
 * null. */
static double work_in_step(int size, const int32_t *dof, double a, const double *before, const double *force,
                           const double *s)
{
  double work = 0;
  for (int i = 0; i < size; ++i) work += (a * before[i] + (1 - a) * force[i]) * s[dof ? dof[i] : i];
  return work;
}

/* -- phases of terms ---------------------------------------------------------------------------- */

void begin_forms(void *self, const time_step *step, const double *q1, const double *s)
{
  const form_of_step *f = self;
  set_cells(f->form, step->q0, f->at);
}

void add_values(void *self, const time_step *step, const double *q1, const double *s)
{
  form_value *f = self;
  *f->entry += f->held = value_of_cells(f->form, q1);
}

void change_of_form(void *self, const double *q1, energy_change *sum)
{
  const form_value *f = self;
  sum->in_beams += value_of_cells(f->form, q1) - f->held;
}

void begin_viscous_forms(void *self, const time_step *step, const double *q1, const double *s)
{
  const viscous_forms *v = self;
  const double rate = v->time / step->dt;
  if (step->dt == *v->dt) return;
  *v->dt = step->dt;
  for (int k = 0; k < v->forms; ++k)
    for (int c = 0; c < v->form[k].form->number; ++c)
      for (int i = 0; i < v->of_cell; ++i) put_in_cell(v->form[k].form, c, v->form[k].at + i, 1, &rate);
}

void begin_second_differences(void *self, const time_step *step, const double *q1, const double *s)
{
  const second_differences *d = self;
  const double ratio = fmin(1, step->dt / *d->last_dt);
  const int n = d->of_cell;
  for (int i = 0; i < d->strains->number * n; ++i) d->space[i] = ratio * d->change[i];
  for (int k = 0; k < d->forms; ++k)
    for (int c = 0; c < d->strains->number; ++c)
      put_in_cell(d->form[k].form, c, d->form[k].at, n, d->space + (size_t)c * n);
}

void accept_second_differences(void *self, const time_step *step, const double *q1, const double *s)
{
  const second_differences *d = self;
  const int n = d->of_cell, all = d->strains->number * n;
  memset(d->space, 0, all * sizeof *d->space);
  add_cells((void *)d->strains, q1, d->space);
  for (int i = 0; i < all; ++i) {
    const double now = d->space[i] / d->weight[i % n];
    d->change[i] = now - d->e[i];
    d->e[i] = now;
  }
  *d->last_dt = step->dt;
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

void begin_dead_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  dead_loads *l = self;
  const int whole = step->fraction == 1 && step->at == 1;
  int same = whole && l->whole;
  l->whole = whole;
  for (int k = 0; k < l->vectors; ++k) {
    const double factor = value_at(l->factor + k, step->load_time);
    if (factor != l->factors[k]) l->factors[k] = factor, same = 0;
  }
  if (same) return;
  for (int k = 0; k < l->vectors; ++k) {
    const double before = l->parts[2][k], change = step->fraction * (l->factors[k] - before);
    l->parts[1][k] = whole ? l->factors[k] : before + change;
    l->parts[0][k] = step->at == 1 ? l->parts[1][k] : before + step->at * change;
  }
  l->acts = 0;
  for (int i = 0; i < l->size; ++i) l->end[i] = l->factors[0] * l->vector[0][i];
  for (int k = 1; k < l->vectors; ++k)
    for (int i = 0; i < l->size; ++i) l->end[i] += l->factors[k] * l->vector[k][i];
  for (int i = 0; i < l->size; ++i) {
    if (!whole) {
      const double change = step->fraction * (l->end[i] - l->before[i]);
      l->end[i] = l->before[i] + change;
      l->force[i] = step->at == 1 ? l->end[i] : l->before[i] + step->at * change;
    } else
      l->force[i] = l->end[i];
    l->acts |= l->force[i] != 0 || l->end[i] != 0 || l->before[i] != 0;
  }
}

void accept_dead_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  dead_loads *l = self;
  memcpy(l->parts[2], l->parts[1], l->vectors * sizeof *l->parts[2]);
  if (!l->acts) return;
  *l->work += work_in_step(l->size, l->dof, l->weight_of_before, l->before, l->force, s);
  memcpy(l->before, l->end, l->size * sizeof *l->end);
}

void begin_follower_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  const follower_loads *f = self;
  for (int k = 0; k < f->number; ++k) {
    const double factor = value_at(f->factor + k, step->load_time);
    for (int i = 3 * k; i < 3 * k + 3; ++i) {
      f->end[i] = f->before[i] + step->fraction * (f->given[i] * factor - f->before[i]);
      f->now[i] = f->before[i] + step->at * (f->end[i] - f->before[i]);
    }
    f->turn0[k] = step->q0[f->turning[k]];
  }
}

void accept_follower_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  const follower_loads *f = self;
  *f->work += work_in_step(f->size, f->dof, f->weight_of_before, f->force_before, f->force, s);
  memcpy(f->force_before, f->force, f->size * sizeof *f->force);
  memcpy(f->before, f->end, 3 * (size_t)f->number * sizeof *f->end);
}

void begin_frame(void *self, const time_step *step, const double *q1, const double *s)
{
  rotating_frame *f = self;
  const double growth = step->fraction * (1 - f->grown);
  f->growth = f->grown + step->at * growth, f->grown_at_end = f->grown + growth;
  f->q0 = step->q0, f->dt = step->dt;
  memcpy(f->force, f->before, f->size * sizeof *f->force); /* iterates of a failed step may be far away */
}

void accept_frame(void *self, const time_step *step, const double *q1, const double *s)
{
  rotating_frame *f = self;
  const double out = -f->growth * (f->rate * f->rate), across = f->coriolis / f->dt;
  double *to = *f->accelerations;
  *f->work += work_in_step(f->size, 0, f->weight_of_before, f->before, f->force, s);
  memcpy(f->before, f->force, f->size * sizeof *f->force);
  f->grown = f->grown_at_end;
  for (int k = 0; k < f->places; ++k) {
    const int x = f->x[k], y = f->y[k];
    to[x] = out * f->place[x] - across * f->change[y];
    to[y] = out * f->place[y] + across * f->change[x];
  }
}

/* Write a parameter into the forms of a work that depend on it, if it has changed. */
static void put_number(const user_work *w, int k, double value)
{
  if (value == w->number[k]) return;
  w->number[k] = value;
  for (int j = 0; j < w->forms; ++j) {
    const cells *form = w->form[j].form;
    const int at = w->at[j * w->numbers + k];
    if (at < 0) continue;
    for (int c = 0; c < form->number; c += form->lanes)
      for (int l = 0; l < form->lanes; ++l) in_cell(form, c, at)[l] = value;
  }
}

static void put_time(const user_work *w, double t)
{
  put_number(w, WORK_TIME, t);
  for (int k = WORK_NUMBERS; k < w->numbers; ++k) put_number(w, k, value_at(w->of_time + k - WORK_NUMBERS, t));
}

/* Longest time step that works get; all rates vanish with it. */
static const double AT_REST = 1e300;

void begin_works(void *self, const time_step *step, const double *q1, const double *s)
{
  user_works *all = self;
  const double growth = step->fraction * (1 - all->grown), t = all->t;
  all->t_at_end = t + step->fraction * (step->motion_time - t), all->grown_at_end = all->grown + growth;
  for (int k = 0; k < all->works; ++k) {
    const user_work *w = all->work[k];
    for (int j = 0; j < w->forms; ++j)
      if (w->form[j].at >= 0) set_cells(w->form[j].form, step->q0, w->form[j].at);
    put_time(w, t + step->at * step->fraction * (step->load_time - t));
    put_number(w, WORK_STEP, fmin(step->dt, AT_REST));
    put_number(w, WORK_PART, all->grown + step->at * growth);
  }
}

/* Enter the loss of a potential by the scheme, and the energy that its change in time supplied. */
static void account_for(const user_work *w, const user_works *all, const double *q0, const double *q1)
{
  const double a = all->weight_of_before;
  if (w->lost) add_values(w->lost, 0, q1, 0);
  if (!w->supplied) return;
  put_time(w, a * all->t + (1 - a) * w->number[WORK_TIME]);
  const cells *energy = w->energy->form;
  const double moved = value_of_cells(energy, q1) - value_of_cells(energy, q0);
  put_time(w, all->t_at_end);
  *w->supplied += value_of_cells(energy, q1) - w->energy->held - moved;
}

void accept_works(void *self, const time_step *step, const double *q1, const double *s)
{
  user_works *all = self;
  const double a = all->weight_of_before;
  double *r = all->space;
  memset(all->force, 0, all->size * sizeof *r);
  for (int k = 0; k < all->works; ++k) {
    const user_work *w = all->work[k];
    memset(r, 0, all->size * sizeof *r);
    add_cells((void *)w->residual, q1, r);
    for (int i = 0; i < all->size; ++i) all->force[i] -= r[i];
    if (w->energy) account_for(w, all, step->q0, q1);
    else {
      double work = 0;
      for (int i = 0; i < all->size; ++i) work += (a * w->before[i] - (1 - a) * r[i]) * s[i];
      *w->supplied += work;
      for (int i = 0; i < all->size; ++i) w->before[i] = -r[i];
    }
  }
  all->t = all->t_at_end, all->grown = all->grown_at_end;
}

void add_energy_of_works(void *self, const time_step *step, const double *q1, const double *s)
{
  const user_works *all = self;
  for (int k = 0; k < all->works; ++k) {
    const user_work *w = all->work[k];
    if (!w->energy) continue;
    put_time(w, all->t);
    add_values(w->energy, step, q1, s);
  }
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

/* Write a row of coefficients as factor s - back v. v is a rate, or a sum if several coefficients
 * are nonzero. */
static void begin_product(const matrix_of_rates *m, const time_step *step, const double *row)
{
  step_product *p = m->product;
  p->q0 = step->q0;
  const rates *r = m->rates;
  int last = 0, some = 0;
  for (int j = 1; j < r->number; ++j)
    if (row[j] != 0) last = j, ++some;
  p->factor = row[0];
  p->back = some == 1 ? -row[last] : -1;
  p->v = some == 1 ? r->rate[last] : m->v;
  if (some != 1) combine_rates(r, row, 1, m->v);
}

void begin_inertia(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  begin_product(m, step, m->rates->now->inertia);
}

void accept_inertia(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  rates *r = m->rates;
  const step_product *p = m->product;
  r->rate[0] = (double *)s;
  combine_rates(r, r->now->rates[0], 0, r->new_rate[1]);
  for (int j = 3; j < r->number; ++j) combine_rates(r, r->now->rates[j - 2], 0, r->new_rate[j]);
  if (m->lost) {
    double *change = m->v;
    for (int i = 0; i < r->size; ++i) change[i] = r->new_rate[1][i] - r->rate[1][i];
    memset(m->momentum, 0, r->size * sizeof *m->momentum);
    add_product(p->A, change, m->momentum);
    r->rate[0] = change;
    combine_rates(r, r->now->slip, 0, r->new_rate[2]);
    *m->lost += dot(r->size, r->new_rate[2], m->momentum);
  }
  double *last = r->rate[2] == r->new_rate[1] ? r->rate[1] : r->rate[2]; /* v becomes the previous velocity */
  r->rate[2] = r->rate[1], r->rate[1] = r->new_rate[1], r->new_rate[1] = last;
  for (int j = 3; j < r->number; ++j) {
    last = r->rate[j];
    r->rate[j] = r->new_rate[j], r->new_rate[j] = last;
  }
  r->last_dt = step->dt, r->more = r->now->gives;
}

void add_kinetic_energy(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  const step_product *p = m->product;
  *m->kept += quadratic_form(p->A, m->rates->rate[1]) / 2;
}

void begin_rayleigh(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  begin_product(m, step, m->rates->now->velocity);
}

void accept_rayleigh(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  const step_product *p = m->product;
  *m->lost += quadratic_form(p->A, s) / step->dt;
}

static void begin_points(points *p, double *dt, double new_dt)
{
  if (new_dt != *dt) {
    *dt = new_dt;
    for (int k = 0; k < p->cells * p->of_cell; ++k) p->w[k * p->width + DT] = new_dt;
  }
  p->tried = p->predicts = 0;
}

/* Add the dissipation of points in the step to the ledger. */
static void enter_losses(const inelastic_term *t, const double *sum)
{
  if (t->plastic) *t->plastic += sum[0];
  if (t->hinges) *t->hinges += sum[1];
  if (t->numerical) *t->numerical += 2 * t->alpha * sum[2];
  if (t->released) *t->released += sum[5];
}

static void enter_stored(const inelastic_term *t, const double *sum)
{
  *t->stored += sum[3];
  if (t->hardening) *t->hardening += sum[4];
}

void begin_inelastic(void *self, const time_step *step, const double *q1, const double *s)
{
  const inelastic_term *t = self;
  begin_points(t->cells->points, t->dt, step->dt);
  t->cells->latest[0] = NAN; /* compute the next response in any case */
}

void accept_inelastic(void *self, const time_step *step, const double *q1, const double *s)
{
  const inelastic_term *t = self;
  respond_at(t->cells, q1);
  commit(t->cells->points);
  enter_losses(t, t->cells->points->sum);
}

void add_energy_of_points(void *self, const time_step *step, const double *q1, const double *s)
{
  const inelastic_term *t = self;
  enter_stored(t, t->cells->points->sum);
}

/* Rows of dampers, motors and actuators, which are constant during a step. */
static void put_rows_of_step(const connector_term *t, const time_step *step)
{
  const connectors *c = t->connectors;
  for (int k = 0; k < c->number; ++k) {
    const int i = c->connector[k];
    double a = 0, b = 1, y;
    if (t->viscosity) {
      a = -t->viscosity[i] / step->dt;
      y = a * c->e0[i];
    } else if (t->wanted_motion) {
      const double wanted = value_at(t->wanted_motion + i, step->motion_time);
      a = 1, b = 0;
      y = c->e0[i] + step->fraction * (wanted - c->e0[i]);
    } else {
      const double wanted = -value_at(t->wanted_force + i, step->load_time);
      t->end[i] = t->reached[i] + step->fraction * (wanted - t->reached[i]);
      y = t->reached[i] + step->at * (t->end[i] - t->reached[i]);
    }
    const double row[3] = {a, b, y};
    put_row(c, k, row);
  }
}

static void begin_friction_again(friction *f)
{
  memcpy(f->slip, f->accepted, f->number * sizeof *f->slip);
  memset(f->against, 0, f->number * sizeof *f->against);
  f->guessed = 1;
}

/* A sticking connector moves by `way` in the step, so that its velocity is zero at the end. Without
 * this motion, the previous velocity would come back. */
static void begin_friction(const connectors *c, const time_step *step)
{
  friction *f = c->friction;
  double way_to_rest = 0;
  memset(c->by_cell, 0, c->number * sizeof *c->by_cell);
  if (f->rates) {
    const double *of = f->rates->now->rates[0]; /* v1 as a function of the step and v, with v instead of
                                                 * v_before */
    way_to_rest = -(of[1] + of[2]) / of[0];
    set_cells(f->rate, f->rates->rate[1], f->at_v);
    add_cells((void *)f->rate, step->q0, c->by_cell);
  }
  for (int k = 0; k < c->number; ++k) {
    const int i = c->connector[k];
    if (f->laws) {
      ask_law(f->limit_of_law, f->laws->w + i * f->laws->width, 1, f->limit[i]);
      *f->limit[i] = fmax(*f->limit[i], 0);
    }
    const double limit = *f->limit[i];
    f->way[i] = way_to_rest * c->by_cell[k];
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
  for (int i = 0; l && i < l->number; ++i) {
    double *w = l->w + i * l->width;
    memcpy(w + c->components, c->e0 + i * c->components, c->components * sizeof *w);
    w[2 * c->components] = step->dt;
  }
  if (c->friction) begin_friction(c, step);
  if (c->asked) {
    /* Substeps go in proportion to the loads of the step. A path has no beginning, as its fractions
     * are 1. */
    const double way = step->fraction * step->at;
    const double t1 = way == 1 ? step->load_time : step->t0 + way * (step->load_time - step->t0);
    c->asked->begin(c->asked->begin_self, t1, step->dt);
  }
  if (c->points) begin_points(c->points, t->points->dt, step->dt);
  for (int i = 0; p && i < p->number; ++i) {
    p->w[i * p->width + t->dt_of_law] = step->dt;
    p->way[i] = t->way_before[i];
  }
}

void begin_connectors_again(void *self)
{
  const connector_term *t = self;
  const connectors *c = t->connectors;
  if (c->rigid_plastic)
    memcpy(c->rigid_plastic->way, t->way_before, c->rigid_plastic->number * sizeof *t->way_before);
  if (c->friction) begin_friction_again(c->friction);
  if (c->asked) c->asked->again(c->asked->again_self);
}

void accept_connectors(void *self, const time_step *step, const double *q1, const double *s)
{
  connector_term *t = self;
  const connectors *c = t->connectors;
  const double taken = commit_connectors(c, q1, step->dt);
  if (t->entry) *t->entry += t->sign * taken;
  if (t->reached) memcpy(t->reached, t->end, c->number * sizeof *t->end);
  if (c->friction) memcpy(c->friction->accepted, c->friction->slip, c->number * sizeof(double));
  if (t->lost) *t->lost += c->laws->sum[0];
  if (c->laws && t->points->numerical) *t->points->numerical += c->laws->sum[1];
  if (c->points) {
    respond_springs(c);
    commit(c->points);
    enter_losses(t->points, c->points->sum);
  }
  if (c->rigid_plastic) {
    double sums[3];
    const rigid_plastic *p = c->rigid_plastic;
    commit_rigid_plastic(p, c->e1, sums);
    for (int i = 0; i < p->number; ++i) t->way_before[i] = p->way[i] * p->slipped[i];
    *t->points->hinges += sums[0];
    if (t->points->numerical) *t->points->numerical += t->loss * sums[1];
    *t->hardened = sums[2];
  }
}

void add_energy_of_connectors(void *self, const time_step *step, const double *q1, const double *s)
{
  const connector_term *t = self;
  const connector_laws *l = t->connectors->laws;
  if (t->connectors->points) enter_stored(t->points, t->connectors->points->sum);
  if (t->connectors->asked) *t->points->stored += *t->connectors->asked->held;
  for (int i = 0; l && i < l->number; ++i) *t->points->stored += l->stored[i];
  if (t->connectors->rigid_plastic && t->points->hardening) *t->points->hardening += *t->hardened;
}

/* Energy stored and dissipated by points in the latest response, less the present one; see
 * Points.change. */
static double change_by_response(const points *p, points *copy)
{
  memcpy(copy->w, p->w, (size_t)p->cells * p->of_cell * p->width * sizeof *p->w);
  memcpy(copy->e0, p->e0, 3 * (size_t)p->cells * sizeof *p->e0);
  memcpy(copy->kept, p->kept, POINT_KEPT * (size_t)p->cells * sizeof *p->kept);
  commit(copy);
  const double *after = copy->sum, *before = p->sum;
  return after[0] + after[1] + (after[3] - before[3]) + (after[4] - before[4]) + after[5] + after[6];
}

void change_of_points(void *self, const double *q1, energy_change *sum)
{
  const inelastic_term *t = self;
  respond_at(t->cells, q1);
  sum->in_beams += change_by_response(t->cells->points, t->copy);
}

void change_of_connectors(void *self, const double *q1, energy_change *sum)
{
  const connector_term *t = self;
  const connectors *c = t->connectors;
  double taken = 0;
  find_motions(c, q1);
  const int loses = !c->laws || c->laws->loses, n = c->components;
  for (int j = 0; j < n * c->number; ++j) {
    const double work = taken_by(c, j, q1);
    taken += loses ? work : 0;
    sum->effort += fabs(work);
  }
  for (int i = 0; !loses && i < c->number; ++i)
    taken += end_of_law(c->laws, i, c->e1 + n * i)[LAW_STORED] - c->laws->stored[i];
  if (c->points) {
    respond_springs(c);
    taken = change_by_response(c->points, t->points->copy);
  }
  sum->in_connectors += taken;
}

int points_dissipate(void *self, const double *q1)
{
  const inelastic_term *t = self;
  respond_at(t->cells, q1);
  return gives_energy(t->cells->points) < 0;
}

int springs_dissipate(void *self, const double *q1)
{
  const connector_term *t = self;
  find_motions(t->connectors, q1);
  respond_springs(t->connectors);
  return gives_energy(t->connectors->points) < 0;
}

/* -- prediction of the end of a step, from which Newton's method starts; see stepper.py ---------------- */

/* Root mean square of motions up to which a step resolves them, relative to the scene's size. */
static const double FAR = 1. / 8;

/* Return 1 if a step is as long as the last one. Differences of times have fewer digits than the
 * times. */
static int as_last(const prediction *p, double dt)
{
  return fabs(dt - p->dt) <= 1e-6 * dt;
}

/* Extrapolate from q at the velocity of the last step. After steps of equal length, add the
 * fraction of its acceleration that is expected to repeat. */
void predict(const prediction *p, double dt, const double *q, double *out)
{
  const double ratio = dt / p->dt, *before = p->q_before, *second = p->second;
  const double again = p->equal > 2 && as_last(p, dt) ? p->repeated : 0;
  if (again > 0)
    for (int i = 0; i < p->size; ++i) out[i] = q[i] + ratio * (q[i] - before[i]) + again * second[i];
  else
    for (int i = 0; i < p->size; ++i) out[i] = q[i] + ratio * (q[i] - before[i]);
}

/* Enter a step from q to q1; products are sums over the degrees of freedom that this process
 * owns. */
void enter_step(prediction *p, double dt, const double *q, const double *q1)
{
  p->equal = as_last(p, dt) ? p->equal + (p->equal < 3) : 1;
  p->dt = dt;
  if (!p->second) return;
  double both = 0, now = 0, step = 0;
  const double of_size = 1 / (p->scene * p->scene);
#pragma omp simd reduction(+ : both, now, step)
  for (int i = 0; i < p->size; ++i) {
    const double change = q1[i] - q[i], second = change - (q[i] - p->q_before[i]);
    const double w = p->weight[i], square = w == 1 ? of_size : w > 0; /* of displacements; of rotations */
    both += square * second * p->second[i], now += square * second * second;
    step += square * change * change;
    p->second[i] = second;
  }
  both /= p->unknowns, now /= p->unknowns, step /= p->unknowns;
  p->before = p->now, p->now = now, p->both = both, p->step = step;
}

/* Fraction of the last second difference that is expected to repeat, from the products over all
 * processes. It is zero if steps do not resolve the motion: second differences are not small
 * relative to steps, or a step is long relative to the scene. */
void compare_differences(prediction *p)
{
  const double larger = fmax(p->now, p->before);
  const int resolved = 4 * larger < p->step && p->step < FAR * FAR;
  p->repeated = resolved && p->both > 0 ? p->both / larger : 0;
}

/* -- the step ------------------------------------------------------------------------------------ */

/* Set the step from the present time to t1, a substep of one to `end`. */
static int set_step(time_loop *m, double t1, double end)
{
  time_step *step = &m->step;
  const double t0 = m->t, dt = t1 - t0;
  step->t0 = t0, step->t1 = t1, step->dt = dt, step->at = m->at;
  step->q0 = m->q, step->q_before = m->prediction->q_before, step->ratio = dt / m->prediction->dt;
  step->fraction = m->in_parts ? dt / (end - t0) : 1;
  step->load_time = m->in_parts ? end : (1 - m->load_weight) * t0 + m->load_weight * t1;
  step->motion_time = m->in_parts ? end : t1;
  if (m->applies) step->load_time = step->motion_time = m->begin_of_run;
  return !m->rates || find_numbers(m->rates, dt);
}

/* Begin the step in all terms; returns whether no function of a user has raised an exception. */
static int begin_terms(time_loop *m)
{
  run(&m->begin, &m->step, 0, 0);
  return raised_anywhere(m->equation) == NOTHING;
}

/* Initial guess of the end of the step in the axes of supports: extrapolation of the last steps,
 * and the prescribed motions of supports. */
static void guess(time_loop *m)
{
  const moving_supports *p = m->supports;
  const equation *e = m->equation;
  const double *q = m->q;
  predict(m->prediction, m->step.dt, q, m->guess);
  turn_axes(e->turned, e->axes, m->guess, 1);
  if (p->moving && e->turned) {
    memcpy(e->plane, q, m->size * sizeof *q);
    turn_axes(e->turned, e->axes, e->plane, 1);
    q = e->plane;
  }
  for (int k = 0; k < p->moving; ++k) {
    const int i = p->dof[k];
    m->guess[i] = q[i] + m->step.fraction * (value_at(p->motion + k, m->step.motion_time) - q[i]);
  }
}

/* Begin the step and compute its initial guess; returns whether no function of a user has raised an
 * exception. */
static int begin_at_guess(time_loop *m)
{
  run(&m->begin, &m->step, 0, 0);
  guess(m);
  return raised_anywhere(m->equation) == NOTHING;
}

/* Size of the loads in the step, on all processes. */
static double size_of_loads(const time_loop *m)
{
  const equation *e = m->equation;
  double size = 0;
  for (int k = 0; k < m->loads; ++k) {
    const vector *l = m->load[k];
    size += over_processes(e, HYPOT, norm(l->size, l->dof, e->weight, l->values));
  }
  return size;
}

/* -- places that open: see material_points.py ------------------------------------------------------------ */

/* Held places open in rounds: first places with the largest excess over their limit, then places
 * above the fraction FALL of it, and so on. So the number of solutions stays small if many places
 * open in a step. Excesses that differ by less than TIE count as equal. */
static const double FALL = 0.7, TIE = 1e-9;

static double largest_excess(const time_loop *m)
{
  double most = 0;
  for (int k = 0; k < m->places; ++k) {
    const openable *o = m->place + k;
    if (o->cells) most = fmax(most, *o->cells->points->over);
    else if (o->points) most = fmax(most, *o->points->over);
    for (int i = 0; o->slips && i < o->slips->number; ++i) most = fmax(most, o->slips->excess[i]);
    for (int i = 0; o->rubs && i < o->rubs->number; ++i) most = fmax(most, o->rubs->excess[i]);
  }
  return most;
}

/* Let held places open whose excess is at least `least`. */
static void open_places(time_loop *m, double least)
{
  for (int k = 0; k < m->places; ++k) {
    const openable *o = m->place + k;
    const rigid_plastic *p = o->slips;
    if (o->cells) {
      release(o->cells->points, least);
      o->cells->latest[0] = NAN;
    } else if (o->points)
      release(o->points, least);
    for (int i = 0; p && i < p->number; ++i)
      if (p->excess[i] > 0 && p->excess[i] >= least) p->slipped[i] = RELEASED;
    for (int i = 0; o->rubs && i < o->rubs->number; ++i)
      o->rubs->free[i] |= o->rubs->excess[i] > 0 && o->rubs->excess[i] >= least;
  }
}

/* End a search: close the released places again until the step is accepted. */
static void end_search(time_loop *m, int opened)
{
  memset(m->equation->search, 0, SEARCH_FLAGS * sizeof(int32_t));
  for (int k = 0; opened && k < m->places; ++k) {
    const openable *o = m->place + k;
    const points *p = o->cells ? o->cells->points : o->points;
    for (int i = 0; p && i < p->cells * p->of_cell; ++i)
      if (p->w[i * p->width + FLOWS] == RELEASED) p->w[i * p->width + FLOWS] = CLOSED;
    for (int i = 0; o->slips && i < o->slips->number; ++i) o->slips->slipped[i] = abs(o->way_before[i]);
    if (o->rubs) memset(o->rubs->free, 0, o->rubs->number * sizeof *o->rubs->free);
  }
}

/* Find the end of the step from the initial guess. With `hold`, places that do not flow are held
 * closed, except those that must open. */
static int solve(time_loop *m, int hold)
{
  equation *e = m->equation;
  const double t = e->border ? *e->border->t : 0;
  e->loads = size_of_loads(m);
  if (!m->opens) return find_equilibrium(e, m->guess) > 0;
  int opened = 0;
  if (hold) {
    memset(e->search, 0, SEARCH_FLAGS * sizeof *e->search);
    e->search[HOLD] = 1;
    int found = find_equilibrium(e, m->guess) > 0;
    while (found) {
      const double excess = e->search[OVER] || e->agree ? over_processes(e, LARGEST, largest_excess(m)) : 0;
      if (excess == 0) break;
      open_places(m, pow(FALL, opened++) * excess - TIE);
      memcpy(m->found, e->unknowns, m->size * sizeof *m->found);
      found = find_equilibrium(e, m->found) > 0;
    }
    const int over = over_processes(e, LARGEST, e->search[OVER]) > 0;
    end_search(m, opened);
    if (found || !over || e->raised == OTHER) return found;
    if (!begin_terms(m)) return 0;
    if (e->border) *e->border->t = t;
  }
  return find_equilibrium(e, m->guess) > 0;
}

/* -- whether a step can be trusted ------------------------------------------------------------------ */

static int fails(time_loop *m, enum failure why)
{
  m->failure = why;
  return 0;
}

/* Compute the end of the step in the axes of the plane and the step of the nodes; check that no
 * node rotates further than allowed. */
static int measure(time_loop *m)
{
  equation *e = m->equation;
  double turn = 0;
  if (e->turned) {
    memcpy(m->x, e->unknowns, m->size * sizeof *m->x);
    turn_axes(e->turned, e->axes, m->x, -1);
  }
  for (int i = 0; i < m->size; ++i) m->s[i] = m->x[i] - m->q[i];
  for (int k = 0; k < m->rotations; ++k) turn = fmax(turn, fabs(m->s[m->rotation[k]]));
  m->turn = over_processes(e, LARGEST, turn);
  if (m->applies && m->turn > m->applying_turn && m->short_part * m->step.dt > m->applied_by - m->begin_of_run)
    return fails(m, APPLIED_TOO_FAST);
  if (m->limits_rotation && !(m->turn <= m->largest_turn)) return fails(m, TURNS_TOO_FAR);
  for (int k = 0; k < m->half_tangents; ++k) {
    const int i = m->half_tangent[k];
    m->s[i] = 2 * tan(m->s[i] / 2);
  }
  for (int k = 0; k < m->multipliers; ++k) m->s[m->multiplier[k]] = 0;
  return 1;
}

/* Check that a static step has followed its path: no node moves as a mechanism does, and the work
 * of internal forces equals the energy stored and dissipated; see step_equation.py. */
static int followed(time_loop *m)
{
  static_path *p = m->path;
  equation *e = m->equation;
  energy_change sum = {0};
  double far = 0, through = 0, round_off = 0;
  for (int i = 0; i < m->size; ++i)
    if (!(fabs(m->s[i]) * p->per_far[i] <= far)) far = fabs(m->s[i]) * p->per_far[i];
  p->moves = over_processes(e, LARGEST, far);
  if (!(p->moves <= p->far)) return fails(m, LEAVES_MECHANISM);
  if (isinf(p->slack)) return 1;
  for (int k = 0; k < p->terms; ++k) p->change[k].of(p->change[k].self, m->x, &sum);
  const double work = work_in_step(m->size, 0, p->weight_of_before, p->force, e->inner_force, m->s);
  find_motion(e, e->unknowns);
  find_round_off(e, e->unknowns, e->space);
  for (int i = 0; i < e->owned; ++i) round_off += fabs(e->space[i] * m->s[i]);
  for (int k = 0; k < p->accounts; ++k)
    for (int i = 0; i < p->entries[k]; ++i) through += fabs(p->account[k][i]);
  enum { OF_FORCES, BEAMS, CONNECTORS, EFFORT, ROUND_OFF, THROUGH, SUMS };
  const enum agreement how[SUMS] = {TOTAL, TOTAL, TOTAL, TOTAL, TOTAL, TOTAL};
  double of[SUMS] = {work, sum.in_beams, sum.in_connectors, sum.effort, round_off, through};
  agree(e, SUMS, how, of);
  p->work = of[OF_FORCES];
  p->stored = of[BEAMS] + of[CONNECTORS];
  /* A motor that stretches a spring does the work that the spring takes; their sum is no measure.
   * Works of connectors are summed one by one, so that the size does not depend on the number of
   * processes. */
  const double size = fabs(p->work) + fabs(of[BEAMS]) + of[EFFORT];
  const double slack = p->slack * size + of[ROUND_OFF] + DBL_MIN;
  if (fabs(p->work - p->stored) <= slack + p->kink * of[THROUGH]) return 1;
  return fails(m, LEAPS);
}

/* Solve a step that its terms have begun from the initial guess; returns whether its end is
 * accepted. */
static int solve_step(time_loop *m, int hold)
{
  equation *e = m->equation;
  int admitted = 1;
  if (!solve(m, hold))
    return fails(m, raised_anywhere(e) == OTHER ? RAISED : NO_EQUILIBRIUM);
  if (!measure(m)) return 0;
  for (int k = 0; k < m->admissions; ++k) admitted &= m->admission[k].of(m->admission[k].self, m->x);
  if (m->judges && over_processes(e, LARGEST, !admitted) > 0) return fails(m, GIVES_ENERGY);
  return !m->path || followed(m);
}

/* Fraction of the first step after which the acceleration is taken as the initial one. Shorter
 * trial steps come closer to it, but amplify velocities of supports that do not fit the initial
 * velocities. */
static const double FIRST_TRIAL = 1. / 16;

/* Solve the step to t1, a substep of one to `end`; the state changes only if it is accepted. */
int attempt_step(time_loop *m, double t1, double end)
{
  equation *e = m->equation;
  e->raised = NOTHING;
  if (m->rates && m->prepare && !m->rates->ready) {
    const double first = m->t + FIRST_TRIAL * (t1 - m->t);
    if (!set_step(m, first, t1) || !begin_at_guess(m)) return fails(m, RAISED);
    if (!solve_step(m, 1)) return 0;
    m->prepare(m->handle);
  }
  if (!set_step(m, t1, end) || !begin_at_guess(m)) return fails(m, RAISED);
  return solve_step(m, 1);
}

/* Solve a step of a path that Python has set. */
int solve_begun_step(time_loop *m, int hold)
{
  m->equation->raised = NOTHING;
  return begin_terms(m) ? solve_step(m, hold) : fails(m, RAISED);
}

static void accept_supports(time_loop *m)
{
  const moving_supports *p = m->supports;
  const double a = p->weight_of_before;
  turn_axes(m->equation->turned, m->equation->axes, m->s, 1);
  if (p->moving)
    for (int k = 0; k < p->held; ++k)
      if (p->hold[k] < m->equation->owned)
        *p->work += (a * p->before[k] + (1 - a) * p->reactions[k]) * m->s[p->hold[k]];
  memcpy(p->before, p->reactions, p->held * sizeof *p->before);
}

/* Count successive changes of direction of the watched forces, by steps or samples. */
static void watch_forces(force_watch *w, const time_loop *m)
{
  for (int i = 0; i < w->number; ++i) {
    const double force = w->value[i] ? *w->value[i] : m->q[w->dof[i]];
    if (w->value[i] && !*w->fresh[i]) continue;
    if (w->value[i]) *w->fresh[i] = 0;
    const double change = force - w->force[i];
    w->largest[i] = fmax(w->largest[i], fabs(force));
    const int large = fabs(change) >= w->large * w->largest[i];
    const int moves = fabs(*w->rate[i]) * m->step.dt >= w->moved * w->length[i];
    w->count[i] = large && moves && change * w->change[i] < 0 ? w->count[i] + 1 : 0;
    w->force[i] = force, w->change[i] = change;
    if (w->count[i] != w->most || w->told[i] == w->told[i]) continue;
    w->told[i] = m->t;
    w->tells = 1;
  }
}

/* Accept the end of the step as the state. Returns whether no function of a user has raised an
 * exception. The step is accepted even if one has, because some terms have accepted it already. */
int accept_step(time_loop *m)
{
  equation *e = m->equation;
  prediction *p = m->prediction;
  run(&m->accept, &m->step, m->x, m->s);
  if (m->path) memcpy(m->path->force, e->inner_force, m->size * sizeof *m->path->force);
  accept_cell_forces(m->cell_forces);
  accept_supports(m);
  memset(m->state, 0, m->states * sizeof *m->state);
  run(&m->add_state, &m->step, m->x, m->s);
  enter_step(p, m->step.dt, m->q, m->x);
  if (m->rates) {
    const enum agreement how[] = {TOTAL, TOTAL, TOTAL};
    double products[] = {p->both, p->now, p->step};
    agree(e, 3, how, products);
    p->both = products[0], p->now = products[1], p->step = products[2];
  }
  compare_differences(p);
  double *spare = p->q_before;
  p->q_before = m->q, m->q = spare;
  memcpy(m->q, m->x, m->size * sizeof *m->q);
  m->t = m->step.t1;
  m->failure = SUCCEEDS;
  ++m->parts;
  if (m->forces && !isinf(m->step.dt)) watch_forces(m->forces, m);
  for (int k = 0; k < m->watches; ++k) watch_step(m->watch[k], 1, m->t, p->q_before, m->q);
  return raised_anywhere(e) == NOTHING || fails(m, RAISED);
}

/* Go to a time in one step or, if that fails, in substeps; returns whether the time is reached. */
int go_to_time(time_loop *m, double end)
{
  const double begin = m->t;
  for (int done = 0, some = MOST_SUBSTEPS; done < MOST_SUBSTEPS;) {
    const double t1 = done + some == MOST_SUBSTEPS ? end : begin + (end - begin) * (done + some) / MOST_SUBSTEPS;
    if (attempt_step(m, t1, end)) {
      if (!accept_step(m)) return 0;
      done += some;
      /* Double the substep at the times where a larger one would begin. */
      if (done % (2 * some) == 0 && some < MOST_SUBSTEPS) some *= 2;
    } else {
      m->failed_end = t1;
      if (some == 1 || m->equation->raised == OTHER || m->equation->error) return 0;
      some /= 2;
    }
  }
  return 1;
}

static double seconds_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Write the state, or the entries of this process, into a row; see state_rows.py. */
void keep_state(const time_loop *m, double *row)
{
  memset(row, 0, m->sums * sizeof *row);
  for (int k = 0; k < m->kinds; ++k) {
    const kept_numbers *n = m->kept + k;
    const double *from = *n->from;
    if (!n->to)
      memcpy(row + n->first, from, n->number * sizeof *row);
    else
      for (int i = 0; i < n->number; ++i) row[n->to[i]] += from[n->at[i]];
  }
}

/* Take steps to the times `ends` until one fails, or ends more than `seconds` after the call;
 * returns the number of steps. If `keeps`, their states are written into `rows`. A step that was
 * divided is the last one, as its last substep does not begin at the end of the previous step. */
int take_steps(time_loop *m, int steps, const double *ends, double seconds, int keeps, double *rows)
{
  const double end = steps > 1 ? seconds_now() + seconds : 0;
  m->failure = SUCCEEDS;
  m->parts = 0;
  for (int k = 0; k < steps; ++k) {
    const int before = m->parts;
    do {
      const double stop = m->stop ? fmin(m->stop(m->stops, ends[k]), ends[k]) : ends[k];
      if (!go_to_time(m, stop)) return k;
    } while (m->t != ends[k]);
    if (keeps) keep_state(m, rows + (size_t)k * m->width);
    m->parts_of_last = m->parts - before;
    if (m->parts_of_last > 1 || (steps > 1 && seconds_now() > end)) return k + 1;
  }
  return steps;
}
