/* SPDX-License-Identifier: MIT */
/* Block elimination of the interior vertices of chains; see beam_elimination.py.
 *
 * A chain is left end - vertices - right end. Its vertices are eliminated from left to right, so
 * that each vertex couples to the left end and to the next vertex when it is eliminated. A chain
 * that begins at a vertex with one neighbour has no left end. A vertex has n unknowns: three in the
 * plane, six in space. Its rows, from dof[v] on, are contiguous in data from begin[v] on. Each row
 * has 3 n entries, or 2 n if there is only one neighbour. From at[3 v + k] on, n of them are the
 * columns of the vertex before (k = 0), of v (1) and of the vertex after (2). The degrees of freedom
 * of an end may have any numbers.
 */

enum { PLANE = 3, SPACE = 6 }; /* unknowns of a vertex */

/* y -= A x */
static inline void subtract(const int n, const double *A, const double *x, double *y)
{
  for (int i = 0; i < n; ++i, A += n) {
    double sum = A[0] * x[0];
    for (int k = 1; k < n; ++k) sum += A[k] * x[k];
    y[i] -= sum;
  }
}

/* x = D^-1 b */
static inline void solve_block(const int n, const double *D, const uint8_t *swap, const double *b,
                               double *x)
{
  for (int i = 0; i < n; ++i) {
    x[i] = b[swap[i]];
    for (int k = 0; k < i; ++k) x[i] -= D[n * i + k] * x[k];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) x[i] -= D[n * i + k] * x[k];
    x[i] *= D[n * i + i];
  }
}

/* Read the block of a vertex, whose rows have `width` entries, with a neighbour in its chain or
 * with itself. The rows are written `far` from each other, their numbers `apart`. */
static inline void read_block(const chains *c, const int n, int vertex, int neighbour, int width,
                              double *block, const int far, const int apart)
{
  const double *row = c->data + c->begin[vertex] + c->at[3 * vertex + neighbour];
  for (int r = 0; r < n; ++r, row += width, block += far)
    for (int k = 0; k < n; ++k) block[apart * k] = row[k];
}

/* Read a block of a chain with its ends, see end_block. */
static inline void read_block_of_end(const chains *c, const int n, int chain, int which,
                                     double *block, const int far, const int apart)
{
  const int32_t *entry = c->with_ends + n * n * (4 * chain + which);
  for (int r = 0; r < n; ++r, entry += n, block += far)
    for (int k = 0; k < n; ++k) block[apart * k] = c->data[entry[k]];
}

/* Read the block that couples the rows of the next vertex, or of the right end, to a vertex. */
static inline void read_below(const chains *c, const int n, int chain, int vertex, double *block,
                              const int far, const int apart)
{
  if (vertex + 1 < c->first[chain + 1])
    read_block(c, n, vertex + 1, 0, 3 * n, block, far, apart);
  else
    read_block_of_end(c, n, chain, RIGHT_LAST, block, far, apart);
}

/* Read the block that couples the rows of a vertex, with `width` entries each, to the next vertex
 * or right end. */
static inline void read_after(const chains *c, const int n, int chain, int vertex, int width,
                              double *block, const int far, const int apart)
{
  if (vertex + 1 < c->first[chain + 1])
    read_block(c, n, vertex, 2, width, block, far, apart);
  else
    read_block_of_end(c, n, chain, LAST_RIGHT, block, far, apart);
}

/* -- in the plane: two chains at once ---------------------------------------------------------- */

/* Each vertex depends on the previous vertex of its chain, but not on other chains. So each vector
 * has one number of each of two chains. */
enum { PAIR = 2 };
typedef double pair __attribute__((vector_size(8 * PAIR)));
typedef int64_t choice __attribute__((vector_size(8 * PAIR)));

/* Two chains during elimination: modified blocks of the next vertices and of the ends. */
typedef struct {
  int next, chain[PAIR], vertex[PAIR], last[PAIR], counts[PAIR];
  pair pivot[9], after[9], f[3];
  pair to[9], from[9], faded, left[9], left_f[3]; /* if a chain has a left end */
} chain_fronts;

