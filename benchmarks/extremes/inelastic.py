# SPDX-License-Identifier: MIT
"""Rows of scenes that yield, flow and break."""

import math

import numpy as np
from rows import EPS, LEDGER, outcome, row
from scipy.optimize import brentq

import ufl_beam as ub

STEPS = 400
"""Of a bar that is pulled at a constant rate."""


def pulled(viscosity):
    """A bar of 1 m, C = 1 N, limit 0.5 N, hardening 0.25 N, stretched by 1 in 1 s; statics."""
    law = ub.ElastoPlastic(yield_limit=0.5, isotropic=0.25, viscosity=viscosity)
    section = ub.Section(EA=1.0, GA=1.0, EI=1.0, axial=law)
    bar = ub.Beam((0, 0), (1, 0), section, cells=1)
    pull = ub.PrescribedDisplacement(bar.end, u=lambda t: t, v=0, psi=0)
    scene = ub.Scene([bar], supports=[ub.Clamped(bar.start), pull])
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1 / STEPS)
    return solution, solution.reaction(pull)[1:, 0]


def drawn(η, t):
    """Force in the bar in closed form; C = 1, limit 0.5, H = 0.25.

    From t = 0.5 on η dp/dt = (t - p) - (0.5 + 0.25 p), a linear equation with the rate 1.25/η.
    """
    if η == math.inf:
        return t
    late = np.maximum(t - 0.5, 0.0)
    if η == 0.0:
        return t - late / 1.25
    x = 1.25 * late / η
    # p = (late - (η/1.25) (1 - exp(-x))) / 1.25, by its series where x is small
    part = np.where(x < 1e-5, late * x / 2, late + np.expm1(-np.minimum(x, 700.0)) * η / 1.25)
    return t - part / 1.25


VISCOSITIES = (0.0, 1e-300, 1e-12, 1e-6, 1e-3, 1e-1, 1.0, 1e2, 1e6, 1e12, 1e300, math.inf)


@row(
    "Perzyna's viscosity",
    "η / (C × duration)",
    "force of a bar at a constant strain rate, closed form",
    VISCOSITIES,
)
def perzyna(η):
    """Backward Euler."""
    solution, got = pulled(ub.Perzyna(η))
    error = float(np.abs(got - drawn(η, solution.times[1:])).max())
    # First order: in one step the overstress changes by at most C Δε; exact at both ends.
    exact = η < 1e-10 or η > 1e10
    return outcome(
        solution,
        error,
        1e-9 + (2 * min(η, 1 / η) if exact and η > 0 else 0) + (0 if exact else 0.5 / STEPS),
    )


@row(
    "Duvaut and Lions' relaxation",
    "τ / duration",
    "force of a bar at a constant strain rate, closed form with η = τ (C + H)",
    VISCOSITIES,
)
def duvaut_lions(τ):
    """Backward Euler."""
    solution, got = pulled(ub.DuvautLions(τ))
    η = τ * 1.25 if τ < 1e299 else math.inf
    error = float(np.abs(got - drawn(η, solution.times[1:])).max())
    exact = τ < 1e-10 or τ > 1e10
    return outcome(
        solution,
        error,
        1e-9 + (2 * min(τ, 1 / τ) if exact and τ > 0 else 0) + (0 if exact else 0.5 / STEPS),
    )


