/* SPDX-License-Identifier: MIT */
/* Blocks: all elements with one statement; see blocks/block.py. Everything here follows from the functions of
 * the statement; no function knows an effect. */

/* For each batch c with elements that act in the step. */
#define FOR_ACTING(b, c) for (int k_ = 0, c; k_ < *(b)->acting && (c = (b)->batch[k_], 1); ++k_)

/* The outputs of a function for all acting elements; element by element if it has no loop in lanes. */
static void evaluate(const element_block *b, const element_function *f, double *out)
{
  const int n = b->lanes;
  double *one = b->space, *e = one + b->width;
  if (f->several && *b->acting == b->batches) {
    f->several(b->batches, b->w, out);
    return;
  }
  FOR_ACTING(b, c) {
    const double *w = b->w + (size_t)c * b->width * n;
    double *to = out + (size_t)c * f->outputs * n;
    if (f->several) f->several(1, w, to);
    for (int l = 0; l < n && !f->several; ++l) {
      for (int i = 0; i < b->width; ++i) one[i] = w[i * n + l];
      ask(f->one, one, f->outputs, e);
      for (int i = 0; i < f->outputs; ++i) to[i * n + l] = e[i];
    }
  }
}

/* Number of elements in batch c; copies of the last one fill up its lanes. */
static inline int elements_in(const element_block *b, int c)
{
  const int rest = b->elements - c * b->lanes;
  return rest < b->lanes ? rest : b->lanes;
}

/* Input i of batch c; inputs are motions after and before the step, their rates, state, numbers, numbers of the
 * step. */
static inline double *input(const element_block *b, int c, int i) { return b->w + ((size_t)c * b->width + i) * b->lanes; }

/* Indices of the first number of the state, and of the first number of the step. */
static inline int first_state(const element_block *b) { return (2 + b->rates) * b->unknowns; }
static inline int first_of_step(const element_block *b) { return b->width - b->modes - b->steps; }

/* Set a mode of all elements. */
static void set_mode(const element_block *b, enum mode_of_block mode, double value)
{
  FOR_ACTING(b, c)
    for (int l = 0; l < b->lanes; ++l) input(b, c, b->width - b->modes + mode)[l] = value;
}

/* Write the configuration q into the motions of elements, from the input `first` on. */
static void gather(const element_block *b, const double *q, int first)
{
  const int all = b->unknowns * b->lanes;
  FOR_ACTING(b, c) {
    const int32_t *dofs = b->dofs + (size_t)c * all;
    double *w = input(b, c, first);
    for (int i = 0; i < all; ++i) w[i] = q[dofs[i]];
  }
}

/* Add the first `each` outputs of a function of elements to `out` at indices. */
static void scatter(const element_block *b, const element_function *f, int each, const double *values,
                    const int32_t *index, double *out)
{
  const int n = b->lanes;
  FOR_ACTING(b, c)
    for (int i = 0, some = elements_in(b, c); i < each; ++i) {
      const int32_t *at = index + ((size_t)c * each + i) * n;
      const double *x = values + ((size_t)c * f->outputs + i) * n;
      for (int l = 0; l < some; ++l) out[at[l]] += x[l];
    }
}

