# SPDX-License-Identifier: MIT
"""Representations in notebooks: a base class, and functions that know how to write each class.

Models and results know no pictures: the modules that draw them register how, see `notebook.py`.
"""

from __future__ import annotations

import html
from functools import singledispatch
from typing import Any


@singledispatch
def html_of(shown: object) -> str:
    """Write an object as HTML: its text, unless a function is registered for its class."""
    return f"<pre>{html.escape(str(shown))}</pre>"


@singledispatch
def picture_of(shown: object) -> Any:
    """Draw the figure that stands for an object in a notebook, by the function for its class."""
    raise TypeError(f"a {type(shown).__name__} has no picture")


class Rich:
    """Base of models and results that a notebook shows as tables and a picture."""

    def _repr_html_(self) -> str:
        return html_of(self)
