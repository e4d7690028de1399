"""How a layer says what pigment it lays: one field per pigment of `skincli.optics.pigments`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, create_model

from skincli.optics.pigments import PIGMENTS

#: An amount of pigment; a negative one takes away from what lies below, down to nothing.
Amount = Annotated[float, Field(ge=-10, le=10)]
AmountRamp = Annotated[tuple[Amount, ...], Field(strict=False, min_length=2, max_length=2)]

#: Pigment -> channel of the stack that adds it up, in the order of `pigment_albedo` in shaders/lib/pigment.glsl.
CHANNEL_OF = {pigment.name: f"pigment_{pigment.name}" for pigment in PIGMENTS}


class _Laid(BaseModel):
    """Amounts by pigment; a pigment that is left out is not touched."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    def pairs(self) -> dict[str, Any]:
        """Return what each channel receives."""
        return {CHANNEL_OF[name]: value for name, value in self if value is not None}


def _model(name: str, kind: Any, what: str) -> Any:
    fields: dict[str, Any] = {
        pigment.name: (kind | None, Field(default=None, description=f"{what} of {pigment.name}: {pigment.doc}"))
        for pigment in PIGMENTS
    }
    return create_model(name, __base__=_Laid, **fields)


if TYPE_CHECKING:
    PigmentAmounts = _Laid
    PigmentRamps = _Laid
else:
    #: What one value everywhere adds.
    PigmentAmounts = _model("PigmentAmounts", Amount, "amount")
    #: What a pattern adds where it is 0 and where it is 1.
    PigmentRamps = _model("PigmentRamps", AmountRamp, "amounts")
