# SPDX-License-Identifier: MIT
"""Beams that yield and break: cut in two, on several processes, at rest after statics."""

from itertools import chain, pairwise

import numpy as np
import pytest
from elastic_scenes import difference, in_pieces, require_same_on_processes

import ufl_beam as ub

SAME = 1e-8
"""Part of the result.  Each step is solved to 1e-10 of the forces, mostly to round-off; softening
passes on what a step leaves to the next ones, some tens of times enlarged."""

pytestmark = pytest.mark.filterwarnings("ignore:.*the hinge of the section:ufl_beam.ModelWarning")
"""Hinges open in the middle of four cells, also of beams that are cut in two."""

KINDS = ["resultants", "hinges", "fibres", "cracks"]
SCHEMES = [ub.Static(), ub.EnergyMomentumStatic(), ub.EnergyMomentum(0.05, 0.05)]

PLACES = [(beam, s) for beam in range(3) for s in (0.0, 0.25, 0.5, 0.75, 1.0)]
CORNERS = [(0.0, 0.0), (0.0, 1.0), (1.5, 1.2), (1.5, 0.2)]


class Frame:
    """A frame whose column and girder yield, flow or break; its strut is elastic.

    Args:
        cut: Beams that are stated as two.
        viscous: Whether what flows also creeps.
        size: Of the displacement that drives the frame; m.
    """

    def __init__(self, kind, *, cut=(), viscous=True, size=0.25, strut_first=False):
        self._viscous, self._hinged = viscous, kind not in ("fibres", "cracks")
        self._beams, joints = {}, []
        for i, (start, end) in enumerate(pairwise(CORNERS)):
            inner = {0.7: ub.LinearSoftening(4.0, 3.0)} if kind == "hinges" and i == 1 else {}
            ends = {0.0: None, 1.0: None} if kind == "hinges" else {}
            middle = tuple((np.array(start) + end) / 2)
            halves = [(start, middle, 0.0), (middle, end, 0.5)] if i in cut else [(start, end, 0.0)]
            k, section = len(halves), self._section(kind, i)
            self._beams[i] = pieces = [
                ub.Beam(
                    a, b, section, cells=4 // k, name=f"beam{i}",
                    hinges={(s - s0) * k: law for s, law in inner.items() if 0 < (s - s0) * k < 1}
                    | ends,
                )
                for a, b, s0 in halves
            ]  # fmt: skip
            joints += [ub.Rigid(one.end, two.start) for one, two in pairwise(pieces)]
        joints += [ub.Rigid(self.place((i, 1.0)), self.place((i + 1, 0.0))) for i in (0, 1)]
        # Driven by a displacement, for softening has no equilibrium under given forces
        top, middle = self.place((0, 1.0)), self.place((1, 0.5))
        growing = ub.Table([0, 0.6, 1], [0, 1, 0.5])
        drive = ub.PrescribedDisplacement(
            top, u=lambda t: size * growing(t), v=lambda t: -((size * growing(t)) ** 2) / 2
        )
        self.scene = ub.Scene(
            [*chain(*self._beams.values())][:: -1 if strut_first else 1],
            joints=joints,
            supports=[ub.Clamped(self.place((0, 0.0))), ub.Pinned(self.place((2, 1.0))), drive],
            loads=[ub.PointLoad(middle, force=(5.0, -20.0), amplitude=growing)],
            masses=[ub.PointMass(middle, 0.5)],
        )

    def _section(self, kind, i):
        viscous = self._viscous
        if kind in ("fibres", "cracks") and i < 2:
            law = ub.ElastoPlastic(2.5e5, 1e6, 2e6, ub.Perzyna(1e4 * viscous))
            fibres = ub.Fibres(law, softening=ub.Softening(3e5, 3e4) if kind == "cracks" else None)
            y, A = np.array([-0.05, -0.02, 0.01, 0.06]), np.full(4, 2e-4)
            return ub.Section.of_fibres(y, A, E=5e7, nu=0.2, rho=1e3, fibres=fibres)
        laws = {}
        if kind == "resultants" and i < 2:
            laws["axial"] = ub.ElastoPlastic(30.0, 500.0, viscosity=ub.Perzyna(20.0 * viscous))
            laws["bending"] = ub.ElastoPlastic(5.0, 5.0, 4.0, ub.DuvautLions(0.02 * viscous))
        if kind == "hinges" and i == 0:
            laws["bending"], laws["hinge"] = ub.ElastoPlastic(5.0, 9.0), ub.Softening(8.0, 10.0)
        return ub.Section(EA=1e4, GA=1e4, EI=60.0, rhoA=1.0, rhoI=0.01, **laws)

    def place(self, place):
        return in_pieces(self._beams[place[0]], place[1])

    def run(self, scheme, *, steps=15, **more):
        self.solution = ub.simulate(self.scene, scheme, t=(0, 1.0), dt=1.0 / steps, **more)
        return self

    def motion(self):
        return np.array([self.solution.displacement(self.place(place)).T for place in PLACES])

    def material(self):
        """N, V, M; jumps of hinges; energies lost by plastic strains and hinges; of all cells."""
        parts = [self.solution.material(p) for pieces in self._beams.values() for p in pieces]
        forces, jump, plastic, hinge = (np.concatenate(x) for x in zip(*parts, strict=True))
        return [*forces.T, jump * self._hinged, plastic, hinge]

    def results(self):
        return [self.motion(), *self.material()]

    def energies(self):
        energy = self.solution.energy
        return {**energy.state, **energy.supplied, **energy.lost}

    @property
    def throughput(self):
        return self.solution.energy.energy_transferred


each_kind = pytest.mark.parametrize("kind", KINDS)
each_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=str)


@each_kind
@each_scheme
def test_a_good_part_of_the_energy_is_dissipated(kind, scheme):
    """The tests below would show little of scenes that hardly yield and break."""
    frame = Frame(kind).run(scheme)
    energies, throughput = frame.energies(), frame.throughput
    assert energies["plastic"][-1] > 1e-2 * throughput
    assert ("hinges" in energies) == (kind in ("hinges", "cracks"))
    if "hinges" in energies:
        assert energies["hinges"][-1] > 1e-2 * throughput
    if kind == "hinges":
        *_, jump, _, hinge = frame.material()
        assert (jump != 0).sum() >= 2
        assert ((hinge > 0) == (jump != 0)).all()
    if scheme != ub.Static():  # exact by design, section 9
        assert frame.solution.energy.worst < 1e-9


@each_kind
@each_scheme
def test_a_beam_cut_in_two_is_the_same_beam(kind, scheme):
    """A beam cut in two by a rigid joint is the same beam, its hinges in the halves."""
    one, other = Frame(kind).run(scheme), Frame(kind, cut=[0, 1]).run(scheme)
    assert len(other.scene.beams) == 5
    assert difference(one, other) < SAME


@each_kind
@each_scheme
@pytest.mark.parametrize("strut_first", [True, False])
def test_processes_find_the_result_of_one(kind, scheme, strut_first):
    """On three ranks the first or the last one has the strut, and nothing that yields."""

    def run(comm):
        return Frame(kind, strut_first=strut_first).run(scheme, comm=comm)

    require_same_on_processes(run, SAME)


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
