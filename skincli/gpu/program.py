"""GLSL programs: includes to any depth, declarations generated from Python, errors at file and line."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import moderngl

from skincli import resources
from skincli.errors import DeviceError, Fault
from skincli.gpu.blocks import Layout
from skincli.gpu.context import get_context
from skincli.gpu.counters import COUNTERS

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')


@dataclass(frozen=True)
class Source:
    """Expanded GLSL and, for each of its lines, the file and line it came from."""

    text: str
    origin: tuple[tuple[str, int], ...]


@cache
def _file_lines(name: str) -> tuple[str, ...]:
    return tuple((resources.folder("shaders") / name).read_text(encoding="utf-8").splitlines())


def expand(name: str, extra: Mapping[str, str] | None = None) -> Source:
    """Return the shader `name` with its includes in place, each file once.

    Parameters
    ----------
    name : path below the shaders folder, or a key of `extra`
    extra : texts that exist only in memory, by the name under which they are included

    Raises
    ------
    DeviceError : an included file does not exist; names the line that asks for it
    """
    generated = extra or {}
    seen: set[str] = set()
    lines: list[str] = []
    origin: list[tuple[str, int]] = []

    def visit(current: str, asked_by: tuple[str, int]) -> None:
        if current in seen:
            return
        seen.add(current)
        if current in generated:
            body: Sequence[str] = generated[current].splitlines()
        else:
            try:
                body = _file_lines(current)
            except FileNotFoundError:
                raise DeviceError(
                    Fault(f"includes '{current}', which does not exist", f"shaders/{asked_by[0]}", asked_by[1])
                ) from None
        for number, line in enumerate(body, start=1):
            match = _INCLUDE.match(line)
            if match:
                visit(match[1], (current, number))
            else:
                lines.append(line)
                origin.append((current, number))

    visit(name, (name, 0))
    return Source("\n".join(lines) + "\n", tuple(origin))


# Mesa writes "0:12(5): error: ...", NVIDIA "0(12) : error ...", Apple "ERROR: 0:12: ...".
_MESSAGE = re.compile(r"^(?:ERROR: )?\d+(?::(\d+)(?:\(\d+\))?|\((\d+)\))\s*:\s*(.*)$")


def locate(log: str, sources: Mapping[str, Source]) -> list[Fault]:
    """Turn a driver's compile log into faults at the file and line a person edits.

    Parameters
    ----------
    log : what the driver printed; moderngl heads each stage's part with the stage's name
    sources : expanded source of each stage, by "vertex_shader" and "fragment_shader"
    """
    faults, stage = [], "fragment_shader"
    for line in log.splitlines():
        heading = line.strip().strip("=").strip()
        if heading in sources:
            stage = heading
        match = _MESSAGE.match(line.strip())
        if match:
            number = int(match[1] or match[2])
            origin = sources[stage].origin
            file, row = origin[min(number, len(origin)) - 1] if origin else (stage, number)
            faults.append(Fault(match[3], f"shaders/{file}", row))
    return faults or [Fault(f"the driver refused a shader: {log.strip()}")]


@dataclass(frozen=True)
class ProgramText:
    """Everything that decides a program: two expanded stages. Equal texts share one compiled program."""

    vertex: Source
    fragment: Source

    @cached_property
    def key(self) -> str:
        """Hash of both stages' text."""
        digest = hashlib.blake2b(self.vertex.text.encode(), digest_size=16)
        digest.update(b"\0" + self.fragment.text.encode())
        return digest.hexdigest()


@cache
def program_text(
    shader: str,
    vertex: str,
    layout: Layout,
    samplers: tuple[tuple[str, str], ...],
    outputs: tuple[tuple[str, str], ...],
    attached: tuple[str, ...],
    defines: tuple[tuple[str, str], ...] = (),
    generated: tuple[tuple[str, str], ...] = (),
) -> ProgramText:
    """Return the text of a pass's program.

    Both stages begin with what Python declares: the uniform block `p`, the samplers, and the outputs. An output
    that is not attached becomes a plain global, so that the compiler drops the work behind it.

    Parameters
    ----------
    shader, vertex : names of the two stages below the shaders folder
    layout : the uniform block
    samplers : (name, GLSL sampler type) pairs
    outputs : (name, GLSL type) pairs, all that the shader writes
    attached : names of the outputs with a render target, in the order of their locations
    defines : (name, value) pairs
    generated : (name, text) pairs of includes that exist only in memory
    """
    head = ["#version 330 core"]
    head += [f"#define {name} {value}" for name, value in defines]
    block = layout.glsl().splitlines()
    uniform = [f"uniform {kind} {name};" for name, kind in samplers]
    targets = [
        f"layout(location = {attached.index(name)}) out {kind} {name};" if name in attached else f"{kind} {name};"
        for name, kind in outputs
    ]
    extra = dict(generated)

    def stage(name: str, lines: list[str]) -> Source:
        body = expand(name, extra)
        generated_origin = (("(generated declarations)", 0),) * len(lines)
        return Source("\n".join(lines) + "\n" + body.text, generated_origin + body.origin)

    return ProgramText(stage(vertex, head + block), stage(shader, head + block + uniform + targets))


@cache
def compile_program(text: ProgramText) -> moderngl.Program:
    """Compile and link; the uniform block is bound to 0 and the samplers keep the order of declaration.

    Raises
    ------
    DeviceError : with the shader's own file and line
    """
    COUNTERS.compiles += 1
    try:
        program = get_context().program(vertex_shader=text.vertex.text, fragment_shader=text.fragment.text)
    except moderngl.Error as error:
        sources = {"vertex_shader": text.vertex, "fragment_shader": text.fragment}
        raise DeviceError(locate(str(error), sources)) from None
    return program
