/* SPDX-License-Identifier: MIT */
/* The equation of a step and Newton's method, as SNES calls them without Python; see newton.py.
 *
 * Contributions without a loop in C are functions that call Python.
 */

/* -- processes that share a scene -------------------------------------------------------------- */

/* Combine numbers over all processes. */
static void agree(const equation *e, int number, const enum agreement *how, double *values)
{
  if (e->agree) e->agree(e->handle, number, (const int *)how, values);
}

double over_processes(const equation *e, enum agreement how, double here)
{
  agree(e, 1, &how, &here);
  return here;
}

/* Norm of forces, and of moments divided by the size of the scene, over all processes. */
static double norm_of(const equation *e, const double *forces)
{
  return over_processes(e, HYPOT, norm(e->size, 0, e->weight, forces));
}

/* Update the ghost values of a PETSc vector (INSERT_VALUES, FORWARD), or add them to the values of
 * the processes that own them (ADD_VALUES, REVERSE). */
static int exchange_ghosts(const equation *e, void *v, int mode, int way)
{
  if (!e->agree) return 0;
  const int error = petsc.VecGhostUpdateBegin(v, mode, way);
  return error ? error : petsc.VecGhostUpdateEnd(v, mode, way);
}

static int update_ghosts(const equation *e, void *v) { return exchange_ghosts(e, v, INSERT_VALUES, FORWARD); }

/* Exception raised by a function of a user on any process, see enum raised; synchronizes
 * e->raised. */
static int raised_anywhere(equation *e) { return e->raised = (int)over_processes(e, LARGEST, e->raised); }

/* -- supports at an angle ---------------------------------------------------------------------- */

/* Configuration in the axes of the plane. */
static const double *in_plane(const equation *e, const double *x)
{
  if (!e->turned) return x;
  memcpy(e->plane, x, e->size * sizeof *x);
  turn_axes(e->turned, e->axes, e->plane, -1);
  return e->plane;
}

static void turn_entries(double *data, int number, const int32_t *first, const int32_t *second, double c,
                         double s)
{
  for (int k = 0; k < number; ++k) {
    const double a = data[first[k]], b = data[second[k]];
    data[first[k]] = c * a + s * b, data[second[k]] = c * b - s * a;
  }
}

/* -- residual and tangent ---------------------------------------------------------------------- */

/* Residual r at x, the array of the PETSc vector f. Support reactions are stored and removed from
 * r. */
int residual(equation *e, const double *x, double *r, void *f)
{
  const double *q = in_plane(e, x);
  memset(r, 0, e->size * sizeof *r);
  for (int k = 0; k < e->inner; ++k) e->force[k].add(e->force[k].self, q, r);
  e->inner_size = norm(e->size, 0, e->weight, r);
  if (e->inner_force) memcpy(e->inner_force, r, e->size * sizeof *r);
  for (int k = e->inner; k < e->forces; ++k) e->force[k].add(e->force[k].self, q, r);
  turn_axes(e->turned, e->axes, r, 1);
  const int error = exchange_ghosts(e, f, ADD_VALUES, REVERSE);
  for (int k = 0; k < e->held; ++k) {
    e->reactions[k] = r[e->hold[k]];
    r[e->hold[k]] = 0;
  }
  return error;
}

/* Initialize rows of the tangent with the product of the constant matrix. */
static void begin_rows(const equation *e, int first, int last)
{
  const int32_t begin = e->indptr[first];
  memset(e->tangent + begin, 0, (e->indptr[last] - begin) * sizeof *e->tangent);
  if (e->product) add_rows(e->product, first, last, e->tangent);
}

/* Assemble the tangent at q in the axes of the plane. Rows are initialized shortly before cells add
 * to them, so that they are still in the cache. */
