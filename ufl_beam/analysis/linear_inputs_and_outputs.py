# SPDX-License-Identifier: MIT
"""Inputs and outputs of linear models: unit forces and motions, and rows of measured quantities."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array, vstack
from scipy.sparse.linalg import splu

from ufl_beam.analysis.linearization import Linearization
from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.cells_in_space import velocity_at
from ufl_beam.discretization.dof_numbering import turned
from ufl_beam.errors import ArgumentError, ArgumentTypeError, shorten
from ufl_beam.model.bodies import GROUND, AttachmentPoint, BodyPoint, Place, node
from ufl_beam.model.connector_laws import Controller, Guide, PrescribedForce, PrescribedMotion
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.loads import Load, RotatingFrame
from ufl_beam.model.scene import Scene, index_of
from ufl_beam.model.supports import COMPONENTS, Support
from ufl_beam.output.section_forces import ForcesAlongCells
from ufl_beam.output.state_rows import connector_indices, signs_on_second_place

NEGLIGIBLE = 1e-9  # fraction of a motion that constraints allow, below which they hold it
IMAGINARY = 1e-100  # imaginary change of a configuration; its square vanishes
SECTION_FORCES = ("N", "V", "M")
FORCE = ("x", "y", "moment")
MOTIONS = "displacement", "velocity", "acceleration"
KINDS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(MOTIONS, COMPONENTS),
    "section_forces_at": SECTION_FORCES,
    "connector": ("motion", "rate", "force"),
    "joint": FORCE,
    "reaction": FORCE,
}
"""Components of the results of methods of :class:`Solution` that may be outputs."""

IN_SPACE: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(MOTIONS, ("u", "v", "w")),
    "connector": KINDS["connector"],
    "reaction": ("x", "y", "z"),
}
"""The same in space."""


class Inputs:
    """Inputs of a linear model: unit forces f, and motions u with the acceleration as input.

    Attributes:
        names: Names of the inputs.
        order: Column of each input, if those of forces come before those of motions.
        forces: Unit forces and residuals of laws at all unknowns; sparse, (size, num_forces).
        condensed: Unit forces without residuals of force laws; sparse, (size, num_forces).
        in_cells: Forces of unit inputs on the ends of cells; (num_forces, 9, num_cells).
        motions: Unit motions of supports at all unknowns; sparse, (size, num_motions).
        prescribed: Unit motions of connectors in the rows of their constraints.
        read: Matrix that reads the motions from all unknowns; sparse, (num_motions, size).
        force_names, prescribed_names: Names of the forces, and of the motions.
    """

    def __init__(
        self,
        small: Linearization,
        scene: Scene,
        requested: Sequence[Any],
        factors: Mapping[int, Any],
    ) -> None:
        self._small, size = small, small.numbering.size
        self.force_names, self.prescribed_names = list[str](), list[str]()
        self._forces, self.in_cells = list[Array](), list[Array]()
        self._motions, self._all = list[tuple[Any, ...]](), list[tuple[str, bool]]()
        for x, components in requested:
            if isinstance(x, Load):
                self._add_load(x, factors[id(x)])
            elif isinstance(x, Connector):
                self._add_connector(x, int(connector_indices(scene, x)[0]))
            else:
                self._add_support(x, components)
        self.names = _unique([name for name, _ in self._all])
        motion = np.array([is_motion for _, is_motion in self._all])
        self.order: Index = np.where(
            motion, np.cumsum(motion) - 1 + np.sum(~motion), np.cumsum(~motion) - 1
        )
        self.forces = csr_array(np.reshape(self._forces, (-1, size)).T)
        T, laws = small.tangent, small._laws
        borne = self.forces[laws] / T.diagonal()[laws][:, None]
        self.condensed = csr_array(self.forces - T[:, laws] @ csr_array(borne)).tolil()
        self.condensed[laws] = 0.0
        self.condensed = csr_array(self.condensed)
        self.motions, self.prescribed, read = (
            csr_array(np.reshape(columns, (-1, size)).T)
            for columns in zip(*self._motions or [((),) * 3], strict=True)
        )
        self.read = csr_array(read.T)
        self.number_of_motions = self.motions.shape[1]

    def _add_load(self, load: Load, factor: Any) -> None:
        before, before_in_cells = self._small.forces()
        factor.change = 1.0
        after, in_cells = self._small.forces()
        factor.change = 0.0
        self._enter_force(f"factor of {load} [1]", before - after, in_cells - before_in_cells)

    def _add_connector(self, connector: Connector, index: int) -> None:
        small, still = self._small, np.zeros(self._small.numbering.size)
        T, row = small.tangent, int(small.numbering.multipliers[index])
        unit = np.eye(1, len(still), row)[0]
        if isinstance(connector.law, PrescribedMotion):
            name = f"motion of {connector} [{'rad' if connector.is_rotation else 'm'}]"
            self._enter_motion(name, still, unit, T[[row]].toarray()[0])
        else:  # λ resists the growth of the motion
            name = f"force of {connector} [{'N m' if connector.is_rotation else 'N'}]"
            in_cells = np.zeros((9, len(small.numbering.cells)))
            self._enter_force(name, -T[row, row] * unit, in_cells)

    def _add_support(self, support: Support, components: Sequence[int]) -> None:
        for c in components:
            dof = self._small.numbering.node(support.place)[c]
            axis = self._small._axes[:, [dof]].toarray()[:, 0]
            unit = "m" if c < support.displacements else "rad"
            name = f"{support.names[c]} of {support} [{unit}]"
            self._enter_motion(name, axis, np.zeros(len(axis)), axis)

    def _enter_force(self, name: str, force: Array, in_cells: Array) -> None:
        self.force_names.append(name)
        self._all.append((name, False))
        self._forces.append(force)
        self.in_cells.append(in_cells)

    def _enter_motion(self, name: str, motion: Array, prescribed: Array, read: Array) -> None:
        self.prescribed_names.append(name)
        words, _, unit = name.removesuffix("]").rpartition(" [")
        first, _, rest = words.partition(" ")
        self._all.append((f"d2{first}/dt2 {rest} [{unit}/s2]", True))  # as in tables of History
        self._motions.append((motion, prescribed, read))


def checked_inputs(scene: Scene, requested: Sequence[Any]) -> list[tuple[Any, list[int]]]:
    """Return the objects of inputs, with the components of supports, or raise."""
    checked = list[tuple[Any, list[int]]]()
    for n, item in enumerate(requested):
        what = f"linearize: inputs[{n}]"
        x, component = item if isinstance(item, tuple) and len(item) == 2 else (item, None)
        if component is not None and not isinstance(x, Support):
            raise ArgumentTypeError(
                f"{what} = {shorten(item)} is a pair, which is for supports; give the object"
            )
        components = list[int]()
        if isinstance(x, Load):
            index_of(scene.loads, x, f"{what}: ")
            if isinstance(x, RotatingFrame):
                raise ArgumentError(f"{what}: forces of a RotatingFrame have no factor")
        elif isinstance(x, Connector):
            _require(what, connector_indices, scene, x)
            if not isinstance(x.law, PrescribedForce | Controller | PrescribedMotion):
                raise ArgumentError(
                    f"{what}: {x} has the law {type(x.law).__name__}; an input has a "
                    "PrescribedForce, a Controller or a PrescribedMotion"
                )
        elif isinstance(x, Support):
            index_of(scene.supports, x, f"{what}: ")
            known = {name: c for c, name in enumerate(x.names) if not name.startswith("rotation")}
            if x.displacements == 3 and x.axis is None:
                del known["psi"]
            if component is not None and component not in [*known]:
                *most, last = map(repr, known)
                raise ArgumentError(
                    f"{what}: component {shorten(component)} must be {', '.join(most)} or {last}"
                )
            held = [c for c in known.values() if c in x.held]
            components = held if component is None else [known[component]]
            for c in components:
                if c not in x.held:
                    raise ArgumentError(
                        f"{what}: {x} does not hold {component}, so that it cannot move it; "
                        "give a PrescribedDisplacement, or a load as an input"
                    )
        else:
            raise ArgumentTypeError(
                f"{what} = {shorten(item)} must be a load, connector or support of the scene, or "
                "(support, component)"
            )
        for y, others in checked:
            if x is y and (not components or {*components} & {*others}):
                raise ArgumentError(f"{what}: {x} occurs twice")
        checked.append((x, components))
    return checked


def _unique(names: Sequence[str]) -> list[str]:
    """Number equal names, such as those of two springs between the same places."""
    return [
        f"{name} ({names[:i].count(name) + 1})" if name in names[:i] else name
        for i, name in enumerate(names)
    ]


class Outputs:
    """Outputs of a linear model: rows for the unknowns, their rates and accelerations.

    Attributes:
        names: Names of the outputs.
        rows: Rows for x, x' and x''; sparse, (num_outputs, size) each.
        direct: Effect of unit forces; (num_outputs, num_forces).
        motions: Rows of the motions of places and connectors, by which :func:`require_free` tests
            whether they can change; sparse, (number, size).
        motion_names: Their names.
    """

    def __init__(
        self, small: Linearization, scene: Scene, wanted: Sequence[Any], inputs: Inputs
    ) -> None:
        self._small, self._scene, self._inputs = small, scene, inputs
        self.names, self.motion_names = list[str](), list[str]()
        self._rows: list[list[Any]] = [[], [], []]
        self._direct, self._motions = list[Array](), list[Any]()
        size = small.numbering.size
        self._none = csr_array((1, size))
        self._identity = eye_array(size, format="csr")
        for kind, x, components in wanted:
            getattr(self, f"_add_{kind}")(x, components, kind)
        self.names = _unique(self.names)
        self.rows = tuple(csr_array(vstack(rows)) for rows in self._rows)
        self.direct = np.array(self._direct).reshape(len(self.names), -1)
        self.motions = csr_array(vstack([csr_array((0, size)), *self._motions]))

    def _enter(
        self, name: str, rows: Sequence[Any], direct: Array | None = None, motion: Any = None
    ) -> None:
        """Add an output with rows for x, x', x''; force laws replace forces in the first one."""
        small, inputs = self._small, self._inputs
        x, rate, acceleration = (self._none if row is None else csr_array(row) for row in rows)
        direct = np.zeros(inputs.forces.shape[1]) if direct is None else direct
        laws = small._laws
        if len(laws) and (on_laws := x[:, laws]).nnz:
            # Row of a law: T x + C x' = f, with T diagonal for the forces of laws
            T, C = small.tangent, small.damping
            factors = csr_array(on_laws / T.diagonal()[laws])
            direct = direct + (factors @ inputs.forces[laws]).toarray()[0]
            x, rate = x - factors @ T[laws], rate - factors @ C[laws]
            x = x.tolil()
            x[:, laws] = 0.0
        self.names.append(name)
        for rows_of_kind, row in zip(self._rows, (x, rate, acceleration), strict=True):
            rows_of_kind.append(csr_array(row))
        self._direct.append(np.asarray(direct))
        if motion is not None:
            self._motions.append(csr_array(motion))
            self.motion_names.append(name)

    # -- motions -------------------------------------------------------------------------------

    def _place_rows(self, place: AttachmentPoint) -> csr_array:
        """Return rows of (u, v, ψ) of a place, in space of (u, v, w); (3, size)."""
        small, numbering = self._small, self._small.numbering
        if isinstance(place, Place):
            dofs = numbering.dofs[numbering.weights(place)[0]]
        elif node(place) is GROUND:
            return csr_array((3, numbering.size))
        else:
            dofs = numbering.node(place)
        each = (np.unique(dofs)[:, None] == np.arange(numbering.size)).astype(float)
        state = small.turns if self._scene.in_space else small.q
        moved = velocity_at(numbering, place, each, state[None])
        return csr_array(moved[:, :3].T @ each)

    def _add_motion(self, x: Any, components: Sequence[int], kind: str) -> None:
        order = ("displacement", "velocity", "acceleration").index(kind)
        before, after = (("", ""), ("d", "/dt"), ("d2", "/dt2"))[order]
        per = ("", "/s", "/s2")[order]
        rows = self._place_rows(x)
        for c in components:
            row, unit = rows[[c]], "m" if c < self._small.numbering.displacements else "rad"
            name = f"{before}{_kinds(self._scene)[kind][c]}{after} {x} [{unit}{per}]"
            self._enter(name, [row if k == order else None for k in range(3)], motion=row)

    _add_displacement = _add_velocity = _add_acceleration = _add_motion

    # -- forces --------------------------------------------------------------------------------

    def _add_connector(self, x: Any, components: Sequence[int], kind: str) -> None:
        numbering, T = self._small.numbering, self._small.tangent
        for index in connector_indices(self._scene, x):
            connector, λ = self._scene.all_connectors[index], int(numbering.multipliers[index])
            column = T[:, [λ]].toarray()[:, 0]
            column[numbering.multipliers] = 0.0
            motion, force = csr_array(column[None]), self._identity[[λ]]
            length, unit = ("rad", "N m") if connector.is_rotation else ("m", "N")
            for c in components:
                name = KINDS["connector"][c]
                law, units = type(connector.law).__name__, (length, f"{length}/s", unit)
                title = f"{name} {connector}, {law} [{units[c]}]"
                rows = ([motion, None, None], [None, motion, None], [force, None, None])[c]
                self._enter(title, rows, motion=None if c == 2 else motion)

    def _add_joint(self, x: Any, components: Sequence[int], kind: str) -> None:
        """Add the force of a joint on its second place, see :meth:`States.joint`."""
        small, numbering = self._small, self._small.numbering
        indices, signs = connector_indices(self._scene, x), signs_on_second_place(x)
        rows = np.zeros((3, numbering.size))
        for k, sign in signs.items():
            holder, λ = x.holders[k], int(numbering.multipliers[indices[k]])
            if holder.is_rotation:
                rows[2, λ] -= sign
                continue
            T = small.tangent[:, [λ]].toarray()[:, 0]
            # Direction in which b moves if the motion grows, and its change with the configuration
            if holder.stretches:
                position = small._simulation.now.position
                between = position(holder.b)[0] - position(holder.a)[0]
                length = float(np.linalg.norm(between))
                d = between / length
                at = self._place_rows(holder.b) - self._place_rows(holder.a)
                change = (np.eye(2) - np.outer(d, d)) @ at.toarray()[:2] / length
            else:
                by_a = self._place_rows(holder.a).toarray()[2] if holder.follows_a else 0 * T
                angle = np.array([by_a @ small.q])
                d = turned(holder.axis, angle)[0]
                change = np.outer([-d[1], d[0]], by_a)
            rows[:2] -= sign * small.q[λ] * change
            rows[:2, λ] -= sign * d
        for c in components:
            resists_rotation = any(x.holders[k].is_rotation for k in signs)
            if c == 2 and not resists_rotation and len(components) > 1:
                continue  # the moment is zero, or with a shared rotation not known
            self._enter(f"{FORCE[c]} {x} [{('N', 'N', 'N m')[c]}]", [rows[[c]], None, None])

    def _add_reaction(self, x: Any, components: Sequence[int], kind: str) -> None:
        small, dofs = self._small, self._small.numbering.node(x.place)[:3]  # in space forces only
        held = [c for c in x.held if c < 3]
        matrices = small.condensed_tangent, small.condensed_damping, small.masses
        axes = small._axes[dofs][:, dofs].toarray()
        holds = np.zeros((3, 3))
        holds[held, held] = 1.0
        to = csr_array(axes @ holds @ axes.T)
        rows = [to @ csr_array(matrix)[dofs] for matrix in matrices]
        direct = -(to @ self._inputs.condensed[dofs]).toarray()
        names = _kinds(self._scene)[kind]
        for c in components:
            name = f"{names[c]} {x} [{'N m' if names[c] == 'moment' else 'N'}]"
            self._enter(name, [row[[c]] for row in rows], direct[c])

    # -- section forces ------------------------------------------------------------------------

    def _add_section_forces_at(self, x: Any, components: Sequence[int], kind: str) -> None:
        """Add section forces in equilibrium with inertia, damping and loads of the cell."""
        small, inputs = self._small, self._inputs
        cell, fraction = small.numbering.cell_and_fraction(x)
        along = ForcesAlongCells(small.numbering)
        dofs = along.dofs[cell]
        q = small.q[dofs]

        def forces(resultants: Array, q: Any) -> Any:
            at = np.array([fraction])
            return along(np.array([cell]), at, resultants[:, [cell]], q[None])[0, 0]

        unique, matrices = np.unique(dofs), np.zeros((3, 3, small.numbering.size))
        _, base = small.forces()
        for dof in unique:
            turned_q = q + IMAGINARY * 1j * (dofs == dof)
            by_axes = np.imag(forces(base, turned_q)) / IMAGINARY
            for k, resultants in enumerate(small.changes_of_cells(int(dof))):
                matrices[k, :, dof] = forces(resultants, q)
            matrices[0, :, dof] += by_axes
        direct = np.array([forces(change, q) for change in inputs.in_cells]).reshape(-1, 3).T
        for c in components:
            name = f"{SECTION_FORCES[c]} {x} [{('N', 'N', 'N m')[c]}]"
            self._enter(name, [matrix[[c]] for matrix in matrices], direct[c])


