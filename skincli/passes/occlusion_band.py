"""Screen-space ambient occlusion of one band, before its blur."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Samples, Values, Vec2, Vec3
from skincli.graph.node import Input, Output, Pass
from skincli.layers.hashing import hash_cell
from skincli.passes.camera import camera_position

#: samples and blur window of the two bands [Fecko2013, section 4.2.2]
HIGH_SAMPLES, HIGH_WINDOW = 16, 3
LOW_SAMPLES, LOW_WINDOW = 28, 15

#: share of the radius by which depths may differ without occluding
BIAS = 0.01


@dataclass(frozen=True)
class BandValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    tan_half, size : of the camera; size in pixels
    right, up, forward : unit vectors of the camera
    radius : mm
    bias : share of the radius
    count : samples in use
    hemisphere : 1 takes samples above the surface, 0 all around the point
    seed : of the angles
    samples : in the unit ball, or in its half with z > 0
    """

    tan_half: Vec2
    size: Vec2
    right: Vec3
    radius: float
    up: Vec3
    bias: float
    forward: Vec3
    count: int
    hemisphere: int
    seed: int
    samples: Samples


class OcclusionBand(Pass):
    """Open share of the samples (rgb) and coverage (a)."""

    shader = "passes/occlusion_band.frag"
    inputs = {"depth": Input(), "normal": Input()}
    outputs = {"occlusion": Output()}


def sample_set(count: int, hemisphere: bool) -> tuple[tuple[float, ...], ...]:
    """Return the static sample set: a spherical Fibonacci spiral whose radii spread evenly by volume.

    Parameters
    ----------
    count : number of samples
    hemisphere : whether z > 0 for all of them

    Returns
    -------
    (count, 4) in the unit ball, w = 0
    """
    golden = (math.sqrt(5) - 1) / 2
    samples = []
    for k in range(count):
        height = (k + 0.5) / count
        z = height if hemisphere else 2 * height - 1
        angle = 2 * math.pi * golden * k
        # A second golden sequence for the radii keeps them independent of the heights.
        radius = ((k * golden * golden + 0.5) % 1.0) ** (1 / 3)
        rim = math.sqrt(1 - z * z)
        samples.append((radius * rim * math.cos(angle), radius * rim * math.sin(angle), radius * z, 0.0))
    return tuple(samples)


def twin(values: BandValues, depth: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the open share and the coverage.

    Parameters
    ----------
    depth : (h, w) mm, 0 is background, top row first
    normal : (h, w, 4) unit, w = slot

    Returns
    -------
    (h, w, 4)
    """
    height, width = depth.shape
    size = np.array([width, height])
    tan_half = np.array(values.tan_half)
    P = camera_position((width, height), values.tan_half, depth)  # type: ignore[arg-type]
    axes = np.array([values.right, values.up, values.forward])
    n = normal[..., :3] @ axes.T
    columns, rows = np.meshgrid(np.arange(width), height - 1 - np.arange(height))
    cells = np.stack([columns, rows, np.zeros_like(rows)], axis=-1)
    angle = 2 * math.pi * hash_cell(cells, values.seed)[..., 0]
    cosine, sine = np.cos(angle), np.sin(angle)

    s = np.where(n[..., 2] >= 0, 1.0, -1.0)
    a = -1 / (s + n[..., 2])
    b = n[..., 0] * n[..., 1] * a
    tangent = np.stack([1 + s * n[..., 0] ** 2 * a, s * b, -s * n[..., 0]], axis=-1)
    bitangent = np.stack([b, s + n[..., 1] ** 2 * a, -n[..., 1]], axis=-1)

    bias = values.bias * values.radius + 2 * tan_half[1] * depth / height
    occluded = np.zeros_like(depth)
    for sample in values.samples[: values.count]:
        x = cosine * sample[0] - sine * sample[1]
        y = sine * sample[0] + cosine * sample[1]
        z = np.full_like(x, sample[2])
        if values.hemisphere:
            offset = x[..., None] * tangent + y[..., None] * bitangent + z[..., None] * n
        else:
            offset = np.stack([x, y, z], axis=-1)
        Q = P + values.radius * offset
        front = Q[..., 2] > 0
        safe = np.where(front, Q[..., 2], 1.0)[..., None]
        at = np.floor((Q[..., :2] / (safe * tan_half) * 0.5 + 0.5) * size)
        inside = front & np.all((at >= 0) & (at < size), axis=-1)
        at = np.where(inside[..., None], at, 0).astype(int)
        seen = np.where(inside, depth[height - 1 - at[..., 1], at[..., 0]], 0.0)
        gap = depth - seen
        blocks = (seen > 0) & (seen < Q[..., 2] - bias)
        share = np.clip(values.radius / np.maximum(gap, 1e-6), 0, 1)
        weight = np.where(gap <= values.radius, 1.0, share * share * (3 - 2 * share))
        occluded += np.where(blocks, weight, 0.0)
    covered = (depth > 0).astype(float)
    visible = (1 - occluded / max(values.count, 1)) * covered
    return np.stack([visible, visible, visible, covered], axis=-1)
