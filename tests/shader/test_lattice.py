"""The passes of the surface lattice against their twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from skincli.gpu.textures import read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import ONE, Load, Ref
from skincli.mesh import lattice
from skincli.passes.lattice import Term, lattice_nodes, twin
from skincli.passes.window import block_node

SIZE = 48


def sphere(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (SIZE**2, 3) points and normals; the poles' texels are small, the first and last column meet."""
    v, u = (np.mgrid[0:SIZE, 0:SIZE] + 0.5) / SIZE
    polar, around = np.pi * v, 2 * np.pi * u
    normals = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1)
    return radius * normals.reshape(-1, 3), normals.reshape(-1, 3)


def both(values: np.ndarray, radius: float, sigmas: dict[float, tuple[float, float, float]]) -> tuple[Any, Any]:
    """Return what passes and twin make of (SIZE, SIZE, 3) light on a sphere."""
    positions, normals = sphere(radius)
    area = (2 * np.pi**2 / SIZE**2 * radius**2) * np.sqrt(1 - normals[:, 1] ** 2)
    texel = np.arange(SIZE**2)
    terms = [
        Term(f"sphere {radius} {sigma}", lattice.tables(positions, normals, area, texel, SIZE, sigma), weight)
        for sigma, weight in sigmas.items()
    ]
    picture = {
        "position": positions.reshape(SIZE, SIZE, 3)[::-1],
        "normal": normals.reshape(SIZE, SIZE, 3)[::-1],
        "area": area.reshape(SIZE, SIZE, 1)[::-1],
    }
    picture["image"] = values
    loads = []
    for name, pixels in picture.items():
        data = np.concatenate([pixels, np.ones((SIZE, SIZE, 4 - pixels.shape[2]))], axis=2)
        loads.append(Load(name, f"{name} {radius} {values.sum()}", lambda data=data: [data]))
    image, position, normal, texels = (Ref(name, "image") for name in ("image", "position", "normal", "area"))
    blocks = block_node((SIZE, SIZE), image, texels, position, normal, ONE, 1)
    graph = FrameGraph(
        [*loads, blocks, *lattice_nodes("sum", (SIZE, SIZE), image, position, normal, texels, blocks, ONE, terms)]
    )
    target = Ref("sum", "sliced")
    found = read_back(graph.run([target], check=True)[target])
    return found, twin(terms, values, picture["position"], picture["normal"], picture["area"][..., 0])


def test_passes_agree_with_their_twin(ctx: Any) -> None:
    values = np.random.default_rng(5).uniform(0, 2, (SIZE, SIZE, 3))
    # On a sphere this small normals differ within reach of the wide sigma and not of the narrow one.
    found, wanted = both(values, 9.0, {0.8: (0.25, 0.5, 1.0), 2.4: (0.75, 0.5, 0.0)})
    np.testing.assert_allclose(found, wanted, atol=2e-5)
    np.testing.assert_allclose(found[..., 3], 1, atol=1e-6)


@pytest.mark.parametrize("color", [(0.3, 1.0, 2.0), (-0.3, -1.0, 2.0), (1e-12, 1e-6, 1e6)])
def test_constant_light_stays(ctx: Any, color: tuple[float, float, float]) -> None:
    values = np.broadcast_to(color, (SIZE, SIZE, 3))
    found, _ = both(values, 12.0, {0.9: (0.4, 0.4, 0.4), 1.8: (0.6, 0.6, 0.6)})
    np.testing.assert_allclose(found[..., :3], values, rtol=1e-5)
