# SPDX-License-Identifier: MIT
"""Public names: bases of the parts of a model, results that are not exported, old names."""

from operator import attrgetter
from pathlib import Path

import pytest
from helpers import raises

import ufl_beam as ub
import ufl_beam.structures


@pytest.mark.parametrize(
    ("base", "part"),
    [(ub.Support, ub.Clamped), (ub.extend.Joint, ub.RigidLink), (ub.Connector, ub.Bushing)],
)
def test_bases_make_no_parts(base, part):
    assert issubclass(part, base)
    with pytest.raises(TypeError):
        base(ub.ground(0, 0))


def no_attribute(*words):
    return raises(*words, kind=AttributeError)


def test_old_names_lead_to_new_ones():
    for old, new in ub.OLD_NAMES.items():
        with no_attribute(f"has no attribute '{old}'; it is ufl_beam.", new):
            getattr(ub, old)
        assert attrgetter(new.split("(")[0].split(",")[0])(ub)
    with pytest.raises(AttributeError, match=r"has no attribute 'Nothing'$"):
        ub.Nothing  # noqa: B018
    assert not hasattr(ub, "Hardening")


def test_names_of_an_earlier_commit_exist_or_lead_to_new_ones():
    """Public names of the last commit with all names in one module."""
    data = Path(__file__).parents[1] / "data"
    for name in (data / "names_of_33c323e1.txt").read_text().split():
        if name in ub.__all__ or name in ub.RESULTS:
            assert hasattr(ub, name)
        else:
            with no_attribute(f"'{name}'; it is ufl_beam") as error:
                getattr(ub, name)
            new = str(error.value).split("it is ufl_beam.")[1].split()[0]
            assert attrgetter(new)(ub)


@pytest.mark.parametrize("name", ["steel", "box", "i_shape", "channel", "t_shape"])
def test_methods_that_moved_lead_to_functions(name):
    with no_attribute(f"Section.{name} is ufl_beam.structures.{name} now"):
        getattr(ub.Section, name)
    assert attrgetter(f"structures.{name}")(ub)


def test_results_are_not_exported():
    assert not {*ub.RESULTS} & {*ub.__all__}
    assert all(isinstance(getattr(ub, name), type) for name in ub.RESULTS)
    assert sorted(ub.RESULTS) == ub.RESULTS
