# %% [markdown]
# # The card: the paper as plain DOLFINx
#
# The paper derives beams with plastic hinges from a functional.  This demo states the functional in
# UFL on an interval mesh, and solves the cantilever of section 4.1 with DOLFINx, NumPy and PETSc:
#
# * the configuration is a P1 function, and the jump of the rotation in a hinge a DG0 function,
# * plastic strains and hardening variables are functions of a quadrature element,
# * a return map in NumPy updates them and the jump in each iteration,
# * PETSc's SNES solves each step.
#
# The strains, the functional and the variations of the time schemes come from the package.  The
# results are compared with both solvers of the package: the compiled one, and the reference solver
# in `ufl_beam/reference/`, which solves the scenes of the paper in this way, also with inertia.
#
# The free end of the cantilever is rotated by 4π in 500 steps.  Its bending moment is constant
# along the axis.  A cell of 20 cm in the middle has a hinge, which opens at 80 N m and softens.

# %%
# SPDX-License-Identifier: MIT
from itertools import pairwise
from pathlib import Path
from time import perf_counter

from mpi4py import MPI
from petsc4py import PETSc

import basix.ufl
import dolfinx.plot
import numpy as np
import pyvista
import ufl
from dolfinx import fem, io, la, mesh
from dolfinx.fem import petsc
from scipy.optimize import brentq

import ufl_beam as ub
from ufl_beam.mechanics import functional
from ufl_beam.mechanics.functional import enhanced_strain, virtual_work
from ufl_beam.mechanics.kinematics import Axis, strain
from ufl_beam.plotting.films import screen

output = Path("output")
output.mkdir(exist_ok=True)
comm = MPI.COMM_WORLD

E, A, I = 73e9, 2e-4, 0.1667e-8  # Pa, m², m⁴
EA, GA, EI = E * A, 5 / 6 * E * A / 2.6, E * I  # N, N, N m²
C = ufl.as_vector([EA, GA, EI])
M_y, H = 50.0, 2e9 * I  # yield moment, N m; hardening, N m²
softening = ub.Softening(limit=80.0, fracture_energy=100.0)  # of the hinge; N m, J
angle, steps = 4 * np.pi, 500

# %% [markdown]
# ## Mesh and functions
#
# The mesh is an interval mesh in the plane, with one quadrature point in each cell.  Under `mpirun`
# DOLFINx distributes it.

# %%
nodes = np.append(np.linspace(0, 0.4, 9), np.linspace(0.6, 1, 9))  # m
vertices = np.column_stack([nodes, 0 * nodes])
cells = np.column_stack([np.arange(17), np.arange(1, 18)])
mine = slice(None) if comm.rank == 0 else slice(0)
line = ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(2,)))
domain = mesh.create_mesh(comm, cells=cells[mine], x=vertices[mine], e=line)
here = np.arange(domain.topology.index_map(1).size_local, dtype=np.int32)
axis, dx = Axis(domain), ufl.Measure("dx", domain, metadata={"quadrature_degree": 1})

V = fem.functionspace(domain, ("Lagrange", 1, (3,)))
DG0 = fem.functionspace(domain, ("DG", 0))
Q = fem.functionspace(domain, basix.ufl.quadrature_element("interval", degree=1))

q0, q1 = fem.Function(V), fem.Function(V)  # (u_x, u_y, ψ) at both ends of a step
jump0, jump1 = fem.Function(DG0), fem.Function(DG0)  # α
plastic0, plastic = fem.Function(Q), fem.Function(Q)  # plastic curvature at t_n and t_n+θ
hardening, opening = fem.Function(Q), fem.Function(Q)  # ξ of the bulk and of the hinge
D = fem.Function(Q)  # derivative of M by the curvature at the end of the step


def in_cells(value):
    """Return a function that evaluates a UFL expression in the middle of each cell."""
    expression = fem.Expression(value, np.array([[0.5]]))
    return lambda: expression.eval(domain, here).reshape(len(here), -1)


length, strains = in_cells(axis.h)()[:, 0], in_cells(strain(q1, axis))
has_hinge = np.isclose(length, 0.2)

