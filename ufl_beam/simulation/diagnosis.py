# SPDX-License-Identifier: MIT
"""Diagnosis of failed steps and open ledgers: forces, what gives way, round-off."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.partition import Share
from ufl_beam.errors import ConvergenceError, StepFailed
from ufl_beam.mechanics.time_schemes import Scheme
from ufl_beam.model.scene import Scene
from ufl_beam.parameter import Parameter
from ufl_beam.simulation.solution import Solution
from ufl_beam.simulation.step_equation import StepEquation
from ufl_beam.solvers.newton import Solver
from ufl_beam.solvers.null_vectors import SINGULAR, free_matrix, null_vector
from ufl_beam.terms.base import KINDS
from ufl_beam.terms.inelastic_beams import InelasticBeams
from ufl_beam.terms.links import Links
from ufl_beam.terms.supports import Supports

SHARE = 0.1
"""Part of the largest motion from which on a motion or a deformation is named."""

SOFT = 1e-3
"""Part of its elastic stiffness up to which a connector or a cell gives way."""

NEAR = 1e-3
"""Motion from the state before a step, of the size of the scene or a radian, that tells what yields
as the step begins."""

ROOM = 10.0
"""Largest imbalance of an exact ledger over the tolerance of the solver."""

NAMED = 3
"""Largest number of names in a list."""


class Failed(Protocol):
    """A simulation whose latest step has failed, as far as a diagnosis asks it."""

    scene: Scene
    grid: Grid
    share: Share
    t: float
    q: Array
    scheme: Scheme
    supports: Supports
    couplings: list[Links]
    inelastic: list[InelasticBeams]
    equation: StepEquation

    @property
    def parameter(self) -> Parameter:
        """Time, or the load factor of a path."""


class Softest(NamedTuple):
    """The motion that meets least resistance.

    Attributes:
        x: It, at all degrees of freedom; largest where one is a radian or the size of the scene.
        motions: Sizes of its parts, those of forces zero; (grid.size,).
        links: Sizes of the motions of connectors; (num_links,).
        cells: Sizes of the strains of cells, see :func:`_strains`; (num_cells,).
        yielding: Connectors, and cells, that have lost their stiffness in this motion.
    """

    x: Array
    motions: Array
    links: Array
    cells: Array
    yielding: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]


def no_equilibrium(
    simulation: Failed,
    newton: Solver,
    solution: Solution,
    failure: StepFailed,
    end: float,
    advice: str,
) -> ConvergenceError:
    """Describe why even the smallest step, to ``end``, failed; all processes call it together."""
    q1 = simulation.supports.in_plane(newton.iterate())
    dt, named = end - simulation.t, simulation.parameter
    forces = _forces_by_kind(simulation, newton, q1)
    sizes = ", ".join(f"{kind} {size:.1e} N" for kind, size in forces.items())
    where = f"at {named.at(simulation.t, '.9g')}"
    if dt != 0:
        where = f"after {named.at(simulation.t, '.9g')}, even with {named.over(dt)}"
    why = singularity(simulation, q1)
    said = f"{failure} ({sizes})" if sizes else str(failure)
    advice = advice or simulation.scheme.advice
    return ConvergenceError(
        f"no equilibrium {where}: {why}{'; ' if why else ''}{said}. {advice}", time=simulation.t,
        dt=dt, solution=solution, residuals=failure.residuals, forces=forces, reason=failure.reason,
    )  # fmt: skip


def open_ledger(solution: Solution, share: Share, newton: Solver) -> str:
    """Describe how far an exact ledger is open; empty if it closes as claimed."""
    energy, claimed = solution.energy, ROOM * newton.convergence.c.rtol
    if not energy.opened(claimed, 0.0):
        return ""
    # Errors of steps are independent: their squares add up.
    q = solution.q[:, share.dofs]
    steps = np.sqrt(np.sum(np.diff(q, axis=0) ** 2, axis=0))
    return energy.opened(claimed, newton.convergence.random_work(np.abs(q).max(axis=0), steps))


def _forces_by_kind(simulation: Failed, newton: Solver, q1: Array) -> dict[str, float]:
    """Sizes of the forces at the latest iterate; N."""
    forces = {kind: np.zeros(simulation.share.size) for kind in KINDS}
    for term in simulation.equation.terms:
        try:
            term.add_residual(q1, forces[term.kind])
        except Exception:
            forces[term.kind].fill(np.nan)  # it is why the step has failed
    sizes = {kind: newton.convergence.size(force) for kind, force in forces.items()}
    return {kind: size for kind, size in sizes.items() if size}


def singularity(simulation: Failed, q: Array) -> str:
    """Describe why the tangent of a failed step is singular, or nearly so; else empty.

    All processes call it together.  Where the latest tangent, at ``q`` in the axes of the plane,
    says nothing, Newton's method may have been sent far away by a tangent before it.  Then the one
    where it set out tells.
    """
    if said := _singularity_at(simulation, q):
        return said
    share, before = simulation.share, simulation.q
    way = np.abs(q - before)
    way[share.multipliers()] = 0.0
    turns = share.rotations()
    way[turns] *= simulation.scene.size
    far = share.largest(float(way.max(initial=0.0))) / simulation.scene.size
    if not 0 < far < np.inf:
        return ""
    near = before + min(1.0, NEAR / far) * (q - before)
    return _singularity_at(simulation, near) if simulation.equation.respond_at(near) else ""


def _singularity_at(simulation: Failed, q: Array) -> str:
    """Describe why the latest tangent, which is that at ``q``, is singular; empty if it is not."""
    K, free = free_matrix(simulation.share, simulation.equation.A, simulation.supports.dofs)
    if not len(free) or not np.isfinite(K.data).all():
        return ""
    try:
        size, vector = null_vector(K)
    except (np.linalg.LinAlgError, RuntimeError):
        return ""
    x = np.zeros(simulation.grid.size)
    x[free] = vector
    grid, scene = simulation.grid, simulation.scene
    motions: Array = np.abs(x)
    turns = np.zeros(grid.size, dtype=bool)
    turns[grid.rotations] = True
    motions[~turns] /= scene.size
    motions[grid.multipliers] = 0.0
    largest = float(motions.max())
    if not np.isfinite(largest):
        return ""
    if largest == 0.0:
        forces = np.abs(x[grid.multipliers])
        names = [str(scene.links[i]) for i in _named(forces / forces.max())]
        said = f"the tangent stiffness is singular: {_list(names)} hold the same motion twice"
        return said if size <= SINGULAR else ""
    x /= largest
    motions /= largest
    found = _softest(simulation, q, x, motions)
    mechanism = not (_deforms(found, 1) | _deforms(found, 0)) and any(
        part.any() for part in found.yielding
    )
    if size <= SINGULAR:
        return f"the tangent stiffness is singular: {_describe(simulation, found)}"
    return f"a mechanism has formed: {_describe(simulation, found)}" if mechanism else ""


def _softest(simulation: Failed, q: Array, x: Array, motions: Array) -> Softest:
    """Return the deformations of a motion, and the parts without stiffness in it."""
    grid, scene, share = simulation.grid, simulation.scene, simulation.share
    here, ε = x[share.dofs], 1e-6
    links, left = np.zeros(len(scene.links)), np.ones(len(scene.links))
    for one in simulation.couplings:
        try:
            change = (one.motion(q + ε * here) - one.motion(q - ε * here)) / (2 * ε)
        except StepFailed:
            continue  # a guide that ends has no motion there, which the failure of the step says
        links[one.numbers] = np.abs(change)
        left[one.numbers] = one.response.remaining()
    links /= np.where([link.turns for link in scene.links], 1.0, scene.size)
    strains, left_of_cells = _strains(grid, share.gather(q), x), np.ones(len(grid.cells))
    for inelastic in simulation.inelastic:
        cells, _ = inelastic.kept()
        left_of_cells[cells] = inelastic.points.remaining(strains[cells])
    if share.comm.size > 1:
        share.comm.Allreduce(MPI.IN_PLACE, links)
        share.comm.Allreduce(MPI.IN_PLACE, left, op=MPI.MIN)
        share.comm.Allreduce(MPI.IN_PLACE, left_of_cells, op=MPI.MIN)
    strains[:, :2] /= scene.size
    sizes = np.abs(strains).max(axis=1, initial=0.0)
    yielding = (left <= SOFT) & (links >= SHARE), (left_of_cells <= SOFT) & (sizes >= SHARE)
    return Softest(x, motions, links, sizes, yielding)


def _deforms(found: Softest, of: int) -> bool:
    """Return whether connectors (0) or cells (1) deform that have their stiffness."""
    sizes = (found.links, found.cells)[of]
    return bool((sizes[~found.yielding[of]] >= SHARE).any())


def _describe(simulation: Failed, found: Softest) -> str:
    """Words for a motion that meets no force."""
    grid, scene = simulation.grid, simulation.scene
    moving = np.where(found.motions >= 1 / 2, found.motions, 0.0)
    parts = [_component(words) for words in grid.worst(moving)]
    elastic = np.where(found.yielding[1], 0.0, found.cells)
    if elastic.max(initial=0.0) >= SHARE:
        return (
            f"the forces no longer resist a motion that is largest in {_list(parts)}, as at a "
            "limit load or a bifurcation"
        )
    said = f"{_list(parts)} {'is' if len(parts) == 1 else 'are'} held by nothing"
    ways = [str(scene.links[i]) for i in _named(np.where(found.yielding[0], found.links, 0.0))]
    ways += [_cell(grid, i) for i in _named(np.where(found.yielding[1], found.cells, 0.0))]
    if ways:
        give = "gives way" if len(ways) == 1 else "give way together"
        said += f"; {_list(ways)} {give} at no further force"
    return said


def _strains(grid: Grid, q: Array, x: Array) -> Array:
    """Strains of a small motion ``x``, times lengths of cells; (num_cells, 3); m, m, rad."""
    first, last = grid.cells[:, 0], grid.cells[:, 1]
    position, motion = grid.points + q[grid.dofs[:, :2]], x[grid.dofs]
    d = position[last] - position[first]
    across = np.column_stack([-d[:, 1], d[:, 0]])
    change = motion[last] - motion[first]
    ψ = (motion[first, 2] + motion[last, 2]) / 2
    apart = change[:, :2] - ψ[:, None] * across
    length = np.linalg.norm(d, axis=1)
    along, shear = (np.sum(apart * axis, axis=1) / length for axis in (d, across))
    return np.column_stack([along, shear, change[:, 2]])


def _named(sizes: Array) -> Index:
    """The largest of those that are large enough to be named."""
    order = np.argsort(-sizes, kind="stable")
    return order[sizes[order] >= SHARE]


def _component(words: str) -> str:
    """A degree of freedom as :meth:`Grid.describe` says it, with a noun."""
    component, _, place = words.partition(" of ")
    return f"the {'rotation' if component == 'psi' else f'displacement {component}'} of {place}"


def _cell(grid: Grid, number: int) -> str:
    """A cell in words: its beam and its middle."""
    beam = grid.scene.beams[grid.beam_of_cell[number]]
    x, y = grid.points[grid.cells[number]].mean(axis=0)
    return f"{beam.name} at ({x:g}, {y:g})"


def _list(names: list[str]) -> str:
    """Names in a sentence, the first ones of many."""
    names, more = names[:NAMED], len(names) - NAMED
    if more > 0:
        return f"{', '.join(names)} and {more} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
