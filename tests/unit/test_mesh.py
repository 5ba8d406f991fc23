# SPDX-License-Identifier: MIT
"""The settings of a mesh: places remain vertices, and what asks a solution takes any mesh."""

import math
import re
from fractions import Fraction

from mpi4py import MPI

import basix.ufl
import numpy as np
import pytest
from scenes import clamped
from scipy.sparse import csr_array

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.discretization.cell_functions import mass_matrix
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import Fields
from ufl_beam.discretization.partition import Subdomain

STEEL = ub.Section(EA=1e6, GA=4e5, EI=1e3, rhoA=2.0, rhoI=1e-3)  # N, N, N m2, kg/m, kg m


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


def bend(scene, **more):
    return ub.simulate(scene, ub.Static(), t=(0, 1), dt=1.0, **more)


@pytest.mark.parametrize(
    ("refine", "expected"),
    [
        # cells of 1/6 of the length, and one of them in halves for the load at 1/4
        (1, [0, 1 / 6, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1]),
        (2, [0, 1 / 12, 1 / 6, 5 / 24, 1 / 4, 7 / 24, 1 / 3, 5 / 12, 1 / 2, 7 / 12, 2 / 3, 3 / 4,
             5 / 6, 11 / 12, 1]),
    ],
)  # fmt: skip
def test_whole_numbers_divide_each_cell(refine, expected):
    scene = portal()
    arm = scene.beams[1]
    assert ub.Mesh(refine=refine).vertices(arm, scene.attached[arm]) == pytest.approx(expected)


def test_parts_join_cells():
    beam = ub.Beam((0, 0), (1, 0), STEEL, cells=12)
    assert ub.Mesh(Fraction(1, 3)).vertices(beam, [0.5]) == [0, 0.25, 0.5, 0.75, 1]
    # 2/3 of three cells between the ends and the middle; places are vertices to the last digit
    beam = ub.Beam((0, 0), (1, 0), STEEL, cells=6)
    finer = ub.Mesh(Fraction(2, 3)).vertices(beam, [0.5])
    assert finer == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert finer[2] == 0.5


@pytest.mark.parametrize("refine", [1, 3, Fraction(5)])
def test_places_remain_vertices(refine):
    """Among them those that come near to a regular vertex, and corners."""
    third = 0.1 + 0.2  # not 0.3
    beam = ub.Beam.polyline([(0, 0), (1, 0), (1, 1.7)], STEEL, cells=10)
    vertices = ub.Mesh(refine).vertices(beam, [third, 0.123])
    for s in (0, 1, third, 0.123, *beam.corners):
        assert np.abs(np.subtract(vertices, s)).min() <= 1e-15
    assert len(vertices) == 12 * refine + 1  # ten cells and two more: the corner, 0.123
    assert (np.diff(vertices) > 0).all()


def test_too_few_cells_to_join():
    scene = portal()
    with pytest.raises(ub.ArgumentError) as error:
        bend(scene, mesh=ub.Mesh(Fraction(1, 2)))
    message = str(error.value)
    # the load at 1/4 leaves two cells of the arm before it, five behind
    assert "5 cells between arm.at(0.25) (0.75, 2) and arm.end (3, 2)" in message
    assert "arm can take multiples of 1" in message
    beam = ub.Beam((0, 0), (1, 0), STEEL, cells=6, name="left")
    with pytest.raises(ub.ArgumentError, match=r"left can take multiples of Fraction\(1, 3\)"):
        ub.Mesh(Fraction(1, 2)).vertices(beam, [0.5])


@pytest.mark.parametrize("refine", [0, -1, 0.5, "2", math.inf])
def test_no_number_of_cells(refine):
    with pytest.raises(ub.ArgumentError, match="Mesh: refine"):
        ub.Mesh(refine)


def test_not_a_mesh():
    with pytest.raises(ub.ArgumentError, match="mesh = 2 is not a Mesh"):
        bend(portal(), mesh=2)


def test_one_is_what_there_is():
    scene = portal()
    plain, same = DofNumbering(scene), DofNumbering(scene, ub.Mesh(1))
    assert plain.agrees(same)
    assert plain.mesh == same.mesh
    assert not plain.agrees(DofNumbering(scene, ub.Mesh(2)))


