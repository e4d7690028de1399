"""std140 uniform blocks made from frozen dataclasses: one declaration gives the GLSL text, the bytes and the key.

[OpenGL 3.3 core, section 2.11.4]: scalars align to 4 bytes, vec2 to 8, vec3 and vec4 to 16; every array element
and every matrix column takes 16 bytes.
"""

from __future__ import annotations

import dataclasses
import re
import struct
import typing
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import chain
from typing import Annotated, Any

from skincli.errors import LimitError

Vec2 = Annotated[tuple[float, ...], "vec2"]
Vec3 = Annotated[tuple[float, ...], "vec3"]
Vec4 = Annotated[tuple[float, ...], "vec4"]
Mat4 = Annotated[tuple[float, ...], "mat4"]  # 16 numbers, column by column

#: numbers of up to 64 skins that a mesh carries side by side
Slots = Annotated[tuple[tuple[float, ...], ...], "vec4[64]"]
#: taps of a separable kernel, per channel
Taps = Annotated[tuple[tuple[float, ...], ...], "vec4[512]"]
#: positions of a sample set
Samples = Annotated[tuple[tuple[float, ...], ...], "vec4[64]"]

#: A block larger than this is not promised by every driver [OpenGL 3.3 core, table 6.52].
MAX_BLOCK_BYTES = 16384

_BASES = {"float": ("f", 1), "int": ("i", 1), "vec2": ("f", 2), "vec3": ("f", 3), "vec4": ("f", 4), "mat4": ("f", 16)}
_ALIGN = {"float": 4, "int": 4, "vec2": 8, "vec3": 16, "vec4": 16, "mat4": 16}


@dataclass(frozen=True)
class Layout:
    """Members of a std140 block, in order.

    Parameters
    ----------
    members : (name, type) pairs; a type is float, int, vec2, vec3, vec4, mat4 or vec4[N]
    """

    members: tuple[tuple[str, str], ...]

    @cache  # noqa: B019 - layouts are few, frozen and live as long as their pass
    def _plan(self) -> tuple[struct.Struct, tuple[tuple[str, int], ...], int]:
        """Return the packer, per member (kind, count of numbers), and the size in bytes."""
        code, offset, kinds = "<", 0, []
        for _, kind in self.members:
            array = re.fullmatch(r"vec4\[(\d+)\]", kind)
            letter, count = ("f", 4 * int(array[1])) if array else _BASES[kind]
            align = 16 if array else _ALIGN[kind]
            padding = -offset % align
            code += f"{padding}x{count}{letter}" if padding else f"{count}{letter}"
            offset += padding + 4 * count
            kinds.append((kind, count))
        padding = -offset % 16
        code += f"{padding}x" if padding else ""
        if offset + padding > MAX_BLOCK_BYTES:
            raise LimitError(f"a uniform block takes {offset + padding} bytes; at most {MAX_BLOCK_BYTES} are allowed")
        return struct.Struct(code), tuple(kinds), offset + padding

    @property
    def size(self) -> int:
        """Bytes of the packed block."""
        return self._plan()[2]

    def glsl(self, instance: str = "p") -> str:
        """Return the GLSL declaration, or an empty string for a block without members."""
        if not self.members:
            return ""
        lines = []
        for name, kind in self.members:
            base, _, rest = kind.partition("[")
            lines.append(f"    {base} {name}{'[' + rest if rest else ''};")
        return "layout(std140) uniform Values {\n" + "\n".join(lines) + f"\n}} {instance};\n"

    def pack(self, values: Sequence[Any]) -> bytes:
        """Return the block's bytes.

        Parameters
        ----------
        values : one per member: a number, a tuple of numbers, or for vec4[N] up to N tuples of four (zero-filled)
        """
        packer, kinds, _ = self._plan()
        flat: list[float] = []
        for value, (kind, count) in zip(values, kinds, strict=True):
            if count == 1:
                flat.append(value)
                continue
            before = len(flat)
            if "[" in kind:
                flat.extend(chain.from_iterable(value))
                flat.extend([0.0] * (before + count - len(flat)))
            else:
                flat.extend(value)
            if len(flat) - before != count:
                raise ValueError(f"a {kind} takes {count} numbers, not {len(flat) - before}")
        return packer.pack(*flat)


@cache
def layout_of(cls: type) -> Layout:
    """Return the Layout that a frozen dataclass of plain values declares."""
    hints = typing.get_type_hints(cls, include_extras=True)
    members = []
    for item in dataclasses.fields(cls):
        hint = hints[item.name]
        kind = hint.__metadata__[0] if hasattr(hint, "__metadata__") else {float: "float", int: "int"}[hint]
        members.append((item.name, kind))
    return Layout(tuple(members))


@dataclass(frozen=True)
class Values:
    """Base of a pass's frozen values; subclasses are frozen dataclasses whose annotations are GLSL types."""

    @property
    def layout(self) -> Layout:
        """The block's declaration."""
        return layout_of(type(self))  # type: ignore[arg-type]

    def numbers_in_order(self) -> Sequence[Any]:
        """One value per member."""
        return [getattr(self, item.name) for item in dataclasses.fields(self)]

    @cached_property
    def packed(self) -> bytes:
        """Bytes of the uniform block; they also enter the node's key."""
        return self.layout.pack(self.numbers_in_order())


@dataclass(frozen=True)
class FreeValues(Values):
    """Values whose members are known only when a description is read (a stack of texture layers).

    Parameters
    ----------
    members : (name, type) pairs
    numbers : one value per member
    """

    members: tuple[tuple[str, str], ...]
    numbers: tuple[Any, ...]

    @property
    def layout(self) -> Layout:
        """The block's declaration."""
        return Layout(self.members)

    def numbers_in_order(self) -> Sequence[Any]:
        """One value per member."""
        return self.numbers
