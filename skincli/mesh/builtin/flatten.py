"""Flatten a triangle mesh into few charts: cut along chosen edges, lower the stretch, pack into the unit square."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_fill_holes
from scipy.signal import fftconvolve
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def half_edges(faces: Ints) -> Ints:
    """Return the (3 m, 2) directed edges of (m, 3) faces; row 3 f + e starts at corner e of face f."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)


def cut(faces: Ints, seams: Ints) -> Ints:
    """Return faces of equal shape whose vertices are split along `seams`.

    Parameters
    ----------
    faces : (m, 3) vertex numbers of a manifold mesh
    seams : (k, 2) vertex pairs, in any order and direction, that become borders
    """
    edges = half_edges(faces)
    count = int(faces.max()) + 1
    code = np.sort(edges, axis=1) @ np.array([count, 1])
    order = np.argsort(code, kind="stable")
    paired = np.flatnonzero(code[order][1:] == code[order][:-1])
    first, second = order[paired], order[paired + 1]
    keep = ~np.isin(code[first], np.sort(seams, axis=1) @ np.array([count, 1]))
    first, second = first[keep], second[keep]
    # Two faces run an edge in opposite directions: the start of one is the end of the other.
    end_of = np.roll(np.arange(len(edges)).reshape(-1, 3), -1, axis=1).ravel()
    left, right = np.concatenate([first, end_of[first]]), np.concatenate([end_of[second], second])
    graph = sp.coo_matrix((np.ones(len(left)), (left, right)), shape=(len(edges), len(edges)))
    corners: Ints = connected_components(graph, directed=False)[1].astype(np.int64)
    return corners.reshape(-1, 3)


def border(faces: Ints) -> Ints:
    """Return the vertices of the longest border loop of `faces` in order, counter-clockwise for an upward disk."""
    edges = half_edges(faces)
    count = int(faces.max()) + 1
    forward, backward = edges @ np.array([count, 1]), edges[:, ::-1] @ np.array([count, 1])
    open_edges = edges[~np.isin(forward, backward)]
    following = dict(open_edges.tolist())
    loops: list[list[int]] = []
    while following:
        start = next(iter(following))
        loop, vertex = [start], following.pop(start)
        while vertex != start:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(loop)
    return np.array(max(loops, key=len))


def disk(positions: Floats, faces: Ints) -> Floats:
    """Flatten a disk without any overlap: its border on a circle, each inner vertex in the middle of its neighbors.

    Parameters
    ----------
    positions : (n, 3) in mm
    faces : (m, 3) of one chart with one border; every vertex is used

    Returns
    -------
    (n, 2) coordinates in mm, scaled to the chart's area (W. T. Tutte, "How to draw a graph", 1963)
    """
    loop = border(faces)
    steps = np.linalg.norm(positions[loop] - positions[np.roll(loop, -1)], axis=1)
    angle = 2 * np.pi * np.concatenate([[0], np.cumsum(steps)[:-1]]) / steps.sum()
    edges = np.unique(np.sort(half_edges(faces), axis=1), axis=0)
    count = len(positions)
    weights = sp.coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count))
    weights = (weights + weights.T).tocsr()
    laplacian = (sp.diags(np.asarray(weights.sum(axis=1)).ravel()) - weights).tocsr()
    inner = np.setdiff1d(np.arange(count), loop)
    uv = np.zeros((count, 2))
    uv[loop] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    solver = splu(laplacian[inner][:, inner].tocsc())
    uv[inner] = solver.solve(-laplacian[inner][:, loop] @ uv[loop])
    return uv * np.sqrt(_areas(positions, faces).sum() / np.pi)


