/* SPDX-License-Identifier: MIT */
/* Loops over cells and rows of a Newton iteration; see loops.h. */

/* Work in a step s of the weighted mean of the forces in the previous equation (weight a) and in
 * the equation of this step. The forces are at the degrees of freedom `dof`, or at all degrees of
 * freedom if `dof` is null. */
static double work_in_step(int size, const int32_t *dof, double a, const double *before, const double *force,
                           const double *s)
{
  double work = 0;
  for (int i = 0; i < size; ++i) work += (a * before[i] + (1 - a) * force[i]) * s[dof ? dof[i] : i];
  return work;
}

/* b -= a at its degrees of freedom */
void subtract_vector(void *self, const double *q, double *b)
{
  const vector *a = self;
  for (int i = 0; i < a->size; ++i) b[a->dof[i]] -= a->values[i];
}

/* Expand CALL for the number of entries of a row. The compiler knows the usual numbers: one for
 * lumped masses, three for consistent masses. */
#define FOR_WIDTH(width, CALL) \
  switch (width) { \
  case 1: CALL(1); break; \
  case 3: CALL(3); break; \
  default: CALL(width); \
  }

/* y += A x in a run of rows; data, x and y begin at its first row */
static inline void add_rows_times(const int width, int rows, const double *data, const int32_t *away,
                                  const double *x, double *restrict y)
{
  for (int i = 0; i < rows; ++i) {
    double sum = 0;
    for (int k = 0; k < width; ++k) sum += data[(size_t)k * rows + i] * x[i + away[k]];
    y[i] += sum;
  }
}

/* y += A x */
void add_product(const constant_matrix *A, const double *x, double *y)
{
  for (int g = 0; g < A->runs; ++g) {
    const int first = A->first[g], rows = A->first[g + 1] - first;
    const int32_t *away = A->away + A->begin[g];
    const double *data = A->data + A->at[g];
#define ADD(width) add_rows_times(width, rows, data, away, x + first, y + first)
    FOR_WIDTH(A->begin[g + 1] - A->begin[g], ADD)
#undef ADD
  }
}

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
    const double half = half_tangent(p, k, q[at] - p->q0[at]);
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
  for (; first < last; ++g) {
    const int rows = A->first[g + 1] - A->first[g];
    const int end = A->first[g + 1] < last ? A->first[g + 1] : last;
    const int32_t *away = A->away + A->begin[g];
    const int64_t at = A->at[g] - A->first[g]; /* where row 0 would be in this run */
#define ADD(width, place) \
  for (; first < end; ++first) \
    for (int k = 0; k < (width); ++k) \
      tangent[p->begin[first] + place[at + (int64_t)k * rows + first]] += \
        A->data[at + (int64_t)k * rows + first] * p->space[first + away[k]]
#define ADD_NEAR(width) ADD(width, p->place)
#define ADD_FAR(width) ADD(width, p->far)
    if (p->place) FOR_WIDTH(A->begin[g + 1] - A->begin[g], ADD_NEAR)
    else FOR_WIDTH(A->begin[g + 1] - A->begin[g], ADD_FAR)
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

/* Return freed memory to the system; the GNU C library keeps it otherwise. */
void give_back_memory(void)
{
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

/* Euclidean norm of w f, with all digits even if its squares are very small or large. f has all
 * rows, or the rows `at` if that is not null. */
double norm(int rows, const int32_t *at, const double *w, const double *f)
{
  double sum = 0, largest = 0, scaled = 0;
#define W(i) w[at ? at[i] : i]
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < rows; ++i) sum += W(i) * f[i] * (W(i) * f[i]);
  if (isnan(sum) || (1e-250 < sum && sum < 1e250)) return sqrt(sum);
  for (int i = 0; i < rows; ++i) largest = fmax(largest, W(i) * fabs(f[i]));
  if (largest == 0 || !isfinite(largest)) return largest;
  for (int i = 0; i < rows; ++i)
    scaled += W(i) * (f[i] / largest) * (W(i) * (f[i] / largest));
#undef W
  return largest * sqrt(scaled);
}

/* Difference between a number x >= 0 and the next number, which has the next pattern of bits. */
static inline double last_digit(double x)
{
  union { double number; int64_t bits; } next = {x};
  next.bits += 1;
  return next.number - x;
}
