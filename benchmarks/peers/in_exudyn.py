# SPDX-License-Identifier: MIT
"""The problems in Exudyn: geometrically exact beams, no output, the fastest settings.

Loads are symbolic functions, which Exudyn evaluates without Python.
"""

import sys
import warnings
from itertools import pairwise

import numpy as np
from problems import PROBLEMS
from stopwatch import Stopwatch

sys.exudynFast = True  # the module without range checks
warnings.filterwarnings("ignore")

import exudyn as exu  # noqa: E402
import exudyn.itemInterface as item  # noqa: E402
from exudyn.advancedUtilities import CreateSymbolicUserFunction  # noqa: E402

VERSION = f"Exudyn {exu.__version__}"
SOLVERS = {
    "sparse": exu.LinearSolverType.EigenSparse,
    "dense": exu.LinearSolverType.EXUdense,
}
DISPLACEMENT, COORDINATES = exu.OutputVariableType.Displacement, exu.OutputVariableType.Coordinates
NODES = {  # in space: kind, and rotation by an angle about z
    "Euler parameters": (item.NodeRigidBodyEP, lambda a: [np.cos(a / 2), 0, 0, np.sin(a / 2)]),
    "Lie group": (item.NodeRigidBodyRotVecLG, lambda a: [0, 0, a]),
}
real, least, most = exu.symbolic.Real, exu.symbolic.min, exu.symbolic.max


class Model:
    """A system, and the nodes of its chains."""

    def __init__(self, chains, node=None):
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.ground = self.coordinate(self.system.AddNode(item.NodePointGround()), 0)
        self.node, self.beams, self._kept = node, [], []
        self.nodes = [self._add(chain) for chain in chains]

    def _add(self, chain):
        add, s = self.system, chain.section
        if self.node is None:
            kind, turn, beam = item.NodeRigidBody2D, [chain.angle], item.Beam2D
            of_section = {
                "massPerLength": s.rhoA, "crossSectionInertia": s.rhoI, "bendingStiffness": s.EI,
                "axialStiffness": s.EA, "shearStiffness": s.GA,
            }  # fmt: skip
        else:  # the chain lies in the plane of x and y
            (kind, turn), beam = NODES[self.node], item.Beam3D
            section = exu.BeamSection()
            section.stiffnessMatrix = np.diag([s.EA, s.GA, s.GA3, s.GJ, s.EI2, s.EI])
            section.inertia = np.diag([s.rhoI + s.rhoI2, s.rhoI2, s.rhoI])
            section.massPerLength = s.rhoA
            turn, of_section = turn(chain.angle), {"sectionData": section}
        nodes = [add.AddNode(kind(referenceCoordinates=[*p, *turn])) for p in chain.points]
        for pair in pairwise(nodes):
            cell = beam(nodeNumbers=list(pair), length=chain.h, **of_section)
            self.beams.append(add.AddObject(cell))
        return nodes

    def coordinate(self, node, c):
        return self.system.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=c))

    def tie(self, a, b, components):
        """Equal components of the motion of two nodes; ``b`` may be None, the ground."""
        for c in components:
            other = self.ground if b is None else self.coordinate(b, c)
            pair = [other, self.coordinate(a, c)]
            self.system.AddObject(item.CoordinateConstraint(markerNumbers=pair))

    def load(self, node, force, moment=None):
        """Symbolic functions of time: a force (x, y) or (x, y, z), and a moment (x, y, z)."""
        zero = real(0.0)
        marker = self.system.AddMarker(item.MarkerNodeRigid(nodeNumber=node))
        made = [(item.LoadForceVector, lambda m, t, v: [*force(t), zero][:3])]
        if moment is not None:
            made.append((item.LoadTorqueVector, lambda m, t, v: moment(t)))
        for kind, function in made:
            load = self.system.AddLoad(kind(markerNumber=marker, loadVector=[0, 0, 0]))
            self.function(self.system.SetLoadParameter, function, "loadVectorUserFunction", load)

    def function(self, setter, function, name, number):
        symbolic = CreateSymbolicUserFunction(self.system, function, name, number)
        self._kept.append(symbolic)
        setter(number, name, symbolic)

    def sense(self, kind, what, **of):
        return self.system.AddSensor(
            kind(**of, outputVariableType=what, storeInternal=True, writeToFile=False)
        )

    def where(self, node):
        position = self.system.GetNodeOutput(node, exu.OutputVariableType.Position)
        return position[: 3 if self.node else 2].tolist()

    def history(self, sensor, column):
        """All but the initial value, one a period."""
        return np.array(self.system.GetSensorStoredData(sensor))[1:, column].tolist()


