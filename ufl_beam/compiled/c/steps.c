/* SPDX-License-Identifier: MIT */
/* A step from its initial guess to its acceptance, its substeps if it fails, and many steps without
 * Python; see stepper.py.
 *
 * A step that fails leaves the state unchanged and is divided into substeps.
 */
#include <complex.h>

/* -- prediction of the end of a step, from which Newton's method starts; see stepper.py ---------------- */

/* Root mean square of motions up to which a step resolves them, relative to the scene's size. */
static const double FAR = 1. / 8;

/* Whether a step is as long as the last one. The tolerance is far above round-off, because
 * differences of times have fewer digits than the times. */
static int as_last(const prediction *p, double dt)
{
  return fabs(dt - p->dt) <= 1e-6 * fabs(dt);
}

/* Extrapolate from q at the velocity of the last step. After steps of equal length, add the
 * fraction of its acceleration that is expected to repeat. */
void predict(const prediction *p, double dt, const double *q, double *out)
{
  const double ratio = dt / p->dt, *before = p->q_before, *second = p->second;
  const double again = p->equal > 2 && as_last(p, dt) ? p->repeated : 0;
  if (again > 0)
    for (int i = 0; i < p->size; ++i) out[i] = q[i] + ratio * (q[i] - before[i]) + again * second[i];
  else
    for (int i = 0; i < p->size; ++i) out[i] = q[i] + ratio * (q[i] - before[i]);
}

/* Guess the end of a stage at the time t by the polynomial through the last ends of stages, between
 * which it may lie. */
static void predict_stage(const prediction *p, double t, double *out)
{
  const int number = POINTS_OF_GUESS;
  memset(out, 0, p->size * sizeof *out);
  for (int k = 0; k < number; ++k) {
    const double *q = p->past + (size_t)p->place[k] * p->size;
    double weight = 1;
    for (int j = 0; j < number; ++j)
      if (j != k) weight *= (t - p->time[j]) / (p->time[k] - p->time[j]);
    for (int i = 0; i < p->size; ++i) out[i] += weight * q[i];
  }
}

/* Enter the end q of a stage at the time t. */
static void enter_stage(prediction *p, double t, const double *q)
{
  const int last = p->known < MOST_KNOWN_ENDS ? p->known++ : MOST_KNOWN_ENDS - 1, free = p->place[last];
  for (int k = last; k > 0; --k) p->place[k] = p->place[k - 1], p->time[k] = p->time[k - 1];
  p->place[0] = free, p->time[0] = t;
  memcpy(p->past + (size_t)free * p->size, q, p->size * sizeof *q);
}

/* Forget the last ends of stages. */
static void forget_ends(prediction *p, int number)
{
  for (; number > 0 && p->known > 0; --number, --p->known) {
    const int free = p->place[0];
    for (int k = 1; k < MOST_KNOWN_ENDS; ++k) p->place[k - 1] = p->place[k], p->time[k - 1] = p->time[k];
    p->place[MOST_KNOWN_ENDS - 1] = free;
  }
}

/* Enter a step from q to q1; products are sums over the degrees of freedom that this process
 * owns. */
void enter_step(prediction *p, double dt, const double *q, const double *q1)
{
  p->equal = as_last(p, dt) ? p->equal + (p->equal < 3) : 1;
  p->dt = dt;
  if (!p->second) return;
  double both = 0, now = 0, step = 0;
  const double of_size = 1 / (p->scene * p->scene);
#pragma omp simd reduction(+ : both, now, step)
  for (int i = 0; i < p->size; ++i) {
    const double change = q1[i] - q[i], second = change - (q[i] - p->q_before[i]);
    const double w = p->weight[i], square = w == 1 ? of_size : w > 0; /* of displacements; of rotations */
    both += square * second * p->second[i], now += square * second * second;
    step += square * change * change;
    p->second[i] = second;
  }
  both /= p->unknowns, now /= p->unknowns, step /= p->unknowns;
  p->before = p->now, p->now = now, p->both = both, p->step = step;
}

/* Fraction of the last second difference that is expected to repeat, from the products over all
 * processes. It is zero if steps do not resolve the motion: second differences are not small
 * relative to steps, or a step is long relative to the scene. */
void compare_differences(prediction *p)
{
  const double larger = fmax(p->now, p->before);
  const int resolved = 4 * larger < p->step && p->step < FAR * FAR;
  p->repeated = resolved && p->both > 0 ? p->both / larger : 0;
}

