# SPDX-License-Identifier: MIT
"""Kernels for several cells at once against the same kernels cell by cell."""

import shutil

import numpy as np
import pytest
import ufl
from compiled_law import ask
from scenes import SECTION, clamped

import ufl_beam as ub
import ufl_beam.structures as st
from ufl_beam.blocks.beams import BeamCells
from ufl_beam.compiled import code_cache, jit, simd_kernels
from ufl_beam.compiled.c_library import doubles, ffi, integers, lib
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


def both(expression, values):
    """What the function makes of the values one by one, and several at once."""
    function, _compiler = pointwise(expression)
    assert function.several
    w = in_batches(np.asarray(values)[:, None], BATCH)
    several = np.empty(w.shape)
    function.several(len(w), doubles(w), doubles(several))
    return one_by_one(function, values), several.ravel()[: len(values)]


ANGLES = np.concatenate(
    [
        [0.0, 5e-324, 1e-300, -1e-9, 1e6, -1e6],
        np.random.default_rng(1).normal(size=500),
        np.random.default_rng(2).normal(size=500) * 1e3,
        np.arange(-40, 41) * np.pi / 4,
        np.nextafter(np.arange(-40, 41) * np.pi / 4, np.inf),
    ]
)


@pytest.mark.parametrize(("function", "digits"), [(ufl.sin, 2), (ufl.cos, 2), (ufl.tan, 9)])
def test_sines_and_cosines_are_those_of_the_c_library(function, digits):
    """Within two last digits of the C library, also relative to what is near zero.

    Tangents are quotients: two relative errors of two digits, each up to 2.2e-16, and one rounding,
    in units of the last digit, which is at least 1.1e-16.
    """
    one, several = both(function, ANGLES)
    assert np.all(np.abs(several - one) <= digits * np.spacing(np.abs(one)))


@pytest.mark.parametrize("flag", ["-O2", "-ffp-contract=off", "-U__FP_FAST_FMA"])
def test_quotients_are_right_to_the_last_digit(flag):
    """To the last digit but rarely, and 1 for equal numbers, also where products are rounded.

    Infinite numbers, such as the limit of an elastic law, have the quotients of C.
    """
    divide = "void divide(int n, const double *a, const double *b, double *c)"
    loop = (
        "{ for (int i = 0; i < n; i += LANES) *(lanes *)(c + i) = "
        "quotient(*(lanes *)(a + i), *(lanes *)(b + i), 1 / *(lanes *)(b + i)); }"
    )
    head = f"#define LANES {simd_kernels.BATCH}\n{jit.text('assembly_simd.h')}"
    source = "\n".join([jit.HEADERS, head, divide, loop])
    flags = [*simd_kernels.FLAGS, flag]
    module = jit.compiled(
        "quotients", f"{divide};", lambda: source, depends_on=[source], flags=flags
    )
    a, b = np.random.default_rng(6).normal(size=(2, 8000)) * 1e3
    a[:4000] = b[:4000]
    a[-8:] = [1.0, -1.0, 0.0, np.inf, -np.inf, 1e308, 1.0, 0.0]
    b[-8:] = [np.inf, np.inf, np.inf, 2.0, 0.0, 1e-10, 0.0, 0.0]
    c = np.empty_like(a)
    module.lib.divide(len(a), *(module.ffi.from_buffer("double[]", x) for x in (a, b, c)))
    assert np.array_equal(c[:4000], np.ones(4000))
    with np.errstate(all="ignore"):
        assert np.array_equal(c[-8:], a[-8:] / b[-8:], equal_nan=True)
    a, b, c = a[:-8], b[:-8], c[:-8]
    assert np.all(np.abs(c - a / b) <= np.spacing(np.abs(a / b)))
    assert np.mean(c != a / b) < 1e-3


