"""The skins that come with the program, and everything that can be changed in them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import yaml
from pydantic import BaseModel

from skincli import resources
from skincli.scene.yaml import load_file

#: what JSON Schema says of a number's range
_BOUNDS = ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")


def names() -> list[str]:
    """Return the names of the presets."""
    return sorted(path.stem for path in resources.folder("presets").glob("*.yaml"))


def about(name: str) -> str:
    """Return a preset's sentence about itself, without a look at the rest."""
    sentence = load_file(resources.folder("presets") / f"{name}.yaml").node(("about",))
    return "" if sentence is None else str(sentence.value)


def described(name: str) -> dict[str, Any]:
    """Return every parameter of a preset by the path that --set takes.

    Returns
    -------
    path -> value, description, and where they exist default, choices, minimum, exclusiveMinimum, maximum and
    exclusiveMaximum, of a list those of its numbers

    Raises
    ------
    InputError : there is no such preset
    """
    return dict(_parameters(_skin(name), "skin"))


def text(name: str) -> str:
    """Return a preset as YAML in which every parameter is written out, with its meaning, unit and range behind it.

    The text is a skin file that means the same as the preset. What is left out there stands in a comment.

    Raises
    ------
    InputError : there is no such preset
    """
    lines = [f"# Preset {name} in full. Change a value with --set skin.PATH=VALUE, or save this as a file of your own."]
    return "\n".join([*lines, *_lines(_skin(name))]) + "\n"


def _skin(name: str) -> BaseModel:
    # Here, for the list of presets needs no layers, whose models take their time to make.
    from skincli.errors import Fault, InputError, did_you_mean
    from skincli.scene.paths import load_skin

    if name not in names():
        known = f"There are: {', '.join(names())}"
        raise InputError(Fault(f"'{name}' is no preset{did_you_mean(name, names()) or '.'} {known}"))
    return load_skin(name).skin


def _parameters(model: BaseModel, path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    for key, schema in _schemas(model).items():
        value, here = getattr(model, key), f"{path}.{key}"
        if isinstance(value, BaseModel):
            kind = _kind(value)
            yield from _parameters(value, here if kind is None else f"{here}.{kind}")
        elif _holds_layers(value):
            for index, layer in enumerate(value):
                yield from _parameters(layer, f"{here}[{index}]")
        else:
            field = type(model).model_fields[key]
            entry = {"value": _plain(value), "description": field.description or ""}
            if not field.is_required():
                entry["default"] = _plain(field.get_default(call_default_factory=True))
            choices = _choices(schema)
            yield here, entry | ({"choices": choices} if choices else {}) | _bounds(schema)


def _lines(model: BaseModel) -> list[str]:
    """Return the lines of a mapping."""
    lines = []
    for key, schema in _schemas(model).items():
        value, remark = getattr(model, key), f"  # {_remark(model, key, schema)}"
        if isinstance(value, BaseModel):
            kind = _kind(value)
            inner = _lines(value) if kind is None else [f"{kind}:", *_indented(_lines(value))]
            # A mapping of comments alone would be none at all.
            lines += [f"{key}:{remark}" if any(_says(line) for line in inner) else f"{key}: {{}}{remark}"]
            lines += _indented(inner)
        elif _holds_layers(value):
            lines.append(f"{key}:{remark}")
            for layer in value:
                lines += [f"  - {_kind(layer)}:", *_indented(_lines(layer), 6)]
        elif value is None:
            lines.append(f"# {key}:{remark}")
        else:
            lines.append(f"{key}: {_flow(_plain(value))}{remark}")
    return lines


def _schemas(model: BaseModel) -> dict[str, Any]:
    """Return the JSON Schema of each field."""
    return _properties(type(model))


@cache
def _properties(model: type[BaseModel]) -> dict[str, Any]:
    schema = model.model_json_schema()
    # A layer, whose mask is a layer again, stands among the definitions.
    found: dict[str, Any] = schema["$defs"][schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema
    properties: dict[str, Any] = found["properties"]
    return properties


def _kind(model: BaseModel) -> str | None:
    """Return a layer's name in YAML; None for what is no layer."""
    from skincli.layers.base import Layer

    return model.kind() if isinstance(model, Layer) else None


def _holds_layers(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], BaseModel)


def _indented(lines: list[str], by: int = 2) -> list[str]:
    return [" " * by + line for line in lines]


def _says(line: str) -> bool:
    return not line.lstrip().startswith("#")


def _bounds(schema: Any) -> dict[str, float]:
    """Return the range of a number, or of the numbers of a list."""
    found = {key: schema[key] for key in _BOUNDS if key in schema}
    below = [*schema.get("anyOf", ()), *([schema["items"]] if "items" in schema else [])]
    return found or next(filter(None, map(_bounds, below)), {})


def _choices(schema: Any) -> list[Any]:
    """Return the words of which a value, or each item of a list, is one."""
    below = [*schema.get("anyOf", ()), *([schema["items"]] if "items" in schema else [])]
    found: list[Any] = schema.get("enum", [])
    return found or next(filter(None, map(_choices, below)), [])


def _remark(model: BaseModel, key: str, schema: Any) -> str:
    """Return a field's description, with its choices or its range where that does not say them."""
    description = type(model).model_fields[key].description or ""
    choices = [str(choice) for choice in _choices(schema)]
    if choices and not all(choice in description for choice in choices):
        return f"{description} [{', '.join(choices)}]"
    found = _bounds(schema)
    if not found:
        return description
    low = f"above {found['exclusiveMinimum']}" if "exclusiveMinimum" in found else str(found.get("minimum", ""))
    high = f"below {found['exclusiveMaximum']}" if "exclusiveMaximum" in found else str(found.get("maximum", ""))
    ends = " to ".join(filter(None, (low, high)))
    return description if ends in description else f"{description} [{ends}]"


def _plain(value: Any) -> Any:
    """Return a value as YAML and JSON have it."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value if isinstance(value, int | float | str | None) else str(value)


def _flow(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=10**9).removesuffix("\n").removesuffix("\n...")
