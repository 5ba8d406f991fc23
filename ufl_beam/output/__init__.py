# SPDX-License-Identifier: MIT
"""Output files, recorders, and their view of a run."""
