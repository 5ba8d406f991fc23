# SPDX-License-Identifier: MIT
"""Tangents against central differences of the residuals, at random states, for all terms."""

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from helpers import in_turn
from scipy.sparse import csr_array

import ufl_beam as ub

# Numbers of one magnitude, so that an error in any term shows in the largest entry.
SECTION = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0)
OTHER = ub.Section(EA=30.0, GA=50.0, EI=20.0, rhoA=0.0)
"""Without inertia."""


KINDS = ["follower", "roller", "masses", "moved", "works"]


def scene(*kinds):
    """Three beams, with the terms of these kinds."""
    a = ub.Beam((0, 0), (1, 2), SECTION, cells=2, name="a")
    b = ub.Beam.arc((0, 2), 1.0, (0, 2), OTHER, cells=3, name="b")
    c = ub.Beam((1, 2), (2, 2), SECTION, cells=2, name="c")
    loads = [ub.PointLoad(b.end, force=(3, 4)), ub.Gravity(), ub.LineLoad(c, force=(1, 2))]
    foot, slide, parts = ub.Clamped(a.start), ub.Roller(c.end), {}
    if "follower" in kinds:
        loads += [
            ub.FollowerLoad(b.at(1 / 3), force=(20, -30), moment=7),
            ub.FollowerLoad(c.start, force=(-10, 20)),
            ub.Pressure(b, 20.0, -30.0, profile=(0.5, 2.0)),
        ]
    if "roller" in kinds:
        slide = ub.Roller(c.end, along=(2, 1))
    if "masses" in kinds:
        parts["masses"] = [ub.PointMass(c.start, 3.0, 2.0), ub.PointMass(b.end, 1.0)]
    if "moved" in kinds:
        motion = {"u": lambda t: 0.1 * t, "v": 0, "psi": lambda t: 0.3 * t}
        foot = ub.PrescribedDisplacement(a.start, **motion)
    if "works" in kinds:
        parts["works"] = works_of(b)
    joints = [ub.Rigid(a.end, b.start), ub.Revolute(a.end, c.start)]
    return ub.Scene([a, b, c], joints=joints, supports=[foot, slide], loads=loads, **parts)


def works_of(beam):
    """A potential and a work that depend on all that there is."""

    def energy(q, axis, t, k):
        turned = (1 + axis.x[0] ** 2) * ufl.sin(q[2] + t)
        return k * q[0] ** 2 * q[1] + k * turned + k * axis.d(q[2]) ** 4 * q[1] ** 2

    def work(q0, q1, q, v, w, axis, t, dt, c):
        force = c * (v[0] ** 2 + v[1] ** 2 + 1) ** 0.5 * (1 + q[2] ** 2 + dt * q0[0] * q1[0])
        return t * force * (v[0] * w[0] + v[1] * w[1]) + q1[0] * axis.d(q1[1]) * axis.d(w[2])

    return [
        ub.Potential("potential", energy, numbers={"k": lambda t: 20.0 + t}),
        ub.VirtualWork("work", work, beams=[beam], numbers={"c": 20.0}),
    ]


SCHEMES = [
    ub.Static(),
    ub.EnergyMomentum(),
    ub.EnergyMomentum(0.1, 0.1),
    ub.EnergyMomentum(alpha=0.5),
    ub.EnergyMomentum(beta=0.5),
    ub.EnergyMomentumPrinted(),
    ub.EnergyMomentumDecaying(),
    ub.Newmark(0.6, 0.35),
    ub.GeneralizedAlpha(0.6),
]


