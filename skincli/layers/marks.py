"""Marks scattered over a surface, the twin of shaders/lib/marks.glsl; not a layer itself.

Marks are the points of a jittered body-centered lattice, two per cell, that lie near the surface, projected onto it
along the normal. So they keep their shape on any form, and no seam of the unwrap shows. Lengths are in cells; per area
of one cell squared there is one mark, so that a cell is as large as the marks are apart.

In a shader all marks that may reach the site are walked through like this:

    float texel = site.footprint / p.cell;
    float wide2 = widened2(p.radius, texel);
    float untouched = 1.0;
    Marks marks = find_marks(site.position / p.cell, site.normal, sqrt(wide2));
    for (ivec3 cell = marks.first; cell.z <= marks.last.z; cell = next_cell(marks, cell)) {
        vec4 random = hash_marks(marks, cell, p.period, p.seed);
        for (int which = 0; which < 2; ++which) {
            Mark mark = mark_of(marks, cell, random, which, p.jitter, site.normal);
            float bump = mark_bump(dot(mark.along, mark.along) / wide2);
            untouched *= 1.0 - mark.near * p.radius * p.radius / wide2 * bump;
        }
    }
    return 1.0 - untouched;

and in its twin, where the marks are a second axis, those out of reach among them:

    texel = site["footprint"] / cell
    wide2 = marks.widened2(radius, texel)
    extent = marks.disk(site["normal"], np.sqrt(wide2))
    found = marks.find_marks(site["position"] / cell, site["normal"], extent, period, jitter, seed)
    bump = marks.bump(found.squared() / wide2[:, None])
    return 1 - np.prod(1 - found.near * radius**2 / wide2[:, None] * bump, axis=1)

A mark must not reach farther than what is searched: the cells are then all that can hold one, at most 8 for radii up
to 0.4 and fewer for small ones, and more where marks are widened for large texels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from skincli.layers import hashing

Array = NDArray[np.float64]

#: A mark farther from the surface than this does not show, in cells.
SHELL = 0.3
#: Where in its layer of cells a flat square lies: by one of the two lattices, and with all its marks in that layer.
ASIDE = 0.3125
#: A mark nearer to the surface than this shows in full, in cells.
CORE = 0.2

#: Marks whose shape widens only roughly, or that hide each other, are looked at in several places of a texel larger
#: than this, in cells.
FINEST = 0.15


def _points_somewhere(direction: tuple[float, ...]) -> tuple[float, ...]:
    if not any(direction):
        raise ValueError("the direction is [0, 0, 0]; at least one number must differ from 0, as in [1, 0, 0]")
    return direction


_Coordinate = Annotated[float, Field(ge=-1, le=1)]

#: A field that holds a direction in the space of the mesh; its length says nothing.
Direction = Annotated[
    tuple[_Coordinate, ...], Field(strict=False, min_length=3, max_length=3), AfterValidator(_points_somewhere)
]


def unit(direction: tuple[float, ...]) -> tuple[float, ...]:
    """Return a direction of length 1."""
    length = float(np.linalg.norm(direction))
    return tuple(coordinate / length for coordinate in direction)


@dataclass(frozen=True)
class Marks:
    """The marks about n places, m for each.

    Parameters
    ----------
    along : (n, m, 3) from the place to the mark's center, along the surface, in cells
    near : (n, m) 1 where the mark shows in full, 0 where it is too far above or below the surface
    random : (n, m, 4) numbers in [0, 1); the first three have placed the mark and only their finer digits are free
    """

    along: Array
    near: Array
    random: Array

    def squared(self) -> Array:
        """Return (n, m): the squared distance to the mark's center along the surface."""
        return np.sum(self.along**2, axis=-1)

    def more_random(self) -> Array:
        """Return (n, m, 4) further numbers in [0, 1), for all practical purposes independent of `random`."""
        return 16 * self.random % 1


