# SPDX-License-Identifier: MIT
"""Checks of combinations against mechanics: equilibrium, momentum, vibrations, paths, buckling."""

import math
from dataclasses import replace

import numpy as np
from combination_checks import DIGITS, SAME, check, difference, only
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu
from user_laws import HardeningSpring

import ufl_beam as ub
from ufl_beam.model.bodies import GROUND, node

FORCES = 1e-8
"""Part of the largest force that may be missing: Newton's method leaves 1e-12 of the forces, which
differences of positions magnify; V follows from moments of cells of a quarter of a metre."""

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
                force = factor * turned(load.force, turn)
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
                place, t = beam.at(diagram.s[i]), turned(axis, turn)
                force = sign * (diagram.N[i] * t + diagram.V[i] * np.array([-t[1], t[0]]))
                ends.append(self.at(place, force, sign * diagram.M[i]))
                self.size = max(self.size, np.abs(ends[-1]).max())
            yield k // 2, (diagram.s[k], diagram.s[k + 1]), ends


def turned(vector, angle):
    """A vector of the plane that is turned by an angle, or by each of several."""
    (x, y), c, s = vector, np.cos(angle), np.sin(angle)
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


@check
def equilibrium(case):
    """In statics N, V, M at both ends of each cell bear its loads, and jump by what acts at nodes.

    A support, connector or joint bears what the nodes of its parts miss.  Quadratures are those of
    the cells, of degree 2, exact for all but the field of magnets.
    """
    words = case.combination
    only(words.has("scheme = ub.Static("), "forces of a step act at its end in Static only")
    only(not words.has("Beam.", "lumped", "field", "KelvinVoigt"), "not integrated here")
    only(not case.exact.failure, "a step fails")
    balance = Balance(case.exact.names, case.exact.solution)
    missing, nodes = {}, {}
    for beam in balance.scene.beams:
        for k, (s0, s1), (start, end) in balance.cuts(beam):
            missing[f"cell {k} of {beam.name}"] = start + end + balance.on_cell(beam, k, s0, s1)
            for s, force in ((s0, start), (s1, end)):
                part = balance._of(beam.at(s))
                nodes[part] = nodes.get(part, np.zeros(3)) - force
    for place, force in balance.on_places():
        part = balance._of(place)
        nodes[part] = nodes.get(part, np.zeros(3)) + force
        balance.size = max(balance.size, np.abs(force).max())
    nodes.pop(GROUND, None)
    missing |= {f"node {part}": force for part, force in nodes.items()}
    wrong = {k: v / balance.size for k, v in missing.items()}
    wrong = {k: v for k, v in wrong.items() if not np.abs(v).max() < FORCES}
    assert not wrong, wrong


