/* SPDX-License-Identifier: MIT */
/* Forces of cells in the equation of the accepted step; see cell_forces.py. */

/* Take the forces of the latest residual as those of the accepted step. */
void accept_cell_forces(cell_forces *c)
{
  c->given = 0;
  for (int k = 0; k < c->forces; ++k) {
    force_in_cells *f = c->force + k;
    double *last = f->accepted;
    if (!f->latest) continue;
    f->accepted = *f->latest;
    *f->latest = last;
  }
  if (c->loads) memcpy(c->loads->accepted, c->loads->latest, c->loads->vectors * sizeof(double));
}

/* out += factor times the numbers that forces on the nodes of some cells mean, one batch of them. */
static inline void add_numbers(const cell_forces *c, const int nodes, const int lanes, int some,
                               int kind, double factor, const double *e, const int32_t *cell,
                               double *out)
{
#define NODE(i, k) e[((i) * nodes + (k)) * lanes + l]
#define OUT(i) out[(size_t)(i) * c->cells + (cell ? cell[l] : l)]
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

/* The same of all cells of a form, whose forces are in batches. */
static void add_all(const cell_forces *c, int lanes, int number, int kind, double factor,
                    const double *e, const int32_t *cell, double *out)
{
  for (int first = 0; first < number; first += lanes) {
    const int some = number - first < lanes ? number - first : lanes, nodes = c->nodes;
    const double *batch = e + (size_t)first * 3 * nodes;
    const int32_t *of = cell ? cell + first : 0;
    double *to = cell ? out : out + first;
#define ADD(nodes, lanes, some, of) \
  add_numbers(c, nodes, lanes, some, kind, factor, batch, of, to)
    if (nodes == 2 && lanes == 8 && some == 8 && !of) ADD(2, 8, 8, 0);
    else if (nodes == 2 && lanes == 4 && some == 4 && !of) ADD(2, 4, 4, 0);
    else ADD(nodes, lanes, some, of);
#undef ADD
  }
}

/* CELL_NUMBERS of all cells: the first number of each, then the second ones, and so on. */
void find_cell_forces(const cell_forces *c, double *out)
{
  const size_t size = (size_t)CELL_NUMBERS * c->cells * sizeof *out;
  if (c->given) {
    memcpy(out, c->given, size);
    return;
  }
  memset(out, 0, size);
  for (int k = 0; k < c->forces; ++k) {
    const force_in_cells *f = c->force + k;
    if (f->form) add_cells((void *)f->form, *f->vector, 0);
    add_all(c, f->lanes, f->number, f->kind, f->factor, *f->entries, f->cell, out);
  }
  for (int k = 0; c->loads && k < c->loads->vectors; ++k)
    if (c->loads->vector[k] && c->loads->accepted[k] != 0)
      add_all(c, 1, c->cells, DENSITY, -c->loads->accepted[k], c->loads->vector[k], 0, out);
}
