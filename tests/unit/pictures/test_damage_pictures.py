# SPDX-License-Identifier: MIT
"""Pictures and files of what yields and breaks: the arrays of the solution, with units."""

import numpy as np
import pytest
from drawn import FRACTURE, circles, moved, outlines, static, yielding_beam
from time_series import read_xdmf

import ufl_beam as ub
from ufl_beam.plotting.style import decimal_prefix, with_unit


def path_in(axes):
    """The points that a line coloured by time runs through."""
    (pieces,) = [c for c in axes.collections if len(c.get_paths()) > 20]
    segments = np.array([p.vertices for p in pieces.get_paths()])
    np.testing.assert_array_equal(segments[1:, 0], segments[:-1, 1])
    return np.concatenate([segments[:, 0], segments[-1:, 1]]), pieces


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_path_of_moment_and_curvature_is_that_of_the_law(damaged, arm):
    place = arm.at(0.3)
    figure = ub.plot(damaged, "moment-curvature", place)
    axes, bar = figure.axes
    path, pieces = path_in(axes)
    np.testing.assert_array_equal(path[:, 0], damaged.strains_at(place)[:, 2])
    np.testing.assert_array_equal(path[:, 1], damaged.material_at(place).forces[:, 2])  # of the law
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("curvature K (1/m)", "bending moment M (N m)")
    assert axes.get_title(loc="left") == f"cell at {place}"
    assert bar.get_ylabel() == "time t (s)"
    assert bar.get_ylim() == (0.0, 3.0)
    # From light to dark, and marks at both ends
    brightness = pieces.get_colors()[:, :3].mean(axis=1)
    assert brightness[0] > brightness[-1]
    assert legend(figure) == ["t = 0 s", "t = 3 s"]
    for mark, end in zip(circles(axes), path[[0, -1]], strict=True):
        np.testing.assert_array_equal(mark.get_xydata()[0], end)


def test_the_path_of_a_hinge_has_its_jump_and_moment(damaged, arm):
    """It turns to and fro; the filled area is the dissipated energy."""
    state = damaged.material_at(arm.start)
    assert state.plastic[-1] > 0
    assert 0.1 * FRACTURE < state.hinge[-1] < 0.95 * FRACTURE
    assert np.diff(state.jump).min() < 0 < np.diff(state.jump).max()
    axes = ub.plot(damaged, "hinge", arm.start).axes[0]
    path, _ = path_in(axes)
    np.testing.assert_array_equal(path, np.column_stack([state.jump, state.forces[:, 2]]))
    assert axes.get_xlabel() == "jump of rotation (mrad)"
    assert axes.get_ylabel() == "bending moment M (N m)"
    title, spent = axes.get_title(loc="left"), with_unit(state.hinge[-1], "J")
    assert f"hinge at {arm.start}" in title
    assert f"{spent} dissipated, {100 * state.hinge[-1] / FRACTURE:.3g} % of 3 J" in title
    fills = [c for c in axes.collections if len(c.get_paths()) < 9]
    points = [path.vertices.T for fill in fills for path in fill.get_paths()]
    areas = [abs(np.sum(x[:-1] * M[1:] - x[1:] * M[:-1])) / 2 for x, M in points]
    # The steps in which the hinge begins to open start below its limit: by the moment of one step,
    # a tenth of the limit, over a jump that is a fiftieth of the whole.
    assert sum(areas) == pytest.approx(state.hinge[-1], rel=0.02)


def test_damage_colours_the_cells_that_yielded(damaged, arm):
    figure = ub.plot(damaged, "damage", n=50, magnify=2)
    axes, bar = figure.axes
    dissipated = damaged.material(arm, 50).plastic
    yielded = np.flatnonzero(dissipated)
    assert 0 < len(yielded) < 4
    rest = damaged.numbering.points[damaged.numbering.vertices_of(arm)]
    points = rest + 2 * (damaged.shape(arm, 50) - rest)
    expected = np.stack([points[yielded], points[yielded + 1]], axis=1)
    np.testing.assert_allclose(outlines(figure, "yielded"), expected)
    largest = dissipated.max() / 0.25  # cells of 0.25 m
    unit, prefix = decimal_prefix(largest)
    assert bar.get_ylabel() == f"dissipated by plastic strains ({prefix}J/m)"
    assert bar.get_ylim()[1] == pytest.approx(largest / unit)
    assert axes.get_title(loc="left") == "damage at t = 1 s, displacements × 2"


def test_damage_marks_hinges_by_the_broken_part(damaged, arm):
    first = int(np.flatnonzero(damaged.material_at(arm.start).hinge)[0])
    sizes = []
    for n in (first, -1):
        figure = ub.plot(damaged, "damage", n=n)
        (mark,) = circles(figure.axes[0])
        np.testing.assert_allclose(mark.get_xydata()[0], damaged.shape(arm, n)[0])
        assert mark.get_markerfacecolor() != "white"
        assert legend(figure) == ["hinge, 10 % broken", "50 %", "fully open"]
        sizes.append(mark.get_markersize())
    assert sizes[0] < sizes[1]
    before = ub.plot(damaged, "damage", n=0)
    assert len(before.axes) == 1  # no colour bar
    assert not [*outlines(before, "yielded"), *circles(before.axes[0]), *before.legends]


