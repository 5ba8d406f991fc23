# SPDX-License-Identifier: MIT
"""Property tests find the module of random scenes, and keep collections of garbage cheap."""

import gc
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))


def pytest_collection_finish(session):
    """What exists before the first test stays; collections then look at what tests made only."""
    gc.collect()
    gc.freeze()
