/* SPDX-License-Identifier: MIT */
/* Blocks: all elements with one statement; see blocks/block.py. Everything here follows from the functions of
 * the statement; no function knows an effect. */

/* The outputs of a function for all elements; element by element if it has no loop in lanes. */
static void evaluate(const element_block *b, const element_function *f, double *out)
{
  const int n = b->lanes;
  double *one = b->space, *e = one + b->width;
  if (f->several) {
    f->several(b->batches, b->w, out);
    return;
  }
  for (int c = 0; c < b->batches; ++c)
    for (int l = 0; l < n; ++l) {
      const double *w = b->w + (size_t)c * b->width * n + l;
      for (int i = 0; i < b->width; ++i) one[i] = w[i * n];
      ask(f->one, one, f->outputs, e);
      for (int i = 0; i < f->outputs; ++i) out[((size_t)c * f->outputs + i) * n + l] = e[i];
    }
}

/* Number of elements in batch c; copies of the last one fill up its lanes. */
static inline int elements_in(const element_block *b, int c)
{
  const int rest = b->elements - c * b->lanes;
  return rest < b->lanes ? rest : b->lanes;
}

/* Input i of batch c; inputs are motions after and before the step, state, numbers, numbers of the step. */
static inline double *input(const element_block *b, int c, int i) { return b->w + ((size_t)c * b->width + i) * b->lanes; }

/* Write the configuration q into the motions of elements, from the input `first` on. */
static void gather(const element_block *b, const double *q, int first)
{
  const int all = b->unknowns * b->lanes;
  const int32_t *dofs = b->dofs;
  for (int c = 0; c < b->batches; ++c, dofs += all) {
    double *w = input(b, c, first);
    for (int i = 0; i < all; ++i) w[i] = q[dofs[i]];
  }
}

/* Add numbers of elements, `each` of them, to `out` at indices. */
static void scatter(const element_block *b, int each, const double *values, const int32_t *index, double *out)
{
  const int n = b->lanes;
  for (int c = 0; c < b->batches; ++c)
    for (int i = 0, some = elements_in(b, c); i < each; ++i, values += n, index += n)
      for (int l = 0; l < some; ++l) out[index[l]] += values[l];
}

/* Numbers of a step: functions of time, and the length of the step. */
static void find_numbers_of_step(const element_block *b, const time_step *step)
{
  static const double at_rest = 1e300; /* instead of an infinite step; all rates are practically zero */
  const double t = b->t[0], a = b->weight_of_before, reached = step->at * step->fraction;
  double time[TIMES_OF_NUMBERS];
  time[AT_START] = t, time[AT_NOW] = t + reached * (step->load_time - t);
  time[AT_END] = b->t[1] = t + step->fraction * (step->motion_time - t);
  time[AT_MIDDLE] = a * t + (1 - a) * time[AT_NOW];
  for (int k = 0; k < b->functions; ++k)
    if (b->when[k] == GROWS) {
      const double change = step->fraction * (value_at(b->function + k, step->load_time) - b->before[k]);
      b->end[k] = b->before[k] + change, b->now[k] = b->before[k] + step->at * change;
    } else
      b->now[k] = value_at(b->function + k, time[b->when[k]]);
  b->now[b->functions] = fmin(step->dt, at_rest);
}

void begin_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  const int of_step = b->width - b->steps, all = b->steps * b->lanes;
  find_numbers_of_step(b, step);
  gather(b, step->q0, b->unknowns);
  for (int c = 0; c < b->batches; ++c)
    for (int i = 0; i < all; ++i) input(b, c, of_step)[i] = b->now[b->from[(size_t)c * all + i]];
  /* For the size of loads: iterates of a failed step may be far away, and a first step has no forces before it. */
  if (*b->begun) memcpy(b->force, b->force_before, b->size * sizeof *b->force);
  else if (b->size) {
    gather(b, step->q0, 0);
    evaluate(b, b->force_of, b->out);
    memset(b->force, 0, b->size * sizeof *b->force);
    scatter(b, b->unknowns, b->out, b->at, b->force);
  }
}

void add_block(void *self, const double *q, double *r)
{
  const element_block *b = self;
  gather(b, q, 0);
  evaluate(b, b->force_of, *b->each);
  if (!b->size) {
    scatter(b, b->unknowns, *b->each, b->dofs, r);
    return;
  }
  memset(b->force, 0, b->size * sizeof *r);
  scatter(b, b->unknowns, *b->each, b->at, b->force);
  for (int i = 0; i < b->size; ++i) r[b->dof[i]] += b->force[i];
}

