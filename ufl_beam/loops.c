/* The loops over cells and rows that a Newton iteration consists of; see loops.py.
 *
 * w holds the packed coefficients of a cell, `width` of them, of which those from `at` on are the
 * unknowns q of the cell; they are brought up to date on the way.
 */
#include <math.h>
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

/* r += A (factor s - before) */
void add_inertia(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                 double factor, const double *s, const double *before, double *r)
{
  for (int i = 0; i < rows; ++i) {
    double sum = 0;
    for (int k = indptr[i]; k < indptr[i + 1]; ++k) {
      int j = indices[k];
      sum += data[k] * (factor * s[j] - before[j]);
    }
    r[i] += sum;
  }
}

/* data += mass, column by column times the derivative of the step of the nodes */
void add_inertia_tangent(int entries, const double *mass, int turning_entries,
                         const int32_t *entry, const int32_t *column, const double *s,
                         double *data)
{
  for (int k = 0; k < entries; ++k) data[k] += mass[k];
  for (int k = 0; k < turning_entries; ++k) {
    double half = s[column[k]] / 2;
    data[entry[k]] += mass[entry[k]] * half * half;
  }
}

/* s = q1 - q0, with 2 tan(x/2) in the place of the increments x of the rotations; the largest |x| */
double step_of_nodes(int size, const double *q0, const double *q1, int rotations,
                     const int32_t *rotation, double *s)
{
  double largest = 0;
  for (int i = 0; i < size; ++i) s[i] = q1[i] - q0[i];
  for (int k = 0; k < rotations; ++k) {
    double *x = s + rotation[k];
    if (!(fabs(*x) <= largest)) largest = fabs(*x);
    *x = 2 * tan(*x / 2);
  }
  return largest;
}

/* sum of w f^2 */
double weighted_square(int rows, const double *w, const double *f)
{
  double sum = 0;
  for (int i = 0; i < rows; ++i) sum += w[i] * f[i] * f[i];
  return sum;
}