/* -- the step ------------------------------------------------------------------------------------ */

/* Set the step from the present time to t1, a substep of one to `end`. */
static int set_step(time_loop *m, double t1, double end)
{
  time_step *step = &m->step;
  const double t0 = m->t, dt = t1 - t0;
  step->t0 = t0, step->t1 = t1, step->dt = dt, step->at = m->at;
  step->q0 = m->q, step->q_before = m->prediction->q_before, step->ratio = dt / m->prediction->dt;
  step->fraction = m->proportional ? dt / (end - t0) : 1;
  step->load_time = m->proportional ? end : (1 - m->load_weight) * t0 + m->load_weight * t1;
  step->motion_time = m->proportional ? end : t1;
  if (m->applies) step->load_time = step->motion_time = m->begin_of_run;
  return !m->rates || find_numbers(m->rates, dt);
}

/* Begin the step in all terms; returns 0 if a function of a user has raised an exception. */
static int begin_terms(time_loop *m)
{
  run(&m->begin, &m->step, 0, 0);
  return raised_anywhere(m->equation) == NOTHING;
}

/* Largest prescribed rotation in a step in space, where a rotation about an axis is 2 tan(angle / 2), or in statics
 * 4 tan(angle / 4). */
static const double LARGEST_TURN = 2.356;

/* Largest length of a conformal rotation vector that is extrapolated: of a longer one, whole turns are unknown. */
static const double FARTHEST = 2;

/* Initial guess of the end of the step in the axes of supports: extrapolation of the last steps,
 * and the prescribed motions of supports. Returns 0 if a support in space turns too far; `turn` is minus its angle. */
static int guess(time_loop *m)
{
  const moving_supports *p = m->supports;
  const equation *e = m->equation;
  const double *q = m->q;
  double far = 0;
  for (int k = 0; k < e->rotations; ++k)
    far = fmax(far, fabs(q[e->rotation[k]] - m->prediction->q_before[e->rotation[k]]));
  if (e->rotations) far = over_processes(e, LARGEST, far);
  if (m->prediction->known >= POINTS_OF_GUESS) predict_stage(m->prediction, m->step.t1, m->guess);
  else if (far > FARTHEST) memcpy(m->guess, q, m->size * sizeof *q);
  else predict(m->prediction, m->step.dt, q, m->guess);
  turn_axes(e->turned, e->axes, m->guess, 1);
  for (int k = 0; k < p->fixed; ++k)
    if (fabs(m->guess[p->fix[k]]) < p->near) m->guess[p->fix[k]] = 0;
  if ((p->moving || p->hinges) && e->turned) {
    memcpy(e->plane, q, m->size * sizeof *q);
    turn_axes(e->turned, e->axes, e->plane, 1);
    q = e->plane;
  }
  const double *angle = p->angle;
  double turn = 0;
  for (int k = 0; k < p->moving; ++k) {
    const int i = p->dof[k], turns = k >= p->moving - p->driven;
    const double from = turns ? *angle++ : q[i];
    double change = m->step.fraction * (value_at(p->motion + k, m->step.motion_time) - from);
    if (turns) turn = fmax(turn, fabs(change)), change = p->at_end ? 4 * tan(change / 4) : 2 * tan(change / 2);
    m->guess[i] = q[i] + change;
  }
  for (int k = 0; k < p->hinges; ++k)
    for (int j = 0; j < 2; ++j) {
      const int i = p->hold[p->hinge[k].across[j]];
      m->guess[i] = q[i];
    }
  if (m->axes == 3) turn = over_processes(e, LARGEST, turn), m->turn = -turn;
  return turn <= LARGEST_TURN;
}

/* -- places that open: see material_points.py ------------------------------------------------------------ */

/* Held places open in rounds: first places with the largest excess over their limit, then places
 * above the fraction FALL of it, and so on. So the number of solutions stays small if many places
 * open in a step. Excesses that differ by less than TIE count as equal. */
static const double FALL = 0.7, TIE = 1e-9;

static double largest_excess(const time_loop *m)
{
  double most = 0;
  for (int k = 0; k < m->places; ++k) {
    const element_block *b = m->place[k];
    if (b->inner) most = fmax(most, *b->inner->over);
    else for (int i = 0; i < b->elements; ++i) most = fmax(most, b->excess[i]);
  }
  return most;
}

