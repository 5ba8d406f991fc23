/* SPDX-License-Identifier: MIT */
/* The loops over cells and rows that a Newton iteration consists of; see loops.h. */

/* The coefficients of a cell from `at` on; the way from one to the next is c->lanes, a power of two:
 * before the batch of a cell there are cell & -lanes cells. */
static inline double *in_cell(const cells *c, int cell, int at)
{
  return c->w + (cell & -c->lanes) * c->width + at * c->lanes + (cell & (c->lanes - 1));
}

/* The values q of the cells into their packed coefficients, from `at` on. */
void set_cells(const cells *c, const double *q, int at)
{
  const int32_t *dofs = c->dofs;
  const int n = c->lanes;
  double *batch = c->w + at * n;
  for (int first = 0; first < c->number; first += n, batch += c->width * n)
    for (int l = 0; l < n && first + l < c->number; ++l, dofs += c->of_cell)
      for (int i = 0; i < c->of_cell; ++i) batch[i * n + l] = q[dofs[i]];
}

/* Some values into the packed coefficients of a cell. */
static inline void put_in_cell(const cells *c, int cell, int at, int number, const double *values)
{
  double *w = in_cell(c, cell, at);
  for (int i = 0; i < number; ++i) w[i * c->lanes] = values[i];
}

/* Add the form at the unknowns q to a vector, or to the entries of a matrix. */
void add_cells(void *self, const double *q, double *b)
{
  const cells *c = self;
  if (c->several) {
    c->several(c, q, b);
    return;
  }
  const int32_t *dofs = c->dofs, *row = c->row;
  const double *coordinates = c->coordinates;
  double *w = c->w, e[MOST_ENTRIES];
  for (int k = 0; k < c->number; ++k) {
    for (int i = 0; i < c->unknowns; ++i) w[c->at + i] = q[dofs[i]];
    memset(e, 0, c->rows * sizeof *e);
    CALL(c->tabulate, e, w, c->constants, coordinates);
    for (int i = 0; i < c->rows; ++i) b[row[i]] += e[i];
    dofs += c->of_cell, w += c->width, coordinates += 6, row += c->rows;
  }
}

/* The same of one form at the first call of a step, and of another one then. */
void add_first_cells(void *self, const double *q, double *b)
{
  first_cells *f = self;
  add_cells((void *)(f->begins ? f->first : f->then), q, b);
  f->begins = 0;
}

/* Value of a functional at the unknowns q. */
double value_of_cells(const cells *c, const double *q)
{
  double value = 0;
  add_cells((void *)c, q, &value);
  return value;
}

/* out = a x + b y */
void combine(int size, double a, const double *x, double b, const double *y, double *out)
{
  for (int i = 0; i < size; ++i) out[i] = a * x[i] + b * y[i];
}

/* out = x + ratio (x - y) */
void extrapolate(int size, const double *x, const double *y, double ratio, double *out)
{
  for (int i = 0; i < size; ++i) out[i] = x[i] + ratio * (x[i] - y[i]);
}

/* b -= a */
void subtract_vector(void *self, const double *q, double *b)
{
  const vector *a = self;
  for (int i = 0; i < a->size; ++i) b[i] -= a->values[i];
}

