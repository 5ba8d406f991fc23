/* SPDX-License-Identifier: MIT */
/* Multifrontal elimination of the first unknowns of a sparse system; see multifrontal.py.
 *
 * A front is a dense matrix with the rows and columns of some pivots, which are eliminated in it,
 * and of the later unknowns that couple to them. The Schur complement of the later unknowns is
 * added to the front of the first of them. The last front has no pivots: it is the Schur complement
 * of the unknowns that stay. Rows are exchanged among the pivots of a front; a small system is one
 * front.
 */

enum { FEW = 64 }; /* entries by which a front may grow per pivot to take one more pivot */

/* Find the fronts of a matrix with a symmetric pattern for the elimination of its first
 * `eliminated` unknowns.
 *
 * Front k has the pivots from first[k] to the first pivot of the next front. Its other unknowns, in
 * order, are rest[begin[k]...]. The arrays have space for `eliminated` + 2 fronts; rest has space
 * for `room` numbers. `mark` (unknowns) and `next` (2 unknowns) are scratch space. Returns the
 * number of fronts, or -1 if `room` is too small.
 */
int find_fronts(int unknowns, int eliminated, const int32_t *indptr, const int32_t *indices,
                int room, int32_t *first, int32_t *begin, int32_t *rest, int32_t *mark,
                int32_t *next)
{
  /* Fronts with the same first other unknown j form a linked list: next[j], then next[unknowns +
   * front]. */
  int count = 0;
  for (int j = 0; j < 2 * unknowns; ++j) next[j] = -1;
  for (int j = 0; j < unknowns; ++j) mark[j] = -1;
  begin[0] = 0;
  const int all = unknowns <= ONE_FRONT && eliminated;
  if (all) {
    first[count++] = 0;
    for (int j = eliminated; j < unknowns; ++j) rest[j - eliminated] = j;
    begin[count] = unknowns - eliminated;
  }
  for (int j = all ? eliminated : 0; j < eliminated; ++j) {
    int32_t *found = rest + begin[count];
    int number = 0;
    if (room - begin[count] < unknowns) return -1;
    mark[j] = j;
    for (int k = indptr[j]; k < indptr[j + 1]; ++k)
      if (indices[k] > j && mark[indices[k]] != j) mark[indices[k]] = j, found[number++] = indices[k];
    int last = 0;
    for (int s = next[j]; s >= 0; s = next[unknowns + s]) {
      last |= s == count - 1;
      for (int k = begin[s]; k < begin[s + 1]; ++k)
        if (mark[rest[k]] != j) mark[rest[k]] = j, found[number++] = rest[k];
    }
    qsort(found, number, sizeof *found, in_order);
    const int pivots = count ? j - first[count - 1] : 0;
    const int before = count ? begin[count] - begin[count - 1] : 0;
    if (last && (number + 1 - before) * pivots <= FEW) {
      memmove(rest + begin[count - 1], found, number * sizeof *found);
      begin[count] = begin[count - 1] + number;
    } else {
      first[count++] = j;
      begin[count] = begin[count - 1] + number;
    }
    if (number) {
      const int parent = rest[begin[count - 1]];
      next[unknowns + count - 1] = next[parent];
      next[parent] = count - 1;
    }
  }
  if (room - begin[count] < unknowns - eliminated) return -1;
  first[count++] = eliminated;
  begin[count] = begin[count - 1];
  for (int j = eliminated; j < unknowns; ++j) rest[begin[count]++] = j;
  first[count] = eliminated;
  return count;
}

/* Row or column of an unknown in a front. */
static int where(const fronts *c, int front, int unknown)
{
  const int pivots = c->first[front + 1] - c->first[front];
  if (unknown < c->first[front + 1]) return unknown - c->first[front];
  const int32_t *rest = c->rest + c->begin[front];
  int low = 0, high = c->begin[front + 1] - c->begin[front] - 1;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (rest[middle] < unknown) low = middle + 1;
    else high = middle;
  }
  return pivots + low;
}

static inline int front_size(const fronts *c, int front)
{
  return c->first[front + 1] - c->first[front] + c->begin[front + 1] - c->begin[front];
}