static inline pair absolute(pair x) { return (pair)((choice)x & INT64_MAX); }

/* Exchange rows of both chains, or of one of them. */
static inline void exchange(choice which, int columns, pair *x, pair *y)
{
  for (int j = 0; j < columns; ++j) {
    const choice differs = ((choice)x[j] ^ (choice)y[j]) & which;
    x[j] = (pair)((choice)x[j] ^ differs), y[j] = (pair)((choice)y[j] ^ differs);
  }
}

/* Rows [D | B] become [LU | L^-1 B], with column pivoting. LU has the reciprocals of the pivots;
 * `swap` gets the order of the rows. */
static inline void factor_rows(const int columns, pair *row, choice *swap)
{
  pair *a = row, *b = row + columns, *c = row + 2 * columns;
  for (int k = 0; k < 3; ++k) swap[k] = (choice){k, k};
#define PIVOT(x, y, k, i) do { \
    const choice larger = (choice)(absolute(y[k]) > absolute(x[k])); \
    if (larger[0] | larger[1]) { \
      exchange(larger, columns, x, y); \
      exchange(larger, 1, (pair *)(swap + k), (pair *)(swap + i)); \
    } \
  } while (0)
  PIVOT(a, b, 0, 1);
  PIVOT(a, c, 0, 2);
  a[0] = 1 / a[0]; /* not finite for a singular block, and so are the results */
  b[0] *= a[0], c[0] *= a[0];
  for (int j = 1; j < columns; ++j) b[j] -= b[0] * a[j], c[j] -= c[0] * a[j];
  PIVOT(b, c, 1, 2);
#undef PIVOT
  b[1] = 1 / b[1];
  c[1] *= b[1];
  for (int j = 2; j < columns; ++j) c[j] -= c[1] * b[j];
  c[2] = 1 / c[2];
}

/* [LU | L^-1 B] becomes [LU | D^-1 B] in the columns up to `end`. */
static inline void solve_rows(const int columns, const int end, pair *row)
{
  pair *a = row, *b = row + columns, *c = row + 2 * columns;
  for (int j = 3; j < end; ++j) {
    c[j] *= c[2];
    b[j] = (b[j] - b[2] * c[j]) * b[1];
    a[j] = (a[j] - a[1] * b[j] - a[2] * c[j]) * a[0];
  }
}

/* A becomes A U^-1. */
static inline void divide_by_rows(const int columns, const pair *row, pair *A)
{
  const pair *a = row, *b = row + columns, *c = row + 2 * columns;
  for (int i = 0; i < 9; i += 3) {
    A[i] *= a[0];
    A[i + 1] = (A[i + 1] - A[i] * a[1]) * b[1];
    A[i + 2] = (A[i + 2] - A[i] * a[2] - A[i + 1] * b[2]) * c[2];
  }
}

/* Y -= A X for `columns` columns of X, whose rows have `far` numbers; subtracts the latest results
 * last */
static inline void subtract_product(const pair *A, const int columns, const int far, const pair *X,
                                    pair *Y)
{
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < columns; ++j)
      Y[columns * i + j] = Y[columns * i + j] - A[3 * i] * X[j] - A[3 * i + 1] * X[far + j]
                           - A[3 * i + 2] * X[2 * far + j];
}

/* The coupling to the left end decays along a chain. Entries become zero if their products are
 * negligible beside the first ones: arithmetic with subnormal numbers takes a hundred times as
 * long. */
static inline void drop_faded(pair *block, pair faded)
{
  for (int k = 0; k < 9; ++k)
    block[k] = (pair)((choice)block[k] & (choice)(absolute(block[k]) >= faded));
}

/* Largest entry of the block of one chain. */
static inline double largest_entry(const pair *block, int lane)
{
  double largest = 0;
  for (int k = 0; k < 9; ++k) largest = fmax(largest, fabs(block[k][lane]));
  return largest;
}

