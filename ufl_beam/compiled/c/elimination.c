/* SPDX-License-Identifier: MIT */
/* Elimination of the interior vertices of chains, by blocks of 3 x 3; see static_condensation.py.
 *
 * A chain is left end - vertices - right end. Its vertices are eliminated from left to right, so that
 * each couples to the left end and to the next vertex when its turn comes. A chain that begins at a
 * vertex with one neighbour has no left end. Row r of vertex v is
 * data[indptr[row[3 v + r]]...], nine entries; order[9 v...] says where those of the columns of the
 * vertex before, of v and of the vertex after are among them.
 */

/* In the sides of a vertex: what its pivot makes of the coupling to the left end, that from there. */
enum { TO_LEFT = 0, FROM_LEFT = 9 };

/* D = LU with the largest pivot of each column; the reciprocals of the pivots on the diagonal */
static void factor_block(double *D, int32_t *swap)
{
  for (int k = 0; k < 3; ++k) swap[k] = k;
  for (int k = 0; k < 3; ++k) {
    int best = k;
    for (int i = k + 1; i < 3; ++i)
      if (fabs(D[3 * i + k]) > fabs(D[3 * best + k])) best = i;
    if (best != k) {
      int32_t s = swap[k];
      swap[k] = swap[best], swap[best] = s;
      for (int j = 0; j < 3; ++j) {
        double d = D[3 * k + j];
        D[3 * k + j] = D[3 * best + j], D[3 * best + j] = d;
      }
    }
    D[4 * k] = 1 / D[4 * k]; /* of a singular block not finite, and so all that comes of it */
    for (int i = k + 1; i < 3; ++i) {
      D[3 * i + k] *= D[4 * k];
      for (int j = k + 1; j < 3; ++j) D[3 * i + j] -= D[3 * i + k] * D[3 * k + j];
    }
  }
}

/* X = D^-1 B, of `columns` columns */
static inline void solve_block(const double *D, const int32_t *swap, int columns, const double *B,
                               double *X)
{
  const double *b0 = B + columns * swap[0], *b1 = B + columns * swap[1], *b2 = B + columns * swap[2];
  for (int j = 0; j < columns; ++j) {
    double x0 = b0[j], x1 = b1[j] - D[3] * x0, x2 = b2[j] - D[6] * x0 - D[7] * x1;
    x2 *= D[8];
    x1 = (x1 - D[5] * x2) * D[4];
    X[j] = (x0 - D[1] * x1 - D[2] * x2) * D[0];
    X[columns + j] = x1, X[2 * columns + j] = x2;
  }
}

/* Y -= A X for blocks of 3 x 3 */
static inline void subtract_product(const double *A, const double *X, double *Y)
{
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      Y[3 * i + j] -= A[3 * i] * X[j] + A[3 * i + 1] * X[3 + j] + A[3 * i + 2] * X[6 + j];
}

/* y -= A x */
static inline void subtract(const double *A, const double *x, double *y)
{
  for (int i = 0; i < 3; ++i) y[i] -= A[3 * i] * x[0] + A[3 * i + 1] * x[1] + A[3 * i + 2] * x[2];
}

/* The block of a vertex with the one before (0), itself (1) or the one after (2) */
static inline void read_block(const chains *c, int vertex, int neighbour, double *block)
{
  const uint8_t *order = c->order + 9 * vertex + 3 * neighbour;
  for (int r = 0; r < 3; ++r) {
    const double *row = c->data + c->indptr[c->row[3 * vertex + r]];
    for (int k = 0; k < 3; ++k) block[3 * r + k] = row[order[k]];
  }
}

/* The block of the one after a vertex with the vertex */
static inline void read_below(const chains *c, int chain, int vertex, double *block)
{
  if (vertex + 1 < c->first[chain + 1])
    read_block(c, vertex + 1, 0, block);
  else
    for (int k = 0; k < 9; ++k) block[k] = c->data[c->from_ends[18 * chain + 9 + k]];
}

static inline double largest_entry(const double *block)
{
  double largest = 0;
  for (int k = 0; k < 9; ++k) largest = fmax(largest, fabs(block[k]));
  return largest;
}

