# SPDX-License-Identifier: MIT
"""Reference solver: the equations of the paper, solved in the plainest way.

A scene is read into forces, each with a residual and a tangent; a step is solved by PETSc's SNES.
"""