void fill_tangent(const equation *e, const double *q)
{
  int begun = 0;
  if (e->product) find_growth(e->product, q);
  for (int first = 0; e->cells && first < e->cells->number; first += SOME) {
    cells some = some_cells(e->cells, first);
    int last = begun;
    for (int i = 0; i < some.number * some.of_cell; ++i)
      last = some.dofs[i] < last ? last : some.dofs[i] + 1;
    begin_rows(e, begun, last);
    begun = last;
    add_cells(&some, q, e->tangent);
  }
  begin_rows(e, begun, e->size);
  for (int k = 0; k < e->stiffnesses; ++k)
    e->stiffness[k].add(e->stiffness[k].self, q, e->tangent);
}

/* Rotate a tangent into the axes of supports and constrain the held degrees of freedom. Their
 * diagonal entries remain, as these have the right dimension and size. The last normal value
 * replaces an entry that vanishes or is subnormal, as material that flows freely or motions that
 * fade can make it. */
void hold_tangent(const equation *e)
{
  for (int k = 0; k < e->turned; ++k) {
    const turned_axes *t = e->axes + k;
    turn_entries(e->tangent, t->in_rows, t->row_i, t->row_j, t->c, t->s);
    turn_entries(e->tangent, t->in_columns, t->column_i, t->column_j, t->c, t->s);
  }
  for (int k = 0; k < e->held; ++k)
    if (isnormal(e->tangent[e->pivot[k]])) e->pivots[k] = e->tangent[e->pivot[k]];
  for (int k = 0; k < e->zeros; ++k) e->tangent[e->zero[k]] = 0;
  for (int k = 0; k < e->held; ++k) e->tangent[e->pivot[k]] = e->pivots[k];
}

/* Tangent at x, with springs that hold zero-energy modes. */
static void assemble(const equation *e, const double *x)
{
  fill_tangent(e, in_plane(e, x));
  hold_tangent(e);
  for (int k = 0; k < e->idle; ++k) e->tangent[e->idle_entry[k]] += e->idle_stiffness[k];
}

/* -- convergence ------------------------------------------------------------------------------- */

/* Fraction of the tolerance that an iterate meets only if Newton's method has converged; required
 * before the least number of iterations. */
static const double SURE = 1e-4;

/* Multiple of the tolerance that is nearly as good, unless laws of connectors may be steep. */
static const double CLOSE = 8;

/* Factor by which a residual should fall below the tolerance in iterations that keep the tangent. */
static const double MARGIN = 1000;

/* Whether x and its residual satisfy the laws of connectors and points on all processes; motions up to `quiet` are
 * round-off. */
static int laws_met(const equation *e, const double *x, double scale, double quiet)
{
  if (!e->demanding) return 1;
  const double *q = in_plane(e, x);
  double most = 0;
  for (int k = 0; k < e->law_residuals; ++k) {
    const law_residual *law = e->law_residual + k;
    most = fmax(most, law->missed(law->self, q, e->residual, scale, e->moved, quiet));
  }
  return over_processes(e, LARGEST, most) <= e->rtol;
}

/* Forces from the round-off of displacements and rotations, estimated with the diagonal of the
 * tangent. Strains have their own relative precision as long as rotations are small. */
void find_round_off(const equation *e, const double *q, double *forces)
{
  const double amplitude = e->moved / e->scene;
  for (int i = 0; i < e->size; ++i) {
    const double far = fabs(q[i]) + amplitude * e->lengths[i];
    forces[i] = e->moves[i] * last_digit(far) * e->tangent[e->diagonal[i]];
  }
}

/* Largest motion in an iterate on all processes, at most the size of the scene: a displacement, or a
 * rotation times that size. */
void find_motion(equation *e, const double *x)
{
  double largest = 0;
  for (int i = 0; i < e->size; ++i) {
    const double w = e->weight[i];
    if (w > 0 && !(fabs(x[i]) <= largest * w)) largest = fabs(x[i]) / w;
  }
  e->moved = fmin(over_processes(e, LARGEST, largest), e->scene);
}

