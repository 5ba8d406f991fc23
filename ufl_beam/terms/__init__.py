# SPDX-License-Identifier: MIT
"""Terms of the step equation: virtual works, one class for each physical effect."""
