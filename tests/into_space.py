# SPDX-License-Identifier: MIT
"""Planar scenes, stated in space in a plane of any direction, and comparison of their runs."""

from dataclasses import fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

import ufl_beam as ub
from ufl_beam.model.bodies import GROUND, BodyPoint, Place
from ufl_beam.model.distributions import Distribution
from ufl_beam.model.joints import Joint
from ufl_beam.model.loads import LOADS
from ufl_beam.model.supports import Support
from ufl_beam.model.works import Work

SKEW = Rotation.from_rotvec([0.3, -0.7, 1.1])
EXACT = ub.Newton(rtol=1e-13)

AXES = {"force", "acceleration", "linear", "about", "along"}
"""Fields with a vector of the plane."""

NORMALS = {"moment", "angular", "rate"}
"""Fields with the component of a vector across the plane."""

SAME = (
    ub.Rigid, ub.Revolute, ub.Prismatic, ub.RigidLink, ub.Link, ub.Turn, ub.Stretch, ub.Slide,
    ub.Clamped, ub.PointLoad, ub.FollowerLoad, ub.LineLoad, ub.Pressure, ub.MovingLoad, ub.Gravity,
    ub.RotatingFrame, ub.Velocity, ub.KelvinVoigt, ub.Coulomb,
)  # fmt: skip
"""Classes that have the same arguments in space, with vectors of three components."""

REFUSED = (
    Joint, ub.Bushing, Support, *LOADS, ub.ImposedStrain, ub.Rayleigh, ub.Controller, Work,
    ub.Effect,
)  # fmt: skip
"""Classes of which the others have no counterpart."""


