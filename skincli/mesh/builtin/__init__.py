"""Meshes that skincli sculpts itself, so that a first picture needs no file."""

from __future__ import annotations

from skincli.errors import InputError, did_you_mean
from skincli.mesh.builtin.levels import DETAILS as DETAILS
from skincli.mesh.model import Mesh


def build(name: str, detail: str | None = None) -> Mesh:
    """Build a mesh by name.

    Parameters
    ----------
    name : a key of DETAILS
    detail : one of DETAILS[name]; "65k" where None

    Returns
    -------
    the mesh in mm, centered, Y up, facing +Z

    Raises
    ------
    InputError : where name or detail is unknown
    """
    if name not in DETAILS:
        raise InputError(
            f"there is no built-in mesh '{name}'; there are {', '.join(DETAILS)}; "
            f"write one of these names{did_you_mean(name, list(DETAILS))}"
        )
    detail = "65k" if detail is None else detail
    if detail not in DETAILS[name]:
        raise InputError(
            f"the built-in mesh '{name}' has no detail '{detail}'; it has {', '.join(DETAILS[name])}; "
            f"write one of these{did_you_mean(detail, DETAILS[name])}"
        )
    # Only the mesh asked for is imported: each carries its own sculpture.
    if name == "head":
        from skincli.mesh.builtin.head import head

        return head(detail)
    if name == "sphere":
        from skincli.mesh.builtin.sphere import sphere

        return sphere(detail)
    from skincli.mesh.builtin.creature import creature

    return creature(detail)
