"""Shapes as a texel sees them, averaged over its area: the twin of shaders/lib/filter.glsl; not a layer itself.

A shape that is drawn without regard to the texel turns into false patterns, and a map of twice the resolution, averaged
2x2, is another picture. Two means against it are here. An edge or a disk can be widened so that its mean and its
variance are those of the shape averaged over a texel; for straight edges and for disks of any size this is exact up to
fourth moments. Whatever is made of several shapes that hide each other is looked at in several places of a texel; as
the places of a coarse texel are those of the four finer ones, both resolutions agree by construction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skincli.layers import hashing
from skincli.layers.base import Site

Array = NDArray[np.float64]

#: Half the width, in texels, of the step that a hard edge becomes: a smoothstep of half-width e has the variance
#: e*e/5, a texel 1/12.
EDGE_PER_TEXEL = 0.6455


def soft_step(d: Array, softness: Array | float, texel: Array | float) -> Array:
    """Return 0 to 1 where d rises through 0, over half a width that is the softness or the texel, whichever counts."""
    half_width = np.sqrt(softness**2 + (EDGE_PER_TEXEL * np.asarray(texel)) ** 2)
    return hashing.smoothstep(-half_width, half_width, d)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Disk:
    """What a texel makes of disks.

    Parameters
    ----------
    radius : mean radius of the edge
    edge : half the width of the edge
    strength : value inside, 0 to 1
    """

    radius: Array
    edge: Array
    strength: Array

    def reach(self) -> Array:
        """Return how far each disk reaches."""
        return self.radius + self.edge

    def at(self, away: Array) -> Array:
        """Return the share of the texel that each disk covers whose center is `away` from the texel's."""
        low, high = self.radius - self.edge, self.radius + self.edge
        return self.strength * (1 - hashing.smoothstep(low, high, away))  # type: ignore[arg-type, operator]


def disk_of(radius: Array, softness: Array, texel: Array) -> Disk:
    """Return what texels make of disks; all lengths in one unit, of shapes that broadcast.

    A disk whose edge is a smoothstep of half-width e about radius r has the mass pi (r^2 + e^2 / 5). Averaged over a
    texel its edge widens while the mass stays. Once the edge reaches the center, the shape stays and grows with the
    texel, and so much weaker that the mass still stays.

    Parameters
    ----------
    radius : of the middle of the edge
    softness : half the width of the edge, at most the radius
    texel : size of a texel
    """
    radius, softness, texel = np.broadcast_arrays(radius, softness, texel)
    mass = radius**2 + 0.2 * softness**2
    room = 2 * (radius**2 - softness**2)
    narrow = texel**2 < room
    spread = np.maximum(mass * 5 / 6 + 0.175 * (texel**2 - room), 1e-12)
    edge = np.maximum(np.sqrt(softness**2 + 5 / 12 * texel**2), 1e-6)
    return Disk(
        np.where(narrow, np.sqrt(np.maximum(radius**2 - texel**2 / 12, 0)), np.sqrt(spread)),
        np.where(narrow, edge, np.sqrt(spread)),
        np.where(narrow, 1.0, mass / (1.2 * spread)),
    )


@dataclass(frozen=True)
class Looks:
    """Texels that are looked at in equally many places.

    Parameters
    ----------
    chosen : (n,) which texels of all they are
    site : these m texels
    count : places along each side of a texel
    steps : count**2 arrays (m, 3), from the center of a texel to each of its places, mm
    """

    chosen: NDArray[np.bool_]
    site: Site
    count: int
    steps: list[Array]

    def reach(self) -> Array:
        """Return (m,): from the center of a texel to the farthest of its places, mm."""
        return 0.70711 * (1 - 1 / self.count) * self.site["footprint"]


def looks(site: Site, finest: float, most: int) -> Iterator[Looks]:
    """Part texels by the number of places in which each must be looked at.

    Parameters
    ----------
    site : the texels
    finest : mm, how far apart the places of a texel may be
    most : how many there are along its side at most, a power of 2
    """
    footprint, count = site["footprint"], 1
    while count <= most:
        fewer = footprint <= finest * count / 2 if count > 1 else np.zeros(len(footprint), bool)
        chosen = ~fewer & ((footprint <= finest * count) | (count == most))
        if chosen.any():
            part: Site = {key: array[chosen] for key, array in site.items()}  # type: ignore[assignment, index]
            offsets = (np.arange(count) + 0.5) / count - 0.5
            across, along = _frame(part["normal"])
            steps = [part["footprint"][:, None] * (x * across + y * along) for y in offsets for x in offsets]
            yield Looks(chosen, part, count, steps)
        count *= 2


def sampled(site: Site, finest: float, most: int, look: Callable[[Site], Array]) -> Array:
    """Return the mean of what `look` returns at several places of each texel, each of them a texel of its own."""
    result = np.empty(len(site["footprint"]))
    for part in looks(site, finest, most):
        small: Site = {**part.site, "footprint": part.site["footprint"] / part.count}
        values = [look({**small, "position": small["position"] + step}) for step in part.steps]
        result[part.chosen] = np.mean(values, axis=0)
    return result


def _frame(normal: Array) -> tuple[Array, Array]:
    """Return two (n, 3) unit vectors along the surface [Duff2017, "Building an Orthonormal Basis, Revisited"]."""
    x, y, z = normal.T
    side = np.where(z < 0, -1.0, 1.0)
    a = -1 / (side + z)
    b = x * y * a
    return np.column_stack([1 + side * x * x * a, side * b, -side * x]), np.column_stack([b, side + y * y * a, -y])
