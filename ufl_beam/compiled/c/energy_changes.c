/* SPDX-License-Identifier: MIT */
/* Energies that a static step changes, before it is accepted; see energy_ledger.py. */

/* Energy that points store and dissipate in a step to q1. */
static double change_by_response(const element_block *b, const double *q1)
{
  points *p = respond_in(b, q1);
  double after[POINT_OUTPUTS], change = 0;
  end_points(p, after, 0);
  for (int k = 0; k < POINT_OUTPUTS; ++k)
    if (k != LOST) change += after[k] - (k == ELASTIC || k == HARDENING ? p->sum[k] : 0);
  return change;
}

/* Energy that connectors of a block take: the work of their forces, by the rule with which all forces of a static step
 * do work; on the path of rate-independent laws; of elastic laws, the energy that they store. */
void change_of_block(void *self, const double *q1, energy_change *sum)
{
  const element_block *b = self;
  const int n = b->lanes, first = b->states + b->shares, energies = first + b->recorded, elastic = b->stored && !b->lost;
  const double *w = first_numbers(b); /* works on paths */
  end_step_of_block(b, q1, COMPUTE);
  for (int i = 0; i < b->elements; ++i) {
    const double *out = b->out + (size_t)(i / n) * b->end_of->outputs * n + i % n;
    for (int k = 0; k < b->recorded; ++k) {
      const double work = b->recorded_kind[k] == RECORDED_WORK ? out[(first + k) * n] : 0;
      sum->effort += fabs(work);
      if (!elastic && !b->power_of && !b->inner) sum->in_connectors += work;
    }
    for (int k = 0; elastic && k < b->stored; ++k) sum->in_connectors += out[(energies + k) * n];
    if (b->power_of) sum->in_connectors += w[(size_t)(i / n) * b->width * n + i % n];
  }
  for (int k = 0; elastic && k < b->stored; ++k) sum->in_connectors -= b->energy[k];
  if (b->inner) sum->in_connectors += change_by_response(b, q1);
}

/* Energy that cells store in a step to q1, without the energy that they supply. */
void change_of_cells(void *self, const double *q1, energy_change *sum)
{
  const element_block *b = self;
  double *out = b->out, before = 0;
  if (b->inner) sum->in_beams += change_by_response(b, q1);
  gather(b, q1, 0);
  if (b->end_of) FOR_ACTING(b, c) {
    evaluate_batch(b, b->end_of, c, out);
    const double *energy = out + (b->states + b->shares + b->recorded) * b->lanes;
    for (int i = 0; i < b->stored + b->entered; ++i)
      for (int l = 0; l < elements_in(b, c); ++l) {
        const double x = energy[i * b->lanes + l];
        if (i < b->stored) sum->in_beams += x;
        else if (i >= b->stored + b->lost) sum->in_beams -= x, sum->effort += fabs(x);
      }
  }
  for (int i = 0; i < b->stored; ++i) before += b->energy[i];
  sum->in_beams -= before;
}

int points_dissipate(void *self, const double *q1)
{
  return gives_energy(respond_in(self, q1)) < 0;
}
