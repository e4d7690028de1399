"""What became faster or slower, nearer or farther off, from one bench.json to another."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skincli.bench.report import table
from skincli.errors import InputError

#: ratio of errors, and of times that hold for the same machine, above which something has become worse
ERROR_GROWTH, TIME_GROWTH = 1.05, 1.25

#: relative errors below this are rounding
LEAST_ERROR = 1e-6


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
    InputError : it cannot be read, or is no report of a bench
    """
    file = path / "bench.json" if path.is_dir() else path
    try:
        found = json.loads(file.read_text("utf-8"))
    except OSError as problem:
        raise InputError(f"{file}: {problem.strerror}; name a bench.json, or the folder that holds one") from None
    except ValueError as problem:
        raise InputError(f"{file}: no JSON ({problem}); name a bench.json that `skincli bench -o DIR` wrote") from None
    if not isinstance(found, dict) or not {"device", "versions", "stages", "sweep"} <= found.keys():
        raise InputError(f"{file}: no report of a bench; name a bench.json that `skincli bench -o DIR` wrote")
    return found


def compare(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Change]:
    """Return what both benches measured.

    Times are held as ratios to `shading: paper --no-skip` of the same run, so that a machine that others use, or
    another machine, says little of a change; the drift of energy counts by its size.
    """
    return [*_points(old, new), *_stages(old, new)]


def _points(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    before, after = (
        {(p["stage"], p["name"]): p for p in (bench["sweep"] or {}).get("points", ())} for bench in (old, new)
    )
    for key in [key for key in before if key in after]:
        what = ": ".join(key)
        one, other = before[key], after[key]
        yield Change(what, "time to paper", one["to_paper"], other["to_paper"], TIME_GROWTH)
        for metric in ("relative_rmse", "p99", "maximum", "flip"):
            a, b = one["errors"][metric], other["errors"][metric]
            if a is not None and b is not None:
                yield _error(what, metric, a, b)
        yield _error(what, "energy_drift", abs(one["errors"]["energy_drift"]), abs(other["errors"]["energy_drift"]))
        yield Change(what, "nonfinite", one["errors"]["nonfinite"], other["errors"]["nonfinite"], 1.0)


def _stages(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Change]:
    before, after = ({(s["node"], s["shading"]): s for s in bench["stages"]} for bench in (old, new))
    for key, one in before.items():
        if key in after:
            other = after[key]
            what = f"twin: {', '.join(key)}"
            yield _error(what, "rms", one["rms"] / one["scale"], other["rms"] / other["scale"])


def _error(what: str, metric: str, old: float, new: float) -> Change:
    return Change(what, metric, max(old, LEAST_ERROR), max(new, LEAST_ERROR) if new == new else new, ERROR_GROWTH)


def as_text(old: Mapping[str, Any], new: Mapping[str, Any], changes: list[Change]) -> str:
    """Return the comparison for a terminal: what is worse, then every point's time and error."""
    lines = [
        f"{name}: {bench['device']['renderer']}, {bench['device']['version']}, skincli {bench['versions']['skincli']}"
        for name, bench in (("old", old), ("new", new))
    ]
    rows = [("point", "metric", "old", "new", "new/old", "allowed", "")]
    for change in changes:
        if change.worse or change.metric in ("time to paper", "relative_rmse", "rms"):
            numbers = (f"{change.old:.3g}", f"{change.new:.3g}", f"{change.ratio:.3f}", f"{change.allowed:g}")
            rows.append((change.what, change.metric, *numbers, "WORSE" if change.worse else ""))
    worse = sum(change.worse for change in changes)
    lines.append(f"{len(changes)} numbers compared, {worse} worse")
    return "\n".join(lines) + ("\n\n" + table(rows, text=2) if changes else "")
