"""Patterns that follow the mesh or its uv, not places in space; not a layer itself."""

from __future__ import annotations

from abc import abstractmethod

from pydantic import model_validator

from skincli.layers.base import Ground, Pattern, Value


class Still(Pattern):
    """A pattern that does not look at the position, so that nothing can pull it about."""

    @model_validator(mode="after")
    def _stays(self) -> Still:
        if self.warp > 0 or self.warp_scale is not None:
            raise ValueError(
                f"{self.kind()} does not follow the position, which warp moves; remove warp and warp_scale"
            )
        return self

    def size(self) -> float:
        raise AssertionError("only what is warped is asked for its size")

    @abstractmethod
    def values(self, ground: Ground) -> dict[str, Value]: ...