/* Begin the next chain; if none is left, repeat the other chain, whose results are not used. */
static void begin_chain(const chains *c, chain_fronts *at, int lane)
{
  at->counts[lane] = at->next < c->count;
  const int chain = at->counts[lane] ? at->next++ : at->chain[1 - lane];
  const int v = c->first[chain], width = c->spike[chain] ? 9 : 6;
  at->chain[lane] = chain, at->vertex[lane] = v, at->last[lane] = c->first[chain + 1] - 1;
  read_block(c, 3, v, 1, width, (double *)at->pivot + lane, 3 * PAIR, PAIR);
  read_after(c, 3, chain, v, width, (double *)at->after + lane, 3 * PAIR, PAIR);
  for (int k = 0; k < 3; ++k) at->f[k][lane] = at->left_f[k][lane] = 0;
  for (int k = 0; k < 9; ++k) at->to[k][lane] = at->from[k][lane] = at->left[k][lane] = 0;
  at->faded[lane] = 0;
  if (!c->spike[chain]) return;
  read_block_of_end(c, 3, chain, FIRST_LEFT, (double *)at->to + lane, 3 * PAIR, PAIR);
  read_block_of_end(c, 3, chain, LEFT_FIRST, (double *)at->from + lane, 3 * PAIR, PAIR);
  at->faded[lane] = 0x1p-511 * fmin(largest_entry(at->to, lane), largest_entry(at->from, lane));
}

/* Add the Schur complement of a chain to the blocks of its ends (left-left, left-right, right-left,
 * right-right) and to the right-hand side there. */
static void end_chain(const chains *c, const chain_fronts *at, int lane)
{
  const int chain = at->chain[lane];
  const int32_t *places = c->places + 36 * chain, *numbers = c->ends + 6 * chain;
  const pair *blocks[] = {at->left, at->from, at->to, at->pivot};
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 9; ++k) c->left_data[*places++] += blocks[i][k][lane];
  for (int k = 0; k < 3; ++k) {
    c->left_f[numbers[k]] += at->left_f[k][lane];
    c->left_f[numbers[3 + k]] += at->f[k][lane];
  }
}

/* Read the block of the next vertex of each chain with the vertex before it (0), itself (1) or the
 * vertex after it (2), inside the chains. */
static inline void read_blocks(const chains *c, const chain_fronts *at, int neighbour, pair *block)
{
  const double *row[PAIR];
  for (int l = 0; l < PAIR; ++l) {
    const int next = at->vertex[l] + 1;
    row[l] = c->data + c->begin[next] + c->at[3 * next + neighbour];
  }
  for (int r = 0; r < 3; ++r)
    for (int k = 0; k < 3; ++k) block[3 * r + k] = (pair){row[0][9 * r + k], row[1][9 * r + k]};
}

/* Read all three blocks of the next vertices, the first into `below`. */
static inline void read_next(const chains *c, chain_fronts *at, pair *below, const int inside)
{
  if (inside) {
    read_blocks(c, at, 0, below);
    read_blocks(c, at, 1, at->pivot);
    read_blocks(c, at, 2, at->after);
    return;
  }
  for (int l = 0; l < PAIR; ++l) {
    const int chain = at->chain[l], v = at->vertex[l];
    read_below(c, 3, chain, v, (double *)below + l, 3 * PAIR, PAIR);
    if (v < at->last[l]) {
      read_block(c, 3, v + 1, 1, 9, (double *)at->pivot + l, 3 * PAIR, PAIR);
      read_after(c, 3, chain, v + 1, 9, (double *)at->after + l, 3 * PAIR, PAIR);
    } else
      for (int k = 0; k < 9; ++k) at->pivot[k][l] = at->after[k][l] = 0;
  }
}

/* Eliminate the next vertex of each chain from the matrix and from the right-hand side b. `spike`:
 * a chain has a left end. `inside`: the next two vertices of both chains are not ends. */
