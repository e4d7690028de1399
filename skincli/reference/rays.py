"""Light on a surface by ray tracing: who sees which lamp, and how much arrives; what `passes` rasterize, told twice.

Ray-traced ambient occlusion is `skincli.mesh.bake.occlusion_at`. Points and normals are relative to the mesh's origin,
as its positions are; lights and cameras are in the scene's millimeters. Formulas are float64; only the hits of rays are
float32, see `RayScene`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.mesh.bake import LIFT, RAYS, RAYS_AT_ONCE, RayScene, _hemisphere
from skincli.mesh.model import Mesh
from skincli.scene.model import Camera, Environment, Light, SpotLight

Floats = NDArray[np.float64]

METER = 1000.0
"""mm. The intensity of point and spot is the irradiance they give at this distance."""


@dataclass(frozen=True)
class Panorama:
    """An environment that can be asked for its radiance.

    Parameters
    ----------
    image : (h, w, 3) float64, radiance, linear Rec.709, latitude by longitude, zenith first
    rotation : degrees, counter-clockwise from above; at 0 the middle of the picture is -Z and right of it +X
    """

    image: Floats
    rotation: float

    @classmethod
    def of(cls, environment: Environment) -> Panorama:
        """Return what a scene's environment shines, its exposure applied.

        Raises
        ------
        InputError, LimitError
            As `skincli.images.read_environment`.
        """
        image = images.read_environment(environment.image).astype(np.float64)
        return cls(image * 2.0**environment.exposure, environment.rotation)

    def radiance(self, directions: NDArray[np.floating]) -> Floats:
        """Return the radiance from (..., 3) directions of any length, (..., 3), by linear interpolation of texels."""
        x, y, z = np.moveaxis(np.asarray(directions, dtype=np.float64), -1, 0)
        height, width = self.image.shape[:2]
        u = np.arctan2(x, -z) / (2 * math.pi) + 0.5 + self.rotation / 360
        v = np.arctan2(np.hypot(x, z), y) / math.pi
        column, row = u * width - 0.5, np.clip(v * height - 0.5, 0, height - 1)
        left, top = np.floor(column).astype(int), np.floor(row).astype(int)
        right, bottom = left + 1, np.minimum(top + 1, height - 1)
        across, down = (column - left)[..., None], (row - top)[..., None]
        upper = self.image[top, left % width] * (1 - across) + self.image[top, right % width] * across
        lower = self.image[bottom, left % width] * (1 - across) + self.image[bottom, right % width] * across
        return upper * (1 - down) + lower * down


def spot_falloff(light: SpotLight, cosine: Floats) -> Floats:
    """Return the share of the full light, (...), at the cosine of an angle to the cone's axis.

    Between the cone's edge and where the full light begins it is the cubic x² (3 - 2 x) of the cosine.
    """
    half = math.radians(light.angle) / 2
    edge, full = math.cos(half), math.cos(half * (1 - light.blend))
    if full <= edge:
        return np.where(cosine >= edge, 1.0, 0.0)
    x = np.clip((cosine - edge) / (full - edge), 0.0, 1.0)
    return x * x * (3 - 2 * x)


def arriving(light: Light, points: Floats) -> tuple[Floats, Floats]:
    """Return the light that arrives at points which nothing shades.

    Parameters
    ----------
    points : (k, 3) mm, in the scene; none in the lamp itself

    Returns
    -------
    toward : (k, 3) mm, from the point to the lamp; unit where the light is directional
    irradiance : (k, 3) linear Rec.709, on a surface that faces the lamp
    """
    if light.type == "directional":
        direction = np.array(light.direction) / np.linalg.norm(light.direction)
        return np.broadcast_to(-direction, points.shape), np.broadcast_to(np.array(light.irradiance), points.shape)
    toward = np.array(light.position) - points
    distance = np.linalg.norm(toward, axis=1)
    share = (METER / distance) ** 2
    if light.type == "spot":
        axis = np.array(light.direction) / np.linalg.norm(light.direction)
        share = share * spot_falloff(light, -(toward @ axis) / distance)
    return toward, share[:, None] * np.array(light.intensity)


def visibility(
    mesh: Mesh, points: Floats, normals: Floats, lights: Sequence[Light], *, sides: Floats | None = None
) -> NDArray[np.bool_]:
    """Return which lamps can be seen from which points.

    Parameters
    ----------
    mesh : what blocks, from both sides
    points : (k, 3) mm relative to the mesh's origin, on the mesh or near it
    normals : (k, 3), unit
    lights : directional ones are infinitely far; a spot's cone does not count here
    sides : (k, 3), unit; the way off the surface, along which rays start a little ahead of the point; `normals` if None

    Returns
    -------
    (len(lights), k) bool; behind its own horizon a point is mostly hidden by the surface it lies on

    Raises
    ------
    DeviceError
        If the ray tracer is not installed.
    """
    return _visible(RayScene(mesh), mesh.origin, points, normals if sides is None else sides, lights)


def irradiance(
    mesh: Mesh,
    points: Floats,
    normals: Floats,
    lights: Sequence[Light] = (),
    *,
    ambient: Sequence[float] = (0.0, 0.0, 0.0),
    environment: Panorama | None = None,
    samples: int = RAYS,
    sides: Floats | None = None,
) -> Floats:
    """Return the irradiance at points of the surface, all light direct, shadows by ray tracing.

    Parameters
    ----------
    mesh, points, normals, lights, sides : see `visibility`
    ambient : (3,) radiance from all around, linear Rec.709
    environment : further radiance from all around
    samples : rays per point for ambient and environment, >= 1; without these two none are traced

    Returns
    -------
    (k, 3) float64, linear Rec.709, the same for the same arguments; exact but for the sampling of ambient and
    environment, which is cosine-weighted (see `occlusion_at`)

    Raises
    ------
    DeviceError
        If the ray tracer is not installed.
    ValueError
        If samples is below 1.
    """
    if samples < 1:
        raise ValueError(f"samples is {samples}; 1 or more is allowed")
    rays = RayScene(mesh)
    sides = normals if sides is None else sides
    total = np.zeros((len(points), 3))
    for light, seen in zip(lights, _visible(rays, mesh.origin, points, sides, lights), strict=True):
        toward, arrives = arriving(light, points + mesh.origin)
        cosine = np.einsum("ij,ij->i", toward, normals) / np.linalg.norm(toward, axis=1)
        total += arrives * (np.maximum(cosine, 0.0) * seen)[:, None]
    if environment is None and not any(ambient):
        return total
    starts = points + LIFT * rays.extent * sides
    seeds = np.arange(len(points))
    at_once = max(1, RAYS_AT_ONCE // samples)

    def chunk(first: int) -> Floats:
        part = slice(first, first + at_once)
        directions = _hemisphere(normals[part], seeds[part], samples)
        seen = ~rays.blocked(starts[part], directions.reshape(-1, 3), math.inf).reshape(-1, samples)
        radiance = np.array(ambient) + (0.0 if environment is None else environment.radiance(directions))
        return math.pi * np.mean(seen[..., None] * radiance, axis=1)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return total + np.concatenate([np.zeros((0, 3)), *pool.map(chunk, range(0, len(points), at_once))])


def coverage(mesh: Mesh, camera: Camera, size: tuple[int, int], samples: int = 4) -> Floats:
    """Return the share of each pixel that the mesh fills.

    Parameters
    ----------
    camera : in the scene
    size : width and height, pixels
    samples : per pixel along each axis, on a regular grid, >= 1

    Returns
    -------
    (h, w) float64 in [0, 1], top row first

    Raises
    ------
    DeviceError
        If the ray tracer is not installed.
    """
    rays = RayScene(mesh)
    eye = np.array(camera.position) - mesh.origin
    found = np.empty(size[::-1])
    for row, directions in zip(found, _view_rays(camera, size, samples), strict=True):
        hit = rays.blocked(eye[None], directions.reshape(-1, 3), math.inf)
        row[:] = hit.reshape(samples, size[0], samples).mean(axis=(0, 2))
    return found


def first_hits(mesh: Mesh, camera: Camera, size: tuple[int, int]) -> Floats:
    """Return what the middle of each pixel shows.

    Parameters
    ----------
    camera, size : see `coverage`

    Returns
    -------
    (h, w, 3) float64, mm relative to the mesh's origin, top row first; infinite where nothing is hit

    Raises
    ------
    DeviceError
        If the ray tracer is not installed.
    """
    rays = RayScene(mesh)
    eye = np.array(camera.position) - mesh.origin
    found = np.full((*size[::-1], 3), math.inf)
    for row, directions in zip(found, _view_rays(camera, size, 1), strict=True):
        along = directions[0] / np.linalg.norm(directions[0], axis=1, keepdims=True)
        distance = rays.distance(eye, along)
        hit = np.isfinite(distance)
        row[hit] = eye + distance[hit, None] * along[hit]
    return found


def _view_rays(camera: Camera, size: tuple[int, int], samples: int) -> Iterator[Floats]:
    """Yield (samples, w * samples, 3) directions, not normalized, for each row of pixels from the top."""
    width, height = size
    forward = np.subtract(camera.target, camera.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    tangent = math.tan(math.radians(camera.fov) / 2)
    x = ((np.arange(width * samples) + 0.5) / (width * samples) * 2 - 1) * tangent * width / height
    y = (1 - (np.arange(height * samples) + 0.5) / (height * samples) * 2) * tangent
    for lines in y.reshape(height, samples):
        yield forward + x[None, :, None] * right + lines[:, None, None] * up


def _visible(
    rays: RayScene, origin: Floats, points: Floats, sides: Floats, lights: Sequence[Light]
) -> NDArray[np.bool_]:
    starts = points + LIFT * rays.extent * sides
    seen = np.ones((len(lights), len(points)), dtype=bool)
    for light, row in zip(lights, seen, strict=True):
        toward, _ = arriving(light, starts + origin)
        # Along the whole way to a lamp, as a direction of that length, 1 reaches it.
        row[:] = ~rays.blocked(starts, toward, math.inf if light.type == "directional" else 1.0)
    return seen
