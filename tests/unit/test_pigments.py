"""Color from pigments: published skin colors, laws of the model, and the few wavelengths against the many."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from skincli import color
from skincli.optics import spectra
from skincli.optics.pigments import (
    DEEP,
    NODES,
    PIGMENTS,
    UPPER,
    Base,
    PigmentModel,
    fitzpatrick,
    half_space,
    human,
    random_amounts,
)

BASES: tuple[Base, ...] = ("dermis", "leucophore", "iridophore")
NAMES = [pigment.name for pigment in PIGMENTS]


def amounts(**named: float) -> NDArray[np.float64]:
    """Return the eight amounts of a bare skin with these pigments."""
    result = np.zeros(len(PIGMENTS))
    for name, value in named.items():
        result[NAMES.index(name)] = value
    return result


def hue(rgb: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return lightness, chroma and hue angle (degrees) in CIELAB."""
    L, a, b = color.rgb_to_lab(rgb)
    return float(L), float(np.hypot(a, b)), float(np.degrees(np.arctan2(b, a)) % 360)


def difference(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    return color.ciede2000(color.rgb_to_lab(first), color.rgb_to_lab(second))


def test_the_two_vectors_of_the_shader_hold_the_layers_where_it_looks_for_them() -> None:
    """lib/pigment.glsl reads upper pigments from a.x and b.yzw, deep ones from a.yzw and b.x."""
    assert UPPER == (0, 5, 6, 7)
    assert DEEP == (1, 2, 3, 4)


def test_six_skin_types_from_melanin_alone() -> None:
    published, melanin = fitzpatrick()
    assert (np.diff(melanin) > 0).all()
    assert melanin.min() >= 0.013
    assert melanin.max() <= 0.43
    far = difference(PigmentModel().albedo(human(melanin)), published)
    assert np.median(far) <= 5.5
    assert far.max() <= 8.8


def test_no_other_melanin_within_human_bounds_lands_nearer() -> None:
    published, melanin = fitzpatrick()
    model = PigmentModel()
    anywhere = model.albedo(human(np.geomspace(0.013, 0.43, 200)))
    best = difference(anywhere[:, None], published).min(axis=0)
    assert (difference(model.albedo(human(melanin)), published) <= best + 0.1).all()


@pytest.mark.parametrize("base", BASES)
def test_twelve_wavelengths_stand_for_the_spectrum(base: Base) -> None:
    for model in (PigmentModel(base=base), PigmentModel(eumelanin=0.5, epidermis=0.1, base=base)):
        mixtures = random_amounts(4000, seed=7)
        skins = human(*np.meshgrid(np.linspace(0, 0.5, 8), np.linspace(0, 0.1, 8), np.linspace(0, 1, 5)))
        high = np.array([pigment.range[1] for pigment in PIGMENTS])
        alone = np.linspace(0, 1, 11)[:, None, None] * np.diag(high)
        for batch in (mixtures, skins, alone):
            assert difference(model.albedo(batch), model.spectral_albedo(batch)).max() < 0.5


@pytest.mark.parametrize("base", BASES)
def test_no_pigment_brightens_any_wavelength(base: Base) -> None:
    model = PigmentModel(base=base)
    some = random_amounts(200, seed=2)
    before = model.spectral_reflectance(some)
    assert before.min() > 0
    assert before.max() < 1
    for i, pigment in enumerate(PIGMENTS):
        more = some.copy()
        more[:, i] += 0.1 * pigment.range[1]
        assert (model.spectral_reflectance(more) <= before * (1 + 1e-12)).all()
        assert (color.luminance(model.albedo(more)) < color.luminance(model.albedo(some)) + 1e-5).all()


def test_upper_pigments_add_density() -> None:
    """Two layers of upper pigment transmit the product of what each transmits, once the light between grains is out."""
    model = PigmentModel(gaps=0.0)
    one, two = amounts(melanin=0.1, xanthommatin=0.4), amounts(melanin=0.05, ommin=0.3)
    bare, first, second, both = (model.spectral_reflectance(a) for a in (amounts(), one, two, one + two))
    np.testing.assert_allclose(both / bare, (first / bare) * (second / bare), rtol=1e-12)


def test_upper_density_follows_from_units() -> None:
    """An optical density of 1 for one crossing lets 1 % back at the peak; melanin crosses its layer's millimeters."""
    model = PigmentModel(gaps=0.0, epidermis=0.05)
    peak = np.flatnonzero(spectra.WAVELENGTH == 440)[0]
    skins = amounts(), amounts(xanthommatin=1), amounts(melanin=0.2)
    bare, sac, brown = (model.spectral_reflectance(skin)[peak] for skin in skins)
    assert sac / bare == pytest.approx(0.01, rel=1e-12)
    melanosome = 6.6e11 * 440**-3.33 / 10  # 1/mm
    assert brown / bare == pytest.approx(np.exp(-2 * 0.05 * 0.2 * melanosome), rel=1e-12)


def test_blood_absorbs_as_tabulated() -> None:
    """[Prahl1999]: mu = 2.303 e (150 g/l) / (64500 g/mol), in 1/cm; the other pigments as cited."""
    at = list(spectra.WAVELENGTH)
    assert spectra.blood(True)[at.index(576)] == pytest.approx(2.302585 * 55540 * 150 / 64500 / 10, rel=1e-6)
    assert spectra.blood(False)[at.index(556)] == pytest.approx(2.302585 * 54540 * 150 / 64500 / 10, rel=1e-6)
    green = spectra.sulfurous_blood()
    assert at[int(np.argmax(green[at.index(500) :])) + at.index(500)] == 620
    jump = np.diff(green[at.index(444) : at.index(460)])
    assert (jump < 0).all()  # the borrowed part below 452 nm meets the table
    assert spectra.bilirubin()[at.index(452)] == pytest.approx(2.302585 * 55000 / 584.66 / 10, rel=1e-6)


def test_white_is_white() -> None:
    np.testing.assert_allclose(spectra.sensor().sum(axis=0), 1.0, rtol=1e-14)
    # A band at 600 nm is orange, one at 540 nm green, one at 450 nm blue.
    for peak, channel in ((600, 0), (540, 1), (450, 2)):
        assert np.argmax(spectra.band(peak, 10, 10) @ spectra.sensor()) == channel


def test_half_space() -> None:
    """[VanDeHulst1980]: 1 without absorption, 0 without scattering, and the inverse that OpenPBR uses in between."""
    assert half_space(0.0) == 1.0
    assert half_space(1e12) == pytest.approx(0.0, abs=1e-9)
    ratio = np.geomspace(1e-4, 1e2, 50)
    C = half_space(ratio)
    assert (np.diff(C) < 0).all()
    s = 4.09712 + 4.20863 * C - np.sqrt(9.59217 + 41.6808 * C + 17.7126 * C * C)
    np.testing.assert_allclose(s * s, ratio / (1 + ratio), atol=2e-4)


def test_colors_have_their_names() -> None:
    skin, white = PigmentModel(), PigmentModel(base="leucophore")
    alive = skin.albedo(human(0.02))
    flushed, pale = skin.albedo(human(0.02, blood=0.05)), skin.albedo(human(0.02, blood=0.002))
    livor = skin.albedo(human(0.02, blood=0.05, oxygenation=0.05))
    assert flushed[0] / flushed[1] > alive[0] / alive[1] > pale[0] / pale[1] > 1  # blood reddens
    assert color.luminance(pale) > color.luminance(alive) > color.luminance(flushed) > color.luminance(livor)
    assert livor[0] / flushed[0] < livor[2] / flushed[2]  # without oxygen, red goes and blue stays: violet
    assert not 60 < hue(livor)[2] < 330
    bruise = skin.albedo(human(0.02) + amounts(bilirubin=0.2))
    assert 75 < hue(bruise)[2] < 100  # yellow
    decay = skin.albedo(human(0.02, blood=0.002) + amounts(sulfhemoglobin=0.03, bilirubin=0.05))
    assert decay[1] > decay[0]  # green
    assert decay[1] > decay[2]
    assert 70 < hue(white.albedo(amounts(xanthommatin=0.8)))[2] < 105  # yellow to ochre
    assert 10 < hue(white.albedo(amounts(reduced_xanthommatin=0.8)))[2] < 60  # red to orange
    dark = hue(white.albedo(amounts(ommin=1.0)))
    assert dark[0] < 40
    assert dark[1] < 30
    assert hue(white.albedo(amounts()))[1] < 10
    assert 140 < hue(PigmentModel(base="iridophore").albedo(amounts()))[2] < 220  # blue-green


def test_the_constants_are_the_models_own() -> None:
    """Only what changes the numbers changes the text, and thereby the key of a program."""
    text = PigmentModel().glsl()
    assert text == PigmentModel().glsl()
    others = [PigmentModel(0.5), PigmentModel(epidermis=0.1), PigmentModel(gaps=0.1), PigmentModel(base="leucophore")]
    assert len({text, *(model.glsl() for model in others)}) == 5
    assert f"PIGMENT_GROUPS = {len(NODES) // 4};" in text
    assert set(NODES) <= set(spectra.WAVELENGTH.astype(int))
