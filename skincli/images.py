"""Pictures in and out of files, through OpenImageIO alone; the only place where encoded values exist.

Every array is (h, w, c) float32 with the TOP row first, as files have it, scene-linear Rec.709 where it is color, and
with straight (unassociated) alpha. What a file holds is decided by the role it is read for, never by its tags, because
most PNG files are tagged sRGB whatever they contain:

- color in integer files is sRGB-encoded; color in float files (EXR, HDR, PFM) is linear;
- data (height, normals, masks) is taken as stored, integers scaled to [0, 1].

An EXR picture is placed into its display window. Orientation tags of cameras are not applied: texture coordinates
refer to the stored pixels.
"""

from __future__ import annotations

import logging
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenImageIO as oiio  # noqa: N813
from numpy.typing import ArrayLike, NDArray

from skincli.color import luminance, srgb_decode, srgb_encode
from skincli.errors import Fault, InputError, LimitError, OutputError

Image = NDArray[np.float32]
StrPath = str | os.PathLike[str]
ColorSpace = Literal["lin_rec709_scene", "data"]
"""What the numbers of an EXR file are, in the names of the Color Interop Forum (ASWF, 2024)."""

MAX_SIDE = 32768
"""Longest side of a picture, in pixels."""
MAX_MEGABYTES = 1024
"""Largest picture, decoded to float32."""
HALF_MAX = 65504.0
"""Largest finite value of a half."""

# OpenImageIO's readers of what is no still picture: nothing at all, volumes, movies, one texture per face.
_NO_PICTURES = {"null", "openvdb", "ffmpeg", "ptex"}

_log = logging.getLogger("skincli")


# ---------------------------------------------------------------------------------------------------------- reading


@cache
def formats() -> Mapping[str, tuple[str, ...]]:
    """Return what a picture may be: the names of the readers, each with its suffixes, such as "png": (".png",)."""
    readers = set(oiio.get_string_attribute("input_format_list").split(",")) - _NO_PICTURES
    entries = (entry.split(":") for entry in sorted(oiio.get_string_attribute("extension_list").split(";")))
    return {name: tuple(f".{suffix}" for suffix in found.split(",")) for name, found in entries if name in readers}


@dataclass(frozen=True)
class _Stored:
    """What a file holds, undecoded: `pixels` (h, w, c), unsigned integers or float32, alpha last if there is one."""

    pixels: NDArray[Any]
    alpha: bool
    associated: bool
    names: list[str]
    label: str

    @property
    def integer(self) -> bool:
        return self.pixels.dtype != np.float32

    @property
    def scale(self) -> float:
        """The stored value that means 1."""
        return float(np.iinfo(self.pixels.dtype).max) if self.integer else 1.0

    @property
    def colors(self) -> int:
        return len(self.names) - self.alpha

    def refuse(self, wanted: str) -> InputError:
        return InputError(Fault(f"has the channels {', '.join(self.names)}; {wanted}", self.label))


def read_color(path: StrPath, label: str | None = None) -> Image:
    """Read a picture as color.

    Parameters
    ----------
    path : any still picture that OpenImageIO reads (see `formats`), recognized by content
    label : the path as the user wrote it, for messages; `path` by default

    Returns
    -------
    Image
        (h, w, 4) scene-linear Rec.709 and straight alpha, top row first. A gray picture fills all three channels; alpha
        is 1 where the file has none. Associated files (EXR, some TIFF and TGA) are divided by alpha (see `straight`).
        Of an EXR with several layers the unnamed one is read, else the first.

    Raises
    ------
    InputError
        The file is missing, not a picture of an allowed format, corrupt, deep, or has no color.
    LimitError
        The picture is larger than `MAX_SIDE` or `MAX_MEGABYTES`.
    """
    stored = _load(path, label, oiio.UINT16)
    if stored.colors not in (1, 3):
        raise stored.refuse("a color picture needs R, G and B or one gray channel; export it again with these")
    pixels = stored.pixels
    height, width, _ = pixels.shape
    result = np.ones((height, width, 4), np.float32)
    color = pixels[..., : stored.colors]
    if stored.alpha:
        result[..., 3] = pixels[..., -1] / np.float32(stored.scale)
    if stored.alpha and stored.associated:
        divided = straight(np.concatenate([color, result[..., 3:]], axis=2))[..., :-1]
        color = np.minimum(np.rint(divided), stored.scale).astype(color.dtype) if stored.integer else divided
    if stored.integer:
        # A table instead of the curve per pixel: exact, fast, and no float64 copy of a large picture.
        table = srgb_decode(np.arange(int(stored.scale) + 1) / stored.scale).astype(np.float32)
        color = table[color]
    result[..., :3] = color
    return result


