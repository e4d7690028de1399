"""Exposure and tone curve: from scene light to the light of a display."""

from __future__ import annotations

from dataclasses import dataclass

from skincli.color import SHOULDER_DESATURATION, SHOULDER_START
from skincli.gpu.blocks import Values
from skincli.graph.node import Input, Output, Pass


@dataclass(frozen=True)
class DisplayValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    gain : 2 to the exposure in EV
    neutral : 1 bends highlights [KhronosNeutral2024], 0 clips
    start, desaturation : of the shoulder, see skincli.color
    """

    gain: float
    neutral: int
    start: float = SHOULDER_START
    desaturation: float = SHOULDER_DESATURATION


class Display(Pass):
    """Linear light of a display, not premultiplied; its twin is skincli.color.neutral_display."""

    shader = "passes/display.frag"
    inputs = {"beauty": Input()}
    outputs = {"displayed": Output()}
