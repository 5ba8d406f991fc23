/* SPDX-License-Identifier: MIT */
/* Connectors: the rows of their laws around an iterate, and what an iterate misses of them. */

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

/* Let springs answer their motions e1. */
static void respond_springs(const couplings *c)
{
  for (int i = 0; i < c->number; ++i) c->points->e1[3 * i] = c->e1[i];
  respond(c->points);
}

/* The laws of springs around their motions at q. */
static void set_rows_of_springs(const couplings *c)
{
  const points *p = c->points;
  respond_springs(c);
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

/* What connector i takes in a step to the motion e1. */
static double taken_by(const couplings *c, int i, const double *q)
{
  const double a = c->weight_of_before, force = a * c->before[i] + (1 - a) * q[c->force[i]];
  return force * (c->e1[i] - c->e0[i]);
}

/* Take the end of the step as the new state; what all have taken in it. */
double commit_couplings(const couplings *c, const double *q, double dt)
{
  double sum = 0;
  find_motions(c, q);
  for (int i = 0; i < c->number; ++i) {
    const double work = taken_by(c, i, q);
    c->taken[i] += work;
    c->rate[i] = (c->e1[i] - c->e0[i]) / dt;
    c->before[i] = q[c->force[i]];
    c->e0[i] = c->e1[i];
    sum += work;
  }
  return sum;
}
