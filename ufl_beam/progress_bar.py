# SPDX-License-Identifier: MIT
"""Progress bars in terminals and notebooks."""

from __future__ import annotations

import sys
import warnings
from typing import Any

from mpi4py import MPI

from ufl_beam.parallel import in_study

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of a notebook without ipywidgets, where bars are text
    from tqdm.auto import tqdm

DELAY = 0.5  # time before a bar is shown, and between its updates; s


def progress_bar(shown: bool, comm: MPI.Intracomm, **options: Any) -> Any:
    """Make a bar of tqdm, which the first process shows if someone can see it.

    Nothing is printed by members of a study, nor if the output is neither a terminal nor a
    notebook, nor by what takes less than half a second.  A notebook whose kernel has TQDM_DISABLE=1
    in its environment shows none, as in a documentation.

    Args:
        shown: Whether the user wants it.
        comm: Processes that share the work.
        options: Arguments of tqdm.
    """
    if not shown or comm.rank > 0 or in_study():
        options["disable"] = True
    elif not in_notebook():
        options["disable"] = None  # unless the output is a terminal
    return tqdm(delay=DELAY, mininterval=DELAY, **options)


def in_notebook() -> bool:
    """Return whether a kernel of Jupyter runs this."""
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell is not None and "IPKernelApp" in shell.config