class Probe:
    """Residual and tangent of a step between random states, without what supports hold."""

    def __init__(self, scene, scheme, turn, seed=0, mesh=None, newton=None):
        random = np.random.default_rng(seed)
        # Every process computes the whole scene.
        self.simulation = simulation = ub.Simulation(
            scene, scheme, mesh=mesh, newton=newton, comm=MPI.COMM_SELF
        )
        size = simulation.subdomain.size
        simulation._q = random.uniform(-0.5, 0.5, size)
        if scheme.dynamic:
            self.in_motion(simulation, random)
        for inelastic in simulation.inelastic:
            self.at_random(inelastic, random)
        simulation.controllers.evaluate(simulation)
        for term in simulation.terms:
            term.start(simulation.q)
        simulation.equation.begin(ub.extend.Step.create(scheme, 0.0, 0.3, 0.3, simulation.q))
        self.x = simulation.supports.in_axes(simulation.q + random.uniform(-turn, turn, size))
        self.free = np.setdiff1d(np.arange(size), simulation.supports.dofs)

    @staticmethod
    def in_motion(simulation, random):
        """Random velocities and whatever else schemes keep, as after a step."""
        rates = simulation.inertia
        rates.commit(*random.uniform(-1, 1, (2, len(rates.v))), last_dt=0.2)
        rates.keep(*random.uniform(-1, 1, (len(simulation.scheme.further_rates), len(rates.v))))
        for term in simulation.terms:
            if term.effect == "SecondDifferences":
                for name, values in term.state.items():
                    values[:] = 0.2 if name == "last dt" else random.uniform(-1, 1, values.shape)

    @staticmethod
    def at_random(inelastic, random):
        """Random plastic strains, jumps and their sums, the latter at least as large."""
        state = inelastic.points.state()
        n = inelastic.points["state plastic"].shape[1]
        p, jump = random.uniform(-0.5, 0.5, (2, len(state), n))
        if not np.isfinite(inelastic.points["traction"]).any():
            jump[:] = 0.0
        more = random.uniform(0.0, 0.5, (2, len(state), n))
        rows = np.hstack([p, abs(p) + more[0], jump, abs(jump) + more[1], state[:, 4 * n :]])
        inelastic.points.restore(rows)

    def residual(self, x):
        supports = self.simulation.supports
        r = self.simulation.equation.forces(supports.in_plane(x))
        supports.into_axes(r)
        return r[self.free]

    def tangent(self):
        A = self.simulation.equation.A
        self.residual(self.x)  # rows of connectors are those of the latest residual
        for _ in range(2):  # the first tangent of a static step takes the forces before the step
            self.simulation.equation.tangent(self.simulation.supports.in_plane(self.x))
        matrix = csr_array((A.data, A.indices, A.indptr)).toarray()
        return matrix[np.ix_(self.free, self.free)]

    def differences(self, ε):
        columns = []
        for i in self.free:
            e = np.zeros(len(self.x))
            e[i] = ε
            columns.append((self.residual(self.x + e) - self.residual(self.x - e)) / (2 * ε))
        return np.column_stack(columns)


def require_derivative(probe, tolerance=1e-7):
    """Central differences with ε = 1e-5 agree with the tangent.

    ε² of third derivatives and 1e-16/ε of values are 1e-9 and less of the largest entry.
    """
    tangent = probe.tangent()
    assert np.abs(tangent - probe.differences(1e-5)).max() < tolerance * np.abs(tangent).max()


# Works with velocities act in statics, too.
@pytest.mark.filterwarnings("ignore:.*takes v:ufl_beam.ModelWarning")
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_the_tangent_is_the_derivative_of_the_residual(scheme):
    require_derivative(Probe(scene(*KINDS), scheme, turn=1.5))


@pytest.mark.parametrize(
    ("mesh", "scheme", "kinds"),
    [
        (ub.Mesh(degree=2), ub.EnergyMomentum(0.1, 0.1), ["roller", "masses"]),
        (ub.Mesh(degree=3, lumped=True), ub.Static(), ["follower", "roller"]),
    ],
    ids=str,
)
def test_tangent_of_higher_degrees(mesh, scheme, kinds):
    require_derivative(Probe(scene(*kinds), scheme, turn=1.5, mesh=mesh))


