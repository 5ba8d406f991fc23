# SPDX-License-Identifier: MIT
"""Checks of linear models: equilibrium at rest, inputs and outputs that constraints hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.analysis.linear_inputs_and_outputs import Inputs, Outputs
from ufl_beam.analysis.linearization import Linearization
from ufl_beam.arrays import Array
from ufl_beam.errors import ArgumentError, warn
from ufl_beam.model.connector_laws import Controller, Coulomb
from ufl_beam.simulation.solution import Solution

UNBALANCED = 1e-6  # unbalanced force that is an error, as a fraction of the largest force
MOVING = 1e-6  # velocity that is an error, as a fraction of lowest frequency times size
NEGLIGIBLE = 1e-9  # fraction of a motion that constraints allow, below which they hold it
NAMED = 3  # largest number of unbalanced forces in a message


def require_free(small: Linearization, inputs: Inputs, outputs: Outputs) -> None:
    """Raise if constraints hold an output, or the motions on which an input works.

    Prescribed motions that are inputs do not hold outputs.
    """
    forces, motions = inputs.condensed.toarray(), outputs.motions.T.toarray()
    moved = inputs.prescribed[small.left].tocsr()[np.flatnonzero(small._constraint_rows)]
    fixed = np.ones(moved.shape[0], dtype=bool) if not moved.nnz else abs(moved).sum(axis=1) == 0
    by_supports = abs(outputs.motions @ inputs.motions).sum(axis=1) > 0
    free = _allowed(small, motions, fixed) | by_supports
    for name in [x for x, able in zip(outputs.motion_names, free, strict=True) if not able][:1]:
        raise ArgumentError(
            f"linearize: outputs: {name}: supports or constraints hold this motion, so that it "
            "does not change; choose another place, or a component that can change"
        )
    works = _allowed(small, forces, fixed | True)
    for name in [x for x, able in zip(inputs.force_names, works, strict=True) if not able][:1]:
        raise ArgumentError(
            f"linearize: inputs: {name}: supports or constraints hold the motion on which it "
            "works, so that it moves nothing; choose another place or direction"
        )


def _allowed(
    small: Linearization, vectors: Array, chosen: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Return which columns, rows of motions or forces, the ``chosen`` constraints leave free.

    A column is free if its part in the motions that the constraints allow is not round-off.
    """
    y, μ = np.flatnonzero(~small._constraint_rows), np.flatnonzero(small._constraint_rows)[chosen]
    whole = np.linalg.norm(small.lengths[:, None] * vectors, axis=0)
    W = small.lengths[small.left[y], None] * (small._Z.T @ vectors)[y]
    if len(μ) and W.size:
        G = csr_array(small.K)[μ][:, y] @ diags_array(small.lengths[small.left[y]])
        G = diags_array(1 / np.sqrt((G * G).sum(axis=1))) @ G
        system = block_array([[eye_array(len(y)), G.T], [G, None]])
        W = splu(csc_array(system)).solve(np.vstack([W, np.zeros((len(μ), W.shape[1]))]))[: len(y)]
    return np.asarray(np.linalg.norm(W, axis=0) > NEGLIGIBLE * whole)


def require_equilibrium(small: Linearization, at: Solution | None) -> None:
    """Raise unless the state is an equilibrium at rest."""
    r, terms, round_off = small.imbalance()
    numbering = small.numbering
    weights = 1 / np.where(np.isin(np.arange(len(r)), numbering.rotations), small.scene.size, 1.0)
    apart = np.abs(r) * weights
    apart[apart <= UNBALANCED * np.max(terms * weights, initial=0.0)] = 0.0
    apart[np.abs(r) <= round_off] = 0.0
    worst = numbering.worst(apart)
    worst |= {f"gap of {x}": gap for x, gap in small.gaps().items() if gap > UNBALANCED}
    if worst:
        listed = ", ".join(f"{name}: {value:.3g}" for name, value in [*worst.items()][:NAMED])
        remedy = (
            "loads or motions have changed, or dampers still bear forces; give the last state of a "
            "static run of this scene in which nothing changes"
            if at is not None
            else "the undeformed scene is not in equilibrium with its loads, except inputs; give "
            "at=simulate(scene, Static(), ...)"
        )
        raise ArgumentError(
            f"linearize: no equilibrium; unbalanced forces (N) at {listed}: {remedy}"
        )
    if at is None or not len(at.v):
        return
    fast = np.abs(at.v[-1]) * numbering.scales
    fast[fast <= MOVING * float(small.squares.min()) ** 0.5] = 0.0
    for name, rate in [*numbering.worst(fast).items()][:1]:
        raise ArgumentError(
            f"linearize: at moves: {name} by {rate:.3g} 1/s of the size of the scene; give a state "
            "at rest, as the last state of a static run, or of a run with more damping"
        )


def warn_of_omissions(small: Linearization, inputs: Sequence[Any]) -> None:
    """Warn of controllers and sliding friction, which the linear model leaves out."""
    for connector in small.scene.all_connectors:
        if isinstance(connector.law, Controller) and connector not in inputs:
            warn(f"linearize: {connector}: the force of the controller is constant")
    warn_of_relaxation("linearize", small)
    warn_of_limits("linearize", small)
    for group in small._simulation.equation.connector_terms:
        if isinstance(group.law, Coulomb) and group.sticks is not None:
            for connector, sticks in zip(group.connectors, group.sticks, strict=True):
                if not sticks:
                    warn(f"linearize: {connector}: sliding friction is left out")


def warn_of_limits(call: str, small: Linearization) -> None:
    """Warn of connectors at a limit in the state, such as stops that just touch."""
    if touching := small.touching():
        names = ", ".join(map(str, touching[:NAMED])) + ", ..." * (len(touching) > NAMED)
        warn(
            f"{call}: {names}: the motion of the state is at a limit, beside which the stiffness "
            "differs, as of a stop that just touches, which counts as open. Give at=, a state "
            "under loads or a preload that close or open it"
        )


def warn_of_relaxation(call: str, small: Linearization) -> None:
    """Warn of laws whose internal variables change in time, which have no matrix of damping."""
    for connector in small.relaxing:
        warn(
            f"{call}: {connector}: the force of the law changes in time while the motion is "
            "constant, or depends on the length of a step; stiffness and viscosity cannot describe "
            "this, so that results are wrong. Replace the law by springs and dampers, with a body "
            "without mass between those in series"
        )
