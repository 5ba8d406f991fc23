# SPDX-License-Identifier: MIT
"""The law of Ibarra, Medina and Krawinkler as a machine of plain numbers, written independently.

It follows the published rules event by event: yielding, capping, residual, reversal (update of the
unloading stiffness) and change of the sign of the moment (update of strengths, and of the target
and the break point of a pinched path).
"""

import itertools
import math

import numpy as np


class Machine:
    """One hinge; ``backbones`` are those of positive and negative moments.

    With ``kappas``, which are κF and κD, it aims at peaks and pinches.
    """

    def __init__(
        self, stiffness, backbones, strength, softening, unloading, exponent,
        kappas=None, reloading=math.inf,
    ):  # fmt: skip
        self.K0 = self.K = self.K_start = stiffness
        self.c, self.least = exponent, 0.1
        capacities = strength, softening, unloading, reloading
        self.energies = [x * backbones[0].yield_limit for x in capacities]
        self.kappas, self.path, self.target, self.steepest = kappas, [], 0.0, 0.0
        self.peaks = {}
        self.lines, self.tops = {}, {}
        for way, b in zip((1, -1), backbones, strict=True):
            yields, top = b.yield_limit / stiffness, b.overstrength * b.yield_limit
            slope = (top - b.yield_limit) / b.capping
            self.least = max(self.least, 2 * slope / stiffness)
            caps, falls, residual = (
                yields + b.capping,
                top / b.post_capping,
                b.residual * b.yield_limit,
            )
            self.tops[way], self.peaks[way] = top, yields
            self.lines[way] = {
                "hardening": [b.yield_limit - slope * yields, slope],
                "falling": [top + falls * caps, -falls],
                "residual": [residual, 0.0],
                "most": [math.inf, 0.0],
            }
            if b.ultimate < math.inf:
                last = max(top - falls * (b.ultimate - caps), residual) or top
                steep = max(last / (0.1 * b.ultimate), 2 * falls)
                self.lines[way]["last"] = [last + steep * b.ultimate, -steep]
                self.lines[way]["whole"] = [last, top]
        self.x = self.M = 0.0
        self.way = 1
        self.work = self.spent = 0.0  # in this excursion; in those before
        self.dead = False
        self.total = 0.0

    def value(self, way, x):
        """Bound of moments in a direction, at x and moments that count positive there."""

        def at(name):
            return self.lines[way][name][0] + self.lines[way][name][1] * x

        if self.path and way == self.way and x < self.target:
            return max(np.interp(x, *self.path), 0.0)
        bound = min(max(min(at("hardening"), at("falling")), at("residual")), at("most"))
        if "last" in self.lines[way]:
            bound = min(bound, at("last"))
        return 0.0 if self.dead else max(bound, 0.0)

    def area(self, way, a, b):
        """Integral of the bound from a to b, by trapezoids between all intersections of lines."""
        lines = [line for name, line in self.lines[way].items() if name != "whole"] + [[0.0, 0.0]]
        cuts = {a, b} | {x for x in (self.path[0] if self.path else ()) if a < x < b}
        for (a0, s0), (a1, s1) in itertools.combinations(lines, 2):
            if s0 != s1 and math.isfinite(a0 - a1) and a < (a1 - a0) / (s0 - s1) < b:
                cuts.add((a1 - a0) / (s0 - s1))
        cuts = sorted(cuts)
        return sum(
            (q - p) * (self.value(way, p) + self.value(way, q)) / 2
            for p, q in itertools.pairwise(cuts)
        )

    def beta(self, energy, capacity):
        if energy <= 0:
            return 0.0
        left = capacity - self.spent - energy
        return 1.0 if left <= energy else (energy / left) ** self.c

    def to(self, x):
        """Move to x; return the moment."""
        if x == self.x:
            return self.M
        elastic = self.M + self.K * (x - self.x)
        if elastic * self.way < 0:  # the moment changes its sign on the elastic line
            zero = self.x - self.M / self.K
            self.work += -(self.M**2) / (2 * self.K)
            self.end_excursion()
            if self.kappas:
                self.aim(zero)
            self.x, self.M = zero, 0.0
            elastic = self.K * (x - zero)
        way = self.way
        a, b, M, K = way * self.x, way * x, way * self.M, self.K
        if way * elastic <= self.value(way, b):
            self.work += (self.M + elastic) / 2 * (x - self.x)
            self.x, self.M = x, elastic
            return self.M
        low, high = a, b  # bisection for the rotation where flow begins
        for _ in range(200):
            middle = (low + high) / 2
            if M + K * (middle - a) <= self.value(way, middle):
                low = middle
            else:
                high = middle
        self.work += (2 * M + K * (low - a)) / 2 * (low - a) + self.area(way, low, b)
        self.x, self.M = x, way * self.value(way, b)
        self.flowed(b)
        return self.M

    def aim(self, zero):
        """Lay the path from a rotation without moment to the target, on the way that begins."""
        way = self.way
        self.path, self.steepest, self.target = [], 0.0, self.peaks[way]
        start, moment = way * zero, self.value(way, self.target)
        if moment * (1 + 1e-6) < self.K * (self.target - start):
            factor, part = self.kappas
            rest = self.target - moment / self.K  # after unloading from the target
            turn = rest - part * max(rest, 0.0)
            corners = [(start, 0.0), (self.target, moment)]
            if start < turn < self.target:
                straight = moment * (turn - start) / (self.target - start)
                corners.insert(1, (turn, factor * straight))
            self.path = list(zip(*corners, strict=True))
            (x0, m0), (x1, m1) = corners[-2:]
            self.steepest = 1.1 * (m1 - m0) / (x1 - x0)

    def flowed(self, b):
        way, lines = self.way, self.lines[self.way]
        self.peaks[way] = max(self.peaks[way], b)
        falling = max(lines["falling"][0] + lines["falling"][1] * b, lines["residual"][0])
        if "last" in lines:
            last = lines["last"][0] + lines["last"][1] * b
            falling = min(falling, last)
            other = self.lines[-way]
            part = max(last, 0) / lines["whole"][0]
            if part < 1:
                other["most"][0] = min(other["most"][0], part * self.tops[-way])
        if b >= self.target:
            lines["most"][0] = min(lines["most"][0], max(falling, 0.0))
        recoverable = self.M**2 / (2 * self.K_start)
        beta = self.beta(self.work - recoverable, self.energies[2])
        least = max(self.least * self.K0, self.steepest)
        self.K = max(self.K_start * (1 - beta), min(self.K_start, least))

    def end_excursion(self):
        betas = [self.beta(self.work, capacity) for capacity in self.energies]
        self.dead = self.dead or max(betas) >= 1
        self.spent += self.work
        self.work, self.way, self.K_start = 0.0, -self.way, self.K
        lines = self.lines[self.way]
        lines["hardening"] = [x * (1 - betas[0]) for x in lines["hardening"]]
        lines["falling"][0] *= 1 - betas[1]
        self.peaks[self.way] *= 1 + betas[3]

    @property
    def dissipated(self):
        return self.spent + self.work - self.M**2 / (2 * self.K)
