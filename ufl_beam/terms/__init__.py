# SPDX-License-Identifier: MIT
"""Virtual works in the equation of a step, one class for each physical effect."""