def read_data(path: StrPath, channels: int, label: str | None = None, *, spread: bool = False) -> Image:
    """Read a picture as raw values: height, normals, masks.

    Parameters
    ----------
    path, label : see `read_color`
    channels : 1 to 4
    spread : a file of one channel fills the first three, in place of being refused

    Returns
    -------
    Image
        (h, w, channels), integers scaled to [0, 1], no curve undone, top row first. One channel of a color file is its
        first channel where all are equal, else the Rec.709 luminance of the raw values; of a file that has nothing but
        alpha it is the alpha. A fourth channel is alpha, 1 where the file has none.

    Raises
    ------
    InputError, LimitError
        As for `read_color`; also where the file has fewer channels than asked for.
    """
    stored = _load(path, label, oiio.UINT32)
    values = stored.pixels if not stored.integer else stored.pixels.astype(np.float32) / np.float32(stored.scale)
    color = values[..., : stored.colors] if stored.colors else values
    if channels == 1:
        first = color[..., :1]
        if color.shape[2] == 3 and not np.array_equal(first.repeat(3, axis=2), color):
            return luminance(color)[..., None].astype(np.float32)
        return np.ascontiguousarray(first)
    needed = min(channels, 3)
    if spread and stored.colors == 1:
        color = color.repeat(needed, axis=2)
    elif stored.colors < needed:
        raise stored.refuse(f"{needed} channels are needed; export it again with these")
    color = color[..., :needed]
    if channels == 4:
        alpha = values[..., -1:] if stored.alpha else np.ones_like(color[..., :1])
        color = np.concatenate([color, alpha], axis=2)
    return np.ascontiguousarray(color)


def read_environment(path: StrPath, label: str | None = None) -> Image:
    """Read an equirectangular environment: (h, w, 3) linear radiance, top row (the zenith) first; see `read_color`."""
    return np.ascontiguousarray(read_color(path, label)[..., :3])


def size_of(path: StrPath, label: str | None = None) -> tuple[int, int]:
    """Return (width, height) of a picture from its header, with the checks and errors of `read_color`."""
    label = os.fspath(path) if label is None else label
    source = _open(Path(path), label)
    try:
        spec = source.spec()
        _check(spec, label)
        return (spec.full_width, spec.full_height) if spec.format.basetype == oiio.FLOAT else (spec.width, spec.height)
    finally:
        source.close()


def straight(rgba: ArrayLike) -> Image:
    """Divide color by alpha: (h, w, c + 1) associated, alpha last, to straight; as it is where alpha is below 1e-6."""
    values = np.array(rgba, dtype=np.float32)
    alpha = values[..., -1:]
    np.divide(values[..., :-1], alpha, out=values[..., :-1], where=alpha >= 1e-6)
    return values


