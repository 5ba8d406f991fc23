# SPDX-License-Identifier: MIT
"""Names of the entries of the energy ledger."""

LOSSES = ("damping", "friction", "functions", "connectors", "contact")
"""Entries of the energy ledger of what connectors and dampers lose."""

ENTRIES = (
    *("kinetic", "stored", "hardening", "loads", "supports", "motors", "controllers"),
    *("numerical", "plastic", "hinges", *LOSSES),
)
"""Names that entries of the energy ledger have already."""
