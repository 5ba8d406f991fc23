/* SPDX-License-Identifier: MIT */
/* Comparison of a vector kernel with the kernel of FFCx, and sizes of the kernel. */

#define NUMBERS (CONSTANTS + (CONSTANTS == 0))
#define COEFFICIENTS (WIDTH + (WIDTH == 0))

/* Entries of a batch, computed cell by cell with FFCx's kernel, and at once with the kernel of this
 * file. */
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