static inline void eliminate_vertices(const chains *c, chain_fronts *at, const double *b,
                                      const int spike, const int inside)
{
  /* columns of the rows [pivot | f | after | to] */
  enum { F = 3, AFTER = 4, TO = 7 };
  const int far = spike ? 10 : 7;
  pair row[3 * 10], below[9];
  choice swap[3];
  for (int r = 0; r < 3; ++r) {
    pair b_r;
    for (int l = 0; l < PAIR; ++l) b_r[l] = b[c->dof[at->vertex[l]] + r];
    row[far * r + F] = at->f[r] + b_r;
    for (int k = 0; k < 3; ++k) {
      row[far * r + k] = at->pivot[3 * r + k];
      row[far * r + AFTER + k] = at->after[3 * r + k];
      if (spike) row[far * r + TO + k] = at->to[3 * r + k];
    }
  }
  factor_rows(far, row, swap);
  read_next(c, at, below, inside);
  divide_by_rows(far, row, below);
  memset(at->f, 0, sizeof at->f);
  subtract_product(below, 1, far, row + F, at->f);
  subtract_product(below, 3, far, row + AFTER, at->pivot);
  if (spike) {
    pair to[9] = {0}, from[9] = {0};
    divide_by_rows(far, row, at->from);
    subtract_product(at->from, 1, far, row + F, at->left_f);
    subtract_product(at->from, 3, far, row + TO, at->left);
    subtract_product(below, 3, far, row + TO, to);
    subtract_product(at->from, 3, far, row + AFTER, from);
    drop_faded(to, at->faded);
    drop_faded(from, at->faded);
    memcpy(at->to, to, sizeof to);
    memcpy(at->from, from, sizeof from);
  }
  solve_rows(far, TO, row);
  for (int l = 0; l < PAIR; ++l) {
    const int v = at->vertex[l]++;
    double *pivot = c->pivots + 9 * v, *to_next = c->to_next + 9 * v, *f = c->f + c->dof[v];
    uint8_t *order = c->swaps + 3 * v;
    for (int r = 0; r < 3; ++r) {
      order[r] = (uint8_t)swap[r][l];
      f[r] = row[far * r + F][l];
      for (int k = 0; k < 3; ++k) {
        pivot[3 * r + k] = row[far * r + k][l];
        to_next[3 * r + k] = row[far * r + AFTER + k][l];
      }
    }
  }
}

static inline int to_go(const chain_fronts *at, int lane)
{
  return at->last[lane] - at->vertex[lane] + 1;
}

/* Eliminate all vertices of planar scenes. */
static void eliminate_in_plane(const chains *c, const double *b)
{
  chain_fronts at = {.next = 0};
  if (c->count)
    for (int l = 0; l < PAIR; ++l) begin_chain(c, &at, l);
  for (int ended = 0; ended < c->count;) {
    int both = to_go(&at, 0) < to_go(&at, 1) ? to_go(&at, 0) : to_go(&at, 1);
    if (c->spike[at.chain[0]] || c->spike[at.chain[1]]) {
      for (; both > 2; --both) eliminate_vertices(c, &at, b, 1, 1);
      for (; both; --both) eliminate_vertices(c, &at, b, 1, 0);
    } else {
      for (; both > 2; --both) eliminate_vertices(c, &at, b, 0, 1);
      for (; both; --both) eliminate_vertices(c, &at, b, 0, 0);
    }
    for (int l = 0; l < PAIR; ++l) {
      if (to_go(&at, l)) continue;
      if (at.counts[l]) end_chain(c, &at, l), ++ended;
      begin_chain(c, &at, l);
    }
  }
}

/* -- in space: rows of six numbers, of two chains in turn --------------------------------------- */

typedef double octet __attribute__((vector_size(64), may_alias));
typedef int64_t eight __attribute__((vector_size(64), may_alias));

