"""The clock: whole frames and single nodes, cold and warm, and the seed paper's table of frame rates."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import itertools
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from skincli.bench.scene import PAPER_SCENE, TIMED_SCENE, TIMED_SETS, load
from skincli.gpu.textures import FORMATS
from skincli.graph.frame_graph import NodeReport
from skincli.graph.node import ZERO, Draw, Load, Node, Pass, Ref
from skincli.graph.store import Store
from skincli.passes.atlas import AtlasValues
from skincli.pipeline import Pipeline, frame_camera, load_scene_mesh
from skincli.scene.model import Camera

#: rounds behind every median; few, because software OpenGL takes seconds for a frame
ROUNDS, PAPER_ROUNDS = 3, 3

#: degrees by which the camera moves about its target from frame to frame
STEP = 2.0

#: bytes that a memo of the bench keeps beyond what a frame needs: several of them live at once
MEMO = 1_000_000_000

#: Frames per second of Table 1 on a GeForce GTX 560 [Fecko2013, section 5], by triangles and picture size.
PAPER_TABLE: Mapping[tuple[str, tuple[int, int]], int] = {
    ("65k", (640, 480)): 63,
    ("65k", (800, 600)): 63,
    ("65k", (1280, 720)): 47,
    ("65k", (1920, 1080)): 31,
    ("259k", (640, 480)): 46,
    ("259k", (800, 600)): 35,
    ("259k", (1280, 720)): 31,
    ("259k", (1920, 1080)): 21,
}


@dataclass(frozen=True)
class Spread:
    """Median and quartiles of times in ms, and how many there were."""

    median: float
    low: float
    high: float
    count: int

    @classmethod
    def of(cls, times: Sequence[float]) -> Spread:
        """Summarize at least one time."""
        low, median, high = np.percentile(times, (25, 50, 75))
        return cls(round(float(median), 3), round(float(low), 3), round(float(high), 3), len(times))


class Motion:
    """A camera that goes about its target, so that what depends on it is computed anew in every frame."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        self.start = pipeline.scene.camera or frame_camera(pipeline.mesh, pipeline.size)
        self.frame = 0

    def step(self) -> None:
        """Move on by STEP degrees."""
        self.frame += 1
        self.pipeline.look_from(turned(self.start, STEP * self.frame))


def turned(camera: Camera, degrees: float) -> Camera:
    """Return the camera turned about the vertical through its target."""
    x, y, z = np.array(camera.position) - np.array(camera.target)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    position = np.array(camera.target) + np.array([c * x + s * z, y, c * z - s * x])
    return camera.model_copy(update={"position": tuple(map(float, position))})


def frame_ms(pipeline: Pipeline, timing: bool = False) -> float:
    """Return the wall time of a frame, its read-back included, in ms."""
    start = time.perf_counter()
    pipeline.run(["beauty"], timing=timing)
    return (time.perf_counter() - start) * 1000


@dataclass
class Measured:
    """Times of one pipeline in ms.

    Parameters
    ----------
    frames : whole frames, one per round
    nodes : each node that ran, from other frames, since measuring nodes holds up the frame
    """

    frames: list[float] = field(default_factory=list)
    nodes: dict[str, list[float]] = field(default_factory=dict)

    def spread_of(self, node: str) -> dict[str, Any] | None:
        """Return the JSON form of a node's times, None where it did not run."""
        return asdict(Spread.of(self.nodes[node])) if node in self.nodes else None

    def ratio_to(self, other: Measured) -> float:
        """Return the median over the rounds of this pipeline's frame time over the other's in the same round."""
        return round(float(np.median(np.divide(self.frames, other.frames))), 4)


def free(store: Store, but_dear: bool = False) -> None:
    """Forget textures, and give their memory back to the system: the C library of Linux keeps it otherwise."""
    store.clear(but_dear)
    gc.collect()
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def measure(pipelines: Sequence[Pipeline], rounds: int) -> list[Measured]:
    """Measure frames, and the nodes in as many again, while the camera moves.

    The pipelines take turns, so that a machine that others use slows all of them alike.
    """
    motions = [Motion(pipeline) for pipeline in pipelines]
    results = [Measured() for _ in pipelines]
    for timing in (False, True):
        for _ in range(rounds):
            for pipeline, motion, result in zip(pipelines, motions, results, strict=True):
                motion.step()
                ms = frame_ms(pipeline, timing)
                if not timing:
                    result.frames.append(ms)
                else:
                    for report in pipeline.reports:
                        if report.ms is not None:
                            result.nodes.setdefault(report.name, []).append(report.ms)
                if not pipeline.graph.skip:
                    # What the next frame forgets in any case need not wait for it; the memory is kept for that.
                    pipeline.graph.store.clear()
    return results


def least_bytes(node: Node, nodes: Mapping[str, Node], reports: Mapping[str, NodeReport]) -> int:
    """Return the texture bytes that a node must at least move in a frame in which all nodes ran.

    Each target is written once and each input read once, by no more texels than it or the target has. A draw over the
    whole target does so again; adding to a target also reads it. Vertices are left out.
    """
    own = reports[node.name]
    if isinstance(node, Load):
        return own.bytes
    assert isinstance(node, Pass)
    read = 0
    for draw in _draws_over_all(node) or node.draws[:1]:
        for source in {draw.inputs.get(name, node.wired.get(name, ZERO)) for name in node.inputs}:
            if isinstance(source, Ref):
                texels = min(_area(reports[source.node]), _area(own))
                read += texels * FORMATS[nodes[source.node].outputs[source.output].format][2]
    return read + own.bytes * max(len(_draws_over_all(node)), 1) * (2 if node.additive else 1)


