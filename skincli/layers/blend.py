"""Blend modes: how a layer's value joins what lies below it, in linear light."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Blend = Literal["normal", "multiply", "screen", "overlay"]


def _overlay(b: Array, s: Array) -> Array:
    return np.where(b <= 0.5, 2 * b * s, 1 - 2 * (1 - b) * (1 - s))


#: Mode -> float64 twin of `blend_MODE` in shaders/lib/blend.glsl. Backdrop b and source s lie in 0 to 1, and so do the
#: results, so that nothing is clamped [W3C2024, "Compositing and Blending Level 1", section 10.1].
MODES: dict[Blend, Callable[[Array, Array], Array]] = {
    "normal": lambda b, s: s,
    "multiply": lambda b, s: b * s,
    "screen": lambda b, s: b + s - b * s,
    "overlay": _overlay,
}
