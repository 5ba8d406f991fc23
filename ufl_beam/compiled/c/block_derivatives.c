/* SPDX-License-Identifier: MIT */
/* Derivatives of blocks by parameters, direct and adjoint; see blocks/block.py. */

/* Derivatives by the numbers of a step, from blocks in neighbouring scenes that take the same step. */
static void find_directions_of_step(const block_derivatives *m, const time_step *step)
{
  const element_block *b = m->block;
  const int shared = b->groups * b->shares;
  memset(m->by_step, 0, (size_t)m->parameters * m->of_step * sizeof *m->by_step);
  for (int k = 0; k < m->parameters * m->neighbours; ++k) {
    const element_block *one = m->neighbour[k];
    find_numbers_of_step(one, step);
    double *direction = m->by_step + k / m->neighbours * m->of_step;
    for (int i = 0; i < b->functions; ++i) direction[i] += m->weight[k] * (one->now[i] - b->now[i]);
  }
  for (int p = 0; p < m->parameters; ++p)
    memcpy(m->by_step + (p + 1) * m->of_step - shared, m->by_shared + (size_t)p * shared, shared * sizeof(double));
}

/* Number of rows of the table: forces, state, shared numbers, strains of material points. */
static inline int rows_of(const block_derivatives *m)
{
  const element_block *b = m->block;
  return b->unknowns + b->states + b->shares + m->strains;
}

/* Length of a row of the table. */
static inline int columns(const element_block *b) { return b->width - b->modes; }

/* Remove the unknowns of the elements of a batch from their table T. */
static void condense(const block_derivatives *m, double *T)
{
  const int u = m->unknowns, n = m->block->lanes, inputs = columns(m->block), all = inputs + u;
  const int rows = rows_of(m) + m->margins;
  double A[(1 + MOST_VARIABLES) * (1 + MOST_VARIABLES)], *B = m->direction;
  for (int l = 0; l < n; ++l) {
    for (int i = 0; i < u; ++i)
      for (int j = 0; j < all; ++j) *(j < inputs ? B + i * inputs + j : A + i * u + j - inputs) = T[((rows + i) * all + j) * n + l];
    solve_dense(u, A, inputs, B);
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < inputs; ++j) {
        double x = T[(i * all + j) * n + l];
        for (int k = 0; k < u; ++k) x -= T[(i * all + inputs + k) * n + l] * B[k * inputs + j];
        T[(i * inputs + j) * n + l] = x;
      }
  }
  memmove(T + rows * inputs * n, T + (rows + u) * all * n, m->margins * n * sizeof *T);
}

/* Compute the table. Derivatives by infinite numbers, such as the limit of an elastic law, and zero times an infinite
 * number of a branch that is not taken, are not finite; they count as zero. */
static void find_table(const block_derivatives *m)
{
  const element_block *b = m->block;
  const int outputs = m->table_of->outputs, slopes = (rows_of(m) + m->margins + m->unknowns) * (columns(b) + m->unknowns);
  evaluate(b, m->table_of, m->table);
  for (int c = 0; c < b->batches; ++c) {
    double *T = m->table + (size_t)c * outputs * b->lanes;
    for (int i = 0; i < slopes * b->lanes; ++i)
      if (!isfinite(T[i])) T[i] = 0;
    if (m->unknowns) condense(m, T);
  }
}

void tabulate_block(void *self, const time_step *step, const double *q1)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  gather(b, q1, 0);
  if (m->inner) {
    inelastic *sections = b->sections;
    if (sections) sections->latest[0] = NAN, sections->points->predicts = 0, respond_at(sections, q1);
    else find_modes(b);
    tabulate_points(m->inner);
  }
  if (m->tabulate) {
    evaluate(b, b->end_of, b->out);
    m->tabulate(m->user);
  }
  find_table(m);
  find_directions_of_step(m, step);
}

/* Derivatives of all inputs of the elements in batch c by parameter p. The derivatives of the motions at the end of
 * the step are in q1; without q1 they are zero. */
