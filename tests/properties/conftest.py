# SPDX-License-Identifier: MIT
"""Property tests find their modules."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
