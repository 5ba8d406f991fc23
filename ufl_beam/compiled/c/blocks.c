/* SPDX-License-Identifier: MIT */
/* Blocks: all elements with one statement; see blocks/block.py. Everything here follows from the functions of
 * the statement; no function knows an effect. */

/* For each batch c with elements that act in the step. */
#define FOR_ACTING(b, c) for (int k_ = 0, c; k_ < *(b)->acting && (c = (b)->batch[k_], 1); ++k_)

/* The outputs of a function for batch c; element by element if it has no loop in lanes. */
static void evaluate_batch(const element_block *b, const element_function *f, int c, double *out)
{
  const int n = b->lanes;
  const double *w = b->w + (size_t)c * b->width * n;
  double *one = b->space, *e = one + b->width;
  if (f->several) {
    f->several(1, w, out);
    return;
  }
  for (int l = 0; l < n; ++l) {
    for (int i = 0; i < b->width; ++i) one[i] = w[i * n + l];
    ask(f->one, one, f->outputs, e);
    for (int i = 0; i < f->outputs; ++i) out[i * n + l] = e[i];
  }
}

/* The outputs of a function for all acting elements. */
static void evaluate(const element_block *b, const element_function *f, double *out)
{
  if (f->several && *b->acting == b->batches) f->several(b->batches, b->w, out);
  else FOR_ACTING(b, c) evaluate_batch(b, f, c, out + (size_t)c * f->outputs * b->lanes);
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

/* Index of the first motion at the latest tangent, among the inputs of cells in a static step. */
static inline int about(const element_block *b) { return b->width - b->modes; }

/* Set a mode of all elements. */
static void set_mode(const element_block *b, int mode, double value)
{
  FOR_ACTING(b, c)
    for (int l = 0; l < b->lanes; ++l) input(b, c, b->width - b->modes + mode)[l] = value;
}

/* Write the configuration q into the motions of elements, from the input `first` on. */
static void gather(const element_block *b, const double *q, int first)
{
  const int n = b->lanes, all = b->unknowns * n;
  FOR_ACTING(b, c) {
    double *w = input(b, c, first);
    for (int i = 0; i < b->unknowns; ++i) __builtin_prefetch(w + (b->width + i) * n, 1); /* see add_in_lanes */
    if (b->inserted) /* as of forms, cell after cell; copies of the last cell fill up the lanes */
      for (int l = 0; l < n; ++l) {
        const int last = b->elements - 1, cell = c * n + l;
        const int32_t *dofs = b->inserted->dofs + (size_t)(cell < last ? cell : last) * b->unknowns;
        for (int i = 0; i < b->unknowns; ++i) w[i * n + l] = q[dofs[i]];
      }
    else {
      const int32_t *dofs = b->dofs + (size_t)c * all;
      for (int i = 0; i < all; ++i) w[i] = q[dofs[i]];
    }
  }
}

/* Whether predictions of cells follow the motion since the latest tangent; part of the change of imposed strains in
 * the step that they contain. */
static void set_prediction(const element_block *b, const double *q, int moved, double reached)
{
  const predicted_forces *p = b->predicted;
  set_mode(b, b->unknowns, moved), set_mode(b, b->unknowns + 1, reached);
  if (p->in_space) gather(b, p->to && !p->exact ? p->to : q, about(b) + b->unknowns + 2);
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
    } else if (b->when[k] == TIME_MOVING) {
      const double before = b->before[k], f = step->fraction, wanted = f > 0 ? value_at(b->function + k, step->motion_time) : 0;
      b->now[k] = b->end[k] = f == 1 ? wanted : f > 0 ? before + f * (wanted - before) : before;
    } else if (b->when[k] == TIME_LAST)
      b->now[k] = b->before[k - 1];
    else
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

/* Set the numbers of a step only, which is then another step from the same beginning. */
void set_numbers_of_step(const element_block *b, const time_step *step)
{
  const int steps = b->steps * b->lanes;
  find_numbers_of_step(b, step);
  FOR_ACTING(b, c)
    for (int i = 0; i < steps; ++i) input(b, c, first_of_step(b))[i] = b->now[b->from[(size_t)c * steps + i]];
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
  points *p = b->inner;
  for (int i = 0; i < b->elements; ++i)
    p->e1[3 * i] = b->out[((size_t)(i / n) * b->end_of->outputs + b->states + b->shares) * n + i % n];
  respond(p);
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
  if (b->predicted) b->predicted->begins = 1, b->predicted->exact = 0;
  if (b->modes && !b->inserted) begin_block_again(self, step, q1, s);
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

/* Tangent of cells in a static step, with the forces that the latest tangent predicts. The first tangent has the
 * forces before the step. */
void add_predicted_tangent(void *self, const double *q, double *tangent)
{
  const element_block *b = self;
  predicted_forces *p = b->predicted;
  const int all = b->unknowns * b->lanes;
  if (p->begins)
    FOR_ACTING(b, c) memcpy(input(b, c, about(b)), input(b, c, b->unknowns), all * sizeof *q);
  else if (p->exact) gather(b, q, about(b));
  set_prediction(b, q, !p->begins, !p->begins);
  add_cells((void *)b->inserted, q, tangent);
  gather(b, q, about(b));
  p->begins = 0, p->stale = 1;
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
  if (!b->inserted) evaluate(b, b->end_of, b->out);
  if (what == COMPUTE) return;
  if (what != TRIAL) memset(b->energy, 0, b->stored * sizeof(double));
  memset(sum, 0, b->groups * b->shares * sizeof *sum);
  FOR_ACTING(b, c) {
    double *out = b->out + (b->inserted ? 0 : (size_t)c * b->end_of->outputs * n);
    if (b->inserted) evaluate_batch(b, b->end_of, c, out);
    const double *shared = out + states;
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

/* Forces of loads at the state q, as a step from there begins with. */
static void find_forces_at_rest(const element_block *b, const double *q)
{
  gather(b, q, 0), gather(b, q, b->unknowns);
  FOR_ACTING(b, c) {
    const size_t states = (size_t)b->states * b->lanes;
    memcpy(input(b, c, first_state(b)), b->state + c * states, states * sizeof *b->w);
  }
  evaluate(b, b->force_of, b->out);
  memset(b->force, 0, b->size * sizeof *b->force);
  scatter(b, b->force_of, b->unknowns, b->out, b->at, b->force);
}

void accept_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  if (b->turns) end_step_of_block(b, q1, ACCEPT), find_forces_at_rest(b, q1);
  if (b->work) *b->work -= work_in_step(b->size, b->dof, b->weight_of_before, b->force_before, b->force, s);
  memcpy(b->force_before, b->force, b->size * sizeof *b->force);
  memcpy(b->before, b->end, b->functions * sizeof *b->before);
  b->t[0] = b->t[1], *b->begun = 1;
  if (!b->turns) end_step_of_block(b, q1, ACCEPT);
}

void add_energy_of_block(void *self, const time_step *step, const double *q1, const double *s)
{
  const element_block *b = self;
  for (int i = 0; i < b->stored; ++i) *b->entries[i] += b->energy[i];
}

/* Largest residual of a law. Residuals of motions are divided by 1 % of `moved`, which is at most the size of the
 * scene, or of `quiet` if that is larger; residuals of forces are divided by `scale`. Round-off of the motions does not
 * count; it grows with the distance from the initial position and with the number of turns.
 *
 * A law with internal variables computes its force from the elastic part of a motion, which has the round-off of the
 * motions at both ends of the step. Times the elastic stiffness it is all that remains of the force of a spring that
 * has failed, where the slope of the law and `scale` vanish. The law and the unknown force, which is the law of an
 * earlier iterate, err by half a digit each. */
double missed_by_block(void *self, const double *q, const double *r, double scale, double moved, double quiet)
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
        const double size = *slope ? 0.01 * b->length[j] * fmax(amplitude, quiet / b->scene) : force;
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

/* The outputs of a function at q that depends on directions, too; with a tangent, add them to entries. w is space for
 * all inputs of the function, which end with the motions in the directions and with numbers that remain. */
void evaluate_along(const element_block *b, const element_function *f, const double *q, int directions,
                    const double *const *direction, int width, double *w, double *out, const int32_t *entry,
                    double *tangent)
{
  element_block more = *b;
  more.w = w, more.width = width;
  FOR_ACTING(b, c)
    memcpy(input(&more, c, 0), input(b, c, 0), (size_t)b->width * b->lanes * sizeof *w);
  gather(&more, q, 0);
  for (int k = 0; k < directions; ++k) gather(&more, direction[k], b->width + k * b->unknowns);
  evaluate(&more, f, out);
  if (tangent) scatter(b, f, f->outputs, out, entry, tangent);
}

/* Begin a step in a neighbouring scene from the state that its statement has at the configuration of the run. */
void begin_neighbour(void *self, const time_step *step, const double *q1, const double *s)
{
  const block_pair *m = self;
  const element_block *b = m->neighbour;
  memcpy(b->state, m->block->state, (size_t)b->batches * b->states * b->lanes * sizeof *b->state);
  take_inputs(b, step);
  begin_block_again((void *)b, step, q1, s);
  gather(b, step->q0, 0);
  find_modes(b);
  end_step_of_block(b, step->q0, BEGIN);
}