/* Test of convergence of an iterate x with the latest residual: the reason to stop, or ITERATING. */
static int test_convergence(equation *e, const double *x, int iteration)
{
  const enum agreement how[] = {HYPOT, HYPOT, LARGEST, LARGEST};
  const double here = norm(e->size, 0, e->weight, e->residual), switched = e->demanding ? *e->switched : 0;
  double of_all[] = {here, e->inner_size, e->raised, switched};
  agree(e, 4, how, of_all);
  const double residual = of_all[0], scale = e->loads + of_all[1];
  e->raised = (int)of_all[2];
  if (e->raised == OTHER || !isfinite(residual)) return DIVERGED;
  const double wanted = e->rtol * scale;
  const int not_yet = iteration > 1 && residual > wanted;
  double floor = 0; /* several times the residual caused by the round-off of the unknowns */
  double quiet = 0; /* a motion up to this size is round-off */
  if (not_yet || e->demanding) find_motion(e, x);
  if (not_yet || (iteration > 1 && e->demanding)) {
    find_round_off(e, x, e->space);
    floor = 8 * norm_of(e, e->space);
    /* A motion is round-off if its forces are round-off of the forces in the scene, as where friction holds all parts. */
    const double least = DBL_EPSILON * DBL_EPSILON * scale;
    if (floor == 0) quiet = DBL_EPSILON * DBL_EPSILON * e->scene;
    else if (floor < least) quiet = fmin(fmax(e->moved, DBL_MIN) * (least / floor), e->scene);
  }
  /* The initial guess may just meet the tolerance without the effect of small loads beside large
   * ones, such as imperfections that make columns buckle. The residual of an iterate is about the
   * square of the previous one. */
  const double enough = iteration < e->least ? SURE * wanted : wanted;
  const int met = residual > wanted || laws_met(e, x, scale, quiet), kept = e->near;
  if (residual <= enough && met && kept < 2) return CONVERGED;
  const int close = residual <= CLOSE * wanted && !e->demanding;
  if (iteration > 1 && kept < 2) {
    /* A residual of a fraction of the round-off is luck, and final. A residual of a few times the
     * round-off is final if Newton's method no longer halves it; the method may cycle between two
     * such states for ever. With a kept tangent that is no proof, but it suffices close to the
     * tolerance. */
    const int stays = e->last / 2 < residual && residual <= floor && (!kept || close);
    if ((stays || residual <= floor / 80) && laws_met(e, x, scale, quiet)) return AT_ROUND_OFF;
  }
  e->near = kept == 2;
  if (iteration > !e->product && !kept && !e->rotations && (close || residual > floor)) {
    /* With a kept tangent, the residual falls by twice the last factor. It must fall far enough that works are the same
     * as with a new tangent. Two such iterations take less time than one with a new tangent. */
    const double factor = 2 * residual / e->last, next = MARGIN * residual * factor;
    e->near = next <= wanted ? 1 : e->product && next * factor <= wanted ? 2 : 0;
  }
  /* A tangent with the row of a motion does not fit the row of a force: newtons of the residual
   * would become metres of the change. */
  if (of_all[3] > 0) e->near = *e->switched = 0;
  e->slow += 1;
  /* Directly after the activation of a connector, balanced forces are no measure of convergence, as
   * its law is not met yet. */
  const double size = iteration > 0 || met ? residual : scale;
  /* Full steps of rotations in space leave the guess far: later residuals fall from that of the first iterate. */
  if (size <= e->best / 2 || (iteration == 1 && e->rotations && !e->careful)) e->best = size, e->slow = 0;
  e->last = residual;
  return e->slow == e->patience ? STALLED : ITERATING;
}

petsc_functions petsc;

#define TRY(call) do { int error = (call); if (error) return error; } while (0)

/* -- the linear equation of an iteration ----------------------------------------------------------- */

/* Tell PETSc that entries of a matrix have changed. */
static int note_change(void *matrix)
{
  int64_t state;
  TRY(petsc.PetscObjectStateGet(matrix, &state));
  return petsc.PetscObjectStateSet(matrix, state + 1);
}

/* Factorize the tangent and eliminate the residual in the chains; *failed if the tangent is
 * singular. */
