/* SPDX-License-Identifier: MIT */
/* What Python sees of the loops in C: what they loop over, and their functions.
 *
 * This is read by cffi as well, which knows no directives of the preprocessor.
 */

/* Adds to `out`, a vector or the entries of a matrix, its part at the unknowns q. */
typedef void (part)(void *self, const double *q, double *out);
typedef struct {
  part *add;
  void *self;
} call;

/* Several of them. */
typedef struct {
  int number;
  const call *part;
} calls;
void add_calls(void *self, const double *q, double *out);

/* -- forms and constant matrices --------------------------------------------------------------- */

enum { MOST_ENTRIES = 144 }; /* of the vector or matrix of a cell: 12 unknowns of degree 3 */

/* A compiled form on some cells. w holds the packed coefficients of a cell, `width` of them, of
 * which those from `at` on are the unknowns of the cell, brought up to date on the way.
 *
 * Where a form is computed for several cells at once, `several` does what add_cells does, and numbers
 * of cells (w, coordinates, row) come in batches of as many cells: the first number of each of these
 * cells, then their second numbers, and so on; the last batch is filled up with the last cell. */
typedef struct cells cells;
typedef void (in_lanes)(const cells *self, const double *q, double *out);
struct cells {
  kernel *tabulate;
  in_lanes *several; /* or none */
  int lanes; /* cells of a batch, a power of two; else 1 */
  int number, of_cell, unknowns; /* cells, degrees of freedom of each, those the form depends on */
  const int32_t *dofs;
  int at, width;
  double *w;
  const double *constants, *coordinates;
  int rows; /* entries of a cell */
  const int32_t *row;
};

typedef struct {
  const cells *first, *then;
  int begins;
} first_cells;

typedef struct {
  int size;
  const double *values;
} vector;

/* A constant matrix A times the step of the nodes from q0, see StepProduct. */
typedef struct {
  int size, rotations;
  const int32_t *rotation, *indptr, *indices, *entry; /* entry: where those of A are in the tangent */
  const double *data;
  double factor, back;
  const double *v, *q0;
  double *space;
} step_product;

void set_cells(const cells *c, const double *q, int at);
void add_cells(void *self, const double *q, double *b);
double value_of_cells(const cells *c, const double *q);
void combine(int size, double a, const double *x, double b, const double *y, double *out);
void extrapolate(int size, const double *x, const double *y, double ratio, double *out);
void add_first_cells(void *self, const double *q, double *b);
void subtract_vector(void *self, const double *q, double *b);
void add_step_force(void *self, const double *q, double *r);
void add_step_tangent(void *self, const double *q, double *tangent);
int find_entries(int rows, const int32_t *indptr, const int32_t *indices, int number,
                 const int32_t *row, const int32_t *column, int32_t *found);
void add_product(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                 const double *x, double *y);
double quadratic_form(int rows, const int32_t *indptr, const int32_t *indices, const double *data,
                      const double *x);
double step_of_nodes(int size, int rotations, const int32_t *rotation, double *s,
                     const double *q0, const double *q1);
double norm(int rows, const double *w, const double *f);
double largest_motion(int rows, const double *w, const double *q);

/* -- material points --------------------------------------------------------------------------- */

/* Python asks for the names in these enums, in their order; the last of each is their number. */

/* The first inputs of the law of a point. After them come, from `strain` of points on: the strains at
 * the end of the step, those before it, and stiffnesses, `components` of each; `variables` before the
 * step; as many that are being solved for, if `solves`; and numbers that C does not know. */
enum point_input {
  GROWTH, DIRECTION,             /* of an iterate: opening */
  TRACTION, JUMP, OPENING, FLOWS, /* the state before the step */
  LENGTH, THETA, DT,
  POINT_INPUTS
};

/* Values of FLOWS: did not grow in the last step, grew in it, may open in this one. */
enum { CLOSED, FLOWING, RELEASED };

/* What the end of a step brings a point; then come stresses and changes of variables. */
enum point_output {
  WORKED, BROKEN, LOST, ELASTIC, HARDENING, RELAXED, RESISTANCE, LEFT, POINT_OUTPUTS
};

