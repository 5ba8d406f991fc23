# SPDX-License-Identifier: MIT
"""Reference solver: a plain implementation of the equations of the paper.

The forces of a scene have residuals and tangents; PETSc's SNES solves for their sum in each step.
"""
