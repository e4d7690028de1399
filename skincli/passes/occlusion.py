"""Equation 1 of the seed paper: the two bands of ambient occlusion as one factor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.graph.node import ONE, Constant, Input, Output, Pass, Source

#: weights the paper found best
HIGH_WEIGHT, LOW_WEIGHT = 1.0, 2.42


@dataclass(frozen=True)
class OcclusionValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    a, b : weights of the high and the low band, 0 and more; 0 leaves a band out
    """

    a: float
    b: float


class Occlusion(Pass):
    """(high^a low^b)^(1/(a+b)); 1 where both weights are 0."""

    shader = "passes/occlusion.frag"
    inputs = {"occlusion_high": Input(), "occlusion_low": Input()}
    outputs = {"occlusion": Output()}

    @property
    def _values(self) -> OcclusionValues:
        values = self.draws[0].values
        assert isinstance(values, OcclusionValues)
        return values

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """Without weight nothing is occluded."""
        return (ONE, "both occlusion bands are off") if self._values.a + self._values.b == 0 else None

    def ignores(self) -> Mapping[str, tuple[Constant, str]]:
        """A band without weight is not needed."""
        found = {}
        if self._values.a == 0:
            found["occlusion_high"] = (ONE, "the high occlusion band has no weight")
        if self._values.b == 0:
            found["occlusion_low"] = (ONE, "the low occlusion band has no weight")
        return found


def twin(a: float, b: float, high: NDArray[np.float64], low: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Equation 1 [Fecko2013].

    Parameters
    ----------
    a, b : 0 and more
    high, low : (...) in [0, 1]

    Returns
    -------
    (...) in [0, 1]; 1 where a + b = 0
    """
    if a + b == 0:
        return np.ones_like(high)
    # The exponents first: a power of 1000 would underflow.
    return high ** (a / (a + b)) * low ** (b / (a + b))