def _load(path: StrPath, label: str | None, widest: Any) -> _Stored:
    """Check and read the layer of a file that the readers above choose from; integers up to the type `widest`."""
    label = os.fspath(path) if label is None else label
    source = _open(Path(path), label)
    try:
        spec = source.spec()
        _check(spec, label)
        names = list(spec.channelnames)
        chosen, alpha = _layer(names)
        begin, end = min(chosen), max(chosen) + 1
        integer = spec.format.basetype not in (oiio.FLOAT, oiio.HALF, oiio.DOUBLE)
        narrow = {oiio.UINT8: oiio.UINT8, oiio.UINT16: oiio.UINT16, oiio.INT8: oiio.UINT16, oiio.INT16: oiio.UINT16}
        kind = narrow.get(spec.format.basetype, widest) if integer else oiio.FLOAT
        # Asking for the alpha as stored is what keeps OpenImageIO from multiplying sRGB codes by it (see _open).
        associated = not spec.get_int_attribute("oiio:UnassociatedAlpha", 0)
        pixels = source.read_image(0, 0, begin, end, kind)
        # Some readers (JPEG) hand out gray for what a truncated file lacks, and only then say so.
        trouble = source.geterror()
        if trouble or pixels is None:
            found = _one_line(trouble) or "it has no pixels"
            raise InputError(Fault(f"is damaged: {found}; export or copy it again", label))
        if source.seek_subimage(1, 0):
            _log.warning("%s: has several parts; the first is used", label)
        encoding = spec.get_string_attribute("oiio:ColorSpace")
        if integer and "log" in encoding.lower():  # as film scans in DPX and Cineon files are
            _log.warning("%s: is tagged %s, which is not undone; convert it to sRGB or linear EXR", label, encoding)
        source.geterror()  # one part only is noted as an error, which would be printed later
    finally:
        source.close()
    pixels = pixels[..., [index - begin for index in chosen]]
    if not integer:
        _make_finite(pixels, label)
        pixels = _in_display_window(pixels, spec)
    return _Stored(pixels, alpha, associated, [names[index] for index in chosen], label)


def _open(path: Path, label: str) -> Any:
    """Open a file of an allowed format, or say why not."""

    def refusal(found: str) -> InputError:
        return InputError(Fault(f"{found}; a picture may be {', '.join(formats())}; convert it", label))

    if path.is_dir():
        raise refusal("is a folder, not a picture")
    try:
        if path.stat().st_size == 0:
            raise refusal("is empty")
    except OSError as error:
        raise InputError(Fault(f"cannot be read: {error.strerror}; check the path", label)) from error
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(os.fspath(path), wishes)
    if source is None:
        raise refusal(f"cannot be opened as a picture: {_one_line(oiio.geterror())}")
    if source.format_name() not in formats():
        source.close()
        raise refusal(f"is a {source.format_name()} file")
    return source


def _one_line(message: str) -> str:
    return "; ".join(message.split("\n"))


def _check(spec: Any, label: str) -> None:
    """Refuse by the header alone, before anything is decoded."""
    if spec.deep:
        raise InputError(Fault("is a deep picture; only flat ones can be read; flatten it first", label))
    width, height = max(spec.width, spec.full_width), max(spec.height, spec.full_height)
    if min(spec.width, spec.height) < 1 or spec.depth > 1:
        raise InputError(Fault(f"is {width} x {height} x {spec.depth} pixels; it must be a flat picture", label))
    megabytes = width * height * spec.nchannels * 4 / 2**20
    if max(width, height) > MAX_SIDE or megabytes > MAX_MEGABYTES:
        raise LimitError(
            Fault(
                f"is {width} x {height} pixels, {megabytes:.0f} MB decoded; at most {MAX_SIDE} a side and "
                f"{MAX_MEGABYTES} MB are read; scale it down",
                label,
            )
        )


def _layer(names: Sequence[str]) -> tuple[list[int], bool]:
    """Choose the channels to read: those of the unnamed layer, else of the first; R, G, B where they exist.

    Returns their indices, alpha last, and whether there is an alpha.
    """
    layers = [name.rpartition(".")[0] for name in names]
    layer = "" if "" in layers else layers[0]
    members = {name.rpartition(".")[2].upper(): i for i, name in enumerate(names) if layers[i] == layer}
    alpha = members.pop("A", None)
    colors = [members[name] for name in "RGB"] if {"R", "G", "B"} <= members.keys() else list(members.values())
    return (colors, False) if alpha is None else ([*colors, alpha], True)


def _make_finite(pixels: Image, label: str) -> None:
    """Replace NaN by 0 and infinities by the largest (or smallest) finite value, in place, with a warning."""
    finite = np.isfinite(pixels)
    count = pixels.size - np.count_nonzero(finite)
    if count == 0:
        return
    known = pixels[finite]
    highest, lowest = (float(known.max()), float(known.min())) if known.size else (0.0, 0.0)
    np.nan_to_num(pixels, copy=False, nan=0.0, posinf=highest, neginf=lowest)
    _log.warning("%s: %d values are NaN or infinite; NaN became 0, infinity %g", label, count, highest)


