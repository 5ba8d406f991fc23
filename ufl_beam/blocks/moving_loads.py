# SPDX-License-Identifier: MIT
"""Statements of forces and masses that move along beams, on each cell of their route."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import BlockSetting, Elements, InTime, Made
from ufl_beam.blocks.cells import StatementOnCell, places, positions
from ufl_beam.blocks.nodes_in_space import unknowns
from ufl_beam.blocks.statement import Equations, Inputs
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.cell_functions import AxisOfCell, Cell
from ufl_beam.mechanics.kinematics import split
from ufl_beam.mechanics.time_scheme import DynamicScheme, has_inertia
from ufl_beam.model.loads import MovingLoad

ON_ROUTE = "low", "high", "first", "last"
"""Distances along the route: bounds between which the cell acts, and ends of the cell; m."""

NEAR = "now", "end", "half_before", "half_after", "later", "twice_later"
"""Times of the distances of a mass, see :data:`~ufl_beam.blocks.block.TIMES`."""


@dataclass(frozen=True)
class _OnRoute(StatementOnCell):
    """Effect at a place that moves along a route, on one cell of the route."""

    @property
    def numbers(self) -> tuple[str, ...]:
        """Distances of the cell, and positions of the nodes."""
        return *ON_ROUTE, *places(self.degree)

    @staticmethod
    def at_distance(cell: Cell, at: Inputs, distance: Expr) -> tuple[Expr, AxisOfCell]:
        """Return 1 if the cell acts for a distance, else 0; and the axis of the cell there."""
        acts = ufl.And(ufl.gt(distance, at["low"]), ufl.le(distance, at["high"]))
        s = (distance - at["first"]) / (at["last"] - at["first"])
        return ufl.conditional(acts, 1.0, 0.0), AxisOfCell(cell, s)


@dataclass(frozen=True)
class MovingForce(_OnRoute):
    """Force at a place that moves; substeps in statics apply a part of the change on each cell."""

    of_step = "place", "factor", "fraction", "reached"
    acts_at = ("place",)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Force for a factor of 1 (N), and the numbers of the base class."""
        return "force x", "force y", *super().numbers

    @property
    def state(self) -> list[str]:
        """Applied forces on the nodes: x of all nodes, then y; N."""
        return [f"applied {c}{k}" for c in "xy" for k in range(self.nodes)]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        cell = Cell(self.degree, at)
        here, axis = self.at_distance(cell, at, at["place"])
        w, _ = split(axis.field(cell.virtual))
        work = here * at["factor"] * (at["force x"] * w[0] + at["force y"] * w[1])
        wanted = dict(zip(self.state, cell.forces(work), strict=False))

        def applied(part: Expr) -> dict[str, Expr]:
            return {x: (1.0 - part) * at[x] + part * force for x, force in wanted.items()}

        forces = [-force for force in applied(at["reached"]).values()]
        return Equations([*forces, *[ufl.as_ufl(0.0)] * self.nodes], applied(at["fraction"]))


@dataclass(frozen=True)
class MovingForceInSpace(MovingForce):
    """The same in space, on the displacements of both nodes of a cell."""

    @property
    def unknowns(self) -> list[str]:
        """Displacements of both nodes, component by component."""
        return unknowns(2)[:6]

    @property
    def numbers(self) -> tuple[str, ...]:
        """Force for a factor of 1 (N), and distances of the cell."""
        return *(f"force {c}" for c in "xyz"), *ON_ROUTE

    @property
    def state(self) -> list[str]:
        """Applied forces on the nodes; N."""
        return [f"applied {x}" for x in self.unknowns]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        acts = ufl.And(ufl.gt(at["place"], at["low"]), ufl.le(at["place"], at["high"]))
        s = (at["place"] - at["first"]) / (at["last"] - at["first"])
        here = ufl.conditional(acts, at["factor"], 0.0)
        wanted = [here * at[f"force {c}"] * share for c in "xyz" for share in (1.0 - s, s)]

        def applied(part: Expr) -> list[Expr]:
            pairs = zip(self.state, wanted, strict=True)
            return [(1.0 - part) * at[x] + part * force for x, force in pairs]

        state = dict(zip(self.state, applied(at["fraction"]), strict=True))
        return Equations([-force for force in applied(at["reached"])], state)


