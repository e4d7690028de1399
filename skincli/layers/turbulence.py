"""Turbulence: sums of absolute noise, creased at every size."""

from __future__ import annotations

import numpy as np

from skincli.layers.base import Array
from skincli.layers.fractal import Fractal


class Turbulence(Fractal):
    """Absolute noise at many sizes, dark creases at each: smoke, marble, mottled hide [Perlin1985]."""

    fade = 2.0
    fine = 1 / 20

    @staticmethod
    def octave(noise: Array) -> Array:
        return np.minimum(np.abs(noise), 1)
