/* SPDX-License-Identifier: MIT */
/* Factors of the reduced system by KLU of SuiteSparse; see solvers/lu_factors.py.
 *
 * KLU takes matrices in compressed columns. The matrix here is in compressed rows, which are the
 * columns of its transpose. So KLU factors the transpose, and klu_tsolve solves with the matrix.
 */

klu_functions klu;

enum { SMALL_SYSTEM = 12 }; /* largest number of unknowns that are eliminated with row exchanges in any case */

/* Least pivot, relative to the largest number beside it, where rows are exchanged; least reciprocal
 * growth of entries without exchanges. */
static const double LEAST_PIVOT = 0.1, LEAST_GROWTH = 0.01;

/* Find the order of elimination by approximate minimum degree; returns whether this succeeds. */
int find_order(lu_factors *lu, int32_t *order)
{
  klu_common *common = lu->common = calloc(1, sizeof *common);
  if (!common || !klu.klu_defaults(common)) return 0;
  common->btf = 0, common->scale = 2, common->tol = LEAST_PIVOT;
  klu_symbolic *symbolic = klu.klu_analyze(lu->size, lu->begin, lu->index, common);
  if (!symbolic) return 0;
  memcpy(order, symbolic->Q, lu->size * sizeof *order);
  return klu.klu_free_symbolic((void **)&symbolic, common);
}

/* Find the structure of the factors for an order of elimination; returns the number of their entries,
 * which is infinite after a failure. */
double analyze(lu_factors *lu, int32_t *order)
{
  klu_common *common = lu->common;
  double *unit = calloc(lu->begin[lu->size], sizeof *unit);
  if (!unit) return INFINITY;
  lu->symbolic = klu.klu_analyze_given(lu->size, lu->begin, lu->index, order, order, common);
  for (int i = 0; i < lu->size; ++i)
    for (int k = lu->begin[i]; k < lu->begin[i + 1]; ++k) unit[k] = lu->index[k] == i;
  const klu_numeric *factors = lu->in_order =
    lu->symbolic ? klu.klu_factor(lu->begin, lu->index, unit, lu->symbolic, common) : 0;
  free(unit);
  return factors ? (double)factors->lnz + factors->unz : INFINITY;
}

/* The solution of a small system by dense elimination with row exchanges; x has `columns` right-hand sides, 0 or 1.
 * Returns whether the matrix is regular. */
static int solve_small(const lu_factors *lu, int columns, double *x)
{
  const int n = lu->size;
  double A[SMALL_SYSTEM * SMALL_SYSTEM] = {0};
  for (int i = 0; i < n; ++i) {
    double largest = 0;
    for (int k = lu->begin[i]; k < lu->begin[i + 1]; ++k) largest = fmax(largest, fabs(lu->data[k]));
    /* Rows have different units; a power of two changes no digit. */
    const double unit = ldexp(1, largest > 0 && isfinite(largest) ? -ilogb(largest) : 0);
    for (int k = lu->begin[i]; k < lu->begin[i + 1]; ++k) A[n * i + lu->index[k]] = unit * lu->data[k];
    if (columns) x[i] *= unit;
  }
  return solve_dense(n, A, columns, x);
}

/* Factorize the matrix without row exchanges, or with exchanges if entries would grow. The factors do
 * not depend on earlier matrices, so that a restarted run has the same numbers. Returns whether the
 * matrix is regular. */
int factorize(lu_factors *lu)
{
  klu_common *common = lu->common;
  if (lu->size <= SMALL_SYSTEM) return solve_small(lu, 0, 0);
  lu->latest = lu->in_order;
  if (klu.klu_refactor(lu->begin, lu->index, lu->data, lu->symbolic, lu->in_order, common)
      && klu.klu_rgrowth(lu->begin, lu->index, lu->data, lu->symbolic, lu->in_order, common)
      && common->rgrowth >= LEAST_GROWTH)
    return 1;
  klu.klu_free_numeric(&lu->exchanged, common);
  lu->latest = lu->exchanged = klu.klu_factor(lu->begin, lu->index, lu->data, lu->symbolic, common);
  return lu->latest != 0;
}

/* Replace a right-hand side by the solution. Without row exchanges, solutions with forces of connectors lose
 * digits, which a refinement restores. */
void solve_factored(const lu_factors *lu, double *x)
{
  const int n = lu->size;
  if (n <= SMALL_SYSTEM) {
    solve_small(lu, 1, x);
    return;
  }
  double *left = lu->space, *first = left + n;
  if (lu->refines) memcpy(left, x, n * sizeof *x);
  klu.klu_tsolve(lu->symbolic, lu->latest, n, 1, x, lu->common);
  if (!lu->refines) return;
  memcpy(first, x, n * sizeof *x);
  for (int i = 0; i < n; ++i)
    for (int k = lu->begin[i]; k < lu->begin[i + 1]; ++k) left[i] -= lu->data[k] * x[lu->index[k]];
  klu.klu_tsolve(lu->symbolic, lu->latest, n, 1, left, lu->common);
  for (int i = 0; i < n; ++i) x[i] = first[i] + left[i];
}

void free_factors(lu_factors *lu)
{
  if (lu->symbolic) klu.klu_free_symbolic(&lu->symbolic, lu->common);
  if (lu->in_order) klu.klu_free_numeric(&lu->in_order, lu->common);
  if (lu->exchanged) klu.klu_free_numeric(&lu->exchanged, lu->common);
  free(lu->common);
}