@dataclass(frozen=True)
class MovingMass(_OnRoute):
    """Mass with the velocity of the point of the axis that it is at: v = ṙ + ṡ r'.

    Rotations of the axis do not enter the velocity.  The mass has a momentum of its own: at a kink
    of the axis, between two cells, it gains the momentum that the axis loses, so that r'' is not
    needed.  The scheme gives the mass the acceleration that fits its velocities.  A mass that comes
    to the route takes the rates of its point of the axis; ṡ enters the velocity only.

    Attributes:
        scheme: Time scheme.
    """

    scheme: DynamicScheme
    acts_at = "place now", "place end"

    @property
    def numbers(self) -> tuple[str, ...]:
        """Mass (kg), length of the route (m), and the numbers of the base class."""
        return "mass", "route", *super().numbers

    @property
    def rates(self) -> int:
        """Velocity, velocity before the last step, and further rates of the scheme."""
        return 2 + len(self.scheme.further_rates)

    @property
    def of_step(self) -> list[str]:
        """Distances at the time of the loads, at the end of the step, and near both times; m."""
        rows = "inertia", "velocity", *(f"rates {i}" for i in range(self.rates - 1))
        coefficients = [f"{row} {j}" for row in rows for j in range(self.rates + 1)]
        return [*(f"place {time}" for time in NEAR), "dt", *coefficients]

    @property
    def shared(self) -> list[str]:
        """Whether the mass is on the route (1 or 0), and its rates."""
        return ["on", *(f"own rate{j + 1} {c}" for j in range(self.rates) for c in "xy")]

    @property
    def trial(self) -> list[str]:
        """Rates of the mass besides its velocities."""
        return self.shared[5:]

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        cell, u0, u1 = Cell(self.degree, at), at.motions("q0"), at.motions("q1")
        number, place = range(1, self.rates + 1), {time: at[f"place {time}"] for time in NEAR}
        of_nodes = [at.motions(f"rate{j}") for j in number]
        own = [ufl.as_vector([at[f"own rate{j} {c}"] for c in "xy"]) for j in number]

        def row(name: str, step: Expr, rates: list[Expr]) -> Expr:
            return sum((at[f"{name} {j}"] * x for j, x in enumerate([step, *rates])), 0)

        def of_axis(axis: AxisOfCell, name: str, speed: Expr | float, fraction: float) -> Expr:
            start, end, *rates = map(axis.field, (u0, u1, *of_nodes))
            moved, _ = split((1.0 - fraction) * start + fraction * end)
            v, _ = split(row(name, end - start, rates))
            return v + speed * (axis.t0 + axis.d(moved))

        def on_route(distance: Expr) -> Expr:
            within = ufl.And(ufl.ge(distance, 0.0), ufl.le(distance, at["route"]))
            return ufl.conditional(within, 1.0, 0.0)

        here, axis = self.at_distance(cell, at, place["now"])
        there, axis_at_end = self.at_distance(cell, at, place["end"])
        carried, remains = at["on"] * on_route(place["now"]), on_route(place["end"])
        speed = (place["half_after"] - place["half_before"]) / at["dt"]
        v = of_axis(axis, "velocity", speed, self.scheme.load_weight)
        step = (v - row("velocity", ufl.zero(2), own)) / at["velocity 0"]
        w, _ = split(axis.field(cell.virtual))
        work = here * carried * at["mass"] * ufl.dot(row("inertia", step, own), w)

        # Parabola through later places: some functions of time begin with the run
        ways = place["later"] - place["end"], place["twice_later"] - place["end"]
        speed = (4.0 * ways[0] - ways[1]) / (2e-6 * lib.LATER)
        stays, comes = here * carried * remains, there * (1.0 - carried) * remains
        new = list[Expr]()
        for i in (0, None, *range(1, self.rates - 1)):  # None: the velocity before the step
            carries = own[0] if i is None else row(f"rates {i}", step, own)
            arrives = of_axis(axis_at_end, f"rates {i or 0}", 0.0 if i else speed, 1.0)
            new.append(stays * carries + comes * arrives)
        before, after = (at["mass"] / 2.0 * ufl.dot(x, x) for x in (own[0], new[0]))
        values = stays + comes, *(x[i] for x in new for i in range(2))
        return Equations(
            cell.forces(work), dict(zip(self.shared, values, strict=True)), {"kinetic": after},
            supplied={"loads": after - here * at["on"] * before},
        )  # fmt: skip


def moving_loads(loads: Sequence[MovingLoad], setting: BlockSetting) -> Iterator[Made]:
    """Yield statements and elements of the forces of loads, then of their masses in dynamics."""
    degree, scheme = setting.subdomain.numbering.mesh.degree, setting.scheme
    force = MovingForceInSpace if setting.scene.in_space else MovingForce
    yield force(degree), _elements("moving forces", loads, setting, heavy=False)
    heavy = [load for load in loads if load.mass]
    if heavy and has_inertia(scheme):
        yield MovingMass(degree, scheme), _elements("moving masses", heavy, setting, heavy=True)


def _elements(
    name: str, loads: Sequence[MovingLoad], setting: BlockSetting, *, heavy: bool
) -> Elements:
    """Return elements of :class:`MovingForce` or :class:`MovingMass` on the routes of loads."""
    subdomain, numbering, rows = setting.subdomain, setting.subdomain.numbering, list[Array]()
    local = np.full(len(numbering.cells), -1)
    local[subdomain.cells] = np.arange(len(subdomain.cells))
    for k, load in enumerate(loads):
        cells = np.concatenate([numbering.cells_of(beam) for beam in load.route])
        ends = np.append(0.0, np.cumsum(numbering.lengths(cells)))
        acts = ends.copy()
        acts[0] = np.nextafter(0.0, -1.0)  # the start of the route belongs to its first cell
        if heavy:  # its ends act for all distances beyond
            acts[[0, -1]] = -np.inf, np.inf
        given = (load.mass, ends[-1]) if heavy else (*load.force, 0.0)[: numbering.displacements]
        numbers = np.tile([k, *given], (len(cells), 1)), acts[:-1], acts[1:], ends[:-1], ends[1:]
        rows.append(np.column_stack([local[cells], *numbers])[local[cells] >= 0])
    table = np.concatenate(rows).T
    cells, of_load = table[:2].astype(np.int32)
    wanted = {"place": ("position", "whole"), "factor": ("amplitude", "whole")}
    if heavy:
        wanted = {f"place {time}": ("position", time) for time in NEAR}
    # In space there are forces on displacements only, and section forces follow from strains
    dofs, in_space = subdomain.cell_dofs[cells], setting.scene.in_space
    return Elements(
        name, subdomain.cells[cells] + len(numbering.cells) * of_load,
        dofs[:, :6] if in_space else dofs,
        [*table[2:], *(() if in_space else positions(subdomain, cells))],
        [InTime(getattr(x, name), x, time) for name, time in wanted.values() for x in loads],
        {name: k * len(loads) + of_load for k, name in enumerate(wanted)},
        None if in_space else cells,
        groups=of_load, number_of_groups=len(loads) * heavy,
    )  # fmt: skip
