# SPDX-License-Identifier: MIT
"""Progress bars: in terminals and notebooks only, and only if they are wanted."""

import contextlib
import io
import re
import sys
from types import SimpleNamespace

from mpi4py import MPI

import pytest
from scenes import SECTION, clamped

import ufl_beam as ub
from ufl_beam import parallel

FIRST = MPI.COMM_WORLD.rank == 0
BEAM = ub.Beam((0, 0), (0, 2), SECTION, cells=2)
TIMES = {"t": (0, 1), "dt": 0.5}


def pushed(force=1.0):
    return clamped(BEAM, loads=[ub.PointLoad(BEAM.end, (force, 0), amplitude=lambda t: t)])


def simulate(**more):
    return ub.simulate(pushed(), ub.Static(), **TIMES, **more)


CALLS = {
    "simulate": (simulate, r"100%\|.*\n$"),
    "reference solver": (
        lambda **more: simulate(newton=ub.Newton(reference=True), **more),
        r"100%\|[^/]*\| \[[\d:]+<[\d:]+.*\]",
    ),
    "differentiate": (
        lambda **more: ub.differentiate(pushed, {"force": 1.0}, ub.Static(), **TIMES, **more),
        r"100%\|[^/]*\| \[[\d:]+<[\d:]+.*\]",
    ),
    "follow": (
        lambda **more: ub.follow(pushed(), ub.LoadControl(0.5), steps=2, **more),
        r"2/2 \[.*\] *\n$",
    ),
    "study": (
        lambda **more: ub.study(lambda n: {"t": simulate().times}, [{"n": 1}, {"n": 2}], **more),
        r"2/2 \[.*\] *\n$",
    ),
    "tradeoff": (
        lambda **more: ub.tradeoff(
            pushed(), {"tip": lambda run: run.position(BEAM.end)[-1]}, scheme=ub.Static(),
            **TIMES, tolerance=0.01, **more,
        ),
        r"trade-off: \d+ runs \[\d+:\d+\] *\n$",
    ),
}  # fmt: skip
"""Calls, and ends of their bars; fractions of time are shown as per cent without digits."""


class Terminal(io.StringIO):
    """Output that is a terminal."""

    def isatty(self):
        return True


def in_terminal(run, **more):
    """What a call prints."""
    with contextlib.redirect_stderr(Terminal()) as terminal:
        run(**more)
    return terminal.getvalue()


@pytest.fixture
def at_once(monkeypatch):
    monkeypatch.setattr(parallel, "DELAY", 0.0)


@pytest.mark.parametrize("call", CALLS)
def test_a_terminal_shows_the_progress(call, at_once, capsys):
    """One bar, that of a study and none of its members; none if it is not wanted or no terminal."""
    run, last = CALLS[call]
    shown = in_terminal(run)
    assert bool(re.search(last, shown)) == FIRST, shown
    assert shown.count("\n") == FIRST, shown
    assert in_terminal(run, progress=False) == ""
    run()
    assert capsys.readouterr().err == ""


def test_short_runs_show_no_progress(monkeypatch):
    """The delay, here of an hour, has not passed at the end."""
    monkeypatch.setattr(parallel, "DELAY", 3600.0)
    assert in_terminal(simulate) == ""


def test_a_notebook_shows_the_progress(at_once, monkeypatch, capsys):
    """Its output is no terminal; the shell has the settings of a kernel."""
    shell = SimpleNamespace(config={"IPKernelApp": {}})
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    simulate()
    assert ("100%" in capsys.readouterr().err) == FIRST
    shell.config.clear()  # the prompt of IPython
    simulate()
    assert capsys.readouterr().err == ""
