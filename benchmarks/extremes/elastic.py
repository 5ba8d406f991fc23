# SPDX-License-Identifier: MIT
"""Rows of elastic scenes: stiffness, slenderness, cells, steps, turns, masses, loads, units.

Each row compares with a closed form, or with what the scheme conserves.  What the last digit of a
number allows is written as ``EPS`` times how much it is magnified.
"""

import math
from itertools import pairwise

import numpy as np
from rows import EPS, LEDGER, outcome, row

import ufl_beam as ub

DECADES = tuple(10.0**k for k in range(10))


def rolled(sections, lengths, cells, moment):
    """A straight chain of beams from a clamp, one end rolled up by a moment; statics in one go."""
    x, beams, joints = 0.0, [], []
    for i, (section, length, n) in enumerate(zip(sections, lengths, cells, strict=True)):
        beams.append(ub.Beam((x, 0), (x + length, 0), section, cells=n, name=f"beam{i}"))
        x += length
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
    scene = ub.Scene(
        beams,
        joints=joints,
        supports=[ub.Clamped(beams[0].start)],
        loads=[ub.PointLoad(beams[-1].end, moment=moment, amplitude=ub.ramp(1.0))],
    )
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.25)


def polygon(angle, length, cells):
    """End of a beam rolled to an arc of ``angle``: its cells are chords of the mean direction."""
    middles = angle * (np.arange(cells) + 0.5) / cells
    h = length / cells
    return np.array([h * np.cos(middles).sum() - length, h * np.sin(middles).sum(), angle])


def missed(solution, end, expected):
    """Difference of the motion of the end of the last beam, which is of the order of one."""
    return float(np.abs(solution.displacement(end)[-1] - expected).max())


@row(
    "stiff and flexible halves, statics",
    "ratio of the stiffnesses of both halves",
    "rotation and position of the end, which a moment rotates by π; closed form of a polygon",
    DECADES,
)
def rigid_part(ratio):
    """Two beams of 0.5 m, one so many times stiffer in all; EI/L² = 1 N, slenderness 100."""
    soft = ub.Section(EA=1e4, GA=1e4, EI=1.0)
    stiff = ub.Section(EA=1e4 * ratio, GA=1e4 * ratio, EI=ratio)
    solution = rolled([soft, stiff], [0.5, 0.5], [8, 8], 2 * math.pi)
    one, two = math.pi, math.pi / ratio
    first = polygon(one, 0.5, 8)
    second = polygon(two, 0.5, 8)
    # The second chain goes on where the first ends, turned by its angle.
    x, y = second[0] + 0.5, second[1]
    turned = np.array(
        [math.cos(one) * x - math.sin(one) * y, math.sin(one) * x + math.cos(one) * y]
    )
    expected = np.array([first[0] + turned[0] - 0.5, first[1] + turned[1], one + two])
    error = missed(solution, solution.scene.beams[-1].end, expected)
    # Forces are met to 1e-10 of those in the scene, some EI/L², and to what the last digits of
    # rotations make in cells of the stiff half, EI/h; a moment strains no axis.
    return outcome(solution, error, 1e-8 + 16 * EPS * ratio)


@row(
    "stiff and flexible halves, dynamics",
    "ratio of the stiffnesses of both halves",
    "energy, momentum and angular momentum of free flight, relative",
    DECADES,
)
def rigid_in_flight(ratio):
    """Two hinged beams fly and spin, one so many times stiffer; 100 steps of 1/60 turn."""
    soft = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-4)
    stiff = ub.Section(EA=1e4 * ratio, GA=1e4 * ratio, EI=ratio, rhoA=1.0, rhoI=1e-4)
    one = ub.Beam((0, 0), (1, 0), soft, cells=4)
    two = ub.Beam((1, 0), (2, 0.5), stiff, cells=4)
    scene = ub.Scene(
        [one, two],
        joints=[ub.Revolute(one.end, two.start)],
        initial=[ub.Velocity([one, two], linear=(1.0, 2.0), angular=3.0)],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 3.5), dt=0.035)
    # An axial strain of last digits stores EA/h EPS² and changes what is stored by its force.
    stored = float(solution.energy["stored"].max())
    floor = 2 * math.sqrt(stored * 1e4 * ratio) * EPS * 4 / solution.energy.energy_transferred
    # Newton's method ends where 8 last digits of strains, EA/h EPS of forces, are missed; either
    # way, so that 100 steps make ten times the work of one.
    missed = 8 * EPS * 1e4 * ratio * 4 * 10 * solution_way(solution)
    return outcome(solution, conserved(solution), LEDGER + 100 * floor + missed)


