/* SPDX-License-Identifier: MIT */
/* What add_cells of loops.c does, for LANES cells at a time; the last ones may be fewer. */

enum { NUMBERS = CONSTANTS + (CONSTANTS == 0) };

/* A batch of which `some` are cells. All lanes add one entry, then the next one: cells side by side
 * add to the same places, and would wait for each other. */
static inline void add_batch(const cells *c, const lanes *e, const int32_t *row, int some, double *b)
{
  for (int i = 0; i < ENTRIES; ++i)
#pragma GCC unroll 4
    for (int l = 0; l < some; ++l) b[row[i * LANES + l]] += e[i][l];
}

static void add_in_lanes(const cells *c, const double *q, double *b)
{
  lanes e[ENTRIES], constants[NUMBERS];
  for (int i = 0; i < CONSTANTS; ++i) constants[i] = ALL(c->constants[i]);
  const int32_t *dofs = c->dofs, *row = c->row;
  const lanes *x = (const lanes *)c->coordinates;
  lanes *w = (lanes *)c->w;
  for (int left = c->number; left > 0; left -= LANES) {
    const int some = left < LANES ? left : LANES;
    for (int l = 0; l < some; ++l, dofs += c->of_cell)
      for (int i = 0; i < c->unknowns; ++i) w[c->at + i][l] = q[dofs[i]];
    memset(e, 0, sizeof e);
    tabulate(e, w, constants, x);
    if (some == LANES) add_batch(c, e, row, LANES, b);
    else add_batch(c, e, row, some, b);
    w += c->width, x += 6, row += ENTRIES * LANES;
  }
}

void *address(void) { return (void *)add_in_lanes; }

/* The entries of a batch, cell after cell by FFCx's kernel and by this one. */
void compute_both(void *of_ffcx, const double *w, const double *constants, const double *x,
                  double *one, double *several)
{
  lanes e[ENTRIES], same[NUMBERS];
  for (int i = 0; i < CONSTANTS; ++i) same[i] = ALL(constants[i]);
  memset(e, 0, sizeof e);
  tabulate(e, (const lanes *)w, same, (const lanes *)x);
  memcpy(several, e, sizeof e);
  for (int l = 0; l < LANES; ++l) {
    double w_l[WIDTH + 1], x_l[6], e_l[ENTRIES] = {0};
    for (int i = 0; i < WIDTH; ++i) w_l[i] = w[i * LANES + l];
    for (int i = 0; i < 6; ++i) x_l[i] = x[i * LANES + l];
    CALL(((kernel *)of_ffcx), e_l, w_l, constants, x_l);
    for (int i = 0; i < ENTRIES; ++i) one[i * LANES + l] = e_l[i];
  }
}
