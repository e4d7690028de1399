"""The one OpenGL context of the process: how it is made, what it is checked for, what can be told about it.

One context per process, because moderngl objects of two contexts silently read each other's textures; more parallelism
means more processes, started afresh (a forked child inherits a driver whose threads do not exist in it).

The driver is reached through EGL on Linux. Elsewhere the platform's own way is taken, which nobody has tested.
"""

from __future__ import annotations

import logging
import os
import re
import struct
import sys
import threading
from dataclasses import dataclass
from typing import Any

import moderngl

from skincli.errors import DeviceError
from skincli.gpu.diagnosis import device_error, gpu_present

log = logging.getLogger("skincli")

GL_VERSION = 330
DEVICES_TRIED = 8
SOFTWARE = re.compile(r"llvmpipe|softpipe|swrast|swiftshader|software rasterizer", re.IGNORECASE)

# The limits a program here can run into, by the names they have in reports; all are single integers.
LIMITS = {
    "max_texture_size": "GL_MAX_TEXTURE_SIZE",
    "max_samplers": "GL_MAX_TEXTURE_IMAGE_UNITS",
    "max_draw_buffers": "GL_MAX_DRAW_BUFFERS",
    "max_uniform_block_size": "GL_MAX_UNIFORM_BLOCK_SIZE",
    "max_samples": "GL_MAX_SAMPLES",
}


@dataclass(frozen=True)
class _Owned:
    """The context with the process and thread it belongs to, and the framebuffer that is bound while none is needed."""

    ctx: moderngl.Context
    device: int
    process: int
    thread: int
    resting: moderngl.Framebuffer


_owned: _Owned | None = None


def get_context(require_gpu: bool = False, device: int | None = None) -> moderngl.Context:
    """Return this process's context; the first call makes and checks it.

    Parameters
    ----------
    require_gpu : refuse software OpenGL
    device : number of the EGL device, from 0; without it SKINCLI_DEVICE, without that the first device that works

    Raises
    ------
    DeviceError
        No device draws; software OpenGL where a GPU is required; another device than the process already uses;
        the context belongs to another thread or to the parent of a forked process.

    Notes
    -----
    `gc_mode` stays None: an object leaves the GPU when its owner calls `release()`, never when Python's collector
    happens to run, which may be in another thread or in the middle of a draw. Nothing is enabled: no depth test, no
    blending, no culling. Before a framebuffer that may be bound is released, call `rest()`.
    """
    global _owned
    if _owned is None:
        _owned = _create(_wanted_device() if device is None else device)
        _notice(_owned.ctx)
    elif _owned.process != os.getpid():
        raise DeviceError("this process was forked from one that draws already; start it afresh (spawn, not fork)")
    elif _owned.thread != threading.get_ident():
        raise DeviceError("the OpenGL context belongs to another thread of this process; draw from that one thread")
    elif device is not None and device != _owned.device:
        raise DeviceError(
            f"this process draws on device {_owned.device} already; start another process for device {device}"
        )
    if require_gpu and is_software(_owned.ctx):
        raise device_error(f"software OpenGL '{_owned.ctx.info['GL_RENDERER']}' where a GPU is required")
    return _owned.ctx


def rest() -> None:
    """Bind a framebuffer that lives as long as the context.

    moderngl binds the last used framebuffer again after most operations, so releasing that one makes each later
    operation an error (GL_INVALID_OPERATION). Whoever releases framebuffers calls this first.
    """
    if _owned is not None:
        _owned.resting.use()


def device_info() -> dict[str, Any]:
    """Return what a report says about the device of `get_context()`: plain values with JSON's types."""
    ctx = get_context()
    assert _owned is not None
    info = ctx.info
    return {
        "vendor": info["GL_VENDOR"],
        "renderer": info["GL_RENDERER"],
        "version": info["GL_VERSION"],
        "software": is_software(ctx),
        "device": _owned.device,
        **{name: int(info[key]) for name, key in LIMITS.items()},
    }