def solution_way(solution):
    """How far a step goes, over the energy that went through."""
    way = np.abs(np.diff(solution.q, axis=0)).max()
    return float(way / solution.energy.energy_transferred)


def conserved(solution):
    """Largest drift of energy and momenta, as parts of the energy and the momenta."""
    momentum = solution.momentum()
    linear = np.abs(momentum[:, :2] - momentum[0, :2]).max() / np.abs(momentum[:, :2]).max()
    angular = np.abs(momentum[:, 2] - momentum[0, 2]).max() / np.abs(momentum[:, 2]).max()
    return max(solution.energy.worst, float(linear), float(angular))


@row(
    "slenderness",
    "ratio of length and radius of gyration",
    "position of the end of a beam bent to a half circle; closed form of a polygon",
    tuple(10.0**k for k in range(7)),
)
def slenderness(ratio):
    """EI/L² = 1 N, EA = GA = slenderness² EI/L²."""
    section = ub.Section(EA=ratio**2, GA=ratio**2, EI=1.0)
    solution = rolled([section], [1.0], [16], math.pi)
    error = missed(solution, solution.scene.beams[0].end, polygon(math.pi, 1.0, 16))
    return outcome(solution, error, 1e-8)


@row(
    "number of cells, statics",
    "cells of the beam",
    "position of the end of a beam bent to a half circle; closed form of a polygon",
    (1, 10, 100, 1000, 10_000, 100_000),
    seconds=300,
)
def cells_static(cells):
    """Slenderness 100."""
    cells = int(cells)
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0)
    solution = rolled([section], [1.0], [cells], math.pi)
    error = missed(solution, solution.scene.beams[0].end, polygon(math.pi, 1.0, cells))
    # A moment is EI times a difference of rotations of order one over 1/cells, and what it misses
    # turns the whole beam: its last digits grow with the cells, and the errors of all add up.
    return outcome(solution, error, 1e-8 + EPS * cells**2 * 10)


@row(
    "number of cells, dynamics",
    "cells of the beam",
    "energy, momentum and angular momentum of free flight, relative",
    (1, 10, 100, 1000, 10_000, 100_000),
    seconds=300,
)
def cells_in_flight(cells):
    """A beam flies and spins; 10 steps of 0.1 s, the lowest period is 0.28 s."""
    solution = flight(int(cells), steps=10, dt=0.1)
    return outcome(solution, conserved(solution), LEDGER + 100 * EPS * cells)


def drift(solution, spin=3.0):
    """What a tolerance of 1e-10 lets energy drift: forces of the spin along the way of all."""
    t = solution.times[-1] - solution.times[0]
    force = spin**2 / 4
    # Far away from where it began positions, and so strains, have fewer digits.
    force += 1e10 * EPS * 1e4 * 8 * 2.3 * t / 100
    return LEDGER + 1e-10 * force * (2.3 + spin) * t / solution.energy.energy_transferred


