# SPDX-License-Identifier: MIT
"""Guides hold a point on a curve in the plane; the point moves freely along the curve."""

from __future__ import annotations

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, lib, loop, struct
from ufl_beam.compiled.csr import Csr
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.discretization.state_io import Archive
from ufl_beam.errors import NoNumber
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.connector_laws import Guide
from ufl_beam.model.connectors import Connector
from ufl_beam.model.functions import REACH, parameter_step
from ufl_beam.terms.derivatives import Each, Neighbours, in_c
from ufl_beam.terms.term import Callbacks, Phases, Term


class Guides(Term):
    """Forces that hold points on curves.

    In schemes whose forces act over the step, they are normal to the chord of the step and do no
    work.  The round-off of points spoils the direction of a short chord.  If the polynomial through
    points around its end agrees with both ends up to round-off, or if the chord is extremely short,
    the secant of the polynomial replaces the chord.

    The motion of a guide is the distance of the point from its curve, which is zero when a step is
    accepted.  guide_curves.c computes guides, and calls Python for points of the curves.
    """

    kind = "connectors"
    sticks = None

    def __init__(self, subdomain: Subdomain, positions: Index, scheme: Scheme, A: Csr) -> None:
        scene = subdomain.numbering.scene
        self.indices: Index = subdomain.connectors[positions]
        self.connectors: list[Connector] = [scene.all_connectors[i] for i in self.indices]
        self._dofs = subdomain.connector_dofs[positions].astype(np.int32)
        self.forces_at: Index = self._dofs[:, 6]
        self._A, self.law = A, self.connectors[0].law
        self.callbacks: Callbacks  # set when the phases are created
        n, size = len(self.connectors), scene.size
        self._e, self.rate, work = np.zeros((3, n))
        self.fields = [("motion", self._e), ("work", work), ("rate", self.rate)]
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
            "guides", number=n, over_step=scheme.average(0.0, 1.0) != 1.0,
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

    # -- as connectors in blocks -----------------------------------------------------------------

    @property
    def effect(self) -> str:
        """See the base class."""
        return "Guide"

    @property
    def flow_direction(self) -> Array:
        """Direction of plastic slip, which guides do not have; (num_connectors,)."""
        return np.zeros(len(self.indices))

    def describe(self, place: int) -> str:
        """Return the name of a connector."""
        return str(self.connectors[place])

    def add_residual(self, q1: Array, r: Array) -> None:
        """Add forces and distances; raise exceptions of the curves."""
        with self.callbacks.raising():
            super().add_residual(q1, r)

    def add_tangent(self, q1: Array) -> None:
        """Add derivatives; raise exceptions of the curves."""
        with self.callbacks.raising():
            super().add_tangent(q1)

    def start(self, q: Array) -> None:
        """Set the accepted motions to ``q``, without a step."""

    def put_motions(self, q: Array, v: Array, works: Array) -> None:
        """Replace forces that laws determine; guides hold."""

    def put_forces(self, q: Array) -> None:
        """Write elastic forces, which guides do not have."""

    def commit(self, q: Array) -> None:
        """Set the forces before the next step, which guides do not need."""

    def remaining(self) -> Array:
        """Return the remaining fraction of elastic stiffness; (num_connectors,)."""
        return np.ones(len(self.indices))

    def freeze(self) -> None:
        """Make laws elastic; guides hold."""

    def dissipation(self, q1: Array) -> float:
        """Return the plastic dissipation in the step to ``q1``, which is zero; J."""
        return 0.0
