# SPDX-License-Identifier: MIT
"""Camera of solid pictures and films: where it looks, and what it follows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.errors import SceneError, require_number, require_row
from ufl_beam.model.bodies import Anchor, require_anchors
from ufl_beam.model.records import Record
from ufl_beam.plotting.scene_layout import Pose

UP = np.array([0.0, 1.0, 0.0])  # upwards in the picture; the frame is in the plane of x and y

Direction = tuple[float, float, float]


def _require_direction(value: Any, what: str) -> Direction:
    direction = require_row(value, what)
    if direction.shape != (3,) or not np.cross(direction, UP).any():
        raise SceneError(
            f"{what} = {value} must be three numbers (x, y, z), and not along y, which is upwards "
            "in the picture; (0, 0, -1) is the front view"
        )
    x, y, z = map(float, direction)
    return x, y, z


def _require_place(value: Any, what: str) -> None:
    require_anchors(what, value)


@dataclass(frozen=True)
class Camera(Record):
    """Camera of :func:`render` and :func:`animate`, without perspective.

    By default it stands still and sees the whole motion.

    Attributes:
        direction: Direction in which it looks; (x, y, z).  The frame is in the plane of x and y; y
            is upwards in the picture, and (0, 0, -1) is the front view.
        follow: Place that the camera moves with: it stands still in the picture.
        width: Width of the picture around the followed place, or around the middle of the motion;
            m.  By default all that moves stays in the picture.

    Raises:
        SceneError: A direction along y, or a wrong argument; the message says which.

    Example:
        >>> front = ub.Camera((0, 0, -1))
        >>> ub.render(solution, "front.png", camera=front, size=(640, 360))
        >>> ub.render(solution, "tip.png", camera=ub.Camera(follow=beam.end, width=0.5))
    """

    direction: Annotated[Direction, _require_direction] = (-0.20, -0.28, -1.0)
    follow: Annotated[Anchor | None, _require_place] = None
    width: Annotated[float | None, partial(require_number, positive=True)] = None

    def origin(self, pose: Pose) -> Array:
        """Return the point of the plane that it moves with; (2,); m."""
        return np.zeros(2) if self.follow is None else pose.at(self.follow)

    def aim(self, plotter: Any, box: Array, origin: Array, size: tuple[int, int]) -> None:
        """Fit a box into the picture, above the colour bar and below the time.

        Args:
            plotter: Plotter of PyVista.
            box: Lower and upper corner, from the origin; (2, 3); m.
            origin: Point of the plane; (2,); m.
            size: Width and height of the picture; pixels.
        """
        towards = np.array(self.direction) / np.linalg.norm(self.direction)
        right = np.cross(towards, UP)
        right /= np.linalg.norm(right)
        up = np.cross(right, towards)
        middle, aspect = box.mean(axis=0), size[1] / size[0]
        if self.width is None:
            corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
            width, height = np.ptp(corners @ right), np.ptp(corners @ up)
            scale = max(height / 0.76, width / 0.96 * aspect) / 2
        else:
            scale = self.width * aspect / 2
            middle = middle if self.follow is None else np.zeros(3)
        focus = np.append(origin, 0.0) + middle - 0.08 * scale * up
        plotter.camera.parallel_projection = True
        plotter.camera.parallel_scale = scale
        plotter.camera.focal_point = focus
        plotter.camera.position = focus - 4 * np.linalg.norm(np.ptp(box, axis=0)) * towards
        plotter.camera.up = up
        plotter.camera_set = True