def flight(cells, *, steps, dt, spin=3.0, linear=(1.0, 2.0), every=1):
    """A free beam of 1 m, slenderness 100, flies and spins."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    start = ub.Velocity([beam], linear=linear, angular=spin)
    scene = ub.Scene([beam], initial=[start])
    return ub.simulate(scene, ub.EnergyMomentum(), t=(0, steps * dt), dt=dt, every=every)


@row(
    "time step, small motion",
    "Δt / period",
    "midpoint rule of a linear oscillator, closed form",
    tuple(10.0**k for k in range(-3, 4)),
)
def oscillator(ratio):
    """A mass on a massless bar that a force begins to pull; 1 - cos nθ, tan θ/2 = ω Δt/2."""
    section = ub.Section(EA=100.0, GA=100.0, EI=1.0)
    bar = ub.Beam((0, 0), (1, 0), section, cells=1)
    scene = ub.Scene(
        [bar],
        supports=[ub.Clamped(bar.start)],
        masses=[ub.PointMass(bar.end, 1.0, 1.0)],
        loads=[ub.PointLoad(bar.end, force=(1.0, 0.0))],
    )
    ω, steps = 10.0, 1000
    dt = ratio * 2 * math.pi / ω
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, steps * dt), dt=dt)
    n = np.arange(steps + 1)
    expected = 0.01 * (1 - np.cos(n * 2 * math.atan(ω * dt / 2)))
    error = np.abs(solution.displacement(bar.end)[:, 0] - expected).max() / 0.02
    # Each step is met to 1e-10 of its forces.
    return outcome(solution, error, 1e-10 * steps)


@row(
    "time step, large motion",
    "Δt / lowest period",
    "energy, momentum and angular momentum of free flight, relative",
    tuple(10.0**k for k in range(-3, 4)),
    stops=("a node turns by", "no equilibrium after t"),
)
def long_steps(ratio):
    """A free beam flies and spins, 2.1 s a turn; 50 or 2 steps, those that turn by π are cut."""
    solution = flight(4, steps=50 if ratio < 100 else 2, dt=ratio * 0.28)
    return outcome(solution, conserved(solution), drift(solution))


@row(
    "tiny time steps",
    "Δt in s at t = 1 s",
    "momentum of free flight, or a message that the time would not change",
    tuple(10.0**k for k in range(-18, -7, 2)),
    stops=("too small", "dt"),
)
def tiny_steps(dt):
    """Three steps from t = 1 s; below 2e-16 s the time would stand still."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    scene = ub.Scene([beam], initial=[ub.Velocity([beam], linear=(1.0, 2.0), angular=3.0)])
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(1.0, 1.0 + max(3 * dt, 4e-16)), dt=dt)
    # Velocities are differences of positions of order one over Δt.
    return outcome(solution, conserved(solution), LEDGER + 10 * EPS / dt)


@row(
    "revolutions of a rigid body in flight",
    "turns",
    "n · 2 atan(ω Δt/2) of the midpoint rule, per radian",
    (1, 10, 100, 1000),
)
def body_turns(turns):
    """20 steps a turn."""
    body = ub.Body((0.3, -0.2), mass=2.0, inertia=0.5)
    start = ub.Velocity([body], angular=2 * math.pi, about=body.center)
    scene = ub.Scene(bodies=[body], initial=[start])
    dt, steps = 0.05, int(20 * turns)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, steps * dt), dt=dt, every=steps)
    angle = steps * 2 * math.atan(math.pi * dt)
    error = abs(solution.displacement(body.middle)[-1, 2] - angle) / angle
    return outcome(solution, error, LEDGER)


@row(
    "revolutions of a flexible beam in flight",
    "turns",
    "energy, momentum and angular momentum, relative",
    (1, 10, 100, 1000),
)
def beam_turns(turns):
    """20 steps a turn."""
    solution = flight(2, steps=int(20 * turns), dt=0.05, spin=2 * math.pi, every=20)
    return outcome(solution, conserved(solution), drift(solution, 2 * math.pi))


