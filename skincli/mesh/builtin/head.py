"""The built-in head: a life-size bust sculpted from smoothly joined forms, with lids, lips, nostrils and ears.

Coordinates are mm, Y up, the face looks to +Z, +X is the subject's left. The surface is one fixed smooth function of a
plane index domain; a level of detail only samples it.

Rays leave an axis inside the head; where they meet the forms (`_solid`) lies the gross surface. Its domain has five
patches like a box without a bottom: i runs round the head (0 at the face, 44 at the back), j runs from the crown's
border (0) to the bust's rim (44), and the crown is a patch of its own. Lids and lips are folds of the rows of one j,
nostrils and ears are disks of the domain that are drawn in and out. The bottom is closed by a flat cap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter1d, map_coordinates

from skincli.mesh.builtin.flatten import charts, cut, flatten, half_edges, pack, relax
from skincli.mesh.builtin.levels import DETAILS
from skincli.mesh.model import Mesh, Part

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# ---------------------------------------------------------------------------------------------------------------------
# Forms: signed distances in mm, negative inside.


def _blend(a: Floats, b: Floats, width: float) -> Floats:
    """Union of two forms, the joint filled smoothly within `width` mm (I. Quilez, "Smooth minimum")."""
    width = 1.6 * width
    h = np.maximum(width - np.abs(a - b), 0) / width
    return np.minimum(a, b) - h * h * h * (width / 6)


def _carve(a: Floats, b: Floats, width: float) -> Floats:
    """The first form without the second."""
    return -_blend(-a, b, width)


def _ellipsoid(
    p: Floats, center: tuple[float, float, float], radii: tuple[float, float, float], tilt: float = 0
) -> Floats:
    """Distance to an ellipsoid to first order; `tilt` turns it about X, in degrees, its top going backward."""
    q = p - np.array(center)
    if tilt:
        c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
        q = np.stack([q[:, 0], c * q[:, 1] - s * q[:, 2], s * q[:, 1] + c * q[:, 2]], axis=1)
    scaled = q / np.array(radii)
    k = np.sqrt(np.einsum("ij,ij->i", scaled, scaled) + 1e-9)
    steep = scaled / np.array(radii)
    slope = np.sqrt(np.einsum("ij,ij->i", steep, steep) + 1e-12)
    return k * (k - 1) / slope


@cache
def _curve(nodes: tuple[tuple[float, ...], ...]) -> Floats:
    """Return about evenly spaced points of the smooth curve through nodes; a straight pair stays a pair."""
    table = np.array(nodes, dtype=float)
    if len(table) < 3:
        return table
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(table[:, :3], axis=0), axis=1))])
    return CubicSpline(length, table, bc_type="natural")(np.linspace(0, length[-1], 4 * len(table)))


def _nearest(p: Floats, table: Floats) -> tuple[Floats, Floats]:
    """Return squared distance to a curve's nearest point, and what else the curve carries there.

    Between the points of a bent curve the nearest one glides, so that no crease shows where it changes.
    """
    if len(table) == 2:
        axis = table[1] - table[0]
        t = np.clip((p - table[0, :3]) @ axis[:3] / max(axis[:3] @ axis[:3], 1e-9), 0, 1)
        at = table[0] + t[:, None] * axis
    else:
        gap = np.sum((table[1] - table[0])[:3] ** 2)
        squared = np.sum(table[:, :3] ** 2, axis=1) - 2 * p @ table[:, :3].T
        weight = np.exp(-(squared - squared.min(axis=1, keepdims=True)) / gap)
        at = weight @ table / weight.sum(axis=1, keepdims=True)
    away = p - at[:, :3]
    return np.einsum("ij,ij->i", away, away), at[:, 3:]


def _bound(p: Floats, table: Floats) -> Floats:
    """Return a lower bound on the distance from a curve."""
    center = (table[:, :3].min(axis=0) + table[:, :3].max(axis=0)) / 2
    away = p - center
    return np.sqrt(np.einsum("ij,ij->i", away, away)) - np.linalg.norm(table[:, :3] - center, axis=1).max()


def _rope(p: Floats, *nodes: tuple[float, float, float, float]) -> Floats:
    """Distance to a rope through nodes (x, y, z, radius); farther than any joint is wide, a lower bound is enough."""
    table = _curve(nodes)
    result = _bound(p, table) - table[:, 3].max()
    near = result < 110
    squared, radius = _nearest(p[near], table)
    result[near] = np.sqrt(squared) - radius[:, 0]
    return result


def _stroke(p: Floats, radius: float, height: float, *nodes: tuple[float, float, float]) -> Floats:
    """A stroke of the thumb along a curve: clay laid on (height > 0 mm) or pressed away."""
    table = _curve(nodes) if len(nodes) > 1 else np.array(nodes * 2, dtype=float)
    near = _bound(p, table) < 5 * radius
    result = np.zeros(len(p))
    result[near] = -height * np.exp(-_nearest(p[near], table)[0] / radius**2)
    return result


def _solid(points: Floats) -> Floats:
    """The bust without ears, folds and pits: signed distance of (n, 3) points in mm, about true near the surface."""
    p = points.copy()
    # A face is never quite its own mirror image.
    p[:, 0] += 0.7 * np.exp(-((points[:, 1] + 42) ** 2) / 30**2 - (points[:, 2] - 110) ** 2 / 40**2) - 0.25
    m = p.copy()
    m[:, 0] = np.sqrt(p[:, 0] ** 2 + 2.0**2)  # the mirrored half, smooth across the middle

    f = _ellipsoid(p, (0, 40, -14), (72, 79, 86))
    f = _blend(f, _ellipsoid(p, (0, 34, -42), (62, 60, 57)), 40)
    f = _blend(f, _ellipsoid(p, (0, 46, 24), (59, 57, 63)), 30)
    # Face: upper jaw, cheekbones, lower jaw, chin.
    f = _blend(f, _ellipsoid(p, (0, -38, 38), (50, 62, 46)), 26)
    f = _blend(f, _rope(m, (33, -20, 65, 10), (53, -17, 44, 10), (63, -13, 18, 6), (66, -11, -4, 4)), 26)
    f = _blend(f, _rope(m, (56, 0, -14, 13.5), (56, -34, -10, 13.5)), 32)
    f = _blend(f, _rope(m, (56, -28, 2, 12), (43, -78, 10, 12), (26, -100, 46, 13), (8, -106, 72, 14)), 26)
    f = _blend(f, _ellipsoid(p, (0, -98, 38), (26, 18, 38)), 16)
    f = _blend(f, _ellipsoid(m, (29, -64, 42), (19, 28, 28)), 20)
    f = _blend(f, _ellipsoid(m, (41, -45, 25), (20.5, 36, 31)), 22)
    f = _blend(f, _ellipsoid(p, (0, -105, 76), (17, 14, 17)), 14)
    f = _blend(f, _ellipsoid(p, (0, -74, 62), (35, 30, 27)), 20)
    # Neck and shoulders.
    neck = _rope(p, (0, -40, -25, 47), (0, -200, -33, 54))
    nape = np.stack([np.sqrt(p[:, 0] ** 2 + 14.0**2), p[:, 1], p[:, 2]], axis=1)  # without a furrow in the middle
    neck = _blend(neck, _rope(nape, (26, -28, -49, 18), (33, -190, -54, 20)), 44)
    neck = _blend(neck, _rope(m, (16, -128, -40, 22), (98, -200, -36, 22)), 40)
    neck = _blend(neck, _rope(m, (59, -40, -24, 8), (13, -186, 22, 9)), 20)
    neck = _blend(neck, _ellipsoid(p, (0, -146, 20), (10, 16, 12)), 18)
    neck = _blend(neck, _ellipsoid(p, (0, -226, -26), (134, 48, 66)), 36)
    neck = _blend(neck, _rope(m, (14, -198, 22, 6), (60, -192, 12, 6), (108, -194, -14, 7)), 14)
    f = _blend(f, neck, 28)

    # Eyes: socket, brow, ball with its closed lids.
    f = _carve(f, _ellipsoid(m, (30, -3, 95), (20, 12.5, 17)), 15)
    f = _blend(f, _rope(m, (8, 19, 80, 7), (26, 24, 75, 8), (45, 21, 61, 8), (55, 6, 46, 6), (54, -12, 43, 4)), 16)
    f = _blend(f, _ellipsoid(m, (32, -3, 64), (16, 12.5, 14.5)), 10)
    # Nose.
    nose = _rope(p, (0, 14, 79, 7), (0, -8, 87, 7), (0, -35, 101, 7.5))
    nose = _blend(nose, _rope(m, (7, 2, 74, 6), (10, -24, 83, 8), (11, -42, 90, 8)), 12)
    nose = _blend(nose, _ellipsoid(p, (0, -42, 105.5), (9, 8.5, 9)), 7)
    nose = _blend(nose, _ellipsoid(m, (12, -44, 96.5), (6, 7, 9.5)), 6)
    nose = _blend(nose, _rope(p, (0, -45, 104, 5.5), (0, -47, 93, 6)), 7)
    nose = _blend(nose, _ellipsoid(p, (0, -45.3, 95), (13, 5.5, 9)), 6)
    f = _blend(f, nose, 10)
    # Mouth.
    f = _blend(f, _rope(m, (0, -70.5, 92, 4.6), (8, -70, 91, 5), (17, -72.5, 85.5, 4.2), (26, -75.5, 77, 3)), 6)
    f = _blend(f, _rope(m, (0, -81, 90, 6.2), (9, -80.5, 89.5, 6), (18, -78.5, 84.5, 4.5), (26, -75.5, 77, 3)), 9)
    f += _stroke(p, 7, -1.4, (-19, -88, 83), (-10, -90.5, 89), (0, -91.5, 91), (10, -90.5, 89), (19, -88, 83))
    f += _stroke(m, 3.2, -2.6, (0, -75.6, 97), (8, -75, 96), (17, -75.5, 90), (27, -76, 79))
    f += _stroke(p, 3.2, -1.0, (0, -61, 92), (0, -67, 96))
    f += _stroke(m, 2.6, 0.5, (5, -60, 91), (5.5, -67, 96))
    f += _stroke(m, 1.8, 0.5, (0, -68, 97), (5, -66.5, 96.5), (14, -70, 92), (24, -75, 82))
    f += _stroke(m, 5, -1.0, (19, -44, 88), (28, -62, 80), (32, -76, 74))
    f += _stroke(m, 3, -0.75, (27, 6, 79), (33, 6.5, 78), (40, 5, 74.5), (46, 1.5, 70))
    f += _stroke(m, 3.5, 0.7, (12, 17, 90), (26, 22, 85), (40, 21, 76), (50, 15, 64))
    f += _stroke(m, 13, 1.6, (42, -30, 66))
    f += _stroke(m, 20, -1.5, (60, 22, 46), (62, 30, 44))
    return -_blend(-f, points[:, 1] + 206, 16)


# ---------------------------------------------------------------------------------------------------------------------
# Gross surface: where rays from the axis meet the forms.

_AROUND, _SIDE, _DOWN = 12, 20, 44  # half the front's and the back's columns, a side's columns, rows
_BACK = 2 * _AROUND + _SIDE  # the column at the back of the head

_COLUMN = PchipInterpolator(  # column -> angle round the axis in degrees, 0 at the face
    [0, 3, 6, 9, 10, 11, 12, 28, 30, 32, 44, 45], [0, 8, 16.5, 29.5, 38, 47.5, 57, 117, 127, 137.5, 180, 183.5]
)

_ROWS = np.array(
    [  # row, axis (y, z), then where the row's rays aim at: front (y, z), side (y, x), back (y, z)
        (0, 15, -8, 98, 50, 98, 52, 98, -68),
        (2, 15, -8, 56, 82, 62, 72, 80, -88),
        (4, 15, -8, 18, 91, 28, 76, 57, -99),
        (7, 5, -8, -1.5, 80, 13, 75, 22, -105),
        (9, 4, -8, -7.5, 80, 3, 75, 2, -104),
        (11, 5, -8, -12.5, 80, -7, 74, -14, -98),
        (20, 13, -8, -54, 97, -52, 66, -58, -76),
        (21, 8, -8, -59.5, 95, -56, 65, -63, -75),
        (23, -10, -8, -70.5, 98, -63, 63, -71, -73),
        (25, -32, -8, -75, 94, -70, 61, -79, -72),
        (27, -44, -8, -79.5, 97, -77, 59, -86, -71),
        (29, -50, -9, -90, 89, -84, 57, -93, -71),
        (31, -56, -10, -104, 92, -91, 55, -100, -71),
        (33, -64, -12, -118, 85, -99, 54, -108, -72),
        (34, -70, -14, -121.5, 74, -104, 53, -113, -72),
        (36, -92, -20, -123, 42, -117, 53, -127, -73),
        (38, -122, -25, -146, 36, -136, 56, -143, -76),
        (41, -164, -26, -177, 32, -169, 72, -171, -82),
        (42, -182, -26, -189, 36, -185, 92, -186, -86),
        (43, -198, -26, -200, 42, -199, 126, -199, -90),
        (44, -190, -26, -214, 36, -214, 100, -214, -78),
    ]
)
_ROW = PchipInterpolator(_ROWS[:, 0], _ROWS[:, 1:])


_TOLERANCE = 1e-5  # mm from the forms


def _meet(theta: Floats, row: Floats, crown: Floats) -> Floats:
    """Return (n, 3) points where rays meet the forms.

    Parameters
    ----------
    theta : (n,) angle round the axis in radians
    row : (n,) row, 0 to _DOWN
    crown : (n,) 1 on rows; from 1 to 0 the rays of row 0 turn upward
    """
    oy, oz, fy, fz, sy, sx, by, bz = _ROW(row).T
    cos, sin = np.cos(theta), np.sin(theta)

    def turn(front: Floats, side: Floats, back: Floats) -> Floats:
        return (
            (front + 2 * side + back) / 4 + (front - back) / 2 * cos + (front - 2 * side + back) / 4 * np.cos(2 * theta)
        )

    out, up = turn(fz - oz, sx, oz - bz), turn(fy, sy, by) - oy
    reach = np.hypot(out, up)
    angle = np.arctan2(out, up) * crown
    start = np.stack([np.zeros_like(oy), oy, oz], axis=1)
    ray = np.stack([np.sin(angle) * sin, np.cos(angle), np.sin(angle) * cos], axis=1)
    reach = 0.8 * reach
    # Secant steps, kept between the farthest point known inside and the nearest outside; only unfinished rays go on.
    todo = np.arange(len(reach))
    inside, outside = np.zeros_like(reach), np.full_like(reach, np.inf)
    before, slope = np.zeros_like(reach), np.full_like(reach, 0.8)
    step = np.zeros_like(reach)
    for attempt in range(60):
        value = _solid(start[todo] + reach[todo, None] * ray[todo])
        within = value < 0
        inside[todo[within]], outside[todo[~within]] = reach[todo[within]], reach[todo[~within]]
        if attempt:
            slope[todo] = np.clip((value - before[todo]) / step[todo], 0.3, 1.2)
        before[todo] = value
        todo = todo[np.abs(value) > _TOLERANCE]
        if not len(todo):
            break
        low, high = inside[todo], outside[todo]
        ahead = reach[todo] - np.clip(before[todo] / slope[todo], -9, 9)
        bracketed = np.isfinite(high)
        middle = (low + np.where(bracketed, high, low)) / 2
        ahead = np.where(bracketed & ((ahead <= low) | (ahead >= high)), middle, ahead)
        step[todo] = ahead - reach[todo]
        reach[todo] = ahead
    return start + reach[:, None] * ray


def _slope(points: Floats) -> Floats:
    """Return (n, 3) outward unit normals of the forms."""
    probes = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    slope = np.sum([_solid(points + 0.05 * probe)[:, None] * probe for probe in probes], axis=0)
    return slope / np.linalg.norm(slope, axis=1, keepdims=True)


def _angle(column: Floats) -> Floats:
    """Angle of a column round the axis in radians, 0 at the face, positive to the subject's left."""
    return np.radians(np.sign(column) * _COLUMN(np.abs(column)))