/* Let held places open whose excess is at least `least`. */
static void open_places(time_loop *m, double least)
{
  for (int k = 0; k < m->places; ++k) {
    const element_block *b = m->place[k];
    if (b->sections) b->sections->latest[0] = NAN;
    if (b->inner) allow_opening(b->inner, least);
    else for (int i = 0; i < b->elements; ++i) b->free[i] |= b->excess[i] > 0 && b->excess[i] >= least;
  }
}

/* End a search: close the released places again until the step is accepted. */
static void end_search(time_loop *m, int opened)
{
  memset(m->equation->search, 0, SEARCH_FLAGS * sizeof(int32_t));
  for (int k = 0; opened && k < m->places; ++k) {
    const element_block *b = m->place[k];
    const points *p = b->inner;
    for (int i = 0; p && i < p->cells * p->of_cell; ++i)
      if (p->w[i * p->width + FLOWS] == MAY_OPEN) p->w[i * p->width + FLOWS] = CLOSED;
    if (!p) memset(b->free, 0, b->elements * sizeof *b->free);
  }
}

/* Find the end of the step from the initial guess. With `hold`, places that do not flow are held
 * closed, except those that must open. */
static int solve(time_loop *m, int hold)
{
  equation *e = m->equation;
  const double t = e->border ? *e->border->t : 0;
  if (e->rotations) memcpy(e->base, m->q, m->size * sizeof *e->base);
  find_size_of_loads(e);
  if (!m->opens) return find_equilibrium(e, m->guess) > 0;
  int opened = 0;
  if (hold) {
    memset(e->search, 0, SEARCH_FLAGS * sizeof *e->search);
    e->search[HOLD] = 1;
    int found = find_equilibrium(e, m->guess) > 0;
    while (found) {
      const double excess = e->search[OVER] || e->agree ? over_processes(e, LARGEST, largest_excess(m)) : 0;
      if (excess == 0) break;
      open_places(m, pow(FALL, opened++) * excess - TIE);
      memcpy(m->found, e->unknowns, m->size * sizeof *m->found);
      found = find_equilibrium(e, m->found) > 0;
    }
    const int over = over_processes(e, LARGEST, e->search[OVER]) > 0;
    end_search(m, opened);
    if (found || !over || e->raised == OTHER) return found;
    if (!begin_terms(m)) return 0;
    if (e->border) *e->border->t = t;
  }
  return find_equilibrium(e, m->guess) > 0;
}

/* -- whether a step can be trusted ------------------------------------------------------------------ */

static int fails(time_loop *m, enum failure why)
{
  m->failure = why;
  return 0;
}

/* Beams turn rigidly if the rotations of their nodes differ by at most this fraction. */
static const double BENT = 1. / 50;

/* Largest rotation of a part that the step from q0 to q1 turns without strain. A rod is a vector. */
static double largest_rigid_turn(const rigid_parts *p, const double *q0, const double *q1)
{
  double turn = 0;
  for (int g = 0, k = 0; g < p->members; ++g) {
    double least = INFINITY, most = -INFINITY;
    for (; k < p->end[g]; ++k) {
      const double x = q1[p->rotation[k]] - q0[p->rotation[k]];
      least = fmin(least, x), most = fmax(most, x);
    }
    const double size = fmax(fabs(least), fabs(most));
    if (most - least <= BENT * size) turn = fmax(turn, size);
  }
  for (int g = 0; g < p->rods; ++g) {
    const int32_t *dof = p->dof + 6 * g;
    const double *arms = p->geometry + 6 * g, *q[] = {q0, q1};
    double complex rod[2];
    for (int i = 0; i < 2; ++i) {
      rod[i] = arms[4] + I * arms[5];
      for (int k = 0; k < 2; ++k)
        rod[i] += (2 * k - 1) * (q[i][dof[k]] + I * q[i][dof[2 + k]]
          + (arms[2 * k] + I * arms[2 * k + 1]) * (cexp(I * q[i][dof[4 + k]]) - 1));
    }
    turn = fmax(turn, fabs(carg(rod[1] * conj(rod[0]))));
  }
  return turn;
}

/* In statics in space: let moments do work on the rotation vectors of the step, and turn the moments of internal forces
 * into axes of the nodes at the end of the step. */
