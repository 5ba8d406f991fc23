# SPDX-License-Identifier: MIT
"""What is compiled: one quadrature rule per form, and nothing that the scene does not need."""

import math
import sys

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from dolfinx import cpp
from scenes import clamped
from ufl.classes import Operator
from ufl.corealg.traversal import unique_pre_traversal

import ufl_beam as ub
from ufl_beam.compiled.c_library import doubles
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.discretization import cell_functions, compiled_forms
from ufl_beam.discretization.beam_forms import elastic_form, mass_form
from ufl_beam.discretization.compiled_forms import (
    Pointwise,
    Stated,
    compiled_functions,
    components,
)
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.function_spaces import DolfinxFields, Fields
from ufl_beam.discretization.partition import Subdomain
from ufl_beam.dolfinx_compat import VERSION, fem, line_mesh

SECTION = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, rhoI=1.0)


def forget_forms():
    """Let forms be stated and compiled again that were before in this process."""
    for name, module in list(sys.modules.items()):
        if name.startswith("ufl_beam"):
            for value in vars(module).values():
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


@pytest.fixture
def compiled(monkeypatch):
    """List that takes every form that is compiled."""
    found = []
    forget_forms()
    compile_form = compiled_forms.fem.form
    monkeypatch.setattr(compiled_forms, "remembered", lambda _, make: make())

    def note(form, *args, **kwargs):
        found.append(form)
        return compile_form(form, *args, **kwargs)

    monkeypatch.setattr(compiled_forms.fem, "form", note)
    return found


def make(**more):
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    return clamped(beam, **more)


def everything():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    return clamped(
        beam,
        ub.Roller(beam.end, along=(1, 1)),
        loads=[ub.Gravity(), ub.FollowerLoad(beam.end, force=(1, 0)), ub.LineLoad(beam)],
        masses=[ub.PointMass(beam.end, 1.0, 1.0)],
    )


# -- one rule per form -------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1)], ids=str
)
def test_forms_have_one_quadrature_rule(compiled, scheme):
    solution = ub.simulate(everything(), scheme, t=(0, 0.1), dt=0.1)
    solution.section_forces(solution.scene.beams[0])
    if scheme.dynamic:
        solution.momentum()
    assert len(compiled) >= 2
    for form in compiled:
        data = ufl.algorithms.compute_form_data(form)
        integrals = [i for group in data.integral_data for i in group.integrals]
        assert len({i.metadata()["quadrature_degree"] for i in integrals}) == 1


@pytest.mark.serial
def test_ffcx_is_still_wrong_about_forms_with_two_rules():
    """Why there is one rule per form: FFCx reuses a coefficient's values at the one point.

    Either outcome is fine for the package; if this fails, FFCx is repaired and the rule is history.
    """
    points = np.column_stack([np.linspace(0, 1, 5), np.zeros(5)])
    mesh = line_mesh(points, np.column_stack([np.arange(4), np.arange(1, 5)]))
    space = fem.functionspace(mesh, ("Lagrange", 1))
    q, w = fem.Function(space), ufl.TestFunction(space)
    q.x.array[:] = np.random.default_rng(0).normal(size=len(q.x.array))

    def vector(*degrees):
        form = sum(q * w * ufl.dx(domain=mesh, metadata={"quadrature_degree": d}) for d in degrees)
        return fem.assemble_vector(fem.form(form)).array

    apart, together = vector(2) + vector(1), vector(2, 1)
    error = np.abs(apart - together).max() / np.abs(apart).max()
    # 0.148 with FFCx 0.9 and 0.11
    assert error > 0.05, "FFCx now integrates forms with two rules correctly; update the notes"
    # What the package relies on: one rule alone is right. Gauss with 2 points on P1 x P1 is exact.
    mass = fem.assemble_matrix(
        fem.form(ufl.TrialFunction(space) * w * ufl.dx(domain=mesh))
    ).to_dense()
    assert np.abs(vector(2) - mass @ q.x.array).max() < 1e-15


# -- nothing that is not needed ----------------------------------------------------------------


def names_of(simulation):
    return [term.effect for term in simulation.terms]


