"""Light that reaches the surface, in texture space: one additive pass per light."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Slots, Values, Vec3
from skincli.graph.node import Input, Output, Pass

AMBIENT, DIRECTIONAL, POINT, SPOT = range(4)

#: skins that one mesh may carry; their factors lie side by side in a uniform block
MAX_SLOTS = 64


@dataclass(frozen=True)
class LightValues(Values):
    """A light as the shaders see it; shared with the specular pass.

    Parameters
    ----------
    color : irradiance of a directional light; intensity (the irradiance at 1 m) of point and spot; ambient light
    kind : AMBIENT, DIRECTIONAL, POINT or SPOT
    position : mm relative to the mesh
    direction : unit, where the light travels
    outer, inner : what the cosines lack to 1 between which a spot fades out
    """

    color: Vec3
    kind: int
    position: Vec3 = (0.0, 0.0, 0.0)
    outer: float = 1.0
    direction: Vec3 = (0.0, 0.0, -1.0)
    inner: float = 0.0


def spot_cosines(angle: float, blend: float) -> tuple[float, float]:
    """Return 1 - cosine at the cone's edge and where the full light begins: a narrow cone's cosines are all but 1.

    Parameters
    ----------
    angle : full angle of the cone, degrees
    blend : share of the half angle over which the light fades, 0 to 1
    """
    half = math.radians(angle) / 2
    return 2 * math.sin(half / 2) ** 2, 2 * math.sin(half * (1 - blend) / 2) ** 2


@dataclass(frozen=True)
class IrradianceValues(LightValues):
    """A light, places along a texel's side where it is asked for, and per slot the skin's answer.

    Parameters
    ----------
    samples : 1 and more
    response : x ambient factor, y diffuse factor
    """

    samples: int = 1
    response: Slots = ()


class Irradiance(Pass):
    """Irradiance times the skin's factors (rgb) and coverage (a); float32, so that many lights add up exactly."""

    shader = "passes/irradiance.frag"
    additive = True
    inputs = {"position": Input(), "normal": Input()}
    outputs = {"irradiance": Output()}


def light_twin(light: LightValues, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the direction towards the light and the irradiance on a surface that faces it.

    Parameters
    ----------
    position : (..., 3) mm

    Returns
    -------
    (..., 3) unit, (..., 3) linear Rec.709
    """
    color = np.array(light.color, float)
    if light.kind == DIRECTIONAL:
        direction = -np.array(light.direction, float)
        return np.broadcast_to(direction, position.shape), np.broadcast_to(color, position.shape)
    to_light = np.array(light.position, float) - position
    distance2 = np.maximum(np.sum(to_light**2, axis=-1, keepdims=True), 1e-6)
    L = to_light / np.sqrt(distance2)
    falloff = 1000.0**2 / distance2
    if light.kind == SPOT:
        versine = np.sum((L + np.array(light.direction, float)) ** 2, axis=-1, keepdims=True) / 2
        x = np.clip((light.outer - versine) / max(light.outer - light.inner, 1e-6 * light.outer, 1e-30), 0, 1)
        falloff = falloff * x * x * (3 - 2 * x)
    return L, color * falloff


def _change(
    position: NDArray[np.float64], normal: NDArray[np.float64], axis: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return by how much position and normal change from texel to texel along an axis.

    Towards the neighbor ahead (rows: above), unless it is so far that it must lie beyond a border of the chart.
    """
    found = []
    for step in (1, -1) if axis == 1 else (-1, 1):
        beside, turned = (np.roll(array, -step, axis=axis) for array in (position, normal))
        edge = [slice(None)] * 2
        edge[axis] = slice(-1, None) if step == 1 else slice(0, 1)
        beside[tuple(edge)] = 0.0
        away = np.linalg.norm(beside[..., :3] - position[..., :3], axis=-1, keepdims=True)
        away = np.where(beside[..., 3:] > 0, away, np.inf)
        found.append((away, step * (beside[..., :3] - position[..., :3]), step * (turned - normal)))
    (forth, *ahead), (back, *behind) = found
    known = np.isfinite(np.minimum(forth, back))
    on = forth <= 2 * back
    moved, turned = (np.where(known, np.where(on, *pair), 0.0) for pair in zip(ahead, behind, strict=True))
    return moved, turned


def twin(
    lights: list[IrradianceValues], position: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return irradiance and coverage.

    Parameters
    ----------
    position : (h, w, 4) mm, w = slot
    normal : (h, w, 3) unit

    Returns
    -------
    (h, w, 4)
    """
    slot = position[..., 3].astype(int)
    covered = (slot > 0)[..., None]
    total = np.zeros((*slot.shape, 3))
    across, down = (_change(position, normal, axis) for axis in (1, 0))
    for light in lights:
        response = np.array(light.response, float)[np.maximum(slot - 1, 0)]
        if light.kind == AMBIENT:
            total += np.array(light.color, float) * response[..., :1]
            continue
        places = (np.arange(light.samples) + 0.5) / light.samples - 0.5
        for x, y in np.array(np.meshgrid(places, places)).reshape(2, -1).T:
            P, N = (
                start + x * u + y * v for start, u, v in zip((position[..., :3], normal), across, down, strict=True)
            )
            N = N / np.maximum(np.linalg.norm(N, axis=-1, keepdims=True), 1e-15)
            L, irradiance = light_twin(light, P)
            cosine = np.maximum(np.sum(N * L, axis=-1, keepdims=True), 0)
            total += response[..., 1:2] * cosine * irradiance / light.samples**2
    return np.concatenate([total * covered, covered], axis=-1)