static void turn_with_nodes(time_loop *m)
{
  equation *e = m->equation;
  if (e->border || e->monitored) find_turning(e, e->unknowns);
  for (int k = 0; k < e->rotations; k += 3) {
    const int32_t *i = e->rotation + k;
    const double s[] = {m->s[i[0]], m->s[i[1]], m->s[i[2]]};
    double p[4], M[4] = {0}, product[4], c = 1;
    take_half(s, p);
    for (int j = 1; j < 4; ++j) c += p[j] * p[j], m->s[i[j - 1]] = e->turning[i[j - 1]];
    if (!e->inner_force) continue;
    const double conjugate[] = {1, -p[1], -p[2], -p[3]};
    for (int j = 0; j < 3; ++j) M[1 + j] = e->inner_force[i[j]] / (c * c);
    for (int half = 0; half < 2; ++half) multiply_turns(conjugate, M, product), multiply_turns(product, p, M);
    for (int j = 0; j < 3; ++j) e->inner_force[i[j]] = M[1 + j];
  }
}

/* Compute the end of the step in the axes of the plane and the step of the nodes; check that no
 * node and no rigid part rotates further than allowed. */
static int measure(time_loop *m)
{
  equation *e = m->equation;
  const double *v = m->turns_from_velocities ? m->rates->rate[1] : 0;
  double turn = 0;
  if (e->turned) {
    memcpy(m->x, e->unknowns, m->size * sizeof *m->x);
    turn_axes(e->turned, e->axes, m->x, -1);
  }
  for (int i = 0; i < m->size; ++i) m->s[i] = m->x[i] - m->q[i];
  for (int i = 0; e->low && i < m->size; ++i) m->s[i] += e->low[i];
  if (e->rotations) turn_with_nodes(m);
  for (int k = 0; k < m->rotations; k += m->axes) {
    double square = 0; /* of a vector in space */
    for (int j = 0; j < m->axes; ++j) {
      const int i = m->rotation[k + j];
      const double x = v ? m->s[i] - m->step.dt * v[i] : m->s[i];
      square += x * x;
    }
    turn = fmax(turn, square);
  }
  turn = sqrt(turn);
  m->turn = over_processes(e, LARGEST, turn);
  if (m->applies && m->turn > m->applying_turn && m->short_part * m->step.dt > m->applied_by - m->begin_of_run)
    return fails(m, APPLIED_TOO_FAST);
  if (!(m->turn <= m->largest_turn)) return fails(m, TURNS_TOO_FAR);
  if (m->parts) {
    m->parts->turn = over_processes(e, LARGEST, largest_rigid_turn(m->parts, m->q, m->x));
    if (!(m->parts->turn <= m->parts->largest_turn)) return fails(m, PART_TURNS_TOO_FAR);
  }
  for (int k = 0; k < m->half_tangents; ++k) {
    const int i = m->half_tangent[k];
    m->s[i] = 2 * tan(m->s[i] / 2);
  }
  for (int k = 0; k < m->multipliers; ++k) m->s[m->multiplier[k]] = 0;
  return 1;
}

/* Whether the internal forces grow faster and faster along the straight line of a static step to `guess`. Between stable
 * states before and after a leap they fall. The force of a straight rope is the third power of its sag, so that works do
 * not tell, however short the step is. */
static int stiffens(time_loop *m)
{
  equation *e = m->equation;
  int grows = 1;
  double growth = 0, last = over_processes(e, TOTAL, work_in_step(m->size, 0, 1, m->path->force, m->path->force, m->s));
  memcpy(m->guess, m->x, m->size * sizeof *m->x);
  for (int k = 1; grows && k <= 4; ++k) { /* ends at the end of the step, whose forces remain */
    for (int i = 0; i < m->size; ++i)
      e->unknowns[i] = k < 4 ? m->q[i] + k / 4. * (m->guess[i] - m->q[i]) : m->guess[i];
    turn_axes(e->turned, e->axes, e->unknowns, 1);
    residual_at(e, e->unknowns);
    const double now = over_processes(e, TOTAL, work_in_step(m->size, 0, 0, e->inner_force, e->inner_force, m->s));
    grows = now - last >= growth && raised_anywhere(e) == NOTHING;
    growth = now - last, last = now;
  }
  return grows;
}

/* Check that a static step has followed its path: no node moves as a mechanism does, the work of
 * internal forces equals the energy stored and dissipated, see step_equation.py, and loads do work on
 * the motion by their growth, as in stable states of elastic scenes with dead loads only. */
