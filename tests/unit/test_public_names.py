# SPDX-License-Identifier: MIT
"""Public names: classes of the parts of a model, results that are not exported, old names."""

import math
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from scenes import SECTION

import ufl_beam as ub
import ufl_beam.structures

LEFT = ub.Beam((0, 0), (1, 0), SECTION, cells=2, name="left")
RIGHT = ub.Beam((1, 0), (2, 0), SECTION, cells=2, name="right")
HIGH = ub.Beam((1, 1), (2, 1), SECTION, cells=2, name="high")
BODY = ub.Body((2, 0), mass=1.0, inertia=0.1)

PARTS = {
    ub.Support: {
        ub.Clamped: ub.Clamped(LEFT.start),
        ub.Pinned: ub.Pinned(LEFT.start),
        ub.Roller: ub.Roller(LEFT.start, along=(1, 1)),
        ub.PrescribedDisplacement: ub.PrescribedDisplacement(LEFT.start, u=math.sin, psi=0.1),
    },
    ub.Joint: {
        ub.Rigid: ub.Rigid(LEFT.end, RIGHT.start, multipliers=True),
        ub.Revolute: ub.Revolute(LEFT.end, RIGHT.start),
        ub.Prismatic: ub.Prismatic(LEFT.start, RIGHT.end, turning=True),
        ub.RigidLink: ub.RigidLink(LEFT.end, HIGH.start),
        ub.Link: ub.Link(LEFT.end, HIGH.start),
        ub.Guided: ub.Guided(LEFT.end, lambda s: (1 + s, s**2)),
        ub.Release: ub.Release(LEFT.end, RIGHT.start, free="NV"),
    },
    ub.Connector: {
        ub.Turn: ub.Turn(LEFT.end, RIGHT.start, ub.Spring(1.0)),
        ub.Stretch: ub.Stretch(LEFT.end, HIGH.start, ub.Damper(1.0)),
        ub.Slide: ub.Slide(LEFT.start, RIGHT.end, ub.Spring(1.0)),
        ub.Bushing: ub.Bushing(LEFT.end, RIGHT.start, ub.Clearance(1e6, gap=1e-3)),
    },
}

ALL = [(base, kind) for base, kinds in PARTS.items() for kind in kinds]


@pytest.mark.parametrize(("base", "kind"), ALL, ids=lambda kind: kind.__name__)
def test_parts_of_models_have_classes(base, kind):
    part = PARTS[base][kind]
    assert isinstance(part, kind)
    assert isinstance(part, base)
    others = [other for _, other in ALL if other is not kind]
    assert not any(isinstance(part, other) for other in others)
    assert str(part).startswith(kind.__name__)
    assert repr(part) == f"<{part}>"
    assert len({part, part}) == 1


@pytest.mark.parametrize("base", PARTS)
def test_bases_make_no_parts(base):
    with pytest.raises(TypeError):
        base(LEFT.start)


def test_arguments_are_attributes():
    assert PARTS[ub.Joint][ub.Rigid].multipliers is True
    assert PARTS[ub.Joint][ub.Release].free == "NV"
    assert PARTS[ub.Support][ub.Roller].along == (1.0, 1.0)
    assert PARTS[ub.Support][ub.PrescribedDisplacement].u is math.sin
    assert np.allclose(PARTS[ub.Connector][ub.Slide].axis, (1, 0))


def test_old_names_lead_to_new_ones():
    for old, new in ub.OLD_NAMES.items():
        with pytest.raises(
            AttributeError, match=f"has no attribute '{old}'; it is ufl_beam."
        ) as error:
            getattr(ub, old)
        assert new in str(error.value)
        assert attrgetter(new.split("(")[0].split(",")[0])(ub)
    with pytest.raises(AttributeError, match=r"has no attribute 'Nothing'$"):
        ub.Nothing  # noqa: B018
    assert not hasattr(ub, "Hardening")


BEFORE = (Path(__file__).parents[1] / "data" / "names_of_33c323e1.txt").read_text().split()
"""Public names of the last commit with all names in one module."""


@pytest.mark.parametrize("name", BEFORE)
def test_names_of_an_earlier_commit_exist_or_lead_to_new_ones(name):
    if name in ub.__all__ or name in ub.RESULTS:
        assert hasattr(ub, name)
        return
    with pytest.raises(AttributeError, match=f"'{name}'; it is ufl_beam") as error:
        getattr(ub, name)
    new = str(error.value).split("it is ufl_beam.")[1].split()[0]
    assert attrgetter(new)(ub)


@pytest.mark.parametrize("name", ["steel", "box", "i_shape", "channel", "t_shape"])
def test_methods_that_moved_lead_to_functions(name):
    with pytest.raises(AttributeError, match=f"Section.{name} is ufl_beam.structures.{name} now"):
        getattr(ub.Section, name)
    assert attrgetter(f"structures.{name}")(ub)


def test_results_are_not_exported():
    assert not {*ub.RESULTS} & {*ub.__all__}
    assert all(isinstance(getattr(ub, name), type) for name in ub.RESULTS)
    assert sorted(ub.RESULTS) == ub.RESULTS