def _draws_over_all(node: Node) -> Sequence[Draw]:
    """Return the draws that touch every texel of the target; those of a mesh share the texels among them."""
    return [draw for draw in node.draws if draw.topology == "screen"] if isinstance(node, Pass) else []


def _area(report: NodeReport) -> int:
    return report.size[0] * report.size[1]


def time_scene() -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Time the scene of skincli.bench.scene.

    Returns
    -------
    frames : "cold" (first frame of the process), "warm" (the camera moves), "all" (--no-skip), "paper" (--no-skip in
        `shading: paper`), and the ratios of warm and all to paper
    nodes : per node the same, with size, megatexels drawn and the least bytes moved with --no-skip
    """
    with tempfile.TemporaryDirectory() as folder:
        loaded = load(Path(folder), TIMED_SCENE, *TIMED_SETS)
        mesh = load_scene_mesh(loaded)
        lazy = Pipeline(loaded, mesh, Store(MEMO))
        # The very first frame compiles: it cannot be repeated, so its nodes are measured in it.
        cold = frame_ms(lazy, timing=True)
        cold_nodes = {report.name: report.ms for report in lazy.reports if report.ms is not None}
        paper_loaded = load(Path(folder), TIMED_SCENE, *TIMED_SETS, "render.shading=paper")
        # Of these the frames are timed, not what is made ready before.
        eager, paper_eager = (
            Pipeline(scene, mesh, Store(MEMO), skip=False, use_cache=True) for scene in (loaded, paper_loaded)
        )
        for pipeline in (eager, paper_eager):
            frame_ms(pipeline)
            pipeline.graph.store.clear()
        pipelines = (lazy, eager, paper_eager)
        warm, everything, paper = measure(pipelines, ROUNDS)
    size = loaded.scene.render.size
    frames = {
        "scene": f"head of {len(mesh.faces)} triangles, {size[0]}x{size[1]}, {lazy.samples}x{lazy.samples} samples, "
        f"atlas {lazy.atlas_size[0]}",
        "cold_ms": round(cold, 3),
        "warm": asdict(Spread.of(warm.frames)),
        "all": asdict(Spread.of(everything.frames)),
        "paper": asdict(Spread.of(paper.frames)),
        "warm_to_paper": warm.ratio_to(paper),
        "all_to_paper": everything.ratio_to(paper),
    }
    reports = {report.name: report for report in eager.reports}
    rows = []
    for name, node in eager.graph.nodes.items():
        drawn = _area(reports[name]) * max(len(_draws_over_all(node)), 1)
        rows.append(
            {
                "name": name,
                "size": list(reports[name].size),
                "megatexels": round(drawn / 1e6, 4),
                "least_bytes": least_bytes(node, eager.graph.nodes, reports),
                "cold_ms": cold_nodes.get(name),
                "warm": warm.spread_of(name),
                "all": everything.spread_of(name),
                "paper": paper.spread_of(name),
            }
        )
    free(lazy.graph.store)
    return frames, rows


def time_paper_table() -> list[dict[str, Any]]:
    """Measure the rows of the seed paper's Table 1.

    Two rates are given: "full", in which every pass that the paper ran per frame runs (the maps, which were image files
    there, are made once), and "camera", in which the camera moves and what does not depend on it is remembered;
    `full_nodes` and `camera_nodes` name what ran.
    """
    rows = []
    store = Store(MEMO)
    numbers = itertools.count(1)  # never the same twice: the rows share the memo
    with tempfile.TemporaryDirectory() as folder:
        for (detail, size), paper_fps in PAPER_TABLE.items():
            loaded = load(Path(folder), PAPER_SCENE, f"mesh.detail={detail}", f"render.size=[{size[0]}, {size[1]}]")
            mesh = load_scene_mesh(loaded)
            pipeline = Pipeline(loaded, mesh, store)
            motion = Motion(pipeline)
            frame_ms(pipeline)
            camera, full = [], []
            for _ in range(PAPER_ROUNDS):
                motion.step()
                camera.append(frame_ms(pipeline))
                camera_nodes = _ran(pipeline)
                motion.step()
                _renew_atlas(pipeline, next(numbers))
                full.append(frame_ms(pipeline))
                full_nodes = _ran(pipeline)
            times = Spread.of(full), Spread.of(camera)
            rows.append(
                {
                    "detail": detail,
                    "triangles": len(mesh.faces),
                    "size": list(size),
                    "paper_fps": paper_fps,
                    "full": asdict(times[0]),
                    "full_nodes": full_nodes,
                    "full_fps": round(1000 / times[0].median, 3),
                    "camera": asdict(times[1]),
                    "camera_nodes": camera_nodes,
                    "camera_fps": round(1000 / times[1].median, 3),
                    "full_to_paper": round(1000 / times[0].median / paper_fps, 5),
                }
            )
    free(store)
    return rows


def _ran(pipeline: Pipeline) -> list[str]:
    """Return the names of the nodes that ran in the last frame."""
    return [report.name for report in pipeline.reports if report.state == "ran"]


def _renew_atlas(pipeline: Pipeline, number: int) -> None:
    """Change the bumps by `number` millionths, after which everything in texture space has to be computed again."""
    atlas = pipeline.graph.nodes["atlas"]
    assert isinstance(atlas, Pass)
    factor = 1 + 1e-6 * number
    renewed = []
    for draw in atlas.draws:
        assert isinstance(draw.values, AtlasValues)
        renewed.append(replace(draw.values, bumpiness=factor * draw.values.bumpiness))
    pipeline.graph.update([atlas.with_values(renewed)])
