/* SPDX-License-Identifier: MIT */
/* The answers of LANES points at a time; the last batch may have fewer. */

static void answer_in_lanes(int number, const double *w, double *answers)
{
  lanes e[ENTRIES], of_point[WIDTH], x[6] = {0}, none[1] = {0};
  x[3] = ALL(1);
  for (int first = 0; first < number; first += LANES, w += WIDTH * LANES) {
    const int some = number - first < LANES ? number - first : LANES;
    /* The first point fills up the batch. */
#define W(l) w[(l < some ? l * WIDTH : 0) + i]
    for (int i = 0; i < WIDTH; ++i) of_point[i] = (lanes){EACH(W)};
#undef W
    memset(e, 0, sizeof e);
    tabulate(e, of_point, none, x);
    for (int l = 0; l < some; ++l, answers += ENTRIES)
      for (int i = 0; i < ENTRIES; ++i) answers[i] = e[i][l];
  }
}

void *address(void) { return (void *)answer_in_lanes; }
