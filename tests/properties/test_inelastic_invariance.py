# SPDX-License-Identifier: MIT
"""One inelastic scene stated in two ways gives one result: units, axes, cuts, order, ranks."""

import math
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from elastic_scenes import Units

import ufl_beam as ub

SAME = 1e-8
"""Part of the result.  Each step is solved to 1e-10 of the forces, mostly to round-off; softening
passes on what a step leaves to the next ones, some tens of times enlarged."""

pytestmark = pytest.mark.filterwarnings("ignore:.*the hinge of the section:ufl_beam.ModelWarning")
"""Hinges open in the middle of four cells, here as in the other statements."""

SI = Units()
KINDS = ["resultants", "hinges", "fibres", "cracks"]
SCHEMES = [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentum(0.05, 0.05)]

PLACES = [(beam, s) for beam in range(3) for s in (0.0, 0.25, 0.5, 0.75, 1.0)]
CORNERS = [(0.0, 0.0), (0.0, 1.0), (1.5, 1.2), (1.5, 0.2)]


class Frame:
    """A frame whose column and girder yield, flow or break; its strut is elastic.

    Args:
        kind: One of KINDS.
        units: Of its numbers.
        angle: The frame is turned by so many rad about the origin,
        shift: and moved; in parts of a metre.
        order: Of the beams in the scene.
        cut: Beams that are stated as two.
        reverse: Beams that run the other way.
        cells: Of each beam.
        viscous: Whether what flows also creeps.
        size: Of the displacement that drives the frame; m.
    """

    def __init__(
        self, kind, *, units=SI, angle=0.0, shift=(0.0, 0.0), order=(0, 1, 2), cut=(),
        reverse=(), cells=4, viscous=True, size=0.25,
    ):  # fmt: skip
        self.units, self.turn, self._viscous = (
            units,
            complex(math.cos(angle), math.sin(angle)),
            viscous,
        )
        self._hinged = kind not in ("fibres", "cracks")
        self._shift, self._reverse = complex(*shift), set(reverse)
        self._beams, joints = {}, []
        for i in range(3):
            ends = [CORNERS[i], CORNERS[i + 1]]
            hinges = {0.7: self._softening(ub.LinearSoftening, 4.0, 3.0)} if i == 1 else {}
            hinges = {0.0: None, **hinges, 1.0: None} if kind == "hinges" else {}
            if i in self._reverse:
                ends, hinges = ends[::-1], {1 - s: law for s, law in hinges.items()}
            section = self._section(kind, i)
            if i in cut:
                middle = tuple((np.array(ends[0]) + ends[1]) / 2)
                halves = [(ends[0], middle, 0.0), (middle, ends[1], 0.5)]
            else:
                halves = [(*ends, 0.0)]
            k = len(halves)
            self._beams[i] = pieces = [
                ub.Beam(
                    self._point(a), self._point(b), section, cells=cells // k, name=f"beam{i}",
                    hinges={(s - s0) * k: law for s, law in hinges.items() if 0 < (s - s0) * k < 1}
                    | ({0.0: None, 1.0: None} if kind == "hinges" else {}),
                )
                for a, b, s0 in halves
            ]  # fmt: skip
            joints += [ub.Rigid(one.end, two.start) for one, two in pairwise(pieces)]
        joints += [ub.Rigid(self.place((i, 1.0)), self.place((i + 1, 0.0))) for i in (0, 1)]
        # Driven by a displacement, for softening has no equilibrium under given forces
        top, middle = self.place((0, 1.0)), self.place((1, 0.5))
        second = units.second
        growing = ub.Table([0, 0.6 * second, second], [0, 1, 0.5])

        def sway(t):
            x = size * growing(t)
            return self._vector((x, -(x**2) / 2)) * units.metre

        drive = ub.PrescribedDisplacement(top, u=lambda t: sway(t).real, v=lambda t: sway(t).imag)
        self.supports = [
            ub.Clamped(self.place((0, 0.0))), ub.Pinned(self.place((2, 1.0))), drive
        ]  # fmt: skip
        press = self._vector((5.0, -20.0)) * units.newton
        self.scene = ub.Scene(
            [piece for i in order for piece in self._beams[i]],
            joints=joints,
            supports=self.supports,
            loads=[ub.PointLoad(middle, force=(press.real, press.imag), amplitude=growing)],
            masses=[ub.PointMass(middle, 0.5 * units.kilogram)],
        )

    def _softening(self, law, limit, energy):
        return law(limit * self.units.joule, energy * self.units.joule)

    def _section(self, kind, i):
        u = self.units
        N, J, m, s = u.newton, u.joule, u.metre, u.second
        if kind in ("fibres", "cracks") and i < 2:
            y = np.array([-0.05, -0.02, 0.01, 0.06]) * (-1 if i in self._reverse else 1)
            law = ub.ElastoPlastic(
                2.5e5 * N / m**2,
                1e6 * N / m**2,
                2e6 * N / m**2,
                ub.Perzyna(1e4 * N * s / m**2 * self._viscous),
            )
            breaks = ub.Softening(3e5 * N / m**2, 3e4 * J / m**2) if kind == "cracks" else None
            return ub.Section.of_fibres(
                y * m, np.full(4, 2e-4) * m**2, E=5e7 * N / m**2, nu=0.2,
                rho=1e3 * u.kilogram / m**3, fibres=ub.Fibres(law, softening=breaks),
            )  # fmt: skip
        laws = {}
        if kind == "resultants" and i < 2:
            laws["axial"] = ub.ElastoPlastic(
                30.0 * N, 500.0 * N, viscosity=ub.Perzyna(20.0 * N * s * self._viscous)
            )
            laws["bending"] = ub.ElastoPlastic(
                5.0 * J, 5.0 * J * m, 4.0 * J * m, ub.DuvautLions(0.02 * s * self._viscous)
            )
        if kind == "hinges" and i == 0:
            laws["bending"] = ub.ElastoPlastic(5.0 * J, 9.0 * J * m)
            laws["hinge"] = self._softening(ub.Softening, 8.0, 10.0)
        return ub.Section(
            EA=1e4 * N, GA=1e4 * N, EI=60.0 * J * m,
            rhoA=1.0 * u.kilogram / m, rhoI=0.01 * u.kilogram * m, **laws,
        )  # fmt: skip

    def _vector(self, xy):
        return complex(*xy) * self.turn

    def _point(self, xy):
        z = (self._vector(xy) + self._shift) * self.units.metre
        return z.real, z.imag

    def place(self, place):
        i, s = place
        s = 1 - s if i in self._reverse else s
        pieces = self._beams[i]
        if len(pieces) == 1:
            return pieces[0].at(s)
        return pieces[0].at(2 * s) if s <= 0.5 else pieces[1].at(2 * s - 1)

    def run(self, scheme, *, steps=15, until=1.0, **more):
        second = self.units.second
        self.solution = ub.simulate(
            self.scene, scheme, t=(0, until * second), dt=until / steps * second, **more
        )
        return self

    # -- results in SI, in the axes and directions of the first statement ------------------------

    def motion(self):
        rows = []
        for place in PLACES:
            u, v, ψ = self.solution.displacement(self.place(place)).T
            back = (u + 1j * v) / self.turn / self.units.metre
            rows.append([back.real, back.imag, ψ])
        return np.array(rows)

    def material(self):
        """N, V, M; jumps of hinges; energies lost by plastic strains and hinges; of all cells."""
        u, groups = self.units, [[], [], [], [], [], []]
        for i in range(3):
            parts = [self.solution.material(piece) for piece in self._beams[i]]
            forces, jump, plastic, hinge = (np.concatenate(x) for x in zip(*parts, strict=True))
            way = 1
            if i in self._reverse:
                forces, jump, plastic, hinge = (x[::-1] for x in (forces, jump, plastic, hinge))
                way = -1
            for group, values in zip(
                groups,
                [
                    forces[:, 0] / u.newton, forces[:, 1] / u.newton, forces[:, 2] * way / u.joule,
                    jump * way * self._hinged, plastic / u.joule, hinge / u.joule,
                ],
                strict=True,
            ):  # fmt: skip
                group.append(values)
        return [np.concatenate(group) for group in groups]

    def energies(self):
        energy = self.solution.energy
        groups = {**energy.state, **energy.supplied, **energy.lost}
        return {name: values / self.units.joule for name, values in groups.items()}


