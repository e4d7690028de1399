"""What became faster or slower, nearer or farther off, from one bench.json to another."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skincli.bench.report import FORMAT, Rows, table
from skincli.errors import InputError

#: ratio of errors, and of times that hold for the same machine, above which something has become worse
ERROR_GROWTH, TIME_GROWTH = 1.05, 1.25

#: relative errors below this are rounding
LEAST_ERROR = 1e-6

#: metrics of which every number is shown; of the others what is worse
SHOWN = ("time to paper", "relative_rmse", "rms", "filter", "frame ms")

#: what is compared, by the key in the document
KINDS = {"sweep": "a scene's sweep", "stages": "stages against their twins", "surfaces": "the diffusion by itself"}


@dataclass(frozen=True)
class Change:
    """One number in two benches.

    Parameters
    ----------
    what, metric : which point or stage, and which of its numbers
    old, new : its values
    allowed : ratio above which it is worse
    """

    what: str
    metric: str
    old: float
    new: float
    allowed: float

    @property
    def ratio(self) -> float:
        """New over old; 1 where both are 0, infinite where only the new one is not."""
        if self.old == self.new:
            return 1.0
        return self.new / self.old if self.old else math.inf

    @property
    def worse(self) -> bool:
        """Whether it grew by more than is allowed; NaN always did."""
        return not self.ratio <= self.allowed


def read(path: Path) -> dict[str, Any]:
    """Return a bench.json.

    Raises
    ------
    InputError : it cannot be read, is no report of a bench, one of another format, or one of what is not compared
    """
    file = path / "bench.json" if path.is_dir() else path
    try:
        found = json.loads(file.read_text("utf-8"))
    except OSError as problem:
        raise InputError(f"{file}: {problem.strerror}; name a bench.json, or the folder that holds one") from None
    except ValueError as problem:
        raise InputError(f"{file}: no JSON ({problem}); name a bench.json that `skincli bench -o DIR` wrote") from None
    if not isinstance(found, dict) or "bench" not in found:
        raise InputError(f"{file}: no report of a bench; name a bench.json that `skincli bench -o DIR` wrote")
    if found["bench"] != FORMAT:
        raise InputError(
            f"{file}: a report of format {found['bench']}; format {FORMAT} is read; measure again with this version"
        )
    if not any(found[kind] for kind in KINDS):
        raise InputError(f"{file}: nothing that is compared; that is {', '.join(KINDS.values())}")
    return found


def compare(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Change]:
    """Return what both benches measured.

    The times of a sweep are held as ratios to `shading: paper --no-skip` of the same run, so that a machine that others
    use, or another machine, says little of a change; those of the diffusion by itself only on the same device. The
    drift of energy counts by its size.

    Raises
    ------
    InputError : they measured different things
    """
    changes = [*_points(old, new), *_stages(old, new), *_surfaces(old, new)]
    if not changes:
        held = (" and ".join(what for kind, what in KINDS.items() if bench[kind]) for bench in (old, new))
        raise InputError("OLD holds {}, NEW {}: nothing is in both; name two benches of one kind".format(*held))
    return changes


def _points(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    if not (old["sweep"] and new["sweep"]):
        return
    for fact in ("triangles", "size", "reference"):
        _require_same(f"the sweep's {fact}", *(bench["sweep"]["scene"][fact] for bench in (old, new)))
    for what, one, other in _both(old["sweep"]["points"], new["sweep"]["points"], "stage", "name"):
        yield Change(what, "time to paper", one["to_paper"], other["to_paper"], TIME_GROWTH)
        before, after = one["errors"], other["errors"]
        yield from _errors(what, before, after, "relative_rmse", "p99", "maximum", "flip")
        yield _error(what, "energy_drift", abs(before["energy_drift"]), abs(after["energy_drift"]))
        yield Change(what, "nonfinite", before["nonfinite"], after["nonfinite"], 1.0)


def _stages(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    for what, one, other in _both(old["stages"], new["stages"], "node", "shading"):
        yield _error(f"twin: {what}", "rms", one["rms"] / one["scale"], other["rms"] / other["scale"])


def _surfaces(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    if not (old["surfaces"] and new["surfaces"]):
        return
    before, after = old["surfaces"], new["surfaces"]
    _require_same("the diffusion's points", before["points"], after["points"])
    for what, one, other in _both(before["layouts"], after["layouts"], "mesh", "layout"):
        for fact in ("triangles", "atlas"):
            _require_same(f"{what}: {fact}", one[fact], other[fact])
        yield _error(what, "constant", one["constant"], other["constant"])
        yield Change(what, "tables MB", one["table_mb"], other["table_mb"], ERROR_GROWTH)
        yield from _errors(f"{what}: step", one["steps"], other["steps"], *one["steps"])
        if old["device"] == new["device"]:
            yield Change(what, "build s", one["build_s"], other["build_s"], TIME_GROWTH)
            yield Change(what, "frame ms", one["frame"]["median"], other["frame"]["median"], TIME_GROWTH)
    for what, one, other in _both(before["rows"], after["rows"], "mesh", "layout", "light", "kernel"):
        yield from _errors(what, one, other, "filter", "p99", "maximum", "seam", "sampling")
    for what, one, other in _both(before["pictures"], after["pictures"], "mesh", "changed"):
        yield from _errors(what, one, other, "flip")


def _require_same(what: str, old: Any, new: Any) -> None:
    if old != new:
        raise InputError(f"{what}: {old} in OLD, {new} in NEW; only benches of the same scene and size are compared")


def _both(old: Rows, new: Rows, *keys: str) -> Iterator[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
    """Give the rows that are in both tables: what they are of, and both."""
    before, after = ({": ".join(row[key] for key in keys): row for row in rows} for rows in (old, new))
    yield from ((what, row, after[what]) for what, row in before.items() if what in after)


def _errors(what: str, old: Mapping[str, Any], new: Mapping[str, Any], *metrics: str) -> Iterator[Change]:
    """Give those of the errors that were measured in both."""
    for metric in metrics:
        a, b = old[metric], new.get(metric)
        if a is not None and b is not None:
            yield _error(what, metric, a, b)


def _error(what: str, metric: str, old: float, new: float) -> Change:
    return Change(what, metric, max(old, LEAST_ERROR), max(new, LEAST_ERROR) if new == new else new, ERROR_GROWTH)


def as_text(old: Mapping[str, Any], new: Mapping[str, Any], changes: list[Change]) -> str:
    """Return the comparison for a terminal: what is worse, and every number of the metrics that are SHOWN."""
    lines = [
        f"{name}: {bench['device']['renderer']}, {bench['device']['version']}, skincli {bench['versions']['skincli']}"
        for name, bench in (("old", old), ("new", new))
    ]
    rows = [("point", "metric", "old", "new", "new/old", "allowed", "")]
    for change in changes:
        if change.worse or change.metric in SHOWN:
            numbers = (f"{change.old:.3g}", f"{change.new:.3g}", f"{change.ratio:.3f}", f"{change.allowed:g}")
            rows.append((change.what, change.metric, *numbers, "WORSE" if change.worse else ""))
    worse = sum(change.worse for change in changes)
    lines.append(f"{len(changes)} numbers compared, {worse} worse")
    return "\n".join(lines) + "\n\n" + table(rows, text=2)
