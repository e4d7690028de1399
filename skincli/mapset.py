"""Maps as files: which there are, how each is named and encoded, and how a folder of them is recognized.

One formula reads every file of a map: value = low + (high - low) * stored, with the range (low, high) of its manifest
entry and `stored` from 0 to 1 in integers, or the number itself in an EXR file; albedo is decoded from sRGB first
where the file holds integers.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import OpenImageIO as oiio  # noqa: N813
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

import skincli
from skincli import files, images
from skincli.errors import Fault, InputError, LimitError, UsageError, did_you_mean

_log = logging.getLogger("skincli")

Format = Literal["png", "exr"]
Depth = Literal["8", "16", "half", "float"]
Naming = Literal["skincli", "ambientcg"]
Convention = Literal["opengl", "directx"]
Role = Literal["color", "grey", "data", "normal_gl", "normal_dx"]

#: the depths of each format, coarse to fine
DEPTHS: Mapping[Format, tuple[Depth, ...]] = {"png": ("8", "16"), "exr": ("half", "float")}
NAMINGS: tuple[Naming, ...] = get_args(Naming)
MANIFEST = "manifest.json"
_MANIFEST_BYTES = 2**20


# ------------------------------------------------------------------------------------------------------------ kinds


@dataclass(frozen=True)
class MapKind:
    """One map.

    Parameters
    ----------
    name : what a person asks for, and the file's name in our own scheme
    doc : what it holds
    channels : 1 or 3
    ambientcg : the end of the file's name in ambientCG's scheme; `normal` adds GL or DX
    role : how an image layer reads it; of a normal map the OpenGL one
    into : the channel of a skin that an image layer writes with it; None where it is not written as it is
    unit : of the values; "" is none
    scale : which values are stored. unit: 0 to 1; direction: -1 to 1; signed: both sides of 0, symmetric, so that 0 is
        mid-level exactly; positive: from 0 up. The last two are measured, and told by the manifest
    exr_scaled : an EXR file holds 0 to 1 as a PNG file does, in place of the values themselves
    depths : in which it may be written
    synonyms : further words for it, when asking for maps and in files' names
    words : further ends of files' names elsewhere, in small letters and without separators
    assumed : the range taken where none is known
    """

    name: str
    doc: str
    channels: Literal[1, 3]
    ambientcg: str
    role: Role = "grey"
    into: str | None = None
    unit: str = ""
    scale: Literal["unit", "direction", "signed", "positive"] = "unit"
    exr_scaled: bool = False
    depths: tuple[Depth, ...] = get_args(Depth)
    synonyms: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    assumed: tuple[float, float] = (0.0, 1.0)


# 8 bits make steps of a relief, and so do halves, whose steps near 0.5 are those of 11 bits.
_RELIEF: tuple[Depth, ...] = ("16", "float")

MAPS: Mapping[str, MapKind] = {
    kind.name: kind
    for kind in (
        MapKind(
            "albedo",
            "color under white light, linear Rec.709, sRGB-encoded in PNG",
            3,
            "Color",
            role="color",
            into="albedo",
            words=("colour", "col", "basecolor", "basecolour", "diffuse", "diff"),
        ),
        MapKind(
            "height",
            "height over the surface; EXR holds mm, PNG is scaled as bump is",
            1,
            "Height",
            unit="mm",
            scale="signed",
            depths=_RELIEF,
            assumed=(-0.5, 0.5),
        ),
        MapKind(
            "bump",
            "height as grey; 0.5 is the undisplaced surface, the manifest has the range in mm",
            1,
            "Displacement",
            unit="mm",
            scale="signed",
            exr_scaled=True,
            depths=_RELIEF,
            words=("disp",),
            assumed=(-0.5, 0.5),
        ),
        MapKind(
            "normal",
            "tangent-space normals, y up (OpenGL) or down (DirectX)",
            3,
            "Normal",
            role="normal_gl",
            scale="direction",
            exr_scaled=True,
            assumed=(-1.0, 1.0),
        ),
        MapKind(
            "reflection",
            "share of the environment that is mirrored, the seed paper's reflection map",
            1,
            "Reflection",
            into="reflectance",
            synonyms=("reflectance",),
        ),
        MapKind("roughness", "roughness of the surface", 1, "Roughness", into="roughness", words=("rough",)),
        MapKind(
            "specular", "factor of the highlights", 1, "Specular", into="specular", words=("specularlevel", "spec")
        ),
        MapKind(
            "scattering_radius",
            "how far red, green and blue light gets in the skin",
            3,
            "ScatteringRadius",
            role="data",
            into="scattering_radius",
            unit="mm",
            scale="positive",
            depths=("16", "half", "float"),
            synonyms=("radius",),
            words=("scatteringradius", "scattering", "sss", "subsurface"),
        ),
        MapKind(
            "cavity",
            "openness of the small relief, 1 is open",
            1,
            "AmbientOcclusion",
            words=("ao", "occlusion"),
        ),
    )
}
"""Every map, by name."""


def parse_maps(text: str) -> tuple[str, ...]:
    """Return the names of the maps that a list such as "albedo, reflectance" asks for, in the order of `MAPS`.

    Raises
    ------
    UsageError : a word that is no map, or none at all
    """
    names = {word: kind.name for kind in MAPS.values() for word in (kind.name, *kind.synonyms)}
    asked = [word.strip().lower() for word in text.split(",") if word.strip()]
    choices = f"there are: {', '.join(MAPS)}"
    if not asked:
        raise UsageError(f"'{text}' names no map; {choices}; write them as in albedo,bump")
    if unknown := [word for word in asked if word not in names]:
        raise UsageError([Fault(f"'{word}' is no map{did_you_mean(word, list(names))}; {choices}") for word in unknown])
    wanted = {names[word] for word in asked}
    return tuple(name for name in MAPS if name in wanted)


# ---------------------------------------------------------------------------------------------------------- writing


@dataclass(frozen=True)
class Encoding:
    """How the numbers of a map are stored."""

    format: Format = "png"
    depth: Depth = "16"

    @classmethod
    def of(cls, format: Format | None = None, depth: Depth | None = None) -> Encoding:
        """Return what a person asks for by a format, a depth or both; PNG of 16 bits, or EXR of halves, by default.

        Raises
        ------
        UsageError : the format has no such depth
        """
        if format is None:
            format = "exr" if depth in DEPTHS["exr"] else "png"
        if depth is None:
            depth = "16" if format == "png" else "half"
        if depth not in DEPTHS[format]:
            other = next(name for name, depths in DEPTHS.items() if depth in depths)
            raise UsageError(
                f"{format} holds no maps of depth {depth}; it may be {' or '.join(DEPTHS[format])}; "
                f"choose one of these, or the format {other}"
            )
        return cls(format, depth)

    def fit(self, kind: MapKind) -> Encoding:
        """Return this encoding, or the next finer one of its format where this one is too coarse for the map."""
        finer = DEPTHS[self.format][DEPTHS[self.format].index(self.depth) :]
        return Encoding(self.format, next(depth for depth in finer if depth in kind.depths))


def file_name(
    name: str, encoding: Encoding, naming: Naming = "skincli", skin: str = "skin", convention: Convention = "opengl"
) -> str:
    """Return the file's name of a map: `albedo.png`, or `human_Color.png` in ambientCG's scheme.

    Parameters
    ----------
    name : key of `MAPS`
    encoding, convention : as for `write_map`
    naming : the scheme; either is recognized by `find_maps`
    skin : the skin's name, which ambientCG's scheme puts first
    """
    kind = MAPS[name]
    if naming == "ambientcg":
        handedness = {"opengl": "GL", "directx": "DX"}[convention] if kind.scale == "direction" else ""
        return f"{skin}_{kind.ambientcg}{handedness}.{encoding.format}"
    return f"{name}{'_dx' if kind.scale == 'direction' and convention == 'directx' else ''}.{encoding.format}"


_Finite = Annotated[float, Field(allow_inf_nan=False)]


class Entry(BaseModel):
    """What a manifest says of one map's file."""

    model_config = ConfigDict(frozen=True)

    file: str = Field(description="relative to the manifest")
    type: str = Field(default="", description="uint8, uint16, half or float")
    bits: int | None = Field(default=None, description="per channel")
    color_space: str = Field(default="", description="of the stored numbers: sRGB, linear Rec.709 or data")
    encodes: str | None = Field(default=None, description="what an encoded color space stands for")
    unit: str | None = Field(default=None, description="of the values")
    range: tuple[_Finite, _Finite] = Field(description="the values that stored 0 and 1 mean")
    mid_level: _Finite | None = Field(default=None, description="the stored number of the undisplaced surface")
    convention: Convention | None = Field(default=None, description="where y of a normal map points")
    pixels: str = Field(default="", description="BLAKE2b-128 of the values, float32, top row first")
    bytes: str = Field(default="", description="BLAKE2b-128 of the file")