def difference(one, other):
    """Largest difference of two results, each kind as a part of its largest value."""
    pairs = [(one.motion(), other.motion()), *zip(one.material(), other.material(), strict=True)]
    first, second = one.energies(), other.energies()
    assert first.keys() == second.keys()
    throughput = one.solution.energy.throughput / one.units.joule
    parts = [np.abs(first[n] - second[n]).max() / throughput for n in first]
    for a, b in pairs:
        assert a.shape == b.shape
        largest = np.abs(a).max()
        parts.append(np.abs(a - b).max() / largest if largest else np.abs(b).max())
    return float(max(parts))


each_kind = pytest.mark.parametrize("kind", KINDS)
each_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=str)


@each_kind
@each_scheme
def test_something_happens(kind, scheme):
    """The scenes below yield and break by a good part of what goes through them."""
    frame = Frame(kind).run(scheme)
    energies, throughput = frame.energies(), frame.solution.energy.throughput
    assert energies["plastic"][-1] > 1e-2 * throughput
    assert ("hinges" in energies) == (kind in ("hinges", "cracks"))
    if "hinges" in energies:
        assert energies["hinges"][-1] > 1e-2 * throughput
    if kind == "hinges":
        *_, jump, _, hinge = frame.material()
        assert (jump != 0).sum() >= 2
        assert ((hinge > 0) == (jump != 0)).all()
    if scheme != ub.Static():
        # Exact by design, section 9
        assert frame.solution.energy.worst < 1e-9


