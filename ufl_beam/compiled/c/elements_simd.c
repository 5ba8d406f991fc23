/* SPDX-License-Identifier: MIT */
/* A function of all elements of a block, LANES at a time; see element_function in loops.h. */

static void evaluate_in_lanes(int batches, const double *w, double *out)
{
  lanes x[6] = {0}, none[1] = {0};
  x[3] = ALL(1);
  for (int b = 0; b < batches; ++b, w += WIDTH * LANES, out += ENTRIES * LANES) {
    memset(out, 0, ENTRIES * LANES * sizeof *out);
    for (int i = WIDTH; i < 2 * WIDTH; ++i) __builtin_prefetch(w + i * LANES);
    tabulate((lanes *)out, (const lanes *)w, none, x);
  }
}

void *address(void) { return (void *)evaluate_in_lanes; }