def test_as_if_beams_had_more_cells():
    """Without places in between, exactly as a scene whose beams say so."""

    def cantilever(cells):
        beam = ub.Beam.arc((0, 0), 1.0, (0.0, 1.5), STEEL, cells=cells)
        load = ub.PointLoad(beam.end, force=(-30.0, 50.0), moment=100.0)
        return clamped(beam, loads=[load])

    coarse, fine = cantilever(4), cantilever(12)
    a, b = bend(coarse, mesh=ub.Mesh(refine=3)), bend(fine)
    assert a.q == pytest.approx(b.q, abs=1e-12)
    assert len(a.section_forces(coarse.beams[0])) == 12


def test_errors_go_with_the_square_of_the_cell_length():
    """Steps of Richardson's extrapolation: errors of a fine mesh go with its h² (issue 6)."""
    scene = portal()
    tip = scene.beams[1].end
    values = [bend(scene, mesh=ub.Mesh(2**k)).displacement(tip)[-1] for k in range(4)]
    changes = np.diff(values, axis=0)
    assert changes[1] / changes[2] == pytest.approx([4, 4, 4], rel=0.03)


def test_hinges_are_where_the_place_is():
    law = ub.Softening(limit=10.0, fracture_energy=1.0)
    beam = ub.Beam((0, 0), (1, 0), STEEL, cells=4, hinges={0.6: law})
    for refine in (1, 2, 5):
        numbering = DofNumbering(ub.Scene([beam]), ub.Mesh(refine))
        np.testing.assert_allclose(
            numbering.points[numbering.vertices_at_hinges], [(0.6, 0.0)], rtol=1e-15
        )


@pytest.mark.parametrize("degree", [2, 3])
def test_elastic_beams_of_higher_degree_may_have_hinges(degree):
    """[closed] θ = M L/EI + α with M = limit exp(-limit α/energy), whatever the degree."""
    law = ub.Softening(limit=10.0, fracture_energy=5.0)
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, hinges={0.5: law})
    turn = ub.PrescribedDisplacement(beam.end, psi=lambda t: 0.3 * t)
    scene = clamped(beam, turn)
    mesh = ub.Mesh(degree=degree)
    solution = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.1, mesh=mesh)
    α, M, *_ = solution.connector(scene.hinges[0])
    assert α[-1] > 0.1
    assert M[-1] == pytest.approx(10.0 * np.exp(-2.0 * α[-1]), rel=1e-9)
    assert M[-1] / 100.0 + α[-1] == pytest.approx(0.3, rel=1e-9)


def test_runs_go_on_with_their_mesh():
    scene = portal()
    tip = scene.beams[1].end
    first = bend(scene, mesh=ub.Mesh(2))
    again = bend(scene, start=first)
    assert again.numbering.mesh == ub.Mesh(2)
    assert again.displacement(tip)[-1] == pytest.approx(first.displacement(tip)[-1])
    with pytest.raises(ub.ArgumentError, match="other beams or another mesh"):
        bend(scene, start=first, mesh=ub.Mesh())


def test_modes_and_buckling():
    beam = ub.Beam((0, 0), (0, 2), STEEL, cells=4)
    scene = clamped(beam, loads=[ub.PointLoad(beam.end, force=(0.0, -1.0), amplitude=lambda t: t)])
    mesh = ub.Mesh(refine=8)
    euler = math.pi**2 * 1e3 / (4 * 2**2)  # N, with 1 N as load
    # Shear and shortening take Euler/GA and Euler/EA of it; cells err by (π h/2L)²/12: 2e-4
    assert ub.buckling(scene, 1, mesh=mesh).factors == pytest.approx([euler], rel=3e-3)
    first = ub.modes(scene, 1, mesh=mesh).omega[0]
    assert first == pytest.approx(1.8751**2 * math.sqrt(1e3 / 2.0) / 2**2, rel=5e-3)
    state = bend(scene, mesh=mesh)
    assert ub.modes(scene, 1, at=state).numbering.mesh == mesh
    with pytest.raises(ub.ArgumentError, match="modes: at is a solution of other beams, joints or"):
        ub.modes(scene, 1, at=state, mesh=ub.Mesh())
    path = ub.follow(scene, ub.LoadControl(0.5), steps=2, mesh=mesh)
    assert len(path.section_forces(beam)) == 32


def test_everything_takes_a_finer_mesh(shared_path):
    scene = portal()
    arm = scene.beams[1]
    records = [ub.XDMF(shared_path / "a.xdmf"), ub.History(shared_path / "a.csv", [arm.at(0.25)])]
    solution = ub.simulate(
        scene, ub.EnergyMomentum(), t=(0, 1e-2), dt=1e-3, mesh=ub.Mesh(2), record=records
    )
    assert len(solution.shape(arm)) == 15
    assert solution.displacement(arm.at(0.25)).shape == (11, 3)
    assert solution.energy.worst < 1e-9
    assert np.isfinite(solution.momentum()).all()
    ub.plot(solution, "M")


