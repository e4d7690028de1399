"""What the bench found, as a JSON document and as text."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skincli import images
from skincli.bench import html
from skincli.bench import surfaces as diffusion
from skincli.bench.fronts import STAGE_TITLES, Found, Shown
from skincli.bench.generator import AIM
from skincli.bench.stages import DEPTH_RMS, DEPTH_SHARE, FULL_TOLERANCE, StageError
from skincli.bench.stress import Outcome
from skincli.errors import OutputError
from skincli.render import report_document

Rows = Sequence[Mapping[str, Any]]

#: of bench.json: another one where a reader of the last would go wrong
FORMAT = 1


def document(
    stages: Sequence[StageError] = (),
    frames: Mapping[str, Any] | None = None,
    nodes: Rows = (),
    paper: Rows = (),
    layers: Rows = (),
    presets: Rows = (),
    stress: Sequence[Outcome] = (),
    sweep: Found | None = None,
    surfaces: diffusion.Found | None = None,
) -> dict[str, Any]:
    """Return the JSON document; what was not measured is empty."""
    machine = report_document([])
    return {
        "bench": FORMAT,
        "device": {**machine["device"], "cores": os.cpu_count()},
        "versions": machine["versions"],
        "stages": [error.entry() for error in stages],
        "nodes": list(nodes),
        "frames": dict(frames or {}),
        "paper": list(paper),
        "layers": list(layers),
        "presets": list(presets),
        "stress": [outcome.entry() for outcome in stress],
        "sweep": None if sweep is None else sweep.entry(),
        "surfaces": None if surfaces is None else surfaces.entry(),
    }


def write(folder: Path, found: Mapping[str, Any], shown: Mapping[str, Shown] | None = None) -> None:
    """Write bench.json, bench.txt and bench.html into a folder, which is made where it is missing.

    Parameters
    ----------
    found : the document
    shown : pictures of the sweep, for the page

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
    images.write_text(folder / "bench.html", html.page(found, shown or {}, as_text({**found, "sweep": None})))


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
    if found["presets"]:
        parts.append(_presets(found["presets"]))
    if found["layers"]:
        parts.append(_layers(found["layers"]))
    if found["paper"]:
        parts.append(_paper(found["paper"]))
    if found["stress"]:
        parts.append(_stress(found["stress"]))
    if found["surfaces"]:
        parts += _surfaces(found["surfaces"])
    if found["sweep"]:
        parts += _sweep(found["sweep"])
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
                f"{every / node['megatexels']:.0f}" if node["megatexels"] else "",  # tables of a few texels
                f"{node['least_bytes'] / 1e6:.1f}",
                f"{node['least_bytes'] / 1e6 / every:.2f}",
            )
        )
    title = (
        "Nodes: median (lower to upper quartile); empty: did not run\n"
        "Rates are those of --no-skip; least MB: every input read once, every target written once"
    )
    return f"{title}\n{table(rows, text=1)}"


def _presets(presets: Rows) -> str:
    rows = [("preset", "layers", "ms", "floor ms", "to floor", "ms/Mtexel")]
    for row in presets:
        times = (_range(row["ms"]), _range(row["floor"]), f"{row['to_floor']:.1f}", f"{row['ms_per_megatexel']:.0f}")
        rows.append((row["preset"], f"{row['layers']}", *times))
    side = presets[0]["side"]
    title = (
        f"Maps of the presets, {side} x {side} texels: albedo, height, reflectance\n"
        f"floor: the same targets written with a constant; aim: at most {AIM} times that"
    )
    return f"{title}\n{table(rows, text=1)}"


def _layers(layers: Rows) -> str:
    rows = [("layer", "as in", "ms/Mtexel", "twin, times slower")]
    for row in layers:
        rows.append((row["layer"], row["preset"], _range(row["ms_per_megatexel"]), f"{row['twin_ratio']:.0f}"))
    return f"Layers, each alone as it stands in the preset that shows it first\n{table(rows, text=2)}"


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


def _stress(stress: Rows) -> str:
    rows = [("varies", "to", "", "node", "not finite", "error", "unlike", "ms")]
    for case in stress:
        measured = f"{case['error']:.3f}" if case["node"] else ""
        unlike = "" if case["unlike"] is None else f"{case['unlike']:.3f}"
        start = (case["group"], case["case"], case["verdict"], case["node"])
        rows.append((*start, f"{case['nonfinite']}", measured, unlike, f"{case['ms']:.0f}"))
    count = Counter(case["verdict"] for case in stress)
    title = (
        "Numerical stability: " + ", ".join(f"{number} {verdict}" for verdict, number in count.items()) + "\n"
        "error: of the node farthest from its float64 twin; unlike: from the picture it has to repeat; 1 is allowed"
    )
    return f"{title}\n{table(rows, text=4)}"


def _sweep(sweep: Mapping[str, Any]) -> list[str]:
    parts = []
    for stage, title in STAGE_TITLES.items():
        points = [point for point in sweep["points"] if point["stage"] == stage]
        note = sweep["notes"].get(stage)
        if note is not None:
            parts.append(f"{title}: {note}" + (f"\n{_points(points)}" if points else ""))
    parts.append(_levels(sweep["levels"]))
    chosen = sweep["chosen"]
    if chosen is not None:
        sets = " ".join(f"--set '{setting}'" for setting in chosen["sets"])
        errors, ms = chosen["errors"], chosen["ms"]
        parts.append(
            f"--max-error {chosen['max_error']:g}: the cheapest point is {chosen['point']}; rendered anew its relative "
            f"RMSE is {errors['relative_rmse']:.4f}, at {ms['median']:.1f} ms a frame\nskincli render ... {sets}"
        )
    return parts


