# SPDX-License-Identifier: MIT
"""Viscous damping of the elastic motion, beside plastic dissipation."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

from ufl_beam.errors import SceneError, closed, require_sequence
from ufl_beam.model.bodies import Member, require_beam
from ufl_beam.model.records import NotNegative, Positive, Record


@closed("state other damping as a VirtualWork of v")
@dataclass(frozen=True)
class Rayleigh(Record):
    """Rayleigh damping (a0 M + a1 K) v with the stiffness K of the undeformed scene, P(92).

    The damping ratio of a mode of circular frequency ω is a0/(2ω) + a1 ω/2.  It is a property of
    the structure, not of the material, and it is not objective: rigid rotation is damped too, and
    a hinge that has opened keeps being resisted.  For large motion see :class:`KelvinVoigt`.

    Args:
        mass: a0; 1/s.
        stiffness: a1; s.

    Raises:
        SceneError: A negative number, or both zero.

    Example:
        >>> damping = ub.Rayleigh(mass=1.0, stiffness=1e-5)  # 1/s, s
        >>> damped = ub.Scene([beam], supports=scene.supports, damping=[damping])
        >>> vibration = ub.modes(damped, 3)
        >>> np.allclose(vibration.damping, 0.5 / vibration.omega + 0.5e-5 * vibration.omega)
        True
    """

    _: KW_ONLY
    mass: NotNegative = 0.0
    stiffness: NotNegative = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mass == self.stiffness == 0.0:
            raise SceneError("Rayleigh: mass and stiffness are both zero; leave damping out")


@closed("state other damping as a VirtualWork of v")
@dataclass(frozen=True, eq=False)
class KelvinVoigt(Record):
    """Kelvin-Voigt damping: C times the strain rates, beside the elastic resultants; objective.

    Rigid motion is not damped.  The damping ratio of a mode of circular frequency ω in small
    vibration is time ω/2, that of ``Rayleigh(stiffness=time)``.  Cells with a hinge are left out,
    so that an open hinge turns freely.

    Args:
        time: Retardation time; s.
        beams: The beams that are damped; all by default.

    Raises:
        SceneError: A time that is not positive.

    Example:
        >>> damped = ub.Scene([beam], supports=scene.supports, damping=[ub.KelvinVoigt(time=1e-4)])
        >>> vibration = ub.modes(damped, 2)
        >>> np.allclose(vibration.damping, 0.5e-4 * vibration.omega)
        True
    """

    time: Positive
    beams: tuple[Member, ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.beams is not None:
            object.__setattr__(self, "beams", require_sequence(self.beams, "KelvinVoigt: beams"))
            for i, beam in enumerate(self.beams):
                require_beam(beam, f"KelvinVoigt: beams[{i}]")


Damping = Rayleigh | KelvinVoigt
