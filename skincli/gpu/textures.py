"""Textures: formats, a pool that hands freed ones out again, uploads and read-backs. Row 0 of an array is the top."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from skincli.errors import LimitError
from skincli.gpu.context import device_info, get_context, rest
from skincli.gpu.counters import COUNTERS

#: share of the machine's memory that textures may take on software GL
MEMORY_SHARE = 0.75

#: format name -> (components, moderngl dtype, bytes of a texel)
FORMATS = {
    "r32f": (1, "f4", 4),
    "rg32f": (2, "f4", 8),
    "rgba32f": (4, "f4", 16),
    "r16f": (1, "f2", 2),
    "rg16f": (2, "f2", 4),
    "rgba16f": (4, "f2", 8),
}


#: size, format, and whether it has levels below 0
Shape = tuple[tuple[int, int], str, bool]


def bytes_of(shape: Shape) -> int:
    """Return the bytes of a texture; a full mip chain adds a third."""
    (width, height), format, mipmaps = shape
    base = width * height * FORMATS[format][2]
    return base * 4 // 3 if mipmaps else base


@dataclass(frozen=True, eq=False)
class Texture:
    """A texture on the GPU; equality is identity."""

    handle: moderngl.Texture
    size: tuple[int, int]
    format: str
    mipmaps: bool

    @property
    def shape(self) -> Shape:
        """What makes it fit in another's place."""
        return self.size, self.format, self.mipmaps

    @property
    def bytes(self) -> int:
        """Bytes it takes."""
        return bytes_of(self.shape)


class TexturePool:
    """Hands out render targets and takes them back, so that later passes and frames reuse the memory."""

    def __init__(self) -> None:
        self._free: dict[Shape, list[Texture]] = {}
        self._framebuffers: dict[tuple[int, ...], moderngl.Framebuffer] = {}
        self._depth: dict[tuple[int, int], moderngl.Renderbuffer] = {}

    def acquire(self, shape: Shape) -> Texture:
        """Return a texture of undefined content.

        Raises
        ------
        LimitError : larger than the driver allows, or out of memory
        """
        free = self._free.get(shape)
        if free:
            return free.pop()
        return create_texture(*shape)

    def release(self, texture: Texture) -> None:
        """Take a texture back; its content may be overwritten from now on."""
        self._free.setdefault(texture.shape, []).append(texture)

    def trim(self, limit: int, wanted: Collection[Shape] = ()) -> None:
        """Free textures that are not in use until the rest takes at most `limit` bytes, those of wanted shapes last."""
        idle = sum(texture.bytes for textures in self._free.values() for texture in textures)
        if idle > limit:
            rest()
        for _, textures in sorted(self._free.items(), key=lambda item: item[0] in wanted):
            while textures and idle > limit:
                texture = textures.pop()
                idle -= texture.bytes
                self._forget(texture)

    def _forget(self, texture: Texture) -> None:
        glo = texture.handle.glo
        for key in [key for key in self._framebuffers if glo in key[1:]]:
            self._framebuffers.pop(key).release()
        destroy_texture(texture)

    def framebuffer(self, textures: Sequence[Texture], depth: bool) -> moderngl.Framebuffer:
        """Return the framebuffer with these color targets, and a depth buffer where asked for."""
        key = (int(depth), *(texture.handle.glo for texture in textures))
        found = self._framebuffers.get(key)
        size = textures[0].size
        if found is None:
            if depth and size not in self._depth:
                self._depth[size] = get_context().depth_renderbuffer(size)
            try:
                found = get_context().framebuffer(
                    [texture.handle for texture in textures], self._depth[size] if depth else None
                )
            except moderngl.Error as error:
                # A driver that has no memory for a texture may say so only here.
                raise LimitError(f"no memory for {len(textures)} targets of {size[0]} x {size[1]}: {error}") from None
            self._framebuffers[key] = found
        return found


def beyond_memory(need: int) -> str | None:
    """Return what to say where `need` bytes of textures are too many for software GL; None where they fit.

    A GPU's driver says itself when its memory is out; software GL would make the machine swap.
    """
    have = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if not device_info()["software"] or need <= MEMORY_SHARE * have:
        return None
    limit = f"of the {have / 1e9:.0f} GB here {MEMORY_SHARE:.0%} are allowed"
    return f"textures of about {need / 1e9:.0f} GB are needed; {limit}"


def create_texture(size: tuple[int, int], format: str, mipmaps: bool = False) -> Texture:
    """Allocate a texture; see TexturePool.acquire for the errors."""
    components, dtype, texel = FORMATS[format]
    limit = get_context().info["GL_MAX_TEXTURE_SIZE"]
    if max(size) > limit:
        raise LimitError(f"a texture of {size[0]} x {size[1]} is asked for; this driver allows {limit} a side")
    try:
        handle = get_context().texture(size, components, dtype=dtype)
        if mipmaps:
            handle.build_mipmaps()
    except moderngl.Error as error:
        need = size[0] * size[1] * texel / 1e6
        raise LimitError(f"no memory for a texture of {size[0]} x {size[1]} ({need:.0f} MB): {error}") from None
    texture = Texture(handle, size, format, mipmaps)
    COUNTERS.allocated(texture.bytes)
    COUNTERS.textures += 1
    return texture


def destroy_texture(texture: Texture) -> None:
    """Free the texture's memory."""
    COUNTERS.allocated(-texture.bytes)
    texture.handle.release()


def upload(pyramid: Sequence[NDArray[np.floating]], format: str, build_mipmaps: bool = False) -> Texture:
    """Make a texture from arrays.

    Parameters
    ----------
    pyramid : (h, w, c) arrays, level 0 first; c as the format has
    build_mipmaps : let the driver make the levels below 0
    """
    height, width = pyramid[0].shape[:2]
    texture = create_texture((width, height), format, build_mipmaps or len(pyramid) > 1)
    dtype = np.float16 if FORMATS[format][1] == "f2" else np.float32
    for level, array in enumerate(pyramid):
        data = np.ascontiguousarray(array[::-1], dtype=dtype)
        texture.handle.write(data.tobytes(), level=level, alignment=1)
        COUNTERS.bytes_uploaded += data.nbytes
    if build_mipmaps:
        texture.handle.build_mipmaps()
    COUNTERS.uploads += 1
    return texture


def read_back(texture: Texture) -> NDArray[np.float32]:
    """Return level 0 as (h, w, c) float32, top row first."""
    components, dtype, _ = FORMATS[texture.format]
    data = texture.handle.read(alignment=1)
    COUNTERS.bytes_read += len(data)
    array = np.frombuffer(data, np.float16 if dtype == "f2" else np.float32)
    return array.reshape(texture.size[1], texture.size[0], components)[::-1].astype(np.float32)


_FILTERS = {
    "nearest": (moderngl.NEAREST, moderngl.NEAREST),
    "linear": (moderngl.LINEAR, moderngl.LINEAR),
    "mipmap": (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR),
}


@cache
def sampler(filter: str, repeat: bool) -> moderngl.Sampler:
    """Return the sampler object for a filter and wrap; see skincli.graph.node.Input."""
    if filter == "bordered":
        return get_context().sampler(filter=_FILTERS["nearest"], border_color=(0.0, 0.0, 0.0, 0.0))
    return get_context().sampler(filter=_FILTERS[filter], repeat_x=repeat, repeat_y=repeat)


@cache
def constant(value: tuple[float, float, float, float]) -> Texture:
    """Return the 1x1 texture that stands for an input nobody computed."""
    return upload([np.array(value, np.float32).reshape(1, 1, 4)], "rgba32f")
