# SPDX-License-Identifier: MIT
"""Numbering of unknowns, function spaces, compiled forms, and transfer of states."""
