"""Which levels of detail each built-in mesh has."""

DETAILS: dict[str, tuple[str, ...]] = {
    "head": ("4k", "16k", "65k", "259k"),
    "creature": ("16k", "65k", "259k"),
    "sphere": ("4k", "16k", "65k"),
}
"""The levels of detail of each mesh: about how many triangles it has, of which "65k" is taken unless one is named."""
