# SPDX-License-Identifier: MIT
"""Each demo runs to its end, where it checks its own result; its files can be opened."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from time_series import read_as_users_do

from ufl_beam.output.paraview_files import TimeSeries

DEMOS = sorted((Path(__file__).parents[1] / "demos").glob("demo_*.py"))


@pytest.fixture
def written(monkeypatch):
    """For each time series: times, and displacements and rotations of nodes of beams."""
    states = {}

    def spied(method):
        def call(self, simulation, *more):
            method(self, simulation, *more)
            kept = states.setdefault(self.files[0].resolve(), [])
            if self._writers[0].complete[0] > len(kept):
                q = simulation.subdomain.gather(simulation.q)
                kept.append((simulation.t, q[simulation.numbering.dofs]))

        return call

    for name in ("begin", "write"):
        monkeypatch.setattr(TimeSeries, name, spied(getattr(TimeSeries, name)))
    return states


def require_states(path, states):
    """PyVista opens a time series in one line, and finds the states that the run had."""
    found = read_as_users_do(path)
    assert found.times == [t for t, _ in states]
    for n, (_, nodes) in enumerate(states):
        rows = slice(len(nodes))  # nodes of beams come first
        assert (found.of("displacement")[n, rows, :2] == nodes[:, :2]).all()
        assert (found.of("rotation")[n, rows] == nodes[:, 2]).all()
    # Not nothing
    assert np.isfinite(found.of("M")).all()
    assert abs(found.of("displacement")).max() > 0
    assert abs(found.of("N")).max() > 0


@pytest.mark.slow
@pytest.mark.demo
@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_each_demo_runs_to_its_end(demo, tmp_path, monkeypatch, written):
    text = demo.read_text(encoding="utf-8")
    if "import control\n" in text:
        pytest.importorskip("control")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(demo))
    assert list((tmp_path / "output").glob("*.png"))
    files = {path.resolve() for path in (tmp_path / "output").glob("*.hdf")}
    assert files == written.keys()
    assert bool(files) == ("ub.VTKHDF(" in text or ".write(output" in text)
    for path in files:
        require_states(path, written[path])