void add_block_tangent(void *self, const double *q, double *tangent)
{
  const element_block *b = self;
  gather(b, q, 0);
  evaluate(b, b->tangent_of, b->out);
  scatter(b, b->tangent_of->outputs, b->out, b->entry, tangent);
}

/* Compute new states and energies. Stored energies are kept for add_energy_of_block; with `enter`, the new states
 * are accepted, and energies of the step are added to the ledger. */
static void end_step(const element_block *b, int enter)
{
  const int n = b->lanes, outputs = b->end_of->outputs, energies = b->stored + b->entered;
  evaluate(b, b->end_of, b->out);
  memset(b->energy, 0, b->stored * sizeof(double));
  for (int c = 0; c < b->batches; ++c) {
    const double *out = b->out + (size_t)c * outputs * n, *energy = out + b->states * n;
    if (enter) memcpy(input(b, c, 2 * b->unknowns), out, b->states * n * sizeof *out);
    for (int i = 0, some = elements_in(b, c); i < energies; ++i)
      for (int l = 0; l < some; ++l)
        if (i < b->stored) b->energy[i] += energy[i * n + l];
        else if (enter) *b->entries[i] += energy[i * n + l];
  }
}

/* Energies of the state with the configuration q, from which a step begins. */
void find_energies_of_block(const element_block *b, const double *q)
{
  gather(b, q, 0);
  end_step(b, 0);
}

void accept_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  if (b->work) *b->work -= work_in_step(b->size, b->dof, b->weight_of_before, b->force_before, b->force, s);
  memcpy(b->force_before, b->force, b->size * sizeof *b->force);
  memcpy(b->before, b->end, b->functions * sizeof *b->before);
  b->t[0] = b->t[1], *b->begun = 1;
  if (!b->end_of) return;
  gather(b, q1, 0);
  end_step(b, 1);
}

void add_energy_of_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  for (int i = 0; i < b->stored; ++i) *b->entries[i] += b->energy[i];
}

/* Add the derivative of the tangent at q in the direction u; w is space for all inputs and for the motions in u. */
void add_change_of_tangent(const element_block *b, const element_function *f, const double *q, const double *u, double *w,
                           double *tangent)
{
  element_block more = *b;
  more.w = w, more.width = b->width + b->unknowns;
  for (int c = 0; c < b->batches; ++c)
    memcpy(input(&more, c, 0), input(b, c, 0), (size_t)b->width * b->lanes * sizeof *w);
  gather(&more, q, 0);
  gather(&more, u, b->width);
  evaluate(&more, f, b->out);
  scatter(b, f->outputs, b->out, b->entry, tangent);
}

/* -- derivatives ----------------------------------------------------------------------------------------- */

/* Derivatives by the numbers of a step, from blocks in neighbouring scenes that take the same step. */
static void find_directions_of_step(const block_derivatives *m, const time_step *step)
{
  const int numbers = m->block->functions;
  memset(m->by_step, 0, (size_t)m->parameters * (numbers + 1) * sizeof *m->by_step);
  for (int k = 0; k < m->parameters * m->neighbours; ++k) {
    const element_block *one = m->neighbour[k];
    find_numbers_of_step(one, step);
    double *direction = m->by_step + k / m->neighbours * (numbers + 1);
    for (int i = 0; i < numbers; ++i) direction[i] += m->weight[k] * (one->now[i] - m->block->now[i]);
  }
}

void tabulate_block(void *self, const time_step *step, const double *q1)
{
  const block_derivatives *m = self;
  gather(m->block, q1, 0);
  evaluate(m->block, m->table_of, m->table);
  find_directions_of_step(m, step);
}

/* Derivatives of all inputs of the elements in batch c by parameter p. The derivatives of the motions at the end of
 * the step are in q1; without q1 they are zero. */
static void find_direction(const block_derivatives *m, const derivatives *d, int c, int p, const double *q1)
{
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns * n, steps = b->steps * n;
  const size_t states = b->states * n, numbers = b->numbers * n, at = (size_t)p * b->batches + c;
  const double *q0 = d->q0 + (size_t)p * d->size, *now = m->by_step + p * (b->functions + 1);
  const int32_t *dofs = b->dofs + (size_t)c * motions, *from = b->from + (size_t)c * steps;
  double *x = m->direction;
  for (int i = 0; i < motions; ++i) x[i] = q1 ? q1[dofs[i]] : 0, x[motions + i] = q0[dofs[i]];
  x += 2 * motions;
  memcpy(x, m->by_state + at * states, states * sizeof *x), x += states;
  memcpy(x, m->by_number + at * numbers, numbers * sizeof *x), x += numbers;
  for (int i = 0; i < steps; ++i) x[i] = now[from[i]];
}

