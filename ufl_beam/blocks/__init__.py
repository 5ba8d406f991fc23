# SPDX-License-Identifier: MIT
"""Statements of effects in UFL, and their evaluation for all elements of a scene."""
