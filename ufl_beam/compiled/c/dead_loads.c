/* SPDX-License-Identifier: MIT */
/* Dead loads and functions of time; see dead_loads.py. */

/* Interpolate as numpy.interp does; without points and function, the value is the time. */
double value_at(const time_function *f, double t)
{
  const int last = f->points - 1;
  if (last < 0) return f->value ? f->value(f->handle, t) : t;
  if (t <= f->t[0] || last == 0) return f->y[0];
  if (t >= f->t[last]) return f->y[last];
  int low = 0, high = last;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    if (f->t[middle] <= t) low = middle;
    else high = middle;
  }
  if (t == f->t[low]) return f->y[low];
  return (f->y[high] - f->y[low]) / (f->t[high] - f->t[low]) * (t - f->t[low]) + f->y[low];
}

/* Work in a step s of the weighted mean of the forces in the previous equation (weight a) and in
 * the equation of this step. The forces are at the degrees of freedom `dof`, or at all degrees of
 * freedom if `dof` is null. */
static double work_in_step(int size, const int32_t *dof, double a, const double *before, const double *force,
                           const double *s)
{
  double work = 0;
  for (int i = 0; i < size; ++i) work += (a * before[i] + (1 - a) * force[i]) * s[dof ? dof[i] : i];
  return work;
}

/* forces = sum of factors times vectors of loads */
static void sum_loads(const dead_loads *l, const double *factors, double *forces)
{
  for (int i = 0; i < l->size; ++i) forces[i] = factors[0] * l->vector[0][i];
  for (int k = 1; k < l->vectors; ++k)
    for (int i = 0; i < l->size; ++i) forces[i] += factors[k] * l->vector[k][i];
}

void begin_dead_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  dead_loads *l = self;
  const int whole = step->fraction == 1 && step->at == 1;
  int same = whole && l->whole;
  l->whole = whole;
  for (int k = 0; k < l->vectors; ++k) {
    const double factor = value_at(l->factor + k, step->load_time), before = l->factors_before[k];
    const double change = step->fraction * (factor - before), end = whole ? factor : before + change;
    if (factor != l->asked[k]) l->asked[k] = factor, same = 0;
    l->factors_at_end[k] = end;
    l->factors[k] = step->at == 1 ? end : before + step->at * change;
  }
  if (!same) sum_loads(l, l->factors, l->force);
}

void accept_dead_loads(void *self, const time_step *step, const double *q1, const double *s)
{
  dead_loads *l = self;
  *l->work += work_in_step(l->size, l->dof, l->weight_of_before, l->before, l->force, s);
  memcpy(l->factors_before, l->factors_at_end, l->vectors * sizeof *l->factors_before);
  sum_loads(l, l->factors_before, l->before);
}

/* b -= a at its degrees of freedom */
void subtract_vector(void *self, const double *q, double *b)
{
  const vector *a = self;
  for (int i = 0; i < a->size; ++i) b[a->dof[i]] -= a->values[i];
}
