/* SPDX-License-Identifier: MIT */
/* Assembly: values of forms on cells into vectors and matrices, one cell at a time, and the pattern of
 * a matrix. Cells of one form are assembled several at a time by assembly_simd.c. */

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

/* Index of an entry of a matrix with sorted columns; -1 if the matrix has no such entry. */
static inline int32_t find_entry(int rows, const int32_t *indptr, const int32_t *indices, int32_t row,
                                 int32_t column)
{
  if (row < 0 || row >= rows) return -1;
  const int32_t *at = indices + indptr[row];
  int32_t number = indptr[row + 1] - indptr[row];
  if (number == 0) return -1;
  for (int32_t half = number / 2; number > 1; number -= half, half = number / 2)
    at += at[half] <= column ? half : 0;
  return *at == column ? (int32_t)(at - indices) : -1;
}

/* Find the indices of the entries (row, column) of a matrix; returns whether it has all of them. */
int find_entries(int rows, const int32_t *indptr, const int32_t *indices, int number,
                 const int32_t *row, const int32_t *column, int32_t *found)
{
  for (int k = 0; k < number; ++k)
    if ((found[k] = find_entry(rows, indptr, indices, row[k], column[k])) < 0) return 0;
  return 1;
}

/* Find the entries of a matrix for all pairs of the `of_cell` unknowns of each cell, row by row.
 * The results are in batches of `lanes` cells; copies of the last cell fill up the last batch. They
 * are indices in `place`, or, if that is null, distances from the beginning of the row in `column`.
 * Returns whether the matrix has all entries. */
int find_blocks(int rows, const int32_t *indptr, const int32_t *indices, int number, int of_cell,
                int lanes, const int32_t *dofs, int32_t *place, uint8_t *column)
{
  for (int64_t k = 0; k < (number + lanes - 1) / lanes * lanes; ++k) {
    const int32_t *of = dofs + of_cell * (k < number ? k : number - 1);
    int64_t at = k / lanes * lanes * of_cell * of_cell + k % lanes;
    for (int i = 0; i < of_cell; ++i)
      for (int j = 0; j < of_cell; ++j, at += lanes) {
        const int32_t entry = find_entry(rows, indptr, indices, of[i], of[j]);
        if (entry < 0) return 0;
        if (place) place[at] = entry;
        else column[at] = (uint8_t)(entry - indptr[of[i]]);
      }
  }
  return 1;
}

static int in_order(const void *a, const void *b)
{
  const int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
  return (i > j) - (i < j);
}

/* Find the pattern of a matrix that has the diagonal and all pairs of the unknowns of each group.
 * The unknowns of group g are dof[first[g]] to dof[first[g + 1] - 1]. The groups of each unknown
 * are written to `begin` and `group`; `seen` is space. Fills indptr and, unless it is null,
 * `indices`. Returns the number of entries, or -1 if there are too many. */
int64_t find_pattern(int size, int groups, const int32_t *first, const int32_t *dof, int32_t *begin,
                     int32_t *group, int32_t *seen, int32_t *indptr, int32_t *indices)
{
  int64_t number = 0;
  for (int i = 0; i <= size; ++i) begin[i] = 0;
  for (int k = 0; k < first[groups]; ++k) ++begin[dof[k]];
  for (int i = 0, sum = 0; i <= size; ++i) sum += begin[i], begin[i] = sum;
  for (int g = groups - 1; g >= 0; --g)
    for (int k = first[g]; k < first[g + 1]; ++k) group[--begin[dof[k]]] = g;
  for (int i = 0; i < size; ++i) seen[i] = -1;
  for (int i = 0; i < size; ++i) {
    const int64_t start = number;
    indptr[i] = (int32_t)number;
    if (indices) indices[number] = i;
    seen[i] = i, ++number;
    for (int l = begin[i]; l < begin[i + 1]; ++l)
      for (int k = first[group[l]]; k < first[group[l] + 1]; ++k)
        if (seen[dof[k]] != i) {
          seen[dof[k]] = i;
          if (indices) indices[number] = dof[k];
          ++number;
        }
    if (number > INT32_MAX) return -1;
    if (indices) qsort(indices + start, number - start, sizeof *indices, in_order);
  }
  indptr[size] = (int32_t)number;
  return number;
}
