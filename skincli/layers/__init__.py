"""The texture layers of the skin generator: every file of this folder that defines a `Layer` adds one to YAML."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainSerializer, create_model, model_validator

from skincli.layers.base import Layer


def _discover() -> dict[str, type[Layer]]:
    """Import the files of this folder and return the layers they define, by name."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    found: list[type[Layer]] = [Layer]  # type: ignore[type-abstract]
    for cls in found:
        found += cls.__subclasses__()
    return {cls.kind(): cls for cls in sorted(found, key=lambda cls: cls.kind()) if not inspect.isabstract(cls)}


#: Every layer, by the name it has in YAML.
LAYERS = _discover()


class _Entry(BaseModel):
    """A layer as written: a mapping with one key, the layer's name."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="after")
    def _single(self) -> _Entry:
        if len(self.model_fields_set) != 1:
            found = ", ".join(sorted(self.model_fields_set)) or "nothing"
            raise ValueError(
                f"a layer is a mapping with one key, the layer's name; found {found}; begin each layer with its own '-'"
            )
        return self

    @property
    def layer(self) -> Layer:
        return getattr(self, next(iter(self.model_fields_set)))


def _stacked(entry: Any) -> Layer:
    layer: Layer = entry.layer
    if not layer.writes():
        writing = sorted(layer.unread_in_mask() - {"name", "enabled", "blend", "space", "contrast"})
        raise ValueError(f"this {layer.kind()} layer writes nothing; give it at least one of {', '.join(writing)}")
    return layer


def _masking(entry: Any) -> Layer:
    layer: Layer = entry.layer
    if layer.kernel is None or "slope" in layer.writes():
        raise ValueError(f"this {layer.kind()} layer has no pattern to mask with; use one that has, such as fbm")
    # Compared with the defaults, not with what was written: a document with its defaults filled in stays valid.
    fields = type(layer).model_fields
    if unread := sorted(key for key in layer.unread_in_mask() if getattr(layer, key) != fields[key].default):
        raise ValueError(f"a mask gives only its pattern; remove {', '.join(unread)} from the mask")
    return layer


def _written(layer: Layer) -> dict[str, Any]:
    return {layer.kind(): layer.model_dump(mode="json")}


# A field without a type that admits None: `pores:` with nothing after it is refused at its place.
_FIELDS: dict[str, Any] = {
    kind: (cls, Field(None, description=(cls.__doc__ or "").partition("\n")[0])) for kind, cls in LAYERS.items()
}
LayerEntry = create_model("LayerEntry", __base__=_Entry, **_FIELDS)

if TYPE_CHECKING:
    StackLayer = Layer
else:
    #: A field that holds a layer of a stack, written as a single-key mapping.
    StackLayer = Annotated[LayerEntry, AfterValidator(_stacked), PlainSerializer(_written)]

#: What validates the pattern of a mask, written likewise.
MASKING: Any = Annotated[LayerEntry, AfterValidator(_masking), PlainSerializer(_written)]