@row(
    "revolutions prescribed by a motor",
    "turns",
    "position of the end of a beam in steady rotation",
    (1, 10, 100, 1000),
)
def motor_turns(turns):
    """An arm on a motor; its vibrations decay until it turns steadily; 20 steps a turn."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=1.0, rhoI=1e-3)
    arm = ub.Beam((0, 0), (1, 0), section, cells=2)
    # From rest within the first second: φ = π t², then steadily
    motor = ub.PrescribedMotion(lambda t: math.pi * t**2 if t < 1 else 2 * math.pi * (t - 0.5))
    scene = ub.Scene(
        [arm],
        joints=[ub.Revolute(arm.start, ub.ground(0, 0))],
        connectors=[ub.Turn(ub.ground(0, 0), arm.start, motor)],
    )
    steps = int(20 * (turns + 2))
    solution = ub.simulate(scene, ub.EnergyMomentum(0.2), t=(0, turns + 2), dt=1 / 20, every=steps)
    φ = 2 * math.pi * (turns + 1.5)
    u, v, _ = solution.displacement(arm.end)[-1]
    place = np.array([1 + u, v]) - np.array([math.cos(φ), math.sin(φ)])
    # It is stretched by ρA ω² L³/3EA = 1.3e-5, and more by what vibrates after two turns still.
    return outcome(solution, float(np.abs(place).max()), 5e-5)


@row(
    "number of steps",
    "steps",
    "energy, momentum and angular momentum of free flight, relative",
    (1e3, 1e4, 1e5, 1e6),
    seconds=900,
)
def many_steps(steps):
    """A free beam of one cell flies slowly and spins, 1000 steps a turn."""
    steps, slow = int(steps), (1e-3, 2e-3)
    solution = flight(1, steps=steps, dt=0.002, spin=math.pi, linear=slow, every=steps // 100)
    return outcome(solution, conserved(solution), drift(solution))


@row(
    "neighbouring masses",
    "ratio of both masses",
    "midpoint rule for three masses on massless bars, linear algebra",
    (0.0, *DECADES),
)
def masses(ratio):
    """Masses 1, ratio and 1 kg at the joints of bars in a line, pulled at the end; 200 steps."""
    section = ub.Section(EA=100.0, GA=100.0, EI=1.0)
    bar = ub.Beam((0, 0), (3, 0), section, cells=3)
    sizes = np.array([1.0, ratio, 1.0])
    places = [bar.at(k / 3) for k in (1, 2, 3)]
    scene = ub.Scene(
        [bar],
        supports=[ub.Clamped(bar.start)],
        masses=[ub.PointMass(p, m, 1.0) for p, m in zip(places, sizes, strict=True) if m > 0],
        loads=[ub.PointLoad(bar.end, force=(1.0, 0.0))],
    )
    dt, steps = 0.1, 200
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, steps * dt), dt=dt)
    got = np.array([solution.displacement(p)[:, 0] for p in places]).T
    K = 100.0 * (np.diag([2.0, 2.0, 1.0]) - np.diag([1.0, 1.0], 1) - np.diag([1.0, 1.0], -1))
    M, f = np.diag(sizes), np.array([0.0, 0.0, 1.0])
    # What has no mass is at the mean of both ends of a step in equilibrium.
    u, v, expected = np.zeros(3), np.zeros(3), [np.zeros(3)]
    A = 2 / dt**2 * M + K / 2
    for _ in range(steps):
        way = np.linalg.solve(A, f - K @ u + 2 / dt * M @ v)
        u, v = u + way, 2 / dt * way - v
        expected.append(u)
    error = np.abs(got - np.array(expected)).max() / np.abs(expected).max()
    return outcome(solution, float(error), 1e-8)


@row(
    "impulses",
    "impulse / impulse that deflects the beam by its length",
    "momentum of a free beam, relative to the impulse",
    (1e-300, 1e-200, 1e-100, 1e-12, 1e-6, 1e-3, 1.0, 10.0, 1e3, 1e6),
    stops=("a node turns by", "no equilibrium after t"),
)
def impulses(size):
    """A force across the end of a free beam, for one step of a hundred."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    dt = 2.0**-10
    hit = ub.PointLoad(beam.end, force=(0.0, size / dt), amplitude=lambda t: float(t < dt))
    solution = ub.simulate(
        ub.Scene([beam], loads=[hit]), ub.EnergyMomentum(), t=(0, 100 * dt), dt=dt
    )
    gained = solution.momentum()[1:, 1]
    error = float(np.abs(gained / size - 1).max())
    return outcome(solution, error, 1e-9)


@row(
    "nearly singular: a flat toggle",
    "angle of the bars, rad",
    "force of two bars that snap through, closed form",
    tuple(10.0**-k for k in range(1, 8)),
)
def toggle(angle):
    """Two bars of 1 m, EA = 1 N, their top moved down by twice its height."""
    bar = ub.Section(EA=1.0, GA=1.0, EI=1.0)
    x, y = math.cos(angle), math.sin(angle)
    left = ub.Beam((-x, 0), (0, y), bar, cells=1)
    right = ub.Beam((x, 0), (0, y), bar, cells=1)
    scene = ub.Scene(
        [left, right],
        joints=[ub.Revolute(left.end, right.end)],
        supports=[
            ub.Pinned(left.start),
            ub.Pinned(right.start),
            ub.PrescribedDisplacement(left.end, u=0, v=lambda t: -2 * y * t),
        ],
    )
    steps = 16
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / steps)
    height = y * (1 - 2 * solution.times)
    length = np.hypot(x, height)
    # sqrt(x² + h²) - 1 without loss of digits
    stretch = (height**2 - y**2) / (length + 1)
    expected = 2 * stretch * height / length
    got = solution.reaction(scene.supports[2])[1:, 1]
    error = float(np.abs(got - expected[1:]).max() / np.abs(expected).max())
    # Met to 1e-10 of the forces in the bars, larger by 1/angle, in a norm of all. Strains are
    # y²/2 and less; a half of the last digit of one is all that a length has.
    return outcome(solution, error, 1e-9 / angle + 10 * EPS / angle**2)