def _in_display_window(pixels: Image, spec: Any) -> Image:
    """Place an EXR's stored rectangle into its display window, black where it does not reach."""
    x, y = spec.x - spec.full_x, spec.y - spec.full_y
    width, height = spec.full_width, spec.full_height
    if (x, y, spec.width, spec.height) == (0, 0, width, height):
        return pixels
    window = np.zeros((height, width, pixels.shape[2]), np.float32)
    window[max(y, 0) : max(y + spec.height, 0), max(x, 0) : max(x + spec.width, 0)] = pixels[
        max(-y, 0) : max(height - y, 0), max(-x, 0) : max(width - x, 0)
    ]
    return window


# ---------------------------------------------------------------------------------------------------------- writing


@contextmanager
def atomic(path: StrPath) -> Iterator[Path]:
    """Give a temporary file name beside `path`, with the same suffix, that becomes `path` when the block ends well.

    Missing folders are created. On any exception, Ctrl-C included, the temporary file is removed and `path` is what it
    was before.

    Raises
    ------
    OutputError
        The target cannot be written, or an OSError came out of the block.
    """
    target = Path(path)
    # Without the target's own name, for with more than that a long one would no longer be allowed.
    temporary = target.with_name(f".skincli-{secrets.token_hex(6)}{target.suffix}")
    try:
        _refuse_what_is_no_file(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with open(temporary, "rb+") as written:
            os.fsync(written.fileno())
        os.replace(temporary, target)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        with suppress(OSError):  # gone after the rename; never to be created where the folder is missing
            temporary.unlink()


def require_writable(path: StrPath) -> None:
    """Raise the OutputError of `atomic` where it can be foreseen, before work is done for a file; writes nothing."""
    target = Path(path)
    try:
        _refuse_what_is_no_file(target)
        folder = next(parent for parent in target.absolute().parents if parent.exists())
        if not folder.is_dir():
            raise OSError(f"'{folder}' is not a folder")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OSError(f"the folder '{folder}' does not permit it")
    except OSError as error:
        raise _unwritable(path, error) from error


def _refuse_what_is_no_file(target: Path) -> None:
    if target.exists() and not target.is_file():
        raise OSError("it exists and is not a file")  # a rename would replace a device such as /dev/null


def _unwritable(path: StrPath, error: OSError) -> OutputError:
    return OutputError(Fault(f"cannot be written: {error.strerror or error}; choose a place that can", os.fspath(path)))


def write_text(path: StrPath, text: str) -> None:
    """Write a UTF-8 text file whole or not at all; OutputError where that fails."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_exr(
    path: StrPath,
    layers: Mapping[str, ArrayLike],
    *,
    half: bool | Mapping[str, bool] = True,
    color_space: ColorSpace = "lin_rec709_scene",
    attributes: Mapping[str, str | int | float] | None = None,
) -> None:
    """Write named layers of equal size into one EXR file.

    Parameters
    ----------
    path : the file; equal layers give equal bytes
    layers : name to (h, w) or (h, w, c) array, c 1 to 4, top row first. Channels are named as Nuke and Blender group
        them: R, G, B and A for "beauty", NAME.R, NAME.G, NAME.B (and NAME.A) for others, NAME.U and NAME.V for two
        channels, NAME.Y for one; the layer "depth" is depth.Z. Color of four-channel layers is straight here and
        associated (multiplied by alpha) in the file, as the format demands.
    half : whether channels are half instead of float; a mapping says so per layer, those it leaves out are half. Values
        beyond +-65504 are clamped to that in half layers, with a warning that counts them.
    color_space : the file's `colorInteropID` (and OpenImageIO's `oiio:ColorSpace`): of its color layers, or "data"
        where no layer is color
    attributes : further metadata; DateTime is SOURCE_DATE_EPOCH, or 1970, so that bytes do not change from day to day

    Raises
    ------
    OutputError
        The file cannot be written.
    ValueError
        The layers differ in size or have more than four channels.
    """
    names: list[str] = []
    formats: list[Any] = []
    arrays: list[Image] = []
    clamped: dict[str, int] = {}
    for name, layer in layers.items():
        array = _as_image(layer)
        is_half = half if isinstance(half, bool) else half.get(name, True)
        if is_half and (count := int(np.count_nonzero(np.abs(array) > HALF_MAX))):
            clamped[name] = count
            array = np.clip(array, -HALF_MAX, HALF_MAX)
        if array.shape[2] == 4:
            array = np.concatenate([array[..., :3] * array[..., 3:], array[..., 3:]], axis=2)
        letters = {1: "Z" if name == "depth" else "Y", 2: "UV", 3: "RGB", 4: "RGBA"}[array.shape[2]]
        names += [letter if name == "beauty" else f"{name}.{letter}" for letter in letters]
        formats += [oiio.TypeHalf if is_half else oiio.TypeFloat] * len(letters)
        arrays.append(array)
    if clamped:
        found = ", ".join(f"{count} of {name}" for name, count in clamped.items())
        _log.warning("%s: values beyond +-%g were clamped to it: %s", os.fspath(path), HALF_MAX, found)
    pixels = np.concatenate(arrays, axis=2)
    # OpenImageIO drops the formats of the channels where all are equal, and takes the file's own.
    kind = oiio.TypeFloat if oiio.TypeFloat in formats else oiio.TypeHalf
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(formats)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:ColorSpace", color_space)
    for key, value in (attributes or {}).items():
        spec.attribute(key, value)
    _write("openexr", path, spec, pixels)


def write_png(
    path: StrPath,
    image: ArrayLike,
    *,
    kind: Literal["color", "data"] = "color",
    bits: Literal[8, 16] = 8,
    dither_seed: int = 0,
) -> None:
    """Write a PNG file.

    Parameters
    ----------
    path : the file; equal arguments give equal bytes
    image : (h, w) or (h, w, c), c 1 (gray), 2 (gray, alpha), 3 or 4, straight alpha, top row first; clipped to [0, 1],
        NaN becomes 0
    kind : "color" encodes linear values with the sRGB curve and tags the file sRGB; "data" stores them as they are,
        without any color tag. Alpha is never encoded.
    bits : per channel. Color in 8 bits is dithered by up to half a step, a fixed hash of position, channel and
        `dither_seed`, so that dark gradients do not band; values that 8 bits hold exactly, 0 and 1 among them, stay.

    Raises
    ------
    OutputError
        The file cannot be written.
    ValueError
        The array is not a picture of 1 to 4 channels.
    """
    array = _as_image(image)
    height, width, count = array.shape
    has_alpha = count in (2, 4)
    colors = count - has_alpha
    steps = 2**bits - 1
    codes = np.empty(array.shape, np.uint8 if bits == 8 else np.uint16)
    for top in range(0, height, 128):  # in bands, lest a large map be held in float64 several times over
        values = np.clip(array[top : top + 128], 0.0, 1.0).astype(np.float64)
        values[np.isnan(values)] = 0.0
        rounding = np.full(values.shape, 0.5)
        if kind == "color":
            values[..., :colors] = srgb_encode(values[..., :colors])
            if bits == 8:
                rounding[..., :colors] = _dither(top, values.shape[0], width, colors, dither_seed)
        codes[top : top + 128] = values * steps + rounding

    spec = oiio.ImageSpec(width, height, count, oiio.UINT8 if bits == 8 else oiio.UINT16)
    spec.channelnames = ("Y", "A")[:count] if count < 3 else ("R", "G", "B", "A")[:count]
    spec.alpha_channel = count - 1 if has_alpha else -1
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("oiio:ColorSpace", "srgb_rec709_scene" if kind == "color" else "data")
    spec.attribute("png:compressionLevel", 4)  # three times as fast as the default, files a twentieth larger
    _write("png", path, spec, codes)


def _as_image(array: ArrayLike) -> Image:
    """Return (h, w, c) float32, or ValueError where that is no picture of 1 to 4 channels."""
    image = np.asarray(array, dtype=np.float32)
    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.size == 0 or image.shape[2] > 4:
        raise ValueError(f"a picture has the shape (h, w) or (h, w, 1 to 4), not {image.shape}")
    return image


def _dither(top: int, height: int, width: int, channels: int, seed: int) -> NDArray[np.float64]:
    """Return uniform thresholds (height, width, channels) in (0, 1) for the rows from `top` on.

    There are 256 of them, none nearer to 0 or 1 than 1/512: float32 noise on a value that is an exact code cannot tip
    it into the next one.
    """

    def pcg(v: NDArray[np.uint32]) -> NDArray[np.uint32]:
        # PCG-RXS-M-XS 32; Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020.
        state = v * np.uint32(747796405) + np.uint32(2891336453)
        word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
        return (word >> np.uint32(22)) ^ word

    y, x, c = np.ogrid[top : top + height, :width, :channels]
    start = np.array([seed & 0xFFFFFFFF], np.uint32)
    hashed = pcg(x.astype(np.uint32) + pcg(y.astype(np.uint32) + pcg(c.astype(np.uint32) + pcg(start))))
    return ((hashed >> np.uint32(24)) + 0.5) / 256


def _write(kind: str, path: StrPath, spec: Any, pixels: NDArray[Any]) -> None:
    """Write one picture atomically, without anything in it that changes from run to run."""
    if kind == "openexr":  # which would otherwise note the present time
        spec.attribute("DateTime", _date())
    spec.attribute("Software", "skincli")
    with atomic(path) as temporary:
        out: Any = oiio.ImageOutput.create(kind)
        done = out.open(os.fspath(temporary), spec) and out.write_image(np.ascontiguousarray(pixels)) and out.close()
        if not done:
            trouble = _one_line(out.geterror())
            out.close()
            raise OSError(trouble.replace(os.fspath(temporary), os.fspath(path)))


def _date() -> str:
    """Return SOURCE_DATE_EPOCH (seconds; reproducible-builds.org) in EXR's notation, the year 1970 without it."""
    text = os.environ.get("SOURCE_DATE_EPOCH", "0")
    try:
        return datetime.fromtimestamp(int(text), UTC).strftime("%Y:%m:%d %H:%M:%S")
    except (ValueError, OverflowError, OSError) as error:
        raise InputError(f"SOURCE_DATE_EPOCH is '{text}'; it must be whole seconds since 1970; unset it") from error


