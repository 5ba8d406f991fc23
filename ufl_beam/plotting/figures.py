# SPDX-License-Identifier: MIT
"""Figures that the first process saves, and that a notebook shows as pictures."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from matplotlib.figure import Figure

from ufl_beam.parallel import active_comm

CSS_DPI = 80.0  # pixels of a page to an inch of a figure


class Picture(Figure):
    """Figure of no window: a cell of a notebook that ends with it shows it as PNG."""

    def savefig(self, *args: Any, **options: Any) -> None:
        """Save the figure; the first process alone writes, as all of them run the same script."""
        if active_comm().rank == 0:
            super().savefig(*args, **options)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        data, width = png(self)
        return data, {"width": width}


def png(figure: Figure) -> tuple[bytes, int]:
    """Return a figure as PNG, and its width in a page; pixels."""
    file = BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue(), round(CSS_DPI * figure.get_figwidth())