/* Find the indices of the entries (row, column) in their fronts, and parent and up of all fronts.
 * front_of is the front of each unknown. */
void place_in_fronts(const fronts *c, int entries, const int32_t *row, const int32_t *column,
                     const int32_t *front_of, int32_t *place, int32_t *parent, int32_t *up)
{
  for (int k = 0; k < entries; ++k) {
    const int s = front_of[row[k] < column[k] ? row[k] : column[k]];
    place[k] = where(c, s, row[k]) * front_size(c, s) + where(c, s, column[k]);
  }
  for (int s = 0; s < c->fronts - 1; ++s) {
    parent[s] = c->begin[s + 1] > c->begin[s] ? front_of[c->rest[c->begin[s]]] : c->fronts - 1;
    for (int k = c->begin[s]; k < c->begin[s + 1]; ++k) up[k] = where(c, parent[s], c->rest[k]);
  }
}

/* Order the fronts so that the children of a front are together before it. order: the fronts.
 * before: the place before the first front on which the front at a place depends. children: number
 * for each front, except children of the last front. The child that depends on most fronts comes
 * first, so that the stack stays small. Returns the largest number of entries of the stack. */
int64_t order_fronts(const fronts *c, int32_t *order, int32_t *before, int32_t *children)
{
  const int last = c->fronts - 1;
  int32_t place = 0;
  int64_t most = 0, stack = 0;
  int32_t *below = before, *from = order; /* fronts that a front depends on; where they begin */
  for (int s = 0; s < last; ++s) below[s] = 1, children[s] = 0;
  for (int s = 0; s < last; ++s)
    if (c->parent[s] < last) below[c->parent[s]] += below[s], ++children[c->parent[s]];
  int32_t *space = calloc(4 * (size_t)last + 1, sizeof *space);
  if (!space) return -1;
  /* Fronts that depend on most others come first, and so parents before their children. */
  int32_t *found = space, *first = space + 2 * last, *sorted = first + last + 1;
  for (int s = 0; s < last; ++s) ++first[last - below[s] + 1];
  for (int k = 0; k < last; ++k) first[k + 1] += first[k];
  for (int s = 0; s < last; ++s) sorted[first[last - below[s]]++] = s;
  for (int k = 0; k < last; ++k) {
    const int s = sorted[k];
    int32_t *begin = c->parent[s] < last ? from + c->parent[s] : &place;
    from[s] = *begin, *begin += below[s];
    const int here = *begin - 1;
    found[here] = s, found[last + here] = here - below[s];
  }
  memcpy(order, found, last * sizeof *found);
  memcpy(before, found + last, last * sizeof *found);
  free(space);
  for (int k = 0; k < last; ++k) {
    for (int child = k - 1, left = children[order[k]]; left; --left, child = before[child]) {
      const int64_t rest = c->begin[order[child] + 1] - c->begin[order[child]];
      stack -= rest * rest;
    }
    const int64_t rest = c->begin[order[k] + 1] - c->begin[order[k]];
    if (c->parent[order[k]] < last) stack += rest * rest;
    most = stack > most ? stack : most;
  }
  return most;
}

/* -- dense elimination -------------------------------------------------------------------------- */

/* pivots that are eliminated from the entire front at once; rows of a product in registers */
enum { PANEL = 24, ROWS = 4 };
typedef double wide __attribute__((vector_size(8 * WIDE), aligned(8), may_alias));

/* C -= A B for `rows` rows and `vectors` vectors of columns, the last of which may be
 * incomplete. Rows of all three matrices have `stride` numbers. Memory beyond the last column
 * must be readable. */
static inline __attribute__((always_inline)) void subtract_block(
    const int rows, const int vectors, int columns, int depth, int stride, const double *A,
    const double *B, double *C)
{
  wide sum[ROWS][2];
  for (int i = 0; i < rows; ++i)
    for (int v = 0; v < vectors; ++v) sum[i][v] = (wide){0};
  for (int k = 0; k < depth; ++k, B += stride)
    for (int i = 0; i < rows; ++i)
      for (int v = 0; v < vectors; ++v)
        sum[i][v] += A[(int64_t)i * stride + k] * ((const wide *)B)[v];
  for (int i = 0; i < rows; ++i, C += stride)
    if (columns == vectors * WIDE)
      for (int v = 0; v < vectors; ++v) ((wide *)C)[v] -= sum[i][v];
    else {
      double ends[2 * WIDE];
      memcpy(ends, sum[i], vectors * sizeof *sum[i]);
      for (int j = 0; j < columns; ++j) C[j] -= ends[j];
    }
}

