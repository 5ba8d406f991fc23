# SPDX-License-Identifier: MIT
"""The settings of a mesh: places remain vertices, and what asks a solution takes any mesh."""

import math
import re
from dataclasses import replace
from fractions import Fraction

from mpi4py import MPI

import basix.ufl
import numpy as np
import pytest
from helpers import raises
from scenes import clamped
from scipy.sparse import csr_array

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.discretization.cell_functions import mass_matrix
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain

STEEL = ub.Section(EA=1e6, GA=4e5, EI=1e3, rhoA=2.0, rhoI=1e-3)  # N, N, N m2, kg/m, kg m


def straight(cells, **more):
    return ub.Beam((0, 0), (1, 0), STEEL, cells=cells, **more)


def portal(**parts):
    """Two beams that meet at a right angle; a load in between two vertices of the second."""
    post = ub.Beam((0, 0), (0, 2), STEEL, cells=4, name="post")  # m
    arm = ub.Beam((0, 2), (3, 2), STEEL, cells=6, name="arm")
    everything = {
        "joints": [ub.Rigid(post.end, arm.start)],
        "supports": [ub.Clamped(post.start)],
        "loads": [ub.PointLoad(arm.at(0.25), force=(0.0, -40.0))],  # N
        **parts,
    }
    return ub.Scene([post, arm], **everything)


def bend(scene, refine=1, degree=1, **more):
    mesh = ub.Mesh(refine, degree=degree)
    return ub.simulate(scene, ub.Static(), t=(0, 1), **{"mesh": mesh, "dt": 1.0, **more})


# -- vertices --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "refine", "place", "expected"),
    [
        # cells of 1/6 of the length, and one of them in halves for the place at 1/4
        (6, 1, 0.25, [0, 1 / 6, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1]),
        (3, 2, 0.5, [0, 1 / 6, 1 / 3, 5 / 12, 1 / 2, 7 / 12, 2 / 3, 5 / 6, 1]),
        (12, Fraction(1, 3), 0.5, [0, 0.25, 0.5, 0.75, 1]),
        # 2/3 of three cells between the ends and the middle
        (6, Fraction(2, 3), 0.5, [0, 0.25, 0.5, 0.75, 1]),
    ],
)
def test_cells_are_divided_and_joined(cells, refine, place, expected):
    found = ub.Mesh(refine).vertices(straight(cells), [place])
    assert found == pytest.approx(expected)
    assert place in found  # to the last digit


@pytest.mark.parametrize("refine", [1, 3])
def test_places_remain_vertices(refine):
    """Among them those that come near to a regular vertex, and corners."""
    third = 0.1 + 0.2  # not 0.3
    beam = ub.Beam.polyline([(0, 0), (1, 0), (1, 1.7)], STEEL, cells=10)
    vertices = ub.Mesh(refine).vertices(beam, [third, 0.123])
    for s in (0, 1, third, 0.123, *beam.corners):
        assert np.abs(np.subtract(vertices, s)).min() <= 1e-15
    assert len(vertices) == 12 * refine + 1  # ten cells and two more: the corner, 0.123
    assert (np.diff(vertices) > 0).all()


# the load at 1/4 leaves two cells of the arm before it, five behind
FIVE = "5 cells between arm.at(0.25) (0.75, 2) and arm.end (3, 2)", "arm can take multiples of 1"


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: bend(portal(), mesh=2), ["mesh = 2 is not a Mesh"]),
        (lambda: bend(portal(), Fraction(1, 2)), FIVE),
        (
            lambda: ub.Mesh(Fraction(1, 2)).vertices(straight(6, name="left"), [0.5]),
            ["left can take multiples of Fraction(1, 3)"],
        ),
        (lambda: bend(portal(), start=bend(portal(), 2)), ["other beams or another mesh"]),
    ],
)
def test_wrong_meshes_are_refused(make, parts):
    with raises(*parts):
        make()


