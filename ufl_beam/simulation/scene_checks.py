# SPDX-License-Identifier: MIT
"""Checks of a scene and a scheme before anything is computed."""

from __future__ import annotations

from ufl_beam.discretization.dof_numbering import Grid
from ufl_beam.discretization.model_warnings import (
    warn_of_far_points,
    warn_of_free_hinges,
    warn_of_masses,
    warn_of_origin,
    warn_of_touching,
)
from ufl_beam.errors import SceneError, require_kind, shorten
from ufl_beam.mechanics.time_schemes import Scheme, has_inertia
from ufl_beam.model.constraint_checks import (
    require_independent,
    require_inertia,
    require_masses,
    require_no_mechanism,
    require_rates,
)
from ufl_beam.model.mesh_options import Mesh
from ufl_beam.model.scene import Scene


def checked_grid(scene: Scene, scheme: Scheme, mesh: Mesh) -> Grid:
    """Make the grid of a scene, once the scheme is known to be able to compute it."""
    require_kind(scene, Scene, "scene")
    if not isinstance(scheme, Scheme) or isinstance(scheme, type):
        raise SceneError(
            f"scheme = {shorten(scheme)} must be a scheme, such as Static() or Midpoint()"
        )
    if has_inertia(scheme):
        require_masses(scene)
        require_inertia(scene)
        warn_of_masses(scene)
        if scene.initial:
            warn_of_origin(scene)
        require_rates(scene, scheme)
    else:
        require_no_mechanism(scene)
    require_independent(scene)
    warn_of_far_points(scene)
    warn_of_free_hinges(scene)
    grid = Grid(scene, mesh)
    if has_inertia(scheme):
        warn_of_touching(grid)
    return grid