EXPONENTS = np.concatenate(
    [
        [
            0.0,
            -0.0,
            5e-324,
            -1e-17,
            709.7,
            709.8,
            1e5,
            -745.1,
            -745.2,
            -1e5,
            np.inf,
            -np.inf,
            np.nan,
        ],
        np.random.default_rng(3).normal(size=500),
        np.random.default_rng(4).normal(size=500) * 300,
    ]
)
NUMBERS = np.concatenate(
    [
        [0.0, -0.0, 5e-324, 1e-310, 2.3e-308, 1.0, 1.8e308, np.inf, -1.0, -np.inf, np.nan],
        np.exp(np.random.default_rng(5).normal(size=500) * 100),
        1 + np.random.default_rng(6).normal(size=500) * 1e-3,
        np.sqrt(0.5) * (1 + np.arange(-4, 5) * 1e-16),
    ]
)


@pytest.mark.parametrize(("function", "values"), [(ufl.exp, EXPONENTS), (ufl.ln, NUMBERS)])
def test_exponentials_and_logarithms_are_those_of_the_c_library(function, values):
    """Within two last digits, with infinities and NaN where the C library has them."""
    one, several = both(function, values)
    finite = np.isfinite(one)
    assert np.array_equal(several[~finite], one[~finite], equal_nan=True)
    several, one = several[finite], one[finite]
    assert np.all(np.abs(several - one) <= 2 * np.spacing(np.abs(one)))


@pytest.mark.parametrize("exponent", [0.8, -0.2, 1.0, None], ids=str)
def test_powers_are_those_of_the_c_library(exponent):
    """Of any base, also where only whole exponents have a real power; None: variable exponents."""
    x = np.concatenate([[0.0, -0.0, 1.0, 2.0, -1.0, -2.5, np.inf, np.nan], np.arange(-3.0, 4.0)])
    x = np.concatenate([x, np.exp(np.random.default_rng(7).normal(size=200) * 3)])
    one, several = both(lambda f: f ** (f / 2 + 2.0 if exponent is None else exponent), x)
    close = np.isclose(several, one, rtol=1e-12, atol=0, equal_nan=True)
    assert np.all(close), x[~close]


def test_far_angles_lose_what_they_do_not_have():
    x = np.random.default_rng(3).uniform(1e6, 1e9, size=200)
    one, several = both(ufl.sin, x)
    assert np.all(np.abs(several - one) <= np.spacing(x))
    one, several = both(ufl.cos, np.array([np.inf, np.nan, 1.0]))
    assert np.array_equal(np.isnan(several), np.isnan(one))


@pytest.mark.parametrize(
    "expression",
    [
        lambda x: ufl.sqrt(abs(x)) - 2.0,
        lambda x: x**3 / (1 + x**2) + x**-2,
        lambda x: ufl.conditional(ufl.lt(x, 0.3), 1.0, ufl.sin(x) / x),
        lambda x: ufl.conditional(ufl.gt(x**2, 0.3), x, 0.25),
    ],
    ids=["root", "powers", "constant or not", "not or constant"],
)
@pytest.mark.parametrize("cells", [1, 3, 4, 9])
def test_expressions_hold_for_any_number_of_cells(expression, cells):
    """Any number of cells, also such that leave some lanes empty."""
    one, several = both(expression, np.linspace(-1.0, 2.0, cells))
    assert np.allclose(several, one, rtol=1e-14, atol=0)


@pytest.mark.parametrize(
    ("expression", "meant"),
    [(ufl.atan, np.arctan), (lambda x: ufl.tanh(x) + x**2, lambda x: np.tanh(x) + x**2)],
    ids=["another function", "beside a power"],
)
def test_what_vectors_cannot_is_computed_cell_by_cell(expression, meant):
    function, _compiler = pointwise(expression)
    assert not function.several
    x = np.linspace(-1.0, 2.0, 5)
    assert np.allclose(one_by_one(function, x), meant(x), rtol=1e-14)


def test_without_the_text_of_the_kernel(tmp_path):
    """The cache may have lost it."""
    with pytest.raises(jit.Refused, match=r"gone\.c has no kernel"):
        simd_kernels.written(tmp_path / "gone.c")


