"""The clock: whole frames and single nodes, cold and warm, and the seed paper's table of frame rates."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
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

#: frames behind every median; few, because software OpenGL takes seconds for one
WARM_FRAMES, ALL_FRAMES, PAPER_FRAMES = 7, 3, 3

#: degrees by which the camera moves about its target from frame to frame
STEP = 2.0

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

#: bytes of the memo for the paper's table: the maps and one frame's buffers, so that later frames reuse their memory
PAPER_MEMO = 1_000_000_000


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


@dataclass(frozen=True)
class Measured:
    """Frames of one pipeline.

    Parameters
    ----------
    frames : wall time of whole frames
    nodes : time of each node that ran, from other frames, since measuring nodes holds up the frame
    reports : of the last frame
    """

    frames: Spread
    nodes: Mapping[str, Spread]
    reports: Sequence[NodeReport]


def measure(pipeline: Pipeline, count: int) -> Measured:
    """Measure `count` frames, and the nodes in as many again, while the camera moves."""
    motion = Motion(pipeline)
    frames: list[float] = []
    nodes: dict[str, list[float]] = {}
    for _ in range(count):
        motion.step()
        frames.append(frame_ms(pipeline))
    for _ in range(count):
        motion.step()
        frame_ms(pipeline, timing=True)
        for report in pipeline.reports:
            if report.ms is not None:
                nodes.setdefault(report.name, []).append(report.ms)
    return Measured(
        Spread.of(frames), {name: Spread.of(times) for name, times in nodes.items()}, tuple(pipeline.reports)
    )


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
        `shading: paper`), and the ratios of the medians of warm and all to paper
    nodes : per node the same, with size, megatexels drawn and the least bytes moved with --no-skip
    """
    with tempfile.TemporaryDirectory() as folder:
        loaded = load(Path(folder), TIMED_SCENE, *TIMED_SETS)
        mesh = load_scene_mesh(loaded)
        lazy = Pipeline(loaded, mesh)
        # The very first frame compiles: it cannot be repeated, so its nodes are measured in it.
        cold = frame_ms(lazy, timing=True)
        cold_nodes = {report.name: report.ms for report in lazy.reports if report.ms is not None}
        warm = measure(lazy, WARM_FRAMES)
        lazy.graph.store.clear()
        eager = Pipeline(loaded, mesh, skip=False)
        frame_ms(eager)
        everything = measure(eager, ALL_FRAMES)
        eager.graph.store.clear()
        paper_loaded = load(Path(folder), TIMED_SCENE, *TIMED_SETS, "render.shading=paper")
        paper_pipeline = Pipeline(paper_loaded, mesh, skip=False)
        frame_ms(paper_pipeline)
        paper = measure(paper_pipeline, ALL_FRAMES)
        paper_pipeline.graph.store.clear()
    frames = {
        "scene": f"head of {len(mesh.faces)} triangles, {loaded.scene.render.size[0]}x{loaded.scene.render.size[1]}, "
        f"{lazy.samples}x{lazy.samples} samples, atlas {lazy.atlas_size[0]}",
        "cold_ms": round(cold, 3),
        "warm": asdict(warm.frames),
        "all": asdict(everything.frames),
        "paper": asdict(paper.frames),
        "warm_to_paper": round(warm.frames.median / paper.frames.median, 4),
        "all_to_paper": round(everything.frames.median / paper.frames.median, 4),
    }
    reports = {report.name: report for report in everything.reports}
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
                "warm": _entry(warm.nodes.get(name)),
                "all": _entry(everything.nodes[name]),
                "paper": _entry(paper.nodes.get(name)),
            }
        )
    return frames, rows


def _entry(spread: Spread | None) -> dict[str, Any] | None:
    return None if spread is None else asdict(spread)


def time_paper_table() -> list[dict[str, Any]]:
    """Measure the rows of the seed paper's Table 1.

    Two rates are given: "full", in which every pass that the paper ran per frame runs (the maps, which were image files
    there, are made once), and "camera", in which the camera moves and what does not depend on it is remembered.
    """
    rows = []
    store = Store(PAPER_MEMO)
    with tempfile.TemporaryDirectory() as folder:
        for (detail, size), paper_fps in PAPER_TABLE.items():
            loaded = load(Path(folder), PAPER_SCENE, f"mesh.detail={detail}", f"render.size=[{size[0]}, {size[1]}]")
            mesh = load_scene_mesh(loaded)
            pipeline = Pipeline(loaded, mesh, store)
            motion = Motion(pipeline)
            frame_ms(pipeline)
            camera, full = [], []
            for _ in range(PAPER_FRAMES):
                motion.step()
                camera.append(frame_ms(pipeline))
            for number in range(PAPER_FRAMES):
                motion.step()
                _renew_atlas(pipeline, number + 1)
                full.append(frame_ms(pipeline))
            times = Spread.of(full), Spread.of(camera)
            rows.append(
                {
                    "detail": detail,
                    "triangles": len(mesh.faces),
                    "size": list(size),
                    "paper_fps": paper_fps,
                    "full": asdict(times[0]),
                    "full_fps": round(1000 / times[0].median, 3),
                    "camera": asdict(times[1]),
                    "camera_fps": round(1000 / times[1].median, 3),
                    "full_to_paper": round(1000 / times[0].median / paper_fps, 5),
                }
            )
    store.clear()
    return rows


def _renew_atlas(pipeline: Pipeline, frame: int) -> None:
    """Change the bumps by a millionth, after which everything in texture space has to be computed again."""
    atlas = pipeline.graph.nodes["atlas"]
    assert isinstance(atlas, Pass)
    factor = 1 + 1e-6 * frame
    draws = []
    for draw in atlas.draws:
        assert isinstance(draw.values, AtlasValues)
        draws.append(replace(draw, values=replace(draw.values, bumpiness=factor * draw.values.bumpiness)))
    pipeline.graph.update([atlas.with_draws(draws)])
