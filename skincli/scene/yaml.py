"""From text to values with line and column, and from a model's complaints to sentences a person can act on.

The YAML read here is the core schema of YAML 1.2 (section 10.3): `no` is text, `1e-3` is a number, `017` is seventeen.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from skincli.errors import Fault, InputError, LimitError, did_you_mean
from skincli.files import nearest

MAX_BYTES = 1_000_000
MAX_DEPTH = 64
MAX_NODES = 100_000  # counted with every alias expanded
MAX_DIGITS = 300  # of a whole number; more would not fit a float anyway

Steps = tuple[str | int, ...]
M = TypeVar("M", bound=BaseModel)

# libyaml's parser where PyYAML was built with it: the same events, some 20 times faster.
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

# A key that needs no quotes in a path.
PLAIN_KEY = re.compile(r"[^\s.\[\]=\"']+")

_NULL = {"", "~", "null", "Null", "NULL"}
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(?:inf|Inf|INF)")
_NAN = {".nan", ".NaN", ".NAN"}
_CORE_TAG = "tag:yaml.org,2002:"


class Mark(NamedTuple):
    """Where something was written: file as the person calls it, 1-based line and column (None: not in a file)."""

    file: str
    line: int | None
    column: int | None

    def fault(self, message: str) -> Fault:
        """Return `message` as a fault at this place."""
        return Fault(message, *self)


@dataclass(frozen=True)
class Node:
    """A value and the places it was written at; never changed, so that aliases may share it.

    Parameters
    ----------
    mark : place of the value
    value : null, bool, int, float or text; for a mapping and a list, see `items`
    items : the nodes of a mapping by key, or of a list in order; None for a scalar
    keys : places of a mapping's keys
    size : number of nodes, this one and the expanded aliases included
    """

    mark: Mark
    value: Any = None
    items: dict[str, Node] | list[Node] | None = None
    keys: dict[str, Mark] = field(default_factory=dict)
    size: int = 1

    @property
    def plain(self) -> Any:
        """The value as Python's own dict, list, str, int, float, bool, None."""
        if isinstance(self.items, dict):
            return {key: node.plain for key, node in self.items.items()}
        return self.value if self.items is None else [node.plain for node in self.items]

    def child(self, step: str | int) -> Node | None:
        """Return the node one step down, or None."""
        if isinstance(self.items, dict):
            return self.items.get(step) if isinstance(step, str) else None
        if isinstance(self.items, list) and isinstance(step, int) and 0 <= step < len(self.items):
            return self.items[step]
        return None


@dataclass(frozen=True)
class Document:
    """What was written, and where.

    Parameters
    ----------
    root : the whole text's node
    """

    root: Node

    @property
    def values(self) -> Any:
        """The values as Python's own types."""
        return self.root.plain

    def node(self, path: Steps) -> Node | None:
        """Return the node at `path`, or None."""
        node: Node | None = self.root
        for step in path:
            node = node.child(step) if node is not None else None
        return node

    def mark(self, path: Steps, key: bool = False) -> Mark:
        """Return the place of the value at `path`, or with `key` of its key.

        Where the path does not exist, the place of its longest existing beginning.
        """
        node, mark = self.root, self.root.mark
        for step in path:
            below = node.child(step)
            if below is None:
                break
            mark = node.keys.get(step, below.mark) if key and isinstance(step, str) else below.mark
            node = below
        return mark

    def at(self, path: Steps) -> Document:
        """Return the part of the document below `path`, which must exist."""
        node = self.node(path)
        if node is None:
            raise KeyError(path)
        return Document(node)


def load_file(path: str | Path, label: str | None = None, faults: list[Fault] | None = None) -> Document:
    """Read a YAML file, see `load_text`; `label` is what messages call it, by default the path itself."""
    path = Path(path)
    label = str(path) if label is None else label
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError(Fault(f"no such file{nearest(path)}", label)) from None
    except IsADirectoryError:
        raise InputError(Fault("that is a folder; name a YAML file in it", label)) from None
    except OSError as error:
        raise InputError(Fault(f"the file cannot be read: {error.strerror}", label)) from None
    if len(data) > MAX_BYTES:
        raise LimitError(Fault(f"the file is larger than {MAX_BYTES:,} bytes; a scene or skin must be smaller", label))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8-sig")
        message = f"the byte 0x{data[error.start]:02x} is not UTF-8; save the file with the encoding UTF-8"
        raise InputError(_mark_at(before, len(before), label).fault(message)) from None
    return load_text(text, label, faults)