static void find_direction(const block_derivatives *m, const derivatives *d, int c, int p, const double *q1)
{
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns * n, steps = b->steps * n;
  const size_t states = b->states * n, numbers = b->numbers * n, at = (size_t)p * b->batches + c;
  const double *now = m->by_step + p * m->of_step;
  const int32_t *dofs = b->dofs + (size_t)c * motions, *from = b->from + (size_t)c * steps;
  double *x = m->direction;
  for (int j = -1; j <= b->rates; ++j, x += motions) {
    const double *q = j < 0 ? q1 : (j ? d->rates[j] : d->q0) + (size_t)p * d->size;
    for (int i = 0; i < motions; ++i) x[i] = q ? q[dofs[i]] : 0;
  }
  memcpy(x, m->by_state + at * states, states * sizeof *x), x += states;
  memcpy(x, m->by_number + at * numbers, numbers * sizeof *x), x += numbers;
  for (int i = 0; i < steps; ++i) x[i] = now[from[i]];
}

/* Strain k of the points of element i, in an array of all strains of each section. A spring has one strain only. */
static inline size_t strain_of(const block_derivatives *m, int i, int k)
{
  return (m->strains == 1 ? m->inner->points->strains : m->strains) * (size_t)i + k;
}

/* Row of the table of batch c. */
static inline const double *row_of(const block_derivatives *m, int c, int row)
{
  return m->table + ((size_t)c * m->table_of->outputs + row * columns(m->block)) * m->block->lanes;
}

/* Product of a row of the table of batch c with the directions of parameter p, in lanes, from an input on. */
static inline void multiply_row(const block_derivatives *m, int c, int row, int p, int first, double *sum)
{
  const element_block *b = m->block;
  const int n = b->lanes;
  const int32_t *changes = m->changes + (size_t)p * columns(b);
  const double *slope = row_of(m, c, row), *x = m->direction;
  double own[MOST_LANES] = {0};
#define SUM(n) for (int j = first; j < columns(b); ++j) \
    if (changes[j]) \
      for (int l = 0; l < n; ++l) own[l] += slope[j * n + l] * x[j * n + l]
  if (n == 8) { SUM(8); } /* the compiler knows the usual size */
  else { SUM(n); }
#undef SUM
  memcpy(sum, own, n * sizeof *sum);
}

/* The first number of element i, in an array of the numbers of all elements. */
static inline double *number_of(const element_block *b, double *numbers, int i)
{
  return numbers + (size_t)(i / b->lanes) * b->numbers * b->lanes + i % b->lanes;
}

void add_block_derivative(void *self, const derivatives *d, int p, double *r)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  double sum[MOST_LANES];
  if (m->inner) { /* the derivatives of the forces at constant motions are numbers of the elements */
    add_points_derivative(m->inner, d, p);
    for (int i = 0; i < b->elements; ++i)
      for (int k = 0; k < m->strains; ++k)
        number_of(b, m->by_number + (size_t)p * all_numbers(b), i)[k * b->lanes] = m->inner->r[strain_of(m, i, k)];
  }
  FOR_ACTING(b, c) {
    find_direction(m, d, c, p, 0);
    for (int i = 0; i < b->unknowns; ++i) {
      const int32_t *dofs = b->dofs + ((size_t)c * b->unknowns + i) * b->lanes;
      multiply_row(m, c, i, p, b->unknowns, sum);
      for (int l = 0; l < elements_in(b, c); ++l) r[dofs[l]] += sum[l];
    }
  }
}

