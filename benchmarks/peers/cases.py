# SPDX-License-Identifier: MIT
"""What is run: each program with its settings on each problem, and the ladders of the figure."""

from typing import NamedTuple


def group_of(part, problem, settings):
    """What cases have in common that are compared."""
    return part, problem, *(settings.get(name) for name in ("cells", "dt", "turns", "end"))


class Case(NamedTuple):
    """One program at one setting on one problem.

    Attributes:
        label: The setting, for tables and legends; "" for the only one.
        settings: Arguments of the program's function.
        part: "tables" or "figure".
        long: Left out by ``--quick``, and run in fewer rounds.
    """

    program: str
    problem: str
    label: str
    settings: dict
    part: str
    long: bool

    @property
    def group(self):
        """Cases of one group run in turn, and are compared."""
        return group_of(self.part, self.problem, self.settings)


NEWTON = ("full", "modified")
DENSE = 64
"""Exudyn's dense solver is tried up to this number of cells."""
FEW = {512: 50, 4096: 5}
"""Steps of OpenSees in the flying and the tumbling beam, which would take minutes."""
FINE = 10_000
"""With more cells OpenSees takes the first steps of the roll-up only, if it can."""
FINEST_IN_SPACE = 0.01
"""Shorter steps of the tumbling beam are run by ufl_beam only; they take less time than the longer
ones of the other programs; s."""
SWING = {"end": 1.2}
"""How far the ladders of the swing go: all programs get there, with every scheme."""

CONSERVING = ("EnergyMomentum", {})
DECAYING = ("decaying EnergyMomentum", {"alpha": 0.01, "beta": 0.01})
TRAPEZOIDAL = {"rho": "trapezoidal"}


def ours(*variants):
    for label, more in variants:
        yield "ufl_beam", label, more


def exudyn(cells, newton=NEWTON, said="", **more):
    for solver in ("sparse", "dense") if cells <= DENSE else ("sparse",):
        for one in newton:
            how = {"newton": one, "solver": solver}
            yield "exudyn", f"{one} Newton, {solver}{said}", how | more


IN_SPACE = (  # nodes of Exudyn and its integrator
    ("", {"node": "Euler parameters", "rho": 1.0}),
    (", trapezoidal", {"node": "Euler parameters", "rho": "trapezoidal"}),
    (", Lie group", {"node": "Lie group", "rho": 1.0}),
)


def opensees(*variants):
    for label, more in variants:
        yield "opensees", label, more


def floor():
    for elimination in ("banded", "fused"):
        yield "c", elimination, {"elimination": elimination}


def roll_up(cells, turns):
    yield from ours(("", {}))
    yield from exudyn(cells, newton=("full",))
    more = {"load_steps": 64} if cells > DENSE else {}  # it fails with 8
    first = {"steps": 4} if cells > FINE else {}
    yield from opensees(("64 load steps" if more else "", more | first))
    yield from floor()


def flying_beam(cells, dt):
    yield from ours(CONSERVING)
    yield from exudyn(cells)
    fewer = {"steps": FEW[cells]} if cells in FEW else {}
    yield from opensees(("Newmark", fewer))
    yield from floor()


def swing(cells, dt):
    yield from ours(CONSERVING, DECAYING)
    yield from exudyn(cells, said=", ρ∞ 0.6", rho=0.6)
    yield from opensees(("TRBDF2", {}))


def portal(cells, dt):
    yield from ours(CONSERVING)
    yield from exudyn(cells)
    yield from opensees(
        ("with shear", {"element": "shear"}), ("without shear", {"element": "euler"})
    )


def cantilever(cells, dt):
    yield from ours(("", {}))
    yield from exudyn(cells)
    yield from opensees(("", {}))
    yield from floor()


def tumbling_beam(cells, dt):
    yield from ours(CONSERVING)
    few = {"steps": FEW[cells]} if cells in FEW else {}
    for said, how in IN_SPACE:
        for newton in NEWTON if said == "" else ("modified",):
            fewer = few if newton == "full" else {}
            how_ = {"newton": newton, "solver": "sparse", **how, **fewer}
            yield "exudyn", f"{newton} Newton, sparse{said}", how_
    yield from opensees(("Newmark, constant inertia", few))
    if dt < 0.05:  # it diverges with longer steps
        fewer = {} if cells < DENSE else {"steps": FEW[512]}
        yield from opensees(("Newmark, masses on arms", {"arms": True, **fewer}))


TABLES = (  # problem, variants, arguments, and which of them --quick leaves out
    ("P1", roll_up, [{"cells": n, "turns": 0.5} for n in (8, 64, 512)], (512,)),
    ("P1", roll_up, [{"cells": 64, "turns": 1.0}], (64,)),
    ("P1", roll_up, [{"cells": 100_000, "turns": 0.5}], (100_000,)),
    ("P2", flying_beam, [{"cells": n, "dt": 0.01} for n in (8, 64, 512, 4096)], (4096,)),
    ("P2", flying_beam, [{"cells": n, "dt": 0.1} for n in (8, 64)], (8, 64)),
    ("P3", swing, [{"cells": n, "dt": 1e-3} for n in (8, 32, 128)], (32, 128)),
    ("P4", portal, [{"cells": n, "dt": 1e-3} for n in (12, 48)], ()),
    ("P5", cantilever, [{"cells": n, "dt": 1e-3} for n in (10_000, 100_000)], (100_000,)),
    ("P6", tumbling_beam, [{"cells": n, "dt": 0.01} for n in (8, 64, 512)], (512,)),
    ("P6", tumbling_beam, [{"cells": n, "dt": 0.05} for n in (8, 64)], (64,)),
)


