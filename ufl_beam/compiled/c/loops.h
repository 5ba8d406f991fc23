/* SPDX-License-Identifier: MIT */
/* Declarations of the C loops for Python: their data and their functions.
 *
 * cffi reads this file as well; it knows no preprocessor directives.
 */

/* Adds a contribution at the unknowns q to `out`, a vector or the entries of a matrix. */
typedef void (part)(void *self, const double *q, double *out);
typedef struct { part *add; void *self; } call;

part add_cells, add_predicted_tangent, subtract_vector,
  add_step_force,
  add_step_tangent, add_inelastic_force, add_inelastic_tangent, add_block, add_block_tangent;

/* -- forms and constant matrices --------------------------------------------------------------- */

/* Entries of the vector or matrix of a cell, at most: the forces of 12 unknowns of
 * degree 3, differentiated by the tangents at 3 points, need 324. */
enum { MOST_ENTRIES = 324 };
enum { SOME = 128 };         /* cells of a block whose data stay in the processor's cache between loops */

/* A compiled function of some cells. Its inputs are the unknowns of a cell and, in w, numbers.
 * `width` is the distance to the numbers of the next cell, as they may be a part of other inputs.
 *
 * The entry of a cell is added at the index in `row`. Without `row`, it is added in the matrix row
 * that starts at `begin`, at the offset in the `pattern` of the cell. Without either, it is added
 * at its degree of freedom.
 *
 * If several cells are computed at once, `several` replaces the loop of add_cells. Data of cells
 * (w, row, patterns) come in batches: the first number of each cell of a
 * batch, then the second numbers, and so on. Copies of the last cell fill up the last batch.
 */
typedef struct cells cells;
typedef void (tabulate_batch)(const cells *self, const double *q, double *out);
struct cells {
  kernel *tabulate;
  tabulate_batch *several; /* or none */
  int batch_size; /* cells of a batch, a power of two */
  int number, of_cell; /* cells, unknowns of each */
  const int32_t *dofs;
  int width, inputs; /* inputs: of a cell, including unknowns */
  double *w, *all; /* all: space for the inputs of a cell */
  int rows; /* values of a cell */
  const int32_t *row, *begin; /* or none */
  const uint8_t *pattern;
  const int32_t *has; /* index of the pattern of each batch */
  int in_rows; /* number of patterns, the first ones, in which the entries of a row are adjacent */
  double *each; /* entries of all cells in the latest evaluation, in batches; or none */
};

/* State of the forces that the tangents of cells in a static step contain. begins: forces before the step, or forces
 * at extrapolated strains; exact: later forces are forces at the iterate, not predicted; stale: whether a tangent has
 * been computed since the prediction; to: the configuration to which the tangent has predicted a change, in space, if
 * it is not the iterate; in_space: whether cells have motions to it. */
typedef struct { int32_t begins, exact, stale, in_space; const double *to; } predicted_forces;

/* Some entries of a vector, or all of them. */
typedef struct {
  int size;
  const int32_t *dof; /* or none */
  const double *values;
} vector;

/* A constant matrix, stored by runs of rows. In a run, each row has the distances from the diagonal of the row `period`
 * rows before. Rows with equal distances form a strip. A run has `period` strips; a short run has empty ones. */
typedef struct {
  int runs, period;
  const int32_t *first;        /* first row of each run, then the number of rows */
  const int32_t *begin, *away; /* begin: range of each strip in `away`, the columns less the row */
  const int32_t *at;           /* where the entries of each strip begin in `data` */
  const double *data;          /* first entry of each row of the strip, then the second ones, and so on */
} constant_matrix;

/* A constant matrix A times the step s of the nodes from q0, see StepProduct. */
typedef struct {
  int size, rotations;
  const int32_t *rotation;
  const constant_matrix *A;
  const int32_t *begin;  /* of each row of the tangent; offsets of the entries of A in it: */
  const uint8_t *place;  /* in one byte each, or */
  const int32_t *far;    /* if one byte is not enough, in four */
  double factor, back;
  const double *v, *q0, *low; /* low: of the equation, or none */
  double *rate;          /* factor s - back v in the latest force */
  double *space;
  double *turn, *half; /* latest increments of the rotations, and tangents of their halves */
} step_product;

void set_cells(const cells *c, const double *q, int at);
int find_entries(int rows, const int32_t *indptr, const int32_t *indices, int number,
                 const int32_t *row, const int32_t *column, int32_t *found);
int find_blocks(int rows, const int32_t *indptr, const int32_t *indices, int number, int of_cell,
                int lanes, const int32_t *dofs, int32_t *place, uint8_t *column);
int64_t find_pattern(int size, int groups, const int32_t *first, const int32_t *dof, int32_t *begin,
                     int32_t *group, int32_t *seen, int32_t *indptr, int32_t *indices);
void add_product(const constant_matrix *A, const double *x, double *y);
void give_back_memory(void);
double norm(int rows, const int32_t *at, const double *w, const double *f);

/* -- forces in cells --------------------------------------------------------------------------- */

/* Resultants of the forces on the nodes of a cell in the equation of a step, see cell_forces.py. */
enum cell_number {
  START_X, START_Y, START_M, END_X, END_Y, END_M, COUPLE, SKEW_X, SKEW_Y, CELL_NUMBERS
};

/* Origin of forces on nodes of cells: stresses, a work of a user, or densities along the cell. */
enum force_kind { STRESS, WORK, DENSITY };

/* A form whose entries are forces on nodes of cells. `latest` and `accepted` are these entries in
 * the latest residual and in the residual of the accepted step; if the form is linear in a vector,
 * they are this vector instead. Entries that depend only on configurations are computed on demand. */
typedef struct {
  const cells *form; /* form that is linear in the vector; or none */
  double **latest, *accepted; /* latest: none if entries are computed on demand, or if another form has
                               * the same vector */
  double *const *vector;
  double *const *entries; /* of the accepted step, in batches */
  double *const *tee;     /* entries in the latest residual, in batches; or none */
  double factor;
  int kind, number, batch_size;
  const int32_t *cell; /* numbers of its cells; or none if the form has all cells */
} force_in_cells;

/* Vectors of loads on nodes of cells, and their load factors. */
typedef struct {
  int vectors;
  const double *const *vector; /* degrees of freedom of each cell; or none */
  const double *latest;        /* load factors */
  double *accepted;
} loads_in_cells;

typedef struct {
  int cells, nodes, forces; /* nodes: of a cell */
  force_in_cells *force;
  const loads_in_cells *loads; /* or none */
  const double *from_middle;   /* position of each node of a cell relative to its middle, divided by the
                                * length of the cell */
  const double *initial;       /* known resultants of the state before the first step; then none */
} cell_forces;

void accept_cell_forces(cell_forces *c);
void find_cell_forces(const cell_forces *c, int now, double *out);

