# SPDX-License-Identifier: MIT
"""The virtual work of connectors: the force of a law on the variation of a relative motion."""

from __future__ import annotations

from functools import cached_property, partial, singledispatch

import basix.ufl
import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import Loop, doubles, ffi, integers, lib, loop
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel
from ufl_beam.discretization.dof_numbering import Share
from ufl_beam.discretization.state_io import Memory
from ufl_beam.dolfinx_compat import fem, line_mesh, space_with_dofs
from ufl_beam.mechanics.relative_motions import MOTIONS, Numbers, Pair
from ufl_beam.mechanics.time_schemes import Step
from ufl_beam.model.connector_laws import HELD, Law, RigidPlastic, Spring
from ufl_beam.model.connectors import Connector
from ufl_beam.terms.connector_laws import Setting, respond
from ufl_beam.terms.guide_curves import Guides
from ufl_beam.terms.links import Links
from ufl_beam.terms.rigid_plastic import RigidPlasticResponse
from ufl_beam.terms.tangent_derivatives import TangentChange

respond.register(RigidPlastic, RigidPlasticResponse)


def _alike(link: Connector) -> tuple[str, object]:
    """Key that the connectors of one :class:`Couplings` have in common."""
    return link.motion, _kind(link.law)


@singledispatch
def _kind(law: Law) -> object:
    """Key of a law: connectors with the same one are computed together."""
    return type(law), law is HELD


@_kind.register
def _(law: Spring) -> object:
    return law


@_kind.register
def _(law: RigidPlastic) -> object:
    return RigidPlastic, type(law.law)


