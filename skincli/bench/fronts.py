"""Time against error: methods and settings swept, the points that no other beats, the cheapest that is good enough."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from skincli import metrics
from skincli.bench.timing import MEMO, Spread, free, turned
from skincli.errors import DeviceError, LimitError, SkincliError, UsageError
from skincli.gpu.textures import read_back
from skincli.graph.node import Pass, Ref
from skincli.graph.store import Store
from skincli.mesh.bake import occlusion_at
from skincli.mesh.model import Mesh
from skincli.passes.camera import camera_position
from skincli.passes.irradiance import IrradianceValues
from skincli.passes.occlusion_band import BandValues, sample_set
from skincli.pipeline import Pipeline, frame_camera, load_scene_mesh
from skincli.reference.texels import SeenTexels
from skincli.scene.model import ATLAS_OF_QUALITY, SUPERSAMPLE_OF_QUALITY, TERMS_OF_QUALITY, DiffusionMethod, Quality
from skincli.scene.paths import LoadedScene

Array = NDArray[np.float64]
Make = Callable[..., LoadedScene]
Settings = Mapping[str, int | str]

#: timed frames behind every median
ROUNDS = 3

#: methods that are worth a coarser atlas than that of draft
COARSE = ("lattice", "none", "sum_of_gaussians")

#: degrees by which the camera moves from one timed frame to the next: enough to compute anew, too little to see else
STEP = 0.01

#: Gaussians of the reference; the most that a scene may ask for
REFERENCE_TERMS = 6

#: pixels on which filter and sampling errors are told apart, at most; of all of them costs minutes
PART_PIXELS = 20_000

#: points of the surface at which occlusion is traced, and rays from each
TRACED_POINTS, TRACED_RAYS = 4000, 256

#: methods that are held against `exact`
METHODS = tuple(method for method in get_args(DiffusionMethod) if method != "exact")

#: stages in the order in which they are reported
STAGE_TITLES = {
    "picture": "The whole picture",
    "diffusion": "Diffusion in the atlas",
    "occlusion": "Ambient occlusion",
    "supersampling": "Samples per pixel",
}

#: methods to which the number of Gaussians means nothing
WITHOUT_TERMS = ("none", "paper")


@dataclass(frozen=True)
class Errors:
    """How far a picture is from its reference, over the pixels that show a surface.

    Parameters
    ----------
    relative_rmse : root mean square error over the root mean square of the reference
    p99, maximum : absolute, in the picture's unit
    flip : mean FLIP, 0 to 1; None for what is no picture
    energy_drift : light gained (+) or lost (-), as a share
    nonfinite : values that are NaN or Inf, in the whole picture
    """

    relative_rmse: float
    p99: float
    maximum: float
    flip: float | None
    energy_drift: float
    nonfinite: int

    @classmethod
    def of(
        cls, test: NDArray[np.floating], reference: NDArray[np.floating], mask: NDArray[np.bool_] | None = None
    ) -> Errors:
        """Measure (..., c) arrays; FLIP is left to `Picture`."""
        return cls(
            metrics.relative_rmse(test, reference, mask),
            metrics.p99(test, reference, mask),
            metrics.max_abs(test, reference, mask),
            None,
            metrics.energy_drift(test, reference, mask),
            metrics.nonfinite_count(test),
        )


@dataclass(frozen=True)
class Point:
    """One setting of one method: what it costs and how far off it is.

    Parameters
    ----------
    stage : "picture", or the stage of it that is swept
    method : the curve it belongs to
    settings : by what it differs from the other points
    ms : time, see `Sweep.times`
    errors : against the stage's reference
    filter_error, sampling_error : relative RMSE by the method at this atlas and by the atlas; None where not told apart
    front : whether no other point of the stage is both cheaper and nearer to the reference
    to_paper : median over the median frame time of `shading: paper --no-skip` in the same run
    """

    stage: str
    method: str
    settings: Settings
    ms: Spread
    errors: Errors
    filter_error: float | None = None
    sampling_error: float | None = None
    front: bool = False
    to_paper: float | None = None

    @property
    def name(self) -> str:
        """The method and its settings, for a person."""
        return ", ".join([self.method, *(f"{key} {value}" for key, value in self.settings.items())])

    def entry(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {**asdict(self), "name": self.name}


def pareto(costs: Sequence[float], errors: Sequence[float]) -> list[bool]:
    """Tell for each point whether no other is at least as good in both and better in one.

    What is not finite is never on the front; equal points are on it together.
    """
    front = [False] * len(costs)
    best = math.inf
    order = sorted(range(len(costs)), key=lambda i: (costs[i], errors[i]))
    for _, group in itertools.groupby(order, key=lambda i: costs[i]):
        same = [i for i in group if math.isfinite(costs[i]) and math.isfinite(errors[i])]
        least = min((errors[i] for i in same), default=math.inf)
        if least < best:
            best = least
            for i in same:
                front[i] = errors[i] == least
    return front


def marked(points: Sequence[Point]) -> list[Point]:
    """Return the points of one stage, those on the front marked."""
    front = pareto([point.ms.median for point in points], [point.errors.relative_rmse for point in points])
    return [replace(point, front=on) for point, on in zip(points, front, strict=True)]


def cheapest(points: Iterable[Point], max_error: float) -> Point:
    """Return the fastest point whose relative RMSE is at most `max_error`.

    Raises
    ------
    LimitError : none holds it
    """
    points = list(points)
    good = [point for point in points if point.errors.relative_rmse <= max_error]
    if good:
        return min(good, key=lambda point: point.ms.median)
    least = min(points, key=lambda point: (not math.isfinite(point.errors.relative_rmse), point.errors.relative_rmse))
    raise LimitError(
        f"--max-error {max_error:g}: none of {len(points)} points holds it; the least relative RMSE is "
        f"{least.errors.relative_rmse:.3g}, of {least.name}; allow as much, or sweep more with --full"
    )


def levels_of_quality(points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return, for each quality level, its point and the cheapest one of the front that is no farther off.

    A level whose point was not swept has none.
    """
    found = []
    for level in get_args(Quality):
        settings = {"atlas": ATLAS_OF_QUALITY[level], "terms": TERMS_OF_QUALITY[level]}
        own = next((p for p in points if p.method == "lattice" and dict(p.settings) == settings), None)
        entry: dict[str, Any] = {"level": level, **settings, "supersample": SUPERSAMPLE_OF_QUALITY[level]}
        entry |= {"point": None, "ms": None, "relative_rmse": None, "front": None, "better": None}
        if own is not None:
            cheaper = [p for p in points if p.front and p.ms.median < own.ms.median]
            better = [p for p in cheaper if p.errors.relative_rmse <= own.errors.relative_rmse]
            entry |= {"point": own.name, "ms": own.ms.median, "relative_rmse": own.errors.relative_rmse}
            entry |= {"front": own.front, "better": min(better, key=lambda p: p.ms.median).name if better else None}
        found.append(entry)
    return found


