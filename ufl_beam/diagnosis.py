"""Diagnosis of singular tangents: the motion that meets no force, and what gives way in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from ufl_beam.compat import Array
from ufl_beam.grid import Grid, Index

if TYPE_CHECKING:
    from ufl_beam.simulation import Simulation

DENSE = 300
"""Up to this number of unknowns the null vector comes from a singular value decomposition."""

SINGULAR = 1e-12
"""Smallest singular value of an equilibrated matrix, over its largest entry, that counts as zero."""

SHARE = 0.1
"""Part of the largest motion from which on a motion or a deformation is named."""

NAMED = 3
"""Largest number of names in a list."""


def singularity(simulation: Simulation, q: Array) -> str:
    """Describe why the latest tangent of a simulation is singular; empty if it is not.

    All processes call it together, after a step has failed.

    Args:
        simulation: Holds the tangent.
        q: The latest iterate at the local degrees of freedom, in the axes of the plane.
    """
    K, free = _free_matrix(simulation)
    if not len(free) or not np.isfinite(K.data).all():
        return ""
    try:
        size, vector = null_vector(K)
    except (np.linalg.LinAlgError, RuntimeError):
        return ""
    if not size <= SINGULAR:
        return ""
    x = np.zeros(simulation.grid.size)
    x[free] = vector
    return _describe(simulation, q, x)


def _free_matrix(simulation: Simulation) -> tuple[csc_array, Index]:
    """The tangent of the whole scene at what supports leave free; and these degrees of freedom."""
    share, A, held = simulation.share, simulation.tangent, simulation.supports.dofs
    here = (share.dofs[A.rows()], share.dofs[A.indices], A.data, share.dofs[held])
    parts = share.comm.allgather(here) if share.comm.size > 1 else [here]
    rows, columns, data, of_all = (np.concatenate(x) for x in zip(*parts, strict=True))
    n = share.grid.size
    free = np.setdiff1d(np.arange(n), of_all)
    K = coo_array((data, (rows, columns)), shape=(n, n)).tocsc()
    return csc_array(K[:, free][free]), free


def null_vector(K: csc_array) -> tuple[float, Array]:
    """The vector that a matrix makes least of, when its rows and columns are scaled to size one.

    Returns:
        How much it makes of it, without dimension; and the vector, in the units of the unknowns.
    """
    scaled, factors = _equilibrated(K)
    n = scaled.shape[0]
    if n <= DENSE:
        _, sizes, vectors = np.linalg.svd(scaled.toarray())
        return float(sizes[-1]), factors * vectors[-1]
    # A shift far below the entries makes the factors those of a regular matrix.
    shifted = splu(csc_array(scaled + SINGULAR * eye_array(n)))
    y: Array = np.random.default_rng(0).normal(size=n)
    for _ in range(20):
        y = shifted.solve(shifted.solve(y / np.linalg.norm(y), trans="T"))
    y /= np.linalg.norm(y)
    return float(np.linalg.norm(scaled @ y)), factors * y


def _equilibrated(K: csc_array) -> tuple[csc_array, Array]:
    """A matrix whose rows and columns have largest entries of about one; factors of the columns."""
    n = K.shape[0]
    columns = np.ones(n)
    for _ in range(10):
        sizes = abs(K)
        by_row, by_column = (np.asarray(sizes.max(axis=k).todense()).ravel() for k in (1, 0))
        r, c = (1 / np.sqrt(np.where(x > 0, x, 1.0)) for x in (by_row, by_column))
        K = csc_array(diags_array(r) @ K @ diags_array(c))
        columns *= c
    return K, columns


def _describe(simulation: Simulation, q: Array, x: Array) -> str:
    """Words for a motion ``x`` of all degrees of freedom that meets no force."""
    grid, scene = simulation.grid, simulation.scene
    motions = np.abs(x)
    turns = np.zeros(grid.size, dtype=bool)
    turns[grid.dofs[:, 2]] = True
    turns[grid.dofs_of_bodies[:, 2]] = True
    motions[~turns] /= scene.size
    motions[grid.multipliers] = 0.0
    largest = float(motions.max())
    beginning = "the tangent stiffness is singular: "
    if largest == 0.0:
        forces = np.abs(x[grid.multipliers])
        which = np.flatnonzero(forces >= SHARE * forces.max())
        names = [str(scene.links[i]) for i in which]
        return f"{beginning}{_list(names)} hold the same motion more than once"
    x = x / largest
    moving = np.where(motions >= largest / 2, motions, 0.0)
    parts = [_component(words) for words in grid.worst(moving)]
    share = simulation.share
    here = x[share.dofs]
    links, ε = np.zeros(len(scene.links)), 1e-6
    for coupling in simulation.couplings:
        change = coupling.motion(q + ε * here) - coupling.motion(q - ε * here)
        links[coupling.numbers] = np.abs(change) / (2 * ε)
    links /= np.where([link.turns for link in scene.links], 1.0, scene.size)
    if share.comm.size > 1:
        share.comm.Allreduce(MPI.IN_PLACE, links)
    cells = _deformation(grid, share.gather(q), x)
    inelastic = np.zeros(len(grid.cells), dtype=bool)
    for numbers, _ in simulation.material():
        inelastic[numbers] = True
    ways = [str(scene.links[i]) for i in _named(links)]
    ways += [_cell(grid, i) for i in _named(np.where(inelastic, cells, 0.0))]
    if np.where(inelastic, 0.0, cells).max(initial=0.0) >= SHARE:
        return (
            f"{beginning}the forces no longer resist a motion that is largest in {_list(parts)}, "
            "as at a limit load or a bifurcation"
        )
    said = f"{beginning}{_list(parts)} {'is' if len(parts) == 1 else 'are'} held by nothing"
    if ways:
        together = "gives way" if len(ways) == 1 else "give way together"
        said += f"; {_list(ways)} {together} at no further force"
    return said


def _deformation(grid: Grid, q: Array, x: Array) -> Array:
    """Sizes of the strains times the lengths of the cells that a small motion ``x`` makes.

    Elongations and shear count as parts of the size of the scene, bending as a rotation.
    """
    first, last = grid.cells[:, 0], grid.cells[:, 1]
    position = grid.points + q[grid.dofs[:, :2]]
    motion = x[grid.dofs]
    d = position[last] - position[first]
    ψ = (motion[first, 2] + motion[last, 2]) / 2
    change = (motion[last] - motion[first])[:, :2] - ψ[:, None] * np.column_stack([-d[:, 1], d[:, 0]])
    bending = np.abs(motion[last, 2] - motion[first, 2])
    return np.maximum(np.linalg.norm(change, axis=1) / grid.scene.size, bending)


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
