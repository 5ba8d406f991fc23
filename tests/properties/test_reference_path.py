# SPDX-License-Identifier: MIT
"""The compiled path and the reference path find the same motions, forces and energies.

They share the records of a scene, the numbering, the time scheme and the algebra of vectors.  What
C evaluates in one, DOLFINx, NumPy and PETSc evaluate in the other: forms, return maps, laws of
connectors, factorization, Newton's method.
"""

from mpi4py import MPI

import numpy as np
import pytest
from any_scene import STEPS, script

import ufl_beam as ub
from ufl_beam.discretization.dolfinx_forms import DolfinxForm
from ufl_beam.solvers.direct_solver import DirectSolver
from ufl_beam.terms.connectors import ReferenceCouplings
from ufl_beam.terms.reference_points import ReferencePoints
from ufl_beam.terms.reference_slips import ReferenceSlips

WANDERING = (1, 19, 25, 26, 32, 36, 38, 45)
"""Scenes in whose steps Newton's method wanders, so that round-off decides where a step is cut.

In 1 and 45 that of the reference path needs more cuts: its points choose between flow and elastic
response by strains.
"""

SEEDS = [seed for seed in range(48) if seed not in WANDERING]
"""Scenes that have, between them, every object, law and scheme that `any_scene` draws."""

SAME = 1e-9
"""Difference as a part of the largest motion or force, or of the energy that went through.

Newton's method stops at 1e-12 of the forces; conditions of the scenes magnify that up to a thousand
times in 15 steps.
"""

pytestmark = pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")


def run(seed, *, reference):
    """The solution of a scene, as far as it goes."""
    names = {}
    exec(script(seed), names)
    newton = ub.Newton(rtol=1e-12, reference=reference)
    scene, scheme, times = (names[name] for name in ("scene", "scheme", "times"))
    try:
        return ub.simulate(
            scene, scheme, t=times, dt=names["dt"], mesh=names["mesh"], newton=newton
        )
    except ub.ConvergenceError as error:
        return error.solution


