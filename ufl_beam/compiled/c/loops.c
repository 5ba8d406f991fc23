/* SPDX-License-Identifier: MIT */
/* Loops over cells and rows of a Newton iteration; see loops.h. */

/* e = factor e + weighted strains of p->change, linearized about a configuration */
static void add_linear_strains(const predicted_strains *p, const double *about, double factor)
{
  for (int i = 0; i < p->strains->number * p->of_cell; ++i) p->e[i] *= factor;
  set_cells(p->strains, about, p->at_about);
  add_cells((void *)p->strains, p->change, p->e);
}

/* Strains at q, linearized about the configuration of the latest tangent. The first strains are
 * strains at the beginning of the step, extrapolated like the configuration. */
static void predict_strains(predicted_strains *p, const double *q)
{
  double *e = p->e, factor = 1;
  if (p->exact && !p->begins) memcpy(p->about, q, p->size * sizeof *q);
  for (int i = 0; i < p->size; ++i) p->change[i] = p->begins ? 0 : q[i] - p->about[i];
  memset(e, 0, (size_t)p->strains->number * p->of_cell * sizeof *e);
  if (p->begins && p->ratio != 0) {
    factor = 1 + p->ratio;
    add_linear_strains(p, p->q_before, 1);
  }
  add_linear_strains(p, p->begins ? p->q0 : p->about, -p->ratio / factor);
  for (int cell = 0; cell < p->strains->number; ++cell, e += p->of_cell)
    for (int i = 0; i < p->of_cell; ++i) e[i] *= factor / p->weight[i];
  if (p->imposed) {
    /* At the beginning imposed strains are extrapolated as well, so without an extrapolation the
     * tangent has the forces before the step. */
    const double reached = p->begins ? p->ratio : 1;
    const double *x = p->imposed;
    e = p->e;
    for (int k = 0; k < p->strains->number * p->of_cell; ++k) {
      const int i = k / 3 * 6 + k % 3;
      e[k] -= x[i] + reached * (x[i + 3] - x[i]);
    }
  }
  p->stale = 0;
}

/* Store q as the configuration of the latest tangent. */
static void predict_from(predicted_strains *p, const double *q)
{
  memcpy(p->about, q, p->size * sizeof *q);
  p->begins = 0, p->stale = 1;
}

/* Tangent of a static step at q, with the forces that the latest tangent predicts. */
void add_static_tangent(void *self, const double *q, double *tangent)
{
  static_tangent *t = self;
  predicted_strains *p = t->predicted;
  predict_strains(p, q);
  for (int cell = 0; cell < t->tangent->number; ++cell)
    put_in_cell(t->tangent, cell, t->at_e, p->of_cell, p->e + cell * p->of_cell);
  add_cells((void *)t->tangent, q, tangent);
  predict_from(p, q);
}

/* Value of a functional at the unknowns q. */
double value_of_cells(const cells *c, const double *q)
{
  double value = 0;
  add_cells((void *)c, q, &value);
  return value;
}

/* b -= a at its degrees of freedom */
void subtract_vector(void *self, const double *q, double *b)
{
  const vector *a = self;
  for (int i = 0; i < a->size; ++i) b[a->dof[i]] -= a->values[i];
}

/* Index of the cell of load k at a time, OFF if it is not on the beam, or ELSEWHERE; and its place in the cell,
 * from 0 to 1. In a neighbouring scene the cell is that of the run. */
static int find_loaded_cell(const moving_loads *m, int k, double t, double *s)
{
  const moving_loads *run = m->run;
  const double distance = value_at(run->position + k, t);
  int i = m->first[k];
  while (i < m->first[k + 1] && !(distance <= run->ends[2 * i + 1])) ++i;
  if (i == m->first[k + 1] || distance < run->ends[2 * i]) return OFF;
  if (m->cell[i] < 0) return ELSEWHERE;
  const double here = m == run ? distance : value_at(m->position + k, t);
  *s = (here - m->ends[2 * i]) / (m->ends[2 * i + 1] - m->ends[2 * i]);
  return i;
}

/* Values of the shape functions of a cell, and their derivatives by s; or none. */
static void find_shapes(const moving_loads *m, double s, double *value, double *slope)
{
  for (int j = 0; j < m->nodes; ++j) {
    const double *c = m->polynomial + j * m->nodes;
    double v = 0, d = 0;
    for (int power = m->nodes - 1; power >= 0; --power) d = d * s + v, v = v * s + c[power];
    value[j] = v;
    if (slope) slope[j] = d;
  }
}

