/* SPDX-License-Identifier: MIT */
/* Return map of material points in cross-sections, see material_points.py. */

/* Strains of a point from the n strains e of its section; b are its d rows of B. */
static inline void find_strains(int n, int d, const double *b, const double *e, double *strain)
{
  for (int a = 0; a < d; ++a) {
    double sum = b[n * a] * e[0];
    for (int k = 1; k < n; ++k) sum += b[n * a + k] * e[k];
    strain[a] = sum;
  }
}

/* Set the strains of the points w of a section from its strains e; the points do not open. */
static inline void set_strains(const points *p, int n, const double *e, double *w)
{
  const int d = p->components;
  for (int i = 0; i < p->of_cell; ++i, w += p->width) {
    if (d == 1) find_strains(n, 1, p->B + n * i, e, w + p->strain);
    else find_strains(n, d, p->B + n * d * i, e, w + p->strain);
    w[GROWTH] = w[DIRECTION] = 0;
  }
}

/* Add stresses s of a point, and the derivatives that follow them in s, to the resultants of its
 * section. */
static inline void add_answer(int n, int d, const double *b, double weight, const double *s, double *r,
                              double *D)
{
  for (int a = 0; a < d; ++a)
    for (int k = 0; k < n; ++k) {
      r[k] += weight * s[a] * b[n * a + k];
      for (int g = 0; g < d; ++g)
        for (int l = 0; l < n; ++l)
          D[n * k + l] += weight * s[d + d * a + g] * b[n * a + k] * b[n * g + l];
    }
}

/* Stiffness, relative to the elastic one, against a change of branch in addition to the predicted
 * stress. Without it, freely flowing material has no unique strain for a stress. */
static const double BESIDE_STRESS = 0.01;

/* Deviation from the prediction up to which a point answers for its own strain, relative to the
 * elastic stress of its change of strain; and round-off of strains. */
static const double ALIKE = 0.01, DIGITS = 1e-9;

/* Answer of a point of one strain on the branch where it bears the stress that the last tangent
 * predicts.
 *
 * The tangent of each point is a line (strain, stress, slope). If a point leaves its line, as when
 * it begins to flow or to unload, the strain of the iterate has the error of the line, which grows
 * with the softness of the point. Its stress is right by equilibrium, and smooth along a beam for
 * any size of the cells. So the next line is the tangent at the strain that belongs to this stress,
 * and the residual uses this line. This is Newton's method for strains and stresses as unknowns,
 * with the stresses condensed.
 *
 * In statics, `linear`, the strain that the iteration predicts, replaces the strain of the iterate.
 * Before the first tangent there is no line; the point then answers on the branch of this strain.
 * `known` is its answer there, or null.
 *
 * Changes s, the stress and its derivative. Returns the difference between the stress and the
 * stress of the strain.
 */
static double follow_prediction(const points *p, double *w, double linear, const double *known,
                                const double *line, double *s)
{
  double *strain = w + p->strain, *z = strain + 3, now[2], kept[MOST_VARIABLES];
  const double start = *strain, elastic = strain[2], beside = BESIDE_STRESS * p->theta * elastic;
  const double first = line ? s[0] - line[1] - line[2] * (start - line[0]) : 0;
  if (line && !(fabs(first) > elastic * (ALIKE * fabs(start - line[0]) + DIGITS * fabs(start)))) return 0;
  if (p->solves) memcpy(kept, z, p->variables * sizeof *z);
  *strain = linear;
  if (known) memcpy(now, known, sizeof now);
  else if (linear == start) memcpy(now, s, sizeof now);
  else answer(p, w, now);
  const double predicted = line ? line[1] + line[2] * (linear - line[0]) : now[0];
  double excess = now[0] - predicted;
  for (int i = 0; i < 20 && fabs(excess) > 1e-3 * fabs(first); ++i) {
    const double from = *strain, change = excess / (now[1] + beside), before = fabs(excess);
    for (double way = 1; way > 1e-3; way /= 2) {
      *strain = from - way * change;
      answer(p, w, now);
      excess = now[0] - predicted + beside * (*strain - linear);
      if (fabs(excess) <= (1 - way / 10) * before) break;
    }
  }
  const double line_at_start = now[0] + now[1] * (start - *strain), unlike = line_at_start - s[0];
  const int found = fabs(excess) <= 1e-3 * fabs(first);
  *strain = start;
  if (p->solves) memcpy(z, kept, p->variables * sizeof *z);
  if (!found) return 0;
  s[0] = line_at_start, s[1] = now[1];
  return fabs(unlike);
}

