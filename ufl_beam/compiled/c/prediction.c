/* SPDX-License-Identifier: MIT */
/* Prediction of the end of a step, from which Newton's method starts; see stepper.py. */

/* Root mean square of the motions in a step, as a part of the size of the scene. */
static const double FAR = 1. / 8;

/* Whether a step is as long as the last one, but for last digits of the times at its ends. */
int as_last(const prediction *p, double dt)
{
  return fabs(dt - p->dt) <= 1e-6 * dt;
}

/* out: from q on, at the velocity of the last step and, after steps of equal length, with the part of
 * its acceleration that repeats itself. */
void predict(const prediction *p, double dt, const double *q, double *out)
{
  const double ratio = dt / p->dt, *before = p->q_before, *second = p->second;
  const double again = p->equal > 2 && as_last(p, dt) ? p->repeated : 0;
  if (again > 0)
    for (int i = 0; i < p->size; ++i) out[i] = q[i] + ratio * (q[i] - before[i]) + again * second[i];
  else
    for (int i = 0; i < p->size; ++i) out[i] = q[i] + ratio * (q[i] - before[i]);
}

/* Enter a step from q to q1; products are sums over the degrees of freedom that this process owns. */
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

/* Which part of the last second difference repeats itself, by the products over all processes. None
 * where steps do not resolve the motion: second differences are not small beside steps, or a step goes
 * far in the scene. */
void compare_differences(prediction *p)
{
  const double larger = fmax(p->now, p->before);
  const int resolved = 4 * larger < p->step && p->step < FAR * FAR;
  p->repeated = resolved && p->both > 0 ? p->both / larger : 0;
}
