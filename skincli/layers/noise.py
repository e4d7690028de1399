"""Noise of one size: value, gradient or simplex noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import LEVELS_FIELD, Array, Ground, Pattern, Site, UnitRamp, Value, joint_seed
from skincli.layers.fractal import NOISE_DEVIATION, steepness


class Kind(IntEnum):
    """What lies between the corners of cells."""

    VALUE = 0
    GRADIENT = 1
    SIMPLEX = 2


#: Standard deviation of each noise over space; a test measures it.
DEVIATION = {Kind.VALUE: 0.4, Kind.GRADIENT: NOISE_DEVIATION, Kind.SIMPLEX: 0.231}
#: Largest deviation of the noise that still shows; a normal distribution would end at three, value noise ends at 1.
REACH = {Kind.VALUE: 2.5, Kind.GRADIENT: 3.0, Kind.SIMPLEX: 3.0}
#: exp(-fade) of a noise is left in the mean over texels as large as its cells.
FADE = {Kind.VALUE: 0.27, Kind.GRADIENT: 0.5, Kind.SIMPLEX: 1.4}
#: Size of a texel that one place stands for well enough, in cells.
FINEST = {Kind.VALUE: 1 / 6, Kind.GRADIENT: 1 / 6, Kind.SIMPLEX: 1 / 10}


class Noise(Pattern):
    """Noise of one size: soft blots without detail, evaluated in space [Perlin1985, Perlin2001]."""

    pattern: Literal["value", "gradient", "simplex"] = Field(
        default="gradient",
        description="value: a random value at each corner of a cell; gradient: a random slope; simplex: "
        "a random slope at the corners of tetrahedra, rounder and without the grain of a lattice",
    )
    scale: float = Field(default=10.0, ge=0.01, le=10000, description="size of a cell of the noise, mm")
    levels: UnitRamp = LEVELS_FIELD

    def size(self) -> float:
        return self.scale

    def finest(self) -> float:
        return FINEST[Kind[self.pattern.upper()]] * self.scale * steepness(self.levels)

    def widest(self) -> float:
        return self.scale

    def grain(self) -> float:
        return (2.2 if self.pattern == "value" else 1.0) * self.scale / steepness(self.levels) ** 0.25

    def values(self, ground: Ground) -> dict[str, Value]:
        kind = Kind[self.pattern.upper()]
        # The lattice of tetrahedra repeats along x and y after every third step.
        cells = 3 if kind == Kind.SIMPLEX else 1
        block, period = ground.fit(cells * self.scale)
        scale = block / cells
        return {
            "kind": kind,
            "scale": scale,
            "period": period,
            "amplitude": 1 / (2 * REACH[kind] * DEVIATION[kind]),
            "deviation": 1 / (2 * REACH[kind]),
            "fade": FADE[kind],
            "levels": self.levels,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        cells, period, seed = site["position"] / values["scale"], values["period"], values["seed"]
        if values["kind"] == Kind.VALUE:
            noise = hashing.value_noise(*hashing.split(cells), period, seed)[:, 0]
        elif values["kind"] == Kind.GRADIENT:
            noise = hashing.gradient_noise(*hashing.split(cells), period, seed)
        else:
            noise = hashing.simplex_noise(*hashing.split(cells), period, seed)
        visible = np.exp(-np.minimum(values["fade"] * (site["footprint"] / values["scale"]) ** 2, 80))
        lost = 1 - visible**2
        return hashing.levels(
            0.5 + values["amplitude"] * visible * noise, values["levels"], values["deviation"] * np.sqrt(5 * lost)
        )
