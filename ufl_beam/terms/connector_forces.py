# SPDX-License-Identifier: MIT
"""Virtual work of connectors: force of a law times the variation of a relative motion.

Guides hold a point on a curve in the plane; the point moves freely along the curve.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, loop, names, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.compiled_forms import Kernel, cached_forms
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.dolfinx_compat import line_mesh
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.errors import NoNumber
from ufl_beam.mechanics.relative_motions import MOTIONS, connector_forms
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import RIGID, ForceLaw, Guide, Law, RigidPlastic, Spring
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import REACH, parameter_step
from ufl_beam.terms.compiled_connector_laws import CompiledLaws, UserLaws
from ufl_beam.terms.connector_rows import (
    PrescribedLaws,
    Response,
    RigidPlasticLaws,
    Setting,
    Springs,
)
from ufl_beam.terms.derivatives import Each, Neighbours, form_derivative, in_c
from ufl_beam.terms.term import Callbacks, Phases, Term, beginning


def response_of(law: Any, connectors: Sequence[Connector], setting: Setting) -> Response:
    """Create the response of connectors whose laws are of the same kind as ``law``."""
    if isinstance(law, ConnectorLaw):
        return CompiledLaws(law, connectors, setting)
    kinds: dict[type, Any] = {Spring: Springs, RigidPlastic: RigidPlasticLaws, ForceLaw: UserLaws}
    made: Response = kinds.get(type(law), PrescribedLaws)(law, connectors, setting)
    return made


class ConnectorTerm(Term):
    """Connectors of the same kind; each has a force among the unknowns.

    Attributes:
        callbacks: Python functions that C calls, see :meth:`phases`.
        indices: Indices of the connectors in :attr:`Scene.all_connectors`.
        connectors: The connectors; each component of a :class:`Bushing` counts as a connector.
        forces_at: Local degrees of freedom of the forces; (num_connectors,).
        response: Response of the laws to motions and forces.
        rate: Mean rate of the motions in the last step; (num_connectors,); m/s or rad/s.
        recorded: Pairs of a field of :class:`Connection` and an array of the accepted state, which
            later steps change, (num_connectors,).  Arrays of the same field are added.
    """

    kind = "connectors"

    def __init__(self, subdomain: Subdomain, positions: Index, setting: Setting, A: Csr) -> None:
        self.indices: Index = subdomain.connectors[positions]
        self.connectors: list[Connector] = [
            subdomain.numbering.scene.all_connectors[i] for i in self.indices
        ]
        self._dofs = subdomain.connector_dofs[positions].astype(np.int32)
        self.forces_at: Index = self._dofs[:, 6]
        self._A = A
        self.callbacks: Callbacks  # set when the phases are created
        self.response = response = response_of(self.connectors[0].law, self.connectors, setting)
        self.must_dissipate = response.must_dissipate
        # In the accepted state: motions, forces, and `connector_number` of loops.h
        self._e, self._before = np.zeros((2, len(self.connectors)))
        self._recorded: Array = np.zeros((lib.CONNECTOR_NUMBERS, len(self.connectors)))
        self.rate: Array = self._recorded[lib.CONNECTOR_RATE]
        motion = self._e if response.motion is None else response.motion
        fields = names("connector_number", "connector_")
        self.recorded = [("motion", motion), *zip(fields, self._recorded, strict=True)]
        self.recorded += [("dissipated", energy) for energy in response.dissipated]

    @abstractmethod
    def motion(self, q: Array) -> Array:
        """Return the relative motions at ``q``; (num_connectors,); m or rad."""

    @property
    def effect(self) -> str:
        """See the base class."""
        return type(self.connectors[0].law).__name__

    def describe(self, place: int) -> str:
        """Return the name of a connector."""
        return str(self.connectors[place])

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add forces and residuals of laws; raise exceptions of functions of a user."""
        with self.callbacks.raising():
            super().add_residual(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Add derivatives of forces and residuals; raise exceptions of functions of a user."""
        with self.callbacks.raising():
            super().add_tangent(q1)

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Replace forces that laws determine, in ``works``, by their motions in a step ``v``."""

    def commit(self, q: Array) -> None:
        """Set the forces before the next step to the forces in ``q``."""
        self._before[:] = q[self.forces_at]

    def put_forces(self, q: Array) -> None:
        """Write the elastic forces of the initial configuration into its unknowns ``q``."""
        if (borne := self.response.borne()) is not None:
            q[self.forces_at] = self._before[:] = borne

    def require_dissipation(self, q1: Array) -> None:
        """Raise :class:`StepFailed` if a law generates energy in the step to ``q1``."""
        self.response.require_dissipation(self.motion(q1))

    def dissipation(self, q1: Array) -> float:
        """Return the plastic dissipation of these connectors in the step to ``q1``; J."""
        return self.response.dissipation(self.motion(q1), q1[self.forces_at])


def _motions_with(connector: Connector) -> tuple[str, ...]:
    """Return the names of motions in the law of a connector: one, or all motions of a bushing."""
    if isinstance(connector.law, ConnectorLaw) and connector.law.components > 1:
        return ("sliding", "sliding", "turning")[: connector.law.components]
    return (connector.motion,)


def _kind(law: Law) -> object:
    """Return the key of a law; connectors with the same key are computed together."""
    if isinstance(law, Spring):
        return law
    if isinstance(law, ForceLaw):
        return ForceLaw, len(law.state)
    if isinstance(law, ConnectorLaw):
        return type(law), law.elastic
    return type(law), law is RIGID, isinstance(law, RigidPlastic) and type(law.law)


@cached_forms
def _unit_cell() -> meshes.Mesh:
    return line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))


