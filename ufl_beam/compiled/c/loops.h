/* SPDX-License-Identifier: MIT */
/* What Python sees of the loops in C: what they loop over, and their functions.
 *
 * This is read by cffi as well, which knows no directives of the preprocessor.
 */

/* Adds to `out`, a vector or the entries of a matrix, its part at the unknowns q. */
typedef void (part)(void *self, const double *q, double *out);
typedef struct { part *add; void *self; } call;

/* Several of them. */
typedef struct { int number; const call *part; } calls;
part add_calls, add_cells, add_static_tangent, subtract_vector, subtract_follower_loads,
  add_tangent_of_follower_loads, subtract_frame_forces, add_tangent_of_frame, add_step_force,
  add_step_tangent, add_inelastic_force, add_inelastic_tangent;

/* -- forms and constant matrices --------------------------------------------------------------- */

enum { MOST_ENTRIES = 144 }; /* of the vector or matrix of a cell: 12 unknowns of degree 3 */
enum { SOME = 128 };         /* cells, of which the processor has all at hand for what comes next */

/* A compiled form on some cells. w holds the packed coefficients of a cell but for its unknowns, which
 * the form has from `at` on; `width` numbers further are those of the next cell, as the values may be a
 * part of those of another form.
 *
 * An entry of a cell is added to the place `row` says; without these, to its entry in the row `begin`
 * of a matrix, as many places on as the `pattern` says that the cell has; without either, to its degree
 * of freedom; of a functional, to its value.
 *
 * Where a form is computed for several cells at once, `several` does what add_cells does, and numbers
 * of cells (w, coordinates, row, patterns) come in batches of as many cells: the first number of each of
 * these cells, then their second numbers, and so on; the last batch is filled up with the last cell. */
typedef struct cells cells;
typedef void (in_lanes)(const cells *self, const double *q, double *out);
struct cells {
  kernel *tabulate;
  in_lanes *several; /* or none */
  int lanes; /* cells of a batch, a power of two; else 1 */
  int number, of_cell, unknowns; /* cells, degrees of freedom of each, those the form depends on */
  const int32_t *dofs;
  int at, width, coefficients; /* coefficients: of a cell, unknowns included */
  double *w, *all; /* all: space for these */
  const double *constants, *coordinates; /* coordinates: x and y of both vertices */
  int rows; /* entries of a cell */
  const int32_t *row, *begin; /* or none */
  const uint8_t *pattern;
  const int32_t *has; /* number of the pattern of each batch */
  int in_rows; /* number of the patterns, the first ones, whose rows stand side by side */
  int is_functional;
  double *each; /* entries of all cells in the latest evaluation, in batches; or none */
};

/* Strains whose forces the tangents of a static step have, see predicted_strains in beams.py. */
typedef struct {
  const cells *strains;           /* linear about a configuration */
  int at_about;                   /* where they have it */
  int size, of_cell;              /* of_cell: strains of a cell */
  const double *weight;           /* of each strain of a cell */
  const double *q0, *q_before;    /* beginnings of the step and of the last one */
  double ratio;                   /* of their lengths */
  int begins, exact;              /* the first strains are extrapolated; all are those at the iterate */
  double *about, *change, *e;     /* configuration of the latest tangent; space; the strains */
  int stale;                      /* whether there was a tangent since they were computed */
} predicted_strains;

/* Tangent of elastic cells in a static step. */
typedef struct {
  predicted_strains *predicted;
  const cells *tangent;
  int at_e; /* where it has the strains */
} static_tangent;

/* Some numbers of a vector, or all of them. */
typedef struct {
  int size;
  const int32_t *dof; /* or none */
  const double *values;
} vector;

/* A constant matrix, by runs of rows whose entries are equally far from the diagonal. */
typedef struct {
  int runs;
  const int32_t *first;        /* row of each run, and the number of rows */
  const int32_t *begin, *away; /* of each run and of one more: its part of `away`, columns less row */
  const int32_t *at;           /* where the entries of each run begin: the first one of each of its */
  const double *data;          /* rows, then the second ones, and so on */
} constant_matrix;

/* A constant matrix A times the step of the nodes from q0, see StepProduct. */
typedef struct {
  int size, rotations;
  const int32_t *rotation;
  const constant_matrix *A;
  const int32_t *begin;  /* of the rows of the tangent; where entries of A are in them: `place`, of */
  const uint8_t *place;  /* one byte each, or */
  const int32_t *far;    /* if that is not enough, this */
  double factor, back;
  const double *v, *q0;
  double *rate;          /* factor s - back v in the latest force, s being the step of the nodes */
  double *space;
  double *turn, *half; /* increments of the rotations asked for last, and tangents of their halves */
} step_product;

void set_cells(const cells *c, const double *q, int at);
double value_of_cells(const cells *c, const double *q);
int find_entries(int rows, const int32_t *indptr, const int32_t *indices, int number,
                 const int32_t *row, const int32_t *column, int32_t *found);