/* Minima and maxima of some numbers so far, and the times at which they were first reached. */
typedef struct {
  int size;
  double *low, *high, *time_low, *time_high;
} extent;

/* Extremes of section forces at points of the cells and of motions, see extremes.py. */
typedef struct {
  const cell_forces *forces;
  const cells *along;       /* section forces as functions of the first of CELL_NUMBERS and of `axes` */
  const double *axes;       /* angles at both ends of each cell, vector between them; in batches */
  int first;                /* number of CELL_NUMBERS that matter */
  int in_order;             /* whether all forms have all cells, in the same batches */
  double between, *q;       /* fraction of the step for the configuration of the forces; space for it */
  double *numbers, *some;   /* space: for all cells; for the numbers of SOME cells */
  extent of_forces, of_motion;
} watch;

void watch_step(const watch *w, int now, double t, const double *before, const double *q);

/* -- material points --------------------------------------------------------------------------- */

/* Python reads the names in these enums in their order; the last name is their number. */

/* The first inputs of the law of a point. `variables` before the step follow, which belong to the state. Further
 * inputs begin at the index `strain` of `points`: strains at the end of the step, strains before the step, and
 * stiffnesses, `components` of each; if `solves`, the variables at the end of the step, which are unknowns; and
 * parameters of the law. */
enum point_input {
  GROWTH, DIRECTION, /* of an iterate */
  FLOWS, LENGTH, THETA, DT,
  TRACTION, JUMP, OPENING, /* the state before the step */
  POINT_INPUTS
};

/* FLOWS: the jump did not grow in the last step, grew in the last step, may grow in this step. */
enum { CLOSED, FLOWING, MAY_OPEN };

/* Energies of a point at the end of a step, J/m³; the new state from TRACTION on, and stresses follow. Energies of
 * the state are stored elastically and by hardening. Energies of the step are dissipated by plastic strains and by
 * the discontinuity; lost numerically if theta were 1; released by breaking and by the error of steps for nonlinear
 * elasticity; and the excess of the work of mean stresses on plastic strains over that of smaller end stresses. */
enum point_output { WORKED, BROKEN, LOST, ELASTIC, HARDENING, RELEASED, RELAXED, POINT_OUTPUTS };

enum { MOST_VARIABLES = 16, MOST_CORRECTIONS = 100 }; /* of a law */

enum { POINT_KEPT = 3 }; /* numbers of a section in `kept` after the resultants, see end_points */

extern const double NO_ENERGY; /* relative size below which dissipation counts as zero */

enum { LINE = 3 }; /* strain, stress and slope of the tangent line of a point */

/* Flags of the present search for an equilibrium, which all points and connectors of a scene share.
 * OPENED: a point has opened. STIFF: points that do not open answer with their elastic stiffness,
 * and if it is STIFFEST, rigid-plastic connectors that soften with a stiffness of the opposite sign.
 * HOLD: points that do not flow stay closed. OVER: a held point has borne more than its limit. */
enum search { OPENED, STIFF, HOLD, OVER, SEARCH_FLAGS };
enum { STIFFEST = 2 };

/* Computes the answers of several points at once, from the inputs of each, point after point. */
typedef void (answer_loop)(int number, const double *w, double *answers);

typedef struct element_block element_block;

/* Points in cross-sections, `of_cell` in each of `cells` sections, with `width` numbers of each point
 * in w; see material_points.py. The sections are at the integration points of cells, one cell after
 * the other; a spring has one section. */
typedef struct {
  int32_t *search;
  /* law: stresses and their derivatives by strains; if `solves`, also residuals and their
   * derivatives, see solve_law. resistance: of a discontinuity, and its derivative by the growth.
   * end: outputs at the end of a step, see point_output. */
  kernel *law, *resistance, *end;
  answer_loop *law_loop, *end_loop; /* the same for all points of a section; or none */
  double *answers;                  /* space for their results; for two answers of the law to each point */
  kernel *own; /* dissipation of a law that must not give energy, and its size; or none */
  int solves, components, variables, strain;
  int cells, of_cell, width;
  int strains; /* of a section: 3, in space 6 */
  const double *B, *weight, *rest, *length;
  double theta;
  double *e0, *e1, *w, *r, *D, *kept, *sum;
  double *over; /* largest excess of a closed point over its limit in the latest response */
  int tried;    /* whether the law has answered an iterate of this step */
  /* Tangent lines of points of one strain: in the latest response, and in the last tangent, if
   * `predicts` says that there is one in this step; see follow_prediction. */
  double *line, *predicted;
  int predicts;
  const double *linear; /* strains of sections that a static iteration predicts; or none */
  double *unlike; /* largest resultants by which a point's answer differs from the stress of its strain */
  /* Cells with tangent damping, whose first numbers are the derivatives D of the accepted state without negative
   * eigenvalues; or none. Number of sections in each. */
  const element_block *damped;
  int in_damped;
  double *inputs;        /* space for the inputs of a point */
  double alpha, *entry[POINT_OUTPUTS]; /* alpha of the scheme; entries of the ledger, or none */
} points;

/* Cells with points in `in_cell` sections each. The block of the cells computes the strains of the sections, and in
 * statics those that the latest tangent predicts. */
typedef struct {
  points *points;
  int in_cell;
  element_block *block;
  const cells *strains, *predicted, *force; /* predicted: none in dynamics */
  int at_r, at_predicted, at_D; /* indices of the first modes of resultants, resultants in the tangent, and D */
  double *e, *change;           /* predicted strains; space */
  double *forces, *last_b, *last_D; /* of the tangent, in statics; b and D of the latest tangent */
  const double *q0, *q_before;  /* configurations at the beginnings of this step and the last one */
  double ratio;                 /* length of this step divided by the length of the last one */
  int size;
  double scene;   /* size of the scene */
  double *latest; /* unknowns of the latest response */
} inelastic;

void respond(points *p);
void respond_at(const inelastic *m, const double *q);
void put_tangents(const inelastic *m);
int gives_energy(const points *p);
void keep_tangents(const points *p);
void end_points(points *p, double *sum, int accepts);

/* -- elimination along chains ------------------------------------------------------------------ */

/* Blocks that couple the first and last vertex of a chain with its ends: rows, then columns. */
enum end_block { LEFT_FIRST, RIGHT_LAST, FIRST_LEFT, LAST_RIGHT };

