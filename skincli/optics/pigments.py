"""Color from pigments: one spectral model for the skin of the living, the dead and the octopus.

Light crosses the upper layer, is scattered back by the deep one, and crosses the upper layer again. Pigments add
optical density, so mixing needs no rule: melanin and the ommochromes of chromatophores take light away on both
crossings (Beer-Lambert); blood, bilirubin and sulfhemoglobin absorb between the scatterers of the deep layer. The
reference works on 76 wavelengths; shaders and their float64 twin evaluate the same formula at 12, with fitted weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skincli.color import ACESCG_TO_REC709
from skincli.optics import spectra

Array = NDArray[np.float64]
Base = Literal["dermis", "leucophore", "iridophore"]


@dataclass(frozen=True)
class Pigment:
    """One of the eight amounts that a texel carries.

    Parameters
    ----------
    name : the word a user writes
    layer : "upper" (epidermis, chromatophores: crossed twice) or "deep" (absorbs among the scatterers)
    unit : of the amount
    range : from none to the most that is sensible; fits and tests cover it
    doc : one sentence
    source : of the absorption spectrum
    """

    name: str
    layer: Literal["upper", "deep"]
    unit: str
    range: tuple[float, float]
    doc: str
    source: str


PIGMENTS: tuple[Pigment, ...] = (
    Pigment(
        "melanin",
        "upper",
        "volume fraction of the epidermis",
        (0.0, 0.5),
        "Brown of skin and freckles: melanosomes.",
        "[Jacques1998], [Donner2006]",
    ),
    Pigment(
        "oxyhemoglobin",
        "deep",
        "volume fraction of the dermis, as whole blood",
        (0.0, 0.1),
        "Pink of living skin: blood that carries oxygen.",
        "[Prahl1999]",
    ),
    Pigment(
        "deoxyhemoglobin",
        "deep",
        "volume fraction of the dermis, as whole blood",
        (0.0, 0.1),
        "Violet of cold lips and livor: blood without oxygen.",
        "[Prahl1999]",
    ),
    Pigment(
        "bilirubin",
        "deep",
        "g/l of the dermis",
        (0.0, 0.3),
        "Yellow of jaundice and of fading bruises.",
        "[Dixon2005]",
    ),
    Pigment(
        "sulfhemoglobin",
        "deep",
        "volume fraction of the dermis, as whole blood",
        (0.0, 0.05),
        "Green of decay: what hydrogen sulfide makes of blood.",
        "[Zijlstra2000]",
    ),
    Pigment(
        "xanthommatin",
        "upper",
        "optical density at the peak, one crossing, base 10",
        (0.0, 1.2),
        "Yellow to ochre chromatophores: oxidized xanthommatin.",
        "[Kumar2018]",
    ),
    Pigment(
        "reduced_xanthommatin",
        "upper",
        "optical density at the peak, one crossing, base 10",
        (0.0, 1.2),
        "Red chromatophores: reduced xanthommatin and ommin.",
        "[Linzen1974]",
    ),
    Pigment(
        "ommin",
        "upper",
        "optical density at the peak, one crossing, base 10",
        (0.0, 1.2),
        "Brown-black chromatophores: dense ommin.",
        "[Linzen1974]",
    ),
)
"""The eight amounts in the order in which two vec4 hold them."""

UPPER = tuple(i for i, pigment in enumerate(PIGMENTS) if pigment.layer == "upper")
DEEP = tuple(i for i, pigment in enumerate(PIGMENTS) if pigment.layer == "deep")

# Peak (nm) of each ommochrome's band as published, and its widths below and above (nm, standard deviation), which are
# chosen, not measured: extracts differ with solvent and redox state, and granules in a sac are broader than extracts.
_OMMOCHROMES = ((440.0, 60.0, 52.0), (495.0, 110.0, 54.0), (520.0, 350.0, 95.0))

NODES = (420, 440, 456, 484, 508, 532, 556, 572, 596, 616, 636, 660)
"""Wavelengths (nm) that shaders evaluate, moved one by one until no move lowered the CIEDE2000 of mixtures."""

_GROUPS = len(NODES) // 4
_COLUMNS = np.searchsorted(spectra.WAVELENGTH, NODES)


@dataclass(frozen=True)
class PigmentModel:
    """What holds for a whole skin, and the color that amounts of pigment give it.

    Parameters
    ----------
    eumelanin : share of eumelanin in the melanin, [0, 1]; the default is the cutaneous melanin of [Jacques1998]
    epidermis : thickness in mm, above 0
    gaps : share of the light that finds its way between the grains of upper pigments, [0, 1): they flatten the spectrum
        of what they absorb [Duysens1956], and keep the darkest skin from black. Chosen for the published skin colors
    base : what scatters light back: "dermis", the white of "leucophore", the blue-green of "iridophore"
    """

    eumelanin: float = 1.0
    epidermis: float = 0.07
    gaps: float = 0.05
    base: Base = "dermis"

    def spectral_reflectance(self, amounts: ArrayLike) -> Array:
        """Return the reflectance at `spectra.WAVELENGTH`; no pigment makes any wavelength brighter.

        Parameters
        ----------
        amounts : (..., 8) in the order and units of `PIGMENTS`; negative ones count as none

        Returns
        -------
        (..., 76) in [0, 1]
        """
        return self._reflectance(amounts, *self._spectra())

    def spectral_albedo(self, amounts: ArrayLike) -> Array:
        """Return linear Rec.709 (..., 3) of amounts (..., 8), integrated over the whole spectrum: the reference.

        A channel that leaves the gamut downwards becomes 0, which takes a saturated yellow's last bit of saturation.
        """
        return np.maximum(self.spectral_reflectance(amounts) @ spectra.sensor(), 0.0)

    def albedo(self, amounts: ArrayLike) -> Array:
        """Return linear Rec.709 (..., 3) of amounts (..., 8) from 12 wavelengths: the twin of lib/pigment.glsl."""
        nodes = self._reflectance(amounts, *(spectrum[..., _COLUMNS] for spectrum in self._spectra()))
        return np.maximum(nodes @ _weights(self), 0.0)

    def glsl(self) -> str:
        """Return the constants of this skin as GLSL, to be included as "generated/pigments" by lib/pigment.glsl.

        Four wavelengths form a group; a matrix takes the amounts of four pigments to what they do to a group.
        """
        upper, deep, bare = (spectrum[..., _COLUMNS] for spectrum in self._spectra())

        def constant(kind: str, name: str, groups: list[Array]) -> str:
            entries = [f"{kind}({', '.join(f'{x:.9g}' for x in group.ravel())})" for group in groups]
            return f"const {kind} {name}[{_GROUPS}] = {kind}[{_GROUPS}](\n    " + ",\n    ".join(entries) + "\n);"

        return "\n".join(
            [
                f"const int PIGMENT_GROUPS = {_GROUPS};",
                f"const float PIGMENT_GAPS = float({self.gaps!r});",
                constant("mat4", "PIGMENT_UPPER", np.split(upper, _GROUPS, axis=1)),
                constant("mat4", "PIGMENT_DEEP", np.split(deep, _GROUPS, axis=1)),
                constant("vec4", "PIGMENT_BARE", np.split(bare, _GROUPS)),
                constant("mat4x3", "PIGMENT_WEIGHTS", np.split(_weights(self), _GROUPS)),
                "",
            ]
        )

    def _spectra(self) -> tuple[Array, Array, Array]:
        """Return, per unit of amount, two crossings' density (4, 76) of the upper pigments; the ratio (4, 76) of
        absorption to reduced scattering of the deep ones; and that of the bare base (76,).
        """
        scattering = _scattering(self.base)
        ommochromes = [2 * np.log(10) * spectra.band(*shape) for shape in _OMMOCHROMES]
        upper = np.stack([2 * self.epidermis * spectra.melanin(self.eumelanin), *ommochromes])
        deep = np.stack([spectra.blood(True), spectra.blood(False), spectra.bilirubin(), spectra.sulfurous_blood()])
        return upper, deep / scattering, spectra.bloodless_skin() / scattering

    def _reflectance(self, amounts: ArrayLike, upper: Array, deep: Array, bare: Array) -> Array:
        a = np.maximum(np.asarray(amounts, dtype=np.float64), 0.0)
        transmitted = np.exp(-(a[..., UPPER] @ upper))
        ratio = bare + a[..., DEEP] @ deep
        return half_space(ratio) * (self.gaps + (1 - self.gaps) * transmitted)


def half_space(ratio: ArrayLike) -> Array:
    """Return the diffuse reflectance of an infinitely deep medium under diffuse light.

    Parameters
    ----------
    ratio : (...) absorption over reduced scattering, 0 or more

    Returns
    -------
    (...) in [0, 1], falling; 1 without absorption. No boundary: what glossy reflection takes is counted elsewhere

    Notes
    -----
    [VanDeHulst1980], a closed-form fit; its inverse defines the single-scattering albedo that OpenPBR
    derives from a subsurface color, so that the published skin colors mean the same here.
    """
    k = np.asarray(ratio, dtype=np.float64)
    s = np.sqrt(k / (1 + k))
    return (1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s)


def _scattering(base: Base) -> Array:
    """Return the reduced scattering (76,) of a base in 1/mm.

    Leucophores scatter all wavelengths alike [Mathger2013]; a stack of iridophore plates one band, at 490 nm
    [Mathger2009]. The strengths and the band's width are chosen, not measured.
    """
    if base == "leucophore":
        return np.full_like(spectra.WAVELENGTH, 10.0)
    if base == "iridophore":
        return 0.3 + 4.0 * spectra.band(490.0, 40.0, 40.0)
    return spectra.collagen_scattering()


def random_amounts(count: int, seed: int) -> Array:
    """Return mixtures (count, 8) over the ranges of `PIGMENTS`: three pigments on average, small amounts more often."""
    rng = np.random.default_rng(seed)
    low, high = np.transpose([pigment.range for pigment in PIGMENTS])
    some = rng.random((count, len(PIGMENTS))) < 0.4
    return low + (high - low) * some * rng.random((count, len(PIGMENTS))) ** 2


@cache
def _weights(model: PigmentModel) -> Array:
    """Return (12, 3), what the reflectances at `NODES` add to linear Rec.709; each channel sums to 1.

    So white stays white. Least squares over mixtures of all pigments, weighted by the slope of the cube root, in
    which errors look equal.
    """
    spectrum = model.spectral_reflectance(random_amounts(1200, seed=1))
    target = spectrum @ spectra.sensor()
    nodes = spectrum[:, _COLUMNS]
    slope = (np.maximum(target, 0.0).mean(axis=1, keepdims=True) + 0.01) ** (-2 / 3)
    last = nodes[:, -1:]
    free = np.linalg.lstsq((nodes[:, :-1] - last) * slope, (target - last) * slope, rcond=None)[0]
    return np.vstack([free, 1 - free.sum(axis=0)])


def human(melanin: ArrayLike, blood: ArrayLike = 0.015, oxygenation: ArrayLike = 0.75) -> Array:
    """Return the amounts (..., 8) of human skin.

    Parameters
    ----------
    melanin : (...) volume fraction of the epidermis, 0.013 to 0.43 [Jacques1998]
    blood : (...) volume fraction of the dermis, 0.002 (pallor) to 0.07 (flushed)
    oxygenation : (...) share of the blood that carries oxygen, [0, 1]
    """
    m, b, o = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (melanin, blood, oxygenation)))
    none = np.zeros_like(m)
    return np.stack([m, b * o, b * (1 - o), *[none] * 5], axis=-1)


FITZPATRICK_MELANIN = (0.013, 0.023, 0.025, 0.118, 0.197, 0.43)
"""Melanin of the Fitzpatrick types I to VI: of the rising sequences within human bounds the one that, all else at its
default, lands nearest to the published colors, rounded. II and III lie close: their colors differ in hue, not in
melanin.
"""

#: albedo of the types I to VI in ACEScg [OpenPBR2024]
_FITZPATRICK_ACESCG = (
    (0.762, 0.652, 0.568),
    (0.671, 0.505, 0.371),
    (0.545, 0.445, 0.359),
    (0.351, 0.240, 0.148),
    (0.227, 0.157, 0.091),
    (0.073, 0.052, 0.025),
)


def fitzpatrick() -> tuple[Array, Array]:
    """Return the published albedos (6, 3) of the Fitzpatrick types I to VI in linear Rec.709, and the melanin (6,) of
    `human` that lands nearest to each [OpenPBR2024].
    """
    return np.array(_FITZPATRICK_ACESCG) @ ACESCG_TO_REC709.T, np.array(FITZPATRICK_MELANIN)