int find_blocks(int rows, const int32_t *indptr, const int32_t *indices, int number, int of_cell,
                int lanes, const int32_t *dofs, int32_t *place, uint8_t *column);
int64_t find_pattern(int size, int groups, const int32_t *first, const int32_t *dof, int32_t *begin,
                     int32_t *group, int32_t *seen, int32_t *indptr, int32_t *indices);
void add_product(const constant_matrix *A, const double *x, double *y);
double quadratic_form(const constant_matrix *A, const double *x);
void give_back_memory(void);
double norm(int rows, const int32_t *at, const double *w, const double *f);

/* -- forces in cells --------------------------------------------------------------------------- */

/* What is known of the forces of a cell in the equation of a step, see cell_forces.py. */
enum cell_number {
  START_X, START_Y, START_M, END_X, END_Y, END_M, COUPLE, SKEW_X, SKEW_Y, CELL_NUMBERS
};

/* Forces on nodes of cells: by stresses; by a work of a user; along all of a cell. */
enum force_kind { STRESS, WORK, DENSITY };

/* A form whose entries are forces on nodes of cells; `latest` and `accepted` are these, or, if it is
 * linear in a vector, that vector: in the latest residual and in that of the accepted step. Entries that
 * depend on nothing but configurations are computed when they are asked for. */
typedef struct {
  const cells *form; /* that is linear; or none */
  double **latest, *accepted; /* latest: or none; also if another form has the same vector */
  double *const *vector;
  double *const *entries; /* of the accepted step, in batches */
  double *const *tee;     /* the same in the latest residual; or none */
  double factor;
  int kind, number, lanes;
  const int32_t *cell; /* numbers of its cells; or none where these are all */
} force_in_cells;

/* Vectors of loads on nodes of cells, which factors multiply. */
typedef struct {
  int vectors;
  const double *const *vector; /* degrees of freedom of each cell; or none */
  const double *latest;        /* factors */
  double *accepted;
} loads_in_cells;

typedef struct {
  int cells, nodes, forces; /* nodes: of a cell */
  force_in_cells *force;
  const loads_in_cells *loads; /* or none */
  const double *from_middle;   /* of the nodes of a cell, as a part of it */
  const double *given;         /* what there is of the state before the first step; then none */
} cell_forces;

void accept_cell_forces(cell_forces *c);
void find_cell_forces(const cell_forces *c, int now, double *out);

/* Least and largest of some numbers so far, and when they were reached first. */
typedef struct {
  int size;
  double *low, *high, *time_low, *time_high;
} extent;

/* Extremes of section forces in points of the cells, and of motions, see extremes.py. */
typedef struct {
  const cell_forces *forces;
  const cells *along;       /* form of the section forces, which it keeps, with two angles of a cell */
  const double *angles;     /* of all cells, in batches */
  int at_angles;            /* where it has these */
  int at_numbers, first;    /* where it has the first of CELL_NUMBERS, and how many */
  int in_order;             /* whether all forms have all cells, in batches as this one */
  double between, *q;       /* part of a step at whose configuration they are; space for that */
  double *numbers, *some;   /* space: for all cells; for what the form has of SOME */
  extent of_forces, of_motion;
} watch;

void watch_step(const watch *w, int now, double t, const double *before, const double *q);

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
  WORKED, BROKEN, LOST, ELASTIC, HARDENING, RELAXED, RESISTANCE, LEFT, MISSED,
  POINT_OUTPUTS
};

enum { MOST_VARIABLES = 16, MOST_CORRECTIONS = 100 }; /* of a law */

enum { POINT_KEPT = 6, POINT_SUMS = 7 }; /* numbers of a cell, and of all: `kept` and `sum` of points */

extern const double NO_ENERGY; /* dissipation that is none, as a part of its size */

enum { LINE = 3 }; /* strain, stress and slope: what a tangent knows of a point */

/* Flags that all points and connectors of a scene share in the present search for an equilibrium. OPENED: a
 * point has opened. STIFF: points that do not open answer elastically. HOLD: points that do not flow stay closed.
 * OVER: one of them has borne more than its limit. */
enum search { OPENED, STIFF, HOLD, OVER, SEARCH_FLAGS };

/* Points in cells, `of_cell` in each, with `width` numbers of each in w; see material_points.py. */
typedef struct {
  int32_t *search;
  /* Of the law: stresses and their derivatives by strains; or, if it solves, residuals and these, see
   * solve_law. Of a discontinuity: resistance and its derivative by the growth. */
  kernel *law, *resistance, *end;
  kernel *own; /* what a law that must dissipate does by itself, and the size of that; or none */
  int solves, components, variables, strain;
  int cells, of_cell, width;
  const double *B, *weight, *rest, *length;
  double theta;
  double *e0, *e1, *w, *r, *D, *kept, *sum;
  double *over; /* largest excess of a closed point over its limit in the latest response */
  int tried;    /* whether an iterate of the step was answered */
  /* Lines of points of one strain: of the latest response, and of the last tangent if it `predicts`;
   * see follow_prediction. */
  double *line, *predicted;
  int predicts;
  const double *linear; /* strains of cells that an iteration of statics predicts; or none */
  double *unlike; /* largest (N, V, M) of a point in the latest response that its strain has not */
} points;

