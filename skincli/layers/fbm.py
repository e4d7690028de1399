"""Fractional Brownian motion: cloudy mottling at many sizes."""

from __future__ import annotations

import math

from skincli.layers.base import Array
from skincli.layers.fractal import NOISE_DEVIATION, STRETCH, Fractal


class Fbm(Fractal):
    """Fractional Brownian motion: cloudy mottling at many sizes, evaluated in space [Perlin1985]."""

    fade = 0.6
    fine = 1 / 6
    wide = 1.0
    coarse = 1.0

    @staticmethod
    def octave(noise: Array) -> Array:
        return noise

    def span(self) -> tuple[float, float]:
        # The sum is nearly normal: three deviations to either side.
        squares = sum(self.gain ** (2 * octave) for octave in range(self.octaves))
        reach = 3 * NOISE_DEVIATION * STRETCH * math.sqrt(squares)
        return -reach, reach
