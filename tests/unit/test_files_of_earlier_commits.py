# SPDX-License-Identifier: MIT
"""Files in tests/data/files, written at commit 33c323e1 by tests/saved_scenes.py.

If a change of the internal state lets a test of this file fail, raise the number of the format of
checkpoints.  If runs no longer continue from a stored solution, let the test expect the error.
"""

import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers import raises
from saved_scenes import DT, END, bridge, crane, crossed, member, simulated

import ufl_beam as ub
from ufl_beam.output import output_files
from ufl_beam.simulation.checkpoint import FORMAT

FILES = Path(__file__).parents[1] / "data" / "files"
RUNS = {
    "decaying": (ub.EnergyMomentumDecaying(), crane),
    "static": (ub.Static(), crane),
    "bridge": (ub.EnergyMomentum(), bridge),
}
SAME = 1e-9
"""Ten times the tolerance of Newton's method, relative to the largest motion."""


@pytest.mark.parametrize("name", RUNS)
def test_a_stored_solution_is_read_and_not_continued(name):
    """States, ledger and section forces are those of a run today; states of connectors are not."""
    scheme, scene = RUNS[name]
    old = ub.Solution.load(FILES / f"{name}.solution", scene=scene())
    new = simulated(scheme, scene=scene)
    assert old.version == "0.1.0"
    alone = ub.Solution.load(FILES / f"{name}.solution")  # without the script
    assert alone.q.tobytes() == old.q.tobytes()
    assert [beam.cells for beam in alone.scene.beams] == [beam.cells for beam in new.scene.beams]
    near = partial(np.testing.assert_allclose, rtol=0.0)
    near(old.q, new.q, atol=SAME * np.abs(new.q).max())
    assert [*old.energy] == [*new.energy]
    for entry, values in new.energy.items():
        near(old.energy[entry], values, atol=SAME * np.abs(new.energy["stored"]).max())
    forces = new.cell_resultants(-1)
    near(old.cell_resultants(-1), forces, atol=1e-7 * np.abs(forces).max())
    with raises("start: version 0.1.0 of ufl_beam", "Run again from the beginning"):
        continued(old, scheme)


def continued(run, scheme):
    return ub.simulate(run.scene, scheme, t=(END, 2 * END), dt=DT, start=run)


@pytest.mark.parametrize(("table", "owner"), [("cells", "deck"), ("Coulomb", "Slide")])
def test_internal_variables_in_another_form_are_refused(table, owner):
    """Without the check, the run would begin with a bridge that has never yielded or slipped."""
    old = simulated(ub.EnergyMomentum(), scene=bridge)
    (name,) = (name for name in old.internal if name.startswith(f"{table}, "))
    old.internal[f"other {name}"] = old.internal.pop(name)
    other = f"stored other internal variables of {owner}"
    with raises("start: version 0.1.0 of ufl_beam", other, "Run again from the beginning"):
        continued(old, ub.EnergyMomentum())


@pytest.mark.serial
def test_a_stored_study_is_read_and_not_continued(tmp_path):
    path = Path(shutil.copy(FILES / "squares.study", tmp_path))
    assert ub.Study.load(path)["square"].tolist() == [0.0, 1.0, 4.0]
    cases = [{"x": float(x)} for x in range(4)]
    with raises("is a study of ufl_beam, 2, written by version 0.1.0", "Delete the file"):
        ub.study(member, cases, path=path)
    assert path.read_bytes() == (FILES / "squares.study").read_bytes()
    ub.study(member, cases, path=path, anew=True)
    assert ub.Study.load(path)["square"].tolist() == [0.0, 1.0, 4.0, 9.0]


@pytest.mark.serial
def test_a_checkpoint_of_an_earlier_format_is_refused(tmp_path):
    """Before the run, with the version that wrote it and the remedy; all files stay."""
    names = "bridge.checkpoint", "bridge.csv"
    for name in names:
        shutil.copy(FILES / name, tmp_path)
    with raises("is a checkpoint of ufl_beam, 6, written by version 0.1.0", "Delete the file"):
        crossed(tmp_path, 2 * END)
    for name in names:
        assert (tmp_path / name).read_bytes() == (FILES / name).read_bytes()


@pytest.mark.serial
def test_a_checkpoint_with_other_arrays_is_refused(tmp_path):
    """Whichever array is missing or has another name: before the run, and all files stay."""
    crossed(tmp_path)
    path, table = tmp_path / "bridge.checkpoint", (tmp_path / "bridge.csv").read_bytes()
    content = output_files.read(path, FORMAT)
    arrays = [name for name in content if name.startswith("state/")]
    assert len(arrays) > 20
    for name in arrays:
        others = {n: values for n, values in content.items() if n != name}
        for more in ({}, {f"{name} and more": content[name]}):
            output_files.write(path, FORMAT, others | more)
            with raises("version 0.1.0 of ufl_beam wrote it", "cannot use it", "Delete the file"):
                crossed(tmp_path, 2 * END)
            assert (tmp_path / "bridge.csv").read_bytes() == table
    output_files.write(path, FORMAT, content)
    assert crossed(tmp_path, 2 * END).times[-1] == pytest.approx(2 * END)