def grid(full: bool) -> list[tuple[str, Settings]]:
    """Return what the picture's sweep runs: method and settings.

    By default every method as draft has it, those of COARSE on an atlas of half the side, too, the lattice with other
    numbers of Gaussians, and as standard has it; `full` is every method with all numbers of Gaussians and the atlas of
    every level.
    """
    draft = {"atlas": ATLAS_OF_QUALITY["draft"], "terms": TERMS_OF_QUALITY["draft"]}
    standard = {"atlas": ATLAS_OF_QUALITY["standard"], "terms": TERMS_OF_QUALITY["standard"]}
    coarse = draft["atlas"] // 2
    sizes: list[int] = [coarse, draft["atlas"]]
    counts: list[int] = [draft["terms"]]
    others = [terms for terms in range(1, standard["terms"] + 1) if terms != draft["terms"]]
    rest: list[tuple[str, Settings]] = [("lattice", {**draft, "terms": terms}) for terms in others]
    rest.append(("lattice", standard))
    if full:
        sizes = sorted({*sizes, *ATLAS_OF_QUALITY.values()})
        counts = list(range(1, REFERENCE_TERMS + 1))
        rest = []
    found: list[tuple[str, Settings]] = []
    for method, size in itertools.product(METHODS, sizes):
        if size == coarse and method not in COARSE and not full:
            continue
        if method in WITHOUT_TERMS:
            found.append((method, {"atlas": size}))
        else:
            found += [(method, {"atlas": size, "terms": terms}) for terms in counts]
    return found + rest


@dataclass(frozen=True)
class Shown:
    """Pictures for a person: what a display shows of a point, and where it is off.

    Parameters
    ----------
    display : (h, w, 4) display-linear, straight alpha
    error : (h, w) absolute error, mean over the channels, in the picture's unit
    """

    display: NDArray[np.float32]
    error: NDArray[np.float32]