def test_the_mesh_belongs_to_a_checkpoint(shared_path):
    path = shared_path / "run.h5"

    def run(t1, refine):
        return ub.simulate(
            portal(), ub.EnergyMomentum(), t=(0, t1), dt=1e-3, mesh=ub.Mesh(refine),
            checkpoint=ub.Checkpoint(path, every=2),
        )  # fmt: skip

    run(4e-3, 2)
    with pytest.raises(
        ub.ArgumentError, match=r"mesh.refine is Fraction\(3, 1\), in the file Frac"
    ):
        run(8e-3, 3)
    assert run(8e-3, 2).times[-1] == 8e-3


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


@pytest.mark.parametrize("degree", [0, 4, 1.5, "2"])
def test_no_such_degree(degree):
    with pytest.raises(ub.ArgumentError, match=r"Mesh: degree = .* must be 1, 2 or 3"):
        ub.Mesh(degree=degree)


def test_lumped_is_yes_or_no():
    with pytest.raises(ub.ArgumentError, match="Mesh: lumped = 1 is not a bool"):
        ub.Mesh(lumped=1)


STIFF = {"EA": 100.0, "GA": 100.0, "EI": 1.0, "rhoA": 0.01, "rhoI": 1e-5}
RANDOM = ub.distributions.Normal(50.0, 5.0, seed=1)
INELASTIC = {
    "yields": {
        "section": ub.Section(
            **STIFF, bending=ub.ElastoPlastic(0.5, isotropic=0.1),
            axial=st.RambergOsgood(1.0, 0.02, 3.0),
        )
    },
    "softens": {"section": ub.Section(**STIFF, hinge=ub.Softening(0.5, 0.5))},
    "fibres": {
        "section": ub.Section.rectangle(
            b=1, h=0.2, E=1e3, nu=0, rho=0.05,
            fibres=ub.Fibres(ub.ElastoPlastic(RANDOM, 50.0), number=4),
        )
    },
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")  # long cells with hinges
@pytest.mark.parametrize(
    ("kind", "mesh"),
    [("yields", ub.Mesh(degree=3)), ("softens", ub.Mesh(degree=3, lumped=True)),
     ("fibres", ub.Mesh(degree=2))],
)  # fmt: skip
def test_cells_that_yield_take_a_higher_degree(kind, mesh, shared_path, request):
    """The reference solver agrees; envelopes, files, a restart and a later start give the same."""
    hinges = {} if kind == "fibres" else {0.0: None, 1.0: None}
    beam = ub.Beam((0, 0), (1, 0), cells=2, hinges=hinges, **INELASTIC[kind])
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
    lost, last = (
        whole.energy.lost["hinges" if kind == "softens" else "plastic"],
        whole.material(beam),
    )
    assert lost[-1] > 0.1 * whole.energy.energy_transferred
    assert np.sum(last.plastic + last.hinge) == pytest.approx(lost[-1], rel=1e-12)
    moments = [whole.diagram(beam, n, points=9).M for n in range(len(whole))]
    lowest = extremes.section_forces(beam).low[:, 2]
    np.testing.assert_allclose(lowest, np.min(moments, axis=0), rtol=0, atol=1e-12)

    file = ub.Checkpoint(shared_path / f"{kind}.checkpoint", every=5)
    half = run((0, 0.4), checkpoint=file)
    assert np.array_equal(run(checkpoint=file).q, whole.q)
    later = run((0.4, 0.8), start=half, mesh=None)
    np.testing.assert_allclose(later.q[-1], whole.q[-1], rtol=0, atol=1e-9)
    whole.save(shared_path / f"{kind}.h5")
    loaded = ub.Solution.load(shared_path / f"{kind}.h5")
    for mine, other in zip(last, loaded.material(loaded.scene.beams[0]), strict=True):
        assert np.array_equal(mine, other)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_lumped_mass_is_the_row_sum(degree):
    scene = portal(masses=[])

    def mass(lumped):
        numbering = DofNumbering(scene, ub.Mesh(degree=degree, lumped=lumped))
        M = mass_matrix(Fields(Subdomain(numbering, MPI.COMM_SELF)))
        return csr_array((M.data, M.indices, M.indptr)).toarray()

    full, lumped = mass(False), mass(True)
    assert (lumped == np.diag(np.diag(lumped))).all()
    # Rows of displacements and rotations alike: no couplings between them
    assert np.diag(lumped) == pytest.approx(full.sum(axis=1), rel=1e-13)
    # 5 m of 2 kg/m and 1e-3 kg m
    assert np.trace(lumped) == pytest.approx(2 * 5 * 2.0 + 5 * 1e-3, rel=1e-13)


@pytest.mark.parametrize("degree", [2, 3])
def test_values_between_nodes(degree):
    """Under its own weight a cell of degree 2 is a parabola of u, and u is exact everywhere."""
    beam = ub.Beam((0, 0), (0, 1), STEEL, cells=1)
    load = ub.LineLoad(beam, force=(0.0, -100.0))  # N/m
    scene = clamped(beam, loads=[load])
    solution = bend(scene, mesh=ub.Mesh(degree=degree))
    for s in (0.1, 0.5, 0.77, 1.0):
        exact = -100.0 / 1e6 * (s - s**2 / 2)
        assert solution.displacement(beam.at(s))[-1, 1] == pytest.approx(exact, rel=1e-9)
        assert solution.position(beam.at(s))[-1] == pytest.approx([0, s + exact], rel=1e-12)
    assert len(solution.numbering.nodes_along(beam)) == degree + 1


@pytest.mark.parametrize("degree", [2, 3])
def test_numbering_of_higher_degrees(degree):
    """Along the beams, so that Gauss elimination fills in next to nothing; joints come last."""
    scene = portal()
    post, arm = scene.beams
    numbering = DofNumbering(scene, ub.Mesh(degree=degree))
    assert numbering.dofs[numbering.nodes_along(post)[:-1]].ravel() == pytest.approx(
        np.arange(12 * degree)
    )
    assert (
        numbering.dofs[numbering.vertex(post.end)] == numbering.dofs[numbering.vertex(arm.start)]
    ).all()
    assert (numbering.dofs[numbering.vertex(post.end)] == numbering.size - 3 + np.arange(3)).all()
    inside = int(numbering.dofs[numbering.nodes_along(arm)[1], 1])
    x = numbering.points[numbering.nodes_along(arm)[1], 0]
    assert numbering.describe(inside) == f"v of arm at ({x:g}, 2)"


@pytest.mark.parametrize("mesh", [ub.Mesh(degree=2), ub.Mesh(2, degree=3, lumped=True)], ids=str)
def test_everything_takes_a_higher_degree(mesh, shared_path, on_first_rank):
    """Joints of all kinds, dampings, recorders, pictures; the ledger closes."""
    base = portal()
    post, arm = base.beams
    body = ub.Body((3, 1), mass=1.0, inertia=0.1)
    scene = ub.Scene(
        base.beams,
        joints=[*base.joints, ub.RigidLink(arm.end, body.at(0, 0.5))],
        supports=base.supports,
        loads=[*base.loads, ub.FollowerLoad(arm.end, force=(0.0, 10.0)), ub.Gravity()],
        bodies=[body],
        damping=[ub.Rayleigh(mass=0.1, stiffness=1e-4), ub.KelvinVoigt(1e-3)],
        connectors=[ub.Stretch(post.at(0.5), arm.at(0.5), ub.Spring(100.0))],
    )
    records = [
        ub.XDMF(shared_path / "b.xdmf"), ub.History(shared_path / "b.csv", [arm.at(0.3)]),
        ub.Extremes(),
        st.Fatigue(st.HotSpot.fibre(arm.at(0.3), y=0.1, E=1e9), st.SNCurve(range=1e8)),
    ]  # fmt: skip
    solution = ub.simulate(
        scene, ub.EnergyMomentum(0.05), t=(0, 0.1), dt=0.01, mesh=mesh, record=records
    )
    assert solution.energy.worst < 1e-9
    written = on_first_rank(lambda: (shared_path / "b.xdmf").read_text())
    (lines, *_) = re.findall(r'NumberOfElements="(\d+)"', written)
    # Degree pieces a cell; and the body, the link and the spring
    assert int(lines) == mesh.degree * int(mesh.refine) * (4 + 7) + 3
    ub.plot(solution, "M")
    ub.plot(solution, "shapes")
    modes = ub.modes(scene, 3, at=(solution, 1))  # before the arm turns fast
    ub.plot(modes)
    assert modes.numbering.mesh == mesh
    again = ub.simulate(scene, ub.EnergyMomentum(0.05), t=(0.1, 0.12), dt=0.01, start=solution)
    assert again.energy.worst < 1e-9
