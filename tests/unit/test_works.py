# SPDX-License-Identifier: MIT
"""Virtual works and potentials of a user: ledger, compilation, restart, ranks, refusals."""

import math
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import ufl
from helpers import raises, run
from scenes import clamped, rigid_chain

import ufl_beam as ub
from ufl_beam.dolfinx_compat import fem, line_mesh
from ufl_beam.plotting.model import model_notes

SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=0.1)


def soil(q, k):
    return k * (q[0] ** 2 + 2 * q[1] ** 2 + 0.1 * q[2] ** 2) / 2


def magnet(q, axis, b):
    return -b * (1 + axis.x[0]) * ufl.sin(q[2] + 0.3)


def air(q, v, w, c):
    return -c * (v[0] * w[0] + v[1] * w[1]) - 0.1 * v[2] * w[2] + 3 * ufl.cos(q[2]) * w[1]


def works(beam=None, b=5.0):
    return [
        ub.Potential("soil", soil, numbers={"k": 50.0}),
        ub.Potential("magnet", magnet, numbers={"b": b}, beams=beam and [beam]),
        ub.VirtualWork("air", air, numbers={"c": 0.3}),
    ]


def flying(b=5.0, cells=4):
    """Two beams in flight, with works on both, and a field on the second one."""
    first = ub.Beam((0, 0), (2, 0.5), SECTION, cells=cells)
    second = ub.Beam((2, 0.5), (3, 0), SECTION, cells=cells // 2)
    spin = ub.Velocity((first, second), linear=(1.0, 2.0), angular=3.0)
    return rigid_chain(
        [first, second],
        initial=[spin],
        loads=[ub.PointLoad(first.start, force=(0, 3))],
        works=works(second, b),
    )


run = partial(run, t=(0, 2), dt=0.05)


# -- ledger ------------------------------------------------------------------------------------


def test_the_ledger_closes():
    """To 1e-9; sin ψ is integrated over a step of 0.2 rad to 0.2⁹/2e9 of itself."""
    energy = run(flying(lambda t: 5 * math.cos(3 * t)), ub.EnergyMomentum(0.1, 0.1)).energy
    assert energy.worst < 1e-9
    assert min(np.ptp(energy[name]) for name in ("soil", "magnet", "magnet in time")) > 1
    assert energy["air"][-1] < -1


def test_the_ledger_of_schemes_at_the_end_is_of_second_order():
    """The trapezoidal rule; [estimate] measured orders of two halvings are within 0.1 of 2.

    Air that depends on rates takes their mean in a step, of first order; so there is wind here.
    """
    beam = ub.Beam((0, 0), (2, 0.5), SECTION, cells=4)
    spin = ub.Velocity((beam,), linear=(1.0, 2.0), angular=3.0)
    wind = ub.VirtualWork("wind", lambda q, w: 3 * ufl.cos(q[2]) * w[1])
    acting = [*works(b=lambda t: 5 * math.cos(3 * t))[:2], wind]
    scene = ub.Scene([beam], initial=[spin], works=acting)
    worst = [run(scene, ub.Newmark(), dt=dt).energy.worst for dt in (0.02, 0.01, 0.005)]
    assert np.log2(worst[0] / worst[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(worst[1] / worst[2]) == pytest.approx(2, abs=0.1)


# -- against the package's own loads -----------------------------------------------------------


@pytest.mark.parametrize("scheme", [ub.EnergyMomentumStatic(), ub.EnergyMomentum()])
def test_a_dead_work_is_a_line_load(scheme):
    """Also where steps are cut, and where it is there from the start."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    load = ub.LineLoad(beam, force=(-20.0, 30.0), moment=5.0)
    work = ub.VirtualWork("load", lambda w: -20.0 * w[0] + 30.0 * w[1] + 5.0 * w[2])
    scenes = clamped(beam, loads=[load]), clamped(beam, works=[work])
    loaded, worked = (run(scene, scheme, t=(0, 1), dt=0.25) for scene in scenes)
    np.testing.assert_allclose(worked.q, loaded.q, atol=1e-9 * np.abs(loaded.q).max())
    forces = (one.reaction(one.scene.supports[0])[1:] for one in (worked, loaded))
    np.testing.assert_allclose(*forces, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(worked.energy["load"], loaded.energy["loads"], rtol=1e-7, atol=1e-9)


# -- small motions -----------------------------------------------------------------------------


FINE = ub.Mesh(refine=8, degree=2)
"""16 cells of degree 3: of a wave with n halves (n π/16)⁶/40 of the stiffness is missing, 1e-6."""


def column(k, *works):
    """A pinned beam of length π on an elastic foundation."""
    # Strains and shear count 1e-6; round-off of so slender a column counts less.
    section = ub.Section(EA=1e7, GA=1e7, EI=1.0, rhoA=2.0, rhoI=0.0)
    beam = ub.Beam((0, 0), (math.pi, 0), section, cells=8)
    held = [ub.Pinned(beam.start), ub.Roller(beam.end)]
    bed = ub.Potential("bed", lambda q, k: k * q[1] ** 2 / 2, numbers={"k": k})
    push = ub.PointLoad(beam.end, force=(-1.0, 0.0))
    return ub.Scene([beam], supports=held, loads=[push], works=[bed, *works])


def test_frequencies_on_an_elastic_foundation():
    """ω² = (EI (nπ/L)⁴ + k)/ρA [closed]."""
    found = ub.modes(column(7.0), 3, mesh=FINE)
    np.testing.assert_allclose(found.omega**2, [(n**4 + 7) / 2 for n in (1, 2, 3)], rtol=5e-6)


def test_damping_ratio_of_viscous_air():
    """c/(2 ρA ω) [closed]."""
    drag = ub.VirtualWork("drag", lambda v, w: -0.3 * v[1] * w[1])
    found = ub.modes(column(7.0, drag), 2, mesh=FINE)
    np.testing.assert_allclose(found.damping, 0.3 / (4 * found.omega), rtol=5e-6)


def test_buckling_on_an_elastic_foundation():
    """P = EI m² + k/m² for m half waves on a length π: two waves of four [closed]."""
    factors = ub.buckling(column(10.0), 2, mesh=FINE).factors
    np.testing.assert_allclose(factors, [4 + 10 / 4, 9 + 10 / 9], rtol=5e-6)


def test_buckling_by_a_field():
    """A magnet against a field: EI ψ'' + m b sin ψ = 0 buckles at m b = EI (π/2L)² [closed].

    The field grows from that of the state, which is none, to that at the time t.
    """
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e9, GA=1e9, EI=1.0), cells=4)
    push = ub.PointLoad(beam.end, force=(-1.0, 0.0))
    for b in (0.0, 1.0, 2.0):
        # The force P that is left beside the field m b: EI ψ'' + (m b + P) sin ψ = 0 for both.
        field = ub.Potential("field", lambda q, b: b * ufl.cos(q[2]), numbers={"b": b})
        scene = clamped(beam, loads=[push], works=[field])
        [factor] = ub.buckling(scene, 1, mesh=ub.Mesh(degree=2, refine=10)).factors
        assert factor == pytest.approx((math.pi / 2) ** 2 - b, rel=1e-6)
    work = ub.VirtualWork("air", lambda v, w: v[1] * w[1])
    with raises("the VirtualWork has a stiffness of its own"):
        ub.buckling(clamped(beam, loads=[push], works=[work]), 1)


def test_a_number_may_have_any_name():
    """Names of the package's own numbers are no names of parameters."""
    beam = ub.Beam((0, 0), (1, 0), SECTION, cells=2)

    def momentum(**numbers):
        work = ub.VirtualWork("lift", lambda growth, w: growth * w[1], numbers=numbers)
        return run(ub.Scene([beam], works=[work]), t=(0, 1), dt=0.25).momentum()[-1, 1]

    assert momentum(growth=3.0) == pytest.approx(3.0)


# -- processes, checkpoints, files -------------------------------------------------------------


def test_a_continued_run():
    """It takes the state as one that works have led to: nothing grows a second time."""
    beam = ub.Beam((0, 0), (2, 0), SECTION, cells=4)
    work = ub.VirtualWork("load", lambda w, q: 30.0 * (1 + q[1]) * w[1])
    scene = clamped(beam, works=[work])
    first = run(scene, ub.Static(), t=(0, 1), dt=0.5)
    second = run(scene, ub.Static(), t=(1, 2), dt=0.5, start=first)
    np.testing.assert_allclose(second.q, first.q[-1][None].repeat(3, 0), atol=1e-9)
    np.testing.assert_allclose(second.energy["load"], 0.0, atol=1e-9)
    assert np.allclose(second.reaction(scene.supports[0]), first.reaction(scene.supports[0])[-1])


@pytest.mark.serial
def test_a_picture_and_a_saved_solution_know_the_works(tmp_path):
    scene = flying(lambda t: 5 + t)
    assert {"magnet: acts as its function says on beam", "air: acts as its function says"} <= {
        *model_notes(scene)
    }
    solution = run(scene, t=(0, 0.2))
    solution.save(tmp_path / "run.solution")
    loaded = ub.Solution.load(tmp_path / "run.solution")
    assert [work.name for work in loaded.scene.works] == ["soil", "magnet", "air"]
    assert np.array_equal(loaded.energy["air"], solution.energy["air"])
    with pytest.raises(ub.ArgumentError, match="the function soil is not in the file"):
        run(loaded.scene)


@pytest.mark.serial
def test_the_blocks_of_the_page_run(capsys):
    page = (Path(__file__).parents[2] / "docs" / "works.md").read_text(encoding="utf-8")
    names = {}
    for block in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        exec(block, names)
    said = [[*map(float, line.split())] for line in capsys.readouterr().out.splitlines()]
    (work, worst), (sunk,), (field, in_time), (dissipated,) = [row for row in said if row]
    assert work < 0 < dissipated
    assert worst < 1e-9
    # Hetényi's deflection to the error of 32 cells, λ² h²/12 = 1e-3
    assert sunk == pytest.approx(-1.350e-5, rel=1e-3)
    assert field < 0 > in_time
    wired = clamped(BEAM, works=[names["wire"]])
    assert run(wired, t=(0, 0.1)).energy["current"][-1] > 0


# -- what is refused ---------------------------------------------------------------------------

BEAM = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="girder")
BODY = ub.Body((0, 0), mass=1.0, inertia=1.0)
STRAY = ub.Beam((0, 1), (1, 1), SECTION, cells=2, name="stray")


def of_soil(numbers):
    return lambda: ub.Potential("a", soil, numbers=numbers)


def of_height(**more):
    return ub.Potential("a", lambda q: q[0], **more)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ub.Potential("kinetic", soil), ["'kinetic' is empty or a reserved entry"]),
        (lambda: ub.Potential("a", min), ["Potential 'a'", "have no names"]),
        (lambda: ub.Potential("a", lambda q, k: q[0]), ["a parameter 'k', which is unknown"]),
        (lambda: ub.Potential("a", lambda w: w[0]), ["'w'", "the known ones are q, axis, t"]),
        (of_soil({"k": 1, "n": 1}), ["Potential 'a': numbers['n'] is no parameter"]),
        (of_soil({"k": 1, "q": 1}), ["numbers['q']: the name has a meaning"]),
        (of_soil({"k": lambda t: None}), ["numbers['k']: the time function returned None"]),
        (lambda: of_height(beams=[]), ["Potential 'a': beams is empty"]),
        (lambda: ub.Scene(bodies=[BODY], works=[of_height()]), ["Potential 'a': there is no beam"]),
        (
            lambda: ub.Scene([BEAM], works=[of_height(beams=[STRAY])]),
            ["Potential 'a': stray is not in the scene; add it to beams"],
        ),
        (
            lambda: ub.Scene([BEAM], works=[of_height(), of_height()]),
            ["'a', the name of a work", "occurs twice, as works[0] and works[1]; rename one"],
        ),
        (lambda: ub.Scene([BEAM], works=[soil]), ["works[0]", "is not a VirtualWork or Potential"]),
    ],
)
def test_bad_works_are_refused(make, says):
    with raises(*says):
        make()