# %% [markdown]
# ## The functional
#
# The Hu-Washizu functional has configurations, strains and resultants as fields, P(26).  A jump α
# adds -α/h to the curvature, P(30).  Resultants are constant in a cell and do no work on it, P(33),
# so they drop out.  The functional becomes the potential Π(q, α), P(49): the free energy W of the
# enhanced strains, and the energy of the hinges.


# %%
def W(e):
    """Return the elastic energy of the bulk as a function of its strains, J/m, P(35)."""
    return functional.elastic_energy(e - ufl.as_vector([0, 0, plastic]), C)


M_u, G_f = softening.limit, softening.fracture_energy
of_hinge = G_f * (1 - ufl.exp(-M_u / G_f * abs(jump1)))  # J
Π = functional.potential(W, q1, jump1, of_hinge, axis) * dx

# %% [markdown]
# Equilibrium is the derivative of Π by q, P(34): the resultants ∂W/∂**e** do virtual work on the
# variation of the strains.  A time scheme states the variation, and the fraction θ of the step at
# which the laws hold.  `Static` has the derivative of the strains, and θ = 1.  The midpoint rule of
# the paper has θ = 1/2, and a variation over the step that conserves energy, P(82).
#
# UFL derives the tangent.  The return map makes plastic strains and jumps functions of q1, so D
# replaces EI, P(76).


# %%
def equilibrium(scheme):
    """Return the forces of a step and their derivative by q1, as compiled forms."""
    w, dq, θ = ufl.TestFunction(V), ufl.TrialFunction(V), scheme.theta
    e0, e1 = enhanced_strain(q0, jump0, axis), enhanced_strain(q1, jump1, axis)
    e = ufl.variable((1 - θ) * e0 + θ * e1)
    r = ufl.diff(W(e), e)
    w_e = scheme.virtual_strain(q0, q1, w, axis)
    F = virtual_work(r, w_e) * dx
    de = ufl.derivative(strain(q1, axis), q1, dq)
    dr = ufl.as_vector([θ * EA * de[0], θ * GA * de[1], D * de[2]])
    J = (virtual_work(dr, w_e) + virtual_work(r, ufl.derivative(w_e, q1, dq))) * dx
    return fem.form(F), fem.form(J)


# %% [markdown]
# ## The return map
#
# The bulk yields with isotropic hardening.  Where its moment exceeds the resistance of the hinge,
# the jump grows until both moments are equal, P(32).  An elastic bulk unloads faster than the hinge
# softens, so Newton's method converges from the growth that would remove the moment.  It takes the
# derivative of the resistance by a complex step.
#
# When a hinge opens, the other cells unload.  Their tangent is then elastic: with the tangent of
# yielding, the first iterations of SNES would alternate between two states.


# %%
def bulk(κ, dt):
    """Return moments, their derivatives and plastic flow for curvatures κ of the bulk."""
    trial, stiffness = EI * (κ - plastic0.x.array), EI + H + viscosity / dt
    γ = np.maximum(abs(trial) - (M_y + H * hardening.x.array), 0) / stiffness  # P(44)
    flow = np.sign(trial) * γ
    return trial - EI * flow, EI * np.where(γ > 0, 1 - EI / stiffness, 1.0), flow


def return_map(scheme, dt, K0):
    """Set plastic curvatures, jumps and D by q1; return growths of ξ of the bulk and the hinge."""
    θ, ξ = scheme.theta, opening.x.array
    κ = (1 - θ) * K0 + θ * strains()[:, 2] - jump0.x.array / length  # while the hinge is held
    M, slope, flow = bulk(κ, θ * dt)
    opens = has_hinge & (abs(M) > softening.traction(ξ))  # P(51)
    way, falls = np.sign(M), 0.0
    a = np.where(opens, abs(M) / EI * length / θ, 0.0)  # this growth would remove the moment
    for _ in range(20 if opens.any() else 0):
        M, slope, flow = bulk(κ - θ * way * a / length, θ * dt)
        t = scheme.resistance(softening, ξ, a + 1e-200j)
        falls = t.imag * 1e200
        a -= np.where(opens, (way * M - t.real) / (-θ * slope / length - falls), 0.0)
    plastic.x.array[:], jump1.x.array[:] = plastic0.x.array + flow, jump0.x.array + way * a
    condensed = slope * falls / (θ * slope / length + falls)  # P(76)
    around = EI if comm.allreduce(opens.any(), MPI.LOR) else slope
    D.x.array[:] = θ * np.where(opens, condensed, around)
    return abs(flow) / θ, a