/* A point of the axis that moves along it. */
typedef struct {
  double shape[4], slope[4]; /* slope: by the length of the axis */
  double speed, step[2], acceleration[2];
  const int32_t *dof;
  int cell;
} on_axis;

/* A row of coefficients times the rates at a degree of freedom, for the step s. */
static double rate_at(const rates *r, const double *row, int dof, double s)
{
  double sum = row[0] * s;
  for (int j = 1; j < r->number; ++j)
    if (row[j] != 0) sum += row[j] * r->rate[j][dof];
  return sum;
}

/* The point at a fraction of cell i of the arrays of `first`; returns whether this process has it. */
static int find_on_axis(const moving_loads *m, int i, double place, double speed, on_axis *a)
{
  if (i < 0) return 0;
  find_shapes(m, place, a->shape, a->slope);
  for (int j = 0; j < m->nodes; ++j) a->slope[j] /= m->ends[2 * i + 1] - m->ends[2 * i];
  a->cell = m->cell[i], a->speed = speed, a->dof = m->freedom + 2 * m->nodes * a->cell;
  return 1;
}

/* Velocity of the point: of the axis, by a row of coefficients, plus the speed times its tangent. */
static void find_velocity(const moving_loads *m, const on_axis *a, const double *row, double fraction, const double *q,
                          double *v)
{
  const int n = m->nodes;
  v[0] = v[1] = 0;
  for (int i = 0; i < 2 * n; ++i) {
    const double start = m->q0[a->dof[i]], change = q[a->dof[i]] - start;
    v[i / n] += a->shape[i % n] * rate_at(m->rates, row, a->dof[i], change)
      + a->speed * a->slope[i % n] * (m->place[2 * n * a->cell + i] + start + fraction * change);
  }
}

/* Derivative of the step of a mass by the displacements of node j at the end of the step. */
static double mass_by_node(const moving_loads *m, const on_axis *a, int j)
{
  return a->shape[j] + m->part * a->speed * a->slope[j] / m->rates->now->velocity[0];
}

/* Step of mass k, with which the scheme gives it the velocity of its point in the equation of the step,
 * and its acceleration. So kinks of the axis, too, change the momentum of the mass by what the axis
 * loses. */
static int find_mass(const moving_loads *m, int k, const double *q, on_axis *a)
{
  if (!find_on_axis(m, m->here[k], m->motion[2 * k], m->motion[2 * k + 1], a)) return 0;
  const scheme_numbers *now = m->rates->now;
  find_velocity(m, a, now->velocity, m->part, q, a->step);
  for (int l = 0; l < 2; ++l) {
    const double *rate = m->state + 2 * MOST_RATES * k + l;
    double sum = 0;
    for (int j = 1; j < m->rates->number; ++j)
      a->step[l] -= now->velocity[j] * rate[2 * j], sum += now->inertia[j] * rate[2 * j];
    a->step[l] /= now->velocity[0];
    a->acceleration[l] = sum + now->inertia[0] * a->step[l];
  }
  return 1;
}

void subtract_moving_loads(void *self, const double *q, double *r)
{
  const moving_loads *m = self;
  const int n = m->nodes;
  double *e = *m->each;
  memset(m->force, 0, m->size * sizeof *m->force);
  for (int k = 0; k < m->cells; ++k)
    for (int i = 0; i < 2 * n; ++i) e[3 * n * k + i] = -m->now[2 * n * k + i];
  for (int k = 0; m->rates && k < m->loads; ++k) {
    on_axis a;
    if (!find_mass(m, k, q, &a)) continue;
    for (int i = 0; i < 2 * n; ++i) e[3 * n * a.cell + i] += m->mass[k] * a.shape[i % n] * a.acceleration[i / n];
  }
  for (int k = 0; k < m->cells; ++k)
    for (int i = 0; i < 2 * n; ++i) m->force[m->at[2 * n * k + i]] -= e[3 * n * k + i];
  for (int i = 0; i < m->size; ++i) r[m->dof[i]] -= m->force[i];
}

void add_tangent_of_moving_masses(void *self, const double *q, double *tangent)
{
  const moving_loads *m = self;
  const int n = m->nodes;
  for (int k = 0; k < m->loads; ++k) {
    on_axis a;
    if (!find_on_axis(m, m->here[k], m->motion[2 * k], m->motion[2 * k + 1], &a)) continue;
    for (int i = 0; i < 2 * n * n; ++i)
      tangent[m->entry[2 * n * n * a.cell + i]] +=
        m->mass[k] * a.shape[i / n % n] * m->rates->now->inertia[0] * mass_by_node(m, &a, i % n);
  }
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