def flying_ladder(cells, dt):
    yield from ours(CONSERVING)
    for newton in NEWTON:
        yield "exudyn", f"{newton} Newton", {"newton": newton, "solver": "sparse"}
    if cells <= 64 and dt >= 0.02:
        yield from opensees(("Newmark", {}))


def printed_ladder(cells, dt):
    """At large steps it errs less where rotary inertia is large, see docs/schemes.md."""
    yield from ours(("EnergyMomentumPrinted", {"scheme": "EnergyMomentumPrinted"}))


def swing_ladder(cells, dt):
    yield from ours(CONSERVING)
    for label, rho in (("trapezoidal", "trapezoidal"), ("ρ∞ 0.9", 0.9)):
        yield "exudyn", label, {"newton": "modified", "solver": "sparse", "rho": rho}
    yield from opensees(("Newmark", {"integrator": "newmark"}), ("TRBDF2", {}))


def portal_ladder(cells, dt):
    yield from ours(CONSERVING)
    for newton in NEWTON:
        yield "exudyn", f"{newton} Newton", {"newton": newton, "solver": "sparse"}
    yield from opensees(
        ("with shear", {"element": "shear"}), ("without shear", {"element": "euler"})
    )


def tumbling_ladder(cells, dt):
    yield from ours(CONSERVING)
    for said, how in IN_SPACE if dt > FINEST_IN_SPACE else ():
        yield (
            "exudyn", f"modified Newton{said}", {"newton": "modified", "solver": "sparse", **how}
        )  # fmt: skip


def arms_ladder(cells, dt):
    yield from opensees(("masses on arms", {"arms": True}))


def smooth(scheme, said="", **dials):
    """Cells of degree 2, which smooth elastic beams allow."""

    def ladder(cells, dt):
        yield from ours((f"{scheme}, degree 2{said}", {"scheme": scheme, "degree": 2, **dials}))

    return ladder


LADDERS = (  # problem, variants, what is common, cells for each step
    ("P2", flying_ladder, {}, {
        0.1: (8, 16, 32), 0.05: (16, 32, 64), 0.02: (32, 64, 128), 0.01: (64, 128, 256),
        0.005: (128, 256),
    }),
    ("P2", printed_ladder, {}, {0.1: (16, 32), 0.05: (32, 64), 0.02: (64,)}),
    ("P2", smooth("EnergyMomentumPrinted"), {}, {
        0.1: (4, 8), 0.05: (4, 8), 0.02: (8, 16), 0.01: (16, 32), 0.005: (32,), 0.0025: (32, 64),
    }),
    ("P3", swing_ladder, SWING, {
        5e-3: (8, 16, 32), 2.5e-3: (16, 32, 64), 1e-3: (32, 64, 128), 5e-4: (128,),
    }),
    ("P3", smooth("EnergyMomentum"), SWING, {
        1e-2: (4, 8), 5e-3: (4, 8), 2.5e-3: (8, 16), 1e-3: (16,), 5e-4: (16,),
    }),
    ("P4", portal_ladder, {}, {
        1e-2: (6, 12), 4e-3: (6, 12, 24), 2e-3: (6, 12, 24, 48), 1e-3: (24, 48, 96), 5e-4: (96,),
    }),
    ("P4", smooth("EnergyMomentum"), {}, {2e-2: (6,), 1e-2: (6,), 4e-3: (6, 12), 2e-3: (12,)}),
    ("P4", smooth("EnergyMomentum", ", lumped", lumped=True), {}, {
        2e-2: (6,), 1e-2: (6, 12), 4e-3: (6, 12), 2e-3: (12,),
    }),
    ("P6", tumbling_ladder, {}, {
        0.2: (8, 16), 0.1: (8, 16, 32), 0.05: (16, 32), 0.025: (32, 64), 0.0125: (64, 128),
        0.00625: (128, 256), 0.003125: (256,),
    }),
    ("P6", arms_ladder, {}, {0.02: (8, 16), 0.01: (16, 32)}),
)  # fmt: skip


def tables():
    """The cases of the tables."""
    for problem, variants, arguments, long in TABLES:
        for one in arguments:
            for program, label, more in variants(**one):
                yield Case(program, problem, label, one | more, "tables", one["cells"] in long)


def ladders():
    """The cases of the figure: cells and step refined together."""
    for problem, variants, more, steps in LADDERS:
        for dt, cells in steps.items():
            for n in cells:
                for program, label, how in variants(n, dt):
                    settings = {"cells": n, "dt": dt, **more, **how}
                    yield Case(program, problem, label, settings, "figure", n != cells[0])
