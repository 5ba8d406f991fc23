/* SPDX-License-Identifier: MIT */
/* Discrete adjoint of a run: derivatives of one number by many parameters, see analysis/derivatives.py.
 *
 * A recorded step is the linear map of derivatives.c from the derivatives before the step to those at
 * its end. Backwards through the steps, the transposed map takes the derivatives of the number by the
 * state at the end of a step to those by the state before it. Arrays `..._bar` are derivatives of the
 * number. */

static double dot(size_t size, const double *x, const double *y)
{
  double sum = 0;
  for (size_t i = 0; i < size; ++i) sum += x[i] * y[i];
  return sum;
}

/* Add the products of `bar` with the rows of a table, one for each parameter, to the gradient. */
static void add_products(adjoint *a, size_t size, const double *bar, const double *rows)
{
  for (int p = 0; bar && rows && p < a->parameters; ++p) a->gradient[p] += dot(size, bar, rows + p * size);
}

/* -- material points ----------------------------------------------------------------------------------- */

/* Remove the unknowns of a point from x_bar, the derivatives by all its inputs; the transpose of
 * find_unknowns. */
static void remove_unknowns(const point_derivatives *m, const double *w, const double *J, double *x_bar)
{
  const points *p = m->points;
  const int opens = w[DIRECTION] != 0, variables = p->solves ? p->variables : 0, size = opens + variables;
  const int first = m->equations + (p->resistance && !opens);
  double A[(1 + MOST_VARIABLES) * (1 + MOST_VARIABLES)], y[1 + MOST_VARIABLES];
  for (int i = 0; i < size; ++i) {
    const int mine = opens && i == 0 ? 0 : 1 + i - opens;
    y[i] = x_bar[m->column[mine]];
    for (int j = 0; j < size; ++j) A[i * size + j] = J[(first + j) * m->columns + mine];
  }
  if (size) solve_dense(size, A, 1, y);
  x_bar[GROWTH] = 0;
  for (int k = 0; k < variables; ++k) x_bar[m->unknown + k] = 0;
  for (int i = 0; i < size; ++i)
    for (int j = 1 + variables; j < m->columns; ++j) x_bar[m->column[j]] -= y[i] * J[(first + i) * m->columns + j];
}

static void add_row(const point_derivatives *m, const double *J, int row, double factor, double *x_bar)
{
  for (int j = 0; j < m->columns; ++j) x_bar[m->column[j]] += factor * J[row * m->columns + j];
}

/* Enter x_bar, the derivatives by the inputs of point i in section c: strains at both ends, whose
 * derivatives are added to e1_bar and e0_bar, and the data of the point. */
static void enter_point(const point_derivatives *m, int c, int i, double *x_bar, double *e1_bar)
{
  const points *p = m->points;
  const int d = p->components, k = c * p->of_cell + i;
  double *w_bar = m->w_bar + (size_t)k * p->width, *e0_bar = m->e0_bar + 3 * c;
  for (int a = 0; a < 2 * d; ++a) {
    const double x = x_bar[p->strain + a], *b = p->B + 3 * (d * i + a % d);
    const double *e = (a < d ? p->e1 : p->e0) + 3 * c;
    double *to = a < d ? e1_bar + 3 * c : e0_bar;
    for (int l = 0; l < 3; ++l) {
      to[l] += x * b[l];
      if (m->B) m->B_bar[3 * (d * i + a % d) + l] += x * e[l];
    }
    x_bar[p->strain + a] = 0;
  }
  for (int j = 0; j < p->width; ++j) w_bar[j] += x_bar[j];
}

/* Derivatives by D without negative eigenvalues, see remove_negative, to those by D and by C. */
static void transpose_remove_negative(const double *C, double *D, double *D_bar, double *C_bar)
{
  double A[3][3], V[3][3], G[3][3], inner[3][3] = {{0}};
  find_eigenvalues(C, D, A, V);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) {
      D_bar[3 * i + j] = D_bar[3 * j + i] = (D_bar[3 * i + j] + D_bar[3 * j + i]) / 2;
      G[i][j] = G[j][i] = D_bar[3 * i + j] * sqrt(C[i] * C[j]);
    }
  /* The derivative of a function of a matrix has its divided differences between eigenvalues. */
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l) {
      const double a = A[k][k], b = A[l][l];
      const double slope = a < 0 && b < 0 ? 1 : a >= 0 && b >= 0 ? 0 : (fmin(a, 0) - fmin(b, 0)) / (a - b);
      for (int i = 0; slope != 0 && i < 3; ++i)
        for (int j = 0; j < 3; ++j) inner[k][l] += slope * V[i][k] * G[i][j] * V[j][l];
    }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double bar = 0, removed = 0;
      for (int k = 0; k < 3; ++k) {
        removed += fmin(A[k][k], 0) * V[i][k] * V[j][k];
        for (int l = 0; l < 3; ++l) bar += V[i][k] * inner[k][l] * V[j][l];
      }
      const double size = sqrt(C[i] * C[j]);
      C_bar[i] += (bar * D[3 * i + j] / size - G[i][j] * removed) / C[i];
      D_bar[3 * i + j] -= bar / size;
    }
}

