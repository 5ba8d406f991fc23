/* SPDX-License-Identifier: MIT */
/* Rigid-plastic connectors, such as plastic hinges: held up to a limit force, then following a
 * law. */

static void set_slip(double *w, double motion, int way)
{
  w[SLIP] = fmax(way * motion, 0), w[SLIP_DIRECTION] = way;
}

/* Direction in which connector i slips in an iterate, or 0 if it is held.
 *
 * With the motion m, the resistance R after it, and any r > 0, the equation for the force f is
 *
 *     r m = 0 where |f + r m| <= R, else f = R or -R:
 *
 * its residual is continuous in f and m, as Newton's method requires. While HOLD is set, connectors
 * that did not slip in the last step are held; their excess is |force| / limit - 1.
 */
static int direction_of_slip(const rigid_plastic *p, int i, double *w, double motion, double force)
{
  const double limit = p->limit[i] * (1 + 1e-12);
  const double tested = force - p->back_force[i] + p->slope[i] * motion;
  double s[2];
  p->excess[i] = 0;
  if (limit == 0) return motion < 0 ? -1 : 1;
  if (p->search[HOLD] && !p->direction_before[i] && !p->free[i]) {
    if (fabs(tested) > limit) {
      p->excess[i] = fabs(tested) / p->limit[i] - 1;
      p->search[OVER] = 1;
    }
    return 0;
  }
  const int way = tested < 0 ? -1 : 1;
  if (way * motion <= 0) {
    if (!(fabs(tested) > limit)) return 0;
  } else {
    set_slip(w, motion, way);
    ask(p->force, w, 2, s);
    if (!(way * (force + p->slope[i] * motion - s[0]) > 0)) return 0;
  }
  p->search[OPENED] = 1;
  return way;
}

/* Rows of the connectors at their motions c->e1 and forces in q: the equations above divided by r.
 * So the rows of held connectors are motions, and their tangent is symmetric.
 *
 * Between connectors that all soften, a node without inertia has a negative stiffness, and Newton's
 * method moves it against the unbalanced force, toward an unstable equilibrium. With the sign of
 * softening changed (STIFFEST) it moves with the unbalanced force, as a node with little inertia does. */
static void set_rows_of_rigid_plastic(const connectors *c, const double *q)
{
  const rigid_plastic *p = c->rigid_plastic;
  double *w = p->w, s[2];
  for (int i = 0; i < c->number; ++i, w += p->width) {
    const double motion = c->e1[i] - w[SLIP_START];
    const int way = direction_of_slip(p, i, w, motion, q[c->force[i]]);
    double *row = c->rows + 3 * i;
    row[0] = 1, row[1] = 0, row[2] = w[SLIP_START];
    p->direction[i] = way;
    if (!way) continue;
    set_slip(w, motion, way);
    ask(p->force, w, 2, s);
    const double r = p->slope[i], slope = p->search[STIFF] == STIFFEST ? fabs(s[1]) : way * s[1];
    row[0] = slope / r, row[1] = -1 / r, row[2] = (slope * c->e1[i] - s[0]) / r;
  }
}

/* Dissipation of the connectors in a step to the motions e1. A held connector that bears more than
 * its limit counts with its excess times a unit of motion. */
double dissipation_of_rigid_plastic(const rigid_plastic *p, const double *e1, const double *force)
{
  double *w = p->w, s[SLIP_OUTPUTS], sum = 0;
  for (int i = 0; i < p->number; ++i, w += p->width) {
    if (!p->direction[i]) {
      sum += fmax(fabs(force[i] - p->back_force[i]) - p->limit[i] * (1 + 1e-12), 0);
      continue;
    }
    set_slip(w, e1[i] - w[SLIP_START], p->direction[i]);
    ask(p->end, w, SLIP_OUTPUTS, s);
    sum += s[SLIP_DISSIPATED];
  }
  return sum;
}

/* Accept the motions e1 as the new state; held connectors do not change. sums get the dissipation
 * and the numerical loss in the step, and the energy that the connectors store. */
static void commit_rigid_plastic(const rigid_plastic *p, const double *e1, double *sums)
{
  double *w = p->w, s[SLIP_OUTPUTS];
  memset(sums, 0, 3 * sizeof *sums);
  for (int i = 0; i < p->number; ++i, w += p->width) {
    const int way = p->direction[i];
    set_slip(w, e1[i] - w[SLIP_START], way);
    if (p->limit[i] < INFINITY) {
      ask(p->end, w, SLIP_OUTPUTS, s);
      for (int k = 0; k < 3; ++k) sums[k] += s[SLIP_DISSIPATED + k];
      p->dissipated[i] += s[SLIP_DISSIPATED];
      p->limit[i] = s[SLIP_LIMIT], p->back_force[i] = s[SLIP_BACK_FORCE];
    }
    p->direction_before[i] = w[SLIP] > 0 ? way : 0;
    w[SLIPPED] += w[SLIP];
    w[SLIP_START] += way * w[SLIP];
  }
}
