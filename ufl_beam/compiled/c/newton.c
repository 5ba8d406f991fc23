/* SPDX-License-Identifier: MIT */
/* The equation of a step as SNES asks for it, without Python; see newton.py.
 *
 * What has no loop in C is a part all the same: a function that calls Python.
 */

/* -- processes that share a scene -------------------------------------------------------------- */

/* Replace numbers by those of all processes. */
static void agree(const equation *e, int number, const enum agreement *how, double *values)
{
  if (e->agree) e->agree(e->handle, number, (const int *)how, values);
}

double over_processes(const equation *e, enum agreement how, double here)
{
  agree(e, 1, &how, &here);
  return here;
}

/* Norm over the scene of forces, and moments over its size, at the degrees of freedom of this process. */
static double norm_of(const equation *e, const double *forces)
{
  return over_processes(e, HYPOT, norm(e->size, 0, e->weight, forces));
}

static int exchange_ghosts(const equation *e, void *v, int mode, int way)
{
  if (!e->agree) return 0;
  const int error = petsc.VecGhostUpdateBegin(v, mode, way);
  return error ? error : petsc.VecGhostUpdateEnd(v, mode, way);
}

/* Values of a vector of PETSc that other processes own; or what this one has for them, added there. */
static int update_ghosts(const equation *e, void *v) { return exchange_ghosts(e, v, INSERT_VALUES, FORWARD); }
static int add_ghosts(const equation *e, void *v) { return exchange_ghosts(e, v, ADD_VALUES, REVERSE); }

/* What a function of a user has raised on any process, see enum raised; all know it then. */
static int raised_anywhere(equation *e) { return e->raised = (int)over_processes(e, LARGEST, e->raised); }

/* -- supports at an angle ---------------------------------------------------------------------- */

/* A vector in the axes of supports (way = 1), or from these in those of the plane (-1), in place. */
void turn_axes(int number, const turned_axes *axes, double *x, int way)
{
  for (int k = 0; k < number; ++k) {
    const turned_axes *t = axes + k;
    const double a = x[t->i], b = x[t->j], s = way * t->s;
    x[t->i] = t->c * a + s * b, x[t->j] = t->c * b - s * a;
  }
}

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

/* What is asked of the internal forces, which r consists of so far. */
static void note_inner_forces(equation *e, const double *r)
{
  e->inner_size = norm(e->size, 0, e->weight, r);
  if (e->inner_force) memcpy(e->inner_force, r, e->size * sizeof *r);
}

/* The residual r at x, which the vector f of PETSc has; what supports carry is noted and removed. */
int residual(equation *e, const double *x, double *r, void *f)
{
  const double *q = in_plane(e, x);
  memset(r, 0, e->size * sizeof *r);
  for (int k = 0; k < e->inner; ++k) e->force[k].add(e->force[k].self, q, r);
  note_inner_forces(e, r);
  for (int k = e->inner; k < e->forces; ++k) e->force[k].add(e->force[k].self, q, r);
  turn_axes(e->turned, e->axes, r, 1);
  const int error = add_ghosts(e, f);
  for (int k = 0; k < e->held; ++k) {
    e->reactions[k] = r[e->hold[k]];
    r[e->hold[k]] = 0;
  }
  return error;
}

/* Rows of the tangent with nothing in them but the product. */
static void begin_rows(const equation *e, int first, int last)
{
  const int32_t begin = e->indptr[first];
  memset(e->tangent + begin, 0, (e->indptr[last] - begin) * sizeof *e->tangent);
  if (e->product) add_rows(e->product, first, last, e->tangent);
}

/* The cells from `first` on */
static cells some_cells(const cells *c, int first)
{
  cells some = *c;
  some.number = c->number - first < SOME ? c->number - first : SOME;
  some.dofs += (size_t)first * c->of_cell, some.coordinates += (size_t)first * 4;
  some.w += (size_t)first * c->width;
  if (c->row) some.row += (size_t)first * c->rows;
  if (c->pattern) some.has += first / c->lanes;
  return some;
}

/* All parts of the tangent at q, in the axes of the plane; rows are begun shortly before cells need them. */
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

/* A tangent in the axes of supports, with what they hold held. What stands on the diagonal has the right
 * dimension and size for that; where material that flows freely leaves nothing, or the digits of motions
 * that fade, what stood there before does as well. */
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

/* The tangent at x. */
static void assemble(const equation *e, const double *x)
{
  fill_tangent(e, in_plane(e, x));
  hold_tangent(e);
  for (int k = 0; k < e->idle; ++k) e->tangent[e->idle_entry[k]] += e->idle_stiffness[k];
}

/* -- convergence ------------------------------------------------------------------------------- */

