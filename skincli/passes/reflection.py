"""Mirror reflection of the environment, damped where the surface is occluded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values, Vec2, Vec3
from skincli.graph.node import ONE, ZERO, Constant, Input, Output, Pass, Source
from skincli.passes.camera import camera_position

#: radiance beyond which a panorama's pixels are cut: its products with 64 EV stay within float32
MOST_RADIANCE = 1e12

#: share of the depth within which a neighbor counts as the same surface
SAME_SURFACE = 0.02


@dataclass(frozen=True)
class ReflectionValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    right, up, forward, tan_half, size : of the camera
    scale : factor of the environment's exposure; 0 where nothing is mirrored
    turn : rotation of the environment about +Y, in turns
    damping : 1 multiplies by the occlusion, 0 does not
    levels : mip levels of the environment
    """

    right: Vec3
    scale: float
    up: Vec3
    turn: float
    forward: Vec3
    damping: float
    tan_half: Vec2
    size: Vec2
    levels: int


class Reflection(Pass):
    """Environment x reflectance x reflection map x occlusion."""

    shader = "passes/reflection.frag"
    inputs = {
        "depth": Input(),
        "normal": Input(),
        "reflectance": Input(),
        "occlusion": Input(),
        "environment": Input(),
    }
    outputs = {"reflection": Output()}

    @property
    def _values(self) -> ReflectionValues:
        values = self.draws[0].values
        assert isinstance(values, ReflectionValues)
        return values

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """What mirrors nothing adds nothing."""
        return (
            (ZERO, "reflection is off, reflectance is 0, or there is no environment")
            if self._values.scale == 0
            else None
        )

    def ignores(self) -> Mapping[str, tuple[Constant, str]]:
        """Without damping the occlusion has no effect."""
        undamped = self._values.damping == 0
        return {"occlusion": (ONE, "the damping of reflections is off")} if undamped else {}


def pyramid(image: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the mip levels of a panorama, each the exact area average of the one before.

    Parameters
    ----------
    image : (h, w, c), finite; cut to +-MOST_RADIANCE

    Returns
    -------
    levels down to 1 x 1, sizes halved and rounded down as OpenGL has them
    """
    levels = [np.clip(np.asarray(image, float), -MOST_RADIANCE, MOST_RADIANCE)]
    while max(levels[-1].shape[:2]) > 1:
        level = levels[-1]
        for axis in (0, 1):
            level = _average(level, axis, max(level.shape[axis] // 2, 1))
        levels.append(level)
    return levels


def _average(image: NDArray[np.float64], axis: int, count: int) -> NDArray[np.float64]:
    """Resample an axis to `count` cells of equal width by exact area average."""
    moved = np.moveaxis(image, axis, 0)
    length = moved.shape[0]
    if length == count:
        return image
    total = np.concatenate([np.zeros_like(moved[:1]), np.cumsum(moved, axis=0)])
    edges = np.linspace(0, length, count + 1)
    low = np.minimum(edges.astype(int), length - 1)
    share = (edges - low).reshape(-1, *([1] * (moved.ndim - 1)))
    at = total[low] + share * moved[low]
    return np.moveaxis(np.diff(at, axis=0) * (count / length), 0, axis)


def _fetch(levels: Sequence[NDArray[np.float64]], at: NDArray[np.float64], level: NDArray[np.intp]) -> NDArray:
    """Bilinear reads of one level per pixel; rows of the levels are top first, `at` counts from the bottom."""
    found = np.zeros((*at.shape[:-1], 3))
    for number in np.unique(level):
        image = levels[number]
        height, width = image.shape[:2]
        here = level == number
        x = at[here] * [width, height] - 0.5
        i = np.floor(x).astype(int)
        f = x - i
        left, right = i[:, 0] % width, (i[:, 0] + 1) % width
        bottom = height - 1 - np.clip(i[:, 1], 0, height - 1)
        top = height - 1 - np.clip(i[:, 1] + 1, 0, height - 1)
        fx, fy = f[:, :1], f[:, 1:]
        low = image[bottom, left, :3] * (1 - fx) + image[bottom, right, :3] * fx
        high = image[top, left, :3] * (1 - fx) + image[top, right, :3] * fx
        found[here] = low * (1 - fy) + high * fy
    return found


def twin(
    values: ReflectionValues,
    depth: NDArray[np.float64],
    normal: NDArray[np.float64],
    reflectance: NDArray[np.float64],
    occlusion: NDArray[np.float64],
    levels: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the reflection.

    Parameters
    ----------
    depth, reflectance, occlusion : (h, w), top row first
    normal : (h, w, 4) unit, w = slot
    levels : the environment's mip levels as uploaded

    Returns
    -------
    (h, w, 3)
    """
    height, width = depth.shape
    axes = np.array([values.right, values.up, values.forward])
    from_eye = camera_position((width, height), values.tan_half, depth) @ axes  # type: ignore[arg-type]
    N = normal[..., :3]
    R = from_eye - 2 * np.sum(from_eye * N, axis=-1, keepdims=True) * N
    R /= np.maximum(np.linalg.norm(R, axis=-1, keepdims=True), 1e-6)
    horizontal = np.hypot(R[..., 0], R[..., 2])
    longitude = np.where(horizontal > 1e-7, np.arctan2(R[..., 0], -R[..., 2]), 0.0)
    u = (longitude / (2 * np.pi) + 0.5 + values.turn) % 1.0
    v = 0.5 + np.arctan2(R[..., 1], np.maximum(horizontal, 1e-7)) / np.pi

    def turned(rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.float64]:
        other, z = normal[rows][:, columns], depth[rows][:, columns]
        same = (other[..., 3] > 0) & (np.abs(z - depth) < SAME_SURFACE * depth)
        return np.where(same, np.linalg.norm(other[..., :3] - N, axis=-1), 0.0)

    rows, columns = np.arange(height), np.arange(width)
    right, left = (turned(rows, np.clip(columns + step, 0, width - 1)) for step in (1, -1))
    above, below = (turned(np.clip(rows - step, 0, height - 1), columns) for step in (1, -1))
    texels = 2 * np.maximum.reduce([right, left, above, below]) * levels[0].shape[1] / (2 * np.pi)
    level = np.clip(np.log2(np.maximum(texels, 1)), 0, values.levels - 1)
    whole = np.floor(level).astype(int)
    at = np.stack([u, v], axis=-1)
    share = (level - whole)[..., None]
    mirrored = _fetch(levels, at, whole) * (1 - share)
    mirrored += _fetch(levels, at, np.minimum(whole + 1, values.levels - 1)) * share
    visible = 1 + (occlusion - 1) * values.damping
    factor = values.scale * reflectance * visible * (normal[..., 3] > 0)
    return factor[..., None] * mirrored
