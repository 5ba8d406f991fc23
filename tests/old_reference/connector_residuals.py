# SPDX-License-Identifier: MIT
"""Forces of connectors, which do work on relative motions, and of guide curves."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import basix.ufl
import numpy as np
import ufl
from ufl.core.expr import Expr

from old_reference.cell_forms import (
    Archive,
    Force,
    Form,
    Response,
    Setting,
    cell_dofs,
    coupled,
    put,
    separate_cells,
)
from old_reference.connector_updates import law_in_step
from ufl_beam.arrays import Array, Index
from ufl_beam.caches import cached_forms
from ufl_beam.dolfinx_compat import fem
from ufl_beam.dolfinx_compat import mesh as meshes
from ufl_beam.errors import NoNumber
from ufl_beam.mechanics.relative_motions import MOTIONS, Geometry, Pair
from ufl_beam.mechanics.time_scheme import Scheme, Step, acting
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector

GUIDE_INCREMENT = 1e-5
"""Increment of central differences of the forces of guides, divided by the size of the scene.

The error of the differences is of second order; round-off of the curve adds less than 1e-10.
"""


class ConnectorForms(NamedTuple):
    """Forms of connectors, and their coefficients."""

    work: ufl.Form  # virtual work, and ``row[:n]·e + row[n] λ - row[n + 1]`` of each motion
    tangent: ufl.Form  # derivative of ``work`` by ``q1``
    motion: ufl.Form  # the n relative motions e of each cell
    rate: ufl.Form  # derivatives of the motions along ``u``
    geometry: fem.Function  # :class:`Geometry` of each motion
    row: fem.Function
    q0: fem.Function  # configurations and forces λ at the beginning of the step
    q1: fem.Function  # configurations and forces λ at its end
    u: fem.Function


@cached_forms
def connector_forms(motions: Sequence[str], scheme: Scheme, cell: meshes.Mesh) -> ConnectorForms:
    """Return forms on cells of unit length between the two nodes of a connector."""
    n = len(motions)
    line = basix.ufl.element("Lagrange", "interval", 1)
    point = basix.ufl.element("DG", "interval", 0)
    space = fem.functionspace(cell, basix.ufl.mixed_element([line, line, line, *n * [point]]))
    geometry, row, motions_by_cell = (
        fem.Function(fem.functionspace(cell, ("DG", 0, (size,))))
        for size in (8 * n, n * (n + 2), n)
    )
    q0, q1, u = (fem.Function(space) for _ in range(3))
    (before, _), (now, λ), (w, w_λ) = map(_split, (q0, q1, ufl.TestFunction(space)))
    dx = ufl.Measure("dx", domain=cell, metadata={"quadrature_degree": 1})
    z = ufl.TestFunction(motions_by_cell.function_space)
    e, e_w = [], []
    for k, motion in enumerate(motions):
        at = range(8 * k, 8 * k + 8, 2)
        mine = Geometry(*(ufl.as_vector([geometry[i], geometry[i + 1]]) for i in at))
        value, variation = MOTIONS[motion](before, now, w, mine, scheme)
        e.append(value)
        e_w.append(variation)
    density, motion_sum = 0, 0
    for i in range(n):
        first = i * (n + 2)
        law = sum(row[first + j] * e[j] for j in range(n))
        density += λ[i] * e_w[i] + w_λ[i] * (law + row[first + n] * λ[i] - row[first + n + 1])
        motion_sum += e[i] * z[i]
    work, by_cell = density * dx, motion_sum * dx
    tangent = ufl.derivative(work, q1)
    rate = ufl.derivative(by_cell, q1, u)
    return ConnectorForms(work, tangent, by_cell, rate, geometry, row, q0, q1, u)


def _split(q: Expr) -> tuple[Pair, Sequence[Expr]]:
    """Split a function into the configurations at both ends of a cell, and the forces."""
    fields = ufl.split(q)

    def at(end: float) -> Expr:
        return ufl.as_vector([x + end / 2 * ufl.grad(x)[0] for x in fields[:3]])

    return Pair(at(-1.0), at(1.0)), fields[3:]


class ConnectorGroup(Force):
    """Base of groups of connectors, whose forces are unknowns of the scene.

    Attributes:
        indices: Indices of the connectors in :attr:`Scene.all_connectors`.
        forces_at: Indices of the unknown forces among the degrees of freedom.
        before: Forces at the end of the last step.
        at_rest: Forces of the laws at the initial configuration.
    """

    def __init__(self, indices: Index, setting: Setting) -> None:
        numbering, self.setting = setting.numbering, setting
        self.size, self.indices = numbering.size, indices
        self.connectors: list[Connector] = [numbering.scene.all_connectors[i] for i in indices]
        self.dofs = numbering.dofs_of_connectors[indices]
        self.forces_at = self.dofs[:, 6]
        self.work, self.rate, self.before, self.at_rest = np.zeros((4, len(indices)))


class Connectors(ConnectorGroup):
    """Connectors with the same kind of relative motion, or bushings with k motions each.

    Each connector or bushing is a cell of unit length between its nodes.  Its forces are further
    unknowns of the cell.
    """

    def __init__(self, motions: Sequence[str], indices: Index, setting: Setting) -> None:
        n, k, size = len(indices), len(motions), setting.numbering.size
        mesh, order = separate_cells(np.tile([[0.0, 0.0], [1.0, 0.0]], (n // k, 1, 1)))
        super().__init__(indices.reshape(-1, k)[order].ravel(), setting)
        self._k, self.laws = (
            k,
            [law_in_step(connector, setting) for connector in self.connectors[::k]],
        )
        self._forms = connector_forms(motions, setting.scheme, mesh)
        forms = self._forms
        self._at: Index = np.empty(n // k * (6 + k), dtype=np.int64)
        self._at[cell_dofs(forms.q1.function_space)] = np.column_stack(
            [self.dofs[::k, :6], self.forces_at.reshape(-1, k)]
        )
        self._work, self._tangent, self._motion, self._rate = (
            Form(form, self._at, size)
            for form in (forms.work, forms.tangent, forms.motion, forms.rate)
        )
        geometry = [(*c.arms[0], *c.arms[1], *c.apart, *c.axis) for c in self.connectors]
        put(forms.geometry, np.reshape(geometry, (-1, 8 * k)))
        by_cell = forms.motion.arguments()[0].ufl_function_space()
        self._cell_dofs = cell_dofs(by_cell).ravel()
        self._length = np.where(
            [connector.is_rotation for connector in self.connectors],
            1.0,
            setting.numbering.scene.size,
        )
        self._rows: Array = np.zeros((n, k + 2))
        self._e0: Array = np.zeros(n)

    def motion(self, q: Array) -> Array:
        """Return the relative motions at ``q``; (num_connectors,); m or rad."""
        self._forms.q1.x.array[:] = q[self._at]
        return np.asarray(self._motion.assembled()[self._cell_dofs])

    def rates(self, q: Array, v: Array) -> Array:
        """Return the rates of the motions at velocities ``v``; (num_connectors,); m/s, rad/s."""
        self._forms.q1.x.array[:], self._forms.u.x.array[:] = q[self._at], v[self._at]
        return np.asarray(self._rate.assembled()[self._cell_dofs])

    def begin(self, step: Step) -> None:
        """Begin the step in all laws."""
        for law, e0 in zip(self.laws, self._by_connector(self._e0), strict=True):
            law.begin(e0, step)

    def _by_connector(self, values: Array) -> list[Any]:
        """Return the values of each connector: a number, or the array of its k components."""
        return [*map(float, values)] if self._k == 1 else [*values.reshape(-1, self._k)]

    def response(self, step: Step, q1: Array) -> Response:
        """Return forces on the nodes, with residuals of the laws, and their derivative."""
        arguments = map(self._by_connector, (self.motion(q1), q1[self.forces_at]))
        rows = [law.row(e, λ) for law, e, λ in zip(self.laws, *arguments, strict=True)]
        self._rows = np.vstack([np.reshape(row, (self._k, -1)) for row in rows])
        put(self._forms.row, self._rows.reshape(len(self.laws), -1))
        self._forms.q0.x.array[:] = step.q0[self._at]
        return self._work.joined(self._work.assembled()), self._tangent.assembled()

    def relative_residual(self, q: Array, r: Array, scale: float, moved: float) -> float:
        """Return the largest relative residual of a law, without round-off of motions.

        A residual in motion is relative to 1 % of ``moved`` (m), a residual in force to ``scale``
        (N).  Rotations are multiplied, and moments divided, by the size of the scene.  The force of
        a law with internal variables has the round-off of the motions times its elastic stiffness.
        """
        size = self.setting.numbering.scene.size
        k, length = self._k, self._length.reshape(-1, self._k)
        amplitude, weight = moved / size, np.abs(self._rows[:, k])
        slopes = np.repeat([law.slope for law in self.laws], k)
        about_motion = weight * slopes < 1 - 1e-12
        motion_scale = 0.01 * self._length * amplitude
        wanted = np.where(about_motion, motion_scale, weight * scale * size / self._length)
        positions = np.maximum(np.abs(q[self.dofs[:, :4]]).max(axis=1) / size,
                         np.abs(q[self.dofs[:, 4:6]]).max(axis=1)) + amplitude  # fmt: skip
        left = np.abs(r[self.forces_at])
        row_motions = (np.abs(self._rows[:, :k]) * np.repeat(length, k, axis=0)).sum(axis=1)
        elastic = np.concatenate([np.broadcast_to(law.stiffness, k) for law in self.laws])
        farthest = np.maximum(positions, np.abs(self._e0) / self._length)
        in_law = weight * elastic * self._length * np.spacing(farthest)
        left -= np.maximum(8 * row_motions * np.spacing(positions), in_law)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.where(left <= 0, 0.0, left / wanted).max())

    def taken(self, q1: Array) -> Array:
        """Return the works of the forces in the step; (num_connectors,); J."""
        force = acting(self.setting.scheme, self.before, q1[self.forces_at])
        return np.asarray(force * (self.motion(q1) - self._e0))

    def change(self, step: Step, q1: Array) -> float:
        """Return the energy that connectors store, dissipate or transfer in the step; J."""
        works = self.taken(q1).reshape(-1, self._k).sum(axis=1)
        each = zip(self.laws, self._by_connector(self.motion(q1)), works, strict=True)
        return sum(law.change(e, float(work)) for law, e, work in each)

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept the end of the step; enter supplied works and losses in the ledger."""
        e, taken = self.motion(q1), self.taken(q1)
        self.work = self.work + taken
        self.rate, self._e0 = np.asarray((e - self._e0) / step.dt), e
        self.before = q1[self.forces_at]
        works = taken.reshape(-1, self._k).sum(axis=1)
        for law, motion, work in zip(self.laws, self._by_connector(e), works, strict=True):
            law.accept(motion, float(work))

    def start(self, q: Array) -> None:
        """Begin a run at the motions of ``q``, and compute the forces there."""
        self._e0 = self.motion(q)
        each = zip(self.laws, self._by_connector(self._e0), strict=True)
        self.at_rest = np.concatenate([np.atleast_1d(law.start(e)) for law, e in each])

    @property
    def stored(self) -> Mapping[str, float]:  # type: ignore[override]
        """Stored energies of the laws, by entry of the ledger; J."""
        total: dict[str, float] = defaultdict(float)
        for name, energy in (item for law in self.laws for item in law.stored.items()):
            total[name] += energy
        return total

    def columns(self, q: Array) -> Array:
        """Return the columns of ``Connection``; (num_connectors, 5)."""
        each = zip(self.laws, self._by_connector(self._e0), strict=True)
        e = np.ravel([law.z.get("start", e) for law, e in each])
        dissipated = np.zeros(len(self.connectors))
        dissipated[:: self._k] = [law.z.get("dissipated", 0.0) for law in self.laws]
        return np.column_stack([e, q[self.forces_at], self.work, self.rate, dissipated])

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore works, rates, forces, motions and internal variables, by kind of law."""
        for i in range(len(self.connectors)):
            law = self.laws[i // self._k]
            row = np.array([self.work[i], self.rate[i], self.before[i], self._e0[i], *law.state()])
            row = archive.rows(law.saved_as, self.indices[i : i + 1], row[None])[0]
            self.work[i], self.rate[i], self.before[i], self._e0[i] = row[:4]
            law.state(row[4:])


class GuideForce(ConnectorGroup):
    """Guide: a point is constrained to a curve of the plane, and free along the curve.

    In schemes whose forces act over the step, the force is normal to the chord of the step, so that
    it does no work.  In other schemes it is normal to the curve.  Round-off of the curve spoils the
    direction of a short chord, so the tangent in the middle of the step replaces the chord.  The
    motion is the distance from the curve, which is zero at the end of a step.
    """

    def __init__(self, number: int, setting: Setting) -> None:
        super().__init__(np.array([number]), setting)
        connector = self.connectors[0]
        assert isinstance(connector.law, Guide)
        self._place, self._curve, self._size = (
            connector.b,
            connector.law.curve,
            setting.numbering.scene.size,
        )
        self._point = self._on0 = np.array(connector.b.point)
        self._x, self._λ = self.dofs[0, [1, 3]], self.dofs[0, 6]
        self._over_step = setting.scheme.average(0.0, 1.0) != 1.0
        last_digit = np.spacing(self._size + np.abs(self._point).max())
        self._shortest = self._size * (24 * last_digit / self._size) ** (1 / 3)
        self._s = self._s0 = self._distance = 0.0  # curve parameters: of the iterate, accepted

    def begin(self, step: Step) -> None:
        """Set the start of the search for the nearest point to the accepted point."""
        self._s = self._s0

    def _nearest(self, x: Array) -> float:
        """Return the parameter of the nearest point of the curve, searched from the latest one."""
        s = self._curve.nearest(x, self._s, self._size)
        if not math.isfinite(s):
            raise NoNumber(f"{self._place}: no nearest point was found on its guide curve")
        return s

    def _equation(self, x: Array) -> Array:
        """Return the distance from the curve, and the direction of the force in the step; (3,)."""
        s = self._nearest(x)
        on, slope, _ = self._curve.at(s)
        t = along = slope / math.hypot(*slope)
        chord = on - self._on0
        if self._over_step and math.hypot(*chord) > self._shortest:
            along = chord * np.sign(chord @ t)
        elif self._over_step:
            along = self._curve.at((self._s0 + s) / 2)[1]
        x_m, y_m = along / math.hypot(*along)
        return np.array([t[0] * (x - on)[1] - t[1] * (x - on)[0], -y_m, x_m])

    def response(self, step: Step, q1: Array) -> Response:
        """Return the force and the distance; their derivatives are central differences."""
        x, λ, r = self._point + q1[self._x], q1[self._λ], np.zeros(self.size)
        self._s = self._nearest(x)
        r[self._λ], *direction = self._equation(x)
        r[self._x] = λ * np.array(direction)
        increments, K = GUIDE_INCREMENT * self._size * np.eye(2), np.zeros((3, 3))  # x, y, λ
        slopes = [self._equation(x + δ) - self._equation(x - δ) for δ in increments]
        K[2, :2], *K[:2, :2] = np.transpose(slopes) / (2 * GUIDE_INCREMENT * self._size)
        K[:2, :2] *= λ
        K[:2, 2] = direction
        dofs = np.array([*self._x, self._λ])
        return r, coupled(self.size, np.repeat(dofs, 3), np.tile(dofs, 3), K)

    def relative_residual(self, q: Array, r: Array, scale: float, moved: float) -> float:
        """Return the distance beyond round-off, divided by 1 % of the size of the scene."""
        round_off = 8 * np.spacing(self._size + np.abs(self._point + self._on0).max())
        return float(max(abs(r[self._λ]) - round_off, 0.0) / (0.01 * self._size))

    def accept(self, step: Step, q1: Array, s: Array) -> None:
        """Accept the point on the curve."""
        self._on0, self._s0 = self._curve.at(self._s)[0], self._s

    def columns(self, q: Array) -> Array:
        """Return the columns of ``Connection``; the distance is NaN without a nearest point."""
        self._s = self._s0
        try:
            self._distance = self._equation(self._point + q[self._x])[0]
        except NoNumber:
            self._distance = math.nan
        return np.array([[self._distance, q[self._λ], 0.0, 0.0, 0.0]])

    def save_or_restore(self, archive: Archive) -> None:
        """Save or restore the distance, the parameters, and the point."""
        row = np.array([[self._distance, self._s, self._s0, *self._on0]])
        (row,) = archive.rows("guides", self.indices, row)
        self._distance, self._s, self._s0 = map(float, row[:3])
        self._on0 = row[3:]


def all_connectors(setting: Setting) -> list[Connectors | GuideForce]:
    """Return all connectors of a scene: a group for each kind of motion, and each guide."""
    connectors: list[Connectors | GuideForce] = []
    kinds: dict[tuple[str, ...], list[int]] = {(motion,): [] for motion in MOTIONS}
    kinds |= {("sliding", "sliding", "turning")[:k]: [] for k in (2, 3)}
    for i, connector in enumerate(setting.numbering.scene.all_connectors):
        if isinstance(connector.law, Guide):
            continue
        k = connector.law.components if isinstance(connector.law, ConnectorLaw) else 1
        kinds[(connector.motion,) if k == 1 else ("sliding", "sliding", "turning")[:k]].append(i)
    for motions, indices in kinds.items():
        if indices:
            connectors.append(Connectors(motions, np.array(indices), setting))
    guides = (
        i for i, x in enumerate(setting.numbering.scene.all_connectors) if isinstance(x.law, Guide)
    )
    return [*connectors, *(GuideForce(i, setting) for i in guides)]
