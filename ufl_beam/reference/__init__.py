# SPDX-License-Identifier: MIT
"""The theory as plain DOLFINx: UFL forms on one mesh of all beams, SNES for each step.

* :mod:`~ufl_beam.reference.forms`: functions of a step, and forms from the functional;
* :mod:`~ufl_beam.reference.frame`: the mesh, and joints and supports as q = C x + g(t);
* :mod:`~ufl_beam.reference.points`: the return map of material points with embedded hinges;
* :mod:`~ufl_beam.reference.connectors`: other joints and motors, bodies and point masses;
* :mod:`~ufl_beam.reference.hinges`: plastic hinges of zero length;
* :mod:`~ufl_beam.reference.nonlinear_problem`: the equation of a step, and SNES;
* :mod:`~ufl_beam.reference.solver`: steps, and the search for hinges that open.

Runs, with their scope and results, are in :mod:`~ufl_beam.simulation.reference_run`.
"""
