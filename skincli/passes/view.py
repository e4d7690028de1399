"""The second geometry pass: what the camera sees, as textures of picture size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from skincli.gpu.blocks import Mat4, Values, Vec3
from skincli.graph.node import ZERO, Constant, Input, Output, Pass


@dataclass(frozen=True)
class ViewValues(Values):
    """Uniform block of the pass.

    Parameters
    ----------
    clip : from mm relative to the mesh to clip space, column by column
    eye, forward : position (mm) and view direction (unit) of the camera, relative to the mesh
    bumpiness : factor on the height, 1 is physical
    slot : 1-based number of the part's skin
    reflectance : the skin's reflectance, 0 to 1
    specular : strength of its highlights
    shininess : exponent of its highlights; negative where the roughness map says it
    """

    clip: Mat4
    eye: Vec3
    bumpiness: float
    forward: Vec3
    slot: float
    reflectance: float
    specular: float
    shininess: float


class View(Pass):
    """Linear depth (mm, 0 is background), bumped normal (w = slot), both UV sets, and the maps where they show.

    finish: x reflectance, y strength and z exponent of the highlights.
    """

    shader = "passes/view.frag"
    vertex = "passes/view.vert"
    depth = True
    inputs = {
        "slope_map": Input("mipmap", repeat=True),
        "albedo_map": Input("mipmap", repeat=True),
        "reflectance_map": Input("mipmap", repeat=True),
        "specular_map": Input("mipmap", repeat=True),
        "roughness_map": Input("mipmap", repeat=True),
    }
    outputs = {
        "depth": Output("r32f", needs=()),
        "normal": Output(needs=("slope_map",)),
        "uv": Output(needs=()),
        "albedo": Output(needs=("albedo_map",)),
        "finish": Output(needs=("reflectance_map", "specular_map", "roughness_map")),
        "frame_n": Output(needs=()),
        "frame_u": Output(needs=("slope_map",)),
        "frame_v": Output(needs=("slope_map",)),
    }

    def ignores(self) -> Mapping[str, tuple[Constant, str]]:
        """A flat skin needs no slope, one that mirrors nothing no reflection map."""
        found = {}
        if all(draw.values.bumpiness == 0 for draw in self.draws):  # type: ignore[attr-defined]
            found["slope_map"] = (ZERO, "bumpiness is 0")
        if all(draw.values.reflectance == 0 for draw in self.draws):  # type: ignore[attr-defined]
            found["reflectance_map"] = (ZERO, "reflectance is 0")
        if all(draw.values.specular == 0 for draw in self.draws):  # type: ignore[attr-defined]
            found |= dict.fromkeys(("specular_map", "roughness_map"), (ZERO, "specular is 0"))
        return found