static inline __attribute__((always_inline)) void subtract_columns(
    const int vectors, int rows, int columns, int depth, int stride, const double *A, const double *B,
    double *C)
{
  for (; rows >= ROWS; rows -= ROWS, A += (int64_t)ROWS * stride, C += (int64_t)ROWS * stride)
    subtract_block(ROWS, vectors, columns, depth, stride, A, B, C);
  for (; rows; --rows, A += stride, C += stride)
    subtract_block(1, vectors, columns, depth, stride, A, B, C);
}

/* C -= A B for C of rows x columns */
static void subtract_dense(int rows, int columns, int depth, int stride, const double *A,
                           const double *B, double *C)
{
  int j = 0;
  for (; columns - j > WIDE; j += 2 * WIDE) {
    const int some = columns - j < 2 * WIDE ? columns - j : 2 * WIDE;
    subtract_columns(2, rows, some, depth, stride, A, B + j, C + j);
  }
  if (j < columns) subtract_columns(1, rows, columns - j, depth, stride, A, B + j, C + j);
}

/* Eliminate the pivots of a front with row exchanges among them. The diagonal gets reciprocals of
 * the pivots, the columns below it multipliers. Returns whether the pivots are finite. `unit` is
 * space for the scale of each row: pivots of rows with different dimensions are compared relative
 * to their largest entries. */
static int eliminate_pivots(int size, int pivots, double *F, int32_t *swap, double *unit)
{
  int finite = 1;
  for (int i = 0; i < pivots; ++i) {
    double largest = 0;
    for (int j = 0; j < size; ++j) /* a call of fmax takes longer */
      if (fabs(F[(int64_t)i * size + j]) > largest) largest = fabs(F[(int64_t)i * size + j]);
    unit[i] = 1 / largest;
  }
  for (int first = 0; first < pivots; first += PANEL) {
    const int next = pivots - first < PANEL ? pivots : first + PANEL;
    for (int k = first; k < next; ++k) {
      int best = k;
      for (int i = k + 1; i < pivots; ++i)
        if (fabs(F[(int64_t)i * size + k]) * unit[i] > fabs(F[(int64_t)best * size + k]) * unit[best])
          best = i;
      double *pivot = F + (int64_t)k * size;
      swap[k] = best;
      unit[best] = unit[k];
      if (best != k) exchange_rows(size, pivot, F + (int64_t)best * size);
      pivot[k] = 1 / pivot[k];
      finite &= isfinite(pivot[k]) != 0;
      for (int i = k + 1; i < size; ++i) {
        double *row = F + (int64_t)i * size, a = row[k] *= pivot[k];
        for (int j = k + 1; j < next; ++j) row[j] -= a * pivot[j];
      }
    }
    for (int k = first + 1; k < next; ++k) {
      double *row = F + (int64_t)k * size;
      for (int i = first; i < k; ++i) {
        const double a = row[i], *pivot = F + (int64_t)i * size;
        for (int j = next; j < size; ++j) row[j] -= a * pivot[j];
      }
    }
    double *rest = F + (int64_t)next * size;
    subtract_dense(size - next, size - next, next - first, size, rest + first,
                   F + (int64_t)first * size + next, rest + next);
  }
  return finite;
}

/* -- the fronts --------------------------------------------------------------------------------- */

/* Add the Schur complement of a front, a matrix with rows of `stride` numbers, to its parent. */
static void add_to_parent(const fronts *c, int front, const double *made, int stride, double *to)
{
  const int rest = c->begin[front + 1] - c->begin[front], size = front_size(c, c->parent[front]);
  const int32_t *up = c->up + c->begin[front];
  for (int i = 0; i < rest; ++i) {
    double *row = to + (int64_t)up[i] * size;
    for (int j = 0; j < rest; ++j) row[up[j]] += made[(int64_t)i * stride + j];
  }
}