OBJECTS: Mapping[str, type] = {
    "section_forces_at": Place, "connector": Connector, "joint": Joint, "reaction": Support,
}  # fmt: skip
"""Classes of the objects of outputs other than motions."""


def _kinds(scene: Scene) -> Mapping[str, tuple[str, ...]]:
    return IN_SPACE if scene.in_space else KINDS


def checked_output(scene: Scene, output: Any, what: str) -> tuple[str, Any, list[int]]:
    """Return kind, object and indices of the components of an output, or raise."""
    kinds = _kinds(scene)
    if not isinstance(output, tuple) or len(output) not in (2, 3) or output[0] not in [*kinds]:
        raise ArgumentTypeError(
            f"{what} = {shorten(output)} must be a tuple such as ('displacement', place, 'v'), "
            f"which{' in space' * scene.in_space} begins with {', '.join(map(repr, kinds))}"
        )
    kind, x, *rest = output
    names = kinds[kind]
    if rest and rest[0] not in [*names]:
        raise ArgumentError(
            f"{what}: component {shorten(rest[0])} must be one of {', '.join(map(repr, names))}"
        )
    if not isinstance(x, OBJECTS.get(kind, Place | BodyPoint)):
        name = OBJECTS[kind].__name__ if kind in OBJECTS else "Place or BodyPoint, as beam.end"
        raise ArgumentTypeError(f"{what}: {shorten(x)} must be a {name}")
    if isinstance(x, Place | BodyPoint):
        part = x.beam if isinstance(x, Place) else x.body
        if part not in (*scene.beams, *scene.rigid_bodies):
            raise ArgumentError(f"{what}: {x} is not in the scene")
    elif isinstance(x, Support):
        index_of(scene.supports, x, f"{what}: ")
    elif isinstance(x, Connector | Joint):
        _require(what, connector_indices, scene, x)
    if isinstance(x, Joint):
        _require(what, signs_on_second_place, x)
        if any(isinstance(holder.law, Guide) for holder in x.holders):
            raise ArgumentError(f"{what}: {x}: the force of a guide is no output")
        if rest and rest[0] == "moment" and 2 in x.shared:
            raise ArgumentError(f"{what}: {x} shares its rotation; its moment is not known")
    return kind, x, [names.index(rest[0])] if rest else [*range(len(names))]