static int followed(time_loop *m)
{
  static_path *p = m->path;
  equation *e = m->equation;
  energy_change sum = {0};
  double far = 0, through = 0, round_off = 0, second = 0;
  for (int i = 0; i < m->size; ++i)
    if (!(fabs(m->s[i]) * p->per_far[i] <= far)) far = fabs(m->s[i]) * p->per_far[i];
  p->moves = over_processes(e, LARGEST, far);
  if (!(p->moves <= p->far)) return fails(m, LEAVES_MECHANISM);
  if (isinf(p->slack)) return 1;
  for (int k = 0; k < p->terms; ++k) p->change[k].of(p->change[k].self, m->x, &sum);
  const double work = work_in_step(m->size, 0, p->weight_of_before, p->force, e->inner_force, m->s);
  find_motion(e, e->unknowns);
  find_round_off(e, e->unknowns, e->space);
  for (int i = 0; i < e->owned; ++i) round_off += fabs(e->space[i] * m->s[i]);
  for (int i = 0; i < m->size; ++i) second += (e->inner_force[i] - p->force[i]) * m->s[i];
  for (int k = 0; k < p->accounts; ++k)
    for (int i = 0; i < p->entries[k]; ++i) through += fabs(p->account[k][i]);
  enum { OF_FORCES, BEAMS, CONNECTORS, EFFORT, ROUND_OFF, THROUGH, SECOND, INNER, MOVES, SUMS };
  const enum agreement how[SUMS] = {TOTAL, TOTAL, TOTAL, TOTAL, TOTAL, TOTAL, TOTAL, HYPOT, HYPOT};
  const double moves = norm(e->owned, 0, p->per_far, m->s);
  double of[SUMS] = {work, sum.in_beams, sum.in_connectors, sum.effort, round_off, through, second, e->inner_size, moves};
  agree(e, SUMS, how, of);
  p->work = of[OF_FORCES];
  p->stored = of[BEAMS] + of[CONNECTORS];
  /* A motor that stretches a spring does the work that the spring takes; their sum is no measure.
   * Works of connectors are summed one by one, so that the size does not depend on the number of
   * processes. */
  const double size = fabs(p->work) + fabs(of[BEAMS]) + of[EFFORT];
  /* Work of the residual that Newton's method leaves, and of forces on the violation of constraints,
   * which missed_by_block limits to 1 % of its tolerance. */
  const double left = e->rtol * (e->loads + of[INNER]) * (e->scene * of[MOVES] + 0.01 * e->moved);
  const double slack = p->slack * size + left + of[ROUND_OFF] + DBL_MIN;
  /* A contact that closes shortly before the end of a step has a force at the end, but little energy.
   * In shorter steps that energy vanishes with the square of the step, and the energy of a leap does
   * not. */
  const int elastic = of[EFFORT] + fabs(of[CONNECTORS]) <= p->slack * fabs(of[BEAMS]);
  const int leaps = elastic && p->dead && !e->border && of[SECOND] < -(left + of[ROUND_OFF]);
  if (!leaps && fabs(p->work - p->stored) <= slack + p->kink * (of[THROUGH] + p->rejected)) return 1;
  /* Between both ends the forces of connectors are not those of their laws. */
  const int one_branch = !m->opens && !e->border && over_processes(e, LARGEST, e->again.number) == 0;
  if (!leaps && one_branch && elastic && stiffens(m))
    return !e->rotations || measure(m); /* for moments in axes of the nodes at the end */
  if (p->rejected == 0) p->rejected = size;
  return fails(m, LEAPS);
}

/* Solve a step that its terms have begun from the initial guess; returns whether its end is
 * accepted. */
static int solve_step(time_loop *m, int hold)
{
  equation *e = m->equation;
  int admitted = 1;
  if (!solve(m, hold))
    return fails(m, raised_anywhere(e) == OTHER ? RAISED : NO_EQUILIBRIUM);
  if (!measure(m)) return 0;
  for (int k = 0; k < m->admissions; ++k) admitted &= m->admission[k].of(m->admission[k].self, m->x);
  if (m->checks_laws && over_processes(e, LARGEST, !admitted) > 0) return fails(m, GIVES_ENERGY);
  return !m->path || followed(m);
}

/* Begin a step to t1, a substep of one to `end`, and solve it from its initial guess. */
static int solve_to(time_loop *m, double t1, double end)
{
  if (set_step(m, t1, end)) {
    run(&m->begin, &m->step, 0, 0);
    const int turns = guess(m);
    if (raised_anywhere(m->equation) == NOTHING) return turns ? solve_step(m, 1) : fails(m, TURNS_TOO_FAR);
  }
  return fails(m, RAISED);
}

