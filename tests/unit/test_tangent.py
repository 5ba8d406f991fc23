# SPDX-License-Identifier: MIT
"""Tangents against central differences of the residuals, at random states, for all terms."""

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from scipy.sparse import csr_array

import ufl_beam as ub
from ufl_beam.compiled.c_library import doubles

# Numbers of one magnitude, so that an error in any term shows in the largest entry.
SECTION = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0)
OTHER = ub.Section(EA=30.0, GA=50.0, EI=20.0, rhoA=0.0)
"""Without inertia."""


def scene(kind):
    a = ub.Beam((0, 0), (1, 2), SECTION, cells=2, name="a")
    b = ub.Beam.arc((0, 2), 1.0, (0, 2), OTHER, cells=3, name="b")
    c = ub.Beam((1, 2), (2, 2), SECTION, cells=2, name="c")
    joints = [ub.Rigid(a.end, b.start), ub.Revolute(a.end, c.start)]
    supports = [ub.Clamped(a.start), ub.Roller(c.end)]
    loads = [ub.PointLoad(b.end, force=(3, 4)), ub.Gravity(), ub.LineLoad(c, force=(1, 2))]
    masses = []
    if "follower" in kind:
        loads += [
            ub.FollowerLoad(b.at(1 / 3), force=(20, -30), moment=7),
            ub.FollowerLoad(c.start, force=(-10, 20)),
            ub.Pressure(b, 20.0, -30.0, profile=(0.5, 2.0)),
        ]
    if "roller" in kind:
        supports[1] = ub.Roller(c.end, along=(2, 1))
    if "masses" in kind:
        masses += [ub.PointMass(c.start, 3.0, 2.0), ub.PointMass(b.end, 1.0)]
    if "moved" in kind:
        supports[0] = ub.PrescribedDisplacement(
            a.start, u=lambda t: 0.1 * t, v=0, psi=lambda t: 0.3 * t
        )
    works = works_of(b) if "works" in kind else []
    return ub.Scene(
        [a, b, c], joints=joints, supports=supports, loads=loads, masses=masses, works=works
    )


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


KINDS = ["plain", "follower", "roller", "masses", "moved", "works", "follower roller masses"]
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


MEANT = pytest.mark.filterwarnings("ignore:.*takes v:ufl_beam.ModelWarning")
"""Works with velocities act in statics, too."""


@MEANT
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_the_tangent_is_the_derivative_of_the_residual(kind, scheme):
    probe = Probe(scene(kind), scheme, turn=1.5)
    tangent = probe.tangent()
    # Central differences with ε = 1e-5: ε² of third derivatives and 1e-16/ε of values, 1e-9
    # and less of the largest entry at these states
    scale = np.abs(tangent).max()
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-7 * scale


@pytest.mark.parametrize("mesh", [ub.Mesh(degree=2), ub.Mesh(degree=3, lumped=True)], ids=str)
@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentum(0.1, 0.1)], ids=str)
def test_tangent_of_higher_degrees(mesh, scheme):
    probe = Probe(scene("follower roller masses"), scheme, turn=1.5, mesh=mesh)
    tangent = probe.tangent()
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-7 * np.abs(tangent).max()  # ditto


@pytest.mark.parametrize("turn", [1e-2, 2.5])
def test_tangent_of_short_and_long_steps(turn):
    """Where x / tan x is a series, and near the limit of the step."""
    probe = Probe(scene("follower roller masses"), ub.EnergyMomentum(0.1, 0.1), turn=turn)
    tangent = probe.tangent()
    # Third derivatives grow with tan² of half the turn: a hundred times as above at 2.5 rad
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-6 * np.abs(tangent).max()


@pytest.mark.parametrize("kind", ["follower", "masses", "roller"])
def test_each_term_shows_in_the_tangent(kind):
    """That the comparison above can fail: without the term the tangent is another one."""
    with_term = Probe(scene(kind), ub.EnergyMomentum(), turn=1.5).tangent()
    without = Probe(scene("plain"), ub.EnergyMomentum(), turn=1.5).tangent()
    assert np.abs(with_term - without).max() > 1e-2 * np.abs(without).max()


def test_static_tangent_of_dead_loads_is_symmetric():
    """Elastic beams under dead loads have a potential."""
    tangent = Probe(scene("roller"), ub.Static(), turn=1.0).tangent()
    assert np.abs(tangent - tangent.T).max() < 1e-14 * np.abs(tangent).max()