class Manifest(BaseModel):
    """What `manifest.json` says; it is written last, so that where it stands all maps are whole."""

    model_config = ConfigDict(frozen=True)

    manifest: Literal[1] = Field(default=1, description="version of the format")
    skin: str = Field(default="", description="the skin's name")
    about: str = ""
    size: int | None = Field(default=None, description="texels a side")
    extent_mm: _Finite | None = Field(default=None, description="side of the flat square; none where they fit a mesh")
    tileable: bool = Field(default=False, description="whether opposite edges meet")
    seed: int | None = None
    versions: dict[str, str] = Field(default={}, description="of the programs that had a part in it")
    maps: dict[str, Entry] = Field(description="by name of the map")
    optics: dict[str, Any] | None = Field(default=None, description="as in a skin file")
    surface: dict[str, Any] | None = Field(default=None, description="as in a skin file")


def write_map(path: Path, name: str, array: ArrayLike, encoding: Encoding, convention: Convention = "opengl") -> Entry:
    """Write one map, with right color metadata; equal arguments give equal bytes.

    Parameters
    ----------
    path : see `file_name`
    name : key of `MAPS`
    array : (h, w, channels), or (h, w) of one channel, top row first, in the units of the map: linear Rec.709, mm, 0 to
        1, unit vectors with y up whatever the convention. PNG clips what is 0 to 1 by definition.
    encoding : where it is too coarse for the map, the next finer one is used, with a warning
    convention : of a normal map

    Returns
    -------
    Entry
        for the manifest

    Raises
    ------
    OutputError : the file cannot be written
    ValueError : the array has another shape, or values that are not finite
    """
    kind = MAPS[name]
    values = np.ascontiguousarray(array, dtype=np.float32)
    values = values[..., None] if values.ndim == 2 else values
    if values.ndim != 3 or values.shape[2] != kind.channels or not np.isfinite(values).all():
        raise ValueError(f"{name} has the shape (h, w, {kind.channels}) and finite values, not {values.shape}")
    fit = encoding.fit(kind)
    if fit != encoding:
        _log.warning("%s: %s is too coarse for %s; it is written as %s", path, encoding.depth, name, fit.depth)
    low, high = _range(kind, values, fit.format)
    stored = values
    if kind.scale == "direction" and convention == "directx":
        stored = values * np.array([1, -1, 1], np.float32)
    if (low, high) != (0.0, 1.0):
        stored = (stored - np.float32(low)) / np.float32(high - low)
    color = kind.role == "color"
    if fit.format == "png":
        images.write_png(path, stored, kind="color" if color else "data", bits=8 if fit.depth == "8" else 16)
    else:
        # The unnamed layer: plain R, G, B or Y, which other programs read.
        space: images.ColorSpace = "lin_rec709_scene" if color else "data"
        images.write_exr(path, {"beauty": stored}, half=fit.depth == "half", color_space=space)
    return Entry(
        file=path.name,
        type={"8": "uint8", "16": "uint16"}.get(fit.depth, fit.depth),
        bits={"8": 8, "16": 16, "half": 16, "float": 32}[fit.depth],
        color_space=("sRGB" if fit.format == "png" else "linear Rec.709") if color else "data",
        encodes="linear Rec.709" if color and fit.format == "png" else None,
        unit=kind.unit or None,
        range=(low, high),
        mid_level=0.5 if kind.scale == "signed" and low < 0 else None,
        convention=convention if kind.scale == "direction" else None,
        pixels=hashlib.blake2b(values.data, digest_size=16).hexdigest(),
        bytes=files.file_digest(path),
    )


