# SPDX-License-Identifier: MIT
"""Output that nobody reads any more, as in ``script | head``: the script ends without a word."""

from __future__ import annotations

import atexit
import os
import select
import signal
import sys
from contextlib import suppress
from types import TracebackType


def _write_to_nowhere() -> bool:
    """Return whether nobody reads the output; then send what is left of it to nowhere."""
    try:
        output = sys.stdout.fileno()
        poll = select.poll()
        poll.register(output, 0)
        broken = any(event & select.POLLERR for _, event in poll.poll(0))
    except (AttributeError, OSError, ValueError):  # closed, or no file
        return False
    if broken:
        os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    return broken


def _end_quietly(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Print an exception that nobody catches, unless it is about output that nobody reads."""
    if not (issubclass(kind, BrokenPipeError) and _write_to_nowhere()):
        _print_exception(kind, error, trace)


_print_exception = sys.excepthook
sys.excepthook = _end_quietly
atexit.register(_write_to_nowhere)
with suppress(ValueError):  # in a thread
    # PETSC has taken the signal, and ends with a page about it; back to Python's exception.
    signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))
