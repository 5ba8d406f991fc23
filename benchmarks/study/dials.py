# SPDX-License-Identifier: MIT
"""What is turned: a setting of all dials, the grid of each scene, and one dial at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from cases import Case

import ufl_beam as ub

SCHEMES: dict[str, ub.mechanics.time_scheme.Scheme] = {
    "EnergyMomentum": ub.EnergyMomentum(),
    "EnergyMomentum(0.05, 0.05)": ub.EnergyMomentum(alpha=0.05, beta=0.05),
    "EnergyMomentumDecaying": ub.EnergyMomentumDecaying(),
    "EnergyMomentumPrinted": ub.EnergyMomentumPrinted(),
    "EnergyMomentum(order=4)": ub.EnergyMomentum(order=4),
    "Newmark": ub.Newmark(),
    "GeneralizedAlpha": ub.GeneralizedAlpha(),
}
STATIC: dict[str, ub.mechanics.time_scheme.Scheme] = {
    "Static": ub.Static(),
    "EnergyMomentumStatic": ub.EnergyMomentumStatic(),
}


SOLVERS = {
    "Newton's method in C": {},
    "PETSc's newtonls": {"petsc": {"snes_type": "newtonls"}},
    "the card": {"reference": True},
}


@dataclass(frozen=True)
class Setting:
    """All dials of a run.

    Attributes:
        scheme: Name, see SCHEMES and STATIC.
        halvings: Of the coarsest step.
        refine: Parts of each of the coarsest cells.
        degree: Of the cells.
        lumped: Whether masses are those of nodes.
        solver: Name, see SOLVERS.
        rtol: Of Newton's method.
        adaptive: Tolerance of adaptive steps, instead of equal steps; 0: none.
        every: Steps from one that is kept to the next.
        history: Whether a table of the place is written, a row each step.
    """

    scheme: str
    halvings: int
    refine: int
    degree: int = 1
    lumped: bool = False
    solver: str = "Newton's method in C"
    rtol: float = 1e-10
    adaptive: float = 0.0
    every: int = 1
    history: bool = False

    def arguments(self, case: Case) -> dict:
        """Of `ub.simulate`."""
        dt = case.end / case.steps / 2**self.halvings
        stops = tuple(case.instants[:-1])
        return {
            "scheme": (SCHEMES | STATIC)[self.scheme],
            "t": (0.0, case.end),
            "dt": ub.Adaptive(self.adaptive, stops=stops) if self.adaptive else dt,
            "mesh": ub.Mesh(refine=self.refine, degree=self.degree, lumped=self.lumped),
            "newton": ub.Newton(rtol=self.rtol, **SOLVERS[self.solver]),
            "every": self.every,
        }


def numbering(case: Case, quick: bool) -> Iterator[Setting]:
    """Schemes, steps and cells; cells of degree 2 where they may be."""
    schemes = SCHEMES if case.dynamic else STATIC
    halvings = ((0, 2) if quick else range(5)) if case.dynamic else range(2)
    cells = [(r, 1) for r in ((1, 4) if quick else (1, 2, 4, 8))]
    if case.elastic:
        cells += [(r, 2) for r in ((1,) if quick else (1, 2, 4))]
    for scheme, n, (refine, degree) in product(schemes, halvings, cells):
        # A diagonal band of the grid: short steps on coarse cells, and the reverse, are no one's
        if quick or not case.dynamic or abs(n - refine.bit_length() - degree + 2) <= 2:
            yield Setting(scheme, n, refine, degree)


def reference(case: Case, quick: bool) -> tuple[Setting, Setting]:
    """A run that is finer than all of the grid, and one that tells how much it errs itself."""
    degree = 2 if case.elastic else 1
    refine = 8 if case.elastic else (16 if quick else 32)
    scheme = next(iter(SCHEMES if case.dynamic else STATIC))
    fine = Setting(scheme, 5 if quick else 7, refine, degree)
    return fine, replace(fine, halvings=fine.halvings - 1, refine=refine // 2)


def base(case: Case, quick: bool) -> Setting:
    """Where one dial is turned at a time."""
    return Setting(
        next(iter(SCHEMES if case.dynamic else STATIC)), 1 if quick else 3, 2 if quick else 4
    )


def one_by_one(case: Case, quick: bool) -> Iterator[tuple[str, Setting]]:
    """Name of the dial, and the base with that dial turned."""
    here = base(case, quick)
    for name, refine in (("half", here.refine // 2), ("twice", 2 * here.refine)):
        yield f"cells: {name}", replace(here, refine=refine)
    if case.elastic:
        for degree in (2, 3):
            yield f"cells: degree {degree}", replace(here, degree=degree)
            coarse = replace(here, degree=degree, refine=max(1, here.refine // degree))
            yield f"cells: degree {degree}, same number of nodes", coarse
    for more in (-1, 1):
        turned = replace(here, halvings=here.halvings + more)
        yield f"step: {'twice' if more < 0 else 'half'}", turned
    if case.dynamic:
        for tolerance in (1e-3, 1e-4, 1e-5):
            yield f"step: adaptive {tolerance:g}", replace(here, adaptive=tolerance)
        for scheme in SCHEMES:
            if scheme != here.scheme:
                yield f"scheme: {scheme}", replace(here, scheme=scheme)
        yield "mass: lumped", replace(here, lumped=True)
    for solver in list(SOLVERS)[1:]:
        yield f"solver: {solver}", replace(here, solver=solver)
    for rtol in (1e-8, 1e-6, 1e-4):
        yield f"Newton: rtol {rtol:g}", replace(here, rtol=rtol)
    steps = case.steps * 2**here.halvings // len(case.instants)
    yield "output: ten states kept", replace(here, every=steps)
    yield "output: with a History file", replace(here, history=True)