def load_text(text: str, file_label: str, faults: list[Fault] | None = None) -> Document:
    """Read one YAML 1.2 document of plain data.

    Parameters
    ----------
    text : the document
    file_label : what messages call the file
    faults : list that takes the faults after which reading can go on (duplicate keys, tags, merge keys), so that a
        caller can report them with others; None: they are raised

    Raises
    ------
    InputError : broken syntax, duplicate keys, tags other than the core ones, keys that are no text, merge keys,
        recursive aliases, several documents, NUL
    LimitError : more than MAX_BYTES, MAX_DEPTH levels or MAX_NODES nodes
    """
    text = text.removeprefix("\ufeff")
    try:
        size = len(text.encode())
    except UnicodeEncodeError as error:  # a command line in another encoding
        message = "there is a character that is not Unicode; write UTF-8"
        raise InputError(_mark_at(text, error.start, file_label).fault(message)) from None
    if size > MAX_BYTES:
        raise LimitError(Fault(f"the text is larger than {MAX_BYTES:,} bytes; make it smaller", file_label))
    if "\0" in text:
        message = "there is a NUL character; the file is not text, or damaged"
        raise InputError(_mark_at(text, text.index("\0"), file_label).fault(message))
    reader = _Reader(text, file_label)
    try:
        root = reader.read()
    except yaml.YAMLError as error:
        raise InputError(report([*reader.faults, _syntax_fault(error, text, file_label)])) from None
    if faults is None and reader.faults:
        raise InputError(report(reader.faults))
    if faults is not None:
        faults += reader.faults
    return Document(root)


def _mark_at(text: str, index: int, label: str) -> Mark:
    return Mark(label, text.count("\n", 0, index) + 1, index - (text.rfind("\n", 0, index) + 1) + 1)


def _syntax_fault(error: yaml.YAMLError, text: str, label: str) -> Fault:
    if isinstance(error, yaml.MarkedYAMLError):
        place = error.problem_mark or error.context_mark
        lines = text.rstrip("\n").split("\n")
        line, column = (place.line, place.column) if place is not None else (0, 0)
        if line >= len(lines):  # libyaml puts an unfinished end on the line after the last
            line, column = len(lines) - 1, len(lines[-1])
        mark = Mark(label, line + 1, column + 1)
        problem = ", ".join(part for part in (error.context, error.problem) if part)
        hint = ""
        if "mapping values are not allowed" in problem:
            hint = "; check the indentation, and put text that contains ': ' in quotes"
        elif "cannot start any token" in problem:
            character = lines[line][column : column + 1]
            tab = character == "\t"
            hint = "; indent with spaces, not tabs" if tab else f"; put text that begins with '{character}' in quotes"
        elif "expected" in problem:
            hint = "; look for a missing bracket, quote, comma or colon at or before this place"
        return mark.fault(f"this is not valid YAML: {problem}{hint}")
    position = getattr(error, "position", None)  # ReaderError
    mark = _mark_at(text, position, label) if isinstance(position, int) else Mark(label, None, None)
    return mark.fault("there is a control character that YAML does not allow; remove it")


