# SPDX-License-Identifier: MIT
"""Blocks of effects of users, whose equations are in UFL, or are computed in Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.blocks.block import Block, BlockSetting
from ufl_beam.blocks.statement import Equations, Statement
from ufl_beam.compiled.c_library import doubles, fill, lib
from ufl_beam.compiled.simd_kernels import BATCH
from ufl_beam.errors import ModelError, NoNumber, calling
from ufl_beam.mechanics.kinematics import COMPONENTS
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.terms.derivatives import Each, Neighbours
from ufl_beam.terms.term import Callbacks, Phases

DIFFERENCE = 6e-6
"""Relative increment at which central differences have the least error: ∛(round-off)."""

ACCOUNTS = "stored", "lost", "supplied", "before"
"""Fields of :class:`Equations` with energies, in the order of the outputs of a step."""


def require_work(forces: int, places: int, *, again: bool) -> None:
    """Raise ValueError if ``work()`` is called again, or with another number of forces."""
    if again:
        raise ValueError("call work() once, with the sum of the forces")
    if forces != places:
        raise ValueError(f"work() takes a force for each of {places} places")


def work_in_step(weight: float, before: Any, forces: Any, q0: Any, q1: Any) -> Any:
    """Return the work of forces on the change of a motion, in the ledger of a scheme; J.

    Forces before the step have the ``weight`` :attr:`Scheme.weight_of_before`.  All arguments are
    numbers or arrays, or expressions of one component.
    """
    return (weight * before + (1.0 - weight) * forces) * (q1 - q0)


class Numbers(dict[str, float]):
    """Inputs of equations in Python, see :class:`Statement`; motions and places are arrays."""

    axis = None
    _worked = False

    def __init__(
        self, scheme: Scheme, known: Mapping[str, float], places: Array, motions: Array,
        before: Array,
    ) -> None:  # fmt: skip
        super().__init__(known)
        self.scheme, self.places, (self.q0, self.q1) = scheme, places, motions
        θ, self._a, self._before = scheme.load_weight, scheme.weight_of_before, before
        self.q, self.v = (1.0 - θ) * self.q0 + θ * self.q1, (self.q1 - self.q0) / self["dt"]

    def work(self, forces: Sequence[Sequence[float]]) -> float:
        """Return the work of forces in the step, see :meth:`Element.work`; J."""
        require_work(len(forces), len(self.q1), again=self._worked)
        self._worked, values = True, np.array(forces, dtype=np.float64)
        return float(work_in_step(self._a, self._before, values, self.q0, self.q1).sum())


@dataclass(frozen=True)
class OfPython(Statement):
    """Equations in Python, linearized about the iterate; forces, slopes and energies are modes.

    Attributes:
        user: The user's statement.
        energies: Account in :data:`ACCOUNTS` and entry of each energy.
    """

    user: Statement
    energies: tuple[tuple[str, str], ...]

    @property
    def nodes(self) -> int:
        """Number of places of the user's statement."""
        return self.user.nodes

    @property
    def state(self) -> Sequence[str]:
        """State of the user."""
        return self.user.state

    @property
    def modes(self) -> list[str]:
        """Forces of the places, and their derivatives by motions; new state; energies."""
        n = range(len(COMPONENTS) * self.nodes)
        slopes = (f"slope {i} {j}" for i in n for j in n)
        energies = (" of ".join(x) for x in self.energies)
        return [*(f"line {i}" for i in n), *slopes, *(f"new {x}" for x in self.state), *energies]

    @property
    def recorded(self) -> dict[str, int]:
        """Places and their motions before and after the step, for the functions."""
        names = [f"X {k} {c}" for k in range(self.nodes) for c in "xy"]
        names += [f"{q} {k} {c}" for q in ("q0", "q1") for k in range(self.nodes) for c in "xyr"]
        return dict.fromkeys(names, lib.RECORDED_STATE)

    def equations(self, at: Any) -> Equations:
        """See the base class."""
        inputs, d = at.inputs, len(COMPONENTS)
        q1, n = [x[i] for x in at.q1 for i in range(d)], range(d * self.nodes)
        lines = [sum((inputs[f"slope {i} {j}"] * q1[j] for j in n), 0) for i in n]
        each = [inputs.stage(inputs[f"line {i}"], line) for i, line in zip(n, lines, strict=True)]
        forces = [each[d * k : d * k + d] for k in range(self.nodes)]
        at.work(forces)  # for the forces before the next step
        accounts: dict[str, Any] = {account: {} for account in ACCOUNTS}
        for account, entry in self.energies:
            accounts[account][entry] = inputs[f"{account} of {entry}"]
        values = [x[i] for some in (at.places, at.q0) for x in some for i in range(len(x))]
        return Equations(
            forces, {x: inputs[f"new {x}"] for x in self.state}, **accounts,
            recorded=dict(zip(self.recorded, [*values, *q1], strict=True)),
        )  # fmt: skip