/* Part of the tolerance that is met by no luck, before the least number of iterations. */
static const double SURE = 1e-4;

/* Times the tolerance that are about as good, unless laws of connectors may be steep. */
static const double CLOSE = 8;

/* Whether laws of connectors and points are met by x and its residual, on all processes. */
static int demands_met(const equation *e, const double *x, double scale)
{
  if (!e->demanding) return 1;
  const double *q = in_plane(e, x);
  double most = 0;
  for (int k = 0; k < e->demands; ++k) {
    const double missed = e->demand[k].missed(e->demand[k].self, q, e->residual, scale, e->moved);
    if (!(missed <= most)) most = isnan(missed) ? INFINITY : missed;
  }
  return over_processes(e, LARGEST, most) <= e->rtol;
}

/* Whether Newton's method has arrived, goes on, or goes nowhere.
 *
 * `floor` is several times the residual that the last digits of the unknowns make.
 */
static int judge(equation *e, const double *q, int iteration, double residual, double scale, double floor,
                 int switched)
{
  const double wanted = e->rtol * scale;
  /* Small loads beside large ones, such as those that make columns buckle, are lost in a guess that
   * just meets the tolerance; the residual of an iterate is about the square of the one before. */
  const double enough = iteration < e->least ? SURE * wanted : wanted;
  const int met = residual > wanted || demands_met(e, q, scale);
  if (residual <= enough && met) return CONVERGED;
  const int kept = e->near;
  e->near = 0;
  if (iteration > 1) {
    /* A fraction of the last digit is luck; a few of them that Newton's method no longer halves are
     * all that can be had: it may go round between two such states for ever. With the tangent of the
     * iterate before that is no proof, but does close to what is wanted. */
    const int close = residual <= CLOSE * wanted && !e->demanding;
    const int stays = e->last / 2 < residual && residual <= floor && (!kept || close);
    if ((stays || residual <= floor / 80) && demands_met(e, q, scale)) return AT_ROUND_OFF;
    /* With that tangent, the residual falls by twice the last factor; works are to come out as with a
     * new one, so it must be far enough. */
    e->near = !kept && 2000 * residual * (residual / e->last) <= wanted && (close || residual > floor);
  }
  /* With the tangent of a row about a motion, one about a force would move the iterate by as many metres
   * as newtons are missing. */
  if (switched) e->near = *e->switched = 0;
  e->slow += 1;
  /* Where a connector has just been released, it is no measure for what follows that forces are in
   * balance, as long as its law is not met. */
  const double size = iteration > 0 || met ? residual : scale;
  if (size <= e->best / 2) e->best = size, e->slow = 0;
  e->last = residual;
  return e->slow == e->patience ? STALLED : ITERATING;
}

/* Forces that the last digits of displacements and rotations make: of the numbers that they are part of.
 * Strains are computed from them to their own relative precision, as long as rotations are small. The
 * next number has the next pattern of bits. */
void find_round_off(const equation *e, const double *q, double *forces)
{
  const double amplitude = e->moved / e->scene;
  for (int i = 0; i < e->size; ++i) {
    const double far = fabs(q[i]) + amplitude * e->lengths[i];
    union { double number; int64_t bits; } next = {far};
    next.bits += 1;
    forces[i] = e->moves[i] * (next.number - far) * e->tangent[e->diagonal[i]];
  }
}

/* Largest motion in an iterate on all processes, at most the size of the scene. */
void find_motion(equation *e, const double *x)
{
  e->moved = fmin(over_processes(e, LARGEST, largest_motion(e->size, e->weight, x)), e->scene);
}