/* Where a matrix holds the entries (row, column); whether it has them all. */
int find_entries(const int32_t *indptr, const int32_t *indices, int number, const int32_t *row,
                 const int32_t *column, int32_t *found)
{
  for (int k = 0; k < number; ++k) {
    int32_t low = indptr[row[k]], high = indptr[row[k] + 1];
    while (high - low > 1) { /* columns are in order */
      const int32_t middle = low + (high - low) / 2;
      if (indices[middle] <= column[k]) low = middle;
      else high = middle;
    }
    if (low == high || indices[low] != column[k]) return 0;
    found[k] = low;
  }
  return 1;
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

/* r += A (factor s - back v), where s is the step of the nodes from q0 to q */
void add_step_force(void *self, const double *q, double *r)
{
  const step_product *p = self;
  double *s = p->space;
  step_of_nodes(p->size, p->rotations, p->rotation, s, p->q0, q);
  for (int i = 0; i < p->size; ++i) s[i] = p->factor * s[i] - p->back * p->v[i];
  add_product(p->size, p->indptr, p->indices, p->data, s, r);
}

/* tangent += factor A, column by column times the derivative 1 + half^2 of the step of the nodes */
void add_step_tangent(void *self, const double *q, double *tangent)
{
  const step_product *p = self;
  double *growth = p->space;
  for (int i = 0; i < p->size; ++i) growth[i] = p->factor;
  for (int k = 0; k < p->rotations; ++k) {
    double half = tan((q[p->rotation[k]] - p->q0[p->rotation[k]]) / 2);
    growth[p->rotation[k]] += p->factor * half * half;
  }
  for (int k = 0; k < p->indptr[p->size]; ++k)
    tangent[p->entry[k]] += p->data[k] * growth[p->indices[k]];
}

/* Sum of the squares of w f. */
double sum_of_squares(int rows, const double *w, const double *f)
{
  double sum = 0;
  for (int i = 0; i < rows; ++i) sum += w[i] * f[i] * (w[i] * f[i]);
  return sum;
}

/* The same of w f / unit. */
double scaled_sum_of_squares(int rows, const double *w, const double *f, double unit)
{
  double sum = 0;
  for (int i = 0; i < rows; ++i) sum += w[i] * (f[i] / unit) * (w[i] * (f[i] / unit));
  return sum;
}

/* Largest size of w f. */
double largest_size(int rows, const double *w, const double *f)
{
  double largest = 0;
  for (int i = 0; i < rows; ++i)
    if (!(w[i] * fabs(f[i]) <= largest)) largest = w[i] * fabs(f[i]);
  return largest;
}

/* Largest displacement in q, and rotation times the size of the scene; w as for forces. */
double largest_motion(int rows, const double *w, const double *q)
{
  double largest = 0;
  for (int i = 0; i < rows; ++i)
    if (w[i] > 0 && !(fabs(q[i]) <= largest * w[i])) largest = fabs(q[i]) / w[i];
  return largest;
}

/* Whether a sum of squares has all its digits: none of them has become too small or too large. */
int has_its_digits(double sum)
{
  return isnan(sum) || (1e-250 < sum && sum < 1e250);
}

/* -- material points ------------------------------------------------------------------------- */

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
  /* Where a jump has relieved the strain, what the bulk bears has the last digits of both. */
  double far = fmax(fabs(w[BEFORE]), fabs(w[STRAIN])) * w[LENGTH] + fabs(w[JUMP]);
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
    if (step <= 1e-9 * a || step <= 4 * DBL_EPSILON * (bound + far)) return next > 0 ? next : a;
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
 *
 * While `course` asks to hold, closed points stay closed whatever they bear, and `over` is the
 * largest of |stress| / limit - 1 of those that bear more than their limit, else zero.
 */
void respond(const points *p)
{
  double s[2], *w = p->w, *r = p->r, *D = p->D;
  const double *e0 = p->e0, *e1 = p->e1;
  *p->over = 0;
  for (int c = 0; c < p->cells; ++c, e0 += 3, e1 += 3, r += 3, D += 9) {
    memset(D, 0, 9 * sizeof *D);
    for (int k = 0; k < 3; ++k) {
      r[k] = p->rest[k] * ((1 - p->theta) * e0[k] + p->theta * e1[k]);
      D[4 * k] = p->rest[k] * p->theta;
    }
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      const double *b = p->B + 3 * i;
      w[STRAIN] = b[0] * e1[0] + b[1] * e1[1] + b[2] * e1[2];
      w[GROWTH] = w[DIRECTION] = 0;
      ask(p->bulk, w, 2, s);
      const int over = fabs(s[0]) > w[TRACTION]; /* P(51) */
      if (over && p->course[HOLD] && w[FLOWS] == CLOSED && w[TRACTION] > 0) {
        *p->over = fmax(*p->over, fabs(s[0]) / w[TRACTION] - 1);
        p->course[OVER] = 1;
      } else if (over) {
        w[DIRECTION] = s[0] < 0 ? -1 : 1;
        w[GROWTH] = growth(p->excess, w);
        ask(p->opening, w, 2, s);
        p->course[OPENED] = 1;
      } else if (p->course[RELIEF]) {
        s[1] = p->theta * w[STIFFNESS];
      }
      for (int k = 0; k < 3; ++k) {
        r[k] += p->weight[i] * s[0] * b[k];
        for (int l = 0; l < 3; ++l) D[3 * k + l] += p->weight[i] * s[1] * b[k] * b[l];
      }
    }
  }
}

/* Let the closed points open, in this step, whose excess in the latest response is so large. */
void release(const points *p, double least)
{
  double s[2], *w = p->w;
  for (int i = 0; i < p->cells * p->of_cell; ++i, w += p->width) {
    if (w[FLOWS] != CLOSED || !(w[TRACTION] < INFINITY)) continue;
    ask(p->bulk, w, 2, s);
    if (fabs(s[0]) > w[TRACTION] && fabs(s[0]) / w[TRACTION] - 1 >= least) w[FLOWS] = RELEASED;
  }
}

