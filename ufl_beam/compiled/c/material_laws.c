/* SPDX-License-Identifier: MIT */
/* Laws of material points: stresses and their derivatives, also of laws that solve for their variables;
 * see material_points.py. */

static const double unit_cell[6] = {0, 0, 0, 1, 0, 0};

static void ask(kernel *tabulate, const double *w, int answers, double *e)
{
  memset(e, 0, answers * sizeof *e);
  CALL(tabulate, e, w, 0, unit_cell);
}

static inline void exchange_rows(int size, double *a, double *b)
{
  for (int j = 0; j < size; ++j) {
    const double x = a[j];
    a[j] = b[j], b[j] = x;
  }
}

/* Solve A X = B for the columns of B, which X replaces; returns zero if A is singular. */
static inline int solve_dense(int n, double *A, int columns, double *B)
{
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (fabs(A[n * i + k]) > fabs(A[n * pivot + k])) pivot = i;
    const double largest = A[n * pivot + k];
    if (!(fabs(largest) > 0 && fabs(largest) < INFINITY)) return 0;
    if (pivot != k) {
      exchange_rows(n, A + n * k, A + n * pivot);
      exchange_rows(columns, B + columns * k, B + columns * pivot);
    }
    for (int i = k + 1; i < n; ++i) {
      const double factor = A[n * i + k] / largest;
      for (int j = k + 1; j < n; ++j) A[n * i + j] -= factor * A[n * k + j];
      for (int j = 0; j < columns; ++j) B[columns * i + j] -= factor * B[columns * k + j];
    }
  }
  for (int k = n - 1; k >= 0; --k)
    for (int j = 0; j < columns; ++j) {
      double b = B[columns * k + j];
      for (int i = k + 1; i < n; ++i) b -= A[n * k + i] * B[columns * i + j];
      B[columns * k + j] = b / A[n * k + k];
    }
  return 1;
}

/* Largest ratio of the residuals of a law to their sizes. */
static double part_of(int m, const double *residuals, const double *sizes)
{
  double largest = 0;
  for (int i = 0; i < m; ++i) {
    const double ratio = fabs(residuals[i]) / sizes[i];
    if (residuals[i] != 0 && !(ratio <= largest)) largest = ratio == ratio ? ratio : INFINITY;
  }
  return largest;
}

/* Solve the residuals of a law of d strains for its m variables by Newton's method. Returns one
 * plus the number of corrections, or zero if it fails. s gets the stresses and their derivatives by
 * the implicit function theorem.
 *
 * The law computes residuals R, their derivatives J by the variables and E by the strains,
 * stresses, and their derivatives by strains and by variables. A correction is halved until the
 * largest residual falls. Residuals are relative to the terms that the correction cancels in them,
 * plus the round-off of these.
 */