/* The coupling to the left end fades along a chain. Entries whose product with such others is nothing
 * beside the first ones become zero: arithmetic with numbers that are less than normal takes a hundred
 * times as long. */
static inline void drop_faded(double *block, double faded)
{
  for (int k = 0; k < 9; ++k)
    if (fabs(block[k]) < faded) block[k] = 0;
}

/* A chain on the way: what the vertices so far make of the next one, and of the ends. */
typedef struct {
  int chain, vertex;
  double pivot[9], to[9], from[9], faded;
  double ends[36], f[3], end_f[6];
} chain_front;

static inline void begin_chain(const chains *c, int chain, chain_front *at)
{
  memset(at, 0, sizeof *at);
  at->chain = chain, at->vertex = c->first[chain];
  read_block(c, at->vertex, 1, at->pivot);
  if (!c->spike[chain]) return;
  read_block(c, at->vertex, 0, at->to);
  for (int k = 0; k < 9; ++k) at->from[k] = c->data[c->from_ends[18 * chain + k]];
  at->faded = 0x1p-511 * fmin(largest_entry(at->to), largest_entry(at->from));
}

/* The next vertex of a chain, and its part of the right-hand side b; without a spike nothing couples
 * to a left end. */
static inline void eliminate_vertex(const chains *c, chain_front *at, const double *b, const int spike)
{
  const int v = at->vertex++;
  double below[9], after[9], *pivot = at->pivot, *to_next = c->to_next + BLOCK * v, *f = c->f + 3 * v;
  int32_t *swap = c->swaps + 3 * v;
  factor_block(pivot, swap);
  memcpy(c->pivots + BLOCK * v, pivot, sizeof at->pivot);
  read_block(c, v, 2, after);
  read_below(c, at->chain, v, below);
  solve_block(pivot, swap, 3, after, to_next);
  for (int r = 0; r < 3; ++r) at->f[r] += b[c->row[3 * v + r]];
  solve_block(pivot, swap, 1, at->f, f);
  memset(at->f, 0, sizeof at->f);
  subtract(below, f, at->f);
  if (spike) {
    double *sides = c->sides + SIDES * v, next_to[9] = {0}, next_from[9] = {0};
    memcpy(sides + FROM_LEFT, at->from, sizeof at->from);
    solve_block(pivot, swap, 3, at->to, sides + TO_LEFT);
    subtract(at->from, f, at->end_f);
    subtract_product(at->from, sides + TO_LEFT, at->ends);
    subtract_product(below, sides + TO_LEFT, next_to);
    subtract_product(at->from, to_next, next_from);
    memcpy(at->to, next_to, sizeof at->to);
    memcpy(at->from, next_from, sizeof at->from);
    drop_faded(at->to, at->faded);
    drop_faded(at->from, at->faded);
  }
  if (v + 1 < c->first[at->chain + 1]) read_block(c, v + 1, 1, pivot);
  else memset(pivot, 0, sizeof at->pivot);
  subtract_product(below, to_next, pivot);
}

/* What a chain makes of the blocks of its ends, left-left, left-right, right-left and right-right, and
 * of the right-hand side there. */
static inline void end_chain(const chains *c, chain_front *at)
{
  const int32_t *places = c->places + 36 * at->chain, *numbers = c->ends + 6 * at->chain;
  if (c->spike[at->chain]) {
    memcpy(at->ends + 9, at->from, sizeof at->from);
    memcpy(at->ends + 18, at->to, sizeof at->to);
  }
  memcpy(at->ends + 27, at->pivot, sizeof at->pivot);
  memcpy(at->end_f + 3, at->f, sizeof at->f);
  for (int k = 0; k < 36; ++k) c->left_data[places[k]] += at->ends[k];
  for (int k = 0; k < 6; ++k) c->left_f[numbers[k]] += at->end_f[k];
}

static inline int to_go(const chains *c, const chain_front *at)
{
  return c->first[at->chain + 1] - at->vertex;
}