@pytest.mark.parametrize("turn", [1e-2, 2.5])
def test_tangent_of_short_and_long_steps(turn):
    """Where x / tan x is a series, and near the limit of the step.

    Third derivatives grow with tan² of half the turn: a hundred times as above at 2.5 rad.
    """
    kinds = "follower", "roller", "masses"
    require_derivative(Probe(scene(*kinds), ub.EnergyMomentum(0.1, 0.1), turn=turn), 1e-6)


@pytest.mark.parametrize("kind", ["follower", "roller", "masses", "works"])
def test_each_term_shows_in_the_tangent(kind):
    """That the comparison above can fail: without the term the tangent is another one."""
    with_term = Probe(scene(kind), ub.EnergyMomentum(), turn=1.5).tangent()
    without = Probe(scene(), ub.EnergyMomentum(), turn=1.5).tangent()
    assert np.abs(with_term - without).max() > 1e-2 * np.abs(without).max()


def test_static_tangent_of_dead_loads_is_symmetric():
    """Elastic beams under dead loads have a potential."""
    tangent = Probe(scene("roller"), ub.Static(), turn=1.0).tangent()
    assert np.abs(tangent - tangent.T).max() < 1e-14 * np.abs(tangent).max()


# -- inelastic material --------------------------------------------------------------------------

VISCOUS = ub.ElastoPlastic(2.0, 5.0, 3.0, ub.Perzyna(0.7))
WEAK = ub.ElastoPlastic(1.0, 2.0, viscosity=ub.Perzyna(0.1))
LAWS = {
    "plastic": {"bending": ub.ElastoPlastic(2.0)},
    "hardening": {"axial": ub.ElastoPlastic(3.0, 4.0), "bending": ub.ElastoPlastic(2.0, 5.0, 3.0)},
    "viscous": {"shear": VISCOUS, "bending": ub.ElastoPlastic(1.0, viscosity=ub.DuvautLions(0.2))},
    "softening": {"hinge": ub.Softening(4.0, 5.0)},
    "linear softening": {"hinge": ub.LinearSoftening(4.0, 5.0)},
    "plastic and softening": {"bending": WEAK, "hinge": ub.Softening(8.0, 40.0)},
    "fibres": {"law": ub.ElastoPlastic(2.0, 5.0)},
    "viscous fibres": {"law": VISCOUS},
    "cracking fibres": {"law": WEAK, "softening": ub.Softening(8.0, 40.0)},
}
"""Of the numbers of SECTION, with limits that strains of order one are far beyond."""


def inelastic_scene(kind):
    laws = LAWS[kind]
    if "fibres" in kind:
        section = ub.Section.of_fibres(
            [-1.0, -0.2, 0.3, 0.8], [0.5, 1.0, 2.0, 0.7], E=20.0, nu=0.0, rho=0.5,
            fibres=ub.Fibres(**laws),
        )  # fmt: skip
    else:
        section = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0, **laws)
    a = ub.Beam((0, 0), (1, 2), section, cells=2, name="a")
    b = ub.Beam.arc((0, 2), 1.0, (0, 2), OTHER, cells=2, name="b")
    c = ub.Beam((1, 2), (2, 2), section, cells=3, name="c")
    return ub.Scene(
        [a, b, c],
        joints=[ub.Rigid(a.end, b.start), ub.Revolute(a.end, c.start)],
        supports=[ub.Clamped(a.start), ub.Roller(c.end, along=(2, 1))],
        loads=[ub.PointLoad(b.end, force=(3, 4)), ub.FollowerLoad(b.end, force=(20, -30))],
    )


STATIC = [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentumStatic(0.6)]
LOSSY = ub.EnergyMomentum(0.1, 0.1)


@pytest.mark.parametrize(
    ("kind", "scheme"),
    in_turn(LAWS, [*STATIC, ub.EnergyMomentum(), LOSSY, ub.GeneralizedAlpha(0.6)]),
    ids=str,
)
def test_tangent_of_inelastic_scenes(kind, scheme):
    for seed in range(3):
        probe = Probe(inelastic_scene(kind), scheme, turn=1.0, seed=seed)
        # None of these states lies within 1e-5 of a corner of its laws
        require_derivative(probe, 1e-6)
