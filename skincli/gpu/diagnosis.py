"""Why OpenGL does not work here and what to do about it: text to text, without OpenGL, so that it always answers."""

from __future__ import annotations

import re
from pathlib import Path

from skincli.errors import DeviceError

# Message of the loader or the driver -> what it means -> what to do. The first match holds.
FAILURES = (
    (
        r"No module named|is missing$",
        "skincli is not completely installed",
        "run make setup in a checkout; elsewhere install skincli again by pip, with its packages",
    ),
    (
        r"SKINCLI_DEVICE is",
        "the environment variable SKINCLI_DEVICE holds something else than a device's number",
        "set SKINCLI_DEVICE to 0, 1, ..., or unset it",
    ),
    (
        r"not loaded|cannot open shared object",
        "the OpenGL or EGL library is not installed",
        "on Debian or Ubuntu: apt-get install --no-install-recommends libegl1 libgl1 libgl1-mesa-dri; libraries with "
        "other names are pointed to by GLCONTEXT_LINUX_LIBGL and GLCONTEXT_LINUX_LIBEGL",
    ),
    (
        r"found 0 devices",
        "EGL is installed, but no driver has registered with it",
        "install libgl1-mesa-dri for software drawing; in an NVIDIA container set "
        "NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility and have 10_nvidia.json in /usr/share/glvnd/egl_vendor.d",
    ),
    (
        r"requested device index",
        "there is no EGL device of that number",
        "set SKINCLI_DEVICE to a smaller number, they start at 0, or unset it",
    ),
    (
        r"eglInitialize failed|eglGetPlatformDisplay\w* failed|EGL_NOT_INITIALIZED|EGL_BAD_DISPLAY",
        "the driver is there, but cannot be started: no right to /dev/dri, a driver that does not fit the kernel's, "
        "or libgl1-mesa-dri missing",
        "join the groups render and video, reinstall the driver, or unset SKINCLI_DEVICE to take any device that works",
    ),
    (
        r"eglCreateContext failed|Requested OpenGL version|eglChooseConfig failed|eglBindAPI failed",
        "the driver does not offer OpenGL 3.3",
        "update the driver, or take Mesa's software driver (package libgl1-mesa-dri) by another SKINCLI_DEVICE; unset "
        "MESA_GL_VERSION_OVERRIDE and GLCONTEXT_GLVERSION if they are set",
    ),
    (
        r"XOpenDisplay",
        "the X11 way to OpenGL was tried, which needs a display",
        "skincli takes EGL on Linux; report how you came here",
    ),
    (
        r"eglQueryDevicesEXT|eglGetPlatformDisplayEXT not found|\w+ not found",
        "the EGL library is too old to draw without a display",
        "install libegl1 1.3 or later",
    ),
    (
        r"pixel|float32",
        "the context opened, but what it draws is wrong",
        "update the driver, or unset SKINCLI_DEVICE to take any device that works",
    ),
    (
        r"killed by|time limit",
        "the OpenGL driver crashed or hung while it was being started",
        "update the driver, or choose another device by SKINCLI_DEVICE=1; mixed driver versions and a conda libstdc++ "
        "before the system's in LD_LIBRARY_PATH are the usual reasons",
    ),
    (
        r"software OpenGL",
        "drawing falls to the processor",
        "install the GPU's driver with its EGL part, choose its device by SKINCLI_DEVICE, or do not require a GPU",
    ),
)


def diagnose(text: str) -> tuple[str, str]:
    """Return (cause, remedy) for the message `text` of a failed attempt to draw."""
    for pattern, cause, remedy in FAILURES:
        if re.search(pattern, text, re.IGNORECASE):
            return cause, remedy
    return "the cause is not known", "run `skincli doctor --json` and report what it prints"


def device_error(text: str) -> DeviceError:
    """Return the error that says what was found, why, and what to do."""
    cause, remedy = diagnose(text)
    return DeviceError(f"no usable OpenGL device ({text}): {cause}; {remedy}")


def gpu_present() -> str | None:
    """Return a file that betrays a GPU in this machine (Linux), or None."""
    candidates = [Path("/dev/nvidia0"), Path("/proc/driver/nvidia"), *sorted(Path("/dev/dri").glob("renderD*"))]
    return next((str(path) for path in candidates if path.exists()), None)
