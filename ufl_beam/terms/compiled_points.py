# SPDX-License-Identifier: MIT
"""Material points whose return map runs in C, compiled from the statement of the laws.

The laws are traced with UFL symbols: UFL derives the consistent tangents, by the implicit function
theorem where a discontinuity opens, FFCx compiles them, and a loop in C goes over the points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from ufl.conditional import Condition
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.compiled.c_library import doubles, ffi, in_order, lib, struct
from ufl_beam.discretization.compiled_forms import Pointwise, stated
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model import law_functions
from ufl_beam.model.material_laws import Bulk, SofteningLaw
from ufl_beam.terms.material_points import Points, inputs

law_functions.where.register(Condition, ufl.conditional)
law_functions.below.register(Expr, ufl.lt)
law_functions.exp.register(Expr, ufl.exp)


class PointForms:
    """Compiled laws: C functions from the inputs of a point to what the loops need.

    They are the stress of the bulk, that of a point that opens by a known growth, and the excess of
    the bulk over the discontinuity, each with its derivative; and ``point_output`` of loops.h.
    The numbers of ``softening`` do not matter: they are inputs.
    """

    def __init__(
        self, statement: type[Bulk], softening: SofteningLaw | None, scheme: Scheme
    ) -> None:
        self._pointwise = pointwise = Pointwise(inputs(statement))
        at = pointwise.at
        strain, a = ufl.variable(at["strain"]), ufl.variable(at["growth"])
        s, p, ξ, length = (at[n] for n in ("direction", "plastic", "accumulated", "length"))
        θ, dt = at["theta"], at["dt"]
        bulk = statement(at["stiffness"], *(at[name] for name in statement.numbers()))

        # The incompatible mode: a jump relaxes the strain of the bulk by jump over length.
        relieved = at["jump"] / length
        e = (1 - θ) * at["before"] + θ * strain - (relieved + θ * s * a / length)
        dp = bulk.flow(e, p, ξ, θ, dt)
        σ = bulk.stress(e, p + θ * dp)
        self.bulk = pointwise.compile(σ, ufl.diff(σ, strain))

        e0, e1 = at["before"] - relieved - p, strain - (relieved + s * a / length) - p - dp
        broken, traction = 0 * a, 0 * a
        self.opening = self.excess = ffi.NULL
        if softening is not None:
            law = softening.of(at["softening limit"], at["softening energy"])
            resistance = scheme.resistance(law, at["opening"], a)
            excess = s * σ - resistance  # P(32), its second equation
            growth_by_strain = -ufl.diff(excess, strain) / ufl.diff(excess, a)
            tangent = ufl.diff(σ, strain) + ufl.diff(σ, a) * growth_by_strain  # P(76)
            self.opening = pointwise.compile(σ, tangent)
            self.excess = pointwise.compile(excess, ufl.diff(excess, a))
            broken = a * law.mean_traction(at["opening"], a)
            traction = law.traction(at["opening"] + a)
        end = {
            "flow": dp,
            "worked": bulk.dissipation(dp, dt),
            "broken": broken,
            "lost": bulk.elastic_energy(e1 - e0) + bulk.hardening_energy(dp, dp),
            "elastic": bulk.elastic_energy(e1),
            "hardening": bulk.hardening_energy(p + dp, ξ + abs(dp)),
            "stress": bulk.stress(e1, 0),
            "resistance": traction,
        }
        self.end = pointwise.compile(*in_order("point_output", end))


_point_forms = stated(PointForms)


class CompiledPoints(Points):
    """Points whose response and commitment are loops in C, see material_points.c.

    Attributes:
        points: What the loops take, see loops.h.
    """

    def _prepare(self, scheme: Scheme, length: Array) -> None:
        layout = self._layout
        kind = layout.softening and layout.softening.of(1.0, 1.0)
        self._forms = forms = _point_forms(layout.statement, kind, scheme)
        self._over = np.zeros(1)
        arrays = {"B": layout.strains, "weight": layout.weights, "rest": layout.rest}
        arrays = {k: np.ascontiguousarray(x, np.float64) for k, x in arrays.items()}
        cells, of_cell, width = self._storage.shape
        self.points = struct(
            "points", cells=cells, of_cell=of_cell, width=width, w=self._storage,
            theta=scheme.theta, length=np.ascontiguousarray(length), **arrays,
            bulk=forms.bulk, opening=forms.opening, excess=forms.excess, end=forms.end,
            e0=self._e0, e1=self.strains, r=self.r, D=self.D, kept=self.kept, sum=self.sums,
            over=self._over, search=self._search.flags,
        )  # fmt: skip

    @property
    def in_c(self) -> dict[str, Any]:
        """The points, by their name in the structs of loops.h."""
        return {"points": self.points}

    def respond(self, strains: Array) -> tuple[Array, Array]:
        """Answer the strains of an iterate."""
        self.strains[:] = strains
        lib.respond(self.points)
        return self.r, self.D

    @property
    def excess(self) -> float:
        """Largest ``|stress| / limit - 1`` of a point that was held closed, or zero."""
        return float(self._over[0])

    def release(self, least: float) -> None:
        """Let held points open from now on whose excess was so large in the latest response."""
        lib.release(self.points, least)

    def accept(self) -> None:
        """Take the strains of the latest response as the new state."""
        lib.commit(self.points)

    def _sums_to_come(self) -> Array:
        """Return :attr:`sums` as :meth:`accept` would leave them."""
        copy = ffi.new("points *", self.points[0])
        sums = np.empty_like(self.sums)
        state = (self._e0, self._storage, self.kept)
        copy.e0, copy.w, copy.kept, copy.sum = alive = [doubles(x.copy()) for x in state] + [
            doubles(sums)
        ]
        lib.commit(copy)
        del alive
        return sums