/* Whether, and why, to stop at an iterate x with the latest residual. */
static int verdict(equation *e, const double *x, int iteration)
{
  const enum agreement how[] = {HYPOT, HYPOT, LARGEST, LARGEST};
  const double here = norm(e->size, 0, e->weight, e->residual), switched = e->demanding ? *e->switched : 0;
  double of_all[] = {here, e->inner_size, e->raised, switched};
  agree(e, 4, how, of_all);
  const double now = of_all[0], scale = e->loads + of_all[1];
  e->raised = (int)of_all[2];
  if (e->raised == OTHER || !isfinite(now)) return DIVERGED;
  const int nearly = iteration > 1 && now > e->rtol * scale;
  double floor = 0;
  if (nearly || e->demanding) find_motion(e, x);
  if (nearly || (iteration > 1 && e->demanding)) {
    find_round_off(e, x, e->space);
    floor = 8 * norm_of(e, e->space);
  }
  return judge(e, x, iteration, now, scale, floor, of_all[3] > 0);
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

/* Factors of the tangent, and what they make of the residual on the way; *failed if it is singular. */
int factor_tangent(const equation *e, int *failed)
{
  eliminate(e->chains, e->residual);
  if ((*failed = !all_finite(e->chains->left, e->chains->left_data))) return 0;
  if (e->fronts) {
    *failed = !factor_fronts(e->fronts, e->chains->left_data);
    return 0;
  }
  TRY(note_change(e->left));
  const int error = petsc.PCSetUp(e->factors);
  if (!error) return petsc.PCGetFailedReason(e->factors, failed);
  *failed = 1;
  return error == OF_LIBRARY ? 0 : error;
}

/* What Newton's method subtracts from the iterate; `reduced` says that the residual is eliminated. */
int solve_tangent(const equation *e, int reduced)
{
  if (!reduced) reduce(e->chains, e->residual);
  if (e->fronts) {
    reduce_fronts(e->fronts, e->chains->left_f);
    expand_fronts(e->fronts, e->found);
  } else TRY(petsc.PCApply(e->factors, e->left_f, e->left_x));
  expand(e->chains, e->found, e->change);
  return 0;
}

/* The change of an iteration, with a new tangent if `anew`; *failed if that is singular. */
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
    return 0;
  }
  if (anew) TRY(factor_tangent(e, failed));
  return *failed ? 0 : solve_tangent(e, anew);
}

/* -- Newton's method --------------------------------------------------------------------------- */

static int residual_at(equation *e, double *x)
{
  TRY(update_ghosts(e, e->x));
  if (e->border) e->border->arrive(e->border->handle, x);
  return residual(e, x, e->residual, e->f);
}

/* Residuals that a search may cost; part of the first work that it must come down to; its limits. */
enum { EVALUATIONS = 4 };
static const double PART = 0.5, LONGEST = 1, SHORTEST = 1e-12;

/* Work of the latest residual on the conjugates. */
static double work_of_residual(const equation *e)
{
  double sum = 0;
  for (int i = 0; i < e->owned; ++i) sum += e->residual[i] * e->conjugate[i];
  return over_processes(e, TOTAL, sum);
}

/* Go the part of the full change at which the residual does no work on it, found by secants.
 *
 * Forces that grow in an S, as in a point that yields one way or the other, send full steps from one
 * branch to the other and back for ever. Work is the only product of residuals and steps that adds forces
 * and moments, and it is the same in all units. Forces of connectors are unknowns of their own: the law
 * of a connector, in the place of its force, does work on the change of its motion. */
static int search(equation *e, double *x)
{
  TRY(update_ghosts(e, e->y));
  e->find_conjugates(e->handle, in_plane(e, x)); /* which makes room for them, and for the start */
  memcpy(e->start, x, e->size * sizeof *x);
  double before = work_of_residual(e), last = 0, way = 1;
  const double first = fabs(before);
  for (int k = 1;; ++k) {
    for (int i = 0; i < e->owned; ++i) x[i] = e->start[i] - way * e->change[i];
    TRY(residual_at(e, x));
    const double now = work_of_residual(e), slope = (now - before) / (way - last);
    if (k == EVALUATIONS || !(fabs(now) > PART * first) || slope == 0) return 0;
    double next = way - now / slope;
    if (next < SHORTEST) next = way + now / slope;
    if (!(SHORTEST <= next && next <= LONGEST)) return 0;
    before = now, last = way, way = next;
  }
}

/* Newton's method from the iterate x; why it ends is `reason`. */
static int newton(equation *e, double *x)
{
  e->iterations = 0;
  TRY(residual_at(e, x));
  for (;;) {
    if (e->monitored) TRY(petsc.SNESMonitor(e->snes, e->iterations, norm_of(e, e->residual)));
    e->reason = verdict(e, x, e->iterations);
    if (e->border && e->reason > 0 && !e->border->met(e->border->handle)) e->reason = ITERATING;
    if (e->reason) return 0;
    if (e->iterations == e->most) {
      e->reason = TOO_MANY;
      return 0;
    }
    int failed;
    TRY(find_change(e, x, !e->near, &failed));
    if (failed) {
      e->reason = SINGULAR;
      return 0;
    }
    if (e->careful) TRY(search(e, x));
    else {
      for (int i = 0; i < e->owned; ++i) x[i] -= e->change[i];
      TRY(residual_at(e, x));
    }
    ++e->iterations;
  }
}

/* -- what SNES calls --------------------------------------------------------------------------- */

/* This method as a solver of SNES: what its own does beside that takes as long as all the rest where
 * there are few unknowns. */
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

/* Local values of a vector, ghosts included, to be read or to be written. */
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
  *reason = e->reason = verdict(e, e->unknowns, e->iterations = (int)iteration);
  return 0;
}

/* -- the equilibrium of a step ------------------------------------------------------------------ */