def _range(kind: MapKind, values: images.Image, format: Format) -> tuple[float, float]:
    """Return the values that stored 0 and 1 shall mean."""
    if kind.scale == "direction":
        return -1.0, 1.0
    if kind.scale == "unit" or (format == "exr" and not kind.exr_scaled):
        return 0.0, 1.0
    highest = float(np.abs(values).max()) or 1.0
    return (-highest if kind.scale == "signed" else 0.0), highest


def write_manifest(folder: Path, manifest: Manifest) -> Path:
    """Write `manifest.json`, with our version and OpenImageIO's added to those it has, and return its path.

    Raises
    ------
    OutputError : the file cannot be written
    """
    versions = {"skincli": skincli.__version__, "OpenImageIO": oiio.VERSION_STRING}
    content = manifest.model_copy(update={"versions": versions | manifest.versions}).model_dump(
        mode="json", exclude_none=True
    )
    path = folder / MANIFEST
    images.write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return path


# ------------------------------------------------------------------------------------------------------ recognition


@dataclass(frozen=True)
class FoundMap:
    """One map in a folder.

    Parameters
    ----------
    kind : what it is
    file : relative to the folder
    role : how an image layer reads it
    range : the values that stored 0 and 1 mean, in the kind's unit
    """

    kind: MapKind
    file: str
    role: Role
    range: tuple[float, float]


