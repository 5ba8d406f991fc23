# SPDX-License-Identifier: MIT
"""What each run with laws of connectors has to fulfil."""

from mpi4py import MPI

import numpy as np

import ufl_beam as ub


def require_reference(run, scene, link, scheme, **more):
    """The reference solver, with the laws by NumPy, finds the same, ledger included; the run."""
    found, reference = (
        run(scene, scheme, newton=ub.Newton(rtol=1e-12, reference=one), **more)
        for one in (False, True)
    )
    np.testing.assert_allclose(found.q, reference.q, rtol=0, atol=1e-9 * np.abs(found.q).max())
    for mine, other in zip(found.connector(link), reference.connector(link), strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9 * max(np.abs(mine).max(), 1e-3))
    assert list(found.energy) == list(reference.energy)
    for entry in found.energy:
        a, b = found.energy[entry], reference.energy[entry]
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * found.energy.throughput)
    return found


def require_restart(run, scene, links, scheme, folder, until):
    """A run resumed at half time ends bit for bit as the whole one, one from `start=` nearly so."""
    half, whole = until / 2, run(scene, scheme, t=(0, until))
    file = ub.Checkpoint(folder / "run.checkpoint", every=7)
    run(scene, scheme, t=(0, half), checkpoint=file)
    resumed = run(scene, scheme, t=(0, until), checkpoint=file)
    assert np.array_equal(resumed.q, whole.q)
    for link in links:
        for mine, other in zip(resumed.connector(link), whole.connector(link), strict=True):
            assert np.array_equal(mine, other)
    for entry in whole.energy:
        # Several processes add up what was lost before and after in another order.
        digits = 0.0 if MPI.COMM_WORLD.size == 1 else 1e-14
        scale = digits * whole.energy.throughput
        np.testing.assert_allclose(resumed.energy[entry], whole.energy[entry], rtol=0, atol=scale)
    second = run(scene, scheme, t=(half, until), start=run(scene, scheme, t=(0, half)))
    np.testing.assert_allclose(second.q[-1], whole.q[-1], rtol=0, atol=1e-8 * np.abs(whole.q).max())
    return whole
