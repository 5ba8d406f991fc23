/* SPDX-License-Identifier: MIT */
/* Block elimination (3 x 3) of the interior vertices of chains; see beam_elimination.py.
 *
 * A chain is left end - vertices - right end. Its vertices are eliminated from left to right, so
 * that each vertex couples to the left end and to the next vertex when it is eliminated. A chain
 * that begins at a vertex with one neighbour has no left end. The rows dof[v], dof[v] + 1 and
 * dof[v] + 2 of vertex v are contiguous in data from begin[v] on. Each row has nine entries, or six
 * if there is only one neighbour. From at[3 v + n] on, three of them are the columns of the vertex
 * before (n = 0), of v (1) and of the vertex after (2). The degrees of freedom of an end may have
 * any numbers.
 */

/* y -= A x */
static inline void subtract(const double *A, const double *x, double *y)
{
  for (int i = 0; i < 3; ++i) y[i] -= A[3 * i] * x[0] + A[3 * i + 1] * x[1] + A[3 * i + 2] * x[2];
}

/* x = D^-1 b */
static inline void solve_block(const double *D, const uint8_t *swap, const double *b, double *x)
{
  const double x0 = b[swap[0]], x1 = b[swap[1]] - D[3] * x0;
  x[2] = (b[swap[2]] - D[6] * x0 - D[7] * x1) * D[8];
  x[1] = (x1 - D[5] * x[2]) * D[4];
  x[0] = (x0 - D[1] * x[1] - D[2] * x[2]) * D[0];
}

/* Read the block of a vertex, whose rows have `width` entries, with a neighbour in its chain or
 * with itself. The numbers are written `apart` from each other. */
static inline void read_block(const chains *c, int vertex, int neighbour, int width, double *block,
                              int apart)
{
  const double *row = c->data + c->begin[vertex] + c->at[3 * vertex + neighbour];
  for (int r = 0; r < 3; ++r, row += width)
    for (int k = 0; k < 3; ++k, block += apart) *block = row[k];
}

/* Read a block of a chain with its ends, see end_block. */
static inline void read_block_of_end(const chains *c, int chain, int which, double *block, int apart)
{
  const int32_t *entry = c->with_ends + 36 * chain + 9 * which;
  for (int k = 0; k < 9; ++k, block += apart) *block = c->data[entry[k]];
}

/* Read the block that couples the rows of the next vertex, or of the right end, to a vertex. */
static inline void read_below(const chains *c, int chain, int vertex, double *block, int apart)
{
  if (vertex + 1 < c->first[chain + 1])
    read_block(c, vertex + 1, 0, 9, block, apart);
  else
    read_block_of_end(c, chain, RIGHT_LAST, block, apart);
}

/* Read the block that couples the rows of a vertex, with `width` entries each, to the next vertex
 * or right end. */
static inline void read_after(const chains *c, int chain, int vertex, int width, double *block,
                              int apart)
{
  if (vertex + 1 < c->first[chain + 1])
    read_block(c, vertex, 2, width, block, apart);
  else
    read_block_of_end(c, chain, LAST_RIGHT, block, apart);
}