class Couplings(Links):
    """Connectors of one relative motion whose laws are of one kind.

    Each is a cell of unit length from one node to the other, with its force as a seventh unknown.
    """

    kind = "connectors"

    def __init__(self, share: Share, here: Index, setting: Setting, A: Csr) -> None:
        super().__init__(share, here, A)
        links, dofs, n = self.links, self._dofs, len(here)
        ends = np.tile([[0.0, 0.0], [1.0, 0.0]], (n, 1))
        mesh = line_mesh(ends, np.arange(2 * n).reshape(-1, 2))
        order = np.asarray(mesh.topology.original_cell_index)
        self._order = order
        coordinates = np.ascontiguousarray(np.tile([[0.0, 0, 0], [1.0, 0, 0]], (n, 1, 1)))
        line = basix.ufl.element("Lagrange", "interval", 1)
        point = basix.ufl.element("DG", "interval", 0)
        element = basix.ufl.mixed_element([line, line, line, point])
        space = space_with_dofs(mesh, element, dofs[order], share.size)

        def given(*shape: int) -> fem.Function:
            element = basix.ufl.element("DG", "interval", 0, shape=shape)
            return fem.Function(fem.functionspace(mesh, element))

        numbers, row = given(8), given(3)
        numbers.x.array[:] = np.array(
            [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in links], dtype=np.float64
        )[order].ravel()
        q0, q1 = fem.Function(space), fem.Function(space)
        (before, _), (now, λ), (w, w_λ) = map(_split, (q0, q1, ufl.TestFunction(space)))
        motion = MOTIONS[links[0].motion]
        n_ = Numbers(*(ufl.as_vector([numbers[i], numbers[i + 1]]) for i in (0, 2, 4, 6)))
        e = motion.value(now, n_)
        e_w = motion.variation(before, now, w, n_, setting.scheme)
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 1})
        work = (λ * e_w + w_λ * (row[0] * e + row[1] * λ - row[2])) * dx
        tangent = ufl.derivative(work, q1, ufl.TrialFunction(space))
        z = ufl.TestFunction(given().function_space)

        self._kernel = kernel = partial(
            Kernel, unknown=q1, cell_dofs=dofs[order], coordinates=coordinates
        )
        self._space, self._motion = space, e * z * dx
        self._q0, self._q1, self._row, self._bend = q0, q1, row, given()
        self._forms = e, w_λ, tangent, dx
        self._work, self._tangent, self._value = map(kernel, (work, tangent, self._motion))
        self._tangent.place(A)
        self.response = respond(links[0].law, links, setting)
        self._length = np.where([c.turns for c in links], 1.0, share.grid.scene.size)
        self._e, self._now = np.zeros((2, n))
        self._rows = np.zeros((n, 3))
        self._q: Array = np.empty(0)
        self._in_c = c = ffi.new("couplings *")
        c.work, c.tangent, c.motion = self._work.cells, self._tangent.cells, self._value.cells
        self._alive = [
            *(integers(x.astype(np.int32)) for x in (order, self._forces_at, self._dofs)),
            *map(doubles, (np.zeros(n), self._now, self._e, self._before, self.work, self.rate)),
            doubles(self._length),
        ]
        c.link, c.force, c.dofs = self._alive[:3]
        c.by_cell, c.e1, c.e0, c.before, c.taken, c.rate, c.length = self._alive[3:]
        c.number, c.size = n, share.grid.scene.size
        c.row, c.row_of_tangent = (one.position(row) for one in (self._work, self._tangent))
        c.weight_of_before = setting.scheme.acting(np.ones(1), np.zeros(1))[0]
        for name, data in self.response.in_c.items():
            setattr(c, name, data)
        self._asks_python = not self.response.steady and not self.response.in_c

    # -- the step ------------------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Relative motions at ``q``; (num_links,); m or rad."""
        lib.find_motions(self._in_c, doubles(q))
        return self._now.copy()

    @cached_property
    def _velocity(self) -> tuple[Kernel, fem.Function]:
        """The rates of the motions, and the velocities that they are of; friction asks for them."""
        velocity = fem.Function(self._space)
        form = ufl.derivative(self._motion, self._q1, velocity)
        return self._kernel(form), velocity

    def rates(self, q: Array, v: Array) -> Array:
        """Rates of the motions at ``q`` if the velocities are ``v``; (num_links,); m/s or rad/s."""
        kernel, velocity = self._velocity
        by_cell, rates = np.zeros((2, len(self.links)))
        kernel.set(velocity, v)
        kernel.add(q, by_cell)
        rates[self._order] = by_cell
        return rates

    def again(self) -> None:
        """Begin the step again: forget what its iterates have tried."""
        self.response.again()

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Put minus the change of the motions where the row is about the force."""
        about_force = self.response.about_force(self._rows)
        if about_force.any():
            works[self._forces_at] = np.where(
                about_force != 0.0, -about_force * self.rates(q, v), works[self._forces_at]
            )

    def begin(self, step: Step) -> None:
        """Remember the motions at the beginning."""
        self._work.set(self._q0, step.q0)
        self._tangent.set(self._q0, step.q0)
        if step.q0 is not self._q:
            self._q, self._e[:] = step.q0, self.motion(step.q0)
        self._dt = step.dt
        self.response.begin(self._e, step)
        if self.response.steady:
            self._put(*self.response.rows(self._e, self._before))

    def _put(self, *rows: Array | float) -> None:
        for column, numbers in enumerate(rows):
            self._rows[:, column] = numbers
        for kernel in (self._work, self._tangent):
            kernel.put(self._row, self._rows[self._order])

    def loops(self) -> tuple[Loop, Loop | None] | None:
        """Those of laws that are steady or of material points."""
        if self._asks_python:
            return None
        return loop("add_couplings_force", self._in_c), loop("add_cells", self._tangent.cells)

    def demand(self) -> Loop:
        """The loop of :meth:`excess`."""
        return loop("missed_by_couplings", self._in_c)

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add the forces on the nodes, and the rows of the laws."""
        if self._asks_python:
            self._put(*self.response.rows(self.motion(q1), self.force(q1)))
        lib.add_couplings_force(self._in_c, doubles(q1), doubles(r))

    def add_tangent(self, q1: Array) -> None:
        """Add the derivative; the rows are those of the latest residual."""
        self._tangent.add(q1, self._A.data)

    def excess(self, q: Array, r: Array, force: float, moved: float) -> float:
        """Largest residual of a row: of motions as a part of 1 % of ``moved``, or of ``force``."""
        missed: float = lib.missed_by_couplings(self._in_c, doubles(q), doubles(r), force, moved)
        return missed

    def _taken(self, q1: Array) -> Array:
        weight = self._in_c.weight_of_before
        force = weight * self._before + (1 - weight) * self.force(q1)
        return np.asarray(force * (self.motion(q1) - self._e))

    def change(self, q1: Array) -> float:
        """Energy that the connectors take in the step to ``q1``; J."""
        return self.response.change(self.motion(q1), float(self._taken(q1).sum()))

    def flows(self) -> bool:
        """Return whether a connector of this process slips plastically in the latest iterate."""
        return self.response.flows()

    def shown_motion(self, q: Array) -> Array:
        """Motions of the accepted state ``q`` as solutions show them; (num_links,); m or rad."""
        return self.response.motion(self.motion(q))

    def dissipated(self) -> Array:
        """Energy that each connector has dissipated by yielding and softening; (num_links,); J."""
        return self.response.dissipated

    def effort(self, q1: Array) -> float:
        """Sum of the sizes of the works that the connectors take in the step to ``q1``; J."""
        return float(np.abs(self._taken(q1)).sum())

    def dissipation(self, q1: Array) -> float:
        """Energy that connectors of this process dissipate plastically in the step to ``q1``; J."""
        return self.response.dissipation(self.motion(q1), self.force(q1))

    def accept(self, q1: Array, s: Array) -> None:
        """Enter what was supplied or lost."""
        taken: float = lib.commit_couplings(self._in_c, doubles(q1), self._dt)
        self._q = q1
        self.response.accept(self._e, taken)

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        change, e = self._tangent_change, self.motion(q1)
        rows = np.zeros_like(self._rows)
        for column, numbers in enumerate(self.response.rows(e, self.force(q1))):
            rows[:, column] = numbers
        change.put(self._row, rows[self._order])
        change.put(self._bend, self.response.bends(e)[self._order, None])
        change.add(q1, u)

    @cached_property
    def _tangent_change(self) -> TangentChange:
        e, w_λ, tangent, dx = self._forms
        q1, bend = self._q1, self._bend

        def of_rows(u: fem.Function) -> ufl.Form:
            """Rows of laws change with the motion, too."""
            dq = ufl.TrialFunction(q1.function_space)
            return w_λ * bend * ufl.derivative(e, q1, u) * ufl.derivative(e, q1, dq) * dx

        return TangentChange(tangent, q1, self._kernel, self._A, of_rows)

    def freeze(self) -> None:
        """From now on nothing yields or breaks further."""
        self.response.freeze()

    # -- the state -----------------------------------------------------------------------------

    def add_state(self, q: Array) -> None:
        """Enter what is stored."""
        if q is not self._q:
            self._q, self._e[:] = q, self.motion(q)
            self.response.start(self._e)
        self.response.add_state(self._e)

    def remember(self, memory: Memory, q: Array) -> None:
        """Motions, forces and works, and what the laws remember."""
        response = self.response
        rows = np.column_stack([self.work, self.rate, self._before, self._e, response.state()])
        rows = memory.rows(type(response).__name__, self.numbers, rows)
        self.work[:], self.rate[:], self._before[:], self._e[:] = rows[:, :4].T
        response.restore(rows[:, 4:])
        self._q = q


def _split(q: Expr) -> tuple[Pair, Expr]:
    """Both configurations, which are values at the ends of a cell, and the force."""
    *components, force = ufl.split(q)

    def at(end: float) -> Expr:
        return ufl.as_vector([x + end / 2 * ufl.grad(x)[0] for x in components])

    return Pair(at(-1.0), at(1.0)), force


def couplings(share: Share, setting: Setting, A: Csr) -> list[Couplings | Guides]:
    """The connectors of a process, those that are alike together."""
    links = share.grid.scene.links
    groups: dict[tuple[str, object], list[int]] = {}
    for i, number in enumerate(share.links):
        groups.setdefault(_alike(links[number]), []).append(i)
    for link in {_alike(link): link for link in links}.values():
        if _alike(link) not in groups and link.motion in MOTIONS:
            respond(link.law, (), setting)  # makes the entries of the ledger that others write
    return [
        (Couplings if motion in MOTIONS else Guides)(share, np.array(here), setting, A)
        for (motion, _), here in groups.items()
    ]
