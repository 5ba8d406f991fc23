# SPDX-License-Identifier: MIT
"""Kernels for several cells at once against the same kernels cell by cell."""

import shutil

import numpy as np
import pytest
import ufl
from compiled_law import ask
from scenes import SECTION, clamped
from ufl.conditional import Condition

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.compiled import code_cache, jit, simd_kernels
from ufl_beam.compiled.c_library import doubles, lib
from ufl_beam.compiled.simd_kernels import BATCH, in_batches
from ufl_beam.discretization.compiled_forms import Pointwise, Stated, compiled_functions


def pointwise(expression):
    """A function of one number, compiled, and its compiler, which keeps it."""
    compiler = Pointwise(["x"])
    stated = Stated(compiler, [[expression(compiler.at["x"])]])
    return *compiled_functions(None, lambda: stated)[0], compiler


def one_by_one(function, values):
    """Values of a function of one number, by FFCx's kernel."""
    found = np.zeros((len(values), 1))
    for x, out in zip(values, found, strict=True):
        ask(function.one, np.array([x]), out)
    return found[:, 0]


def both(expression, *samples):
    """Values of an expression one by one, and several at once, for each of the samples."""
    function, _compiler = pointwise(expression)
    assert function.several
    for values in samples:
        w = in_batches(np.asarray(values)[:, None], BATCH)
        several = np.empty(w.shape)
        function.several(len(w), doubles(w), doubles(several))
        yield one_by_one(function, values), several.ravel()[: len(values)]


# -- functions of numbers ------------------------------------------------------------------------


def normal(seed, size=1.0, number=500):
    return np.random.default_rng(seed).normal(size=number) * size


QUARTERS = np.arange(-40, 41) * np.pi / 4
ANGLES = np.concatenate(
    [[0.0, 5e-324, 1e-300, -1e-9, 1e6, -1e6], normal(1), normal(2, 1e3), QUARTERS,
     np.nextafter(QUARTERS, np.inf)]
)  # fmt: skip
EXPONENTS = np.concatenate(
    [[0.0, -0.0, 5e-324, -1e-17, 709.7, 709.8, 1e5, -745.1, -745.2, -1e5, np.inf, -np.inf, np.nan],
     normal(3), normal(4, 300)]
)  # fmt: skip
NUMBERS = np.concatenate(
    [[0.0, -0.0, 5e-324, 1e-310, 2.3e-308, 1.0, 1.8e308, np.inf, -1.0, -np.inf, np.nan],
     np.exp(normal(5, 100)), 1 + normal(6, 1e-3), np.sqrt(0.5) * (1 + np.arange(-4, 5) * 1e-16)]
)  # fmt: skip


@pytest.mark.parametrize(
    ("function", "values", "digits"),
    [
        (ufl.sin, ANGLES, 2), (ufl.cos, ANGLES, 2), (ufl.tan, ANGLES, 9), (ufl.exp, EXPONENTS, 2),
        (ufl.ln, NUMBERS, 2),
    ],
)  # fmt: skip
def test_functions_are_those_of_the_c_library(function, values, digits):
    """Within two last digits, also near zero, with infinities and NaN as the C library.

    Tangents are quotients: two relative errors of two digits, each up to 2.2e-16, and one rounding,
    in units of the last digit, which is at least 1.1e-16.
    """
    [(one, several)] = both(function, values)
    finite = np.isfinite(one)
    assert np.array_equal(several[~finite], one[~finite], equal_nan=True)
    several, one = several[finite], one[finite]
    assert np.all(np.abs(several - one) <= digits * np.spacing(np.abs(one)))


def test_angles_that_are_far_or_infinite():
    """Far angles have lost digits themselves."""
    x = np.random.default_rng(3).uniform(1e6, 1e9, size=200)
    (one, several), (of_infinite, found) = both(ufl.sin, x, [np.inf, np.nan, 1.0])
    assert np.all(np.abs(several - one) <= np.spacing(x))
    assert np.array_equal(np.isnan(found), np.isnan(of_infinite))


@pytest.mark.parametrize("exponent", [0.8, -0.2, 1.0, None], ids=str)
def test_powers_are_those_of_the_c_library(exponent):
    """Of any base, also where only whole exponents have a real power; None: variable exponents."""
    x = np.concatenate([[0.0, -0.0, 1.0, 2.0, -1.0, -2.5, np.inf, np.nan], np.arange(-3.0, 4.0)])
    x = np.concatenate([x, np.exp(normal(7, 3, 200))])
    [(one, several)] = both(lambda f: f ** (f / 2 + 2.0 if exponent is None else exponent), x)
    close = np.isclose(several, one, rtol=1e-12, atol=0, equal_nan=True)
    assert np.all(close), x[~close]


# -- expressions ---------------------------------------------------------------------------------


