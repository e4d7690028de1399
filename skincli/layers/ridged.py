"""Ridged noise: sharp crests that branch and cross, as of wrinkled or dried skin."""

from __future__ import annotations

import numpy as np

from skincli.layers.base import Array
from skincli.layers.fractal import Fractal


class Ridged(Fractal):
    """Sharp crests where noise changes its sign, at many sizes: wrinkles, veins, dried skin [Musgrave1994]."""

    fade = 2.0
    fine = 1 / 40

    @staticmethod
    def octave(noise: Array) -> Array:
        return (1 - np.minimum(np.abs(noise), 1)) ** 2