def _points(points: Rows) -> str:
    title = (
        "",
        "point",
        "ms",
        "to paper",
        "rel. RMSE",
        "p99",
        "maximum",
        "FLIP",
        "energy",
        "not finite",
        "filter",
        "atlas",
    )
    rows = [title]
    for point in points:
        errors = point["errors"]
        parted = ("" if point[which] is None else f"{point[which]:.4f}" for which in ("filter_error", "sampling_error"))
        rows.append(
            (
                "*" if point["front"] else "",
                point["name"],
                _range(point["ms"]) if point["ms"]["count"] > 1 else f"{point['ms']['median']:.1f}",
                f"{point['to_paper']:.3f}",
                f"{errors['relative_rmse']:.4f}",
                f"{errors['p99']:.4f}",
                f"{errors['maximum']:.3f}",
                "" if errors["flip"] is None else f"{errors['flip']:.4f}",
                f"{errors['energy_drift']:+.2%}",
                f"{errors['nonfinite']}",
                *parted,
            )
        )
    return "* on the Pareto front; filter, atlas: relative RMSE by the method and by its atlas alone\n" + table(rows, 2)


def _levels(levels: Rows) -> str:
    rows = [("quality", "atlas", "Gaussians", "ms", "rel. RMSE", "on the front", "faster and as near")]
    for level in levels:
        known = level["point"] is not None
        rows.append(
            (
                level["level"],
                f"{level['atlas']}",
                f"{level['terms']}",
                f"{level['ms']:.1f}" if known else "not swept",
                f"{level['relative_rmse']:.4f}" if known else "",
                ("yes" if level["front"] else "no") if known else "",
                level["better"] or "",
            )
        )
    return f"Quality levels, at one sample a pixel\n{table(rows, text=1)}"


def _surfaces(found: Mapping[str, Any]) -> list[str]:
    rows = [
        (
            "mesh",
            "atlas_uv",
            "light",
            "kernel",
            "filter",
            "p99",
            "maximum",
            "seam",
            "atlas",
            "half",
            "0.01 at",
            "misses",
        )
    ]
    for row in found["rows"]:
        rows.append(
            (
                *(row[name] for name in ("mesh", "layout", "light", "kernel")),
                *(f"{row[name]:.4f}" for name in ("filter", "p99")),
                f"{row['maximum']:.3f}",
                "" if row["seam"] is None else f"{row['seam']:.4f}",
                *(f"{row[name]:.4f}" for name in ("sampling", "halved")),
                "" if row["named"] is None else f"{row['named']}",
                ", ".join(row["misses"]),
            )
        )
    title = (
        f"The diffusion by itself, at {found['points']} points spread evenly over each mesh\n"
        "filter: relative RMSE of the passes against the exact sum over the same texels; p99, maximum: of that error,\n"
        "as shares of the signal's RMS; seam: RMS of its difference across seams; atlas, half: relative RMSE of the\n"
        "exact sum over the texels of this atlas, and of one of half the side, against that over the mesh itself;\n"
        "0.01 at: texels a side at which that is 0.01, by its power law\n"
        f"Aims: filter {diffusion.FILTER_AIM:g} (never above {diffusion.FILTER_LIMIT:g}), p99 {diffusion.P99_AIM:g}, "
        f"atlas {diffusion.SAMPLING_AIM:g}"
    )
    parts = [f"{title}\n{table(rows, text=4)}"]
    rows = [
        (
            "mesh",
            "atlas_uv",
            "triangles",
            "texels",
            "mm",
            "constant",
            "MB",
            "build s",
            "frame ms",
            "seam steps",
            "pixels",
            "misses",
        )
    ]
    for one in found["layouts"]:
        steps = [f"{name} {step:.2f}" for name, step in one["steps"].items() if step is not None]
        rows.append(
            (
                one["mesh"],
                one["layout"],
                f"{one['triangles']}",
                f"{one['atlas']}",
                f"{one['texel_mm']:.3f}",
                f"{one['constant']:.1e}",
                f"{one['table_mb']:.0f}",
                f"{one['build_s']:.1f}",
                _range(one["frame"]),
                ", ".join(steps),
                f"{one['seam_pixels']}",
                ", ".join(one["misses"]),
            )
        )
    title = (
        f"Its cost for {diffusion.SINGLE} Gaussians, and its laws\n"
        f"constant: greatest relative change of constant light, at most {diffusion.CONSTANT_LIMIT:g}; MB: tables, aim "
        f"{diffusion.TABLE_MB_AIM:g}; build: aim {diffusion.BUILD_S_AIM:g}; frame: its nodes, aim "
        f"{diffusion.FRAME_MS_AIM:g}; seam steps: between\npixels across a seam over those beside it, aim "
        f"{diffusion.STEP_AIM:g}"
    )
    parts.append(f"{title}\n{table(rows, text=2)}")
    changes = [("mesh", "changed", "FLIP", "")]
    for picture in found["pictures"]:
        holds = "ok" if picture["flip"] <= diffusion.FLIP_AIM else "misses"
        changes.append((picture["mesh"], picture["changed"], f"{picture['flip']:.4f}", holds))
    title = f"Pictures that ought to be alike: mean FLIP inside the silhouette, aim {diffusion.FLIP_AIM:g}"
    parts.append(f"{title}\n{table(changes, text=2)}")
    return parts


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
