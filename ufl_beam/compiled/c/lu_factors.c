/* SPDX-License-Identifier: MIT */
/* Factors of the reduced system by KLU of SuiteSparse; see solvers/lu_factors.py.
 *
 * KLU takes matrices in compressed columns. The matrix here is in compressed rows, which are the
 * columns of its transpose. So KLU factors the transpose, and klu_tsolve solves with the matrix.
 */

klu_functions klu;

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

/* Factorize the matrix without row exchanges, or with exchanges if entries would grow. The factors do
 * not depend on earlier matrices, so that a restarted run has the same numbers. Returns whether the
 * matrix is regular. */
int factorize(lu_factors *lu)
{
  klu_common *common = lu->common;
  lu->latest = lu->in_order;
  if (klu.klu_refactor(lu->begin, lu->index, lu->data, lu->symbolic, lu->in_order, common)
      && klu.klu_rgrowth(lu->begin, lu->index, lu->data, lu->symbolic, lu->in_order, common)
      && common->rgrowth >= LEAST_GROWTH)
    return 1;
  klu.klu_free_numeric(&lu->exchanged, common);
  lu->latest = lu->exchanged = klu.klu_factor(lu->begin, lu->index, lu->data, lu->symbolic, common);
  return lu->latest != 0;
}

/* Replace a right-hand side by the solution. */
void solve_factored(const lu_factors *lu, double *x)
{
  klu.klu_tsolve(lu->symbolic, lu->latest, lu->size, 1, x, lu->common);
}

void free_factors(lu_factors *lu)
{
  if (lu->symbolic) klu.klu_free_symbolic(&lu->symbolic, lu->common);
  if (lu->in_order) klu.klu_free_numeric(&lu->in_order, lu->common);
  if (lu->exchanged) klu.klu_free_numeric(&lu->exchanged, lu->common);
  free(lu->common);
}