/* Resultants as affine functions b + D e of the strains, for the tangent. */
static void linearise(const inelastic *m)
{
  const points *p = m->points;
  const double *e = p->e1, *r = p->r, *D = p->D;
  for (int c = 0; c < p->cells; ++c, e += 3, r += 3, D += 9) {
    double b[3];
    for (int k = 0; k < 3; ++k)
      b[k] = r[k] - D[3 * k] * e[0] - D[3 * k + 1] * e[1] - D[3 * k + 2] * e[2];
    put_in_cell(m->tangent, c, m->at_b, 3, b);
    put_in_cell(m->tangent, c, m->at_D, 9, D);
  }
}

/* Resultants and their derivatives at q; nothing is to do if q is the latest.
 *
 * First the strains at q, then what responds to them, then where it goes.
 */
void respond_at(const inelastic *m, const double *q)
{
  const points *p = m->points;
  if (!memcmp(q, m->latest, m->size * sizeof *q)) return;
  memcpy(m->latest, q, m->size * sizeof *q);
  memset(p->e1, 0, 3 * p->cells * sizeof *p->e1);
  add_cells((void *)m->strains, q, p->e1);
  respond(p);
  for (int c = 0; c < p->cells; ++c) put_in_cell(m->force, c, m->at_r, 3, p->r + 3 * c);
}

void add_inelastic_force(void *self, const double *q, double *r)
{
  const inelastic *m = self;
  respond_at(m, q);
  add_cells((void *)m->force, q, r);
}

/* The first tangent of a static step is of the forces before it, see beams.py. */
void add_inelastic_tangent(void *self, const double *q, double *tangent)
{
  inelastic *m = self;
  const points *p = m->points;
  respond_at(m, q);
  if (m->begins) {
    for (int c = 0; c < p->cells; ++c) memcpy(p->r + 3 * c, p->kept + 6 * c, 3 * sizeof *p->r);
    m->latest[0] = NAN;
  }
  linearise(m);
  add_cells((void *)m->tangent, q, tangent);
  m->begins = 0;
}

/* -- connectors -------------------------------------------------------------------------------- */

/* Motions of the links at q. */
void find_motions(const couplings *c, const double *q)
{
  memset(c->by_cell, 0, c->number * sizeof *c->by_cell);
  add_cells((void *)c->motion, q, c->by_cell);
  for (int k = 0; k < c->number; ++k) c->e1[c->link[k]] = c->by_cell[k];
}

static void put_row(const couplings *c, int cell, const double *row)
{
  put_in_cell(c->work, cell, c->row, 3, row);
  put_in_cell(c->tangent, cell, c->row_of_tangent, 3, row);
}

/* The laws of springs around their motions at q. */
static void set_rows_of_springs(const couplings *c)
{
  const points *p = c->points;
  for (int i = 0; i < c->number; ++i) p->e1[3 * i] = c->e1[i];
  respond(p);
  for (int k = 0; k < c->number; ++k) {
    const int i = c->link[k];
    const double D = p->D[9 * i], row[3] = {-D, 1, p->r[3 * i] - D * c->e1[i]};
    put_row(c, k, row);
  }
}

/* The laws of springs and rigid-plastic connectors around their motions at q. */
static void set_rows(const couplings *c, const double *q)
{
  if (!c->points && !c->rigid_plastic) return;
  find_motions(c, q);
  if (c->points) set_rows_of_springs(c);
  if (!c->rigid_plastic) return;
  set_rows_of_rigid_plastic(c, q);
  for (int k = 0; k < c->number; ++k) put_row(c, k, c->rigid_plastic->rows + 3 * c->link[k]);
}

void add_couplings_force(void *self, const double *q, double *r)
{
  const couplings *c = self;
  set_rows(c, q);
  add_cells((void *)c->work, q, r);
}

/* Largest residual of a row: of motions as a part of 1 % of the largest motion in the scene, or of 1 %
 * of the scene if that is less; of forces as a part of the scale. What the last digits of the motions
 * make of a row does not count; far from where it began, or after many turns, it has fewer digits. */
