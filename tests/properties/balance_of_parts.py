# SPDX-License-Identifier: MIT
"""Forces on the cells and nodes of a scene in a static state, stated anew from the records."""

import math

import numpy as np
from user_laws import HardeningSpring

import ufl_beam as ub
from ufl_beam.model.bodies import GROUND, node

GAUSS = np.polynomial.legendre.leggauss(5)


class Balance:
    """Forces and moments about the origin on parts of a scene at the end of a static run; (3,)."""

    def __init__(self, names, solution):
        self.scene, self.solution, self.t = names["scene"], solution, solution.times[-1]
        self._group, self.size = {}, 0.0
        for joint in self.scene.joints:
            self._join(*joint.places)
        for one in self.scene.connectors:
            self._join(one.a, one.b)

    def _of(self, point):
        """Part of a place: a body, the ground, or a vertex of a beam."""
        key = node(point)
        key = key if not isinstance(key, ub.Place) else (key.beam, round(key.s, 9))
        while key in self._group:
            key = self._group[key]
        return key

    def _join(self, a, *others):
        """Parts that forces of joints and connectors keep together; those of the ground act."""
        for b in others:
            one, other = self._of(a), self._of(b)
            if one != other and GROUND not in (one, other):
                self._group[one] = other

    def at(self, place, force, moment=0.0):
        """A force at a place, about the origin."""
        x, y = self.solution.position(place)[-1]
        return np.array([*force, x * force[1] - y * force[0] + moment])

    def turn(self, place):
        return self.solution.displacement(place)[-1, 2]

    def on_places(self):
        """Forces of loads, supports, weights, and of what is joined to the ground, with places."""
        solution, scene, last = self.solution, self.scene, -1
        for load in scene.loads:
            if isinstance(load, ub.PointLoad | ub.FollowerLoad):
                turn = self.turn(load.place) * isinstance(load, ub.FollowerLoad)
                factor = load.amplitude(self.t)
                force = factor * _turned(load.force, turn)
                yield load.place, self.at(load.place, force, factor * load.moment)
        for support in scene.supports:
            *force, moment = solution.reaction(support)[last]
            yield support.place, self.at(support.place, force, moment)
        heavy = [(one.place, one.mass) for one in scene.masses]
        for place, mass in heavy + [(one.middle, one.mass) for one in scene.bodies]:
            yield place, self.at(place, mass * self.field(solution.position(place)[last]))
        for one in scene.connectors:
            if node(one.a) is GROUND:
                yield one.b, self._of_connector(one, solution.connector(one).force[last])
        for one in scene.works:
            if isinstance(one, ub.Effect) and isinstance(one.statement, HardeningSpring):
                place, of = one.places[1], one.numbers
                e = solution.displacement(place)[last, 1]
                yield place, self.at(place, np.array([0.0, -of["k"] * e - of["h"] * e**3]))
        for joint in scene.joints:
            if node(joint.places[0]) is GROUND:
                history, place = solution.joint(joint), joint.places[1]
                moment = np.nan_to_num(history.moment[last])
                yield place, self.at(place, history.force[last], moment)

    def _of_connector(self, one, force):
        if one.components:
            each = zip(one.components, force, strict=True)
            return sum(self._of_connector(component, x) for component, x in each)
        if one.is_rotation:
            return np.array([0.0, 0.0, -force])
        away = self.solution.position(one.b)[-1] - np.array(one.a.point)
        axis = away / np.hypot(*away) if one.stretches else np.array(one.axis)
        return self.at(one.b, -force * axis)

    def field(self, x):
        """Acceleration of weight and of rotating frames at a point; m/s²."""
        g = np.zeros(2)
        for load in self.scene.loads:
            if isinstance(load, ub.Gravity):
                g += load.amplitude(self.t) * np.array(load.acceleration)
            if isinstance(load, ub.RotatingFrame):
                g += load.rate**2 * np.subtract(x, load.about)
        return g

    def on_cell(self, beam, k, s0, s1):
        """Distributed loads and works on the k-th cell, from s0 to s1."""
        total = np.zeros(3)
        length = math.dist(*self.solution.numbering.points[self._nodes(beam, k)])
        for ξ, w in zip(*GAUSS, strict=True):
            place = beam.at((s0 + s1) / 2 + ξ * (s1 - s0) / 2)
            x = self.solution.position(place)[-1]
            force, moment = beam.section.rhoA * self.field(x), 0.0
            for load in self.scene.loads:
                if isinstance(load, ub.LineLoad | ub.Pressure) and load.beam is beam:
                    factor = load.amplitude(self.t) * load.factors(np.array([place.s]))[0]
                    per_length, couple = self._per_length(load, place, s1 - s0, length)
                    force, moment = force + factor * per_length, moment + factor * couple
                if isinstance(load, ub.MovingLoad):
                    total += w / 2 * self._of_moving_load(load, beam, k)
            of_works = self._of_works(beam, place, (s0, s1), length)
            total += w / 2 * length * self.at(place, force + of_works[:2], moment + of_works[2])
        return total

    def _per_length(self, load, place, width, length):
        """Force and moment per length of a line load or pressure."""
        if isinstance(load, ub.LineLoad):
            return np.array(load.force), load.moment
        x, y = self._slope(place, width) / length
        along, across = load.tangential, load.normal
        return np.array([along * x - across * y, along * y + across * x]), 0.0

    def _of_moving_load(self, load, beam, k):
        """Force on the k-th cell of a beam, at its place on the axis between the nodes."""
        numbering, d = self.solution.numbering, load.position(self.t)
        cells = np.concatenate([numbering.cells_of(one) for one in load.route])
        ends = np.append(0.0, np.cumsum(numbering.lengths(cells)))
        i = np.searchsorted(ends, d) - 1 if d else 0
        if not 0.0 <= d <= ends[-1] or cells[i] != numbering.cells_of(beam)[k]:
            return np.zeros(3)
        s, ξ = numbering.parameters(beam), (d - ends[i]) / (ends[i + 1] - ends[i])
        place = beam.at(s[k] + ξ * (s[k + 1] - s[k]))
        return self.at(place, load.amplitude(self.t) * np.array(load.force))

    def _slope(self, place, width):
        """Derivative of the position by the fraction of a cell; exact for cubic polynomials."""
        at = (place.beam.at(place.s + k * width / 50) for k in (-2, -1, 1, 2))
        a, b, c, d = (self.solution.position(p)[-1] for p in at)
        return 50 * (8 * (c - b) - (d - a)) / 12

    def _nodes(self, beam, k):
        """Vertices of the k-th cell of a beam."""
        return self.solution.numbering.cells[self.solution.numbering.cells_of(beam)][k]

    def _of_works(self, beam, place, ends, length):
        """Force and moment per length of the works of user_classes.py."""
        total = np.zeros(3)
        u = self.solution.displacement(place)[-1]
        for work in self.scene.works:
            number = {n: x(self.t) if callable(x) else x for n, x in work.numbers.items()}
            if beam not in work.on(self.scene.beams):
                continue
            if work.name == "dead":
                total[:2] += number["x"], number["y"]
            elif work.name == "soil":
                total[1] -= number["k"] * u[1]
            elif work.name == "field":
                total[2] += number["size"] * math.cos(u[2])
            elif work.name == "current":
                a, b = (self.solution.position(beam.at(s))[-1] for s in ends)
                x, y = (b - a) / length
                total[:2] += number["p"] * np.array([-y, x])
        return total

    def cuts(self, beam):
        """Forces on the cells of a straight beam at their ends, from the diagram; pairs of (3,)."""
        diagram = self.solution.diagram(beam, points=2)
        axis = np.subtract(*beam.ends[::-1]) / math.dist(*beam.ends)
        for k in range(0, len(diagram.s), 2):
            ends = []
            turns = self.solution.q[-1, self.solution.numbering.dofs[self._nodes(beam, k // 2), 2]]
            for i, sign, turn in ((k, -1.0, turns[0]), (k + 1, 1.0, turns[1])):
                place, t = beam.at(diagram.s[i]), _turned(axis, turn)
                force = sign * (diagram.N[i] * t + diagram.V[i] * np.array([-t[1], t[0]]))
                ends.append(self.at(place, force, sign * diagram.M[i]))
                self.size = max(self.size, np.abs(ends[-1]).max())
            yield k // 2, (diagram.s[k], diagram.s[k + 1]), ends


def _turned(vector, angle):
    (x, y), c, s = vector, math.cos(angle), math.sin(angle)
    return np.array([c * x - s * y, s * x + c * y])
