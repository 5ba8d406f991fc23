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
PUSH = ub.PointLoad(BEAM.end, force=(1.0, 0), amplitude=lambda t: t)
SCENE = clamped(BEAM, loads=[PUSH])


def simulate(**more):
    return ub.simulate(SCENE, ub.Static(), t=(0, 1), dt=0.5, **more)


CALLS = {
    "simulate": (simulate, r"100%\|.*\n$"),
    "follow": (
        lambda **more: ub.follow(SCENE, ub.LoadControl(0.5), steps=2, **more),
        r"2/2 \[.*\] *\n$",
    ),
    "study": (
        lambda **more: ub.study(lambda n: {"t": simulate().times}, [{"n": 1}, {"n": 2}], **more),
        r"2/2 \[.*\] *\n$",
    ),
    "tradeoff": (
        lambda **more: ub.tradeoff(
            SCENE, {"tip": lambda run: run.position(BEAM.end)[-1]}, scheme=ub.Static(), t=(0, 1),
            dt=0.5, tolerance=0.01, **more,
        ),
        r"trade-off: \d+ runs \[\d+:\d+\] *\n$",
    ),
}  # fmt: skip


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
def test_a_terminal_shows_the_progress(call, at_once):
    run, last = CALLS[call]
    shown = in_terminal(run)
    assert bool(re.search(last, shown)) == FIRST, shown
    # One bar: that of the study, none of its members
    assert shown.count("\n") == FIRST, shown


FRACTIONS = {
    "reference solver": lambda: simulate(newton=ub.Newton(reference=True)),
    "derivatives": lambda: ub.differentiate(
        lambda force: clamped(BEAM, loads=[ub.PointLoad(BEAM.end, force=(force, 0))]),
        {"force": 1.0}, ub.Static(), t=(0, 1), dt=0.5,
    ),
}  # fmt: skip


@pytest.mark.parametrize("call", FRACTIONS)
def test_fractions_are_per_cent(call, at_once):
    """A bar of all digits of the fraction, 0.30228333333333335/1.0, tells nothing."""
    shown = in_terminal(FRACTIONS[call])
    assert bool(re.search(r"100%\|[^/]*\| \[[\d:]+<[\d:]+.*\]", shown)) == FIRST, shown


@pytest.mark.parametrize("call", CALLS)
def test_no_progress_if_it_is_not_wanted(call, at_once):
    run, _ = CALLS[call]
    assert in_terminal(run, progress=False) == ""


@pytest.mark.parametrize("call", CALLS)
def test_no_progress_without_a_terminal(call, at_once, capsys):
    run, _ = CALLS[call]
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
