# SPDX-License-Identifier: MIT
"""Unit tests keep collections of garbage cheap."""

import gc


def pytest_collection_finish(session):
    """What exists before the first test stays; collections then look at what tests made only."""
    gc.collect()
    gc.freeze()
