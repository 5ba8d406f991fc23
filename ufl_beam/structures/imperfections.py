# SPDX-License-Identifier: MIT
"""Initial imperfections: scenes with another geometry, free of stress."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

from ufl_beam.analysis.modes import Shapes
from ufl_beam.arrays import Array
from ufl_beam.errors import (
    ArgumentError,
    require_count,
    require_kind,
    require_number,
    require_vector,
    shorten,
)
from ufl_beam.model import plausibility
from ufl_beam.model.beams import Beam
from ufl_beam.model.bodies import GROUND, AttachmentPoint, Body, BodyPoint, Place
from ufl_beam.model.functions import Curve, Point
from ufl_beam.model.scene import Scene, not_in
from ufl_beam.model.sections import Section


def imperfect(
    scene: Scene, *, sway: float | Point = 0.0, bow: Mapping[Beam, float | Point] | None = None,
    mode: Shapes | None = None, k: int = 0, amplitude: float = 0.0,
) -> Scene:  # fmt: skip
    """Return a scene with initial imperfections: the same model in another geometry without stress.

    Sway, bows and mode add up.  Beams and bodies of the new scene are new objects of the same
    names, such as ``new["column"].end``.  Functions of users that refer to places, such as
    controllers, keep the places of ``scene``.

    Args:
        scene: Perfect model.
        sway: Inclination of the whole scene, with its lowest beam end fixed: displacement along x
            divided by height, such as 1/200; in space along x and y, as (1/200, 0), by the height
            along z.
        bow: Amplitudes of half sine waves of beams as fractions of the distance of their ends, such
            as ``{column: 1 / 300}``; positive to the left of the direction of the beam.  In space
            two numbers, along the axes 2 and 3 of the section.
        mode: Result of :func:`buckling` or :func:`modes` of ``scene``.
        k: Index of the mode.
        amplitude: Largest displacement of the mode, positive or negative; m.

    Raises:
        ArgumentError: The call is wrong: nothing changes the geometry; a beam of ``bow`` is not in
            the scene, or has a joint between its ends; the mode is complex, or of other beams.
        ModelError: Joints do not fit together in the new geometry.

    Example:
        >>> load = ub.PointLoad(beam.end, force=(-1e6, 0))
        >>> column = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        >>> crooked = st.imperfect(column, mode=ub.buckling(column, 1), amplitude=2 / 500)
        >>> run = ub.simulate(crooked, ub.Static(), t=(0, 1), dt=0.5)
        >>> tip = run.displacement(crooked["beam"].end)[-1, 1]
        >>> print(round(abs(tip) / (2 / 500), 3))  # 1 / (8.84 - 1), the load is 1/8.84 of Euler's
        0.128
    """
    require_kind(scene, Scene, "imperfect: scene")
    lean = _numbers(sway, scene, "imperfect: sway")
    require_number(amplitude, "imperfect: amplitude")
    require_count(k, "imperfect: k", at_least=0)
    plausibility.check("imperfect", "inclination", math.hypot(*lean))
    bows = {} if bow is None else bow
    if not isinstance(bows, Mapping) or not all(isinstance(beam, Beam) for beam in bows):
        raise ArgumentError(
            f"imperfect: bow = {shorten(bow)} must be a dict of beams of the scene, as in "
            'bow={scene["column"]: 1 / 300}'
        )
    amplitudes = dict[Beam, Array]()
    for beam, size in bows.items():
        if beam not in scene.beams:
            raise ArgumentError(f"imperfect: bow: {not_in(scene, beam)}")
        amplitudes[beam] = _numbers(size, scene, f"imperfect: bow of {beam.name}")
        plausibility.check(f"imperfect: {beam.name}", "bow", math.hypot(*amplitudes[beam]))
        for joint in scene.joints:
            if any(isinstance(x, Place) and x.beam is beam and 0 < x.s < 1 for x in joint.places):
                raise ArgumentError(
                    f"imperfect: bow of {beam.name}: {joint} is between its ends; divide the beam "
                    "there, or give the scaled mode of ub.buckling"
                )
    if mode is not None:
        require_kind(mode, Shapes, "imperfect: mode")
        if mode.scene.beams != scene.beams or mode.scene.bodies != scene.bodies:
            raise ArgumentError("imperfect: mode is of other beams or bodies")
        if np.iscomplexobj(mode.shapes[:, k : k + 1]):
            raise ArgumentError(f"imperfect: mode {k} is complex; its phases differ")
    if not any(map(np.any, (lean, *amplitudes.values()))) and (mode is None or not amplitude):
        raise ArgumentError(
            "imperfect: nothing changes the geometry; give sway=, bow= or mode= with amplitude="
        )
    lowest = min((point[-1] for beam in scene.beams for point in beam.ends), default=0.0)
    change = _Change(np.append(lean, 0.0), lowest, amplitudes, mode, k, amplitude)
    return change(scene)  # type: ignore[no-any-return]


def _numbers(given: Any, scene: Scene, what: str) -> Array:
    """Return a number, in space two numbers, as an array, or raise."""
    if not scene.in_space:
        return np.array([require_number(given, what)])
    if np.ndim(given) == 0 and given == 0.0:
        return np.zeros(2)
    return np.array(require_vector(given, what))


@dataclass(frozen=True, eq=False)
class Displaced:
    """Curve of a beam plus displacements: sway, a half sine wave, and linear interpolation."""

    curve: Curve
    sway: Array  # displacement by height; (2 or 3,)
    lowest: float  # height of the points without sway; m
    bow: Array  # amplitude of the half sine wave; (2 or 3,); m
    s: Array
    shape: Array  # displacements at the parameters ``s``; (n, 2 or 3); m

    def __call__(self, s: float) -> Point:
        """Return the point at a parameter; m."""
        point = np.array(self.curve(s))
        wave = math.sin(math.pi * s) if 0.0 < s < 1.0 else 0.0
        moved = [np.interp(s, self.s, values) for values in self.shape.T]
        swayed = point + self.sway * (point[-1] - self.lowest)
        return tuple((swayed + self.bow * wave + moved).tolist())


@dataclass(frozen=True, eq=False)
class _Change:
    """Change of geometry; a call returns a record with new beams, bodies and places."""

    sway: Array  # displacement by height; (2 or 3,)
    lowest: float  # height without sway; m
    bows: Mapping[Beam, Array]
    mode: Shapes | None
    k: int
    amplitude: float
    made: dict[int, tuple[Any, Any]] = field(default_factory=dict)  # by id, which it keeps in use

    def __call__(self, old: Any) -> Any:
        """Return an object with new places, or the object itself if it has none."""
        if id(old) not in self.made:
            self.made[id(old)] = old, self._renew(old)
        return self.made[id(old)][1]

    def _renew(self, old: Any) -> Any:
        if old is GROUND or isinstance(old, type | Section):
            return old
        if isinstance(old, Beam):
            curve = self._curve(old)
            return _rebuilt(old, curve=curve, ends=(curve(0.0), curve(1.0)))
        if isinstance(old, Body):
            return _rebuilt(old, center=self._point(old.middle))
        if isinstance(old, BodyPoint):
            return BodyPoint(self(old.body), self._point(old))
        if isinstance(old, Mapping):
            pairs = [(self(key), self(value)) for key, value in old.items()]
            same = all(value is old.get(key) for key, value in pairs)
            return old if same else dict(pairs)
        if isinstance(old, list | tuple) and not hasattr(old, "_fields"):
            items = [self(item) for item in old]
            same = all(item is value for item, value in zip(items, old, strict=True))
            return old if same else type(old)(items)
        if is_dataclass(old):
            values = {f.name: getattr(old, f.name) for f in fields(old) if f.init}
            changed = {name: self(value) for name, value in values.items()}
            same = all(changed[name] is value for name, value in values.items())
            return old if same else _rebuilt(old, **changed)
        return old

    def _curve(self, beam: Beam) -> Displaced:
        along, up = np.array(beam.ends[1]) - beam.ends[0], np.array(beam.up)
        size = self.bows.get(beam, np.zeros(len(self.sway) - 1))
        s = np.array([0.0, 1.0])
        if self.mode is not None:
            numbering = self.mode.numbering
            s, pieces = numbering.parameters(beam), 1 if numbering.mesh.degree == 1 else 12
            s = np.interp(np.arange(pieces * (len(s) - 1) + 1) / pieces, np.arange(len(s)), s)
        shape = np.array([self._motion(beam.at(float(x))) for x in s])
        if len(along) == 2:
            bow = size * (-along[1], along[0])
        else:
            third = np.cross(along, up)
            third *= np.linalg.norm(along) / np.linalg.norm(third)
            bow = size @ [np.cross(third, along / np.linalg.norm(along)), third]
        return Displaced(beam.curve, self.sway, self.lowest, bow, s, shape)

    def _motion(self, place: AttachmentPoint) -> Array:
        """Return the displacement of a place in the mode; (2 or 3,); m."""
        d = len(place.point)
        if self.mode is None:
            return np.zeros(d)
        return np.asarray(self.amplitude * self.mode.shape(self.k, place)[:d])

    def _point(self, place: BodyPoint) -> Point:
        point = np.array(place.point)
        swayed = point + self.sway * (point[-1] - self.lowest)
        return tuple((swayed + self._motion(place)).tolist())


def _rebuilt(old: Any, **changed: Any) -> Any:
    """Return a copy of a record with other values of some fields, which are checked anew."""
    new = object.__new__(type(old))
    for f in fields(old):
        if f.init:
            object.__setattr__(new, f.name, changed.get(f.name, getattr(old, f.name)))
    getattr(new, "__post_init__", lambda: None)()
    return new
