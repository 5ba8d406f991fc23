# SPDX-License-Identifier: MIT
"""Names of connectors, and springs with a free length."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from helpers import raises, require_restart
from scenes import clamped

import ufl_beam as ub

MASS, K, C = 2.0, 100.0, 1.0


def strut():
    """A mass on a rail, on a spring that is 0.2 m shorter than its place, and on a damper."""
    body = ub.Body((1, 0), mass=MASS, inertia=0.1)
    stop = ub.Stop(1e4, high=0.5)
    laws = {"spring": ub.Spring(K, free=-0.2), "damper": ub.Damper(C), "stop": stop}
    parts = [ub.Stretch(ub.ground(0, 0), body.middle, law, name=name) for name, law in laws.items()]
    rail = ub.Prismatic(ub.ground(0, 0), body.middle, axis=(1, 0))
    return body, parts, ub.Scene(bodies=[body], joints=[rail], connectors=parts)


def test_a_spring_pulls_a_mass_to_its_free_length(tmp_path, request):
    """[closed] Damped oscillation about x = -0.2 m; the midpoint rule has the error (ω dt)²/12."""
    body, (spring, *_), scene = strut()
    simulate = partial(ub.simulate, scene, ub.EnergyMomentum())
    if ub.parallel.active_comm().size == 1:
        short = simulate(t=(0, 0.2), dt=0.02, newton=ub.Newton(rtol=1e-12))
        request.getfixturevalue("as_by_reference")(short)
    run = simulate(t=(0, 1), dt=1e-3)
    d, t = C / (2 * MASS), run.times
    ω = math.sqrt(K / MASS - d**2)
    exact = -0.2 + 0.2 * np.exp(-d * t) * (np.cos(ω * t) + d / ω * np.sin(ω * t))
    np.testing.assert_allclose(run.displacement(body.middle)[:, 0], exact, rtol=0, atol=1e-5)
    assert run.energy.state["stored"][0] == pytest.approx(K * 0.2**2 / 2, rel=1e-12)
    assert run.energy.worst < 1e-9
    assert run.connector(spring).force[0] == pytest.approx(0.2 * K, rel=1e-12)
    again = partial(ub.simulate, dt=0.02)
    require_restart(again, scene, [spring], ub.EnergyMomentum(), tmp_path, 0.4)


def lifted(free, cells=2):
    """A cantilever on a spring at its end."""
    beam = ub.Beam((0, 0), (1, 0), ub.Section(EA=1e9, GA=1e9, EI=1e4, rhoA=1.0), cells=cells)
    law = ub.Spring(2e4, free=free)
    lift = ub.Slide(ub.ground(1, 0), beam.end, law, axis=(0, 1), name="lift")
    return clamped(beam, connectors=[lift])


@pytest.mark.parametrize("scheme", [ub.Static(), ub.EnergyMomentumStatic()], ids=str)
def test_a_beam_is_bent_by_a_spring_of_another_length(scheme):
    """[closed] Springs in series: F = k 3EI/L³ / (k + 3EI/L³) free, for a small deflection."""
    free, scene = 1e-4, lifted(1e-4, cells=64)
    run = ub.simulate(scene, scheme, t=(0, 1), dt=1.0)
    force = 2e4 * 3e4 / (2e4 + 3e4) * free
    # Of shear 3EI/GA = 3e-5; the square of the deflection is negligible
    assert -run.connector(scene.connectors[0]).force[-1] == pytest.approx(force, rel=1e-4)
    about = ub.modes(scene, 1, at=run).omega
    # The normal force of the support is zero, so the state has the tangent of the undeformed scene
    assert about == pytest.approx(ub.modes(lifted(0.0, cells=64), 1).omega, rel=1e-6)
    with raises("modes", "lift", "stress at no strain", "give at="):
        ub.modes(scene, 1)


def test_derivatives_by_the_free_length():
    """A linear spring: the deflection is proportional to it."""
    found = ub.differentiate(lifted, {"free": 1e-4}, ub.Static(), t=(0, 1), dt=1.0)
    slope = found.of(lambda s: s.displacement(s.scene.beams[0].end)[-1, 1])[0]
    value = found.solution.displacement(found.solution.scene.beams[0].end)[-1, 1]
    assert slope == pytest.approx(value / 1e-4, rel=1e-6)


def test_springs_with_a_free_length_are_elastic():
    for more in ({"law": ub.ElastoPlastic(1.0)}, {"softening": ub.Softening(1.0, 1.0)}):
        with raises("Spring: free is for an elastic spring", kind=ub.ModelError):
            ub.Spring(K, free=0.1, **more)


def test_names_tell_connectors_of_the_same_places_apart(shared_path, on_first_rank):
    """In tables, saved scenes, events, messages and pictures; a bushing gives it to components."""
    body, parts, scene = strut()
    assert [*map(str, parts)] == ["spring", "damper", "stop"]
    events = ub.Events()
    record = [ub.History(shared_path / "run.csv", connectors=parts), events]
    scene = replace(scene, loads=[ub.PointLoad(body.middle, force=(1e3, 0))])
    run = ub.simulate(scene, ub.EnergyMomentum(), t=(0, 0.1), dt=1e-2, record=record)
    header = on_first_rank(lambda: (shared_path / "run.csv").read_text().splitlines()[0])
    assert "force spring, Spring [N]" in header
    assert "force damper, Damper [N]" in header
    assert "stop touches" in str(events.found[0])
    run.save(shared_path / "run.h5")
    loaded = ub.Solution.load(shared_path / "run.h5").scene.connectors
    assert [c.name for c in loaded] == ["spring", "damper", "stop"]
    assert loaded[0].law.free == -0.2
    texts = [text.get_text() for text in ub.plot(scene).axes[0].texts]
    assert {"spring", "damper", "stop"} <= {text.split(",")[0] for text in texts}
    law = ub.Clearance(stiffness=1e5, gap=1e-3)
    pin = ub.Bushing(ub.ground(1, 0), body.middle, law, name="pin")
    assert {str(x) for x in pin.components} == {str(pin)} == {"pin"}
    assert [*map(str, ub.Scene(bodies=[body], connectors=[pin]).all_connectors)] == ["pin", "pin"]