/* Begin to iterate anew, with tangents of a kind. */
void restart(const equation *e, enum tangents kind)
{
  for (int k = 0; k < e->predictions; ++k) {
    predicted_strains *p = e->predicted[k];
    p->begins = kind != EXACT, p->stale = 1, p->exact = kind != PREDICTED;
  }
}

/* Take a guess for the unknowns. */
static int go_to(equation *e, const double *guess, enum tangents kind)
{
  double *q;
  TRY(petsc.VecGetArray(e->x, &q)); /* tells PETSc of the change */
  if (guess != e->unknowns) memcpy(e->unknowns, guess, e->size * sizeof *guess);
  TRY(petsc.VecRestoreArray(e->x, &q));
  restart(e, kind);
  return 0;
}

/* Let a vector be written again that PETSc keeps locked after a linear solution has failed. */
static void unlock(void *v)
{
  petsc_int locks = 0;
  petsc.VecLockGet(v, &locks);
  while (locks-- > 0) petsc.VecLockReadPop(v);
}

/* Iterations in a row without half the least residual that are one too many: of full steps, of steps that a
 * search shortens or stiffer tangents make, and along paths. Those that wander longer find a solution by
 * luck: the last digits of the data would decide. */
enum { SHORT_PATIENCE = 2, LONG_PATIENCE = 10, PATIENCE_ALONG = 12 };

/* Iterate from the unknowns; the reason to end is the return value. */
static int iterate(equation *e, int patience, int careful)
{
  const int by_petsc = e->monitored && !e->border && !(careful && e->searches);
  e->last = e->best = INFINITY;
  e->near = e->slow = 0;
  if (e->raised == STEP_FAILED) e->raised = NOTHING; /* at an iterate that is left */
  e->patience = patience;
  e->careful = careful && !by_petsc;
  const int error = by_petsc || !e->monitored ? petsc.SNESSolve(e->snes, 0, e->x) : newton(e, e->unknowns);
  e->total += e->iterations;
  if (error) {
    if (error != OF_LIBRARY) e->error = error; /* KLU stops PETSc where it finds no pivot */
    e->reason = SINGULAR;
  } else if (by_petsc) {
    petsc.SNESGetConvergedReason(e->snes, &e->reason);
    e->error = update_ghosts(e, e->x); /* PETSc copies what a process owns */
  }
  if (e->reason <= 0 && by_petsc) unlock(e->f);
  return e->reason;
}

/* The same from a guess, with idle motions held if the tangent is singular; without any if that does not
 * help. */
static int iterate_from(equation *e, const double *guess, int patience, enum tangents kind)
{
  const double start = e->border ? *e->border->t : 0;
  enum { FRESH, HELD, FREE } motions = FRESH;
  for (;;) {
    if (e->border) *e->border->t = start;
    go_to(e, guess, kind);
    const int reason = iterate(e, patience, 0);
    if (motions == FREE || reason > 0 || e->error || raised_anywhere(e) == OTHER) return reason;
    if (reason == SINGULAR && e->find_idle(e->handle)) motions = HELD;
    else if ((reason == SINGULAR || motions == HELD) && e->forget_idle(e->handle)) motions = FREE;
    else return reason;
  }
}

/* Stiffer tangents of points that do not open, or the true ones again; whether they differ. */
static int stiffen(equation *e, int stiff)
{
  const int opened = over_processes(e, LARGEST, e->search && e->search[OPENED]) > 0;
  if (e->search) e->search[STIFF] = stiff && opened;
  for (int k = 0; stiff && k < e->agains; ++k) e->again[k].run(e->again[k].self);
  return opened;
}

/* Find the unknowns at which the residual vanishes from a guess; the reason to end is the return value,
 * positive if they are found. */
static int find_equilibrium(equation *e, const double *guess)
{
  e->error = 0;
  if (e->border) return iterate_from(e, guess, PATIENCE_ALONG, FIRST);
  int reason = iterate_from(e, guess, SHORT_PATIENCE, PREDICTED);
  if (reason == STALLED) {
    restart(e, EXACT);
    reason = iterate(e, LONG_PATIENCE, 1);
  }
  if (reason > 0 || e->error || raised_anywhere(e) == OTHER || !stiffen(e, 1)) return reason;
  /* Stiffer tangents come near, but slowly; then true ones. */
  go_to(e, guess, PREDICTED);
  const int slow = iterate(e, LONG_PATIENCE, 0);
  stiffen(e, 0);
  if (slow != TOO_MANY && slow <= 0) return slow;
  memcpy(e->aside, e->unknowns, e->size * sizeof *e->aside);
  const int exact = iterate(e, SHORT_PATIENCE, 0);
  if (exact > 0) return exact;
  go_to(e, e->aside, PREDICTED);
  return slow;
}