def settings(newton, solver, rtol=1e-8, atol=1e-8, sampled=None):
    s = exu.SimulationSettings()
    s.solution.file.write = False
    s.solution.solverInformationFileName = ""
    s.solution.sensors.active = sampled is not None
    s.solution.sensors.writePeriod = sampled or 1.0
    s.displayStatistics = s.displayComputationTime = False
    s.parallel.numberOfThreads = 1
    s.linearSolver.solverType = SOLVERS[solver]
    s.linearSolver.reuseAnalyzedPattern = solver == "sparse"
    for part in (s.timeIntegration, s.staticSolver):
        part.verboseMode = part.stepInformation = 0
        part.adaptiveStep = False
        part.newton.relativeTolerance, part.newton.absoluteTolerance = rtol, atol
    s.timeIntegration.newton.useModifiedNewton = newton == "modified"
    return s


def integrator(s, rho):
    """The integrator: generalised-α with its spectral radius, or the trapezoidal rule."""
    α = s.timeIntegration.generalizedAlpha
    if rho == "trapezoidal":
        α.spectralRadius, α.useIndex2Constraints, α.useNewmark = 1.0, True, True
    else:
        α.spectralRadius = rho


def solve(solver, model, s):
    """Only the steps are timed."""
    if not solver.InitializeSolver(model.system, s):
        raise RuntimeError("InitializeSolver failed")
    stopwatch = Stopwatch()
    with stopwatch:
        done = solver.SolveSteps(model.system, s)
    counts = {"newton": solver.it.newtonStepsCount, "jacobians": solver.it.newtonJacobiCount}
    if not done:
        counts["failed"] = f"stopped at t = {solver.it.currentTime:.4g}"
    solver.FinalizeSolver(model.system, s)
    return counts | stopwatch.read()


def run(model, s, end, steps):
    s.timeIntegration.endTime, s.timeIntegration.numberOfSteps = end, steps
    return {"steps": steps, **solve(exu.MainSolverImplicitSecondOrder(), model, s)}


def roll_up(cells, turns, newton, solver):
    p = PROBLEMS["P1"]
    model = Model(p.chains(cells))
    (nodes,) = model.nodes
    model.tie(nodes[0], None, (0, 1, 2))
    end = model.system.AddMarker(item.MarkerNodeRigid(nodeNumber=nodes[-1]))
    torque = [0, 0, p.moment(turns)]
    model.system.AddLoad(item.LoadTorqueVector(markerNumber=end, loadVector=torque))
    model.system.Assemble()
    tolerance = 1e-8 if cells <= 10_000 else 1e-6  # it does not reach less on fine meshes
    s = settings(newton, solver, tolerance, tolerance)
    s.staticSolver.numberOfLoadSteps = p.steps
    s.staticSolver.newton.maxIterations = 60
    result = solve(exu.MainSolverStatic(), model, s)
    return {"steps": p.steps} | result | {"values": {"tip": model.where(nodes[-1])}}


def flying_beam(cells, dt, newton, solver, steps=None, rho=1.0, pulse="sudden"):
    p = PROBLEMS["P2"]
    model = Model(p.chains(cells))
    (nodes,) = model.nodes

    def factor(t):
        """1 until the push ends, 1/2 there, then 0; 3/2 at the first step, where the trapezoidal
        impulse lacks the first half, because no initial accelerations are computed."""
        if pulse == "triangle":
            return most(real(0.0), least(t, p.until - t)) * (2 / p.until)
        on = most(real(0.0), least(real(1.0), (p.until - t) * (500 / dt) + 0.5))
        return on + 0.5 * most(real(0.0), 1.0 - exu.symbolic.abs(t - dt) * (1000 / dt))

    zero = real(0.0)
    model.load(
        nodes[0],
        lambda t: [p.force * factor(t), zero],
        lambda t: [zero, zero, p.moment * factor(t)],
    )
    model.system.Assemble()
    s = settings(newton, solver)
    integrator(s, rho)
    # that of a force on the node of a fine mesh would spoil the predictor
    s.timeIntegration.generalizedAlpha.computeInitialAccelerations = False
    n = steps or round(p.end / dt)
    result = run(model, s, n * dt, n)
    return result | {"values": {"ends": [model.where(nodes[i]) for i in (0, -1)]}}