# -- runs ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [2, 3])
def test_values_between_nodes(degree):
    """Under its own weight a cell of degree 2 is a parabola of u, and u is exact everywhere."""
    beam = ub.Beam((0, 0), (0, 1), STEEL, cells=1)
    scene = clamped(beam, loads=[ub.LineLoad(beam, force=(0.0, -100.0))])  # N/m
    solution = bend(scene, degree=degree)
    for s in (0.1, 0.5, 0.77, 1.0):
        exact = -100.0 / 1e6 * (s - s**2 / 2)
        assert solution.displacement(beam.at(s))[-1, 1] == pytest.approx(exact, rel=1e-9)
        assert solution.position(beam.at(s))[-1] == pytest.approx([0, s + exact], rel=1e-12)
    assert len(solution.numbering.nodes_along(beam)) == degree + 1


def test_analyses_and_runs_keep_a_mesh():
    beam = ub.Beam((0, 0), (0, 2), STEEL, cells=4)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0.0, -1.0), amplitude=lambda t: t)])
    mesh = ub.Mesh(refine=8)
    euler = math.pi**2 * 1e3 / (4 * 2**2)  # N, with 1 N as load
    # Shear and shortening take Euler/GA and Euler/EA of it; cells err by (π h/2L)²/12: 2e-4
    assert ub.buckling(scene, 1, mesh=mesh).factors == pytest.approx([euler], rel=3e-3)
    state = bend(scene, mesh=mesh)
    for other in (ub.modes(scene, 1, at=state), bend(scene, mesh=None, start=state)):
        assert other.numbering.mesh == mesh
    with raises("modes: at is a solution of other beams, joints or"):
        ub.modes(scene, 1, at=state, mesh=ub.Mesh())
    path = ub.follow(scene, ub.LoadControl(0.5), steps=2, mesh=mesh)
    assert len(path.section_forces(beam)) == 32


def test_the_mesh_belongs_to_a_checkpoint(shared_path):
    file = ub.Checkpoint(shared_path / "run.h5", every=2)

    def run(t1, refine):
        mesh = ub.Mesh(refine)
        scheme, times = ub.EnergyMomentum(), {"t": (0, t1), "dt": 1e-3}
        return ub.simulate(portal(), scheme, mesh=mesh, checkpoint=file, **times)

    run(4e-3, 2)
    with raises("mesh.refine is Fraction(3, 1), in the file Frac"):
        run(8e-3, 3)
    assert run(8e-3, 2).times[-1] == 8e-3


@pytest.mark.parametrize("mesh", [ub.Mesh(2), ub.Mesh(4, degree=2, lumped=True)], ids=str)
def test_everything_takes_any_mesh(mesh, shared_path, on_first_rank):
    """Joints of all kinds, dampings, recorders, pictures; the ledger closes."""
    base = portal()
    post, arm = base.beams
    body = ub.Body((3, 1), mass=1.0, inertia=0.1)
    scene = replace(
        base,
        joints=[*base.joints, ub.RigidLink(arm.end, body.at(0, 0.5))],
        loads=[*base.loads, ub.FollowerLoad(arm.end, force=(0.0, 10.0)), ub.Gravity()],
        bodies=[body],
        damping=[ub.Rayleigh(mass=0.1, stiffness=1e-4), ub.KelvinVoigt(1e-3)],
        connectors=[ub.Stretch(post.at(0.5), arm.at(0.5), ub.Spring(100.0))],
    )
    spot = st.HotSpot.fibre(arm.at(0.3), y=0.1, E=1e9)
    records = [
        ub.XDMF(shared_path / "b.xdmf"), ub.History(shared_path / "b.csv", [arm.at(0.3)]),
        ub.Extremes(), st.Fatigue(spot, st.SNCurve(range=1e8)),
    ]  # fmt: skip
    scheme = ub.EnergyMomentum(0.05)
    solution = ub.simulate(scene, scheme, t=(0, 0.1), dt=0.01, mesh=mesh, record=records)
    assert solution.energy.worst < 1e-9
    written = on_first_rank(lambda: (shared_path / "b.xdmf").read_text())
    (lines, *_) = re.findall(r'NumberOfElements="(\d+)"', written)
    # Degree pieces a cell; and the body, the link and the spring
    assert int(lines) == mesh.degree * int(mesh.refine) * (4 + 7) + 3
    modes = ub.modes(scene, 3, at=(solution, 1))  # before the arm turns fast
    assert modes.numbering.mesh == mesh
    ub.plot(solution, "M")
    ub.plot(solution, "shapes")
    ub.plot(modes)


