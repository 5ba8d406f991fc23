/* The loops over cells and rows that a Newton iteration consists of; see loops.py.
 *
 * w holds the packed coefficients of a cell, `width` of them, of which those from `at` on are the
 * unknowns q of the cell; they are brought up to date on the way.
 */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { MOST = 144 }; /* entries of an element vector or matrix: 12 unknowns of degree 3 */

/* The values q of the cells into their packed coefficients, from `at` on. */
void set_cells(int cells, int dofs_per_cell, const int32_t *dofs, const double *q, int at,
               double *w, int width)
{
  for (int c = 0; c < cells; ++c, dofs += dofs_per_cell, w += width)
    for (int i = 0; i < dofs_per_cell; ++i) w[at + i] = q[dofs[i]];
}

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

/* x A x */
double quadratic_form(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                      const double *x)
{
  double sum = 0;
  for (int i = 0; i < rows; ++i)
    for (int k = indptr[i]; k < indptr[i + 1]; ++k) sum += x[i] * data[k] * x[indices[k]];
  return sum;
}

/* s = q1 - q0, with 2 tan(x/2) in the place of the increments x of the rotations; the largest |x| */
double step_of_nodes(int size, int rotations, const int32_t *rotation, double *s,
                     const double *q0, const double *q1)
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

/* r += A (factor s - back v), where s, of which only the space is given, is the step of the nodes */
void add_step_product(int size, const int32_t *indptr, const int32_t *indices, const double *data,
                      double factor, double back, const double *v, int rotations,
                      const int32_t *rotation, double *s, const double *q0, const double *q1,
                      double *r)
{
  step_of_nodes(size, rotations, rotation, s, q0, q1);
  for (int i = 0; i < size; ++i) s[i] = factor * s[i] - back * v[i];
  add_product(size, indptr, indices, data, s, r);
}

/* tangent += A, column by column times the derivative 1 + half^2 of the step of the nodes */
void add_step_tangent(int entries, const int32_t *entry, const int32_t *column, const double *data,
                      int size, int rotations, const int32_t *rotation, double *half,
                      const double *q0, const double *q1, double *tangent)
{
  memset(half, 0, size * sizeof *half);
  for (int k = 0; k < rotations; ++k)
    half[rotation[k]] = tan((q1[rotation[k]] - q0[rotation[k]]) / 2);
  for (int k = 0; k < entries; ++k) {
    double h = half[column[k]];
    tangent[entry[k]] = tangent[entry[k]] + data[k] + data[k] * h * h;
  }
}

/* sum of w f^2 */
double weighted_square(int rows, const double *w, const double *f)
{
  double sum = 0;
  for (int i = 0; i < rows; ++i) sum += w[i] * f[i] * f[i];
  if (sum == 0)
    for (int i = 0; i < rows; ++i)
      if (w[i] * f[i] != 0) return 5e-324; /* the squares are too small for a number */
  return sum;
}

/* -- material points ------------------------------------------------------------------------- */

/* What a point is about; the order of INPUTS in points.py. */
enum {
  STRAIN, GROWTH, DIRECTION, TRACTION, BEFORE, PLASTIC, ACCUMULATED, JUMP, OPENING, STIFFNESS,
  LENGTH, THETA, WIDTH = 19
};

/* What the kernel of the end of a step says; the order in points.py. */
enum { FLOW, WORKED, BROKEN, LOST, ELASTIC, HARDENING, STRESS, RESISTANCE, SAID };

/* What points know of each other in a step; the order in points.py. */
enum { OPENED, RELIEF };

static const double unit_cell[6] = {0, 0, 0, 1, 0, 0};

static void ask(kernel *tabulate, const double *w, int answers, double *e)
{
  memset(e, 0, answers * sizeof *e);
  CALL(tabulate, e, w, 0, unit_cell);
}

/* Growth at which the excess of what the bulk bears over the resistance vanishes, or NAN.
 *
 * The excess is positive at zero, falls, and is concave unless the bulk flows back in tension:
 * Newton's method comes to its root from above, from where the bulk would be unloaded. Bisection
 * stands by.
 */
static double growth(kernel *excess, double *w)
{
  double g[2], theta = w[THETA];
  double strain = (1 - theta) * w[BEFORE] + theta * w[STRAIN] - w[JUMP] / w[LENGTH];
  double bound = fabs(strain - w[PLASTIC]) * w[LENGTH] / theta + DBL_MIN;
  w[GROWTH] = 0;
  ask(excess, w, 2, g);
  if (g[0] <= 0) return 0; /* over the limit by a last digit */
  double a = g[1] < 0 ? fmin(bound, -g[0] / g[1]) : bound, low = 0, high = INFINITY;
  for (int i = 0; i < 200; ++i) {
    w[GROWTH] = a;
    ask(excess, w, 2, g);
    if (g[0] > 0) low = a;
    else high = a;
    double next = a - g[0] / g[1], step = fabs(next - a);
    /* So small a relative step was the last but none: the next one would be its square. */
    if (step <= 1e-9 * a || step <= 4 * DBL_EPSILON * bound) return next > 0 ? next : a;
    if (!(next > low && next < high)) next = high < INFINITY ? (low + high) / 2 : 2 * a;
    a = next;
  }
  return NAN;
}

/* Resultants r of cells whose strains grow from e0 to e1, and their derivatives D.
 *
 * `course` notes that a point opens, and may ask for relief: then points that do not open answer
 * with their elastic stiffness. Where one opens, those around it unload, which their own tangents
 * do not tell, and Newton's method would close what it just opened, again and again.
 */