CONDITIONS = {
    "and": lambda x: ufl.And(ufl.gt(x, -0.5), ufl.le(x, 1.0)),
    "or": lambda x: ufl.Or(ufl.lt(x, -0.5), ufl.ge(x, 1.0)),
    "not": lambda x: ufl.Not(ufl.lt(x, 0.25)),
    "equal": lambda x: ufl.Or(ufl.eq(x, 0.5), ufl.Not(ufl.ne(x, -1.0))),
    "nested": lambda x: ufl.Not(
        ufl.Or(ufl.And(ufl.gt(x, -0.5), ufl.ne(x, 1.0)), ufl.Not(ufl.lt(x, 1.5)))
    ),
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_logical_operators_choose_exactly(condition):
    """Exactly: cells choose one number or the other."""
    values, holds = np.linspace(-1.0, 2.0, 13), CONDITIONS[condition]
    one, several = both(lambda x: ufl.conditional(holds(x), x**2, -1.0), values)
    assert np.array_equal(several, one)
    assert 0 < np.sum(one == -1.0) < 13


# -- the check of what is compiled ---------------------------------------------------------------


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """Nothing is compiled or known yet."""
    monkeypatch.setattr(code_cache, "_place", lambda: tmp_path)
    simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()
    yield
    simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()


@pytest.mark.serial
def test_wrong_vectors_are_found_once(fresh, monkeypatch, caplog):
    """As after a change of FFCx's text that still compiles, but means something else."""
    right = simd_kernels.in_vectors
    monkeypatch.setattr(
        simd_kernels, "in_vectors", lambda kernel: right(kernel).replace("lanes_sin(", "lanes_cos(")
    )
    caplog.set_level("INFO", logger="ufl_beam")
    for told in (["WARNING", "INFO"], ["INFO"]):
        function, _compiler = pointwise(ufl.sin)
        assert not function.several
        assert [record.levelname for record in caplog.records] == told
        assert "entries differ from FFCx's kernel" in caplog.text
        x = np.linspace(0.1, 1.0, 5)
        assert np.allclose(one_by_one(function, x), np.sin(x), rtol=1e-14)
        caplog.clear()
        simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()


@pytest.mark.serial
@pytest.mark.parametrize(
    "condition",
    [CONDITIONS["nested"], lambda x: ufl.lt(ufl.as_ufl(1.0), 2.0)],
    ids=["logical", "known"],
)
def test_the_compiler_says_nothing(fresh, capfd, condition):
    function, _compiler = pointwise(lambda x: ufl.conditional(condition(x), x, -1.0))
    assert function.several
    assert "error" not in capfd.readouterr().err


def of_elements():
    """Four functions of elements, and their outputs for a batch of inputs."""
    pointwise = Pointwise(["a", "b"])
    a, b = pointwise.at.values()
    x, y = inputs = np.random.default_rng(3).uniform(-2.0, 2.0, (2, simd_kernels.BATCH))
    stated = [a * b, ufl.sin(a)], [], [a * b, ufl.sin(a)], [ufl.cos(b)]
    meant = [[x * y, np.sin(x)], None, [x * y, np.sin(x)], [np.cos(y)]]
    functions, _ = compiled_functions(None, lambda: Stated(pointwise, stated))
    return pointwise, functions, inputs, meant


@pytest.mark.serial
def test_functions_of_elements_are_compiled_together(fresh, tmp_path):
    """Equal functions and none at all do not confuse them."""
    _alive, functions, inputs, meant = of_elements()
    assert len([path for path in tmp_path.iterdir() if path.is_dir()]) == 2  # FFCx's code, vectors
    for function, values in zip(functions, meant, strict=True):
        if values is None:
            assert function is None
            continue
        assert function.outputs == len(values)
        out = np.full_like(values, np.nan)
        function.several(1, doubles(inputs), doubles(out))
        assert np.allclose(out, values, rtol=1e-14)  # products, and sines to two last digits


@pytest.mark.serial
def test_a_wrong_function_of_elements_refuses_those_beside_it(fresh, monkeypatch):
    right = simd_kernels.in_vectors
    monkeypatch.setattr(
        simd_kernels, "in_vectors", lambda kernel: right(kernel).replace("lanes_cos(", "lanes_sin(")
    )
    _alive, functions, *_ = of_elements()
    assert [bool(function.several) for function in functions if function] == [False] * 3


@pytest.mark.serial
def test_the_check_is_made_once(fresh, monkeypatch):
    calls = []
    check = simd_kernels.require_agreement
    monkeypatch.setattr(
        simd_kernels,
        "require_agreement",
        lambda *args, **more: (calls.append(args), check(*args, **more)),
    )
    for _ in range(2):
        function, _compiler = pointwise(ufl.cos)
        assert function.several
        simd_kernels.element_loops.cache_clear()
    jit.cached_form.cache_clear()
    assert len(calls) == 1


@pytest.mark.serial
def test_what_is_slower_is_said(fresh, caplog, monkeypatch, tmp_path):
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


# -- the kernels of the hot loop ---------------------------------------------------------------


def scene(damping=(), **section):
    frame = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0, **section)
    beam = ub.Beam((1, 2), (4, 6), frame, cells=19)  # of which some fill no batch
    loads = [ub.PointLoad(beam.end, force=(30.0, -20.0), moment=40.0)]
    return clamped(beam, loads=loads, damping=damping)


