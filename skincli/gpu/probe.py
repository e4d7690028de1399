"""What `skincli doctor` runs in a child process, since a bad driver may crash: make the context, draw, tell as JSON."""

from __future__ import annotations

import json
import time
from typing import Any

import moderngl

from skincli.errors import DeviceError
from skincli.gpu.context import device_info, draw_value, get_context, rest


def probe() -> dict[str, Any]:
    """Return {"device", "seconds", "checks"}: the device, the time its context took, what was drawn and found right.

    Raises
    ------
    DeviceError
        There is no usable device.
    """
    start = time.perf_counter()
    ctx = get_context()
    seconds = time.perf_counter() - start
    checks = {
        "float32 target": _drawn(ctx, "f4", times=1) == _expected(1),
        "float16 target": _drawn(ctx, "f2", times=1) == _expected(1),
        "float32 blending": _drawn(ctx, "f4", times=3) == _expected(3),
    }
    return {"device": device_info(), "seconds": round(seconds, 3), "checks": checks}


# Exact in half precision, also after being added up three times; one above 1, one below 0: neither may be clamped.
_VALUE = (0.25, -2.0, 100.5, 1.0)


def _expected(times: int) -> tuple[float, ...]:
    return tuple(times * value for value in _VALUE)


def _drawn(ctx: moderngl.Context, dtype: str, times: int) -> tuple[float, ...]:
    """Return the pixel that results when `_VALUE` is drawn `times` times, additively, into a target of `dtype`."""
    texture = ctx.texture((1, 1), 4, dtype=dtype)
    target = ctx.framebuffer([texture])
    ctx.enable(moderngl.BLEND)
    ctx.blend_func = moderngl.ONE, moderngl.ONE
    pixel = draw_value(ctx, target, _VALUE, times)
    ctx.disable(moderngl.BLEND)
    rest()
    target.release()
    texture.release()
    return pixel


def main() -> None:
    """Print what `probe` returns, or {"error": text}, as one line of JSON."""
    try:
        found = probe()
    except DeviceError as problem:
        found = {"error": str(problem.__cause__ or problem)}  # the driver's own words, where it said any
    print(json.dumps(found))


if __name__ == "__main__":
    main()
