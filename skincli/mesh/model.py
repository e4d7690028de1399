"""What every other room knows of a mesh: arrays in millimetres, two UV sets, parts."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pathlib import Path


class Urgent(str):
    """A note on a mesh that asks the person to do something; the others only tell what was done."""

    __slots__ = ()


@dataclass(frozen=True)
class Material:
    """What the file itself says of a part's look; used where the scene gives the part no skin.

    Parameters
    ----------
    base_color : (3,) scene-linear Rec.709 factor
    base_color_image : (h, w, 3 or 4) uint8 sRGB-encoded pixels, top row first, or None
    base_color_file : the image file it came from, or None when embedded
    """

    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    base_color_image: NDArray[np.uint8] | None = field(default=None, repr=False)
    base_color_file: Path | None = None


@dataclass(frozen=True)
class Part:
    """A run of faces that share a name and a material: one geometry of the file.

    Parameters
    ----------
    name : unique within the mesh
    start, stop : faces[start:stop] belong to the part
    material : what the file says of it, or None
    """

    name: str
    start: int
    stop: int
    material: Material | None = None


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh ready for the pipeline.

    Parameters
    ----------
    positions : (n, 3) float64, mm, relative to `origin`
    normals : (n, 3) float64, unit, outward
    uv : (n, 2) float64, the authored UV set that maps read; may overlap, mirror or tile
    atlas_uv : (n, 2) float64 in [0, 1], unique: no two triangles overlap; light is computed here
    faces : (m, 3) int32, counter-clockwise seen from outside
    parts : at least one, in face order, covering all faces
    origin : (3,) float64, mm, scene position of the mesh's local zero; subtracted in float64 before float32
    uv_is_unique : whether `uv` itself lies in [0, 1] and does not overlap (then `atlas_uv` equals it)
    notes : sentences for the user about what was repaired on the way (normals computed, faces dropped, ...)

    UV (0, 0) is the lower left corner of an image, v grows upward.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64]
    atlas_uv: NDArray[np.float64]
    faces: NDArray[np.int32]
    parts: tuple[Part, ...]
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    uv_is_unique: bool = True
    notes: tuple[str, ...] = ()

    @cached_property
    def key(self) -> str:
        """Hash of everything that can change a picture; names and notes stay out."""
        digest = hashlib.blake2b(digest_size=16)
        for array in (self.positions, self.normals, self.uv, self.atlas_uv, self.faces, self.origin):
            digest.update(np.ascontiguousarray(array).tobytes())
        for part in self.parts:
            digest.update(f"{part.start}:{part.stop};".encode())
        return digest.hexdigest()
