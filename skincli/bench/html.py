"""What the bench found as one HTML page that needs nothing else: plots, pictures, error maps, tables."""

from __future__ import annotations

import base64
import math
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import images
from skincli.bench.fronts import STAGE_TITLES, Shown
from skincli.color import srgb_decode

Rows = Sequence[Mapping[str, Any]]

TEMPLATE = Path(__file__).with_name("page.html")

#: size of a plot and its margins: left, top, right, bottom
WIDTH, HEIGHT, MARGINS = 860, 440, (70, 24, 190, 52)

#: colors that people who see few colors tell apart [Okabe and Ito 2008], fit for light and dark ground
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c7a5b")

#: of error maps, from none to much: black, blue, violet, red, orange, yellow, white; equal steps in the logarithm
HEAT = np.array(
    [[0, 0, 4], [40, 11, 84], [101, 21, 110], [188, 55, 84], [237, 105, 37], [251, 180, 26], [252, 255, 164]]
)

#: ends of the error maps' scale, as a share of the reference's mean
LEAST_HEAT, MOST_HEAT = 1e-3, 1.0


def page(found: Mapping[str, Any], shown: Mapping[str, Shown], tables: str) -> str:
    """Return the page.

    Parameters
    ----------
    found : the JSON document, see skincli.bench.report
    shown : pictures of the sweep by the point's name
    tables : the other parts of the report as text
    """
    sweep = found["sweep"]
    device = found["device"]
    machine = {
        "device": device["renderer"],
        "driver": f"{device['version']}{', software OpenGL' if device['software'] else ''}",
        "processor cores": device["cores"],
        "versions": ", ".join(f"{name} {version}" for name, version in found["versions"].items()),
    }
    parts = []
    summary = "Time and error of each stage of the renderer."
    if sweep:
        scene = sweep["scene"]
        machine |= {"picture": f"{scene['size'][0]} x {scene['size'][1]}, {scene['triangles']} triangles"}
        machine |= {"reference": scene["reference"]}
        summary = (
            "Time against error, both logarithmic. The dashed line is the Pareto front: no other point is both faster "
            f"and nearer to the reference. Times are medians of {scene['rounds']} frames."
        )
        if sweep["chosen"]:
            parts.append(_chosen(sweep["chosen"]))
        limit = sweep["chosen"]["max_error"] if sweep["chosen"] else None
        for stage, title in STAGE_TITLES.items():
            points = [point for point in sweep["points"] if point["stage"] == stage]
            note = sweep["notes"].get(stage, "")
            if not points and not note:
                continue
            parts.append(f"<h2>{title}</h2>\n<p>{escape(note)}</p>")
            if points:
                parts.append(plot(points, limit if stage == "picture" else None))
                parts.append(_table(points))
            if stage == "picture":
                parts += [_levels(sweep["levels"]), _pictures(points, shown)]
    if tables:
        parts.append(f'<h2>All tables</h2>\n<div class="wide"><pre>{escape(tables)}</pre></div>')
    facts = "".join(f"<dt>{escape(str(name))}</dt><dd>{escape(str(value))}</dd>" for name, value in machine.items())
    template = Template(TEMPLATE.read_text("utf-8"))
    title = "skincli bench"
    return template.substitute(title=title, summary=escape(summary), machine=facts, body="\n".join(parts))


def _chosen(chosen: Mapping[str, Any]) -> str:
    sets = " ".join(f"--set '{setting}'" for setting in chosen["sets"])
    return (
        f"<h2>At most {chosen['max_error']:g}</h2>\n<p>The cheapest is <strong>{escape(chosen['point'])}</strong>; "
        f"rendered anew its relative RMSE is {chosen['errors']['relative_rmse']:.3g} and a frame takes "
        f"{chosen['ms']['median']:.0f} ms.</p>\n<pre>{escape(sets)}</pre>"
    )


def _levels(levels: Rows) -> str:
    rows = [("quality", "atlas", "Gaussians", "samples", "ms", "relative RMSE", "on the front", "faster and as near")]
    for level in levels:
        measured = level["point"] is not None
        rows.append(
            (
                level["level"], f"{level['atlas']}", f"{level['terms']}", f"{level['supersample']}",
                f"{level['ms']:.0f}" if measured else "not swept",
                f"{level['relative_rmse']:.3g}" if measured else "",
                ("yes" if level["front"] else "no") if measured else "",
                level["better"] or "",
            )
        )  # fmt: skip
    return "<h2>Quality levels</h2>\n<p>Measured at one sample a pixel.</p>\n" + _html_table(rows, ())