# ------------------------------------------------------------------------------------------ resampling and previews


def reduce_to(image: ArrayLike, side: int) -> Image:
    """Shrink each axis of (h, w) or (h, w, c) that is longer than `side` to it; what fits stays as it is.

    Each pixel becomes the mean of the area it covers, fractions of pixels included, so that the mean of the picture
    stays. The axes are independent, for a texture is laid over a square whatever its proportions. Alpha is averaged
    by itself.
    """
    image = _as_image(image)
    for axis in (0, 1):
        if image.shape[axis] > side:
            image = np.swapaxes(_shrink(np.swapaxes(image, 0, axis), side), 0, axis)
    return np.ascontiguousarray(image)


def _shrink(rows: Image, count: int) -> Image:
    """Average (n, m, c) rows to (count, m, c), count < n."""
    length = len(rows)
    result = np.empty((count, *rows.shape[1:]), np.float32)
    for index in range(count):
        # In units of 1/count of a row, in which all borders are whole numbers.
        begin, end = index * length, (index + 1) * length
        first, last = begin // count, -(-end // count)
        borders = np.clip(np.arange(first, last + 1) * count, begin, end)
        result[index] = np.tensordot(np.diff(borders) / length, rows[first:last], 1)
    return result


def resize(image: ArrayLike, width: int, height: int) -> Image:
    """Resample (h, w) or (h, w, c) to (height, width, c) for previews.

    The filter has no negative lobes, so that highlights get no dark rings.
    """
    source = oiio.ImageBuf(np.ascontiguousarray(_as_image(image)))
    region = oiio.ROI(0, width, 0, height, 0, 1, 0, source.nchannels)
    result = oiio.ImageBufAlgo.resize(source, filtername="blackman-harris", roi=region)
    if result.has_error:
        raise ValueError(f"cannot resize to {width} x {height}: {result.geterror()}")
    return np.asarray(result.get_pixels(oiio.FLOAT), dtype=np.float32)


