"""Sums of octaves of gradient noise: fbm, ridged, billow, turbulence; the twin of shaders/lib/fractal.glsl."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import (
    LEVELS_FIELD,
    Array,
    Ground,
    Pattern,
    Site,
    UnitRamp,
    Value,
    joint_seed,
)

#: Standard deviation of shaders/lib/noise.glsl gradient_noise over space; a test measures it.
NOISE_DEVIATION = 0.191
#: What three deviations of gradient noise are multiplied by to become 1; FRACTAL_STRETCH in the shader.
STRETCH = 1.745
#: An octave whose part of a texel's mean is less is not evaluated; FRACTAL_LEAST in the shader.
LEAST = 0.01

Kind = Literal["fbm", "ridged", "billow", "turbulence"]


class Fractal(Pattern):
    """Octaves of gradient noise, summed after each went through the same function."""

    #: share of an octave that is left in the mean over texels of its size: exp(-fade)
    fade: ClassVar[float]
    #: size of a texel that one place stands for well enough, in units of the scale
    fine: ClassVar[float]
    #: likewise, up to which the octaves' own average keeps the mean
    wide: ClassVar[float] = 0.15
    #: size of what vanishes last in large texels: the stronger the contrast, the more slowly it must
    coarse: ClassVar[float] = 1.25

    scale: float = Field(default=10.0, ge=0.01, le=10000, description="size of the largest features, mm")
    octaves: int = Field(default=5, ge=1, le=12, description="how many sizes are summed, each half of the one before")
    gain: float = Field(
        default=0.5, ge=0, le=1, description="strength of each octave relative to the one before, 0 to 1"
    )
    levels: UnitRamp = LEVELS_FIELD

    @staticmethod
    @abstractmethod
    def octave(noise: Array) -> Array:
        """Return what an octave is, of noise whose deviation is 1/3."""

    @staticmethod
    def weight(value: Array) -> Array | float:
        """Return the factor of the next octave, given the value of this one."""
        return 1.0

    def span(self) -> tuple[float, float]:
        """Return what of the sum becomes 0 and 1."""
        return _range(type(self), self.octaves, self.gain)

    def size(self) -> float:
        return self.scale

    def finest(self) -> float:
        return self.fine * self.scale * steepness(self.levels)

    def widest(self) -> float:
        return self.wide * self.scale

    def grain(self) -> float:
        return self.coarse * self.scale / steepness(self.levels) ** 0.2

    def values(self, ground: Ground) -> dict[str, Value]:
        scale, period = ground.fit(self.scale)
        low, high = self.span()
        return {
            "scale": scale,
            "period": period,
            "octaves": self.octaves,
            "gain": self.gain,
            "offset": -low / (high - low),
            "amplitude": 1 / (high - low),
            "fade": self.fade,
            "octave": _moments(type(self)),
            "levels": self.levels,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        deviation = values["octave"][1]
        coarsest = np.exp(-np.minimum(values["fade"] * (site["footprint"] / values["scale"]) ** 2, 80))
        raw, lost = _sum(cls, values, site["position"] / values["scale"], coarsest)
        t = values["offset"] + values["amplitude"] * raw
        return hashing.levels(t, values["levels"], deviation * values["amplitude"] * np.sqrt(5 * lost))


def steepness(levels: tuple[float, ...]) -> float:
    """Return by how much smaller texels must be where levels pick out a small part of a pattern, at least 1/8."""
    return min(max(2 * abs(levels[1] - levels[0]), 0.125), 1.0)


def _sum(cls: type[Fractal], values: Mapping[str, Any], x: Array, visible: Array) -> tuple[Array, Array]:
    """Return the sum of the octaves, and the sum of the squares of what of them is averaged out; both (n,)."""
    mean = values["octave"][0]
    cell, fraction = hashing.split(x)
    period, amplitude = values["period"], 1.0
    total, lost, weight = np.zeros(len(x)), np.zeros(len(x)), np.ones(len(x))
    for octave in range(values["octaves"]):
        noise = hashing.gradient_noise(cell, fraction, period, values["seed"] + 7919 * octave) * STRETCH
        value = mean + np.where(visible > LEAST, visible, 0) * (cls.octave(noise) - mean)
        total += amplitude * weight * value
        lost += amplitude**2 * (1 - visible**2)
        weight = cls.weight(value) * np.ones(len(x))
        amplitude *= values["gain"]
        visible = visible**4
        period *= 2
        carry, fraction = hashing.split(2 * fraction + np.array([0.3125, 0.4375, 0.1875]))
        cell = 2 * cell + carry
    return total, lost


def _space() -> Array:
    """Return 8192 fixed points of a large volume, in cells."""
    return hashing.hash_cell(np.arange(8192)[:, None] * np.array([1, 0, 0]), 0)[:, :3] * 1000


@cache
def _moments(cls: type[Fractal]) -> tuple[float, float]:
    """Return mean and standard deviation of an octave."""
    octave = cls.octave(hashing.gradient_noise(*hashing.split(_space()), 0, 0) * STRETCH)
    return float(octave.mean()), float(octave.std())


@cache
def _range(cls: type[Fractal], octaves: int, gain: float) -> tuple[float, float]:
    """Return between what all but one point in 100 of the sum lies."""
    values = {"octave": (0.0, 1.0), "period": 0, "octaves": octaves, "gain": gain, "seed": 0}
    raw, _ = _sum(cls, values, _space(), np.ones(8192))
    low, high = np.quantile(raw, [0.005, 0.995])
    return float(low), float(high)
