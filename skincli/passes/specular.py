"""Phong highlights in picture space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Vec2, Vec3
from skincli.graph.node import ZERO, Input, Output, Pass, Source
from skincli.passes.camera import camera_position
from skincli.passes.irradiance import LightsValues, light_twin


@dataclass(frozen=True)
class SpecularValues(LightsValues):
    """Lights and the camera.

    Parameters
    ----------
    eye, right, up, forward, tan_half, size : of the camera, relative to the mesh
    scale : factor on the result: 1 for `paper`, 1/pi for radiance
    dull : whether no skin has highlights
    middle, middle_depth : the point of the view axis beside the mesh's origin, relative to it, and its depth; from
        there float32 reaches the surface of the mesh however far away the eye is
    """

    eye: Vec3 = (0.0, 0.0, 0.0)
    scale: float = 1.0
    right: Vec3 = (1.0, 0.0, 0.0)
    up: Vec3 = (0.0, 1.0, 0.0)
    forward: Vec3 = (0.0, 0.0, -1.0)
    tan_half: Vec2 = (1.0, 1.0)
    size: Vec2 = (1.0, 1.0)
    dull: int = 0
    middle: Vec3 = field(init=False)
    middle_depth: float = field(init=False)

    def __post_init__(self) -> None:
        eye, forward = np.array(self.eye, float), np.array(self.forward, float)
        # Rounded as the shader has it, so that the point goes with that depth.
        depth = float(np.float32(max(-eye @ forward, 0.0)))
        object.__setattr__(self, "middle", tuple(map(float, eye + depth * forward)))
        object.__setattr__(self, "middle_depth", depth)


class Specular(Pass):
    """Sum of the lights' highlights times the skin's strength."""

    shader = "passes/specular.frag"
    additive = True
    inputs = {"depth": Input(), "normal": Input(), "finish": Input()}
    outputs = {"specular": Output()}

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """A skin without gloss has no highlights."""
        draws = [draw.values for draw in self.draws if isinstance(draw.values, SpecularValues)]
        dark = all(draw.dull or not any(any(light.color) for light in draw.sources()) for draw in draws)
        return (ZERO, "specular is off or 0, or there is no light") if dark else None


def twin(
    draws: Sequence[SpecularValues],
    depth: NDArray[np.float64],
    normal: NDArray[np.float64],
    finish: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the highlights.

    Parameters
    ----------
    depth : (h, w) mm
    normal : (h, w, 4) unit, w = slot
    finish : (h, w, 4) y strength, z shininess

    Returns
    -------
    (h, w, 3)
    """
    slot = normal[..., 3].astype(int)
    total = np.zeros((*depth.shape, 3))
    for draw in draws:
        width, height = depth.shape[1], depth.shape[0]
        axes = np.array([draw.right, draw.up, draw.forward])
        from_eye = camera_position((width, height), draw.tan_half, depth) @ axes  # type: ignore[arg-type]
        V = -from_eye / np.maximum(np.linalg.norm(from_eye, axis=-1, keepdims=True), 1e-6)
        N = normal[..., :3]
        for light in draw.sources():
            L, irradiance = light_twin(light, np.array(draw.eye) + from_eye)
            NoL = np.sum(N * L, axis=-1, keepdims=True)
            R = 2 * NoL * N - L
            versine = np.sum((R - V) ** 2, axis=-1, keepdims=True) / 2
            lobe = np.where((versine < 1) & (NoL > 0), np.maximum(1 - versine, 1e-30) ** finish[..., 2:3], 0.0)
            total += draw.scale * finish[..., 1:2] * lobe * irradiance
    return total * (slot > 0)[..., None]
