"""The curvature of the mesh as a pattern."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field

from skincli.layers import hashing
from skincli.layers.base import Array, Ground, Site, Value
from skincli.layers.still import Still

PerMillimetre = Annotated[float, Field(ge=-100, le=100)]


class Curvature(Still):
    """Curvature of the mesh: tells ridges from hollows. From a bake of the mesh; 0 on a flat square."""

    reads: ClassVar[frozenset[str]] = frozenset({"curvature"})

    levels: Annotated[tuple[PerMillimetre, ...], Field(strict=False, min_length=2, max_length=2)] = Field(
        default=(0.0, 0.1),
        description="mean curvatures that become 0 and 1, 1/mm, positive where convex (1/radius on a sphere), with a "
        "smooth step between; falling order inverts. Baked by rays from the mesh; 0 everywhere on a flat square",
    )

    def values(self, ground: Ground) -> dict[str, Value]:
        return {"levels": self.levels}

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        return hashing.levels(site["curvature"], values["levels"], 0)