/* A chain during elimination. pivot, after, to: rows of the vertex in the columns of the vertex, of the next vertex, of the
 * left end. next, next_to: modified rows of the next vertex in the columns of this vertex and of the left end. from, left:
 * modified rows of the left end in the columns of the vertex and of the left end. Column 6 of after, next and from is the
 * right-hand side. */
typedef struct {
  int chain, vertex, last;
  octet pivot[6], after[6], to[6], next[6], next_to[6], from[6], left[6];
  double low[36], over[6], faded;
  uint8_t swap[6];
} rows_of_six;

enum { OF_RIGHT = 6 }; /* column of right-hand sides */

#define SIX(x) {(x)[0], (x)[1], (x)[2], (x)[3], (x)[4], (x)[5]}

/* Pivot block k becomes LU, and the other columns L^-1 times them, with column pivoting, as factor_rows does. L is in `low`,
 * the reciprocals of the pivots are in `over`. Numbers of rows are not changed: vectors that are partly new take long to load. */
static inline void eliminate_column(rows_of_six *at, const int k, const int spike)
{
  octet *A = at->pivot, *B = at->after, *C = at->to;
  int largest = k;
  for (int i = k + 1; i < 6; ++i)
    if (fabs(A[i][k]) > fabs(A[largest][k])) largest = i;
  if (largest != k) {
#define EXCHANGE(type, x) do { const type old = (x)[k]; (x)[k] = (x)[largest], (x)[largest] = old; } while (0)
    EXCHANGE(octet, A);
    EXCHANGE(octet, B);
    if (spike) EXCHANGE(octet, C);
    EXCHANGE(uint8_t, at->swap);
    for (int j = 0; j < k; ++j) EXCHANGE(double, at->low + 6 * j);
#undef EXCHANGE
  }
  const octet a = A[k], b = B[k], c = C[k];
  const double over = at->over[k] = 1 / A[k][k]; /* not finite for a singular block, and so are the results */
  for (int i = k + 1; i < 6; ++i) {
    const double ratio = at->low[6 * k + i] = A[i][k] * over;
    A[i] -= ratio * a;
    B[i] -= ratio * b;
    if (spike) C[i] -= ratio * c;
  }
}

/* L^-1 B becomes D^-1 B. */
static inline void solve_six(const rows_of_six *at, octet *B)
{
  octet b[6];
  for (int k = 0; k < 6; ++k) b[k] = B[k];
  for (int j = 5; j >= 0; --j) {
    b[j] *= at->over[j];
    for (int k = 0; k < j; ++k) b[k] -= at->pivot[k][j] * b[j];
  }
  for (int k = 0; k < 6; ++k) B[k] = b[k];
}

/* Y -= A X */
static inline void subtract_six(const double *A, int far, const octet *X, octet *Y)
{
  octet x[6];
  for (int k = 0; k < 6; ++k) x[k] = X[k];
  for (int i = 0; i < 6; ++i, A += far) {
    octet y = Y[i];
    for (int k = 0; k < 6; ++k) y -= A[k] * x[k];
    Y[i] = y;
  }
}

static inline double largest_of_six(const octet *block)
{
  double largest = 0;
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k) largest = fmax(largest, fabs(block[i][k]));
  return largest;
}

/* As drop_faded does, but not to right-hand sides. */
static inline void drop_faded_six(octet *block, double faded)
{
  const eight others = {0, 0, 0, 0, 0, 0, -1, -1};
  for (int i = 0; i < 6; ++i) {
    const eight x = (eight)block[i];
    block[i] = (octet)(x & ((eight)((octet)(x & INT64_MAX) >= faded) | others));
  }
}

static inline void begin_six(const chains *c, rows_of_six *at, int chain)
{
  memset(at, 0, sizeof *at);
  at->chain = chain, at->vertex = c->first[chain], at->last = c->first[chain + 1] - 1;
  read_block(c, 6, at->vertex, 1, c->spike[chain] ? 18 : 12, (double *)at->next, 8, 1);
  if (!c->spike[chain]) return;
  read_block_of_end(c, 6, chain, FIRST_LEFT, (double *)at->next_to, 8, 1);
  read_block_of_end(c, 6, chain, LEFT_FIRST, (double *)at->from, 8, 1);
  at->faded = 0x1p-511 * fmin(largest_of_six(at->next_to), largest_of_six(at->from));
}

