# SPDX-License-Identifier: MIT
"""Effects of a user at places and along beams: statements, virtual works, potentials."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity
from ufl.classes import Zero
from ufl.core.expr import Expr
from ufl.domain import extract_domains

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import Block, BlockSetting, Elements, InTime
from ufl_beam.blocks.cells import POINT, at_points, places, positions
from ufl_beam.blocks.effect_blocks import (
    EffectBlock,
    OfPython,
    PythonBlock,
    computed,
    require_work,
    work_in_step,
)
from ufl_beam.blocks.statement import Equations, Inputs, Statement
from ufl_beam.compiled.c_library import lib
from ufl_beam.discretization.cell_functions import AxisOfCell, Cell
from ufl_beam.errors import ModelError, calling, shorten
from ufl_beam.mechanics.kinematics import COMPONENTS
from ufl_beam.mechanics.relative_motions import by_turning, virtual_displacement
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.bodies import arm
from ufl_beam.model.connector_law import CONTRIBUTIONS, LOSSES
from ufl_beam.model.functions import Constant, steady, value_at
from ufl_beam.model.works import Effect, Potential, VirtualWork, Work

TIMES = "now", "end", "before", "between"
"""Times of numbers that vary, see :data:`~ufl_beam.blocks.block.TIMES`."""

ENTRIES = {"stored": ["stored"], "lost": [*LOSSES, "numerical"], "supplied": ["loads"]}
"""Entries of the package in the ledger to which statements of a user may add, by account."""


class Element(dict[str, Any]):
    """Inputs of a user's statement by name, see :class:`Statement`.

    Attributes:
        inputs: Inputs of :class:`OfUser`.
        steps: Virtual motions of the nodes whose values in a step are the changes of the motions.
        virtual: The same at the places.
        length: Length for which the element stands, m; 1 at places.
        worked: Forces of :meth:`work`, by the names of their states; None before the call.
    """

    def __init__(self, statement: OfUser, at: Inputs) -> None:
        inner, self.scheme, self.inputs = statement.inner, statement.scheme, at
        self._statement, nodes = statement, range(statement.nodes)
        self.nodes = [at.motions("q0"), at.motions("q1")]
        self.variables = [[ufl.variable(ufl.as_ufl(0.0)) for _ in COMPONENTS] for _ in nodes]
        self.axis, self.length, self.virtual = None, ufl.as_ufl(1.0), list[Expr]()
        self.worked: dict[str, Expr] | None = None
        if statement.degree:
            self.axis = AxisOfCell(Cell(statement.degree, at), at["s"])
            self.places, self.length = [self.axis.x], at["weight"] * self.axis.h
        else:
            self.places, self._arms = (
                [ufl.as_vector([at[f"{name} {c}{k}"] for c in "xy"]) for k in nodes]
                for name in ("place", "arm")
            )
        self.q0, self.q1 = map(self.motions, self.nodes)
        θ = self.scheme.load_weight
        pairs = [*zip(self.q0, self.q1, strict=True)]
        self.q = [(1.0 - θ) * q0 + θ * q1 for q0, q1 in pairs]
        self.v = [(q1 - q0) / at["dt"] for q0, q1 in pairs]
        self.steps, w = list[Expr](), [ufl.as_vector(v) for v in self.variables]
        for k, (q0, q1, u) in enumerate(zip(*self.nodes, w, strict=True)):
            turn = self.scheme.virtual_rotation(0.0, q1[2] - q0[2], u[2])
            self.steps.append(ufl.as_vector([u[0], u[1], turn]))
            if not self.axis:
                moved = virtual_displacement(q0, q1, u, self._arms[k], self.scheme)
                self.virtual.append(ufl.as_vector([moved[0], moved[1], turn]))
        if self.axis:
            self.virtual = [self.axis.field(self.steps)]
        super().__init__({x: at[f"state {x}"] for x in inner.state} | {"dt": at["dt"]})
        self.update(self.numbers("now"))

    def __missing__(self, name: str) -> Any:
        raise KeyError(f"{name!r} is no input; the inputs are {', '.join(self)}")

    def numbers(self, when: str) -> dict[str, Expr]:
        """Return the numbers at one of :data:`TIMES`."""
        time = when if self._statement.varies else "now"
        return {name: self.inputs[f"{name} {time}"] for name in self._statement.names}

    def motions(self, nodal: Sequence[Expr]) -> list[Expr]:
        """Return the motions of the places from motions of the nodes."""
        if self.axis:
            return [self.axis.field(nodal)]
        moved = [by_turning(x, q[2]) for x, q in zip(self._arms, nodal, strict=True)]
        pairs = zip(nodal, moved, strict=True)
        return [ufl.as_vector([q[0] + u[0], q[1] + u[1], q[2]]) for q, u in pairs]

    def work(self, forces: Sequence[Any]) -> Expr:
        """Return the work of forces in the step, in the ledger of the scheme; J."""
        require_work(len(forces), len(self.q1), again=self.worked is not None)
        self.worked = {}
        a, work, before = self.scheme.weight_of_before, ufl.as_ufl(0.0), 0.0
        for k, (f, q0, q1) in enumerate(zip(forces, self.q0, self.q1, strict=True)):
            for i, c in enumerate(COMPONENTS):
                if a:
                    self.worked[name := f"force {c}{k}"] = f[i]
                    before = self.inputs[name]
                work += work_in_step(a, before, f[i], q0[i], q1[i])
        return work

    def potential(
        self, name: str, energy: Callable[[list[Expr], dict[str, Expr]], Any]
    ) -> Equations:
        """Return the forces of an energy, which is a function of motions and numbers; J."""
        scheme, size = self.scheme, 3 * len(self.steps)
        q0, q1, s = (
            ufl.as_vector([x[i] for x in nodal for i in range(3)])
            for nodal in (*self.nodes, self.steps)
        )

        def value(q: Expr, when: str) -> Expr:
            nodal = [ufl.as_vector([q[k + i] for i in range(3)]) for k in range(0, size, 3)]
            return ufl.as_ufl(energy(self.motions(nodal), self.numbers(when)))

        def along(s: Expr, q: Expr) -> Expr:
            variables = [ufl.variable(q[i]) for i in range(size)]
            now = value(ufl.as_vector(variables), "now")
            return sum((ufl.diff(now, x) * s[i] for i, x in enumerate(variables)), 0)

        if isinstance(expand_derivatives(along(s, q1)), Zero):
            raise ModelError(
                f"{self._statement.label}: the energy must depend on the configuration q"
            )
        work, lost, supplied = scheme.mean(lambda q: along(s, q), q0, q1), {}, {}
        if α := scheme.alpha:
            work += α * (along(s, q1) - along(s, q0))
            lost = {"numerical": α * (along(q1 - q0, q1) - along(q1 - q0, q0))}
        stored = value(q1, "end")
        if self._statement.varies:
            moved = value(q1, "between") - value(q0, "between")
            supplied = {f"{name} in time": stored - value(q0, "before") - moved}
        return Equations(work, {}, {name: stored}, lost, supplied)


@dataclass(frozen=True)
class OfUser(Statement):
    """Statement of a user, at places or at a quadrature point of a cell.

    Attributes:
        inner: The user's statement, or :class:`OfFunction`.
        names: Names of its numbers.
        scheme: Time scheme.
        degree: Degree of the cells; 0 at places.
        varies: Whether numbers may vary in time.
        label: Name in messages.
    """

    inner: Statement
    names: tuple[str, ...]
    scheme: Scheme
    degree: int
    varies: bool
    label: str

    @property
    def nodes(self) -> int:
        """Number of nodes of the cell, or of places."""
        return self.degree + 1 if self.degree else self.inner.nodes

    @property
    def numbers(self) -> list[str]:
        """Quadrature point and positions of the nodes, or positions of places and their arms."""
        if self.degree:
            return [*POINT, *places(self.degree)]
        nodes = range(self.nodes)
        return [f"{name} {c}{k}" for name in ("place", "arm") for k in nodes for c in "xy"]

    @property
    def state(self) -> list[str]:
        """State of the user; forces at the end of the last step, if they are in works."""
        places = range(self.inner.nodes if self.scheme.weight_of_before else 0)
        forces = [f"force {c}{k}" for k in places for c in COMPONENTS]
        return [*(f"state {x}" for x in self.inner.state), *forces * self.remembers]

    @property
    def of_step(self) -> list[str]:
        """Length of the step, and the numbers at each time."""
        times = TIMES if self.varies else TIMES[:1]
        return ["dt", *self.inner.of_step, *(f"{x} {when}" for x in self.names for when in times)]

    @property
    def modes(self) -> Sequence[str]:
        """Modes of equations in Python."""
        return self.inner.modes

    @property
    def recorded(self) -> Mapping[str, int]:
        """Inputs of equations in Python."""
        return self.inner.recorded

    @property
    def remembers(self) -> bool:
        """True for statements of a user, which may use the work of their forces."""
        return not isinstance(self.inner, OfFunction)

    def equations(self, at: Inputs) -> Equations:
        """See the base class."""
        element, inner = Element(self, at), self.inner
        if self.remembers:
            with calling(f"{self.label}.equations fails"):
                returned = inner.equations(element)
            made = self.checked(returned)
        else:
            made = [inner.equations(element)]
        work, state = ufl.as_ufl(0.0), dict[str, Any](element.worked or {})
        accounts = [dict[str, Any]() for _ in range(4)]
        for one in made:
            if isinstance(one.forces, Expr):
                work += one.forces
            else:
                pairs = zip(one.forces, element.virtual, strict=True)
                work += sum(f[i] * s[i] for f, s in pairs for i in range(len(COMPONENTS)))
            state |= {f"state {name}": x for name, x in one.state.items()}
            energies = one.stored, one.lost, one.supplied, one.before
            for account, some in zip(accounts, energies, strict=True):
                for name, x in some.items():
                    account[name] = account.get(name, 0.0) + element.length * x
        by = [v[i] for i in range(len(COMPONENTS)) for v in element.variables]
        forces = [ufl.diff(element.length * work, x) for x in by]
        stored, lost, supplied, before = accounts
        none = dict.fromkeys(self.state, ufl.as_ufl(0.0))
        recorded = {name: x for one in made for name, x in one.recorded.items()}
        return Equations(
            forces, none | state, stored, lost, supplied, before=before, recorded=recorded
        )

    def checked(self, returned: Any) -> list[Equations]:
        """Return the equations of a user, or raise :class:`ModelError`."""
        made = [returned] if isinstance(returned, Equations) else returned
        if not isinstance(made, Sequence) or not all(isinstance(x, Equations) for x in made):
            raise ModelError(
                f"{self.label}: equations returned {shorten(returned)}; it must return "
                "ub.extend.Equations, or several of them"
            )
        number, states = self.inner.nodes, [name for one in made for name in one.state]
        for one in made:
            forces: Any = one.forces
            if isinstance(forces, Expr) and not forces.ufl_shape:
                continue  # of a potential
            if len(forces) != number or any(_size(f) != len(COMPONENTS) for f in forces):
                raise ModelError(
                    f"{self.label}: forces = {shorten(forces)} must be a vector (x, y, moment) for "
                    f"each of {number} places"
                )
            for account, names in ENTRIES.items():
                for entry, energy in getattr(one, account).items():
                    if entry in CONTRIBUTIONS and entry not in names:
                        raise ModelError(
                            f"{self.label}: {entry!r} in {account} is an entry of the package; "
                            f"use {', '.join(names)} or a name of your own"
                        )
                    if _size(energy) != 0:
                        raise ModelError(
                            f"{self.label}: the energy {entry!r} in {account} is "
                            f"{shorten(energy)}; it must be a scalar"
                        )
        if sorted(states) != sorted(self.inner.state):
            raise ModelError(
                f"{self.label}: equations returned the state {', '.join(states) or 'nothing'}, and "
                f"must return each of {', '.join(self.inner.state) or 'no names'} once"
            )
        return [*made]


def _size(value: Any) -> int | None:
    """Return the number of components of a vector; 0 for scalars, None for other objects."""
    if isinstance(value, Expr) and len(value.ufl_shape) < 2 and not value.ufl_free_indices:
        return int(sum(value.ufl_shape))
    if isinstance(value, list | tuple):
        return len(value) if all(_size(x) == 0 for x in value) else None
    if isinstance(value, np.ndarray):
        return value.size if value.ndim == 1 else 0 if value.ndim == 0 else None
    return 0 if isinstance(value, int | float | np.number) else None


# -- virtual works and potentials ------------------------------------------------------------------


@dataclass(frozen=True)
class OfFunction(Statement):
    """Virtual work or potential by a function along beams.

    Attributes:
        kind: Class of the work.
        name: Name of the work.
        names: Names of its numbers, without the time.
        key: Identity of the user's function.
        density: The function.
    """

    kind: type[Work]
    name: str
    names: tuple[str, ...]
    key: int
    density: Callable[..., Any] = field(compare=False)
    of_step = ("growth",)  # part of a virtual work in substeps of the first step

    @property
    def work(self) -> Work:
        """A work with this function."""
        return self.kind(self.name, self.density, numbers=dict.fromkeys(self.names, 1.0))

    def returned(self, known: Mapping[str, Any], domain: ufl.Mesh) -> Expr:
        """Return the expression of the user's function, or raise :class:`ModelError`."""
        work = self.work
        wanted = "an energy per length of components of q, such as k * q[1] ** 2 / 2"
        if isinstance(work, VirtualWork):
            wanted = "a virtual work per length, linear in components of w, such as f * w[1]"
        try:
            value = work.density(**{name: known[name] for name in work.used_arguments})
        except ModelError:
            raise
        except Exception as error:
            raise ModelError(f"{work}: the function fails: {shorten(error)}") from error
        if not isinstance(value, Expr):
            raise ModelError(
                f"{work}: the function returned {shorten(value)}; it must return an expression of "
                f"UFL, {wanted}"
            )
        if value.ufl_shape or value.ufl_free_indices:
            raise ModelError(
                f"{work}: the function returned a tensor of shape {value.ufl_shape}; it must "
                f"return a scalar, {wanted}"
            )
        if any(one != domain for one in extract_domains(value)):
            raise ModelError(
                f"{work}: the function uses a mesh of its own; use axis.x for the place, and "
                "`numbers` for its parameters"
            )
        return value

    def equations(self, at: Any) -> Equations:
        """See the base class."""

        def energy(motions: Sequence[Expr], numbers: Mapping[str, Expr]) -> Expr:
            return self.returned({"q": motions[0], "axis": at.axis, **numbers}, at.inputs.domain)

        if self.kind is Potential:
            made: Equations = at.potential(self.name, energy)
            return made
        inputs, nodes = at.inputs, range(len(at.variables))
        w = ufl.TestFunction(inputs.space(3 * len(nodes)))
        virtual = [ufl.as_vector([w[3 * k + i] for i in range(3)]) for k in nodes]
        known = {
            "q0": at.q0[0], "q1": at.q1[0], "q": at.q[0], "axis": at.axis, "v": at.v[0],
            "w": at.axis.field(virtual), "dt": at["dt"],
        }  # fmt: skip
        work = self.returned(known | at.numbers("now"), inputs.domain)
        try:
            check_form_arity(expand_derivatives(work * ufl.dx(domain=inputs.domain)), (w,))
        except (ArityMismatch, ValueError):  # ValueError: UFL fails to write its message
            raise ModelError(
                f"{self.work}: the function must return an expression that is linear in w, such "
                "as f * w[1]"
            ) from None
        every = ufl.as_vector([x for v in at.variables for x in v])
        return Equations(-inputs["growth"] * ufl.replace(work, {w: every}))


