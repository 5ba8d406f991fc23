# SPDX-License-Identifier: MIT
"""Dataclasses of a model: beams, bodies, sections, laws, joints, supports, loads, scenes."""
