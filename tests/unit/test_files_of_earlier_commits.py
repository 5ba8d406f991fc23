# SPDX-License-Identifier: MIT
"""Files in tests/data/files, written at commit 33c323e1 by tests/saved_scenes.py."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers import raises
from saved_scenes import DT, END, crane, simulated

import ufl_beam as ub

FILES = Path(__file__).parents[1] / "data" / "files"
SCHEMES = {"decaying": ub.EnergyMomentumDecaying(), "static": ub.Static()}
SAME = 1e-9
"""Ten times the tolerance of Newton's method, relative to the largest motion."""


@pytest.mark.parametrize("name", SCHEMES)
def test_a_stored_solution_is_read_and_continued(name):
    """States, ledger and section forces are those of a run today, and so is a run that goes on."""
    old, new = ub.Solution.load(FILES / f"{name}.solution"), simulated(SCHEMES[name])
    size = np.abs(new.q).max()
    np.testing.assert_allclose(old.q, new.q, atol=SAME * size, rtol=0.0)
    for account in ("state", "supplied", "lost"):
        before, now = (getattr(x.energy, account) for x in (old, new))
        assert list(before) == list(now)
        for entry, values in now.items():
            np.testing.assert_allclose(
                before[entry], values, atol=SAME * np.abs(new.energy["stored"]).max(), rtol=0.0
            )
    forces = new.cell_resultants(-1)
    scale = np.abs(forces).max()
    np.testing.assert_allclose(old.cell_resultants(-1), forces, atol=1e-7 * scale, rtol=0.0)
    ends = [
        ub.simulate(
            run.scene, SCHEMES[name], t=(END, 2 * END), dt=DT, start=run, progress=False
        ).q[-1]
        for run in (old, new)
    ]  # fmt: skip
    np.testing.assert_allclose(*ends, atol=1e2 * SAME * size, rtol=0.0)


def test_a_stored_study_is_read():
    assert ub.Study.load(FILES / "squares.study")["square"].tolist() == [0.0, 1.0, 4.0]


@pytest.mark.serial
def test_a_checkpoint_of_an_earlier_format_is_refused(tmp_path):
    """Before the run, with the version that wrote it and the remedy; the file stays."""
    path = Path(shutil.copy(FILES / "crane.checkpoint", tmp_path))
    with raises("is a checkpoint of ufl_beam, 6, written by version 0.1.0", "Delete the file"):
        ub.simulate(
            crane(), ub.EnergyMomentum(), t=(0, END), dt=DT,
            checkpoint=ub.Checkpoint(path, every=10), progress=False,
        )  # fmt: skip
    assert path.read_bytes() == (FILES / "crane.checkpoint").read_bytes()
