# SPDX-License-Identifier: MIT
"""Cost of inelastic material beside the same scene without, side by side in one run.

Run on an idle machine, one core::

    make bench

Pairs: the flying beam elastic and yielding in every cell (8, 512 and 4096 cells, the last also over
300 steps); a frame of 50 cells, one of which can hinge: without and closed, closed and opening; 100
cells with 200 fibres each beside resultants, and with 40 fibres of steel and concrete laws beside
ElastoPlastic.  Each pair alternates, the figures are iterations per step, and medians of
microseconds per Newton iteration and per step over the whole time loop; ratios are those of the
medians.  One JSON line per pair goes to ``benchmarks/results/bench_inelastic.jsonl``.
"""

import argparse
import statistics

from bench_step import time_loop
from records import keep, machine

import ufl_beam as ub
import ufl_beam.structures as st


def flying_beam(cells, **laws):
    section = ub.Section(EA=1e4, GA=1e4, EI=100.0, rhoA=1.0, rhoI=10.0, **laws)
    beam = ub.Beam((6, 0), (0, 8), section, cells=cells)
    load = ub.PointLoad(beam.start, force=(8, 0), moment=-80, amplitude=lambda t: float(t < 2.5))
    return ub.Scene([beam], loads=[load])


def frame(limit):
    """A steel portal of 50 cells under a blow; one cell can hinge, if there is a limit."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0)
    hinges = {1.0: ub.Softening(limit=limit, fracture_energy=2e3)} if limit else {}
    left = ub.Beam((0, 0), (0, 3), section, cells=15)
    roof = ub.Beam((0, 3), (4, 3), section, cells=20, hinges=hinges)
    right = ub.Beam((4, 3), (4, 0), section, cells=15)
    return ub.Scene(
        [left, roof, right],
        joints=[ub.Rigid(left.end, roof.start), ub.Rigid(roof.end, right.start)],
        supports=[ub.Clamped(left.start), ub.Clamped(right.end)],
        loads=[ub.PointLoad(left.end, force=(200e3, 0), amplitude=lambda t: float(t < 0.02))],
    )


def cantilever(**section):
    """A steel cantilever of 100 cells that is thrown far beyond its yield moment."""
    section = ub.Section.rectangle(b=0.1, h=0.2, E=210e9, nu=0.3, rho=7850.0, **section)
    beam = ub.Beam((0, 0), (3, 0), section, cells=100)
    load = ub.PointLoad(beam.end, force=(0, -200e3), amplitude=lambda t: float(t < 0.02))
    return ub.Scene([beam], supports=[ub.Clamped(beam.start)], loads=[load])


LAW = ub.ElastoPlastic(yield_limit=1.0, kinematic=10.0)
FIBRES = ub.Fibres(ub.ElastoPlastic(250e6, kinematic=2e9), number=200)
TENSION = ub.Softening(250e6, 5e6)
LAWS = {
    "MenegottoPinto": st.MenegottoPinto(250e6, 0.01),
    "KentPark": st.KentPark(250e6, residual=200e6, ultimate=0.05, tension=TENSION),
    "Mander": st.Mander(500e6, strain=0.005, tension=TENSION),
}
PAIRS = {  # name: (scene without, scene with, steps, dt)
    "8 cells, all yield": (flying_beam(8), flying_beam(8, bending=LAW), 500, 0.01),
    "512 cells, all yield": (flying_beam(512), flying_beam(512, bending=LAW), 60, 0.01),
    "4096 cells, all yield": (flying_beam(4096), flying_beam(4096, bending=LAW), 30, 0.01),
    "4096 cells, all yield, longer": (flying_beam(4096), flying_beam(4096, bending=LAW), 300, 0.01),
    "1 of 50 cells can hinge, stays closed": (frame(0), frame(1e9), 300, 1e-3),
    "1 of 50 cells can hinge, opens": (frame(1e9), frame(50e3), 300, 1e-3),
    "100 cells of 200 fibres beside resultants": (
        cantilever(bending=ub.ElastoPlastic(yield_limit=250e6 * 0.1 * 0.2**2 / 4, kinematic=1e5)),
        cantilever(fibres=FIBRES),
        100,
        1e-3,
    ),
    **{
        f"40 fibres of {name} beside bilinear": (
            cantilever(fibres=ub.Fibres(ub.ElastoPlastic(250e6, kinematic=2e9), number=40)),
            cantilever(fibres=ub.Fibres(law, number=40)),
            100 if name == "MenegottoPinto" else 20,  # later the beam breaks
            1e-3,
        )
        for name, law in LAWS.items()
    },
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=7, help="alternations of each pair")
    options = parser.parse_args()
    print(f"EnergyMomentum(), medians of {options.repeat} alternations; {machine()}")
    print(f"{'':44s} {'µs per':>10} {'without':>8} {'with':>9} {'ratio':>6}")
    for name, (*scenes, steps, dt) in PAIRS.items():
        for scene in scenes:
            time_loop(scene, 2, dt)  # compiles
        # Without the simulations: runs of few cells are slower beside a gigabyte of memory in use.
        loops = [
            [time_loop(scene, steps, dt)[:2] for scene in scenes] for _ in range(options.repeat)
        ]
        iterations = [whole_scene[1] / steps for whole_scene in loops[0]]
        ratio = iterations[1] / iterations[0]
        print(
            f"{name:44s} {'iterations':>10} {iterations[0]:8.2f} {iterations[1]:9.2f} {ratio:6.2f}"
        )
        case = {
            "case": name, "steps": steps, "dt": dt, "iterations_without": iterations[0],
            "iterations_with": iterations[1],
        }  # fmt: skip
        for unit in ("iteration", "step"):
            without, with_ = (
                statistics.median(
                    1e6 * seconds / (iterations if unit == "iteration" else steps)
                    for seconds, iterations in one
                )
                for one in zip(*loops, strict=True)
            )
            ratio = with_ / without
            case |= {
                f"us_per_{unit}_without": without, f"us_per_{unit}_with": with_,
                f"ratio_per_{unit}": ratio,
            }  # fmt: skip
            print(f"{name:44s} {unit:>10} {without:8.1f} {with_:9.1f} {ratio:6.2f}", flush=True)
        keep("bench_inelastic", case)


if __name__ == "__main__":
    main()
