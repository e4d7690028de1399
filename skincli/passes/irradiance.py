"""Light that reaches the surface, in texture space."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Slots, Values, Vec3
from skincli.graph.node import Input, Output
from skincli.passes.seen import Tiled

DIRECTIONAL, POINT, SPOT = 1, 2, 3

#: lights of one draw: a uniform block need not hold more
MAX_LIGHTS = 64
Lights = Annotated[tuple[tuple[float, ...], ...], f"vec4[{3 * MAX_LIGHTS}]"]

#: skins that one mesh may carry; their factors lie side by side in a uniform block
MAX_SLOTS = 64

#: share of the brightest by which the light at a texel's center and at its corners differ where it is looked at more
#: closely; from twice as much on, what is seen closely replaces the rest
CHANGE = 0.05

#: what the shader shares with the twin
DEFINES = (("CHANGE", str(CHANGE)),)

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class LightValues:
    """A light as the shaders see it.

    Parameters
    ----------
    color : irradiance of a directional light; intensity (the irradiance at 1 m) of point and spot
    kind : DIRECTIONAL, POINT or SPOT
    position : mm relative to the mesh
    direction : unit, where the light travels
    outer, inner : what the cosines lack to 1 between which a spot fades out
    """

    color: tuple[float, ...]
    kind: int
    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    outer: float = 1.0
    direction: tuple[float, ...] = (0.0, 0.0, -1.0)
    inner: float = 0.0


@dataclass(frozen=True)
class LightsValues(Values):
    """Lights of one draw.

    Parameters
    ----------
    directional, point, spot : how many there are of each kind
    lights : three rows of each, the kinds in this order: color, 0; position, outer; direction, inner
    """

    directional: int
    point: int
    spot: int
    lights: Lights

    def sources(self) -> list[LightValues]:
        """Return the lights."""
        kinds = [DIRECTIONAL] * self.directional + [POINT] * self.point + [SPOT] * self.spot
        rows = [self.lights[3 * k : 3 * k + 3] for k in range(len(kinds))]
        return [
            LightValues(color[:3], kind, position[:3], position[3], direction[:3], direction[3])
            for kind, (color, position, direction) in zip(kinds, rows, strict=True)
        ]

    def brighter(self, factor: float) -> Self:
        """Return the same with colors times a factor."""
        rows = [tuple(factor * c for c in row) if k % 3 == 0 else row for k, row in enumerate(self.lights)]
        return replace(self, lights=tuple(rows))


def in_blocks(lights: Sequence[LightValues]) -> list[dict[str, Any]]:
    """Return what LightsValues are made of, for as few draws as hold all lights: at least one."""
    blocks = []
    for first in range(0, max(len(lights), 1), MAX_LIGHTS):
        some = sorted(lights[first : first + MAX_LIGHTS], key=lambda light: light.kind)
        rows = [
            row
            for light in some
            for row in ((*light.color, 0.0), (*light.position, light.outer), (*light.direction, light.inner))
        ]
        directional, point, spot = (sum(light.kind == kind for light in some) for kind in (DIRECTIONAL, POINT, SPOT))
        blocks.append({"directional": directional, "point": point, "spot": spot, "lights": tuple(rows)})
    return blocks


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
class IrradianceValues(LightsValues):
    """Lights, how closely they are looked at, and per slot the skin's answer.

    Parameters
    ----------
    ambient : irradiance from everywhere, once in all draws
    covers : what the draw adds to coverage: 1 in one of them
    samples : places along a texel's side where the light has an edge; 1: all texels are their centers
    response : x ambient factor, y diffuse factor
    """

    ambient: Vec3
    covers: float
    samples: int
    response: Slots


class Irradiance(Tiled):
    """Irradiance times the skin's factors (rgb) and coverage (a); float32, so that many lights add up exactly."""

    shader = "passes/irradiance.frag"
    additive = True
    inputs = {"seen": Input(), "position": Input(), "normal": Input()}
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


