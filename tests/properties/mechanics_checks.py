# SPDX-License-Identifier: MIT
"""Checks of combinations against mechanics: equilibrium, momentum, vibrations, paths, buckling."""

import math
from dataclasses import replace

import numpy as np
from balance_of_parts import Balance
from combination_checks import DIGITS, SAME, check, difference, only
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

import ufl_beam as ub
from ufl_beam.model.bodies import GROUND, node

FORCES = 1e-8
"""Part of the largest force that may be missing: Newton's method leaves 1e-12 of the forces, which
differences of positions magnify; V follows from moments of cells of a quarter of a metre."""


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
            add(factor * (_turned(mean) @ np.array(load.force)))
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


def _turned(angles):
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)


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