/* Numbers of a step: functions of time, then numbers_of_step, coefficients of the scheme, and shared numbers. */
static void find_numbers_of_step(const element_block *b, const time_step *step)
{
  static const double at_rest = 1e300; /* instead of an infinite step; all rates are practically zero */
  const double t = b->t[0], t1 = step->load_time, a = b->weight_of_before, reached = step->at * step->fraction;
  const double half = isfinite(step->dt) ? step->dt / 2 : 0, later = 1e-6 * LATER;
  const double now = reached == 1 ? t1 : t + reached * (t1 - t);
  const double end = step->fraction == 1 ? step->motion_time : t + step->fraction * (step->motion_time - t);
  const double time[TIMES_OF_NUMBERS] = {
    [TIME_NOW] = now, [TIME_WHOLE] = t1, [TIME_BEFORE] = t, [TIME_BETWEEN] = a * t + (1 - a) * now, [TIME_END] = end,
    [TIME_HALF_BEFORE] = now - half, [TIME_HALF_AFTER] = now + half, [TIME_LATER] = end + later,
    [TIME_TWICE_LATER] = end + 2 * later, [TIME_WHOLE_MOTION] = step->motion_time,
  };
  double *more = b->now + b->functions;
  b->t[1] = end;
  for (int k = 0; k < b->functions; ++k)
    if (b->when[k] == TIME_GROWING) {
      const double change = step->fraction * (value_at(b->function + k, t1) - b->before[k]);
      b->end[k] = b->before[k] + change, b->now[k] = b->before[k] + step->at * change;
    } else
      b->now[k] = value_at(b->function + k, time[b->when[k]]);
  more[LENGTH_OF_STEP] = fmin(step->dt, at_rest), more[FRACTION] = step->fraction, more[REACHED] = reached;
  more += NUMBERS_OF_STEP;
  if (!b->rates) return;
  static const scheme_numbers at_begin = {.velocity = {1}, .rates = {{0, 1}}}; /* velocities are known, all else is zero */
  memcpy(more, (b->nodal->now ? b->nodal->now : &at_begin)->inertia, OF_SCHEME * sizeof *more);
  memcpy(more + OF_SCHEME, b->shared, b->groups * b->shares * sizeof *more);
}

/* Find the batches with elements that act: a number of the step is within the range of an element, or its state is
 * not zero. All elements act if they have no ranges. */
static void find_acting(const element_block *b)
{
  const int n = b->lanes;
  if (!b->ranges) return;
  *b->acting = 0;
  for (int c = 0; c < b->batches; ++c) {
    const int32_t *from = b->from + (size_t)c * b->steps * n;
    const double *low = b->range + 2 * (size_t)c * n, *z = b->state + (size_t)c * b->states * n;
    int acts = 0;
    for (int k = 0; k < b->ranges; ++k)
      for (int l = 0; l < n; ++l) {
        const double x = b->now[from[k * n + l]];
        acts |= low[l] < x && x <= low[n + l];
      }
    for (int i = 0; i < b->states * n; ++i) acts |= z[i] != 0;
    if (acts) b->batch[(*b->acting)++] = c;
  }
  memset(*b->each, 0, (size_t)b->batches * b->unknowns * n * sizeof **b->each);
}

/* Set the inputs of a step, except the motions at its end. */
static void take_inputs(const element_block *b, const time_step *step)
{
  const int steps = b->steps * b->lanes, states = b->states * b->lanes;
  find_numbers_of_step(b, step);
  find_acting(b);
  gather(b, step->q0, b->unknowns);
  for (int j = 1; j <= b->rates; ++j) gather(b, b->nodal->rate[j], (1 + j) * b->unknowns);
  FOR_ACTING(b, c) {
    memcpy(input(b, c, first_state(b)), b->state + (size_t)c * states, states * sizeof *b->w);
    for (int i = 0; i < steps; ++i) input(b, c, first_of_step(b))[i] = b->now[b->from[(size_t)c * steps + i]];
  }
}

/* Select the rows of tables by the mode before them; returns whether a row has changed. */
static int select_rows(const element_block *b)
{
  const int n = b->lanes, modes = b->columns * n;
  int changed = 0;
  if (!modes) return 0;
  FOR_ACTING(b, c)
    for (int l = 0; l < n; ++l) {
      const int i = c * n + l < b->elements ? c * n + l : b->elements - 1;
      double *row = input(b, c, b->width - b->columns) + l;
      int low = 0, high = b->table_rows[i];
      while (high - low > 1) {
        const int middle = (low + high) / 2;
        *(row[-n] >= b->table[i][middle * b->columns] ? &low : &high) = middle;
      }
      const double *wanted = b->table[i] + low * b->columns;
      for (int k = 0; k < b->columns; ++k) changed |= row[k * n] != wanted[k], row[k * n] = wanted[k];
    }
  return changed;
}

/* Modes before the first iterate: the modes at the end of the last step, or zero. */
void begin_block_again(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  const int n = b->lanes;
  set_mode(b, MODE_FRESH, 1);
  for (int k = 0; b->mode_of && k < b->modes - FIRST_MODE; ++k)
    FOR_ACTING(b, c)
      for (int l = 0; l < n; ++l)
        input(b, c, b->width - b->modes + FIRST_MODE + k)[l] =
          b->begins[k] < 0 ? 0 : b->state[((size_t)c * b->states + b->begins[k]) * n + l];
  select_rows(b);
}

