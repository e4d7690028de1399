"""Curves that remap a pattern, the twin of shaders/lib/curve.glsl: control points joined by monotone cubics."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

Array = NDArray[np.float64]
Points = tuple[tuple[float, ...], ...]

#: Control points of a curve; those that are not used repeat the last.
MAX_POINTS = 8

#: Least distance of neighboring points: with it float32 positions keep the curve within 1e-5 of exact.
MIN_STEP = 0.01


def _rising(points: Points) -> Points:
    for (before, _), (after, _) in pairwise(points):
        # Written decimals such as 0.29 and 0.3 may differ by a little less than they say.
        if after - before < MIN_STEP - 1e-9:
            raise ValueError(
                f"the curve's x goes from {before:g} to {after:g}; from each point to the next it must rise by at "
                f"least {MIN_STEP:g}; sort the points by x and move or remove one"
            )
    return points


_Unit = Annotated[float, Field(ge=0, le=1)]
_Point = Annotated[tuple[_Unit, ...], Field(strict=False, min_length=2, max_length=2)]

#: A field that holds a curve, written [[x, y], ...]: x rises, all numbers lie in 0 to 1.
Curve = Annotated[tuple[_Point, ...], Field(strict=False, min_length=2, max_length=MAX_POINTS), AfterValidator(_rising)]


def slopes(points: Sequence[Sequence[float]]) -> Array:
    """Return the slope of a curve at its control points, such that it is monotone between each two.

    Parameters
    ----------
    points : (n, 2) x and y, n at least 2, x rising

    Returns
    -------
    (n,) y per x

    References
    ----------
    [FritschCarlson1980]: means of the secants on both sides, drawn into the disk of radius 3 secants
    """
    x, y = np.array(points, dtype=np.float64).T
    secants = np.diff(y) / np.diff(x)
    before, after = np.append(secants[0], secants), np.append(secants, secants[-1])
    found = np.where(before * after > 0, (before + after) / 2, 0.0)
    for i, secant in enumerate(secants):
        # Slopes in units of the secant; where it is 0, so are both of them.
        length = np.hypot(*found[i : i + 2]) / abs(secant) if secant else 0.0
        found[i : i + 2] *= 3 / max(length, 3)
    return found


def remap(points: Sequence[Sequence[float]], t: Array) -> Array:
    """Return a curve's value, 0 to 1, at t; left of the first point and right of the last it stays constant.

    Parameters
    ----------
    points : (n, 2) x and y, each 0 to 1, x rising
    t : any shape
    """
    x, y = np.array(points, dtype=np.float64).T
    slope = slopes(points)
    i = np.clip(np.searchsorted(x, t) - 1, 0, len(x) - 2)
    width = x[i + 1] - x[i]
    u = np.clip((t - x[i]) / width, 0, 1)
    rise = y[i + 1] - y[i]
    start, end = width * slope[i], width * slope[i + 1]
    return y[i] + u * (start + u * (3 * rise - 2 * start - end + u * (start + end - 2 * rise)))


def members(points: Sequence[Sequence[float]]) -> dict[str, tuple[float, ...]]:
    """Return what the shader needs of a curve: the suffix of a member's name -> its vec4.

    There are always `MAX_POINTS`, so that curves of all numbers of points share a program. A vec4 is x, y, slope, and
    1 / distance to the next point, 0 for the last point and those that repeat it.
    """
    x = np.array(points, dtype=np.float64)[:, 0]
    inverse = np.append(1 / np.diff(x), 0.0)
    rows = [
        (float(point[0]), float(point[1]), float(slope), float(step))
        for point, slope, step in zip(points, slopes(points), inverse, strict=True)
    ]
    rows += [rows[-1]] * (MAX_POINTS - len(rows))
    return {str(i): row for i, row in enumerate(rows)}


def call(prefix: str, t: str) -> str:
    """Return the GLSL expression for the remapped t; needs `lib/curve.glsl`.

    Parameters
    ----------
    prefix : what stands in the shader before "_" and each suffix of `members`, such as "p.layer0_curve"
    t : expression of type float
    """
    return f"remap_curve({t}, {', '.join(f'{prefix}_{i}' for i in range(MAX_POINTS))})"