def hub(spokes):
    """Beams from one point: each degree of freedom there couples to three of each, and its own."""
    angles = np.linspace(0.1, 2 * np.pi, spokes)
    beams = [
        ub.Beam((0, 0), (np.cos(a), np.sin(a)), SECTION, cells=1, name=str(i))
        for i, a in enumerate(angles)
    ]
    rim = [ub.Clamped(beam.end) for beam in beams]
    load = ub.PointLoad(beams[0].start, force=(30.0, -20.0), moment=40.0)
    return ub.Scene(
        beams, joints=[ub.Rigid(*(beam.start for beam in beams))], supports=rim, loads=[load]
    )


HARD = ub.ElastoPlastic(yield_limit=20.0, isotropic=5.0)
RUNS = {
    "rows of 255 entries": (hub(84), ub.EnergyMomentum(), {}),
    "rows of 261 entries": (hub(86), ub.EnergyMomentum(), {}),
    "static": (scene(), ub.Static(), {}),
    "midpoint": (scene(), ub.EnergyMomentum(), {}),
    "lossy": (scene(), ub.EnergyMomentum(alpha=0.1, beta=0.1), {}),
    "printed": (scene(), ub.EnergyMomentumPrinted(), {}),
    "decaying": (scene(), ub.EnergyMomentumDecaying(), {}),
    "generalized": (scene(), ub.GeneralizedAlpha(0.8), {}),
    "degree 2": (scene(), ub.EnergyMomentum(), {"mesh": ub.Mesh(degree=2)}),
    "degree 3": (scene(), ub.EnergyMomentumPrinted(), {"mesh": ub.Mesh(degree=3)}),
    "inelastic": (scene(bending=HARD), ub.EnergyMomentum(), {}),
    "viscous": (scene(damping=[ub.KelvinVoigt(retardation_time=0.01)]), ub.EnergyMomentum(), {}),
}


def inserted_cells_of(term, q, entries):
    """Forces and tangent of a block of cells, in lanes and one by one."""
    if not isinstance(term, BeamCells):
        return
    made, block = term._kernels, ffi.cast("element_block *", term._c)
    assert made.force.inserts
    assert made.tangent.inserts
    dofs = integers(in_batches(term._elements.dofs.astype(np.int32), BATCH))
    pairs = (made.force, dofs), (made.tangent, term._entries(made))
    for (function, at), form in zip(
        pairs, (term.in_cells[0].form().cells, block.inserted), strict=True
    ):
        several, one = np.zeros((2, max(entries, len(q))))
        lib.add_cells(form, doubles(q), doubles(several))
        term._along(function, q, [], 0, at, doubles(one))
        yield several, one


