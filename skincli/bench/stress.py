"""Numerical stability: every case of skincli.bench.extremes is finite and on its twins, or refused as documented."""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli.bench.extremes import Case
from skincli.bench.stages import (
    DEPTH_SHARE,
    FULL_TOLERANCE,
    HALF_TOLERANCE,
    LEAST_SCALE,
    STAGES,
    Stage,
    Stored,
)
from skincli.errors import SkincliError
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import Pass
from skincli.pipeline import OUTPUTS

Array = NDArray[np.float64]

#: the three ends of a case
OK, REFUSED, FAILS = "ok", "refused as documented", "FAILS"

#: pixels that may fall on the other side of an edge where depths are compared, however small the picture is
EDGE_PIXELS = 4

#: mean absolute difference of two pictures that are to be one, as a share of their mean
LIKENESS = 1e-3


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Parameters
    ----------
    verdict : OK, REFUSED or FAILS
    found : the error's message, or what is wrong; empty where the case is ok
    nonfinite : values that are NaN or Inf, over all outputs of all nodes
    error : of the node that is farthest from its float64 twin, as a share of what is allowed
    node : that node
    unlike : difference from the picture that the case has to repeat, as a share of what is allowed; None without one
    ms : of the whole case, its twins included
    """

    group: str
    case: str
    verdict: str
    found: str = ""
    nonfinite: int = 0
    error: float = 0.0
    node: str = ""
    unlike: float | None = None
    ms: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether the case ended as it has to."""
        return self.verdict != FAILS

    @property
    def sentence(self) -> str:
        """What is wrong, for a person."""
        return f"stress case {self.group}, {self.case}: {self.found}"

    def entry(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {**asdict(self), "passed": self.passed}


def run(cases: Iterable[Case]) -> list[Outcome]:
    """Return what became of each case, in order. Warnings about what is made good on the way are kept quiet."""
    pictures: dict[Case, Array] = {}
    log = logging.getLogger("skincli")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        return [examine(case, pictures) for case in cases]
    finally:
        log.setLevel(level)


def examine(case: Case, pictures: dict[Case, Array]) -> Outcome:
    """Return what became of a case.

    Parameters
    ----------
    pictures : of the cases that others repeat; grows
    """
    start = time.perf_counter()
    outcome = Outcome(case.group, case.name, FAILS)
    with tempfile.TemporaryDirectory() as folder:
        try:
            graph = case.make(Path(folder))
            try:
                outcome = _lean(graph, outcome) if case.lean else _measured(case, graph, outcome, pictures)
            finally:
                graph.store.clear()
        except SkincliError as error:
            refused = case.refused
            documented = refused is not None and type(error) is refused.error and refused.says in str(error)
            found = " ".join(str(error).replace(f"{folder}/", "").split())
            outcome = replace(outcome, verdict=REFUSED if documented else FAILS, found=found)
        except Exception as error:  # whatever one case meets, the others are to be run
            outcome = replace(outcome, found=f"{type(error).__name__}: {error}")
        else:
            if case.refused is not None and case.refused.always:
                outcome = replace(outcome, verdict=FAILS, found=f"is rendered, not refused with '{case.refused.says}'")
    return replace(outcome, ms=round((time.perf_counter() - start) * 1000, 1))


def _lean(graph: FrameGraph, outcome: Outcome) -> Outcome:
    """Run what the picture needs; a value that is not finite ends in an error."""
    graph.run([OUTPUTS["beauty"].source], check=True)
    return replace(outcome, verdict=OK)


def _measured(case: Case, graph: FrameGraph, outcome: Outcome, pictures: dict[Case, Array]) -> Outcome:
    """Run every node, count what is not finite, and hold each stage against its twin."""
    stored = Stored(graph)
    bad = {ref: int(np.count_nonzero(~np.isfinite(array))) for ref, array in stored.arrays.items()}
    if any(bad.values()):
        ref, count = next((ref, count) for ref, count in bad.items() if count)
        found = f"{count} values of {ref.node}.{ref.output} are not finite"
        return replace(outcome, found=found, nonfinite=sum(bad.values()))
    errors = {}
    for node in graph.nodes.values():
        stage = STAGES.get(type(node))
        if stage is not None:
            assert isinstance(node, Pass)
            errors[node.name] = deviation(stage, node, stored, case.faint)
    worst = max(errors, key=errors.__getitem__)
    outcome = replace(outcome, verdict=OK, error=errors[worst], node=worst)
    if outcome.error > 1:
        found = f"{worst} differs from its twin by {outcome.error:.3g} times what is allowed"
        return replace(outcome, verdict=FAILS, found=found)
    source = OUTPUTS["beauty"].source
    if source in stored.arrays:
        pictures[case] = stored.arrays[source].astype(np.float64)
    if case.like is None:
        return outcome
    if case.like not in pictures:
        examine(case.like, pictures)
    if case.like not in pictures:
        return replace(outcome, verdict=FAILS, found=f"{case.like.name}, which it has to repeat, gives no picture")
    other = pictures[case.like]
    unlike = float(np.abs(pictures[case] - other).mean() / np.abs(other).mean() / LIKENESS)
    if not unlike <= 1:
        found = f"its picture differs from that of {case.like.name} by {unlike:.3g} times what is allowed"
        return replace(outcome, verdict=FAILS, found=found, unlike=unlike)
    return replace(outcome, unlike=unlike)


def deviation(stage: Stage, node: Pass, stored: Stored, faint: float) -> float:
    """Return how far a node is from its twin, as a share of what is allowed.

    The tolerances are those of skincli.bench.stages, but relative where a value is larger than the stage's scale, which
    is taken of what is lit: beside a light that touches the skin, brightness spans many powers of ten. Where depths are
    compared, the number of pixels beyond the tolerance counts.

    Parameters
    ----------
    faint : factor of the least scale, 1 where the light is of usual brightness
    """
    expected = stage.twin(node, stored)
    found = stored.output(node, stage.output)[..., : expected.shape[-1]]
    expected = np.broadcast_to(expected, found.shape)
    meant = ((found != 0) | (expected != 0)).any(axis=-1)
    if not meant.any():
        return 0.0
    found, expected = found[meant], expected[meant]
    lit = np.abs(expected[:, :3][expected[:, :3] != 0])
    scale = max(LEAST_SCALE * faint, float(np.percentile(lit, 99)) if lit.size else 0.0)
    # A fourth channel is a share, in whatever light.
    scales = np.where(np.arange(expected.shape[-1]) < 3, scale, 1.0)
    tolerance = HALF_TOLERANCE if "16f" in node.outputs[stage.output].format else FULL_TOLERANCE
    error = np.abs(found - expected) / np.maximum(np.abs(expected), scales)
    # Nothing meets a twin that is not finite.
    error = np.where(np.isfinite(error), error, np.finfo(float).max * tolerance)
    if not stage.compares_depth:
        return float(error.max() / tolerance)
    # A pixel on the other side of an edge is no error of the stage.
    beyond = np.count_nonzero(~(error <= tolerance).all(axis=-1))
    return beyond / max(EDGE_PIXELS, DEPTH_SHARE * len(error))
