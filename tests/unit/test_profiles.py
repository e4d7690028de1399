"""Diffusion profiles: numbers against their sources, laws against quadrature, fits against their claims."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from skincli.errors import InputError
from skincli.optics import dipole, gaussians, profiles
from skincli.optics.diffusion import burley_width
from skincli.optics.dipole import Dipole, Layer, Multipole
from skincli.optics.gaussians import HUMAN, Floats, GaussianSum, Profile, fit, single
from skincli.optics.profiles import Burley, from_color, from_medium, preset
from skincli.reference import responses

SLAB = Path(__file__).parents[3] / "shared" / "data" / "reference" / "slab_profiles.json"

GREY = (1.0, 1.0, 1.0)
OPENPBR = ((0.799, 0.485, 0.347), (0.482, 0.169, 0.109))
SKIN = Multipole(
    (
        Layer((0.21, 0.21, 0.5), (4.8, 6.0, 6.5), 0.25, 1.4),
        Layer((0.016, 0.019, 0.03), (3.2, 4.0, 4.6), 0.5, 1.34),
        Layer((0.085, 1.0, 2.5), (2.0, 2.1, 2.2), math.inf, 1.4),
    )
)
"""Three layers of about human thickness: made up, to exercise the method."""

ALL: dict[str, Profile] = {
    **profiles.PRESETS,
    "single": single((1.2, 0.5, 0.3), (0.48, 0.27, 0.2)),
    "burley": from_color(*OPENPBR, "mfp"),
    "layers": SKIN,
}


# --- numbers against their sources ------------------------------------------------------------------------------------


def human_is_as_published(profile: GaussianSum) -> bool:
    """Tell whether sums, mean radii and rms radii are those worked out from the published table [dEon2007]."""
    variances, weights = np.array(profile.variances), np.array(profile.weights)
    mean = np.sqrt(np.pi / 2 * variances) @ weights
    rms = np.sqrt(profile.mean_square_radius())
    return bool(
        np.allclose(profile.total(), 1.0, rtol=0, atol=1e-12)
        and np.allclose(mean, (1.121, 0.259, 0.167), rtol=0, atol=6e-4)
        and np.allclose(rms, (1.663, 0.369, 0.223), rtol=0, atol=6e-4)
    )


def test_the_human_table_and_that_an_error_in_it_is_seen() -> None:
    assert human_is_as_published(HUMAN)
    for row in range(6):
        for channel in range(3):
            weights = np.array(HUMAN.weights)
            weights[row, channel] += 0.01
            assert not human_is_as_published(dataclasses.replace(HUMAN, weights=tuple(map(tuple, weights.tolist()))))
        variances = list(HUMAN.variances)
        variances[row] *= 1.1
        assert not human_is_as_published(dataclasses.replace(HUMAN, variances=tuple(variances)))


Width = Callable[[Sequence[float], Sequence[float], str], Floats]
COEFFICIENTS: dict[str, tuple[float, ...]] = {
    "mfp": (1.9, 1.0, 3.5, 0.8, 2.0),
    "dmfp": (3.5, 0.0, 100.0, 0.33, 4.0),
    "d": (1.0, 0.0, 0.0, 0.0, 1.0),
}
"""Of s(A) = a - b A + c (A - e)^f, the scaling of diffuse transmission and that by the diffuse mean free path."""


def fits_are_as_published(width: Width) -> bool:
    """Tell whether width = length / s(A), with s worked out by hand from the printed fits at some albedos."""
    table = {
        "mfp": ((0.0, 4.14), (0.3, 2.475), (0.8, 1.1), (1.0, 1.04)),
        "dmfp": ((0.0, 4.685921), (0.33, 3.5), (0.83, 9.75), (1.0, 23.651121)),
        "d": ((0.0, 1.0), (0.4, 1.0), (1.0, 1.0)),
    }
    return all(
        np.allclose(width((1.0, 2.0, 3.0), (color,) * 3, kind), np.array([1.0, 2.0, 3.0]) / scaling, rtol=1e-6)
        for kind, rows in table.items()
        for color, scaling in rows
    )


def test_which_radius_is_meant_and_that_an_error_in_the_fits_is_seen() -> None:
    def with_coefficients(table: dict[str, tuple[float, ...]]) -> Width:
        def width(radius: Sequence[float], color: Sequence[float], kind: str) -> Floats:
            a, b, c, e, f = table[kind]
            A = np.asarray(color)
            return np.asarray(radius) / (a - b * A + c * np.abs(A - e) ** f)

        return width

    assert fits_are_as_published(burley_width)
    assert fits_are_as_published(lambda radius, color, kind: np.array(from_color(color, radius, kind).width))
    assert fits_are_as_published(with_coefficients(COEFFICIENTS))
    for kind in ("mfp", "dmfp"):
        for place, value in enumerate(COEFFICIENTS[kind]):
            wrong = list(COEFFICIENTS[kind])
            wrong[place] = value + 0.01
            assert not fits_are_as_published(with_coefficients({**COEFFICIENTS, kind: tuple(wrong)}))


def skin_is_as_published(medium: Dipole, measured: tuple[float, ...], rms: tuple[float, ...]) -> bool:
    """Tell whether the dipole has the diffuse reflectance that [Jensen2001] prints beside the coefficients."""
    return bool(
        np.allclose(medium.total(), measured, rtol=0, atol=0.0075)
        and np.allclose(np.sqrt(medium.mean_square_radius()), rms, rtol=0, atol=6e-3)
    )


@pytest.mark.parametrize(
    ("name", "measured", "rms"),
    [
        ("jensen_skin1", (0.44, 0.22, 0.13), (4.13, 1.83, 1.01)),
        ("jensen_skin2", (0.63, 0.44, 0.34), (4.37, 1.91, 1.33)),
    ],
)
def test_jensens_skins_and_that_an_error_in_them_is_seen(
    name: str, measured: tuple[float, ...], rms: tuple[float, ...]
) -> None:
    medium = preset(name)
    assert isinstance(medium, Dipole)
    assert skin_is_as_published(medium, measured, rms)
    for field in ("sigma_a", "sigma_s_prime"):
        for channel in range(3):
            values = list(getattr(medium, field))
            values[channel] *= 1.1
            assert not skin_is_as_published(
                Dipole(**{**dataclasses.asdict(medium), field: tuple(values)}), measured, rms
            )
    assert not skin_is_as_published(dataclasses.replace(medium, eta=1.4), measured, rms)


# --- laws -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ALL)
def test_each_profile_integrates_to_its_albedo(name: str) -> None:
    profile = ALL[name]
    total = profile.total()
    assert total.shape == (3,)
    assert (total > 0).all()
    assert (total <= 1 + 1e-12).all()
    np.testing.assert_allclose(responses.spot(profile, responses.FAR), total, rtol=1e-8)
    np.testing.assert_allclose(profile.edge(1e5), total, rtol=1e-10)
    np.testing.assert_allclose(profile.edge(-1e5), 0, atol=1e-10)
    np.testing.assert_allclose(profile.edge(0.0), total / 2, rtol=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_responses_agree_with_quadrature_of_the_profile(name: str) -> None:
    profile = ALL[name]
    for length in (0.03, 0.4, 5.0):
        np.testing.assert_allclose(profile.spot(length), responses.spot(profile, length), rtol=0, atol=1e-8)
        np.testing.assert_allclose(profile.edge(length), responses.edge(profile, length), rtol=0, atol=1e-8)
        np.testing.assert_allclose(profile.edge(-length), responses.edge(profile, -length), rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ALL)
def test_values_keep_their_shape_and_channels_apart(name: str) -> None:
    profile = ALL[name]
    r = np.array([[0.1, 0.2, 2.0], [3.0, 4.0, 30.0]])
    for method in (profile.radial, profile.edge, profile.spot):
        values = method(r)
        assert values.shape == (2, 3, 3)
        np.testing.assert_allclose(values[1, 0], method(3.0), rtol=1e-6, atol=1e-12)
    assert (np.diff(profile.edge(np.linspace(-3, 3, 31)), axis=0) > -1e-12).all()


def test_moments_of_normalized_diffusion() -> None:
    d = 0.7
    profile = Burley(GREY, (d, d, d))
    t = np.linspace(math.log(1e-9), math.log(120 * d), 4001)
    r = np.exp(t)
    density = 2 * np.pi * r**2 * profile.radial(r)[:, 0]
    for power, moment in ((0, 1.0), (1, 2.5 * d), (2, 14 * d**2)):
        assert np.trapezoid(density * r**power, t) == pytest.approx(moment, rel=1e-6)
    # [Christensen2015]: the cumulative distribution, and where three renderers cut it off.
    np.testing.assert_allclose(profile.spot(16 * d), 0.996379, atol=1e-6)
    np.testing.assert_allclose(profile.spot(d), 1 - math.exp(-1) / 4 - 0.75 * math.exp(-1 / 3), rtol=1e-12)


def test_one_gaussian_is_the_normal_distribution() -> None:
    """And a sum of one variance is one term, whatever the channels weigh."""
    profile = single(2.0, (1.0, 0.5, 0.0))
    assert profile.variances == (4.0,)
    np.testing.assert_allclose(profile.edge(2.0), 0.8413447460685429 * np.array([1, 0.5, 0]), rtol=1e-12)
    np.testing.assert_allclose(profile.spot(2.0), (1 - math.exp(-0.5)) * np.array([1, 0.5, 0]), rtol=1e-12)
    assert single((1.0, 2.0, 1.0), GREY).weights == ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0))


def test_a_matched_boundary_reflects_nothing_and_a_denser_medium_more() -> None:
    assert dipole.internal_reflection(1.0) == 1.0
    # F by hand from the polynomial that [Jensen2001] prints.
    assert dipole.internal_reflection(1.3) == pytest.approx((1 + 0.444763) / (1 - 0.444763), rel=1e-5)
    assert dipole.internal_reflection(1.4) == pytest.approx((1 + 0.529489) / (1 - 0.529489), rel=1e-5)
    assert dipole.internal_reflection(1 / 1.4) < 1.7 < dipole.internal_reflection(1.2)


# --- layers -----------------------------------------------------------------------------------------------------------


def test_one_thick_layer_is_the_dipole() -> None:
    medium = from_medium((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.4)
    x = np.array([0.05, 0.7, 4.0, 15.0])
    for thickness in (math.inf, 400.0):
        layers = Multipole((Layer(medium.sigma_a, medium.sigma_s_prime, thickness, 1.4),))
        np.testing.assert_allclose(layers.total(), medium.total(), rtol=1e-9)
        np.testing.assert_allclose(layers.edge(x), medium.edge(x), atol=1e-9)
        np.testing.assert_allclose(layers.spot(x), medium.spot(x), atol=1e-9)
        np.testing.assert_allclose(layers.radial(x), medium.radial(x), rtol=1e-6, atol=1e-10)


def test_a_slab_is_the_sum_of_dipole_pairs_in_real_space() -> None:
    """[Donner2005]: R(r) as a sum over pairs at 2 i (d + zb0 + zbd) + l; 11 of them are within 0.01 % of all."""
    sigma_a, sigma_s, d, ior = 0.3, 2.0, 1.5, 1.4
    extinction = sigma_a + sigma_s
    depth, transport = 1 / extinction, math.sqrt(3 * sigma_a * extinction)
    beyond = 2 * dipole.internal_reflection(ior) / (3 * extinction)
    r = np.array([0.0, 0.3, 1.0, 4.0])

    def sent(z: float) -> Floats:
        distance = np.hypot(r, z)
        return z * (1 + transport * distance) * np.exp(-transport * distance) / (4 * np.pi * distance**3)

    pairs = [2 * i * (d + 2 * beyond) + depth for i in range(-5, 6)]
    expected = sigma_s / extinction * sum(sent(z) - sent(z - 2 * depth - 2 * beyond) for z in pairs)
    slab = Multipole((Layer((sigma_a,) * 3, (sigma_s,) * 3, d, ior),))
    np.testing.assert_allclose(slab.radial(r)[:, 0], expected, rtol=1e-4)


def test_cutting_a_layer_in_two_changes_little() -> None:
    """Light that bounces between the halves is all counted; what stays is the method's own error at matched borders."""
    whole = Layer((0.05,) * 3, (2.0,) * 3, math.inf, 1.4)
    cut = Multipole((dataclasses.replace(whole, thickness=3.0), whole))
    np.testing.assert_allclose(cut.total(), Multipole((whole,)).total(), rtol=0.03)


