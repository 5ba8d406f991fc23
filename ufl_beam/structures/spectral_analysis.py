# SPDX-License-Identifier: MIT
"""Response spectrum analysis: peak responses of modes, combined by SRSS or CQC."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ufl_beam.analysis.linearization import (
    Linearization,
    linear_forces_in_space,
    linear_forces_of_cells,
)
from ufl_beam.analysis.modes import Modes, modes
from ufl_beam.arrays import Array
from ufl_beam.display import Rich
from ufl_beam.errors import (
    ArgumentError,
    each_warning_once,
    require_count,
    require_kind,
    require_number,
    require_point,
    shorten,
    warn,
)
from ufl_beam.model.beams import Mesh
from ufl_beam.model.bodies import AttachmentPoint, Member
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.scene import Scene, index_of
from ufl_beam.model.supports import Support
from ufl_beam.output.section_forces import Diagram, DiagramInSpace, ForcesAlongCells
from ufl_beam.simulation.initial_state import StateOf, chosen_state
from ufl_beam.simulation.solution import Solution
from ufl_beam.structures.response_spectra import Spectrum, spectral_accelerations

RULES = "CQC", "SRSS"
NO_MASS = 1e-12  # fraction of the mass below which an effective mass is printed as zero
LEAST_MASS = 0.9  # fraction of the mass that modes should have; EN 1998-1:2004, 4.3.3.3.1
AT_REST = 1e-6  # frequency below which a mode is a rigid motion, as a fraction of the highest


@dataclass(frozen=True, eq=False, repr=False)
class SpectralResponse(Rich):
    """Peak responses to a spectrum; made by :func:`response_spectrum_analysis`.

    Combined responses are positive, and belong to different times.

    Attributes:
        modes: The modes, without damping.
        direction: Unit vector of the ground motion.
        accelerations: Spectral acceleration of each mode; (n,); m/s².
        participation: Participation factor of each mode, for its largest displacement of 1; (n,).
        effective_masses: Effective mass of each mode in the direction; (n,); kg.
        mass: Mass that moves; kg.
        correlation: Coefficients ρ of the combination; (n, n).
        resultants: Peak forces on the ends of cells in each mode, ``cell_number`` of loops.h;
            (n, 9, num_cells).  In space, peak section forces at the start, middle and end of cells;
            (n, num_cells, 3, 6).
        reactions: Peak force (x, y) and moment of each support in each mode, in space force and
            moment along x, y, z; (n, num_supports, 3 or 6).

    Example:
        >>> response = st.response_spectrum_analysis(scene, lambda T: 3.0, n=4, direction=(0, 1))
        >>> print(f"{response.base_shear:.0f} N, {response.missing_mass:.1%} of the mass missing")
        620 N, 3.7% of the mass missing
        >>> print(response.reaction(scene.supports[0])[1:].round())  # N, N m
        [620. 852.]
        >>> figure = ub.plot(response, "M")
    """

    modes: Modes
    direction: tuple[float, ...]
    accelerations: Array
    participation: Array
    effective_masses: Array
    mass: float
    correlation: Array
    resultants: Array
    reactions: Array

    @property
    def scene(self) -> Scene:
        """The model of the modes."""
        return self.modes.scene

    @property
    def missing_mass(self) -> float:
        """Fraction of the mass that the effective masses of the modes lack."""
        return 1.0 - float(self.effective_masses.sum()) / self.mass

    @property
    def base_shear(self) -> float:
        """Combined inertial force in the direction; N."""
        return float(self.combine(self.effective_masses * self.accelerations))

    def combine(self, peaks: npt.ArrayLike) -> Array:
        """Combine the peaks of all modes, such as drifts; (n, ...) to (...).

        The combination of the peaks R is the root of Σ ρ_ij R_i R_j.
        """
        values = np.asarray(peaks, dtype=float)
        if values.shape[:1] != self.accelerations.shape:
            raise ArgumentError(
                f"combine: peaks of shape {values.shape} must have a row for each of the "
                f"{len(self.accelerations)} modes"
            )
        squares = np.einsum("ij,i...,j...->...", self.correlation, values, values)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))  # round-off may be negative

    def peaks(self, place: AttachmentPoint) -> Array:
        """Return the peak motion (u, v, ψ) of a place in each mode, with its sign; (n, 3).

        In space, return displacements, and rotations about axes of the node; (n, 6).

        Raises:
            ArgumentError: The place is not in the scene.
        """
        sizes = self.participation * self.accelerations / self.modes.omega**2
        return np.array([size * self.modes.shape(k, place).real for k, size in enumerate(sizes)])

    def displacement(self, place: AttachmentPoint) -> Array:
        """Return the combined :meth:`peaks` of a place; (3,), in space (6,); m, rad."""
        return self.combine(self.peaks(place))

    def diagram(self, beam: Member, *, points: int = 9) -> Diagram | DiagramInSpace:
        """Return combined section forces along a beam, with ``points`` points in each cell.

        Raises:
            ArgumentError: The beam is not in the scene, or ``points`` is less than 2.
        """
        require_number(points, "diagram: points", at_least=2)
        numbering = self.modes.numbering
        s, fractions = numbering.parameters(beam), np.arange(int(points)) / (int(points) - 1)
        cells, at = numbering.cells_of(beam), s[:-1, None] + fractions * np.diff(s)[:, None]
        if self.scene.in_space:
            x = fractions[:, None]
            parabolas = np.hstack([(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)])
            combined = self.combine(parabolas @ self.resultants[:, cells])
            return DiagramInSpace(at.ravel(), *combined.reshape(-1, 6).T)
        along = ForcesAlongCells(numbering)
        q = self.modes.q[along.dofs[cells]]
        peaks = [along(cells, fractions, forces[:, cells], q) for forces in self.resultants]
        return Diagram(at.ravel(), *self.combine(peaks).reshape(-1, 3).T)

    def reaction(self, support: Support) -> Array:
        """Return the combined force (x, y) and moment of a support; (3,); N, N, N m.

        In space, return force and moment along x, y, z; (6,).

        Raises:
            ArgumentError: The support is not in the scene.
        """
        index = index_of(self.scene.supports, support, "reaction: ")
        return self.combine(self.reactions[:, index])

    def __str__(self) -> str:
        lines = ["mode     period  acceleration  effective mass"]
        masses = np.where(self.effective_masses > NO_MASS * self.mass, self.effective_masses, 0.0)
        rows = zip(self.modes.frequencies, self.accelerations, masses, strict=True)
        lines += [
            f"{k:4d} {1 / f:8.4g} s {a:8.4g} m/s² {m:8.4g} kg  {m / self.mass:.1%}"
            for k, (f, a, m) in enumerate(rows)
        ]
        return "\n".join([
            *lines, f"missing mass {self.missing_mass:.1%}, base shear {self.base_shear:.4g} N",
        ])  # fmt: skip

    def __repr__(self) -> str:
        return (
            f"<SpectralResponse: {len(self.modes)} modes, base shear {self.base_shear:.4g} N, "
            f"missing mass {self.missing_mass:.1%}>"
        )


@each_warning_once()
def response_spectrum_analysis(
    scene: Scene,
    spectrum: Spectrum,
    *,
    n: int = 10,
    direction: Sequence[float] | None = None,
    damping: float = 0.05,
    rule: str = "CQC",
    at: StateOf | None = None,
    mesh: Mesh | None = None,
) -> SpectralResponse:
    """Compute peak responses of a structure to a spectrum by its modes.

    All supports have the same motion.  The peaks of modes are combined by the complete quadratic
    combination of Der Kiureghian (Earthquake Engineering and Structural Dynamics 9, 1981), or by
    the root of the sum of squares.  Modes that are left out contribute nothing; the missing mass is
    reported.  The section forces of a mode are in equilibrium with its inertial forces; axes of
    sections are those of the state.

    Args:
        scene: Model.
        spectrum: Spectral acceleration (m/s²) as a function of the period (s), or (periods,
            accelerations), for the damping ratio.
        n: Number of modes; fewer if the scene has fewer.
        direction: Direction of the ground motion, by default x; only its direction matters.
        damping: Damping ratio of all modes for CQC; damping of the scene is ignored.
        rule: "CQC" or "SRSS".
        at: Static solution about whose last state the scene vibrates; responses are beyond this
            state.  By default the scene is undeformed.
        mesh: Discretization; by default the mesh of ``at``, or the cells of the beams.

    Raises:
        ArgumentError: The call is wrong, the spectrum does not cover the periods, nothing has mass,
            the scene can move freely, or it has dampers, works, or loads that follow the motion:
            :class:`FollowerLoad`, :class:`Pressure`, :class:`RotatingFrame`.

    Warns:
        ModelWarning: The modes have less than 90 % of the mass.

    Example:
        >>> response = st.response_spectrum_analysis(scene, ([1e-4, 4.0], [3.0, 3.0]), n=6)
        >>> print(response.displacement(beam.end).shape, response.diagram(beam).M.shape)
        (3,) (36,)
    """
    what = "response_spectrum_analysis"
    require_kind(scene, Scene, f"{what}: scene")
    n = require_count(n, f"{what}: n")
    along_x = (1.0, 0.0, 0.0)[: 3 if scene.in_space else 2]
    toward = np.array(
        require_point(along_x if direction is None else direction, f"{what}: direction")
    )
    if len(toward) != len(along_x) or not (size := math.hypot(*toward)) > 0.0:
        raise ArgumentError(
            f"{what}: direction = {shorten(direction)} must have {len(along_x)} components, and a "
            "length"
        )
    toward /= size
    damping = require_number(damping, f"{what}: damping", positive=True)
    if damping >= 1.0:
        raise ArgumentError(f"{what}: damping = {damping:g} must be below 1")
    if not isinstance(rule, str) or rule not in RULES:
        raise ArgumentError(f"{what}: rule = {shorten(rule)} must be one of {', '.join(RULES)}")
    if mesh is not None:
        require_kind(mesh, Mesh, f"{what}: mesh")
    at = chosen_state(at, f"{what}: at")
    spectral_accelerations(spectrum, np.zeros(0), what)
    if scene.works:
        raise ArgumentError(f"{what}: {scene.works[0]}: works are left out of section forces")
    for load in scene.loads:
        if not (load.dead or isinstance(load, ImposedStrain)):
            raise ArgumentError(
                f"{what}: {load}: the force follows the motion, so that modes are not orthogonal "
                "or section forces lack a part; leave it out, or use simulate"
            )
    undamped = replace(scene, damping=())
    basis = modes(undamped, n, at=at, mesh=mesh)
    _require_vibration(basis, what)
    small = Linearization(undamped if at else replace(undamped, loads=()), at, mesh=mesh)
    shapes, omega = np.asarray(basis.shapes.real), basis.omega
    pushed, mass = small.participation(toward)
    own = np.einsum("ik,ik->k", shapes, small.masses @ shapes)
    along = shapes.T @ pushed
    participation, effective = along / own, along**2 / own
    accelerations = spectral_accelerations(spectrum, np.asarray(2.0 * math.pi / omega), what)
    sizes = participation * accelerations / omega**2
    reactions = (small.support_forces(shapes, omega) * sizes).transpose(2, 0, 1)
    response = SpectralResponse(
        replace(basis, scene=scene), tuple(map(float, toward)), accelerations, participation,
        effective, mass, cqc(omega, damping) if rule == "CQC" else np.eye(len(omega)),
        _resultants(basis, sizes, at), reactions,
    )  # fmt: skip
    if response.missing_mass > 1.0 - LEAST_MASS:
        warn(
            f"{what}: the {len(basis)} modes have {1.0 - response.missing_mass:.0%} of the mass "
            f"along ({', '.join(f'{x:g}' for x in toward)}); 90 % are usual (EN 1998-1, "
            "4.3.3.3.1): give a larger n"
        )
    return response


def _require_vibration(basis: Modes, what: str) -> None:
    """Raise unless all modes are undamped vibrations about a stable state."""
    if not len(basis):
        raise ArgumentError(f"{what}: the scene has no mode")
    if np.iscomplexobj(basis.shapes) or (np.abs(basis.damping) > AT_REST).any():
        raise ArgumentError(
            f"{what}: dampers, follower loads or a rotating frame act on the scene, or it is "
            "unstable, so that it has no undamped modes; leave them out, or use simulate"
        )
    if (basis.omega <= AT_REST * basis.omega.max()).any():
        raise ArgumentError(f"{what}: the scene can move without strain; give it supports")


def cqc(omega: Array, damping: float) -> Array:
    """Return the correlation coefficients of modes with equal damping ratios; (n, n).

    Der Kiureghian 1981, equation 24, for frequencies ``omega``; rad/s.
    """
    i, j = omega[:, None], omega
    product, ζ = i * j, damping
    above = 8.0 * ζ**2 * np.sqrt(product) * (i + j) * product
    below = (i**2 - j**2) ** 2 + 4.0 * ζ**2 * product * (i**2 + j**2) + 8.0 * ζ**2 * product**2
    return np.asarray(above / below)


def _resultants(basis: Modes, sizes: Array, at: Solution | None) -> Array:
    if basis.scene.in_space:
        given = None if at is None else at.forces_in_middle(-1)
        forces = linear_forces_in_space(basis.numbering, basis.q, basis.turns, given)
    else:
        forces = linear_forces_of_cells(basis.numbering, basis.q, basis.section_law)
    peaks = []
    for shape, size, omega in zip(basis.shapes.real.T, sizes, basis.omega, strict=True):
        x = np.ascontiguousarray(size * shape)
        peaks.append(forces(x, -(omega**2) * x))
    return np.array(peaks)
