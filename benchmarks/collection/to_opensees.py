# SPDX-License-Identifier: MIT
"""Cases of the collection in the commands of OpenSees: one translation for all models.

Nodes, cells, layers, bars, masses, damping and steps are those of the case.  A cell is a
corotational ``forceBeamColumn`` with one Gauss point, whose section has the shear stiffness of the
case: for small strains of the cell this is the cell of the case.  The differences:

* Masses of beams are lumped, and Newmark's method begins without an acceleration.
* A hinge of zero length is a ``zeroLength`` spring with a large stiffness and the law ``ElasticPP``
  or, for exponential softening, ``UVCuniaxial``, whose yield limit decays.
* Coulomb friction has an elastic displacement of 0.01 mm.
* Contact with damping is ``ViscoelasticGap``: its damping is linear in the velocity, and equal at a
  depth of 1 mm.  Cables have no damping of contact.  ``HertzDamp`` has the law of the case, but a
  tangent of the wrong sign.
"""

import json
import math
import os
import subprocess
import sys
from itertools import count, pairwise
from pathlib import Path

import numpy as np

import ufl_beam as ub
import ufl_beam.structures as st

LONGEST = 600
"""Time after which a run of OpenSees is stopped; s."""

SMALLEST = 1e-9
"""Largest value of a history that counts as zero: a slab that sticks; m."""

FACTORS = 1000, 100
"""Stiffnesses of hinges of zero length, as multiples of EI/L of the member; both are tried."""