/* Lines of springs: the force of a material point and its derivative by the motion. */
static void find_lines(const element_block *b)
{
  const int n = b->lanes, first = b->width - b->modes + FIRST_MODE;
  const points *p = b->inner->points;
  for (int i = 0; i < b->elements; ++i)
    p->e1[3 * i] = b->out[((size_t)(i / n) * b->end_of->outputs + b->states + b->shares) * n + i % n];
  respond(b->inner->points);
  for (int i = 0; i < b->elements; ++i) {
    double *slope = input(b, i / n, first) + i % n;
    slope[0] = p->D[9 * i], slope[n] = p->r[3 * i];
  }
}

enum { MOST_ROWS = 50 }; /* of a table that an iterate tries */

/* Modes at the present motions, which are the first recorded numbers. Held elements keep theirs; the excess measures by how much that is violated. */
static void find_modes(const element_block *b)
{
  const int n = b->lanes, first = b->width - b->modes, modes = b->modes - FIRST_MODE;
  const int holds = b->opens && b->search[HOLD];
  if (!b->mode_of) {
    evaluate(b, b->end_of, b->out);
    if (b->inner) find_lines(b);
    else b->ask(b->asked);
    set_mode(b, MODE_FRESH, 0);
    return;
  }
  FOR_ACTING(b, c)
    for (int l = 0; l < elements_in(b, c); ++l) input(b, c, first + MODE_HELD)[l] = holds && !b->free[c * n + l];
  for (int i = 0; i == 0 || (i < MOST_ROWS && select_rows(b)); ++i) {
    evaluate(b, b->mode_of, b->out);
    FOR_ACTING(b, c)
      memcpy(input(b, c, first + FIRST_MODE), b->out + (size_t)c * b->mode_of->outputs * n, modes * n * sizeof *b->out);
  }
  FOR_ACTING(b, c) {
    const double *out = b->out + (size_t)c * b->mode_of->outputs * n, *excess = out + modes * n, *opened = excess + n;
    for (int l = 0; l < elements_in(b, c); ++l) {
      b->excess[c * n + l] = excess[l];
      if (excess[l] > 0) b->search[OVER] = 1;
      if (opened[l] > 0) b->search[OPENED] = 1;
    }
  }
  set_mode(b, MODE_FRESH, 0);
}

/* Compute the response of springs at q. */
void respond_springs(const element_block *b, const double *q)
{
  gather(b, q, 0);
  find_modes(b);
}

/* Note whether a law began or ceased to hold since the latest residual. */
static void find_holds(const element_block *b)
{
  const int n = b->lanes, k = b->laws;
  FOR_ACTING(b, c)
    for (int i = 0; i < k * elements_in(b, c); ++i) {
      const size_t at = (size_t)c * b->force_of->outputs + b->unknowns + i % k * (k + 2);
      const int holds = (*b->each)[at * n + i / k] != 0;
      int32_t *before = b->holds + c * n * k + i;
      if (holds != *before) *before = holds, *b->switched = 1;
    }
}

void begin_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  take_inputs(b, step);
  if (b->modes) begin_block_again(self, step, q1, s);
  /* For the size of loads: iterates of a failed step may be far away, and a first step has no forces before it. */
  if (*b->begun) memcpy(b->force, b->force_before, b->size * sizeof *b->force);
  else if (b->size) {
    gather(b, step->q0, 0);
    evaluate(b, b->force_of, b->out);
    memset(b->force, 0, b->size * sizeof *b->force);
    scatter(b, b->force_of, b->unknowns, b->out, b->at, b->force);
  }
}

void add_block(void *self, const double *q, double *r)
{
  const element_block *b = self;
  gather(b, q, 0);
  if (b->modes) find_modes(b);
  evaluate(b, b->force_of, *b->each);
  if (b->modes) find_holds(b);
  if (!b->size) {
    scatter(b, b->force_of, b->unknowns, *b->each, b->dofs, r);
    return;
  }
  memset(b->force, 0, b->size * sizeof *r);
  scatter(b, b->force_of, b->unknowns, *b->each, b->at, b->force);
  for (int i = 0; i < b->size; ++i) r[b->dof[i]] += b->force[i];
}

