"""Patterns as a texel sees them, averaged over its area: the twin of shaders/lib/filter.glsl; not a layer itself.

A pattern that is drawn without regard to the texel turns into false patterns, and a map of twice the resolution,
averaged 2x2, is another picture. Three means against it are here. An edge or a disk can be widened so that its mean and
its variance are those of the shape averaged over a texel; for straight edges and for disks of any size this is exact up
to fourth moments. Texels that are large for a pattern are looked at in several places. Where these no longer suffice
either, patterns have given way to their mean: so slowly that from one resolution to the next, of which the coarser
shows more of the mean, hardly anything changes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from skincli.layers import hashing, remap
from skincli.layers.base import Ground, Pattern, Site, Value
from skincli.layers.base import site as site_of

Array = NDArray[np.float64]

#: Half the width, in texels, of the step that a hard edge becomes: a smoothstep of half-width e has the variance
#: e*e/5, a texel 1/12.
EDGE_PER_TEXEL = 0.6455
#: Places along a side of a texel at most: where features are larger than it, and where they are not. A prime number:
#: places of texels that are as large as some of a lattice's cells shall not fall on like places of the cells.
PLACES, MOST_PLACES = 8, 13
#: Size of a texel from which on it is looked at in the most places, and of one that shows the mean alone, in sizes of
#: the pattern's features.
MOST_FROM = 0.7
LAST = 12.0
#: Steep curves are looked at in places by so much closer at most.
STEEPEST = 8.0
#: Points whose mean is taken for that of a pattern: in space, and on the plane of flat squares, which counts most.
IN_SPACE, ON_PLANE = 2048, 8192


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
class Band:
    """How a pattern is averaged over texels that are large for it.

    Parameters
    ----------
    finest : size of a texel that one place stands for well enough, mm
    widest : size up to which places grow with the texel, mm
    small : size of a texel from which on it is looked at in the most places, mm
    last : size of a texel that shows the mean alone, mm
    mean : on surfaces of all directions
    flat : on the plane z = 0, in which flat squares lie, and which meets lattices at one height
    """

    finest: float
    widest: float
    small: float
    last: float
    mean: float
    flat: float

    def members(self) -> dict[str, tuple[float, ...]]:
        """Return what the shader reads, by name."""
        return {"band": (self.finest, self.widest, self.small, self.last), "mean": (self.mean, self.flat)}

    def shown(self, footprint: Array) -> Array:
        """Return how much of the pattern texels show, the rest being its mean: 1 to 0.

        The mean over a texel differs the less from that of the pattern the larger the texel, so that the pattern may
        fade the faster.
        """
        x = footprint / self.last
        return np.maximum(1 - np.sqrt(x * np.sqrt(x * np.sqrt(x))), 0)

    def places(self, footprint: Array) -> NDArray[np.int64]:
        """Return in how many places along each side texels are looked at."""
        count = places_of(footprint, self.finest)
        return np.where((count == PLACES) & (footprint > self.small), MOST_PLACES, count)

    def mean_at(self, normal: Array) -> Array:
        """Return (n,) the mean where the surface has these (n, 3) normals."""
        return self.mean + (self.flat - self.mean) * hashing.smoothstep(0.98, 1, normal[:, 2] ** 2)


def band_of(layer: Pattern, ground: Ground) -> Band | None:
    """Return how a pattern is averaged; None for one whose function does it."""
    finest = layer.finest()
    if finest is None:
        return None
    values = {**layer.values(ground), "seed": 0}
    mean, flat = _means(type(layer), tuple(values.items()), layer.curve, layer.size())
    # What is pulled about leaves the plane.
    flat += (mean - flat) * min(2 * layer.warp / layer.size(), 1.0)
    widest, grain = layer.widest(), layer.grain()
    if layer.curve is not None:
        # A curve knows nothing of averages; and the stronger the contrast, the more slowly a pattern must fade.
        steep = min(max(float(np.abs(remap.slopes(layer.curve)).max()), 1.0), STEEPEST)
        finest /= steep
        widest = min(widest, finest)
        grain *= steep**0.25
    return Band(finest, max(widest, finest), MOST_FROM * layer.size(), LAST * grain, mean, flat)


@cache
def _means(
    layer: type[Pattern], values: tuple[tuple[str, Value], ...], curve: remap.Points | None, size: float
) -> tuple[float, float]:
    """Return the means of a pattern in space and on the plane z = 0, known to about 0.01 and 0.005."""
    random = hashing.hash_cell(np.arange(IN_SPACE)[:, None] * np.array([1, 0, 0]), 0)
    normal = random[:, [3, 0, 1]] - 0.5
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # In even distances, about as many as there are features.
    steps = np.arange(ON_PLANE)
    plane = np.sqrt(ON_PLANE) * np.column_stack([steps / ON_PLANE, steps * 0.6180339887 % 1, 0 * steps])
    up = np.broadcast_to([0.0, 0.0, 1.0], plane.shape)
    found = []
    for position, direction in ((1000 * random[:, :3], normal), (plane, up)):
        points = site_of(position * size, direction, np.zeros(len(position)))
        t = _remapped(layer.twin(dict(values), points, ()), curve)
        found.append(float(np.mean(t)) / max(float(np.mean(layer.local(dict(values), points))), 1e-9))
    return found[0], found[1]


def _remapped(t: Array, curve: remap.Points | None) -> Array:
    return t if curve is None else remap.remap(curve, t)


def seen(layer: Pattern, ground: Ground, site: Site, textures: Sequence[Array]) -> Array:
    """Return the twin of what a skin shows of a layer: averaged over texels, and remapped.

    Returns
    -------
    (n,) for a float kernel, (n, 4) for a vec4 kernel
    """
    values, band = layer.values(ground), band_of(layer, ground)
    if band is None:
        t = layer.twin(values, site, textures)
        if layer.curve is None or layer.curve_is_in_texture():
            return t
        if t.ndim > 1:
            return np.column_stack([t[:, :3], remap.remap(layer.curve, t[:, 3])])
        return remap.remap(layer.curve, t)
    shown = band.shown(site["footprint"])
    t = band.mean_at(site["normal"]) * layer.local(values, site)
    counts = np.where(shown > 0, band.places(site["footprint"]), 0)
    for count in np.unique(counts[counts > 0]):
        chosen = counts == count
        part: Site = {key: array[chosen] for key, array in site.items()}  # type: ignore[assignment, index]
        place: Site = {**part, "footprint": np.minimum(part["footprint"] / count, band.widest)}
        looks = (
            layer.twin(values, {**place, "position": part["position"] + step}, textures)
            for step in places_in_texel(part["normal"], part["footprint"], count)
        )
        mean = sum(_remapped(look, layer.curve) for look in looks) / count**2
        t[chosen] += shown[chosen] * (mean - t[chosen])
    return t


def places_of(footprint: Array, finest: float) -> NDArray[np.int64]:
    """Return in how many places along each side texels are looked at, so that these are at most `finest` apart."""
    return 2 ** np.sum(footprint[:, None] > finest * 2 ** np.arange(PLACES.bit_length() - 1), axis=1)


def places_in_texel(normal: Array, footprint: Array, count: int) -> Iterator[Array]:
    """Yield (n, 3): from the center of texels to each of their count * count places, mm."""
    across, along = _frame(normal)
    offsets = (np.arange(count) + 0.5) / count - 0.5
    for x, y in product(offsets, offsets):
        yield footprint[:, None] * (x * across + y * along)


def _frame(normal: Array) -> tuple[Array, Array]:
    """Return two (n, 3) unit vectors along the surface [Duff2017, "Building an Orthonormal Basis, Revisited"]."""
    x, y, z = normal.T
    side = np.where(z < 0, -1.0, 1.0)
    a = -1 / (side + z)
    b = x * y * a
    return np.column_stack([1 + side * x * x * a, side * b, -side * x]), np.column_stack([b, side + y * y * a, -y])