int factor_tangent(const equation *e, int *failed)
{
  eliminate(e->elimination, e->residual);
  if ((*failed = !all_finite(e->elimination->left, e->elimination->left_data))) return 0;
  if (e->fronts) {
    *failed = !factor_fronts(e->fronts, e->elimination->left_data);
    return 0;
  }
  TRY(note_change(e->left));
  const int error = petsc.PCSetUp(e->factors);
  if (!error) return petsc.PCGetFailedReason(e->factors, failed);
  *failed = 1;
  return error == OF_LIBRARY ? 0 : error;
}

/* Compute the change that Newton's method subtracts from the iterate; `reduced` says that the
 * residual is already eliminated in the chains. */
int solve_tangent(const equation *e, int reduced)
{
  if (!reduced) reduce(e->elimination, e->residual);
  if (e->fronts) {
    reduce_fronts(e->fronts, e->elimination->left_f);
    expand_fronts(e->fronts, e->found);
  } else TRY(petsc.PCApply(e->factors, e->left_f, e->left_x));
  expand(e->elimination, e->found, e->change);
  return 0;
}

/* Compute the change of an iteration, with a new tangent if `anew`; *failed if that is singular. */
static int find_change(equation *e, const double *x, int anew, int *failed)
{
  *failed = 0;
  if (e->border) {
    *failed = e->border->change(e->border->handle, x);
    return 0;
  }
  if (anew) assemble(e, x);
  if (e->agree) {
    *failed = e->solve(e->handle, anew);
    return e->rotations ? update_ghosts(e, e->y) : 0; /* see move_to */
  }
  if (anew) TRY(factor_tangent(e, failed));
  return *failed ? 0 : solve_tangent(e, anew);
}

/* -- Newton's method --------------------------------------------------------------------------- */

/* Size of the loads, along a path at the latest load factor. */
void find_size_of_loads(equation *e)
{
  e->loads = 0;
  for (int k = 0; k < e->load_vectors; ++k) {
    const vector *l = e->load[k];
    e->loads += over_processes(e, HYPOT, norm(l->size, l->dof, e->weight, l->values));
  }
}

static int residual_at(equation *e, double *x)
{
  TRY(update_ghosts(e, e->x));
  if (e->border) {
    e->border->arrive(e->border->handle, x);
    find_size_of_loads(e);
  }
  return residual(e, x, e->residual, e->f);
}

/* Limits of the line search: number of residuals, fraction of the initial work that ends it,
 * longest and shortest step. */
enum { EVALUATIONS = 4 };
static const double PART = 0.5, LONGEST = 1, SHORTEST = 1e-12;

/* Work of the latest residual on the conjugates of the change. */
static double work_of_residual(const equation *e)
{
  double sum = 0;
  for (int i = 0; i < e->owned; ++i) sum += e->residual[i] * e->conjugate[i];
  return over_processes(e, TOTAL, sum);
}

/* Added to the first component of a conformal rotation vector, of length 4 at most, if the node has turned by between
 * 180 and 540 degrees: then its quaternion has the other sign. See Turn in spatial_kinematics.py. */
static const double FLIPPED = 32;

/* The quaternion (1, p), without its length, of which the square is the rotation of a conformal rotation vector m; returns
 * the sign of that. */
static int take_half(const double *m, double *p)
{
  const double flips = fabs(m[0]) > FLIPPED / 2 ? copysign(FLIPPED, m[0]) : 0;
  p[0] = 1, p[1] = (m[0] - flips) / 4, p[2] = m[1] / 4, p[3] = m[2] / 4;
  return flips ? -1 : 1;
}

static double length(const double *v) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Rotation vectors of the step to x, of less than a turn. */
static void find_turning(const equation *e, const double *x)
{
  if (e->rotations) x = in_plane(e, x);
  for (int k = 0; k < e->rotations; k += 3) {
    const int32_t *i = e->rotation + k;
    const double m[] = {x[i[0]] - e->base[i[0]], x[i[1]] - e->base[i[1]], x[i[2]] - e->base[i[2]]};
    double p[4];
    const double whole = take_half(m, p) < 0 ? 2 * M_PI : 0, size = length(p + 1);
    for (int j = 0; j < 3; ++j) e->turning[i[j]] = size > 0 ? (4 * atan(size) - whole) / size * p[1 + j] : m[j];
  }
}