/* Cells with points: forms of the strains, of the forces, which know the resultants r, and of their
 * tangent, which knows them as affine functions b + D e of the strains. */
typedef struct {
  points *points;
  const cells *strains, *force, *tangent;
  int at_r, at_b, at_D; /* where the coefficients of `force` and `tangent` have r, b and D */
  predicted_strains *predicted; /* in statics; or none */
  double *forces, *last_b, *last_D; /* of the tangent, in statics; b and D about the latest one */
  int size;
  double scene;   /* size */
  double *latest; /* the unknowns that the points responded to */
} inelastic;

/* The first inputs of the law of a rigid-plastic connector, and what the end of a step brings. */
enum slip_input { SLIP, SLIP_DIRECTION, SLIPPED, SLIP_START, SLIP_INPUTS };
enum slip_output {
  SLIP_DISSIPATED, SLIP_LOST, SLIP_STORED, SLIP_LIMIT, SLIP_BACK_FORCE, SLIP_OUTPUTS
};

/* Rigid-plastic connectors, see connector_laws.py. */
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

typedef struct friction friction;

/* Connectors whose laws are functions of a user, see force_laws.py. */
typedef struct {
  double *force, *rows; /* forces in the iterate; rows of the laws around it, three of each */
  double *held;         /* energy that they store */
  void *begin_self, *rows_self, *again_self; /* data of the functions */
  void (*begin)(void *self, double t, double dt);
  void (*find_rows)(void *self), (*again)(void *self);
} asked_laws;

/* The end of a step in a law of connectors, then come its variables there. */
enum law_output { LAW_STORED, LAW_NUMERICAL, LAW_OUTPUTS };

/* Connectors with compiled laws, see force_laws.py. Inputs of a law are its motions, those before the
 * step, dt, theta, the variables before the step, and the numbers of the law. */
typedef struct {
  kernel *force, *end;        /* forces and their derivatives by the motions; what the end of a step brings */
  int number, width, variables;
  int components;             /* motions of each */
  int loses;                  /* whether what is not stored of a work is lost, or the ledger is open by it */
  double *w;                  /* what the kernels know, `width` numbers of each connector */
  double *stored, *lost;      /* energy in the accepted state; lost by each since the beginning */
  double *rows, *answer;      /* rows as in `couplings`; space for an answer */
  double *sum;                /* lost in the last step, and by the scheme */
} connector_laws;

/* Connectors of the same motions as cells, with their forces as unknowns. A law is a row a·e + b f = c
 * for each component, in all motions e of the connector and the force f of the component; rows of
 * springs come of points. Arrays have one number for each component of each link. */
typedef struct {
  const cells *work, *tangent, *motion;
  points *points;                  /* or none */
  rigid_plastic *rigid_plastic;    /* or none */
  connector_laws *laws;            /* or none */
  friction *friction;              /* or none */
  asked_laws *asked;               /* or none; if none of all these, the rows stay during a step */
  int number, components;          /* components: one, but for compiled laws */
  const int32_t *link, *force;     /* of each cell; where the forces are among the unknowns */
  int row, row_of_tangent;         /* where the coefficients of work and tangent have the rows */
  double *by_cell, *e1;            /* space; motions at the latest unknowns */
  double *e0, *before, *taken, *rate; /* the accepted state: motion, force, work, rate */
  double weight_of_before;         /* of the force that works in a step */
  const int32_t *dofs;             /* of each link: six of its nodes, then the forces */
  const double *length;            /* one where it turns, else the size of the scene */
  double size;                     /* of the scene */
} couplings;

void find_motions(const couplings *c, const double *q);
double dissipation_of_rigid_plastic(const rigid_plastic *p, const double *e1, const double *force);
void find_rows(const couplings *c, const double *q, double *rows);
void ask_law(kernel *law, const double *w, int answers, double *s);
part add_couplings_force, add_guides_force, add_guides_tangent;
void respond(points *p);
void respond_at(const inelastic *m, const double *q);
int gives_energy(const points *p);
void commit(points *p);

/* -- points on guide curves -------------------------------------------------------------------- */

enum { CURVE_POINTS = 5 }; /* at equal steps of the parameter */

/* The polynomial through these points of a curve, around the parameter in their middle; its coefficients
 * are of powers of steps. */
typedef struct {
  double middle; /* not a number if there is none */
  double a[CURVE_POINTS][2];
} curve_around;

/* A place and its curve: where the rest is known, or not numbers; the nearest point, and the derivative
 * by steps there; distance and normal; the normal over the step, and its derivative by the place. */