/* -- two chains at once ------------------------------------------------------------------------- */

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
  read_block(c, v, 1, width, (double *)at->pivot + lane, PAIR);
  read_after(c, chain, v, width, (double *)at->after + lane, PAIR);
  for (int k = 0; k < 3; ++k) at->f[k][lane] = at->left_f[k][lane] = 0;
  for (int k = 0; k < 9; ++k) at->to[k][lane] = at->from[k][lane] = at->left[k][lane] = 0;
  at->faded[lane] = 0;
  if (!c->spike[chain]) return;
  read_block_of_end(c, chain, FIRST_LEFT, (double *)at->to + lane, PAIR);
  read_block_of_end(c, chain, LEFT_FIRST, (double *)at->from + lane, PAIR);
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
    read_below(c, chain, v, (double *)below + l, PAIR);
    if (v < at->last[l]) {
      read_block(c, v + 1, 1, 9, (double *)at->pivot + l, PAIR);
      read_after(c, chain, v + 1, 9, (double *)at->after + l, PAIR);
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
    double *pivot = c->pivots + BLOCK * v, *to_next = c->to_next + BLOCK * v, *f = c->f + c->dof[v];
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

/* Eliminate all vertices from the matrix and from the right-hand side b. The reduced system
 * consists of the entries that stay and the Schur complements of the chains. */
void eliminate(const chains *c, const double *b)
{
  memset(c->left_data, 0, c->left * sizeof *c->left_data);
  memset(c->left_f, 0, c->left_size * sizeof *c->left_f);
  for (int k = 0; k < c->stay; ++k) c->left_data[c->place[k]] = c->data[c->entry[k]];
  for (int k = 0; k < c->rows; ++k) c->left_f[c->number[k]] = b[c->kept[k]];
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

static inline void read_vertex(const chains *c, const double *f, int vertex, double *y)
{
  for (int r = 0; r < 3; ++r) y[r] = f[c->dof[vertex] + r];
}

static inline void write_vertex(const chains *c, const double *y, int vertex, double *f)
{
  for (int r = 0; r < 3; ++r) f[c->dof[vertex] + r] = y[r];
}

/* y = D^-1 b of a vertex, and its contribution to the right-hand side of the next vertex or right
 * end */
static inline void go_on(const chains *c, int chain, int vertex, const double *b, double *y,
                         double *next)
{
  double below[9];
  solve_block(c->pivots + BLOCK * vertex, c->swaps + 3 * vertex, b, y);
  read_below(c, chain, vertex, below, 1);
  memset(next, 0, 3 * sizeof *next);
  subtract(below, y, next);
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
static void feel_first_vertex(const chains *c, int chain, double *left)
{
  const int end = c->first[chain + 1];
  double from[9], x[3], y[3];
  read_vertex(c, c->f, end - 1, y);
  for (int v = end - 2; v >= c->first[chain]; --v) {
    read_vertex(c, c->f, v, x);
    subtract(c->to_next + BLOCK * v, y, x);
    memcpy(y, x, sizeof y);
  }
  read_block_of_end(c, chain, LEFT_FIRST, from, 1);
  subtract(from, y, left);
}

/* Eliminate all vertices from another right-hand side; f gets D^-1 times the reduced right-hand
 * side. */
void reduce(const chains *c, const double *b)
{
  memset(c->left_f, 0, c->left_size * sizeof *c->left_f);
  for (int k = 0; k < c->rows; ++k) c->left_f[c->number[k]] = b[c->kept[k]];
  for (int chain = 0; chain < c->count; chain += PAIR) {
    double next[PAIR][3] = {0};
    const int most = most_vertices(c, chain);
    for (int k = 0; k < most; ++k)
      for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
        const int v = c->first[chain + l] + k;
        double x[3], y[3];
        if (v >= c->first[chain + l + 1]) continue;
        read_vertex(c, b, v, x);
        for (int r = 0; r < 3; ++r) x[r] += next[l][r];
        go_on(c, chain + l, v, x, y, next[l]);
        write_vertex(c, y, v, c->f);
      }
    for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
      const int32_t *numbers = c->ends + 6 * (chain + l);
      double left[3] = {0};
      if (c->spike[chain + l]) feel_first_vertex(c, chain + l, left);
      for (int k = 0; k < 3; ++k) {
        c->left_f[numbers[k]] += left[k];
        c->left_f[numbers[3 + k]] += next[l][k];
      }
    }
  }
}

/* Add the effect of the motion of the left end to f, until it has decayed. */
static void follow_left_end(const chains *c, int chain, const double *left)
{
  double to[9], y[3], next[3] = {0};
  read_block_of_end(c, chain, FIRST_LEFT, to, 1);
  subtract(to, left, next);
  const double faded = 0x1p-511 * fmax(fabs(next[0]), fmax(fabs(next[1]), fabs(next[2])));
  for (int v = c->first[chain]; v < c->first[chain + 1]; ++v) {
    if (fmax(fabs(next[0]), fmax(fabs(next[1]), fabs(next[2]))) <= faded) return;
    go_on(c, chain, v, next, y, next);
    for (int r = 0; r < 3; ++r) c->f[c->dof[v] + r] += y[r];
  }
}

/* Compute the unknowns of all vertices in x from the reduced solution. f is as reduce has left it;
 * x may be f. */
void expand(const chains *c, const double *left, double *x)
{
  for (int k = 0; k < c->rows; ++k) x[c->kept[k]] = left[c->number[k]];
  for (int chain = 0; chain < c->count; chain += PAIR) {
    double first[3], next[PAIR][3];
    const int most = most_vertices(c, chain);
    for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
      const int32_t *numbers = c->ends + 6 * (chain + l);
      for (int k = 0; k < 3; ++k) first[k] = left[numbers[k]], next[l][k] = left[numbers[3 + k]];
      if (c->spike[chain + l]) follow_left_end(c, chain + l, first);
    }
    for (int k = 1; k <= most; ++k)
      for (int l = 0; l < PAIR && chain + l < c->count; ++l) {
        const int v = c->first[chain + l + 1] - k;
        double y[3];
        if (v < c->first[chain + l]) continue;
        read_vertex(c, c->f, v, y);
        subtract(c->to_next + BLOCK * v, next[l], y);
        memcpy(next[l], y, sizeof y);
        write_vertex(c, y, v, x);
      }
  }
}

int all_finite(int size, const double *values)
{
  for (int i = 0; i < size; ++i)
    if (!isfinite(values[i])) return 0;
  return 1;
}