/* Answer of a point for its committed tangent, see keep_tangents; returns its share of the weight. */
static double answer_at_end(const points *p, double *inputs, double *s)
{
  points at_end = *p;
  at_end.tried = 0;
  if (answer_at(&at_end, 1, inputs, s)) return 1;
  answer_at(&at_end, p->theta, inputs, s);
  return 1 / p->theta;
}

/* Size of changes of input j of a point in differences: a part of a number of the state, or the change of
 * another number by the parameters. A number of the state that is still zero has the derivative zero. */
static double step_of_input(const point_derivatives *m, int parameters, const double *w, size_t at, int j)
{
  const points *p = m->points;
  const int d = p->components;
  double size = 0;
  if (j == GROWTH || (p->solves && j >= m->unknown && j < m->unknown + p->variables)) return 0;
  if (j >= p->strain && j < p->strain + 2 * d)
    for (int a = 0; a < 2 * d; ++a) size = fmax(size, fabs(w[p->strain + a]));
  else if (j >= TRACTION && j < POINT_INPUTS + p->variables) size = fabs(w[j]);
  else {
    const size_t all = (size_t)p->cells * p->of_cell * p->width;
    for (int q = 0; q < parameters; ++q) size = fmax(size, m->step[q] * fabs(m->w[q * all + at + j]));
    return size;
  }
  return isfinite(size) ? size / (1 << 16) : 0;
}

/* Derivatives by the committed tangent of section c at the end of the step, see differentiate_tangents, to
 * those by its sum over the points, `sum_bar`, and by the numbers of the section. */
static void transpose_sum_of_tangents(const point_derivatives *m, int c, double *sum_bar)
{
  const points *p = m->points;
  const int d = p->components, width = p->width;
  double D[9] = {0}, s[3 + 9], r[3] = {0};
  for (int k = 0; k < 3; ++k) D[4 * k] = p->rest[k];
  for (int i = 0; i < p->of_cell; ++i) {
    memcpy(p->inputs, p->w + ((size_t)c * p->of_cell + i) * width, width * sizeof *s);
    const double share = answer_at_end(p, p->inputs, s);
    add_answer(d, p->B + 3 * d * i, share * p->weight[i], s, r, D);
  }
  double *bar = tangent_of(p, m->tangents_bar, p->damped->numbers, c);
  for (int k = 0; k < 9; ++k, bar += p->damped->lanes) sum_bar[k] = *bar, *bar = 0;
  transpose_remove_negative(p->elastic + 3 * c, D, sum_bar, m->elastic_bar + 3 * c);
  for (int k = 0; m->rest && k < 3; ++k) m->rest_bar[k] += sum_bar[4 * k];
}

/* From the sum of the tangents of section c to the inputs of point i, by differences. */
static void transpose_tangent(const point_derivatives *m, int parameters, int c, int i, const double *sum_bar,
                              double *x_bar)
{
  static const double at[4] = {-2, -1, 1, 2}, factor[4] = {1. / 12, -8. / 12, 8. / 12, -1. / 12};
  const points *p = m->points;
  const int d = p->components, width = p->width;
  const size_t first = ((size_t)c * p->of_cell + i) * width;
  const double *w = p->w + first, *b = p->B + 3 * d * i;
  double s[3 + 9], bar[9] = {0};
  for (int a = 0; a < d; ++a)
    for (int g = 0; g < d; ++g)
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l) bar[d * a + g] += b[3 * a + k] * sum_bar[3 * k + l] * b[3 * g + l];
  memcpy(p->inputs, w, width * sizeof *w);
  const double share = answer_at_end(p, p->inputs, s);
  if (m->weight) m->weight_bar[i] += share * dot(d * d, s + d, bar);
  for (int a = 0; m->B && a < d; ++a)
    for (int g = 0; g < d; ++g)
      for (int k = 0; k < 3; ++k)
        m->B_bar[3 * (d * i + a) + k] += share * p->weight[i] * (s[d + d * a + g] + s[d + d * g + a])
          * dot(3, sum_bar + 3 * k, b + 3 * g);
  for (int j = 0; j < width; ++j) {
    const double h = step_of_input(m, parameters, w, first, j);
    for (int k = 0; h > 0 && k < 4; ++k) {
      memcpy(p->inputs, w, width * sizeof *w);
      p->inputs[j] += at[k] * h;
      const double weight = answer_at_end(p, p->inputs, s) * p->weight[i];
      x_bar[j] += factor[k] / h * weight * dot(d * d, s + d, bar);
    }
  }
}

