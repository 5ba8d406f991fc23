/* SPDX-License-Identifier: MIT */
/* Forces of cells in the equation of the accepted step; see cell_forces.py. */

/* Accept the forces of the latest residual as those of the accepted step. */
void accept_cell_forces(cell_forces *c)
{
  c->initial = 0;
  for (int k = 0; k < c->forces; ++k) {
    force_in_cells *f = c->force + k;
    double *last = f->accepted;
    if (!f->latest) continue;
    f->accepted = *f->latest;
    *f->latest = last;
  }
  if (c->loads) memcpy(c->loads->accepted, c->loads->latest, c->loads->vectors * sizeof(double));
}

/* out += factor times the resultants of the nodal forces of a batch of cells */
static inline void add_numbers(const cell_forces *c, const int nodes, const int lanes, int some,
                               int kind, double factor, const double *restrict e,
                               const int32_t *cell, size_t row, double *restrict out)
{
#define NODE(i, k) e[((i) * nodes + (k)) * lanes + l]
#define OUT(i) out[(i) * row + (cell ? cell[l] : l)]
  for (int i = 0; i < 3; ++i)
    for (int l = 0; l < some; ++l) {
      OUT(START_X + i) += factor * NODE(i, 0);
      OUT(END_X + i) += factor * NODE(i, 1);
    }
  if (kind == STRESS) return;
  for (int k = 0; k < nodes; ++k)
    for (int l = 0; l < some; ++l) OUT(COUPLE) += factor * NODE(2, k);
  if (kind == WORK) return;
  for (int k = 0; k < nodes; ++k) {
    const double away = factor * c->from_middle[k];
    for (int l = 0; l < some; ++l) OUT(SKEW_X) += away * NODE(0, k);
    for (int l = 0; l < some; ++l) OUT(SKEW_Y) += away * NODE(1, k);
  }
#undef NODE
#undef OUT
}

/* Layout of the resultants of cells in batches of `lanes`: `row` is the distance from one number to
 * the next, `batch` the distance per cell from one batch to the next. `first` is how many of the
 * numbers are needed. */
typedef struct {
  double *out;
  size_t row, batch;
  int lanes, first;
} places;

/* Add the resultants of some cells of a form, whose nodal forces are in batches. */
static void add_some(const cell_forces *c, int lanes, int number, int kind, double factor,
                     const double *e, const int32_t *cell, places p)
{
  if (p.first <= COUPLE) kind = STRESS;
  for (int first = 0; first < number; first += lanes) {
    const int some = number - first < lanes ? number - first : lanes, nodes = c->nodes;
    const double *batch = e + (size_t)first * 3 * nodes;
    const int32_t *of = cell ? cell + first : 0;
    double *to = cell ? p.out : p.out + first * p.batch;
#define ADD(nodes, lanes, some, of) \
  add_numbers(c, nodes, lanes, some, kind, factor, batch, of, p.row, to)
    if (nodes == 2 && lanes == 8 && some == 8 && !of) ADD(2, 8, 8, 0);
    else if (nodes == 2 && lanes == 4 && some == 4 && !of) ADD(2, 4, 4, 0);
    else ADD(nodes, lanes, some, of);
#undef ADD
  }
}

/* Add the resultants of `number` cells from `first` on, or of all cells. `now` tells that the
 * latest residual belongs to the accepted step. */
static void add_forms(const cell_forces *c, int now, int first, int number, places p)
{
  const int lanes = p.lanes;
  for (int k = 0; k < c->forces; ++k) {
    const force_in_cells *f = c->force + k;
    const int whole = f->cell || number == c->cells;
    const double *e = now && f->tee ? *f->tee : *f->entries;
    if (f->form) {
      cells some = whole ? *f->form : some_cells(f->form, first);
      add_cells(&some, *f->vector, 0);
    } else if (!whole)
      e += (size_t)first * 3 * c->nodes;
    add_some(c, f->batch_size, whole ? f->number : number, f->kind, f->factor, e, f->cell, p);
  }
  for (int k = 0; c->loads && k < c->loads->vectors; ++k)
    for (int i = 0; c->loads->vector[k] && c->loads->accepted[k] != 0 && i < number; ++i) {
      places one = p; /* loads are not in batches */
      one.out = p.out + (i - i % lanes) * p.batch + i % lanes;
      add_some(c, 1, 1, DENSITY, -c->loads->accepted[k],
               c->loads->vector[k] + (size_t)(first + i) * 3 * c->nodes, 0, one);
    }
}

/* Resultants (CELL_NUMBERS) of all cells: the first number of each cell, then the second ones, and
 * so on. */
void find_cell_forces(const cell_forces *c, int now, double *out)
{
  const size_t size = (size_t)CELL_NUMBERS * c->cells * sizeof *out;
  const places p = {out, c->cells, 1, 1, CELL_NUMBERS};
  if (c->initial) {
    memcpy(out, c->initial, size);
    return;
  }
  memset(out, 0, size);
  add_forms(c, now, 0, c->cells, p);
}

/* Extend the extremes from `begin` on by numbers at a time. */
static void widen(const extent *e, size_t begin, int number, const double *restrict x, double t)
{
  double *restrict low = e->low + begin, *restrict time_low = e->time_low + begin;
  double *restrict high = e->high + begin, *restrict time_high = e->time_high + begin;
#pragma omp simd
  for (int i = 0; i < number; ++i) {
    const int below = x[i] < low[i], above = x[i] > high[i];
    low[i] = below ? x[i] : low[i], time_low[i] = below ? t : time_low[i];
    high[i] = above ? x[i] : high[i], time_high[i] = above ? t : time_high[i];
  }
}

/* Update the extremes by the state after a step; see find_cell_forces. Cells are processed in
 * blocks, so that the data of a block stay in the cache. */
void watch_step(const watch *w, int now, double t, const double *before, const double *q)
{
  const cells *c = w->along;
  const int n = c->batch_size, in_order = w->in_order && !w->forces->initial;
  const double b = w->between;
  const double *at = q;
  widen(&w->of_motion, 0, w->of_motion.size, q, t);
  if (b != 1) {
    for (int i = 0; i < w->of_motion.size; ++i) w->q[i] = (1 - b) * before[i] + b * q[i];
    at = w->q;
  }
  if (!in_order) find_cell_forces(w->forces, now, w->numbers);
  for (int first = 0; first < c->number; first += SOME) {
    cells some = some_cells(c, first);
    const places p = {w->some, n, c->width, n, w->first};
    const int all = (some.number + n - 1) / n * n;
    some.w = w->some;
    for (int k = 0; k < all; k += n) {
      double *batch = w->some + k * c->width;
      memset(batch, 0, w->first * n * sizeof *batch);
      memcpy(batch + w->first * n, w->axes + 4 * (size_t)(first + k), 4 * n * sizeof *batch);
    }
    if (in_order)
      add_forms(w->forces, now, first, some.number, p);
    else
      for (int k = 0; k < some.number; ++k)
        for (int i = 0; i < w->first; ++i)
          p.out[(k - k % n) * p.batch + i * n + k % n] =
            w->numbers[(size_t)i * c->number + first + k];
    add_cells(&some, at, 0);
    widen(&w->of_forces, (size_t)first * c->rows, all * c->rows, c->each, t);
  }
}