/* Resultants r of sections whose strains grow from e0 to e1, and their derivatives D.
 *
 * `search` records that a point opens, and may request stiff points: points that do not open then
 * answer with their elastic stiffness. Points around one that opens unload, which their own
 * tangents do not predict, and Newton's method would close the point again and again.
 *
 * If `search` has HOLD set, closed points stay closed for any stress. `over` is the largest
 * |stress| / limit - 1 of points beyond their limit, else zero.
 */
static inline __attribute__((always_inline)) void respond_sized(points *p, const int n)
{
  double s[3 + 9], *w = p->w, *r = p->r, *D = p->D, *line = p->line;
  const double *e0 = p->e0, *e1 = p->e1, *predicted = p->predicted;
  const int d = p->components, answers = d * (1 + d);
  *p->over = 0;
  memset(p->unlike, 0, n * sizeof *p->unlike);
  for (int c = 0; c < p->cells; ++c, e0 += n, e1 += n, r += n, D += n * n) {
    memset(D, 0, n * n * sizeof *D);
    for (int k = 0; k < n; ++k) {
      r[k] = p->rest[k] * ((1 - p->theta) * e0[k] + p->theta * e1[k]);
      D[(n + 1) * k] = p->rest[k] * p->theta;
    }
    double *known = 0; /* answers that all points need */
    if (p->law_loop && p->linear && !p->predicts) {
      set_strains(p, n, p->linear + n * c, w);
      p->law_loop(p->of_cell, w, known = p->answers + answers * p->of_cell);
    }
    set_strains(p, n, e1, w);
    if (p->law_loop) p->law_loop(p->of_cell, w, p->answers);
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      double *strain = w + p->strain;
      if (p->law_loop) memcpy(s, p->answers + answers * i, answers * sizeof *s);
      else answer(p, w, s);
      const int over = fabs(s[0]) > w[TRACTION]; /* P(51) */
      if (over && p->search[HOLD] && w[FLOWS] == CLOSED && w[TRACTION] > 0) {
        *p->over = fmax(*p->over, fabs(s[0]) / w[TRACTION] - 1);
        p->search[OVER] = 1;
      } else if (over) {
        condense_hinge(p, w, s);
        p->search[OPENED] = 1;
      } else if (p->search[STIFF]) {
        for (int a = 0; a < d * d; ++a)
          s[d + a] = a % (d + 1) ? 0 : p->theta * strain[2 * d + a / (d + 1)];
      } else if ((p->predicts || p->linear) && !(w[TRACTION] < INFINITY)) {
        double linear = *strain;
        if (p->linear) find_strains(n, 1, p->B + n * i, p->linear + n * c, &linear);
        const double *last = p->predicts ? predicted : 0, *there = known ? known + answers * i : 0;
        const double unlike = p->weight[i] * follow_prediction(p, w, linear, there, last, s);
        for (int k = 0; k < n && unlike > 0; ++k)
          p->unlike[k] = fmax(p->unlike[k], unlike * fabs(p->B[n * i + k]));
      }
      if (line) {
        line[0] = *strain, line[1] = s[0], line[2] = s[1];
        line += LINE, predicted += LINE;
      }
      if (d == 1) add_answer(n, 1, p->B + n * i, p->weight[i], s, r, D);
      else add_answer(n, d, p->B + n * d * i, p->weight[i], s, r, D);
    }
  }
  p->tried = 1;
}

