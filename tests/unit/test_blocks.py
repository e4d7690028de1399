"""std140 packing against offsets worked out by hand from the specification."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import pytest

from skincli.errors import LimitError
from skincli.gpu.blocks import FreeValues, Layout, Mat4, Values, Vec2, Vec3, Vec4, layout_of


@dataclass(frozen=True)
class Mixed(Values):
    a: float
    b: Vec2
    c: Vec3
    d: int
    e: Vec4
    f: Mat4
    g: float


def test_members_lie_where_std140_says() -> None:
    values = Mixed(1.0, (2.0, 3.0), (4.0, 5.0, 6.0), 7, (8.0, 9.0, 10.0, 11.0), tuple(map(float, range(16))), 12.0)
    data = values.packed
    # a at 0; b aligns to 8; c to 16; d fills c's fourth float; e at 32; f at 48; g at 112; padded to 128.
    assert len(data) == 128 == values.layout.size
    assert struct.unpack_from("<f", data, 0) == (1.0,)
    assert struct.unpack_from("<2f", data, 8) == (2.0, 3.0)
    assert struct.unpack_from("<3f", data, 16) == (4.0, 5.0, 6.0)
    assert struct.unpack_from("<i", data, 28) == (7,)
    assert struct.unpack_from("<4f", data, 32) == (8.0, 9.0, 10.0, 11.0)
    assert struct.unpack_from("<16f", data, 48) == tuple(map(float, range(16)))
    assert struct.unpack_from("<f", data, 112) == (12.0,)


def test_an_array_is_filled_with_zeros() -> None:
    layout = Layout((("count", "int"), ("rows", "vec4[3]")))
    data = layout.pack([2, ((1.0, 2.0, 3.0, 4.0), (5.0, 6.0, 7.0, 8.0))])
    assert len(data) == 64
    assert struct.unpack_from("<12f", data, 16) == (1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0)


def test_the_declaration_is_glsl() -> None:
    text = layout_of(Mixed).glsl()
    assert text.startswith("layout(std140) uniform Values {\n    float a;\n    vec2 b;\n    vec3 c;\n    int d;")
    assert text.endswith("} p;\n")
    assert Layout((("rows", "vec4[3]"),)).glsl() == "layout(std140) uniform Values {\n    vec4 rows[3];\n} p;\n"
    assert Layout(()).glsl() == ""


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="vec3 takes 3 numbers, not 2"):
        Layout((("a", "vec3"),)).pack([(1.0, 2.0)])
    with pytest.raises(ValueError, match="takes 8 numbers, not 12"):
        Layout((("a", "vec4[2]"),)).pack([((1.0,) * 4,) * 3])
    with pytest.raises(LimitError, match="16400 bytes"):
        Layout((("a", "vec4[1025]"),)).pack([()])


def test_free_values_pack_as_declared_ones() -> None:
    free = FreeValues((("a", "float"), ("b", "vec3")), (1.0, (2.0, 3.0, 4.0)))
    assert struct.unpack("<f12x3f4x", free.packed) == (1.0, 2.0, 3.0, 4.0)