def _require(what: str, check: Callable[..., object], *arguments: Any) -> None:
    """Let errors of a check begin with the name of an input or output."""
    try:
        check(*arguments)
    except ArgumentError as error:
        raise ArgumentError(f"{what}: {error}") from None


def require_free(small: Linearization, inputs: Inputs, outputs: Outputs) -> None:
    """Raise if constraints hold an output, or the motions on which an input works.

    Prescribed motions that are inputs do not hold outputs.
    """
    forces, motions = inputs.condensed.toarray(), outputs.motions.T.toarray()
    moved = inputs.prescribed[small.left].tocsr()[np.flatnonzero(small._constraint_rows)]
    fixed = np.ones(moved.shape[0], dtype=bool) if not moved.nnz else abs(moved).sum(axis=1) == 0
    by_supports = abs(outputs.motions @ inputs.motions).sum(axis=1) > 0
    free = _allowed(small, motions, fixed) | by_supports
    for name in [x for x, able in zip(outputs.motion_names, free, strict=True) if not able][:1]:
        raise ArgumentError(
            f"linearize: outputs: {name}: supports or constraints hold this motion, so that it "
            "does not change; choose another place, or a component that can change"
        )
    works = _allowed(small, forces, fixed | True)
    for name in [x for x, able in zip(inputs.force_names, works, strict=True) if not able][:1]:
        raise ArgumentError(
            f"linearize: inputs: {name}: supports or constraints hold the motion on which it "
            "works, so that it moves nothing; choose another place or direction"
        )


def _allowed(
    small: Linearization, vectors: Array, chosen: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Return which columns, rows of motions or forces, the ``chosen`` constraints leave free.

    A column is free if its part in the motions that the constraints allow is not round-off.
    """
    y, μ = np.flatnonzero(~small._constraint_rows), np.flatnonzero(small._constraint_rows)[chosen]
    whole = np.linalg.norm(small.lengths[:, None] * vectors, axis=0)
    W = small.lengths[small.left[y], None] * (small._Z.T @ vectors)[y]
    if len(μ) and W.size:
        G = csr_array(small.K)[μ][:, y] @ diags_array(small.lengths[small.left[y]])
        G = diags_array(1 / np.sqrt((G * G).sum(axis=1))) @ G
        system = block_array([[eye_array(len(y)), G.T], [G, None]])
        W = splu(csc_array(system)).solve(np.vstack([W, np.zeros((len(μ), W.shape[1]))]))[: len(y)]
    return np.asarray(np.linalg.norm(W, axis=0) > NEGLIGIBLE * whole)