static inline int improve_sized(int m, int d, const points *p, double *w, double *s)
{
  enum { M = MOST_VARIABLES };
  const int all = m * (1 + m + d) + d * (1 + d + m);
  double *z = w + p->strain + 3 * d, x[M], sizes[M], a[M * (1 + M + 3) + 3 * (1 + 3 + M)];
  double J[M * M], B[M * 4];
  ask(p->law, w, all, a);
  for (int corrections = 0;; ++corrections) {
    const double *E = a + m + m * m, *stress = E + m * d, *by_strain = stress + d;
    const double *by_variables = by_strain + d * d;
    memcpy(J, a + m, m * m * sizeof *J);
    for (int i = 0; i < m; ++i) {
      B[(1 + d) * i] = a[i];
      for (int k = 0; k < d; ++k) B[(1 + d) * i + 1 + k] = E[d * i + k];
    }
    const int solved = solve_dense(m, J, 1 + d, B);
    int ends = 1;
    for (int i = 0; i < m; ++i) {
      double digits = 0;
      sizes[i] = 0;
      for (int j = 0; j < m; ++j) {
        sizes[i] += fabs(a[m + m * i + j] * B[(1 + d) * j]);
        digits += fabs(a[m + m * i + j] * z[j]);
      }
      for (int k = 0; k < d; ++k) digits += fabs(E[d * i + k] * w[p->strain + k]);
      /* Round-off of the terms, or a correction whose square is negligible. */
      const int small = fabs(B[(1 + d) * i]) <= 1e-9 * fabs(z[i]);
      digits *= 4 * DBL_EPSILON;
      sizes[i] += digits;
      ends = ends && (fabs(a[i]) <= digits || small);
    }
    if (!solved || (!ends && corrections == MOST_CORRECTIONS)) return 0;
    if (ends) {
      for (int k = 0; k < d; ++k) {
        s[k] = stress[k];
        for (int j = 0; j < m; ++j) s[k] -= by_variables[m * k + j] * B[(1 + d) * j];
        for (int l = 0; l < d; ++l) {
          double tangent = by_strain[d * k + l];
          for (int j = 0; j < m; ++j) tangent -= by_variables[m * k + j] * B[(1 + d) * j + 1 + l];
          s[d + d * k + l] = tangent;
        }
      }
      for (int j = 0; j < m; ++j) z[j] -= B[(1 + d) * j];
      return 1 + corrections;
    }
    const double before = part_of(m, a, sizes);
    memcpy(x, z, m * sizeof *x);
    for (double way = 1; way > 1e-3; way /= 2) {
      for (int j = 0; j < m; ++j) z[j] = x[j] - way * B[(1 + d) * j];
      ask(p->law, w, all, a);
      if (part_of(m, a, sizes) <= (1 - way / 10) * before) break;
    }
  }
}

/* Call improve_sized, with constants for frequent sizes, which the compiler can use. */
static int improve(const points *p, double *w, double *s)
{
  const int m = p->variables, d = p->components;
  if (d == 1 && m == 1) return improve_sized(1, 1, p, w, s);
  if (d == 1 && m == 2) return improve_sized(2, 1, p, w, s);
  return improve_sized(m, d, p, w, s);
}

/* The variables of a law have this relative precision, since the square of the last correction is
 * negligible. */
const double NO_ENERGY = 1e-9;

/* Dissipation of a law in the step, relative to its size; zero if that is not finite. */
static double own_dissipation(const points *p, const double *w)
{
  double s[2];
  ask(p->own, w, 2, s);
  const double share = s[0] / s[1];
  return isfinite(share) ? share : 0;
}

/* Number of the point that gives the most energy in the latest response, or -1; see Points. */
int gives_energy(const points *p)
{
  double least = -NO_ENERGY;
  int worst = -1;
  for (int i = 0; p->own && i < p->cells * p->of_cell; ++i) {
    const double share = own_dissipation(p, p->w + i * p->width);
    if (share < least) least = share, worst = i;
  }
  return worst;
}

/* Corrections up to which a solution is close to the last iterate and on the same branch. */
enum { NEARBY = 2 };

/* Stresses and derivatives of a law that solves for its variables, or NaN.
 *
 * The solution starts from the variables of the last iterate in the step. It starts from the
 * variables before the step if there is no iterate, if the first solution fails, or if that gives
 * energy.
 */
static void solve_law(const points *p, double *w, double *s)
{
  const int m = p->variables, d = p->components;
  double *z = w + p->strain + 3 * d;
  const int found = p->tried ? improve(p, w, s) : 0, near = found <= 1 + NEARBY || !p->own;
  if (found && (near || own_dissipation(p, w) >= -NO_ENERGY)) return;
  memcpy(z, w + POINT_INPUTS, m * sizeof *z);
  if (improve(p, w, s)) return;
  for (int i = 0; i < d + d * d; ++i) s[i] = NAN;
}

/* Stresses of the bulk and their derivatives by the strains at the end of the step. */
static inline void answer(const points *p, double *w, double *s)
{
  if (p->solves) solve_law(p, w, s);
  else if (p->components == 1) ask(p->law, w, 2, s); /* the compiler knows the size */
  else ask(p->law, w, p->components * (1 + p->components), s);
}
