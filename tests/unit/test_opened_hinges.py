# SPDX-License-Identifier: MIT
"""Reports on cells that opened: how far the place of a hinge shifts its limit, openings in a jump.

The beam has no moment at its ends, so its hinge opens in a cell of the span: next to the push at a
quarter of the length, on the longer side, where the moment in the middle of a cell is larger.
"""

import math
import warnings

import numpy as np
import pytest

import ufl_beam as ub
from ufl_beam.simulation.solution import _fall

LENGTH, EI, LIMIT = 2.0, 1000.0, 10.0  # m, N m², N m
LONGER = 0.75 * LENGTH
each_law = pytest.mark.parametrize("law", [ub.Softening, ub.LinearSoftening])


warns = pytest.mark.serial
"""Warnings are those of the first process."""


def pushed(hinge=None, *, cells=8, fibres=None, name="girder"):
    """A beam on two supports that is moved by 4 mm at a quarter of its length."""
    section = ub.Section(EA=1e6, GA=1e6, EI=EI, rhoA=1.0, rhoI=1e-3, hinge=hinge)
    if fibres is not None:
        section = ub.Section.rectangle(0.1, 0.1, E=1.2e8, nu=0.2, rho=100.0, fibres=fibres)
    beam = ub.Beam((0, 0), (LENGTH, 0), section, cells=cells, name=name)
    push = ub.PrescribedDisplacement(beam.at(0.25), v=lambda t: 0.004 * t)
    return beam, ub.Scene([beam], supports=[ub.Pinned(beam.start), ub.Roller(beam.end), push])


def run(scene, scheme=None, dt=0.01, **options):
    scheme = scheme or ub.Static()
    return ub.simulate(scene, scheme, t=(0, 1), dt=dt, **options)


def place_error(cells):
    """[closed] |V| h / (2 M) with M = V (b - h/2) in the middle of the cell, b the longer side."""
    h = LENGTH / cells
    return h / (2 * LONGER - h)


# -- the place of a hinge --------------------------------------------------------------------------


@warns
@pytest.mark.parametrize("cells", [4, 8, 12])
def test_the_error_of_an_opened_place_is_told(cells):
    """The closed form, to 3 %: V is that of a kept time, 0.01 s of 0.5 s from the opening."""
    beam, scene = pushed(ub.Softening(LIMIT, 100.0), cells=cells)
    with pytest.warns(ub.ModelWarning, match="girder: the hinge of the section opened in 1 cell, "):
        solution = run(scene)
    assert solution.hinge_place_error() == {beam: pytest.approx(place_error(cells), rel=0.03)}
    s = 0.25 + 1 / (2 * cells)
    line = (
        "embedded hinges opened in 1 cell; their place within the cell shifts the limit by at most "
        f"{100 * solution.hinge_place_error()[beam]:.2g} % (girder, cell at s = {s:.3g})"
    )
    assert line in str(solution).splitlines()


@warns
def test_the_limit_is_shifted_by_the_place_error():
    """The moment under the push is above the limit by the place error when the hinge opens."""
    beam, scene = pushed(ub.Softening(LIMIT, 100.0))
    with pytest.warns(ub.ModelWarning, match=r"the same uncertainty.*hinges=\{s: law\}"):
        solution = run(scene, dt=0.001)
    opens = int(np.argmax(solution.material(beam).hinge))
    M = np.array([solution.section_forces(beam, n)[:, 2] for n in range(len(solution))])
    V = np.array([solution.section_forces(beam, n)[opens, 1] for n in range(len(solution))])
    first = int(np.argmax(solution.energy.lost["hinges"] > 0))
    at_push = np.abs(M[first, opens]) + np.abs(V[first]) * LENGTH / 8 / 2
    assert at_push / LIMIT - 1 == pytest.approx(place_error(8), rel=0.01)


def test_short_cells_are_not_warned_about():
    """Below 5 % a number, and no warning, which would fail the test."""
    beam, scene = pushed(ub.Softening(LIMIT, 100.0), cells=32)
    solution = run(scene)
    assert solution.hinge_place_error() == {beam: pytest.approx(place_error(32), rel=0.03)}
    assert "embedded hinges opened in 1 cell" in str(solution)