def test_a_dark_floor_darkens_and_narrows() -> None:
    over, dark = SKIN.layers[:2], Layer((50.0,) * 3, (0.1,) * 3, math.inf, 1.4)
    darker = Multipole((*over, dark))
    assert (darker.total() < SKIN.total()).all()
    assert (darker.edge(1.0) / darker.total() > SKIN.edge(1.0) / SKIN.total())[0]


def test_layers_that_the_method_cannot_serve_are_refused() -> None:
    with pytest.raises(InputError, match=r"layer 2 is 0\.1 mm thick, less than its mean free path, 0\.311 mm"):
        Multipole((SKIN.layers[0], Layer((0.016,) * 3, (3.2,) * 3, 0.1, 1.4)))
    with pytest.raises(InputError, match="layer 1 is infinitely thick"):
        Multipole((SKIN.layers[2], SKIN.layers[0]))
    with pytest.raises(InputError, match="at least one"):
        Multipole(())
    with pytest.raises(InputError, match=r"sigma_a is \[0\.0, 1\.0, 1\.0\]; each value must be finite and above 0"):
        from_medium((0, 1, 1), (1, 1, 1), 1.4)
    with pytest.raises(InputError, match="did you mean 'human'"):
        preset("humn")
    with pytest.raises(InputError, match="kind 'mean'"):
        from_color((0.5,) * 3, (1.0,) * 3, "mean")


