"""From several samples a pixel to the picture."""

from __future__ import annotations

from dataclasses import dataclass

from skincli.gpu.blocks import Values, Vec4
from skincli.graph.node import Input, Output, Pass, Source

NO_BACKGROUND = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ResolveValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    background : premultiplied color behind the picture; all 0 leaves it transparent
    samples : samples a side of a pixel
    mean : 1 averages, 0 takes the first sample that shows a surface
    """

    background: Vec4
    samples: int
    mean: int


class Resolve(Pass):
    """Averages what mixes; takes the first covered sample of what does not (depth, uv)."""

    shader = "passes/resolve.frag"
    inputs = {"image": Input(), "depth": Input()}
    outputs = {"resolved": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """One sample a pixel and no background: the picture is there already."""
        values = self.draws[0].values
        assert isinstance(values, ResolveValues)
        if values.samples == 1 and values.background == NO_BACKGROUND and values.mean == 1:
            return self.source(self.draws[0], "image"), "one sample a pixel"
        return None
