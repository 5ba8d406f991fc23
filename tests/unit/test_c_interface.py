# SPDX-License-Identifier: MIT
"""Interface between Python, C and PETSc: names, errors, versions, and Newton's method in both."""

import runpy
import subprocess
import sys

from petsc4py import PETSc

import cffi
import dolfinx
import numpy as np
import pytest
from helpers import run
from scenes import SECTION, rigid_chain

import ufl_beam as ub
from ufl_beam import dolfinx_compat
from ufl_beam.compiled import c_library
from ufl_beam.compiled.c_library import ffi, in_order, lib, names, petsc

serial = pytest.mark.serial  # independent of the number of processes


@serial
@pytest.mark.parametrize("change", [{"worked": None}, {"heat": 0.0}], ids=["missing", "unknown"])
def test_other_outputs_than_those_of_c_are_refused(change):
    values = dict.fromkeys(names("point_output"), 0.0) | change
    values = {name: value for name, value in values.items() if value is not None}
    with pytest.raises(ValueError, match=r"point_output is .*'worked'.* in loops\.h"):
        in_order("point_output", values)


@serial
def test_libraries_show_nothing_but_their_module():
    """A visible function would give way to one of the same name in another library."""
    command = ["nm", "-D", "--defined-only", c_library.module.__file__]
    listed = subprocess.run(command, capture_output=True, text=True, check=True)
    symbols = {line.split()[-1] for line in listed.stdout.splitlines()}
    assert symbols == {f"PyInit_{c_library.module.__name__}"}


@serial
def test_other_types_are_refused():
    """Calls of kernels of another type would have no defined behaviour."""
    of = cffi.FFI()
    pointer = of.cast("void (*)(double *, const double *, int)", 0)
    with pytest.raises(RuntimeError, match=r"DOLFINx .* FFCx .* C type void.*int\); ufl_beam ca"):
        c_library.kernel(pointer, of)
    with pytest.raises(TypeError, match="32 bits, not int64"):
        c_library.integers(np.arange(3))


@serial
@pytest.mark.parametrize(
    ("version", "numbers", "kind", "message"),
    [
        ("0.8.0", None, ImportError, r"needs DOLFINx 0\.9 or newer, this is 0\.8\.0"),
        ("0.12.1", None, RuntimeWarning, r"with DOLFINx 0\.9 to 0\.11, and not with 0\.12\.1"),
        ("0.10.0.post4", np.float32, ImportError, "real numbers of double.*float32"),
        ("0.10.0.post4", None, None, ""),
    ],
)
def test_versions_of_dolfinx_and_numbers_of_petsc(monkeypatch, version, numbers, kind, message):
    """Old ones are refused, unknown ones are said, and known ones issue no warning."""
    monkeypatch.setattr(dolfinx, "__version__", version)
    if numbers:
        monkeypatch.setattr(PETSc, "ScalarType", numbers)
    if kind is None:
        assert runpy.run_path(dolfinx_compat.__file__)["VERSION"] == (0, 10)
    else:
        expected = pytest.warns if kind is RuntimeWarning else pytest.raises
        with expected(kind, match=message):
            runpy.run_path(dolfinx_compat.__file__)


def inelastic():
    hinge = {1.0: ub.Softening(limit=30.0, fracture_energy=5.0)}
    law = ub.ElastoPlastic(yield_limit=20.0, isotropic=5.0, kinematic=3.0)
    soft = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0, bending=law)
    left = ub.Beam((0, 0), (0, 3), soft, cells=4)
    roof = ub.Beam((0, 3), (4, 3), SECTION, cells=4, hinges=hinge)
    return rigid_chain(
        [left, roof],
        supports=[ub.Clamped(left.start), ub.Pinned(roof.end)],
        loads=[ub.PointLoad(left.end, force=(40.0, -10.0), amplitude=lambda t: min(t, 0.2))],
        damping=[ub.Rayleigh(mass=0.1, stiffness=1e-3)],
    )


def machine():
    """Something held, something sprung, a law that only Python knows, and a guide."""
    crank = ub.Beam((0, 0), (1, 0), SECTION, cells=3)
    rod = ub.Beam((1, 0), (3, 0), SECTION, cells=4)
    spring = ub.Spring(50.0, law=ub.ElastoPlastic(yield_limit=5.0, kinematic=2.0))
    force = ub.ForceLaw(lambda e, de: 3.0 * e**3 + 0.1 * de)
    turn = ub.Turn(crank.end, rod.start, spring)
    return ub.Scene(
        [crank, rod],
        joints=[ub.Revolute(crank.end, rod.start), ub.Guided(rod.end, lambda s: (3.0 + s, 0.0))],
        connectors=[turn, ub.Stretch(ub.ground(3.0, 0.5), rod.end, force)],
        supports=[ub.Pinned(crank.start)],
        loads=[ub.PointLoad(rod.at(0.5), force=(0.0, 10.0))],
    )


