# SPDX-License-Identifier: MIT
"""Interface between Python and C: one description of names, and refusals where both differ."""

import pytest

from ufl_beam.compiled.c_library import in_order, lib, names
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