class ConnectorForces(ConnectorTerm):
    """Connectors with the same relative motions and laws of one kind.

    Forms are stated on a cell of unit length between the two nodes of a connector.  The unknowns of
    the cell are six nodal unknowns, then the forces.  A :class:`Bushing` is one cell; its
    components are consecutive connectors.  C evaluates the forms and most laws.

    Attributes:
        forms: Forms of a connector, and the functions in them.
        motions: Motions in the accepted state and in the latest iterate, (num_connectors,) each.
        latest_rows: α, β, γ of connector_rows.py in the latest iterate; (num_connectors, k + 2).
    """

    def __init__(self, subdomain: Subdomain, positions: Index, setting: Setting, A: Csr) -> None:
        super().__init__(subdomain, positions, setting, A)
        connectors, scheme = self.connectors, setting.scheme
        motions = _motions_with(connectors[0])
        k, n = len(motions), len(connectors)
        self._cells = n // k
        self._dofs = np.column_stack([self._dofs[::k, :6], self.forces_at.reshape(-1, k)])
        self.forms = forms = connector_forms(motions, scheme, _unit_cell())
        geometry = [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in connectors]
        self._geometry = np.reshape(geometry, (self._cells, 8 * k))
        step_forms = forms.work, forms.tangent, forms.motion
        work, tangent, value = (self._form(form) for form in step_forms)
        tangent.place(A)
        self._step_kernels, self._motion_kernel = (work, tangent), value
        self._now, self.latest_rows = np.zeros(n), np.zeros((n, k + 2))
        self.motions = self._e, self._now
        self.latest_rows[:, 0] = 1.0  # constraints, unless laws change them
        for kernel in self._step_kernels:
            kernel.put(forms.row, self.latest_rows.reshape(self._cells, -1))
        self._in_c = struct(
            "connectors", number=self._cells, components=k, dofs=self._dofs, rows=self.latest_rows,
            force=self.forces_at.copy(), size=setting.scene.size,
            length=np.where([c.is_rotation for c in connectors], 1.0, setting.scene.size),
            stiffness=self.response.stiffness,
            work=work.cells, tangent=tangent.cells, motion=value.cells,
            row=work.position(forms.row), row_of_tangent=tangent.position(forms.row),
            e0=self._e, e1=self._now, before=self._before,
            kept=[doubles(saved) for saved in self._recorded],
            weight_of_before=scheme.weight_of_before, **self.response.in_c,
        )  # fmt: skip
        self.loops = loop("add_connectors_force", self._in_c), loop("add_cells", tangent.cells)
        self.law_residual = loop("missed_by_connectors", self._in_c)
        self.response.bind_term(self)

    def _form(self, form: ufl.Form) -> Kernel:
        """Return a kernel of a form on the connectors, with their geometry."""
        unit = np.tile([[0.0, 0.0], [1.0, 0.0]], (self._cells, 1, 1))
        kernel = Kernel(form, self.forms.q1, self._dofs, unit)
        if kernel.uses(self.forms.geometry):
            kernel.put(self.forms.geometry, self._geometry)
        return kernel

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops over the connectors; laws of a user accept the end of a step in Python."""
        self.callbacks, response = callbacks, self.response
        law_fields = response.in_steps(callbacks)
        fields = {name for name, _ in ffi.typeof("connector_term").fields}
        mine = {name: x for name, x in law_fields.items() if name in fields}
        points = self._points = struct(
            "inelastic_term", points=response.in_c.get("points", ffi.NULL), springs=self._in_c,
            **{k: x for k, x in law_fields.items() if k not in fields},
        )  # fmt: skip
        c = struct("connector_term", connectors=self._in_c, points=points, **mine)
        self._term_in_c = c

        begin = beginning(self._step_kernels, self.forms.q0)
        phases = ("begin_connectors", "accept_connectors", "add_energy_of_connectors")
        first, accept, state = ([loop(name, c)] for name in phases)
        admits = loop("points_dissipate", points) if response.must_dissipate else None
        change, again = loop("change_of_connectors", c), None
        if response.needs_accept_end:

            def accept_user_laws(step: Any, q1: Any, s: Any) -> None:
                """Let laws of a user accept the end of a step before any other term accepts it."""
                lib.find_motions(self._in_c, q1)
                response.accept_end(self._now)

            accept.insert(0, callbacks.phase(accept_user_laws))
        if response.in_c.keys() & {"rigid_plastic", "friction", "asked"}:
            again = loop("begin_connectors_again", c)
        return Phases([*begin, *first], accept, state, change, response.opens, admits, again)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        forms, work, value = self.forms, self._step_kernels[0], self._motion_kernel
        by_q1 = form_derivative(forms.motion, value, self._form, forms.q1)
        row, row_bar = np.zeros((2, self._cells, forms.row.x.array.size))
        force = partial(form_derivative, forms.work, work, self._form)
        geometry, change = ffi.NULL, neighbours.differences(lambda term: term._geometry)
        direction = {"direction": change.ravel(), "stride": change[0].size}
        if change.any():
            form = form_derivative(forms.motion, value, self._form, forms.geometry, **direction)
            geometry = ffi.NULL if form is None else form
        motions = {"strains": by_q1, "by_geometry": geometry, "row_bar": row_bar}
        own = self.response.derivatives(neighbours, self, motions, row)
        if own is None:
            return None
        made = [force(forms.row, direction=row, stride=0, bar=row_bar)] if own else []
        made += [force(forms.q0)] if work.uses(forms.q0) else []
        made += [force(forms.geometry, **direction)] if change.any() else []
        return [*own, *(in_c("form", f) for f in made if f is not None)]

    # -- the step ------------------------------------------------------------------------------

    def motion(self, q: Array) -> Array:
        """Return the relative motions at ``q``; (num_connectors,); m or rad."""
        lib.find_motions(self._in_c, doubles(q))
        return self._now.copy()

    @cached_property
    def motion_rate(self) -> Kernel:
        """Kernel of the rates of the motions, for friction."""
        return self._form(self.forms.rate)

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Replace forces that laws determine by -1/β times their motions in a step ``v``."""
        β = self.rows(q)[:, -2]
        about_force = β != 0.0
        factors = np.divide(-1.0, β, out=np.zeros(len(β)), where=about_force)
        if self.response.sticks is not None:
            about_force = self.response.sticks == 0
            factors = np.where(about_force, -1.0, 0.0)
        if about_force.any():
            rates = np.zeros(len(self.connectors))
            self.motion_rate.set(self.forms.u, v)
            self.motion_rate.add(q, rates)
            at = self.forces_at
            works[at] = np.where(about_force, factors * rates, works[at])

    def rows(self, q: Array) -> Array:
        """Return the rows of the laws, linearized at ``q``; :attr:`latest_rows`."""
        lib.find_rows(self._in_c, doubles(q))
        return self.latest_rows

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``."""
        change, e = self._tangent_change, self.motion(q1)
        both = self.rows(q1), self.response.bends(e)
        rows, bends = (np.reshape(x, (self._cells, -1)) for x in both)
        for function, values in ((self.forms.row, rows), (self.forms.bend, bends)):
            if change.uses(function):
                change.put(function, values)
        change.set(self.forms.u, u)
        change.add(q1, self._A.data)

    @cached_property
    def _tangent_change(self) -> Kernel:
        change = self._form(self.forms.change)
        change.place(self._A)
        return change

    # -- the state -----------------------------------------------------------------------------

    def start(self, q: Array) -> None:
        """Set the accepted motions to the motions at ``q``, without a step."""
        self._e[:] = self.motion(q)
        self.response.start(self._e)

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore works, rates, forces, motions, and internal variables of laws."""
        response = self.response
        mine = *self._recorded, self._before, self._e
        rows = np.column_stack([*mine, response.state()])
        rows = archive.rows(response.name, self.indices, rows)
        for saved, column in zip(mine, rows.T, strict=False):
            saved[:] = column
        response.restore(rows[:, len(mine) :])


