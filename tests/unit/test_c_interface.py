# SPDX-License-Identifier: MIT
"""Interface between Python and C: one description of names, and refusals where both differ."""

import runpy
import subprocess
import weakref

from petsc4py import PETSc

import cffi
import dolfinx
import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam import dolfinx_compat
from ufl_beam.compiled import c_library
from ufl_beam.compiled.c_library import ffi, in_order, lib, names, petsc
from ufl_beam.mechanics.point_equations import inputs as inputs_of_points

pytestmark = pytest.mark.serial  # nothing here depends on the number of processes


SECTION = ub.Section(EA=1e4, GA=1e4, EI=100.0, bending=ub.ElastoPlastic(1.0))


def test_inputs_of_points_are_where_c_has_them():
    """Python takes their order from loops.h."""
    for inputs, enum, prefix in (
        (inputs_of_points(SECTION.section_points(None)[0]), "point_input", ""),
    ):
        of_c = names(enum, prefix)
        assert inputs[: len(of_c)] == of_c
        assert len(set(inputs)) == len(inputs)
    for name in names("point_input"):
        assert getattr(lib, name.upper()) == inputs_of_points(
            SECTION.section_points(None)[0]
        ).index(name)
    assert len(names("point_input")) == lib.POINT_INPUTS


def test_outputs_come_in_the_order_of_c():
    values = {name: name.upper() for name in reversed(names("point_output"))}
    ordered = in_order("point_output", values)
    assert [getattr(lib, name) for name in ordered] == list(range(lib.POINT_OUTPUTS))


@pytest.mark.parametrize("change", [{"worked": None}, {"heat": 0.0}], ids=["missing", "unknown"])
def test_other_outputs_than_those_of_c_are_refused(change):
    values = dict.fromkeys(names("point_output"), 0.0) | change
    values = {name: value for name, value in values.items() if value is not None}
    with pytest.raises(ValueError, match=r"point_output is .*'worked'.* in loops\.h"):
        in_order("point_output", values)


# -- symbols -------------------------------------------------------------------------------------


def test_libraries_show_nothing_but_their_module():
    """A visible function would give way to one of the same name in another library."""
    command = ["nm", "-D", "--defined-only", c_library.module.__file__]
    listed = subprocess.run(command, capture_output=True, text=True, check=True)
    symbols = {line.split()[-1] for line in listed.stdout.splitlines()}
    assert symbols == {f"PyInit_{c_library.module.__name__}"}


# -- PETSc ---------------------------------------------------------------------------------------


def test_errors_of_petsc_that_python_meets():
    says = "VecLockReadPop of PETSc failed with error 73: .*: Vector has been unlocked .* too many"
    with pytest.raises(RuntimeError, match=says):
        petsc("VecLockReadPop", PETSc.Vec().createSeq(2))


@pytest.fixture
def simulation():
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((0, 0), (4, 3), section, cells=8)
    loads = [ub.PointLoad(beam.end, force=(300.0, 500.0))]
    # Joints with multipliers, more than fit into one front: KLU factors what the chains leave.
    places = [beam.at(s) for s in (0.25, 0.5, 0.75, 1.0)]
    braces = [ub.Beam((p.point[0], 0), p.point, section, cells=2) for p in places]
    pins = [ub.Revolute(p, b.end, multipliers=True) for p, b in zip(places, braces, strict=True)]
    clamps = [ub.Clamped(one.start) for one in (beam, *braces)]
    scene = ub.Scene([beam, *braces], joints=pins, supports=clamps, loads=loads)
    return ub.Simulation(scene, ub.Static())


def test_errors_of_petsc_that_c_meets(simulation):
    """They end Newton's method in C, and are no singular tangent."""
    simulation.step_to(0.5)
    short = PETSc.Vec().createSeq(2)
    simulation.solver._equation.c.left_x = ffi.cast("void *", short.handle)
    with pytest.raises(PETSc.Error, match=r"Nonconforming object sizes|error code 60"):
        simulation.step_to(1.0)


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


def test_a_solve_of_petsc_that_fails(simulation):
    """An error of the library is a singular tangent, and cuts the step; others are raised."""
    scene, newton = simulation.scene, ub.Newton(petsc={"snes_type": "newtonls"})
    for error in (lib.OF_LIBRARY, 60):
        simulation = ub.Simulation(scene, ub.Static(), newton=newton)
        klu = simulation.solver._factors._solved
        klu._factors = FailsOnce(klu._factors, error)
        if error == lib.OF_LIBRARY:
            simulation.step_to(1.0)
            assert simulation.substeps > 1
        else:
            with pytest.raises(PETSc.Error, match="error code 60"):
                simulation.step_to(1.0)


# -- versions of DOLFINx and PETSc ---------------------------------------------------------------


def imported():
    """Run the module that looks at the versions as an import does."""
    return runpy.run_path(dolfinx_compat.__file__)


def test_versions_before_the_first_are_refused(monkeypatch):
    monkeypatch.setattr(dolfinx, "__version__", "0.8.0")
    with pytest.raises(ImportError, match=r"needs DOLFINx 0\.9 or newer, this is 0\.8\.0"):
        imported()


def test_versions_after_the_last_are_said(monkeypatch):
    monkeypatch.setattr(dolfinx, "__version__", "0.12.1")
    with pytest.warns(RuntimeWarning, match=r"with DOLFINx 0\.9 to 0\.11, and not with 0\.12\.1"):
        assert imported()["VERSION"] == (0, 12)


@pytest.mark.parametrize("version", ["0.9.0", "0.10.0.post4", "0.11.0"])
def test_known_versions_do_not_warn(monkeypatch, recwarn, version):
    monkeypatch.setattr(dolfinx, "__version__", version)
    imported()
    assert not recwarn


@pytest.mark.parametrize("numbers", [np.complex128, np.float32])
def test_other_numbers_of_petsc_are_refused(monkeypatch, numbers):
    monkeypatch.setattr(PETSc, "ScalarType", numbers)
    with pytest.raises(ImportError, match=f"real numbers of double.*{numbers.__name__}"):
        imported()


def test_kernels_of_another_type_are_refused():
    """Their calls would have no defined behaviour."""
    of = cffi.FFI()
    pointer = of.cast("void (*)(double *, const double *, int)", 0)
    with pytest.raises(
        RuntimeError, match=r"DOLFINx .* FFCx .* C type void.*int\); ufl_beam calls"
    ):
        c_library.kernel(pointer, of)


# -- structs -------------------------------------------------------------------------------------


def test_arrays_live_as_long_as_the_struct_that_points_to_them():
    values = np.array([1.0, 2.0])
    alive = weakref.ref(values)
    struct = c_library.fill(ffi.new("vector *"), size=2, values=values)
    del values
    assert list(struct.values[0 : struct.size]) == [1.0, 2.0]
    assert alive() is not None
    del struct
    assert alive() is None


# -- sizes and types -----------------------------------------------------------------------------


def test_integers_of_another_size_are_refused():
    with pytest.raises(TypeError, match="32 bits, not int64"):
        c_library.integers(np.arange(3))
