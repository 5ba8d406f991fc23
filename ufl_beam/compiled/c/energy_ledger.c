/* SPDX-License-Identifier: MIT */
/* Energy ledger: each term accepts a step and enters its works and losses, and adds its energies; see
 * energy_ledger.py. */

/* x A y for the matrix A of m */
static double product_with(const matrix_of_rates *m, const double *x, const double *y)
{
  const step_product *p = m->product;
  double *Ay = p->space, sum = 0;
  memset(Ay, 0, p->size * sizeof *Ay);
  add_product(p->A, y, Ay);
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < p->size; ++i) sum += x[i] * Ay[i];
  return sum;
}

void accept_dead_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  dead_loads *l = self;
  *l->work += work_in_step(l->size, l->dof, l->weight_of_before, l->before, l->force, s);
  memcpy(l->factors_before, l->factors_at_end, l->vectors * sizeof *l->factors_before);
  sum_loads(l, l->factors_before, l->before);
}

void accept_inertia(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  rates *r = m->rates;
  r->rate[0] = (double *)s;
  combine_rates(r, r->now->rates[0], 0, r->new_rate[1]);
  for (int j = 3; j < r->number; ++j) combine_rates(r, r->now->rates[j - 2], 0, r->new_rate[j]);
  if (m->lost) {
    double *change = m->v;
    for (int i = 0; i < r->size; ++i) change[i] = r->new_rate[1][i] - r->rate[1][i];
    r->rate[0] = change;
    combine_rates(r, r->now->slip, 0, r->new_rate[2]);
    *m->lost += product_with(m, r->new_rate[2], change);
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
  const double *v = m->rates->rate[1];
  *m->kept += product_with(m, v, v) / 2;
}

void accept_rayleigh(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  *m->lost += product_with(m, s, s) / step->dt;
}

/* The points of a block after their response at q. */
static points *respond_in(const element_block *b, const double *q)
{
  if (b->sections) respond_at(b->sections, q);
  else respond_springs(b, q);
  return b->inner;
}

void accept_points(void *self, const time_step *step, const double *q1, const double *s)
{
  points *p = respond_in(self, q1);
  if (p->damped) {
    accept_block((void *)p->damped, step, q1, s);
    keep_tangents(p);
  }
  end_points(p, p->sum, 1);
  for (int k = 0; k < POINT_OUTPUTS; ++k)
    if (p->entry[k] && k != ELASTIC && k != HARDENING) *p->entry[k] += (k == LOST ? 2 * p->alpha : 1) * p->sum[k];
}

void add_energy_of_points(void *self, const time_step *step, const double *q1, const double *s)
{
  const points *p = ((element_block *)self)->inner;
  for (int k = ELASTIC; k <= HARDENING; ++k)
    if (p->entry[k]) *p->entry[k] += p->sum[k];
}

/* Energy that points store and dissipate in a step to q1. */
static double change_by_response(const element_block *b, const double *q1)
{
  points *p = respond_in(b, q1);
  double after[POINT_OUTPUTS], change = 0;
  end_points(p, after, 0);
  for (int k = 0; k < POINT_OUTPUTS; ++k)
    if (k != LOST) change += after[k] - (k == ELASTIC || k == HARDENING ? p->sum[k] : 0);
  return change;
}

/* Energy that connectors of a block take: the work of their forces, by the rule with which all forces of a static step
 * do work; on the path of rate-independent laws; of elastic laws, the energy that they store. */
void change_of_block(void *self, const double *q1, energy_change *sum)
{
  const element_block *b = self;
  const int n = b->lanes, first = b->states + b->shares, energies = first + b->recorded, elastic = b->stored && !b->lost;
  const double *w = first_numbers(b); /* works on paths */
  end_step_of_block(b, q1, COMPUTE);
  for (int i = 0; i < b->elements; ++i) {
    const double *out = b->out + (size_t)(i / n) * b->end_of->outputs * n + i % n;
    for (int k = 0; k < b->recorded; ++k) {
      const double work = b->recorded_kind[k] == RECORDED_WORK ? out[(first + k) * n] : 0;
      sum->effort += fabs(work);
      if (!elastic && !b->power_of && !b->inner) sum->in_connectors += work;
    }
    for (int k = 0; elastic && k < b->stored; ++k) sum->in_connectors += out[(energies + k) * n];
    if (b->power_of) sum->in_connectors += w[(size_t)(i / n) * b->width * n + i % n];
  }
  for (int k = 0; elastic && k < b->stored; ++k) sum->in_connectors -= b->energy[k];
  if (b->inner) sum->in_connectors += change_by_response(b, q1);
}

/* Energy that cells store in a step to q1, without the energy that they supply. */
void change_of_cells(void *self, const double *q1, energy_change *sum)
{
  const element_block *b = self;
  double *out = b->out, before = 0;
  if (b->inner) sum->in_beams += change_by_response(b, q1);
  gather(b, q1, 0);
  if (b->end_of) FOR_ACTING(b, c) {
    evaluate_batch(b, b->end_of, c, out);
    const double *energy = out + (b->states + b->shares + b->recorded) * b->lanes;
    for (int i = 0; i < b->stored + b->entered; ++i)
      for (int l = 0; l < elements_in(b, c); ++l) {
        const double x = energy[i * b->lanes + l];
        if (i < b->stored) sum->in_beams += x;
        else if (i >= b->stored + b->lost) sum->in_beams -= x, sum->effort += fabs(x);
      }
  }
  for (int i = 0; i < b->stored; ++i) before += b->energy[i];
  sum->in_beams -= before;
}

int points_dissipate(void *self, const double *q1)
{
  return gives_energy(respond_in(self, q1)) < 0;
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