def _ramp(x: Floats, low: float, high: float) -> Floats:
    """From 0 at `low` to 1 at `high`, smooth."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


# ---------------------------------------------------------------------------------------------------------------------
# Lids and lips: folds of the rows about one row.


_BAND = 2.0  # half the number of rows a fold takes


@dataclass(frozen=True)
class _Fold:
    """A slit along a row whose two walls lie side by side.

    Parameters
    ----------
    row : the row that runs along the bottom of the slit
    depth : mm
    heart : (x, y, z) mm toward which the walls go in; x on the side of the face where the column is
    shift : by column, how many rows the row is bent
    openness : by column, 0 where there is no slit to 1 where it has its full depth
    """

    row: float
    depth: float
    heart: tuple[float, float, float]
    shift: PchipInterpolator
    openness: PchipInterpolator


def _lids_line(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the height of the closed lids' line at x in mm, its place from corner to corner, and how far it counts."""
    u = (np.abs(x) - 32) / 15.5
    line = -4.6 - 4.2 * np.clip(1 - u**2, -0.3, 1) + 1.2 * np.clip(u, -1.3, 1.3)
    return line, u, _ramp(np.abs(x), 5, 14) * (1 - _ramp(np.abs(x), 50, 64))


def _lips_line(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The same of the lips' line: lowest at the upper lip's tubercle."""
    u = x / 26
    line = -75.3 - 0.7 * np.exp(-((x / 5) ** 2)) + 0.7 * np.exp(-(((np.abs(x) - 12) / 6) ** 2)) - 0.8 * u**2
    return line, u, 1 - _ramp(np.abs(x), 29, 44)


@cache
def _folds() -> tuple[_Fold, ...]:
    """Return the lids' and the lips' fold."""
    columns = np.linspace(-20, 20, 161)
    result = []
    for row, depth, heart, curve in (
        (9.0, 3.5, (32.0, -3.0, 58.0), _lids_line),
        (25.0, 6.0, (0.0, -75.0, 40.0), _lips_line),
    ):
        rows = row + np.linspace(-2.6, 2.6, 27)
        grid_column, grid_row = np.meshgrid(columns, rows, indexing="ij")
        flat = _meet(_angle(grid_column.ravel()), grid_row.ravel(), np.ones(grid_row.size))
        points = flat.reshape(*grid_row.shape, 3)
        line, place, near = curve(points[:, 13, 0])
        # Under a bulging lip the height rises again for a few rows; the line takes the first row that comes so low.
        drop = np.maximum.accumulate(-points[..., 1], axis=1) + 1e-6 * grid_row
        shift = np.array([np.interp(-y, d, rows) for y, d in zip(line, drop, strict=True)])
        shift = gaussian_filter1d((shift - row) * near, 2.5)
        openness = _ramp(1.15 - place**2, 0, 0.9)
        result.append(_Fold(row, depth, heart, PchipInterpolator(columns, shift), PchipInterpolator(columns, openness)))
    return tuple(result)


def _shift(column: Floats, row: Floats) -> Floats:
    """Return rows bent so that one row follows the lids' line and one the lips' line."""
    bent = row.copy()
    for fold in _folds():
        bump = np.clip(1 - ((row - fold.row) / 4.5) ** 2, 0, None) ** 2
        bent += np.where(np.abs(column) < 20, fold.shift(np.clip(column, -20, 20)) * bump, 0)
    return bent


def _skin(column: Floats, row: Floats) -> Floats:
    """Return (n, 3) points of the gross surface with its rows along lids and lips."""
    return _meet(_angle(column), _shift(column, row), np.ones_like(row))


def _fold_in(column: Floats, row: Floats, fold: _Fold) -> tuple[Floats, Floats]:
    """Return rows drawn aside for a fold, and how deep they go in, in mm."""
    beta = (row - fold.row) / _BAND
    s = np.abs(beta)
    wide = fold.openness(column)
    gap = 0.06
    aside = gap * np.clip(s / 0.12, 0, 1) + (1 - gap) * np.clip((s - 0.4) / 0.6, 0, 1) ** 1.7
    aside = s + (aside - s) * wide**0.4
    return fold.row + np.sign(beta) * aside * _BAND, fold.depth * (1 - s) ** 2.5 * wide


# ---------------------------------------------------------------------------------------------------------------------
# Nostrils: disks of the domain drawn into the nose.


@cache
def _nostril(side: int) -> tuple[Floats, Floats, Floats]:
    """Return the nostril's (column, row), the (2, 2) map from the domain to its unit disk, and the pit's direction."""
    target = np.array([7.2 * side, -50.5, 102.0])
    at = np.array([1.6 * side, 19.5])
    for _ in range(12):
        probe = at + np.array([[0, 0], [0.05, 0], [0, 0.05]])
        points = _skin(probe[:, 0], probe[:, 1])
        tangent = (points[1:] - points[0]).T / 0.05
        at = at + np.clip(np.linalg.lstsq(tangent, target - points[0], rcond=None)[0], -0.5, 0.5)
    long = np.array([0.35 * side, 0.1, -1.0])
    normal = np.cross(tangent[:, 0], tangent[:, 1])
    normal /= np.linalg.norm(normal)
    long -= normal * (long @ normal)
    long /= np.linalg.norm(long)
    across = np.cross(normal, long)
    to_disk = np.stack([long @ tangent / 3.9, across @ tangent / 2.3])
    inward = np.array([-0.12 * side, 1.0, 0.4])
    return at, to_disk, inward / np.linalg.norm(inward)


def _draw_in(column: Floats, row: Floats, side: int) -> tuple[Floats, Floats, Floats]:
    """Return columns and rows drawn together over a nostril, and the depth in mm."""
    at, to_disk, _ = _nostril(side)
    disk = (np.stack([column, row], axis=1) - at) @ to_disk.T
    rho = np.linalg.norm(disk, axis=1)
    # The pit takes the disk's inner 2 and narrows as it goes in; beyond 2.4, short of the other nostril's, nothing
    # moves.
    knots = PchipInterpolator([0, 0.5, 1.0, 1.4, 1.8, 2.1, 2.4, 2.6], [0, 0.22, 0.52, 0.84, 1.35, 1.83, 2.4, 2.6])
    drawn = np.where(rho < 2.4, knots(np.minimum(rho, 2.5)), rho)
    depth = 10 * (1 - _ramp(rho, 0, 2.0))
    scale = drawn / np.maximum(rho, 1e-9)
    moved = at + (disk * scale[:, None]) @ np.linalg.inv(to_disk).T
    near = rho < 2.4
    return np.where(near, moved[:, 0], column), np.where(near, moved[:, 1], row), depth


# ---------------------------------------------------------------------------------------------------------------------
# Ears: disks of the domain; from the middle outward their rings run over the front to the rim, down the back to the
# crease, and out over the head.

_EAR_COLUMN, _EAR_ROW, _EAR_HALF = 20.0, 12.0, 8.0
_EAR_GROUND = 7  # how many of the rings lie on the head
_EAR_END = 0.88  # where the sculpted rings end and the head begins, as a part of the square's half side
_OUTLINE = (  # angle in degrees (0 rear, 90 up), radius of the rim in mm
    (-180, 9), (-150, 9.8), (-125, 14.5), (-105, 21.5), (-90, 26.5), (-70, 28), (-45, 24), (-20, 23), (0, 24), (30, 28),
    (60, 33), (80, 34.5), (100, 32.5), (120, 27), (145, 18), (180, 9),
)  # fmt: skip


def _periodic(table: tuple[tuple[float, float], ...], angle: Floats) -> Floats:
    """Smooth periodic curve through (degrees, value)."""
    degrees, values = np.array(table, dtype=float).T
    return CubicSpline(degrees, values, bc_type="periodic")(np.degrees(angle))


def _ridge(a: Floats, b: Floats, radius: float, height: float, *nodes: tuple[float, float]) -> Floats:
    """A stroke in the ear's plane."""
    points = np.stack([a.ravel(), b.ravel(), np.zeros(a.size)], axis=1)
    return -_stroke(points, radius, height, *((x, y, 0.0) for x, y in nodes)).reshape(a.shape)


def _roll(to_rim: Floats, rolled: Floats) -> Floats:
    """Height in mm of the rim's roll and the groove along it, `to_rim` mm from the rim."""
    groove = 0.6 * np.exp(-(((to_rim - 7.2) / 2.2) ** 2))
    return rolled * (2.3 * np.exp(-(((to_rim - 2.6) / 2.3) ** 2)) - groove)


def _relief(a: Floats, b: Floats) -> Floats:
    """Height in mm of the ear's ridges over its plane, at `a` mm backward and `b` mm upward of the canal."""
    h = _ridge(a, b, 3.2, 3.2, (4, -14.5), (9, -11), (13, -4), (13.5, 3), (11, 10), (7, 16), (4, 22))
    h += _ridge(a, b, 2.6, 2.4, (11, 9), (5, 12.5), (-2, 14))
    h += _ridge(a, b, 2.6, 4.0, (4, 2), (-3, 4.5), (-8, 9))
    h += _ridge(a, b, 3.4, 2.0, (4, -14.5))
    h += _ridge(a, b, 7, 1.6, (2, -22))
    return h


def _ear_lines(angles: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the rim's radius, the crease's, freedom from the head and the rim's roll at `angles` in radians."""
    degrees = np.degrees(angles)
    rim = _periodic(_OUTLINE, angles)
    free = _ramp(degrees, -125, -70) * (1 - _ramp(degrees, 100, 170))
    rolled = _ramp(degrees, -75, -35) * (1 - _ramp(degrees, 115, 165))
    apart = 2.0 + 3.0 * _ramp(-np.cos(angles), 0.85, 1.0)  # room for the tragus's slope
    crease = free * (0.5 * rim - 2.0) + (1 - free) * (rim + apart)
    return rim, crease, free, rolled


def _ear_index(radius: Floats, angles: Floats) -> Floats:
    """Return (..., 2) column and row offsets of the head under a point of the ear's plane."""
    a, b = radius * np.cos(angles), radius * np.sin(angles)
    return np.stack([0.88 * a / 4.7, -b / 5.0 - 0.04 * a], axis=-1)


def _ear_ground(offset: Floats, side: int) -> Floats:
    """Return (..., 3) points of the head at (..., 2) offsets from the ear's middle."""
    flat = offset.reshape(-1, 2)
    return _skin(side * (_EAR_COLUMN + flat[:, 0]), _EAR_ROW + flat[:, 1]).reshape(*offset.shape[:-1], 3)


def _hollow(a: Floats, b: Floats) -> Floats:
    """Depth in mm of the concha and the canal's mouth."""
    bowl = np.hypot((a - 3) / 7, (b + 1.5) / 10)
    return 8.5 / (1 + bowl**6) + _ridge(a, b, 3.6, 4.0, (-1.5, -0.5))


def _tragus(a: Floats, b: Floats) -> Floats:
    """Height in mm of the tragus over the head in front of the canal."""
    return _ridge(a, b, 3.8, 4.5, (-6.5, 2), (-6, -4.5))


@cache
def _ear(side: int) -> Floats:
    """Return the (rings, angles, 3) control net of one ear in mm."""
    angles = np.linspace(-np.pi, np.pi, 120, endpoint=False)
    cos, sin = np.cos(angles), np.sin(angles)
    rim, crease, free, rolled = _ear_lines(angles)

    # The ear's plane: tilted backward, its rear standing off the head, its top leaning outward with the skull.
    tilt, flare, lean = np.radians([12, 30, 5])
    outward, up, back = np.eye(3) * [side, 1, -1]
    back = np.cos(tilt) * back - np.sin(tilt) * up
    axis_b = np.cos(lean) * np.cross(outward, back) * side + np.sin(lean) * outward
    axis_a = np.cos(flare) * back + np.sin(flare) * outward
    axes = np.stack([axis_a, axis_b, np.cross(axis_a, axis_b) * side])
    canal = _ear_ground(np.zeros(2), side) + 2.0 * outward

    def plane(radius: Floats, height: Floats) -> Floats:
        return canal + np.stack([radius * cos, radius * sin, height], axis=-1) @ axes

    f = np.concatenate([np.linspace(0, 0.6, 12, endpoint=False), np.linspace(0.6, 1, 15)])[:, None]
    radius = f * rim
    a, b = radius * cos, radius * sin
    height = _relief(a, b) + _roll(rim - radius, rolled) - 1.5 * _ramp(f, 0.93, 1.0) * free
    edge = (1 - (1 - free) * _ramp(f, 0.6, 1.0))[..., None]
    onto = ((1 - free) * _ramp(f, 0.1, 0.8))[..., None]
    front = plane(radius, np.zeros_like(radius))
    # Where the rim leaves the head its front keeps clear of the head behind it.
    lift = (7 * _ramp(free, 0.02, 0.6) * _ramp(sin, -0.3, 0.6))[:, None] * outward
    ground = _ear_ground(_ear_index(radius, angles), side) + _ramp(f, 0.2, 0.8)[..., None] * lift
    front += onto * (ground - front)
    rise = axes[2] + onto * (outward - axes[2])
    front += edge * (height[..., None] * rise - _hollow(a, b)[..., None] * outward)
    edge_points = front[-1].copy()
    front += _tragus(a, b)[..., None] * outward

    s = np.linspace(0, 1, 13)[1:, None]
    radius = rim + s * (crease - rim)
    # The back follows the front's ridges and hollow, so that the flap is thick nowhere.
    a, b = radius * cos, radius * sin
    follow = _ramp(s, 0, 0.5) * 0.85
    height = (
        height[-1] - 3.3 * np.sin(np.pi / 2 * np.clip(s / 0.3, 0, 1)) + follow * (_relief(a, b) - _relief(a[0], b[0]))
    )
    behind = plane(radius, height) - (follow * _hollow(a, b))[..., None] * outward
    onto = (1 - free * (1 - _ramp(s, 0.6, 1.0)))[..., None]
    ground = _ear_ground(_ear_index(radius, angles), side)
    behind += onto * (ground + (1 - _ramp(s, 0, 0.8))[..., None] * lift - behind)
    # Where it is hardly free, the rim only slopes down to the head.
    slope = ground + (1 - _ramp(s, 0, 1))[..., None] * (edge_points - _ear_ground(_ear_index(rim, angles), side))
    behind = slope + _ramp(free, 0.25, 0.75)[:, None] * (behind - slope) + _tragus(a, b)[..., None] * outward

    t = np.linspace(0, 1, _EAR_GROUND + 1)[1:, None]
    return np.concatenate([front, behind, _ear_ground(_ear_apron(t, angles), side)])


def _ear_apron(t: Floats, angles: Floats) -> Floats:
    """Return offsets of the head from the crease (t = 0) to the oval at which the rings end (t = 1)."""
    inner = _ear_index(_ear_lines(angles)[1], angles)
    outer = _EAR_END * _EAR_HALF * np.stack([np.cos(angles), -np.sin(angles)], axis=-1)
    return inner + t[..., None] * (outer - inner)


def _ear_surface(column: Floats, row: Floats, side: int) -> Floats:
    """Return (n, 3) points of an ear's square of the domain."""
    x, y = (np.abs(column) - _EAR_COLUMN) / _EAR_HALF, (_EAR_ROW - row) / _EAR_HALF
    rho = np.maximum(np.abs(x), np.abs(y))
    angles = np.arctan2(y, x)
    net = _ear(side)
    rings, turns = net.shape[:2]
    # Through the middle the rings go on at the opposite angle.
    padded = np.concatenate([np.roll(net[1:4], turns // 2, axis=1)[::-1], net])
    ring = np.clip(rho / _EAR_END, 0, 1) * (rings - 1)
    at = [ring + 3, (angles + np.pi) / (2 * np.pi) * turns]
    result = np.stack(
        [map_coordinates(padded[..., k], at, order=3, prefilter=False, mode="grid-wrap") for k in range(3)], axis=1
    )
    # Where the rings lie on the head, the head itself takes over; past their oval it reaches to the square.
    t = 1 + (ring - (rings - 1)) / _EAR_GROUND
    on_head = t > 0.35
    t, theta = t[on_head], angles[on_head]
    past = np.clip((rho[on_head] - _EAR_END) / (1 - _EAR_END), 0, 1)[:, None]
    corner = _EAR_HALF * np.stack([x, -y], axis=1)[on_head] / rho[on_head, None]
    offset = _ear_apron(t, theta)
    ground = _ear_ground(offset + past * (corner - offset), side)
    result[on_head] += _ramp(t, 0.35, 0.95)[:, None] * (ground - result[on_head])
    return result


# ---------------------------------------------------------------------------------------------------------------------
# The whole surface over its domain.

_ROWS_PATCH, _CROWN, _CAP = 0, 1, 2


def _rim_column(p: Floats, q: Floats) -> Floats:
    """Column of a border point of the crown's or the cap's patch: p across (-_AROUND to _AROUND), q front to back."""
    front, back = np.isclose(q, 0), np.isclose(q, _SIDE)
    return np.where(front, p, np.where(back, np.where(p >= 0, _BACK - p, -_BACK - p), np.sign(p) * (_AROUND + q)))


def _across(p: Floats, q: Floats, border: dict[str, Floats]) -> Floats:
    """Fill a patch from its border by Coons' rule; `border` maps each side to the points at the same p or q."""
    u, v = ((p + _AROUND) / (2 * _AROUND))[:, None], (q / _SIDE)[:, None]
    sides = (1 - v) * border["front"] + v * border["back"] + (1 - u) * border["left"] + u * border["right"]
    corners = (1 - v) * ((1 - u) * border["fl"] + u * border["fr"]) + v * ((1 - u) * border["bl"] + u * border["br"])
    return sides - corners


def _border(p: Floats, q: Floats, curve: Callable[[Floats], Floats]) -> dict[str, Floats]:
    low, high, zero, far = np.full_like(p, -_AROUND), np.full_like(p, _AROUND), np.zeros_like(q), np.full_like(q, _SIDE)
    at = {
        "front": (p, zero), "back": (p, far), "left": (low, q), "right": (high, q),
        "fl": (low, zero), "fr": (high, zero), "bl": (low, far), "br": (high, far),
    }  # fmt: skip
    return {name: curve(_rim_column(*pair)) for name, pair in at.items()}


def _surface(patch: Ints, coords: Floats) -> Floats:
    """Return (n, 3) points of the bust in mm at (n, 2) coordinates of the domain's patches."""
    result = np.empty((len(patch), 3))
    rows = patch == _ROWS_PATCH
    result[rows] = _rows_surface(coords[rows, 0], coords[rows, 1])
    p, q = coords[patch == _CROWN].T
    flat = _across(p, q, _border(p, q, lambda c: np.stack([np.sin(_angle(c)), np.cos(_angle(c))], axis=1)))
    result[patch == _CROWN] = _meet(np.arctan2(flat[:, 0], flat[:, 1]), np.zeros(len(flat)), np.hypot(*flat.T))
    p, q = coords[patch == _CAP].T
    rim = CubicSpline(np.arange(-_BACK, _BACK + 1), _rim(), bc_type="periodic")
    result[patch == _CAP] = _across(p, q, _border(p, q, rim))
    return result


@cache
def _rim() -> Floats:
    """Return the points of the bust's rim at whole columns from back to back."""
    column = np.arange(-_BACK, _BACK + 1.0)
    points = _skin(column, np.full_like(column, _DOWN))
    points[-1] = points[0]
    return points


def _rows_surface(column: Floats, row: Floats) -> Floats:
    """Return (n, 3) points of the rows' patch: the gross surface, its folds and pits, the ears."""
    result = np.empty((len(column), 3))
    rest = np.ones(len(column), dtype=bool)
    for side in (-1, 1):
        ear = (np.abs(side * column - _EAR_COLUMN) < _EAR_HALF) & (np.abs(row - _EAR_ROW) < _EAR_HALF)
        result[ear] = _ear_surface(column[ear], row[ear], side)
        rest &= ~ear
    column, row = column[rest], row[rest]
    inward, heart = np.zeros(len(row)), np.zeros((len(row), 3))
    for fold in _folds():
        band = (np.abs(row - fold.row) < _BAND) & (np.abs(column) < 20)
        row[band], inward[band] = _fold_in(column[band], row[band], fold)
        heart[band] = fold.heart
        heart[band, 0] *= np.sign(column[band])
    pits = np.zeros((len(row), 3))
    for side in (-1, 1):
        column, row, depth = _draw_in(column, row, side)
        # Deeper it bends forward, so that from in front no wall is seen that looks up to the light.
        pits += depth[:, None] * _nostril(side)[2] + depth[:, None] ** 2 * (0, 0, 0.02)
    points = _skin(column, row)
    aim = heart - points
    points += pits + (inward / np.linalg.norm(aim, axis=1))[:, None] * aim
    result[rest] = points
    return result


# ---------------------------------------------------------------------------------------------------------------------
# Sampling: a coarse mesh of the domain, finer where there is more to see; each level splits every triangle in four.


def _in_ear(column: float, row: float) -> bool:
    return abs(abs(column) - _EAR_COLUMN) < _EAR_HALF and abs(row - _EAR_ROW) < _EAR_HALF


def _size(column: float, row: float) -> float:
    """Side of the cells in the 2 x 2 block about a point of the rows' patch."""
    x = abs(column)
    if x < 4 and 18 < row < 22:  # nostrils
        return 0.5
    face = (x < 10 and 2 < row < 36) or (x < 12 and 6 < row < 14)
    return 1.0 if face or _in_ear(column, row) else 2.0


def _blocks(patch: int, low: tuple[int, int], high: tuple[int, int]) -> list[tuple[int, float, float, float]]:
    """Return (patch, p, q, size) of the square cells of a patch; sizes of neighbors differ by two at most."""
    cells = []
    for p in range(low[0], high[0], 4):
        for q in range(low[1], high[1], 4):
            if patch != _ROWS_PATCH or (q < 36 and not -_AROUND - _SIDE <= p < _AROUND + _SIDE):
                cells.append((patch, float(p), float(q), 4.0))
                continue
            for i, j in ((p, q), (p + 2, q), (p, q + 2), (p + 2, q + 2)):
                size = _size(i + 1, j + 1)
                steps = np.arange(0, 2, size)
                cells += [(patch, i + x, j + y, size) for x in steps for y in steps]
    return cells


def _slants(patch: int, center: tuple[float, float]) -> bool:
    """Whether a cell is split from its low to its high corner; both halves of the head mirror each other."""
    p, q = center
    slant = p > 0
    if patch == _ROWS_PATCH and _in_ear(p, q):
        # Along the rays of the ear, across which its rings turn a corner.
        slant ^= (abs(p) - _EAR_COLUMN) * (q - _EAR_ROW) < 0
    return slant


def _vertex(patch: int, p: float, q: float) -> tuple[int, float, float]:
    """The same name for a domain point in every patch that holds it."""
    if patch != _ROWS_PATCH:
        if abs(p) < _AROUND and 0 < q < _SIDE:
            return (patch, p, q)
        p, q = float(_rim_column(np.array(p), np.array(q))), 0 if patch == _CROWN else _DOWN
    return (_ROWS_PATCH, p if p < _BACK else p - 2 * _BACK, q)


def _coarse() -> tuple[Ints, Ints, Floats]:
    """Return (m, 3) faces, (m,) patches and (m, 3, 2) domain coordinates of the coarsest mesh."""
    cells = _blocks(_ROWS_PATCH, (-_BACK, 0), (_BACK, _DOWN))
    for patch in (_CROWN, _CAP):
        cells += _blocks(patch, (-_AROUND, 0), (_AROUND, _SIDE))
    outlines: list[tuple[int, list[tuple[float, float]]]] = []
    for patch, p, q, size in cells:
        corners = [(p, q), (p, q + size), (p + size, q + size), (p + size, q)]
        if patch == _CROWN:
            corners.reverse()  # its rows run away from the face
        outlines.append((patch, corners))
    used = {_vertex(patch, *c) for patch, corners in outlines for c in corners}
    names: dict[tuple[int, float, float], int] = {}
    faces, patches, coords = [], [], []
    for patch, corners in outlines:
        ring: list[tuple[float, float]] = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            ring.append(a)
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            if _vertex(patch, *middle) in used:
                ring.append(middle)
        center = (corners[0][0] + corners[2][0]) / 2, (corners[0][1] + corners[2][1]) / 2
        if len(ring) > 4:
            triangles = [(center, a, b) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
        elif _slants(patch, center):
            triangles = [(ring[0], ring[1], ring[2]), (ring[0], ring[2], ring[3])]
        else:
            triangles = [(ring[1], ring[2], ring[3]), (ring[1], ring[3], ring[0])]
        for triangle in triangles:
            faces.append([names.setdefault(_vertex(patch, *c), len(names)) for c in triangle])
            patches.append(patch)
            coords.append(triangle)
    return np.array(faces), np.array(patches), np.array(coords, dtype=float)


def _seams(faces: Ints, patches: Ints, coords: Floats) -> Ints:
    """Return the edges to cut: down the middle of the back from behind the crown, and round the cap."""
    edges = half_edges(faces)
    owner = np.repeat(patches, 3)
    start = coords.reshape(-1, 2)

    def both(line: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return line & np.roll(line.reshape(-1, 3), -1, axis=1).ravel()

    rows = (owner == _ROWS_PATCH) & both(np.abs(start[:, 0]) == _BACK)
    crown = (owner == _CROWN) & both((start[:, 0] == 0) & (start[:, 1] >= 12))
    rim = (owner == _ROWS_PATCH) & both(start[:, 1] == _DOWN)
    return edges[rows | crown | rim]


def _split(faces: Ints) -> tuple[Ints, Ints]:
    """Split every triangle in four; return faces and the (k, 2) vertices between which each new vertex lies."""
    edges = np.sort(half_edges(faces), axis=1)
    count = int(faces.max()) + 1
    code, inverse = np.unique(edges @ np.array([count, 1]), return_inverse=True)
    middle = inverse.reshape(-1, 3) + count
    a, b, c = faces.T
    ab, bc, ca = middle.T
    split = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return split, np.stack(np.divmod(code, count), axis=1)


def _split_corners(values: Floats) -> Floats:
    """Split per-corner values (m, 3, k) as `_split` splits faces."""
    a, b, c = (values[:, k] for k in range(3))
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3, values.shape[2])


def _positions(faces: Ints, patches: Ints, coords: Floats) -> Floats:
    """Return the (n, 3) points of the vertices, each by the coordinates of the first corner that names it."""
    _, first = np.unique(faces, return_index=True)
    return _surface(np.repeat(patches, 3)[first], coords.reshape(-1, 2)[first])


def _normals(positions: Floats, faces: Ints) -> Floats:
    """Angle-weighted vertex normals."""
    corner = positions[faces]
    ahead = np.roll(corner, -1, axis=1) - corner
    behind = np.roll(corner, 1, axis=1) - corner
    cross = np.cross(ahead, behind)
    angle = np.arctan2(np.linalg.norm(cross, axis=2), np.sum(ahead * behind, axis=2))
    weighted = cross / np.maximum(np.linalg.norm(cross, axis=2, keepdims=True), 1e-30) * angle[..., None]
    normals = np.zeros_like(positions)
    np.add.at(normals, faces, weighted)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


_LAYOUT_LEVEL = 1  # flattened at this level; finer ones lie between
_NORMALS_LEVEL = 2  # normals of coarser levels are those of this one


def head(detail: str = "65k") -> Mesh:
    """Build the bust.

    Parameters
    ----------
    detail : a level of DETAILS["head"]; all levels are samples of one surface and share one UV layout

    Returns
    -------
    a closed mesh in mm of one part, "skin"; the middle between chin and crown lies at the origin. The skin is one
    chart, cut down the middle of the back; the cap under the bust is another
    """
    faces, patches, coords = _coarse()
    level = DETAILS["head"].index(detail)
    uv_faces = cut(faces, _seams(faces, patches, coords))
    sampled, middles = [(faces, uv_faces)], []
    for _ in range(max(level, _NORMALS_LEVEL)):
        faces, _ = _split(faces)
        uv_faces, between = _split(uv_faces)
        patches, coords = np.repeat(patches, 4), _split_corners(coords)
        sampled.append((faces, uv_faces))
        middles.append(between)
    positions = _positions(faces, patches, coords)
    normals = _normals(positions, faces)
    # Where no ear, fold or pit changes the forms, their own slope is better than any mean over triangles.
    plain = np.abs(_solid(positions)) < 2 * _TOLERANCE
    normals[plain] = _slope(positions[plain])

    uv = _layout(positions, sampled, middles)
    faces, uv_faces = sampled[level]
    for between in middles[_LAYOUT_LEVEL:level]:
        uv = np.concatenate([uv, uv[between].mean(axis=1)])
    uv = uv[: uv_faces.max() + 1]
    welded = _welded(faces, uv_faces)
    return Mesh(positions[welded], normals[welded], uv, uv, uv_faces.astype(np.int32), (Part("skin", 0, len(faces)),))


def _welded(faces: Ints, uv_faces: Ints) -> Ints:
    """Return the vertex of each UV vertex."""
    welded = np.empty(uv_faces.max() + 1, dtype=np.int64)
    welded[uv_faces] = faces
    return welded


def _layout(positions: Floats, sampled: list[tuple[Ints, Ints]], middles: list[Ints]) -> Floats:
    """Return the UV of level _LAYOUT_LEVEL, which all levels share: finer ones lie between, coarser ones leave out."""
    faces, uv_faces = sampled[0]
    uv = flatten(positions[_welded(faces, uv_faces)], uv_faces, 60)
    for level in range(1, _LAYOUT_LEVEL + 1):
        uv = np.concatenate([uv, uv[middles[level - 1]].mean(axis=1)])
        faces, uv_faces = sampled[level]
        for chart in charts(uv_faces):
            used, local = np.unique(uv_faces[chart], return_inverse=True)
            uv[used] = relax(positions[_welded(faces, uv_faces)][used], local.reshape(-1, 3), uv[used], 6)
    # Turned so that the face stands upright, the subject's left on the right.
    right = positions[_welded(faces, uv_faces), 0] @ (uv - uv.mean(axis=0))
    right /= np.linalg.norm(right)
    return pack(uv @ np.array([right, [-right[1], right[0]]]).T, uv_faces, 4.0)
