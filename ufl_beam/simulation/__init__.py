# SPDX-License-Identifier: MIT
"""Simulation of a scene: steps and their control, solutions and checkpoints."""
