/* SPDX-License-Identifier: MIT */
/* Rates, and products of constant matrices with rates; see inertia_and_damping.py. */

/* tan(x/2) for the increment x of rotation k, stored because forces and their tangent use the same
 * increment. */
static inline double half_tangent(const step_product *p, int k, double x)
{
  if (p->turn[k] != x) p->turn[k] = x, p->half[k] = tan(x / 2);
  return p->half[k];
}

/* r += A (factor s - back v), where s is the step of the nodes from q0 to q */
void add_step_force(void *self, const double *q, double *r)
{
  const step_product *p = self;
  double *s = p->rate;
  if (p->low)
    for (int i = 0; i < p->size; ++i) s[i] = q[i] - p->q0[i] + p->low[i];
  else
    for (int i = 0; i < p->size; ++i) s[i] = q[i] - p->q0[i];
  for (int k = 0; k < p->rotations; ++k) {
    double *x = s + p->rotation[k];
    *x = 2 * half_tangent(p, k, *x);
  }
  for (int i = 0; i < p->size; ++i) s[i] = p->factor * s[i] - p->back * p->v[i];
  add_product(p->A, s, r);
}

/* Derivatives by q of factor times the step of the nodes: factor (1 + half^2) */
static void find_growth(const step_product *p, const double *q)
{
  double *growth = p->space;
  for (int i = 0; i < p->size; ++i) growth[i] = p->factor;
  for (int k = 0; k < p->rotations; ++k) {
    const int32_t at = p->rotation[k];
    const double half = half_tangent(p, k, q[at] - p->q0[at] + (p->low ? p->low[at] : 0));
    growth[at] += p->factor * half * half;
  }
}

/* tangent += A, each column times its derivative, for a range of rows */
static void add_rows(const step_product *p, int first, int last, double *tangent)
{
  const constant_matrix *A = p->A;
  int g = 0;
  for (int end = A->runs; end - g > 1;) {
    const int middle = (g + end) / 2;
    if (A->first[middle] <= first) g = middle;
    else end = middle;
  }
  for (; g < A->runs && A->first[g] < last; ++g)
    for (int r = 0; r < A->period; ++r) {
      const int s = g * A->period + r, begin = A->first[g] + r, rows = rows_of_strip(A, g, r);
      const int from = first > begin ? (first - begin + A->period - 1) / A->period : 0;
      const int before = (last - begin + A->period - 1) / A->period, to = before < rows ? before : rows;
      const int32_t *away = A->away + A->begin[s];
      const int64_t at = A->at[s];
#define ADD(width, period, place) \
  for (int i = from, row = begin + from * (period); i < to; ++i, row += (period)) \
    for (int k = 0; k < (width); ++k) \
      tangent[p->begin[row] + (place)[at + (int64_t)k * rows + i]] += \
        A->data[at + (int64_t)k * rows + i] * p->space[row + away[k]]
#define ADD_NEAR(width, period) ADD(width, period, p->place)
#define ADD_FAR(width, period) ADD(width, period, p->far)
      if (p->place) FOR_STRIP(A->begin[s + 1] - A->begin[s], A->period, ADD_NEAR)
      else FOR_STRIP(A->begin[s + 1] - A->begin[s], A->period, ADD_FAR)
#undef ADD
#undef ADD_NEAR
#undef ADD_FAR
    }
}

void add_step_tangent(void *self, const double *q, double *tangent)
{
  const step_product *p = self;
  find_growth(p, q);
  add_rows(p, 0, p->size, tangent);
}

/* out = sum of coefficients times rates, from the index `first` on */
static void combine_rates(const rates *r, const double *numbers, int first, double *out)
{
  int begun = 0;
  for (int j = first; j < r->number; ++j) {
    const double c = numbers[j], *x = r->rate[j];
    if (c == 0) continue;
    if (begun)
      for (int i = 0; i < r->size; ++i) out[i] += c * x[i];
    else
      for (int i = 0; i < r->size; ++i) out[i] = c * x[i];
    begun = 1;
  }
  if (!begun) memset(out, 0, r->size * sizeof *out);
}

int find_numbers(rates *r, double dt)
{
  for (int k = 0; k < r->known; ++k) {
    r->now = r->numbers + k;
    if (r->now->dt == dt && (r->after_any || r->now->last_dt == r->last_dt) && r->now->more == r->more)
      return 1;
  }
  scheme_numbers *n = r->numbers + r->oldest;
  n->dt = dt, n->last_dt = r->last_dt, n->more = r->more;
  if (!r->find(r->handle, n)) {
    n->dt = NAN;
    return 0;
  }
  r->now = n;
  r->oldest = (r->oldest + 1) % MOST_KNOWN;
  if (r->known < MOST_KNOWN) ++r->known;
  return 1;
}

/* Write the coefficients of the rates as factor s - back v. v is a rate, or a sum if several
 * coefficients are nonzero. */
void begin_product(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  step_product *p = m->product;
  const rates *r = m->rates;
  const double *row = m->damps ? r->now->velocity : r->now->inertia;
  int last = 0, some = 0;
  p->q0 = step->q0;
  for (int j = 1; j < r->number; ++j)
    if (row[j] != 0) last = j, ++some;
  p->factor = row[0];
  p->back = some == 1 ? -row[last] : -1;
  p->v = some == 1 ? r->rate[last] : m->v;
  if (some != 1) combine_rates(r, row, 1, m->v);
}

/* x A y for the matrix A of m */
static double product_with(const matrix_of_rates *m, const double *x, const double *y)
{
  const step_product *p = m->product;
  double *Ay = p->space, sum = 0;
  memset(Ay, 0, p->size * sizeof *Ay);
  add_product(p->A, y, Ay);
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < p->size; ++i) sum += x[i] * Ay[i];
  return sum;
}

void accept_inertia(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  rates *r = m->rates;
  r->rate[0] = (double *)s;
  combine_rates(r, r->now->rates[0], 0, r->new_rate[1]);
  for (int j = 3; j < r->number; ++j) combine_rates(r, r->now->rates[j - 2], 0, r->new_rate[j]);
  if (m->lost) {
    double *change = m->v;
    for (int i = 0; i < r->size; ++i) change[i] = r->new_rate[1][i] - r->rate[1][i];
    r->rate[0] = change;
    combine_rates(r, r->now->slip, 0, r->new_rate[2]);
    *m->lost += product_with(m, r->new_rate[2], change);
  }
  double *last = r->rate[2] == r->new_rate[1] ? r->rate[1] : r->rate[2]; /* v becomes the previous velocity */
  r->rate[2] = r->rate[1], r->rate[1] = r->new_rate[1], r->new_rate[1] = last;
  for (int j = 3; j < r->number; ++j) {
    last = r->rate[j];
    r->rate[j] = r->new_rate[j], r->new_rate[j] = last;
  }
  r->last_dt = step->dt, r->more = r->now->gives;
}

void add_kinetic_energy(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  const double *v = m->rates->rate[1];
  *m->kept += product_with(m, v, v) / 2;
}

void accept_rayleigh(void *self, const time_step *step, const double *q1, const double *s)
{
  const matrix_of_rates *m = self;
  *m->lost += product_with(m, s, s) / step->dt;
}