def other_mesh():
    mesh = line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))
    return fem.Function(fem.functionspace(mesh, ("DG", 0, (3,))))


@pytest.mark.parametrize(
    ("kind", "function", "says"),
    [
        (ub.VirtualWork, lambda w: None, "VirtualWork 'a': the function returned None"),
        (ub.VirtualWork, lambda w: 3.0, "returned 3.0; it must return an expression of UFL"),
        (ub.VirtualWork, lambda w: np.ones(2), "the function returned array"),
        (ub.VirtualWork, lambda w: w, "the function returned a tensor of shape (3,)"),
        (ub.VirtualWork, lambda w: {}["nothing"], "the function fails: KeyError('nothing')"),
        (ub.VirtualWork, lambda q: q[0], "must return an expression that is linear in w"),
        (ub.VirtualWork, lambda w: w[0] ** 2, "must return an expression that is linear in w"),
        (ub.VirtualWork, lambda w: w[0] + 1, "must return an expression that is linear in w"),
        (ub.VirtualWork, lambda w: abs(w[0]), "must return an expression that is linear in w"),
        (ub.VirtualWork, lambda w: w[0] * other_mesh()[0], "the function uses a mesh of its own"),
        (ub.Potential, lambda q: None, "Potential 'a': the function returned None"),
        (ub.Potential, lambda t: 2 * t, "the energy must depend on the configuration q"),
        (ub.Potential, lambda q: q, "the function returned a tensor of shape (3,)"),
        (ub.Potential, lambda q: q.nothing, "the function fails: AttributeError"),
    ],
)
def test_bad_functions_are_refused(kind, function, says):
    scene = clamped(BEAM, works=[kind("a", function)])
    with raises(says):
        ub.Simulation(scene, ub.EnergyMomentum())


