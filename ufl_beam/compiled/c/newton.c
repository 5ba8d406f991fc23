/* SPDX-License-Identifier: MIT */
/* The equation of a step as SNES asks for it, without Python; see newton.py.
 *
 * What has no loop in C is a part all the same: a function that calls Python.
 */

/* What is asked of the internal forces, which r consists of so far. */
void note_inner_forces(equation *e, const double *r)
{
  e->inner_size = norm(e->size, e->weight, r);
  if (e->inner_force) memcpy(e->inner_force, r, e->size * sizeof *r);
}

/* The residual at q; what supports carry is noted and removed. */
void residual(equation *e, const double *q, double *r)
{
  memset(r, 0, e->size * sizeof *r);
  for (int k = 0; k < e->inner; ++k) e->force[k].add(e->force[k].self, q, r);
  note_inner_forces(e, r);
  for (int k = e->inner; k < e->forces; ++k) e->force[k].add(e->force[k].self, q, r);
  for (int k = 0; k < e->held; ++k) {
    e->reactions[k] = r[e->hold[k]];
    r[e->hold[k]] = 0;
  }
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

/* All parts of the tangent at q; rows are begun shortly before cells need them. */
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

/* The tangent at q. What stands on the diagonal has the right dimension and size for what is held;
 * where material that flows freely leaves nothing, or the digits of motions that fade, what stood there
 * before does as well. */
void assemble(equation *e, const double *q)
{
  fill_tangent(e, q);
  for (int k = 0; k < e->held; ++k)
    if (isnormal(e->tangent[e->pivot[k]])) e->pivots[k] = e->tangent[e->pivot[k]];
  for (int k = 0; k < e->zeros; ++k) e->tangent[e->zero[k]] = 0;
  for (int k = 0; k < e->held; ++k) e->tangent[e->pivot[k]] = e->pivots[k];
  for (int k = 0; k < e->idle; ++k) e->tangent[e->idle_entry[k]] += e->idle_stiffness[k];
}

/* Iterations that a tangent may still cost if it is kept: making one costs as much as two. */
enum { MORE = 3 };

/* Part of the tolerance that is met by no luck, before the least number of iterations. */
static const double SURE = 1e-4;

/* Times the tolerance that are about as good, unless laws of connectors may be steep. */
static const double CLOSE = 8;

static int demands_met(const equation *e, const double *q, double scale)
{
  for (int k = 0; k < e->demands; ++k)
    if (!(e->demand[k].missed(e->demand[k].self, q, e->residual, scale, e->moved) <= e->rtol))
      return 0;
  return 1;
}

/* Whether Newton's method has arrived, goes on, or goes nowhere.
 *
 * `floor` is several times the residual that the last digits of the unknowns make.
 */
int judge(equation *e, const double *q, int iteration, double residual, double scale, double floor)
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
    const int close = residual <= CLOSE * wanted && !e->demands;
    const int stays = e->last / 2 < residual && residual <= floor && (!kept || close);
    if ((stays || residual <= floor / 80) && demands_met(e, q, scale)) return AT_ROUND_OFF;
    /* With that tangent, the residual falls by twice the last factor; works are to come out as with a
     * new one, so it must be far enough. */
    e->near = !kept && 2000 * residual * (residual / e->last) <= wanted && (close || residual > floor);
  }
  if (e->modified) {
    /* The residual goes on to fall as it did, if the tangent is kept; from step to step too. Where forces
     * fade with it, as when all loads go, it is no nearer to a part of them. */
    if (iteration > 0) e->rate = residual / e->last * fmax(1, e->last_scale / scale);
    e->last_scale = scale;
    e->near |= residual * pow(e->rate, MORE) <= wanted;
  }
  /* With the tangent of a row about a motion, one about a force would move the iterate by as many metres
   * as newtons are missing. */
  if (*e->switched) e->near = *e->switched = 0;
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

/* Before the first iterate; `like_last` says that a modified tangent may be that of the last step. A
 * checkpoint does not have that: runs with one begin each step anew, so that they go on bit for bit. */
void begin_newton(equation *e, int patience, int like_last)
{
  e->last = e->best = INFINITY;
  e->near = e->slow = e->raised = 0;
  e->patience = patience;
  if (!like_last || e->anew) e->rate = INFINITY;
}

petsc_functions petsc;

#define TRY(call) do { int error = (call); if (error) return error; } while (0)

/* -- what SNES calls --------------------------------------------------------------------------- */

int snes_function(void *snes, void *x, void *f, void *self)
{
  equation *e = self;
  const double *q;
  double *r;
  TRY(petsc.VecGetArrayRead(x, &q));
  TRY(petsc.VecGetArray(f, &r));
  residual(e, q, r);
  TRY(petsc.VecRestoreArray(f, &r));
  return petsc.VecRestoreArrayRead(x, &q);
}

/* Tell PETSc that entries of a matrix have changed. */
static int note_change(void *matrix)
{
  int64_t state;
  TRY(petsc.PetscObjectStateGet(matrix, &state));
  return petsc.PetscObjectStateSet(matrix, state + 1);
}

int snes_jacobian(void *snes, void *x, void *A, void *P, void *self)
{
  equation *e = self;
  const double *q;
  if (e->near) return 0;
  TRY(petsc.VecGetArrayRead(x, &q));
  assemble(e, q);
  TRY(note_change(P));
  return petsc.VecRestoreArrayRead(x, &q);
}

/* What becomes of an iterate q. */
static int verdict(equation *e, const double *q, int iteration)
{
  const double now = norm(e->size, e->weight, e->residual);
  if (!isfinite(now)) return DIVERGED;
  const double scale = e->loads + e->inner_size;
  const int nearly = iteration > 1 && now > e->rtol * scale;
  double floor = 0;
  if (nearly || e->demands) e->moved = fmin(largest_motion(e->size, e->weight, q), e->scene);
  if (nearly || (iteration > 1 && e->demands)) {
    find_round_off(e, q, e->space);
    floor = 8 * norm(e->size, e->weight, e->space);
  }
  const int found = judge(e, q, iteration, now, scale, floor);
  return e->raised ? DIVERGED : found;
}

int snes_test(void *snes, petsc_int iteration, double x, double s, double f, int *reason, void *self)
{
  equation *e = self;
  const double *q;
  TRY(petsc.VecGetArrayRead(e->x, &q));
  *reason = verdict(e, q, (int)iteration);
  return petsc.VecRestoreArrayRead(e->x, &q);
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

/* Newton's method with full steps, as a solver of SNES: what its own does beside that takes as long
 * as all the rest where there are few unknowns. */
int snes_newton(void *snes, void *x)
{
  equation *e;
  double *q;
  int iteration = 0, reason;
  TRY(petsc.SNESShellGetContext(snes, &e));
  TRY(petsc.VecGetArray(x, &q));
  residual(e, q, e->residual);
  while (!(reason = verdict(e, q, iteration))) {
    if (iteration == e->most) {
      reason = TOO_MANY;
      break;
    }
    const int anew = !e->near;
    if (anew) {
      int failed = 0;
      assemble(e, q);
      TRY(factor_tangent(e, &failed));
      if (failed) {
        reason = SINGULAR;
        break;
      }
    }
    TRY(solve_tangent(e, anew));
    for (int i = 0; i < e->size; ++i) q[i] -= e->change[i];
    residual(e, q, e->residual);
    ++iteration;
  }
  e->iterations = iteration, e->reason = reason;
  TRY(petsc.VecRestoreArray(x, &q));
  TRY(petsc.SNESSetIterationNumber(snes, iteration));
  return petsc.SNESSetConvergedReason(snes, reason);
}