@dataclass
class Found:
    """What a sweep found.

    Parameters
    ----------
    scene : the reference's settings and the picture, for a person and for `compare`
    points : of all stages
    shown : pictures by the point's name; "exact" is the reference
    levels : see `levels_of_quality`
    notes : what a reader has to know, by stage
    chosen : what --max-error picked and how it was verified; None without it
    """

    scene: dict[str, Any]
    points: list[Point] = field(default_factory=list)
    shown: dict[str, Shown] = field(default_factory=dict)
    levels: list[dict[str, Any]] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    chosen: dict[str, Any] | None = None

    def entry(self) -> dict[str, Any]:
        """Return the JSON form, without pictures."""
        return {
            "scene": self.scene,
            "points": [point.entry() for point in self.points],
            "levels": self.levels,
            "notes": self.notes,
            "chosen": self.chosen,
        }


class Sweep:
    """A scene rendered with many settings.

    The mesh stands still, its maps are made once and lights and camera move: everything from the light on the atlas to
    the picture is computed in every timed frame.

    Parameters
    ----------
    make : returns the scene with settings, as --set has them
    full : sweep every method with every setting
    """

    def __init__(self, make: Make, full: bool = False) -> None:
        self.make = make
        self.full = full
        self.mesh: Mesh = load_scene_mesh(make())
        self.store = Store(MEMO)
        self._numbers = itertools.count(1)
        self._paper: Pipeline | None = None
        self._paper_ms: list[float] = []

    def pipeline(self, *sets: str, exact: SeenTexels | None = None, store: Store | None = None) -> Pipeline:
        """Return the scene in `shading: physical`, one sample a pixel, with settings."""
        loaded = self.make("render.shading=physical", "render.supersample=1", *sets)
        return Pipeline(loaded, self.mesh, store or self.store, exact=exact, single=True)

    # -- the clock -----------------------------------------------------------------------------------------------

    def time_paper(self) -> None:
        """Time another frame of `shading: paper --no-skip`."""
        if self._paper is None:
            loaded = self.make("render.diffusion={}", "render.shading=paper")
            self._paper = Pipeline(loaded, self.mesh, Store(MEMO), skip=False)
        # A frame that is not timed fetches the memory anew.
        self._paper.run(["beauty"])
        start = time.perf_counter()
        self._paper.run(["beauty"])
        self._paper_ms.append((time.perf_counter() - start) * 1000)
        self._paper.graph.store.clear()

    def times(self, pipeline: Pipeline, lights: bool = True) -> Spread:
        """Return the times of whole frames, read-back included, after lights (if they are to) and camera have moved."""
        times = []
        with self._moving(pipeline, lights) as move:
            for _ in range(ROUNDS):
                move()
                start = time.perf_counter()
                pipeline.run(["beauty"])
                times.append((time.perf_counter() - start) * 1000)
        return Spread.of(times)

    def node_times(self, pipeline: Pipeline) -> dict[str, float]:
        """Return ms by node of a frame in which everything ran; to time nodes holds up the frame."""
        with self._moving(pipeline, lights=True) as move:
            move()
            pipeline.run(["beauty"], timing=True)
            return {report.name: report.ms for report in pipeline.reports if report.ms is not None}

    @contextmanager
    def _moving(self, pipeline: Pipeline, lights: bool) -> Iterator[Callable[[], None]]:
        """Give what moves camera and lights a little; put them back at the end.

        Pipelines share the memo, so no two frames of a sweep are alike.
        """
        camera = pipeline.scene.camera or frame_camera(pipeline.mesh, pipeline.size)
        lit = pipeline.graph.nodes["irradiance"]
        assert isinstance(lit, Pass)

        def move() -> None:
            number = next(self._numbers)
            pipeline.look_from(turned(camera, STEP * (number % 7 + 1) + 1e-5 * number))
            if lights:
                values = []
                for draw in lit.draws:
                    assert isinstance(draw.values, IrradianceValues)
                    factor = 1 + 1e-5 * number
                    ambient = tuple(factor * c + 1e-9 * number for c in draw.values.ambient)
                    values.append(replace(draw.values.brighter(factor), ambient=ambient))
                pipeline.graph.update([lit.with_values(values)])

        yield move
        pipeline.look_from(camera)
        pipeline.graph.update([lit])

    # -- the picture and its diffusion ---------------------------------------------------------------------------

    def run(self, max_error: float | None = None) -> Found:
        """Sweep the picture and its stages.

        Parameters
        ----------
        max_error : relative RMSE for which the cheapest point is picked and verified

        Raises
        ------
        LimitError : no point is that near to the reference
        SkincliError : the point that was picked does not hold it when rendered anew
        """
        if max_error is not None and not max_error > 0:
            raise UsageError(f"--max-error {max_error:g}: a relative error above 0 is meant; write for example 0.01")
        points = grid(self.full)
        finest = max(int(settings["atlas"]) for _, settings in points)
        reference = Reference(self, finest)
        free(self.store, but_dear=True)
        size = self.make().scene.render.size
        found = Found(
            {
                "triangles": len(self.mesh.faces),
                "size": [size[0], size[1]],
                "reference": f"exact, atlas {finest}, terms {REFERENCE_TERMS}",
                "pixels": int(reference.mask.sum()),
                "part_pixels": len(reference.part[0]),
                "rounds": ROUNDS,
            }
        )
        found.shown["exact"] = Shown(reference.display, np.zeros(reference.mask.shape, dtype=np.float32))
        pictures, stages = [], []
        side = 0
        for number, (method, settings) in enumerate(sorted(points, key=lambda point: (point[1]["atlas"], point[0]))):
            # Spread over the sweep, since what else the machine does changes.
            if number % math.ceil(len(points) / ROUNDS) == 0:
                self.time_paper()
            if settings["atlas"] != side:
                # Points of one atlas share what its textures hold.
                side = int(settings["atlas"])
                free(self.store, but_dear=True)
            picture, stage, shown = self._measure(reference, method, settings)
            pictures.append(picture)
            stages += [stage] if stage is not None else []
            found.shown[picture.name] = shown
        free(self.store, but_dear=True)
        found.points = [*marked(pictures), *marked(stages), *self._supersampling()]
        free(self.store, but_dear=True)
        found.notes["picture"] = (
            f"the frame when lights and camera move, against {found.scene['reference']}, all at one sample a pixel; "
            f"an atlas of {finest} has no sampling error to be seen, since the reference has it too"
        )
        found.notes["diffusion"] = "its nodes' time; the light on the atlas against the exact one on the same texels"
        found.notes["supersampling"] = "the frame when the camera moves, against 4 samples a side of a pixel"
        try:
            found.points += self._occlusion()
            found.notes["occlusion"] = (
                "its nodes' time, against the traced, cosine-weighted share of open rays as long as the radius: "
                "another quantity than the screen's share of open samples in a ball, so no setting can reach 0"
            )
        except DeviceError as problem:
            found.notes["occlusion"] = f"not measured: {problem}"
        paper = float(np.median(self._paper_ms))
        found.scene["paper_ms"] = round(paper, 3)
        found.points = [replace(point, to_paper=round(point.ms.median / paper, 4)) for point in found.points]
        pictures = [point for point in found.points if point.stage == "picture"]
        found.levels = levels_of_quality(pictures)
        # What follows is rendered anew, and needs the memory.
        free(self.store)
        if max_error is not None:
            found.chosen = self._verified(reference, cheapest(pictures, max_error), max_error)
        return found

    def _measure(self, reference: Reference, method: str, settings: Settings) -> tuple[Point, Point | None, Shown]:
        """Return a method's point of the picture and, where it works in the atlas, of the diffusion alone."""
        pipeline = self.pipeline(*_sets(method, settings))
        shown, picture = reference.errors(pipeline)
        in_atlas, filtered, sampled = reference.told_apart(pipeline, int(settings["atlas"]))
        point = Point("picture", method, settings, self.times(pipeline), picture, filtered, sampled)
        if in_atlas is None:
            return point, None, shown
        nodes = self.node_times(pipeline)
        own = sum(value for name, value in nodes.items() if name.startswith(("incoming", "diffused", "coverage")))
        return point, Point("diffusion", method, settings, Spread.of([own]), in_atlas), shown

    def _verified(self, reference: Reference, point: Point, max_error: float) -> dict[str, Any]:
        """Render a point anew, without what is remembered, and hold it against the reference and the clock again."""
        pipeline = self.pipeline(*_sets(point.method, point.settings), store=Store(MEMO))
        _, errors = reference.errors(pipeline)
        ms = self.times(pipeline)
        free(pipeline.graph.store)
        if not errors.relative_rmse <= max_error:
            raise SkincliError(
                f"--max-error {max_error:g}: {point.name} had a relative RMSE of {point.errors.relative_rmse:.3g}, but "
                f"{errors.relative_rmse:.3g} when rendered anew; the same scene must give the same picture, so this is "
                "a fault of the driver or of skincli: please report it"
            )
        sets = _sets(point.method, point.settings)
        return {"max_error": max_error, "point": point.name, "sets": sets, "ms": asdict(ms), "errors": asdict(errors)}

    # -- other stages --------------------------------------------------------------------------------------------

    def _supersampling(self) -> list[Point]:
        """Sweep the samples a pixel; the atlas keeps its light."""
        draft = _sets("lattice", {"atlas": ATLAS_OF_QUALITY["draft"] // 2, "terms": TERMS_OF_QUALITY["draft"]})

        def rendered(samples: int) -> tuple[Pipeline, dict[str, NDArray[np.float32]]]:
            pipeline = self.pipeline(*draft, f"render.supersample={samples}")
            return pipeline, pipeline.run(["beauty", "depth"])

        best = rendered(4)[1]
        free(self.store, but_dear=True)
        inside = best["depth"][..., 0] > 0
        points = []
        for samples in (1, 2, 3):
            pipeline, picture = rendered(samples)
            ms = self.times(pipeline, lights=False)
            free(self.store, but_dear=True)
            errors = Errors.of(picture["beauty"][..., :3], best["beauty"][..., :3], inside)
            points.append(Point("supersampling", "box", {"samples": samples}, ms, errors))
        return marked(points)

    def _occlusion(self) -> list[Point]:
        """Sweep bands, sample sets and their counts against rays."""
        pipeline = self.pipeline(f"render.atlas={ATLAS_OF_QUALITY['draft'] // 2}")
        seen = _read(pipeline, Ref("view", "depth"), Ref("view", "normal"), Ref("view", "frame_n"))
        depth, normal, smooth = seen[0][..., 0], seen[1][..., :3], seen[2][..., :3]
        at = _part(depth > 0, TRACED_POINTS)
        view = pipeline.view
        axes = np.array([view.right, view.up, view.forward])
        position = camera_position(pipeline.size, view.tan_half, depth)[at] @ axes + np.array(view.eye)
        occlusion = pipeline.scene.render.occlusion
        points = []
        for band, radius in (("high", occlusion.radius_high), ("low", occlusion.radius_low)):
            sides = smooth[at] / np.maximum(np.linalg.norm(smooth[at], axis=1, keepdims=True), 1e-12)
            traced = occlusion_at(self.mesh, position, normal[at], reach=radius, rays=TRACED_RAYS, sides=sides)
            name = f"occlusion_{band}"
            node = pipeline.graph.nodes[f"{name}_samples"]
            assert isinstance(node, Pass)
            values = node.draws[0].values
            assert isinstance(values, BandValues)
            usual = values.count
            counts = (4, 8, 16, 28, 48, 64) if self.full else sorted({usual // 2, usual, 64})
            for hemisphere, count in itertools.product((1, 0), counts):
                samples = sample_set(count, bool(hemisphere))
                changed = replace(values, count=count, hemisphere=hemisphere, samples=samples)
                pipeline.graph.update([node.with_values([changed])])
                found = _read(pipeline, Ref(name, "blurred"))[0][..., 0][at]
                times = []
                with self._moving(pipeline, lights=False) as move:
                    for _ in range(ROUNDS):
                        move()
                        # The camera's values put the usual samples back.
                        pipeline.graph.update([node.with_values([changed])])
                        pipeline.graph.run([Ref(name, "blurred")], timing=True)
                        reports = pipeline.reports
                        times.append(sum(r.ms for r in reports if r.ms is not None and r.name.startswith(name)))
                ms = Spread.of(times)
                settings: Settings = {"band": band, "samples": count}
                method = "hemisphere" if hemisphere else "sphere"
                errors = Errors.of(found[:, None], traced[:, None])
                points.append(Point("occlusion", method, settings, ms, errors))
        # Each band answers another question: it has a front of its own.
        return [p for band in ("high", "low") for p in marked([q for q in points if q.settings["band"] == band])]


class Reference:
    """The exact picture, and what tells the errors of a method from those of the atlas.

    Parameters
    ----------
    sweep : the scene
    finest : side of the atlas that the picture is made with, texels
    """

    def __init__(self, sweep: Sweep, finest: int) -> None:
        self._sweep = sweep
        # What the camera sees depends on no method.
        plain = sweep.pipeline(*_sets("none", {"atlas": finest}))
        depth, uv = _read(plain, Ref("view", "depth"), Ref("view", "uv"))
        self.mask = depth[..., 0] > 0
        if not self.mask.any():
            raise SkincliError("the camera sees nothing of the mesh, so there is no picture to measure; turn it")
        self.part = _part(self.mask, PART_PIXELS)
        self._uv = uv[..., 2:]
        exact = self._exact(finest, self.mask)
        self.beauty, self.display = self._rendered(exact)
        self._atlas = {finest: self._kept(exact, finest)}

    def _exact(self, size: int, pixels: Any) -> Pipeline:
        seen = SeenTexels(self._uv[pixels], size)
        return self._sweep.pipeline(*_sets("exact", {"atlas": size, "terms": REFERENCE_TERMS}), exact=seen)

    def _kept(self, exact: Pipeline, size: int) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return what an exact pipeline gives at some pixels, on the atlas, and which texels those pixels read."""
        beauty, _ = self._rendered(exact)
        seen = SeenTexels(self._uv[self.part], size).read.reshape(size, size)[::-1]
        light, owner = _read(exact, Ref("diffused", "blurred"), Ref("atlas", "position"))
        # A copy, since a part of an array holds all of it.
        return beauty[self.part], light[..., :3].copy(), seen & (owner[..., 3] > 0)

    @staticmethod
    def _rendered(pipeline: Pipeline) -> tuple[Array, NDArray[np.float32]]:
        arrays = pipeline.run(["beauty"], display=True)
        return arrays["beauty"].astype(np.float64)[..., :3], arrays["display"]

    def errors(self, pipeline: Pipeline) -> tuple[Shown, Errors]:
        """Render a picture and hold it against the reference."""
        beauty, display = self._rendered(pipeline)
        found = Errors.of(beauty, self.beauty, self.mask)
        seen = np.nan_to_num(display[..., :3] * display[..., 3:])
        flip, _ = metrics.flip(seen, self.display[..., :3] * self.display[..., 3:], self.mask)
        error = np.abs(np.nan_to_num(beauty) - self.beauty).mean(axis=-1) * self.mask
        return Shown(display, error.astype(np.float32)), replace(found, flip=flip)

    def told_apart(self, pipeline: Pipeline, size: int) -> tuple[Errors | None, float, float]:
        """Return the error in the atlas (None where the method does not work there), of the filter, and of the atlas.

        The last two are relative RMSE of the picture, over some of the pixels.
        """
        if size not in self._atlas:
            self._atlas[size] = self._kept(self._exact(size, self.part), size)
        beauty, light, seen = self._atlas[size]
        found = self._rendered(pipeline)[0][self.part]
        filtered = metrics.relative_rmse(found, beauty)
        sampled = metrics.relative_rmse(beauty, self.beauty[self.part])
        diffused = _read(pipeline, Ref("diffused", "blurred"))[0]
        if diffused.shape[:2] != light.shape[:2] or pipeline.graph.nodes["diffused"].size != (size, size):
            return None, filtered, sampled
        return Errors.of(diffused[..., :3], light, seen), filtered, sampled


def _sets(method: str, settings: Settings) -> list[str]:
    """Return a point as --set has it."""
    terms = f", terms: {settings['terms']}" if "terms" in settings else ""
    return [f"render.atlas={settings['atlas']}", f"render.diffusion={{method: {method}{terms}}}"]


def _read(pipeline: Pipeline, *refs: Ref) -> list[Array]:
    found = pipeline.graph.run(list(refs))
    return [read_back(found[ref]).astype(np.float64) for ref in refs]


def _part(mask: NDArray[np.bool_], most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns of at most about `most` pixels of a mask, spread evenly over it."""
    rows, columns = np.nonzero(mask)
    step = max(1, math.ceil(math.sqrt(len(rows) / most)))
    keep = (rows % step == step // 2) & (columns % step == step // 2)
    if not keep.any():
        keep[:] = True
    return rows[keep], columns[keep]
