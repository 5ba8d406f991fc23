# SPDX-License-Identifier: MIT
"""Planar scenes of the demos, computed in space in a skew plane, equal the planar runs."""

import ast
import contextlib
import io
import sys
from fractions import Fraction
from pathlib import Path

import pytest
from elastic_scenes import Built, draw
from into_space import InSpace, differences
from scipy.spatial.transform import Rotation

import ufl_beam as ub
import ufl_beam.structures as st

DEMOS = {
    path.stem.removeprefix("demo_"): path
    for path in (Path(__file__).parents[2] / "demos").glob("demo_*.py")
}
SKEW = Rotation.from_rotvec([0.3, -0.7, 1.1])
KEEPING = {"u": Rotation.from_rotvec([1.1, 0, 0]), "v": Rotation.from_rotvec([0, 1.1, 0])}
"""Rotations that keep the direction of a controlled displacement."""

EXACT = ub.Newton(rtol=1e-13)

LEFT_OUT = {
    **dict.fromkeys(
        ("bricard", "lateral_buckling", "right_angle_frame", "tumbling_beam"), "is in space"
    ),
    "fibre_damping": "random yield stresses depend on coordinates",
}
"""Demos without a planar scene that can be stated in space, and the reason."""

SHORT = {
    "adaptive_steps": {"dt": 4e-3, "steps": 150},
    "calibration": {},
    "concrete_column": {"steps": 8},  # the next is divided or not by last digits, in both
    "emergency_stop": {"dt": 5e-3, "steps": 150},
    "end_rotation": {},
    "fatigue": {},
    "flying_beam": {},
    "four_beam_swing": {"dt": 4e-3},
    "hinge_snapback": {"control": lambda x: ub.DisplacementControl(x.beams[0].end, "v", 1e-3)},
    "hinges_or_dampers": {"steps": 60},
    "inverted_pendulum": {},
    "lattice": {"dt": 1e-3, "steps": 20, "refine": Fraction(1, 5)},
    "lee_frame": {"control": lambda _: ub.LoadControl(0.01), "refine": Fraction(1, 12)},
    "manipulator": {},
    "monte_carlo": {},
    "pushover": {"control": lambda x: ub.DisplacementControl(x.beams[0].end, "u", 0.02)},
    "roll_up": {},
    "rotating_beam": {},
    "slider_crank": {},
    "steel_frame": {},
    "the_card": {},
    "tradeoff": {},
    "vibrating_frame": {},
}
"""Demos with planar scenes, with the time step, number of steps and cells if they are changed."""


class Stopped(Exception):
    """A demo calls a computation."""


def planar_runs(path, monkeypatch):
    """Return {(scene, scheme): (scene, scheme or control, options)} of the runs of a demo.

    The statements of the demo are executed one by one, without computations.  Those that need
    results fail and are left out.  Of similar scenes with equal schemes, the first is returned.
    """
    found = {}

    def run(scene, scheme, **options):
        if not scene.in_space:
            found.setdefault((str(scene), str(scheme)), (scene, scheme, options))
        raise Stopped

    def stop(*_, **__):
        raise Stopped

    with monkeypatch.context() as patched:
        for name in ("simulate", "follow", "Simulation"):
            patched.setattr(ub, name, run)
        for module, name in ((ub, "modes"), (ub, "tradeoff"), (st, "pushover"), (st, "calibrate")):
            patched.setattr(module, name, stop)
        patched.setattr(ub, "study", lambda run, cases, **_: run(**cases[0]))
        patched.setattr(sys, "argv", [str(path)])
        names = {"__name__": path.stem}
        with contextlib.redirect_stdout(io.StringIO()):
            for statement in ast.parse(path.read_text(encoding="utf-8")).body:
                with contextlib.suppress(Exception):
                    exec(compile(ast.Module([statement], []), str(path), "exec"), names)
    return found


def in_both(scene, scheme, options, *, dt=None, steps=100, refine=1, control=None):
    """Run a scene of a demo in the plane and in a skew plane; yield their differences."""
    kept = getattr(control(scene), "component", "") if control else ""
    copy, runs = InSpace(scene, KEEPING.get(kept, SKEW)), []
    more = {"newton": EXACT, "mesh": ub.Mesh(refine=refine)}
    for x in (scene, copy.scene):
        if control:
            runs.append(ub.follow(x, control(x), steps=20, **more))
        else:
            start, end = options.get("t", (0, 1))
            step = dt or options["dt"]
            end = min(end, start + steps * step)
            runs.append(ub.simulate(x, scheme, t=(start, end), dt=step, **more))
    static = (control or isinstance(scheme, ub.Static)) and not scene.damping
    return differences(copy, *runs, forces=static)


@pytest.mark.serial
@pytest.mark.filterwarnings("ignore::ufl_beam.ModelWarning")
@pytest.mark.parametrize("demo", SHORT)
def test_scenes_of_demos_are_the_same_in_space(demo, monkeypatch, tmp_path):
    """To round-off: motions, energies, section forces of statics, reactions, connectors.

    Path controls are met to 1e-9 of a step.
    """
    monkeypatch.chdir(tmp_path)
    runs = planar_runs(DEMOS[demo], monkeypatch)
    assert runs
    for case in runs.values():
        for name, difference, size in in_both(*case, **SHORT[demo]):
            assert difference <= (1e-8 if "control" in SHORT[demo] else 1e-9) * size, name


RANDOM = [
    ({"free": True}, ub.EnergyMomentum(), 0.02),
    ({}, ub.EnergyMomentum(alpha=0.1, beta=0.05), 0.02),
    ({"fixed": True}, ub.Static(), 0.1),
    ({"fixed": True}, ub.EnergyMomentumStatic(), 0.1),
]


@pytest.mark.serial
@pytest.mark.parametrize(("kind", "scheme", "dt"), RANDOM, ids=lambda x: str(x) * (x != {}))
def test_random_scenes_are_the_same_in_space(kind, scheme, dt):
    """Free ones with velocities, on turned supports, and in statics; to round-off."""
    for seed in (0, *range(2, 12)):  # in statics 1 is divided by Newton's method in the plane
        scene = Built(draw(seed, **kind)).scene
        for name, difference, size in in_both(
            scene, scheme, {"t": (0, 15 * dt)}, dt=dt, steps=5 if kind.get("fixed") else 15
        ):
            assert difference <= 1e-9 * size, f"seed {seed}: {name}"


@pytest.mark.parametrize("demo", LEFT_OUT)
def test_demos_without_such_a_scene(demo, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for scene, _, _ in planar_runs(DEMOS[demo], monkeypatch).values():
        with pytest.raises(NotImplementedError, match=LEFT_OUT[demo]):
            InSpace(scene, SKEW)


def test_each_demo_has_a_comparison_or_a_reason():
    assert {*SHORT, *LEFT_OUT} == {*DEMOS}
    assert not {*SHORT} & {*LEFT_OUT}