typedef struct {
  int count, unknowns; /* of chains; of a vertex, n: three in the plane, six in space */
  const int32_t *first;     /* first vertex of each chain, and their number */
  const int32_t *spike;     /* whether a chain has a left end */
  const int32_t *dof, *begin; /* of each vertex: first degree of freedom; where its rows begin */
  const uint8_t *at;        /* vertices x 3: where the blocks begin in a row, see beam_elimination.c */
  const int32_t *with_ends; /* chains x 4 x n x n: entries of the blocks that couple with the ends, see
                             * end_block */
  const double *data;
  double *pivots, *to_next; /* vertices x n x n: pivot block D as LU; D^-1 times the coupling to the next */
  uint8_t *swaps;           /* vertices x n: rows in the order of the pivots */
  double *f;                /* D^-1 times the reduced right-hand side, at the degrees of freedom of
                             * vertices */

  /* The reduced system. */
  int left, stay, rows;          /* entries of it; entries of data that stay; degrees of freedom that stay */
  double *left_data, *left_f;
  int left_size;
  const int32_t *entry, *place;  /* indices of the entries that stay: in data, in left_data */
  const int32_t *places;         /* chains x 4 x n x n: indices of the blocks of the ends in left_data */
  const int32_t *kept, *number;  /* degrees of freedom that stay: in the full system, in the reduced system */
  const int32_t *ends;           /* chains x 2 n: degrees of freedom of the ends in the reduced system */
} chains;

void eliminate(const chains *c, const double *b);
void reduce(const chains *c, const double *b);
void expand(const chains *c, const double *left, double *x);
int all_finite(int size, const double *values);

/* -- multifrontal elimination, see multifrontal.c ------------------------------------------------------ */

enum {
  WIDE = 8,      /* columns of a product that are computed at once */
  ONE_FRONT = 24 /* largest number of unknowns of a system that is one front */
};

typedef struct {
  int size, fronts;
  const int32_t *unknown;       /* unknowns of the system in the order of elimination */
  const int32_t *first, *begin; /* of each front, and one more: first pivot, where its `rest` begins */
  const int32_t *rest;          /* unknowns of a front that are not its pivots */
  const int32_t *parent, *up;   /* front that receives the Schur complement; rows there */
  const int32_t *order, *before, *children; /* see order_fronts */
  const int32_t *entries, *entry, *place;   /* of each front: indices in the data, indices in the front */
  const int64_t *at;            /* where the factors of each front begin in values */
  double *values;               /* rows of the pivots, then columns of the rest */
  double *schur, *stack, *space; /* space: for the largest front and 2 WIDE numbers more */
  int32_t *swap;                /* for each pivot: the row with which it is exchanged */
  double *x;                    /* right-hand side and solution, in the order of elimination */
  double *unit;                 /* space for a number for each pivot of a front */
} fronts;

int find_fronts(int unknowns, int eliminated, const int32_t *indptr, const int32_t *indices,
                int room, int32_t *first, int32_t *begin, int32_t *rest, int32_t *mark,
                int32_t *next);
void place_in_fronts(const fronts *c, int entries, const int32_t *row, const int32_t *column,
                     const int32_t *front_of, int32_t *place, int32_t *parent, int32_t *up);
int64_t order_fronts(const fronts *c, int32_t *order, int32_t *before, int32_t *children);
int factor_fronts(const fronts *c, const double *data);
void reduce_fronts(const fronts *c, const double *b);
void expand_fronts(const fronts *c, double *found);

/* -- Newton's method, see newton.c ------------------------------------------------------------- */

/* Functions of PETSc, which Python looks up under these names; PETSc's objects are opaque here.
 * Each function returns an error code or zero, as the callbacks of SNES do. */
typedef struct {
  int (*PetscErrorMessage)(int error, const char **text, char **specific);
  int (*PetscOptionsUsed)(void *options, const char *name, void *used); /* a bool or an int */
  int (*VecGetArrayRead)(void *vec, const double **values);
  int (*VecRestoreArrayRead)(void *vec, const double **values);
  int (*VecGetArray)(void *vec, double **values);
  int (*VecRestoreArray)(void *vec, double **values);
  int (*VecGhostUpdateBegin)(void *vec, int insert_mode, int scatter_mode);
  int (*VecGhostUpdateEnd)(void *vec, int insert_mode, int scatter_mode);
  int (*VecGhostGetLocalForm)(void *vec, void **local);
  int (*VecGhostRestoreLocalForm)(void *vec, void **local);
  int (*VecLockGet)(void *vec, petsc_int *state);
  int (*VecLockReadPop)(void *vec);
  int (*PetscObjectStateGet)(void *object, int64_t *state);
  int (*PetscObjectStateSet)(void *object, int64_t state);
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
  int (*SNESSolve)(void *snes, void *b, void *x);
  int (*SNESMonitor)(void *snes, petsc_int iteration, double norm);
  int (*SNESGetConvergedReason)(void *snes, int *reason);
  int (*SNESSetConvergedReason)(void *snes, int reason);
} petsc_functions;

extern petsc_functions petsc;

enum { INSERT_VALUES = 1, ADD_VALUES = 2, FORWARD = 0, REVERSE = 1 }; /* of InsertMode, ScatterMode */

enum { OF_LIBRARY = 76 }; /* PETSC_ERR_LIB: KLU reports a singular matrix by this error */

/* Relative violation of a law at an iterate q with the residual r. scale is the size of the forces;
 * moved is the largest motion, see find_motion; motions up to quiet are round-off. */
typedef double (miss)(void *self, const double *q, const double *r, double scale, double moved, double quiet);
typedef struct { miss *missed; void *self; } law_residual;
miss missed_by_points, missed_by_block;

/* A rotation of two components of a motion into the axes of a support; c and s are its cosine and
 * sine. In space there may be several, one after another. The arrays list the entries of the tangent in the rows and in the columns of both degrees
 * of freedom. */
typedef struct {
  int i, j, in_rows, in_columns;
  double c, s;
  const int32_t *row_i, *row_j, *column_i, *column_j;
} turned_axes;

/* How numbers of the processes that share a scene are combined: sum, root of the sum of squares,
 * maximum. */
enum agreement { TOTAL, HYPOT, LARGEST };

/* Exception that a function of a user has raised: failure of the step, or another one, which ends
 * the run. */
enum raised { NOTHING, STEP_FAILED, OTHER };

/* Forces in the tangents of static steps, see BeamCell of blocks/beams.py. PREDICTED: forces
 * before the step, then forces that the last iteration predicted. FIRST: forces before the step,
 * then forces at the iterate. EXACT: always forces at the iterate. */
enum tangents { PREDICTED, FIRST, EXACT };

/* The control equation of an equilibrium path and its unknown t, see path_controls.py. */
typedef struct {
  void *handle;
  double *t;
  void (*arrive)(void *handle, const double *x);  /* store an iterate before its residual is computed */
  int (*change)(void *handle, const double *x);   /* compute the change of an iteration; 1 if that fails */
  int (*met)(void *handle);
} border;

/* A step, see Step in time_scheme.py. */
typedef struct {
  double t0, t1, dt, load_time, motion_time, fraction, at, ratio;
  const double *q0, *q_before;
} time_step;

