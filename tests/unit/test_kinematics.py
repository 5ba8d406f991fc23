# SPDX-License-Identifier: MIT
"""Strains and their algorithmic variation, at random states of cells in random directions."""

import math

import basix.ufl
import numpy as np
import pytest
import ufl

import ufl_beam as ub
from ufl_beam.dolfinx_compat import fem, line_mesh
from ufl_beam.mechanics import kinematics
from ufl_beam.mechanics.kinematics import Axis

CELLS = 20


class Cells:
    """Cells apart from each other, of lengths from 0.5 to 2 in all directions."""

    def __init__(self, seed, degree=1):
        self.random = np.random.default_rng(seed)
        length = self.random.uniform(0.5, 2, CELLS)
        angle = self.random.uniform(-np.pi, np.pi, CELLS)
        first = np.column_stack([10.0 * np.arange(CELLS), np.zeros(CELLS)])
        along = np.column_stack([np.cos(angle), np.sin(angle)]) * length[:, None]
        points = np.stack([first, first + along], axis=1).reshape(-1, 2)
        self.mesh = line_mesh(points, np.arange(2 * CELLS).reshape(-1, 2))
        line = basix.ufl.element("Lagrange", "interval", degree, shape=(3,))
        self.space = fem.functionspace(self.mesh, line)
        self.x = self.space.tabulate_dof_coordinates()[:, :2]
        X = fem.Function(fem.functionspace(self.mesh, ("DG", 1)))
        X.x.array[:] = np.tile([0.0, 1.0], CELLS)
        self.axis = Axis(self.mesh, ub.Mesh(degree=degree).nodes, X)
        self.points = (1 + np.polynomial.legendre.leggauss(degree)[0][:, None]) / 2

    def field(self, values):
        function = fem.Function(self.space)
        function.x.array[:] = np.asarray(values).ravel()
        return function

    def values(self, size):
        """Random (u, v, ψ) at all nodes, each up to `size`."""
        return self.random.uniform(-size, size, (len(self.x), 3))

    def at_points(self, expression):
        """A vector of three at the Gauss points of all cells; (CELLS times degree, 3)."""
        compiled = fem.Expression(expression, self.points)
        cells = np.arange(CELLS, dtype=np.int32)
        return np.asarray(compiled.eval(self.mesh, cells)).reshape(-1, 3)


@pytest.fixture(params=[(0, 1), (1, 1), (2, 1), (0, 2), (0, 3)], ids=str)
def cells(request):
    """A seed and a degree."""
    return Cells(*request.param)


