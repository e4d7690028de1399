"""Every stage of the pipeline against its float64 twin, both fed the same stored inputs."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skincli import metrics
from skincli.bench.scene import STAGE_SCENE, load, ring
from skincli.color import neutral_display
from skincli.gpu.textures import read_back
from skincli.graph.frame_graph import FrameGraph
from skincli.graph.node import ZERO, Constant, Load, Node, Pass, Ref
from skincli.passes import (
    absorb,
    atlas,
    blur,
    combine,
    compose,
    display,
    irradiance,
    lattice,
    occlusion,
    occlusion_band,
    reflection,
    slope,
    specular,
    view,
)
from skincli.pipeline import Pipeline

Array = NDArray[np.float64]

SHADINGS = ("physical", "paper")

#: allowed error of a float32 and of a half target, as a share of the stage's scale
FULL_TOLERANCE, HALF_TOLERANCE = 1e-4, 2e-3

#: the scale of a stage is the 99th percentile of its twin, or this where it is darker
LEAST_SCALE = 1e-3

#: where depths are compared, a sample may fall on the other side of an edge: share of pixels, RMS as a share of scale
DEPTH_SHARE, DEPTH_RMS = 1e-3, 5e-4


class Stored:
    """All that one frame of a graph stored, top row first.

    Parameters
    ----------
    graph : made with skip=False, so that every node runs

    Attributes
    ----------
    arrays : (h, w, c) float32 by node and output
    """

    def __init__(self, graph: FrameGraph) -> None:
        self._nodes = graph.nodes
        refs = [Ref(node.name, output) for node in self._nodes.values() for output in node.outputs]
        self.arrays = {ref: read_back(texture) for ref, texture in graph.run(refs).items()}

    def output(self, node: Pass, name: str) -> Array:
        """Return (h, w, c) float64 what a node wrote."""
        return self.arrays[Ref(node.name, name)].astype(np.float64)

    def input(self, node: Pass, name: str, draw: int = 0) -> Array:
        """Return (h, w, c) what the first draw of a node reads, or another; a constant is (1, 1, 4)."""
        source = node.draws[draw].inputs.get(name, node.wired.get(name, ZERO))
        if isinstance(source, Constant):
            return np.array(source.value).reshape(1, 1, 4)
        return self.arrays[source].astype(np.float64)

    def node(self, name: str) -> Pass:
        """Return the pass of that name."""
        found = self._nodes[name]
        assert isinstance(found, Pass)
        return found

    def levels(self, node: Pass, name: str) -> list[Array]:
        """Return the mip levels of a loaded image that a node reads, as uploaded; a constant has one."""
        source = node.wired[name]
        if isinstance(source, Constant):
            return [self.input(node, name)]
        load = self._nodes[source.node]
        assert isinstance(load, Load)
        return [level.astype(np.float32).astype(np.float64) for level in load.make()]


def _slope(node: Pass, stored: Stored) -> Array:
    return slope.twin(stored.input(node, "height")[..., 0])


def _bump(node: Pass, stored: Stored) -> Array:
    along_u, along_v = stored.output(node, "frame_u"), stored.output(node, "frame_v")
    dh = np.stack([along_u[..., 3], along_v[..., 3]], axis=-1)
    return atlas.twin(stored.output(node, "frame_n")[..., :3], along_u[..., :3], along_v[..., :3], dh)


def _lighting(node: Pass, stored: Stored) -> Array:
    position, normal = stored.input(node, "position"), stored.input(node, "normal")
    return irradiance.twin(_values(node), position, normal[..., :3])


def _blur(node: Pass, stored: Stored) -> Array:
    image, owner = stored.input(node, "image"), stored.input(node, "owner")
    first, *others = _values(node)
    result = blur.twin(first, image, owner)
    for values in others:
        result = np.where(owner[..., 3:] == values.slot, blur.twin(values, image, owner), result)
    return result


def _absorb(node: Pass, stored: Stored) -> Array:
    return absorb.twin(_values(node)[0], stored.input(node, "image"), stored.input(node, "albedo")[..., :3])


def _lattice(node: Pass, stored: Stored) -> Array:
    assert isinstance(node, lattice.LatticeSlice)
    splat = stored.node(f"{node.name}_0_whole_splat")
    return lattice.twin(
        node.terms,
        stored.input(splat, "image")[..., :3],
        stored.input(node, "position")[..., :3],
        stored.input(node, "normal")[..., :3],
        stored.input(splat, "area")[..., 0],
    )


def _combine(node: Pass, stored: Stored) -> Array:
    image, owner, spread, weights = (stored.input(node, name) for name in ("image", "owner", "spread", "weights"))
    levels = [stored.input(node, name) for name in combine.LEVELS if name in node.wired]
    return combine.twin(_values(node)[0], image, levels, owner, spread, weights[::-1])


def _band(node: Pass, stored: Stored) -> Array:
    return occlusion_band.twin(_values(node)[0], stored.input(node, "depth")[..., 0], stored.input(node, "normal"))


def _equation_1(node: Pass, stored: Stored) -> Array:
    high, low = stored.input(node, "occlusion_high"), stored.input(node, "occlusion_low")
    values = _values(node)[0]
    return occlusion.twin(values.a, values.b, high[..., :1], low[..., :1])


def _specular(node: Pass, stored: Stored) -> Array:
    depth, normal, finish = (stored.input(node, name) for name in ("depth", "normal", "finish"))
    return specular.twin(_values(node), depth[..., 0], normal, finish)


def _reflection(node: Pass, stored: Stored) -> Array:
    depth, reflectance, occluded = (stored.input(node, name)[..., 0] for name in ("depth", "reflectance", "occlusion"))
    levels = stored.levels(node, "environment")
    return reflection.twin(_values(node)[0], depth, stored.input(node, "normal"), reflectance, occluded, levels)


def _equation_2(node: Pass, stored: Stored) -> Array:
    albedo, shine, mirrored = (stored.input(node, name)[..., :3] for name in ("albedo", "specular", "reflection"))
    occluded = stored.input(node, "occlusion")[..., 0]
    return compose.twin(_values(node)[0], stored.output(node, "diffuse"), albedo, occluded, shine, mirrored)


def _display(node: Pass, stored: Stored) -> Array:
    values, beauty = _values(node)[0], stored.input(node, "beauty")
    color = np.maximum(beauty[..., :3] / np.maximum(beauty[..., 3:], 1e-6), 0) * values.gain
    shown = neutral_display(color) if values.neutral else np.minimum(color, 1)
    return np.concatenate([shown, beauty[..., 3:]], axis=-1)


def _values(node: Pass) -> list[Any]:
    return [draw.values for draw in node.draws]


@dataclass(frozen=True)
class Stage:
    """How a pass is held against its twin.

    Parameters
    ----------
    name : what the stage is called
    output : the output that is compared, in as many channels as the twin returns
    twin : called with a node and what was stored
    compares_depth : whether the stage decides by comparing depths, so that single pixels may differ
    """

    name: str
    output: str
    twin: Callable[[Pass, Stored], Array]
    compares_depth: bool = False


STAGES: Mapping[type[Node], Stage] = {
    slope.Slope: Stage("slope", "slope", _slope),
    atlas.Atlas: Stage("bump", "normal", _bump),
    irradiance.Irradiance: Stage("lighting", "irradiance", _lighting),
    absorb.Absorb: Stage("absorption", "absorbed", _absorb),
    lattice.LatticeSlice: Stage("lattice", "sliced", _lattice),
    combine.Combine: Stage("sum of Gaussians", "blurred", _combine),
    blur.Blur: Stage("blur", "blurred", _blur),
    view.View: Stage("bump", "normal", _bump),
    occlusion_band.OcclusionBand: Stage("occlusion band", "occlusion", _band, compares_depth=True),
    occlusion.Occlusion: Stage("Equation 1", "occlusion", _equation_1),
    specular.Specular: Stage("specular", "specular", _specular),
    reflection.Reflection: Stage("reflection", "reflection", _reflection, compares_depth=True),
    compose.Compose: Stage("Equation 2", "beauty", _equation_2),
    display.Display: Stage("display", "displayed", _display),
}


@dataclass(frozen=True)
class StageError:
    """How far a node is from its twin, over the pixels where either holds anything.

    Parameters
    ----------
    format : of the target
    compares_depth : which of the two rules holds
    maximum, rms : absolute
    share : of the pixels in which some channel differs by more than `bound`
    scale : 99th percentile of the twin's absolute color, at least LEAST_SCALE
    bound : tolerance of the format times the scale
    """

    stage: str
    node: str
    shading: str
    format: str
    compares_depth: bool
    maximum: float
    rms: float
    share: float
    scale: float
    bound: float

    @property
    def passed(self) -> bool:
        """Whether the error is allowed; NaN never is."""
        if self.compares_depth:
            return self.share <= DEPTH_SHARE and self.rms <= DEPTH_RMS * self.scale
        return self.maximum <= self.bound

    @property
    def sentence(self) -> str:
        """What is wrong, for a person."""
        allowed = f"at most {self.bound:.2g} is allowed"
        if self.compares_depth:
            allowed += f" but for {DEPTH_SHARE:.1%} of the pixels, with an RMS of {DEPTH_RMS * self.scale:.2g}"
        return (
            f"stage {self.stage} (node {self.node}, {self.shading}) differs from its twin by up to {self.maximum:.3g}, "
            f"RMS {self.rms:.3g}, in {self.share:.2%} of the pixels; {allowed}; "
            f"compare the pass's shader with the twin in its Python file"
        )

    def entry(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {**asdict(self), "passed": self.passed}


def compare(found: Array, expected: Array, *, half: bool) -> dict[str, float]:
    """Return maximum, rms, share, scale and bound of StageError.

    Parameters
    ----------
    found, expected : (h, w, c); a fourth channel is compared but does not enter the scale
    half : whether the target is half floats
    """
    meant = ((found != 0) | (expected != 0)).any(axis=-1)
    if not meant.any():
        return {"maximum": 0.0, "rms": 0.0, "share": 0.0, "scale": LEAST_SCALE, "bound": FULL_TOLERANCE * LEAST_SCALE}
    scale = max(LEAST_SCALE, float(np.percentile(np.abs(expected[meant][:, :3]), 99)))
    bound = (HALF_TOLERANCE if half else FULL_TOLERANCE) * scale
    return {
        "maximum": metrics.max_abs(found, expected, meant),
        "rms": float(np.sqrt(np.mean((found - expected)[meant] ** 2))),
        "share": metrics.share_differing(found, expected, bound, meant),
        "scale": scale,
        "bound": bound,
    }


def compare_stages(shadings: Sequence[str] = SHADINGS) -> list[StageError]:
    """Render the scene of skincli.bench.scene and hold every pass that has a twin against it."""
    errors = []
    for shading in shadings:
        with tempfile.TemporaryDirectory() as folder:
            pipeline = Pipeline(load(Path(folder), STAGE_SCENE, f"render.shading={shading}"), ring(), skip=False)
            stored = Stored(pipeline.graph)
            for node in pipeline.graph.nodes.values():
                stage = STAGES.get(type(node))
                if stage is None:
                    continue
                assert isinstance(node, Pass)
                expected = stage.twin(node, stored)
                found = stored.output(node, stage.output)[..., : expected.shape[-1]]
                format = node.outputs[stage.output].format
                measured = compare(found, expected, half="16f" in format)
                errors.append(StageError(stage.name, node.name, shading, format, stage.compares_depth, **measured))
    return errors
