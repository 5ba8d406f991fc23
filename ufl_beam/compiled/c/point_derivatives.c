/* SPDX-License-Identifier: MIT */
/* Derivatives of material points by parameters, direct and adjoint. Points are elements of a block: their motions are
 * the strains of a section, their forces are its resultants; see block_derivatives.c. */

/* The derivatives whose configurations are the strains of sections. */
static derivatives of_sections(const point_derivatives *m, const derivatives *d)
{
  derivatives inner = *d;
  inner.size = m->points->strains * m->points->cells, inner.q0 = m->e0, inner.q1 = m->e1;
  return inner;
}

/* Compute the tables of all points at the latest response. */
void tabulate_points(const point_derivatives *m)
{
  const points *p = m->points;
  const element_block *b = m->of->block;
  const int n = b->lanes;
  gather(b, p->e1, 0), gather(b, p->e0, b->unknowns);
  for (int k = 0; k < b->batches * n; ++k) {
    const double *w = p->w + (size_t)(k < b->elements ? k : b->elements - 1) * p->width;
    for (int j = 0; j < b->width; ++j)
      if (m->column[j] >= 0) input(b, k / n, j)[k % n] = w[m->column[j]];
  }
  find_table(m->of);
}

/* Derivatives of the resultants at constant strains. */
void add_points_derivative(const point_derivatives *m, const derivatives *d, int q)
{
  const derivatives inner = of_sections(m, d);
  memset(m->r, 0, inner.size * sizeof *m->r);
  add_block_derivative((void *)m->of, &inner, q, m->r);
}

/* Add a point, whose inputs in its block are y, to the committed tangent of its section, see add_committed. */
static void add_changed(const point_derivatives *m, const double *y, double *D, double *C)
{
  const points *p = m->points;
  const int d = p->components;
  const double *B = y + m->geometry, *rest = y + m->rest;
  double *inputs = p->inputs;
  for (int j = 0; j < m->of->block->width; ++j)
    if (m->column[j] >= 0) inputs[m->column[j]] = y[j];
  find_strains(3, d, B, y, inputs + p->strain);
  find_strains(3, d, B, y + 3, inputs + p->strain + d);
  for (int k = 0; k < 3; ++k) D[4 * k] += rest[k], C[k] += rest[k];
  add_committed(p, inputs, B, B[3 * d], D, C);
}

/* Inputs of point k in its block, in space. */
static double *inputs_of(const point_derivatives *m, int k)
{
  const element_block *b = m->of->block;
  for (int j = 0; j < b->width; ++j) b->space[j] = input(b, k / b->lanes, j)[k % b->lanes];
  return b->space;
}

static const double NEAR[4] = {-2, -1, 1, 2}, SHARE[4] = {1. / 12, -8. / 12, 8. / 12, -1. / 12};

/* Derivatives of the committed tangents, see keep_tangents, by differences. */
static void differentiate_tangents(const point_derivatives *m, const derivatives *inner, int q)
{
  const points *p = m->points;
  const element_block *b = m->of->block;
  for (int c = 0; c < p->cells; ++c) {
    double sum[9] = {0};
    for (int k = 0; k < 4; ++k) {
      double D[9] = {0}, C[3] = {0};
      for (int i = c * p->of_cell; i < (c + 1) * p->of_cell; ++i) {
        double *y = inputs_of(m, i);
        find_direction(m->of, inner, i / b->lanes, q, inner->q1 + (size_t)q * inner->size);
        for (int j = 0; j < columns(b); ++j) y[j] += NEAR[k] * m->step[q] * m->of->direction[j * b->lanes + i % b->lanes];
        add_changed(m, y, D, C);
      }
      remove_negative(C, D);
      for (int j = 0; j < 9; ++j) sum[j] += SHARE[k] / m->step[q] * D[j];
    }
    put_tangent(p, m->tangents + q * all_numbers(p->damped), p->damped->numbers, c, sum);
  }
}

/* Derivatives of the state of the points at the end of the step; e1 has the derivatives of the strains. */
void accept_points_derivative(const point_derivatives *m, const derivatives *d)
{
  const derivatives inner = of_sections(m, d);
  for (int q = 0; m->tangents && q < d->parameters; ++q) differentiate_tangents(m, &inner, q);
  accept_block_derivative((void *)m->of, &inner);
  memcpy(m->e0, m->e1, (size_t)d->parameters * inner.size * sizeof *m->e1);
}

/* -- the adjoint --------------------------------------------------------------------------------------- */

/* Size of changes of input j of a point, whose inputs are y, in differences: a part of a strain of the point, or of a
 * number of the state, or the change of another number by the parameters. A number of the state that is still zero
 * has the derivative zero. */