/* Product of quaternions. */
static void multiply_turns(const double *q, const double *p, double *out)
{
  out[0] = q[0] * p[0] - q[1] * p[1] - q[2] * p[2] - q[3] * p[3];
  for (int j = 1, a = 2, b = 3; j < 4; ++j, a = a % 3 + 1, b = b % 3 + 1)
    out[j] = q[0] * p[j] + p[0] * q[j] + q[a] * p[b] - q[b] * p[a];
}

/* Let a node turn from the rotations m by the rotation vector to which their change d is tangent. Returns the conformal
 * rotation vector in m, and in `turning` the rotation vector of the step with whole turns, `before` the change. */
static void turn_node(const double *d, const double *before, double *m, double *turning)
{
  double p[4], way[4] = {0, d[0], d[1], d[2]}, product[4], spin[4], end[4], whole = 0;
  const double old = take_half(m, p), size = length(p + 1), c = 1 / (1 + size * size);
  const double conjugate[] = {1, -p[1], -p[2], -p[3]};
  multiply_turns(p, way, product), multiply_turns(product, conjugate, spin);
  for (int j = 1; j < 4; ++j) spin[j] *= c * c;
  const double angle = length(spin + 1), f = angle > 0 ? sin(angle / 2) / angle : 0.5;
  way[0] = cos(angle / 2);
  for (int j = 1; j < 4; ++j) way[j] = f * spin[j];
  multiply_turns(p, p, product), multiply_turns(way, product, end);
  const double sign = end[0] < 0 ? -1 : 1;
  for (int j = 0; j < 4; ++j) end[j] *= sign * c;
  const double sine = length(end + 1), ratio = sine > 0 ? 2 * atan2(sine, end[0]) / sine : 2;
  const double expected[] = {before[0] + spin[1], before[1] + spin[2], before[2] + spin[3]}, far = length(expected);
  /* Close to whole turns, the axis is that of the expected rotation. */
  const double *axis = sine > 1e-8 ? end + 1 : expected, unit = sine > 1e-8 ? sine : far > 0 ? far : 1;
  for (int j = 0; j < 3; ++j) whole += axis[j] / unit * (expected[j] - ratio * end[1 + j]);
  whole = 2 * M_PI * round(whole / (2 * M_PI));
  for (int j = 0; j < 3; ++j) {
    m[j] = 4 * end[1 + j] / (1 + end[0]);
    turning[j] = ratio * end[1 + j] + whole * axis[j] / unit;
  }
  if (old * sign < 0) m[0] += FLIPPED;
}

/* Set the iterate x to a fraction of the change from `from`. Rotations in static steps in space are composed: so a beam
 * that rolls up turns as far as the linear equation says. */
static void move_to(equation *e, double *x, const double *from, double way)
{
  double *to = e->to;
  if (e->low && from == x) {
    /* Steps keep their digits far from the origin and if they are short: x + low is exact. */
    for (int i = 0; i < e->size; ++i) {
      const double before = x[i], change = way * e->change[i], after = before - change, done = before - after;
      e->low[i] += (before - (after + done)) + (done - change);
      x[i] = after;
    }
    return;
  }
  if (!e->rotations || e->border) {
    for (int i = 0; i < e->owned; ++i) x[i] = from[i] - way * e->change[i];
    if (e->low) memset(e->low, 0, e->size * sizeof *x);
    return;
  }
  memcpy(e->space, from, e->size * sizeof *x);
  const double *begin = in_plane(e, e->space);
  for (int i = 0; i < e->size; ++i) to[i] = e->space[i] - way * e->change[i];
  turn_axes(e->turned, e->axes, to, -1);
  memcpy(x, to, e->size * sizeof *x);
  for (int k = 0; k < e->rotations; k += 3) {
    const int32_t *i = e->rotation + k;
    double d[3], m[3], before[3], turning[3];
    for (int j = 0; j < 3; ++j)
      d[j] = to[i[j]] - begin[i[j]], m[j] = begin[i[j]] - e->base[i[j]], before[j] = e->turned_by[i[j]];
    if (d[0] == 0 && d[1] == 0 && d[2] == 0) continue;
    turn_node(d, before, m, turning);
    for (int j = 0; j < 3; ++j) x[i[j]] = e->base[i[j]] + m[j], e->turning[i[j]] = turning[j];
  }
  turn_axes(e->turned, e->axes, x, 1);
  for (int k = 0; k < e->held; ++k) x[e->hold[k]] = e->space[e->hold[k]];
  for (int k = 0; k < e->predictions; ++k) e->predicted[k]->to = to;
}