/* Phase of a term when a step begins or is accepted: q1 is the end of the step, s the step of the
 * nodes. Both are none when the step begins. */
typedef void (phase)(void *self, const time_step *step, const double *q1, const double *s);
typedef struct { phase *run; void *self; } phase_call;
typedef struct { int number; const phase_call *call; } phases;

/* Whether a first change that is very long makes a tangent singular, see goes_astray of newton.c. */
enum doubt { CERTAIN, DOUBTS, DOUBTED };

/* The equation of a step and the state of its solution. Unknowns and residuals are in the axes of
 * supports. */
typedef struct {
  int size, owned, inner, forces, stiffnesses; /* owned: degrees of freedom of this process, the first ones */
  const call *force;     /* contributions to the residual, the internal forces first */
  const call *stiffness; /* contributions to the tangent in addition to the next two */
  const step_product *product; /* or none */
  const cells *cells;          /* or none */
  const int32_t *indptr;
  double *inner_force;   /* sum of the internal forces; or none */
  double inner_size;     /* norm of the internal forces */
  double *tangent;
  int held, zeros; /* degrees of freedom that supports hold; entries that become zero */
  const int32_t *hold, *zero, *pivot; /* pivot: the diagonal entry of each held degree of freedom */
  double *reactions, *pivots;
  int turned;
  const turned_axes *axes;
  double *plane; /* unknowns in the axes of the plane, if some axes are turned */
  int idle; /* zero-energy modes that springs in the tangent hold, see newton.py */
  const int32_t *idle_entry;
  const double *idle_stiffness;

  double rtol, loads; /* tolerance; size of the loads */
  int load_vectors;
  const vector *const *load; /* forces of loads */
  const chains *elimination;
  const fronts *fronts;  /* factors of the reduced system; or none: then PETSc factorizes it */
  void *left, *factors, *left_f, *left_x; /* in PETSc: reduced system, its factors, two vectors */
  void *snes, *x, *f, *y;                 /* in PETSc: solver; unknowns, residual, change */
  double *unknowns, *residual, *change;   /* local values of these; others use `change` between solutions */
  double *low; /* sum of the round-off of the iterate in this step, see move_to; or none */
  double *found;         /* solution of the reduced system; in PETSc the entries of left_x */
  const double *weight;  /* see Solver */
  int least, most;                             /* numbers of iterations */
  const int32_t *diagonal;
  double *space;
  const double *lengths; /* see Solver */
  const uint8_t *moves;
  double scene, moved; /* size of the scene; largest motion of the latest iterate, at most that size */
  int law_residuals, demanding; /* demanding: whether any process has law_residuals */
  const law_residual *law_residual; /* of connectors and points */
  int32_t *switched;    /* set if a row of a connector has changed between motion and force since the
                         * tangent */
  double last, best;                  /* residual of the previous iterate; least residual so far */
  int near, slow, patience; /* near: iterations that will keep the tangent */
  int iterations, reason, total;      /* of the latest solution; total: of all */
  int careful;           /* whether changes are scaled by a line search */
  int monitored;         /* whether options of PETSc or monitors ask for PETSc's own method */
  int searches;          /* whether the line search of newton.c is used nevertheless */
  enum doubt doubt;
  int error;             /* of PETSc */
  int raised;            /* see enum raised */
  const border *border;  /* or none */
  int predictions;
  predicted_forces *const *predicted;
  int32_t *search;       /* flags of points that may open; or none */
  phases again;          /* restart a step: discard the trial values of iterates */
  /* Of static steps in space, see move_to, in axes of the scene: rotations of nodes, three of each; base: unknowns before
   * the step; turning, turned_by: rotation vectors of the step, to the iterate and before its latest change; to: see
   * predicted_forces. */
  int rotations;
  const int32_t *rotation;
  double *base, *turning, *turned_by, *to;
  double *conjugate, *start, *aside; /* space: of a line search; of a solution with stiffer tangents */
  void *handle;
  void (*agree)(void *handle, int number, const int *how, double *values); /* none on one process */
  int (*solve)(void *handle, int anew);                /* on several processes: computes the change */
  void (*find_conjugates)(void *handle, const double *q);
  int (*find_zero_modes)(void *handle);
  int (*forget_zero_modes)(void *handle);
} equation;

/* Values of SNESConvergedReason. */
enum {
  ITERATING = 0, AT_ROUND_OFF = 2, CONVERGED = 3,
  SINGULAR = -3, TOO_MANY = -5, STALLED = -6, DIVERGED = -9
};

double over_processes(const equation *e, enum agreement how, double here);
void turn_axes(int number, const turned_axes *axes, double *x, int way);
int residual(equation *e, const double *x, double *r, void *f);
void fill_tangent(const equation *e, const double *q);
void hold_tangent(const equation *e);
int factor_tangent(const equation *e, int *failed);
int solve_tangent(const equation *e, int reduced);
void find_motion(equation *e, const double *x);
void find_round_off(const equation *e, const double *q, double *forces);
void restart(const equation *e, enum tangents kind);
int snes_function(void *snes, void *x, void *f, void *self);
int snes_jacobian(void *snes, void *x, void *A, void *P, void *self);
int snes_newton(void *snes, void *x);
int snes_test(void *snes, petsc_int iteration, double x, double s, double f, int *reason,
              void *self);

/* -- prediction of the end of a step, see steps.c ------------------------------------------------- */

/* Points of the polynomial that predicts the end of a stage; known ends of stages, also after the
 * stages of a step are taken back. A polynomial through more points needs more iterations. */
enum { POINTS_OF_GUESS = 3, MOST_KNOWN_ENDS = 8 };

/* The last steps. `second` is the second difference of the configuration; in dynamics only. */
typedef struct {
  int size, equal;   /* equal: number of last steps with the same length, up to three */
  double dt;         /* length of the last step; infinite if there was none */
  double *q_before;  /* configuration at the beginning of the last step */
  double *second;
  const double *weight; /* as for residuals */
  double scene, unknowns; /* size of the scene; number of unknowns on all processes */
  /* Product of the last two second differences, and the square of each: means over the unknowns,
   * displacements as fractions of the size of the scene. */
  double both, now, before;
  double step;              /* square of the last step */
  double repeated;          /* fraction of `second` that the next step is expected to repeat */
  /* Compositions only: the last ends of stages, the latest one first, each with its time and its
   * configuration; `place` has their places in `past`. */
  int known, place[MOST_KNOWN_ENDS];
  double time[MOST_KNOWN_ENDS];
  double *past;
} prediction;

void predict(const prediction *p, double dt, const double *q, double *out);
void enter_step(prediction *p, double dt, const double *q, const double *q1);
void compare_differences(prediction *p);

/* -- steps one after the other, see steps.c ----------------------------------------------------- */