void add_block_tangent(void *self, const double *q, double *tangent)
{
  const element_block *b = self;
  gather(b, q, 0);
  if (b->modes) set_mode(b, MODE_STIFFENED, b->search[STIFF] == STIFFEST);
  evaluate(b, b->tangent_of, b->out);
  scatter(b, b->tangent_of, b->tangent_of->outputs, b->out, b->entry, tangent);
}

/* Power of an element, whose inputs are in b->space, after a fraction of the step; J per step. */
static double power_at(const element_block *b, double fraction)
{
  double power;
  b->space[first_state(b) + b->states] = fraction;
  ask(b->power_of->one, b->space, 1, &power);
  return power;
}

/* Largest number of halvings of a path, and error of Simpson's rule as a fraction of the work. */
enum { HALVINGS = 14 };
static const double WORK_ERROR = 1e-7;

/* Work between the fractions s and t by Simpson's rule, halved where the powers have kinks. */
static double work_between(const element_block *b, double s, double t, double at_s, double at_t, int halvings, double size)
{
  const double middle = (s + t) / 2, at = power_at(b, middle), mean = (at_s + at_t) / 2;
  if (halvings >= 3 && (halvings == HALVINGS || fabs(at - mean) * (t - s) <= WORK_ERROR * size))
    return (t - s) * (mean + 2 * at) / 3;
  return work_between(b, s, middle, at_s, at, halvings + 1, size) + work_between(b, middle, t, at, at_t, halvings + 1, size);
}

/* Replace the first number of each element by its work on the path of the step. */
static void find_works(const element_block *b)
{
  const int n = b->lanes;
  FOR_ACTING(b, c)
    for (int l = 0; l < n; ++l) {
      for (int i = 0; i < b->width; ++i) b->space[i] = input(b, c, i)[l];
      const double before = power_at(b, 0), now = power_at(b, 1), size = fabs(before) + fabs(now) + fabs(power_at(b, 0.5));
      input(b, c, first_state(b) + b->states)[l] = work_between(b, 0, 1, before, now, 0, size);
    }
}

/* Compute new states and energies. Stored energies are kept for add_energy_of_block. */
void end_step_of_block(const element_block *b, const double *q, enum end_of_step what)
{
  const int n = b->lanes, states = b->states * n, energies = b->stored + b->entered;
  double *sum = b->new_shared;
  if (!b->end_of) return;
  gather(b, q, 0);
  if (b->power_of) find_works(b);
  evaluate(b, b->end_of, b->out);
  if (what == COMPUTE) return;
  if (what != TRIAL) memset(b->energy, 0, b->stored * sizeof(double));
  memset(sum, 0, b->groups * b->shares * sizeof *sum);
  FOR_ACTING(b, c) {
    const double *out = b->out + (size_t)c * b->end_of->outputs * n, *shared = out + states;
    const double *record = shared + b->shares * n, *energy = record + b->recorded * n;
    if (what == ENERGIES && b->knows_before) energy += energies * n;
    const int some = elements_in(b, c);
    if (what >= BEGIN) memcpy(b->state + (size_t)c * states, out, states * sizeof *out);
    for (int i = 0; i < b->shares; ++i)
      for (int l = 0; l < some; ++l) sum[b->group[c * n + l] * b->shares + i] += shared[i * n + l];
    for (int i = 0; i < b->recorded && what != TRIAL; ++i)
      for (int l = 0; l < some; ++l) {
        double *x = b->record + (c * n + l) * b->recorded + i, value = record[i * n + l];
        if (b->recorded_kind[i] == RECORDED_STATE || what == ACCEPT)
          *x = value + (b->recorded_kind[i] >= RECORDED_TOTAL ? *x : 0);
      }
    for (int i = 0; i < energies && what != TRIAL; ++i)
      for (int l = 0; l < some; ++l)
        if (i < b->stored) b->energy[i] += energy[i * n + l];
        else if (what == ACCEPT) *b->entries[i] += energy[i * n + l];
  }
  if (!b->shares || what == ENERGIES) return;
  if (what != BEGIN && b->equation->agree) b->equation->agree(b->equation->handle, b->groups * b->shares, b->totals, sum);
  for (int i = 0; i < b->groups * b->shares; ++i)
    if (what != TRIAL || i % b->shares >= b->kept) b->shared[i] = sum[i];
}