void accept_block_derivative(void *self, const derivatives *d)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes, shared = b->groups * b->shares, computes = b->states || b->shares || m->margins || m->strains;
  double sum[MOST_LANES];
  for (int i = 0; i < m->parameters * shared; ++i) /* numbers of the step have copies of the values before it */
    if (!d->initial || i % b->shares >= b->kept) m->by_shared[i] = 0;
  FOR_ACTING(b, c)
    for (int p = 0; computes && p < m->parameters; ++p) {
      double *z = m->by_state + ((size_t)p * b->batches + c) * b->states * n;
      find_direction(m, d, c, p, d->q1 + (size_t)p * d->size);
      for (int k = 0; k < m->margins; ++k) {
        const double *margin = row_of(m, c, rows_of(m) + m->margins) + k * n;
        multiply_row(m, c, rows_of(m) + k, p, 0, sum);
        for (int l = 0; l < elements_in(b, c); ++l) note_margin(d, p, (c * n + l) * (b->laws ? b->laws : 1), margin[l], sum[l]);
      }
      for (int i = 0; i < b->states && !d->initial; ++i) multiply_row(m, c, b->unknowns + i, p, 0, z + i * n);
      for (int i = 0; i < m->strains && !d->initial; ++i) {
        multiply_row(m, c, b->unknowns + b->states + b->shares + i, p, 0, sum);
        for (int l = 0; l < elements_in(b, c); ++l) m->inner->e1[(size_t)p * m->inner->points->strains * m->inner->points->cells + strain_of(m, c * n + l, i)] = sum[l];
      }
      for (int i = 0; i < b->shares; ++i) {
        if (d->initial && i < b->kept) continue;
        multiply_row(m, c, b->unknowns + b->states + i, p, 0, sum);
        for (int l = 0; l < elements_in(b, c); ++l) m->by_shared[(size_t)p * shared + b->group[c * n + l] * b->shares + i] += sum[l];
      }
    }
  if (d->initial) return;
  if (m->inner) accept_points_derivative(m->inner, d);
  if (m->neighbours) memset(m->by_before, 0, (size_t)m->parameters * b->functions * sizeof(double));
  for (int k = 0; k < m->parameters * m->neighbours; ++k) {
    const element_block *one = m->neighbour[k];
    double *before = m->by_before + k / m->neighbours * b->functions;
    for (int i = 0; i < b->functions; ++i) before[i] += m->weight[k] * (one->end[i] - b->end[i]);
    memcpy(one->before, one->end, b->functions * sizeof(double));
    one->t[0] = one->t[1];
  }
}

/* Derivatives of batch c by the rows of the table, in lanes: of forces by λ, of new states and shared numbers by
 * the derivatives after the step, which a trial step has of some shared numbers only. */
static void find_bars(const block_derivatives *m, const adjoint *a, int c, const double *λ, double *bar)
{
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns * n, states = b->states * n;
  const int32_t *dofs = b->dofs + (size_t)c * motions;
  for (int i = 0; i < motions; ++i) bar[i] = λ ? λ[dofs[i]] : 0;
  for (int i = 0; i < states; ++i) bar[motions + i] = a->d->initial ? 0 : m->state_bar[(size_t)c * states + i];
  for (int i = 0; i < b->shares; ++i)
    for (int l = 0; l < n; ++l)
      bar[motions + states + i * n + l] =
        a->d->initial && i < b->kept ? 0 : m->shared_bar[b->group[c * n + l] * b->shares + i];
  memcpy(bar + motions + states + b->shares * n, m->strain_bar + (size_t)c * m->strains * n, m->strains * n * sizeof *bar);
}

/* Derivatives by new states to those by the motions after the step. */
static void transpose_new_states(const block_derivatives *m, adjoint *a)
{
  const element_block *b = m->block;
  const int n = b->lanes, rows = rows_of(m);
  if (rows > b->unknowns) FOR_ACTING(b, c) {
    const int32_t *dofs = b->dofs + (size_t)c * b->unknowns * n;
    find_bars(m, a, c, 0, m->direction);
    for (int i = b->unknowns; i < rows; ++i) {
      const double *slope = row_of(m, c, i), *bar = m->direction + i * n;
      for (int j = 0; j < b->unknowns; ++j)
        for (int l = 0; l < elements_in(b, c); ++l) a->q1[dofs[j * n + l]] += slope[j * n + l] * bar[l];
    }
  }
}

/* The table of a recorded step, whose state is restored. Forces and new states depend on the motions after the
 * step: the solution for λ needs the derivatives of new states by these. */