/* A function of time: piecewise linear and constant outside the points, or a Python function. */
typedef struct {
  int points;
  const double *t, *y;
  double (*value)(void *handle, double t);
  void *handle;
} time_function;

/* -- blocks: all elements with one statement, see blocks/statement.py ---------------------------------- */

/* A compiled function of elements. `several` computes all batches: the first input of each element of a
 * batch, then the second ones, and so on; outputs alike. `inserts` adds outputs for cells, see struct cells. */
typedef void (batch_function)(int batches, const double *w, double *out);
typedef struct {
  batch_function *several; /* or none */
  tabulate_batch *inserts; /* or none */
  kernel *one;
  int outputs;
} element_function;

/* Time of a number of a step. Growing: a value that grows from that at the end of the last step, by the applied
 * fraction of a step. Others are values at the time of the applied fraction of the loads, and of all loads; before
 * and at the end of the step, and at the time between for which the trapezoidal rule takes loads; half a step
 * before and after the loads; LATER and twice as much after the step; at the end of all motions. Moving: grows like a
 * prescribed motion; last: the number before it, at the end of the last step. */
enum time_of_number {
  TIME_GROWING, TIME_NOW, TIME_WHOLE, TIME_BEFORE, TIME_BETWEEN, TIME_END, TIME_HALF_BEFORE, TIME_HALF_AFTER,
  TIME_LATER, TIME_TWICE_LATER, TIME_WHOLE_MOTION, TIME_MOVING, TIME_LAST, TIMES_OF_NUMBERS
};
enum { LATER = 100 }; /* microseconds */

/* Numbers of all steps: length (s), and the fraction of changes of loads at its end and in its equation. */
enum number_of_step { LENGTH_OF_STEP, FRACTION, REACHED, NUMBERS_OF_STEP };

/* Purpose of the computation of energies and of new numbers: outputs only; energies of a state; rates after a trial
 * step; state that begins a run; step that is accepted. */
enum end_of_step { COMPUTE, ENERGIES, TRIAL, BEGIN, ACCEPT };

/* A number of an element that solutions record: of a state; of the last step; sums over all steps, of any number and
 * of the work of a connector. */
enum recorded_number { RECORDED_STATE, RECORDED_STEP, RECORDED_TOTAL, RECORDED_WORK };

typedef struct rates rates;

/* First modes of an element, which C sets: whether it is held in the search; whether the iterate is the first one;
 * whether softening has the opposite sign in the tangent. Others select the branch of a law in an iterate. */
enum mode_of_block { MODE_HELD, MODE_FRESH, MODE_STIFFENED, FIRST_MODE };

/* Inputs of an element are motions of its nodes at the end of the step and before it, `unknowns` each, `rates` of
 * them, its state, its numbers, `steps` numbers of the step, and its modes, see mode_of_block. The last unknowns of an
 * element with laws are their forces. The last outputs of force_of are its laws, then for each law whether it holds
 * the motion, and its derivatives by the force and by all motions of the laws. */
struct element_block {
  const element_function *force_of, *tangent_of;
  const element_function *end_of; /* state, shared numbers, recorded numbers, energies; or none */
  int lanes, elements, batches, unknowns, rates, states, numbers, steps, modes, width; /* lanes: elements of a batch */
  int32_t *acting, *batch;  /* number of batches with elements that act in this step; their indices */
  int ranges;               /* the first numbers of the step, of which one is within the range of an acting element */
  const double *range;      /* lower ends, then upper ends, of a batch; or none */
  int columns;              /* of tables: last modes that depend on the mode before them; or zero */
  const double *const *table; /* of each element: rows, which begin with the least value of that mode */
  const int32_t *table_rows;
  const int32_t *dofs;      /* degree of freedom of each motion of an element; of inserted cells, for derivatives only */
  int size;                 /* of loads: number of degrees of freedom on which they act */
  const int32_t *dof, *at;  /* of loads: these; index in `dof` of each motion of an element */
  const int32_t *entry;     /* entry of the matrix of each output of tangent_of */
  int functions;            /* of time */
  const time_function *function;
  const int32_t *when;      /* time_of_number of each */
  double *t;                /* time of the state, and at the end of the step */
  int32_t *begun;           /* whether forces of a last step are known */
  double *now, *end, *before; /* their values in the equation, at the end of the step, at the end of the last
                               * step; then the length of the step */
  const int32_t *from;      /* index in `now` of each number of the step of an element */
  double *state;            /* of the elements in batches */
  double *w, *out, *space;  /* inputs; space for outputs of all elements, and for inputs and outputs of one */
  double **each;            /* forces of elements in the latest residual */
  double *force, *force_before; /* of loads: forces in the latest residual and in the last step; size */
  double weight_of_before, *work; /* work: entry of the ledger of the work of loads, minus the forces; or none */
  int stored, lost, entered; /* numbers of energies: of a state; of a step, the first ones are lost */
  int knows_before;         /* whether the energies before the step follow these */
  double *energy, *const *entries; /* energies of the state; entries of all in the ledger */
  /* Of elements with rates; otherwise none: */
  const rates *nodal;
  const equation *equation;
  int groups, shares, kept; /* numbers that the elements of a group share; kept: by a trial step */
  const int32_t *group;     /* of each element */
  double *shared, *new_shared;
  const int *totals;        /* TOTAL for each shared number */
  int laws;
  const double *length;     /* of the motion of each law: 1 for a rotation, else the size of the scene */
  int32_t *holds, *switched; /* whether each law of an element with modes holds; see equation */
  const double *stiffness;  /* elastic stiffness of each law of an element with internal variables; or none */
  const element_function *power_of; /* power at a part of the step, which is the first number of an element; or none */
  double scene;             /* size of the scene */
  const element_function *mode_of; /* modes in an iterate, excess, whether the element has opened; or none */
  const int32_t *begins;    /* of each further mode: index of the state that is its value when a step begins, or -1 */
  int32_t *search, *free;   /* see points; free: elements that may change their modes while others are held */
  double *excess;           /* violation of the modes of held elements */
  int opens;                /* whether elements are held in the search */
  points *inner;            /* material points, of cells or one of each spring, whose strain is the motion; or none */
  inelastic *sections;      /* of cells with points; or none */
  void (*ask)(void *handle); /* function of Python that sets the modes; or none */
  void *asked;
  int recorded;             /* numbers that solutions record */
  const int *recorded_kind; /* recorded_number of each */
  double *record;           /* `recorded` numbers of each element */
  const cells *inserted;    /* cells whose tangent is inserted as that of a form; or none */
  predicted_forces *predicted; /* of cells in static steps; further modes are then motions at the latest tangent, and
                             * two numbers, see set_prediction */
  int turns;                /* of loads: whether moments are in axes of nodes before the step, at the end of which they act */
};

