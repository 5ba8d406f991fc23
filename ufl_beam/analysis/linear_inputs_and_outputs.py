# SPDX-License-Identifier: MIT
"""Inputs and outputs of linear models: unit forces and motions, and rows of measured quantities."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array, eye_array, vstack

from ufl_beam.analysis.linearization import Linearization
from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.cells_in_space import velocity_in_space
from ufl_beam.discretization.dof_numbering import turned, values_at
from ufl_beam.errors import ArgumentError, ArgumentTypeError, shorten
from ufl_beam.model.bodies import GROUND, AttachmentPoint, BodyPoint, Place, arm, node
from ufl_beam.model.connector_laws import Controller, Guide, PrescribedForce, PrescribedMotion
from ufl_beam.model.connectors import Connector
from ufl_beam.model.joints import Joint
from ufl_beam.model.loads import Load, RotatingFrame
from ufl_beam.model.scene import Scene, index_of
from ufl_beam.model.supports import COMPONENTS, Support
from ufl_beam.output.section_forces import ForcesAlongCells
from ufl_beam.output.state_rows import connector_indices, signs_on_second_place

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
        self._small, self._scene, self._factors = small, scene, factors
        self.force_names, self.prescribed_names = list[str](), list[str]()
        self._forces, self.in_cells = list[Array](), list[Array]()
        size, cells = small.numbering.size, len(small.numbering.cells)
        self._still = np.zeros((9, cells))
        columns: dict[str, list[Any]] = {"motions": [], "prescribed": [], "read": []}
        names, kinds = list[str](), list[bool]()
        for x, components in requested:
            before = len(self.force_names), len(self.prescribed_names)
            self._add(x, components, columns)
            names += [f"{name}" for name in self.force_names[before[0] :]]
            kinds += [False] * (len(self.force_names) - before[0])
            more = self.prescribed_names[before[1] :]
            names += [_accelerated(name) for name in more]
            kinds += [True] * len(more)
        self.names, motion = _unique(names), np.array(kinds, dtype=bool)
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
            csr_array(np.reshape(columns[name], (-1, size)).T) for name in columns
        )
        self.read = csr_array(read.T)
        self.number_of_motions = self.motions.shape[1]

    def _add(self, x: Any, components: Sequence[int], columns: dict[str, list[Any]]) -> None:
        scene, size, T = self._scene, self._small.numbering.size, self._small.tangent
        if isinstance(x, Load):
            before, before_in_cells = self._small.forces()
            self._factors[id(x)].change = 1.0
            after, in_cells = self._small.forces()
            self._factors[id(x)].change = 0.0
            self._enter_force(f"factor of {x} [1]", before - after, in_cells - before_in_cells)
        elif isinstance(x, Connector):
            row = int(self._small.numbering.multipliers[connector_indices(scene, x)[0]])
            if not isinstance(x.law, PrescribedMotion):
                force = np.zeros(size)
                force[row] = -T[row, row]  # λ resists the growth of the motion
                unit = "N m" if x.is_rotation else "N"
                self._enter_force(f"force of {x} [{unit}]", force, self._still)
                return
            columns["motions"].append(np.zeros(size))
            columns["prescribed"].append(np.eye(1, size, row)[0])
            columns["read"].append(T[[row]].toarray()[0])
            unit = "rad" if x.is_rotation else "m"
            self.prescribed_names.append(f"motion of {x} [{unit}]")
        else:
            for c in components:
                axis = self._small._axes[:, [self._small.numbering.node(x.place)[c]]].toarray()
                columns["motions"].append(axis[:, 0])
                columns["prescribed"].append(np.zeros(size))
                columns["read"].append(axis[:, 0])
                unit = "m" if c < x.displacements else "rad"
                self.prescribed_names.append(f"{x.names[c]} of {x} [{unit}]")

    def _enter_force(self, name: str, force: Array, in_cells: Array) -> None:
        self.force_names.append(name)
        self._forces.append(force)
        self.in_cells.append(in_cells)


def _accelerated(name: str) -> str:
    """Return the name of the acceleration of a motion, as in tables of :class:`History`."""
    motion, _, unit = name.removesuffix("]").rpartition(" [")
    first, _, rest = motion.partition(" ")
    return f"d2{first}/dt2 {rest} [{unit}/s2]"


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
        numbering, turns = self._small.numbering, self._small.turns
        rows = np.zeros((3, numbering.size))
        if isinstance(place, BodyPoint) and node(place) is GROUND:
            return csr_array(rows)
        if self._scene.in_space:
            if isinstance(place, BodyPoint):
                dofs = numbering.node(place)
            else:
                dofs = numbering.dofs[numbering.weights(place)[0]]
            each = (np.unique(dofs)[:, None] == np.arange(numbering.size)).astype(float)
            moved = velocity_in_space(numbering, place, each, np.array([turns] * len(each)))
            return csr_array(moved[:, :3].T @ each)
        if isinstance(place, BodyPoint):
            dofs = numbering.node(place)
            x, y = turned(arm(place), self._small.q[dofs[2:]])[0]
            rows[[0, 1, 2], dofs] = 1.0
            rows[[0, 1], dofs[2]] = -y, x
        else:
            nodes, weights = numbering.weights(place)
            for at, weight in zip(nodes, weights, strict=True):
                rows[[0, 1, 2], numbering.dofs[at]] += weight
        return csr_array(rows)

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
                between = _position(small, holder.b) - _position(small, holder.a)
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


def _position(small: Linearization, place: AttachmentPoint) -> Array:
    """Return the position of a place in the state; (2,); m."""
    if isinstance(place, BodyPoint) and node(place) is not GROUND:
        (moved,) = values_at(small.numbering, place, small.q[None])
        (offset,) = turned(arm(place), moved[2:])
        return np.asarray(place.point - np.array(arm(place)) + offset + moved[:2])
    (moved,) = values_at(small.numbering, place, small.q[None])
    return np.asarray(place.point + moved[:2])


def checked_outputs(scene: Scene, wanted: Sequence[Any]) -> list[tuple[str, Any, list[int]]]:
    """Return kinds, objects and indices of the components of outputs, or raise."""
    return [_checked_output(scene, x, f"linearize: outputs[{n}]") for n, x in enumerate(wanted)]


OBJECTS: Mapping[str, type] = {
    "section_forces_at": Place, "connector": Connector, "joint": Joint, "reaction": Support,
}  # fmt: skip
"""Classes of the objects of outputs other than motions."""


def _kinds(scene: Scene) -> Mapping[str, tuple[str, ...]]:
    return IN_SPACE if scene.in_space else KINDS


def _checked_output(scene: Scene, output: Any, what: str) -> tuple[str, Any, list[int]]:
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
        _require_known_force(x, rest, what)
    return kind, x, [names.index(rest[0])] if rest else [*range(len(names))]


def _require(what: str, check: Callable[..., object], *arguments: Any) -> None:
    """Let errors of a check begin with the name of an input or output."""
    try:
        check(*arguments)
    except ArgumentError as error:
        raise ArgumentError(f"{what}: {error}") from None


def _require_known_force(joint: Joint, rest: Sequence[str], what: str) -> None:
    """Raise unless the force of a joint on its second place is known."""
    _require(what, signs_on_second_place, joint)
    if any(isinstance(holder.law, Guide) for holder in joint.holders):
        raise ArgumentError(f"{what}: {joint}: the force of a guide is no output")
    if rest and rest[0] == "moment" and 2 in joint.shared:
        raise ArgumentError(f"{what}: {joint} shares its rotation; its moment is not known")
