"""The camera as shaders see it: everything relative to the mesh, so that float32 never holds a far coordinate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class View3D:
    """A pinhole camera relative to the mesh's origin.

    Parameters
    ----------
    eye : mm
    right, up, forward : unit, right-handed with forward away from the viewer
    tan_half : tangents of half the horizontal and vertical field of view
    near, far : mm along forward
    """

    eye: tuple[float, ...]
    right: tuple[float, ...]
    up: tuple[float, ...]
    forward: tuple[float, ...]
    tan_half: tuple[float, float]
    near: float
    far: float

    @property
    def clip(self) -> tuple[float, ...]:
        """The matrix from mm relative to the mesh to clip space, column by column."""
        rotation = np.array([self.right, self.up, self.forward])
        view = np.eye(4)
        view[:3, :3] = rotation
        view[:3, 3] = -rotation @ np.array(self.eye)
        near, far = self.near, self.far
        projection = np.zeros((4, 4))
        projection[0, 0] = 1 / self.tan_half[0]
        projection[1, 1] = 1 / self.tan_half[1]
        projection[2, 2] = (far + near) / (far - near)
        projection[2, 3] = -2 * far * near / (far - near)
        projection[3, 2] = 1
        return tuple(float(x) for x in (projection @ view).T.ravel())


def look_at(
    position: NDArray[np.float64],
    target: NDArray[np.float64],
    up: NDArray[np.float64],
    fov: float,
    size: tuple[int, int],
    reach: float,
) -> View3D:
    """Return the camera.

    Parameters
    ----------
    position, target : (3,) mm relative to the mesh
    up : (3,) any length
    fov : vertical, degrees
    size : picture, pixels
    reach : radius of a sphere about the mesh's origin that holds the mesh, mm
    """
    forward = target - position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right)
    true_up = np.cross(right, forward)
    tangent = math.tan(math.radians(fov) / 2)
    along = float(-position @ forward)
    far = max(along + reach, reach) * 1.01
    near = max(along - reach, far * 1e-4)
    return View3D(
        tuple(map(float, position)),
        tuple(map(float, right)),
        tuple(map(float, true_up)),
        tuple(map(float, forward)),
        (tangent * size[0] / size[1], tangent),
        near,
        far,
    )


def camera_position(
    view_size: tuple[int, int], tan_half: tuple[float, float], depth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the twin of lib/camera.glsl: camera-space points of a depth image.

    Parameters
    ----------
    depth : (h, w) mm along the view axis, top row first

    Returns
    -------
    (h, w, 3) mm: right, up, forward
    """
    width, height = view_size
    x = ((np.arange(width) + 0.5) / width * 2 - 1) * tan_half[0]
    y = (1 - (np.arange(height) + 0.5) / height * 2) * tan_half[1]
    rays = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1)
    return rays * depth[..., None]
