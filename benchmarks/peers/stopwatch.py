# SPDX-License-Identifier: MIT
"""Time that a loop takes, on the wall and of the processor."""

import time


class Stopwatch:
    """Adds up what passes within ``with stopwatch:``; the rest is not timed."""

    def __init__(self):
        self.wall = self.cpu = 0.0

    def __enter__(self):
        self._begin = time.perf_counter(), time.process_time()

    def __exit__(self, *_):
        wall, cpu = self._begin
        self.wall += time.perf_counter() - wall
        self.cpu += time.process_time() - cpu

    def read(self):
        return {"wall": self.wall, "cpu": self.cpu}