class InSpace:
    """A planar scene in space.

    Supports also hold the motion out of the plane, so that statics has no free motion.  A point
    mass becomes a body, and a pin in a slot a sliding body that bears the pin.

    Args:
        plane: The planar scene.
        turn: Rotation from the axes x, y of the scene to those of the plane.

    Attributes:
        scene: The scene in space.

    Raises:
        NotImplementedError: Something has no counterpart in space.
    """

    def __init__(self, plane, turn):
        self.plane, self.turn, self.made, self.more = plane, turn, {}, {"bodies": [], "joints": []}
        self.normal = self.vector((0, 0, 1))
        lists = {x.name: getattr(plane, x.name) for x in fields(plane)}
        made = {name: [self.at(x) for x in records] for name, records in lists.items()}
        self.scene = ub.Scene(
            **{name: records + self.more.get(name, []) for name, records in made.items()}
            | {"masses": []}
        )

    def vector(self, v):
        """Return a vector of the plane by its components in space."""
        return tuple(self.turn.apply([*v, 0.0][:3]).tolist())

    def back(self, vectors):
        """Return vectors of space in axes of the plane; the last axis has a multiple of 3."""
        return self.turn.inv().apply(np.reshape(vectors, (-1, 3))).reshape(np.shape(vectors))

    def at(self, x):
        """Return the counterpart of an object, place, law or number."""
        if isinstance(x, Place):
            return replace(x, beam=self.at(x.beam))
        if isinstance(x, BodyPoint):
            point = self.vector(x.point)
            return ub.ground(*point) if x.body is GROUND else self.at(x.body).at(*point)
        if isinstance(x, tuple | list):
            return type(x)(map(self.at, x))
        kind = type(x).__name__
        if not hasattr(self, kind) and not isinstance(x, SAME):
            if isinstance(x, REFUSED):
                raise NotImplementedError(f"{kind} has no counterpart in space")
            return x  # a law or a number
        if x not in self.made:
            self.made[x] = getattr(self, kind, self.same)(x)
        return self.made[x]

    def same(self, x, **more):
        """Return a record with all its fields in space."""
        values = {f.name: getattr(x, f.name) for f in fields(x) if f.init}
        for name, value in values.items():
            if name in NORMALS:
                values[name] = tuple(value * np.array(self.normal))
            elif name in AXES and np.ndim(value):
                values[name] = self.vector(value)
            else:
                values[name] = self.at(value)
        places = values.pop("places", ())
        return type(x)(*places, **values | more)

    def Beam(self, beam):
        (x, y), (x1, y1) = beam.ends
        return ub.Beam(
            *map(self.vector, beam.ends), self.section(beam.section), cells=beam.cells,
            name=beam.name, curve=lambda s: self.vector(beam.curve(s)), corners=beam.corners,
            hinges=beam.hinges, up=self.vector((y - y1, x1 - x)),
        )  # fmt: skip

    def section(self, section):
        """Return a section with arbitrary stiffnesses of motion out of the plane."""
        if section.interaction:
            raise NotImplementedError("laws of N and M together are for the plane")
        fibres, EI2 = section.fibres, 1.7 * section.EI
        if fibres:  # two for each one
            if any(
                isinstance(x, Distribution) for f in fibres.fibres for x in vars(f.law).values()
            ):
                raise NotImplementedError("random yield stresses depend on coordinates")
            away = np.full(len(fibres.y), np.sqrt(EI2 / fibres.EA))
            twice = {x: np.tile(getattr(fibres, x), 2) for x in ("material", "E", "y", "A")}
            z = np.concatenate([-away, away])
            fibres = replace(fibres, **twice | {"A": twice["A"] / 2}, z=z)
        return replace(
            section, fibres=fibres, shape=None, GA3=0.8 * section.GA, EI2=EI2, GJ=1.3 * section.EI,
            rhoI2=0.6 * section.rhoI or None,
        )  # fmt: skip

    def Body(self, body):
        return ub.Body(
            self.vector(body.center), mass=body.mass, inertia=body.inertia, name=body.name
        )

    def PointMass(self, mass):
        place = self.at(mass.place)
        body = ub.Body(place.point, mass=mass.mass, inertia=mass.inertia, name="mass")
        self.more["bodies"].append(body)
        self.more["joints"].append(ub.Rigid(place, body.middle))
        return body

    def Velocity(self, velocity):
        """Point masses at the beams move with them."""
        masses = [x for x in self.plane.masses if getattr(x.place, "beam", None) in velocity.beams]
        bodies = [self.at(x) for x in masses]
        return self.same(velocity, beams=(*map(self.at, velocity.beams), *bodies))

    def Revolute(self, joint):
        return self.same(joint, axis=self.normal)

    def Turn(self, turn):
        return self.same(turn, axis=self.normal)

    def Slide(self, slide):
        return self.same(slide, axis=self.vector(slide.axis))

    def Prismatic(self, joint):
        axis, rail, slider = self.vector(joint.axis), self.at(joint.rail), self.at(joint.slider)
        if not joint.turning:
            return ub.Prismatic(rail, slider, axis=axis)
        block = ub.Body(slider.point, name="block")
        self.more["bodies"].append(block)
        self.more["joints"].append(ub.Revolute(block.middle, slider, axis=self.normal))
        return ub.Prismatic(rail, block.middle, axis=axis)

    def Pinned(self, support):
        return self.PrescribedDisplacement(support, u=0.0, v=0.0)

    def Roller(self, support):
        return self.PrescribedDisplacement(support, v=0.0)

    def PrescribedDisplacement(self, support, **held):
        held = held or {name: getattr(support, name) for name in ("u", "v", "psi")}
        more = {"along": self.vector(getattr(support, "along", (1, 0))), "up": self.normal}
        if held.keys() != {"u", "v", "psi"} or held["psi"] is not None:
            more |= {"axis": self.normal, "w": 0.0}
        return ub.PrescribedDisplacement(self.at(support.place), **held, **more)

    def LineLoad(self, load):
        if load.moment:
            raise NotImplementedError("LineLoad: moments along beams are for the plane")
        return self.same(load, moment=0.0)

    def Pressure(self, load):
        return self.same(load, normal=(load.normal, 0.0))