def rigid(cells, values, angle, shift, center=(0.0, 0.0)):
    """The configuration `values` turned by `angle` about `center` and shifted."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x = (cells.x + values[:, :2] - center) @ turn.T + center + shift
    return np.column_stack([x - cells.x, values[:, 2] + angle])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.7, 3.0, 40.0])
def test_rigid_motion_makes_no_strain(cells, angle):
    q = rigid(cells, np.zeros((len(cells.x), 3)), angle, (5.0, -3.0), center=(7.0, 1.0))
    strain = cells.at_points(kinematics.strain(cells.field(q), cells.axis))
    # Displacements of 400 m are differences of round-off 6e-14, over lengths of 0.5 m
    assert np.abs(strain).max() < 1e-12


def test_strain_does_not_see_rigid_motion(cells):
    q = cells.values(1.0)
    moved = rigid(cells, q, 1.1, (2.0, 3.0))
    one, other = (
        cells.at_points(kinematics.strain(cells.field(f), cells.axis)) for f in (q, moved)
    )
    assert np.abs(one - other).max() < 1e-12  # as above


def test_strain_of_known_states():
    # One cell along y: stretch is v', shear is -u', in the frame (t0, n0) = (y, -x)
    cells = Cells(0)
    mesh = line_mesh(np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([[0, 1]]))
    cells.mesh, cells.axis = mesh, Axis(mesh)
    cells.space = fem.functionspace(mesh, cells.space.ufl_element())
    x = cells.space.tabulate_dof_coordinates()[:, 1:2]
    q = cells.field(x * np.array([[0.03, 0.01, 0.0]]))
    expression = fem.Expression(kinematics.strain(q, cells.axis), np.array([[0.5]]))
    strain = np.asarray(expression.eval(mesh, np.array([0], dtype=np.int32))).ravel()
    assert strain == pytest.approx([0.01, -0.03, 0.0], abs=1e-15)


def test_virtual_strain_is_the_derivative(cells):
    q, w = cells.values(1.0), cells.values(1.0)
    ε = 1e-6
    ahead, behind = (
        cells.at_points(kinematics.strain(cells.field(q + s * ε * w), cells.axis)) for s in (1, -1)
    )
    variation = kinematics.virtual_strain(cells.field(q), cells.field(w), cells.axis)
    # Central differences: ε² of third derivatives (up to 100) and 1e-16/ε of values: 1e-9
    assert np.abs(cells.at_points(variation) - (ahead - behind) / (2 * ε)).max() < 1e-8


def step(cells, increments):
    """Random states apart by `increments` of rotation, and their algorithmic step."""
    q0 = cells.values(1.0)
    q1 = cells.values(1.0)
    q1[:, 2] = q0[:, 2] + increments
    s = q1 - q0
    s[:, 2] = 2 * np.tan(increments / 2)
    return q0, q1, s


def of_step(cells, q0, q1, w):
    f0, f1, f = (cells.field(x) for x in (q0, q1, w))
    return cells.at_points(kinematics.virtual_strain_over_step(f0, f1, f, cells.axis))


@pytest.mark.parametrize("turn", [0.0, 1e-12, 1e-6, 0.03, 0.1, 1.0, 2.5])
def test_work_of_resultants_is_the_increment_of_energy(cells, turn):
    """What makes the work of the resultants the increment of stored energy."""
    # Between nodes a polynomial of degree 3 may turn half as far again as at any of them.
    turn = min(turn, math.pi / 2) if len(cells.axis.nodes) > 2 else turn
    q0, q1, s = step(cells, turn * cells.random.uniform(-1, 1, len(cells.x)))
    e0, e1 = (cells.at_points(kinematics.strain(cells.field(q), cells.axis)) for q in (q0, q1))
    change = of_step(cells, q0, q1, s)
    # Round-off of the terms that are summed: displacements of up to 2 and 2 tan(1.25) = 6 on
    # deformed tangents of up to 5, so terms of up to 30 at 2.5 rad
    scale = max(np.abs(s[:, 2]).max(), 1.0) * 5
    assert np.abs(change - (e1 - e0)).max() < 1e-14 * scale


@pytest.mark.parametrize("turn", [2.5, -2.5])
def test_increment_identity_for_equal_and_opposite_turns(cells, turn):
    """The extremes: all nodes turn alike (e = 0), and the ends of cells apart (δ = 0)."""
    alike = np.full(len(cells.x), turn)
    apart = np.where(np.arange(2 * CELLS) % 2, turn, -turn)
    for increments in (alike, apart) if len(cells.axis.nodes) == 2 else (alike,):
        q0, q1, s = step(cells, increments)
        e0, e1 = (cells.at_points(kinematics.strain(cells.field(q), cells.axis)) for q in (q0, q1))
        assert np.abs(of_step(cells, q0, q1, s) - (e1 - e0)).max() < 3e-13  # as above


@pytest.mark.parametrize("turn", [0.0, 0.01, 1.0, 2.5])
@pytest.mark.parametrize("center", [(0.0, 0.0), (-3.0, 20.0)])
def test_virtual_rotation_makes_no_virtual_strain(cells, turn, center):
    """What makes angular momentum exact: about any point, between any two states."""
    turn = min(turn, math.pi / 2) if len(cells.axis.nodes) > 2 else turn  # as above
    q0, q1, _ = step(cells, turn * cells.random.uniform(-1, 1, len(cells.x)))
    x = cells.x + (q0[:, :2] + q1[:, :2]) / 2 - center
    w = np.column_stack([-x[:, 1], x[:, 0], np.ones(len(cells.x))])
    # Round-off of coordinates of up to 200 over lengths of 0.5
    assert np.abs(of_step(cells, q0, q1, w)).max() < 1e-12


def test_virtual_translation_makes_no_virtual_strain(cells):
    q0, q1, _ = step(cells, cells.random.uniform(-1.5, 1.5, len(cells.x)))
    w = np.tile([1.0, -2.0, 0.0], (len(cells.x), 1))
    # Differences of equal numbers, up to 14 over a length of 0.5 in derivatives of degree 3
    assert np.abs(of_step(cells, q0, q1, w)).max() < 1e-13


def test_short_steps_give_the_variation(cells):
    """For q1 -> q0 the algorithmic variation is the variation, with an error of second order."""
    q, w = cells.values(1.0), cells.values(1.0)
    exact = cells.at_points(kinematics.virtual_strain(cells.field(q), cells.field(w), cells.axis))
    assert np.abs(of_step(cells, q, q, w) - exact).max() < 1e-14  # the same sums

    d = cells.values(1.0)
    errors = [np.abs(of_step(cells, q - ε * d, q + ε * d, w) - exact).max() for ε in (1e-2, 1e-3)]
    # Second order about the middle of the step
    assert errors[0] / errors[1] == pytest.approx(100, rel=0.1)


def test_two_nodes_are_a_case_of_many():
    """The short form in the middle of a cell with two nodes is the general one."""
    cells = Cells(5)
    ψ0, ψ1, w = (cells.field(cells.values(1.2))[0] for _ in range(3))
    short, general = (
        cells.at_points(ufl.as_vector([*turn(ψ0, ψ1, w, cells.axis), 0]))
        for turn in (kinematics._two_node_rotation, kinematics._nodal_rotation)
    )
    assert np.abs(short).max() > 1
    assert np.abs(short - general).max() < 1e-13  # sums of ten numbers of order one


@pytest.mark.parametrize("x", [1e-300, 1e-9, 1e-4, 9e-3, 1e-2 * (1 - 1e-12), 1e-2, 1.1e-2, 1.3])
def test_both_branches_of_x_over_tan_x_agree(x):
    """Both branches are x / tan x to the last digits, so there is no jump between them."""
    for sign in (1, -1):
        value = kinematics.over_tan(ufl.as_ufl(sign * x))(())
        assert value == pytest.approx(x / np.tan(x), rel=4e-16)  # two units in the last place


def test_over_tan_at_zero_is_one_with_slope_zero():
    assert kinematics.over_tan(ufl.as_ufl(0.0))(()) == 1.0
    x = ufl.variable(ufl.as_ufl(0.0))
    slope = ufl.algorithms.expand_derivatives(ufl.diff(kinematics.over_tan(x), x))
    assert slope(()) == 0.0


def test_slope_of_over_tan_is_continuous_where_the_branches_meet():
    def slope(value):
        x = ufl.variable(ufl.as_ufl(value))
        return ufl.algorithms.expand_derivatives(ufl.diff(kinematics.over_tan(x), x))(())

    # The points are 2e-11 apart and the curvature is -2/3; the closed branch, 1/tan x - x/sin² x,
    # cancels numbers of 100 and adds 1e-14
    below, above = slope(1e-2 * (1 - 1e-9)), slope(1e-2 * (1 + 1e-9))
    assert below - above == pytest.approx(2 / 3 * 2e-11, abs=1e-13)
    assert below == pytest.approx(-2 / 3 * 1e-2, rel=1e-4)
