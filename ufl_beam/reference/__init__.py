# SPDX-License-Identifier: MIT
"""The theory as plain DOLFINx: UFL forms on one mesh of all beams, SNES for each step.

* :mod:`~ufl_beam.reference.frame`: the mesh, and joints and supports as q = C x;
* :mod:`~ufl_beam.reference.forms`: functions of a step, and forms from the functional;
* :mod:`~ufl_beam.reference.points`: the return map of material points with embedded hinges;
* :mod:`~ufl_beam.reference.connectors`: other joints, motors and hinges of zero length;
* :mod:`~ufl_beam.reference.step_problem`: the equation of a step, and SNES that solves it;
* :mod:`~ufl_beam.reference.solver`: steps, and the search for hinges that open.

Runs, with their scope and results, are in :mod:`~ufl_beam.simulation.reference_run`.  A comment
"equation (n)" marks a line that uses P(n), which is stated elsewhere; "P(n)" states it.
"""
