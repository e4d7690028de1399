"""Openness of a relief: a map of pits and furrows for shaders that have no relief of their own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Samples, Values
from skincli.graph.node import Input, Output, Pass

Array = NDArray[np.float64]

DIRECTIONS, STEPS = 12, 6

DEFINES = (("CAVITY_DIRECTIONS", str(DIRECTIONS)), ("CAVITY_STEPS", str(STEPS)))


def _circle() -> Samples:
    """Return unit vectors around the circle, (x, y, 0, 0): a slot has four numbers."""
    angles = [2 * math.pi * (i + 0.5) / DIRECTIONS for i in range(DIRECTIONS)]
    return tuple((math.cos(angle), math.sin(angle), 0.0, 0.0) for angle in angles)


_AROUND = _circle()


@dataclass(frozen=True)
class CavityValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    footprint : mm per texel of a flat square; 0 where the site says it for a mesh
    radius : how far the horizon is sought, mm
    repeats : 1 where the map goes on beyond its edges
    directions : in texel space, which is taken to be free of stretch
    """

    footprint: float
    radius: float
    repeats: int
    directions: Samples = _AROUND


class Cavity(Pass):
    """Cosine-weighted share of the sky that the relief leaves open, 1 on a plane.

    Above a horizon of elevation h the share is 1 - sin^2 h, averaged over the directions [Bavoil2008, without its
    falloff with distance].
    """

    shader = "passes/cavity.frag"
    inputs = {"height": Input(), "site_normal": Input()}
    outputs = {"cavity": Output("r32f")}


def twin(values: CavityValues, height: Array, footprint: Array | float) -> Array:
    """Return the openness.

    Parameters
    ----------
    height : (h, w) mm, top row first
    footprint : (h, w) or a number, mm per texel; 0 where no mesh lies

    Returns
    -------
    (h, w) in [0, 1]
    """
    mm = np.broadcast_to(footprint, height.shape)
    rows, columns = np.mgrid[0 : height.shape[0], 0 : height.shape[1]]
    covered = np.zeros_like(height)
    for x, y, *_ in values.directions:
        horizon = np.zeros_like(height)
        for k in range(1, STEPS + 1):
            reach = np.minimum((k / STEPS) ** 2 * values.radius / np.maximum(mm, 1e-9), height.shape[1])
            right, up = np.floor(x * reach + 0.5).astype(int), np.floor(y * reach + 0.5).astype(int)
            there = rows - up, columns + right
            inside = there[0] % height.shape[0], there[1] % height.shape[1]
            within = (there[0] == inside[0]) & (there[1] == inside[1])
            seen = ((values.repeats == 1) | within) & (mm[inside] > 0)
            rise, run = height[inside] - height, np.hypot(right, up) * mm
            found = seen & (run > 0) & (rise > 0)
            horizon = np.where(found, np.maximum(horizon, rise**2 / np.maximum(rise**2 + run**2, 1e-30)), horizon)
        covered += horizon
    return np.where(mm > 0, 1 - covered / DIRECTIONS, 1.0)