def is_software(ctx: moderngl.Context) -> bool:
    """Tell whether the processor does the drawing."""
    return SOFTWARE.search(ctx.info["GL_RENDERER"]) is not None


def _notice(ctx: moderngl.Context) -> None:
    """Say that the processor draws although the machine has a GPU: slow, and easily overlooked."""
    trace = gpu_present()
    if trace and is_software(ctx):
        log.warning(
            "drawing in software (%s) although this machine has a GPU (%s); `skincli doctor` says more",
            ctx.info["GL_RENDERER"],
            trace,
        )


def _wanted_device() -> int | None:
    """Return the device number that SKINCLI_DEVICE asks for, or None."""
    text = os.environ.get("SKINCLI_DEVICE", "")
    if not text:
        return None
    if not text.isdecimal():
        raise DeviceError(
            f"SKINCLI_DEVICE is '{text}'; the number of a device, 0, 1, ..., is allowed; correct or unset it"
        )
    return int(text)


def _create(device: int | None) -> _Owned:
    """Make a context on `device`, or where that is None on the first device that can be opened and draws rightly."""
    linux = sys.platform.startswith("linux")
    numbers = range(DEVICES_TRIED if linux else 1) if device is None else (device,)
    failures: list[Exception] = []
    for number in numbers:
        try:
            ctx = _open(number) if linux else moderngl.create_context(require=GL_VERSION, standalone=True)
            resting = _draw_one_pixel(ctx)
        except Exception as problem:  # moderngl and glcontext raise bare Exception for what the driver refuses
            failures.append(problem)
            if "requested device index" in str(problem):  # counted past the last device
                break
        else:
            for failed, reason in enumerate(failures):
                log.warning("OpenGL device %d cannot be used (%s); drawing on device %d", failed, reason, number)
            return _Owned(ctx, number, os.getpid(), threading.get_ident(), resting)
    raise device_error(str(failures[0])) from failures[0]


def _open(device: int) -> moderngl.Context:
    """Open EGL device `device`; the libraries by soname, since glcontext's own search needs ldconfig or a compiler."""
    settings: dict[str, Any] = {
        "backend": "egl",
        "device_index": device,
        "libgl": "libGL.so.1",
        "libegl": "libEGL.so.1",
    }
    return moderngl.create_context(require=GL_VERSION, standalone=True, **settings)


def _draw_one_pixel(ctx: moderngl.Context) -> moderngl.Framebuffer:
    """Draw values that only a true float32 target keeps, read them back, and return the target, bound.

    glcontext checks neither that a configuration was found nor that the context became current, so a context that was
    "made" may draw nothing at all.
    """
    target = ctx.framebuffer([ctx.texture((1, 1), 4, dtype="f4")])
    wanted = struct.unpack("4f", struct.pack("4f", 1 / 3, -2.0, 70000.25, 1e-6))
    found = draw_value(ctx, target, wanted)
    if found != wanted or ctx.error != "GL_NO_ERROR":
        raise RuntimeError(f"a pixel drawn as {wanted} reads back as {found}")
    return target


def draw_value(
    ctx: moderngl.Context, target: moderngl.Framebuffer, value: tuple[float, ...], times: int = 1
) -> tuple[float, ...]:
    """Clear the one-pixel `target`, draw the four numbers `value` into it `times` times, return what it then holds."""
    program = ctx.program(
        vertex_shader="""#version 330 core
            void main() { gl_Position = vec4(4.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0, 0.0, 1.0); }""",
        fragment_shader="""#version 330 core
            uniform vec4 value; out vec4 color;
            void main() { color = value; }""",
    )
    program["value"] = value
    triangle = ctx.vertex_array(program, [])
    target.use()
    target.clear()
    for _ in range(times):
        triangle.render(vertices=3)
    found = struct.unpack("4f", target.read(components=4, dtype="f4"))
    triangle.release()
    program.release()
    return found