# --- fits -------------------------------------------------------------------------------------------------------------


def measured_error(profile: Profile, found: GaussianSum) -> float:
    x = np.geomspace(1e-4, 200, 901)
    return float(np.abs((found.edge(x) - profile.edge(x)) / profile.total()).max())


@pytest.mark.parametrize(
    ("profile", "errors"),
    [
        (Burley(GREY, GREY), (0.060, 0.0150, 0.0051, 0.0022, 0.0011)),
        (from_color(*OPENPBR, "mfp"), (0.21, 0.050, 0.018, 0.0088, 0.0047)),
        (HUMAN, (0.18, 0.027, 0.0058, 0.0024, 0.0004)),
        (preset("jensen_skin1"), (0.14, 0.021, 0.0042, 0.0013, 0.0006)),
        (SKIN, (0.18, 0.06, 0.02, 0.008, 0.004)),
    ],
    ids=["burley", "openpbr", "human", "jensen", "layers"],
)
def test_few_shared_gaussians_fit_every_profile(profile: Profile, errors: tuple[float, ...]) -> None:
    for terms, most in enumerate(errors, 1):
        found = fit(profile, terms)
        assert len(found.variances) == terms
        assert list(found.variances) == sorted(found.variances)
        assert np.min(found.weights) >= 0
        np.testing.assert_allclose(found.total(), profile.total(), rtol=1e-12)
        assert found.edge_error <= most
        assert measured_error(profile, found) <= found.edge_error * 1.05 + 1e-5


