"""Nodes of the frame graph: pure functions from textures and values to textures, each with a content key per output."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from skincli.gpu.blocks import Values
from skincli.gpu.geometry import Geometry
from skincli.gpu.program import ProgramText, program_text


@dataclass(frozen=True)
class Ref:
    """An output of another node."""

    node: str
    output: str


@dataclass(frozen=True)
class Constant:
    """A value that stands for a texture: bound as 1x1 to the same program that would read the texture."""

    value: tuple[float, float, float, float]


Source = Ref | Constant

ZERO = Constant((0.0, 0.0, 0.0, 0.0))
ONE = Constant((1.0, 1.0, 1.0, 1.0))


@dataclass(frozen=True)
class Input:
    """A texture that a pass reads.

    Parameters
    ----------
    filter : nearest, linear, mipmap, or bordered: nearest, and 0 beyond the edge
    repeat : whether coordinates beyond [0, 1] repeat the texture; they clamp otherwise
    """

    filter: str = "nearest"
    repeat: bool = False


@dataclass(frozen=True)
class Output:
    """A texture that a pass writes.

    Parameters
    ----------
    format : a key of skincli.gpu.textures.FORMATS
    needs : names of the inputs its value depends on; None for all of them
    mipmaps : whether the levels below 0 are filled after the draw
    """

    format: str = "rgba32f"
    needs: tuple[str, ...] | None = None
    mipmaps: bool = False


@dataclass(frozen=True)
class Draw:
    """One draw call of a node.

    Parameters
    ----------
    values : the uniform block
    inputs : sources of this draw's own inputs, over those of the node
    topology : "screen" (one triangle over the target), "faces", "borders" or "tiles" of the node's geometry
    part : the mesh part to draw, None for a screen draw
    points : draw so many points instead; the vertex shader has nothing but gl_VertexID
    """

    values: Values
    inputs: Mapping[str, Source] = field(default_factory=dict)
    topology: str = "screen"
    part: int | None = None
    points: int = 0


class Node:
    """What every node has: a name, a size, outputs, and for each output what it depends on and its key."""

    name: str
    size: tuple[int, int]
    outputs: Mapping[str, Output]

    def shortcut(self, output: str) -> tuple[Source, str] | None:
        """Return what the output equals, exactly and everywhere it is read, and why; None where work is needed."""
        return None

    def ignores(self) -> Mapping[str, tuple[Constant, str]]:
        """Return the inputs that the present values leave without effect, with the constant to bind and the reason."""
        return {}

    def own_digest(self, output: str) -> bytes:
        """Return a digest of everything but the sources that decides the output."""
        raise AssertionError("every node defines its digest")


@dataclass(frozen=True, eq=False)
class Load(Node):
    """A texture made by the host: an image, a table.

    Parameters
    ----------
    key : says what is loaded (hash of the file's bytes and how they are read)
    make : called only when the texture is needed; returns (h, w, c) arrays, level 0 first
    format : texture format
    mipmaps : let the driver fill the levels below 0
    """

    name: str
    key: str
    make: Callable[[], Sequence[NDArray[np.floating]]]
    format: str = "rgba32f"
    mipmaps: bool = False
    size: tuple[int, int] = (0, 0)

    @property
    def outputs(self) -> Mapping[str, Output]:  # type: ignore[override]
        """One output, `image`."""
        return {"image": Output(self.format, mipmaps=self.mipmaps)}

    def own_digest(self, output: str) -> bytes:
        """The key says it all."""
        return f"load {self.key} {self.format} {self.mipmaps}".encode()


@cache
def module_digest(module: str) -> bytes:
    """Return the hash of a Python module's file."""
    file = sys.modules[module].__file__
    assert file is not None
    return hashlib.blake2b(Path(file).read_bytes(), digest_size=16).digest()


class Pass(Node):
    """A render pass: its class declares shader, inputs and outputs; an instance is one node of a graph.

    A pass's file also holds its frozen Values and its float64 twin.

    Parameters
    ----------
    name : unique in the graph
    size : (width, height) of the targets in pixels or texels
    draws : at least one; several are drawn into the same targets in order
    inputs : sources shared by all draws
    geometry : the mesh, where a draw's topology asks for it
    defines, generated : (name, text) pairs that enter the shader's source
    """

    shader: ClassVar[str]
    vertex: str = "lib/screen.vert"
    inputs: Mapping[str, Input] = {}
    outputs: Mapping[str, Output] = {}
    #: add to what is there (float32), instead of replacing it
    additive: ClassVar[bool] = False
    #: keep the nearest surface only
    depth: ClassVar[bool] = False
    #: costs more to make than its memory is worth: the memo lets go of it last
    dear: ClassVar[bool] = False

    def __init__(
        self,
        name: str,
        size: tuple[int, int],
        draws: Sequence[Draw],
        inputs: Mapping[str, Source] | None = None,
        geometry: Geometry | None = None,
        defines: Sequence[tuple[str, str]] = (),
        generated: Sequence[tuple[str, str]] = (),
    ) -> None:
        self.name = name
        self.size = size
        self.draws = tuple(draws)
        self.wired = dict(inputs or {})
        self.geometry = geometry
        self.defines = tuple(defines)
        self.generated = tuple(generated)

    def text(self, draw: Draw, attached: tuple[str, ...]) -> ProgramText:
        """Return the program's text for the outputs that have a target."""
        return program_text(
            self.shader,
            self.vertex,
            draw.values.layout,
            tuple((name, "sampler2D") for name in self.inputs),
            tuple((name, "vec4") for name in self.outputs),
            attached,
            self.defines,
            self.generated,
        )

    def wired_source(self, draw: Draw, name: str) -> Source:
        """Return what is wired to the input `name` of a draw, whatever the present values make of it."""
        return draw.inputs.get(name, self.wired.get(name, ZERO))

    def source(self, draw: Draw, name: str) -> Source:
        """Return what feeds the input `name` of a draw, an ignored one its constant."""
        ignored = self._ignored.get(name)
        return ignored[0] if ignored else self.wired_source(draw, name)

    @cached_property
    def _ignored(self) -> Mapping[str, tuple[Constant, str]]:
        return self.ignores()

    def needed_inputs(self, output: str) -> Sequence[str]:
        """Return the names of the inputs that the output depends on."""
        needs = self.outputs[output].needs
        return tuple(self.inputs) if needs is None else needs

    def own_digest(self, output: str) -> bytes:
        """Hash of shader, Python file, values, size and geometry; for an output without inputs too."""
        digest = hashlib.blake2b(self._static_digest, digest_size=16)
        digest.update(output.encode())
        for draw in self.draws:
            digest.update(draw.values.packed)
        return digest.digest()

    @cached_property
    def _static_digest(self) -> bytes:
        digest = hashlib.blake2b(module_digest(type(self).__module__), digest_size=16)
        digest.update(f"{self.size} {self.geometry.key if self.geometry else ''} {self.outputs}".encode())
        for draw in self.draws:
            text = self.text(draw, tuple(self.outputs)).key
            digest.update(f"{text} {draw.topology} {draw.part} {draw.points};".encode())
        return digest.digest()

    def with_values(self, values: Sequence[Values]) -> Pass:
        """Return the same node with other values, one per draw; shader and wiring stay."""
        other = copy(self)
        other.__dict__.pop("_ignored", None)
        other.draws = tuple(replace(draw, values=new) for draw, new in zip(self.draws, values, strict=True))
        return other