class Translation:
    """Commands for a scene; its nodes and elements by place, connector and support."""

    def __init__(self, scene: ub.Scene, factor: float) -> None:
        self.scene, self.factor, self.tags = scene, factor, count(1)
        self.commands: list = []
        self.nodes: dict = {}
        self.sections: dict = {}
        self.elements: dict = {}
        self.masses: dict = {}
        self.cells: dict = {}
        self.tied: dict = {}
        self.same = {
            other: joint.places[0]
            for joint in scene.joints
            if isinstance(joint, ub.Rigid)
            for other in joint.places[1:]
        }
        self.add("model", "basic", "-ndm", 2, "-ndf", 3)
        self.add("geomTransf", "Corotational", 1)
        for beam in scene.beams:
            self.beam(beam)
        for body in scene.bodies:
            self.mass(self.node(body.middle), body.mass, body.inertia)
        for mass in scene.masses:
            self.mass(self.node(mass.place), mass.mass, mass.inertia)
        for joint in scene.joints:
            if isinstance(joint, ub.Revolute):
                for place in joint.places[1:]:
                    self.add("equalDOF", self.node(joint.places[0]), self.node(place), 1, 2)
            elif isinstance(joint, ub.Prismatic):  # of the ground, along x
                self.add("fix", self.node(joint.slider), 0, 1, 1)
        for connector in scene.connectors:
            self.connector(connector)
        self.moving: dict = {}
        for support in scene.supports:
            node, fixed = self.node(support.place), [0, 0, 0]
            for component, motion in support.held.items():
                if any(motion(t) for t in np.linspace(0.0, 20.0, 401)):
                    self.moving[node, component] = motion
                else:
                    fixed[component] = 1
            if any(fixed):
                self.add("fix", node, *fixed)
        for node, values in self.masses.items():
            self.add("mass", node, *values)
        for damping in scene.damping:
            self.add("rayleigh", damping.mass, 0.0, damping.stiffness, 0.0)

    def add(self, name, *arguments) -> None:
        """Append a command."""
        self.commands.append((name, *(a.item() if hasattr(a, "item") else a for a in arguments)))

    def new_node(self, point) -> int:
        """Create a node."""
        tag = next(self.tags)
        self.add("node", tag, *map(float, point))
        return tag

    def node(self, place) -> int:
        """Return the node of a place; rigidly joined places share one."""
        place = self.same.get(place, place)
        if place not in self.nodes:
            self.nodes[place] = self.new_node(place.point)
            body = getattr(place, "body", None)
            if body is not None and place != body.middle:
                self.add("rigidLink", "beam", self.node(body.middle), self.nodes[place])
        return self.nodes[place]

    def spring(self, i, j, material, direction, kind="zeroLength") -> int:
        """Create a spring between two nodes."""
        tag = next(self.tags)
        self.add("element", kind, tag, i, j, "-mat", material, "-dir", direction)
        return tag

    def mass(self, node, mass, inertia) -> None:
        """Add a mass to a node."""
        old = self.masses.get(node, (0.0, 0.0, 0.0))
        self.masses[node] = tuple(np.add(old, (mass, mass, inertia)).tolist())

    def material(self, name, *numbers) -> int:
        """Create a uniaxial material."""
        tag = next(self.tags)
        self.add("uniaxialMaterial", name, tag, *numbers)
        return tag

    def law(self, law, E) -> int:
        """Create the material of a law with the stiffness ``E`` of a fibre, spring or hinge."""
        match law:
            case ub.ElastoPlastic():
                return self.material("ElasticPP", E, law.yield_limit / E)
            case st.MenegottoPinto():
                curve = law.R0, law.cR1, law.cR2
                return self.material("Steel02", law.yield_limit, E, law.hardening, *curve)
            case st.KentPark():
                peak = law.strength, 2 * law.strength / E
                return self.material(
                    "Concrete01", *(-x for x in (*peak, law.residual, law.ultimate))
                )
            case st.Mander():
                r = E / (E - law.strength / law.strain)
                peak = -law.strength, -law.strain
                return self.material("Concrete07", *peak, E, 1.0, 1e-6, 2.0, 2.3, r)
            case ub.Softening():
                rate = law.limit / law.fracture_energy
                decay = 0.0, 1.0, law.limit, rate
                return self.material("UVCuniaxial", E, law.limit, *decay, 1, 1.0, 1.0)
            case st.IbarraKrawinkler():
                b = law.backbone
                rotations = b.capping, b.post_capping, b.ultimate
                branch = *rotations, b.yield_limit, b.overstrength, b.residual
                modes = law.strength, law.softening, law.unloading, *[1.0] * 5
                return self.material("IMKBilin", law.stiffness, *branch, *branch, *modes)
            case ub.Spring():
                return self.material("Elastic", law.stiffness)
            case ub.Coulomb():
                return self.material("ElasticPP", law.force / 1e-5, 1e-5)
            case ub.Stop():
                gap, sign = (law.low, -1.0) if np.isinf(law.high) else (law.high, 1.0)
                gap = gap or sign * 1e-12  # zero is no gap in OpenSees
                if law.damping and sign < 0:
                    return self.material("ViscoelasticGap", E, E * law.damping * 1e-3, gap)
                return self.material("ElasticPPGap", E, sign * 1e20, gap)
        raise NotImplementedError(law)

    def section(self, section) -> int:
        """Create a section of fibres with its rule of integration."""
        if section not in self.sections:
            placed, tag = section.fibres, next(self.tags)
            if placed is None:
                shear = section.GA / section.EA
                self.add("section", "Elastic", tag, 1.0, section.EA, section.EI, 1.0, shear)
            else:
                laws = {
                    (number, E): self.law(placed.fibres[number].law, float(E))
                    for number, E in dict.fromkeys(zip(placed.material, placed.E, strict=True))
                }
                plane, tag = tag, next(self.tags)
                self.add("section", "Fiber", plane)
                rows = zip(placed.y, placed.A, placed.material, placed.E, strict=True)
                for y, A, number, E in rows:
                    self.add("fiber", y, 0.0, A, laws[number, E])
                shear = self.material("Elastic", section.GA)
                self.add("section", "Aggregator", tag, shear, "Vy", "-section", plane)
            self.sections[section] = tag
            self.add("beamIntegration", "Legendre", tag, tag, 1)
        return self.sections[section]

    def beam(self, beam) -> None:
        """Create the cells, masses and hinges of a beam."""
        at, section = beam.vertices(self.scene.attached[beam]), beam.section
        length = [
            float(np.hypot(*np.diff([beam.at(a).point, beam.at(b).point], axis=0)[0]))
            for a, b in pairwise(at)
        ]
        places = [self.node(beam.at(s)) for s in at]
        firsts, lasts = places[:-1], places[1:]
        for s, law in beam.hinges.items():
            k = int(np.abs(np.subtract(at, s)).argmin())
            beyond = self.new_node(beam.at(s).point)
            pair = places[k], beyond
            if k < len(firsts):
                firsts[k] = beyond
            else:
                lasts[-1] = beyond
            self.add("equalDOF", *pair, 1, 2)
            self.tied.setdefault(pair[0], []).append(beyond)
            stiffness = self.factor * section.EI / sum(length)
            self.spring(*pair, self.law(law, stiffness), 6)
        self.cells[beam] = []
        for i, j, h in zip(firsts, lasts, length, strict=True):
            for n in (i, j):
                self.mass(n, section.rhoA * h / 2, section.rhoI * h / 2)
            rule = self.section(section)
            self.add("element", "forceBeamColumn", next(self.tags), i, j, 1, rule)
            self.cells[beam].append((i, j, h))

    def connector(self, connector) -> None:
        """Create a spring, gap, cable or friction."""
        a, b = connector.a, connector.b
        grounded = getattr(a, "body", None) is ub.ground(0, 0).body
        law, j = connector.law, self.node(b)
        if isinstance(connector, ub.Stretch):
            self.elements[connector] = tag = next(self.tags)
            length = float(np.hypot(*np.subtract(a.point, b.point)))
            material = self.material(
                "ElasticPPGap", law.stiffness * length, 1e20, law.high / length
            )
            i = self.new_node(a.point)
            self.add("fix", i, 1, 1, 1)
            self.add("element", "corotTruss", tag, i, j, 1.0, material)
            return
        i = self.new_node(b.point) if grounded else self.node(a)
        if grounded:
            self.add("fix", i, 1, 1, 1)
        direction = 6 if isinstance(connector, ub.Turn) else 1 + int(abs(connector.axis[1]))
        material = self.law(law, getattr(law, "stiffness", None))
        apart = not grounded and direction != 6
        self.elements[connector] = self.spring(
            i, j, material, direction, "twoNodeLink" if apart else "zeroLength"
        )

    def forces(self, load) -> list:
        """Return the nodal forces of a load."""
        match load:
            case ub.PointLoad():
                return [(self.node(load.place), *map(float, load.force), float(load.moment))]
            case ub.LineLoad():
                return [
                    (n, *(h / 2 * f for f in load.force), 0.0)
                    for i, j, h in self.cells[load.beam]
                    for n in (i, j)
                ]
            case ub.Gravity():
                x, y = load.acceleration
                return [(n, m * x, m * y, 0.0) for n, (m, _, _) in self.masses.items()]
        raise NotImplementedError(load)


