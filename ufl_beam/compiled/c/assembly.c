/* SPDX-License-Identifier: MIT */
/* Assembly: values of forms on cells into vectors and matrices, one cell at a time. In most runs
 * assembly_simd.c inserts the cells of a form, several at a time. */

/* Inputs of a cell from `at` on, c->batch_size apart from each other. c->batch_size is a power of two,
 * so cell & -lanes cells come before the batch of the cell. */
static inline double *in_cell(const cells *c, int cell, int at)
{
  return c->w + (cell & -c->batch_size) * c->width + at * c->batch_size + (cell & (c->batch_size - 1));
}

/* Write the values q at the unknowns of the cells into their inputs, from `at` on. */
void set_cells(const cells *c, const double *q, int at)
{
  const int32_t *dofs = c->dofs;
  const int n = c->batch_size;
  double *batch = c->w + at * n;
  for (int first = 0; first < c->number; first += n, batch += c->width * n)
    for (int l = 0; l < n && first + l < c->number; ++l, dofs += c->of_cell)
      for (int i = 0; i < c->of_cell; ++i) batch[i * n + l] = q[dofs[i]];
}

/* Add the values of a cell to a matrix or a vector; see insert_batch for several cells. */
static inline void insert_cell(const cells *c, const double *e, int k, double *b)
{
  const int32_t *dofs = c->dofs + (size_t)k * c->of_cell;
  const int n = c->batch_size, l = k % n;
  if (c->row)
    for (int i = 0; i < c->rows; ++i) b[c->row[((size_t)(k / n) * c->rows + i) * n + l]] += e[i];
  else if (c->pattern) {
    const uint8_t *pattern = c->pattern + (size_t)c->has[k / n] * c->rows * n + l;
    for (int i = 0; i < c->rows; ++i) b[c->begin[dofs[i / c->of_cell]] + pattern[i * n]] += e[i];
  } else
    for (int i = 0; i < c->rows; ++i) b[dofs[i]] += e[i];
}

/* Add the function at the unknowns q to a vector, to the entries of a matrix, or to nothing if b is
 * null. */
void add_cells(void *self, const double *q, double *b)
{
  const cells *c = self;
  if (c->several) {
    c->several(c, q, b);
    return;
  }
  const int unknowns = c->of_cell, n = c->batch_size;
  double *w = c->all, e[MOST_ENTRIES], x[6] = {[3] = 1};
  for (int k = 0; k < c->number; ++k) {
    const int32_t *dofs = c->dofs + (size_t)k * unknowns;
    const double *stored = in_cell(c, k, 0);
    for (int i = 0; i < unknowns; ++i) w[i] = q[dofs[i]];
    for (int i = unknowns; i < c->inputs; ++i) w[i] = stored[(i - unknowns) * n];
    memset(e, 0, c->rows * sizeof *e);
    CALL(c->tabulate, e, w, 0, x);
    for (int i = 0; c->each && i < c->rows; ++i) c->each[((size_t)(k / n) * c->rows + i) * n + k % n] = e[i];
    if (b) insert_cell(c, e, k, b);
  }
}

/* The cells from `first` on, SOME at most. */
static cells some_cells(const cells *c, int first)
{
  cells some = *c;
  some.number = c->number - first < SOME ? c->number - first : SOME;
  some.dofs += (size_t)first * c->of_cell;
  some.w += (size_t)first * c->width;
  if (c->row) some.row += (size_t)first * c->rows;
  if (c->pattern) some.has += first / c->batch_size;
  return some;
}

/* Rotate a vector into the axes of supports (way = 1), or back into the axes of the plane (-1), in
 * place. */
void turn_axes(int number, const turned_axes *axes, double *x, int way)
{
  for (int k = 0; k < number; ++k) {
    const turned_axes *t = axes + (way > 0 ? k : number - 1 - k);
    const double a = x[t->i], b = x[t->j], s = way * t->s;
    x[t->i] = t->c * a + s * b, x[t->j] = t->c * b - s * a;
  }
}
