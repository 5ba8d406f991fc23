# SPDX-License-Identifier: MIT
"""Modes, buckling, static paths, studies, and the trade of speed for accuracy."""