# %% [markdown]
# ## Steps
#
# SNES finds the end of each step.  Its initial guess extrapolates the last step and satisfies the
# boundary conditions.  Changes of internal variables from t_n to t_n+θ, divided by θ, are the
# changes in the whole step.

# %%
clamp = fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[0], 0))
rotations, in_V = V.sub(2).collapse()
tip = fem.locate_dofs_geometrical((V.sub(2), rotations), lambda x: np.isclose(x[0], 1))
turned = fem.Function(rotations)
supports = [fem.dirichletbc(np.zeros(3), clamp, V), fem.dirichletbc(turned, tip, V.sub(2))]
options = {
    "snes_type": "newtonls", "snes_linesearch_type": "basic", "snes_stol": 1e-9, "snes_rtol": 0,
    "snes_atol": 0, "ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps",
}  # fmt: skip


def run(scheme, after_step=None):
    """Rotate the end; return configurations and jumps after each step, and the wall time; s."""
    for function in (q0, q1, jump0, jump1, plastic0, plastic, hardening, opening):
        function.x.array[:] = 0.0
    F, J = equilibrium(scheme)
    A, f, x, K0 = petsc.create_matrix(J), fem.Function(V), q1.x.petsc_vec.copy(), strains()[:, 2]
    grown = []

    def residual(snes, x, b):
        x.copy(q1.x.petsc_vec)
        q1.x.scatter_forward()
        grown[:] = return_map(scheme, 1 / steps, K0)
        with b.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(b, F)
        b.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        petsc.set_bc(b, supports, x, -1.0)

    def jacobian(snes, x, A, P):
        P.zeroEntries()
        petsc.assemble_matrix(P, J, supports)
        P.assemble()

    snes = PETSc.SNES().create(comm)
    snes.setOptionsPrefix("card_")
    snes.setFunction(residual, f.x.petsc_vec)
    snes.setJacobian(jacobian, A)
    for name, value in options.items():
        PETSc.Options("card_")[name] = value
    snes.setFromOptions()
    last, states, begin = 0.0, [], perf_counter()
    for n in range(1, steps + 1):
        turned.x.array[:] = angle * n / steps
        q1.x.array[:] += last
        for support in supports:
            support.set(q1.x.array)
        q1.x.petsc_vec.copy(x)
        snes.solve(None, x)
        assert snes.getConvergedReason() > 0, snes.getConvergedReason()
        if after_step:
            after_step(n)
        last = q1.x.array - q0.x.array
        plastic0.x.array[:] += (plastic.x.array - plastic0.x.array) / scheme.theta
        hardening.x.array[:] += grown[0]
        opening.x.array[:] += grown[1]
        q0.x.array[:], jump0.x.array[:], K0 = q1.x.array, jump1.x.array, strains()[:, 2]
        states.append((q1.x.array.copy(), comm.allreduce(jump1.x.array.sum())))
    return *map(np.array, zip(*states, strict=True)), perf_counter() - begin


# %% [markdown]
# ## Files and a picture
#
# DOLFINx writes the functions to an XDMF file.  ParaView opens it with *Xdmf3 Reader T*, as a block
# for each function.  PyVista draws the mesh.

# %%
e_bulk = enhanced_strain(q1, jump1, axis) - ufl.as_vector([0, 0, plastic])
resultants = in_cells(functional.resultants(e_bulk, C))
shown = {
    "displacement": fem.Function(V), "rotation": fem.Function(rotations),
    "N V M": fem.Function(fem.functionspace(domain, ("DG", 0, (3,)))),
    "plastic curvature": fem.Function(DG0), "jump": fem.Function(DG0),
}  # fmt: skip
for name, function in shown.items():
    function.name = name
shapes = []


