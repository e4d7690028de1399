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
    cos_outer, cos_inner : cosines between which a spot fades out
    """

    color: Vec3
    kind: int
    position: Vec3 = (0.0, 0.0, 0.0)
    cos_outer: float = 0.0
    direction: Vec3 = (0.0, 0.0, -1.0)
    cos_inner: float = 1.0


def spot_cosines(angle: float, blend: float) -> tuple[float, float]:
    """Return the cosines at the cone's edge and where the full light begins.

    Parameters
    ----------
    angle : full angle of the cone, degrees
    blend : share of the half angle over which the light fades, 0 to 1
    """
    half = math.radians(angle) / 2
    return math.cos(half), math.cos(half * (1 - blend))


@dataclass(frozen=True)
class IrradianceValues(LightValues):
    """A light and, per slot, the skin's answer: x ambient factor, y diffuse factor."""

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
        cosine = -np.sum(L * np.array(light.direction, float), axis=-1, keepdims=True)
        x = np.clip((cosine - light.cos_outer) / max(light.cos_inner - light.cos_outer, 1e-6), 0, 1)
        falloff = falloff * x * x * (3 - 2 * x)
    return L, color * falloff


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
    for light in lights:
        response = np.array(light.response, float)[np.maximum(slot - 1, 0)]
        if light.kind == AMBIENT:
            total += np.array(light.color, float) * response[..., :1]
            continue
        L, irradiance = light_twin(light, position[..., :3])
        cosine = np.maximum(np.sum(normal * L, axis=-1, keepdims=True), 0)
        total += response[..., 1:2] * cosine * irradiance
    return np.concatenate([total * covered, covered], axis=-1)