@pytest.mark.serial
@pytest.mark.parametrize("run", RUNS)
def test_kernels_of_the_hot_loop(run):
    scene, scheme, more = RUNS[run]
    simulation = ub.Simulation(scene, scheme, **more)
    for n in range(1, 4):
        simulation.step_to(0.02 * n)
    rng = np.random.default_rng(7)
    q = simulation.q + 1e-2 * rng.normal(size=len(simulation.q))
    compared = 0
    for term in simulation.terms:
        for several, one in inserted_cells_of(term, q, simulation.equation.A.data.size):
            compared += 1
            assert np.allclose(several, one, rtol=0, atol=1e-13 * np.abs(one).max())
    assert compared >= 2


# -- laws of points ----------------------------------------------------------------------------

CRACKING = ub.Softening(2.5e6, 200.0)
LAWS = {
    "MenegottoPinto": (200e9, st.MenegottoPinto(400e6, 0.01, a1=0.05, a3=0.05)),
    "KentPark": (30e9, st.KentPark(30e6, residual=6e6, ultimate=0.006, tension=CRACKING)),
    "Mander": (30e9, st.Mander(30e6, strain=0.0021, tension=CRACKING)),
}


def fibre_run(law, scheme, number):
    """A column that sways beyond the limits of its fibres."""
    E, law = LAWS[law]
    section = ub.Section.rectangle(
        b=0.3, h=0.3, E=E, nu=0.2, rho=2500.0, fibres=ub.Fibres(law, number=number)
    )
    column = ub.Beam((0, 0), (0, 2), section, cells=4)
    strain = 0.004 if E > 100e9 else 0.0015
    reach = strain * 2**2 / (3 * 0.15)  # of an elastic cantilever with this strain at its foot
    top = ub.PrescribedDisplacement(column.end, u=lambda t: reach * np.sin(6.0 * t) ** 2)
    scene = ub.Scene([column], supports=[ub.Clamped(column.start), top])
    simulation = ub.Simulation(scene, scheme)
    for n in range(1, 6):
        simulation.step_to(0.1 * n)
    return simulation


@pytest.mark.parametrize("number", [8, 11])
@pytest.mark.parametrize(
    ("law", "scheme"),
    [
        ("MenegottoPinto", ub.Static()),
        ("MenegottoPinto", ub.EnergyMomentum()),
        ("KentPark", ub.Static()),
        ("Mander", ub.Static()),
    ],
    ids=str,
)
def test_loops_over_fibres_change_nothing(law, scheme, number, monkeypatch):
    """Both runs stop at the relative tolerance of Newton's method, 1e-8.

    The dynamics of cracked concrete is chaotic.
    """
    several = fibre_run(law, scheme, number)
    assert several.inelastic[0].points.c.law_loop
    assert several.inelastic[0].points.c.end_loop
    monkeypatch.setattr("ufl_beam.blocks.material_points.BATCH", 100)
    one = fibre_run(law, scheme, number)
    assert not one.inelastic[0].points.c.law_loop
    assert np.allclose(several.q, one.q, rtol=0, atol=1e-7 * np.abs(one.q).max())
    energies = [run.entries()[0] for run in (several, one)]
    assert energies[0] == pytest.approx(
        energies[1], rel=1e-6, abs=1e-6 * one.entries()[0]["stored"]
    )
    assert one.inelastic[0].points.recorded[:, 4].sum() > 0


@pytest.mark.parametrize("law", LAWS)
def test_a_loop_over_fibres_agrees_with_the_law(law):
    """Stresses, slopes and outputs at the end of a step at random inputs of eleven points."""
    points = fibre_run(law, ub.Static(), 11).inelastic[0].points
    w, c = points._storage[0].copy(), points.c
    E, strain = w[0, points.names.index("stiffness")], 1e-3
    w[:, points.names.index("strain")] += strain * np.random.default_rng(8).normal(size=11)
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


def test_laws_without_slow_functions_have_no_loop():
    section = ub.Section.rectangle(
        b=0.1, h=0.1, E=1e9, nu=0.3, rho=1.0, fibres=ub.Fibres(ub.ElastoPlastic(1e6), number=8)
    )
    beam = ub.Beam((0, 0), (1, 0), section, cells=2)
    simulation = ub.Simulation(clamped(beam), ub.EnergyMomentum())
    assert not simulation.inelastic[0].points.c.law_loop