/* Line search by secants: take the fraction of the full change at which the residual does no work
 * on it.
 *
 * Forces may have an S-shaped characteristic, for example at a point that can yield in two
 * directions. Full steps then alternate between two branches for ever. Work is the only product of
 * residuals and steps that adds forces and moments consistently, and it does not depend on units.
 * Forces of connectors are unknowns: the residual of a connector's law, instead of its force, does
 * work on the change of its motion.
 */
static int search(equation *e, double *x)
{
  TRY(update_ghosts(e, e->y));
  e->find_conjugates(e->handle, in_plane(e, x)); /* allocates conjugates and start */
  memcpy(e->start, x, e->size * sizeof *x);
  double before = work_of_residual(e), last = 0, way = 1;
  const double first = fabs(before);
  for (int k = 1;; ++k) {
    move_to(e, x, e->start, way);
    TRY(residual_at(e, x));
    const double now = work_of_residual(e), slope = (now - before) / (way - last);
    if (k == EVALUATIONS || !(fabs(now) > PART * first) || slope == 0) return 0;
    double next = way - now / slope;
    if (next < SHORTEST) next = way + now / slope;
    if (!(SHORTEST <= next && next <= LONGEST)) return 0;
    before = now, last = way, way = next;
  }
}

/* Whether the first change of a static step from a state without internal forces is so long that only round-off resists
 * it: forces that the step brings may resist it, as weight holds a pendulum. */
static int goes_astray(const equation *e)
{
  double far = 0;
  if (e->iterations || over_processes(e, HYPOT, e->inner_size) > e->rtol * e->loads) return 0;
  for (int i = 0; i < e->owned; ++i)
    if (e->weight[i] > 0) far = fmax(far, fabs(e->change[i]) / e->weight[i]);
  return over_processes(e, LARGEST, far) > 1e3 * e->scene;
}

/* Newton's method from the iterate x; `reason` tells why it ends. */
static int newton(equation *e, double *x)
{
  e->iterations = 0;
  if (e->low) memset(e->low, 0, e->size * sizeof *x);
  TRY(residual_at(e, x));
  for (;;) {
    if (e->monitored) TRY(petsc.SNESMonitor(e->snes, e->iterations, norm_of(e, e->residual)));
    e->reason = test_convergence(e, x, e->iterations);
    if (e->border && e->reason > 0 && !e->border->met(e->border->handle)) e->reason = ITERATING;
    if (e->reason) return 0;
    if (e->iterations == e->most) {
      e->reason = TOO_MANY;
      return 0;
    }
    int failed;
    TRY(find_change(e, x, !e->near, &failed));
    if (!failed && e->doubt == DOUBTS && goes_astray(e)) e->doubt = DOUBTED, failed = 1;
    if (failed) {
      e->reason = SINGULAR;
      return 0;
    }
    if (e->rotations) memcpy(e->turned_by, e->turning, e->size * sizeof *x);
    if (e->careful) TRY(search(e, x));
    else {
      move_to(e, x, x, 1);
      TRY(residual_at(e, x));
    }
    ++e->iterations;
  }
}

/* -- callbacks of SNES ------------------------------------------------------------------------- */

/* Newton's method as a solver of SNES. The overhead of PETSc's own method takes as long as the
 * remaining computation if there are few unknowns. */
