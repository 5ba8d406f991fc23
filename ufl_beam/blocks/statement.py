# SPDX-License-Identifier: MIT
"""Statements: one effect on an element, in UFL.

A statement has the forces of an element on its nodes, its new state, and its energies, as functions
of the motions of the nodes, the state, numbers of the element, and numbers of the step.  Tangents,
works, section forces and derivatives follow from these functions; see :mod:`ufl_beam.blocks.block`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import ufl
from ufl.classes import Zero
from ufl.core.expr import Expr
from ufl.corealg.traversal import unique_pre_traversal

from ufl_beam.compiled.c_library import ffi, lib, names
from ufl_beam.compiled.keys import key_of
from ufl_beam.discretization.compiled_forms import (
    Pointwise,
    Stated,
    compiled_functions,
    components,
    with_shared_nodes,
)
from ufl_beam.mechanics.kinematics import COMPONENTS
from ufl_beam.terms.derivatives import margins

COEFFICIENTS = [
    *(f"{row} {j}" for row in ("inertia", "velocity") for j in range(lib.MOST_RATES)),
    *(f"rates {i} {j}" for i in range(lib.MOST_RATES) for j in range(lib.MOST_RATES)),
]
"""Names of the coefficients of a scheme in a step, see :class:`~ufl_beam.Coefficients`."""

OF_STEP = ["dt", "fraction", "reached", *COEFFICIENTS]
"""Numbers of all steps: length (s); part of the changes of loads that is applied at the end of the
step, and in its equation; and, for statements with rates, coefficients of the scheme."""


MANY = 100
"""Number of intermediate numbers above which sparse products are fewer than products in order."""

FIRST_MODES = names("mode_of_block", "mode_")
"""Modes that C sets: "held", "fresh" and "stiffened", see loops.h."""


class Equations(NamedTuple):
    """Functions of the inputs of a statement.

    Attributes:
        forces: Forces of the element in the equilibrium of its nodes, in the order of
            :attr:`Statement.unknowns`, of a user's statement a vector (x, y, moment) for each
            place; positive if they resist a positive motion; N, N, N m.
        state: New state and shared numbers at the end of the step, by name.
        stored: Energies that the element stores at the end of the step, by entry of the ledger; J.
        lost: Energies that it loses in the step, by entry of the ledger; J.
        supplied: Energies that it supplies in the step besides the work of loads; J.
        modes: Modes in an iterate, by name.
        excess: Violation of the modes of an element that is held in the search; 0 without.
        opened: 1 if the element has opened in the iterate, else 0.
        holds: 1 for each law that holds its motion, 0 for a law of its force; by default, laws hold
            that do not depend on their force.
        margins: Numbers that vanish where the element changes its modes, for ranges of derivatives.
        before: Stored energies before the step, if they are functions of other variables than
            ``stored`` at the end of a step without motion.
        power: Power at a part of the step (J per step), if the work on the path of a step is an
            input, see :attr:`Statement.integrates`.
        motions: Variables of UFL on which the laws depend, one for each law; m or rad.
        recorded: Numbers that solutions record, by name; changes of numbers that are sums.
        strains: Strains of material points inside the element.  Derivatives by the first numbers of
            the element are those by the forces of the points, at constant strains.
        predicted: Strains that the latest tangent of a static step predicts.

    Example:
        >>> ub.extend.Equations([[0.0, 9.81, 0.0]]).stored  # N, on one place
        {}
    """

    forces: Sequence[Expr]
    state: Mapping[str, Expr] = {}
    stored: Mapping[str, Expr] = {}
    lost: Mapping[str, Expr] = {}
    supplied: Mapping[str, Expr] = {}
    modes: Mapping[str, Expr] = {}
    excess: Expr | float = 0.0
    opened: Expr | float = 0.0
    holds: Sequence[Expr] = ()
    margins: Sequence[Expr] = ()
    before: Mapping[str, Expr] = {}
    power: Expr | None = None
    motions: Sequence[Expr] = ()
    recorded: Mapping[str, Expr] = {}
    strains: Sequence[Expr] = ()
    predicted: Sequence[Expr] = ()


class Inputs(dict[str, Expr]):
    """Inputs of a statement by name; motions are "q0 x0", "q1 rotation1", rates "rate1 x0".

    Attributes:
        domain: Mesh of the inputs in UFL.
        compiler: Compiler of functions of the inputs.
        space: Function that returns a space of n values on the mesh.
        stages: Intermediate numbers: a variable, its value, a number with the same derivatives, and
            the symbol in the variable.
        in_tangent: Values of intermediate numbers in the tangent, by symbol, if they differ.
    """

    def __init__(self, compiler: Pointwise, at: Mapping[str, Expr]) -> None:
        super().__init__(at)
        self.compiler, self.space = compiler, compiler.values
        self.domain = compiler.values(1).mesh.ufl_domain()
        self.stages: list[tuple[Expr, Expr, Expr, Expr]] = []
        self.in_tangent: dict[Expr, Expr] = {}

    def stage(self, value: Any, slope_of: Any = None, in_tangent: Any = None) -> Expr:
        """Return a variable for an intermediate number, which is differentiated apart.

        Derivatives by inputs are products of derivatives by the number and of the number.  With
        ``slope_of``, another expression is differentiated in place of the number.  With
        ``in_tangent``, the tangent has this value of the number.
        """
        symbol = ufl.Coefficient(self.space(1))[0]
        if in_tangent is not None:
            self.in_tangent[symbol] = ufl.as_ufl(in_tangent)
        alike = value if slope_of is None else slope_of
        self.stages.append((ufl.variable(symbol), *expanded([value, alike]), symbol))
        return self.stages[-1][0]

    @property
    def values_of_stages(self) -> dict[Expr, Expr]:
        """Values of intermediate numbers by symbol."""
        return {symbol: value for _, value, _, symbol in self.stages}

    def motions(self, group: str) -> list[Expr]:
        """Return the motion (x, y, rotation) of each node: "q0" before the step, "q1" after it.

        "rate1" are the velocities before the step, "rate2" and so on further rates of the scheme.
        """
        nodes = sum(name.startswith(f"{group} x") for name in self)
        return [ufl.as_vector([self[f"{group} {c}{k}"] for c in COMPONENTS]) for k in range(nodes)]

    def between(self, fraction: float) -> list[Expr]:
        """Return the motions of the nodes at a fraction of the step."""
        pairs = zip(self.motions("q0"), self.motions("q1"), strict=True)
        return [(1.0 - fraction) * q0 + fraction * q1 for q0, q1 in pairs]

    def slopes(self, outputs: Sequence[Expr], names: Sequence[str]) -> list[Expr]:
        """Return the derivatives of expanded expressions by inputs: of the first one, ..."""
        return self.slopes_by(outputs, [self[name] for name in names])

    def slopes_by(self, outputs: Sequence[Expr], by: Sequence[Expr], unused: int = 0) -> list[Expr]:
        """Return the derivatives of expanded expressions by variables: of the first one, ...

        Intermediate numbers are eliminated one by one; if there are :data:`MANY`, next the one with
        the fewest products, see A. Griewank and A. Walther, Evaluating Derivatives, 2008, section
        9.2.  Derivatives of the first ``unused`` outputs by as many first variables are left
        out: they are zero.
        """
        if not outputs or not by:
            return []
        stages, m, n = [stage for stage, *_ in self.stages], len(outputs), len(by)
        every = iter(_slopes([*outputs, *(x[2] for x in self.stages)], [*by, *stages]))
        rows = [dict(enumerate(islice(every, n + len(stages)))) for _ in range(m + len(stages))]
        used = [unused * (i < unused) for i in range(len(rows))]  # first columns
        rows = [
            {j: x for j, x in row.items() if j >= first and not isinstance(x, Zero)}
            for row, first in zip(rows, used, strict=True)
        ]
        left = [*range(len(stages))]
        while left:
            k = left[0]
            if len(stages) > MANY:
                k = min(left, key=lambda k: _products(rows[m + k], [x for x in rows if n + k in x]))
            left.remove(k)
            inner, rows[m + k] = rows[m + k], {}
            for row, first in zip(rows, used, strict=True):
                if (x := row.pop(n + k, None)) is not None:
                    row.update((j, row.get(j, 0) + x * dx) for j, dx in inner.items() if j >= first)
        return [row.get(j, Zero()) for row in rows[:m] for j in range(n)]

    def along(
        self, outputs: Sequence[Expr], names: Sequence[str], directions: Sequence[Expr]
    ) -> list[Expr]:
        """Return the derivatives of expanded expressions along directions of inputs."""
        slopes = np.array(self.slopes(outputs, names), dtype=object).reshape(-1, len(names))
        pairs = (zip(row, directions, strict=True) for row in slopes)
        return expanded([sum((slope * u for slope, u in some), 0) for some in pairs])


class Statement(ABC):
    """Effect on an element.  Equal statements, such as equal frozen dataclasses, share kernels.

    The statement of a user is a frozen dataclass, which an :class:`Effect` puts into a scene.  It
    has the attributes ``nodes``, the number of places, by default 1; ``numbers``, names of numbers
    whose values the effect has; and ``state``, names of numbers that an element remembers, or their
    initial values by name.  Its method ``equations(at)`` returns :class:`Equations` in UFL with
    ``forces``, ``state``, ``stored``, ``lost``, ``supplied`` and ``before``, or several whose
    functions are added.  ``at`` has numbers and state before the step by name, the length
    ``at["dt"]`` of the step (s), and these attributes:

    * ``q0``, ``q1``: motion (x, y, rotation) of each place before the step and at its end, a list,
    * ``q``: motions at which the scheme evaluates forces, see :class:`VirtualWork`,
    * ``v``: mean velocities of the step, (q1 - q0)/dt,
    * ``places``: position of each place in the undeformed scene; m,
    * ``axis``: undeformed axis along beams, see :class:`VirtualWork`; None at places,
    * ``work(forces)``: work of forces in the step, on q1 - q0, for the ledger of the scheme; J,
    * ``potential(name, energy)``: equations of a stored energy with its forces, a function
      ``energy(q, numbers)``; its error in the ledger is the same as of :class:`Potential`.

    With ``in_python = True`` in the class, ``equations`` gets and returns numbers, so that it may
    use tables, loops and branches.  Motions are then arrays.  Derivatives by motions are
    differences, ``potential`` is missing, and runs have no derivatives by parameters.

    The work of the forces must equal the stored, lost and supplied energies.  The names of
    these energies are entries of the ledger: names of your own, or entries of the package for
    losses ("damping", "friction", ...), "stored", and "loads" for supplied energy.

    Raises:
        ModelError: Before a run: an unknown name, other forces than places, a state that is not
            returned, energies that are no scalars, unexplained work, or numbers that are not
            finite.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Tether(ub.extend.Statement):
        ...     nodes = 2
        ...     numbers = "k", "length"  # N/m, m
        ...
        ...     def equations(self, at):
        ...         a, b = at.places
        ...
        ...         def energy(q, n):
        ...             x, y = (b[i] - a[i] + q[1][i] - q[0][i] for i in (0, 1))
        ...             longer = (x**2 + y**2) ** 0.5 - n["length"]
        ...             return n["k"] / 2 * ((longer + abs(longer)) / 2) ** 2
        ...
        ...         return at.potential("tether", energy)
        >>> places = [ub.ground(2, 3), beam.end]
        >>> tether = ub.Effect(Tether(), places=places, numbers={"k": 1e3, "length": 2.9})
        >>> hanging = ub.Scene([beam], supports=[ub.Clamped(beam.start)], works=[tether])
        >>> run = ub.simulate(hanging, ub.Static(), t=(0, 1), dt=1.0)
        >>> print(run.energy["tether"][-1].round(1))  # J
        5.0
    """

    @property
    def nodes(self) -> int:
        """Number of nodes of an element."""
        return 1

    @property
    def rates(self) -> int:
        """Number of rates of each motion among the inputs, in dynamics."""
        return 0

    @property
    def state(self) -> Sequence[str]:
        """Names of the numbers that an element remembers."""
        return ()

    @property
    def of_step(self) -> Sequence[str]:
        """Names of the numbers of a step: values of functions of time, or :data:`OF_STEP`."""
        return ()

    @property
    def acts_at(self) -> Sequence[str]:
        """Names of the first numbers of the step, if elements act in some steps only.

        An element acts while one of these numbers is above its number "low" and not above its
        number "high", or its state is not zero.
        """
        return ()

    @property
    def shared(self) -> Sequence[str]:
        """Names of numbers that a group of elements remembers, which are inputs.

        The new numbers are the sums of the outputs of the elements that act.
        """
        return ()

    @property
    def trial(self) -> Sequence[str]:
        """Last names of ``shared``: numbers that a trial step for initial rates changes."""
        return ()

    @property
    def laws(self) -> int:
        """Number of laws of an element, each with a force among the unknowns.

        The last outputs of ``forces`` are the residuals of the laws, which are motions or forces.
        """
        return 0

    @property
    def recorded(self) -> Mapping[str, int]:
        """Numbers that solutions record: their names, and ``recorded_number`` of loops.h."""
        return {}

    @property
    def modes(self) -> Sequence[str]:
        """Names of numbers that select the branch of an iterate, besides :data:`FIRST_MODES`.

        In the first iterate, a mode "x" has the value of the state "last x", or is zero.
        """
        return ()

    @property
    def all_modes(self) -> list[str]:
        """Names of all modes among the inputs."""
        return [*FIRST_MODES, *self.modes] if self.modes and not self.inserts else [*self.modes]

    @property
    def integrates(self) -> bool:
        """True if the first number of an element is the work of its power on the path of a step.

        In the power this number is the part of the path, from 0 to 1.
        """
        return False

    @property
    def inserts(self) -> bool:
        """True for cells whose forces and tangent C inserts as of forms, with all entries."""
        return False

    @property
    def frozen(self) -> Statement:
        """The statement with constant internal variables."""
        return self

    @property
    def numbers(self) -> Sequence[str]:
        """Names of the constant numbers of an element."""
        return ()

    @property
    def in_python(self) -> bool:
        """True if the equations of a user are not in UFL, but compute numbers in Python."""
        return False

    @property
    def given(self) -> Sequence[str]:
        """Names of the first numbers, if another term sets them after each step."""
        return ()

    @abstractmethod
    def equations(self, at: Any) -> Equations:
        """Return the functions of the inputs ``at``, which are :class:`Inputs`."""

    @property
    def unknowns(self) -> list[str]:
        """Names of the motions of an element: x of all nodes, then y, then rotations; forces."""
        motions = [f"{c}{k}" for c in COMPONENTS for k in range(self.nodes)]
        return [*motions, *(f"force{k}" for k in range(self.laws))]

    @cached_property
    def inputs(self) -> list[str]:
        """Names of all inputs, in the order of the columns of an element."""
        groups = "q1", "q0", *(f"rate{j + 1}" for j in range(self.rates))
        motions = (f"{group} {name}" for group in groups for name in self.unknowns)
        numbers = *self.state, *self.numbers, *self.of_step, *self.shared
        return [*motions, *numbers, *self.all_modes]


class Kernels:
    """Compiled functions of a statement, each as ``element_function`` of loops.h.

    Attributes:
        force: Forces of an element; derivatives of its laws, see loops.h.
        tangent: Their derivatives by the motions at the end of the step, without zeros.
        entries: Row and column of each entry of ``tangent``.
        strain, predicted: See :attr:`Equations.strains` of cells; None if there are none.
        strains: Number of strains of an element.
        power: See :attr:`Equations.power`; None if there is none.
        mode: Modes in an iterate, excess, and whether the element has opened; None if C sets modes.
        end: New state, recorded numbers, and stored, lost and supplied energies; None if there
            are none.
        energies: Names of these energies in the ledger, by account.
        fields: Fields of ``element_block`` of loops.h that all blocks of the statement share.
        most: Largest number of outputs of a function of a step.
    """

    def __init__(self, statement: Statement) -> None:
        self._statement = statement
        functions, facts = self._compiled("steps", self._of_steps)
        self.force, self.tangent, self.strain, self.predicted, self.end, self.power, self.mode = (
            functions
        )
        self.entries = [(row, column) for row, column in facts["entries"]]
        self.energies: dict[str, list[str]] = facts["energies"]
        self.knows_before, self.strains = facts["knows_before"], facts["strains"]
        steps = self.force, self.tangent, self.end, self.mode
        self.most = max(function.outputs for function in steps if function is not None)
        state, last = list(statement.state), [f"last {name}" for name in statement.modes]
        begins = [state.index(name) if name in state else -1 for name in last]
        stored, *entered = map(len, self.energies.values())
        self.fields: dict[str, Any] = {
            "force_of": self.force, "tangent_of": self.tangent or ffi.NULL,
            "end_of": self.end or ffi.NULL, "power_of": self.power or ffi.NULL,
            "mode_of": self.mode or ffi.NULL, "unknowns": len(statement.unknowns),
            "rates": statement.rates, "states": len(state), "numbers": len(statement.numbers),
            "steps": len(statement.of_step) + len(statement.shared),
            "modes": len(statement.all_modes), "width": len(statement.inputs),
            "ranges": len(statement.acts_at), "stored": stored, "lost": entered[0],
            "entered": sum(entered), "knows_before": self.knows_before,
            "begins": np.array(begins, dtype=np.int32), "shares": len(statement.shared),
            "kept": len(statement.shared) - len(statement.trial), "laws": statement.laws,
            "recorded": len(statement.recorded),
            "recorded_kind": ffi.new("int[]", [*statement.recorded.values()]),
        }  # fmt: skip

    def _of_steps(self) -> Stated:
        """Return the functions of steps."""
        statement = self._statement
        made, at = self._stated(statement.inputs)
        names = [f"q1 {name}" for name in statement.unknowns]
        forces = expanded(made.forces)
        slopes = at.slopes(forces, names)
        whole = statement.inserts
        nonzero = [i for i, x in enumerate(slopes) if whole or not isinstance(x, Zero)]
        energies = {"state": made.stored, "lost": made.lost, "supplied": made.supplied}
        values = [x for some in (*energies.values(), made.before) for x in some.values()]
        recorded = [made.recorded[name] for name in statement.recorded]
        modes = [made.modes[name] for name in statement.modes] if made.modes else []
        cells = [
            [*forces, *expanded(self._slopes_of_laws(made, at))],
            self._in_tangent([slopes[i] for i in nonzero], at),
            *(expanded(x if whole else []) for x in (made.strains, made.predicted)),
        ]
        functions = [
            *cells,
            expanded([*self._states(made), *recorded, *values]),
            expanded([made.power] if made.power else []),
            expanded([*modes, made.excess, made.opened] if modes else []),
        ]
        facts = {
            "entries": [divmod(i, len(names)) for i in nonzero],
            "energies": {account: [*some] for account, some in energies.items()},
            "knows_before": bool(made.before), "strains": len(made.strains),
        }  # fmt: skip
        return self._as_stated(at, functions, facts, inserted=sum(map(bool, cells)) if whole else 0)

    def _in_tangent(self, slopes: list[Expr], at: Inputs) -> list[Expr]:
        """Replace intermediate numbers by their values in the tangent, which are numbers, too."""
        if not at.in_tangent:
            return slopes
        values = dict(zip(at.in_tangent, expanded([*at.in_tangent.values()]), strict=True))
        others = dict[Expr, Expr]()
        for _, value, _, symbol in [*at.stages]:  # later ones may depend on earlier ones
            instead = values.get(symbol)
            if instead is None and not others.keys().isdisjoint(unique_pre_traversal(value)):
                (instead,) = with_shared_nodes([value], others)
            if instead is not None:
                others[symbol] = other = ufl.Coefficient(at.space(1))[0]
                at.stages.append((other, instead, instead, other))
        return [*with_shared_nodes(slopes, others)]

    def _inputs(self, names: Sequence[str]) -> Inputs:
        compiler = Pointwise(names)
        return Inputs(compiler, {name: ufl.variable(x) for name, x in compiler.at.items()})

    def _stated(self, names: Sequence[str]) -> tuple[Equations, Inputs]:
        at = self._inputs(names)
        return self._statement.equations(at), at

    def _slopes_of_laws(self, made: Equations, at: Inputs) -> list[Expr]:
        """Return whether each law holds, and its derivatives by its force and by all motions."""
        laws, found = self._statement.laws, list[Expr]()
        by = [*(at[f"q1 force{k}"] for k in range(laws)), *made.motions]
        slopes = at.slopes_by(expanded(made.forces[len(made.forces) - laws :]), by)
        for k in range(laws):
            row = slopes[2 * laws * k : 2 * laws * (k + 1)]
            holds = made.holds[k] if made.holds else float(isinstance(row[k], Zero))
            found += [ufl.as_ufl(holds), row[k], *row[laws:]]
        return found

    def _states(self, made: Equations) -> list[Expr]:
        return [made.state[name] for name in (*self._statement.state, *self._statement.shared)]

    def _compiled(self, name: str, state: Callable[[], Stated]) -> tuple[list[Any], Any]:
        return compiled_functions(key_of(name, self._statement), state)

    def _as_stated(
        self, at: Inputs, functions: Sequence[Sequence[Expr]], facts: Any = None, inserted: int = 0
    ) -> Stated:
        unknowns = len(self._statement.unknowns)
        large = len(at.stages) > MANY and not inserted
        return Stated(at.compiler, functions, facts, at.values_of_stages, inserted, unknowns, large)

    @cached_property
    def derivative(self) -> tuple[Any, int]:
        """Derivatives of forces, new state, shared numbers, strains and margins by all inputs.

        The rows of a function are the derivatives of one number; the margins follow.  The second
        item is the number of margins.  Derivatives of forces by the motions at the end of the step
        are zero here: they are the tangent.
        """

        def state() -> Stated:
            statement = self._statement
            names = statement.inputs[: len(statement.inputs) - len(statement.all_modes)]
            made, at = self._stated(statement.inputs)
            rows = with_shared_nodes(expanded([*made.forces, *self._states(made), *made.strains]))
            conditions = [*margins(rows), *expanded(made.margins)]
            by, unused = [at[name] for name in names], len(statement.unknowns)
            table = [*at.slopes_by([*rows, *conditions], by, unused), *conditions]
            return self._as_stated(at, [table], len(conditions))

        (function,), conditions = self._compiled("derivative", state)
        return function, conditions

    @cached_property
    def change(self) -> Any:
        """Derivatives of ``tangent`` along motions, which are further inputs; None if zero."""

        def state() -> Stated:
            made, at, names, along = self._stated_along()
            slopes = at.slopes(expanded(made.forces), names)
            changes = at.along([slopes[i * len(names) + j] for i, j in self.entries], names, along)
            return self._as_stated(at, [without_zeros(changes)])

        return self._compiled("change", state)[0][0]

    @cached_property
    def motion_rates(self) -> Any:
        """Derivatives of the motions of laws along motions, which are further inputs."""

        def state() -> Stated:
            made, at, names, along = self._stated_along()
            return self._as_stated(at, [at.along(made.motions, names, along)])

        return self._compiled("motion rates", state)[0][0]

    @cached_property
    def tangent_work(self) -> Any:
        """Work y·(K x) of the tangent K; the motions x and y are further inputs."""
        return self._work(2)

    @cached_property
    def change_of_tangent_work(self) -> Any:
        """Derivative of :attr:`tangent_work` along motions, which are further inputs; None if 0."""
        return self._work(3)

    def _work(self, directions: int) -> Any:
        """Compile a work of motions x, y and, with 3 directions, u.

        Motions are q1 + a x + b u, with inputs a and b of zero, by which the work is derived:
        relative motions of x and u are computed before stiffnesses multiply them.
        """

        def state() -> Stated:
            parts = [f"part{k}" for k in range(directions - 1)]
            names, along = self._along(directions)
            some = [x for direction in along for x in direction]
            at = self._inputs([*self._statement.inputs, *some, *parts])
            x, y, *u = ([at[name] for name in direction] for direction in along)
            for k, name in enumerate(names):
                terms = (at[part] * one[k] for part, one in zip(parts, (x, *u), strict=True))
                at[name] = sum(terms, at[name])
            forces = self._statement.equations(at).forces
            work = expanded([sum((f * v for f, v in zip(forces, y, strict=True)), 0)])
            for part in parts:
                work = expanded(at.slopes_by(work, [at[part]]))
            return self._as_stated(at, [without_zeros(work)])

        return self._compiled(f"work of {directions} motions", state)[0][0]

    def _along(self, directions: int) -> tuple[list[str], list[list[str]]]:
        """Return names of the motions after the step, and of motions in directions."""
        names = [f"q1 {name}" for name in self._statement.unknowns]
        return names, [[f"along{k} {x}" for x in names] for k in range(directions)]

    def _stated_along(self) -> tuple[Equations, Inputs, list[str], list[Expr]]:
        """Return equations, inputs, names of the motions after the step, and their direction."""
        names, (along,) = self._along(1)
        made, at = self._stated([*self._statement.inputs, *along])
        return made, at, names, [at[x] for x in along]


kernels = lru_cache(maxsize=1024)(Kernels)
"""Compiled functions of a statement, of which each takes some 0.1 MB; equal ones have the same."""


def expanded(outputs: Sequence[Expr]) -> list[Expr]:
    """Return expressions with all derivatives expanded together."""
    shared = with_shared_nodes([*map(ufl.as_ufl, outputs)])
    return components(ufl.as_vector(shared)) if outputs else []


def without_zeros(outputs: list[Expr]) -> list[Expr]:
    """Return expressions, or none if all are zero."""
    return [] if all(isinstance(x, Zero) for x in outputs) else outputs


def _products(inner: dict[int, Expr], outer: list[dict[int, Expr]]) -> int:
    """Return the number of products that eliminate a number, and four for each new derivative."""
    new = sum(j not in row for row in outer for j in inner) - len(inner) - len(outer)
    return len(inner) * len(outer) + 4 * new


def _slopes(outputs: Sequence[Expr], by: Sequence[Expr]) -> list[Expr]:
    """Return the derivatives of expanded expressions: of the first one by all variables, ..."""
    nodes = [{*unique_pre_traversal(one)} for one in outputs]
    some = [[y if x in z else Zero() for y, z in zip(outputs, nodes, strict=True)] for x in by]
    # UFL differentiates a vector at once, and a zero in no time: most slopes are zero
    rows = [ufl.diff(ufl.as_vector(row), x) for row, x in zip(some, by, strict=True)]
    whole = components(ufl.as_tensor(rows))
    return [x for i in range(len(outputs)) for x in whole[i :: len(outputs)]]