static void add_entries(const fronts *c, int front, const double *data, double *F)
{
  for (int k = c->entries[front]; k < c->entries[front + 1]; ++k) F[c->place[k]] += data[c->entry[k]];
}

/* Factorize the system with the entries `data` and compute the Schur complement of the unknowns
 * that stay. Returns whether all pivots are finite.
 *
 * Parents come after their children, whose Schur complements are at the end of the stack.
 */
int factor_fronts(const fronts *c, const double *data)
{
  const int last = c->fronts - 1, stay = front_size(c, last);
  double *F = c->space, *top = c->stack;
  int finite = 1;
  memset(c->schur, 0, (int64_t)stay * stay * sizeof *F);
  add_entries(c, last, data, c->schur);
  for (int k = 0; k < last; ++k) {
    const int s = c->order[k], pivots = c->first[s + 1] - c->first[s], size = front_size(c, s);
    const int rest = size - pivots;
    double *rows = c->values + c->at[s], *columns = rows + (int64_t)pivots * size;
    memset(F, 0, (int64_t)size * size * sizeof *F);
    add_entries(c, s, data, F);
    for (int child = k - 1, left = c->children[s]; left; --left) {
      const int of = c->order[child], made = c->begin[of + 1] - c->begin[of];
      add_to_parent(c, of, top -= (int64_t)made * made, made, F);
      child = c->before[child];
    }
    finite &= eliminate_pivots(size, pivots, F, c->swap + c->first[s], c->unit);
    memcpy(rows, F, (int64_t)pivots * size * sizeof *F);
    for (int i = pivots; i < size; ++i)
      memcpy(columns + (int64_t)(i - pivots) * pivots, F + (int64_t)i * size, pivots * sizeof *F);
    const double *made = F + (int64_t)pivots * size + pivots;
    if (c->parent[s] == last) add_to_parent(c, s, made, size, c->schur);
    else
      for (int i = 0; i < rest; ++i, top += rest)
        memcpy(top, made + (int64_t)i * size, rest * sizeof *F);
  }
  return finite;
}

/* Reduce the right-hand side b in x: eliminated pivots, then the right-hand side of the Schur
 * complement. */
void reduce_fronts(const fronts *c, const double *b)
{
  for (int i = 0; i < c->size; ++i) c->x[i] = b[c->unknown[i]];
  for (int k = 0; k < c->fronts - 1; ++k) {
    const int s = c->order[k], pivots = c->first[s + 1] - c->first[s], size = front_size(c, s);
    const int32_t *rest = c->rest + c->begin[s] - pivots, *swap = c->swap + c->first[s];
    const double *F = c->values + c->at[s];
    double *x = c->x + c->first[s];
    for (int i = 0; i < pivots; ++i) {
      const double y = x[swap[i]];
      x[swap[i]] = x[i], x[i] = y;
    }
    for (int i = 1; i < pivots; ++i)
      for (int j = 0; j < i; ++j) x[i] -= F[(int64_t)i * size + j] * x[j];
    const double *row = F + (int64_t)pivots * size;
    for (int i = pivots; i < size; ++i, row += pivots) {
      double y = 0;
      for (int j = 0; j < pivots; ++j) y += row[j] * x[j];
      c->x[rest[i]] -= y;
    }
  }
}

/* Compute the solution from the solution of the unknowns that stay, at the end of x. */
void expand_fronts(const fronts *c, double *found)
{
  for (int k = c->fronts - 2; k >= 0; --k) {
    const int s = c->order[k], pivots = c->first[s + 1] - c->first[s], size = front_size(c, s);
    const int32_t *rest = c->rest + c->begin[s] - pivots;
    const double *F = c->values + c->at[s];
    double *x = c->x + c->first[s];
    for (int i = pivots - 1; i >= 0; --i) {
      const double *row = F + (int64_t)i * size;
      double y = x[i];
      for (int j = i + 1; j < pivots; ++j) y -= row[j] * x[j];
      for (int j = pivots; j < size; ++j) y -= row[j] * c->x[rest[j]];
      x[i] = y * row[i];
    }
  }
  for (int i = 0; i < c->size; ++i) found[c->unknown[i]] = c->x[i];
}
