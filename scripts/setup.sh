#!/bin/sh
# Makes this checkout runnable: the system's OpenGL and venv packages where they are missing, .venv, and the Python
# packages in it. Does nothing, quickly, where nothing has changed. NO_APT=1 leaves the system's packages alone.
set -eu
cd "$(dirname "$0")/.."

say() { printf 'setup: %s\n' "$*"; }
stop() {
    say "$*" >&2
    exit 1
}

# --- a Python that is new enough ------------------------------------------------------------------------------------
new_enough='import sys; sys.exit(sys.version_info < (3, 11))'
python=
for candidate in python3 python3.14 python3.13 python3.12 python3.11; do
    if command -v "$candidate" >/dev/null 2>&1 && "$candidate" -c "$new_enough"; then
        python=$candidate
        break
    fi
done
[ -n "$python" ] || stop "skincli needs Python 3.11 or later, and here python3 is $(python3 -V 2>&1 || true)."

# --- the system's packages ------------------------------------------------------------------------------------------
# Prints the Debian names of what is missing. Asked is what counts, whatever package manager brought it: does Python
# have ensurepip, do the libraries load, does EGL know a device that can be started?
missing_packages() {
    "$python" - "$python" <<'EOF'
import ctypes, importlib.util, sys

def library(name):
    try:
        return ctypes.CDLL(name)
    except OSError:
        return None

def a_device_starts(egl):
    pointer, integer = ctypes.c_void_p, ctypes.c_int
    egl.eglGetProcAddress.restype = pointer
    query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    display_of = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query or not display_of:
        return False
    query = ctypes.CFUNCTYPE(integer, integer, ctypes.POINTER(pointer), ctypes.POINTER(integer))(query)
    display_of = ctypes.CFUNCTYPE(pointer, integer, pointer, pointer)(display_of)
    devices, count = (pointer * 16)(), integer()
    query(16, devices, ctypes.byref(count))
    egl.eglInitialize.argtypes = [pointer, pointer, pointer]
    platform_device = 0x313F  # EGL_PLATFORM_DEVICE_EXT
    displays = [display_of(platform_device, device, None) for device in devices[: count.value]]
    return any(display and egl.eglInitialize(display, None, None) for display in displays)

missing = []
if importlib.util.find_spec("ensurepip") is None:
    missing.append(sys.argv[1] + "-venv")
if sys.platform.startswith("linux"):
    egl = library("libEGL.so.1")
    if egl is None:
        missing.append("libegl1")
    if library("libGL.so.1") is None:
        missing.append("libgl1")
    if egl is None or not a_device_starts(egl):
        missing.append("libgl1-mesa-dri")
print(*missing)
EOF
}

probe=$(mktemp)
trap 'rm -f "$probe"' EXIT
check_system() { missing=$(missing_packages 2>"$probe") || stop "the check of the system failed: $(cat "$probe")"; }

check_system
if [ -n "$missing" ]; then
    as_root=
    [ "$(id -u)" = 0 ] || as_root="sudo "
    install="${as_root}apt-get install --no-install-recommends -y $missing"
    command -v apt-get >/dev/null 2>&1 ||
        stop "missing on this system: what Debian calls $missing; install it by your package manager."
    [ "${NO_APT:-0}" = 0 ] || stop "missing system packages, and NO_APT is set; run: $install"
    if [ -n "$as_root" ]; then
        sudo -n true 2>/dev/null || stop "missing system packages, and no right to install them; run: $install"
        as_root="sudo -n "
    fi
    say "system packages are missing; installing them now (NO_APT=1 would not): $install"
    ${as_root}apt-get -qq update || say "the package lists could not be renewed; trying with those that are here"
    # shellcheck disable=SC2086 # the words of $missing are arguments
    ${as_root}env DEBIAN_FRONTEND=noninteractive apt-get install --no-install-recommends -y $missing ||
        stop "that failed; run it by hand: $install"
    check_system
    [ -z "$missing" ] || stop "still missing after the installation: $missing (what the drivers said: $(cat "$probe"))"
fi

# --- .venv and the Python packages ----------------------------------------------------------------------------------
# The stamp holds what the environment was made from and where: a moved copy would run the checkout it came from.
wanted="$PWD $(cat pyproject.toml scripts/setup.sh | cksum)"
works='import sys, pip; sys.exit(sys.version_info < (3, 11))'
if ! .venv/bin/python -c "$works" >/dev/null 2>&1; then
    say "making .venv with $("$python" -V)"
    "$python" -m venv --clear .venv
elif [ "$(cat .venv/skincli-stamp 2>/dev/null)" = "$wanted" ]; then
    exit 0
fi
say "installing skincli and its Python packages into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
printf '%s\n' "$wanted" >.venv/skincli-stamp
say "done: .venv/bin/skincli is ready"