def test_statics_has_no_inertia(compiled):
    simulation = ub.Simulation(make(loads=[ub.Gravity()]), ub.Static())
    assert names_of(simulation) == ["ElasticCell", "DeadLoads"]
    assert len(compiled) == 1  # all functions of elastic cells
    assert not hasattr(simulation, "inertia")
    assert simulation.velocities() == []
    assert list(simulation.ledger.state) == ["stored"]
    assert simulation.solution.v.size == 0


def test_dynamics_adds_the_mass_and_nothing_else(compiled):
    simulation = ub.Simulation(make(), ub.EnergyMomentum())
    assert names_of(simulation) == ["ElasticCell", "Inertia"]
    assert len(compiled) == 2  # all functions of elastic cells, mass
    assert [name for group in simulation.entries() for name in group] == ["stored", "kinetic"]


@pytest.mark.parametrize(
    ("scheme", "lost"),
    [
        (ub.EnergyMomentum(), []),
        (ub.EnergyMomentum(alpha=0.1), ["numerical"]),
        (ub.EnergyMomentum(beta=0.1), ["numerical"]),
        (ub.EnergyMomentum(0.1, 0.1), ["numerical"]),
    ],
    ids=str,
)
def test_numerical_loss_only_where_there_is_some(compiled, scheme, lost):
    simulation = ub.Simulation(make(), scheme)
    assert len(compiled) == 2  # the kernel of cells without a loss does not compute it
    cells = simulation.equation.beams[0]
    assert list(cells._kernels.energies["lost"]) == ["numerical"] * (scheme.alpha > 0)
    assert list(simulation.ledger.lost) == lost


def test_no_load_no_term_and_no_entry(compiled):
    simulation = ub.Simulation(make(), ub.EnergyMomentum())
    assert simulation.loads == []
    assert list(simulation.ledger.supplied) == []


def test_follower_loads_only_where_there_are_some(compiled):
    dead = ub.Simulation(make(loads=[ub.Gravity()]), ub.EnergyMomentum())
    beam = dead.scene.beams[0]
    follower = [ub.FollowerLoad(beam.end, force=(1, 0))]
    both = ub.Simulation(ub.Scene([beam], loads=[ub.Gravity(), *follower]), ub.EnergyMomentum())
    alone = ub.Simulation(ub.Scene([beam], loads=follower), ub.EnergyMomentum())
    assert names_of(dead) == ["ElasticCell", "DeadLoads", "Inertia"]
    assert names_of(both) == ["ElasticCell", "DeadLoads", "FollowerForce", "Inertia"]
    assert names_of(alone) == ["ElasticCell", "FollowerForce", "Inertia"]
    assert len(compiled) == 3  # dead loads need no form, and the beams are alike


def test_supports_that_stand_still_do_no_work():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    still = [ub.Clamped(beam.start), ub.PrescribedDisplacement(beam.end, u=0, v=0.0)]
    moving = [ub.Clamped(beam.start), ub.PrescribedDisplacement(beam.end, u=lambda t: 0.1 * t)]
    entries = [
        list(ub.Simulation(ub.Scene([beam], supports=s), ub.EnergyMomentum()).ledger.supplied)
        for s in (still, moving)
    ]
    assert entries == [[], ["supports"]]


def test_turned_axes_only_at_inclined_rollers():
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=4)
    count = [
        ub.Simulation(
            ub.Scene([beam], supports=[ub.Roller(beam.end, along=along)]),
            ub.EnergyMomentum(),
            comm=MPI.COMM_SELF,
        ).equation.c.turned
        for along in ((1, 0), (0, 1), (1, 1))
    ]
    assert count == [0, 0, 1]


def test_section_forces_are_compiled_when_asked_for(compiled):
    """Where processes share a scene, they add up forces of cells when states are kept."""
    scene = make()
    solution = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=0.1, comm=MPI.COMM_SELF)
    before = len(compiled)
    solution.section_forces(scene.beams[0])
    solution.section_forces_at(scene.beams[0].end)
    assert (before, len(compiled)) == (2, 3)


@pytest.fixture
def no_points(monkeypatch):
    """Nothing of inelastic material may be made."""

    def refuse(*args, **kwargs):
        raise AssertionError("made for a scene that is elastic")

    forget_forms()
    monkeypatch.setattr("ufl_beam.blocks.material_points.Points.__init__", refuse)
    monkeypatch.setattr("ufl_beam.blocks.material_points.PointForms.__init__", refuse)
    monkeypatch.setattr("ufl_beam.blocks.beams.InelasticCells.__init__", refuse)
    monkeypatch.setattr("ufl_beam.model.softening_laws.Softening.traction", refuse)
    monkeypatch.setattr("ufl_beam.mechanics.point_equations.PointEquations.__init__", refuse)