class _Reader:
    """Builds nodes from the parser's events, so that no budget can be passed before it is checked."""

    def __init__(self, text: str, label: str) -> None:
        self.events = iter(yaml.parse(text, Loader=_Loader))
        self.label = label
        self.faults: list[Fault] = []
        self.anchors: dict[str, Node | None] = {}  # None while the anchored node is still open
        self.nodes = 0

    def read(self) -> Node:
        """Return the root of the only document."""
        next(self.events)  # stream start
        event = next(self.events)
        if isinstance(event, yaml.StreamEndEvent):
            return Node(Mark(self.label, 1, 1))
        root = self.node(next(self.events), 1)
        next(self.events)  # document end
        event = next(self.events)
        if not isinstance(event, yaml.StreamEndEvent):
            self.faults.append(self.mark(event).fault("a second document begins here; one file holds one document"))
        return root

    def mark(self, event: Any) -> Mark:
        """Return the place at which `event` begins."""
        return Mark(self.label, event.start_mark.line + 1, event.start_mark.column + 1)

    def node(self, event: Any, depth: int) -> Node:
        """Return the node that begins with `event`, `depth` levels down."""
        mark = self.mark(event)
        if isinstance(event, yaml.AliasEvent):
            node = self.anchors.get(str(event.anchor))
            if node is None:
                known = event.anchor in self.anchors
                what = "contains itself" if known else "has no anchor before it"
                advice = "write the value out" if known else f"mark the value meant with &{event.anchor}"
                self.faults.append(mark.fault(f"the alias *{event.anchor} {what}; {advice}"))
                return Node(mark)
            self.spend(node.size, mark)
            return node
        self.spend(1, mark)
        if depth > MAX_DEPTH:
            fault = mark.fault(f"the nesting is deeper than {MAX_DEPTH} levels; flatten it")
            raise LimitError([*report(self.faults), fault])
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if isinstance(event, yaml.ScalarEvent):
            node = Node(mark, self.scalar(event, mark))
        elif isinstance(event, yaml.SequenceStartEvent):
            self.check_tag(event, mark, "seq")
            node = self.sequence(mark, depth)
        else:
            self.check_tag(event, mark, "map")
            node = self.mapping(mark, depth)
        if event.anchor is not None:
            self.anchors[event.anchor] = node
        return node

    def spend(self, count: int, mark: Mark) -> None:
        """Count nodes, aliases expanded, against the budget."""
        self.nodes += count
        if self.nodes > MAX_NODES:
            message = f"the document holds more than {MAX_NODES:,} values with its aliases expanded; make it smaller"
            raise LimitError([*report(self.faults), mark.fault(message)])

    def sequence(self, mark: Mark, depth: int) -> Node:
        """Read a list's items up to its end."""
        items: list[Node] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            items.append(self.node(event, depth + 1))
        return Node(mark, items=items, size=1 + sum(item.size for item in items))

    def mapping(self, mark: Mark, depth: int) -> Node:
        """Read a mapping's keys and values up to its end; of equal keys the first is kept."""
        items: dict[str, Node] = {}
        keys: dict[str, Mark] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            place = self.mark(event)
            key = self.key(event, place, depth)
            value = self.node(next(self.events), depth + 1)
            if key is None:
                continue
            if key in items:
                first = keys[key]
                message = f"the key '{shorten(key)}' is already at {first.line}:{first.column}; remove one of them"
                self.faults.append(place.fault(message))
                continue
            items[key], keys[key] = value, place
        return Node(mark, items=items, keys=keys, size=1 + sum(item.size for item in items.values()))

    def key(self, event: Any, mark: Mark, depth: int) -> str | None:
        """Return a key's text as written (`1:` has the key "1"), or None after a fault."""
        if not isinstance(event, yaml.ScalarEvent):
            self.node(event, depth + 1)
            self.faults.append(mark.fault("a key must be text, not a list, a mapping or an alias"))
            return None
        if event.implicit[0] and event.value == "<<":
            self.faults.append(mark.fault("merge keys (<<) are not YAML 1.2; write the keys out"))
            return None
        self.spend(1, mark)
        self.check_tag(event, mark, "str")
        if event.anchor is not None:
            self.anchors[event.anchor] = Node(mark, event.value)
        return event.value

    def check_tag(self, event: Any, mark: Mark, kind: str) -> None:
        """Refuse any explicit tag except the one that says what the node is anyway."""
        if event.tag not in (None, "!", _CORE_TAG + kind):
            self.refuse_tag(event, mark)

    def refuse_tag(self, event: Any, mark: Mark) -> None:
        """Note that the tag of `event` is not allowed."""
        tag = event.tag
        name = "!!" + tag.removeprefix(_CORE_TAG) if tag.startswith(_CORE_TAG) else tag
        self.faults.append(mark.fault(f"the tag {shorten(name)} is not allowed here; remove it"))

    def scalar(self, event: Any, mark: Mark) -> Any:
        """Return the value of a scalar under the core schema."""
        text = event.value
        if event.tag is None:
            if not event.implicit[0]:
                return text
            if len(text) > MAX_DIGITS and _INT.fullmatch(text):
                self.faults.append(mark.fault(f"a whole number has at most {MAX_DIGITS} digits; this has {len(text)}"))
                return 0
            return resolve_scalar(text)
        kind = event.tag.removeprefix(_CORE_TAG)
        if event.tag in ("!", _CORE_TAG + "str"):
            return text
        value = resolve_scalar(text) if len(text) <= MAX_DIGITS else text
        if kind == "float" and type(value) is int:
            return float(value)
        kinds = {"null": type(None), "bool": bool, "int": int, "float": float}
        if kind not in kinds or event.tag == kind:
            self.refuse_tag(event, mark)
        elif type(value) is not kinds[kind]:
            self.faults.append(mark.fault(f"'{shorten(text)}' is not what its tag !!{kind} says; remove the tag"))
        return value


