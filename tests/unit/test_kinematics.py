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

        self.compiled = {}

    def values(self):
        """Random (u, v, ψ) at all nodes, each up to 1."""
        return self.random.uniform(-1, 1, (len(self.x), 3))

    def at_points(self, strain, *values):
        """A function of fields and the axis at the Gauss points; (CELLS times degree, 3)."""
        if strain not in self.compiled:
            fields = [fem.Function(self.space) for _ in values]
            expression = fem.Expression(strain(*fields, self.axis), self.points)
            self.compiled[strain] = expression, fields
        expression, fields = self.compiled[strain]
        for field, x in zip(fields, values, strict=True):
            field.x.array[:] = x.ravel()
        cells = np.arange(len(self.x) // len(self.axis.nodes), dtype=np.int32)
        return np.asarray(expression.eval(self.mesh, cells)).reshape(-1, 3)

    def strain(self, q):
        return self.at_points(kinematics.strain, q)

    def virtual_strain(self, q, w):
        return self.at_points(kinematics.virtual_strain, q, w)

    def over_step(self, q0, q1, w):
        return self.at_points(kinematics.virtual_strain_over_step, q0, q1, w)

    def step(self, increments):
        """Random states apart by `increments` of rotation, and their algorithmic step."""
        q0, q1 = self.values(), self.values()
        q1[:, 2] = q0[:, 2] + increments
        s = q1 - q0
        s[:, 2] = 2 * np.tan(increments / 2)
        return q0, q1, s


@pytest.fixture(params=[(0, 1), (1, 1), (0, 2), (0, 3)], ids=str, scope="module")
def cells(request):
    """A seed and a degree."""
    return Cells(*request.param)


def rigid(cells, values, angle, shift, center=(0.0, 0.0)):
    """The configuration `values` turned by `angle` about `center` and shifted."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x = (cells.x + values[:, :2] - center) @ turn.T + center + shift
    return np.column_stack([x - cells.x, values[:, 2] + angle])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.7, 40.0])
def test_rigid_motion_makes_no_strain(cells, angle):
    q = rigid(cells, np.zeros((len(cells.x), 3)), angle, (5.0, -3.0), center=(7.0, 1.0))
    # Displacements of 400 m are differences of round-off 6e-14, over lengths of 0.5 m
    assert np.abs(cells.strain(q)).max() < 1e-12


def test_strain_does_not_see_rigid_motion(cells):
    q = cells.values()
    moved = rigid(cells, q, 1.1, (2.0, 3.0))
    assert np.abs(cells.strain(q) - cells.strain(moved)).max() < 1e-12  # as above


def test_strain_of_known_states():
    # One cell along y: stretch is v', shear is -u', in the frame (t0, n0) = (y, -x)
    cells = Cells(0)
    cells.mesh = line_mesh(np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([[0, 1]]))
    cells.axis = Axis(cells.mesh)
    cells.space = fem.functionspace(cells.mesh, cells.space.ufl_element())
    cells.x = cells.space.tabulate_dof_coordinates()[:, :2]
    strain = cells.strain(cells.x[:, 1:] * [0.03, 0.01, 0.0])
    assert strain == pytest.approx(np.array([[0.01, -0.03, 0.0]]), abs=1e-15)


def test_virtual_strain_is_the_derivative(cells):
    q, w, ε = cells.values(), cells.values(), 1e-6
    difference = (cells.strain(q + ε * w) - cells.strain(q - ε * w)) / (2 * ε)
    # Central differences: ε² of third derivatives (up to 100) and 1e-16/ε of values: 1e-9
    assert np.abs(cells.virtual_strain(q, w) - difference).max() < 1e-8


@pytest.mark.parametrize("turn", [0.0, 1e-12, 1e-6, 0.03, 1.0, 2.5])
def test_work_of_resultants_is_the_increment_of_energy(cells, turn):
    """In random steps, if all nodes turn alike (e = 0), and ends of cells apart (δ = 0)."""
    nodes, linear = len(cells.x), len(cells.axis.nodes) == 2
    # Between nodes a polynomial of degree 3 may turn half as far again as at any of them.
    turns = (turn if linear else min(turn, math.pi / 2)) * cells.random.uniform(-1, 1, nodes)
    apart = np.where(np.arange(nodes) % 2, turn, -turn)
    for increments in (turns, np.full(nodes, turn), np.full(nodes, -turn), apart, -apart):
        if increments is turns or linear or np.ptp(increments) == 0:
            q0, q1, s = cells.step(increments)
            change = cells.strain(q1) - cells.strain(q0)
            # Round-off of the terms that are summed: displacements of up to 2 and
            # 2 tan(1.25) = 6 on deformed tangents of up to 5, so terms of up to 30 at 2.5 rad
            scale = max(np.abs(s[:, 2]).max(), 1.0) * 5
            assert np.abs(cells.over_step(q0, q1, s) - change).max() < 1e-14 * scale


@pytest.mark.parametrize("turn", [0.0, 0.01, 1.0, 2.5])
def test_virtual_rigid_motion_makes_no_virtual_strain(cells, turn):
    """What makes momenta exact: rotation about any point and translation, between any states."""
    turn = min(turn, math.pi / 2) if len(cells.axis.nodes) > 2 else turn  # as above
    q0, q1, _ = cells.step(turn * cells.random.uniform(-1, 1, len(cells.x)))
    for center in ((0.0, 0.0), (-3.0, 20.0)):
        x = cells.x + (q0[:, :2] + q1[:, :2]) / 2 - center
        w = np.column_stack([-x[:, 1], x[:, 0], np.ones(len(cells.x))])
        # Round-off of coordinates of up to 200 over lengths of 0.5
        assert np.abs(cells.over_step(q0, q1, w)).max() < 1e-12
    w = np.tile([1.0, -2.0, 0.0], (len(cells.x), 1))
    # Differences of equal numbers, up to 14 over a length of 0.5 in derivatives of degree 3
    assert np.abs(cells.over_step(q0, q1, w)).max() < 1e-13


def test_short_steps_give_the_variation(cells):
    """For q1 -> q0 the algorithmic variation is the variation, with an error of second order."""
    q, w, d = cells.values(), cells.values(), cells.values()
    exact = cells.virtual_strain(q, w)
    assert np.abs(cells.over_step(q, q, w) - exact).max() < 1e-14  # the same sums
    # Second order about the middle of the step
    coarse, fine = (
        np.abs(cells.over_step(q - ε * d, q + ε * d, w) - exact).max() for ε in (1e-2, 1e-3)
    )
    assert coarse / fine == pytest.approx(100, rel=0.1)


@pytest.mark.parametrize("x", [0.0, 1e-300, 1e-4, 1e-2 * (1 - 1e-9), 1e-2 * (1 + 1e-9), 1.3])
def test_x_over_tan_x_and_its_slope(x):
    """On both sides of 0.01, where a series ends, to the last digits."""
    for at in (x, -x):
        value = kinematics.over_tan(ufl.as_ufl(at))(())
        assert value == pytest.approx(x / np.tan(x) if x else 1.0, rel=4e-16)
        variable = ufl.variable(ufl.as_ufl(at))
        slope = ufl.diff(kinematics.over_tan(variable), variable)
        # The closed branch cancels numbers of 100 and adds 1e-14; its series is -2/3 x - 4/45 x³
        expected = -2 / 3 * at - 4 / 45 * at**3 - 4 / 315 * at**5
        found = ufl.algorithms.expand_derivatives(slope)(())
        assert x > 1 or found == pytest.approx(expected, abs=1e-13)
