/* SPDX-License-Identifier: MIT */
/* Sparse matrices: entries, patterns and products, see csr.py; norms. */

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

/* Expand CALL for the number of entries of a row, and the distance between rows. The compiler knows the usual ones: one entry
 * for lumped masses, three for consistent masses; in space six and nine for rotary inertia. */
#define FOR_STRIP(width, period, CALL) \
  if ((period) == 1) switch (width) { \
  case 1: CALL(1, 1); break; \
  case 3: CALL(3, 1); break; \
  default: CALL(width, 1); \
  } else switch (width) { \
  case 3: CALL(3, 6); break; \
  case 6: CALL(6, 6); break; \
  case 9: CALL(9, 6); break; \
  default: CALL(width, period); \
  }

/* Number of rows of a strip of a run. */
static inline int rows_of_strip(const constant_matrix *A, int run, int strip)
{
  return (A->first[run + 1] - A->first[run] - strip + A->period - 1) / A->period;
}

/* y += A x in rows of a strip; data, x and y begin at its first row */
static inline void add_strip_times(const int width, const int period, int from, int to, int rows,
                                   const double *data, const int32_t *away, const double *x, double *restrict y)
{
  for (int i = from; i < to; ++i) {
    double sum = 0;
    for (int k = 0; k < width; ++k) sum += data[(size_t)k * rows + i] * x[period * i + away[k]];
    y[period * i] += sum;
  }
}

/* y += A x; the strips of a run are in the cache together */
void add_product(const constant_matrix *A, const double *x, double *y)
{
  enum { CHUNK = 64 };
  for (int g = 0; g < A->runs; ++g) {
    const int all = rows_of_strip(A, g, 0), chunk = A->period == 1 ? all : CHUNK;
    for (int from = 0; from < all; from += chunk)
      for (int r = 0; r < A->period; ++r) {
        const int s = g * A->period + r, first = A->first[g] + r, rows = rows_of_strip(A, g, r);
        const int to = from + chunk < rows ? from + chunk : rows;
        const int32_t *away = A->away + A->begin[s];
        const double *data = A->data + A->at[s];
#define ADD(width, period) add_strip_times(width, period, from, to, rows, data, away, x + first, y + first)
        FOR_STRIP(A->begin[s + 1] - A->begin[s], A->period, ADD)
#undef ADD
      }
  }
}

/* Euclidean norm of w f, with all digits even if its squares are very small or large. f has all
 * rows, or the rows `at` if that is not null. */
double norm(int rows, const int32_t *at, const double *w, const double *f)
{
  double sum = 0, largest = 0, scaled = 0;
#define W(i) w[at ? at[i] : i]
  if (at)
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < rows; ++i) sum += W(i) * f[i] * (W(i) * f[i]);
  else
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < rows; ++i) sum += w[i] * f[i] * (w[i] * f[i]);
  if (isnan(sum) || (1e-250 < sum && sum < 1e250)) return sqrt(sum);
  for (int i = 0; i < rows; ++i) largest = fmax(largest, W(i) * fabs(f[i]));
  if (largest == 0 || !isfinite(largest)) return largest;
  for (int i = 0; i < rows; ++i)
    scaled += W(i) * (f[i] / largest) * (W(i) * (f[i] / largest));
#undef W
  return largest * sqrt(scaled);
}

/* Difference between a number x >= 0 and the next number, which has the next pattern of bits. */
static inline double last_digit(double x)
{
  union { double number; int64_t bits; } next = {x};
  next.bits += 1;
  return next.number - x;
}

/* Return freed memory to the system; the GNU C library keeps it otherwise. */
void give_back_memory(void)
{
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}