int snes_newton(void *snes, void *x)
{
  equation *e;
  double *q;
  TRY(petsc.SNESShellGetContext(snes, &e));
  TRY(petsc.VecGetArray(x, &q));
  TRY(newton(e, e->unknowns));
  TRY(petsc.VecRestoreArray(x, &q));
  TRY(petsc.SNESSetIterationNumber(snes, e->iterations));
  return petsc.SNESSetConvergedReason(snes, e->reason);
}

/* Local values of a vector including ghosts, for reading or writing. */
static int open_vector(const equation *e, void *v, void **local, double **values, int read)
{
  *local = v;
  if (e->agree) TRY(petsc.VecGhostGetLocalForm(v, local));
  return read ? petsc.VecGetArrayRead(*local, (const double **)values) : petsc.VecGetArray(*local, values);
}

static int close_vector(const equation *e, void *v, void **local, double **values, int read)
{
  TRY(read ? petsc.VecRestoreArrayRead(*local, (const double **)values)
           : petsc.VecRestoreArray(*local, values));
  return e->agree ? petsc.VecGhostRestoreLocalForm(v, local) : 0;
}

int snes_function(void *snes, void *x, void *f, void *self)
{
  equation *e = self;
  void *local_f, *local_x;
  double *r, *q;
  TRY(update_ghosts(e, x));
  TRY(open_vector(e, x, &local_x, &q, 1));
  TRY(open_vector(e, f, &local_f, &r, 0));
  TRY(residual(e, q, r, f));
  TRY(close_vector(e, f, &local_f, &r, 0));
  return close_vector(e, x, &local_x, &q, 1);
}

int snes_jacobian(void *snes, void *x, void *A, void *P, void *self)
{
  equation *e = self;
  void *local_x;
  double *q;
  if (e->near) return 0;
  TRY(update_ghosts(e, x));
  TRY(open_vector(e, x, &local_x, &q, 1));
  assemble(e, q);
  TRY(note_change(P));
  return close_vector(e, x, &local_x, &q, 1);
}

int snes_test(void *snes, petsc_int iteration, double x, double s, double f, int *reason, void *self)
{
  equation *e = self;
  *reason = e->reason = test_convergence(e, e->unknowns, e->iterations = (int)iteration);
  return 0;
}

/* -- the equilibrium of a step ------------------------------------------------------------------ */

/* Restart the predicted strains for iterations with a kind of tangents. */
void restart(const equation *e, enum tangents kind)
{
  for (int k = 0; k < e->predictions; ++k) {
    predicted_forces *p = e->predicted[k];
    p->begins = kind != EXACT, p->stale = 1, p->exact = kind != PREDICTED, p->to = 0;
  }
}

/* Set the unknowns to an initial guess. */
static int go_to(equation *e, const double *guess, enum tangents kind)
{
  double *q;
  TRY(petsc.VecGetArray(e->x, &q)); /* tells PETSc of the change */
  if (guess != e->unknowns) memcpy(e->unknowns, guess, e->size * sizeof *guess);
  TRY(petsc.VecRestoreArray(e->x, &q));
  find_turning(e, e->unknowns);
  restart(e, kind);
  return 0;
}

/* Iterations in a row that do not halve the least residual, at which the method stalls: for full
 * steps; for full steps in space; for steps that a line search shortens or with stiffer tangents; along paths. Iterates that
 * wander longer find a solution by luck: round-off of the data would decide. */
enum { SHORT_PATIENCE = 2, PATIENCE_IN_SPACE = 4, LONG_PATIENCE = 10, PATIENCE_ALONG = 12 };

/* Iterate from the unknowns; returns the reason to end. */
static int iterate(equation *e, int patience, int careful)
{
  const int by_petsc = e->monitored && !e->border && !(careful && e->searches);
  e->last = e->best = INFINITY;
  e->near = e->slow = 0;
  if (e->raised == STEP_FAILED) e->raised = NOTHING; /* the failure belongs to a discarded iterate */
  e->patience = patience;
  e->careful = careful && !by_petsc;
  const int error = by_petsc || !e->monitored ? petsc.SNESSolve(e->snes, 0, e->x) : newton(e, e->unknowns);
  e->total += e->iterations;
  if (error) {
    if (error != OF_LIBRARY) e->error = error; /* KLU raises an error if it finds no pivot */
    e->reason = SINGULAR;
  } else if (by_petsc) {
    petsc.SNESGetConvergedReason(e->snes, &e->reason);
    e->error = update_ghosts(e, e->x); /* PETSc copies only the values that a process owns */
  }
  if (e->reason <= 0 && by_petsc) { /* PETSc leaves locks on f after a failed linear solution */
    petsc_int locks = 0;
    petsc.VecLockGet(e->f, &locks);
    while (locks-- > 0) petsc.VecLockReadPop(e->f);
  }
  return e->reason;
}

