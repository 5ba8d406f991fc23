# SPDX-License-Identifier: MIT
"""Numbers of small scenes with each effect are those that are stored in ``tests/data/effects``.

They are a record, not the truth: see ``tests/verification`` and ``tests/unit`` for closed forms.
"""

from mpi4py import MPI

import numpy as np
import pytest
import stored_effects  # noqa: F401 - adds the effects
from stored_scenes import EFFECTS, EXACT, SCENES, differences, numbers, stored

import ufl_beam as ub
from ufl_beam.blocks.beams import BeamCells, InelasticCells
from ufl_beam.blocks.block import Block
from ufl_beam.blocks.springs import SpringBlock
from ufl_beam.compiled.c_library import doubles, lib
from ufl_beam.errors import StepFailed

TOLERANCE = 1e-9
"""Largest difference, over the largest motion, velocity, force or energy of a scene: flags of the
compiler make up to 2.3e-12, a tolerance of Newton's method of 1e-13 up to 2.5e-10."""


@pytest.mark.serial  # each process would compute the same
@pytest.mark.parametrize("name", EFFECTS)
def test_numbers_are_those_that_are_stored(name):
    scenes = stored(name)
    assert len(scenes) == SCENES
    for seed, expected in enumerate(scenes):
        found = differences(numbers(*EFFECTS[name].draft(seed).run()), expected["numbers"])
        assert max(found.values()) <= TOLERANCE, {
            (seed, key): value for key, value in found.items() if value > TOLERANCE
        }


POINTS = SpringBlock, InelasticCells
"""Blocks whose energies are those of material points."""

STEPS = 12


def works(block, trial):
    """Work of the forces of a statement in a step, and the energy that it stores, loses, takes."""
    forces, c = np.zeros(len(trial.q1)), block._c
    block.add_residual(trial.q1, forces)
    if isinstance(getattr(block, "forces_at", None), np.ndarray):
        forces[block.forces_at] = 0.0  # residuals of laws
    if isinstance(block, BeamCells):
        outputs = block._along(block._kernels.end, trial.q1, [])
    else:
        lib.end_step_of_block(c, doubles(trial.q1), lib.COMPUTE)
        outputs = block.outputs(c.end_of)
    account = np.repeat([1.0, 1.0, -1.0], [c.stored, c.lost, c.entered - c.lost])
    first = outputs.shape[1] - len(account) - c.knows_before * c.stored
    energies = outputs[:, first : first + len(account)]
    return forces @ trial.s, (energies @ account).sum() - block._energy.sum()


@pytest.mark.serial  # each process would compute the same
@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
@pytest.mark.parametrize("name", [x for x in EFFECTS if EFFECTS[x].draft(0).control is None])
def test_work_is_explained(name):
    """The work of each statement, by itself, is what it stores, loses and supplies in each step."""
    drafts = [EFFECTS[name].draft(seed) for seed in range(SCENES)]
    drafts = [x for x in drafts if x.scheme.weight_of_before == 0.0 and isinstance(x.dt, float)]
    for draft in drafts:
        options = {"mesh": draft.mesh, "newton": EXACT, "comm": MPI.COMM_SELF}
        simulation = ub.Simulation(ub.Scene(**draft.parts), draft.scheme, **options)
        blocks = [
            x for x in simulation.equation.terms
            if isinstance(x, Block) and not x._supplies and not isinstance(x, POINTS)
            and (getattr(draft.scheme, "exact_ledger", False) or not isinstance(x, BeamCells))
        ]  # fmt: skip
        missing, size = dict.fromkeys(map(id, blocks), 0.0), 0.0
        for n in range(STEPS if blocks and not simulation.time_loop.stages > 1 else 0):
            try:
                trial = simulation.attempt((n + 1) * draft.dt)
            except StepFailed:
                break
            for block in blocks:
                work, explained = works(block, trial)
                missing[id(block)] = max(missing[id(block)], abs(work - explained))
                size = max(size, abs(work), abs(explained))
            simulation.accept(trial)
            size = max(size, simulation.equation.ledger.size())
        for block in blocks:
            assert missing[id(block)] <= TOLERANCE * size, block.effect