void respond(points *p)
{
  if (p->strains == 3) respond_sized(p, 3); /* the compiler knows the size */
  else respond_sized(p, 6);
}

/* Replace D by its symmetric part, and compute its eigenvalues A[k][k] and eigenvectors V[.][k],
 * relative to the stiffnesses C, by Jacobi's method. */
static void find_eigenvalues(const double *C, double *D, double A[3][3], double V[3][3])
{
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) V[i][j] = i == j;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) {
      D[3 * i + j] = D[3 * j + i] = (D[3 * i + j] + D[3 * j + i]) / 2;
      A[i][j] = A[j][i] = D[3 * i + j] / sqrt(C[i] * C[j]);
    }
  for (int sweep = 0; sweep < 10; ++sweep)
    for (int i = 0; i < 2; ++i)
      for (int j = i + 1; j < 3; ++j) {
        if (A[i][j] == 0) continue;
        const double ratio = (A[j][j] - A[i][i]) / (2 * A[i][j]);
        const double t = copysign(1, ratio) / (fabs(ratio) + sqrt(ratio * ratio + 1));
        const double c = 1 / sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < 3; ++k) {
          const double x = A[k][i], y = A[k][j], v = V[k][i], w = V[k][j];
          A[k][i] = c * x - s * y, A[k][j] = s * x + c * y;
          V[k][i] = c * v - s * w, V[k][j] = s * v + c * w;
        }
        for (int k = 0; k < 3; ++k) {
          const double x = A[i][k], y = A[j][k];
          A[i][k] = c * x - s * y, A[j][k] = s * x + c * y;
        }
        A[i][j] = A[j][i] = 0;
      }
}

/* Remove the negative eigenvalues from the symmetric part of D. */
static void remove_negative(const double *C, double *D)
{
  double A[3][3], V[3][3];
  find_eigenvalues(C, D, A, V);
  for (int k = 0; k < 3; ++k)
    for (int i = 0; A[k][k] < 0 && i < 3; ++i)
      for (int j = 0; j < 3; ++j) D[3 * i + j] -= A[k][k] * V[i][k] * V[j][k] * sqrt(C[i] * C[j]);
}

/* Stress of a point, and its derivative, if the law holds at the fraction theta of the step; returns
 * whether they are finite. */
static int answer_at(const points *p, double theta, double *w, double *s)
{
  const int d = p->components;
  w[THETA] = theta, w[GROWTH] = w[DIRECTION] = 0;
  answer(p, w, s);
  if (fabs(s[0]) > w[TRACTION]) condense_hinge(p, w, s);
  for (int a = 0; a < d + d * d; ++a)
    if (!isfinite(s[a])) return 0;
  return 1;
}

/* Numbers of the elements of a block: of the first one, among its inputs; how many there are. */
static inline double *first_numbers(const element_block *b)
{
  return b->w + (size_t)((2 + b->rates) * b->unknowns + b->states) * b->lanes;
}
static inline size_t all_numbers(const element_block *b) { return (size_t)b->batches * b->numbers * b->lanes; }

/* The tangent of a section among the first numbers of a damped cell; `rows` is the number of numbers of a batch. */
static inline double *tangent_of(const points *p, double *numbers, int rows, int section)
{
  const int n = p->damped->lanes, i = section / p->in_damped;
  return numbers + ((size_t)(i / n) * rows + 9 * (section % p->in_damped)) * n + i % n;
}
static inline void put_tangent(const points *p, double *numbers, int rows, int section, const double *D)
{
  double *to = tangent_of(p, numbers, rows, section);
  for (int k = 0; k < 9; ++k) to[k * p->damped->lanes] = D[k];
}

/* Add a point, whose inputs change, to the committed tangent D of its section, and to its elastic stiffnesses C.
 *
 * The law holds at the end of the step here, and its iteration starts from the state before the
 * step. If a scheme satisfies the law within the step, stresses at the ends may alternate about the
 * yield surface. Every second step of flowing material is then elastic, and its tangent is not the
 * tangent of the motion.
 */