void respond(int32_t *course, kernel *bulk, kernel *opening, kernel *excess, int points, const double *B,
             const double *weight, const double *rest, double theta, const double *e0,
             double *w, double *r, double *D, int cells, const double *e1)
{
  double s[2];
  for (int c = 0; c < cells; ++c, e0 += 3, e1 += 3, r += 3, D += 9) {
    memset(D, 0, 9 * sizeof *D);
    for (int k = 0; k < 3; ++k) {
      r[k] = rest[k] * ((1 - theta) * e0[k] + theta * e1[k]);
      D[4 * k] = rest[k] * theta;
    }
    for (int i = 0; i < points; ++i, w += WIDTH) {
      const double *b = B + 3 * i;
      w[STRAIN] = b[0] * e1[0] + b[1] * e1[1] + b[2] * e1[2];
      w[GROWTH] = w[DIRECTION] = 0;
      ask(bulk, w, 2, s);
      if (fabs(s[0]) > w[TRACTION]) { /* P(51) */
        w[DIRECTION] = s[0] < 0 ? -1 : 1;
        w[GROWTH] = growth(excess, w);
        ask(opening, w, 2, s);
        course[OPENED] = 1;
      } else if (course[RELIEF]) {
        s[1] = theta * w[STIFFNESS];
      }
      for (int k = 0; k < 3; ++k) {
        r[k] += weight[i] * s[0] * b[k];
        for (int l = 0; l < 3; ++l) D[3 * k + l] += weight[i] * s[1] * b[k] * b[l];
      }
    }
  }
}

/* Resultants as affine functions b + D e of the strains, into the packed values of cells. */
void linearise(int cells, const double *e, const double *r, const double *D, double *b,
               double *packed_D, int width)
{
  for (int c = 0; c < cells; ++c, e += 3, r += 3, D += 9, b += width, packed_D += width) {
    for (int k = 0; k < 3; ++k)
      b[k] = r[k] - D[3 * k] * e[0] - D[3 * k + 1] * e[1] - D[3 * k + 2] * e[2];
    memcpy(packed_D, D, 9 * sizeof *D);
  }
}

/* Resultants as affine functions of the strains, at q; nothing is to do if q is the latest.
 *
 * First what the strains at q are computed with, then what responds to them, then where it goes.
 */
void respond_at(const double *q, int size, double *latest,
                kernel *strain, int cells, int dofs_per_cell, const int32_t *dofs, int at,
                double *values, int values_width, const double *constants,
                const double *coordinates, int rows, const int32_t *row, double *e1,
                int32_t *course, kernel *bulk, kernel *opening, kernel *excess, int points, const double *B,
                const double *weight, const double *rest, double theta, const double *e0,
                double *w, double *r, double *D, double *b, double *packed_D, int width)
{
  if (!memcmp(q, latest, size * sizeof *q)) return;
  memcpy(latest, q, size * sizeof *q);
  memset(e1, 0, 3 * cells * sizeof *e1);
  cells_vector(strain, cells, dofs_per_cell, dofs, q, at, values, values_width, constants,
               coordinates, rows, row, e1);
  respond(course, bulk, opening, excess, points, B, weight, rest, theta, e0, w, r, D, cells, e1);
  linearise(cells, e1, r, D, b, packed_D, width);
}

/* Take the end of the step as the new state.
 *
 * Each cell keeps what it bears (3), the jump of its last point, and what it dissipated by plastic
 * strains and by discontinuities; sum gets what all cells dissipated so in the step, what they lost
 * numerically at theta = 1, and what they store elastically and by hardening.
 */
void commit(kernel *end, int cells, int points, const double *B, const double *weight,
            const double *rest, const double *length, double *e0, const double *e1,
            double *w, double *kept, double *sum)
{
  double s[SAID];
  memset(sum, 0, 5 * sizeof *sum);
  for (int c = 0; c < cells; ++c, e0 += 3, e1 += 3, kept += 6) {
    double plastic = 0, broken = 0;
    for (int k = 0; k < 3; ++k) {
      double change = e1[k] - e0[k];
      kept[k] = rest[k] * e1[k];
      sum[2] += rest[k] * change * change / 2 * length[c];
      sum[3] += rest[k] * e1[k] * e1[k] / 2 * length[c];
      e0[k] = e1[k];
    }
    for (int i = 0; i < points; ++i, w += WIDTH) {
      double volume = weight[i] * length[c];
      ask(end, w, SAID, s);
      w[BEFORE] = w[STRAIN];
      w[PLASTIC] += s[FLOW];
      w[ACCUMULATED] += fabs(s[FLOW]);
      w[JUMP] += w[DIRECTION] * w[GROWTH];
      w[OPENING] += w[GROWTH];
      w[GROWTH] = w[DIRECTION] = 0;
      if (w[TRACTION] < INFINITY) w[TRACTION] = s[RESISTANCE];
      plastic += volume * s[WORKED];
      broken += weight[i] * s[BROKEN];
      sum[2] += volume * s[LOST];
      sum[3] += volume * s[ELASTIC];
      sum[4] += volume * s[HARDENING];
      for (int k = 0; k < 3; ++k) kept[k] += weight[i] * s[STRESS] * B[3 * i + k];
    }
    kept[3] = w[JUMP - WIDTH];
    kept[4] += plastic;
    kept[5] += broken;
    sum[0] += plastic;
    sum[1] += broken;
  }
}
