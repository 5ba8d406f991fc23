/* SPDX-License-Identifier: MIT */
/* Comparison of a vector kernel with the kernel of FFCx. */

/* Entries of a batch, computed cell by cell with FFCx's kernel, and at once with the kernel of this
 * file. */
void compute_both(void *of_ffcx, const double *w, double *one, double *several)
{
  const double x_l[6] = {[3] = 1};
  lanes e[ENTRIES], x[6] = {0};
  x[3] = ALL(1);
  memset(e, 0, sizeof e);
  tabulate(e, (const lanes *)w, (const lanes *)w + UNKNOWNS, x);
  memcpy(several, e, sizeof e);
  for (int l = 0; l < LANES; ++l) {
    double w_l[WIDTH + 1], e_l[ENTRIES] = {0};
    for (int i = 0; i < WIDTH; ++i) w_l[i] = w[i * LANES + l];
    CALL(((kernel *)of_ffcx), e_l, w_l, 0, x_l);
    for (int i = 0; i < ENTRIES; ++i) one[i * LANES + l] = e_l[i];
  }
}
