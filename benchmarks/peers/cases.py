"""What is run: each program with its settings on each problem, and the ladders of the figure."""

from typing import NamedTuple


class Case(NamedTuple):
    """One program at one setting on one problem.

    Attributes:
        label: The setting, for tables and legends; "" for the only one.
        settings: Arguments of the program's function.
        group: Cases that are compared run in turn.
    """

    program: str
    problem: str
    label: str
    settings: dict

    @property
    def group(self):
        names = ("cells", "dt", "turns")
        return self.problem, *(self.settings.get(name) for name in names)


NEWTON = ("full", "modified")
SMALL = 64
"""Exudyn's dense solver is tried up to this number of cells."""


def exudyn(problem, cells, newton=NEWTON, **more):
    for solver in ("sparse", "dense") if cells <= SMALL else ("sparse",):
        for one in newton:
            settings = {"cells": cells, "newton": one, "solver": solver, **more}
            yield Case("exudyn", problem, f"{one} Newton, {solver}", settings)


def opensees(problem, cells, label="", **more):
    yield Case("opensees", problem, label, {"cells": cells, **more})


def ours(problem, cells, label="", **more):
    yield Case("ufl_beam", problem, label, {"cells": cells, **more})


def flying_beam():
    few = {512: 50, 4096: 10}  # steps of OpenSees, which would take minutes
    for dt in (0.1, 0.01):
        for cells in (8, 64, 512, 4096):
            yield from ours("P2", cells, dt=dt)
            yield from exudyn("P2", cells, dt=dt)
            shorter = {"steps": few[cells]} if cells in few else {}
            yield from opensees("P2", cells, dt=dt, **shorter)


def portal():
    for cells in (12, 48):
        yield from ours("P4", cells, dt=1e-3)
        yield from exudyn("P4", cells, dt=1e-3)
        yield from opensees("P4", cells, dt=1e-3, element="shear", label="with shear")
        yield from opensees("P4", cells, dt=1e-3, label="without shear")


def timed():
    """The cases of the tables."""
    return [*flying_beam(), *portal()]