typedef struct {
  double at[2], on[2], slope[2];
  double distance, n[2], m[2], dm[2][2];
} guide_frame;

/* Places held on curves, see guide_curves.c. */
typedef struct {
  int number, over_step;   /* over_step: whether forces are across the chord of a step */
  const int32_t *dofs;     /* seven of each link */
  const int32_t *entries;  /* of the tangent, eight of each: dm, m, n */
  const double *point;     /* in the undeformed scene */
  double size, reach;      /* of the scene; of a step, as a part of that */
  const double *shortest;  /* chord that has a direction */
  double *distance, *s0, *step, *on0; /* the accepted state: parameter, its steps, point of the curve */
  double *s;               /* parameter of the latest nearest point */
  guide_frame *frame;      /* of the latest iterate */
  curve_around *around;    /* latest polynomials */
  void (*ask)(void *curve, double s, double step, double *out); /* for points of a curve */
  void *const *curve;
  int lost;                /* guide that has no nearest point; Python raises that if it is told */
  void (*report)(void *handle);
  void *handle;
} guides;

int find_frames(guides *g, const double *q);
void begin_guides_again(void *self);

/* -- elimination along chains ------------------------------------------------------------------ */

/* What is kept of a vertex: its pivot block as LU, what that makes of the coupling to the vertex after. */
enum { BLOCK = 9 };

/* Rows and columns of the blocks that the first and last vertex of a chain have with its ends. */
enum end_block { LEFT_FIRST, RIGHT_LAST, FIRST_LEFT, LAST_RIGHT };

typedef struct {
  int chains;
  const int32_t *first;     /* first vertex of each chain, and their number */
  const int32_t *spike;     /* whether a chain has a left end */
  const int32_t *dof, *begin; /* of each vertex: first degree of freedom; where its rows begin */
  const uint8_t *at;        /* vertices x 3: where blocks begin in rows, see elimination.c */
  const int32_t *with_ends; /* chains x 4 x 9: entries of blocks with the ends, see end_block */
  const double *data;
  double *pivots, *to_next; /* vertices x BLOCK */
  uint8_t *swaps;           /* vertices x 3: rows in the order of the pivots */
  double *f;                /* at the degrees of freedom of vertices: what pivots make of those of b */

  /* The system of what is left. */
  int left, stay, rows;          /* its entries; those of data that stay; degrees of freedom that do */
  double *left_data, *left_f;
  int left_size;
  const int32_t *entry, *place;  /* of those that stay: in data, in left_data */
  const int32_t *places;         /* chains x 36: where in left_data the blocks of the ends are */
  const int32_t *kept, *number;  /* of those that stay: here, and among those left */
  const int32_t *ends;           /* chains x 6: numbers of the ends among those left */
} chains;

void eliminate(const chains *c, const double *b);
void reduce(const chains *c, const double *b);
void expand(const chains *c, const double *left, double *x);
int all_finite(int size, const double *values);

/* -- multifrontal elimination, see fronts.c ------------------------------------------------------ */

enum {
  WIDE = 8,      /* columns of a product that are computed at once */
  ONE_FRONT = 24 /* unknowns of a system that is one front, at most */
};