@row(
    "nearly singular: close to buckling",
    "1 - P/P_cr",
    "amplification of a small lateral load, linear algebra of the same cells",
    (0.5, 0.1, 1e-2, 1e-3, 1e-4),
)
def buckling(distance):
    """A cantilever of 8 cells under an axial load and a lateral one of 1e-9."""
    section = ub.Section(EA=1e8, GA=1e8, EI=1.0)
    n, h = 8, 1 / 8
    # Two-node cells with one point: EI Δ²ψ/h + P h (ψ_i average) = 0, a clamped and a free end.
    # Rotations ψ_k = sin(k θ): 4 (EI/h²) tan²(θ/2) = P, n θ = π/2.
    critical = 4 / h**2 * math.tan(math.pi / (4 * n)) ** 2
    # P of the undeformed length; compressed by P/EA = 2.5e-8, the shear adds as much.
    beam = ub.Beam((0, 0), (1, 0), section, cells=n)
    push = ub.PointLoad(beam.end, force=(-critical * (1 - distance), 0), amplitude=ub.ramp(1.0))
    side = ub.PointLoad(beam.end, force=(0, 1e-9), amplitude=ub.ramp(1.0))
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[push, side])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1)
    expected = _discrete_deflection(n, critical * (1 - distance), 1e-9)
    error = abs(solution.displacement(beam.end)[-1, 1] / expected - 1)
    # P/EA over the distance: the shortened column; 1e-10 of forces over the lateral one.
    return outcome(solution, error, 1e-6 + 1e-7 / distance)


def _discrete_deflection(n, P, Q):
    """Deflection of the end by linear algebra of the rotations of the same cells."""
    h = 1 / n
    K = np.zeros((n + 1, n + 1))
    f = np.zeros(n + 1)
    for i in range(n):
        d, m = np.zeros(n + 1), np.zeros(n + 1)
        d[[i, i + 1]], m[[i, i + 1]] = (-1, 1), 0.5
        K += np.outer(d, d) / h - P * h * np.outer(m, m)
        f += Q * h * m
    ψ = np.r_[0.0, np.linalg.solve(K[1:, 1:], f[1:])]
    return h * ((ψ[1:] + ψ[:-1]) / 2).sum()


@row(
    "gravity",
    "acceleration / 9.81 m/s²",
    "elongation of a hanging bar, ρA g L²/(2 EA)",
    (1e-300, 1e-100, 1e-12, 1e-6, 1.0, 1e3, 1e6),
)
def gravity(ratio):
    """A bar of 1 m hangs; at 1 g it is stretched by 4.9e-9."""
    section = ub.Section(EA=1e9, GA=1e9, EI=1e5, rhoA=1.0)
    bar = ub.Beam((0, 0), (0, -1), section, cells=8)
    g = 9.81 * ratio
    scene = ub.Scene(
        [bar],
        supports=[ub.Clamped(bar.start)],
        loads=[ub.Gravity((0.0, -g), amplitude=ub.ramp(1.0))],
    )
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.5)
    expected = g / 2e9
    error = abs(-solution.displacement(bar.end)[-1, 1] - expected) / max(expected, 8 * EPS)
    # A stretch has the digits of the length.
    return outcome(solution, float(error), 1e-9 + EPS / max(expected, 8 * EPS))


