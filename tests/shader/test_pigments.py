"""lib/pigment.glsl against its float64 twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli.gpu.context import rest
from skincli.gpu.program import expand
from skincli.optics.pigments import Base, PigmentModel, human, random_amounts

SIDE = 64
TRIANGLE = """#version 330 core
void main() { gl_Position = vec4(ivec2(gl_VertexID & 1, gl_VertexID >> 1) * 4 - 1, 0, 1); }
"""
MAIN = """#version 330 core
uniform sampler2D first;
uniform sampler2D second;
layout(location = 0) out vec4 color;
#include "lib/pigment.glsl"
void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    color = vec4(pigment_albedo(texelFetch(first, texel, 0), texelFetch(second, texel, 0)), 1.0);
}
"""


def draw(ctx: Any, model: PigmentModel, amounts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the albedo (n, 3) that the shader gives amounts (n, 8); n is at most SIDE * SIDE."""
    texels = np.zeros((SIDE * SIDE, 8), "f4")
    texels[: len(amounts)] = amounts
    fragment = expand("main", {"main": MAIN, "generated/pigments": model.glsl()}).text
    program = ctx.program(vertex_shader=TRIANGLE, fragment_shader=fragment)
    halves = [
        ctx.texture((SIDE, SIDE), 4, np.ascontiguousarray(half).tobytes(), dtype="f4")
        for half in (texels[:, :4], texels[:, 4:])
    ]
    for unit, (name, half) in enumerate(zip(("first", "second"), halves, strict=True)):
        program[name] = unit
        half.use(unit)
    target = ctx.texture((SIDE, SIDE), 4, dtype="f4")
    framebuffer = ctx.framebuffer([target])
    framebuffer.use()
    triangle = ctx.vertex_array(program, [])
    triangle.render(vertices=3)
    color = np.frombuffer(target.read(), "f4").reshape(-1, 4)[: len(amounts), :3].astype(np.float64)
    rest()
    for thing in (framebuffer, target, *halves, triangle, program):
        thing.release()
    return color


@pytest.mark.parametrize("base", ["dermis", "leucophore", "iridophore"])
def test_the_shader_is_its_twin(ctx: Any, base: Base) -> None:
    model = PigmentModel(eumelanin=0.7, epidermis=0.1, base=base)
    amounts = np.concatenate([random_amounts(3000, seed=3), human(np.linspace(0, 0.5, 500))]).astype("f4").astype("f8")
    np.testing.assert_allclose(draw(ctx, model, amounts), model.albedo(amounts), rtol=0, atol=1e-5)


def test_amounts_out_of_range_stay_finite(ctx: Any) -> None:
    amounts = np.array([[-1.0] * 8, [0.0] * 8, [1e4] * 8, [1e4, 0, 0, 0, 0, 0, 0, 0], [0, 1e4, 1e4, 0, 0, 0, 0, 0]])
    color = draw(ctx, PigmentModel(), amounts)
    assert np.isfinite(color).all()
    assert (color >= 0).all()
    assert (color <= 1).all()
    np.testing.assert_array_equal(color[0], color[1])