/* Two chains at once: each vertex waits for the one before it, but not for those of the other chain. */
static inline void eliminate_pair(const chains *c, chain_front *one, chain_front *other, const double *b,
                                  const int spike)
{
  int both = to_go(c, one) < to_go(c, other) ? to_go(c, one) : to_go(c, other);
  for (; both > 0; --both) {
    eliminate_vertex(c, one, b, spike);
    eliminate_vertex(c, other, b, spike);
  }
}

static void eliminate_rest(const chains *c, chain_front *at, const double *b)
{
  if (c->spike[at->chain])
    while (to_go(c, at)) eliminate_vertex(c, at, b, 1);
  else
    while (to_go(c, at)) eliminate_vertex(c, at, b, 0);
  end_chain(c, at);
}

/* Eliminate all vertices from the matrix, and from the right-hand side b: what is left is what stays
 * as it is, and what the chains make of their ends. */
void eliminate(const chains *c, const double *b)
{
  chain_front one, other;
  memset(c->left_data, 0, c->left * sizeof *c->left_data);
  memset(c->left_f, 0, c->left_size * sizeof *c->left_f);
  for (int k = 0; k < c->stay; ++k) c->left_data[c->place[k]] = c->data[c->entry[k]];
  for (int k = 0; k < c->rows; ++k) c->left_f[c->number[k]] = b[c->dof[k]];
  for (int chain = 0; chain < c->chains; chain += 2) {
    begin_chain(c, chain, &one);
    if (chain + 1 < c->chains) {
      begin_chain(c, chain + 1, &other);
      if (c->spike[chain] && c->spike[chain + 1]) eliminate_pair(c, &one, &other, b, 1);
      else if (!c->spike[chain] && !c->spike[chain + 1]) eliminate_pair(c, &one, &other, b, 0);
    }
    eliminate_rest(c, &one, b);
    if (chain + 1 < c->chains) eliminate_rest(c, &other, b);
  }
}

/* The same for another right-hand side; f takes what pivots make of it. */
void reduce(const chains *c, const double *b)
{
  memset(c->left_f, 0, c->left_size * sizeof *c->left_f);
  for (int k = 0; k < c->rows; ++k) c->left_f[c->number[k]] = b[c->dof[k]];
  const int32_t *numbers = c->ends;
  for (int chain = 0; chain < c->chains; ++chain, numbers += 6) {
    double ends[6] = {0}, next[3] = {0}, below[9];
    for (int v = c->first[chain]; v < c->first[chain + 1]; ++v) {
      double *f = c->f + 3 * v;
      for (int r = 0; r < 3; ++r) next[r] += b[c->row[3 * v + r]];
      solve_block(c->pivots + BLOCK * v, c->swaps + 3 * v, 1, next, f);
      read_below(c, chain, v, below);
      memset(next, 0, sizeof next);
      subtract(below, f, next);
      if (c->spike[chain]) subtract(c->sides + SIDES * v + FROM_LEFT, f, ends);
    }
    memcpy(ends + 3, next, sizeof next);
    for (int k = 0; k < 6; ++k) c->left_f[numbers[k]] += ends[k];
  }
}

/* The unknowns of all vertices into x, from those that are left; f as reduce left it. */
void expand(const chains *c, const double *left, double *x)
{
  for (int k = 0; k < c->rows; ++k) x[c->dof[k]] = left[c->number[k]];
  const int32_t *numbers = c->ends;
  for (int chain = 0; chain < c->chains; ++chain, numbers += 6) {
    double first[3], next[3], y[3];
    for (int k = 0; k < 3; ++k) first[k] = left[numbers[k]], next[k] = left[numbers[3 + k]];
    for (int v = c->first[chain + 1] - 1; v >= c->first[chain]; --v) {
      memcpy(y, c->f + 3 * v, sizeof y);
      if (c->spike[chain]) subtract(c->sides + SIDES * v + TO_LEFT, first, y);
      subtract(c->to_next + BLOCK * v, next, y);
      memcpy(next, y, sizeof y);
      for (int r = 0; r < 3; ++r) x[c->row[3 * v + r]] = y[r];
    }
  }
}

int all_finite(int size, const double *values)
{
  for (int i = 0; i < size; ++i)
    if (!isfinite(values[i])) return 0;
  return 1;
}
