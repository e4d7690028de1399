"""Blend modes and curves on the GPU, against their float64 twins."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from skincli.color import srgb_encode
from skincli.gpu.blocks import FreeValues
from skincli.gpu.context import rest
from skincli.gpu.program import expand
from skincli.layers import remap
from skincli.layers.blend import MODES, Blend, apply_in, expression, height_coverage

Array = NDArray[Any]

TRIANGLE = """#version 330 core
void main() { gl_Position = vec4(ivec2(gl_VertexID & 1, gl_VertexID >> 1) * 4 - 1, 0, 1); }
"""
WIDTH = 128


def draw(
    ctx: Any, include: str, tables: dict[str, Array], results: list[str], values: FreeValues | None = None
) -> list[Array]:
    """Return the value of each GLSL expression, a vec4, at every row of the tables, which it reads by their names.

    Parameters
    ----------
    include : file below the shaders folder
    tables : (n, 4) float32 numbers, all of one n
    """
    layout = "" if values is None else values.layout.glsl()
    lines = ["#version 330 core", layout, *(f"uniform sampler2D {name}_table;" for name in tables)]
    lines += [f"layout(location = {i}) out vec4 result{i};" for i in range(len(results))]
    lines.append(expand("main", {"main": f'#include "{include}"\n'}).text)
    lines.append("void main() {")
    lines += [f"    vec4 {name} = texelFetch({name}_table, ivec2(gl_FragCoord.xy), 0);" for name in tables]
    lines += [f"    result{i} = {expression};" for i, expression in enumerate(results)]
    program = ctx.program(vertex_shader=TRIANGLE, fragment_shader="\n".join([*lines, "}"]) + "\n")
    count = len(next(iter(tables.values())))
    size = (WIDTH, -(-count // WIDTH))
    textures = []
    for unit, (name, table) in enumerate(tables.items()):
        padded = np.zeros((size[0] * size[1], 4), "f4")
        padded[:count] = table
        texture = ctx.texture(size, 4, padded.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if f"{name}_table" in program:  # a mode may ignore one of its inputs
            program[f"{name}_table"] = unit
        texture.use(unit)
        textures.append(texture)
    targets = [ctx.texture(size, 4, dtype="f4") for _ in results]
    framebuffer = ctx.framebuffer(targets)
    block = ctx.buffer(bytes(16) if values is None else values.packed)
    block.bind_to_uniform_block(0)
    framebuffer.use()
    triangle = ctx.vertex_array(program, [])
    triangle.render(vertices=3)
    found = [np.frombuffer(target.read(), "f4").reshape(-1, 4)[:count].astype(np.float64) for target in targets]
    rest()
    for thing in (framebuffer, *targets, *textures, triangle, block, program):
        thing.release()
    return found


def single(array: Array) -> Array:
    """Return what of an array float32 can hold."""
    return array.astype(np.float32).astype(np.float64)


def pairs() -> tuple[Array, Array, Array]:
    """Return colors b and s (n, 3) and weights (n, 1): every pair of a dense grid in every channel, 0, 1/2 and 1 too.

    Among them are all pairs of grays and of corners and middles of the color cube, values near 0, and random ones.
    """
    rng = np.random.default_rng(6)
    grid = np.concatenate([np.linspace(0, 1, 41), [1e-4, 0.003, 0.0032, 0.2499, 0.2501, 0.9]])
    b, s = (x.reshape(-1, 1) for x in np.meshgrid(grid, grid))
    orders = [rng.permutation(len(b)) for _ in range(2)]
    mixed = [np.concatenate([x, *(x[order] for order in orders)], axis=1) for x in (b, s)]
    cube = np.stack(np.meshgrid(*[[0, 0.5, 1]] * 6), axis=-1).reshape(-1, 6)
    random = rng.random((2, 5000, 3))
    once_b = np.concatenate([mixed[0], np.tile(b, 3), cube[:, :3], random[0]])
    once_s = np.concatenate([mixed[1], np.tile(s, 3), cube[:, 3:], random[1]])
    weights = [0.0, 0.3, 0.5, 1.0]
    w = np.repeat(weights, len(once_b))[:, None]
    return single(np.tile(once_b, (4, 1))), single(np.tile(once_s, (4, 1))), single(w)


@pytest.mark.parametrize("mode", MODES)
def test_each_mode_is_its_twin(ctx: Any, mode: Blend) -> None:
    """In colors and in single channels, in every space the mode has; results stay in 0 to 1."""
    b, s, w = pairs()
    tables = {"b": np.column_stack([b, w]), "s": np.column_stack([s, w])}
    spaces = MODES[mode].spaces
    results = []
    for space in spaces:
        results.append(f"vec4({expression(mode, space, 'b.rgb', 's.rgb', 'b.a')}, 0)")
        results.append(f"vec4({expression(mode, space, 'b.r', 's.r', 'b.a')}, 0, 0, 0)")
    found = draw(ctx, "lib/blend.glsl", tables, results)
    for index, space in enumerate(spaces):
        colors, grays = found[2 * index][:, :3], found[2 * index + 1][:, :1]
        differences = colors - apply_in(space, mode, b, s, w), grays - apply_in(space, mode, b[:, :1], s[:, :1], w)
        for difference in differences:
            if mode == "hard_mix" and space == "display":
                # The curve's rounding decides between 0 and 1 where the encoded values sum to 1 but for less than it.
                columns = slice(0, difference.shape[1])
                difference[np.abs(srgb_encode(b) + srgb_encode(s) - 1)[:, columns] < 1e-6] = 0
            np.testing.assert_allclose(difference, 0, atol=1e-5)
        for result in (colors, grays):
            assert result.min() >= -1e-7
            assert result.max() <= 1 + 1e-6


def test_height_coverage_is_its_twin(ctx: Any) -> None:
    rng = np.random.default_rng(2)
    heights = single(np.column_stack([rng.uniform(-1, 1, (4000, 2)), rng.uniform(0.01, 2, 4000), np.zeros(4000)]))
    heights[:500, 1] = heights[:500, 0]
    [found] = draw(ctx, "lib/blend.glsl", {"t": heights}, ["vec4(height_coverage(t.x, t.y, t.z), 0, 0, 0)"])
    expected = height_coverage(heights[:, 0], heights[:, 1], heights[:, 2])
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-6)
    assert np.all(found[:500, 0] == 0.5)


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0], [1, 1]],
        [[0.2, 0.9], [0.7, 0.1]],
        [[0, 0], [0.25, 0.1], [0.5, 0.5], [0.75, 0.9], [1, 1]],
        [[0, 0.3], [0.3, 1], [0.5, 0], [0.6, 0.05], [0.7, 0.6], [0.8, 0.6], [0.9, 0.1], [1, 0.4]],
    ],
)
def test_a_curve_is_its_twin(ctx: Any, points: list[list[float]]) -> None:
    found = draw_curve(ctx, points)
    np.testing.assert_allclose(found, remap.remap(points, curve_positions(points)), atol=1e-6)
    assert found.min() >= -1e-7
    assert found.max() <= 1 + 1e-6


def test_the_steepest_curve_is_its_twin(ctx: Any) -> None:
    points = [[0.0, 0.0], [0.98, 0.0], [0.99, 1.0], [1.0, 1.0]]
    np.testing.assert_allclose(draw_curve(ctx, points), remap.remap(points, curve_positions(points)), atol=1e-5)


def curve_positions(points: list[list[float]]) -> Array:
    return single(np.concatenate([np.linspace(-0.1, 1.1, 3001), [x for x, _ in points]]))


def draw_curve(ctx: Any, points: list[list[float]]) -> Array:
    members = remap.members(points)
    values = FreeValues(tuple((f"curve_{name}", "vec4") for name in members), tuple(members.values()))
    t = curve_positions(points)
    table = np.column_stack([t, np.zeros((len(t), 3))])
    [found] = draw(ctx, "lib/curve.glsl", {"t": table}, [f"vec4({remap.call('p.curve', 't.x')}, 0, 0, 0)"], values)
    return found[:, 0]