/* Derivatives of the state at the end of a step to those by its beginning; e1 gets those by the
 * strains of the sections at the end. */
void transpose_points_state(void *self, adjoint *a)
{
  const point_derivatives *m = self;
  const points *p = m->points;
  const int d = p->components, width = p->width, states = POINT_INPUTS - TRACTION + p->variables;
  double *x = a->values;
  memcpy(m->e1, m->e0_bar, 3 * (size_t)p->cells * sizeof *m->e1);
  memset(m->e0_bar, 0, 3 * (size_t)p->cells * sizeof *m->e0_bar);
  for (int c = 0; c < p->cells; ++c) {
    double sum_bar[9];
    if (m->tangents) transpose_sum_of_tangents(m, c, sum_bar);
    for (int i = 0; i < p->of_cell; ++i) {
      const size_t k = c * p->of_cell + i;
      double *w = p->w + k * width, *w_bar = m->w_bar + k * width;
      const double *J = m->J + k * m->outputs;
      memset(x, 0, width * sizeof *x);
      for (int j = 0; j < states; ++j) add_row(m, J, d + j, w_bar[TRACTION + j], x);
      memset(w_bar + TRACTION, 0, states * sizeof *x);
      if (m->tangents) transpose_tangent(m, a->parameters, c, i, sum_bar, x);
      remove_unknowns(m, w, J, x);
      enter_point(m, c, i, x, m->e1);
    }
  }
}

/* Derivatives by the resultants to those by the state before the step. */
void transpose_points(void *self, adjoint *a, const double *λ)
{
  const point_derivatives *m = self;
  const points *p = m->points;
  const int d = p->components, width = p->width;
  const double θ = p->theta;
  double *x = a->values;
  memset(m->e1, 0, 3 * (size_t)p->cells * sizeof *m->e1);
  for (int c = 0; c < p->cells; ++c) {
    const double *e0 = p->e0 + 3 * c, *e1 = p->e1 + 3 * c;
    const double *r_bar = m->r_bar + 3 * c;
    for (int k = 0; k < 3; ++k) {
      m->e0_bar[3 * c + k] += p->rest[k] * (1 - θ) * r_bar[k];
      m->e1[3 * c + k] += p->rest[k] * θ * r_bar[k];
      if (m->rest) m->rest_bar[k] += r_bar[k] * ((1 - θ) * e0[k] + θ * e1[k]);
    }
    for (int i = 0; i < p->of_cell; ++i) {
      const size_t at = c * p->of_cell + i;
      const double *J = m->J + at * m->outputs;
      memset(x, 0, width * sizeof *x);
      for (int b = 0; b < d; ++b) {
        const double s = J[m->outputs - d - m->margins + b];
        double bar = 0;
        for (int k = 0; k < 3; ++k) {
          bar += p->B[3 * (d * i + b) + k] * r_bar[k];
          if (m->B) m->B_bar[3 * (d * i + b) + k] += p->weight[i] * s * r_bar[k];
        }
        if (m->weight) m->weight_bar[i] += s * bar;
        add_row(m, J, b, p->weight[i] * bar, x);
      }
      remove_unknowns(m, p->w + at * width, J, x);
      enter_point(m, c, i, x, m->e1);
    }
  }
}

void finish_points(void *self, adjoint *a)
{
  const point_derivatives *m = self;
  const points *p = m->points;
  const size_t all = (size_t)p->cells * p->of_cell * p->width, strains = 3 * (size_t)p->cells;
  add_products(a, all, m->w_bar, m->w);
  add_products(a, strains, m->e0_bar, m->e0);
  add_products(a, 3 * p->components * p->of_cell, m->B_bar, m->B);
  add_products(a, p->of_cell, m->weight_bar, m->weight);
  add_products(a, 3, m->rest_bar, m->rest);
  add_products(a, strains, m->elastic_bar, m->elastic);
}

