# SPDX-License-Identifier: MIT
"""Compilation of C and of UFL forms, the C library, and the matrices that it fills."""