def write(n):
    """Write every tenth state, and keep the shapes of a few states."""
    if n % 10:
        return
    moved, N_V_M = q1.x.array.reshape(-1, 3) * (1, 1, 0), resultants()
    values = moved, q1.x.array[in_V], N_V_M, plastic.x.array, jump1.x.array
    for function, value in zip(shown.values(), values, strict=True):
        function.x.array[:] = np.ravel(value)
        file.write_function(function, n / steps)
    if n in (60, 150, 250, 380, 410, 500):
        lines, _, x = dolfinx.plot.vtk_mesh(V)
        shape = pyvista.PolyData(x + moved, lines=lines)
        shape.cell_data["M (N m)"], shape.field_data["hinge"] = N_V_M[:, 2], has_hinge
        shapes.append((f"{angle * n / steps:.1f} rad", comm.gather(shape)))


def draw():
    """Draw the shapes side by side, coloured by the moment; black: the cell with the hinge."""
    plotter, left = pyvista.Plotter(off_screen=True, window_size=(1600, 560)), 0.0
    plotter.set_background("white")
    bar = {"title_font_size": 22, "label_font_size": 18, "n_labels": 2, "color": "black"}
    for turn, parts in shapes:
        x0, x1 = (f([part.bounds[k] for part in parts]) for k, f in enumerate((min, max)))
        for part in parts:
            part.translate((left - x0, 0, 0), inplace=True)
            plotter.add_mesh(
                part.tube(radius=0.009), scalars="M (N m)", clim=(0, 80), cmap="plasma_r",
                scalar_bar_args=bar,
            )  # fmt: skip
            for k in np.flatnonzero(part.field_data["hinge"]):
                a, b = part.points[part.lines[3 * k + 1 : 3 * k + 3]] + (0, 0, 0.01)
                plotter.add_mesh(pyvista.Tube(pointa=a, pointb=b, radius=0.005), color="black")
        below = [(left + (x1 - x0) / 2, -0.09, 0)]
        plotter.add_point_labels(
            below, [turn], shape=None, show_points=False, text_color="black", font_size=20,
            justification_horizontal="center",
        )  # fmt: skip
        left += x1 - x0 + 0.18
    plotter.view_xy()
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = (left / 2 - 0.09, 0.17, 0)
    plotter.camera.position = (left / 2 - 0.09, 0.17, 9)
    plotter.camera.parallel_scale = 0.53
    plotter.screenshot(output / "the_card.png")
    plotter.close()


viscosity = 0.0  # of the bulk; N m² s
with io.XDMFFile(comm, output / "the_card.xdmf", "w") as file:
    file.write_mesh(domain)
    at_end = run(ub.Static(), write)
if comm.rank == 0:
    with screen(pyvista):
        draw()

# %% [markdown]
# The return map and SNES have made Π stationary: its derivatives by q and by α vanish at the end of
# the last step, except for the reactions of the supports.

# %%
by_q = fem.assemble_vector(fem.form(ufl.derivative(Π, q1, ufl.TestFunction(V))))
by_q.scatter_reverse(la.InsertMode.add)
by_α = fem.assemble_vector(fem.form(ufl.derivative(Π, jump1, ufl.TestFunction(DG0))))
held = np.concatenate([support.dof_indices()[0] for support in supports])
owned = V.dofmap.index_map.size_local
forces, moments = by_q.array[np.setdiff1d(np.arange(3 * owned), held)], by_α.array[has_hinge]


def largest(values):
    """Return the largest absolute value on all processes."""
    return comm.allreduce(np.abs(values).max(initial=0.0), MPI.MAX)


ub.print_once(
    f"derivative by q {largest(forces):.0e} N and N m, by the jump {largest(moments):.0e} N m"
)
assert largest(forces) < 1e-12 * EA  # round-off of strains of size one
assert largest(moments) < 1e-12 * M_u

# %% [markdown]
# ## The same scene in the package
#
# The scene has the same cells.  `simulate` solves it by compiled C, and `Newton(reference=True)`
# by DOLFINx.  The second scheme is the midpoint rule of the paper, with the viscosity of its
# example.