@pytest.mark.parametrize(
    "hinge", [None, ub.Softening(1e9, 1.0), ub.Softening(math.inf, 1.0)], ids=str
)
def test_what_stays_closed_has_no_error(hinge):
    """No beam is named, and no line is printed."""
    _, scene = pushed(hinge)
    solution = run(scene, dt=0.1)
    assert solution.hinge_place_error() == {}
    assert "embedded" not in str(solution)


def test_cracks_have_no_place():
    """A section of fibres is no hinge."""
    law = ub.Fibres(ub.ElastoPlastic(math.inf), number=4, softening=ub.Softening(1e4, 1e4))
    _, scene = pushed(fibres=law)
    solution = run(scene)
    assert solution.energy.lost["hinges"][-1] > 0
    assert solution.hinge_place_error() == {}


@warns
def test_only_the_run_in_which_it_opened_tells():
    """A run that goes on from another one does not know what V was."""
    _, scene = pushed(ub.Softening(LIMIT, 100.0))
    with pytest.warns(ub.ModelWarning):
        first = run(scene)
    again = ub.simulate(scene, ub.Static(), t=(1, 1.1), dt=0.01, start=first)
    assert again.hinge_place_error() == {}


# -- jumps -----------------------------------------------------------------------------------------


def needed(law, scheme, cells):
    """[closed] Energy from which the cell can follow: resistance and cell are as steep; J.

    All but ``Static()`` take the mean traction of a step, which falls half as fast.
    """
    mean, linear = scheme != ub.Static(), law is ub.LinearSoftening
    return LIMIT**2 / (2**linear * 2**mean) / (scheme.theta * EI / (LENGTH / cells))


@each_law
@pytest.mark.parametrize(
    "scheme", [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentum(0.2)], ids=str
)
def test_what_a_cell_can_follow(law, scheme):
    """[closed] To 1e-6, the part of the opening over which the slope is taken."""
    section_points = ub.Section(EA=1e6, GA=1e6, EI=EI).section_points(law(LIMIT, 3.0))[0]
    assert _fall(section_points, scheme)[0] * 0.25 == pytest.approx(
        needed(law, scheme, 8) / 3.0, rel=2e-6
    )


@warns
@each_law
def test_an_opening_in_a_jump_is_warned_about(law):
    """With 10 % less energy than needed, and not with 10 % more.

    Cells are so short that nothing is said of places.
    """
    scheme = ub.EnergyMomentum()
    energy = needed(law, scheme, cells=64)
    _, scene = pushed(law(LIMIT, 0.9 * energy), cells=64)
    with pytest.warns(
        ub.ModelWarning,
        match=r"girder: the hinge in the cell .* opened suddenly .* falls 1\.11 times",
    ) as found:
        run(scene, scheme)
    text = " ".join(str(one.message) for one in found)
    assert "cells shorter than 0.0281 m, or a fracture energy 1.11 times as large" in text
    _, scene = pushed(law(LIMIT, 1.1 * energy), cells=64)
    assert run(scene, scheme).energy.lost["hinges"][-1] > 0


def test_no_jump_that_did_not_happen():
    """The energy is small, but the hinge stays closed."""
    _, scene = pushed(ub.Softening(1e3, 1e-6))
    assert run(scene, ub.EnergyMomentum()).energy.lost["hinges"][-1] == 0.0


@warns
def test_cracks_open_in_a_jump():
    """A crack in a fibre of stiffness E; one warning of the beam, whatever the number of cracks."""
    law = ub.Fibres(ub.ElastoPlastic(math.inf), number=4, softening=ub.Softening(3e4, 1.1e-3))
    _, scene = pushed(fibres=law)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        solution = run(scene, ub.EnergyMomentum())
    assert solution.energy.lost["hinges"][-1] > 0
    (one,) = found
    ratio = 3e4**2 / (2 * 1.1e-3) / (0.5 * 1.2e8 / (LENGTH / 8))
    assert f"falls {ratio:.3g} times" in str(one.message)
    assert one.filename == ub.simulate.__code__.co_filename or one.filename == __file__


@warns
def test_paths_warn_too():
    """At the end of :func:`follow`."""
    beam, scene = pushed(ub.Softening(LIMIT, 100.0))
    with pytest.warns(ub.ModelWarning, match="girder: the hinge of the section"):
        path = ub.follow(scene, ub.DisplacementControl(beam.at(0.5), "v", 2e-4), steps=30)
    assert beam in path.hinge_place_error()
