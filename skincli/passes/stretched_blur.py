"""Sums of Gaussians in texture space with stretch maps, as in GPU Gems 3, chapter 14 [dEon2007].

Each Gaussian is made from the next narrower one; the stretch map is blurred along, so that faces leave no edges. Light
is divided by blurred coverage, which the original leaves out; a seam of the atlas stays a seam.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skincli.gpu.blocks import Values
from skincli.graph.node import Draw, Input, Output, Pass, Ref, Source
from skincli.passes.blur import LEAST_COVERAGE

#: texels between two taps, at most: where a face has next to no area its stretch means nothing
WIDEST = 64.0


@dataclass(frozen=True)
class StretchedBlurValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    sigma : mm
    along : 0 rows, 1 columns
    least : share of coverage below which nothing is known
    widest : texels between two taps, at most
    """

    sigma: float
    along: int
    least: float
    widest: float


class StretchedBlur(Pass):
    """One direction of the blur of an image premultiplied by its coverage."""

    shader = "passes/stretched_blur.frag"
    inputs = {"image": Input("linear"), "stretch": Input()}
    outputs = {"blurred": Output()}


def chained(
    name: str, size: tuple[int, int], image: Source, stretch: Source, widths: Sequence[float]
) -> tuple[list[Pass], list[Ref]]:
    """Return the nodes of Gaussians, and where each is found, premultiplied by blurred coverage.

    Parameters
    ----------
    image : irradiance (rgb) and coverage (a) in the atlas
    stretch : texels per mm along rows (y) and columns (z), and coverage (w)
    widths : standard deviations, mm, ascending
    """
    nodes: list[Pass] = []
    found = []

    def blurred(name: str, source: Source, sigma: float) -> Ref:
        for along, direction in enumerate(("_rows", "")):
            draw = Draw(StretchedBlurValues(sigma, along, LEAST_COVERAGE, WIDEST))
            nodes.append(StretchedBlur(f"{name}{direction}", size, [draw], {"image": source, "stretch": stretch}))
            source = Ref(f"{name}{direction}", "blurred")
        return Ref(name, "blurred")

    done = 0.0
    for number, width in enumerate(widths):
        sigma = math.sqrt(width**2 - done**2)
        image = blurred(f"{name}_{number}", image, sigma)
        found.append(image)
        if number + 1 < len(widths):
            stretch = blurred(f"{name}_stretch{number}", stretch, sigma)
        done = width
    return nodes, found