def resolve_scalar(text: str) -> Any:
    """Return the value of an unquoted scalar: YAML 1.2 core schema, section 10.3.2."""
    if text in _NULL:
        return None
    if text in _BOOL:
        return _BOOL[text]
    if _INT.fullmatch(text):
        base = {"0o": 8, "0x": 16}.get(text[:2], 10)
        return int(text if base == 10 else text[2:], base)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INFINITY.fullmatch(text):
        return float("-inf" if text[0] == "-" else "inf")
    return float("nan") if text in _NAN else text


def shorten(value: Any, limit: int = 40) -> str:
    """Return a value as a person would write it, cut to about `limit` characters."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        text = "{" + ", ".join(f"{key}: {_quoted(item, limit)}" for key, item in list(value.items())[:limit]) + "}"
    elif isinstance(value, list):
        text = "[" + ", ".join(_quoted(item, limit) for item in value[:limit]) + "]"
    else:
        text = value if isinstance(value, str) else repr(value)
        text = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return text if len(text) <= limit else text[: limit - 3].rstrip() + "..."


def _quoted(value: Any, limit: int = 40) -> str:
    return f"'{shorten(value, limit)}'" if isinstance(value, str) else shorten(value, limit)


def path_text(path: Steps) -> str:
    """Return a path as messages show it, in the grammar of `skincli.scene.paths`: a.b[0].c"""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        elif PLAIN_KEY.fullmatch(step) and step.isprintable():
            text += f".{step}" if text else step
        else:
            text += f'["{shorten(step)}"]'
    return text


def model_keys(kind: Any, node: Node | None) -> list[str]:
    """Return the keys that a value of the type `kind` may have, [] where that is not a model."""
    model = _model(kind, node)
    return sorted(model.model_fields) if model else []


def field_at(kind: Any, node: Node | None, path: Steps) -> tuple[Any, FieldInfo | None]:
    """Follow `path` through model classes: the type found there, and its field where it is one; None: not known."""
    info: FieldInfo | None = None
    for step in path:
        info, kind = _step(kind, node, step)
        node = node.child(step) if node is not None else None
    return kind, info


def _step(kind: Any, node: Node | None, step: str | int) -> tuple[FieldInfo | None, Any]:
    model = _model(kind, node)
    if model is not None:
        info = model.model_fields.get(step) if isinstance(step, str) else None
        return info, info.annotation if info else None
    arguments = [a for a in get_args(_bare(kind)) if a is not Ellipsis]
    return None, arguments[-1] if arguments and not _branches(kind) else None


def _bare(kind: Any) -> Any:
    """Strip Annotated and `| None`."""
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    members = _members(kind)
    if len(members) == 1 and members[0] is not kind:
        return _bare(members[0])
    return kind


def _members(kind: Any) -> list[Any]:
    if get_origin(kind) is Union or type(kind).__name__ == "UnionType":
        return [member for member in get_args(kind) if member is not type(None)]
    return [kind]


def _branches(kind: Any) -> list[Any]:
    """Return the members of a union of several types, else []."""
    members = _members(_bare(kind))
    return members if len(members) > 1 else []


def _tags(kind: Any) -> dict[str, type[BaseModel]]:
    """Return the models of a union by the text that their key `type` must have."""
    models = [_bare(branch) for branch in _branches(kind)]
    return {
        tag: model
        for model in models
        if isinstance(model, type) and issubclass(model, BaseModel) and "type" in model.model_fields
        for tag in get_args(model.model_fields["type"].annotation)
    }


def _model(kind: Any, node: Node | None) -> type[BaseModel] | None:
    kind = _bare(kind)
    chosen = node.child("type") if node is not None else None
    if chosen is not None and (tags := _tags(kind)):
        return tags.get(chosen.value) if isinstance(chosen.value, str) else None
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _path_of(location: tuple[int | str, ...], root: Node, kind: Any) -> Steps:
    """Return pydantic's location without the names of union branches, which nobody wrote."""
    path: list[str | int] = []
    node: Node | None = root
    steps = list(location)
    while steps:
        step = steps.pop(0)
        if _branches(kind):
            kind = _tags(kind).get(str(step)) or next(iter(_branches(kind)))
            continue
        below = node.child(step) if node is not None else None
        if below is None and steps and kind is None:
            continue  # a branch that a validator of its own has added
        _, kind = _step(kind, node, step)
        path.append(step)
        node = below
    return tuple(path)


