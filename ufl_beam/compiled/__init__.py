# SPDX-License-Identifier: MIT
"""Compilation of C and of UFL forms, the code in C, and matrices that it fills."""
