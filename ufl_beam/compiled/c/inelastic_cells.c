/* SPDX-License-Identifier: MIT */
/* Cells with material points, which compute the resultants; see InelasticCells of blocks/beams.py. */

/* out = A x */
static inline void multiply(int n, const double *A, const double *x, double *out)
{
  for (int i = 0; i < n; ++i) {
    double sum = A[n * i] * x[0];
    for (int k = 1; k < n; ++k) sum += A[n * i + k] * x[k];
    out[i] = sum;
  }
}

/* Store the response as the latest tangent. */
static void take_tangent(const inelastic *m)
{
  const points *p = m->points;
  const int n = p->strains;
  memcpy(m->last_D, p->D, n * n * (size_t)p->cells * sizeof *p->D);
  for (int c = 0; c < p->cells; ++c) {
    double *b = m->last_b + n * c;
    multiply(n, p->D + n * n * c, p->e1 + n * c, b);
    for (int k = 0; k < n; ++k) b[k] = p->r[n * c + k] - b[k];
  }
}

/* Strains of the sections of all cells, from a function of the block. */
static void find_sections(const inelastic *m, const cells *function, const double *q, double *e)
{
  memset(e, 0, m->points->strains * m->points->cells * sizeof *e);
  add_cells((void *)function, q, e);
}

/* Strains at q, linearized about the configuration of the latest tangent. The first strains are those at the
 * beginning of the step, extrapolated like the configuration; imposed strains are extrapolated as well, so without an
 * extrapolation the tangent has the forces before the step. */
static void predict_strains(const inelastic *m, const double *q)
{
  const element_block *b = m->block;
  const double ratio = m->ratio;
  const int last = m->points->strains * m->points->cells;
  predicted_forces *p = b->predicted;
  p->stale = 0;
  if (!p->begins) {
    if (p->exact) gather(b, q, about(b));
    set_prediction(b, q, 1, 1);
    find_sections(m, m->predicted, q, m->e);
    return;
  }
  gather(b, m->q0, about(b));
  set_prediction(b, q, 0, ratio / (1 + ratio));
  find_sections(m, m->predicted, q, m->e);
  if (ratio == 0) return;
  gather(b, m->q_before, about(b));
  set_prediction(b, q, 0, 0);
  find_sections(m, m->predicted, q, m->change);
  for (int k = 0; k < last; ++k) m->e[k] = (1 + ratio) * m->e[k] - ratio * m->change[k];
}

/* Forces for the tangent of a static step. The first forces are the forces before the step, or, for
 * points with tangent lines, forces at the extrapolated strains. Later forces are predicted by the
 * latest tangent for the strains that it predicts. Stiff points predict nothing. */
static const double *predict_forces(const inelastic *m, const double *q)
{
  const points *p = m->points;
  const predicted_forces *now = m->block->predicted;
  double *f = m->forces;
  const int n = p->strains, stays = now->exact || p->search[STIFF];
  if (stays && !now->begins) return p->r;
  if (now->begins && (stays || !p->line)) {
    for (int c = 0; c < p->cells; ++c) memcpy(f + n * c, p->kept + (n + POINT_KEPT) * c, n * sizeof *f);
    return f;
  }
  if (now->begins) take_tangent(m);
  if (!p->line || now->stale) predict_strains(m, q);
  for (int c = 0; c < p->cells; ++c) {
    multiply(n, m->last_D + n * n * c, m->e + n * c, f + n * c);
    for (int k = 0; k < n; ++k) f[n * c + k] += m->last_b[n * c + k];
  }
  return f;
}

/* Write numbers of the sections into modes of the cells, from `at` on. */
static void put_modes(const inelastic *m, int at, int number, const double *values)
{
  const element_block *b = m->block;
  const int each = number * m->in_cell;
  for (int i = 0; i < b->elements; ++i, values += each) {
    double *w = input(b, i / b->lanes, b->width - b->modes + at) + i % b->lanes;
    for (int k = 0; k < each; ++k) w[k * b->lanes] = values[k];
  }
}

