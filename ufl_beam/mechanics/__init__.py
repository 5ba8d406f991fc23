# SPDX-License-Identifier: MIT
"""The mechanics of the paper in UFL: strains, relative motions, time schemes."""