void accept_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  if (b->work) *b->work -= work_in_step(b->size, b->dof, b->weight_of_before, b->force_before, b->force, s);
  memcpy(b->force_before, b->force, b->size * sizeof *b->force);
  memcpy(b->before, b->end, b->functions * sizeof *b->before);
  b->t[0] = b->t[1], *b->begun = 1;
  end_step_of_block(b, q1, ACCEPT);
}

void add_energy_of_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  for (int i = 0; i < b->stored; ++i) *b->entries[i] += b->energy[i];
}

/* Largest residual of a law. Residuals of motions are divided by 1 % of `moved`, which is at most the size of the
 * scene; residuals of forces are divided by `scale`. Round-off of the motions does not count; it grows with the
 * distance from the initial position and with the number of turns.
 *
 * A law with internal variables computes its force from the elastic part of a motion, which has the round-off of the
 * motions at both ends of the step. Times the elastic stiffness it is all that remains of the force of a spring that
 * has failed, where the slope of the law and `scale` vanish. The law and the unknown force, which is the law of an
 * earlier iterate, err by half a digit each. */
double missed_by_block(void *self, const double *q, const double *r, double scale, double moved)
{
  const element_block *b = self;
  const int n = b->lanes, k = b->laws, motions = b->unknowns - k;
  const double amplitude = moved / b->scene;
  double most = 0;
  FOR_ACTING(b, c)
    for (int l = 0; l < elements_in(b, c); ++l) {
      const int32_t *dofs = b->dofs + (size_t)c * b->unknowns * n + l;
      const double *slope = *b->each + ((size_t)c * b->force_of->outputs + b->unknowns) * n + l;
      double far = amplitude;
      for (int i = 0; i < motions; ++i)
        far = fmax(far, amplitude + fabs(q[dofs[i * n]]) / (3 * i < 2 * motions ? b->scene : 1));
      for (int j = 0; j < k; ++j, slope += (k + 2) * n) {
        const double force = fabs(slope[n]) * scale * b->scene / b->length[j];
        const double size = *slope ? 0.01 * b->length[j] * amplitude : force;
        double reach = 0; /* of the motions in the law */
        for (int i = 0; i < k; ++i) reach += fabs(slope[(i + 2) * n]) * b->length[i];
        double round_off = 8 * reach * last_digit(far);
        if (b->stiffness) {
          const int at = (c * n + l) * k + j;
          const double farthest = fmax(far, fabs(b->record[(size_t)at * (b->recorded / k)]) / b->length[j]);
          round_off = fmax(round_off, fabs(slope[n]) * b->stiffness[at] * b->length[j] * last_digit(farthest));
        }
        const double left = fabs(r[dofs[(motions + j) * n]]) - round_off;
        if (left > 0) most = fmax(most, left / size);
      }
    }
  return most;
}

/* The outputs of a function at q that depends on the direction u, too; with a tangent, add them to entries. w is
 * space for all inputs and for the motions in u. */
void evaluate_along(const element_block *b, const element_function *f, const double *q, const double *u, double *w,
                    const int32_t *entry, double *tangent)
{
  element_block more = *b;
  more.w = w, more.width = b->width + b->unknowns;
  FOR_ACTING(b, c)
    memcpy(input(&more, c, 0), input(b, c, 0), (size_t)b->width * b->lanes * sizeof *w);
  gather(&more, q, 0);
  gather(&more, u, b->width);
  evaluate(&more, f, b->out);
  if (tangent) scatter(b, f, f->outputs, b->out, entry, tangent);
}

/* Begin a step in a neighbouring scene from the state that its statement has at the configuration of the run. */
void begin_neighbour(void *self, const time_step *step, const double *q1, const double *s)
{
  const block_pair *m = self;
  const element_block *b = m->neighbour;
  memcpy(b->state, m->block->state, (size_t)b->batches * b->states * b->lanes * sizeof *b->state);
  take_inputs(b, step);
  begin_block_again(m->neighbour, step, q1, s);
  gather(b, step->q0, 0);
  find_modes(b);
  end_step_of_block(b, step->q0, BEGIN);
}

