# SPDX-License-Identifier: MIT
"""Scenes and runs whose files are stored in tests/data/files, written by an earlier commit.

As a script it writes the files with the package that is imported: in a work tree of that commit,
``./env python3 saved_scenes.py FOLDER``.
"""

import sys
from pathlib import Path

import ufl_beam as ub

SECTION = ub.Section(EA=2e6, GA=8e5, EI=900.0, rhoA=8.0, rhoI=0.01)
END, DT = 0.2, 0.01


def crane():
    """Two arms with a yielding hinge, a link, and loads that follow the motion."""
    mast = ub.Beam((0, 0), (0, 2), SECTION, cells=4, name="mast")
    arm = ub.Beam((0, 2), (1.5, 2), SECTION, cells=3, name="arm")
    yields = ub.ElastoPlastic(400.0, isotropic=2e3)
    hinge = ub.Turn(mast.end, arm.start, ub.Spring(2e4, law=yields))
    return ub.Scene(
        [mast, arm],
        joints=[ub.Revolute(mast.end, arm.start), ub.Link(ub.ground(-1.0, 1.0), mast.at(0.5))],
        supports=[ub.Clamped(mast.start)],
        connectors=[hinge],
        loads=[ub.FollowerLoad(arm.end, force=(0, -500.0)), ub.Pressure(mast, normal=200.0)],
        masses=[ub.PointMass(arm.end, 5.0)],
        damping=[ub.KelvinVoigt(1e-3)],
    )


def bridge():
    """A beam that yields under a load that crosses it, on a bearing with friction."""
    yields = ub.ElastoPlastic(300.0, kinematic=100.0)
    section = ub.Section(EA=2e6, GA=8e5, EI=900.0, rhoA=8.0, rhoI=0.01, bending=yields)
    deck = ub.Beam((0, 0), (4, 0), section, cells=4, name="deck")
    rubs = ub.Slide(ub.ground(4, 0), deck.end, ub.Coulomb(50.0), axis=(1, 0))
    return ub.Scene(
        [deck],
        supports=[ub.Pinned(deck.start), ub.Roller(deck.end)],
        connectors=[rubs],
        loads=[ub.MovingLoad([deck], place, (0.0, -800.0))],
    )


def place(t):
    """The distance of the load from the left end; m."""
    return 1.0 + 6.0 * t


def simulated(scheme, until=END, scene=crane, **options):
    """A run of a scene."""
    return ub.simulate(scene(), scheme, t=(0, until), dt=DT, **options)


def crossed(folder, until=END):
    """A run of the bridge with a checkpoint, which has the states of all recorders."""
    deck = (scene := bridge()).beams[0]
    recorders = [ub.History(folder / "bridge.csv", [deck.at(0.5)]), ub.Extremes(), ub.Events()]
    checkpoint = ub.Checkpoint(folder / "bridge.checkpoint", every=10)
    return simulated(
        ub.EnergyMomentum(), until, lambda: scene, record=recorders, checkpoint=checkpoint
    )


def member(x):
    """A member of the study."""
    return {"square": x**2}


def write(folder):
    """Write a file of each kind."""
    for name, scheme in (("decaying", ub.EnergyMomentumDecaying()), ("static", ub.Static())):
        simulated(scheme).save(folder / f"{name}.solution")
    crossed(folder).save(folder / "bridge.solution")
    ub.study(member, [{"x": float(x)} for x in range(3)], path=folder / "squares.study")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
