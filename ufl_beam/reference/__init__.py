# SPDX-License-Identifier: MIT
"""The theory as plain DOLFINx: UFL forms on one mesh of all beams, SNES for each step.

* :mod:`~ufl_beam.reference.frame`: the mesh, and joints and supports as q = C x + g(t);
* :mod:`~ufl_beam.reference.forms`: functions of a step, and forms from the functional;
* :mod:`~ufl_beam.reference.points`: the return map of material points with embedded hinges;
* :mod:`~ufl_beam.reference.hinges`: plastic hinges of zero length;
* :mod:`~ufl_beam.reference.constraints`: other joints and motors, bodies and point masses;
* :mod:`~ufl_beam.reference.simulation`: scope, equation of a step, steps, results.
"""