/* -- derivatives ----------------------------------------------------------------------------------------- */

/* Derivatives by the numbers of a step, from blocks in neighbouring scenes that take the same step. */
static void find_directions_of_step(const block_derivatives *m, const time_step *step)
{
  const element_block *b = m->block;
  const int shared = b->groups * b->shares;
  memset(m->by_step, 0, (size_t)m->parameters * m->of_step * sizeof *m->by_step);
  for (int k = 0; k < m->parameters * m->neighbours; ++k) {
    const element_block *one = m->neighbour[k];
    find_numbers_of_step(one, step);
    double *direction = m->by_step + k / m->neighbours * m->of_step;
    for (int i = 0; i < b->functions; ++i) direction[i] += m->weight[k] * (one->now[i] - b->now[i]);
  }
  for (int p = 0; p < m->parameters; ++p)
    memcpy(m->by_step + (p + 1) * m->of_step - shared, m->by_shared + (size_t)p * shared, shared * sizeof(double));
}

void tabulate_block(void *self, const time_step *step, const double *q1)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  gather(b, q1, 0);
  if (m->inner) {
    find_modes(b);
    tabulate_points(m->inner, step, q1);
  }
  if (m->tabulate) {
    evaluate(b, b->end_of, b->out);
    m->tabulate(m->user);
  }
  evaluate(b, m->table_of, m->table);
  for (size_t i = 0; i < (size_t)m->block->batches * m->table_of->outputs * m->block->lanes; ++i)
    if (!isfinite(m->table[i])) m->table[i] = 0; /* zero times an infinite number of a branch that is not taken */
  find_directions_of_step(m, step);
}

/* Derivatives of all inputs of the elements in batch c by parameter p. The derivatives of the motions at the end of
 * the step are in q1; without q1 they are zero. */
static void find_direction(const block_derivatives *m, const derivatives *d, int c, int p, const double *q1)
{
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns * n, steps = b->steps * n;
  const size_t states = b->states * n, numbers = b->numbers * n, at = (size_t)p * b->batches + c;
  const double *now = m->by_step + p * m->of_step;
  const int32_t *dofs = b->dofs + (size_t)c * motions, *from = b->from + (size_t)c * steps;
  double *x = m->direction;
  for (int j = -1; j <= b->rates; ++j, x += motions) {
    const double *q = j < 0 ? q1 : (j ? d->rates[j] : d->q0) + (size_t)p * d->size;
    for (int i = 0; i < motions; ++i) x[i] = q ? q[dofs[i]] : 0;
  }
  memcpy(x, m->by_state + at * states, states * sizeof *x), x += states;
  memcpy(x, m->by_number + at * numbers, numbers * sizeof *x), x += numbers;
  for (int i = 0; i < steps; ++i) x[i] = now[from[i]];
}

/* Number of rows of the table: forces, state, shared numbers. */
static inline int rows_of(const element_block *b) { return b->unknowns + b->states + b->shares; }

/* Row of the table of batch c, and its length. */
static inline int columns(const element_block *b) { return b->width - b->modes; }
static inline const double *row_of(const block_derivatives *m, int c, int row)
{
  return m->table + ((size_t)c * m->table_of->outputs + row * columns(m->block)) * m->block->lanes;
}

/* Product of a row of the table of batch c with the directions, in lanes. */
static inline void multiply_row(const block_derivatives *m, int c, int row, double *sum)
{
  const element_block *b = m->block;
  const int n = b->lanes;
  const double *slope = row_of(m, c, row);
  memset(sum, 0, n * sizeof *sum);
  for (int j = 0; j < columns(b); ++j, slope += n)
    for (int l = 0; l < n; ++l) sum[l] += slope[l] * m->direction[j * n + l];
}

/* The first number of element i, in an array of the numbers of all elements, whose size follows. */
static inline double *number_of(const element_block *b, double *numbers, int i)
{
  return numbers + (size_t)(i / b->lanes) * b->numbers * b->lanes + i % b->lanes;
}
static inline size_t all_numbers(const element_block *b) { return (size_t)b->batches * b->numbers * b->lanes; }