static double step_of_input(const point_derivatives *m, int parameters, const double *y, int k, int j)
{
  const element_block *b = m->of->block;
  const int d = m->points->components, state = first_state(b), first = state + b->states;
  const double *B = y + m->geometry;
  double size = 0, strain = 0, slope = 0;
  for (int q = 0; j >= first && q < parameters; ++q)
    size = fmax(size, m->step[q] * fabs(number_of(b, m->of->by_number + q * all_numbers(b), k)[(j - first) * b->lanes]));
  if (j >= first) return size;
  for (int a = 0; j < state && a < d; ++a) {
    strain = fmax(strain, fmax(fabs(dot(3, B + 3 * a, y)), fabs(dot(3, B + 3 * a, y + 3))));
    slope = fmax(slope, fabs(B[3 * a + j % 3]));
  }
  if (j < state) size = slope > 0 ? strain / slope : 0;
  else size = fabs(y[j]);
  return isfinite(size) ? size / (1 << 16) : 0;
}

/* Derivatives by the committed tangent of section c, to those by the inputs of its points, by differences. */
static void transpose_tangents(const point_derivatives *m, int parameters, int c)
{
  const points *p = m->points;
  const int inputs = columns(m->of->block);
  double whole[12] = {0}, bar[9], *of = tangent_of(p, m->tangents_bar, p->damped->numbers, c);
  for (int k = 0; k < 9; ++k, of += p->damped->lanes) bar[k] = *of, *of = 0;
  for (int i = c * p->of_cell; i < (c + 1) * p->of_cell; ++i) add_changed(m, inputs_of(m, i), whole, whole + 9);
  for (int i = c * p->of_cell; i < (c + 1) * p->of_cell; ++i) {
    double own[12] = {0}, *y = inputs_of(m, i), *x = m->input_bar + (size_t)i * inputs;
    add_changed(m, y, own, own + 9);
    memset(x, 0, inputs * sizeof *x);
    for (int j = 0; j < inputs; ++j) {
      const double h = step_of_input(m, parameters, y, i, j), at = y[j];
      for (int k = 0; h > 0 && k < 4; ++k) {
        double D[12];
        for (int l = 0; l < 12; ++l) D[l] = whole[l] - own[l];
        y[j] = at + NEAR[k] * h;
        add_changed(m, y, D, D + 9);
        remove_negative(D + 9, D);
        x[j] += SHARE[k] / h * dot(9, bar, D);
      }
      y[j] = at;
    }
    for (int k = 0; k < 3; ++k) m->e1_bar[3 * c + k] += x[k];
  }
}

/* The adjoint whose configurations are the strains of sections. */
static adjoint adjoint_of_sections(const point_derivatives *m, const adjoint *a, derivatives *d)
{
  adjoint inner = *a;
  inner.d = d, inner.q0 = m->e0_bar, inner.q1 = m->e1_bar;
  return inner;
}

/* Derivatives of the state at the end of a step to those by the strains e1 at the end. */
void transpose_points_state(const point_derivatives *m, adjoint *a)
{
  derivatives d = of_sections(m, a->d);
  adjoint inner = adjoint_of_sections(m, a, &d);
  memset(m->e1_bar, 0, d.size * sizeof *m->e1_bar);
  if (d.initial) return;
  memcpy(m->e1_bar, m->e0_bar, d.size * sizeof *m->e1_bar);
  memset(m->e0_bar, 0, d.size * sizeof *m->e0_bar);
  transpose_new_states(m->of, &inner);
  for (int c = 0; m->tangents && c < m->points->cells; ++c) transpose_tangents(m, a->parameters, c);
}

/* Derivatives by the resultants to those by the state before the step. */
void transpose_points(const point_derivatives *m, adjoint *a)
{
  const element_block *b = m->of->block;
  derivatives d = of_sections(m, a->d);
  adjoint inner = adjoint_of_sections(m, a, &d);
  transpose_block((void *)m->of, &inner, m->r_bar);
  for (int k = 0; m->tangents && !d.initial && k < b->elements; ++k) {
    const double *x = m->input_bar + (size_t)k * columns(b) + 3;
    double *state = m->of->state_bar + (size_t)(k / b->lanes) * b->states * b->lanes + k % b->lanes;
    for (int j = 0; j < 3; ++j) m->e0_bar[3 * (k / m->points->of_cell) + j] += *x++;
    for (int j = 0; j < b->states; ++j) state[j * b->lanes] += *x++;
    for (int j = 0; j < b->numbers; ++j) number_of(b, m->of->number_bar, k)[j * b->lanes] += *x++;
  }
}

void finish_points(const point_derivatives *m, adjoint *a)
{
  finish_block((void *)m->of, a);
  add_products(a, m->points->strains * (size_t)m->points->cells, m->e0_bar, m->e0);
}