/* Moments of hinges in axes of the node at the end of the step; the unknowns are in axes at its begin. */
static void turn_moments(const moving_supports *p, double *s)
{
  for (int k = 0; k < p->hinges; ++k) {
    const hinge_support *h = p->hinge + k;
    const double angle = p->at_end ? s[h->axis] : 2 * atan(s[h->axis] / 2), c = cos(angle), y = sin(angle);
    const double M = p->reactions[h->across[0]];
    double *N = p->reactions + h->across[1];
    p->reactions[h->across[0]] = c * M + y * *N, *N = c * *N - y * M;
    p->angle[k] += angle;
  }
}

static void accept_supports(time_loop *m)
{
  const moving_supports *p = m->supports;
  const double a = p->weight_of_before;
  turn_axes(m->equation->turned, m->equation->axes, m->s, 1);
  turn_moments(p, m->s);
  if (p->moving)
    for (int k = 0; k < p->held; ++k)
      if (p->hold[k] < m->equation->owned)
        *p->work += (a * p->before[k] + (1 - a) * p->reactions[k]) * m->s[p->hold[k]];
  memcpy(p->before, p->reactions, p->held * sizeof *p->before);
}

/* Accept the end of a step, or of a stage of it, as the state of all terms. Returns 0 if a function
 * of a user has raised an exception. The step is accepted nevertheless, because some terms have
 * accepted it already. */
static int accept_end(time_loop *m)
{
  equation *e = m->equation;
  prediction *p = m->prediction;
  run(&m->accept, &m->step, m->x, m->s);
  if (m->path) {
    memcpy(m->path->force, e->inner_force, m->size * sizeof *m->path->force);
    m->path->rejected = 0;
  }
  accept_cell_forces(m->cell_forces);
  accept_supports(m);
  memset(m->state, 0, m->states * sizeof *m->state);
  run(&m->add_state, &m->step, m->x, m->s);
  enter_step(p, m->step.dt, m->q, m->x);
  if (m->rates) {
    const enum agreement how[] = {TOTAL, TOTAL, TOTAL};
    double products[] = {p->both, p->now, p->step};
    agree(e, 3, how, products);
    p->both = products[0], p->now = products[1], p->step = products[2];
  }
  compare_differences(p);
  double *spare = p->q_before;
  p->q_before = m->q, m->q = spare;
  memcpy(m->q, m->x, m->size * sizeof *m->q);
  m->t = m->step.t1;
  m->failure = SUCCEEDS;
  return raised_anywhere(e) == NOTHING || fails(m, RAISED);
}

/* -- steps of several stages ---------------------------------------------------------------------- */

/* Exchange the multipliers of two configurations. */
static void exchange_multipliers(const time_loop *m, double *a, double *b)
{
  for (int k = 0; k < m->multipliers; ++k) {
    const int i = m->multiplier[k];
    const double value = a[i];
    a[i] = b[i], b[i] = value;
  }
}

/* Take back the accepted stages of a step that is not accepted. A step of such a scheme is the same
 * in both directions of time, so the beginning of a stage, which is known, is its end in a stage
 * that goes back. All terms accept this stage; no equation is solved. Multipliers are forces of the
 * stage, found with its end: the stage that goes back has the same. Its derivatives undo the
 * derivatives of the stage, too. */
void take_back(time_loop *m)
{
  equation *e = m->equation;
  const int raised = e->raised, error = e->error;
  int failure = m->failure;
  if (!m->taken) return;
  forget_ends(m->prediction, m->taken);
  e->raised = NOTHING;
  for (; m->taken > 0; --m->taken) {
    const int k = m->taken - 1;
    double *begun = m->begun + (size_t)k * m->size;
    set_step(m, m->stage_begin[k], m->stage_begin[k]);
    exchange_multipliers(m, begun, m->q);
    run(&m->begin, &m->step, 0, 0);
    go_to(e, begun, EXACT);
    residual_at(e, e->unknowns);
    measure(m);
    if (m->derivatives && failure != NO_DERIVATIVE && !differentiate_step(m->derivatives, m, 0)) failure = NO_DERIVATIVE;
    accept_end(m);
    exchange_multipliers(m, m->q, m->prediction->q_before);
  }
  e->raised = raised, e->error = error, m->failure = failure;
}

/* Differentiate the solved step or stage before it is accepted, if that is asked for; see
 * differentiate_step on an `initial` one. */
