# SPDX-License-Identifier: MIT
"""Files, recorders, and what they ask of a run."""