class Guides(ConnectorTerm):
    """Forces that hold points on curves.

    In schemes whose forces act over the step, they are normal to the chord of the step and do no
    work.  The round-off of points spoils the direction of a short chord.  If the polynomial through
    points around its end agrees with both ends up to round-off, or if the chord is extremely short,
    the secant of the polynomial replaces the chord.

    The motion of a guide is the distance of the point from its curve, which is zero when a step is
    accepted.  guide_curves.c computes guides, and calls Python for points of the curves.
    """

    def __init__(self, subdomain: Subdomain, positions: Index, setting: Setting, A: Csr) -> None:
        super().__init__(subdomain, positions, setting, A)
        n, size = len(self.connectors), setting.scene.size
        self._curves = [
            connector.law.curve for connector in self.connectors if isinstance(connector.law, Guide)
        ]
        x, y, λ = self._x, self._y, _ = [self._dofs[:, k] for k in (1, 3, 6)]
        pairs = (x, x), (x, y), (y, x), (y, y), (x, λ), (y, λ), (λ, x), (λ, y)
        points = np.array([connector.b.point for connector in self.connectors], dtype=np.float64)
        last_digit = np.spacing(size + np.abs(points).max(axis=1))
        self._s, self._s0 = np.zeros((2, n))
        self._steps = np.array([parameter_step(curve, 0.0, size) for curve in self._curves])
        self._on0, self._size = points.copy(), size
        self._c = struct(
            "guides", number=n, over_step=setting.scheme.average(0.0, 1.0) != 1.0,
            dofs=self._dofs, entries=np.column_stack([A.positions(*pair) for pair in pairs]),
            point=points, size=size, reach=REACH,
            shortest=size * (24 * last_digit / size) ** (1 / 3),
            distance=self._e, s0=self._s0, s=self._s, step=self._steps, on0=self._on0,
            frame=ffi.new("guide_frame[]", n), around=ffi.new("curve_around[]", n),
        )  # fmt: skip
        self._begin_again()
        self.loops = loop("add_guides_force", self._c), loop("add_guides_tangent", self._c)
        self.law_residual = loop("missed_by_guides", self._c)

    def phases(self, callbacks: Callbacks) -> Phases:
        """Return loops that begin at the accepted points of the curves, and accept new points."""
        self.callbacks = callbacks
        curves = [callbacks.handle(curve, 2 * lib.CURVE_POINTS) for curve in self._curves]
        fill(self._c, points=lib.curve_in_python, curve=ffi.new("void *[]", curves))
        self._c.report, self._c.handle = lib.run_in_python, callbacks.handle(self._report)
        begin, accept = (loop(name, self._c) for name in ("begin_guides", "accept_guides"))
        return Phases([begin], [accept], again=begin)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        others = [term._c for some in neighbours.terms for term in some]
        parameters, number = neighbours.weights.shape
        # The state of the other guides follows from that of the guides of the run
        own, (e, s0, s, step), (on0, tangent) = (
            ffi.new("guides *", self._c[0]),
            np.zeros((4, len(self._curves))),
            np.zeros((2, len(self._curves), 2)),
        )
        frame, around = (ffi.new(f"{x}[]", len(s)) for x in ("guide_frame", "curve_around"))
        fill(own, distance=e, s0=s0, s=s, step=step, on0=on0, frame=frame, around=around)
        c = struct(
            "guide_derivatives", guides=self._c, own=own, parameters=parameters, neighbours=number,
            neighbour=ffi.new("guides *[]", others), weight=neighbours.weights, tangent=tangent,
        )  # fmt: skip
        return [in_c("guides", c)]

    def _begin_again(self) -> None:
        """Discard iterates, and begin at the accepted points of the curves."""
        lib.begin_guides(self._c, ffi.NULL, ffi.NULL, ffi.NULL)

    def _report(self) -> None:
        place = self.connectors[self._c.lost].b
        raise NoNumber(f"{place}: no nearest point was found on its guide curve")

    def motion(self, q: Array) -> Array:
        """Return the distances from the curves; (num_connectors,); m."""
        self._begin_again()
        with self.callbacks.raising():
            lib.find_frames(self._c, doubles(q))
        return np.array([self._c.frame[k].distance for k in range(len(self.connectors))])

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Add the derivative of the tangent at ``q1`` along ``u``.

        Curves are Python functions, so the derivative is a fourth-order difference whose increment
        is a hundredth of the scene.  The error of curvatures is 1e-8, of the derivative 1e-6.
        """
        increment = np.abs(u[np.r_[self._x, self._y]]).max(initial=0.0)
        ε = 1e-2 * self._size / increment if increment > 0 else 1.0
        data = self._A.data
        before, change = data.copy(), np.zeros_like(data)
        for k, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1)):
            data.fill(0.0)
            self.add_tangent(q1 + k * ε * u)
            change += weight / (12 * ε) * data
        data[:] = before + change

    def save_or_restore(self, archive: Archive, q: Array) -> None:
        """Save or restore distances, and points on curves, their parameters and parameter steps."""
        arrays = (self._e, self._s, self._s0, self._steps)
        rows = archive.rows("guides", self.indices, np.column_stack([*arrays, self._on0]))
        for array, column in zip(arrays, rows.T, strict=False):
            array[:] = column
        self._on0[:] = rows[:, 4:]


def connector_terms(subdomain: Subdomain, setting: Setting, A: Csr) -> list[ConnectorTerm]:
    """Create the terms of the connectors of a process, one for each kind, guides last.

    Every process creates all entries of the ledger, in the order of the scene.
    """
    connectors = subdomain.numbering.scene.all_connectors
    groups: dict[tuple[tuple[str, ...], object], list[int]] = {}
    keys = [(_motions_with(connector), _kind(connector.law)) for connector in connectors]
    for i, number in enumerate(subdomain.connectors):
        groups.setdefault(keys[number], []).append(i)
    made: list[ConnectorTerm] = []
    for key, connector in dict(zip(keys, connectors, strict=True)).items():
        if connector.motion in MOTIONS and key in groups:
            made.append(ConnectorForces(subdomain, np.array(groups[key]), setting, A))
        elif connector.motion in MOTIONS:
            response_of(connector.law, (), setting)
    guides = [
        i
        for i, number in enumerate(subdomain.connectors)
        if isinstance(connectors[number].law, Guide)
    ]
    if guides:
        made.append(Guides(subdomain, np.array(guides), setting, A))
    return made
