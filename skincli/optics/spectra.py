"""Spectra from 400 to 700 nm in float64: blood, melanin, bilirubin, bare skin, and what the eye makes of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skincli.color import xyz_to_rgb

Array = NDArray[np.float64]

STEP = 4.0
"""Distance of the wavelengths of all spectra in nm: the tables below need no interpolation."""

WAVELENGTH: Array = np.arange(400.0, 700.0 + STEP, STEP)
"""(76,) nm."""

# Molar extinction of hemoglobin in water, base 10, 1/cm per mol/l: oxygenated and deoxygenated [Prahl1999].
# fmt: off
_HEMOGLOBIN = np.array([
    266232, 223296, 308716, 253368, 422320, 287356, 500200, 321344, 521880, 363848, 480360, 407560, 376236, 461200,
    283112, 500840, 214120, 552160, 132820, 547040, 102580, 413280, 81444, 282724, 67044, 173320, 58864, 62640,
    49496, 30698.8, 44480, 23388.8, 39807.2, 19260.8, 34870.8, 17025.6, 31620, 15310, 28850.8, 14792.8, 26629.2,
    14550, 25180.4, 15212.4, 24174.8, 15898, 23086.8, 17469.6, 21850.4, 19041.2, 20932.8, 20862, 20418, 22803.6,
    19996, 24745.2, 20150.4, 26936.8, 21001.6, 29263.2, 24202.4, 31589.6, 29269.2, 34397.6, 35990, 37490, 43876,
    40584, 49752, 43592, 53236, 46592, 52096, 49708, 46660, 52496, 39675.2, 54080, 34476.8, 54540, 32613.2, 53788,
    33915.6, 50572, 40172, 46948, 49172, 43340, 55540, 40092, 50104, 37020, 34639.6, 34332.8, 19763.2, 31075.2,
    10468.4, 25470, 5683.6, 19800, 3200, 14677.2, 2128, 12567.6, 1647.6, 10477.6, 1364.4, 8591.2, 1110, 7344.8, 942,
    6509.6, 774, 5906.8, 658.8, 5366.8, 561.2, 4930.8, 478.8, 4602.4, 442, 4345.2, 405.2, 4088.4, 379.2, 3857.6,
    356.8, 3642.64, 335.2, 3427.68, 319.6, 3226.56, 308.4, 3053.96, 298, 2881.4, 290, 2708.84, 282, 2554.4, 277.6,
    2407.92, 274.4, 2261.48, 274.4, 2115, 277.6, 2000.48, 282, 1897.56, 290, 1794.28,
]).reshape(-1, 2)
# Sulfhemoglobin from 452 nm, base 10, 1/cm per mmol/l of the tetramer [Zijlstra2000].
_SULFHEMOGLOBIN = np.array([
    47.84, 40.32, 35.2, 31.48, 28.88, 26.88, 25.64, 24.8, 24.48, 24.6, 24.88, 25.4, 26, 26.64, 27.12, 27.32, 27.04,
    26.24, 25.12, 23.8, 22.6, 22.16, 22.48, 23.6, 25.24, 26.96, 27.92, 28.12, 27.8, 26.76, 24.4, 22.48, 23.8, 27.72,
    30.36, 32.48, 34.6, 37.48, 42.16, 49.96, 61.16, 74.08, 83.64, 82.92, 70.16, 51.76, 35.2, 24.08, 17.16, 13,
    10.36, 8.68, 7.52, 6.64, 6, 5.48, 5.12, 4.76, 4.48, 4.28, 4.08, 3.96, 3.84,
])
# Relative power of the illuminant D65 every 10 nm from 400 nm; between them it is linear by definition [CIE2018].
_D65 = np.array([
    82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811, 109.354, 107.802,
    104.79, 107.689, 104.405, 104.046, 100, 96.3342, 95.788, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992,
    80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091,
])
# fmt: on

#: whole blood: grams of hemoglobin per liter, and its grams per mol [Prahl1999]
HEMOGLOBIN_DENSITY, HEMOGLOBIN_MOLAR_MASS = 150.0, 64_500.0

#: bilirubin: grams per mol, and the extinction of its band at the peak, 1/cm per mol/l [Dixon2005]
BILIRUBIN_MOLAR_MASS, BILIRUBIN_PEAK = 584.66, 55_000.0


def absorption(extinction: Array, density: float, molar_mass: float) -> Array:
    """Return the absorption coefficient in 1/mm (base e) of a solution.

    Parameters
    ----------
    extinction : (...) molar extinction, base 10, 1/cm per mol/l
    density : g/l
    molar_mass : g/mol
    """
    return np.log(10) * extinction * density / molar_mass / 10


def band(peak: float, below: float, above: float) -> Array:
    """Return (76,) a band of height 1: a Gaussian of one width (nm) below the peak and another above it."""
    return np.exp(-0.5 * ((WAVELENGTH - peak) / np.where(peak > WAVELENGTH, below, above)) ** 2)


def blood(oxygenated: bool) -> Array:
    """Return (76,) 1/mm, the absorption of whole blood, all of it oxygenated or none [Prahl1999]."""
    return absorption(_HEMOGLOBIN[:, 0 if oxygenated else 1], HEMOGLOBIN_DENSITY, HEMOGLOBIN_MOLAR_MASS)


def sulfurous_blood() -> Array:
    """Return (76,) 1/mm, the absorption of whole blood whose hemoglobin has all become sulfhemoglobin [Zijlstra2000].

    Below 452 nm, where the table ends, the Soret band is taken to have the shape of oxyhemoglobin's.
    """
    soret = _HEMOGLOBIN[:, 0]
    known = len(_SULFHEMOGLOBIN)
    joined = np.append(soret[:-known] * _SULFHEMOGLOBIN[0] / soret[-known], _SULFHEMOGLOBIN)
    return absorption(1000 * joined, HEMOGLOBIN_DENSITY, HEMOGLOBIN_MOLAR_MASS)


def bilirubin() -> Array:
    """Return (76,) 1/mm per g/l: a band at 452 nm whose two widths follow the measured spectrum [Dixon2005]."""
    return absorption(BILIRUBIN_PEAK * band(452, 40, 25), 1.0, BILIRUBIN_MOLAR_MASS)


def melanin(eumelanin: float) -> Array:
    """Return (76,) 1/mm, the absorption of the inside of a melanosome.

    Parameters
    ----------
    eumelanin : share of eumelanin in [0, 1] [Jacques1998]; the rest is pheomelanin [Donner2006]
    """
    return 0.1 * (eumelanin * 6.6e11 * WAVELENGTH**-3.33 + (1 - eumelanin) * 2.9e15 * WAVELENGTH**-4.75)


def bloodless_skin() -> Array:
    """Return (76,) 1/mm, the absorption of skin without blood or melanin [Jacques1998]."""
    return 0.1 * (0.244 + 85.3 * np.exp(-(WAVELENGTH - 154) / 66.2))


def collagen_scattering() -> Array:
    """Return (76,) 1/mm, the reduced scattering of dermis: Mie's by large fibers, Rayleigh's by small [Jacques1998]."""
    return 0.1 * (2e5 * WAVELENGTH**-1.5 + 2e12 * WAVELENGTH**-4.0)


def _lobe(peak: float, below: float, above: float) -> Array:
    return band(peak, 1 / below, 1 / above)


def sensor() -> Array:
    """Return (76, 3): a reflectance times this is linear Rec.709 under D65; a white one gives (1, 1, 1).

    The CIE 1931 matching functions are the fits of [Wyman2013]. What they miss of D65's white, 0.3 %, is taken out per
    channel.
    """
    x = (
        0.362 * _lobe(442.0, 0.0624, 0.0374)
        + 1.056 * _lobe(599.8, 0.0264, 0.0323)
        - 0.065 * _lobe(501.1, 0.049, 0.0382)
    )
    y = 0.821 * _lobe(568.8, 0.0213, 0.0247) + 0.286 * _lobe(530.9, 0.0613, 0.0322)
    z = 1.217 * _lobe(437.0, 0.0845, 0.0278) + 0.681 * _lobe(459.0, 0.0385, 0.0725)
    light = np.interp(WAVELENGTH, 400.0 + 10.0 * np.arange(len(_D65)), _D65)
    rgb = xyz_to_rgb(np.stack([x, y, z], axis=-1) * light[:, None])
    return rgb / rgb.sum(axis=0)