/* A block, and the same in a neighbouring scene, whose state follows from the configuration. */
typedef struct { const element_block *block, *neighbour; } block_pair;

void set_numbers_of_step(const element_block *b, const time_step *step);
void end_step_of_block(const element_block *b, const double *q, enum end_of_step what);
void respond_springs(const element_block *b, const double *q);
void evaluate_along(const element_block *b, const element_function *f, const double *q, int directions,
                    const double *const *direction, int width, double *w, double *out, const int32_t *entry,
                    double *tangent);

/* Vectors of loads at some degrees of freedom times functions of time, see DeadLoads. */
typedef struct {
  int size, vectors;
  int whole; /* whether the latest step reached its loads completely */
  const int32_t *dof;
  const double *const *vector;
  const time_function *factor;
  double *asked; /* factors that the functions gave for the latest step; NaN before the first */
  double *factors, *factors_at_end, *factors_before; /* in the equation; at the ends of this step and the
                                                      * last one */
  double *force, *before; /* in the equation; at the end of the last step */
  double weight_of_before;
  double *work; /* entry of the ledger */
} dead_loads;

/* Coefficients of a step, see Coefficients of time_scheme.py. Their rows multiply the rates: the
 * step or a change of velocities, the velocities, the previous velocities, and further rates of the
 * scheme. */
enum { MOST_RATES = 6, MOST_KNOWN = 16, OF_SCHEME = 2 * MOST_RATES + MOST_RATES * MOST_RATES };
typedef struct {
  double dt, last_dt;
  int more, gives; /* number of further rates that are known before the step, and after it */
  double inertia[MOST_RATES], velocity[MOST_RATES];
  double rates[MOST_RATES][MOST_RATES], slip[MOST_RATES];
} scheme_numbers;

/* Velocities and further rates of a time scheme. */
struct rates {
  int size, number;            /* of the rates; the first is a step or a change of velocities */
  double *rate[MOST_RATES];
  double *new_rate[MOST_RATES]; /* space for new rates; new velocities may use the space of the previous
                                 * ones */
  double last_dt;
  int after_any; /* whether coefficients do not depend on the length of the previous step */
  int ready, more; /* ready: whether a step can begin; more: number of further rates that are known */
  int known, oldest;
  scheme_numbers numbers[MOST_KNOWN];
  const scheme_numbers *now;   /* coefficients of this step */
  int (*find)(void *handle, scheme_numbers *numbers);
  void *handle;
};

/* Set `now` to the coefficients of a step of length dt; returns whether that succeeds. */
int find_numbers(rates *r, double dt);

/* A constant matrix that multiplies rates: inertia, or Rayleigh damping. */
typedef struct {
  step_product *product;
  rates *rates;
  int damps;            /* whether it multiplies velocities */
  double *v;            /* space */
  double *kept, *lost; /* entries of the ledger, energy stored and dissipated; or none */
} matrix_of_rates;

/* A node in space that turns about an axis of a support: the degree of freedom of this rotation, and
 * positions in `reactions` of the moments across the axis, and about it or -1. */
typedef struct { int32_t axis, across[2], about; } hinge_support;

/* Prescribed motions of supports, and their work. */
typedef struct {
  int held, moving;
  const int32_t *hold, *dof; /* degrees of freedom that are held; those that move */
  const time_function *motion;
  double *reactions;
  double *before, *work; /* work: entry of the ledger */
  double weight_of_before, near; /* near: a smaller displacement of a fixed place is round-off; m */
  /* driven: hinges with prescribed rotations, the last motions; at_end: whether the equation of a step
   * holds at its end */
  int hinges, driven, at_end, fixed;
  const int32_t *fix;         /* fixed displacements in space in turned axes */
  const hinge_support *hinge; /* the driven ones are first */
  double *angle;              /* of each hinge; rad */
} moving_supports;

/* Forces of laws of a user, watched for changes of direction at every step; see controllers.py. */
typedef struct {
  int number, most;            /* most: successive changes of direction at which a force is reported */
  double large, moved;         /* thresholds: fractions of the largest force, and of `length` */
  const int32_t *dof;          /* index of each force among the unknowns */
  const double *const *value;  /* force of a controller; else none */
  int32_t *const *fresh;       /* whether the controller was evaluated since this flag was cleared */
  const double *const *rate;   /* of the motions in the last step */
  const double *length;
  double *force, *change, *largest, *told; /* told: time at which a force was reported; NaN before */
  int32_t *count;              /* successive changes of direction so far */
  int tells;                   /* whether any force was reported since this flag was cleared */
} force_watch;

/* Energy stored and dissipated in a step, and the sum of the magnitudes of the works on
 * connectors and on imposed strains. */
typedef struct { double in_beams, in_connectors, effort; } energy_change;

/* Adds the contribution of a term in a step to q1. */
typedef void (change_of_energy)(void *self, const double *q1, energy_change *sum);
typedef struct { change_of_energy *of; void *self; } change_call;

/* Whether a step to q1 may be accepted. */
typedef int (admission)(void *self, const double *q1);
typedef struct { admission *of; void *self; } admission_call;

/* Checks of static steps, see step_equation.py, and results of the latest check. */
typedef struct {
  double slack, far, kink;
  const double *per_far; /* 1 / size of the scene for displacements, 1 for rotations */
  double *force, weight_of_before; /* internal forces before the step */
  int dead; /* whether only dead loads act, supports rest, and there are no connectors */
  int terms;
  const change_call *change;
  int accounts; /* arrays of the ledger */
  double *const *account;
  const int32_t *entries;
  double moves, work, stored; /* largest motion, in the unit of `far`; J */
  double rejected; /* energy of the first attempt to go to the end of a step that leapt, else zero; J */
} static_path;

/* Parts that a step may turn without strain. */
typedef struct {
  int members, rods;
  const int32_t *end, *rotation; /* rotations of the nodes of each beam or body, and their ends in `rotation` */
  const int32_t *dof;            /* of each rod between two places: u, v and rotation of both nodes */
  const double *geometry;        /* of each rod, undeformed: arms of both places, vector between them */
  double turn, largest_turn;     /* largest rotation in the step; its limit */
} rigid_parts;

enum { MOST_SUBSTEPS = 4096 }; /* largest number of substeps of a step */

/* Reasons why a step is not accepted. */
enum failure {
  SUCCEEDS, RAISED, NO_EQUILIBRIUM, APPLIED_TOO_FAST, TURNS_TOO_FAR, PART_TURNS_TOO_FAR, GIVES_ENERGY,
  LEAVES_MECHANISM, LEAPS, NO_DERIVATIVE
};

/* Numbers of a state and their place in its row. They are contiguous, or are added from the indices
 * `at` to the indices `to`. */
typedef struct {
  double *const *from;
  int number, first;     /* first: index in the row, if the numbers are contiguous */
  const int32_t *at, *to; /* indices, or none */
} group_columns;