/* Iterate from an initial guess. If the tangent is singular, hold zero-energy modes by springs. If
 * that does not help, go on without the springs, because forces at the last iterate may resist the
 * modes: a rope that was slack at the guess is taut there. */
static int iterate_from(equation *e, const double *guess, int patience, enum tangents kind)
{
  const double start = e->border ? *e->border->t : 0;
  enum { FRESH, HELD, FREE } motions = FRESH;
  e->doubt = e->product || e->border ? CERTAIN : DOUBTS;
  for (int from_guess = 1;;) {
    if (from_guess && e->border) *e->border->t = start;
    if (from_guess) go_to(e, guess, kind);
    const int reason = iterate(e, patience, 0);
    if (motions == FREE || reason > 0 || e->error || raised_anywhere(e) == OTHER) return reason;
    const int doubted = e->doubt == DOUBTED, held = reason == SINGULAR && e->find_zero_modes(e->handle);
    e->doubt = CERTAIN;
    if (held) motions = HELD;
    else if (doubted) from_guess = 1;
    else if ((reason == SINGULAR || motions == HELD) && e->forget_zero_modes(e->handle))
      from_guess = motions != HELD, motions = FREE;
    else return reason;
  }
}

static void run(const phases *p, const time_step *step, const double *q1, const double *s)
{
  for (int k = 0; k < p->number; ++k) p->call[k].run(p->call[k].self, step, q1, s);
}

/* Set stiffer tangents of points that do not open, or restore the true ones; returns whether they
 * differ. */
static int stiffen(equation *e, int stiff)
{
  const int opened = over_processes(e, LARGEST, e->search && e->search[OPENED]) > 0;
  if (e->search) e->search[STIFF] = opened ? stiff : 0;
  if (stiff) run(&e->again, 0, 0, 0);
  return opened;
}

/* Find the unknowns at which the residual vanishes from an initial guess. Returns the reason to
 * end, which is positive on success. */
static int find_equilibrium(equation *e, const double *guess)
{
  e->error = 0;
  if (e->border) return iterate_from(e, guess, PATIENCE_ALONG, FIRST);
  int reason = iterate_from(e, guess, e->rotations ? PATIENCE_IN_SPACE : SHORT_PATIENCE, PREDICTED);
  if (reason == STALLED || (reason == DIVERGED && e->rotations && raised_anywhere(e) != OTHER)) {
    if (reason == STALLED) restart(e, EXACT);
    else go_to(e, guess, EXACT); /* frames that turn by half a turn in a cell have no finite forces */
    reason = iterate(e, LONG_PATIENCE, 1);
  }
  if (reason > 0) return reason;
  for (int stiff = 1; stiff <= STIFFEST; ++stiff) {
    if (e->error || raised_anywhere(e) == OTHER || !stiffen(e, stiff)) return reason;
    /* Stiffer tangents approach the solution slowly; true tangents finish it. */
    go_to(e, guess, PREDICTED);
    reason = iterate(e, LONG_PATIENCE, 0);
    stiffen(e, 0);
    if (reason > 0 || reason == TOO_MANY) break;
  }
  const int slow = reason;
  if (slow != TOO_MANY && slow <= 0) return slow;
  memcpy(e->aside, e->unknowns, e->size * sizeof *e->aside);
  const int exact = iterate(e, SHORT_PATIENCE, 0);
  if (exact > 0) return exact;
  go_to(e, e->aside, PREDICTED);
  return slow;
}
