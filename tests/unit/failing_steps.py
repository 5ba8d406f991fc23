# SPDX-License-Identifier: MIT
"""Steps that fail on purpose, after their last iteration."""

from ufl_beam.compiled.c_library import ffi, fill


def let_fail(simulation, fails):
    """Let a step to the time t1 fail where ``fails(t1)`` is true."""
    time_loop = simulation.time_loop

    @ffi.callback("int(void *, const double *)")
    def admits(_, q1):
        return not fails(time_loop.step.t1)

    calls = ffi.new("admission_call[]", [(admits, ffi.NULL)])
    fill(time_loop, admissions=1, admission=calls, checks_laws=1)
    simulation._alive.append((calls, admits))