@row(
    "release of a rolled-up beam",
    "initial rotation of the end, revolutions",
    "energy, relative to the energy stored initially",
    (0.1, 0.5, 1.0, 2.0, 4.0),
    stops=("a node turns by", "no equilibrium after t"),
)
def released(turns):
    """A cantilever rolled up by a moment in statics, let go at once in dynamics; 200 steps."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-4)
    beam = ub.Beam((0, 0), (1, 0), section, cells=16)
    θ = 2 * math.pi * turns
    scene = ub.Scene(
        [beam],
        supports=[ub.Clamped(beam.start)],
        loads=[ub.PointLoad(beam.end, moment=θ, amplitude=lambda t: t if t <= 1 else 0.0)],
    )
    rolled_up = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / 32)
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(1, 1.4), dt=0.002, start=rolled_up)
    energy = solution.energy
    error = float(np.abs(energy.total - θ**2 / 2).max() / (θ**2 / 2))
    # The roll is in equilibrium to 1e-10.
    return outcome(solution, max(error, energy.worst), 1e-8)


@row(
    "speed of free flight",
    "speed of the end / speed of axial waves",
    "energy and momenta of free flight, relative",
    (1e-6, 1e-3, 1e-1, 1.0, 10.0, 100.0),
    stops=("a node turns by", "no equilibrium after t"),
)
def fast(ratio):
    """A free beam is given a spin; 50 steps of 1/100 turn."""
    spin = ratio * 200.0
    solution = flight(4, steps=50, dt=0.0628 / spin, spin=spin)
    return outcome(solution, conserved(solution), drift(solution, spin))


def machine(metre, kilogram, second):
    """A softening frame with a body, a spring, a damper, in other units; places to compare."""
    N, J = kilogram * metre / second**2, kilogram * metre**2 / second**2
    hinge = ub.Softening(limit=2.0 * J, fracture_energy=0.5 * J)
    column = ub.Section(
        EA=1e4 * N, GA=4e3 * N, EI=10.0 * J * metre, rhoA=1.0 * kilogram / metre,
        rhoI=1e-3 * kilogram * metre, hinge=hinge,
    )  # fmt: skip
    law = ub.ElastoPlastic(
        yield_limit=1.5 * J,
        isotropic=1.0 * J * metre,
        viscosity=ub.Perzyna(0.1 * J * metre * second),
    )
    girder = ub.Section(
        EA=1e4 * N, GA=4e3 * N, EI=10.0 * J * metre, rhoA=1.0 * kilogram / metre,
        rhoI=1e-3 * kilogram * metre, bending=law,
    )  # fmt: skip
    m = metre
    left = ub.Beam((0, 0), (0, 1 * m), column, cells=4)
    roof = ub.Beam((0, 1 * m), (1.5 * m, 1 * m), girder, cells=4)
    body = ub.Body((1.6 * m, 0.9 * m), mass=0.5 * kilogram, inertia=0.01 * kilogram * m**2)
    push = ub.PointLoad(left.end, force=(30.0 * N, 0.0), amplitude=ub.ramp(0.2 * second))
    spring = ub.Stretch(ub.ground(1.5 * m, 0), roof.end, ub.Spring(50.0 * N / m))
    damper = ub.Stretch(ub.ground(2 * m, 0), body.middle, ub.Damper(2.0 * N * second / m))
    return ub.Scene(
        [left, roof],
        bodies=[body],
        joints=[ub.Rigid(left.end, roof.start), ub.Revolute(roof.end, body.at(1.5 * m, 1 * m))],
        connectors=[spring, damper],
        supports=[ub.Clamped(left.start)],
        loads=[push, ub.Gravity((0, -9.81 * m / second**2))],
    )


@row(
    "units",
    "metre, kilogram or second in other units",
    "displacements and ledger of the same frame in SI, relative to their largest values",
    tuple((name, 10.0**k) for name in ("m", "kg", "s") for k in (-12, -6, 6, 12)),
)
def units(unit):
    """A frame that yields, flows and breaks, 60 steps."""
    name, factor = unit
    scale = {"m": 1.0, "kg": 1.0, "s": 1.0, name: factor}
    metre, second = scale["m"], scale["s"]
    joule = scale["kg"] * metre**2 / second**2

    def run(metre, kilogram, second):
        scene = machine(metre, kilogram, second)
        return ub.simulate(
            scene, ub.EnergyMomentum(0.1, 0.1), t=(0, 0.6 * second), dt=0.01 * second
        )

    si, other = run(1.0, 1.0, 1.0), run(metre, scale["kg"], second)
    parts = []
    for one, two in zip(si.scene.beams, other.scene.beams, strict=True):
        a, b = si.displacement(one.end), other.displacement(two.end) / [metre, metre, 1.0]
        parts.append(np.abs(a - b).max() / np.abs(a).max())
    for name, values in {**si.energy.state, **si.energy.lost}.items():
        parts.append(
            np.abs(values - other.energy[name] / joule).max() / si.energy.energy_transferred
        )
    # Both are solved to 1e-10 of the forces, and errors grow with the motion.
    return outcome(other, float(max(parts)), 1e-7)