def test_a_number_that_fails_later_is_named():
    work = ub.VirtualWork(
        "gust", lambda w, c: c * w[1], numbers={"c": lambda t: 1.0 if t < 0.1 else None}
    )
    scene = clamped(BEAM, works=[work])
    with raises("VirtualWork 'gust': the time function returned None at t = "):
        run(scene, t=(0, 1))


def test_a_work_that_is_no_number_ends_the_run():
    """The square root has no derivative at rest; the message names the beam."""
    still = ub.VirtualWork("drag", lambda v, w: -ufl.sqrt(v[1] ** 2) * v[1] * w[1])
    push = ub.PointLoad(BEAM.end, force=(0.0, 1.0))
    scene = clamped(BEAM, loads=[push], works=[still])
    with pytest.raises(ub.ConvergenceError, match="girder"):
        run(scene, t=(0, 1))


def test_section_forces_before_the_first_static_step_are_zero():
    """The potential acts from the first step on, as its reactions do."""
    weight = ub.Potential("weight", lambda q, g: g * q[1], numbers={"g": 6.0})
    run_ = run(clamped(BEAM, works=[weight]), ub.Static(), t=(0, 1), dt=0.5)
    shear = run_.cell_resultants(-1)[[1, 4]]
    assert np.abs(shear).max() > 1.0  # N
    assert run_.cell_resultants(0)[[1, 4]] == pytest.approx(0.0, abs=1e-9)