/* Add the Schur complement of a chain as end_chain does. */
static inline void end_six(const chains *c, const rows_of_six *at)
{
  const int32_t *place = c->places + 4 * 36 * at->chain, *numbers = c->ends + 12 * at->chain;
  const octet *blocks[] = {at->left, at->from, at->next_to, at->next};
  for (int i = 0; i < 4; ++i)
    for (int r = 0; r < 6; ++r)
      for (int k = 0; k < 6; ++k) c->left_data[*place++] += blocks[i][r][k];
  for (int r = 0; r < 6; ++r) {
    c->left_f[numbers[r]] += at->from[r][OF_RIGHT];
    c->left_f[numbers[6 + r]] += at->next[r][OF_RIGHT];
  }
}

/* Eliminate the next vertices of chains from the matrix and from the right-hand side b. `spike`: a chain has a left end. */
static inline void eliminate_six(const chains *c, rows_of_six *at, int number, const double *b, const int spike)
{
  for (rows_of_six *x = at; x < at + number; ++x) {
    const int v = x->vertex, width = v > c->first[x->chain] || c->spike[x->chain] ? 18 : 12;
    const double *row = c->data + c->begin[v] + c->at[3 * v + 2];
    octet right[6];
    if (v == x->last) read_block_of_end(c, 6, x->chain, LAST_RIGHT, (double *)right, 8, 1);
    for (int r = 0; r < 6; ++r) {
      x->after[r] = v < x->last ? (octet)SIX(row + width * r) : right[r];
      x->after[r][OF_RIGHT] = x->next[r][OF_RIGHT] + b[c->dof[v] + r];
      x->pivot[r] = x->next[r], x->swap[r] = (uint8_t)r;
      if (spike) x->to[r] = x->next_to[r];
    }
  }
#pragma GCC unroll 6
  for (int k = 0; k < 6; ++k)
    for (rows_of_six *x = at; x < at + number; ++x) eliminate_column(x, k, spike);
  for (rows_of_six *x = at; x < at + number; ++x) {
    solve_six(x, x->after);
    if (spike) solve_six(x, x->to);
  }
  for (rows_of_six *x = at; x < at + number; ++x) {
    const int v = x->vertex, inside = v < x->last;
    double end[36], *pivot = c->pivots + 36 * v, *to_next = c->to_next + 36 * v, *f = c->f + c->dof[v];
    const double *row = c->data + c->begin[v + inside], *below = inside ? row + c->at[3 * (v + 1)] : end;
    if (inside) row += c->at[3 * (v + 1) + 1];
    else read_block_of_end(c, 6, x->chain, RIGHT_LAST, end, 6, 1);
    for (int r = 0; r < 6; ++r) x->next[r] = inside ? (octet)SIX(row + 18 * r) : (octet){0};
    subtract_six(below, inside ? 18 : 6, x->after, x->next);
    if (spike) {
      octet from[6] = {0};
      memset(x->next_to, 0, sizeof x->next_to);
      subtract_six(below, inside ? 18 : 6, x->to, x->next_to);
      subtract_six((double *)x->from, 8, x->to, x->left);
      for (int r = 0; r < 6; ++r) from[r][OF_RIGHT] = x->from[r][OF_RIGHT];
      subtract_six((double *)x->from, 8, x->after, from);
      memcpy(x->from, from, sizeof from);
      drop_faded_six(x->next_to, x->faded), drop_faded_six(x->from, x->faded);
    }
    for (int r = 0; r < 6; ++r) {
      f[r] = x->after[r][OF_RIGHT], c->swaps[6 * v + r] = x->swap[r];
      for (int k = 0; k < 6; ++k) {
        pivot[6 * r + k] = k < r ? x->low[6 * k + r] : k > r ? x->pivot[r][k] : x->over[r];
        to_next[6 * r + k] = x->after[r][k];
      }
    }
    ++x->vertex;
  }
}