void add_block_derivative(void *self, const derivatives *d, int p, double *r)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  double sum[MOST_LANES];
  if (m->inner) { /* the derivatives of the forces at constant motions are numbers of the elements */
    add_points_derivative(m->inner, d, p, r);
    for (int i = 0; i < b->elements; ++i) *number_of(b, m->by_number + (size_t)p * all_numbers(b), i) = m->inner->r[3 * i];
  }
  FOR_ACTING(b, c) {
    find_direction(m, d, c, p, 0);
    for (int i = 0; i < b->unknowns; ++i) {
      const int32_t *dofs = b->dofs + ((size_t)c * b->unknowns + i) * b->lanes;
      multiply_row(m, c, i, sum);
      for (int l = 0; l < elements_in(b, c); ++l) r[dofs[l]] += sum[l];
    }
  }
}

void accept_block_derivative(void *self, const derivatives *d, int p)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes, shared = b->groups * b->shares;
  double sum[MOST_LANES], *new_shared = b->new_shared;
  memset(new_shared, 0, shared * sizeof *new_shared);
  FOR_ACTING(b, c) {
    double *z = m->by_state + ((size_t)p * b->batches + c) * b->states * n;
    if (!b->states && !b->shares && !m->margins) break;
    find_direction(m, d, c, p, d->q1 + (size_t)p * d->size);
    for (int k = 0; k < m->margins; ++k) {
      const double *margin = row_of(m, c, rows_of(b) + m->margins) + k * n;
      multiply_row(m, c, rows_of(b) + k, sum);
      for (int l = 0; l < elements_in(b, c); ++l) note_margin(d, p, (c * n + l) * (b->laws ? b->laws : 1), margin[l], sum[l]);
    }
    for (int i = 0; i < b->states && !d->initial; ++i) multiply_row(m, c, b->unknowns + i, z + i * n);
    for (int i = 0; i < b->shares; ++i) {
      multiply_row(m, c, b->unknowns + b->states + i, sum);
      for (int l = 0; l < elements_in(b, c); ++l) new_shared[b->group[c * n + l] * b->shares + i] += sum[l];
    }
  }
  if (m->inner && !d->initial) {
    for (int i = 0; i < b->elements; ++i)
      m->inner->e1[3 * i] = m->by_state[(((size_t)p * b->batches + i / n) * b->states + b->states - 1) * n + i % n];
    accept_points_derivative(m->inner, d, p);
  }
  for (int i = 0; i < shared; ++i)
    if (!d->initial || i % b->shares >= b->kept) m->by_shared[(size_t)p * shared + i] = new_shared[i];
  if (m->neighbours && !d->initial) memset(m->by_before + (size_t)p * b->functions, 0, b->functions * sizeof(double));
  for (int k = p * m->neighbours; k < (p + 1) * m->neighbours && !d->initial; ++k) {
    const element_block *one = m->neighbour[k];
    for (int i = 0; i < b->functions; ++i) m->by_before[(size_t)p * b->functions + i] += m->weight[k] * (one->end[i] - b->end[i]);
    memcpy(one->before, one->end, b->functions * sizeof(double));
    one->t[0] = one->t[1];
  }
}

/* Derivatives of batch c by the rows of the table, in lanes: of forces by λ, of new states and shared numbers by
 * the derivatives after the step, which a trial step has of some shared numbers only. */
static void find_bars(const block_derivatives *m, const adjoint *a, int c, const double *λ, double *bar)
{
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns * n, states = b->states * n;
  const int32_t *dofs = b->dofs + (size_t)c * motions;
  for (int i = 0; i < motions; ++i) bar[i] = λ ? λ[dofs[i]] : 0;
  for (int i = 0; i < states; ++i) bar[motions + i] = a->d->initial ? 0 : m->state_bar[(size_t)c * states + i];
  for (int i = 0; i < b->shares; ++i)
    for (int l = 0; l < n; ++l)
      bar[motions + states + i * n + l] =
        a->d->initial && i < b->kept ? 0 : m->shared_bar[b->group[c * n + l] * b->shares + i];
}

/* The table of a recorded step, whose state is restored. Forces and new states depend on the motions after the
 * step: the solution for λ needs the derivatives of new states by these. */
