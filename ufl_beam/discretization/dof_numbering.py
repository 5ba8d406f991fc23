# SPDX-License-Identifier: MIT
"""From a scene to vertices, cells and the numbering of degrees of freedom.

Every process holds the numbering of the whole scene, a few integers a cell, and meshes only its
own cells; so neither joints nor supports need communication, and files are written as if by one
process.
"""

from __future__ import annotations

from functools import cache, cached_property
from zlib import crc32

import numpy as np

from ufl_beam.arrays import Array, Index
from ufl_beam.discretization.beam_mesh import BeamMesh
from ufl_beam.errors import SceneError, require_kind
from ufl_beam.model.bodies import Anchor, Body, Member, Node, Place, node
from ufl_beam.model.connectors import Connector
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.plastic_hinges import place_of
from ufl_beam.model.scene import Scene
from ufl_beam.model.supports import COMPONENTS


class Grid(BeamMesh):
    """Vertices, cells and degrees of freedom of a scene.

    A node has three degrees of freedom (u, v, ψ); those that joints share are one.  They are
    numbered along the beams, the shared ones last: eliminating them in this order fills in nothing
    but the coupling of the joints.

    Attributes:
        dofs: Degrees of freedom of each node; shape (num_nodes, 3).
        dofs_of_bodies: Degrees of freedom of the rigid bodies; shape (num_bodies, 3).
        multipliers: Degrees of freedom that are the forces of connectors; shape (num_links,).
        size: Number of degrees of freedom.
    """

    def __init__(self, scene: Scene, mesh: Mesh | None = None) -> None:
        mesh = Mesh() if mesh is None else mesh
        require_kind(mesh, Mesh, "mesh")
        self.scene = scene
        places = [place_of(hinge) for hinge in scene.hinges]
        super().__init__(scene.beams, scene.attached, places, mesh, scene.size)
        self._number()

    def agrees(self, other: Grid) -> bool:
        """Return whether the degrees of freedom are those of another grid."""
        return (
            self.scene.beams == other.scene.beams
            and np.array_equal(self.points, other.points)
            and np.array_equal(self.dofs, other.dofs)
        )

    def checksum(self) -> int:
        """A number that tells points and numberings apart."""
        numbers = np.concatenate([self.dofs.ravel(), self.dofs_of_bodies.ravel(), self.multipliers])
        return crc32(numbers.astype("<i8").tobytes(), crc32(self.points.astype("<f8").tobytes()))

    def nodes_of(self, one: Member | Body) -> tuple[Array, Index]:
        """Points and degrees of freedom of the nodes of a beam or body; (n, 2), (n, 3); m."""
        if isinstance(one, Body):
            return np.array([one.center]), self.node(one.middle).reshape(1, 3)
        nodes = self._nodes_of(one)
        return self.points[nodes], self.dofs[nodes]

    def node(self, anchor: Anchor) -> Index:
        """Degrees of freedom of what an anchor that has a vertex, or a body, moves with; (3,)."""
        of = node(anchor)
        if not isinstance(of, Body):
            return np.asarray(self.dofs[self.vertex(of)])
        if of not in self.scene.rigid_bodies:
            raise SceneError(f"{anchor}: {of.name} is not in the scene")
        return np.asarray(self.dofs_of_bodies[self.scene.rigid_bodies.index(of)])

    @cached_property
    def rotations(self) -> Index:
        """Degrees of freedom that are rotations, those that joints share once."""
        return np.unique(np.r_[self.dofs[:, 2], self.dofs_of_bodies[:, 2]])

    @cached_property
    def dofs_of_links(self) -> Index:
        """Degrees of freedom of each connector: u, v, ψ of both nodes, force; (num_links, 7)."""
        links = self.scene.links
        nodes = np.array([(self.node(c.a), self.node(c.b)) for c in links]).reshape(-1, 2, 3)
        both = nodes.transpose(0, 2, 1).reshape(-1, 6)
        return np.column_stack([both, self.multipliers]).astype(np.int64)

    def place_of(self, number: int) -> Place:
        """The middle of a cell or, numbered after the cells, the place of a plastic hinge."""
        if number < len(self.cells):
            return self.middle(number)
        return place_of(self.scene.hinges[number - len(self.cells)])

    def hinge_at(self, place: Place) -> Connector | None:
        """The plastic hinge of zero length at a place, if there is one."""
        return next((h for h in self.scene.hinges if place in (h.a, h.b)), None)

    def describe(self, dof: int) -> str:
        """A degree of freedom in words: its component, beam and point."""
        if dof in self.multipliers:
            return f"what holds {self.scene.links[dof - self.multipliers[0]]}"
        if dof not in self.dofs:
            body, component = np.argwhere(self.dofs_of_bodies == dof)[0]
            return f"{COMPONENTS[component]} of {self.scene.rigid_bodies[body].name}"
        node, component = np.argwhere(self.dofs == dof)[0]
        x, y = self.points[node]
        beam = next(b for b in self.scene.beams if node in self._nodes_of(b))
        return f"{COMPONENTS[component]} of {beam.name} at ({x:g}, {y:g})"

    def worst(self, sizes: Array) -> dict[str, float]:
        """Largest degree of freedom of each beam, body and connector, in words; zeros left out."""
        dofs_of_beams = [self.nodes_of(beam)[1] for beam in self.scene.beams]
        groups = [*dofs_of_beams, *self.dofs_of_bodies, *self.multipliers.reshape(-1, 1)]
        worst = sorted({int(g.flat[np.argmax(sizes[g])]) for g in groups}, key=lambda d: -sizes[d])
        return {self.describe(dof): float(sizes[dof]) for dof in worst if sizes[dof]}

    def _number(self) -> None:
        nodes, rigid_bodies = len(self.points), self.scene.rigid_bodies
        row = {body: nodes + i for i, body in enumerate(rigid_bodies)}

        @cache
        def at(of: Node) -> int:
            return row[of] if isinstance(of, Body) else self.vertex(of)

        slots = np.arange(3 * (nodes + len(rigid_bodies)))
        shared = slots >= 3 * nodes
        for (one, component), (other, _) in self.scene.representatives.items():
            same = 3 * at(other) + component
            slots[3 * at(one) + component] = same
            shared[same] = True
        kept = slots == np.arange(len(slots))
        inner = self.nodes_of_cells[:, 2:]
        position = np.arange(nodes + len(rigid_bodies), dtype=np.float64)
        position[list(self._beyond.values())] = self.vertices_at_hinges
        position[inner] = position[self.cells[:, :1]] + self.mesh.nodes[1:-1]
        ordered = (3 * np.argsort(position)[:, None] + np.arange(3)).ravel()
        order = np.concatenate([ordered[(kept & of)[ordered]] for of in (~shared, shared)])
        number = np.empty(len(slots), dtype=np.int64)
        number[order] = np.arange(len(order))
        dofs = number[slots].reshape(-1, 3)
        self.dofs, self.dofs_of_bodies = dofs[:nodes], dofs[nodes:]
        # Forces come last: eliminating what they act on first leaves no zero on the diagonal.
        self.multipliers: Index = len(order) + np.arange(len(self.scene.links))
        self.size = len(order) + len(self.multipliers)