# -- blocks ----------------------------------------------------------------------------------------


def statement_of(work: Work | Effect, degree: int, scheme: Scheme) -> OfUser:
    """Return the statement of a work or effect; it serves all beams and values of numbers."""
    varying, names = {name for name, x in work.numbers.items() if callable(x)}, (*work.numbers,)
    if isinstance(work, Effect):
        inner = work.statement
        if inner.in_python:
            inner = _of_python(work, names, scheme)
        return OfUser(inner, names, scheme, degree if work.beams else 0, bool(varying), work.name)
    inner = OfFunction(type(work), work.name, names, id(work.density), work.density)
    varies = isinstance(work, Potential) and bool((varying | {"t"}) & {*work.used_arguments})
    return OfUser(inner, ("t", *names), scheme, degree, varies, str(work))


def _of_python(effect: Effect, names: tuple[str, ...], scheme: Scheme) -> OfPython:
    """Return a statement in Python with the names of its energies, from a step without motion."""
    inner = OfPython(effect.statement, ())
    given = inner.state.items() if isinstance(inner.state, Mapping) else ()
    state = dict.fromkeys(inner.state, 0.0) | dict(given)
    known = values_at_zero(effect) | state | {"dt": 1.0}
    none, points = np.zeros((3, inner.nodes, 3)), np.zeros((inner.nodes, 2))
    statement = OfUser(inner, names, scheme, 0, False, effect.name)
    _, _, energies = computed(statement, known, points, none[:2], none[2])
    return OfPython(effect.statement, (*energies,))