/* Eliminate all vertices of scenes in space. */
static void eliminate_in_space(const chains *c, const double *b)
{
  rows_of_six at[PAIR];
  int next = 0, number = 0;
  for (;;) {
    for (; number < PAIR && next < c->count; ++next, ++number) begin_six(c, at + number, next);
    if (!number) return;
    int spike = 0, both = INT32_MAX;
    for (int l = 0; l < number; ++l) {
      const int to_go = at[l].last + 1 - at[l].vertex;
      spike |= c->spike[at[l].chain], both = to_go < both ? to_go : both;
    }
    for (; both; --both)
      if (spike) eliminate_six(c, at, number, b, 1);
      else if (number == PAIR) eliminate_six(c, at, PAIR, b, 0);
      else eliminate_six(c, at, 1, b, 0);
    for (int l = number - 1; l >= 0; --l)
      if (at[l].vertex > at[l].last) {
        end_six(c, at + l);
        if (l < --number) at[l] = at[number];
      }
  }
}

/* -- in both ----------------------------------------------------------------------------------- */

/* Eliminate all vertices from the matrix and from the right-hand side b. The reduced system
 * consists of the entries that stay and the Schur complements of the chains. */
void eliminate(const chains *c, const double *b)
{
  memset(c->left_data, 0, c->left * sizeof *c->left_data);
  memset(c->left_f, 0, c->left_size * sizeof *c->left_f);
  for (int k = 0; k < c->stay; ++k) c->left_data[c->place[k]] = c->data[c->entry[k]];
  for (int k = 0; k < c->rows; ++k) c->left_f[c->number[k]] = b[c->kept[k]];
  if (c->unknowns == PLANE) eliminate_in_plane(c, b);
  else eliminate_in_space(c, b);
}

static inline void read_vertex(const chains *c, const int n, const double *f, int vertex, double *y)
{
  for (int r = 0; r < n; ++r) y[r] = f[c->dof[vertex] + r];
}

static inline void write_vertex(const chains *c, const int n, const double *y, int vertex, double *f)
{
  for (int r = 0; r < n; ++r) f[c->dof[vertex] + r] = y[r];
}

/* y = D^-1 b of a vertex, and its contribution to the right-hand side of the next vertex or right
 * end */
static inline void go_on(const chains *c, const int n, int chain, int vertex, const double *b,
                         double *y, double *next)
{
  double below[SPACE * SPACE];
  solve_block(n, c->pivots + n * n * vertex, c->swaps + n * vertex, b, y);
  read_below(c, n, chain, vertex, below, n, 1);
  memset(next, 0, n * sizeof *next);
  subtract(n, below, y, next);
}

/* Number of vertices of the longest of PAIR chains, or of the last chain alone. Loops alternate
 * between chains, as a vertex depends on the previous one of its chain. */
static inline int most_vertices(const chains *c, int chain)
{
  int most = 0;
  for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
    const int number = c->first[chain + l + 1] - c->first[chain + l];
    if (number > most) most = number;
  }
  return most;
}

/* Contribution of the first vertex to the right-hand side of the left end with both ends held, from
 * f. */
static inline void feel_first_vertex(const chains *c, const int n, int chain, double *left)
{
  const int end = c->first[chain + 1];
  double from[SPACE * SPACE], x[SPACE], y[SPACE];
  read_vertex(c, n, c->f, end - 1, y);
  for (int v = end - 2; v >= c->first[chain]; --v) {
    read_vertex(c, n, c->f, v, x);
    subtract(n, c->to_next + n * n * v, y, x);
    memcpy(y, x, n * sizeof *y);
  }
  read_block_of_end(c, n, chain, LEFT_FIRST, from, n, 1);
  subtract(n, from, y, left);
}