@check
def jumps(case):
    """N, V, M jump at no vertex where nothing is; at ends they are zero or the reaction; sizes."""
    only(not case.exact.failure, "a step fails")
    scene, solution = case.exact.names["scene"], case.exact.solution
    attached, supports = {}, {}
    along = ub.LineLoad | ub.Pressure | ub.MovingLoad | ub.ImposedStrain | ub.VirtualWork
    for owner, place in scene.attachments():
        on_beams = isinstance(owner, along) or bool(getattr(owner, "beams", None))
        if isinstance(place, ub.Place) and not on_beams:
            attached.setdefault((place.beam, round(place.s, 9)), []).append(owner)
    for support in scene.supports:
        supports[support.place.beam, round(support.place.s, 9)] = support
    wrong, size = {}, 0.0
    for n in {1, len(solution) // 2, len(solution) - 1}:
        for beam in scene.beams:
            s, N, V, M = solution.diagram(beam, n, points=2)
            forces = np.column_stack([np.hypot(N, V), M])
            size = max(size, np.abs(forces).max())
            for i in range(0, len(s) + 1, 2):
                sides = forces[max(i - 1, 0) : i + 1]
                at = beam, round(float(s[min(i, len(s) - 1)]), 9)
                owners = attached.get(at, [])
                if at in supports and len(owners) == 1 and len(sides) == 1:
                    x, y, moment = solution.reaction(supports[at])[n]
                    sides = np.vstack([np.abs(sides), [math.hypot(x, y), abs(moment)]])
                elif owners:
                    continue
                jump = np.abs(np.diff(sides, axis=0) if len(sides) == 2 else sides).max()
                wrong[f"{beam.name} at {at[1]}, state {n}"] = float(jump)
    wrong = {name: jump / size for name, jump in wrong.items() if jump > FORCES * size}
    assert not wrong, wrong


@check
def momentum(case):
    """In midpoint rules linear momentum grows by the impulses of loads, supports and the ground."""
    words = case.combination
    midpoint = words.has("ub.EnergyMomentum(", "ub.EnergyMomentumDecaying", "Weighted")
    only(midpoint and not words.has("order=4"), "other means of forces")
    fields = "VirtualWork", "Effect", "Potential", "RotatingFrame", "Rayleigh", "Guided", "Pressure"
    only(not words.has(*fields), "field")
    only(not case.exact.failure, "a step fails")
    solution, scene = case.exact.solution, case.exact.names["scene"]
    only(solution.substeps == len(solution) - 1, "a step was cut")
    moving = [load for load in scene.loads if isinstance(load, ub.MovingLoad)]
    only(not any(load.mass for load in moving), "a mass that comes and goes")
    t, dt = solution.times, np.diff(solution.times)
    middle = (t[1:] + t[:-1]) / 2
    force, size = np.zeros((len(dt), 2)), 0.0

    def add(values):
        nonlocal force, size
        force, size = force + values, max(size, np.abs(values).max(initial=0.0))

    for load in scene.loads:
        factor = np.array([load.amplitude(x) for x in middle])[:, None]
        if isinstance(load, ub.Gravity):
            mass = sum(_length(solution, beam) * beam.section.rhoA for beam in scene.beams)
            mass += sum(one.mass for one in (*scene.masses, *scene.bodies))
            add(factor * mass * np.array(load.acceleration))
        elif isinstance(load, ub.LineLoad):
            add(factor * _loaded_length(solution, load) * np.array(load.force))
        elif load in moving:
            places = np.array([load.position(x) for x in middle])[:, None]
            there = (places >= 0) & (places <= sum(_length(solution, x) for x in load.route))
            add(there * factor * np.array(load.force))
        elif not isinstance(load, ub.ImposedStrain):
            turn = solution.displacement(load.place)[:, 2]
            mean = (turn[1:] + turn[:-1]) / 2 * isinstance(load, ub.FollowerLoad)
            add(factor * turned(load.force, mean))
    for support in scene.supports:
        add(solution.reaction(support)[1:, :2])
    joints = [joint.holders[0] for joint in scene.joints if node(joint.places[0]) is GROUND]
    for one in (*scene.connectors, *joints):
        if node(one.a) is GROUND and not one.is_rotation:
            away = solution.position(one.b) - np.array(one.a.point)
            sums, lengths = away[1:] + away[:-1], np.hypot(*away.T)
            axis = sums / (lengths[1:] + lengths[:-1])[:, None] if one.stretches else one.axis
            along = np.broadcast_to(axis, force.shape)
            if one.components:
                x, y = solution.connector(one).force[1:, :2].T
                add(-x[:, None] * along - y[:, None] * along @ [[0.0, 1.0], [-1.0, 0.0]])
            else:
                add(-solution.connector(one).force[1:, None] * along)
    change = np.diff(solution.momentum()[:, :2], axis=0)
    assert np.abs(change - dt[:, None] * force).max() < FORCES * size * dt.max()


def _loaded_length(solution, load):
    """Integral of the profile of a line load along the cells of its beam; m."""
    numbering, (points, weights) = solution.numbering, np.polynomial.legendre.leggauss(4)
    s, cells = numbering.parameters(load.beam), numbering.cells_of(load.beam)
    at = (s[:-1, None] + s[1:, None]) / 2 + np.outer(np.diff(s) / 2, points)
    return numbering.lengths(cells) @ load.factors(at) @ weights / 2


def _length(solution, beam):
    return np.hypot(
        *np.diff(solution.numbering.points[solution.numbering.vertices_of(beam)], axis=0).T
    ).sum()


@check
def modes(case):
    """Modes about a static state are those of the motion after a small step of a load.

    With s dt = 2 (z - 1)/(z + 1) in the midpoint rule, states lie in the span of zⁿ of all modes.
    Those beyond 20 have less than 1/100 of the first amplitude.
    """
    words = case.combination
    only(words.has("scheme = ub.Static(") and words.elastic, "not elastic, or no equilibrium at T")
    only(not case.exact.failure, "a step fails")
    only(not words.has("Prescribed", "VirtualWork", "'field'"), "driven")
    names, state = case.exact.names, case.exact.solution
    scene, t0 = names["scene"], state.times[-1]
    held = [_held(load, t0) for load in scene.loads]
    still = replace(scene, loads=held)
    options = {"mesh": names["mesh"], "comm": case.comm, "newton": ub.Newton(rtol=DIGITS)}
    creep = [one.retardation_time for one in scene.damping if isinstance(one, ub.KelvinVoigt)]
    if creep:  # until nothing moves
        times = t0, t0 + 1000 * max(creep)
        dt = (times[1] - t0) / 10
        state = ub.simulate(still, ub.Static(), t=times, dt=dt, start=state, **options)
        t0 = times[1]
    shapes = ub.modes(still, 20, at=state)
    period = 2 * math.pi / shapes.omega[0]
    places = [b.at(s) for b in scene.beams for s in ((0.5, 1.0) if b.cells % 2 == 0 else (1.0,))]
    ways = [float(np.abs(shapes.shape(0, p)[:2]).max()) for p in places]
    place = places[int(np.argmax(ways))]  # a node, so that the mesh stays
    push = ub.PointLoad(place, force=1e-5 * 100 * np.array([0.6, 0.8]), amplitude=lambda t: 1.0)
    _require_linear_model(still, held, push, place, state, shapes)
    options |= {"t": (t0, t0 + 4 * period), "dt": period / 40, "start": state}
    run = ub.simulate(replace(still, loads=[*held, push]), ub.EnergyMomentum(), **options)
    moved = run.displacement(place)[:, :2]
    sdt = shapes.exponents * period / 40
    z = (1 + sdt / 2) / (1 - sdt / 2)
    powers = z[None, :] ** np.arange(len(moved))[:, None]
    basis = np.column_stack([np.ones(len(moved)), powers.real, powers.imag])
    left = moved - basis @ np.linalg.lstsq(basis, moved, rcond=1e-10)[0]
    assert np.abs(left).max() < 1e-2 * np.ptp(moved, axis=0).max()


def _held(load, t):
    """A load as it is at a time."""
    if isinstance(load, ub.RotatingFrame):
        return load
    still = {"amplitude": lambda _: load.amplitude(t)}
    if isinstance(load, ub.MovingLoad):
        still |= {"position": lambda _: load.position(t), "mass": 0.0}
    return replace(load, **still)


def _require_linear_model(still, held, push, place, state, shapes):
    """The linear model has the exponents of the modes, and one response in all its forms.

    Exponents of first-order equations have errors of 1e-14 of the largest one, in the square.
    """
    push = replace(push, force=(0.6, 0.8), amplitude=lambda t: float(t > state.times[-1]))
    model = ub.linearize(
        replace(still, loads=[*held, push]), inputs=[push], at=state,
        outputs=[("displacement", place, "u"), ("velocity", place, "v")],
    )  # fmt: skip
    A, B, C, D = model.state_space()
    s, few = np.linalg.eigvals(A), shapes.exponents[:6]
    largest = np.abs(s).max()
    for one in few:
        near = np.abs(s**2 - one**2).min()
        assert near <= 1e-11 * largest**2 + 1e-7 * abs(one) ** 2, (one, near)
    at = 0.7 * abs(few[0]) * np.exp(1.9j)
    full = model.transfer_function(at)[:, 0, 0]
    by_states = (C @ np.linalg.solve(at * np.eye(len(A)) - A, B) + D)[:, 0]
    E, A, B, C, D = model.descriptor()
    by_descriptor = (C @ splu(csc_array(at * E - A)).solve(B.toarray().astype(complex)) + D)[:, 0]
    for other in (by_states, by_descriptor):
        assert np.abs(other - full).max() <= 1e-6 * np.abs(full).max()


IN_TIME = ("Controller", "state=", "Perzyna", "DuvautLions", "Dashpot", "KelvinVoigt")
"""What depends on time, or on rates, and is no part of a path."""


@check
def path(case):
    """`follow` with equal steps of the load factor passes the states of `Static`.

    Loads that act at the factor 0 come alone on a path, with others in the first step of `Static`;
    what has a history remembers that, and also the factors at which one of both was alone.
    """
    words = case.combination
    only(words.has("scheme = ub.Static(") and not words.has(*IN_TIME), "in time")
    only(words.base != "column" and not case.exact.failure, "no equilibrium")
    only(words.elastic or not words.has("RotatingFrame", "Work(", "warming"), "loads at factor 0")
    names, expected = case.combination.make(), case.exact.solution
    step, end = expected.times[1], expected.times[-1]
    only(expected.substeps == len(expected) - 1, "a step was cut")
    options = {"steps": len(expected) - 1, "until": lambda now: now.t > end - step / 2}
    options |= {"mesh": names["mesh"], "newton": ub.Newton(rtol=DIGITS), "comm": case.comm}
    try:
        found = ub.follow(names["scene"], ub.LoadControl(step), **options)
    except ub.ConvergenceError as error:
        only("nothing moves with the load factor" not in str(error), "loads stay as they are")
        raise
    near = np.abs(found.factor[:, None] - expected.times[None, 1:]) < 1e-9 * end
    others, rows = np.nonzero(near)
    cut = np.ptp(np.diff(found.factor)) > 1e-9 * step
    # A path ends where the loads stop growing, perhaps before its third step.
    assert cut or len(rows) >= min(3, found.factor[-1] // step), found.factor
    only(len(rows), "loads stay as they are")
    if not words.elastic:
        n = np.arange(len(rows))
        common = (rows == n) & (others == n + 1)  # and so were all factors before
        others, rows = others[common], rows[common]
        only(len(rows), "the first step was cut")
    rows = rows + 1
    nodes = np.unique(np.vstack([expected.numbering.dofs, expected.numbering.dofs_of_bodies]))
    assert difference(found.q[others][:, nodes], expected.q[rows][:, nodes], 1.0) < SAME
    for one, other in zip(names["scene"].supports, case.exact.names["scene"].supports, strict=True):
        forces = expected.reaction(other)[rows]
        size = max(np.abs(forces).max(), 1.0)
        assert difference(found.reaction(one)[others], forces, size) < 10 * SAME


@check
def buckles(case):
    """The first critical point of a straight column is a bifurcation, at its buckling load."""
    only(case.combination.base == "column", "no straight column")
    names = case.combination.make()
    scene, mesh = names["scene"], names["mesh"]
    factor = ub.buckling(scene, 1, mesh=mesh).factors[0]
    options = {"mesh": mesh, "comm": case.comm, "until": lambda now: now.t > 1.1 * factor}
    path = ub.follow(scene, ub.LoadControl(factor / 8.3), steps=11, **options)
    assert path.critical, f"none up to {path.factor[-1]:.6g}; buckling at {factor:.6g}"
    first = path.critical[0]
    strain = factor / names["b0"].section.EA + factor / names["b0"].section.GA
    assert first.kind == "bifurcation", (first, factor)
    assert abs(first.factor / factor - 1) < 4 * strain + 1e-6, (first.factor, factor)


@check
def pictures(case):
    """One of the pictures, another one for each seed, is drawn without an error."""
    solution, beam = case.whole.solution, case.whole.names["b0"]
    only(len(solution) > 1, "no step")
    drawn = [(solution.scene,), (solution, "shapes"), (solution, "energy")]
    drawn.append((solution, "history", [beam.end]))
    if case.combination.has("bending=", "axial=ub.", "fibres=", "hinge=", "interaction="):
        drawn += [(solution, "dissipation"), (solution, "moment-curvature", beam.at(0.3))]
    if case.combination.seed % 12 == 5:  # these take seconds
        drawn = [(solution, force) for force in "NVM"]
    ub.plot(*drawn[case.combination.seed % len(drawn)]).draw_without_rendering()