def contact_sheet(
    panels: Sequence[tuple[str, ArrayLike]], columns: int, *, title: str | None = None, text_scale: int = 2
) -> Image:
    """Lay pictures out in rows, each with its label below it, on a dark neutral ground.

    Parameters
    ----------
    panels : (label, (h, w, 3) linear picture); a cell is as large as the largest of them, which are centered in it
    columns : panels a row
    title : a line above them, in letters of twice the size
    text_scale : pixels per dot of the 5 x 7 dot letters (ASCII). A label too long for its cell is cut.

    Returns
    -------
    Image
        (H, W, 3) linear Rec.709, for `write_png`.
    """
    # Both are codes that 8 bits hold exactly, so that no dither lies on them.
    ground, ink = (float(srgb_decode(code / 255)) for code in (29, 196))
    gap = 8
    images = [(label, _as_image(image)) for label, image in panels]
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    cell_h = max(image.shape[0] for _, image in images)
    cell_w = max(image.shape[1] for _, image in images)
    line = 7 * text_scale + gap
    head = 2 * 7 * text_scale + 2 * gap if title else 0
    sheet = np.full(
        (head + gap + rows * (cell_h + line + gap), gap + columns * (cell_w + gap), 3), ground, dtype=np.float32
    )

    def put(text: str, x: int, y: int, scale: int, room: int) -> None:
        dots = _letters(text[: max(room // (6 * scale), 0)]).repeat(scale, axis=0).repeat(scale, axis=1)
        sheet[y : y + dots.shape[0], x : x + dots.shape[1]][dots] = ink

    if title:
        put(title, gap, gap + gap // 2, 2 * text_scale, sheet.shape[1] - 2 * gap)
    for index, (label, image) in enumerate(images):
        row, column = divmod(index, columns)
        x, y = gap + column * (cell_w + gap), head + gap + row * (cell_h + line + gap)
        height, width, _ = image.shape
        left, top = x + (cell_w - width) // 2, y + (cell_h - height) // 2
        sheet[top : top + height, left : left + width] = image
        put(label, x, y + cell_h + gap // 2, text_scale, cell_w)
    return sheet


# ASCII from "!" to "~", drawn for this program: seven rows of five dots a letter, a row as one digit in base 32. Kept
# here, they need no font file on the machine.
_GLYPHS = """
    4444004 AAA0000 AAVAVAA 4FKE5U4 OP248J3 CIK8LID C480000 2488842 8422248 04LEL40 044V440 0000C48 000V000 00000CC
    01248G0 EHJLPHE 4C4444E EH1248V V2421HE 26AIV22 VGU11HE 68GUHHE V124888 EHHEHHE EHHF12C 0CC0CC0 0CC0C48 248G842
    00V0V00 8421248 EH12404 EH1DLLE EHHVHHH UHHUHHU EHGGGHE SIHHHIS VGGUGGV VGGUGGG EHGNHHF HHHVHHH E44444E 72222IC
    HIKOKIH GGGGGGV HRLLHHH HHPLJHH EHHHHHE UHHUGGG EHHHLID UHHUKIH FGGE11U V444444 HHHHHHE HHHHHA4 HHHLLLA HHA4AHH
    HHHA444 V1248GV E88888E 0G84210 E22222E 4AH0000 000000V 8420000 00E1FHF GGMPHHU 00EGGHE 11DJHHF 00EHVGE 698S888
    0FHHF1E GGMPHHH 40C444E 20622IC GGIKOKI C44444E 00QLLHH 00MPHHH 00EHHHE 00UHUGG 00DJF11 00MPGGG 00EGE1U 88S8896
    00HHHJD 00HHHA4 00HHLLA 00HA4AH 00HHF1E 00V248V 2448442 4444444 8442448 008L200
""".split()  # noqa: SIM905


def _letters(text: str) -> NDArray[np.bool_]:
    """Return the dots of a line of text, (7, 6 x letters), True where ink is; a box for a letter that is not ASCII."""
    dots = np.zeros((7, 6 * len(text)), bool)
    for index, letter in enumerate(text):
        if letter == " ":
            continue
        glyph = _GLYPHS[ord(letter) - ord("!")] if "!" <= letter <= "~" else "VHHHHHV"
        for row, digit in enumerate(glyph):
            dots[row, 6 * index : 6 * index + 5] = [int(digit, 32) >> shift & 1 for shift in (4, 3, 2, 1, 0)]
    return dots