def swing(cells, dt, newton, solver, rho=0.9, end=None):
    p = PROBLEMS["P3"]
    model = Model(p.chains(cells))
    beam, left, right = model.nodes
    for connector, node in ((left, beam[0]), (right, beam[-1])):
        model.tie(connector[-1], None, (0, 1))
        pair = [
            model.system.AddMarker(item.MarkerNodePosition(nodeNumber=n))
            for n in (connector[0], node)
        ]
        model.system.AddObject(item.ObjectJointRevolute2D(markerNumbers=pair))
    middle = beam[len(beam) // 2]
    mass = item.ObjectRigidBody2D(physicsMass=p.mass, physicsInertia=0.0, nodeNumber=middle)
    model.system.AddObject(mass)
    slope = 2 * p.peak / p.until
    model.load(middle, lambda t: [most(real(0.0), least(t, p.until - t)) * slope, real(0.0)])
    sensor = model.sense(item.SensorNode, DISPLACEMENT, nodeNumber=middle)
    model.system.Assemble()
    s = settings(newton, solver, atol=1e-5, sampled=p.sampled)  # fine meshes do not reach less
    integrator(s, rho)
    n = round((end or p.end) / dt)
    result = run(model, s, n * dt, n)
    u, v = (model.history(sensor, column) for column in (1, 2))
    return result | {"values": {"middle": list(zip(u, v, strict=True))}}


def portal(cells, dt, newton, solver, rho="trapezoidal"):
    p = PROBLEMS["P4"]
    model = Model(p.chains(cells))
    left, girder, right = model.nodes
    model.tie(left[0], None, (0, 1, 2))
    model.tie(right[-1], None, (0, 1, 2))
    model.tie(left[-1], girder[0], (0, 1, 2))
    model.tie(girder[-1], right[0], (0, 1))
    turn = [model.coordinate(node, 2) for node in (girder[-1], right[0])]
    connect = hinge(model, turn, p)

    def push(t):
        return [p.force * exu.symbolic.sin(least(t, real(p.until)) * (np.pi / p.until)), real(0.0)]

    model.load(left[-1], push)
    senses = (
        model.sense(item.SensorNode, DISPLACEMENT, nodeNumber=left[-1]),
        model.sense(item.SensorObject, DISPLACEMENT, objectNumber=connect),
    )
    model.system.Assemble()
    s = settings(newton, solver, atol=1e-6, sampled=p.sampled)
    integrator(s, rho)
    result = run(model, s, p.end, round(p.end / dt))
    u, turned = (model.history(sensor, 1) for sensor in senses)
    return result | {"values": {"u": u, "turn": turned}}


def hinge(model, turn, p):
    """A symbolic return map; the plastic rotation is committed in Python after each step.

    Exudyn's friction bristle (CoordinateSpringDamperExt) would need no Python, but it diverges
    here, or comes to rest elsewhere.
    """
    k, limit, slip = p.stiffness * (1 - p.ratio), p.limit * (1 - p.ratio), 0.0

    def moment(system, t, i, q, v, stiffness, damping, offset):
        elastic = k * (q - offset)
        return p.stiffness * p.ratio * q + most(real(-limit), least(real(limit), elastic))

    spring = item.ObjectConnectorCoordinateSpringDamper(markerNumbers=turn, stiffness=p.stiffness)
    number = model.system.AddObject(spring)
    model.function(model.system.SetObjectParameter, moment, "springForceUserFunction", number)

    def commit(system, t):
        nonlocal slip
        elastic = k * (system.GetObjectOutput(number, DISPLACEMENT) - slip)
        if abs(elastic) > limit:
            slip += np.copysign(abs(elastic) - limit, elastic) / k
            system.SetObjectParameter(number, "offset", slip)
        return True

    model.system.SetPostStepUserFunction(commit)
    return number


def cantilever(cells, dt, newton, solver):
    p = PROBLEMS["P5"]
    model = Model(p.chains(cells))
    (nodes,) = model.nodes
    model.tie(nodes[0], None, (0, 1, 2))
    model.load(nodes[-1], lambda t: [real(0.0), t * (p.force / p.end)])
    model.system.Assemble()
    s = settings(newton, solver, rtol=1e-6, atol=1e-3)  # it does not reach less on fine meshes
    result = run(model, s, p.end, round(p.end / dt))
    return result | {"values": {"tip": model.where(nodes[-1])}}


def tumbling_beam(cells, dt, newton, solver, node, steps=None, rho=1.0):
    p = PROBLEMS["P6"]
    model = Model(p.chains(cells), node)
    (nodes,) = model.nodes
    slope = 2 * p.peak / p.until

    def load(vector):
        return lambda t: [most(real(0.0), least(t, p.until - t)) * (slope * v) for v in vector]

    model.load(nodes[0], load(p.force), load(p.moment))
    parts = exu.OutputVariableType.KineticEnergy, exu.OutputVariableType.PotentialEnergy
    energies = [
        model.sense(item.SensorBody, part, bodyNumber=beam)
        for beam in model.beams
        for part in parts
    ]
    model.system.Assemble()
    # it does not reach less on fine meshes
    tolerance = 1e-7 if node == "Lie group" and cells > 256 else 1e-8
    s = settings(newton, solver, tolerance, tolerance, sampled=p.until)
    integrator(s, rho)
    n = steps or round(p.end / dt)
    result = run(model, s, n * dt, n)
    ends = [model.where(nodes[i]) for i in (0, -1)]
    energy = np.sum([model.history(sensor, 1) for sensor in energies], axis=0).tolist()
    return result | {"values": {"ends": ends, "energy": energy}}


RUNS = {
    "P1": roll_up, "P2": flying_beam, "P3": swing, "P4": portal, "P5": cantilever,
    "P6": tumbling_beam,
}  # fmt: skip