def find_marks(x: Array, normal: Array, extent: Array, period: int, jitter: float, seed: int) -> Marks:
    """Return all marks that can reach some places.

    Parameters
    ----------
    x : (n, 3) places, in cells
    normal : (n, 3) unit vectors
    extent : (n, 3) how far from a place the centers of its marks are at most along the three axes, in cells: see
        `disk` and `box`
    period : after how many cells along x and y the marks repeat; 0: never
    jitter : disorder, 0 to 1
    seed : of the hash
    """
    home, fraction = hashing.split(x + ASIDE)
    # The box of the place that needs the largest serves all: what is out of reach shows nowhere.
    first = np.floor(fraction - extent).min(axis=0).astype(int)
    last = np.floor(fraction + extent).max(axis=0).astype(int)
    axes = [np.arange(low, high + 1) for low, high in zip(first, last, strict=True)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    hashed = hashing.hash_cell(hashing.wrap_cell(home[:, None] + cells, period), seed)
    random = np.stack([hashed, 4096 * hashed % 1], axis=2)
    center = np.array([[0.25 + 0.125 * jitter], [0.75 - 0.125 * jitter]])
    to = cells[:, None] + center + 0.75 * jitter * (random[..., :3] - 0.5) - fraction[:, None, None]
    to, random = to.reshape(len(x), -1, 3), random.reshape(len(x), -1, 4)
    height = np.einsum("nmi,ni->nm", to, normal)
    near = 1 - hashing.smoothstep(CORE, SHELL, np.abs(height))
    return Marks(to - height[..., None] * normal[:, None], near, random)


def require_room(name: str, size: float, spacing: float, share: float = 1.0) -> None:
    """Refuse marks that are too large for the distance between them; all lengths in mm.

    Parameters
    ----------
    name, size : of the setting
    spacing : mean distance between marks
    share : of the spacing that the setting may be at most, 1 or 0.5

    Raises
    ------
    ValueError
        If the setting is larger.
    """
    if size > share * spacing:
        most = "half of spacing" if share < 1 else "spacing"
        raise ValueError(f"{name} is {size:g} mm, more than {most}, {spacing:g} mm; lower {name} or raise spacing")


def disk(normal: Array, radius: Array | float) -> Array:
    """Return the (n, 3) extent of marks that reach `radius`, (n,), along the surface."""
    return np.reshape(radius, (-1, 1)) * np.sqrt(np.maximum(1 - normal**2, 0)) + SHELL * np.abs(normal)


def box(normal: Array, axis: Array, side: Array, long: Array, short: Array) -> Array:
    """Return the (n, 3) extent of marks that reach `long` along the vectors `axis` and `short` along `side`."""
    return long[:, None] * np.abs(axis) + short[:, None] * np.abs(side) + SHELL * np.abs(normal)


def along_surface(direction: Array, normal: Array) -> Array:
    """Return the part of directions along the surface, of unit length; zero where there is none.

    Parameters
    ----------
    direction : (..., 3)
    normal : (..., 3) unit vectors
    """
    along = direction - np.sum(direction * normal, axis=-1, keepdims=True) * normal
    return along / np.sqrt(np.maximum(np.sum(along**2, axis=-1, keepdims=True), 1e-12))


def bump(squared: Array) -> Array:
    """Return the shape of a soft mark at a squared distance of 1 at its border."""
    return np.maximum(1 - squared, 0) ** 4


#: Farthest border of a mark that is `out_of_round`.
OUT_OF_ROUND = 1.21


def out_of_round(along: Array, pull: Array, amount: float) -> Array:
    """Return squared distances from the centers of marks of radius 1 that are not round.

    Parameters
    ----------
    along : (..., 3) from the place to the center
    pull : (..., 3) towards where the mark is pulled, coordinates -1 to 1
    amount : how far, 0 to 1
    """
    squared = np.sum(along**2, axis=-1)
    # |along·pull| is at most √3 |along|, and |along| / (1 + |along|²) at most 1/2: the factor is 0.69 or more.
    return squared * (1 - 0.35 * amount * np.sum(along * pull, axis=-1) / (1 + squared))


def widened2(radius: Array | float, texel: Array) -> Array:
    """Return the squared radius of a bump seen through texels; weakened by the ratio of the areas it keeps its mean.

    The variance of a bump along an axis is radius² / 12, that of a texel's square texel² / 12; they add up.
    """
    return radius**2 + texel**2
