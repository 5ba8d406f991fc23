# SPDX-License-Identifier: MIT
"""Modules of the benchmarks import each other by their names."""

import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[1]
sys.path += [str(BENCHMARKS), str(BENCHMARKS / "study")]
