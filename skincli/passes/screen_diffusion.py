"""Separable diffusion in the picture [Jimenez2009]: only what the camera sees gives light to what it sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from skincli.gpu.blocks import Values
from skincli.graph.node import Draw, Input, Output, Pass, Ref, Source

#: taps on each side, and the standard deviations over which they are spread
TAPS, KEPT_SIGMAS = 12, 3.0


@dataclass(frozen=True)
class ArrivingValues(Values):
    """No values."""


class Arriving(Pass):
    """Light of the atlas at the picture's pixels (rgb), and coverage (a)."""

    shader = "passes/arriving.frag"
    inputs = {"image": Input("linear"), "uv": Input(), "depth": Input()}
    outputs = {"arriving": Output()}


@dataclass(frozen=True)
class ScreenDiffusionValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    sigma : mm
    scale : pixels that a mm takes at a depth of 1 mm
    along : 0 rows, 1 columns
    taps : on each side
    kept : standard deviations over which the taps are spread
    """

    sigma: float
    scale: float
    along: int
    taps: int = TAPS
    kept: float = KEPT_SIGMAS


class ScreenDiffusion(Pass):
    """One direction of the Gaussian."""

    shader = "passes/screen_diffusion.frag"
    inputs = {"image": Input(), "depth": Input()}
    outputs = {"diffused": Output()}


def screen_values(widths: Sequence[float], scale: float) -> dict[str, ScreenDiffusionValues]:
    """Return the values of each node of `screen_nodes`, which change with the camera."""
    return {
        f"diffused_{number}{direction}": ScreenDiffusionValues(width, scale, along)
        for number, width in enumerate(widths)
        for along, direction in enumerate(("_rows", ""))
    }


def screen_nodes(
    size: tuple[int, int], image: Source, depth: Source, values: dict[str, ScreenDiffusionValues]
) -> tuple[list[Pass], list[Ref]]:
    """Return the nodes of Gaussians in the picture, and where each is found.

    Parameters
    ----------
    image : light at the pixels
    depth : mm along the view axis, 0 for none
    values : of `screen_values`
    """
    nodes: list[Pass] = []
    found = []
    source = image
    for name, block in values.items():
        nodes.append(ScreenDiffusion(name, size, [Draw(block)], {"image": source, "depth": depth}))
        source = Ref(name, "diffused")
        if block.along == 1:
            found.append(source)
            source = image
    return nodes, found