STIFF = {"EA": 100.0, "GA": 100.0, "EI": 1.0, "rhoA": 0.01, "rhoI": 1e-5}
RANDOM = ub.distributions.Normal(50.0, 5.0, seed=1)
INELASTIC = {
    "yields": ub.Section(
        **STIFF, bending=ub.ElastoPlastic(0.5, isotropic=0.1),
        axial=st.RambergOsgood(1.0, 0.02, 3.0),
    ),
    "softens": ub.Section(**STIFF, hinge=ub.Softening(0.5, 0.5)),
    "fibres": ub.Section.rectangle(
        b=1, h=0.2, E=1e3, nu=0, rho=0.05,
        fibres=ub.Fibres(ub.ElastoPlastic(RANDOM, 50.0), number=4),
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")  # long cells with hinges
@pytest.mark.parametrize(
    ("kind", "mesh"),
    [("yields", ub.Mesh(degree=3)), ("softens", ub.Mesh(degree=3, lumped=True)),
     ("fibres", ub.Mesh(degree=2))],
)  # fmt: skip
def test_cells_that_yield_take_a_higher_degree(kind, mesh, request):
    """The reference solver agrees, and recorded extremes are those of the states."""
    hinges = {} if kind == "fibres" else {0.0: None, 1.0: None}
    beam = ub.Beam((0, 0), (1, 0), INELASTIC[kind], cells=2, hinges=hinges)
    lift = ub.PrescribedDisplacement(beam.end, v=lambda t: 0.3 * math.sin(math.pi * t) ** 2)
    warm = ub.ImposedStrain(beam, axial=2e-3, curvature=0.05, amplitude=lambda t: t)
    scene, extremes = clamped(beam, lift, loads=[warm]), ub.Extremes(points=9)

    def run(t=(0, 0.8), **more):
        more = {"mesh": mesh, "newton": ub.Newton(rtol=1e-12), **more}
        return ub.simulate(scene, ub.EnergyMomentum(), t=t, dt=0.05, **more)

    if MPI.COMM_WORLD.size == 1:
        request.getfixturevalue("as_by_reference")(run((0, 0.4)))
    whole = run(record=extremes)
    assert whole.energy.worst < 1e-9
    lost = whole.energy.lost["hinges" if kind == "softens" else "plastic"]
    last = whole.material(beam)
    assert lost[-1] > 0.1 * whole.energy.energy_transferred
    assert np.sum(last.plastic + last.hinge) == pytest.approx(lost[-1], rel=1e-12)
    moments = [whole.diagram(beam, n, points=9).M for n in range(len(whole))]
    lowest = extremes.section_forces(beam).low[:, 2]
    np.testing.assert_allclose(lowest, np.min(moments, axis=0), rtol=0, atol=1e-12)


# -- degree and lumped mass ------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_nodes_are_those_of_the_element(degree):
    mesh = ub.Mesh(degree=degree)
    element = basix.ufl.element("Lagrange", "interval", degree).basix_element
    first, last, *between = element.points[:, 0]
    assert mesh.nodes == pytest.approx([first, *between, last], abs=1e-15)
    values = element.tabulate(0, np.array([[0.3]]))[0, 0, :, 0]
    first, *between, last = mesh.weights(0.3)
    assert values == pytest.approx([first, last, *between], abs=1e-14)
    # The nodes are the points of a rule that is exact up to degree 2p - 1
    for k in range(2 * degree):
        assert mesh.fractions @ mesh.nodes**k == pytest.approx(1 / (k + 1), rel=1e-14)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_lumped_mass_is_the_row_sum(degree):
    def mass(lumped):
        numbering = DofNumbering(portal(), ub.Mesh(degree=degree, lumped=lumped))
        M = mass_matrix(Fields(Subdomain(numbering, MPI.COMM_SELF)))
        return csr_array((M.data, M.indices, M.indptr)).toarray()

    full, lumped = mass(False), mass(True)
    assert (lumped == np.diag(np.diag(lumped))).all()
    # Rows of displacements and rotations alike: no couplings between them
    assert np.diag(lumped) == pytest.approx(full.sum(axis=1), rel=1e-13)
    # 5 m of 2 kg/m and 1e-3 kg m
    assert np.trace(lumped) == pytest.approx(2 * 5 * 2.0 + 5 * 1e-3, rel=1e-13)
