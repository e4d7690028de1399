"""Scars: long healed cuts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from skincli.layers import hashing, marks
from skincli.layers.base import Array, Ground, Pattern, Site, Unit, Value, joint_seed


class Part(IntEnum):
    """What of a scar is drawn."""

    LINE = 0
    PUCKERS = 1
    STITCHES = 2


#: Half the length of a stitch, in widths of the scar.
STITCH = 1.6
#: Half the width of a stitch or a pucker, in intervals between them.
THREAD = 0.4
#: Texels larger than this, in intervals, are looked at in several places.
FINEST = 0.3
#: Mean over an interval of a bump with that half width: twice the integral of (1 - x²)⁴ from 0 to 1, 128 / 315.
THREADS_MEAN = 2 * THREAD * 128 / 315


class Scars(Pattern):
    """Sparse long marks of random direction: the scar, the puckers across it, or stitches; layers of one seed meet."""

    part: Literal["line", "puckers", "stitches"] = Field(
        default="line",
        description="what is 1: the scar, the folds that pull together across it, or the marks of stitches",
    )
    spacing: float = Field(default=40.0, ge=0.01, le=10000, description="mean distance between scars, mm")
    length: float = Field(default=25.0, gt=0, le=10000, description="length, mm, at most twice the spacing")
    width: float = Field(default=2.0, gt=0, le=10000, description="width, mm, at most half the length")
    interval: float = Field(
        default=2.0, gt=0, le=1000, description="distance between puckers or stitches, mm, at most half the length"
    )
    bend: Unit = Field(default=0.3, description="how far the most crooked bulge aside, relative to half the length")
    variation: Unit = Field(default=0.5, description="how much weaker some are: 0 equal, 1 down to nothing")

    @model_validator(mode="after")
    def _fits(self) -> Scars:
        limits = {
            "length": (2 * self.spacing, "twice the spacing"),
            "width": (0.5 * self.length, "half the length"),
            "interval": (0.5 * self.length, "half the length"),
        }
        for name, (most, words) in limits.items():
            if getattr(self, name) > most:
                raise ValueError(
                    f"{name} is {getattr(self, name):g} mm, more than {words}, {most:g} mm; "
                    f"lower {name} to {most:g} mm or less"
                )
        return self

    def size(self) -> float:
        return self.spacing

    def finest(self) -> float:
        return (
            marks.FINEST * self.spacing
            if self.part == "line"
            else min(marks.FINEST * self.spacing, FINEST * self.interval)
        )

    def values(self, ground: Ground) -> dict[str, Value]:
        cell, period = ground.fit(self.spacing)
        return {
            "part": Part[self.part.upper()],
            "cell": cell,
            "period": period,
            "reach": 0.5 * self.length / cell,
            "radius": 0.5 * self.width / cell,
            "stitch": STITCH * self.width / cell,
            "interval": self.interval / cell,
            "thread": THREAD * self.interval / cell,
            "threads_mean": THREADS_MEAN,
            "bend": self.bend,
            "variation": self.variation,
            "seed": joint_seed(ground.seed, self.seed),
        }

    @classmethod
    def twin(cls, values: Mapping[str, Any], site: Site, textures: Sequence[Array]) -> Array:
        normal, reach, interval, thread = (site["normal"], *(values[key] for key in ("reach", "interval", "thread")))
        texel = site["footprint"] / values["cell"]
        half_width = values["stitch"] if values["part"] == Part.STITCHES else values["radius"]
        wide2, long2, line2 = (marks.widened2(size, texel)[:, None] for size in (half_width, reach, thread))
        bow = values["bend"] * reach
        found = marks.find_marks(
            site["position"] / values["cell"],
            normal,
            marks.disk(normal, np.sqrt(long2 + wide2)[:, 0] + bow),
            values["period"],
            1.0,
            values["seed"],
        )
        more = found.more_random()
        axis = marks.along_surface(2 * more[..., :3] - 1, normal[:, None])
        ahead = np.sum(found.along * axis, axis=-1)
        u = np.clip(ahead / reach, -1, 1)
        across = np.sum(found.along * np.cross(normal[:, None], axis), axis=-1)
        across = across + bow * (2 * more[..., 3] - 1) * (u**2 - 0.3)
        t = half_width * reach / np.sqrt(wide2 * long2) * marks.bump(ahead**2 / long2 + across**2 / wide2)
        if values["part"] != Part.LINE:
            to_line = ((ahead / interval + found.random[..., 3]) % 1 - 0.5) * interval
            line = thread / np.sqrt(line2) * marks.bump(to_line**2 / line2)
            resolved = 1 - hashing.smoothstep(0.25, 0.5, texel / interval)[:, None]
            t = t * ((1 - resolved) * values["threads_mean"] + resolved * line)
        untouched = np.prod(1 - found.near * (1 - values["variation"] * found.random[..., 3]) * t, axis=1)
        return 1 - untouched