/* Product of a row of the table of batch c with the directions, in lanes. */
static inline void multiply_row(const block_derivatives *m, int c, int row, double *sum)
{
  const element_block *b = m->block;
  const int n = b->lanes;
  const double *slope = m->table + ((size_t)c * (b->unknowns + b->states) + row) * b->width * n;
  memset(sum, 0, n * sizeof *sum);
  for (int j = 0; j < b->width; ++j, slope += n)
    for (int l = 0; l < n; ++l) sum[l] += slope[l] * m->direction[j * n + l];
}

void add_block_derivative(void *self, const derivatives *d, int p, double *r)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  double sum[MOST_LANES];
  for (int c = 0; c < b->batches; ++c) {
    find_direction(m, d, c, p, 0);
    for (int i = 0; i < b->unknowns; ++i) {
      const int32_t *dofs = b->dofs + ((size_t)c * b->unknowns + i) * b->lanes;
      multiply_row(m, c, i, sum);
      for (int l = 0; l < elements_in(b, c); ++l) r[dofs[l]] += sum[l];
    }
  }
}

void accept_block_derivative(void *self, const derivatives *d, int p)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const size_t of_batch = b->states * b->lanes;
  for (int c = 0; c < b->batches && b->states; ++c) {
    double *z = m->by_state + ((size_t)p * b->batches + c) * of_batch;
    find_direction(m, d, c, p, d->q1 + (size_t)p * d->size);
    for (int i = 0; i < b->states; ++i) multiply_row(m, c, b->unknowns + i, z + i * b->lanes);
  }
  for (int k = p * m->neighbours; k < (p + 1) * m->neighbours; ++k) {
    const element_block *one = m->neighbour[k];
    memcpy(one->before, one->end, b->functions * sizeof(double));
    one->t[0] = one->t[1];
  }
}

/* Add the products of the rows from `first` on, weighted by `bar` in lanes, to the derivatives by all inputs but
 * the state, and return those by the state in `z_bar`. */
static void transpose_rows(const block_derivatives *m, adjoint *a, int c, int first, int rows, const double *bar,
                           double *z_bar)
{
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns, end = 2 * motions + b->states;
  const int32_t *dofs = b->dofs + (size_t)c * motions * n, *from = b->from + (size_t)c * b->steps * n;
  for (int i = 0; i < rows; ++i) {
    const double *slope = m->table + ((size_t)c * (motions + b->states) + first + i) * b->width * n;
    for (int j = 0; j < b->width; ++j, slope += n)
      for (int l = 0; l < elements_in(b, c); ++l) {
        const double x = slope[l] * bar[i * n + l];
        if (j < motions) { if (first) a->q1[dofs[j * n + l]] += x; }
        else if (j < 2 * motions) a->q0[dofs[(j - motions) * n + l]] += x;
        else if (j < end) z_bar[(j - 2 * motions) * n + l] += x;
        else if (j < end + b->numbers) m->number_bar[((size_t)c * b->numbers + j - end) * n + l] += x;
        else m->step_bar[from[(j - end - b->numbers) * n + l]] += x;
      }
  }
}

/* The table of a recorded step, whose inputs are restored. */
static void tabulate_again(const block_derivatives *m, const adjoint *a)
{
  find_numbers_of_step(m->block, a->step);
  find_directions_of_step(m, a->step);
  evaluate(m->block, m->table_of, m->table);
}

void transpose_block_state(void *self, adjoint *a)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int of_batch = b->states * b->lanes;
  tabulate_again(m, a);
  for (int c = 0; c < b->batches && b->states; ++c) {
    double *bar = m->state_bar + (size_t)c * of_batch;
    memcpy(m->direction, bar, of_batch * sizeof *bar);
    memset(bar, 0, of_batch * sizeof *bar);
    transpose_rows(m, a, c, b->unknowns, b->states, m->direction, bar);
  }
}

void transpose_block(void *self, adjoint *a, const double *λ)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns * n;
  if (a->d->initial) tabulate_again(m, a); /* such a step has no new state */
  for (int c = 0; c < b->batches; ++c) {
    const int32_t *dofs = b->dofs + (size_t)c * motions;
    for (int i = 0; i < motions; ++i) m->direction[i] = λ[dofs[i]];
    transpose_rows(m, a, c, 0, b->unknowns, m->direction, m->state_bar + (size_t)c * b->states * n);
  }
  add_products(a, b->functions + 1, m->step_bar, m->by_step);
  memset(m->step_bar, 0, (b->functions + 1) * sizeof *m->step_bar);
}

void finish_block(void *self, adjoint *a)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const size_t all = (size_t)b->batches * b->lanes;
  add_products(a, all * b->states, m->state_bar, m->by_state);
  add_products(a, all * b->numbers, m->number_bar, m->by_number);
}