typedef struct {
  int size, fronts;
  const int32_t *unknown;       /* unknowns of the system in the order of elimination */
  const int32_t *first, *begin; /* of each front, and of one more: pivot, other unknown */
  const int32_t *rest;          /* unknowns of a front that are not its pivots */
  const int32_t *parent, *up;   /* front that the rest is in; where it is there */
  const int32_t *order, *before, *children; /* see order_fronts */
  const int32_t *entries, *entry, *place;   /* of the fronts: in the data, and in the front */
  const int64_t *at;            /* where the factors of each front begin in values */
  double *values;               /* rows of the pivots, then columns of the rest */
  double *schur, *stack, *space; /* space: for the largest front, and 2 WIDE numbers more */
  int32_t *swap;                /* of the pivots: row that each is exchanged with */
  double *x;                    /* right-hand side and solution, in the order of elimination */
  double *unit;                 /* space for a number of each pivot of a front */
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

/* Functions of PETSc, which Python finds by these names; its objects are opaque here. Each returns an
 * error, or zero, as what SNES calls does. */
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

enum { OF_LIBRARY = 76 }; /* PETSC_ERR_LIB: KLU says so of a singular matrix */

/* How far a law is missed by an iterate q and its residual r, without dimension; scale is the size
 * of the forces, and moved the largest motion, see largest_motion. */
typedef double (miss)(void *self, const double *q, const double *r, double scale, double moved);
typedef struct { miss *missed; void *self; } demand;
miss missed_by_couplings, missed_by_points, missed_by_guides;

/* Displacement of a place in axes of a support at an angle, whose cosine and sine are c and s; entries of
 * the tangent in the rows, and in the columns, of both of its degrees of freedom. */
typedef struct {
  int i, j, in_rows, in_columns;
  double c, s;
  const int32_t *row_i, *row_j, *column_i, *column_j;
} turned_axes;

/* Numbers of processes that share a scene: their sum, the root of the sum of their squares, the largest. */
enum agreement { TOTAL, HYPOT, LARGEST };

/* What a function of a user has raised: a failure of the step, or something else, which ends the run. */
enum raised { NOTHING, STEP_FAILED, OTHER };

/* Whose forces tangents of static steps have, see predicted_strains in beams.py: first those before the step, then
 * those that the last iteration predicted, or those at the iterate; or always these. */
enum tangents { PREDICTED, FIRST, EXACT };

/* The equation of a path's control, and its unknown t, see path_controls.py. */
typedef struct {
  void *handle;
  double *t;
  void (*arrive)(void *handle, const double *x);  /* take note of an iterate, before its residual */
  int (*change)(void *handle, const double *x);   /* find the change of an iteration; 1 if it fails */
  int (*met)(void *handle);
} border;

/* Functions that begin a step again: forget what iterates have tried. */
typedef struct { void (*run)(void *self); void *self; } again_call;

/* The equation of a step, and how far its solution is. Unknowns and residuals are in the axes of supports. */
typedef struct {
  int size, owned, inner, forces, stiffnesses; /* owned: degrees of freedom, the first ones */
  const call *force;     /* parts of the residual, the inner forces first */
  const call *stiffness; /* parts of the tangent besides the next two */
  const step_product *product; /* or none */
  const cells *cells;          /* or none */
  const int32_t *indptr;
  double *inner_force;   /* what the inner ones add up to; or none */
  double inner_size;     /* norm of that */
  double *tangent;
  int held, zeros; /* degrees of freedom and entries that supports hold */
  const int32_t *hold, *zero, *pivot; /* pivot: the entry of each that is held on the diagonal */
  double *reactions, *pivots;
  int turned;
  const turned_axes *axes;
  double *plane; /* unknowns in the axes of the plane, if some are turned */
  int idle; /* motions that the tangent holds, their entries and stiffnesses, see null_vectors.py */
  const int32_t *idle_entry;
  const double *idle_stiffness;

  double rtol, loads; /* tolerance; size of the loads */
  const chains *chains;
  const fronts *fronts;  /* factors of what chains leave; or none: then PETSc has these */
  void *left, *factors, *left_f, *left_x; /* in PETSc: what chains leave, its factors, two vectors */
  void *snes, *x, *f, *y;                 /* in PETSc: the solver; unknowns, residual, change */
  double *unknowns, *residual, *change;   /* local values of these; between solutions others use the last */
  double *found;         /* solution of what chains leave; in PETSc the entries of left_x */
  const double *weight;  /* see Solver */
  int least, most;                             /* iterations */
  const int32_t *diagonal;
  double *space;
  const double *lengths; /* see Solver */
  const uint8_t *moves;
  double scene, moved; /* size of the scene; largest motion of the latest iterate, at most that size */
  int demands, demanding; /* demanding: whether there are any on any process */
  const demand *demand; /* of connectors and points */
  int32_t *switched;    /* a row of a connector is not about what it was in the tangent */
  double last, best;                  /* residuals of the iterate before; least so far */
  int near, slow, patience; /* near: the tangent is kept in the next iteration */
  int iterations, reason, total;      /* of the latest solution, and of all */
  int careful;           /* whether changes are searched along */
  int monitored;         /* PETSc's own method is asked for: by its options, or monitors */
  int searches;          /* whether the search here is used all the same */
  int error;             /* of PETSc */
  int raised;            /* see enum raised */
  const border *border;  /* or none */
  int predictions;
  predicted_strains *const *predicted;
  int32_t *search;       /* flags of points that may open; or none */
  int agains;
  const again_call *again;
  double *conjugate, *start, *aside; /* space: of a search; of a solution with stiffer tangents */
  void *handle;
  void (*agree)(void *handle, int number, const int *how, double *values); /* none on one process */
  int (*solve)(void *handle, int anew);                /* where there are several: the change */
  void (*find_conjugates)(void *handle, const double *q);
  int (*find_idle)(void *handle);
  int (*forget_idle)(void *handle);
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

/* -- prediction of the end of a step, see march.c ------------------------------------------------- */

/* The last steps. `second` is the second difference of the configuration; in dynamics only. */
typedef struct {
  int size, equal;   /* equal: steps of the same length that led here, up to three */
  double dt;         /* length of the last; infinite if there was none */
  double *q_before;  /* configuration at its beginning */
  double *second;
  const double *weight; /* as of residuals */
  double scene, unknowns; /* size of the scene; unknowns on all processes */
  /* Product of the last two second differences, square of each: mean values of motions as parts of the
   * size of the scene, and of rotations. */
  double both, now, before;
  double step;              /* square of the last step */
  double repeated;          /* part of `second` that repeats itself */
} prediction;

void predict(const prediction *p, double dt, const double *q, double *out);
void enter_step(prediction *p, double dt, const double *q, const double *q1);
void compare_differences(prediction *p);

/* -- steps one after the other, see march.c ----------------------------------------------------- */

/* A step, see Step in time_schemes.py. */
typedef struct {
  double t0, t1, dt, load_time, motion_time, fraction, at, ratio;
  const double *q0, *q_before;
} time_step;

/* What a term does when a step begins, or is accepted: q1 is its end, s the step of the nodes. When it
 * begins both are none. */
typedef void (phase)(void *self, const time_step *step, const double *q1, const double *s);
typedef struct { phase *run; void *self; } phase_call;
typedef struct { int number; const phase_call *call; } phases;

/* A function of time: linear between points and constant outside, or one of Python. */
typedef struct {
  int points;
  const double *t, *y;
  double (*ask)(void *handle, double t);
  void *handle;
} time_function;

/* Forms that know the configuration q0 at the beginning of a step, which they have from `at` on. */
typedef struct { const cells *form; int at; } form_of_step;

/* Forms that know a time over that of the step, in each point of a cell, which they have from `at` on. */
typedef struct {
  int forms, of_cell;
  const form_of_step *form;
  double time, *dt; /* dt: of the latest step */
} viscous_forms;

/* Forms that know the changes of the strains in the step before, see SecondDifferences. */
typedef struct {
  const cells *strains; /* which weights them */
  int of_cell, forms;
  const double *weight; /* of_cell */
  const form_of_step *form;
  double *e, *change; /* strains at the beginning of the step, their changes in the step before; each
                       * cells * of_cell */
  double *space, *last_dt;
} second_differences;

/* The value of a form, added to an entry of the ledger, and as it was when it was added last. */
typedef struct {
  const cells *form;
  double *entry, held;
} form_value;

/* Loads that turn with cross-sections, see FollowerLoads; three numbers of each. */
typedef struct {
  int number, size;
  const int32_t *dof;      /* that are loaded; size */
  const int32_t *at;       /* places among these */
  const int32_t *turning;  /* rotations that the loads follow; number */
  double *turn0, part;     /* these at the beginning of the step; part of its turn at which loads act */
  const double *given;     /* forces along and across, and moments, times functions of time: */
  const time_function *factor;
  double *now, *end, *before; /* in the equation, at the end of the step, at that of the last one */
  const int32_t *x, *y;    /* entries of the tangent, of forces in the plane by the rotations */
  double *force, *force_before; /* in the plane: in the latest residual, in that of the last step; size */
  double weight_of_before, *work;
} follower_loads;

/* Vectors times functions of time at some degrees of freedom, see DeadLoads. */
typedef struct {
  int size, vectors;
  int whole; /* whether the latest step went all the way to its loads */
  const int32_t *dof;
  const double *const *vector;
  const time_function *factor;
  double *factors; /* of the latest step; not numbers before the first */
  double *force, *end, *before;
  double *parts[3]; /* of the vectors in these */
  double weight_of_before;
  int acts; /* whether a force, now or before, is not zero */
  double *work; /* entry of the ledger */
} dead_loads;

/* Centrifugal and Coriolis forces, see FrameForces. */
typedef struct {
  int size, entries, places;
  const int32_t *x, *y;             /* displacements of each place */
  const constant_matrix *pull, *turn; /* that make forces of places, and of velocities */
  const double *pulls, *turns;      /* the same as entries of the tangent */
  const double *from_centre;        /* places at rest */
  double rate, coriolis, part, weight_of_before; /* coriolis: twice the rate, or 0 in statics */
  const double *q0;
  double dt, growth, grown, grown_at_end; /* of the forces: in the equation, before and after the step */
  double *change, *place, *space;   /* change: of q; place: at which forces act */
  double *force, *before;           /* in the latest residual, in that of the last step */
  double *const *accelerations, *work;
} rotating_frame;

/* The first numbers of a work: time, length of the step, part that acts; then come those of its user. */
enum work_number { WORK_TIME, WORK_STEP, WORK_PART, WORK_NUMBERS };

/* A work of a user on cells, see works.py. */
typedef struct {
  const cells *residual;
  int forms, numbers;
  const form_of_step *form;     /* all of its forms, and where they have q0, or -1 */
  const int32_t *at;            /* forms x numbers: where they have these, or -1 */
  double *number;               /* as forms have them */
  const time_function *of_time; /* numbers of the user */
  double *before;               /* forces in the equation of the last step; of virtual works */
  form_value *energy, *lost;    /* of a potential, or none */
  double *supplied;             /* entry of what it, or a change of a potential in time, supplies; or none */
} user_work;

typedef struct {
  int size, works;
  user_work *const *work;
  double weight_of_before;
  double t, grown, t_at_end, grown_at_end; /* time and part that acts, in the state and after the step */
  double *force, *space; /* force: of all works in the equation of the last step */
} user_works;

/* Coefficients of a step: rows of numbers for the step or a change of velocities, the velocities, those
 * before, and what else a scheme keeps; see Coefficients of time_schemes.py. */
enum { MOST_RATES = 6, MOST_KNOWN = 16 };
typedef struct {
  double dt, last_dt;
  int more, gives; /* of the rates after those before the last: how many are known, and will be */
  double inertia[MOST_RATES], velocity[MOST_RATES];
  double rates[MOST_RATES][MOST_RATES], slip[MOST_RATES];
} scheme_numbers;

/* Velocities, and what else a scheme keeps. */
typedef struct {
  int size, number;            /* of the rates, that first of which is a step or a change */
  double *rate[MOST_RATES];
  double *new_rate[MOST_RATES]; /* space, as many; of velocities perhaps that of those before */
  double last_dt;
  int after_any; /* whether numbers are the same after steps of any length */
  int ready, more; /* whether a step can begin; how many are known of those after that before the last */
  int known, oldest;
  scheme_numbers numbers[MOST_KNOWN];
  const scheme_numbers *now;   /* those of the step */
  int (*find)(void *handle, scheme_numbers *numbers);
  void *handle;
} rates;

/* Dry friction: connectors that stick (0), or slip one way or the other (-1, 1). */
struct friction {
  int number;
  const cells *rate;           /* rates of the motions */
  int at_v;                    /* where its coefficients have the velocities */
  const rates *rates;          /* in motion */
  double *const *limit;        /* of the force of each; N or N m */
  connector_laws *laws;        /* whose forces slide; or none, where sliding forces are the limits */
  kernel *limit_of_law;        /* of these laws */
  double *slip, *accepted;     /* in the latest iterate, and in the accepted state */
  double *way, *creep;         /* in the step: of what comes to rest at its end; for a unit of force */
  double *softness, *tiny;     /* creep at the limit; step that is nothing but round-off */
  int32_t *sticks, *against;   /* in the latest iterate; whether to come to rest would give energy */
  int32_t *switched;           /* see equation */
  int32_t *search, *free;      /* of laws: as that of points; whether one may change in the iterates */
  double *excess;              /* of laws: of those that an equilibrium does not admit as they are */
  int guessed;                 /* whether the next iterate is the guess */
  double *force, *rows;        /* in the iterate; of each, three */
};

/* Let `now` be the numbers of steps of a length; whether that succeeds. */
int find_numbers(rates *r, double dt);

/* A constant matrix that works on rates: inertia, or Rayleigh damping. */
typedef struct {
  step_product *product;
  rates *rates;
  double *v, *momentum; /* space */
  double *kept, *lost; /* entries of the ledger; or none */
} matrix_of_rates;

/* Motions that supports give, and their work. */
typedef struct {
  int held, moving;
  const int32_t *hold, *dof; /* of what is held; of what moves */
  const time_function *motion;
  const double *reactions;
  double *before, *work; /* work: entry of the ledger */
  double weight_of_before;
} moving_supports;

/* Cells with material points, and entries of the ledger or none. */
typedef struct {
  inelastic *cells;
  double alpha, *dt;
  points *copy; /* space for the points as the end of a step would leave them; in statics */
  double *plastic, *hinges, *numerical, *released, *stored, *hardening;
} inelastic_term;

/* Connectors of one motion: springs, rigid-plastic ones, or such as are held, damped, driven or pushed;
 * entries or none. */
typedef struct {
  couplings *links;
  const double *viscosity;            /* of dampers */
  const time_function *wanted_motion; /* of motors */
  const time_function *wanted_force;  /* of actuators; */
  double *end, *reached;              /* theirs at the end of the step, and of the last one */
  double *entry, sign;                /* of the work in the ledger */
  int dt_of_law;       /* where a rigid-plastic law has the step */
  int32_t *way_before; /* of rigid-plastic ones, after the last step */
  double *hardened, loss; /* stored by rigid-plastic ones; part of what backward Euler loses */
  double *lost;           /* entry of compiled laws */
  const inelastic_term *points; /* entries of the ledger of springs, rigid-plastic ones and laws */
} coupling_term;

/* Forces of laws of a user, which may change their direction at every step; see controllers.py. */
typedef struct {
  int number, most;            /* changes in a row that are one too many */
  double large, moved;         /* parts of the largest force, and of `length`, that count */
  const int32_t *dof;          /* where each force is among the unknowns */
  const double *const *value;  /* of a controller: its force; else none */
  int32_t *const *fresh;       /* whether it was evaluated since this was cleared */
  const double *const *rate;   /* of the motions in the last step */
  const double *length;
  double *force, *change, *largest, *told; /* told: time from which on it is too often; not a number before */
  int32_t *count;              /* changes in a row so far */
  int tells;                   /* whether any was told since this was cleared */
} force_watch;

/* Energy stored and dissipated in a step, and the sum of the sizes of the works on connectors. */
typedef struct { double in_beams, in_connectors, effort; } energy_change;

/* Adds the part of a term in a step to q1. */
typedef void (change_of_energy)(void *self, const double *q1, energy_change *sum);
typedef struct { change_of_energy *of; void *self; } change_call;

/* Whether a step to q1 may be accepted. */
typedef int (admission)(void *self, const double *q1);
typedef struct { admission *of; void *self; } admission_call;

/* Checks of static steps, see step_equation.py; and what the latest one has found. */
typedef struct {
  double slack, far, kink;
  const double *per_far; /* one over the size of the scene for displacements, one for rotations */
  double *force, weight_of_before; /* internal forces before the step */
  int terms;
  const change_call *change;
  int accounts; /* parts of the ledger */
  double *const *account;
  const int32_t *entries;
  double moves, work, stored; /* largest motion, as a part of `far`; J */
} static_path;

/* Places that open beyond a limit: points of cells or of springs, rigid-plastic connectors, or laws that
 * hold a motion. */
typedef struct {
  inelastic *cells;
  points *points;
  friction *rubs;
  rigid_plastic *slips;
  const int32_t *way_before; /* of these, after the last step */
} openable;

enum { MOST_PARTS = 4096 }; /* largest number of parts that a step is cut into */

/* Why a step is not accepted. */
enum failure {
  SUCCEEDS, RAISED, NO_EQUILIBRIUM, APPLIED_TOO_FAST, TURNS_TOO_FAR, GIVES_ENERGY, LEAVES_MECHANISM, LEAPS
};

/* Numbers of a state: how many, from where and to where in its row.  They are one after the other, or
 * have places in both, where they are added. */
typedef struct {
  double *const *from;
  int number, first;     /* first: of the row, if they are one after the other */
  const int32_t *at, *to; /* places, or none */
} kept_numbers;

/* The step of a scene: its state, and all that takes part. */
typedef struct {
  equation *equation;
  int size;
  double t, *q, *x, *s; /* x: the end of the step in the axes of the plane; s: the step of the nodes */
  double *guess, *found; /* found: space, where places may open */
  prediction *prediction;
  double load_weight, at; /* parts of the step; see step */
  int in_parts;          /* whether parts of a step go in proportion to loads and motions at its end */
  int rotations, half_tangents, multipliers;
  const int32_t *rotation, *half_tangent, *multiplier;
  int limits_turn;
  double turn, largest_turn; /* turn: the largest in the step */
  rates *rates;       /* in dynamics */
  int admissions, judges; /* checks of laws; whether there are any on any process */
  const admission_call *admission;
  static_path *path;  /* in statics */
  int loads;
  const vector *const *load; /* their forces */
  moving_supports *supports;
  int opens, places;  /* opens: whether something may open, on any process */
  const openable *place;
  phases begin, accept, add_state;
  int states;
  double *state;      /* entries of the ledger that a state has, one after the other */
  time_step step;
  int kinds, width;     /* of numbers of a state; of a row */
  int sums, after_sums; /* part of a row where numbers are added */
  const kept_numbers *kept;
  cell_forces *cell_forces;
  int watches;
  force_watch *forces; /* of laws of a user; or none */
  const watch *const *watch;
  int parts, parts_of_last; /* steps and parts of steps in the latest call; in its last step */
  int failure;            /* of the latest step; see enum failure */
  double failed_end;      /* of the smallest part that was tried */
  double (*stop)(void *handle, double t); /* the next time at which a step must stop; or none */
  void (*prepare)(void *handle); /* takes from a trial step what else a scheme keeps; or none */
  void *stops, *handle;
  /* While loads that act from the beginning are applied: that time and the end of it; the largest turn of a
   * node in a part; parts that are shorter by a factor may turn it further. */
  int applies;
  double begin_of_run, applied_by, applying_turn, short_part;
} march;

phase begin_forms, add_values, begin_static_tangent, begin_predicted_strains, begin_dead_loads,
  accept_dead_loads, begin_follower_loads, accept_follower_loads, begin_frame, accept_frame, begin_works,
  accept_works, add_energy_of_works, begin_viscous_forms, begin_second_differences,
  accept_second_differences, begin_inertia, accept_inertia, add_kinetic_energy, begin_rayleigh,
  accept_rayleigh, begin_inelastic, accept_inelastic, add_energy_of_points, begin_couplings,
  accept_couplings, add_energy_of_couplings, begin_guides, accept_guides;
void begin_couplings_again(void *self);
admission points_dissipate, springs_dissipate;
change_of_energy change_of_form, change_of_points, change_of_couplings;
double value_at(const time_function *f, double t);
void keep_state(const march *m, double *row);
int solve_begun_step(march *m, int hold);
int attempt_step(march *m, double t1, double end);
int accept_step(march *m);
int go_to_time(march *m, double end);
int take_steps(march *m, int steps, const double *ends, double seconds, int keeps, double *rows);