GUESS = (
    "last dt", "q before", "part that repeats itself", "equal steps", "second difference",
    "square of the second difference",
)  # fmt: skip
"""Numbers of the initial guess of a step, with which a run with `start=` goes on."""


@pytest.mark.parametrize(
    "scheme",
    [ub.Static(), ub.EnergyMomentumStatic(0.5), ub.EnergyMomentum(), ub.EnergyMomentum(0.1, 0.1)],
    ids=str,
)
def test_an_elastic_scene_has_no_points(no_points, scheme):
    """Nor one with hinges that never open."""
    section = ub.Section(EA=60.0, GA=40.0, EI=30.0, rhoA=2.0, hinge=ub.Softening(math.inf, 1.0))
    beam = ub.Beam((0, 0), (1, 0), section, cells=4, hinges={0.1: ub.Softening(math.inf, 2.0)})
    never = clamped(beam, loads=[ub.Gravity()])
    for scene in (everything(), never):
        solution = ub.simulate(scene, scheme, t=(0, 0.1), dt=0.1)
        solution.section_forces(scene.beams[0])
        assert {*solution.internal} <= {"reactions", *GUESS}
        assert not {"hardening", "plastic", "hinges"} & {
            *solution.energy.state,
            *solution.energy.lost,
        }


def test_no_points_can_fail(no_points):
    """That the test above can fail."""
    section = ub.Section(EA=60.0, GA=40.0, EI=30.0, bending=ub.ElastoPlastic(1.0))
    beam = ub.Beam((0, 0), (1, 0), section, cells=4)
    with pytest.raises(AssertionError, match="elastic"):
        ub.Simulation(clamped(beam), ub.Static())


def test_changing_alpha_compiles_no_other_code(compiled):
    """Numbers of the scheme are constants: the same signature, so the same code."""
    for alpha in (0.1, 0.2):
        forget_forms()
        ub.Simulation(make(), ub.EnergyMomentum(alpha=alpha))
    half = len(compiled) // 2
    one, other = (
        [form.signature() for form in some] for some in (compiled[:half], compiled[half:])
    )
    assert one == other


# -- the loops of the package against DOLFINx's assemblers ---------------------------------------


def fields_of_a_frame(mesh=None):
    a = ub.Beam((0, 0), (0, 2), SECTION, cells=3)
    b = ub.Beam((0, 2), (3, 1), SECTION, cells=4)
    scene = ub.Scene([a, b], joints=[ub.Revolute(a.end, b.start)])
    return Fields(Subdomain(DofNumbering(scene, mesh or ub.Mesh()), MPI.COMM_SELF))


def space_with_dofs(domain, element, cell_dofs, size):
    """Make a function space with given degrees of freedom of the cells."""
    plain = fem.functionspace(domain, element)
    index_map = cpp.common.IndexMap(MPI.COMM_SELF, size)
    adjacency = cpp.graph.AdjacencyList_int32(np.ascontiguousarray(cell_dofs, dtype=np.int32))
    dofmap = cpp.fem.DofMap(plain.dofmap.dof_layout, index_map, 1, adjacency, 1)
    arguments = [domain._cpp_object, plain._cpp_object.element, dofmap]
    if VERSION < (0, 11):
        arguments.append(list(element.reference_value_shape))
    return fem.FunctionSpace(domain, element, cpp.fem.FunctionSpace_float64(*arguments))


