"""From a scene to files: pictures, data layers and the report of what was done for them."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import skincli
from skincli import images
from skincli.errors import UsageError
from skincli.gpu.context import device_info
from skincli.gpu.counters import COUNTERS
from skincli.graph.frame_graph import NodeReport
from skincli.pipeline import OUTPUTS, Pipeline

SUFFIXES = (".exr", ".png")

#: share of a PNG's codes that depth takes; the rest parts the farthest point from the background
DEPTH_SHARE = 0.9

#: packages whose version can change a picture
PACKAGES = ("moderngl", "numpy", "OpenImageIO", "trimesh", "xatlas")


@dataclass(frozen=True)
class Target:
    """Where a frame goes.

    Parameters
    ----------
    path : file named by the user; its suffix chooses the format
    """

    path: Path

    def __post_init__(self) -> None:
        if self.path.suffix.lower() not in SUFFIXES:
            raise UsageError(
                f"-o {self.path}: a picture file ends in {' or '.join(SUFFIXES)}; "
                f"write for example {self.path.stem or 'head'}.png"
            )

    def files(self, outputs: Sequence[str]) -> dict[Path, list[str]]:
        """Return which outputs go into which file."""
        stem = self.path.with_suffix("")
        found: dict[Path, list[str]] = {}
        for name in outputs:
            if self.path.suffix.lower() == ".png":
                file = self.path if name == "beauty" else stem.with_name(f"{stem.name}.{name}.png")
            elif OUTPUTS[name].room == "atlas":
                file = stem.with_name(f"{stem.name}.atlas.exr")
            else:
                file = self.path
            found.setdefault(file, []).append(name)
        return found

    def require_writable(self, outputs: Sequence[str]) -> None:
        """Raise an OutputError, before anything is computed, where one of the files cannot be written."""
        for file in self.files(outputs):
            images.require_writable(file)


def render_frame(
    pipeline: Pipeline, target: Target, outputs: Sequence[str], timing: bool = False, check: bool = False
) -> dict[str, Any]:
    """Render one frame and write its files.

    Parameters
    ----------
    pipeline, target, outputs : what is rendered, whereto, and which of OUTPUTS
    timing : measure every node
    check : write nothing where a node left a NaN or Inf, see FrameGraph.run

    Returns
    -------
    the frame's entry of the report; `ms` is the wall time until the pixels are on the host, without writing files

    Raises
    ------
    OutputError : a file cannot be written
    """
    png = target.path.suffix.lower() == ".png"
    display = png and "beauty" in outputs
    wanted = [name for name in outputs if not (png and name == "beauty")]
    waits = timing and device_info()["software"]
    before = COUNTERS.snapshot()
    start = time.perf_counter()
    arrays = pipeline.run(wanted, display=display, timing=timing and not waits, check=check)
    ms = (time.perf_counter() - start) * 1000
    counted = COUNTERS.since(before)
    reports = pipeline.reports
    if waits:
        # To time a node on software GL is to wait for it, so that is done in a second run, apart from the frame's time.
        pipeline.graph.store.clear()
        pipeline.run(wanted, display=display, timing=True)
        measured = {report.name: report.ms for report in pipeline.reports}
        reports = [replace(report, ms=measured[report.name]) for report in reports]
    start_of_writing = time.perf_counter()
    for file, names in target.files(outputs).items():
        if png:
            _write_png(file, names[0], arrays)
        else:
            _write_exr(file, names, arrays)
    return {
        "output": str(target.path),
        "ms": round(ms, 3),
        "write_ms": round((time.perf_counter() - start_of_writing) * 1000, 3),
        "counters": counted,
        "png_ranges_mm": png_ranges_mm(arrays) if png else {},
        "nodes": [node_entry(report) for report in reports],
    }


def _write_exr(file: Path, names: Sequence[str], arrays: Mapping[str, NDArray[np.float32]]) -> None:
    # The pipeline's beauty is premultiplied; the image room takes straight alpha and multiplies by it itself.
    layers = {name: images.straight(arrays[name]) if name == "beauty" else arrays[name] for name in names}
    images.write_exr(file, layers, half={name: OUTPUTS[name].color for name in names})


def _write_png(file: Path, name: str, arrays: Mapping[str, NDArray[np.float32]]) -> None:
    if name == "beauty":
        images.write_png(file, arrays["display"])
    elif OUTPUTS[name].color:
        images.write_png(file, arrays[name])
    else:
        images.write_png(file, data_to_unit(name, arrays[name]), kind="data", bits=16)


def png_ranges_mm(arrays: Mapping[str, NDArray[np.float32]]) -> dict[str, list[list[float]]]:
    """Return, for each output whose PNG spans its own range, the lowest and highest value per channel."""
    spans = {name: data_range(name, array) for name, array in arrays.items()}
    return {name: [end.tolist() for end in span] for name, span in spans.items() if span is not None}


def data_range(name: str, array: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
    """Return the range that a PNG of depth or positions spans, mm per channel; None for data of a fixed range."""
    if name not in ("depth", "atlas_position"):
        return None
    pixels = array.reshape(-1, array.shape[2])
    seen = pixels[pixels[:, 0] > 0] if name == "depth" and (pixels > 0).any() else pixels
    return seen.min(axis=0), seen.max(axis=0)


def data_to_unit(name: str, array: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return data as a PNG can hold it, in [0, 1].

    Normals become 0.5 + 0.5 n. Positions span `data_range`; so does depth, near white, far dark, the background black.
    The rest is clipped.
    """
    if name.endswith("normal"):
        return 0.5 + 0.5 * array
    if name == "uv":
        # Two channels would be read as gray and alpha.
        return np.concatenate([array, np.zeros_like(array[..., :1])], axis=-1)
    span = data_range(name, array)
    if span is None:
        return array
    unit = (array - span[0]) / np.maximum(span[1] - span[0], 1e-6)
    return np.where(array > 0, 1 - DEPTH_SHARE * unit, 0) if name == "depth" else unit


def node_entry(report: NodeReport) -> dict[str, Any]:
    """Return a node's entry of the report."""
    return {
        "name": report.name,
        "state": report.state,
        "reason": report.reason,
        "ms": None if report.ms is None else round(report.ms, 3),
        "key": report.key,
        "size": list(report.size),
        "bytes": report.bytes,
    }


def report_document(frames: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the report of a run: device, versions, memory, frames."""
    return {
        "device": device_info(),
        "versions": {"skincli": skincli.__version__, **{name: version(name) for name in PACKAGES}},
        "peak_bytes": COUNTERS.peak_bytes,
        "frames": list(frames),
    }


def write_report(path: Path, frames: Sequence[Mapping[str, Any]]) -> None:
    """Write the report as JSON, whole or not at all."""
    images.write_text(path, json.dumps(report_document(frames), indent=1) + "\n")


def explain(frame: Mapping[str, Any]) -> str:
    """Return a frame's entry of the report as a table of what became of each node."""
    rows = [("node", "state", "ms", "size", "key", "why")]
    for node in frame["nodes"]:
        ms = "" if node["ms"] is None else f"{node['ms']:.1f}"
        size = "{}x{}".format(*node["size"]) if any(node["size"]) else ""
        rows.append((node["name"], node["state"], ms, size, node["key"][:8], node["reason"]))
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    return "\n".join(
        "  ".join([*(cell.ljust(width) for cell, width in zip(row[:5], widths, strict=True)), row[5]]).rstrip()
        for row in rows
    )