@each_kind
@each_scheme
def test_units(kind, scheme):
    """No number in the package has a dimension."""
    units = Units(*(float(x) for x in 10 ** np.random.default_rng(0).uniform(-4, 4, 3)))
    one, other = Frame(kind).run(scheme), Frame(kind, units=units).run(scheme)
    assert difference(one, other) < SAME
    assert one.solution.parts == other.solution.parts


@each_kind
@each_scheme
def test_axes(kind, scheme):
    """The whole frame turned by 2 rad, and moved by ten times its size."""
    other = Frame(kind, angle=2.0, shift=(10.0, -20.0)).run(scheme)
    assert difference(Frame(kind).run(scheme), other) < SAME


@each_kind
@each_scheme
def test_cuts(kind, scheme):
    """A beam cut in two by a rigid joint is the same beam, its hinges in the halves."""
    one, other = Frame(kind).run(scheme), Frame(kind, cut=[0, 1]).run(scheme)
    assert len(other.scene.beams) == 5
    assert difference(one, other) < SAME


@each_kind
@each_scheme
def test_order(kind, scheme):
    """The order of the beams in the scene; limits that are random depend on it."""
    assert difference(Frame(kind).run(scheme), Frame(kind, order=[2, 0, 1]).run(scheme)) < SAME


@each_kind
@each_scheme
def test_reversal(kind, scheme):
    """Beams that run the other way have moments and jumps of the other sign."""
    assert difference(Frame(kind).run(scheme), Frame(kind, reverse=[0, 1]).run(scheme)) < SAME


@each_kind
@each_scheme
def test_ranks(kind, scheme):
    """The number of processes: against each process alone.  On one rank: a run can be repeated.

    The strut is elastic, and of three beams of four cells it is the last: on three ranks one has
    nothing that yields.
    """
    one, other = Frame(kind).run(scheme), Frame(kind).run(scheme, comm=MPI.COMM_SELF)
    assert difference(one, other) < SAME
    everywhere = MPI.COMM_WORLD.allgather(one.motion().tobytes())
    assert len(set(everywhere)) == 1
    if MPI.COMM_WORLD.size == 1:
        assert (one.motion() == other.motion()).all()