def values_at_zero(effect: Effect) -> dict[str, float]:
    """Return the numbers of an effect at the time 0."""
    numbers = effect.numbers.items()
    return {x: value_at(f, 0.0, effect) if callable(f) else float(f) for x, f in numbers}


def work_blocks(setting: BlockSetting) -> list[Block]:
    """Return the blocks of the works and effects of a scene; every process has them.

    The ledger has virtual works in ``supplied``, and energies of potentials in ``state``.  Virtual
    works grow in the substeps of the first step, as loads do; all else acts fully from the start.
    """
    works, degree = setting.scene.works, setting.subdomain.numbering.mesh.degree
    groups, names, blocks = defaultdict[Any, list[int]](list), Counter[str](), list[Block]()
    for i, work in enumerate(works):
        groups[statement_of(work, degree, setting.scheme), work.degree].append(i)
    for (statement, _), indices in groups.items():
        name = works[indices[0]].name
        names[name] += statement.remembers  # works have different names
        saved = f"effect {name} {names[name]}" if statement.remembers else f"work of {name}"
        blocks.append(_block(saved, statement, indices, setting))
    return blocks


def _block(name: str, statement: OfUser, indices: list[int], setting: BlockSetting) -> Block:
    """Return the block of the works with the indices in the scene, which have one statement."""
    subdomain, scene = setting.subdomain, setting.scene
    numbering, works = subdomain.numbering, [scene.works[i] for i in indices]
    rows, of_work, in_time = list[Any](), list[Array](), [InTime(steady, works[0])]
    of_step = defaultdict[str, list[int]](list, growth=[0] * len(works))
    for k, (i, work) in enumerate(zip(indices, works, strict=True)):
        values = {x: f if callable(f) else Constant(f) for x, f in work.numbers.items()}
        for timed in statement.of_step:
            plain, _, time = timed.rpartition(" ")
            if plain in statement.names:
                of_step[timed].append(len(in_time))
                in_time.append(InTime(values.get(plain), work, time))
        if isinstance(work, Effect) and work.places:
            mine = [i] if i in subdomain.effect_dofs else []
            dofs = np.reshape([subdomain.effect_dofs[i] for i in mine], (-1, 3 * statement.nodes))
            numbers = geometry(work)[:, None].repeat(len(mine), axis=1)
            rows.append((np.full(len(mine), k), dofs, numbers, np.zeros(0, dtype=int)))
        else:
            of_beams = [numbering.cells_of(beam) for beam in work.on(scene.beams)]
            points = (work.degree + 2 * (numbering.mesh.degree - 1)) // 2 + 1
            on = np.flatnonzero(np.isin(subdomain.cells, np.concatenate(of_beams)))
            cells, point, at = at_points(on, points)
            elements = (k * len(numbering.cells) + subdomain.cells[cells]) * points + point
            numbers = np.array([*at, *positions(subdomain, cells)])
            rows.append((elements, subdomain.cell_dofs[cells], numbers, cells))
        of_work.append(np.full(len(rows[-1][0]), k))
    elements, dofs, numbers, cells = (
        np.concatenate(x, axis=int(i == 2)) for i, x in enumerate(zip(*rows, strict=True))
    )
    of_element = np.concatenate(of_work)
    kind = PythonBlock if isinstance(statement.inner, OfPython) else EffectBlock
    block = kind(
        statement,
        Elements(
            name, elements, dofs, numbers, in_time,
            {x: np.array(at)[of_element] for x, at in of_step.items()},
            cells if statement.degree else None, lib.WORK,
        ),
        setting, supplies=works[0].name if isinstance(works[0], VirtualWork) else None,
        moves=works[0].takes_rates,
    )  # fmt: skip
    for state, value in zip(block.state.values(), initial_state(statement), strict=True):
        state[:] = value
    return block


def geometry(effect: Effect) -> Array:
    """Return the numbers of a statement at places: positions, and arms; m."""
    return np.ravel([*(place.point for place in effect.places), *map(arm, effect.places)])


def initial_state(statement: OfUser) -> Array:
    """Return the initial state of an element."""
    z, given = np.zeros(len(statement.state)), statement.inner.state
    if isinstance(given, Mapping):
        z[: len(given)] = [*given.values()]
    return z
