# SPDX-License-Identifier: MIT
"""Names of the models that have a counterpart in OpenSees, and the controls they run with."""

CONTROLS = "imposed motion", "displacement control"

NAMES = (
    "hinge at the kink to residual strength, in cycles",
    "the same hinge beyond its ultimate rotation",
    "reinforced concrete beam beyond its peak",
    "two storeys of reinforced concrete, pushed after the vertical loads",
    "concrete without tension under gravity, then bent",
    "column of reinforced concrete, cycles until the concrete crushes",
    "brace that buckles and yields in cycles",
)
