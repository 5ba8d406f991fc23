# SPDX-License-Identifier: MIT
"""Numbering of unknowns, function spaces, compiled forms, transfer of states."""