EXPRESSIONS = {
    "root": lambda x: ufl.sqrt(abs(x)) - 2.0,
    "powers": lambda x: x**3 / (1 + x**2) + x**-2,
    "constant or not": lambda x: ufl.conditional(ufl.lt(x, 0.3), 1.0, ufl.sin(x) / x),
    "not or constant": lambda x: ufl.conditional(ufl.gt(x**2, 0.3), x, 0.25),
    "bounds": lambda x: ufl.Or(ufl.And(ufl.gt(x, -0.5), ufl.le(x, 1.0)), ufl.ge(x, 1.75)),
    "equal": lambda x: ufl.Or(ufl.eq(x, 0.5), ufl.Not(ufl.ne(x, -1.0))),
    "nested": lambda x: ufl.Not(ufl.Or(ufl.And(x > -0.5, ufl.ne(x, 1.0)), ufl.Not(x < 1.5))),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_expressions_hold_for_any_number_of_cells(name):
    """Also for numbers of cells that leave some lanes empty, and on the bounds of conditions."""

    def expression(x):
        value = EXPRESSIONS[name](x)
        return ufl.conditional(value, x**2, -1.0) if isinstance(value, Condition) else value

    for one, several in both(expression, *(np.linspace(-1.0, 2.0, n) for n in (1, 3, 4, 13))):
        assert np.allclose(several, one, rtol=1e-14, atol=0)


@pytest.mark.parametrize(
    ("expression", "meant"),
    [(ufl.atan, np.arctan), (lambda x: ufl.tanh(x) + x**2, lambda x: np.tanh(x) + x**2)],
    ids=["another function", "beside a power"],
)
def test_functions_without_a_vector_version_are_computed_cell_by_cell(expression, meant):
    function, _compiler = pointwise(expression)
    assert not function.several
    x = np.linspace(-1.0, 2.0, 5)
    assert np.allclose(one_by_one(function, x), meant(x), rtol=1e-14)


def test_texts_of_kernels(tmp_path):
    """Inputs after the unknowns are read where they are stored; the cache may have lost a text."""
    assert simd_kernels.with_stored_inputs("w[0] * w[7]", unknowns=6) == "w[0] * c[1]"
    with pytest.raises(jit.Refused, match="inputs are not read one by one"):
        simd_kernels.with_stored_inputs("w[0] * w[i]", unknowns=6)
    with pytest.raises(jit.Refused, match=r"gone\.c has no kernel"):
        simd_kernels.written(tmp_path / "gone.c")


# -- the check of compiled code ------------------------------------------------------------------


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """Nothing is compiled or known yet."""
    monkeypatch.setattr(code_cache, "_place", lambda: tmp_path)
    simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()
    yield
    simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()


def of_elements():
    """Four functions of elements, and their outputs for a batch of inputs."""
    pointwise = Pointwise(["a", "b"])
    a, b = pointwise.at.values()
    x, y = inputs = np.random.default_rng(3).uniform(-2.0, 2.0, (2, BATCH))
    stated = [a * b, ufl.sin(a)], [], [a * b, ufl.sin(a)], [ufl.cos(b)]
    meant = [[x * y, np.sin(x)], None, [x * y, np.sin(x)], [np.cos(y)]]
    functions, _ = compiled_functions(None, lambda: Stated(pointwise, stated))
    return pointwise, functions, inputs, meant


@pytest.mark.serial
def test_functions_of_elements_are_compiled_together(fresh, capfd):
    """Equal functions and none at all do not confuse them; the compiler says nothing."""
    _alive, functions, inputs, meant = of_elements()
    for function, values in zip(functions, meant, strict=True):
        if values is None:
            assert function is None
            continue
        assert function.outputs == len(values)
        out = np.full_like(values, np.nan)
        function.several(1, doubles(inputs), doubles(out))
        assert np.allclose(out, values, rtol=1e-14)  # products, and sines to two last digits
    for holds in (lambda x: ufl.lt(ufl.as_ufl(1.0), 2.0), EXPRESSIONS["nested"]):
        assert pointwise(lambda x, holds=holds: ufl.conditional(holds(x), x, -1.0))[0].several
    assert "error" not in capfd.readouterr().err


@pytest.mark.serial
def test_wrong_vectors_are_found_once(fresh, monkeypatch, caplog):
    """As after a change of FFCx's text that still compiles, but means something else."""
    right = simd_kernels.in_vectors
    monkeypatch.setattr(
        simd_kernels, "in_vectors", lambda kernel: right(kernel).replace("lanes_cos(", "lanes_sin(")
    )
    caplog.set_level("INFO", logger="ufl_beam")
    for told in (["WARNING", "INFO"], ["INFO"]):
        _alive, functions, (_, y), meant = of_elements()
        assert [bool(function.several) for function in functions if function] == [False] * 3
        assert [record.levelname for record in caplog.records] == told
        assert "entries differ from FFCx's kernel" in caplog.text
        out = np.zeros(1)
        ask(functions[-1].one, np.array([0.0, y[0]]), out)
        assert out == pytest.approx(meant[-1][0][0], rel=1e-14)
        caplog.clear()
        simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()


@pytest.mark.serial
def test_slower_computations_are_told(fresh, caplog, monkeypatch, tmp_path):
    caplog.set_level("INFO", logger="ufl_beam")
    pointwise(ufl.atan)
    assert "computed cell by cell, which is slower: assembly_simd.h has no atan" in caplog.text
    pointwise(ufl.sin)  # FFCx's kernel is in the cache now
    for path in tmp_path.glob("ufl_beam_lanes*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()
    monkeypatch.setenv("CC", "no-such-compiler")
    function, _compiler = pointwise(ufl.sin)
    assert not function.several
    assert "which is slower: ufl_beam_lanes cannot be compiled" in caplog.text


@pytest.mark.parametrize("spokes", [84, 86])
def test_a_point_with_many_beams(spokes):
    """[closed] Stiffnesses n (EA + GA)/2, n (EI + GA/4) of n cells of 1 m; 255 or 261 entries."""
    beams = [
        ub.Beam((0, 0), (np.cos(a), np.sin(a)), SECTION, cells=1)
        for a in np.linspace(0.0, 2 * np.pi, spokes, endpoint=False)
    ]
    scene = ub.Scene(
        beams,
        joints=[ub.Rigid(*(beam.start for beam in beams))],
        supports=[ub.Clamped(beam.end) for beam in beams],
        loads=[ub.PointLoad(beams[0].start, force=(3e-3, -2e-3), moment=4e-3)],
    )
    simulation = ub.Simulation(scene, ub.Static())
    simulation.step_to(1.0)
    assert simulation.iterations <= 3
    stiffness = spokes * np.array([1e4, 1e4, 100.0 + 1e4 / 4])
    found = simulation.displacement(beams[0].start)
    assert found == pytest.approx([3e-3, -2e-3, 4e-3] / stiffness, rel=1e-6)


# -- laws of points ----------------------------------------------------------------------------

CRACKING = ub.Softening(2.5e6, 200.0)
LAWS = {
    "MenegottoPinto": (200e9, 4e-3, st.MenegottoPinto(400e6, 0.01, a1=0.05, a3=0.05)),
    "KentPark": (30e9, 1.5e-3, st.KentPark(30e6, residual=6e6, ultimate=0.006, tension=CRACKING)),
    "Mander": (30e9, 1.5e-3, st.Mander(30e6, strain=0.0021, tension=CRACKING)),
}


def points_of(law):
    """Points of a column that sways until its foot is strained beyond the limits of fibres."""
    E, strain, law = LAWS[law]
    fibres = ub.Fibres(law, number=11)
    section = ub.Section.rectangle(b=0.3, h=0.3, E=E, nu=0.2, rho=2500.0, fibres=fibres)
    column = ub.Beam((0, 0), (0, 2), section, cells=4)
    reach = strain * 2**2 / (3 * 0.15)  # of an elastic cantilever
    top = ub.PrescribedDisplacement(column.end, u=lambda t: reach * np.sin(6.0 * t) ** 2)
    simulation = ub.Simulation(clamped(column, top), ub.Static())
    for n in range(1, 6):
        simulation.step_to(0.1 * n)
    return simulation.inelastic[0].points


@pytest.mark.parametrize("law", LAWS)
def test_a_loop_over_fibres_agrees_with_the_law(law):
    """Stresses, slopes and outputs at the end of a step at random inputs of eleven points."""
    points = points_of(law)
    w, c = points._storage[0].copy(), points.c
    E, strain = w[0, points.names.index("stiffness")], 1e-3
    w[:, points.names.index("strain")] += normal(8, strain, 11)
    energy, stress = [E * strain**2] * int(lib.POINT_OUTPUTS), E * strain
    w[:, points.names.index("traction")] = 1.0  # differences of infinite numbers are not finite
    state = [1.0] * 3 + [strain] * c.variables
    sizes = [stress, E], [*energy, *state, stress]
    for function, loop, scale in zip((c.law, c.end), (c.law_loop, c.end_loop), sizes, strict=True):
        size = len(scale)
        several, one = np.zeros((2, 11, size))
        loop(11, doubles(w), doubles(several))
        for row, answer in zip(w, one, strict=True):
            ask(function, row, answer)
        assert np.all(np.abs(several - one) <= 1e-10 * np.array(scale) + 1e-10 * np.abs(one))
        assert np.any(np.abs(one) > 1e-3 * np.array(scale))