def bent(hinge, scheme=None, cells=1):
    """A cantilever, EI/L = 1 N m, a hinge in its first cell, its end turned by 1 rad."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells, hinges={0.0: hinge})
    turn = ub.PrescribedDisplacement(beam.end, psi=lambda t: t)
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start), turn])
    solution = ub.simulate(scene, scheme or ub.Static(), t=(0, 1), dt=1 / 50)
    return solution, solution.reaction(turn)[1:, 2]


def softened(limit, energy, ψ):
    """Moment of that beam in closed form: ψ = M + ξ, M = limit exp(-limit/energy ξ)."""
    if limit >= ψ:
        return ψ
    return ψ - brentq(lambda ξ: ψ - ξ - limit * math.exp(-limit / energy * ξ), 0.0, ψ, xtol=1e-15)


@row(
    "fracture energy, statics",
    "energy / (limit² L/EI), below which softening snaps back",
    "moment of a beam with a prescribed rotation of its end, closed form",
    tuple(10.0**k for k in range(-6, 7)),
    stops=("softening snaps back",),
)
def fracture(ratio):
    """Limit 0.5 N m at EI/L = 1 N m."""
    energy = 0.25 * ratio * 1.001
    solution, got = bent(ub.Softening(limit=0.5, fracture_energy=energy))
    expected = [softened(0.5, energy, t) for t in solution.times[1:]]
    error = float(np.abs(got - expected).max())
    # 1e-10 of forces; at the limit of snap-back the tangent is a thousandth of EI/L.
    return outcome(solution, error, 1e-6 if ratio == 1.0 else 1e-8)


@row(
    "fracture energy, dynamics",
    "energy / (limit² L/EI), below which softening snaps back",
    "ledger; dissipation of at most the energy of the hinge",
    (1e-300, 1e-100, *(10.0**k for k in range(-6, 7)), 1e300),
    stops=("a node turns by", "no equilibrium after t"),
)
def fracture_in_motion(ratio):
    """A cantilever with a mass, hit so that it breaks; 200 steps."""
    hinge = ub.Softening(limit=0.5, fracture_energy=0.25 * ratio)
    solution = struck(hinge, cells=4)
    return ledger_of_hinges(solution, 0.25 * ratio, 4)


def struck(hinge, cells, steps=200):
    """A cantilever with a hinge in every cell and a mass at its end, hit."""
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=0.1, rhoI=1e-4, hinge=hinge)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    hit = ub.PointLoad(beam.end, force=(0.0, 10.0), amplitude=lambda t: float(t < 0.1))
    scene = ub.Scene(
        [beam],
        supports=[ub.Clamped(beam.start)],
        masses=[ub.PointMass(beam.end, 1.0, 0.01)],
        loads=[hit],
    )
    return ub.simulate(scene, ub.EnergyMomentum(0.05, 0.05), t=(0, 0.005 * steps), dt=0.005)


def ledger_of_hinges(solution, energy, hinges, note=""):
    """The ledger must close, and hinges dissipate no more than they can."""
    spent = float(solution.energy.lost["hinges"][-1]) if "hinges" in solution.energy.lost else 0.0
    beyond = max(spent / (hinges * energy) - 1, 0.0)
    throughput = solution.energy.energy_transferred
    beyond *= hinges * energy / throughput  # as a part of what went through
    return outcome(solution, max(solution.energy.worst, beyond), LEDGER, note)


@row(
    "limit of a hinge, statics",
    "M_u / moment of the elastic beam",
    "moment of a beam with a prescribed rotation of its end, closed form",
    (0.0, 1e-300, 1e-100, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 1.0, 1e3, 1e12, 1e300, math.inf),
    stops=("or is too long to tell",),
)
def limit(size):
    """Energy 10 J at EI/L = 1 N m; an infinite limit is an elastic beam."""
    solution, got = bent(ub.Softening(limit=size, fracture_energy=10.0))
    expected = [softened(size, 10.0, t) for t in solution.times[1:]]
    return outcome(solution, float(np.abs(got - expected).max()), 1e-8)


@row(
    "limit of a hinge, dynamics",
    "M_u / (EI/L)",
    "ledger; dissipation of at most the energy of the hinges",
    (0.0, 1e-300, 1e-100, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 1e3, 1e300, math.inf),
    stops=("a node turns by", "no equilibrium after t"),
)
def limit_in_motion(size):
    """A cantilever with a mass, hit; four hinges of 1 J."""
    return ledger_of_hinges(struck(ub.Softening(limit=size, fracture_energy=1.0), cells=4), 1.0, 4)


@row(
    "hinge without resistance",
    "cells of a clamped beam with M_u = 0 at the clamp",
    "the same beam on a pinned support",
    (8, 32, 128, 512),
)
def perfect_joint(cells):
    """A beam clamped by a perfect hinge falls like one that is pinned; 100 steps."""
    section = ub.Section(EA=1e6, GA=1e6, EI=1e3, rhoA=1.0, rhoI=1e-3)
    ends = []
    for hinges, held in (
        ({0.0: ub.Softening(limit=0.0, fracture_energy=1.0)}, ub.Clamped),
        ({}, ub.Pinned),
    ):
        beam = ub.Beam((0, 0), (1, 0), section, cells=cells, hinges=hinges)
        scene = ub.Scene([beam], supports=[held(beam.start)], loads=[ub.Gravity()])
        solution = ub.simulate(scene, ub.EnergyMomentum(0.1, 0.1), t=(0, 1), dt=0.01)
        ends.append(solution.displacement(beam.end)[:, :2])
    error = float(np.abs(ends[0] - ends[1]).max())
    return outcome(solution, error, 1e-9)


@row(
    "a hinge in each cell",
    "cells",
    "ledger; dissipation of at most the energy of the hinges",
    (1, 8, 64, 512, 4096),
    stops=("a node turns by", "no equilibrium after t"),
    seconds=300,
)
def every_cell(cells):
    """A free beam bent by moments at both ends, suddenly, far beyond the limit of all; 10 steps."""
    cells = int(cells)
    hinge = ub.Softening(limit=1e-3, fracture_energy=1.0)
    section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1.0, hinge=hinge)
    beam = ub.Beam((0, 0), (1, 0), section, cells=cells)
    # Along the beam the moment load is such that all cells are bent alike: each rotates s.
    loads = [ub.PointLoad(beam.end, moment=1.0), ub.PointLoad(beam.start, moment=-1.0)]
    scene = ub.Scene([beam], loads=loads)
    solution = ub.simulate(scene, ub.EnergyMomentum(0.1, 0.1), t=(0, 0.02), dt=0.002)
    jumps = [solution.material_at(beam.at((i + 0.5) / cells)).jump[-1] for i in (0, cells // 2)]
    opened = int(np.count_nonzero(jumps))
    return ledger_of_hinges(solution, 1.0, cells, note=f"{opened} of 2 sampled cells opened")


@row(
    "neighbouring yield moments",
    "ratio of the yield moments of two beams",
    "ledger",
    (0.0, 1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e12, math.inf),
    stops=("a node turns by", "no equilibrium after t"),
)
def neighbours(ratio):
    """Two beams that yield, one at so many times the moment of the other, hit; 100 steps."""
    parts = []
    for k, size in enumerate((0.1, 0.1 * ratio)):
        law = ub.ElastoPlastic(yield_limit=size, isotropic=0.1)
        section = ub.Section(EA=1e4, GA=1e4, EI=1.0, rhoA=1.0, rhoI=1e-3, bending=law)
        parts.append(ub.Beam((k, 0), (k + 1, 0), section, cells=4))
    one, two = parts
    hit = ub.PointLoad(two.end, force=(0.0, 10.0), amplitude=lambda t: float(t < 0.1))
    scene = ub.Scene(
        parts,
        joints=[ub.Rigid(one.end, two.start)],
        supports=[ub.Clamped(one.start)],
        loads=[hit],
    )
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.5), dt=0.005)
    return outcome(solution, solution.energy.worst, LEDGER + 100 * EPS)
