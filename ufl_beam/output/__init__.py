# SPDX-License-Identifier: MIT
"""Recorders, output files, and the states of a run that they read."""