def averaged(
    lit: Callable[[Floats, Floats], tuple[Floats, Floats]],
    index: Indices,
    width: int,
    position: Floats,
    normal: Floats,
    samples: int,
    rows: slice = slice(None),
) -> Floats:
    """Return the light that texels receive, averaged over each.

    The center and the corners are weighted so that light which bends as a parabola is averaged exactly, and tell
    whether an edge lies between them: no straight one passes without parting a corner from the center. There a grid
    of places takes over.

    Parameters
    ----------
    lit : of (n, 3) positions and unit normals; gives the light on a surface that faces it, and what is received, (n, k)
    index : (n,) ascending, row * width + column, row 0 at v = 0: the texels
    width : texels in a row
    position, normal : (n, 3) mm and unit
    samples : places along a texel's side where the light has an edge; 1: all texels are their centers
    rows : the texels that are wanted, m of them

    Returns
    -------
    (m, k)
    """
    places = [
        np.stack([start[rows], *changes])
        for start, changes in zip((position, normal), _changes(index, width, position, normal, rows), strict=True)
    ]

    def at(x: float, y: float, some: NDArray[np.bool_] | slice = slice(None)) -> tuple[Floats, Floats]:
        P, N = (np.tensordot((1.0, x, y), place[:, some], axes=1) for place in places)
        return lit(P, N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-15))

    arriving, mean = at(0, 0)
    if samples == 1:
        return mean
    corners = [at(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    brightest = np.max(np.abs([arriving, *(there for there, _ in corners)]), axis=0)
    change = np.abs(arriving - sum(there for there, _ in corners) / 4)
    mean = 2 / 3 * mean + sum(received for _, received in corners) / 12
    edge = np.clip(change / np.maximum(CHANGE * brightest, 1e-30) - 1, 0, 1)
    some = edge.any(axis=1)
    side = (np.arange(samples) + 0.5) / samples - 0.5
    closely = sum(at(x, y, some)[1] for x in side for y in side) / samples**2
    mean[some] += edge[some] * (closely - mean[some])
    return mean


def _changes(
    index: Indices, width: int, position: Floats, normal: Floats, rows: slice
) -> tuple[list[Floats], list[Floats]]:
    """Return by how much position and normal change from texel to texel along a row, and from row to row.

    Towards the neighbor ahead, unless it is so far that it must lie beyond a border of the chart.
    """
    own = index[rows]
    moved: list[Floats] = []
    turned: list[Floats] = []
    for stride, along_row in ((1, True), (width, False)):
        found = []
        for step in (stride, -stride):
            beside = np.minimum(np.searchsorted(index, own + step), len(index) - 1)
            known = (index[beside] == own + step) & ((not along_row) | ((own + step) // width == own // width))
            change = [np.sign(step) * (array[beside] - array[rows]) for array in (position, normal)]
            found.append((np.where(known, np.linalg.norm(change[0], axis=1), np.inf), *change))
        (forth, *ahead), (back, *behind) = found
        known, on = np.isfinite(np.minimum(forth, back))[:, None], (forth <= 2 * back)[:, None]
        for total, pair in zip((moved, turned), zip(ahead, behind, strict=True), strict=True):
            total.append(np.where(known, np.where(on, *pair), 0.0))
    return moved, turned


def twin(draws: Sequence[IrradianceValues], position: Floats, normal: Floats) -> Floats:
    """Return irradiance and coverage.

    Parameters
    ----------
    position : (h, w, 4) mm, w = slot
    normal : (h, w, 3) unit

    Returns
    -------
    (h, w, 4)
    """
    # The topmost row comes first in arrays, last among texels.
    texels, normals = position[::-1].reshape(-1, 4), normal[::-1].reshape(-1, 3)
    index = np.flatnonzero(texels[:, 3] > 0)
    points, slot = texels[index, :3], texels[index, 3].astype(int) - 1
    result = np.zeros((len(texels), 4))
    for draw in draws:
        ambient, diffuse = np.array(draw.response, float)[slot, :2, None].transpose(1, 0, 2)
        result[index, :3] += ambient * np.array(draw.ambient, float)
        result[index, 3] += draw.covers
        for light in draw.sources():

            def lit(P: Floats, N: Floats, light: LightValues = light) -> tuple[Floats, Floats]:
                L, arriving = light_twin(light, P)
                return arriving, np.maximum(np.sum(N * L, axis=1, keepdims=True), 0) * arriving

            received = averaged(lit, index, position.shape[1], points, normals[index], draw.samples)
            result[index, :3] += diffuse * received
    return result.reshape(position.shape)[::-1]
