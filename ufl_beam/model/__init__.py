# SPDX-License-Identifier: MIT
"""Records of a model: beams, bodies, sections, laws, joints, supports, loads, scenes."""