# %%
def cantilever():
    """Return the scene: two beams with eight cells, and the cell with the hinge between them."""
    law = ub.ElastoPlastic(M_y, isotropic=H, viscosity=ub.Perzyna(viscosity))
    hinges = (None, softening, None)
    parts = [
        ub.Beam(
            (start, 0), (end, 0), ub.Section(EA=EA, GA=GA, EI=EI, bending=law, hinge=hinge),
            cells=1 if hinge else 8, hinges={0.0: None, 1.0: None} if hinge else {},
        )
        for (start, end), hinge in zip(pairwise((0, 0.4, 0.6, 1)), hinges, strict=True)
    ]  # fmt: skip
    turned = ub.PrescribedDisplacement(parts[2].end, psi=lambda t: angle * t)
    joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(parts)]
    return ub.Scene(parts, joints=joints, supports=[ub.Clamped(parts[0].start), turned])


def compare(scheme, states, solvers):
    """Compare jumps, motions of all nodes and times; return the largest difference."""
    q, jumps, seconds = states
    motions = q.reshape(steps, -1, 3)[:, :owned]
    x, ends = V.tabulate_dof_coordinates()[:owned, 0], np.array([0, 0.4, 0.6, 1])
    beams = np.searchsorted(ends[1:], x - 1e-9)
    s = (x - ends[beams]) / np.diff(ends)[beams]
    ub.print_once(f"\n{scheme}, viscosity {viscosity:g} N m² s")
    ub.print_once(f"  this demo: jump {jumps[-1]:.12f} rad in {seconds:.1f} s")
    worst = 0.0
    for name, newton in solvers.items():
        scene, begin = cantilever(), perf_counter()
        solution = ub.simulate(scene, scheme, t=(0, 1), dt=1 / steps, newton=newton)
        seconds = perf_counter() - begin
        places = [scene.beams[beam].at(value) for beam, value in zip(beams, s, strict=True)]
        theirs = np.stack([solution.displacement(place)[1:] for place in places], axis=1)
        jump = solution.material_at(scene.beams[1].at(0.5)).jump
        differences = largest(motions - theirs), largest(jumps - jump[1:])
        ub.print_once(
            f"  {name}: jump {jump[-1]:.12f} rad in {seconds:.1f} s; largest differences: motion "
            f"{differences[0]:.0e}, jump {differences[1]:.0e}"
        )
        worst = max(worst, *differences)
    return worst


compiled = {"compiled": ub.Newton(rtol=1e-12)}
both = compiled | {"reference": ub.Newton(rtol=1e-12, reference=True)}
differences = [compare(ub.Static(), at_end, both)]
viscosity, midpoint = 2e7 * I, ub.EnergyMomentumStatic(theta=0.5)
differences.append(compare(midpoint, run(midpoint), compiled))

# %% [markdown]
# ## Verification
#
# The bulk yields until the hinge opens; after that it only unloads.  With the plastic curvature of
# the last step in which the hinge is closed, the rotation of the end, ψ = M L/EI + κ_p L + α, and
# the law of the hinge give the jump in closed form.

# %%
step = angle / steps
closed = np.floor((M_u / EI + (M_u - M_y) / H) / step) * step  # rad
kept = (closed - M_y / EI) * EI / (EI + H)  # 1/m


def missing(α):
    """Return the rotation that is missing if the jump is α; rad."""
    return angle - (M_u * np.exp(-M_u / G_f * α) / EI + kept + α)


by_hand = brentq(missing, 1.0, angle, xtol=1e-14)
ub.print_once(f"\njump in closed form: {by_hand:.12f} rad")
assert abs(at_end[1][-1] - by_hand) < 1e-9
assert max(differences) < 1e-9 * angle  # the tolerance of SNES
ub.print_once("\nfiles:", *sorted(map(str, output.glob("the_card*"))), sep="\n  ")

# %% [markdown]
# ## Try this
#
# * `options["snes_monitor"] = None`: how many iterations has the step in which the hinge opens?
# * `around = slope` in the return map: in which step does SNES fail?
# * kinematic hardening in `bulk`, and `kinematic=` instead of `isotropic=` in the scene.