@dataclass(frozen=True)
class MapFolder:
    """A folder of maps that can be worn as a skin.

    Parameters
    ----------
    folder : symbolic links resolved
    maps : by name, in the order of `MAPS`
    repeat : whether the maps go on beyond their edges
    extent : mm a side, where the manifest says so
    about, optics, surface : as in a skin file, where the manifest has them
    """

    folder: Path
    maps: Mapping[str, FoundMap]
    repeat: bool = True
    extent: float | None = None
    about: str = ""
    optics: Mapping[str, Any] | None = None
    surface: Mapping[str, Any] | None = None

    def layers(self) -> list[dict[str, Any]]:
        """Return the `layers` of the skin: one image layer per map, laid by uv and named after the map.

        Of height, bump and normal only the first that is there takes part, for they tell the same relief. Cavity takes
        none: the renderer computes occlusion itself.
        """
        relief = next((name for name in ("height", "bump", "normal") if name in self.maps), None)
        used = [found for name, found in self.maps.items() if name == relief or found.kind.into is not None]
        return [{"image": self._image(found)} for found in used]

    def _image(self, found: FoundMap) -> dict[str, Any]:
        layer: dict[str, Any] = {"name": found.kind.name, "file": found.file, "role": found.role}
        if found.kind.into is not None:
            layer["into"] = [found.kind.into]
            if found.range != (0.0, 1.0):
                layer["range"] = list(found.range)
        elif found.kind.scale == "signed":
            layer["height"] = list(found.range)
        return layer | {"tile": "repeat" if self.repeat else "clamp"}


