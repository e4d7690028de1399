"""What the bench found, as a JSON document and as text."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skincli import images
from skincli.bench.stages import DEPTH_RMS, DEPTH_SHARE, FULL_TOLERANCE, StageError
from skincli.errors import OutputError
from skincli.render import report_document

Rows = Sequence[Mapping[str, Any]]


def document(
    stages: Sequence[StageError] = (), frames: Mapping[str, Any] | None = None, nodes: Rows = (), paper: Rows = ()
) -> dict[str, Any]:
    """Return the JSON document; what was not measured is empty."""
    machine = report_document([])
    return {
        "device": {**machine["device"], "cores": os.cpu_count()},
        "versions": machine["versions"],
        "stages": [error.entry() for error in stages],
        "nodes": list(nodes),
        "frames": dict(frames or {}),
        "paper": list(paper),
    }


def write(folder: Path, found: Mapping[str, Any]) -> None:
    """Write bench.json and bench.txt into a folder, which is made where it is missing.

    Raises
    ------
    OutputError : a file cannot be written
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise OutputError(f"-o {folder}: {problem.strerror}; name a folder that can be made or written") from None
    images.write_text(folder / "bench.json", as_json(found))
    images.write_text(folder / "bench.txt", as_text(found) + "\n")


def as_json(found: Mapping[str, Any]) -> str:
    """Return the document as JSON text."""
    return json.dumps(found, indent=1) + "\n"


def as_text(found: Mapping[str, Any]) -> str:
    """Return the document as tables for a terminal."""
    device = found["device"]
    where = f"device: {device['renderer']}, {device['version']}; {device['cores']} processor cores"
    parts = [where + ("; software OpenGL" if device["software"] else "")]
    if found["stages"]:
        parts.append(_stages(found["stages"]))
    if found["frames"]:
        parts += [_frames(found["frames"]), _nodes(found["nodes"])]
    if found["paper"]:
        parts.append(_paper(found["paper"]))
    return "\n\n".join(parts)


def _stages(stages: Rows) -> str:
    rows = [("stage", "node", "shading", "maximum", "rms", "differ", "allowed", "")]
    for stage in stages:
        rows.append(
            (
                stage["stage"],
                stage["node"],
                stage["shading"],
                f"{stage['maximum']:.1e}",
                f"{stage['rms']:.1e}",
                f"{stage['share']:.3%}",
                f"{stage['bound']:.1e}" + (" *" if stage["compares_depth"] else "  "),
                "ok" if stage["passed"] else "FAILS",
            )
        )
    title = (
        "Error against the float64 twin on the same stored inputs; * where depths are compared, this is allowed\n"
        f"but for {DEPTH_SHARE:.1%} of the pixels, and {DEPTH_RMS / FULL_TOLERANCE:g} times this as RMS"
    )
    return f"{title}\n{table(rows, text=3)}"


def _frames(frames: Mapping[str, Any]) -> str:
    rows = [
        ("frames", "ms", "quartiles", "count", "to paper"),
        ("cold, first of the process", f"{frames['cold_ms']:.0f}", "", "1", ""),
        ("warm, the camera moves", *_spread(frames["warm"]), f"{frames['warm_to_paper']:.2f}"),
        ("--no-skip", *_spread(frames["all"]), f"{frames['all_to_paper']:.2f}"),
        ("--no-skip, shading: paper", *_spread(frames["paper"]), "1.00"),
    ]
    return f"Frames of a {frames['scene']}\n{table(rows, text=1)}"


def _spread(times: Mapping[str, Any]) -> tuple[str, str, str]:
    return f"{times['median']:.1f}", f"{times['low']:.1f} to {times['high']:.1f}", f"{times['count']}"


def _nodes(nodes: Rows) -> str:
    rows = [("node", "cold ms", "warm ms", "no-skip ms", "paper ms", "Mtexel", "ms/Mtexel", "least MB", "GB/s")]
    for node in nodes:
        every = max(node["all"]["median"], 1e-6)
        rows.append(
            (
                node["name"],
                "" if node["cold_ms"] is None else f"{node['cold_ms']:.1f}",
                _range(node["warm"]),
                _range(node["all"]),
                _range(node["paper"]),
                f"{node['megatexels']:.2f}",
                f"{every / node['megatexels']:.0f}",
                f"{node['least_bytes'] / 1e6:.1f}",
                f"{node['least_bytes'] / 1e6 / every:.2f}",
            )
        )
    title = (
        "Nodes: median (lower to upper quartile); empty: did not run\n"
        "Rates are those of --no-skip; least MB: every input read once, every target written once"
    )
    return f"{title}\n{table(rows, text=1)}"


def _range(times: Mapping[str, Any] | None) -> str:
    return "" if times is None else f"{times['median']:.1f} ({times['low']:.1f} to {times['high']:.1f})"


def _paper(paper: Rows) -> str:
    rows = [
        (
            "triangles",
            "picture",
            "paper fps",
            "full fps",
            "full ms",
            "nodes",
            "to paper",
            "camera fps",
            "camera ms",
            "nodes",
        )
    ]
    for row in paper:
        rows.append(
            (
                f"{row['triangles']}",
                f"{row['size'][0]} x {row['size'][1]}",
                f"{row['paper_fps']}",
                f"{row['full_fps']:.2f}",
                _range(row["full"]),
                f"{len(row['full_nodes'])}",
                f"{row['full_to_paper']:.3f}",
                f"{row['camera_fps']:.2f}",
                _range(row["camera"]),
                f"{len(row['camera_nodes'])}",
            )
        )
    count = paper[0]["full"]["count"]
    title = (
        "Table 1 of the seed paper (GeForce GTX 560) beside this device, shading: paper, atlas 2500, all effects\n"
        f"full: every pass of the paper in every frame; camera: only the camera moves, the rest is remembered; "
        f"{count} frames each"
    )
    return f"{title}\n{table(rows, text=0)}"


def table(rows: Sequence[Sequence[str]], text: int) -> str:
    """Return rows as aligned columns, the first `text` of them to the left, the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column < text else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