typedef struct derivatives derivatives;
struct adjoint;

/* The time loop of a scene: its state, and all terms of the equation. */
typedef struct {
  equation *equation;
  int size;
  double t, *q, *x, *s; /* x: end of the step in the axes of the plane; s: step of the nodes */
  double *guess, *found; /* found: space for the solution from which places open */
  prediction *prediction;
  double load_weight, at; /* load_weight: of the end of a step in load_time; at: see Step */
  int proportional;          /* whether substeps go in proportion to loads and motions at the end of the step */
  int rotations, axes, half_tangents, multipliers; /* axes: consecutive numbers of a rotation, 1 or 3 */
  int adds_up; /* whether rotations in space are sums of all steps, as derivatives need them; see shorten_rotations */
  const int32_t *rotation, *half_tangent, *multiplier;
  double turn, largest_turn; /* largest rotation in the step; limit of it, infinite if there is none */
  int turns_from_velocities; /* whether these are differences from rotations with the velocities before the step */
  rigid_parts *parts; /* whose rotation is limited; or none */
  rates *rates;       /* in dynamics */
  int admissions, checks_laws; /* checks of laws; whether any process has checks */
  const admission_call *admission;
  static_path *path;  /* in statics */
  moving_supports *supports;
  int opens, places;  /* opens: whether places may open, on any process */
  const element_block *const *place; /* blocks whose points or elements open beyond a limit */
  phases begin, accept, add_state;
  int states;
  double *state;      /* entries of the ledger that are functions of the state, contiguous */
  time_step step;
  /* A composition solves a step in several stages, of which some go backward. */
  int stages, taken;      /* taken: number of stages that are accepted, of a step that is not */
  const double *stage;    /* ends of the stages, as fractions of the step */
  double *begun;          /* unknowns at the beginnings of the stages, in the axes of supports */
  double *stage_begin;    /* times of these beginnings; s */
  int num_groups, width, sums; /* groups of numbers of a state; length of a row, and of its first part, in
                           * which numbers are added */
  const group_columns *groups;
  cell_forces *cell_forces;
  int watches;
  force_watch *forces; /* forces of laws of a user; or none */
  const watch *const *watch;
  int substeps, substeps_of_last; /* steps and substeps in the latest call; in its last step */
  int failure;            /* of the latest step; see enum failure */
  double failed_end;      /* end of the smallest substep that was tried */
  double (*stop)(void *handle, double t); /* next time at which a step must stop; or none */
  void (*prepare)(void *handle); /* takes further rates of the scheme from a trial step; or none */
  void *stops, *handle;
  /* Lets velocities meet rates that have jumped before the next step, to t1, and returns the time of the
   * next check; or none. See simulation/impacts.py. */
  double (*meet_jumps)(void *handle, double t1);
  void *impacts;
  double next_jump;
  /* While loads that act from the beginning are applied: beginning and end of that time; largest
   * rotation of a node in a substep; substeps that are shorter by the factor short_part may exceed
   * it. */
  int applies;
  double begin_of_run, applied_by, applying_turn, short_part;
  derivatives *derivatives; /* or none */
  struct adjoint *adjoint;  /* or none */
} time_loop;

phase begin_dead_loads,
  accept_dead_loads,
  
  begin_product, accept_inertia, add_kinetic_energy, accept_rayleigh,
  begin_points, accept_points, add_energy_of_points,
  begin_block, begin_block_again, begin_neighbour, accept_block, add_energy_of_block;
admission points_dissipate;
change_of_energy change_of_block, change_of_cells;
double value_at(const time_function *f, double t);
void keep_state(const time_loop *m, double *row);
int solve_begun_step(time_loop *m, int hold);
int attempt_step(time_loop *m, double t1, double end);
void take_back(time_loop *m);
int accept_step(time_loop *m);
int step_or_subdivide(time_loop *m, double end);
int repeat_steps(time_loop *m, int number, const double *steps, const double *configurations, double *rows);
int take_steps(time_loop *m, int steps, const double *ends, double seconds, int keeps, double *rows);

/* -- derivatives of a run by parameters, see derivatives.c --------------------------------------------- */

enum { MOST_LANES = 16 }; /* largest number of cells in a batch */

/* Derivatives of a term in a step: tables at the end of the step; derivatives of its forces by parameter
 * p at constant unknowns; derivatives of its state at the end of the step. Each may be none. */
typedef struct {
  void *self;
  void (*linearize)(void *self, const time_step *step, const double *q1);
  void (*add)(void *self, const derivatives *d, int p, double *r);
  void (*accept)(void *self, const derivatives *d); /* of all parameters */
  void (*accept_trial)(void *self, const derivatives *d); /* of a step with `initial`; or none */
} term_derivative;

/* Derivatives of the state of a run. Arrays have a row for each parameter. */
struct derivatives {
  int parameters, size, terms;
  const term_derivative *term;
  double *q0, *q1;        /* of the configuration at both ends of the step */
  double *rates[MOST_RATES], *new_rates; /* of the rates, from 1 on; in dynamics */
  const step_product *inertia;           /* in dynamics */
  double *reactions;      /* of the forces of supports, in their axes */
  int neighbours;         /* scenes with other values of a parameter, for differences */
  const double *weight;   /* parameters x neighbours: weights of the differences */
  const time_function *const *motion; /* parameters x neighbours: motions of supports */
  const double *x;        /* configuration at the end of the step */
  const int32_t *indices; /* columns of the tangent */
  double *tangent, *r, *v, *s, *space;
  const time_step *step;  /* the step; s: of the nodes */
  int initial;            /* whether further rates of the scheme are taken from the step, and nothing else */
  /* Nearest switch of each parameter to another piece of the run, to first order: change of the parameter;
   * time; index of the term, and of the point or connector in it. */
  double *range, *range_time;
  int32_t *range_term, *range_place;
  double t;               /* end of the step */
  int now;                /* index of the term */
  int kept;               /* number of stored states */
  double *kept_q, *kept_v, *kept_reactions;
  /* Substeps within divided steps: space for some; number stored, -1 if there was too little space. Of
   * each: its end, the end of the step, whether loads were applied (3); the configuration and its
   * derivatives at its end. */
  int room, substeps;
  double *substep, *substep_q, *substep_dq;
};

/* Derivatives of material points, as elements whose motions are the strains of a section. */
typedef struct block_derivatives block_derivatives;
typedef struct {
  points *points;
  const block_derivatives *of;
  const int32_t *column;          /* index in w of `points` of each input of an element, or -1 */
  int geometry, rest;             /* first inputs for B and weight, and for rest, of a point */
  double *e0, *e1, *r;            /* derivatives of strains before the step and at its end; by one parameter: of resultants */
  /* Of committed tangents, if a damping uses them: derivatives of its numbers; steps of parameters for differences. */
  double *tangents;
  const double *step;
  double *e0_bar, *e1_bar, *r_bar, *tangents_bar, *input_bar; /* of the adjoint */
} point_derivatives;