def _table(points: Rows) -> str:
    rows = [
        ("point", "ms", "quartiles", "to paper", "rel. RMSE", "p99", "maximum", "FLIP", "energy", "not finite",
         "filter", "atlas")
    ]  # fmt: skip
    for point in points:
        ms, errors = point["ms"], point["errors"]
        rows.append(
            (
                point["name"], f"{ms['median']:.1f}", f"{ms['low']:.1f} to {ms['high']:.1f}",
                f"{point['to_paper']:.3f}",
                f"{errors['relative_rmse']:.4f}", f"{errors['p99']:.4f}", f"{errors['maximum']:.3f}",
                _optional(errors["flip"]), f"{errors['energy_drift']:+.2%}", f"{errors['nonfinite']}",
                _optional(point["filter_error"]), _optional(point["sampling_error"]),
            )
        )  # fmt: skip
    front = [number for number, point in enumerate(points, 1) if point["front"]]
    return _html_table(rows, front)


def _optional(value: float | None) -> str:
    return "" if value is None else f"{value:.4f}"


def _html_table(rows: Sequence[Sequence[str]], front: Iterable[int]) -> str:
    marked = set(front)
    lines = ["<tr>" + "".join(f"<th>{escape(cell)}</th>" for cell in rows[0]) + "</tr>"]
    for number, row in enumerate(rows[1:], 1):
        kind = ' class="front"' if number in marked else ""
        lines.append(f"<tr{kind}>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>")
    return '<div class="wide"><table>\n' + "\n".join(lines) + "\n</table></div>"


# -- plots -----------------------------------------------------------------------------------------------------------