def difference(a, b):
    """Largest difference, as a part of the largest size."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    return np.abs(a - b).max(initial=0.0) / (np.abs(b).max(initial=0.0) or 1.0)


def differences(compiled, reference):
    """Largest differences of all kinds of results, by name."""
    found = {"times": difference(compiled.times, reference.times)}
    found["motions and forces"] = difference(compiled.q, reference.q)
    mine, others = (_forces(solution) for solution in (compiled, reference))
    for name, part in (("forces", slice(0, 2)), ("moments", slice(2, 3))):
        found[name] = difference(mine[..., part], others[..., part])
    through = reference.energy.throughput or 1.0
    for kind in ("state", "supplied", "lost"):
        mine, others = getattr(compiled.energy, kind), getattr(reference.energy, kind)
        assert set(mine) == set(others)
        for name in mine:
            found[name] = np.abs(mine[name] - others[name]).max() / through
    return found


def _forces(solution):
    """Reactions, and forces and moments in two cells of each beam, at all times."""
    places = [beam.at(s) for beam in solution.scene.beams for s in (0.3, 0.8)]
    reactions = [solution.reaction(support) for support in solution.scene.supports]
    return np.array([*reactions, *(solution.section_forces_at(place) for place in places)])


@pytest.mark.parametrize("seed", SEEDS if MPI.COMM_WORLD.size == 1 else SEEDS[::6])
def test_both_paths_agree(seed):
    found = differences(run(seed, reference=False), run(seed, reference=True))
    assert max(found.values()) < SAME, {k: v for k, v in found.items() if not v < SAME}


@pytest.mark.serial
@pytest.mark.parametrize("seed", SEEDS)
def test_residuals_and_tangents_agree(seed):
    """Somewhere off equilibrium, so that nothing hides behind a converged solution."""
    names = {}
    exec(script(seed), names)
    found = []
    for reference in (False, True):
        simulation = ub.Simulation(
            names["scene"], names["scheme"], mesh=names["mesh"], comm=MPI.COMM_SELF,
            newton=ub.Newton(rtol=1e-12, reference=reference),
        )  # fmt: skip
        t0, dt = names["times"][0], (names["times"][1] - names["times"][0]) / STEPS
        simulation.step_to(t0 + dt)
        x = simulation.supports.in_axes(simulation.q + step(simulation.share))
        simulation.ask()
        simulation.equation.begin(
            names["scheme"].step(t0 + dt, t0 + 2 * dt, t0 + 2 * dt, simulation.q)
        )
        r = np.empty(len(x))
        simulation.equation.residual(x, r)
        simulation.equation.tangent(x)
        found.append((r, simulation.equation.A.data.copy()))
        simulation.close()
    for compiled, reference in zip(*found, strict=True):
        # States of both differ by the tolerance of one step.
        assert difference(compiled, reference) < SAME


def step(share):
    """Motions and forces at random, small enough that no node turns far."""
    random = np.random.default_rng(5)
    return 1e-3 * share.grid.scene.size * random.uniform(-1, 1, share.size)


@pytest.mark.serial
def test_the_scenes_have_everything():
    """The seeds above leave out nothing that hundreds of scenes have."""

    def names(seeds):
        words = " ".join(script(seed) for seed in seeds).split("ub.")[1:]
        return {word.split("(")[0] for word in words}

    assert names(SEEDS) == names(range(200))


# -- mistakes that are found ---------------------------------------------------------------------


def sign_of_jump(patch):
    """A hinge that opens adds to the strain of the bulk."""
    flow = ReferencePoints._flow

    def wrong(self, at):
        return flow(self, {**at, "jump": -at["jump"]})

    patch.setattr(ReferencePoints, "_flow", wrong)


def hardening_twice(patch):
    """Accumulated plastic strain counts twice."""
    commit = ReferencePoints._commit

    def wrong(self, storage, e0, kept):
        before = self._state(storage)["state accumulated"].copy()
        sums = commit(self, storage, e0, kept)
        accumulated = self._state(storage)["state accumulated"]
        accumulated += accumulated - before
        return sums

    patch.setattr(ReferencePoints, "_commit", wrong)


def factor_of_forms(patch):
    """Forms on cells are too large by a part in a million."""
    add = DolfinxForm.add

    def wrong(self, q, b):
        before = b.copy()
        add(self, q, b)
        b += 1e-6 * (b - before)

    patch.setattr(DolfinxForm, "add", wrong)


def motion_of_connectors(patch):
    """Relative motions are too large by a part in a million."""
    motion = ReferenceCouplings.motion
    patch.setattr(ReferenceCouplings, "motion", lambda self, q: (1 + 1e-6) * motion(self, q))


def limit_of_slips(patch):
    """Plastic hinges of zero length slip at a limit that is too small."""
    rows = ReferenceSlips.rows

    def wrong(self, e1, λ):
        self._limit *= 0.9
        try:
            return rows(self, e1, λ)
        finally:
            self._limit /= 0.9

    patch.setattr(ReferenceSlips, "rows", wrong)


def energy_of_points(patch):
    """What points dissipate is entered with the wrong sign."""
    commit = ReferencePoints._commit

    def wrong(self, storage, e0, kept):
        return commit(self, storage, e0, kept) * [-1, 1, 1, 1, 1, 1, 1]

    patch.setattr(ReferencePoints, "_commit", wrong)


def solution_of_tangent(patch):
    """Corrections are a part in ten too small; convergence to 1e-12 makes up for it."""
    apply = DirectSolver.apply

    def wrong(self, pc, b, x):
        apply(self, pc, b, x)
        x.scale(0.9)

    patch.setattr(DirectSolver, "apply", wrong)


MISTAKES = [
    sign_of_jump, hardening_twice, factor_of_forms, motion_of_connectors, limit_of_slips,
    energy_of_points,
]  # fmt: skip


def yielding():
    """A frame with fibres that crack, a hinge in cells, one of zero length, springs and a motor."""
    fibres = ub.Fibres(
        ub.Hardening(2e5, modulus=1e7), number=4, softening=ub.Softening(2.5e5, energy=40.0)
    )
    cracking = ub.Section.rectangle(0.1, 0.1, E=1e8, nu=0.2, rho=1e3, fibres=fibres)
    both = ub.Section(
        EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01, bending=ub.Hardening(30.0, modulus=80.0),
        hinge=ub.Softening(40.0, energy=15.0),
    )  # fmt: skip
    left = ub.Beam((0, 0), (0, 1), cracking, cells=3)
    roof = ub.Beam((0, 1), (1, 1.2), both, cells=3)
    right = ub.Beam(
        (1, 1.2), (1.3, 0), ub.Section(EA=1e6, GA=4e5, EI=800.0, rhoA=10.0, rhoI=0.01), cells=2,
        hinges={0.5: ub.Softening(20.0, energy=5.0)},
    )  # fmt: skip
    spring = ub.Spring(3e3, law=ub.Hardening(40.0, modulus=100.0))
    return ub.Scene(
        [left, roof, right],
        joints=[ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.start)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        connectors=[ub.Stretch(left.start, roof.end, spring)],
        loads=[ub.PointLoad(roof.at(1 / 3), force=(900.0, -700.0), time=ub.ramp(0.1))],
    )


def simulated(reference):
    newton = ub.Newton(rtol=1e-12, reference=reference)
    return ub.simulate(yielding(), ub.Midpoint(0.1), t=(0, 0.12), dt=2e-3, newton=newton)


@pytest.fixture(scope="module")
def compiled():
    """The scene with everything that yields, computed in C."""
    return simulated(reference=False)


def test_everything_yields(compiled):
    """That the mistakes below can show."""
    lost = compiled.energy.lost
    assert lost["plastic"][-1] > 1.0
    assert lost["hinges"][-1] > 1.0
    assert max(differences(compiled, simulated(reference=True)).values()) < SAME


@pytest.mark.serial
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_found(mistake, compiled, monkeypatch):
    mistake(monkeypatch)
    try:
        found = simulated(reference=True)
    except ub.ConvergenceError as error:
        found = error.solution
    if len(found.times) == len(compiled.times):
        assert max(differences(compiled, found).values()) > SAME


@pytest.mark.serial
def test_an_inexact_tangent_is_no_mistake(compiled, monkeypatch):
    """Only the number of iterations tells it."""
    solution_of_tangent(monkeypatch)
    assert max(differences(compiled, simulated(reference=True)).values()) < SAME