static void add_committed(const points *p, double *inputs, const double *b, double weight, double *D, double *C)
{
  const int d = p->components;
  points at_end = *p;
  double s[3 + 9], r[3] = {0}, share = 1;
  at_end.tried = 0;
  if (!answer_at(&at_end, 1, inputs, s)) answer_at(&at_end, p->theta, inputs, s), share = 1 / p->theta;
  add_answer(3, d, b, share * weight, s, r, D);
  for (int i = 0; i < 3 * d; ++i) C[i % 3] += weight * inputs[p->strain + 2 * d + i / 3] * b[i] * b[i];
}

/* Store the tangents at the strains of the latest response, which remains. */
void keep_tangents(const points *p)
{
  double *w = p->w;
  for (int c = 0; c < p->cells; ++c) {
    double D[9] = {0}, C[3];
    for (int k = 0; k < 3; ++k) D[4 * k] = C[k] = p->rest[k];
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      memcpy(p->inputs, w, p->width * sizeof *w);
      add_committed(p, p->inputs, p->B + 3 * p->components * i, p->weight[i], D, C);
    }
    remove_negative(C, D);
    put_tangent(p, first_numbers(p->damped), p->damped->width, c, D);
  }
}

/* Energies of all points at the end of the step, see point_output. If `accepts`, the end becomes the new state.
 *
 * `kept` of a section has its resultants, the jump of its last point, and the dissipation by plastic
 * strains and by discontinuities.
 */
void end_points(points *p, double *sum, int accepts)
{
  double own[POINT_OUTPUTS + POINT_INPUTS + MOST_VARIABLES + 3], *s = own, *w = p->w, *kept = p->kept;
  const int n = p->strains, d = p->components, states = POINT_INPUTS - TRACTION + p->variables, answers = POINT_OUTPUTS + states + d;
  memset(sum, 0, POINT_OUTPUTS * sizeof *sum);
  for (int c = 0; c < p->cells; ++c, kept += n + POINT_KEPT) {
    const double *e1 = p->e1 + n * c, length = p->length[c];
    double *e0 = p->e0 + n * c, r[6], plastic = 0, broken = 0;
    for (int k = 0; k < n; ++k) {
      const double rest = p->rest[k], change = e1[k] - e0[k];
      r[k] = rest * e1[k];
      sum[LOST] += rest * change * change / 2 * length;
      sum[ELASTIC] += rest * e1[k] * e1[k] / 2 * length;
    }
    if (p->end_loop) p->end_loop(p->of_cell, w, p->answers);
    for (int i = 0; i < p->of_cell; ++i, w += p->width) {
      const double volume = p->weight[i] * length;
      if (p->end_loop) s = p->answers + answers * i;
      else ask(p->end, w, answers, s);
      const double *state = s + POINT_OUTPUTS, *stress = state + states;
      for (int k = 0; k < POINT_OUTPUTS; ++k) sum[k] += volume * s[k];
      plastic += volume * s[WORKED], broken += volume * s[BROKEN];
      for (int a = 0; a < d; ++a)
        for (int k = 0; k < n; ++k) r[k] += p->weight[i] * stress[a] * p->B[n * (d * i + a) + k];
      if (!accepts) continue;
      double *strain = w + p->strain;
      memcpy(strain + d, strain, d * sizeof *w);
      memcpy(w + TRACTION, state, states * sizeof *w);
      w[FLOWS] = w[GROWTH] > 0 ? FLOWING : CLOSED;
      w[GROWTH] = w[DIRECTION] = 0;
    }
    if (!accepts) continue;
    memcpy(e0, e1, n * sizeof *e0);
    memcpy(kept, r, n * sizeof *kept);
    kept[n] = w[JUMP - p->width], kept[n + 1] += plastic, kept[n + 2] += broken;
  }
  if (accepts) p->tried = p->predicts = 0;
}