/* -- inertia, damping, loads ----------------------------------------------------------------------------- */

/* The matrices are symmetric. */
void transpose_product(void *self, adjoint *a, const double *λ)
{
  const product_derivative *m = self;
  const step_product *product = m->matrix->product;
  const rates *of = m->matrix->rates;
  const double *row = m->matrix->damps ? of->now->velocity : of->now->inertia;
  double *x = a->values;
  memset(x, 0, a->size * sizeof *x);
  add_product(product->A, λ, x);
  for (int j = 1; j < of->number; ++j)
    for (int i = 0; row[j] != 0 && i < a->size; ++i) a->rates[j][i] += row[j] * x[i];
  scale_rotations(product, x);
  for (int i = 0; i < a->size; ++i) a->q0[i] -= row[0] * x[i];
  for (int p = 0; p < a->parameters; ++p) {
    if (!m->change[p]) continue;
    memset(x, 0, a->size * sizeof *x);
    add_product(m->change[p], product->rate, x);
    a->gradient[p] += dot(a->size, x, λ);
  }
}

/* Rates after the step to rates before it, and to the configurations at both ends. A step from which the
 * `initial` rates are taken changes only rates besides the velocities. */
static void transpose_rates(adjoint *a, const time_loop *m, int initial)
{
  const rates *of = m->rates;
  const scheme_numbers *now = of->now;
  double *s = a->values;
  memset(s, 0, a->size * sizeof *s);
  for (int j = 1; j < of->number; ++j) memcpy(a->new_rates + (size_t)j * a->size, a->rates[j], a->size * sizeof *s);
  for (int j = initial ? 3 : 1; j < of->number; ++j) memset(a->rates[j], 0, a->size * sizeof *s);
  for (int i = 0; !initial && i < a->size; ++i) a->rates[1][i] = a->new_rates[2 * a->size + i]; /* velocities before the last step */
  for (int k = initial; k <= now->gives; ++k) {
    const double *bar = a->new_rates + (size_t)(k ? 2 + k : 1) * a->size;
    for (int j = 0; j < of->number; ++j)
      for (int i = 0; now->rates[k][j] != 0 && i < a->size; ++i)
        *(j ? a->rates[j] + i : s + i) += now->rates[k][j] * bar[i];
  }
  for (int k = 0; k < m->multipliers; ++k) s[m->multiplier[k]] = 0;
  scale_rotations(a->d->inertia, s);
  for (int i = 0; i < a->size; ++i) a->q1[i] += s[i], a->q0[i] -= s[i];
}

/* Dead loads of whole steps, whose derivatives do not depend on the state. */
void transpose_loads(void *self, adjoint *a, const double *λ)
{
  const load_derivatives *l = self;
  differentiate_loads(self, a->step, 0);
  for (int p = 0; p < a->parameters; ++p) a->gradient[p] -= dot(l->size, l->now + (size_t)p * l->size, λ);
}

/* Terms of loads by differences between scenes; only their explicit derivatives are differenced. */
void transpose_differences(void *self, adjoint *a, const double *λ)
{
  begin_neighbours(self, a->step, a->d->x);
  for (int p = 0; p < a->parameters; ++p) {
    memset(a->values, 0, a->size * sizeof *a->values);
    add_differences_derivative(self, a->d, p, a->values);
    a->gradient[p] += dot(a->size, a->values, λ);
  }
}

/* -- the steps ------------------------------------------------------------------------------------------- */

/* Record the solved step, before it is accepted; see differentiate_step on an `initial` one. Returns 0 if
 * the memory is full. */
int record_step(adjoint *a, time_loop *m, int initial)
{
  equation *e = m->equation;
  derivatives *d = a->d;
  if (a->recorded == a->most) return 0;
  memcpy(d->s, m->s, a->size * sizeof *d->s);
  d->x = m->x;
  restart(e, EXACT);
  residual(e, e->unknowns, e->residual, e->f);
  fill_tangent(e, m->x);
  for (int k = 0; k < d->terms; ++k)
    if (d->term[k].linearize) d->term[k].linearize(d->term[k].self, &m->step, m->x);
  char *to = a->record + (size_t)a->recorded * a->bytes;
  memcpy(to, &initial, sizeof initial), to += sizeof initial;
  memcpy(to, &m->step, sizeof m->step), to += sizeof m->step;
  if (m->rates) memcpy(to, m->rates->now, sizeof *m->rates->now);
  to += sizeof(scheme_numbers);
  for (int k = 0; k < a->blocks; ++k) memcpy(to, *a->block[k], a->length[k]), to += a->length[k];
  ++a->recorded;
  memcpy(m->s, d->s, a->size * sizeof *d->s);
  return 1;
}

