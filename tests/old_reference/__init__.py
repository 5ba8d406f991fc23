# SPDX-License-Identifier: MIT
"""Reference solver of version 0.1.0, for tests of scenes that the present one refuses.

The forces of a scene have residuals and tangents; PETSc's SNES solves for their sum in each step.
"""