static inline void reduce_blocks(const chains *c, const int n, const double *b)
{
  memset(c->left_f, 0, c->left_size * sizeof *c->left_f);
  for (int k = 0; k < c->rows; ++k) c->left_f[c->number[k]] = b[c->kept[k]];
  for (int chain = 0; chain < c->count; chain += PAIR) {
    double next[PAIR][SPACE] = {0};
    const int most = most_vertices(c, chain);
    for (int k = 0; k < most; ++k)
      for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
        const int v = c->first[chain + l] + k;
        double x[SPACE], y[SPACE];
        if (v >= c->first[chain + l + 1]) continue;
        read_vertex(c, n, b, v, x);
        for (int r = 0; r < n; ++r) x[r] += next[l][r];
        go_on(c, n, chain + l, v, x, y, next[l]);
        write_vertex(c, n, y, v, c->f);
      }
    for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
      const int32_t *numbers = c->ends + 2 * n * (chain + l);
      double left[SPACE] = {0};
      if (c->spike[chain + l]) feel_first_vertex(c, n, chain + l, left);
      for (int k = 0; k < n; ++k) {
        c->left_f[numbers[k]] += left[k];
        c->left_f[numbers[n + k]] += next[l][k];
      }
    }
  }
}

/* Eliminate all vertices from another right-hand side; f gets D^-1 times the reduced right-hand
 * side. */
void reduce(const chains *c, const double *b)
{
  if (c->unknowns == PLANE) reduce_blocks(c, PLANE, b);
  else reduce_blocks(c, SPACE, b);
}

static inline double largest_of(const int n, const double *x)
{
  double largest = 0;
  for (int k = 0; k < n; ++k) largest = fmax(largest, fabs(x[k]));
  return largest;
}

/* Add the effect of the motion of the left end to f, until it has decayed. */
static inline void follow_left_end(const chains *c, const int n, int chain, const double *left)
{
  double to[SPACE * SPACE], y[SPACE], next[SPACE] = {0};
  read_block_of_end(c, n, chain, FIRST_LEFT, to, n, 1);
  subtract(n, to, left, next);
  const double faded = 0x1p-511 * largest_of(n, next);
  for (int v = c->first[chain]; v < c->first[chain + 1]; ++v) {
    if (largest_of(n, next) <= faded) return;
    go_on(c, n, chain, v, next, y, next);
    for (int r = 0; r < n; ++r) c->f[c->dof[v] + r] += y[r];
  }
}

static inline void expand_blocks(const chains *c, const int n, const double *left, double *x)
{
  for (int k = 0; k < c->rows; ++k) x[c->kept[k]] = left[c->number[k]];
  for (int chain = 0; chain < c->count; chain += PAIR) {
    double first[SPACE], next[PAIR][SPACE];
    const int most = most_vertices(c, chain);
    for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
      const int32_t *numbers = c->ends + 2 * n * (chain + l);
      for (int k = 0; k < n; ++k) first[k] = left[numbers[k]], next[l][k] = left[numbers[n + k]];
      if (c->spike[chain + l]) follow_left_end(c, n, chain + l, first);
    }
    for (int k = 1; k <= most; ++k)
      for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
        const int v = c->first[chain + l + 1] - k;
        double y[SPACE];
        if (v < c->first[chain + l]) continue;
        read_vertex(c, n, c->f, v, y);
        subtract(n, c->to_next + n * n * v, next[l], y);
        memcpy(next[l], y, n * sizeof *y);
        write_vertex(c, n, y, v, x);
      }
  }
}

/* Compute the unknowns of all vertices in x from the reduced solution. f is as reduce has left it;
 * x may be f. */
void expand(const chains *c, const double *left, double *x)
{
  if (c->unknowns == PLANE) expand_blocks(c, PLANE, left, x);
  else expand_blocks(c, SPACE, left, x);
}

int all_finite(int size, const double *values)
{
  for (int i = 0; i < size; ++i)
    if (!isfinite(values[i])) return 0;
  return 1;
}
