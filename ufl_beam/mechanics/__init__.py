# SPDX-License-Identifier: MIT
"""Mechanics of the paper in UFL: strains, relative motions, time schemes."""