def find_maps(folder: Path, roots: Sequence[Path] = (), label: str | None = None) -> MapFolder:
    """Find out which maps a folder holds: by our manifest, else by names in the style of ambientCG, Substance, Poly
    Haven or our own, in large or small letters, each as any picture that can be read.

    Without a manifest the range of a relief is not known: black to white is taken as 1 mm, with a warning. Normal maps
    are OpenGL unless their name says DX; where both are there, GL is taken.

    Parameters
    ----------
    folder : the maps lie in it, not below it; a manifest may name files below it
    roots : further folders into which symbolic links may lead, see `skincli.files.asset_roots`
    label : the folder as the person wrote it, for messages; `folder` by default

    Raises
    ------
    InputError
        No such folder; no map in it; several files for one map; a file that lies outside; a manifest that is broken, of
        another version, or names what is missing.
    LimitError
        The manifest has more than 1 MB.
    """
    label = str(folder if label is None else Path(label))
    try:
        if not folder.is_dir():
            raise InputError(Fault(f"is no folder of maps{files.nearest(folder)}", label))
        folder = folder.resolve()
        manifest = _read_manifest(folder, roots, label)
        return _by_names(folder, roots, label) if manifest is None else _by_manifest(folder, manifest, roots, label)
    except OSError as error:
        raise InputError(Fault(f"cannot be read: {error.strerror}; check its permissions", label)) from error


def _read_manifest(folder: Path, roots: Sequence[Path], label: str) -> Manifest | None:
    """Return our manifest; None where there is none, or another program's."""
    if not os.path.lexists(folder / MANIFEST):
        return None
    path, label = files.resolve(MANIFEST, folder, roots, f"the manifest of '{label}'"), f"{label}/{MANIFEST}"
    size = path.stat().st_size
    if size > _MANIFEST_BYTES:
        raise LimitError(Fault(f"has {size} bytes; a manifest has at most {_MANIFEST_BYTES}; remove it", label))
    try:
        content = from_json(path.read_bytes())
    except ValueError as error:
        raise InputError(Fault(f"is not JSON: {error}; generate the maps again, or remove it", label)) from None
    if not isinstance(content, dict) or "manifest" not in content:
        return None
    try:
        return Manifest.model_validate(content)
    except ValidationError as error:
        places = ((".".join(map(str, fault["loc"])), fault["msg"]) for fault in error.errors())
        advice = "generate the maps again, or remove it"
        raise InputError([Fault(f"{place}: {message}; {advice}", label) for place, message in places]) from None


def _by_manifest(folder: Path, manifest: Manifest, roots: Sequence[Path], label: str) -> MapFolder:
    found: dict[str, FoundMap] = {}
    faults: list[Fault] = []
    label = f"{label}/{MANIFEST}"
    for name, entry in manifest.maps.items():
        if name not in MAPS:
            _log.warning("%s: '%s' is no map that is known; it is left out", label, name)
            continue
        try:
            files.resolve(entry.file, folder, roots, f"maps.{name}.file")
        except InputError as error:
            faults += [Fault(fault.message, label) for fault in error.faults]
        kind = MAPS[name]
        role: Role = "normal_dx" if kind.scale == "direction" and entry.convention == "directx" else kind.role
        found[name] = FoundMap(kind, entry.file, role, entry.range)
    if faults:
        raise InputError(faults)
    if not found:
        raise InputError(Fault(f"names no map; there are: {', '.join(MAPS)}; generate them again", label))
    return MapFolder(
        folder,
        _ordered(found),
        manifest.tileable,
        manifest.extent_mm,
        manifest.about,
        manifest.optics,
        manifest.surface,
    )


def _words() -> dict[str, tuple[MapKind, Role]]:
    """Return what the end of a file's name means, in small letters and without separators."""
    words = {
        word.lower().replace("_", ""): (kind, kind.role)
        for kind in MAPS.values()
        for word in (kind.name, kind.ambientcg, *kind.synonyms, *kind.words)
    }
    for word in ("normal", "normalmap", "nor", "nrm"):
        words |= {word + end: (MAPS["normal"], "normal_gl") for end in ("", "gl", "ogl", "opengl")}
        words |= {word + end: (MAPS["normal"], "normal_dx") for end in ("dx", "directx")}
    return words


