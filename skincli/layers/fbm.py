"""Fractional Brownian motion: cloudy mottling at many sizes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import (
    LEVELS_FIELD,
    SEED_FIELD,
    Array,
    Pattern,
    Seed,
    Site,
    UnitRamp,
    Value,
    joint_seed,
    pattern_mean,
)

#: Standard deviation of shaders/lib/noise.glsl gradient_noise over space; a test measures it.
NOISE_DEVIATION = 0.191
#: Standard deviation of the raw pattern about 1/2: what is farther than three of them falls to the ends of `levels`.
PATTERN_DEVIATION = 1 / 6


class Fbm(Pattern):
    """Fractional Brownian motion: cloudy mottling at many sizes, evaluated in space [Perlin1985]."""

    scale: float = Field(default=10.0, ge=0.01, le=10000, description="size of the largest features, mm")
    octaves: int = Field(default=5, ge=1, le=12, description="how many sizes are summed, each half of the one before")
    gain: float = Field(
        default=0.5, ge=0, le=1, description="strength of each octave relative to the one before, 0 to 1"
    )
    warp: float = Field(default=0.0, ge=0, le=10000, description="how far the pattern is pulled about, mm")
    levels: UnitRamp = LEVELS_FIELD
    seed: Seed = SEED_FIELD

    def values(self, seed: int) -> dict[str, Value]:
        deviation = NOISE_DEVIATION * math.sqrt(sum(self.gain ** (2 * octave) for octave in range(self.octaves)))
        values: dict[str, Value] = {
            "scale": self.scale,
            "octaves": self.octaves,
            "amplitude": PATTERN_DEVIATION / deviation,
            "gain": self.gain,
            "warp": self.warp / self.scale,
            "levels": self.levels,
            "seed": joint_seed(seed, self.seed),
        }
        return values | {"mean": pattern_mean(type(self), values, self.scale)}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, picture: Array | None) -> Array:
        scale, seed, footprint = values["scale"], values["seed"], site["footprint"]
        cell, fraction = hashing.split(hashing.warp_cells(site["position"] / scale, values["warp"], seed))
        amplitude, size = values["amplitude"], scale
        total = np.full(len(footprint), 0.5)
        for octave in range(values["octaves"]):
            noise = hashing.gradient_noise(cell, fraction, seed + 7919 * octave)
            total += amplitude * hashing.resolved(size, footprint) * noise
            amplitude *= values["gain"]
            size *= 0.5
            carry, fraction = hashing.split(2 * fraction + np.array([0.3125, 0.4375, 0.1875]))
            cell = 2 * cell + carry
        t = hashing.levels(total, values["levels"], footprint / scale)
        visible = hashing.resolved(scale, footprint)
        return (1 - visible) * values["mean"] + visible * t
