# SPDX-License-Identifier: MIT
"""Effects that are stated once, in UFL, and the loop that computes what follows."""