double missed_by_couplings(void *self, const double *q, const double *r, double scale, double moved)
{
  const couplings *c = self;
  double most = 0;
  for (int k = 0; k < c->number; ++k) {
    const int i = c->link[k];
    const int32_t *dofs = c->dofs + 7 * i;
    const double *row = in_cell(c->work, k, c->row), length = c->length[i];
    const double weight = fabs(row[c->work->lanes]);
    const double unit = c->rigid_plastic ? c->rigid_plastic->slope[i] : 1;
    const double amplitude = moved / c->size;
    const double size = weight * unit < 1 - 1e-12 ? 0.01 * length * amplitude
                                                  : weight * scale * c->size / length;
    double far = amplitude;
    for (int j = 0; j < 4; ++j) far = fmax(far, amplitude + fabs(q[dofs[j]]) / c->size);
    for (int j = 4; j < 6; ++j) far = fmax(far, amplitude + fabs(q[dofs[j]]));
    const double round_off = 8 * fabs(row[0]) * length * (nextafter(far, INFINITY) - far);
    const double left = fabs(r[c->force[i]]) - round_off;
    const double missed = left > 0 ? left / size : left <= 0 ? 0 : NAN;
    if (!(missed <= most)) most = missed;
  }
  return most;
}

/* Take the end of the step as the new state; what all have taken in it. */
double commit_couplings(const couplings *c, const double *q, double dt)
{
  const double a = c->weight_of_before;
  double sum = 0;
  find_motions(c, q);
  for (int i = 0; i < c->number; ++i) {
    const double f = q[c->force[i]], change = c->e1[i] - c->e0[i];
    const double work = (a * c->before[i] + (1 - a) * f) * change;
    c->taken[i] += work;
    c->rate[i] = change / dt;
    c->before[i] = f;
    c->e0[i] = c->e1[i];
    sum += work;
  }
  return sum;
}

/* Take the end of the step as the new state.
 *
 * Each cell keeps what it bears (3), the jump of its last point, and what it dissipated by plastic
 * strains and by discontinuities; sum gets what all cells dissipated so in the step, what they lost
 * numerically at theta = 1, what they store elastically and by hardening, what breaking points let go
 * of, and what mean stresses do more on plastic strains than those at the end, where these are less.
 */
void commit(const points *p)
{
  double s[POINT_OUTPUTS], *e0 = p->e0, *w = p->w, *kept = p->kept, *sum = p->sum;
  const double *e1 = p->e1, *rest = p->rest, *length = p->length, *weight = p->weight;
  memset(sum, 0, 7 * sizeof *sum);
  for (int c = 0; c < p->cells; ++c, e0 += 3, e1 += 3, kept += 6) {
    double plastic = 0, broken = 0;
    for (int k = 0; k < 3; ++k) {
      double change = e1[k] - e0[k];
      kept[k] = rest[k] * e1[k];
      sum[2] += rest[k] * change * change / 2 * length[c];
      sum[3] += rest[k] * e1[k] * e1[k] / 2 * length[c];
      e0[k] = e1[k];
    }
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      double volume = weight[i] * length[c];
      ask(p->end, w, POINT_OUTPUTS, s);
      const double before = w[STIFFNESS] * (w[BEFORE] - w[JUMP] / w[LENGTH] - w[PLASTIC]);
      const double change = s[STRESS] - before;
      const double hardened = s[LOST] - change / w[STIFFNESS] * change / 2;
      const double relaxed = hardened - change / 2 * s[FLOW];
      if (s[FLOW] != 0 && relaxed > 0) sum[6] += volume * relaxed;
      w[BEFORE] = w[STRAIN];
      w[PLASTIC] += s[FLOW];
      w[ACCUMULATED] += fabs(s[FLOW]);
      w[JUMP] += w[DIRECTION] * w[GROWTH];
      w[OPENING] += w[GROWTH];
      w[FLOWS] = w[GROWTH] > 0 ? FLOWING : CLOSED;
      w[GROWTH] = w[DIRECTION] = 0;
      if (w[TRACTION] < INFINITY) w[TRACTION] = s[RESISTANCE];
      if (w[TRACTION] == 0) {
        /* Broken: the mean stress of each step is zero from now on, but stresses at the ends may
         * alternate about that. The discontinuity takes the elastic strain, which nothing holds. */
        w[JUMP] += s[STRESS] / w[STIFFNESS] * w[LENGTH];
        sum[5] += volume * s[ELASTIC];
        s[STRESS] = s[ELASTIC] = 0;
      }
      plastic += volume * s[WORKED];
      broken += weight[i] * s[BROKEN];
      sum[2] += volume * s[LOST];
      sum[3] += volume * s[ELASTIC];
      sum[4] += volume * s[HARDENING];
      for (int k = 0; k < 3; ++k) kept[k] += weight[i] * s[STRESS] * p->B[3 * i + k];
    }
    kept[3] = w[JUMP - p->width];
    kept[4] += plastic;
    kept[5] += broken;
    sum[0] += plastic;
    sum[1] += broken;
  }
}