def computed(
    statement: Any, known: Mapping[str, float], places: Array, motions: Array, before: Array
) -> tuple[Array, Array, dict[tuple[str, str], float]]:
    """Return forces, new state and energies of equations in Python.

    Args:
        statement: :class:`~ufl_beam.blocks.works.OfUser` of the equations.
        known: Numbers, state before the step, and its length by name.
        places: Positions of the places; (n, 2); m.
        motions: Motions of the places before and after the step; (2, n, 3).
        before: Forces on the places before the step; (n, 3).

    Raises:
        ModelError: The function fails, or returns something else.
        NoNumber: A number is not finite.
    """
    user, energies = statement.inner.user, dict[tuple[str, str], float]()
    with calling(f"{statement.label}.equations fails"):
        returned = user.equations(Numbers(statement.scheme, known, places, motions, before))
    made = statement.checked(returned)
    forces = np.sum([np.array(one.forces, dtype=np.float64) for one in made], axis=0)
    state = {name: float(x) for one in made for name, x in one.state.items()}
    for account in ACCOUNTS:
        for one in made:
            for entry, energy in getattr(one, account).items():
                key = account, entry
                energies[key] = energies.get(key, 0.0) + float(energy)
    numbers = *forces.ravel(), *state.values(), *energies.values()
    if not np.isfinite(numbers).all():
        raise NoNumber(
            f"{statement.label}: equations returned numbers that are not finite at "
            f"q1 = {motions[1].tolist()}, dt = {known['dt']:.6g} s"
        )
    return forces, np.array([state[name] for name in user.state]), energies


class EffectBlock(Block):
    """Effects of a user with one statement."""

    statement: Any  # `OfUser`
    remembers = True

    @property
    def effect(self) -> str:
        """See the base class."""
        label: str = self.statement.label
        return label

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """See the base class."""
        label, others = self.statement.label, [x for some in neighbours.terms for x in some]
        if self.statement.inner.state and any(x.statement != self.statement for x in others):
            raise ModelError(
                f"{label}: a parameter changes the statement, so that its state has no derivative; "
                "make the parameter one of its numbers"
            )
        with calling(f"{label} has no derivative"):
            return super().derivatives(neighbours)

    def _begin_state(self, q: Array) -> None:
        """Keep the state: a step without motion would change one that relaxes."""


class PythonBlock(EffectBlock):
    """Effects of a user with equations in Python, which C asks for in each residual."""

    def __init__(self, statement: Any, elements: Any, setting: BlockSetting, **more: Any) -> None:
        super().__init__(statement, elements, setting, **more)
        fill(self._c, search=setting.search, switched=setting.switched)
        names, given = statement.inputs, statement.inner.state
        columns = {x: f"{x} now" for x in statement.names} | {x: f"state {x}" for x in given}
        self._known = {x: names.index(y) for x, y in (columns | {"dt": "dt"}).items()}
        forces = [i for i, name in enumerate(names) if name.startswith("force ")]
        self._before = forces, len(COMPONENTS) * statement.inner.nodes
        sizes = [setting.scene.size, setting.scene.size, 1.0]
        self._least = 1e-3 * np.tile(sizes, (statement.inner.nodes, 1))

    def phases(self, callbacks: Callbacks) -> Phases:
        """See the base class."""
        fill(self._c, ask=lib.run_in_python, asked=callbacks.handle(self._ask))
        made = super().phases(callbacks)
        return made._replace(accept=[callbacks.phase(self._accept), *made.accept])

    def _ask(self, *, slopes: bool = True) -> None:
        """Set the modes to the equations at the motions of which C has computed the outputs."""
        statement, first = self.statement, len(self.statement.state)
        n = len(COMPONENTS) * statement.inner.nodes
        rows: Any = self.outputs(self._kernels.end)
        for i, row in enumerate(rows):
            w = self._w[i // BATCH, :, i % BATCH]
            known = {name: float(w[k]) for name, k in self._known.items()}
            forces, size = self._before
            before = (w[forces] if forces else np.zeros(size)).reshape(-1, len(COMPONENTS))
            places, moved = np.split(row[first : first + n // 3 * 8], [n // 3 * 2])
            places, motions = places.reshape(-1, 2), moved.reshape(2, -1, len(COMPONENTS))
            sizes = np.abs(motions[1] - motions[0]), 1e-3 * np.abs(motions[1]), self._least
            steps = np.max(sizes, axis=0)
            now, state, energies = computed(statement, known, places, motions, before)
            found = np.zeros((n, n))
            for j, at in enumerate(np.ndindex(now.shape) if slopes else ()):
                pair = list[Array]()
                ε = DIFFERENCE * steps[at]
                for sign in (1.0, -1.0):
                    ends = motions.copy()
                    ends[(1, *at)] += sign * ε
                    pair.append(computed(statement, known, places, ends, before)[0].ravel())
                found[:, j] = (pair[0] - pair[1]) / (2.0 * ε)
            if {*energies} != {*statement.inner.energies}:
                raise ModelError(
                    f"{statement.label}: equations returned the energies "
                    f"{', '.join(name for _, name in energies) or 'none'}, and others before"
                )
            values = [energies[key] for key in statement.inner.energies]
            modes = [*now.ravel(), *found.ravel(), *state, *values]
            w[len(w) - len(modes) :] = modes

    def _accept(self, step: Any, q1: Any, s: Any) -> None:
        """Compute new state and energies, before any other term accepts the step."""
        lib.end_step_of_block(self._c, q1, lib.COMPUTE)
        self._ask(slopes=False)

    def start(self, q: Array) -> None:
        """See the base class."""
        self._begin(q, float(self._t[0]), dt=np.inf, fraction=0.0)
        lib.end_step_of_block(self._c, doubles(q), lib.COMPUTE)
        self._ask(slopes=False)
        super().start(q)

    def derivatives(self, neighbours: Neighbours) -> list[Each] | None:
        """Raise :class:`ModelError`: slopes are differences."""
        raise ModelError(
            f"{self.statement.label} has no derivative, because its equations are in Python; state "
            "them in UFL"
        )

    def add_tangent_change(self, q1: Array, u: Array) -> None:
        """Raise :class:`ModelError`: slopes are differences."""
        self.derivatives(None)  # type: ignore[arg-type]
