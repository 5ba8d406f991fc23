# SPDX-License-Identifier: MIT
"""Each demo runs to its end, where it checks its own result; its files can be opened."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from time_series import read_as_users_do

DEMOS = sorted((Path(__file__).parents[1] / "demos").glob("demo_*.py"))


@pytest.mark.slow
@pytest.mark.demo
@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_each_demo_runs_to_its_end(demo, tmp_path, monkeypatch):
    """PyVista opens its time series in one line; unit/test_recorders.py compares all numbers."""
    text = demo.read_text(encoding="utf-8")
    if "import control\n" in text:
        pytest.importorskip("control")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(demo))
    assert list((tmp_path / "output").glob("*.png"))
    files = list((tmp_path / "output").glob("*.hdf"))
    assert bool(files) == ("ub.VTKHDF(" in text or ".write(output" in text)
    for path in files:
        found = read_as_users_do(path)
        moments = "M" if "M" in found.names else "M3"  # in the plane, in space
        assert np.isfinite(found.of(moments)).all()
        assert abs(found.of("displacement")).max() > 0
        assert abs(found.of("N")).max() > 0
