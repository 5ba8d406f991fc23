# SPDX-License-Identifier: MIT
"""Scenes in space beside published values, and solutions of differential equations."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import ufl_beam as ub


def rectangle(E, nu, height, width, GJ, shear=5 / 6, rho=0.0):
    """A section with its height along axis 2."""
    G, A = E / (2 * (1 + nu)), height * width
    Iy, Iz = height * width**3 / 12, width * height**3 / 12
    mass = {"rhoA": rho * A, "rhoI": rho * Iz, "rhoI2": rho * Iy} if rho else {}
    return ub.Section(
        EA=E * A, GA=shear * G * A, GA3=shear * G * A, EI=E * Iz, EI2=E * Iy, GJ=G * GJ(Iy + Iz),
        **mass,
    )  # fmt: skip


def extrapolated(coarse, fine):
    """The limit of errors of second order, from a mesh and one twice as fine."""
    return fine + (fine - coarse) / 3


def tip(scene, scheme, dt):
    run = ub.simulate(scene, scheme, t=(0, 1), dt=dt)
    return run.displacement(scene.beams[-1].end)[-1]


def test_princeton_beam():
    """A narrow cantilever with 13.345 N at 45 degrees to its sides, in one load step.

    The reference solves the differential equation by shooting; it has seven digits.
    """
    b, tips = np.radians(45), []
    section = rectangle(71.7e9, 0.31, 12.3777e-3, 3.2024e-3, lambda polar: 0.21002 * polar)
    for cells in (16, 32):
        beam = ub.Beam((0, 0, 0), (0.508, 0, 0), section, cells=cells, up=(0, 1, 0))
        force = 13.345 * np.array([0.0, -np.cos(b), np.sin(b)])
        load = ub.PointLoad(beam.end, force=tuple(force), amplitude=lambda t: t)
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        tips.append(tip(scene, ub.Static(), 1.0)[:3])
    shooting = np.array([-0.0303582, -0.0153401, 0.1565806])
    assert np.abs(extrapolated(*tips) - shooting).max() < 2e-6


@pytest.mark.parametrize(
    ("force", "exact"), [((0, 0, 1), 5.429321478e-3), ((0, 1, 0), 1.749623339e-3)]
)
def test_pretwisted_cantilever(force, exact):
    """Turned by 90 degrees along the axis; an integral of beam theory with the shear stiffness."""
    E, height, width, tips = 29e6, 1.1, 0.32, []
    section = rectangle(E, 0.22, height, width, lambda polar: 0.1 * polar)
    for cells in (16, 32):
        angles = (np.arange(cells) + 0.5) / cells * np.pi / 2
        x = np.linspace(0, 12, cells + 1)
        beams = [
            ub.Beam((a, 0, 0), (b, 0, 0), section, cells=1, up=(0, np.cos(angle), np.sin(angle)))
            for a, b, angle in zip(x[:-1], x[1:], angles, strict=True)
        ]
        joints = [ub.Rigid(a.end, b.start) for a, b in pairwise(beams)]
        load = ub.PointLoad(beams[-1].end, force=tuple(1e-3 * np.array(force)))
        scene = ub.Scene(beams, joints=joints, supports=[ub.Clamped(beams[0].start)], loads=[load])
        tips.append(1e3 * tip(scene, ub.Static(), 1.0)[:3] @ force)
    assert extrapolated(*tips) == pytest.approx(exact, rel=1e-5)


def test_helix():
    """Ten turns by an end moment, drawn out by a force along the axis of the moment.

    A. Ibrahimbegović, Computer Methods in Applied Mechanics and Engineering 149 (1997).  The
    reference solves the differential equation by shooting.
    """
    section = ub.Section(EA=1e4, GA=1e4, GA3=1e4, EI=1e2, EI2=1e2, GJ=1e2)
    tips = []
    for cells in (100, 200):
        beam = ub.Beam((0, 0, 0), (10, 0, 0), section, cells=cells)
        load = ub.PointLoad(
            beam.end, force=(0, 0, 50), moment=(0, 0, 200 * np.pi), amplitude=lambda t: t
        )
        scene = ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])
        run = ub.simulate(scene, ub.Static(), t=(0, 1), dt=0.01)
        tips.append(run.position(beam.end)[[4, 10, 25, 50, 100]])
    limit = extrapolated(*tips)
    assert np.abs(limit[-1] - [0.0048030, 0.000072, -0.076442]).max() < 1e-4
    assert np.abs(limit[:-1, 2] - [3.234081, -1.091729, 0.520651, -0.226637]).max() < 1e-4


def rigid_body_rates(masses, tensors, arms, g):
    """Rates of bodies that hang on ball joints, each at the one before; constraints by multipliers.

    ``arms`` has the joints of a body, from its centre: the upper and the lower one.
    """
    n = len(masses)

    def rates(t, y):
        q, v, w = y[3 * n : 7 * n].reshape(n, 4), y[7 * n : 10 * n], y[10 * n :].reshape(n, 3)
        R = Rotation.from_quat(q)
        J = R.as_matrix() @ tensors @ R.as_matrix().transpose(0, 2, 1)
        A, b = np.zeros((9 * n, 9 * n)), np.zeros(9 * n)
        for k in range(n):
            x, turn, row = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6), 6 * n + 3 * k
            A[x, x], A[turn, turn] = masses[k] * np.eye(3), J[k]
            b[6 * k + 2], b[turn] = -masses[k] * g, -np.cross(w[k], J[k] @ w[k])
            for body, arm, sign in ((k, arms[k][0], 1.0), (k - 1, arms[k - 1][1], -1.0)):
                if body >= 0:
                    arm = R[body].apply(arm)
                    G = sign * np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])
                    A[row : row + 3, 6 * body : 6 * body + 6] += G
                    A[6 * body : 6 * body + 6, row : row + 3] += G.T
                    b[row : row + 3] -= sign * np.cross(w[body], np.cross(w[body], arm))
        a = np.linalg.solve(A, b)[: 6 * n].reshape(n, 6)
        turning = [
            np.append((q[k, 3] * w[k] + np.cross(w[k], q[k, :3])) / 2, -w[k] @ q[k, :3] / 2)
            for k in range(n)
        ]
        return np.concatenate([v, np.ravel(turning), a[:, :3].ravel(), a[:, 3:].ravel()])

    return rates


def test_double_pendulum():
    """Two bodies on ball joints, released from a skew position, against their equations of motion.

    Errors are of second order in the step.
    """
    masses, g = np.array([1.0, 2.0]), 9.81
    tensors = np.array([np.diag([0.03, 0.02, 0.01]), np.diag([0.02, 0.05, 0.04])])
    directions = np.array([[0.6, 0.0, -0.8], [0.0, 1.0, 0.0]])
    arms = [(-0.25 * d, 0.25 * d) for d in directions]
    centres = np.array([-arms[0][0], -arms[0][0] + arms[0][1] - arms[1][0]])
    w = np.array([[0.5, 0.0, 2.0], [0.0, 0.0, 1.0]])
    v = np.array(
        [np.cross(w[0], centres[0]), np.cross(w[0], 2 * centres[0]) + np.cross(w[1], -arms[1][0])]
    )
    y = np.concatenate([centres.ravel(), [0, 0, 0, 1] * 2, v.ravel(), w.ravel()])
    rates = rigid_body_rates(masses, tensors, arms, g)
    exact = solve_ivp(rates, (0, 1), y, method="DOP853", rtol=1e-11, atol=1e-12).y[3:6, -1]
    errors = []
    for dt in (0.01, 0.005):
        bodies = [
            ub.Body(tuple(c), mass=m, inertia=J)
            for c, m, J in zip(centres, masses, tensors, strict=True)
        ]
        joints = [
            ub.Spherical(ub.ground(0, 0, 0), bodies[0].at(0, 0, 0)),
            ub.Spherical(*(body.at(*(2 * centres[0])) for body in bodies)),
        ]
        initial = [
            ub.Velocity([body], linear=tuple(vk), angular=tuple(wk), about=tuple(c))
            for body, vk, wk, c in zip(bodies, v, w, centres, strict=True)
        ]
        scene = ub.Scene(
            bodies=bodies, joints=joints, loads=[ub.Gravity((0, 0, -g))], initial=initial
        )
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 1), dt=dt)
        assert run.energy.worst < 1e-10
        errors.append(np.linalg.norm(run.position(bodies[1].middle)[-1] - exact))
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1


def test_top_of_simo_and_wong():
    """A fast heavy top with a fixed point; the axis after 2 s by its differential equation.

    J. C. Simo and K. K. Wong, International Journal for Numerical Methods in Engineering 31 (1991).
    The energy is 1269.975 J.  The top turns by up to 6 degrees in a step.
    """
    tilt, errors = Rotation.from_rotvec([0.05, 0, 0]), []
    axis = np.array([0.03801721, -0.03291846, 0.99873473])
    for dt in (2e-3, 1e-3):
        # About its fixed point the top has the moments (5, 5, 1); the arm to the centre is 1 m.
        tensor = tilt.as_matrix() @ np.diag([4.0, 4.0, 1.0]) @ tilt.as_matrix().T
        centre, spin = tilt.apply([0, 0, 1]), tilt.apply([0, 0, 50.0])
        top = ub.Body(tuple(centre), mass=1.0, inertia=tensor)
        scene = ub.Scene(
            bodies=[top], joints=[ub.Spherical(ub.ground(0, 0, 0), top.at(0, 0, 0))],
            loads=[ub.Gravity((0, 0, -20.0))],
            initial=[ub.Velocity([top], linear=(0, 0, 0), angular=tuple(spin), about=(0, 0, 0))],
        )  # fmt: skip
        newton = ub.Newton(rtol=1e-9)  # gravity transfers millijoules of 1250 J
        run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 2), dt=dt, newton=newton)
        moving = run.energy["kinetic"][0] + 20.0 * centre[2]
        assert moving == pytest.approx(1269.975, abs=5e-4)
        assert run.energy.worst < 1e-10 * moving
        path = run.position(top.middle)
        assert np.abs(np.linalg.norm(path, axis=1) - 1).max() < 1e-9  # rtol
        errors.append(np.linalg.norm(path[-1] - axis))
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1