_EXPECTED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a mapping, key: value",
    "model_type": "a mapping, key: value",
    "model_attributes_type": "a mapping, key: value",
    "greater_than": "greater than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "multiple_of": "a multiple of {multiple_of}",
    "string_too_short": "text of at least {min_length} characters",
    "string_too_long": "text of at most {max_length} characters",
}
_CHOICES = ("literal_error", "enum", "union_tag_invalid")
_YES_NO = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}
MAX_FAULTS = 100


def validate(document: Document, model_class: type[M], context: Mapping[str, Any] | None = None) -> M:
    """Return the document as an instance of a pydantic model.

    Parameters
    ----------
    document : what was read
    model_class : what it must be
    context : passed to the model's validators, see `skincli.files.AssetPath` and `skincli.scene.model.Scene`

    Raises
    ------
    InputError : all that is wrong with it, in the order of the text
    """
    instance, faults = check(document, model_class, context)
    if instance is None:
        raise InputError(report(faults))
    return instance


def check(
    document: Document,
    model_class: type[M],
    context: Mapping[str, Any] | None = None,
    at: Steps = (),
    file: str | None = None,
) -> tuple[M | None, list[Fault]]:
    """Do the work of `validate` without raising, so that the faults of several documents can be reported together.

    Parameters
    ----------
    at : where the document hangs in a larger one; messages begin with it
    file : label of the file whose own root the document is: in its lines a person expects paths from there, not `at`
    """
    try:
        return model_class.model_validate(document.values, context=context), []
    except ValidationError as error:
        found = error.errors(include_url=False)
    groups: dict[tuple[Steps, bool], list[Any]] = {}
    for item in found:
        path = _path_of(item["loc"], document.root, model_class)
        if item["type"] == "union_tag_invalid":
            path = (*path, str(item["ctx"]["discriminator"]).strip("'"))
        if item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]:
            continue  # pydantic does not count the items that have faults of their own
        groups.setdefault((path, item["type"] in ("extra_forbidden", "missing")), []).append(item)
    marked = [
        (document.mark(path, key=about_key or _is_key_named(document.node(path))), path, items)
        for (path, about_key), items in groups.items()
    ]
    marked.sort(key=lambda entry: _order(entry[0]))
    faults = []
    for mark, path, items in marked[:MAX_FAULTS]:
        shown = path if mark.file == file else (*at, *path)
        faults.append(mark.fault(_sentence(items, path, shown, document.root, model_class)))
    # The sentences take time; `report` lists no more of them, but counts all.
    faults += [mark.fault(path_text(path)) for mark, path, _ in marked[MAX_FAULTS:]]
    return None, faults


def _is_key_named(node: Node | None) -> bool:
    """Tell whether a fault of the value is best shown at its key: it is a mapping, or there is nothing to show."""
    return node is None or isinstance(node.items, dict) or (node.items is None and node.value is None)


def _order(place: Mark | Fault) -> tuple[float, float]:
    """Sort by line and column; what was given on the command line comes last."""
    return (place.line or float("inf"), place.column or float("inf"))


def report(faults: Iterable[Fault], files: Sequence[str] = ()) -> list[Fault]:
    """Return the faults file by file in the order of `files` (others after), each file's in the order of its text.

    After MAX_FAULTS of them one more says how many are left out.
    """
    known = {file: index for index, file in enumerate(files)}
    ordered = sorted(dict.fromkeys(faults), key=lambda fault: (known.get(fault.file or "", len(known)), *_order(fault)))
    if len(ordered) > MAX_FAULTS:
        first = ordered[MAX_FAULTS]
        rest = Fault(
            f"from here on {len(ordered) - MAX_FAULTS} faults are not listed", first.file, first.line, first.column
        )
        ordered = [*ordered[:MAX_FAULTS], rest]
    return ordered


