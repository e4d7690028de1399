"""Scales: overlapping rows, as on dragons, snakes and fish."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import filtering, hashing
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed

#: How far apart the places may be in which a texel is looked at, in widths of a scale.
FINEST = 1 / 20
#: Half the width of a scale where it is widest, in distances between scales of a row.
HALF_WIDTH = 0.55
#: Width of a scale's rounded edge, in distances between scales of a row.
BEVEL = 0.12
#: What of the height is the slope from root to tip and what is lost at the rounded edge, as shares.
SLOPE, ROUND = 0.75, 0.6
#: Height of the keel as a share of the scale's, and half its width as a share of the scale's half-width.
KEEL_HEIGHT, KEEL_WIDTH = 0.45, 0.35
#: Half the width of edges, in distances between scales of a row.
SHARP = 0.015
#: Where the surface faces between two axes, both lattices show from this ratio of the squared normals on.
MEETING = 0.75
#: By how much a lattice sinks where it ends, and difference of height over which the crease between two is dark; in
#: heights of a scale.
SINK, CREASE = 2.0, 0.15


class Part(IntEnum):
    """What of the scales the pattern is."""

    SCALE = 0
    GAP = 1
    VALUE = 2


Direction = Annotated[tuple[float, ...], Field(strict=False, min_length=3, max_length=3)]


class Scales(Pattern):
    """Rows of overlapping scales that point along a direction.

    Rows lie in the planes of two axes, seen along the third, by which the surface faces that way most; where it faces
    between two axes the scales of one plane give way to those of the other. Nothing of this depends on the unwrap.
    """

    spacing: float = Field(default=4.0, ge=0.01, le=1000, description="distance between the scales of a row, mm")
    length: float = Field(
        default=0.7, ge=0.2, le=4, description="distance between rows, in spacings: low is broad, high is slender"
    )
    direction: Direction = Field(
        default=(0.0, -1.0, 0.0),
        description="where the tips point, in the mesh's axes; on a tileable map the nearest of its four sides",
    )
    overlap: Unit = Field(default=0.6, description="how far a scale reaches over the next row: 0 not, 1 quite over it")
    point: Unit = Field(default=0.2, description="shape of the tips: 0 round as a fish's, 1 pointed as a snake's")
    keel: Unit = Field(default=0.0, description="height of the ridge along the middle of a scale, 0 to 1")
    gap: float = Field(default=0.15, ge=0, le=1000, description="width of the dark line around a scale's tip, mm")
    jitter: Unit = Field(default=0.3, description="disorder of places and sizes, 0 to 1")
    part: Literal["scale", "gap", "value"] = Field(
        default="scale",
        description="scale: height, from root to tip, 0 in gaps; gap: 1 in the lines around tips; "
        "value: a random value for each scale",
    )

    def size(self) -> float:
        return self.spacing * min(1.0, self.length)

    @model_validator(mode="after")
    def _points_somewhere(self) -> Scales:
        if max(abs(x) for x in self.direction) < 1e-6:
            raise ValueError("direction is 0; give it a length, as in [0, -1, 0], which points down")
        return self

    def finest(self) -> float:
        return min(FINEST * self.size(), 0.5 * self.gap) if self.part == "gap" and self.gap else FINEST * self.size()

    def widest(self) -> float:
        return 0.1 * self.size()

    def grain(self) -> float:
        return (1.6 if self.part == "value" else 0.6) * self.size()

    def values(self, ground: Ground) -> dict[str, Value]:
        spacing, columns = ground.fit(self.spacing)
        # Every second row is set off by half a scale, so rows repeat in pairs.
        pair, pairs = ground.fit(2 * self.length * spacing)
        return {
            "part": Part[self.part.upper()],
            "spacing": spacing,
            "columns": columns,
            "row": 0.5 * pair / spacing,
            "rows": 2 * pairs,
            "reach": 0.5 * pair / spacing * (1 + 0.9 * self.overlap),
            **{f"along_{axis}": _within(self.direction, k, ground.period) for k, axis in enumerate("xyz")},
            "point": self.point,
            "keel": KEEL_HEIGHT * self.keel,
            "gap": self.gap / spacing,
            "jitter": self.jitter,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        # The lattices of three planes; where two meet, the higher scale hides the other.
        position, squared = site["position"] / values["spacing"], site["normal"] ** 2
        texel = site["footprint"] / values["spacing"]
        most = np.maximum(squared.max(axis=1), 1e-12)
        best, t = np.full(len(texel), -9.0), np.zeros(len(texel))
        in_crease = {Part.SCALE: 0.0, Part.GAP: 1.0}
        for axis, name in enumerate("xyz"):
            share = hashing.smoothstep(MEETING, 1, squared[:, axis] / most)
            seen = np.flatnonzero(share > 0)
            place = position[seen][:, [(axis + 1) % 3, (axis + 2) % 3]]
            layer = np.where(site["normal"][seen, axis] < 0, axis + 3, axis)
            height, own = _rows(values, place, values[f"along_{name}"], texel[seen], layer)
            lifted = height - SINK * (1 - share[seen])
            above = lifted - best[seen]
            over = hashing.smoothstep(-0.05, 0.05, above)
            t[seen] = (1 - over) * t[seen] + over * own
            if values["part"] in in_crease:
                clear = hashing.smoothstep(0, CREASE, np.abs(above))
                t[seen] = (1 - clear) * in_crease[values["part"]] + clear * t[seen]
            best[seen] = np.maximum(best[seen], lifted)
        return t


def _within(direction: tuple[float, ...], axis: int, period: float | None) -> tuple[float, float]:
    """Return the direction within the plane across an axis: unit length along the two axes that follow it."""
    x, y = direction[(axis + 1) % 3], direction[(axis + 2) % 3]
    length = math.hypot(x, y)
    if length < 1e-3 * max(abs(component) for component in direction):
        # It points out of the plane: any other does; downwards where that is possible, else backwards.
        x, y = [(-1.0, 0.0), (-1.0, 0.0), (0.0, -1.0)][axis]
        length = 1.0
    x, y = x / length, y / length
    if period is not None:
        x, y = (math.copysign(1, x), 0.0) if abs(x) >= abs(y) else (0.0, math.copysign(1, y))
    return x, y


def _rows(
    values: Mapping[str, Any], place: Array, along: tuple[float, float], texel: Array, layer: Array
) -> tuple[Array, Array]:
    """Return height and pattern of one plane's scales, each drawn over those of the rows towards which it points."""
    length, reach, jitter = values["row"], values["reach"], values["jitter"]
    row, down = hashing.split((place[:, 0] * along[0] + place[:, 1] * along[1]) / length)
    sideways = place[:, 1] * along[0] - place[:, 0] * along[1]
    height, own = np.zeros(len(texel)), np.full(len(texel), 0.5 if values["part"] == Part.VALUE else 0.0)
    wide = np.sqrt((KEEL_WIDTH * HALF_WIDTH) ** 2 + 7 / 12 * texel**2)
    for ahead in (1, 0, -1, -2):
        off = 0.5 * ((row + ahead) % 2)
        column, right = hashing.split(sideways - off)
        for beside in (0, 1):
            cell = np.stack(
                [
                    hashing.wrap_cell(np.stack([column + beside, row, row], -1), values["columns"])[:, 0],
                    hashing.wrap_cell(np.stack([row + ahead, row, row], -1), values["rows"])[:, 0],
                    layer,
                ],
                axis=-1,
            )
            random = hashing.hash_cell(cell, values["seed"])
            size = 1 - 0.3 * jitter * random[:, 2]
            a = (down - ahead - 0.5 * jitter * (random[:, 0] - 0.5)) * length
            b = right - beside - 0.3 * jitter * (random[:, 1] - 0.5)
            inside = _inside(a / reach, np.abs(b) / HALF_WIDTH, size, reach, values["point"])
            alpha = filtering.soft_step(inside, SHARP, texel)
            rim = filtering.soft_step(inside + values["gap"], SHARP, texel)
            ramp = np.clip(1 - (reach - a) / (2 * length), 0, 1)
            dome = 1 - 0.5 * np.minimum((b / HALF_WIDTH) ** 2, 1)
            ridge = KEEL_WIDTH * HALF_WIDTH / wide * np.maximum(1 - (b / wide) ** 2, 0) ** 2
            body = (1 - values["keel"]) * (1 - SLOPE + SLOPE * ramp) * dome
            body = body + values["keel"] * (0.3 + 0.7 * ramp) * ridge
            edge = (1 - ROUND) * alpha + ROUND * filtering.soft_step(inside - 0.5 * BEVEL, 0.5 * BEVEL, texel)
            height = (1 - rim) * height + body * edge
            if values["part"] == Part.GAP:
                own = (1 - rim) * own + rim - alpha
            elif values["part"] == Part.VALUE:
                own = (1 - alpha) * own + alpha * random[:, 3]
    return height, height if values["part"] == Part.SCALE else own


def _inside(a: Array, b: Array, size: Array, reach: float, point: float) -> Array:
    """Return about how far inside a scale's outline a place is, in distances between scales of a row.

    The outline is between an ellipse and a rhombus; dividing by the slope makes of its function a distance.
    """
    round_ = np.sqrt(np.maximum(a * a + b * b, 1e-6))
    slope_a = ((1 - point) * np.abs(a) / round_ + point) / reach
    slope_b = ((1 - point) * b / round_ + point) / HALF_WIDTH
    outline = (1 - point) * round_ + point * (np.abs(a) + b)
    return (size - outline) / np.sqrt(np.maximum(slope_a**2 + slope_b**2, 1e-2))
