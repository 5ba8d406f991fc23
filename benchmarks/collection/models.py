# SPDX-License-Identifier: MIT
"""A model of the collection, and the judgement of its runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import ufl_beam as ub


class CutSteps(ub.extend.Recorder):
    """Recorder that counts the steps that were divided into substeps."""

    def __init__(self) -> None:
        self.cut = self.last = 0

    def open(self, simulation) -> None:
        """Begin at the present number of substeps."""
        self.last = simulation.substeps

    def write(self, simulation) -> None:
        """Count the last step if it has several substeps."""
        self.cut += simulation.substeps > self.last + 1
        self.last = simulation.substeps


@dataclass(frozen=True)
class Case:
    """A scene, its load history or path, and the compared quantity.

    Attributes:
        scene: The scene.
        watched: Method of the solution ("displacement", "reaction"), "force" of a connector or
            "factor" of a path, with the place, support or connector; and the component.
        steps: Number of steps.
        end: Time of the end; s.
        rest: Scene in whose equilibrium dynamics begin; None begins undeformed.
        dynamic: Whether the run is in dynamics.
        control: Function of the divisor that returns the control of a path; None for a run.
        until: End of the path.
        compared: Function that returns the compared numbers of the history of a path.
        arc: Length of a step of a path in OpenSees; m.
        ends: End of the path in OpenSees: a quantity as in ``watched``, and the limit below which
            it falls.
    """

    scene: ub.Scene
    watched: tuple
    steps: int
    end: float = 1.0
    rest: ub.Scene | None = None
    dynamic: bool = False
    control: Callable[[int], object] | None = None
    until: Callable | None = None
    compared: Callable[[np.ndarray], list] | None = None
    arc: float = 0.0
    ends: tuple = ()

    def history(self, run) -> np.ndarray:
        """Return the history of the compared quantity."""
        method, *of = self.watched
        if method == "factor":
            return run.factor
        if method == "force":
            return run.connector(*of).force
        return getattr(run, method)(of[0])[:, of[1]]

    def run(self, divisor: int = 1, record=()) -> np.ndarray:
        """Run with the step divided; the history, or the compared numbers of a path."""
        if self.control is not None:
            path = ub.follow(
                self.scene,
                self.control(divisor),
                steps=self.steps * divisor,
                until=self.until,
                record=record,
                progress=False,
            )
            return np.array(self.compared(self.history(path)))
        rest = self.rest and ub.simulate(self.rest, ub.Static(), t=(0, 1), dt=0.25, progress=False)
        scheme = ub.EnergyMomentum() if self.dynamic else ub.Static()
        more = {} if rest is None else {"start": rest}
        return self.history(
            ub.simulate(
                self.scene,
                scheme,
                t=(0, self.end),
                dt=self.end / (self.steps * divisor),
                record=record,
                progress=False,
                **more,
            )
        )

    def small(self) -> Case:
        """Return the case with a thousandth of all loads and motions; a path under load control.

        Dynamics end after a quarter of the time.
        """

        def motion(function):
            return lambda t: function(t) / 1000

        swap: dict = {}
        for support in self.scene.supports:
            if isinstance(support, ub.PrescribedDisplacement):
                moves = {("u", "v", "psi")[k]: motion(f) for k, f in support.held.items()}
                swap[support] = replace(support, **moves)
        for load in self.scene.loads:
            field = "acceleration" if isinstance(load, ub.Gravity) else "force"
            swap[load] = replace(load, **{field: tuple(x / 1000 for x in getattr(load, field))})

        def swapped(scene):
            lists = {
                name: [swap.get(one, one) for one in getattr(scene, name)]
                for name in ("supports", "loads")
            }
            return replace(scene, **lists)

        watched = tuple(swap.get(x, x) for x in self.watched)
        steps, end = self.steps, self.end
        if self.dynamic:
            steps, end = steps // 4, end / 4
        if self.control is not None:
            place = self.scene.loads[0].place
            watched, steps = ("displacement", place, 1), 1
        rest = self.rest and swapped(self.rest)
        return Case(swapped(self.scene), watched, steps, end, rest, self.dynamic)


@dataclass(frozen=True)
class Model:
    """A model that is hard to converge.

    Attributes:
        name: Title.
        kind: "statics", "path" or "dynamics".
        source: Report of the failure, or the reason why such models fail.
        quantity: Name and unit of the compared number.
        case: Function that builds the case.
        stops: Parts of the message if the model must stop, such as the names of the hinges of its
            mechanism; empty if it must reach the end.
        limit: Function that computes the time at which it must stop by limit analysis, from the
            solution at this time, whose displaced geometry it may use.
        tolerance: Relative difference that `limit` allows.
        failure: Reason why this package fails, if it is known to.
    """

    name: str
    kind: str
    source: str
    quantity: str
    case: Callable[[], Case]
    stops: tuple[str, ...] = ()
    limit: Callable[[ub.Solution], float] | None = None
    tolerance: float = 0.0
    failure: str = ""


MODELS: dict[str, Model] = {}
"""The collection."""


def model(name: str, kind: str, source: str, quantity: str, **more):
    """Enter a case into the collection."""

    def enter(case):
        MODELS[name] = Model(name, kind, source, quantity, case, **more)
        return case

    return enter


@dataclass(frozen=True)
class Result:
    """Result of one run.

    Attributes:
        end: Time of the last state if the run stopped; None if it reached the end.
        message: Message of the error; empty if the run reached the end.
        values: History of the compared quantity; empty if the run stopped.
        cut: Number of steps that were divided.
        seconds: Time of the run.
        solution: States up to the stop; None if the run reached the end.
    """

    end: float | None
    message: str
    values: np.ndarray
    cut: int
    seconds: float
    solution: ub.Solution | None


def result(one: Model, divisor: int) -> Result:
    """Run a model with its step divided by ``divisor``."""
    steps, begin = CutSteps(), time.perf_counter()
    end, message, values, solution = None, "", np.zeros(0), None
    try:
        values = one.case().run(divisor, steps)
    except ub.ConvergenceError as error:
        end, message, solution = error.time, " ".join(str(error).split()), error.solution
    return Result(end, message, values, steps.cut, time.perf_counter() - begin, solution)


def judged(one: Model) -> dict:
    """Run a model with its step and with a quarter of it; return the row of the table."""
    first, second = result(one, 1), result(one, 4)
    row = {"name": one.name, "kind": one.kind, "source": one.source, "quantity": one.quantity}
    row |= {"cut": first.cut, "cut_fine": second.cut, "seconds": first.seconds}
    row |= {
        "failure": one.failure,
        "message": first.message,
        "end": first.end,
        "seconds_fine": second.seconds,
    }
    if first.end is None and second.end is None:
        fine = second.values if one.kind == "path" else second.values[::4]
        size = np.abs(second.values).max()
        row["peak"] = float(size)
        row["history"] = float(np.abs(first.values - fine).max() / size)
        row["difference"] = float(abs(np.abs(first.values).max() / size - 1))
        return row | {"verdict": "WRONG" if one.stops else "end"}
    if first.end is None or second.end is None:
        row |= {"message": first.message or second.message, "end": first.end or second.end}
        return row | {"verdict": "FAILS"}
    row["difference"] = abs(first.end / second.end - 1)
    if not one.stops:
        return row | {"verdict": "FAILS"}
    if not all(part in first.message for part in one.stops):
        return row | {"verdict": "WRONG"}
    if one.limit is not None:
        row["limit"] = one.limit(first.solution)
        row["missed"] = abs(first.end / row["limit"] - 1)
        if row["missed"] > one.tolerance:
            return row | {"verdict": "WRONG"}
    return row | {"verdict": "stops"}