_WORDS = _words()
# What says how, not what: 4k, 2048x2048, 16bit, and the format.
_NOISE = re.compile(r"\d+k|\d+x\d+|\d+bit|png|jpg|exr|tif")
# Of several files for one map, the one to take.
_BETTER: Mapping[str, str] = {"normal": "normal_gl", "cavity": "cavity"}
# Ends of names of files that hold roughness in another form.
_NOT_ROUGHNESS = {
    **dict.fromkeys(("arm", "orm", "rma"), "it packs several maps into one file"),
    **dict.fromkeys(("gloss", "glossiness", "smoothness"), "it is the opposite of roughness"),
}


def _ending(stem: str, words: Mapping[str, Any]) -> str | None:
    """Return the word with which a file's name ends, the longest: `rock_nor_gl_4k` ends with norgl."""
    parts = re.split(r"[\s_.\-]+", stem.lower())
    while len(parts) > 1 and _NOISE.fullmatch(parts[-1]):
        parts.pop()
    ends = ("".join(parts[-count:]) for count in (3, 2, 1))
    return next((end for end in ends if end in words), None)


def _by_names(folder: Path, roots: Sequence[Path], label: str) -> MapFolder:
    suffixes = {suffix for found in images.formats().values() for suffix in found}
    # Hidden files are none: macOS lays a `._NAME.png`, which is no picture, beside a NAME.png.
    found_names = (path.name for path in folder.iterdir() if path.suffix.lower() in suffixes)
    names = sorted(name for name in found_names if not name.startswith("."))
    candidates: dict[str, dict[str, str]] = {}  # by name of the map: file -> word
    for name in names:
        word = _ending(Path(name).stem, _WORDS)
        if word is not None:
            candidates.setdefault(_WORDS[word][0].name, {})[name] = word
    if not candidates:
        examples = ", ".join(
            file_name(name, Encoding(), "ambientcg", "NAME") for name in ("albedo", "bump", "roughness")
        )
        raise InputError(
            Fault(
                f"holds no map; a file's name ends with what it is, as {examples} (ambientCG), NAME_BaseColor.png "
                f"(Substance), NAME_diff_4k.jpg (Poly Haven) or albedo.png; there may be: {', '.join(MAPS)}; rename "
                "the files",
                label,
            )
        )
    found: dict[str, FoundMap] = {}
    faults: list[Fault] = []
    for name, ends in candidates.items():
        preferred = [file for file, word in ends.items() if _BETTER.get(name) in (word, _WORDS[word][1])]
        chosen = preferred or list(ends)
        if len(chosen) > 1:
            both = " and ".join(f"'{file}'" for file in chosen)
            faults.append(Fault(f"holds more than one {name} map: {both}; leave one of them in the folder", label))
            continue
        try:
            files.resolve(chosen[0], folder, roots, f"the {name} map")
        except InputError as error:
            faults += [Fault(fault.message, label) for fault in error.faults]
        kind, role = _WORDS[ends[chosen[0]]]
        found[name] = FoundMap(kind, chosen[0], role, kind.assumed)
    if faults:
        raise InputError(faults)
    result = MapFolder(folder, _ordered(found))
    _tell_assumptions(result, names, label)
    return result


def _tell_assumptions(result: MapFolder, names: Sequence[str], label: str) -> None:
    """Warn of what names alone cannot tell."""
    for layer in result.layers():
        settings = layer["image"]
        kind = result.maps[settings["name"]].kind
        if kind.unit:
            key = "height" if "height" in settings else "range"
            _log.warning(
                "%s/%s: its range is not known; black to white is taken as %g to %g %s; change it with "
                "--set skin.layers.%s.%s=[LOW, HIGH]",
                *(label, settings["file"], *kind.assumed, kind.unit, kind.name, key),
            )
    if "roughness" not in result.maps:
        for name in names:
            if (word := _ending(Path(name).stem, _NOT_ROUGHNESS)) is not None:
                reason = _NOT_ROUGHNESS[word]
                _log.warning("%s/%s: is left out, for %s; export roughness by itself", label, name, reason)


def _ordered(found: Mapping[str, FoundMap]) -> dict[str, FoundMap]:
    return {name: found[name] for name in MAPS if name in found}