void transpose_block_state(void *self, adjoint *a)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes, rows = rows_of(b);
  take_inputs(b, a->step);
  tabulate_block(self, a->step, a->d->x);
  if (m->inner) { /* the last state of an element is its motion */
    transpose_points_state(m->inner, a);
    for (int i = 0; i < b->elements; ++i)
      m->state_bar[((size_t)(i / n) * b->states + b->states - 1) * n + i % n] += m->inner->e1[3 * i];
  }
  FOR_ACTING(b, c) {
    const int32_t *dofs = b->dofs + (size_t)c * b->unknowns * n;
    if (rows == b->unknowns) break;
    find_bars(m, a, c, 0, m->direction);
    for (int i = b->unknowns; i < rows; ++i) {
      const double *slope = row_of(m, c, i), *bar = m->direction + i * n;
      for (int j = 0; j < b->unknowns; ++j)
        for (int l = 0; l < elements_in(b, c); ++l) a->q1[dofs[j * n + l]] += slope[j * n + l] * bar[l];
    }
  }
}

/* Derivatives by all inputs but the motions after the step. */
void transpose_block(void *self, adjoint *a, const double *λ)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const int n = b->lanes, motions = b->unknowns, z = first_state(b), end = z + b->states, rows = rows_of(b);
  const int shared = b->groups * b->shares;
  FOR_ACTING(b, c) {
    const int32_t *dofs = b->dofs + (size_t)c * motions * n, *from = b->from + (size_t)c * b->steps * n;
    double *z_bar = m->state_bar + (size_t)c * b->states * n;
    find_bars(m, a, c, λ, m->direction);
    if (!a->d->initial) memset(z_bar, 0, b->states * n * sizeof *z_bar);
    for (int i = 0; i < rows; ++i) {
      const double *slope = row_of(m, c, i) + motions * n;
      for (int j = motions; j < columns(b); ++j, slope += n)
        for (int l = 0; l < elements_in(b, c); ++l) {
          const double x = slope[l] * m->direction[i * n + l];
          const int rate = j / motions - 1;
          if (j < z) (rate ? a->rates[rate] : a->q0)[dofs[j % motions * n + l]] += x;
          else if (j < end) z_bar[(j - z) * n + l] += x;
          else if (j < end + b->numbers) m->number_bar[((size_t)c * b->numbers + j - end) * n + l] += x;
          else m->step_bar[from[(j - end - b->numbers) * n + l]] += x;
        }
    }
  }
  if (m->inner) {
    for (int i = 0; i < b->elements; ++i) {
      double *x = number_of(b, m->number_bar, i);
      m->inner->r_bar[3 * i] = *x, *x = 0;
    }
    transpose_points(m->inner, a, λ);
  }
  if (m->tabulate) /* numbers that change in each step */
    for (int p = 0; p < a->parameters; ++p)
      for (int i = 0; i < b->elements; ++i)
        for (int j = 0; j < m->shifts; ++j)
          a->gradient[p] += number_of(b, m->number_bar, i)[j * n] * number_of(b, m->by_number + p * all_numbers(b), i)[j * n];
  for (int i = 0; m->tabulate && i < b->elements * m->shifts; ++i) number_of(b, m->number_bar, i / m->shifts)[i % m->shifts * n] = 0;
  double *before = m->step_bar + m->of_step - shared;
  for (int i = 0; i < shared; ++i) {
    m->shared_bar[i] = before[i] + (a->d->initial && i % b->shares < b->kept ? m->shared_bar[i] : 0);
    before[i] = 0;
  }
  add_products(a, m->of_step, m->step_bar, m->by_step);
  memset(m->step_bar, 0, m->of_step * sizeof *m->step_bar);
}

void finish_block(void *self, adjoint *a)
{
  const block_derivatives *m = self;
  const element_block *b = m->block;
  const size_t all = (size_t)b->batches * b->lanes;
  add_products(a, all * b->states, m->state_bar, m->by_state);
  add_products(a, all * b->numbers, m->number_bar, m->by_number);
  add_products(a, b->groups * b->shares, m->shared_bar, m->by_shared);
  if (m->inner) finish_points(m->inner, a);
}