enum { MOST_VARIABLES = 16, MOST_CORRECTIONS = 100 }; /* of a law */

enum { POINT_KEPT = 6, POINT_SUMS = 7 }; /* numbers of a cell, and of all: `kept` and `sum` of points */

/* Flags that all points of a scene share in a step; see SearchFlags in material_points.py. */
enum search { OPENED, STIFF, HOLD, OVER, SEARCH_FLAGS };

/* Points in cells, `of_cell` in each, with `width` numbers of each in w; see material_points.py. */
typedef struct {
  int32_t *search;
  /* Of the law: stresses and their derivatives by strains; or, if it solves, residuals and these, see
   * solve_law. Of a discontinuity: resistance and its derivative by the growth. */
  kernel *law, *resistance, *end;
  int solves, components, variables, strain;
  int cells, of_cell, width;
  const double *B, *weight, *rest, *length;
  double theta;
  double *e0, *e1, *w, *r, *D, *kept, *sum;
  double *over; /* largest excess of a closed point over its limit in the latest response */
  int tried;    /* whether an iterate of the step was answered */
} points;

/* Cells with points: forms of the strains, of the forces, which know the resultants r, and of their
 * tangent, which knows them as affine functions b + D e of the strains. */
typedef struct {
  points *points;
  const cells *strains, *force, *tangent;
  int at_r, at_b, at_D; /* where the coefficients of `force` and `tangent` have r, b and D */
  int size, begins;
  double *latest; /* the unknowns that the points responded to */
} inelastic;

/* The first inputs of the law of a rigid-plastic connector, and what the end of a step brings. */
enum slip_input { SLIP, SLIP_DIRECTION, SLIPPED, SLIP_START, SLIP_INPUTS };
enum slip_output {
  SLIP_DISSIPATED, SLIP_LOST, SLIP_STORED, SLIP_LIMIT, SLIP_BACK_FORCE, SLIP_OUTPUTS
};

/* Rigid-plastic connectors, see rigid_plastic.py. */
typedef struct {
  int32_t *search;             /* as that of points */
  kernel *force, *end;         /* force of a slip and its derivative; what the end of a step brings */
  int number, width;
  double *w;                   /* what the kernels know, `width` numbers of each connector */
  double *limit, *back_force;  /* in the accepted state: |force - back force| up to which it is held */
  double *dissipated;          /* by each since the beginning */
  int32_t *slipped;            /* whether each did in the last step, or may in this one; as FLOWS */
  const double *slope;         /* r > 0 of the equation of each, see rigid_plastic.c */
  double *excess;              /* |force - back force| / limit - 1 of those held that bear too much */
  int32_t *way;                /* whether, and in what direction, each slips in the present iterate */
  double *rows;                /* of each connector, three */
} rigid_plastic;

/* Connectors of one motion as cells, with their forces as unknowns. Their laws are rows
 * a e + b f = c in the motion e and the force f; those of springs come of points. */
typedef struct {
  const cells *work, *tangent, *motion;
  points *points;                  /* or none */
  const rigid_plastic *rigid_plastic; /* or none; if neither, the rows stay during a step */
  int number;
  const int32_t *link, *force;     /* of each cell; where each link's force is among the unknowns */
  int row, row_of_tangent;         /* where the coefficients of work and tangent have the rows */
  double *by_cell, *e1;            /* space; motions at the latest unknowns */
  double *e0, *before, *taken, *rate; /* the accepted state: motion, force, work, rate */
  double weight_of_before;         /* of the force that works in a step */
  const int32_t *dofs;             /* seven of each link */
  const double *length;            /* one where it turns, else the size of the scene */
  double size;                     /* of the scene */
} couplings;

void find_motions(const couplings *c, const double *q);
double dissipation_of_rigid_plastic(const rigid_plastic *p, const double *e1, const double *force);
void commit_rigid_plastic(const rigid_plastic *p, const double *e1, double *sums);
void add_couplings_force(void *self, const double *q, double *r);
double missed_by_couplings(void *self, const double *q, const double *r, double scale,
                           double moved);