@pytest.mark.parametrize("make", [inelastic, machine])
def test_options_bring_the_solver_of_petsc(make):
    """The same iterations, and no fewer if more tangents are kept."""
    own, theirs, lagged = (
        run(make(), t=(0, 0.4), dt=0.02, newton=ub.Newton(petsc=options))
        for options in ({}, {"snes_type": "newtonls"}, {"snes_lag_jacobian": "2"})
    )
    assert theirs.iterations == own.iterations
    assert np.allclose(theirs.q, own.q, rtol=0, atol=1e-11)
    assert lagged.substeps == own.substeps
    assert lagged.iterations >= own.iterations
    # Residuals of 1e-10 of forces of 1e2 N, on stiffnesses of some 10 N/m, in 20 steps.
    assert np.allclose(own.q, lagged.q, rtol=0, atol=20 * 1e-9)
    assert lagged.energy.worst < 1e-8


def test_an_interrupt_at_the_door_of_a_callback_is_not_lost():
    """It comes before the first line of what C calls, and cffi would only print it."""

    def interrupt(frame, event, argument):
        if frame.f_code.co_name == "call_in_python":
            sys.settrace(None)
            raise KeyboardInterrupt

    simulation, whole = (ub.Simulation(machine(), ub.EnergyMomentum()) for _ in range(2))
    simulation.step_to(0.02)
    before = sys.gettrace()
    sys.settrace(interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            simulation.step_to(0.04)
    finally:
        sys.settrace(before)
    assert simulation.t == 0.02
    simulation.step_to(0.04)
    whole.step_to(0.02)
    whole.step_to(0.04)
    np.testing.assert_array_equal(simulation.q, whole.q)


@serial
def test_errors_of_petsc_that_python_meets():
    says = "VecLockReadPop of PETSc failed with error 73: .*: Vector has been unlocked .* too many"
    with pytest.raises(RuntimeError, match=says):
        petsc("VecLockReadPop", PETSc.Vec().createSeq(2))


class FailsOnce:
    """Factors whose second solve fails, as those of KLU may."""

    def __init__(self, factors, error):
        self.factors, self.error, self.solves = factors, error, 0

    def __getattr__(self, name):
        return getattr(self.factors, name)

    def apply(self, b, x):
        self.solves += 1
        if self.solves == 2:
            raise PETSc.Error(self.error)
        self.factors.apply(b, x)


@serial
def test_a_solve_of_petsc_that_fails():
    """An error of the library is a singular tangent, and cuts the step; others are raised.

    There are more joints with multipliers than fit into one front: KLU factors what is left.
    """
    beam = ub.Beam((0, 0), (4, 3), SECTION, cells=8)
    places = [beam.at(s) for s in (0.25, 0.5, 0.75, 1.0)]
    braces = [ub.Beam((p.point[0], 0), p.point, SECTION, cells=2) for p in places]
    pins = [ub.Revolute(p, b.end, multipliers=True) for p, b in zip(places, braces, strict=True)]
    clamps = [ub.Clamped(one.start) for one in (beam, *braces)]
    load = ub.PointLoad(beam.end, force=(300.0, 500.0))
    scene = ub.Scene([beam, *braces], joints=pins, supports=clamps, loads=[load])
    for error in (lib.OF_LIBRARY, 60):
        newton = ub.Newton(petsc={"snes_type": "newtonls"})
        simulation = ub.Simulation(scene, ub.Static(), newton=newton)
        klu = simulation.solver._factors._solved
        klu._factors = FailsOnce(klu._factors, error)
        if error == lib.OF_LIBRARY:
            simulation.step_to(1.0)
            assert simulation.substeps > 1
        else:
            with pytest.raises(PETSc.Error, match="error code 60"):
                simulation.step_to(1.0)
    simulation = ub.Simulation(scene, ub.Static())  # an error that C meets
    simulation.step_to(0.5)
    short = PETSc.Vec().createSeq(2)
    simulation.solver._equation.c.left_x = ffi.cast("void *", short.handle)
    with pytest.raises(PETSc.Error, match=r"Nonconforming object sizes|error code 60"):
        simulation.step_to(1.0)
