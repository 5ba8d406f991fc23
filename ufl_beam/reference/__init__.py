# SPDX-License-Identifier: MIT
"""Reference solver: a plain solution of the equations of the paper.

A scene becomes a list of forces, each with a residual and a tangent; PETSc's SNES solves a step.
"""
