/* The loops over cells and rows that a Newton iteration consists of; see loops.py.
 *
 * w holds the packed coefficients of a cell, `width` of them, of which those from `at` on are the
 * unknowns q of the cell; they are brought up to date on the way.
 */
#include <stdint.h>
#include <string.h>

enum { MOST = 64 }; /* entries of an element vector or matrix, checked in Python */

void cells_vector(kernel *tabulate, int cells, int dofs_per_cell, const int32_t *dofs,
                  const double *q, int at, double *w, int width, const double *constants,
                  const double *coordinates, int rows, const int32_t *row, double *b)
{
  double e[MOST];
  for (int c = 0; c < cells; ++c) {
    for (int i = 0; i < dofs_per_cell; ++i) w[at + i] = q[dofs[i]];
    memset(e, 0, rows * sizeof *e);
    CALL(tabulate, e, w, constants, coordinates);
    for (int i = 0; i < rows; ++i) b[row[i]] += e[i];
    dofs += dofs_per_cell, w += width, coordinates += 6, row += rows;
  }
}

/* y += A x */
void add_product(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                 const double *x, double *y)
{
  for (int i = 0; i < rows; ++i) {
    double sum = 0;
    for (int k = indptr[i]; k < indptr[i + 1]; ++k) sum += data[k] * x[indices[k]];
    y[i] += sum;
  }
}

/* sum of w f^2 */
double weighted_square(int rows, const double *w, const double *f)
{
  double sum = 0;
  for (int i = 0; i < rows; ++i) sum += w[i] * f[i] * f[i];
  return sum;
}
