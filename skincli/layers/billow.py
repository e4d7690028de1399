"""Billow: rounded puffs between creases."""

from __future__ import annotations

import numpy as np

from skincli.layers.base import Array
from skincli.layers.fractal import Fractal


class Billow(Fractal):
    """Puffs between creases: absolute noise whose finer octaves sit on the coarser puffs and spare their creases."""

    fade = 2.0
    fine = 1 / 16

    @staticmethod
    def octave(noise: Array) -> Array:
        return np.minimum(np.abs(noise), 1)

    @staticmethod
    def weight(value: Array) -> Array:
        return np.minimum(2 * value, 1)