def same_in_space(
    plane, scheme, *, turn=SKEW, t=(0, 1), dt=0.1, forces=False, tolerance=1e-11, **more
):
    """Require that a planar scene and its copy in space have equal runs; return both."""
    copy = InSpace(plane, turn)
    options = {"t": t, "dt": dt, "newton": EXACT} | more
    runs = [ub.simulate(x, scheme, **options) for x in (plane, copy.scene)]
    for name, difference, size in differences(copy, *runs, forces=forces):
        assert difference <= tolerance * size, name
    return runs


def differences(copy, plane, space, *, forces):
    """Yield (quantity, difference, size) of a planar run and of the run of its copy in space.

    Both are the largest values of all times.  Quantities across the plane are compared with zero.

    Args:
        copy: The scene in space.
        plane: The run in the plane.
        space: The run in space.
        forces: Whether section forces have one definition in both: in statics without damping.
    """
    flat, times, beams = copy.plane, range(len(plane.times)), copy.plane.beams[:9]
    # Strains have the round-off of directions, so that smaller ones count as these.
    small = 1e-3 * np.array([1.0, 1.0, 1.0 / flat.size])
    stiffness = [[getattr(b.section, x) for x in ("EA", "GA", "EI")] for b in flat.beams]
    of_forces = small * np.max(stiffness, axis=0, initial=0.0)
    force = of_forces.max()
    through = plane.energy.energy_transferred + plane.energy.total.max() + 1e-3 * force * flat.size

    def compare(name, a, b, size):
        return name, np.abs(np.subtract(b, a)).max(), max(size, np.abs(a).max())

    for part in (*beams, *flat.bodies):
        place = part.at(0.3) if part in flat.beams else part.middle
        (*u, ψ), moved = plane.displacement(place).T, copy.back(space.displacement(copy.at(place)))
        yield compare(f"{place}", np.transpose([*u, 0 * ψ]), moved[:, :3], flat.size)
        turns = np.angle(np.exp(1j * ψ))
        near = np.abs(turns) < 3.1  # farther the rotation vector may have the other sign
        yield compare(
            f"rotation of {place}", np.outer(turns[near], [0, 0, 1]), moved[near, 3:], 1.0
        )
    for name in {*plane.energy, *space.energy}:
        one, other = (run.energy.get(name, 0.0) for run in (plane, space))
        yield compare(f"energy {name}", one, other, through)
    for beam in beams:
        a, b = (
            np.array([run.strains(x, n) for n in times])
            for run, x in ((plane, beam), (space, copy.at(beam)))
        )
        for k, name in ((0, "Σ"), (1, "Γ"), (2, "K")):
            yield compare(f"{name} of {beam.name}", a[..., k], b[..., (0, 1, 5)[k]], small[k])
        yield compare(f"Γ3, T, K2 of {beam.name}", 0.0, b[..., 2:5], np.abs(a).max() + small.max())
        if forces:
            a, b = (
                np.array([run.diagram(x, n, points=3)[1:] for n in times])
                for run, x in ((plane, beam), (space, copy.at(beam)))
            )
            for k, name in enumerate("NVM"):
                yield compare(f"{name} of {beam.name}", a[:, k], b[:, (0, 1, 5)[k]], of_forces[k])
            yield compare(f"V3, T, M2 of {beam.name}", 0.0, b[:, 2:5], force)
    for support in flat.supports:
        one, other = plane.reaction(support)[1:], copy.back(space.reaction(copy.at(support))[1:])
        x, y, M = one.T
        yield compare(f"{support}", np.transpose([x, y, 0 * M]), other[:, :3], force)
        yield compare(
            f"moment of {support}", np.outer(M, [0, 0, 1]), other[:, 3:], force * flat.size
        )
    for one in flat.connectors:
        a, b = plane.connector(one), space.connector(copy.at(one))
        yield compare(
            f"motion of {one}", a.motion, b.motion, 1.0 if isinstance(one, ub.Turn) else flat.size
        )
        yield compare(f"force of {one}", a.force, b.force, force)
        yield compare(f"work of {one}", a.work, b.work, through)
        yield compare(f"loss of {one}", a.dissipated, b.dissipated, through)
