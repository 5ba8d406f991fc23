/* SPDX-License-Identifier: MIT */
/* The loop of add_cells in assembly.c for LANES cells at a time; the last batch may have fewer. */

/* Two and four numbers at any address. */
typedef double two __attribute__((vector_size(16), aligned(8), may_alias));
typedef double four __attribute__((vector_size(32), aligned(8), may_alias));

/* Do the work of insert_batch for cells with two vertices if entries of a row are adjacent, vertex by vertex: all six of a
 * cell in the plane, the six of each vertex in space. A cell has them in the order u u v v ... Additions are fewer and wider
 * than for single entries. */
static inline void insert_rows_of_six(const cells *c, const lanes *e, const int32_t *dofs,
                                   const uint8_t *pattern, double *b)
{
  /* Rows of the second vertices come last: adjacent cells add to the same rows, and would wait for
   * each other. */
  enum { HALF = SIDE < 2 ? 1 : SIDE / 2 };
  for (int k = 0; k < SIDE; ++k) {
    const int i = k % HALF * 2 + k / HALF;
    for (int six = 0; six < SIDE / 6; ++six) {
      double *row[LANES];
      for (int l = 0; l < LANES; ++l)
        row[l] = b + c->begin[dofs[l * SIDE + i]] + pattern[LANES * (SIDE * i + six) + l];
#define FOUR(j) (*(const four *)((const double *)(e + SIDE * i + (six * 6 + (j)) % HALF * 2 + (six * 6 + (j)) / HALF) + l))
#define EVEN(a, b) __builtin_shufflevector(a, b, 0, 4, 2, 6)
#define ODD(a, b) __builtin_shufflevector(a, b, 1, 5, 3, 7)
#define LOWER(a, b) __builtin_shufflevector(a, b, 0, 1, 4, 5)
#define UPPER(a, b) __builtin_shufflevector(a, b, 2, 3, 6, 7)
      for (int l = 0; l < LANES; l += 4) {
        const four u = EVEN(FOUR(0), FOUR(1)), U = ODD(FOUR(0), FOUR(1));
        const four v = EVEN(FOUR(2), FOUR(3)), V = ODD(FOUR(2), FOUR(3));
        const four w = EVEN(FOUR(4), FOUR(5)), W = ODD(FOUR(4), FOUR(5));
        *(four *)row[l] += LOWER(u, v);
        *(four *)row[l + 1] += LOWER(U, V);
        *(four *)row[l + 2] += UPPER(u, v);
        *(four *)row[l + 3] += UPPER(U, V);
        *(two *)(row[l] + 4) += __builtin_shufflevector(w, w, 0, 1);
        *(two *)(row[l + 1] + 4) += __builtin_shufflevector(W, W, 0, 1);
        *(two *)(row[l + 2] + 4) += __builtin_shufflevector(w, w, 2, 3);
        *(two *)(row[l + 3] + 4) += __builtin_shufflevector(W, W, 2, 3);
      }
    }
#undef FOUR
#undef EVEN
#undef ODD
#undef LOWER
#undef UPPER
  }
}

/* Add a batch of `some` cells; if the entries are a matrix, it has SIDE rows. All lanes add one
 * entry, then the next one: adjacent cells add to the same indices, and would wait for each
 * other. */
static inline void insert_batch(const cells *c, const lanes *e, int first, int some, double *b)
{
  const int32_t *dofs = c->dofs + (size_t)first * c->of_cell;
  if (c->pattern) {
    const int has = c->has[first / LANES];
    const uint8_t *pattern = c->pattern + (size_t)has * ENTRIES * LANES;
    if ((SIDE == 6 || SIDE == 12) && some == LANES && has < c->in_rows) {
      insert_rows_of_six(c, e, dofs, pattern, b);
      return;
    }
    for (int i = 0; i < SIDE; ++i) {
      double *row[LANES] = {0};
#pragma GCC unroll 8
      for (int l = 0; l < some; ++l) row[l] = b + c->begin[dofs[l * SIDE + i]];
      for (int j = 0; j < SIDE; ++j, ++e, pattern += LANES)
#pragma GCC unroll 8
        for (int l = 0; l < some; ++l) row[l][pattern[l]] += (*e)[l];
    }
  } else if (c->row) {
    const int32_t *row = c->row + (size_t)first * ENTRIES;
    for (int i = 0; i < ENTRIES; ++i)
#pragma GCC unroll 4
      for (int l = 0; l < some; ++l) b[row[i * LANES + l]] += e[i][l];
  } else
    for (int i = 0; i < ENTRIES; ++i)
#pragma GCC unroll 4
      for (int l = 0; l < some; ++l) b[dofs[l * ENTRIES + i]] += e[i][l];
}

/* Gather the unknowns of a batch of `some` cells; the first cell fills up the batch. */
static inline void take_unknowns(const int32_t *dofs, const double *q, int some, lanes *w)
{
#define Q(l) q[dofs[(l < some ? l * UNKNOWNS : 0) + i]]
  for (int i = 0; i < UNKNOWNS; ++i) w[i] = (lanes){EACH(Q)};
#undef Q
}

static void add_in_lanes(const cells *c, const double *q, double *b)
{
  lanes e[ENTRIES], w[UNKNOWNS], x[6] = {0};
  x[3] = ALL(1);
  for (int first = 0; first < c->number; first += LANES) {
    const int some = c->number - first < LANES ? c->number - first : LANES;
    const lanes *stored = (const lanes *)(c->w + (size_t)first * c->width);
    const int32_t *dofs = c->dofs + (size_t)first * UNKNOWNS;
    if (some == LANES) take_unknowns(dofs, q, LANES, w);
    else take_unknowns(dofs, q, some, w);
    /* Processors do not find the next batch by themselves if unused inputs lie between. */
    for (int i = 0; i < WIDTH - UNKNOWNS; ++i) __builtin_prefetch(stored + i + c->width);
    memset(e, 0, sizeof e);
    tabulate(e, w, stored, x);
    if (c->each) memcpy(c->each + (size_t)first * ENTRIES, e, sizeof e);
    if (!b) continue;
    if (some == LANES) insert_batch(c, e, first, LANES, b);
    else insert_batch(c, e, first, some, b);
  }
}

void *address(void) { return (void *)add_in_lanes; }
