# SPDX-License-Identifier: MIT
"""Virtual works, one class each: what a scene contributes to the equation of a step."""