def test_held_rows_and_columns_are_diagonal():
    """With the stiffness that stood there, so that no unit of measure gets in."""
    probe = Probe(scene("roller"), ub.Static(), turn=1.0)
    simulation = probe.simulation
    probe.tangent()
    A = simulation.equation.A
    matrix = csr_array((A.data, A.indices, A.indptr)).toarray()
    held = simulation.supports.dofs
    diagonal = np.diag(matrix)
    others = matrix - np.diag(diagonal)
    assert len(held) == 4
    assert (others[held] == 0).all()
    assert (others[:, held] == 0).all()
    assert (diagonal[held] > 1e-3 * diagonal.max()).all()


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


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize(
    "scheme",
    [
        ub.Static(),
        ub.EnergyMomentumStatic(),
        ub.EnergyMomentumStatic(0.6),
        ub.EnergyMomentum(),
        ub.EnergyMomentum(0.1, 0.1),
        ub.GeneralizedAlpha(0.6),
    ],
    ids=str,
)
def test_tangent_of_inelastic_scenes(kind, scheme):
    for seed in range(3):
        probe = Probe(inelastic_scene(kind), scheme, turn=1.0, seed=seed)
        tangent = probe.tangent()
        # As above; and none of these states lies within 1e-5 of a corner of its laws
        scale = np.abs(tangent).max()
        assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-6 * scale


@pytest.mark.parametrize("kind", LAWS)
def test_laws_show_in_the_tangent(kind):
    """That the comparison above is about flow and openings, and about both at one point."""
    flows, opens, both = False, False, False
    for seed in range(3):
        probe = Probe(inelastic_scene(kind), ub.EnergyMomentum(), turn=1.0, seed=seed)
        probe.tangent()
        (inelastic,) = probe.simulation.inelastic
        p, opening = (inelastic.points[name].copy() for name in ("state plastic", "opening"))
        step, *_ = probe.simulation.equation._begun
        x = probe.simulation.supports.in_plane(probe.x)
        for accept, data in inelastic.made_phases.accept:
            accept(data, step, doubles(x), doubles(x))
        flow, growth = inelastic.points["state plastic"] != p, inelastic.points["opening"] > opening
        flows, opens = flows or flow.any(), opens or growth.any()
        both = both or (flow & growth).any()
    assert opens == ("hinge" in LAWS[kind] or "softening" in LAWS[kind])
    assert flows == ("softening" not in kind or "plastic" in kind)
    assert both == (flows and opens)


@pytest.mark.parametrize("kind", ["hardening", "softening", "cracking fibres"])
def test_static_tangent_of_associated_flow_is_symmetric(kind):
    """Flow and openings follow from potentials, so do increments of the resultants.

    The row of the law of a hinge is the column of its moment, but for a factor.
    """
    scene = inelastic_scene(kind)
    dead = ub.Scene(scene.beams, joints=scene.joints, supports=scene.supports)
    probe = Probe(dead, ub.Static(), turn=1.0)
    tangent = probe.tangent()
    for row in np.flatnonzero(np.isin(probe.free, probe.simulation.numbering.multipliers)):
        other = int(np.argmax(np.abs(tangent[:, row]) * (np.arange(len(tangent)) != row)))
        tangent[row] *= tangent[other, row] / tangent[row, other]
    assert np.abs(tangent - tangent.T).max() < 1e-14 * np.abs(tangent).max()


@pytest.mark.parametrize(
    "scheme", [ub.Newmark(0.6, 0.35), ub.GeneralizedAlpha(0.6), ub.EnergyMomentum()], ids=str
)
def test_tangent_of_a_guide(scheme):
    """Forces at the end of a step or over it, on a curve whose parameter is no arc length."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)
    guide = ub.Guided(beam.end, lambda s: (1 + 2 * s, 0.4 * ufl.sin(3 * s)))
    guided = ub.Scene([beam], joints=[guide], supports=[ub.Roller(beam.start)])
    probe = Probe(guided, scheme, turn=0.3)
    tangent = probe.tangent()
    assert np.abs(tangent - probe.differences(1e-5)).max() < 1e-7 * np.abs(tangent).max()
