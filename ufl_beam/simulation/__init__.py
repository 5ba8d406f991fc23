# SPDX-License-Identifier: MIT
"""From a scene to its motion: steps, solutions, checkpoints."""
