"""Draw calls with everything looked up that does not change from frame to frame, and how long they took."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import moderngl

from skincli.errors import DeviceError
from skincli.gpu.blocks import Layout
from skincli.gpu.context import device_info, get_context
from skincli.gpu.counters import COUNTERS
from skincli.gpu.geometry import Geometry
from skincli.gpu.program import ProgramText, compile_program
from skincli.gpu.textures import Texture, TexturePool, sampler


class DrawCall:
    """A compiled draw: program, vertices, uniform buffer and samplers.

    Parameters
    ----------
    text : the program
    layout : its uniform block
    samplers : (name, filter, repeat) of the textures it may read
    geometry, topology, part : what is drawn; topology "screen" is one triangle over the target
    points : draw so many points instead, which have no attributes

    Raises
    ------
    DeviceError : the driver refuses the shader, or lays the block out differently from std140
    """

    def __init__(
        self,
        text: ProgramText,
        layout: Layout,
        samplers: Sequence[tuple[str, str, bool]],
        geometry: Geometry | None = None,
        topology: str = "screen",
        part: int | None = None,
        points: int = 0,
    ) -> None:
        program = compile_program(text)
        #: names of the textures that the compiled program reads, in the order in which they are to be given
        self.reads: list[str] = []
        self._samplers: list[moderngl.Sampler] = []
        for name, filter, repeat in samplers:
            if name in program:
                program[name] = len(self.reads)
                self.reads.append(name)
                self._samplers.append(sampler(filter, repeat))
        self._packed = b""
        self._block: moderngl.Buffer | None = None
        if "Values" in program:
            declared = program["Values"]
            assert isinstance(declared, moderngl.UniformBlock)
            if declared.size != layout.size:
                raise DeviceError(
                    f"the driver lays a uniform block out in {declared.size} bytes where std140 has {layout.size}; "
                    "update the driver, or choose another by SKINCLI_DEVICE"
                )
            self._block = get_context().buffer(reserve=layout.size, dynamic=True)
        self._mode = moderngl.POINTS if points else moderngl.TRIANGLES
        if points or topology == "screen":
            self._vertices = get_context().vertex_array(program, [])
            self._first, self._count = 0, points or 3
        else:
            assert geometry is not None
            assert part is not None
            self._vertices = geometry.vertex_array(program, topology)
            self._first, self._count = geometry.part_range(topology, part)

    def __call__(self, packed: bytes, read: Sequence[Texture]) -> None:
        """Draw into the bound target.

        Parameters
        ----------
        packed : bytes of the uniform block
        read : one texture per name of `reads`
        """
        if self._block is not None:
            if packed != self._packed:
                self._block.write(packed)
                self._packed = packed
            self._block.bind_to_uniform_block(0)
        for unit, (texture, state) in enumerate(zip(read, self._samplers, strict=True)):
            texture.handle.use(unit)
            state.use(unit)
        if self._count:
            self._vertices.render(self._mode, vertices=self._count, first=self._first)
            COUNTERS.draws += 1


def bind_target(pool: TexturePool, targets: Sequence[Texture], additive: bool, depth: bool) -> None:
    """Bind and clear the targets; `additive` sums the draws, `depth` keeps the nearest surface."""
    context = get_context()
    framebuffer = pool.framebuffer(targets, depth)
    framebuffer.use()
    framebuffer.clear()
    blend, nearest = context.BLEND if additive else 0, context.DEPTH_TEST if depth else 0
    context.enable_only(blend | nearest | context.PROGRAM_POINT_SIZE)
    if additive:
        context.blend_func = context.ONE, context.ONE


def timed(work: Callable[[], None]) -> Callable[[], float]:
    """Do the work and return a function that tells its milliseconds.

    On a GPU a timer query measures, and only asking for the number waits. Software GL has no such clock: there the
    driver is waited for before and after the work.
    """
    context = get_context()
    if device_info()["software"]:
        context.finish()
        start = time.perf_counter()
        work()
        context.finish()
        ms = (time.perf_counter() - start) * 1000
        return lambda: ms
    query = context.query(time=True)
    with query:
        work()
    return lambda: query.elapsed / 1e6