def test_a_sum_of_gaussians_is_its_own_fit() -> None:
    found = fit(HUMAN, 6)
    assert (found.variances, found.weights, found.edge_error) == (HUMAN.variances, HUMAN.weights, 0.0)


def test_fits_scale_with_the_profile_repeat_and_leave_black_channels_black() -> None:
    small, large = (fit(Burley((0.8, 0.0, 0.4), (d, d, d / 2)), 3) for d in (0.2, 200.0))
    np.testing.assert_allclose(np.sqrt(large.variances), 1000 * np.sqrt(small.variances), rtol=1e-2)
    np.testing.assert_array_equal(np.array(small.weights)[:, 1], 0)
    gaussians.fit.cache_clear()
    again = fit(Burley((0.8, 0.0, 0.4), (0.2, 0.2, 0.1)), 3)
    assert again == small
    with pytest.raises(ValueError, match="at least one"):
        fit(HUMAN, 0)


# --- the truth --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(not SLAB.exists(), reason="the Monte-Carlo profiles are not at hand")
def test_the_dipole_is_off_by_what_is_claimed() -> None:
    data = json.loads(SLAB.read_text("utf-8"))
    channels = list(data["channels"].values())
    for ior, low, high in ((1.0, 0.03, 0.18), (1.4, 0.02, 0.31)):
        medium = from_medium([c["sigma_a"] for c in channels], [c["sigma_s"] for c in channels], ior)
        stated = [c[f"n={ior}"]["dipole_albedo"] for c in channels]
        np.testing.assert_allclose(medium.total(), stated, atol=6e-6)
        truth = np.array([c[f"n={ior}"]["albedo"] for c in channels])
        error = np.abs(medium.total() / truth - 1)
        assert low < error.min() < error.max() < high
        # Close to the source it misses most of the light that scatters once or twice.
        near = np.array([c[f"n={ior}"]["radial"][0] for c in channels])
        assert (medium.radial(0.05) < 0.15 * near).all()
    # Their own dipole, averaged over rings, pins radial(), not only its integral.
    edges = np.array(data["r_edges"])
    rings = np.diff(medium.spot(edges), axis=0) / (np.pi * np.diff(edges**2))[:, None]
    theirs = np.stack([c["n=1.4"]["dipole_radial"] for c in channels], axis=1)
    np.testing.assert_allclose(rings[:10], theirs[:10], rtol=2e-2)