@pytest.mark.parametrize(
    "mesh", [ub.Mesh(), ub.Mesh(degree=2), ub.Mesh(degree=3, lumped=True)], ids=str
)
def test_functions_of_cells_are_what_dolfinx_assembles(mesh):
    """Forces of strains, masses and the stiffness at rest; sums over cells in another order."""
    fields = fields_of_a_frame(mesh)
    q = np.random.default_rng(0).uniform(-1, 1, fields.subdomain.size)
    C = np.diag([SECTION.EA, SECTION.GA, SECTION.EI]).ravel()
    law = (
        np.zeros((len(fields.order), 3 * mesh.degree)),
        np.tile(C, (len(fields.order), mesh.degree)),
    )
    forces = np.zeros(len(q))
    cell_functions.stress_forces(fields, law).add(q, forces)

    meshed = DolfinxFields(fields.subdomain)
    of, size = meshed.element, fields.subdomain.size
    space = space_with_dofs(meshed.mesh, of.space.ufl_element(), meshed.cell_dofs, size)
    now, w, u = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    now.x.array[:] = q
    work = elastic_form(of, ub.Static())
    assembled = fem.assemble_vector(fem.form(ufl.replace(work, {of.q1: now, of.w: w}))).array
    assert np.abs(forces - assembled).max() < 1e-13 * np.abs(assembled).max()
    rest = fem.Function(space)  # where the tangent of the forces is the stiffness
    tangent = ufl.derivative(ufl.replace(work, {of.q1: rest, of.w: w}), rest, u)
    mass = ufl.replace(mass_form(of), {of.w: w, ufl.TrialFunction(of.space): u})
    for form, matrix in (
        (tangent, cell_functions.stiffness_matrix(fields)),
        (mass, cell_functions.mass_matrix(fields)),
    ):
        expected = fem.assemble_matrix(fem.form(form)).to_dense()
        found = matrix.sparse().toarray()
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
        product = np.zeros(size)
        on_cells = cell_functions.stiffness_forces, cell_functions.mass_forces
        on_cells[form is mass](fields).add(q, product)
        assert np.abs(product - expected @ q).max() < 1e-13 * np.abs(expected).max()


def test_forms_are_compiled_once_in_a_process(compiled):
    """For scenes with other numbers, on other meshes; hinges of the same kind included."""
    for n, limit in ((3, 1.0), (5, 2.0)):
        section = ub.Section(EA=60.0 * n, GA=40.0, EI=30.0, rhoA=2.0, hinge=ub.Softening(limit, 1))
        hinges = {0.0: ub.Softening(limit, 2.0), 1.0: ub.ElastoPlastic(limit, 0.1 * n)}
        beam = ub.Beam((0, 0), (n, 1), section, cells=n, hinges=hinges)
        scene = clamped(beam, ub.Clamped(beam.end))
        ub.Simulation(scene, ub.EnergyMomentum())
        if n == 3:
            before = len(compiled)
    assert before == len(compiled) > 6


def test_components_have_no_tensors_inside():
    """Nor does a variable lose a component.

    Without memory of components, 40 products of vectors would take 3^40 visits.
    """
    pointwise = Pointwise(["a", "b"])
    a, b = (ufl.variable(x) for x in pointwise.at.values())
    v, x = ufl.as_vector([a, b]), np.array([0.3, 0.7])
    for _ in range(40):
        v = ufl.variable(b * v / ufl.dot(v, v) + ufl.as_vector([v[1], a]))
        x = 0.7 * x / (x @ x) + [x[1], 0.3]
    outputs = components(ufl.as_vector([*v, ufl.diff(a * ufl.sin(b), b)]))
    nodes = [node for output in outputs for node in unique_pre_traversal(output)]
    assert not any(isinstance(node, Operator) and node.ufl_shape for node in nodes)
    ((function,), _) = compiled_functions(None, lambda: Stated(pointwise, [outputs]))
    inputs, answers = np.full((2, BATCH), [[0.3], [0.7]]), np.empty((3, BATCH))
    function.several(1, doubles(inputs), doubles(answers))
    # Round-off: the 40 products converge to a fixed point.
    assert np.allclose(answers.T, [*x, 0.3 * math.cos(0.7)], rtol=1e-13)


@pytest.mark.skipif(VERSION >= (0, 10), reason="derivatives in UFL have less depth since 2025")
def test_components_of_long_sums():
    """A sum of 600 terms would be too deep for recursion."""
    x = Pointwise(["x"]).at["x"]
    (long,) = components(ufl.as_vector([sum((k * x for k in range(600)), x)]))
    assert len([*unique_pre_traversal(long)]) > 600


def test_matrix_entries_that_do_not_exist_are_refused():
    matrix = fields_of_a_frame().matrix()
    with pytest.raises(ValueError, match="no such entry"):
        matrix.positions(np.array([0]), np.array([matrix.size - 3]))
    for beyond in (-1, matrix.size):
        with pytest.raises(ValueError, match="no such entry"):
            matrix.positions(np.array([beyond]), np.array([0]))