static int differentiate_or_record(time_loop *m, int initial)
{
  if (m->derivatives && !differentiate_step(m->derivatives, m, initial)) return fails(m, NO_DERIVATIVE);
  return !m->adjoint || record_step(m->adjoint, m, initial) || fails(m, NO_DERIVATIVE);
}

/* Take all stages of the step to t1 but the last one, in which the state of the terms goes on. */
static int take_stages(time_loop *m, double t1)
{
  const double begin = m->t;
  if (!m->prediction->known) enter_stage(m->prediction, m->t, m->q);
  while (m->taken + 1 < m->stages) {
    double *begun = m->begun + (size_t)m->taken * m->size;
    if (!solve_to(m, begin + m->stage[m->taken] * (t1 - begin), t1) || !differentiate_or_record(m, 0)) return 0;
    memcpy(begun, m->q, m->size * sizeof *begun);
    turn_axes(m->equation->turned, m->equation->axes, begun, 1);
    m->stage_begin[m->taken++] = m->t;
    if (!accept_end(m)) return 0;
    enter_stage(m->prediction, m->t, m->q);
  }
  return 1;
}

/* Fraction of the first step after which the acceleration is taken as the initial one. Shorter
 * trial steps come closer to it, but amplify velocities of supports that do not fit the initial
 * velocities. */
static const double FIRST_TRIAL = 1. / 16;

/* Let velocities meet prescribed rates that have jumped up to the beginning of a step to t1, a substep of one
 * to `end`, and take further rates of the scheme from a trial step. */
static int find_rates(time_loop *m, double t1, double end)
{
  if (m->meet_jumps && m->t + 1e-9 * (t1 - m->t) >= m->next_jump) {
    m->next_jump = m->meet_jumps(m->impacts, t1);
    if (raised_anywhere(m->equation) != NOTHING) return fails(m, RAISED);
  }
  if (!m->rates || !m->prepare || m->rates->ready) return 1;
  if (!solve_to(m, m->t + FIRST_TRIAL * (end - m->t), end) || !differentiate_or_record(m, 1)) return 0;
  m->prepare(m->handle);
  return 1;
}

/* Solve the step to t1, a substep of one to `end`; the state changes only if it is accepted, except for
 * velocities that rates contradict. */
int attempt_step(time_loop *m, double t1, double end)
{
  m->equation->raised = NOTHING;
  take_back(m); /* an attempt that was not accepted */
  if (!find_rates(m, t1, t1)) return 0;
  if (m->stages <= 1) return solve_to(m, t1, end);
  if (take_stages(m, t1) && solve_to(m, t1, end)) return 1;
  if (m->taken && m->equation->raised == NOTHING && m->adjoint) fails(m, NO_DERIVATIVE); /* the record has the stages */
  take_back(m);
  return 0;
}

/* Solve a step of a path that Python has set. */
int solve_begun_step(time_loop *m, int hold)
{
  m->equation->raised = NOTHING;
  return begin_terms(m) ? solve_step(m, hold) : fails(m, RAISED);
}

/* Count successive changes of direction of the watched forces, by steps or samples. */
static void watch_forces(force_watch *w, const time_loop *m)
{
  for (int i = 0; i < w->number; ++i) {
    const double force = w->value[i] ? *w->value[i] : m->q[w->dof[i]];
    if (w->value[i] && !*w->fresh[i]) continue;
    if (w->value[i]) *w->fresh[i] = 0;
    const double change = force - w->force[i];
    w->largest[i] = fmax(w->largest[i], fabs(force));
    const int large = fabs(change) >= w->large * w->largest[i];
    const int moves = fabs(*w->rate[i]) * m->step.dt >= w->moved * w->length[i];
    w->count[i] = large && moves && change * w->change[i] < 0 ? w->count[i] + 1 : 0;
    w->force[i] = force, w->change[i] = change;
    if (w->count[i] != w->most || w->told[i] == w->told[i]) continue;
    w->told[i] = m->t;
    w->tells = 1;
  }
}

/* Subtract whole numbers from unknowns of rotations in space, whose changes alone have a meaning. Otherwise they would
 * grow with the turns, and their steps would lose digits. At least 1 remains as the size of round-off of frames. */
static void shorten_rotations(time_loop *m)
{
  prediction *p = m->prediction;
  for (int k = 0; k < m->rotations; ++k) {
    const int i = m->rotation[k];
    const double whole = trunc(m->q[i]), away = fabs(whole) < 2 ? 0 : whole - copysign(1, whole);
    m->q[i] -= away, p->q_before[i] -= away;
    for (int j = 0; j < p->known; ++j) p->past[(size_t)p->place[j] * m->size + i] -= away;
  }
}