@each_scheme
@pytest.mark.parametrize("first", [True, False])
def test_ranks_with_and_without_hinges(scheme, first):
    """Half of the cells yield and break, those of the first ranks or of the last ones."""
    plain = {"EA": 1e4, "GA": 1e4, "EI": 60.0, "rhoA": 1.0}
    laws = {"bending": ub.ElastoPlastic(6.0, 9.0), "hinge": ub.Softening(8.0, 10.0)}
    sections = [ub.Section(**plain, **laws), ub.Section(**plain)][:: 1 if first else -1]
    a = ub.Beam((0, 0), (1, 0), sections[0], cells=6, name="a")
    b = ub.Beam((1, 0), (2, 0), sections[1], cells=6, name="b")
    tip = ub.PrescribedDisplacement(b.end, v=ub.Table([0, 1], [0, 0.6]))
    scene = ub.Scene([a, b], joints=[ub.Rigid(a.end, b.start)], supports=[ub.Clamped(a.start), tip])
    one, other = (
        ub.simulate(scene, scheme, t=(0, 1), dt=0.05, comm=comm)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    for beam in (a, b):
        for values, expected in zip(one.material(beam), other.material(beam), strict=True):
            scale = np.abs(expected).max()
            assert np.abs(values - expected).max() <= SAME * scale
    for name in ("plastic", "hinges", "stored", "supports"):
        assert one.energy[name] == pytest.approx(other.energy[name], rel=1e-8, abs=1e-9)
    assert one.energy["plastic"][-1] > 0
    if first:
        assert one.energy["hinges"][-1] > 0


# -- a run goes on ---------------------------------------------------------------------------------


@each_kind
@each_scheme
def test_a_run_in_two_parts_is_the_run(kind, scheme):
    """Configuration, velocities and internal variables are all that a run needs.

    The second part unloads, so that a first step that is cut does not lead elsewhere.
    """
    whole, part = (Frame(kind, size=0.12, viscous=False) for _ in range(2))
    whole.run(scheme, steps=100)
    first = ub.simulate(part.scene, scheme, t=(0, 0.7), dt=0.01, every=9)
    second = ub.simulate(part.scene, scheme, t=(0.7, 1), dt=0.01, start=first)
    beam = part.scene.beams[0]
    # The state that begins the second part is that which ended the first, to the last digit
    for one, two in zip(first.material(beam), second.material(beam, 0), strict=True):
        assert np.abs(one - two).max() <= 1e-14 * np.abs(one).max()
    assert (second.q[0] == first.q[-1]).all()
    for name in first.energy.state:
        assert second.energy[name][0] == pytest.approx(first.energy[name][-1], rel=1e-13)
    part.solution = second
    motion, expected = part.motion()[:, :, -1], whole.motion()[:, :, -1]
    assert np.abs(motion - expected).max() < SAME * np.abs(expected).max()
    for values, scale in zip(part.material(), whole.material(), strict=True):
        assert np.abs(values - scale).max() <= SAME * np.abs(scale).max()
    for name in {"plastic", "hinges"} & set(whole.solution.energy.lost):
        lost = first.energy[name][-1] + second.energy[name][-1]
        assert lost == pytest.approx(whole.solution.energy[name][-1], rel=1e-7)


@each_kind
def test_dynamics_from_plastic_statics_stays_at_rest(kind):
    """Plastic strains and open hinges are in equilibrium: nothing moves, nothing flows."""
    frame = Frame(kind, viscous=False)
    static = ub.simulate(frame.scene, ub.Static(), t=(0, 1), dt=0.05)
    assert static.energy["plastic"][-1] > 0
    solution = ub.simulate(frame.scene, ub.EnergyMomentum(), t=(1, 1.2), dt=0.01, start=static)
    still = np.abs(solution.q - static.q[-1]).max()
    # What Newton's method leaves, 1e-10 of 100 N, on some 10 N/m
    assert still < 1e-8
    for name in ("plastic", "hinges"):
        if name in solution.energy.lost:
            assert solution.energy[name][-1] < 1e-9 * static.energy[name][-1]