double commit_couplings(const couplings *c, const double *q, double dt);
void respond(points *p);
void release(const points *p, double least);
void respond_at(const inelastic *m, const double *q);
void add_inelastic_force(void *self, const double *q, double *r);
void add_inelastic_tangent(void *self, const double *q, double *tangent);
void commit(points *p);

/* -- elimination along chains ------------------------------------------------------------------ */

/* What is kept of a vertex: its pivot block as LU, what that makes of the coupling to the vertex after;
 * where there is a spike, the couplings to and from the left end. */
enum { BLOCK = 9, SIDES = 18 };

typedef struct {
  int chains;
  const int32_t *first;     /* first vertex of each chain, and their number */
  const int32_t *spike;     /* whether a chain has a left end */
  const int32_t *row;       /* vertices x 3 */
  const uint8_t *order;     /* vertices x 9 */
  const int32_t *from_ends; /* chains x 18: entries of the ends' rows, left and right */
  const int32_t *indptr;
  const double *data;
  double *pivots, *to_next; /* vertices x BLOCK */
  double *sides;            /* vertices x SIDES, where there are spikes */
  int32_t *swaps;           /* vertices x 3: rows in the order of the pivots */
  double *f;                /* vertices x 3: right-hand sides */

  /* The system of what is left. */
  int left, stay, rows;          /* its entries; those of data that stay; degrees of freedom that do */
  double *left_data, *left_f;
  int left_size;
  const int32_t *entry, *place;  /* of those that stay: in data, in left_data */
  const int32_t *places;         /* chains x 36: where in left_data the blocks of the ends are */
  const int32_t *dof, *number;   /* of those that stay: here, and among those left */
  const int32_t *ends;           /* chains x 6: numbers of the ends among those left */
} chains;

void eliminate(const chains *c);
void reduce(const chains *c, const double *b);
void expand(const chains *c, const double *left, double *x);
int all_finite(int size, const double *values);

/* -- multifrontal elimination, see fronts.c ------------------------------------------------------ */

typedef struct {
  int fronts;
  const int32_t *first, *begin; /* of each front, and of one more: pivot, other unknown */
  const int32_t *rest;          /* unknowns of a front that are not its pivots */
  const int32_t *parent, *up;   /* front that the rest is in; where it is there */
  const int32_t *order, *before, *children; /* see order_fronts */
  const int32_t *entries, *entry, *place;   /* of the fronts: in the data, and in the front */
  const int64_t *at;            /* where the factors of each front begin in values */
  double *values;               /* rows of the pivots, then columns of the rest */
  double *schur, *stack, *space; /* space: for the largest front */
  int32_t *swap;                /* of the pivots: row that each is exchanged with */
} fronts;

int find_fronts(int unknowns, int eliminated, const int32_t *indptr, const int32_t *indices,
                int room, int32_t *first, int32_t *begin, int32_t *rest, int32_t *mark,
                int32_t *next);
void place_in_fronts(const fronts *c, int entries, const int32_t *row, const int32_t *column,
                     const int32_t *front_of, int32_t *place, int32_t *parent, int32_t *up);
int64_t order_fronts(const fronts *c, int32_t *order, int32_t *before, int32_t *children);
int factor_fronts(const fronts *c, const double *data);
void reduce_fronts(const fronts *c, double *b);
void expand_fronts(const fronts *c, double *b);

/* -- Newton's method, see newton.c ------------------------------------------------------------- */

/* Functions of PETSc, which Python finds by these names; its objects are opaque here. Each returns an
 * error, or zero, as what SNES calls does. */
