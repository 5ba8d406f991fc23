# SPDX-License-Identifier: MIT
"""Interface between Python and C: one description of names, and refusals where both differ."""

import subprocess

from petsc4py import PETSc

import pytest

import ufl_beam as ub
from ufl_beam.compiled import c_library
from ufl_beam.compiled.c_library import ffi, in_order, lib, names, petsc
from ufl_beam.terms import material_points, rigid_plastic

pytestmark = pytest.mark.serial  # nothing here depends on the number of processes


def test_inputs_of_points_are_where_c_has_them():
    """Python takes their order from loops.h."""
    for inputs, enum, prefix in (
        (material_points.INPUTS, "point_input", ""),
        (rigid_plastic.INPUTS, "slip_input", "slip_"),
    ):
        of_c = names(enum, prefix)
        assert inputs[: len(of_c)] == of_c
        assert len(set(inputs)) == len(inputs)
    for name in names("point_input"):
        assert getattr(lib, name.upper()) == material_points.INPUTS.index(name)
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
    with pytest.raises(PETSc.Error, match="unlocked from read-only access too many times"):
        petsc("VecLockReadPop", PETSc.Vec().createSeq(2))


def test_errors_of_petsc_that_c_meets():
    """They end Newton's method in C, and are no singular tangent."""
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=1.0)
    beam = ub.Beam((0, 0), (4, 3), section, cells=6)
    loads = [ub.PointLoad(beam.end, force=(3.0, 5.0))]
    scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=loads)
    simulation = ub.Simulation(scene, ub.Static())
    simulation.step_to(0.5)
    short = PETSc.Vec().createSeq(2)
    simulation._solver._equation.c.left_x = ffi.cast("void *", short.handle)
    with pytest.raises(PETSc.Error, match="Nonconforming object sizes"):
        simulation.step_to(1.0)