void transpose_block_state(void *self, adjoint *a)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes;
  /* The run has whole steps, so that moving numbers before the step are those at its time. */
  for (int k = -1; k < m->parameters * m->neighbours; ++k) {
    const element_block *one = k < 0 ? b : m->neighbour[k];
    for (int i = 0; i < one->functions; ++i)
      if (one->when[i] == TIME_MOVING) one->before[i] = value_at(one->function + i, a->step->t0);
  }
  take_inputs(b, a->step);
  tabulate_block(self, a->step, a->d->x);
  if (m->inner) {
    transpose_points_state(m->inner, a);
    for (int i = 0; i < b->elements; ++i)
      for (int k = 0; k < m->strains; ++k)
        m->strain_bar[((size_t)(i / n) * m->strains + k) * n + i % n] = m->inner->e1_bar[strain_of(m, i, k)];
  }
  transpose_new_states(m, a);
}

/* Derivatives by all inputs but the motions after the step. */
void transpose_block(void *self, adjoint *a, const double *λ)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns, z = first_state(b), end = z + b->states, rows = rows_of(m);
  const int shared = b->groups * b->shares;
  FOR_ACTING(b, c) {
    const int32_t *dofs = b->dofs + (size_t)c * motions * n, *from = b->from + (size_t)c * b->steps * n;
    double *z_bar = m->state_bar + (size_t)c * b->states * n;
    find_bars(m, a, c, λ, m->direction);
    if (!a->d->initial) memset(z_bar, 0, b->states * n * sizeof *z_bar);
    for (int i = 0; i < rows; ++i) {
      const double *slope = row_of(m, c, i) + motions * n;
      for (int j = motions; j < columns(b); ++j, slope += n)
        for (int l = 0; l < elements_in(b, c); ++l) {
          const double x = slope[l] * m->direction[i * n + l];
          const int rate = j / motions - 1;
          if (j < z) (rate ? a->rates[rate] : a->q0)[dofs[j % motions * n + l]] += x;
          else if (j < end) z_bar[(j - z) * n + l] += x;
          else if (j < end + b->numbers) m->number_bar[((size_t)c * b->numbers + j - end) * n + l] += x;
          else m->step_bar[from[(j - end - b->numbers) * n + l]] += x;
        }
    }
  }
  if (m->inner) {
    for (int i = 0; i < b->elements; ++i)
      for (int k = 0; k < m->strains; ++k) {
        double *x = number_of(b, m->number_bar, i) + k * n;
        m->inner->r_bar[strain_of(m, i, k)] = *x, *x = 0;
      }
    transpose_points(m->inner, a);
  }
  if (m->tabulate) /* numbers that change in each step */
    for (int p = 0; p < a->parameters; ++p)
      for (int i = 0; i < b->elements; ++i)
        for (int j = 0; j < m->shifts; ++j)
          a->gradient[p] += number_of(b, m->number_bar, i)[j * n] * number_of(b, m->by_number + p * all_numbers(b), i)[j * n];
  for (int i = 0; m->tabulate && i < b->elements * m->shifts; ++i) number_of(b, m->number_bar, i / m->shifts)[i % m->shifts * n] = 0;
  double *before = m->step_bar + m->of_step - shared;
  for (int i = 0; i < shared; ++i) {
    m->shared_bar[i] = before[i] + (a->d->initial && i % b->shares < b->kept ? m->shared_bar[i] : 0);
    before[i] = 0;
  }
  add_products(a, m->of_step, m->step_bar, m->by_step);
  memset(m->step_bar, 0, m->of_step * sizeof *m->step_bar);
}

void finish_block(void *self, adjoint *a)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const size_t all = (size_t)b->batches * b->lanes;
  add_products(a, all * b->states, m->state_bar, m->by_state);
  add_products(a, all * b->numbers, m->number_bar, m->by_number);
  add_products(a, b->groups * b->shares, m->shared_bar, m->by_shared);
  if (m->inner) finish_points(m->inner, a);
}
