# SPDX-License-Identifier: MIT
"""Mechanics in UFL: strains, relative motions, equations of laws, time schemes."""