/* Accept the end of the step as the state, and show it to watches; see accept_end. */
int accept_step(time_loop *m)
{
  const int accepted = accept_end(m);
  m->taken = 0;
  if (m->stages > 1) enter_stage(m->prediction, m->t, m->q);
  if (m->axes == 3 && m->rates && !m->adds_up) shorten_rotations(m);
  ++m->substeps;
  if (m->forces && !isinf(m->step.dt)) watch_forces(m->forces, m);
  for (int k = 0; k < m->watches; ++k) watch_step(m->watch[k], 1, m->t, m->prediction->q_before, m->q);
  return accepted;
}

/* Go to a time in one step or, if that fails, in substeps; returns whether the time is reached. */
int step_or_subdivide(time_loop *m, double end)
{
  const double begin = m->t;
  double rejected = 0; /* of the whole step */
  for (int done = 0, some = MOST_SUBSTEPS; done < MOST_SUBSTEPS;) {
    if (m->path) m->path->rejected = rejected;
    const double t1 = done + some == MOST_SUBSTEPS ? end : begin + (end - begin) * (done + some) / MOST_SUBSTEPS;
    m->failed_end = t1;
    const int solved = attempt_step(m, t1, end);
    if (m->path) rejected = m->path->rejected;
    if (solved) {
      if (!differentiate_or_record(m, 0) || !accept_step(m)) return 0;
      if (m->derivatives && (t1 != end || m->applies)) keep_substep(m->derivatives, m, end);
      done += some;
      /* Double the substep at the times where a larger one would begin. */
      if (done % (2 * some) == 0 && some < MOST_SUBSTEPS) some *= 2;
    } else {
      if (some == 1 || m->equation->raised == OTHER || m->equation->error || m->failure == NO_DERIVATIVE) return 0;
      some /= 2;
    }
  }
  return 1;
}

static double seconds_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Take steps to the times `ends` until one fails, or ends more than `seconds` after the call;
 * returns the number of steps. If `keeps`, their states are written into `rows`. A step that was
 * divided is the last one, as its last substep does not begin at the end of the previous step. */
int take_steps(time_loop *m, int steps, const double *ends, double seconds, int keeps, double *rows)
{
  const double end = steps > 1 ? seconds_now() + seconds : 0;
  m->failure = SUCCEEDS;
  m->substeps = 0;
  for (int k = 0; k < steps; ++k) {
    const int before = m->substeps;
    do {
      const double stop = m->stop ? fmin(m->stop(m->stops, ends[k]), ends[k]) : ends[k];
      if (!step_or_subdivide(m, stop)) return k;
    } while (m->t != ends[k]);
    if (keeps) keep_state(m, rows + (size_t)k * m->width);
    if (m->derivatives) keep_derivatives(m->derivatives, m);
    m->substeps_of_last = m->substeps - before;
    if (m->substeps_of_last > 1 || (steps > 1 && seconds_now() > end)) return k + 1;
  }
  return steps;
}

/* Check and accept given configurations at the ends of steps or substeps, see keep_substep, without solutions,
 * and write the states into `rows`. The configurations are in the axes of the plane. Returns the number of steps. */
int repeat_steps(time_loop *m, int number, const double *steps, const double *configurations, double *rows)
{
  equation *e = m->equation;
  for (int k = 0; k < number; ++k) {
    const double t1 = steps[3 * k], end = steps[3 * k + 1];
    m->applies = steps[3 * k + 2] != 0;
    e->raised = NOTHING;
    if (!find_rates(m, t1, end) || !set_step(m, t1, end) || !begin_terms(m)) return k;
    memcpy(e->unknowns, configurations + (size_t)k * m->size, m->size * sizeof *e->unknowns);
    turn_axes(e->turned, e->axes, e->unknowns, 1);
    if (e->rotations) memcpy(e->base, m->q, m->size * sizeof *e->base);
    find_turning(e, e->unknowns);
    restart(e, EXACT);
    find_size_of_loads(e);
    /* Laws with several branches find their branch in the first residual. */
    for (int i = 0; i < 2; ++i) residual(e, e->unknowns, e->residual, e->f);
    if (!measure(m) || (m->path && !followed(m)) || !accept_step(m)) return k;
    keep_state(m, rows + (size_t)k * m->width);
  }
  return number;
}