def _sentence(items: list[Any], path: Steps, shown: Steps, root: Node, model_class: type[BaseModel]) -> str:
    """Say what is wrong at `path`, which a message calls `shown`."""
    first = items[0]
    kind, node = first["type"], Document(root).node(path)
    _, info = field_at(model_class, root, path)
    subject = path_text(shown) or f"the {model_class.__name__.lower()}"
    parent = path_text(shown[:-1]) or f"the {model_class.__name__.lower()}"
    about = f" ({info.description})" if info is not None and info.description else ""
    if kind == "extra_forbidden":
        above, _ = field_at(model_class, root, path[:-1])
        keys = model_keys(above, Document(root).node(path[:-1]))
        listed = f" It has: {', '.join(keys)}." if keys else ""
        key = shorten(str(path[-1]))
        return f"{parent} has no key '{key}'{did_you_mean(key, keys) or '.'}{listed}"
    if kind == "missing":
        return f"{parent} lacks the key '{path[-1]}'{about}; add it"
    if kind == "union_tag_not_found":
        above, _ = field_at(model_class, root, path)
        return f"{subject} lacks the key 'type'; add it, one of {', '.join(_tags(above))}"
    if kind in ("too_short", "too_long"):
        return f"{subject} has {_items(len(first['input']))}; it must have {_lengths(first['ctx'], info)}"
    value = node.plain if node is not None else first["input"]
    if len(items) == 1 and kind in ("value_error", "assertion_error"):
        text = str(first["ctx"]["error"])
        whole = isinstance(value, dict)
        return (f"{subject}: {text}" if path else text) if whole else f"{subject} is {_quoted(value)}; {text}"
    found = "has no value" if value is None else f"is {_quoted(value)}"
    if not path and value is None:
        found = "is empty"
    expected = " or ".join(dict.fromkeys(_expected(item) for item in items))
    if kind in ("model_type", "model_attributes_type"):
        above, _ = field_at(model_class, root, path)
        model = _model(above, node)
        if value is None and model is not None and _may_be_empty(model):
            expected += "; write {} for its defaults"
    elif any(item["type"].endswith("_type") for item in items):
        expected += about
    return f"{subject} {found}; it must be {expected}{_remedy(items, value)}"


def _may_be_empty(model: type[BaseModel]) -> bool:
    try:
        model.model_validate({})
    except ValidationError:
        return False
    return True


def _items(count: int) -> str:
    return f"{count} item" if count == 1 else f"{count} items"


def _lengths(context: dict[str, Any], info: FieldInfo | None) -> str:
    limits = {type(limit).__name__: limit for limit in info.metadata} if info is not None else {}
    if "MinLen" in limits and "MaxLen" in limits and limits["MinLen"].min_length == limits["MaxLen"].max_length:
        return str(limits["MinLen"].min_length)
    if "min_length" in context:
        return f"at least {context['min_length']}"
    return f"at most {context['max_length']}"


def _expected(error: Any) -> str:
    """Return what may stand there, to follow "it must be"."""
    kind, context = error["type"], error.get("ctx", {})
    if kind in _CHOICES:
        words = _words(error)
        return f"one of {', '.join(words)}" if len(words) > 1 else words[0]
    if kind in ("value_error", "assertion_error"):
        return str(context["error"]).removeprefix("it must be ")
    if kind in _EXPECTED:
        return _EXPECTED[kind].format(**{name: _number(limit) for name, limit in context.items()})
    return re.sub("^Input should (be )?", "", error["msg"])


def _words(error: Any) -> list[str]:
    context = error["ctx"]
    listed = str(context.get("expected_tags", context.get("expected")))
    return re.findall(r"'([^']*)'", listed) or [listed]


def _number(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 1e6 else value


def _remedy(items: list[Any], value: Any) -> str:
    """Return what to do about a value, where it can be told from the value."""
    kinds = {item["type"] for item in items}
    if not isinstance(value, str):
        return ""
    if "bool_type" in kinds and value.lower() in _YES_NO:
        return f"; write {_YES_NO[value.lower()]}"
    if kinds & {"float_type", "int_type", "literal_error"}:
        if isinstance(resolve_scalar(value), int | float):
            return "; remove the quotes"
        if re.fullmatch(_FLOAT.pattern + r"\s*[^\W\d]+|" + _FLOAT.pattern + r"\s*[%°\"']", value):
            return "; write the number alone, without a unit"
    words = [word for item in items if item["type"] in _CHOICES for word in _words(item)]
    return did_you_mean(value, words)