def relax(positions: Floats, faces: Ints, uv: Floats, iterations: int) -> Floats:
    """Lower the stretch of a flattening, never turning a triangle over.

    Minimizes the symmetric Dirichlet energy, which is least where lengths in mm are kept, by reweighted least squares
    (M. Rabinovich et al., "Scalable Locally Injective Mappings", 2017).

    Parameters
    ----------
    positions : (n, 3) in mm
    faces : (m, 3)
    uv : (n, 2) in mm, every triangle counter-clockwise
    iterations : most least-squares steps to take, each with a line search; they end when the stretch hardly falls

    Returns
    -------
    (n, 2) in mm
    """
    gradient, area = _gradients(positions, faces)
    count = len(positions)
    derivative = [
        sp.csr_matrix(
            (gradient[:, :, axis].ravel(), (np.repeat(np.arange(len(faces)), 3), faces.ravel())), (len(faces), count)
        )
        for axis in range(2)
    ]
    mass = sp.identity(2 * count) * (1e-4 * area.sum() / count / area.mean())

    def jacobians(points: Floats) -> Floats:
        return np.stack([d @ points for d in derivative], axis=2)

    def energy(points: Floats) -> float:
        jacobian = jacobians(points)
        det = np.linalg.det(jacobian)
        if det.min() <= 0:
            return np.inf
        return float(np.sum(area * np.sum(jacobian**2, axis=(1, 2)) * (1 + det**-2)))

    current = energy(uv)
    for _ in range(iterations):
        left, sigma, right = np.linalg.svd(jacobians(uv))
        # Weights that give the quadratic proxy the energy's own gradient at the nearest rotation (Eq. 10 of the paper).
        slope = sigma - sigma**-3
        offset = sigma - 1
        near = np.abs(offset) < 1e-4
        weight = np.sqrt(np.where(near, 4.0, slope / np.where(near, 1.0, offset)))
        local = np.einsum("fij,fj,fkj->fik", left, weight, left)
        target = left @ right
        root = np.sqrt(area)[:, None, None]
        local, goal = local * root, (local @ target) * root
        rows, values = [], []
        for i in range(2):
            for axis in range(2):
                rows.append(sp.hstack([sp.diags(local[:, i, k]) @ derivative[axis] for k in range(2)]))
                values.append(goal[:, i, axis])
        matrix = sp.vstack(rows).tocsr()
        flat = uv.T.ravel()
        system = (matrix.T @ matrix + mass).tocsc()
        aim = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve(
            matrix.T @ np.concatenate(values) + mass @ flat
        )
        step = (aim - flat).reshape(2, -1).T
        length = min(1.0, 0.9 * _first_flip(uv, step, faces))
        while (trial := energy(uv + length * step)) > current and length > 1e-6:
            length *= 0.5
        if trial >= current * (1 - 1e-5):
            break
        uv, current = uv + length * step, trial
    return uv


def charts(faces: Ints) -> list[Ints]:
    """Return the face numbers of each connected chart, the chart of most faces first."""
    count = int(faces.max()) + 1
    edges = half_edges(faces)
    graph = sp.coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count))
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    sizes = np.bincount(label)
    return [np.flatnonzero(label == k) for k in np.argsort(-sizes, kind="stable") if sizes[k]]


def flatten(positions: Floats, faces: Ints, iterations: int) -> Floats:
    """Flatten every chart of a cut mesh by itself; see `disk` and `relax`.

    Parameters
    ----------
    positions : (n, 3) in mm
    faces : (m, 3), as `cut` returns them; every chart has the topology of a disk
    iterations : steps of `relax`

    Returns
    -------
    (n, 2) in mm; charts lie on top of each other until they are packed
    """
    uv = np.zeros((len(positions), 2))
    for chart in charts(faces):
        used, local = np.unique(faces[chart], return_inverse=True)
        local = local.reshape(-1, 3)
        uv[used] = relax(positions[used], local, disk(positions[used], local), iterations)
    return uv