/* Matrix of rates, with its derivative by each parameter, or none. */
typedef struct {
  const matrix_of_rates *matrix;
  const constant_matrix *const *change;
} product_derivative;

/* Derivatives of a block by its inputs except modes, with a row for each parameter. The table has the rows of forces,
 * states, shared numbers, strains of material points and margins, then the equations of the unknowns of an element,
 * by which the last columns are; the margins follow. The unknowns are removed. */
struct block_derivatives {
  element_block *block;
  int parameters, neighbours, margins, unknowns;
  element_block *const *neighbour;  /* in scenes with other values of a parameter */
  const double *weight;     /* see derivatives */
  const element_function *table_of;
  double *table, *direction; /* direction: space for the inputs of a batch */
  const int32_t *changes;   /* whether an input may depend on a parameter; parameters x inputs without modes */
  int of_step;              /* number of all numbers of the step */
  double *by_state, *by_number, *by_step, *by_shared, *by_before; /* by_before: of `before` of the block */
  double *state_bar, *number_bar, *step_bar, *shared_bar; /* of the adjoint */
  point_derivatives *inner;   /* of material points; or none */
  int strains;                /* of these points in an element, or 0; derivatives of the first numbers are those of the
                               * resultants at constant strains */
  double *strain_bar;
  /* Function of Python that sets the modes for the table and derivatives of the first `shifts` numbers; or none. */
  void (*tabulate)(void *handle);
  void *user;
  int shifts;
};

/* Derivatives of dead loads: of their vectors, and of their factors from scenes with other values of a
 * parameter. */
typedef struct {
  int parameters, size, neighbours, number, loaded;
  const dead_loads *loads, *const *neighbour;
  const double *weight;
  const int32_t *parameter, *vector, *dof;
  const double *change;       /* `number` derivatives of a vector by a parameter, at the `loaded` degrees of freedom */
  const int32_t *enters;      /* whether a parameter changes the loads */
  double *factor, *by_factor; /* factors, and their derivatives; parameters x vectors */
  double *now, *end, *before; /* in the equation, at the end of this step, at the end of the last step */
  double *vector_bar;         /* of the adjoint; vectors x loaded */
} load_derivatives;

/* A term in the steps of a run. */
typedef struct { phases begin, accept; call force; } term_in_steps;

/* Derivatives of a term by numbers of the scene, as differences: the same term in scenes with other
 * values of a parameter takes the steps of the run. */
typedef struct {
  int parameters, neighbours, size;
  const term_in_steps *term; /* of the scene; then of its neighbours, parameters x neighbours */
  const double *weight;      /* see derivatives */
  double *here;              /* forces of the scene */
} term_differences;

/* Transposes of a term: from the state at the end of a step to the state before it; from lambda, the
 * derivatives by the forces, to the state before the step; from the initial state to the parameters.
 * `state` and `finish` may be none. */
typedef struct adjoint adjoint;
typedef struct {
  void (*state)(void *self, adjoint *a);
  void (*force)(void *self, adjoint *a, const double *lambda);
  void (*finish)(void *self, adjoint *a);
} term_transposes;

/* Adjoint of a run, see adjoint.c: recorded steps, and the derivatives of one number. */
struct adjoint {
  derivatives *d;
  int parameters, size;
  const term_transposes *term;   /* in the order of the terms of d */
  double *q0, *q1, *rates[MOST_RATES], *new_rates; /* derivatives by the state */
  double *q_bar;                 /* space: derivatives by the configuration at the end of a step */
  const time_step *step;
  double *lambda, *values, *gradient; /* values: space; gradient: derivatives by the parameters */
  const int32_t *transpose;      /* index of the transposed entry of each entry of the tangent */
  double *transposed;
  /* Blocks of memory that a step needs: their addresses, lengths in bytes, and the length of a step. */
  int blocks, recorded, most;
  void *const *const *block;
  const int64_t *length;
  int64_t bytes;
  char *record;
};

int record_step(adjoint *a, time_loop *m, int initial);
int go_back(adjoint *a, time_loop *m);
void finish_adjoint(adjoint *a, time_loop *m);
void transpose_points_state(const point_derivatives *m, adjoint *a);
void transpose_points(const point_derivatives *m, adjoint *a);
void transpose_product(void *self, adjoint *a, const double *lambda);
void transpose_loads(void *self, adjoint *a, const double *lambda);
void finish_loads(void *self, adjoint *a);
void transpose_differences(void *self, adjoint *a, const double *lambda);
void transpose_block_state(void *self, adjoint *a);
void transpose_block(void *self, adjoint *a, const double *lambda);
void finish_block(void *self, adjoint *a);
void finish_points(const point_derivatives *m, adjoint *a);
void tabulate_points(const point_derivatives *m);
int differentiate_step(derivatives *d, time_loop *m, int initial);
void begin_neighbours(void *self, const time_step *step, const double *q1);
void add_differences_derivative(void *self, const derivatives *d, int p, double *r);
void accept_differences_derivative(void *self, const derivatives *d);
void keep_derivatives(derivatives *d, const time_loop *m);
void keep_substep(derivatives *d, const time_loop *m, double end);
void tabulate_block(void *self, const time_step *step, const double *q1);
void add_block_derivative(void *self, const derivatives *d, int p, double *r);
void accept_block_derivative(void *self, const derivatives *d);
void add_points_derivative(const point_derivatives *m, const derivatives *d, int q);
void add_product_derivative(void *self, const derivatives *d, int p, double *r);
void add_load_derivative(void *self, const derivatives *d, int p, double *r);
void accept_points_derivative(const point_derivatives *m, const derivatives *d);
void accept_load_derivative(void *self, const derivatives *d);
void differentiate_loads(void *self, const time_step *step, const double *q1);

/* -- oscillators, see oscillators.c --------------------------------------------------------------- */

/* u'' + 2 damping omega u' + restoring force = load, all per mass.  The state is complex, x = u' - conj(l) u with
 * l = omega (-damping + i sqrt(1 - damping^2)), and a step is x1 = E x0 + c0 load0 + c1 load1, for a
 * load that is linear in it.  Arrays have the real and the imaginary part.
 */
typedef struct {
  double omega, damping, hardening; /* hardening: stiffness after yield, divided by omega^2 */
  double dt;                        /* of a substep */
  int substeps;                     /* of each step of the load */
  double E[2], c0[2], c1[2];
} oscillator;

/* Largest displacement, velocity and acceleration without the load; steps are exact for a plastic
 * displacement that is linear in them. */
void oscillator_peaks(const oscillator *o, int number, const double *load, double strength, double *peaks);
