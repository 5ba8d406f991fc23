# SPDX-License-Identifier: MIT
"""Analyses of cross-sections: moment-curvature, and interaction of axial force and moment.

Both use the compiled material points of beams, so that a section answers as in a beam.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array
from ufl_beam.blocks.material_points import Points
from ufl_beam.errors import (
    ArgumentError,
    StepFailed,
    require_array,
    require_count,
    require_kind,
    require_number,
    require_row,
    warn,
)
from ufl_beam.mechanics.time_schemes import Static
from ufl_beam.model.fibres import Fibres
from ufl_beam.model.sections import Section

SUBSTEPS = 1024  # number of smallest substeps in a step of curvature and axial force

TOLERANCE = 1e-13
"""Error of N, as a fraction of EA times the largest strain so far, up to which N is met."""

MOST_STRAIN = 10.0  # largest axial strain among those that are tried
MOST_ITERATIONS = 200  # largest number of corrections of the axial strain in a substep


class _State:
    """Material points of a section in several states, with prescribed strains."""

    def __init__(self, section: Section, states: int, length: float | None, what: str) -> None:
        require_kind(section, Section, f"{what}: section")
        points = section.section_points(section.hinge)
        if length is not None:
            require_number(length, f"{what}: length", positive=True)
        elif any(class_points.softening is not None for class_points in points):
            raise ArgumentError(
                f"{what}: the section has cracks or a hinge, whose openings are strains times a "
                "length; give the length of a cell, length= (m)"
            )
        lengths, keys = np.full(states, length or 1.0), [(0, 0)] * states
        self._points = [Points(class_points, keys, lengths, Static()) for class_points in points]
        # Without points the section is elastic; otherwise the points have the elastic resultants.
        self._rest = np.zeros(3) if points else np.array([section.EA, section.GA, section.EI])
        self._elastic = np.tile(np.diag(self._rest), (states, 1, 1))
        self._strains = np.zeros((states, 3))
        self._EA, self._depth, self._strain, self._length = section.EA, section.depth, 0.0, lengths
        self._largest = 0.0  # strain so far, of the axis or by curvature

    def begin(self, dt: float) -> None:
        for points in self._points:
            points.begin(dt)

    def response(self, strain: npt.ArrayLike, curvature: npt.ArrayLike) -> tuple[Array, Array]:
        """Return (N, V, M) and their derivatives in the step; (states, 3), (states, 3, 3)."""
        e = self._strains
        e[:, 0], e[:, 2] = strain, curvature
        r, D = self._rest * e, self._elastic
        for points in self._points:
            forces, slopes = points.return_map(e)
            r, D = r + forces, D + slopes.reshape(-1, 3, 3)
        return r, D

    def accept(self) -> None:
        """Accept the latest response; raise :class:`StepFailed` if a law generates energy."""
        for points in self._points:
            points.require_dissipation(lambda _: "the section")
        for points in self._points:
            points.accept()

    def dissipated(self) -> Array:
        """Return the energies per length that the states have dissipated; (states,); J/m."""
        lost = sum((p.recorded[:, 4:].sum(axis=1) for p in self._points), np.zeros(1))
        return np.asarray(lost / self._length)

    def reach(self, curvature: float, N: float, dt: float) -> tuple[float, float] | None:
        """Step to a curvature and an axial force; return (axial strain, M), or None.

        Newton's method finds the axial strain.  Bisection takes over between strains at which N is
        too small and too large, because N may be constant over intervals of perfect plasticity.
        """
        self.begin(dt)
        by_curvature = abs(curvature) * self._depth
        e, low, high, width, last = self._strain, -math.inf, math.inf, 0.0, math.inf
        for _ in range(MOST_ITERATIONS):
            r, D = self.response(e, curvature)
            excess, slope = float(r[0, 0]) - N, float(D[0, 0, 0])
            if not math.isfinite(excess) or abs(e) > MOST_STRAIN:
                return None
            largest = max(self._largest, abs(e) + by_curvature)
            met = abs(excess) <= TOLERANCE * self._EA * largest
            if met or high - low <= 4 * np.finfo(float).eps * largest:
                if not met and abs(excess) > 1e4 * TOLERANCE * self._EA * largest:
                    return None  # N jumps
                try:
                    self.accept()
                except StepFailed:
                    return None
                self._strain, self._largest = e, largest
                return e, float(r[0, 2])
            low, high = (e, high) if excess < 0 else (low, e)
            after = e - excess / slope if slope > 0 else math.nan
            if not (low < after < high and (abs(excess) < last / 2 or high - low == math.inf)):
                width = 2 * width or max(by_curvature, abs(excess) / self._EA)
                after = (
                    (low + high) / 2 if high - low < math.inf else e - math.copysign(width, excess)
                )
            e, last = after, abs(excess)
        return None


# -- moment and curvature --------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MomentCurvature:
    """Bending moments of a section under a history of curvatures, see :func:`moment_curvature`.

    Moments are about the axis of the section.  The strain of a fibre is ``strain - y curvature``,
    with y from this axis.

    Attributes:
        curvature: Curvatures; (n,); 1/m.
        moment: Bending moments; (n,); N m.
        N: Axial forces, positive in tension; (n,); N.
        strain: Axial strains of the axis of the section; (n,).
        dissipated: Energies per length dissipated since the beginning; (n,); J/m.

    Example:
        >>> steel = ub.Fibres(ub.ElastoPlastic(235e6), number=40)
        >>> section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=steel)
        >>> result = st.moment_curvature(section, np.linspace(0, 0.1, 21))
        >>> print(f"{result.moment[-1] / (235e6 * 0.1 * 0.2**2 / 4):.3f}")  # of the plastic moment
        0.996
        >>> ub.plot(result).savefig("moment_curvature.png")
    """

    curvature: Array
    moment: Array
    N: Array
    strain: Array
    dissipated: Array

    def __repr__(self) -> str:
        largest = np.abs(self.moment).max(initial=0.0)
        return f"<MomentCurvature: {len(self.moment)} states, |M| up to {largest:.4g} N m>"


def moment_curvature(
    section: Section, curvature: npt.ArrayLike, N: npt.ArrayLike = 0.0, *,
    length: float | None = None, dt: float = 1.0,
) -> MomentCurvature:  # fmt: skip
    """Compute the bending moment of a section under a history of curvatures and axial forces.

    A cell of a beam in a :class:`Static` run has the same material points.  The axial strain
    follows from N.  Before the first curvature, N is applied without curvature.  A step without
    equilibrium is divided.  If the section cannot bear N even in the smallest substep, the result
    ends there, with a warning.

    Args:
        section: Section with fibres or laws of resultants.
        curvature: Curvatures, one after the other, also cyclic; (n,); 1/m.
        N: Axial force, positive in tension; a number, or one for each curvature; N.
        length: Length of the cell, needed for cracks of fibres and hinges of cells; m.
        dt: Time between two curvatures, for viscous laws; s.

    Raises:
        ArgumentError: The section cannot bear N at the first curvature, the number of forces and
            curvatures differs, or ``length`` is missing.

    Example:
        >>> steel = ub.Fibres(ub.ElastoPlastic(235e6, kinematic=2e9), number=40)
        >>> section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=steel)
        >>> cycle = 0.05 * np.sin(np.linspace(0, 2.5 * np.pi, 101))
        >>> loop = st.moment_curvature(section, cycle, N=-1e6)
        >>> print(f"{loop.moment[-1]:.4g} N m, {loop.dissipated[-1]:.4g} J/m")
        2.298e+05 N m, 3.767e+04 J/m
    """
    what = "moment_curvature"
    K, forces = require_row(curvature, f"{what}: curvature"), require_array(N, f"{what}: N")
    if not len(K):
        raise ArgumentError(f"{what}: curvature is empty")
    if forces.ndim and forces.shape != K.shape:
        raise ArgumentError(f"{what}: N has the shape {forces.shape}, curvature {K.shape}")
    require_number(dt, f"{what}: dt", positive=True)
    state, before, rows = _State(section, 1, length, what), np.zeros(2), list[list[float]]()
    path = np.column_stack(np.broadcast_arrays(K, forces))
    loads_first = int(K[0] != 0 and path[0, 1] != 0)
    for after in [np.array([0.0, path[0, 1]])] * loads_first + list(path):
        done, substep, reached = 0, SUBSTEPS, None
        while done < SUBSTEPS:
            target = before + (after - before) * ((done + substep) / SUBSTEPS)
            reached = state.reach(float(target[0]), float(target[1]), dt * substep / SUBSTEPS)
            if reached is not None:
                done += substep
                substep = math.gcd(done, SUBSTEPS)
            elif substep > 1:
                substep //= 2
            else:
                break
        if reached is None:
            said = (
                f"{what}: the section cannot bear N = {target[1]:.4g} N at the curvature "
                f"{target[0]:.4g} 1/m"
            )
            if len(rows) <= loads_first:
                raise ArgumentError(said)
            warn(f"{said}; the result ends at {rows[-1][0]:.4g} 1/m")
            break
        rows.append([*after, *reached, float(state.dissipated()[0])])
        before = after
    K, forces, strains, moments, lost = np.array(rows)[loads_first:].T
    return MomentCurvature(K, moments, forces, strains, lost)


# -- interaction of axial force and moment ---------------------------------------------------------


@dataclass(frozen=True, eq=False)
class InteractionDiagram:
    """Largest moments of a section over the axial force, see :func:`interaction_diagram`.

    The points form a closed curve: the largest moments from tension to compression, then the least
    moments back.  The first point is repeated at the end.

    Attributes:
        N: Axial forces, positive in tension; (n,); N.
        M: Bending moments about the axis of the section; (n,); N m.
        strain: Axial strains of the axis of the section; (n,).
        curvature: Curvatures; (n,); 1/m.

    Example:
        >>> steel = ub.Fibres(ub.ElastoPlastic(235e6), number=40)
        >>> section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, fibres=steel)
        >>> diagram = st.interaction_diagram(section, (0.05, 0.05))
        >>> low, high = diagram.moments(-0.5 * 235e6 * 0.02)  # at half of the squash load
        >>> print(f"{high / (235e6 * 0.1 * 0.2**2 / 4):.3f}")  # of the plastic moment
        0.749
        >>> ub.plot(diagram).savefig("interaction.png")
    """

    N: Array
    M: Array
    strain: Array
    curvature: Array

    def __repr__(self) -> str:
        N, M = ((x.min(), x.max()) for x in (self.N, self.M))
        return (
            f"<InteractionDiagram: N from {N[0]:.4g} to {N[1]:.4g} N, "
            f"M from {M[0]:.4g} to {M[1]:.4g} N m>"
        )

    def moments(self, N: float) -> tuple[float, float]:
        """Return the least and the largest moment of the curve at an axial force; N m.

        Raises:
            ArgumentError: The section cannot bear N.
        """
        curve = np.array([self.N, self.M])
        _, M = _at_force(require_number(N, "moments: N"), curve[:, :-1], curve[:, 1:])
        if not len(M):
            raise ArgumentError(f"moments: N = {N:g} N is beyond the diagram, {self!r}")
        return float(M.min()), float(M.max())


def _at_force(N: float, first: Array, last: Array) -> Array:
    """Return the points at an axial force on segments, whose first numbers are axial forces."""
    at = np.flatnonzero((first[0] - N) * (last[0] - N) <= 0)
    a, change = first[:, at], last[:, at] - first[:, at]
    return np.asarray(a + change * ((N - a[0]) / np.where(change[0] == 0.0, 1.0, change[0])))


Limits = tuple[float, float]
"""Largest compressive and tensile strains of fibres, both positive; infinite if unlimited."""


def interaction_diagram(
    section: Section, limits: Limits | Mapping[Fibres, Limits], *, points: int = 360,
    steps: int = 50, length: float | None = None,
) -> InteractionDiagram:  # fmt: skip
    """Compute the moments that a section can bear at each axial force within limit strains.

    Planes of strains grow from zero in proportion until the first fibre reaches its limit.  The
    diagram is the envelope of all their states: limit strains, or smaller ones if a law softens
    before.  Strains are at the centroids of the fibres.

    Args:
        section: Section with fibres.
        limits: Largest compressive and largest tensile strain, both positive, of all fibres; or
            for each of the :class:`Fibres` of the section, as ``{concrete: (0.0035, math.inf),
            steel: (0.02, 0.02)}``.  Fibres without an entry have no limit.
        points: Number of planes, in equal steps of the angle between strain and curvature.
        steps: Number of equal steps in which strains grow; laws that are curved or soften need
            many.
        length: Length of the cell, needed for cracks of fibres; m.

    Raises:
        ArgumentError: The section has no fibres, a limit is not positive or belongs to no fibres
            of the section, or some planes are unlimited.

    Example:
        >>> concrete, steel = (ub.Fibres(ub.ElastoPlastic(limit)) for limit in (30e6, 500e6))
        >>> column = ub.Section.rectangle(
        ...     b=0.3, h=0.4, E=30e9, nu=0.2, fibres=concrete
        ... ).reinforced([-0.15, 0.15], [1e-3, 1e-3], E=200e9, fibres=steel)
        >>> limits = {concrete: (0.0035, np.inf), steel: (0.02, 0.02)}
        >>> diagram = st.interaction_diagram(column, limits)
        >>> print(f"{diagram.N.min():.4g}")  # 30e6 (0.12 - 0.002) + 500e6 * 0.002 N
        -4.54e+06
    """
    what = "interaction_diagram"
    require_count(points, f"{what}: points", at_least=8)
    require_count(steps, f"{what}: steps")
    state, placed = _State(section, points, length, what), section.fibres
    if placed is None:
        raise ArgumentError(f"{what}: the section has no fibres, whose strains could be limited")
    if not isinstance(limits, Mapping):
        limits = dict.fromkeys(placed.fibres, limits)
    allowed = np.full((2, len(placed.y)), math.inf)
    for fibres, pair in limits.items():
        indices = [number for number, own in enumerate(placed.fibres) if own == fibres]
        if not indices:
            raise ArgumentError(f"{what}: limits of {fibres!r}, which is not in the section")
        try:
            compressive, tensile = pair
        except (TypeError, ValueError):
            raise ArgumentError(f"{what}: limits = {pair!r} must be two strains") from None
        for row, limit in zip(allowed, (compressive, tensile), strict=True):
            row[np.isin(placed.material, indices)] = require_number(
                limit, f"{what}: limits", positive=True, infinite=True
            )
    angle = 2 * math.pi * np.arange(points) / points
    strain, curvature = np.cos(angle), 2 / section.depth * np.sin(angle)
    fibre_strains = strain[:, None] - curvature[:, None] * placed.y
    with np.errstate(divide="ignore"):
        factors = np.where(fibre_strains < 0, allowed[0], allowed[1]) / np.abs(fibre_strains)
    factor = factors.min(axis=1)
    if not np.isfinite(factor).all():
        sense = "tension" if strain[np.argmax(factor)] > 0 else "compression"
        raise ArgumentError(
            f"{what}: no fibre limits the strain in {sense}; give some fibres a limit there"
        )
    strain, curvature = factor * strain, factor * curvature
    reached = np.empty((4, steps, points))  # N, M, strain and curvature
    for step in range(steps):
        state.begin(1.0)
        fraction = (step + 1) / steps
        r, _ = state.response(strain * fraction, curvature * fraction)
        if not np.isfinite(r).all():
            raise ArgumentError(f"{what}: a law has no stress in a step; increase steps = {steps}")
        state.accept()
        reached[:, step] = r[:, 0], r[:, 2], strain * fraction, curvature * fraction
    # Segments between adjacent planes, and between adjacent steps
    begins, ends = (reached, reached[:, :-1]), (np.roll(reached, -1, axis=2), reached[:, 1:])
    first, last = (np.hstack([x.reshape(4, -1) for x in pair]) for pair in (begins, ends))
    most, least, N = [], [], reached[0]
    for force in np.unique([*N[-1], *np.linspace(N.min(), N.max(), points)]):
        crossed = _at_force(force, first, last)
        most.append(crossed[:, crossed[1].argmax()])
        least.append(crossed[:, crossed[1].argmin()])
    return InteractionDiagram(*np.transpose([*most[::-1], *least, most[-1]]))