def pack(uv: Floats, faces: Ints, margin: float) -> Floats:
    """Lay charts into the unit square at one common scale.

    Parameters
    ----------
    uv : (n, 2) in mm, charts upon each other
    faces : (m, 3), which tell the charts
    margin : free border round each chart in mm

    Returns
    -------
    (n, 2) in [0, 1]; the chart of most faces keeps its direction, each further one takes, in one of eight directions,
    the place where the square grows least
    """
    result = uv.copy()
    corners = uv[faces]
    area = 0.5 * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum()
    cell = np.sqrt(area) / 160
    placed: NDArray[np.bool_] | None = None
    low = np.zeros(2)
    for chart in charts(faces):
        used = np.unique(faces[chart])
        if placed is None:
            low = uv[used].min(axis=0)
            placed = _cover(uv, faces[chart], low, cell, margin)
            continue
        best: tuple[float, Floats, NDArray[np.bool_]] | None = None
        for turn in np.arange(8) * np.pi / 8:
            rotated = uv @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
            corner = rotated[used].min(axis=0)
            mask = _cover(rotated, faces[chart], corner, cell, margin)
            room = np.pad(placed, [(0, mask.shape[0]), (0, mask.shape[1])])
            free = fftconvolve(room, mask[::-1, ::-1].astype(float), mode="valid") < 0.5
            at = np.argwhere(free)
            reach = np.maximum(at + mask.shape, placed.shape)
            cost = reach.max(axis=1) + 1e-3 * reach.min(axis=1) + 1e-6 * at.sum(axis=1)
            if len(at) and (best is None or cost.min() < best[0]):
                x, y = at[cost.argmin()]
                grown = np.pad(placed, [(0, max(0, n)) for n in reach[cost.argmin()] - placed.shape])
                grown[x : x + mask.shape[0], y : y + mask.shape[1]] |= mask
                best = cost.min(), rotated[used] - corner + low + np.array([x, y]) * cell, grown
        assert best is not None
        result[used], placed = best[1:]
    low, high = result.min(axis=0) - margin, result.max(axis=0) + margin
    side = (high - low).max()
    return (result - low + (side - (high - low)) / 2) / side


def _cover(uv: Floats, faces: Ints, low: Floats, cell: float, margin: float) -> NDArray[np.bool_]:
    """Return the cells of one chart and those nearer to it than the margin."""
    loop = (uv[border(faces)] - low) / cell
    ahead = np.roll(loop, -1, axis=0)
    steps = int(np.ceil(2 * np.abs(ahead - loop).max())) + 1
    t = np.arange(steps)[:, None, None] / steps
    rim = int(np.ceil(margin / cell)) + 1
    at = np.floor(loop + t * (ahead - loop)).reshape(-1, 2).astype(int) + rim
    mask = np.zeros(at.max(axis=0) + rim + 1, dtype=bool)
    mask[at[:, 0], at[:, 1]] = True
    result: NDArray[np.bool_] = binary_dilation(binary_fill_holes(mask), np.ones((2 * rim + 1,) * 2))
    return result


def _areas(positions: Floats, faces: Ints) -> Floats:
    corner = positions[faces]
    return 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)


def _gradients(positions: Floats, faces: Ints) -> tuple[Floats, Floats]:
    """Return (m, 3, 2) gradients of the hat functions in each triangle's own plane and (m,) areas."""
    corner = positions[faces]
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    length = np.linalg.norm(first, axis=1)
    along = first / length[:, None]
    x = np.sum(second * along, axis=1)
    y = np.linalg.norm(second - x[:, None] * along, axis=1)
    zero = np.zeros_like(x)
    plane = np.stack([np.stack([zero, zero], 1), np.stack([length, zero], 1), np.stack([x, y], 1)], axis=1)
    opposite = np.roll(plane, -2, axis=1) - np.roll(plane, -1, axis=1)
    double = length * y
    gradient = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2) / double[:, None, None]
    return gradient, 0.5 * double


def _first_flip(uv: Floats, step: Floats, faces: Ints) -> float:
    """Return the smallest positive multiple of `step` at which some triangle has no area."""
    a, b = uv[faces[:, 1]] - uv[faces[:, 0]], uv[faces[:, 2]] - uv[faces[:, 0]]
    c, d = step[faces[:, 1]] - step[faces[:, 0]], step[faces[:, 2]] - step[faces[:, 0]]
    zero = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    one = a[:, 0] * d[:, 1] - a[:, 1] * d[:, 0] + c[:, 0] * b[:, 1] - c[:, 1] * b[:, 0]
    two = c[:, 0] * d[:, 1] - c[:, 1] * d[:, 0]
    # The root nearest to zero, by the form that stays accurate when `two` vanishes.
    inside = one**2 - 4 * two * zero
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(inside)
        times = np.stack([2 * zero / (-one - root), 2 * zero / (-one + root)])
    times = times[np.isfinite(times) & (times > 0)]
    return float(times.min(initial=np.inf))