def plot(points: Rows, limit: float | None = None) -> str:
    """Return a log-log plot of time and relative RMSE as SVG; points without a finite, positive error are left out.

    Parameters
    ----------
    points : of one stage; those of another `band` form fronts of their own
    limit : an error to draw a line at
    """
    points = [p for p in points if p["ms"]["median"] > 0 and 0 < p["errors"]["relative_rmse"] < math.inf]
    if not points:
        return ""
    left, top, right, bottom = MARGINS
    xs, ys = [p["ms"]["median"] for p in points], [p["errors"]["relative_rmse"] for p in points]
    x_low, x_high = _decades(xs)
    y_low, y_high = _decades(ys + ([limit] if limit else []))

    def at(x: float, y: float) -> tuple[float, float]:
        across = (math.log10(x) - x_low) / (x_high - x_low)
        up = (math.log10(y) - y_low) / (y_high - y_low)
        return left + across * (WIDTH - left - right), HEIGHT - bottom - up * (HEIGHT - top - bottom)

    lines = [f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="time against error">']
    for tick in _ticks(x_low, x_high):
        x, _ = at(tick, 10**y_low)
        lines.append(f'<line class="grid" x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{HEIGHT - bottom}"/>')
        lines.append(f'<text x="{x:.1f}" y="{HEIGHT - bottom + 18}" text-anchor="middle">{tick:g}</text>')
    for tick in _ticks(y_low, y_high):
        _, y = at(10**x_low, tick)
        lines.append(f'<line class="grid" x1="{left}" y1="{y:.1f}" x2="{WIDTH - right}" y2="{y:.1f}"/>')
        lines.append(f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    middle = (left + WIDTH - right) / 2
    lines.append(f'<text x="{middle:.0f}" y="{HEIGHT - 12}" text-anchor="middle">ms</text>')
    lines.append(
        f'<text transform="translate(18 {HEIGHT / 2:.0f}) rotate(-90)" text-anchor="middle">relative RMSE</text>'
    )
    if limit:
        _, y = at(10**x_low, limit)
        lines.append(f'<line class="limit" x1="{left}" y1="{y:.1f}" x2="{WIDTH - right}" y2="{y:.1f}"/>')
    bands = dict.fromkeys(p["settings"].get("band") for p in points)
    for band in bands:
        ends = sorted(at(p["ms"]["median"], p["errors"]["relative_rmse"])
                      for p in points if p["front"] and p["settings"].get("band") == band)  # fmt: skip
        # Between two points of the front lies what both beat: a staircase.
        path = [f"{x:.1f},{y:.1f}" for x, y in _stairs(ends)]
        lines.append(f'<polyline class="front" points="{" ".join(path)}"/>')
    kinds = list(dict.fromkeys((p["method"], p["settings"].get("band")) for p in points))
    for p in points:
        color = COLORS[kinds.index((p["method"], p["settings"].get("band"))) % len(COLORS)]
        x, y = at(p["ms"]["median"], p["errors"]["relative_rmse"])
        if p["front"]:
            lines.append(f'<circle class="ring" cx="{x:.1f}" cy="{y:.1f}" r="9"/>')
        label = f"{p['name']}: {p['ms']['median']:.1f} ms, {p['errors']['relative_rmse']:.4g}"
        lines.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{color}"><title>{escape(label)}</title></circle>')
    for number, (method, band) in enumerate(kinds):
        y = top + 14 + 20 * number
        x = WIDTH - right + 18
        lines.append(f'<circle cx="{x}" cy="{y - 4}" r="5" fill="{COLORS[number % len(COLORS)]}"/>')
        lines.append(f'<text x="{x + 12}" y="{y}">{escape(f"{method}, {band}" if band else method)}</text>')
    return "\n".join([*lines, "</svg>"])


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """Return the ends of an axis that holds all values with some room, as logarithms."""
    low, high = math.log10(min(values)), math.log10(max(values))
    room = max(0.08 * (high - low), 0.1)
    return low - room, high + room


def _ticks(low: float, high: float) -> list[float]:
    """Return round numbers between two logarithms."""
    ticks = [m * 10.0**e for e in range(math.floor(low), math.ceil(high) + 1) for m in (1, 2, 5)]
    inside = [tick for tick in ticks if low <= math.log10(tick) <= high]
    whole = [tick for tick in inside if round(math.log10(tick), 6).is_integer()]
    return whole if len(whole) > 3 else inside


def _stairs(ends: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    path = list(ends[:1])
    for x, y in ends[1:]:
        path += [(x, path[-1][1]), (x, y)]
    return path


# -- pictures --------------------------------------------------------------------------------------------------------


def _pictures(points: Rows, shown: Mapping[str, Shown]) -> str:
    """Return the slider, and each method's best point beside its error map."""
    best: dict[str, Mapping[str, Any]] = {}
    for point in points:
        known = best.get(point["method"])
        error = point["errors"]["relative_rmse"]
        if point["name"] in shown and (known is None or error < known["errors"]["relative_rmse"]):
            best[point["method"]] = point
    chosen = {p["name"]: p for p in [*best.values(), *(p for p in points if p["front"])] if p["name"] in shown}
    if not chosen or "exact" not in shown:
        return ""
    rows, columns = np.nonzero(shown["exact"].display[..., 3] > 0)
    crop = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    exact = shown["exact"].display[crop]
    mean = float(exact[..., :3][exact[..., 3] > 0].mean())
    names = ["exact", *chosen]
    options = [
        "".join(
            f'<option value="picture{number}"{" selected" if number == first else ""}>{escape(name)}</option>'
            for number, name in enumerate(names)
        )
        for first in (0, 1)
    ]
    sources = [_png(shown[name].display[crop]) for name in names]
    parts = [
        "<h2>Pictures</h2>\n<p>The reference and each method at its best, and all points of the front. "
        "Choose two and move the slider.</p>",
        f'<div class="slider" id="compare"><img alt="left picture" src="{sources[0]}">'
        f'<img alt="right picture" src="{sources[1]}"></div>',
        '<div class="controls">'
        '<input id="at" type="range" min="0" max="100" value="50" aria-label="place of the border">'
        f'<label>left <select id="left">{options[0]}</select></label>'
        f'<label>right <select id="right">{options[1]}</select></label></div>',
        f"<p>Error maps: mean absolute error of the linear picture over the mean of what is shown ({mean:.3g}), "
        "logarithmic.</p>",
        f'<div class="scale" style="background: linear-gradient(to right, {", ".join(_css(c) for c in HEAT)})"></div>'
        f'<div class="ends"><span>{LEAST_HEAT:g} or less</span><span>{MOST_HEAT:g} or more</span></div>',
        '<div class="pairs">',
        f'<figure><div class="two"><img id="picture0" alt="exact" src="{sources[0]}"></div>'
        "<figcaption>exact, the reference</figcaption></figure>",
    ]
    for number, (name, point) in enumerate(chosen.items(), 1):
        errors = point["errors"]
        heat = _png(heat_map(shown[name].error[crop] / mean))
        flip = "" if errors["flip"] is None else f", FLIP {errors['flip']:.4f}"
        parts.append(
            f'<figure><div class="two"><img id="picture{number}" alt="{escape(name)}" src="{sources[number]}">'
            f'<img alt="error of {escape(name)}" src="{heat}"></div><figcaption>{escape(name)}: relative RMSE '
            f"{errors['relative_rmse']:.4f}{flip}, {point['ms']['median']:.0f} ms</figcaption></figure>"
        )
    return "\n".join([*parts, "</div>"])


def heat_map(error: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return (h, w, 3) display-linear colors of (h, w) relative errors, see HEAT."""
    least, most = math.log10(LEAST_HEAT), math.log10(MOST_HEAT)
    place = (np.log10(np.maximum(error, LEAST_HEAT)) - least) / (most - least)
    place = np.clip(np.nan_to_num(place, nan=1.0), 0, 1) * (len(HEAT) - 1)
    encoded = np.stack([np.interp(place, np.arange(len(HEAT)), column) for column in HEAT.T], axis=-1) / 255
    return np.asarray(srgb_decode(encoded), dtype=np.float32)


def _css(color: NDArray[np.int64]) -> str:
    return f"rgb({color[0]}, {color[1]}, {color[2]})"


def _png(picture: NDArray[np.float32]) -> str:
    """Return a picture as the URL that is itself a PNG file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "picture.png"
        images.write_png(file, picture)
        return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode("ascii")