/* Resultants and their derivatives at q, unless q is the latest one: compute the strains at q, the
 * response to them, and write the resultants into the modes of the cells. */
void respond_at(const inelastic *m, const double *q)
{
  points *p = m->points;
  const predicted_forces *now = m->block->predicted;
  if (!memcmp(q, m->latest, m->size * sizeof *q)) return;
  memcpy(m->latest, q, m->size * sizeof *q);
  find_sections(m, m->strains, q, p->e1);
  p->linear = 0;
  if (now && p->line && !now->exact) {
    predict_strains(m, q);
    p->linear = m->e;
  }
  respond(p);
  put_modes(m, m->at_r, p->strains, p->r);
}

/* Write the tangents of the latest response into the modes of the cells. */
void put_tangents(const inelastic *m)
{
  put_modes(m, m->at_D, m->points->strains * m->points->strains, m->points->D);
  put_modes(m, m->at_predicted, m->points->strains, m->points->r);
}

void add_inelastic_force(void *self, const double *q, double *r)
{
  const inelastic *m = self;
  respond_at(m, q);
  add_cells((void *)m->force, q, r);
}

void add_inelastic_tangent(void *self, const double *q, double *tangent)
{
  const inelastic *m = self;
  const element_block *b = m->block;
  points *p = m->points;
  respond_at(m, q);
  put_tangents(m);
  if (b->predicted) put_modes(m, m->at_predicted, p->strains, predict_forces(m, q));
  add_cells((void *)b->inserted, q, tangent);
  if (b->predicted) {
    take_tangent(m);
    gather(b, q, about(b));
    b->predicted->begins = 0, b->predicted->stale = 1;
  }
  if (p->line) {
    memcpy(p->predicted, p->line, LINE * p->cells * p->of_cell * sizeof *p->line);
    p->predicts = 1;
    m->latest[0] = NAN; /* if supports hold all motions, the same q is evaluated with new lines */
  }
}

/* Largest difference at q between the force of a point and the force of its strain, relative to
 * `scale`. */
double missed_by_points(void *self, const double *q, const double *r, double scale, double moved, double quiet)
{
  const inelastic *m = self;
  const double *unlike = m->points->unlike;
  double largest = 0;
  respond_at(m, q);
  for (int k = 0, n = m->points->strains; k < n; ++k)
    largest = fmax(largest, 2 * k < n ? unlike[k] : unlike[k] / m->scene); /* forces, then moments */
  return largest > 0 ? largest / scale : 0;
}

/* -- points of cells and of springs ------------------------------------------------------------- */

void begin_points(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  points *p = b->inner;
  inelastic *m = b->sections;
  for (int k = 0; k < p->cells * p->of_cell && p->w[k * p->width + DT] != step->dt; ++k)
    p->w[k * p->width + DT] = step->dt;
  p->tried = p->predicts = 0;
  if (!m) return;
  m->latest[0] = NAN; /* compute the next response in any case */
  m->q0 = step->q0, m->q_before = step->q_before, m->ratio = step->ratio;
}

/* The points of a block after their response at q. */
static points *respond_in(const element_block *b, const double *q)
{
  if (b->sections) respond_at(b->sections, q);
  else respond_springs(b, q);
  return b->inner;
}

void accept_points(void *self, const time_step *step, const double *q1, const double *s)
{
  points *p = respond_in(self, q1);
  if (p->damped) {
    accept_block((void *)p->damped, step, q1, s);
    keep_tangents(p);
  }
  end_points(p, p->sum, 1);
  for (int k = 0; k < POINT_OUTPUTS; ++k)
    if (p->entry[k] && k != ELASTIC && k != HARDENING) *p->entry[k] += (k == LOST ? 2 * p->alpha : 1) * p->sum[k];
}

void add_energy_of_points(void *self, const time_step *step, const double *q1, const double *s)
{
  const points *p = ((element_block *)self)->inner;
  for (int k = ELASTIC; k <= HARDENING; ++k)
    if (p->entry[k]) *p->entry[k] += p->sum[k];
}
