"""The one grammar by which a value of a scene is named, `--set`, and the loading of a scene with all it refers to."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, get_args

from skincli import files, resources
from skincli.errors import Fault, InputError, UsageError, did_you_mean
from skincli.scene.model import MAX_SIZE, Scene
from skincli.scene.skin import Skin
from skincli.scene.yaml import (
    PLAIN_KEY,
    Document,
    Mark,
    Node,
    Steps,
    check,
    field_at,
    load_file,
    load_text,
    path_text,
    report,
    shorten,
)

(SKIN_VERSION,) = get_args(Skin.model_fields["skin"].annotation)

_STEP = re.compile(
    rf"""(?P<dot>\.?)(?P<key>{PLAIN_KEY.pattern})|\[(?P<index>\d+)\]|\[(?P<q>["'])(?P<quoted>.*?)(?P=q)\]"""
)
_ASSIGNMENT = re.compile(r"""((?:\[(?:"[^"]*"|'[^']*')\]|[^=])*)=(.*)""", re.DOTALL)


def parse(text: str) -> Steps:
    """Return the steps of a path such as `lights[0].angle`, `skin.layers.pores.depth` or `parts["Head.001"].skin`.

    Raises
    ------
    ValueError : the text is no path; the message says what is
    """
    steps: list[str | int] = []
    position = 0
    while position < len(text):
        match = _STEP.match(text, position)
        # A dot stands before every key but the first.
        if match is None or (match["key"] is not None and bool(match["dot"]) != bool(steps)):
            break
        steps.append(int(match["index"]) if match["index"] else match["key"] or match["quoted"])
        position = match.end()
    if not steps or position < len(text) or isinstance(steps[0], int):
        raise ValueError(
            f"'{shorten(text)}' is not a path; write keys and numbers as in camera.fov, lights[0].angle "
            """or parts["Head.001"].skin"""
        )
    return tuple(steps)


def locate(document: Document, path: Steps) -> Steps:
    """Return `path` with layers' names replaced by their numbers, and with the kind that stands between a layer's
    number and its settings: (skin, layers, pores, depth) becomes (skin, layers, 2, pores, depth).

    Raises
    ------
    ValueError : a name that no layer or several have, a number that the list has not, a step into a list or scalar
    """
    found: list[str | int] = []
    node: Node | None = document.root
    for step in path:
        kind = _layer_kind(node) if _is_layer(found) else None
        if kind is not None and step != kind and node is not None:
            found.append(kind)
            node = node.child(kind)
        here = path_text(tuple(found))
        if node is not None and isinstance(node.items, list) and isinstance(step, str):
            step = _named_layer(node, step, here) if found[-1] == "layers" else _no_index(node, step, here)
        if node is not None and isinstance(node.items, list) and isinstance(step, int) and step >= len(node.items):
            raise ValueError(f"{here} has {_count(node)}, so there is no {here}[{step}]")
        if node is not None and node.items is None and node.value is not None:
            raise ValueError(f"{here} is {shorten(node.value)}, so there is nothing below it; set {here} itself")
        if node is not None and isinstance(node.items, dict) and isinstance(step, int):
            raise ValueError(f"{here or 'the scene'} has keys, not numbers; it has: {', '.join(sorted(node.items))}")
        found.append(step)
        node = node.child(step) if node is not None else None
    return tuple(found)


def _is_layer(path: list[str | int]) -> bool:
    return len(path) >= 2 and path[-2] == "layers" and isinstance(path[-1], int)


def _layer_kind(node: Node | None) -> str | None:
    """Return the single key of a layer's mapping."""
    return (
        next(iter(node.items)) if node is not None and isinstance(node.items, dict) and len(node.items) == 1 else None
    )


def _layer_name(node: Node) -> str | None:
    """Return a layer's own name, else its kind."""
    kind = _layer_kind(node)
    settings = node.child(kind) if kind is not None else None
    name = settings.child("name") if settings is not None else None
    return name.value if name is not None and isinstance(name.value, str) else kind


def _named_layer(layers: Node, name: str, here: str) -> int:
    assert isinstance(layers.items, list)
    names = [_layer_name(layer) for layer in layers.items]
    indices = [index for index, other in enumerate(names) if other == name]
    if len(indices) == 1:
        return indices[0]
    if indices:
        choices = " or ".join(f"{here}[{index}]" for index in indices)
        raise ValueError(f"several layers are called '{name}'; write {choices}, or give them names")
    known = [other for other in names if other is not None]
    raise ValueError(f"no layer is called '{name}'{did_you_mean(name, known) or '.'} There are: {', '.join(known)}")


def _no_index(node: Node, step: str, here: str) -> int:
    raise ValueError(f"{here} has {_count(node)}; say which one, as in {here}[0].{step}")


def _count(node: Node) -> str:
    count = len(node.items or ())
    return "no items" if count == 0 else "1 item, [0]" if count == 1 else f"{count} items, [0] to [{count - 1}]"


def set_value(
    document: Document,
    path: str,
    value_text: str,
    label: str,
    default: Callable[[Document, Steps], object] = lambda document, path: None,
) -> Document:
    """Return the document with one value replaced; mappings on the way to it are made where they are missing.

    Parameters
    ----------
    document : is not changed
    path : see `parse` and `locate`
    value_text : YAML
    label : what faults of the value name in place of a file and line, such as "--set camera.fov=190"
    default : gives the list that stands where nothing was written, so that one item of it can be set

    Raises
    ------
    InputError : the value is not YAML, or the path leads nowhere
    UsageError : the path does not follow the grammar
    """
    mark = Mark(label, None, None)
    try:
        steps = parse(path)
    except ValueError as error:
        raise UsageError(mark.fault(str(error))) from None
    try:
        value = _moved(load_text(value_text, label).root, mark)
    except InputError as error:
        raise InputError(mark.fault(error.faults[0].message)) from None
    try:
        for end, step in enumerate(steps):
            if isinstance(step, int):
                document = _with_default_list(document, locate(document, steps[:end]), default, mark)
        return Document(_replaced(document.root, locate(document, steps), value, mark))
    except ValueError as error:
        raise InputError(mark.fault(str(error))) from None


def _with_default_list(
    document: Document, path: Steps, default: Callable[[Document, Steps], object], mark: Mark
) -> Document:
    """Write out the list that `default` says stands at `path`, where nothing is written there."""
    node = document.node(path)
    if node is not None and (node.items is not None or node.value is not None):
        return document
    items = default(document, path)
    if not isinstance(items, tuple | list):
        raise ValueError(f"{path_text(path)} has no items yet; set the whole list")
    filled = Node(mark, items=[Node(mark, item) for item in items], size=1 + len(items))
    return Document(_replaced(document.root, path, filled, mark))


def _moved(node: Node, mark: Mark) -> Node:
    """Return the node as if written at `mark`."""
    items = node.items
    if isinstance(items, dict):
        return Node(mark, None, {k: _moved(n, mark) for k, n in items.items()}, dict.fromkeys(items, mark), node.size)
    return Node(mark, node.value, None if items is None else [_moved(n, mark) for n in items], {}, node.size)


def _replaced(node: Node | None, path: Steps, value: Node, mark: Mark) -> Node:
    """Return a copy of `node` with `value` at `path`; what is missing on the way is made, as written at `mark`."""
    if not path:
        return value
    step, rest = path[0], path[1:]
    if node is not None and isinstance(node.items, list) and isinstance(step, int):
        items = list(node.items)
        items[step] = _replaced(items[step], rest, value, mark)
        return Node(node.mark, items=items, size=1 + sum(item.size for item in items))
    if node is None or not isinstance(node.items, dict):
        node = Node(mark, items={})
    assert isinstance(node.items, dict)
    assert isinstance(step, str)
    mapping = node.items | {step: _replaced(node.items.get(step), rest, value, mark)}
    return Node(
        node.mark, items=mapping, keys={step: mark, **node.keys}, size=1 + sum(item.size for item in mapping.values())
    )


#: what tells a path from a preset's name
_PATH_LIKE = r"[/\\]|\.ya?ml$"


class LoadedSkin(NamedTuple):
    """A skin and the folder to which the paths in it are relative."""

    skin: Skin
    folder: Path


@dataclass(frozen=True)
class LoadedScene:
    """A scene with all that it refers to in YAML, checked.

    Parameters
    ----------
    scene : the model; its paths are resolved
    skins : by name of the mesh's part; "" is the skin of all other parts; without an entry: the mesh file's material
    folder : the scene file's folder, to which its paths are relative
    roots : further folders that may hold assets
    label : the scene file as the person called it
    document : the resolved values with their places, for messages and for `locate`
    """

    scene: Scene
    skins: dict[str, LoadedSkin]
    folder: Path
    roots: tuple[Path, ...]
    label: str
    document: Document

    def fault(self, path: str, message: str) -> Fault:
        """Return `message` as a fault at the place where `path` was written, or at its longest written beginning."""
        return self.document.mark(parse(path)).fault(message)


def load_scene(
    path: str | Path,
    sets: Sequence[str] = (),
    asset_roots: Sequence[Path] = (),
    outputs: Collection[str] | None = None,
) -> LoadedScene:
    """Read a scene, put the skins it names in place, apply the settings, and check everything.

    Parameters
    ----------
    path : the scene file
    sets : the values of `--set`, PATH=VALUE, in their order; a relative path in a value is relative to the file that
        it changes
    asset_roots : see `skincli.files.asset_roots`
    outputs : the names that `outputs` may hold; None: not checked

    Raises
    ------
    InputError : all that is wrong with the scene, its skins and the settings
    LimitError : a file beyond the budgets of `skincli.scene.yaml`
    UsageError : a setting that is not PATH=VALUE
    """
    return _SceneReader(Path(path), tuple(asset_roots)).load(sets, outputs)


def load_skin(skin: str, sets: Sequence[str] = (), asset_roots: Sequence[Path] = ()) -> LoadedSkin:
    """Read a skin by itself.

    Parameters
    ----------
    skin : a preset's name, or the path of a skin file or of a folder of maps
    sets : settings as a scene takes them, such as skin.layers[0].opacity=0.5
    asset_roots : see `skincli.files.asset_roots`

    Raises
    ------
    InputError, LimitError, UsageError : as load_scene
    """
    return _SceneReader(Path("skin"), tuple(asset_roots)).load_skin(skin, sets)


class _SceneReader:
    """Collects the faults of all files of one scene."""

    def __init__(self, path: Path, roots: tuple[Path, ...]) -> None:
        self.path, self.label, self.roots = path, str(path), roots
        self.folder = path.parent.resolve()
        self.folders = {self.label: self.folder}  # by label, in the order of reading
        self.skin_files: dict[Path, Node | None] = {}
        self.broken: set[Steps] = set()  # skins that could not be read, and are not judged further
        self.faults: list[Fault] = []

    def load(self, sets: Sequence[str], outputs: Collection[str] | None) -> LoadedScene:
        assignments = [_assignment(text) for text in sets]
        document = self.with_sets(self.with_skins(load_file(self.path, self.label, self.faults)), assignments)
        context = {"base": self.folder, "roots": self.roots, "outputs": outputs}
        scene, faults = check(document, Scene, context)
        self.faults += faults
        found = {place: self.checked_skin(document, place) for place in _skin_places(document)}
        if scene is None or self.faults:
            raise self.refusal(assignments)
        skins = {str(place[1]) if len(place) > 1 else "": skin for place, skin in found.items() if skin is not None}
        return LoadedScene(scene, skins, self.folder, self.roots, self.label, document)

    def load_skin(self, text: str, sets: Sequence[str]) -> LoadedSkin:
        assignments = [_assignment(setting) for setting in sets]
        for target, _, label in assignments:
            if len(parse(target)) < 2 or parse(target)[0] != "skin":
                raise InputError(
                    Fault(f"a skin by itself has no '{target}'; write skin.KEY, as in --set skin.seed=3", label)
                )
        # What is named on the command line may lie anywhere; what it refers to may not.
        path, label = self.skin_path(text, "SKIN", anywhere=True)
        root = self.read_skin(path, label)
        if root is None:
            raise self.refusal(assignments)
        document = self.with_sets(Document(Node(root.mark, items={"skin": root}, size=1 + root.size)), assignments)
        skin = self.checked_skin(document, ("skin",))
        if skin is None or self.faults:
            raise self.refusal(assignments)
        return skin

    def refusal(self, assignments: Sequence[tuple[str, str, str]]) -> InputError:
        """Return all faults as one error, file by file."""
        return InputError(report(self.faults, [*self.folders, *(label for *_, label in assignments)]))

    def with_sets(self, document: Document, assignments: Sequence[tuple[str, str, str]]) -> Document:
        """Return the document with the settings applied; what cannot be set becomes a fault."""
        for target, value, label in assignments:
            try:
                document = self.with_skins(set_value(document, target, value, label, _default))
            except InputError as error:
                if not any(parse(target)[: len(skin)] == skin for skin in self.broken):
                    self.faults += error.faults
        return document

    def checked_skin(self, document: Document, place: Steps) -> LoadedSkin | None:
        """Return the skin at a place; None where there is none, or after a fault."""
        node = document.node(place)
        if node is None or place in self.broken or (node.items is None and node.value is None):
            return None
        folder = self.folders.get(node.mark.file, self.folder)
        own_file = node.mark.file if node.mark.file in self.folders and node.mark.file != self.label else None
        if own_file is None and isinstance(node.items, dict) and "skin" not in node.items:
            # What is written inside a scene needs no version of its own.
            node = _replaced(node, ("skin",), Node(node.mark, SKIN_VERSION), node.mark)
        skin, faults = check(Document(node), Skin, {"base": folder, "roots": self.roots}, place, own_file)
        self.faults += faults
        return None if skin is None else LoadedSkin(skin, folder)

    def with_skins(self, document: Document) -> Document:
        """Return the document with every skin that is a name or a path replaced by its file's content."""
        for place in _skin_places(document):
            node = document.node(place)
            if node is None or isinstance(node.items, dict) or (node.items is None and node.value is None):
                continue
            skin = self.skin_file(node, path_text(place))
            if skin is None:
                self.broken.add(place)
                skin = Node(node.mark)
            else:
                self.broken.discard(place)
            document = Document(_replaced(document.root, place, skin, node.mark))
        return document

    def skin_file(self, node: Node, what: str) -> Node | None:
        """Return the content of the skin that a node names, or None after a fault."""
        if not isinstance(node.value, str):
            message = f"{what} is {shorten(node.plain)}; it must be a preset's name, a skin's path, or a mapping"
            self.faults.append(node.mark.fault(message))
            return None
        try:
            path, label = self.skin_path(node.value, what)
        except InputError as error:
            self.faults += [node.mark.fault(fault.message) for fault in error.faults]
            return None
        if path not in self.skin_files:
            self.skin_files[path] = self.read_skin(path, label)
        return self.skin_files[path]

    def read_skin(self, path: Path, label: str) -> Node | None:
        """Return the content of a skin file, or what stands for a folder of maps; None after a fault."""
        self.folders[label] = (path if path.is_dir() else path.parent).resolve()
        try:
            root = self.read_maps(path, label) if path.is_dir() else load_file(path, label, self.faults).root
        except InputError as error:
            self.faults += error.faults
            return None
        if not isinstance(root.items, dict):
            _, faults = check(Document(root), Skin)
            self.faults += faults
            return None
        return root

    def read_maps(self, path: Path, label: str) -> Node:
        """Return the skin that a folder of maps stands for: a layer per map, as large as the largest of them."""
        from skincli import images, mapset  # here, for OpenImageIO takes its time to load

        found = mapset.find_maps(path, self.roots, label)
        layers = found.layers()
        names = [layer["image"]["file"] for layer in layers]
        sides = [images.size_of(found.folder / name, f"{label.rstrip('/')}/{name}") for name in names]
        written = {
            "about": found.about,
            "size": min(max(map(max, sides), default=1), MAX_SIZE),
            "extent": found.extent,
            "layers": layers,
            "optics": found.optics,
            "surface": found.surface,
        }
        document = {"skin": SKIN_VERSION} | {key: value for key, value in written.items() if value is not None}
        return _moved(load_text(json.dumps(document), label).root, Mark(label, None, None))

    def skin_path(self, text: str, what: str, *, anywhere: bool = False) -> tuple[Path, str]:
        """Return the file of a preset's name, or the file or folder of a path, and what messages call it.

        Parameters
        ----------
        text : as written
        what : how a message calls it
        anywhere : whether a path may lead out of the scene's folder
        """
        if not re.search(_PATH_LIKE, text):
            presets = {path.stem: path for path in sorted(resources.folder("presets").glob("*.yaml"))}
            if text in presets:
                return presets[text], f"preset {text}"
            if not text or not (self.folder / text).is_dir():
                raise InputError(
                    f"{what} is '{shorten(text)}'; no preset has that name{did_you_mean(text, list(presets)) or '.'} "
                    f"There are: {', '.join(presets)}. A path ends in .yaml, or in / for a folder of maps"
                )
        if anywhere:
            return Path(text), text
        return files.resolve(text, self.folder, self.roots, what, folders=True), str(self.path.parent / text)


def _assignment(text: str) -> tuple[str, str, str]:
    """Split PATH=VALUE and add the label for its faults."""
    label = f"--set {shorten(text, 60)}"
    match = _ASSIGNMENT.fullmatch(text)
    if match is None:
        raise UsageError(Fault("there is no '='; write PATH=VALUE, as in --set camera.fov=35", label))
    return match[1].strip(), match[2], label


def _skin_places(document: Document) -> list[Steps]:
    """Return the paths at which a scene may have a skin."""
    parts = document.node(("parts",))
    names = list(parts.items) if parts is not None and isinstance(parts.items, dict) else []
    return [("skin",), *(("parts", name, "skin") for name in names)]


def _default(document: Document, path: Steps) -> object:
    """Return what the models say stands at `path` when nothing is written, or None."""
    for place in _skin_places(document):
        if path[: len(place)] == place:
            _, info = field_at(Skin, document.node(place), path[len(place) :])
            break
    else:
        _, info = field_at(Scene, document.root, path)
    return info.get_default(call_default_factory=True) if info is not None else None