typedef struct {
  int (*PetscErrorMessage)(int error, const char **text, char **specific);
  int (*PetscOptionsUsed)(void *options, const char *name, void *used); /* a bool or an int */
  int (*VecGetArrayRead)(void *vec, const double **values);
  int (*VecRestoreArrayRead)(void *vec, const double **values);
  int (*VecGetArray)(void *vec, double **values);
  int (*VecRestoreArray)(void *vec, double **values);
  int (*VecLockGet)(void *vec, petsc_int *state);
  int (*VecLockReadPop)(void *vec);
  int (*MatSeqAIJGetArray)(void *mat, double **values);
  int (*MatSeqAIJRestoreArray)(void *mat, double **values);
  int (*PCSetUp)(void *pc);
  int (*PCGetFailedReason)(void *pc, int *reason);
  int (*PCApply)(void *pc, void *b, void *x);
  int (*SNESSetFunction)(void *snes, void *f, int (*function)(void *, void *, void *, void *),
                         void *context);
  int (*SNESSetJacobian)(void *snes, void *A, void *P,
                         int (*jacobian)(void *, void *, void *, void *, void *), void *context);
  int (*SNESSetConvergenceTest)(void *snes,
                                int (*test)(void *, petsc_int, double, double, double, int *, void *),
                                void *context, int (*destroy)(void *));
  int (*SNESShellSetContext)(void *snes, void *context);
  int (*SNESShellGetContext)(void *snes, void *context);
  int (*SNESShellSetSolve)(void *snes, int (*solve)(void *, void *));
  int (*SNESSetIterationNumber)(void *snes, petsc_int number);
  int (*SNESSetConvergedReason)(void *snes, int reason);
} petsc_functions;

extern petsc_functions petsc;

enum { OF_LIBRARY = 76 }; /* PETSC_ERR_LIB: KLU says so of a singular matrix */

/* How far a law is missed by an iterate q and its residual r, without dimension; scale is the size
 * of the forces, and moved the largest motion, see largest_motion. */
typedef struct {
  double (*missed)(void *self, const double *q, const double *r, double scale, double moved);
  void *self;
} demand;

/* The equation of a step, and how far its solution is. */
typedef struct {
  int size, inner, forces, stiffnesses;
  const call *force;     /* parts of the residual, the inner forces first */
  const call *stiffness; /* parts of the tangent */
  double *inner_force;   /* what the inner ones add up to */
  int entries;
  double *tangent;
  int held, zeros; /* degrees of freedom and entries that supports hold */
  const int32_t *hold, *zero, *pivot; /* pivot: the entry of each that is held on the diagonal */
  double *reactions, *pivots;
  int idle; /* motions that the tangent holds, their entries and stiffnesses, see null_vectors.py */
  const int32_t *idle_entry;
  const double *idle_stiffness;

  double rtol, loads; /* tolerance; size of the loads */
  const chains *chains;
  void *x, *left, *factors, *left_f, *left_x; /* in PETSc: the unknowns; what chains leave of the */
                                              /* tangent, its factors, two vectors */
  double *residual, *change;                  /* at an iterate, and what it is changed by */
  const double *found, *weight;               /* entries of left_x; see Solver */
  int least, most;                             /* iterations */
  const int32_t *diagonal;
  double *space;
  const double *lengths, *moves; /* see Solver */
  double scene, moved; /* size of the scene; largest motion of the latest iterate, at most that size */
  int demands;
  const demand *demand; /* of connectors */
  double last, best;
  int near, slow, patience, modified; /* near: the tangent is kept in the next iteration */
  double rate;                        /* of a modified Newton's method, by which residuals fall */
} equation;

/* Values of SNESConvergedReason. */
enum {
  ITERATING = 0, AT_ROUND_OFF = 2, CONVERGED = 3,
  SINGULAR = -3, TOO_MANY = -5, STALLED = -6, DIVERGED = -9
};

void residual(equation *e, const double *q, double *r);
void assemble(equation *e, const double *q);
int factor_tangent(const equation *e, int *failed);
int solve_tangent(const equation *e);
void find_last_digits(const equation *e, const double *q, double *digits);
int judge(equation *e, const double *q, int iteration, double residual, double scale,
          double floor);
int snes_function(void *snes, void *x, void *f, void *self);
int snes_jacobian(void *snes, void *x, void *A, void *P, void *self);
int snes_newton(void *snes, void *x);
int snes_test(void *snes, petsc_int iteration, double x, double s, double f, int *reason,
              void *self);