def translated(case, factor: float = FACTORS[0]) -> dict:
    """Return the commands of a case, loads and motions at the ends of steps, path and quantity."""
    of = Translation(case.scene, factor)
    times = np.linspace(0.0, case.end, case.steps + 1)

    def values(function):
        return [float(function(t)) for t in times]

    patterns, rest = [], []
    for load in case.scene.loads:
        if case.rest is not None and load in case.rest.loads:
            rest.append(of.forces(load))
        else:
            patterns.append({"values": values(load.amplitude), "loads": of.forces(load)})
    motions = [
        {"values": values(motion), "node": node, "dof": component + 1}
        for (node, component), motion in of.moving.items()
    ]
    method, *what = case.watched
    if method == "force":
        watched = "force", of.elements[what[0]]
    elif method == "factor":
        watched = ("factor",)
    else:
        place = what[0] if method == "displacement" else what[0].place
        node = of.node(place)
        watched = method, what[1] + 1, node, *of.tied.get(node, ())
    path = None
    if case.control is not None:
        control, (method, *what) = case.control(1), case.ends
        end = (method,) if method == "factor" else (method, what[1] + 1, of.node(what[0]))
        path = {"size": case.arc, "end": end, "limit": what[-1]}
        if isinstance(control, ub.DisplacementControl):
            component = ("u", "v", "psi").index(control.component)
            path |= {"size": control.step, "at": (of.node(control.place), component + 1)}
    return {
        "commands": of.commands, "patterns": patterns, "motions": motions, "rest": rest,
        "dt": case.end / case.steps, "steps": case.steps, "dynamic": case.dynamic,
        "watched": watched, "path": path, "hinges": any(beam.hinges for beam in case.scene.beams),
    }  # fmt: skip


def in_opensees(model: dict, control: str) -> dict:
    """Run a translated case in a process of its own; ``end`` is None at the end."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "peers"))
    from install import installed  # installs from PyPI

    environment = {**os.environ, "PYTHONPATH": str(installed())}
    command = [sys.executable, str(Path(__file__).with_name("in_opensees.py")), control]
    try:
        done = subprocess.run(
            command, input=json.dumps(model), env=environment, capture_output=True, text=True,
            timeout=LONGEST, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return {"end": math.nan, "halved": 0, "values": [0.0], "seconds": float(LONGEST)}
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("result ")]
    return json.loads(line.removeprefix("result "))


def values_of(case) -> np.ndarray:
    """Run a case; the compared quantity at the ends of the steps up to the end or the stop."""
    try:
        return case.run()
    except ub.ConvergenceError as error:
        return case.history(error.solution)[: int(error.time * case.steps / case.end + 1e-6) + 1]


def apart(case, ours, found) -> list[float]:
    """Return the differences of the largest values and of the histories, relative to the largest.

    The first is left out unless both programs reach the end, both if there is nothing to compare.
    """
    theirs, size = np.array(found["values"]), float(np.abs(ours).max())
    if case.control is not None:
        if found["end"] is not None:
            return []
        theirs = np.array(case.compared(theirs))
    if size <= SMALLEST:
        return []
    n = min(len(ours), len(theirs))
    history = float(np.abs(theirs[:n] - ours[:n]).max() / size)
    peak = abs(float(np.abs(theirs).max()) / size - 1)
    return [peak, history] if len(ours) == len(theirs) else [history]


def beside(case) -> dict:
    """Run a case in both programs, and a thousandth of it: all ways, and their differences.

    Prescribed motions are imposed, or reached by displacement control; cases without them that
    have hinges of zero length run with both stiffnesses.
    """
    ours, small, runs = values_of(case), case.small(), []
    model = translated(case)
    ways = [("imposed motion", FACTORS[0]), ("displacement control", FACTORS[0])]
    if not model["motions"]:
        ways = [("", factor) for factor in (FACTORS if model["hinges"] else FACTORS[:1])]
    for control, factor in ways:
        found = in_opensees(translated(case, factor), control)
        found["apart"] = apart(case, ours, found)
        del found["values"]
        runs.append(found)
    elastic = apart(small, values_of(small), in_opensees(translated(small), ""))[-1:]
    return {"runs": runs, "elastic": elastic}
