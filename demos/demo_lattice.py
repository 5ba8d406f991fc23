# %% [markdown]
# # Lattice: 200 000 cells, alone or under `mpirun`
#
# A wall of square bays, a hundred by a hundred, stands on clamped feet and is struck at its upper
# left corner.  The impact causes waves in the wall: fast waves stretch the members, and slow waves
# bend them.
#
# This demo shows
#
# * a large model: 20 000 beams, 10 000 joints, 600 000 unknowns, with exact rotations,
# * the same script on several processes: `mpirun -n 2 python3 demos/demo_lattice.py`,
# * a loop of your own over `Simulation.step_to`, with files written during the run,
# * the ledger, which closes for large models, too.
#
# Each process condenses the interior nodes of its members without communication.  The processes
# solve for the remaining unknowns at the joints, a twentieth of all, together.

# %%
# SPDX-License-Identifier: MIT
import argparse
import resource
import time
from collections import defaultdict
from pathlib import Path

from mpi4py import MPI

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Scene
#
# `--cells` is the approximate number of cells; the default is small if another script imports or
# runs this script, as in the tests.

# %%
parser = argparse.ArgumentParser()
parser.add_argument("--cells", type=int, default=200_000 if __name__ == "__main__" else 3_000)
options, _ = parser.parse_known_args()

steel = {"E": 210e9, "nu": 0.3, "rho": 7850.0}  # Pa, -, kg/m^3
tube = ub.Section.tube(d=0.2, t=0.01, **steel)  # m
bay, in_member = 3.0, 10  # m, cells of a member
bays = max(2, round(np.sqrt(options.cells / in_member / 2)))

begin = time.perf_counter()
beams, ends = [], defaultdict(list)


def member(a, b):
    """Add a beam between two nodes (column, row) of the lattice."""
    start, end = ((bay * i, bay * j) for i, j in (a, b))
    beam = ub.Beam(start, end, tube, cells=in_member, name=f"{a}-{b}")
    beams.append(beam)
    ends[a].append(beam.start)
    ends[b].append(beam.end)


for j in range(bays):
    for i in range(bays + 1):
        member((i, j), (i, j + 1))
    for i in range(bays):
        member((i, j + 1), (i + 1, j + 1))

# %% [markdown]
# Members are joined rigidly, except at every seventh joint, which is a hinge of all its members.

# %%
joints = [
    (ub.Rigid if (i + 3 * j) % 7 else ub.Revolute)(*places)
    for (i, j), places in ends.items()
    if len(places) > 1
]
corner = ends[0, bays][0]
duration = 10e-3  # s
wall = ub.Scene(
    beams=beams,
    joints=joints,
    supports=[ub.Clamped(ends[i, 0][0]) for i in range(bays + 1)],
    loads=[
        ub.PointLoad(
            corner,
            force=(300e3, -150e3),
            amplitude=ub.Table([0, duration / 2, duration], [0, 1, 0]),
        )  # N
    ],
)
simulation = ub.Simulation(wall, ub.EnergyMomentum())  # conserves energy exactly
built = time.perf_counter() - begin
ub.print_once(
    f"{len(wall.beams)} beams, {len(wall.joints)} joints, {len(simulation.numbering.cells)} cells, "
    f"{simulation.numbering.size} unknowns; built in {built:.1f} s"
)

# %% [markdown]
# ## Run
#
# The step resolves the duration of the load, but not the vibrations of single cells.  The run ends
# when sound in steel has travelled three quarters of the height of the wall.

# %%
sound = np.sqrt(steel["E"] / steel["rho"])  # 5172 m/s
end = max(0.75 * bays * bay / sound, 2 * duration)  # s
quarter = int(np.ceil(end / (duration / 2)))  # at least eight steps for the blow
steps = 4 * quarter
files = ub.VTKHDF(output / "lattice.hdf", every=quarter)

solution, seconds = simulation.solution, []
files.open(simulation)
simulation.keep()
for n in range(1, steps + 1):
    begin = time.perf_counter()
    simulation.step_to(n * end / steps)
    seconds.append(time.perf_counter() - begin)
    files.write(simulation)
    if n % quarter == 0:
        simulation.keep()
files.close()
simulation.close()

memory = MPI.COMM_WORLD.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
ub.print_once(f"{steps} steps of {1e3 * end / steps:.2f} ms, {simulation.iterations} iterations")
ub.print_once(f"{np.median(seconds):.2f} s a step on {MPI.COMM_WORLD.size} process(es)")
if MPI.COMM_WORLD.rank == 0:
    ub.print_once("largest memory:", *(f"{megabytes:.0f} MB" for megabytes in memory))
ub.print_once(solution.energy)

# %% [markdown]
# ## Pictures
#
# Each cell is coloured by its speed at four times.  Axial waves along the members form the front;
# behind the front the members bend.  Ahead of it nearly nothing moves.

# %%
speeds = [
    np.hypot(*v[solution.numbering.dofs[solution.numbering.cells, :2]].mean(axis=1).T)
    for v in solution.v[1:]
]
points = solution.numbering.points
at = points[solution.numbering.cells]
fastest = max(speed.max() for speed in speeds)


def draw(ax, t, speed):
    """Draw the speed of each cell."""
    lines = LineCollection(at, linewidths=60 / bays, cmap="YlGnBu")
    lines.set_array(speed)
    lines.set_norm(LogNorm(1e-3 * fastest, fastest, clip=True))
    ax.add_collection(lines)
    size = bays * bay
    ax.set(xlim=(0, size), ylim=(0, size), aspect="equal", xticks=(), yticks=())
    ax.set_title(f"{1e3 * t:.1f} ms")
    return lines


with ub.picture((7, 6)) as last:
    colors = draw(last.subplots(), solution.times[-1], speeds[-1])
    last.colorbar(colors, label="speed (m/s)", shrink=0.8)
last.savefig(output / "lattice_last.png")
with ub.picture((10, 9)) as waves:
    for ax, t, speed in zip(waves.subplots(2, 2).flat, solution.times[1:], speeds, strict=True):
        colors = draw(ax, t, speed)
    waves.colorbar(colors, ax=waves.axes, label="speed (m/s)", shrink=0.8)
waves.savefig(output / "lattice_waves.png")
ub.print_once("\npictures and data:", *sorted(str(p) for p in output.glob("lattice*")), sep="\n  ")

# %% [markdown]
# ## Verification
#
# The ledger closes to round-off, for any number of processes.  The front of the waves is not faster
# than sound in steel.  An implicit step moves all nodes, but the motion ahead of the front is
# negligible.

# %%
assert abs(solution.energy.worst) < 1e-9
distance = np.linalg.norm(at.mean(axis=1) - corner.point, axis=1)
for t, speed in zip(solution.times[1:], speeds, strict=True):
    ahead = distance > sound * (t + 4 * end / steps)
    if ahead.any():
        assert speed[ahead].max() < 0.01 * speed.max()
ub.print_once("the ledger closes, and nothing overtakes sound")

# %% [markdown]
# ## Try this
#
# * `mpirun -n 2 python3 demos/demo_lattice.py`: the same results, in less time,
# * `--cells 1000`: a wall of seven bays, in a few seconds,
# * `output/lattice.hdf` in ParaView: *Warp By Vector* with the displacement, coloured by `M`; then
#   *Rescale to data range over all timesteps*, since nothing moves at t = 0.