/* Go back through the last recorded step; returns 0 if the tangent is singular. */
int go_back(adjoint *a, time_loop *m)
{
  equation *e = m->equation;
  derivatives *d = a->d;
  const char *from = a->record + (size_t)--a->recorded * a->bytes;
  scheme_numbers numbers;
  const rates *of = m->rates;
  int failed = 0, initial;
  memcpy(&initial, from, sizeof initial), from += sizeof initial;
  memcpy(&m->step, from, sizeof m->step), from += sizeof m->step;
  memcpy(&numbers, from, sizeof numbers), from += sizeof numbers;
  if (of) m->rates->now = &numbers;
  for (int k = 0; k < a->blocks; ++k) memcpy(*a->block[k], from, a->length[k]), from += a->length[k];
  d->x = m->x, a->step = &m->step, d->initial = initial;
  memset(a->q0, 0, a->size * sizeof *a->q0);
  memcpy(a->q_bar, a->q1, a->size * sizeof *a->q_bar);
  if (initial) memset(a->q1, 0, a->size * sizeof *a->q1);
  for (int k = d->terms - 1; k >= 0; --k)
    if (a->term[k].state && (!initial || d->term[k].accept_trial)) a->term[k].state(d->term[k].self, a);
  if (of) transpose_rates(a, m, initial);
  /* λ = -K^-T q1_bar, in the axes of supports, where held motions are prescribed */
  memcpy(d->tangent, e->tangent, e->indptr[e->size] * sizeof *d->tangent);
  hold_tangent(e);
  for (int k = 0; k < e->indptr[e->size]; ++k) a->transposed[k] = e->tangent[a->transpose[k]];
  memcpy(e->tangent, a->transposed, e->indptr[e->size] * sizeof *d->tangent);
  double *r = e->residual, *λ = a->lambda;
  memcpy(r, a->q1, a->size * sizeof *r);
  turn_axes(e->turned, e->axes, r, 1);
  memcpy(d->v, r, a->size * sizeof *r);
  for (int k = 0; k < e->held; ++k) r[e->hold[k]] = 0;
  if (factor_tangent(e, &failed) || failed || solve_tangent(e, 1)) return 0;
  for (int i = 0; i < a->size; ++i) λ[i] = -e->change[i];
  for (int k = 0; k < e->held; ++k) λ[e->hold[k]] = 0;
  turn_axes(e->turned, e->axes, λ, -1);
  if (m->supports->moving) { /* derivatives by the prescribed motions */
    memset(d->r, 0, a->size * sizeof *r);
    for (int i = 0; i < e->size; ++i)
      for (int k = e->indptr[i]; k < e->indptr[i + 1]; ++k) d->r[d->indices[k]] += d->tangent[k] * λ[i];
    turn_axes(e->turned, e->axes, d->r, 1);
    for (int p = 0; p < a->parameters; ++p)
      for (int k = 0; k < m->supports->moving; ++k) {
        const int i = m->supports->dof[k];
        double wanted = 0;
        for (int j = 0; j < d->neighbours; ++j)
          wanted += d->weight[p * d->neighbours + j] *
                    change_of(d->motion[p * d->neighbours + j] + k, m->supports->motion + k, m->step.motion_time);
        a->gradient[p] += (d->v[i] + d->r[i]) * wanted;
      }
  }
  for (int k = d->terms - 1; k >= 0; --k) a->term[k].force(d->term[k].self, a, λ);
  /* The configuration at the end of the step before; an initial step does not change it. */
  for (int i = 0; i < a->size; ++i) a->q1[i] = a->q0[i] + (initial ? a->q_bar[i] : 0);
  return 1;
}

/* Derivatives by the parameters, from those by the initial state. */
void finish_adjoint(adjoint *a, time_loop *m)
{
  derivatives *d = a->d;
  for (int k = 0; k < d->terms; ++k)
    if (a->term[k].finish) a->term[k].finish(d->term[k].self, a);
  add_products(a, a->size, a->q1, d->q0);
  for (int j = 1; m->rates && j < m->rates->number; ++j) add_products(a, a->size, a->rates[j], d->rates[j]);
}
