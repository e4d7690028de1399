"""The ambient occlusion of the mesh as a pattern."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Site, UnitRamp, Value
from skincli.layers.still import Still


class Occlusion(Still):
    """Openness of the mesh: 1 where nothing is near, 0 deep in folds. From a bake of the mesh; 1 on a flat square."""

    reads: ClassVar[frozenset[str]] = frozenset({"occlusion"})

    levels: UnitRamp = Field(
        default=(0.0, 1.0),
        description="shares of open sky that become 0 and 1, with a smooth step between; falling order inverts. "
        "Baked by rays from the mesh; 1 everywhere on a flat square",
    )

    def values(self, ground: Ground) -> dict[str, Value]:
        return {"levels": self.levels}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        return hashing.levels(site["occlusion"], values["levels"], 0)