@pytest.mark.parametrize("law", [ub.Softening(0.0, 1.0), ub.LinearSoftening(1.0, 1e-2)])
def test_a_fully_open_hinge_is_hollow(law):
    """A hinge without resistance, and one of linear softening turned beyond 2 G/M = 0.02.

    The end does not turn, so that what is left is no mechanism.
    """
    section = ub.Section(EA=1e6, GA=1e6, EI=100.0)
    beam = ub.Beam((0, 0), (1, 0), section, cells=2, hinges={0.0: law})
    scene = moved(beam, v=lambda t: 0.1 * t, psi=0)
    solution = ub.simulate(scene, ub.EnergyMomentumStatic(), t=(0, 1), dt=0.05)
    (mark,) = circles(ub.plot(solution, "damage").axes[0])
    assert mark.get_markerfacecolor() == "white"


def test_cracks_of_fibres_are_damage():
    law = ub.Fibres(ub.ElastoPlastic(np.inf), number=4, softening=ub.Softening(1e6, 100.0))
    section = ub.Section.rectangle(b=0.1, h=0.2, E=30e9, nu=0.2, fibres=law)
    beam = ub.Beam((0, 0), (1, 0), section, cells=1)
    solution = static(moved(beam, u=lambda t: 1e-4 * t), dt=0.1)
    axes, bar = ub.plot(solution, "damage").axes
    assert bar.get_ylabel() == "dissipated by plastic strains and cracks (J/m)"
    # One cell of 1 m: its energy is the upper end of the bar
    assert bar.get_ylim()[1] == pytest.approx(solution.material(beam).hinge[0])
    assert not circles(axes)


def lines_of(figure):
    return {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}


def test_dissipation_stacks_the_losses_of_the_ledger(damaged):
    figure = ub.plot(damaged, "dissipation")
    (axes,), energy = figure.axes, damaged.energy
    lower = np.zeros_like(damaged.times)
    assert len(axes.collections) == len(energy.lost) == 3
    for area, (name, lost) in zip(axes.collections, energy.lost.items(), strict=True):
        assert area.get_label() == f"lost: {name}"
        (outline,) = [path.vertices for path in area.get_paths()]
        for bound in (lower, lower + lost):
            points = np.column_stack([damaged.times, bound])
            # The outline holds them to the rounding of the sum
            apart = np.abs(outline[None] - points[:, None]).sum(axis=2).min(axis=1)
            assert apart.max() <= 1e-14 * energy.energy_transferred
        lower = lower + lost
    drawn = lines_of(figure)
    np.testing.assert_array_equal(drawn["supplied"], sum(energy.supplied.values()))
    np.testing.assert_array_equal(drawn["in the scene"], energy.total)
    assert axes.get_ylabel() == "energy (J)"
    title = axes.get_title(loc="left")
    assert title.endswith(f"of {with_unit(energy.energy_transferred, 'J')} transferred")
    assert f"{energy.worst:.1e}".split("e")[0] in title
    losses = {f"lost: {name}" for name in energy.lost}
    assert {*legend(figure)} == {"supplied", "in the scene", *losses} == {*drawn, *losses}


def test_xdmf_holds_jumps_and_dissipated_energies(shared_path, on_first_rank):
    beam, path = yielding_beam(), shared_path / "run.xdmf"
    scene, scheme = moved(beam, v=lambda t: 0.1 * t), ub.EnergyMomentumStatic()
    solution = ub.simulate(scene, scheme, t=(0, 1), dt=0.1, record=ub.XDMF(path))
    written = on_first_rank(lambda: read_xdmf(path)).in_cells[-1]
    state, hinge = solution.material(beam), solution.material_at(beam.start)
    jump, spent = (np.where(np.arange(4) == 0, x[-1], 0.0) for x in (hinge.jump, hinge.hinge))
    # Copies, so equal to the last bit
    np.testing.assert_array_equal(written["M"], solution.section_forces(beam)[:, 2])
    np.testing.assert_array_equal(written["jump"], jump)
    np.testing.assert_array_equal(written["dissipated energy"], state.plastic + spent)
    assert jump[0] != 0


@pytest.mark.parametrize("what", ["moment-curvature", "hinge", "damage", "dissipation"])
def test_elastic_scenes_are_refused(portal, what):
    places = [portal.scene.beams[0].end] if what in ("moment-curvature", "hinge") else []
    with pytest.raises(ub.ArgumentError, match="no beam of the scene yields or breaks"):
        ub.plot(portal, what, *places)


def test_a_cell_without_a_hinge_is_refused(damaged, arm):
    with pytest.raises(ub.ArgumentError, match=r"plot: neither arm.at\(0.9\).*has a hinge"):
        ub.plot(damaged, "hinge", arm.at(0.9))
