"""The frame graph: wired once, pulled by the outputs that are wanted, culled, memoised, replayed.

Vocabulary and idea of culling by what is read: Filament's FrameGraph; content keys: Gaffer's compute nodes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from skincli.errors import Fault, SkincliError
from skincli.gpu import textures
from skincli.gpu.draw import DrawCall, bind_target, timed
from skincli.gpu.textures import Texture
from skincli.graph.node import ZERO, Constant, Draw, Load, Node, Pass, Ref, Source
from skincli.graph.store import Store


@dataclass
class NodeReport:
    """What became of one node in one frame.

    Parameters
    ----------
    state : "ran", "reused" or "skipped"
    reason : why
    ms : time of its draws, None where it was not measured
    key : hex digest over the outputs that were needed
    bytes : size of those outputs
    """

    name: str
    state: str
    reason: str
    size: tuple[int, int]
    ms: float | None = None
    key: str = ""
    bytes: int = 0


@dataclass
class _Step:
    """A node and the outputs of it that some target depends on."""

    node: Node
    outputs: tuple[str, ...]
    depends: dict[str, tuple[Ref, ...]]
    keys: dict[str, str] = field(default_factory=dict)


class FrameGraph:
    """A set of nodes wired by name.

    Parameters
    ----------
    nodes : unique names
    store : memo shared with other graphs of the process, or None for one of its own
    skip : False runs every node of the graph in every frame and remembers nothing

    Raises
    ------
    ValueError : two nodes of one name, or an input wired to nothing; names all of them
    """

    def __init__(self, nodes: Iterable[Node], store: Store | None = None, skip: bool = True) -> None:
        self.nodes: dict[str, Node] = {}
        faults = []
        for node in nodes:
            if node.name in self.nodes:
                faults.append(f"two nodes are called '{node.name}'")
            self.nodes[node.name] = node
        for node in self.nodes.values():
            for source in self._all_sources(node):
                if isinstance(source, Ref) and source.output not in getattr(self.nodes.get(source.node), "outputs", {}):
                    faults.append(f"'{node.name}' reads '{source.node}.{source.output}', which no node writes")
        if faults:
            raise ValueError("; ".join(faults))
        self.store = store or Store()
        self.skip = skip
        self._ran: dict[str, NodeReport] = {}
        self._clocks: dict[str, Callable[[], float]] = {}
        self._wanted: set[Source] = set()
        self._keys: dict[Ref, str] = {}
        self._dirty: set[str] = set()
        self._shapes = {name: self._shape_of(node) for name, node in self.nodes.items()}
        self._targets: tuple[Ref, ...] | None = None
        self._steps: list[_Step] = []
        self._resolved: dict[Ref, Source] = {}
        self._calls: dict[tuple[str, tuple[str, ...]], list[DrawCall]] = {}

    @staticmethod
    def _all_sources(node: Node) -> list[Source]:
        if isinstance(node, Pass):
            return [*node.wired.values(), *(source for draw in node.draws for source in draw.inputs.values())]
        return []

    # -- compile -------------------------------------------------------------------------------------------------

    def _resolve(self, source: Source) -> Source:
        """Follow shortcuts to the node that does the work, or to a constant."""
        while isinstance(source, Ref) and self.skip:
            way = self.nodes[source.node].shortcut(source.output)
            if way is None:
                break
            source = way[0]
        return source

    def _shape_of(self, node: Node) -> object:
        """Everything about a node's present values that decides how the graph is wired around it."""
        if not self.skip:
            return None
        return tuple((output, node.shortcut(output)) for output in node.outputs), tuple(sorted(node.ignores()))

    def _source(self, node: Pass, draw: Draw, name: str) -> Source:
        """Return what feeds an input of a draw: resolved, or as wired where nothing is skipped."""
        return self._resolve(node.source(draw, name) if self.skip else node.wired_source(draw, name))

    def _sources(self, node: Node, output: str) -> list[Source]:
        """Return what an output depends on, in a fixed order."""
        if not isinstance(node, Pass):
            return []
        needed = node.needed_inputs(output)
        return [self._source(node, draw, name) for draw in node.draws for name in needed]

    def _compile(self, targets: tuple[Ref, ...]) -> None:
        """Work out the order of the nodes that the targets need."""
        needed: dict[str, dict[str, tuple[Ref, ...]]] = {}
        path: list[str] = []

        def visit(ref: Ref) -> None:
            if ref.node in path:
                raise ValueError("a cycle of nodes: " + " <- ".join([*path[path.index(ref.node) :], ref.node]))
            outputs = needed.setdefault(ref.node, {})
            if ref.output in outputs:
                return
            node = self.nodes[ref.node]
            sources = self._sources(node, ref.output)
            refs = tuple(dict.fromkeys(source for source in sources if isinstance(source, Ref)))
            path.append(ref.node)
            for child in refs:
                visit(child)
            path.pop()
            outputs[ref.output] = refs

        for target in targets:
            source = self._resolve(target)
            self._resolved[target] = source
            if isinstance(source, Ref):
                visit(source)
        # Only now is it known what all needed outputs of a node depend on: sort the nodes by dependence.
        done: list[str] = []

        def place(name: str) -> None:
            if name in done:
                return
            for refs in needed[name].values():
                for ref in refs:
                    place(ref.node)
            done.append(name)

        for name in needed:
            place(name)
        self._steps = [_Step(self.nodes[name], tuple(needed[name]), needed[name]) for name in done]
        self._keys.clear()
        self._targets = targets

    def _make_keys(self) -> None:
        """Chain the content keys from the sources to the targets; what no change reaches keeps its keys."""
        renewed: set[Ref] = set()
        for step in self._steps:
            name = step.node.name
            for output in step.outputs:
                ref = Ref(name, output)
                if ref in self._keys and name not in self._dirty and renewed.isdisjoint(step.depends[output]):
                    continue
                digest = hashlib.blake2b(step.node.own_digest(output), digest_size=16)
                for source in self._sources(step.node, output):
                    digest.update((self._keys[source] if isinstance(source, Ref) else repr(source.value)).encode())
                step.keys[output] = self._keys[ref] = digest.hexdigest()
                renewed.add(ref)
        self._dirty.clear()

    def update(self, nodes: Iterable[Node]) -> None:
        """Replace nodes by others of the same name, shader and wiring whose values differ (a later frame).

        Only where a value makes a node needless, or needed again, is the graph compiled anew.
        """
        for node in nodes:
            self.nodes[node.name] = node
            self._dirty.add(node.name)
            shape = self._shape_of(node)
            if shape != self._shapes[node.name]:
                self._shapes[node.name] = shape
                self._targets = None
        for step in self._steps:
            step.node = self.nodes[step.node.name]

    # -- run -----------------------------------------------------------------------------------------------------

    def run(self, targets: Sequence[Ref], timing: bool = False, check: bool = False) -> dict[Ref, Texture]:
        """Compute what the targets need and is not known yet.

        Parameters
        ----------
        targets : outputs that are wanted
        timing : measure each node (timer queries on a GPU, waiting for the driver on software GL)
        check : read every result back and look for NaN and Inf

        Returns
        -------
        texture of each target; valid until the next run

        Raises
        ------
        SkincliError : `check` found something; names node, output, count and first pixel of each
        """
        wanted_targets = tuple(targets)
        if not self.skip:
            everything = [Ref(node.name, output) for node in self.nodes.values() for output in node.outputs]
            wanted_targets = tuple(dict.fromkeys([*targets, *everything]))
            self.store.clear()
        if wanted_targets != self._targets:
            self._compile(wanted_targets)
        self._make_keys()

        missing = self._missing(wanted_targets)
        pins = self._pins(missing, targets)
        why = "first asked for, or something it reads has changed" if self.skip else "nothing is skipped"
        self._ran, self._clocks = {}, {}
        faults = []
        for position, (step, outputs) in enumerate(missing):
            used = {key for key, last in pins.items() if last >= position}
            self.store.evict(used, [] if isinstance(step.node, Load) else _shapes(step.node, outputs))
            clock = self._execute(step, outputs, timing)
            self._ran[step.node.name] = self._report(step, outputs, "ran", why)
            if clock is not None:
                self._clocks[step.node.name] = clock
            if check:
                found = [_unfinite(f"{step.node.name}.{name}", self.store.get(step.keys[name])) for name in outputs]
                faults += [Fault(fault) for fault in found if fault is not None]
        self.store.evict({key for key, last in pins.items() if last >= len(missing)})
        if faults:
            raise SkincliError(faults)
        results = {}
        for target in targets:
            source = self._resolved[target]
            results[target] = (
                self.store.get(self._keys[source]) if isinstance(source, Ref) else textures.constant(source.value)
            )
        return results

    def _missing(self, targets: Sequence[Ref]) -> list[tuple[_Step, tuple[str, ...]]]:
        """Return the steps to run, in order, each with the outputs that are not in the memo."""
        wanted = {self._resolved[target] for target in targets}
        found = []
        for step in reversed(self._steps):
            outputs = tuple(
                output
                for output in step.outputs
                if Ref(step.node.name, output) in wanted and step.keys[output] not in self.store
            )
            if outputs:
                found.append((step, outputs))
                wanted.update(ref for output in outputs for ref in step.depends[output])
        self._wanted = wanted
        return found[::-1]

    def _pins(self, missing: list[tuple[_Step, tuple[str, ...]]], targets: Sequence[Ref]) -> dict[str, int]:
        """Return for each key in use the position of the last step that reads it."""
        pins: dict[str, int] = {}
        for position, (step, outputs) in enumerate(missing):
            for output in outputs:
                for ref in step.depends[output]:
                    pins[self._keys[ref]] = position
                pins.setdefault(step.keys[output], position)
        for target in targets:
            source = self._resolved[target]
            if isinstance(source, Ref):
                pins[self._keys[source]] = len(missing) + 1
        return pins

    def _execute(self, step: _Step, outputs: tuple[str, ...], timing: bool) -> Callable[[], float] | None:
        if timing:
            return timed(lambda: self._draw(step, outputs))
        self._draw(step, outputs)
        return None

    def _draw(self, step: _Step, outputs: tuple[str, ...]) -> None:
        node = step.node
        if isinstance(node, Load):
            upload = textures.upload(node.make(), node.format, node.mipmaps)
            self.store.put(step.keys["image"], upload, pooled=False, dear=True)
            return
        assert isinstance(node, Pass)
        calls = self._prepare(node, outputs)
        targets = [self.store.pool.acquire(shape) for shape in _shapes(node, outputs)]
        bind_target(self.store.pool, targets, node.additive, node.depth)
        needed = {name for output in outputs for name in node.needed_inputs(output)}
        for call, draw in zip(calls, node.draws, strict=True):
            call(draw.values.packed, [self._texture(node, draw, name, needed) for name in call.reads])
        for name, target in zip(outputs, targets, strict=True):
            if target.mipmaps:
                target.handle.build_mipmaps()
            self.store.put(step.keys[name], target, dear=node.dear)

    def _texture(self, node: Pass, draw: Draw, name: str, needed: set[str]) -> Texture:
        """Return what a draw reads as `name`: a constant where the outputs at hand do not depend on it."""
        source = self._source(node, draw, name) if name in needed else ZERO
        if isinstance(source, Constant):
            return textures.constant(source.value)
        return self.store.get(self._keys[source])

    def _prepare(self, node: Pass, outputs: tuple[str, ...]) -> list[DrawCall]:
        key = (node.name, outputs)
        if key not in self._calls:
            samplers = [(name, texture.filter, texture.repeat) for name, texture in node.inputs.items()]
            self._calls[key] = [
                DrawCall(
                    node.text(draw, outputs),
                    draw.values.layout,
                    samplers,
                    node.geometry,
                    draw.topology,
                    draw.part,
                    draw.points,
                )
                for draw in node.draws
            ]
        return self._calls[key]

    # -- account -------------------------------------------------------------------------------------------------

    def _report(self, step: _Step, outputs: Sequence[str], state: str, reason: str) -> NodeReport:
        key = "".join(step.keys[output] for output in outputs)
        if len(outputs) > 1:
            key = hashlib.blake2b(key.encode(), digest_size=16).hexdigest()
        held = [self.store.get(step.keys[output]) for output in outputs if step.keys[output] in self.store]
        size = held[0].size if held else step.node.size
        return NodeReport(step.node.name, state, reason, size, None, key, sum(texture.bytes for texture in held))

    @property
    def reports(self) -> list[NodeReport]:
        """What became of every node in the last run, in the order in which the light travels."""
        steps = {step.node.name: step for step in self._steps}
        asked = self._asked()
        reports = []
        for node in self.nodes.values():
            if node.name in self._ran:
                clock = self._clocks.get(node.name)
                reports.append(replace(self._ran[node.name], ms=clock() if clock else None))
                continue
            step = steps.get(node.name)
            if step is not None and any(Ref(node.name, output) in self._wanted for output in step.outputs):
                reports.append(self._report(step, step.outputs, "reused", "same key as before"))
            elif step is not None:
                reports.append(self._report(step, (), "reused", "what reads it is known already"))
            else:
                reason = self._why_skipped(node, asked) or "no output that is asked for needs it"
                reports.append(NodeReport(node.name, "skipped", reason, node.size))
        return reports

    def _why_skipped(self, node: Node, asked: Collection[str]) -> str | None:
        """Return the value that made a node needless: its own, or that of what would read it.

        Parameters
        ----------
        asked : the nodes that the targets would need if no value made any needless
        """
        if node.name not in asked:
            return None
        for output in node.outputs:
            way = node.shortcut(output)
            if way is not None:
                return way[1]
        for name in asked:
            consumer = self.nodes[name]
            read = [source for source in self._raw_inputs(consumer) if source[1].node == node.name]
            ignored = consumer.ignores()
            reason = next((ignored[sampler][1] for sampler, _ in read if sampler in ignored), None)
            if read and reason is None:
                reason = self._why_skipped(consumer, asked)
            if reason is not None:
                return reason
        return None

    def _raw_inputs(self, node: Node) -> list[tuple[str, Ref]]:
        """Return the inputs as wired, whatever the present values make of them."""
        if not isinstance(node, Pass):
            return []
        wired = [(name, node.wired_source(draw, name)) for draw in node.draws for name in node.inputs]
        return [(name, source) for name, source in wired if isinstance(source, Ref)]

    def _asked(self) -> set[str]:
        """Return the nodes that the targets would need if no value made any needless."""
        found: set[str] = set()
        pending = [target.node for target in self._targets or ()]
        while pending:
            name = pending.pop()
            if name not in found:
                found.add(name)
                pending += [source.node for _, source in self._raw_inputs(self.nodes[name])]
        return found


def _unfinite(name: str, texture: Texture) -> str | None:
    """Return a sentence about the values of a texture that are NaN or Inf, or None."""
    bad = ~np.isfinite(textures.read_back(texture)).all(axis=-1)
    if not bad.any():
        return None
    row, column = np.argwhere(bad)[0]
    return f"{name}: {int(bad.sum())} pixels are not finite, the first at column {column}, row {row}"


def _shapes(node: Node, outputs: Sequence[str]) -> list[textures.Shape]:
    """Return what some outputs of a node are drawn into."""
    return [(node.size, node.outputs[name].format, node.outputs[name].mipmaps) for name in outputs]
