# SPDX-License-Identifier: MIT
"""Runs by the reference solvers: their scope, and results in the form of other runs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from ufl_beam.arrays import Array, State
from ufl_beam.blocks.block import Block as Elements
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_transfer import same_unknowns
from ufl_beam.dolfinx_compat import fem
from ufl_beam.errors import ArgumentError, ConvergenceError, StepFailed
from ufl_beam.mechanics.point_equations import curved, rows
from ufl_beam.mechanics.time_scheme import (
    Scheme,
    Step,
    acting,
    acts_at_end,
    has_inertia,
    nodal_step,
    stages_of,
)
from ufl_beam.mechanics.time_schemes import EnergyMomentum, EnergyMomentumStatic, Static
from ufl_beam.model.beams import Mesh
from ufl_beam.model.connector_laws import RIGID, PrescribedMotion
from ufl_beam.model.connectors import law_of
from ufl_beam.model.loads import Gravity, LineLoad, PointLoad, Rayleigh
from ufl_beam.model.scene import Scene
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.output.recorder import PresentState, StateView
from ufl_beam.output.state_rows import (
    BEFORE,
    DISSIPATED,
    FORCE,
    FORCES,
    WORK,
    Block,
    Columns,
    Connection,
)
from ufl_beam.output.states import States
from ufl_beam.parallel import Agreement, ProcessComparison
from ufl_beam.reference.connectors import Connectors, Hinge
from ufl_beam.reference.solver import Solver
from ufl_beam.simulation.impacts import Impact, impacts_of
from ufl_beam.simulation.initial_state import (
    StateOf,
    checked_numbering,
    chosen_state,
    continuation,
    initial_state,
    mesh_of,
    require_held,
)
from ufl_beam.simulation.simulation import Simulation
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.stepper import MOST_SUBSTEPS
from ufl_beam.solvers.newton_options import Newton, checked_newton

SCHEMES = Static, EnergyMomentum, EnergyMomentumStatic
DEAD_LOADS = PointLoad, LineLoad, Gravity
RATE = Connection._fields.index("rate")


def require_scope(numbering: DofNumbering, scheme: Scheme, comm: MPI.Intracomm) -> None:
    """Raise :class:`ArgumentError` if the solver leaves out a part of the scene, or the scheme."""
    scene = numbering.scene
    kinds = {id(kind): kind for kind, _ in numbering.inelastic}.values()
    sections = {beam.section for beam in scene.beams}
    several = [s for s in sections if len(s.section_points(s.hinge)) > 1]
    connectors = (c for c in scene.all_connectors if c not in scene.hinges)
    known = isinstance(scheme, SCHEMES) and getattr(scheme, "order", 2) == 2
    refused: dict[str, Sequence[object]] = {
        "a scene without beams,": [scene] * (not scene.beams),
        "the scheme": [scheme] * (not known),
        "a mesh of degree above 1": [numbering.mesh] * (numbering.mesh.degree > 1),
        "the law of": [c for c in connectors if not isinstance(c.law, PrescribedMotion)],
        "the law of the hinge": [
            hinge for hinge in scene.hinges if not isinstance(law_of(hinge), SofteningLaw)
        ],
        "the load": [x for x in scene.loads if not isinstance(x, DEAD_LOADS)],
        "the damping": [x for x in scene.damping if not isinstance(x, Rayleigh) or x.tangent],
        "the work": scene.works,
        "the law": [
            kind.kind.law for kind in kinds
            if kind.kind.law.solves or rows(kind.kind.law, "strain") != ("strain",)
        ],
        "laws of several classes in": several,
        f"{comm.size} processes for": [numbering] * (comm.size > len(numbering.cells)),
    }  # fmt: skip
    for kind, objects in refused.items():
        for what in objects:
            raise ArgumentError(
                f"Newton: reference=True cannot be combined with {kind} {what}: the reference "
                "solver computes beams with resultants or fibres, hinges, joints, bodies and dead "
                "loads, see docs/theory.md; leave it out"
            )


class ReferenceRun(Solver, PresentState):
    """Simulation by the reference solver, with energy ledger, section forces and stored states.

    It takes the arguments of :class:`Simulation`.
    """

    _sums: Array
    _reactions: Array
    warn, may_break, damage = StateView.warn, StateView.may_break, StateView.damage

    def __init__(
        self, scene: Scene, scheme: Scheme, *, t0: float, start: StateOf | None,
        newton: Newton | None, mesh: Mesh | None, comm: MPI.Intracomm,
    ) -> None:  # fmt: skip
        newton, start = checked_newton(newton, comm), chosen_state(start, "start")
        mesh, fresh = mesh_of(start, mesh), start is None
        numbering, _ = checked_numbering(scene, scheme, mesh, fresh=fresh)
        require_scope(numbering, scheme, comm)
        q, v, internal, _ = state = initial_state(numbering, start)
        t, same = continuation(start, scene, t0)
        impacts, impact = impacts_of(numbering, scheme, t, start, same, state)
        super().__init__(numbering, scheme, t, newton=newton, comm=comm)
        self.impacts, self.q_before = impacts, q
        self.start(q, v, None if start is None else internal)
        if same and "reactions" in internal:
            self._reactions = internal["reactions"]
        self.subdomain, self.together = Subdomain(numbering, MPI.COMM_SELF), Agreement(comm)
        self.comparison = ProcessComparison(MPI.COMM_SELF, self.subdomain)
        self.requested_forces: dict[Any, float] = {}
        self.solution = solution = Solution(scene, numbering)
        between = solution.equilibrium_fraction = float(scheme.average(0.0, 1.0))
        solution.needs_start, solution.scheme = between < 1, scheme
        self.parameter = solution.parameter
        alike = start is not None and same_unknowns(start.numbering, numbering)
        if alike and start is not None and start.equilibrium_fraction == between:
            self._forces = start.cell_resultants(-1)[:, self.frame.cells]
            self.q_before = start.before(-1)
        self._sum_energies()
        self._lost_before = self._sums[2:].copy()
        self._meet(impact)
        self._sum_energies()

    def start(self, q: Array, v: Array, internal: State | None) -> None:
        """See the base class; also begin the ledger, the reactions and the forces."""
        super().start(q, v, internal)
        numbering, size = self.numbering, len(self.frame.cells)
        self.ledger, self._lost_before = self._make_ledger(), np.zeros(2)
        self._forces, self._load_before = np.zeros((9, size)), self.load
        self._history = np.zeros((len(self.scene.all_connectors), len(Connection._fields)))
        self._reactions = np.zeros(numbering.size)
        for group in self.connectors:
            if not self.fresh:
                require_held(group.connectors, group.e0, self.scene.size)
            self._history[group.indices, 0] = group.e0
            self._history[group.indices, FORCE] = q[group.forces_at]
            for name in self._tables(group) if internal else ():
                self._restore(group, name, internal.get(name, np.zeros((0, 0))))  # type: ignore[union-attr]
        if not self.fresh and not self.dynamic:
            self._reactions = self._held(self.forces() - self.load)

    def _restore(self, group: Connectors, name: str, table: Array) -> None:
        recorded, forces = (name.startswith(x) for x in ("recorded", "forces"))
        for k, index in enumerate(group.indices):
            for row in table[table[:, :1].ravel() == index, 1:]:
                if recorded:
                    self._history[index, [0, WORK, RATE]] = row[:3]
                elif forces:
                    self._history[index, FORCE] = row[0]
                if (hinge := group.hinges.get(k)) and recorded:
                    self._history[index, DISSIPATED] = hinge.dissipated = float(row[3])
                elif hinge and not forces:
                    hinge.opening, hinge.e0, _, _, flows = map(float, row)
                    hinge.flows = int(flows)

    def _held(self, forces: Array) -> Array:
        """Return the forces on prescribed coordinates; (size,)."""
        on_coordinates, reactions = self.frame.E.T @ forces, np.zeros(len(forces))
        reactions[self.frame.held] = on_coordinates[self.frame.held]
        return reactions

    def steps_to(self, ends: Array, *, keep: bool = False) -> int:
        """Go to some of the times ``ends``; return their number.

        Raises:
            ConvergenceError: Even the smallest substep failed.
        """
        ends = ends[:16]  # so that the run can be interrupted
        for end in map(float, ends):
            try:
                self.step_to(end)
            except StepFailed as failure:
                raise ConvergenceError(
                    f"no equilibrium after t = {self.t:.9g} s: {failure}. {self.scheme.advice}",
                    time=self.t, dt=end - self.t, solution=self.solution, residuals={}, forces={},
                    reason=failure.reason,
                ) from failure  # fmt: skip
            if keep:
                self.keep()
        return len(ends)

    # -- energies --------------------------------------------------------------------------------

    def _make_ledger(self) -> SimpleNamespace:
        """Return the entries of the energy ledger with zeros; see :class:`Energy`."""
        scene, scheme, points = self.scene, self.scheme, self.points
        over_step, softens = not acts_at_end(scheme), any(p.section.softening for p in points)
        yields = any(p.section.yields for p in points)
        releases = over_step and (softens or any(curved(p.section.kind) for p in points))
        defect = has_inertia(scheme) and scheme.coefficients(1.0, 1.0, 0).velocity_defect
        laws = [connector.law for connector in scene.all_connectors]
        motors = any(isinstance(law, PrescribedMotion) and law is not RIGID for law in laws)
        occurs: dict[str, dict[str, object]] = {
            "state": {"stored": True, "hardening": yields, "kinetic": self.dynamic},
            "supplied": {
                "supports": any(support.moving for support in scene.supports),
                "loads": scene.loads, "motors": motors,
            },
            "lost": {
                "plastic": yields, "hinges": softens or scene.hinges, "damping": scene.damping,
                "numerical": scheme.alpha or defect or releases,
                "impacts": self.impacts is not None and self.impacts.moves,
            },
        }  # fmt: skip
        return SimpleNamespace(**{
            account: defaultdict(float, {name: 0.0 for name, does in entries.items() if does})
            for account, entries in occurs.items()
        })  # fmt: skip

    def accept(self, step: Step) -> None:
        """Accept the end of a step, and enter works and losses in the ledger."""
        scheme, supplied, lost, s = self.scheme, self.ledger.supplied, self.ledger.lost, self.s
        self._forces = self._cell_forces()
        reactions = self._held(self.forces() - self.load)
        if "supports" in supplied:
            along = nodal_step(scheme, self.y, self.y1, self.numbering.rotations)
            supplied["supports"] += float(acting(scheme, self._reactions, reactions) @ along)
        if "loads" in supplied:
            supplied["loads"] += float(acting(scheme, self._load_before, self.load) @ s)
        for group in self.connectors:
            rows, force = self._history[group.indices], self.q1[group.forces_at]
            growth = group.motions(self.q1) - group.e0
            work = acting(scheme, rows[:, FORCE], force) * growth
            rows[:, 0], rows[:, FORCE] = rows[:, 0] + growth, force
            rows[:, WORK], rows[:, RATE] = rows[:, WORK] + work, growth / step.dt
            self._history[group.indices] = rows
            if "motors" in supplied:
                drives = [isinstance(c.law, PrescribedMotion) and c.law is not RIGID
                          for c in group.connectors]  # fmt: skip
                supplied["motors"] -= float(work @ drives)
        numerical = 2 * scheme.alpha * fem.assemble_scalar(self.fields.lost)
        numerical -= sum(points.numerical for points in self.points)
        v, self.q_before = self.v, self.q
        super().accept(step)
        numerical += sum(points.numerical for points in self.points)
        if "numerical" in lost:
            lost["numerical"] += self.comm.allreduce(float(numerical))
        if self.dynamic:
            defect = self.coefficients.velocity_defect
            if defect is not None:
                parts = defect[0] * (self.v - v) + defect[1] * v
                lost["numerical"] += self._product(self.M, self.masses, parts, self.v - v)
            if "damping" in lost:
                product = self._product(self.damping, self.rayleigh[0] * self.masses, s, s)
                lost["damping"] += product / step.dt
        for group in self.connectors:
            for k, hinge in group.hinges.items():
                self._history[group.indices[k], DISSIPATED] = hinge.dissipated
        self._reactions, self._load_before = reactions, self.load
        self._sum_energies()

    def _product(self, A: Any, diagonal: Array, a: Array, b: Array) -> float:
        """Return a·(A + diagonal) b of two vectors of the scene."""
        for function, x in ((self.rate, a), (self.r, b)):
            function.x.array[:] = x[self.frame.dofs]
        product = A.createVecLeft()
        A.mult(self.r.x.petsc_vec, product)
        return float(self.rate.x.petsc_vec.dot(product) + a @ (diagonal * b))

    def _sum_energies(self) -> None:
        state, lost = self.ledger.state, self.ledger.lost
        sums = np.array([self.elastic, 0.0, 0.0, 0.0])
        for points in self.points:
            sums += np.r_[points.stored.sum(axis=0), points.recorded[:, 4:].sum(axis=0)]
        self.comm.Allreduce(MPI.IN_PLACE, sums)
        sums[3] += sum(part.dissipated for part in self.parts if isinstance(part, Hinge))
        self._sums = sums
        values = dict(zip(("stored", "hardening"), sums, strict=False))
        values |= dict(zip(("plastic", "hinges"), sums[2:] - self._lost_before, strict=True))
        if self.dynamic:
            values["kinetic"] = self._product(self.M, self.masses, self.v, self.v) / 2
        for account in (state, lost):
            account.update((name, float(values[name])) for name in account if name in values)
        self.energies = sum(abs(x) for one in vars(self.ledger).values() for x in one.values())

    def _solve(self, step: Step) -> None:
        """See the base class; before, velocities meet rates of motions that have jumped."""
        if self.impacts is not None:
            counts = self.impacts.after(self.last_dt, self.t, step.t1)
            self._meet(self.impacts.find(self.q, self.v, self.t, counts, {}, longest=step.dt / 4))
        super()._solve(step)

    def _meet(self, impact: Impact | None) -> None:
        """Change the velocities by an impact, if there is one, and enter it in the ledger."""
        if impact is not None and self.impacts is not None:
            self.v, works = impact.v, np.zeros(len(self._history))
            self.impacts.enter(impact, self.ledger, [(np.arange(len(works)), works)])
            self._history[:, WORK] += works

    # -- section forces --------------------------------------------------------------------------

    def _cell_forces(self) -> Array:
        """Return the forces of the nodes on cells in the step, as rows of FORCES; (9, cells)."""
        fields = self.fields
        along: Any = np.tensordot(self.factors, self.of_loads_on_cells, 1)
        forces = _table(fields.forces_on_cells(fields.force_on_cells)) - _table(along, density=True)
        if self.dynamic:
            c, (a0, a1) = self.coefficients, self.rayleigh
            a, v = (row[0] * self.s + row[1] * self.v for row in (c.inertia, c.velocity))
            inertia, damping = (fields.mass_on_cells, a + a0 * v), (fields.damping_on_cells, a1 * v)
            for (form, rate), density in ((inertia, True), (damping, False)):
                fields.v.x.array[:] = rate[self.frame.dofs]
                forces += _table(fields.forces_on_cells(form), density=density)
        return forces

    # -- states ----------------------------------------------------------------------------------

    @property
    def now(self) -> States:
        """Present state as a solution; all processes call it together."""
        numbering, scene = self.numbering, self.scene
        reactions = np.zeros((len(scene.supports), 3))
        for row, support in zip(reactions, scene.supports, strict=True):
            row[[*support.held]] = self._reactions[numbering.node(support.place)[[*support.held]]]
        material = np.zeros((len(numbering.inelastic_cells), 6))
        forces = np.zeros((9, len(numbering.cells)))
        for points in self.points:
            at = np.searchsorted(numbering.inelastic_cells, self.frame.cells[points.cells])
            material[at] = points.recorded
        forces[:, self.frame.cells] = self._forces
        for table in (material, forces):
            self.comm.Allreduce(MPI.IN_PLACE, table)
        state = {"t": np.array(self.t), "q": self.q, "reactions": reactions}
        if self.dynamic:
            state["v"] = self.v
        for account, energies in vars(self.ledger).items():
            state |= {f"{account}: {name}": np.array(value) for name, value in energies.items()}
        state |= {"connectors": self._history, "material": material, FORCES: forces}
        between = self.solution.equilibrium_fraction
        if between < 1:
            state[BEFORE] = self.q_before
        columns = Columns({name: np.shape(values) for name, values in state.items()})
        row = np.concatenate([np.ravel(values) for values in state.values()])
        now = States(numbering, None, Block(columns, row[None], 1))
        now.equilibrium_fraction, now.needs_start = between, between < 1
        return now

    def keep(self) -> None:
        """Append the state to :attr:`solution`; all processes call it."""
        columns, row = self.now.row(0)
        if self.substeps == 0 and self.dynamic:
            columns.column_of("reactions", row).fill(math.nan)  # unknown before the first step
        self.solution.append(columns, row)
        self.solution.count(self.substeps, self.iterations)

    def end(self) -> None:
        """Store the last state, and the data for ``start=``, in the solution."""
        if self.t not in self.solution.times[-1:]:
            self.keep()
        self.solution.substeps, self.solution.iterations = self.substeps, self.iterations
        self.solution.internal = self.internal()

    def internal(self) -> State:
        """Return the variables that a later run needs, by name, on all processes."""
        tables: dict[str, list[Array]] = {}
        for part in self.comm.allgather([points.state() for points in self.points]):
            for table in part:
                tables.setdefault(f"cells, {table.shape[1] - 1}", []).append(table)
        for group in self.connectors:
            for name, table in self._tables(group).items():
                tables.setdefault(name, []).append(table)
        whole = {name: np.concatenate(parts) for name, parts in tables.items()}
        whole = {name: x[np.argsort(x[:, 0], kind="stable")] for name, x in whole.items()}
        return whole | {"reactions": self._reactions}

    def _tables(self, group: Connectors) -> State:
        """Return recorded numbers and states of connectors, as :class:`ConnectorBlock` does."""
        tables: dict[str, list[list[float]]] = {}
        for k, index in enumerate(group.indices):
            name = "Held" if group.connectors[k].law is RIGID else "Driven"
            motion, work, rate, force = self._history[index, [0, WORK, RATE, FORCE]]
            recorded, state = [motion, work, rate], list[float]()
            if h := group.hinges.get(k):
                name = "Hinged"
                recorded += [h.dissipated, group.e0[k]]
                state += [h.opening, h.e0, h.limit, 0.0, h.flows]
            rows = {f"recorded of {name}": recorded, f"forces of {name}": [force], name: state}
            for kind, row in rows.items():
                tables.setdefault(f"{kind}, {len(row)}", []).append([index, *row])
        return {name: np.array(rows) for name, rows in tables.items() if rows[0][1:]}

    def velocities(self) -> list[Array]:
        """Return a list with the velocities; empty in statics."""
        return [self.v] if self.dynamic else []

    def watch(self, fractions: Array) -> Any:
        """Raise :class:`ArgumentError`: only C updates extremes after each substep."""
        raise ArgumentError("Newton: reference=True cannot be combined with Extremes; leave it out")


def _table(forces: Array, *, density: bool = False) -> Array:
    """Return forces of both nodes on each cell, (cells, 2, 3), as rows of the column FORCES."""
    start, end = forces.transpose(1, 2, 0)
    return np.vstack([start, end, density * (start[2] + end[2]), density * (end - start)[:2] / 2])


# -- space ----------------------------------------------------------------------------------------

SMALL_CHANGE = 1e-9
"""Largest change of the last iterate but one, in sizes of the scene or rad."""


class ReferenceInSpace(Simulation):
    """Simulation by the reference solver in space: Newton's method by a plain loop over kernels.

    Assembly in lanes, static condensation, prediction and search of the ordinary solver are not
    used.  The ordinary step then accepts the solution, so that results have the ordinary form.

    Raises:
        ArgumentError: The solver leaves out a part of the scene, or there are several processes.
    """

    def __init__(
        self, *arguments: Any, newton: Newton | None, comm: MPI.Intracomm, **more: Any
    ) -> None:
        plain = replace(checked_newton(newton, comm), reference=False)
        super().__init__(*arguments, newton=plain, comm=comm, **more)
        refused = {
            f"{comm.size} processes": comm.size > 1,
            "supports that move or have their own axes": self.supports.turned or self.supports.work,
            "loads that act from the start of statics": self._applies,
            f"{self.scheme!r}": len(stages_of(self.scheme)) > 1,
        }
        for what, refuses in refused.items():
            if refuses:
                raise ArgumentError(
                    f"Newton: reference=True in space cannot be combined with {what}; leave it out"
                )

    def steps_to(self, ends: Array, *, keep: bool = False) -> int:
        """Go to one of the times ``ends``; return 1.

        Raises:
            ConvergenceError: Even the smallest substep failed.
        """
        end, begin, done, some = float(ends[0]), self.t, 0, MOST_SUBSTEPS
        while done < MOST_SUBSTEPS:
            last = done + some == MOST_SUBSTEPS
            t1 = end if last else begin + (end - begin) * (done + some) / MOST_SUBSTEPS
            row: Array = np.zeros((1, self._writer.columns.width))
            try:
                self._accept_given(np.array([t1, end, 0.0]), self._solve(t1, end), row)
                done += some
            except StepFailed as failure:
                if some == 1:
                    self.give_up(failure, t1)
                some //= 2
        if keep:
            self.keep()
        return 1

    def _solve(self, t1: float, end: float) -> Array:
        """Return the configuration at the end of a step."""
        equation, last_dt = self.equation, float(self.prediction.c.dt)
        self._evaluate_controllers()
        equation.begin(Step.create(self.scheme, self.t, t1, end, self.q))
        x = self.q + (t1 - self.t) / last_dt * (self.q - self.q_before)
        scales = self.numbering.scales
        free = np.setdiff1d(np.arange(len(x)), self.supports.dofs)
        x[self.supports.dofs] = self.q[self.supports.dofs]
        change = last = np.inf
        for _ in range(self.newton.max_iterations):
            r, K, size = self._equation(x)
            left = float(np.linalg.norm((equation.weights * r)[free]))
            if change <= SMALL_CHANGE and (left <= self.newton.rtol * size or left > last / 2):
                return x  # to the tolerance, or to round-off
            last = left
            if not np.isfinite([left, K.sum()]).all():
                raise StepFailed("a force is not a finite number")
            try:
                step = splu(K[free][:, free].tocsc()).solve(r[free])
            except RuntimeError:
                raise StepFailed("the tangent is singular") from None
            x[free] -= step
            equation.c.total += 1
            change = float(np.abs(step * scales[free]).max(initial=0.0))
        raise StepFailed(f"Newton's method changes the iterate by {change:.1e} without an end")

    def _equation(self, x: Array) -> tuple[Array, Any, float]:
        """Return the residual at ``x``, its tangent, and the sum of the sizes of forces."""
        r, K, size = np.zeros(len(x)), coo_array((len(x), len(x))).tocsr(), 0.0
        rows, columns, values = list[Array](), list[Array](), list[Array]()
        for term in self.terms:
            own = np.zeros(len(x))
            term.add_residual(x, own)  # laws choose their branches
            if isinstance(term, Elements):
                own[:] = 0.0
                for dofs, forces, entries, tangent in term.each_element(x):
                    np.add.at(own, dofs, forces)
                    rows.append(dofs[entries[: len(tangent), 0]])
                    columns.append(dofs[entries[: len(tangent), 1]])
                    values.append(tangent)
            size += float(np.linalg.norm(self.equation.weights * own))
            r += own
        if values:
            places = np.concatenate(rows), np.concatenate(columns)
            K = K + coo_array((np.concatenate(values), places), shape=K.shape).tocsr()
        if has_inertia(self.scheme):
            K = K + self.inertia.c.now.inertia[0] * self.inertia.M.sparse()
        return r, K, size
