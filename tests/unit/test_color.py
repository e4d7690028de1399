"""Color science against published numbers and against its own inverses."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from skincli import color

# Sharma, Wu and Dalal 2005, Table 1: all 34 pairs.
SHARMA = np.array(
    [
        [50.0000, 2.6772, -79.7751, 50.0000, 0.0000, -82.7485, 2.0425],
        [50.0000, 3.1571, -77.2803, 50.0000, 0.0000, -82.7485, 2.8615],
        [50.0000, 2.8361, -74.0200, 50.0000, 0.0000, -82.7485, 3.4412],
        [50.0000, -1.3802, -84.2814, 50.0000, 0.0000, -82.7485, 1.0000],
        [50.0000, -1.1848, -84.8006, 50.0000, 0.0000, -82.7485, 1.0000],
        [50.0000, -0.9009, -85.5211, 50.0000, 0.0000, -82.7485, 1.0000],
        [50.0000, 0.0000, 0.0000, 50.0000, -1.0000, 2.0000, 2.3669],
        [50.0000, -1.0000, 2.0000, 50.0000, 0.0000, 0.0000, 2.3669],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0009, 7.1792],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0010, 7.1792],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0011, 7.2195],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0012, 7.2195],
        [50.0000, -0.0010, 2.4900, 50.0000, 0.0009, -2.4900, 4.8045],
        [50.0000, -0.0010, 2.4900, 50.0000, 0.0010, -2.4900, 4.8045],
        [50.0000, -0.0010, 2.4900, 50.0000, 0.0011, -2.4900, 4.7461],
        [50.0000, 2.5000, 0.0000, 50.0000, 0.0000, -2.5000, 4.3065],
        [50.0000, 2.5000, 0.0000, 73.0000, 25.0000, -18.0000, 27.1492],
        [50.0000, 2.5000, 0.0000, 61.0000, -5.0000, 29.0000, 22.8977],
        [50.0000, 2.5000, 0.0000, 56.0000, -27.0000, -3.0000, 31.9030],
        [50.0000, 2.5000, 0.0000, 58.0000, 24.0000, 15.0000, 19.4535],
        [50.0000, 2.5000, 0.0000, 50.0000, 3.1736, 0.5854, 1.0000],
        [50.0000, 2.5000, 0.0000, 50.0000, 3.2972, 0.0000, 1.0000],
        [50.0000, 2.5000, 0.0000, 50.0000, 1.8634, 0.5757, 1.0000],
        [50.0000, 2.5000, 0.0000, 50.0000, 3.2592, 0.3350, 1.0000],
        [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
        [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630],
        [61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731],
        [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
        [22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373],
        [36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
        [90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441],
        [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
        [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
        [2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082],
    ]
)


def test_srgb_curve_hits_the_standard_and_inverts() -> None:
    assert color.srgb_encode([0.0, 1.0]).tolist() == [0.0, pytest.approx(1.0, abs=1e-15)]
    assert float(color.srgb_decode(0.5)) == pytest.approx(0.21404114048223255, abs=1e-15)
    x = np.linspace(-0.2, 4.0, 4001)
    np.testing.assert_allclose(color.srgb_decode(color.srgb_encode(x)), x, atol=3e-8)
    v = np.arange(65536) / 65535
    np.testing.assert_allclose(color.srgb_encode(color.srgb_decode(v)), v, atol=1e-7)


def test_srgb_pieces_meet() -> None:
    below, above = color.srgb_encode(0.0031308), color.srgb_encode(np.nextafter(0.0031308, 1))
    assert abs(float(above - below)) < 1e-7


def test_luminance_is_the_y_row() -> None:
    assert color.REC709_LUMA.sum() == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(color.REC709_TO_XYZ[1], color.REC709_LUMA, atol=5e-5)
    assert color.luminance(np.ones((2, 4, 3))).shape == (2, 4)


def test_xyz_and_lab_of_white_and_inverses() -> None:
    np.testing.assert_allclose(color.rgb_to_xyz([1, 1, 1]), [0.95046, 1.0, 1.08906], atol=1e-5)
    np.testing.assert_allclose(color.rgb_to_lab([[1, 1, 1], [0, 0, 0]]), [[100, 0, 0], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(color.rgb_to_lab([1, 0, 0]), [53.24, 80.09, 67.20], atol=0.02)
    rgb = np.random.default_rng(1).random((50, 3))
    np.testing.assert_allclose(color.xyz_to_rgb(color.lab_to_xyz(color.rgb_to_lab(rgb))), rgb, atol=1e-13)


def test_ciede2000_meets_the_published_pairs() -> None:
    forth = color.ciede2000(SHARMA[:, 0:3], SHARMA[:, 3:6])
    back = color.ciede2000(SHARMA[:, 3:6], SHARMA[:, 0:3])
    np.testing.assert_allclose(forth, SHARMA[:, 6], atol=5.1e-5)
    np.testing.assert_allclose(back, forth, atol=1e-12)
    assert color.ciede2000(SHARMA[:, 0:3], SHARMA[:, 0:3]).max() == 0.0


def test_neutral_display_laws() -> None:
    assert color.neutral_display([0.0, 0.0, 0.0]).tolist() == [0, 0, 0]
    below = [0.79, 0.34, 0.19]
    np.testing.assert_array_equal(color.neutral_display(below), below)
    gray = np.geomspace(1e-4, 1e4, 500)[:, None] * np.ones(3)
    shown = color.neutral_display(gray)[:, 0]
    assert np.all(np.diff(shown) > 0)
    assert shown[0] > 0
    assert shown[-1] < 1


def test_neutral_display_follows_the_published_shoulder() -> None:
    """Computed by hand from the published shader, without its toe and so with the start at 0.8."""
    peak, start = 2.0, 0.8
    bent = 1 - 0.2**2 / (peak + 0.2 - start)
    share = 1 - 1 / (0.15 * (peak - bent) + 1)
    expected = np.array([2.0, 1.0, 0.5]) * bent / peak * (1 - share) + bent * share
    np.testing.assert_allclose(color.neutral_display([2.0, 1.0, 0.5]), expected, atol=1e-14)


def test_acescg_matrix() -> None:
    published = [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]]
    np.testing.assert_allclose(color.ACESCG_TO_REC709, published, atol=1.5e-5)
    np.testing.assert_allclose(color.ACESCG_TO_REC709 @ np.ones(3), np.ones(3), atol=1e-12)
    source = np.random.default_rng(3).random((4, 4, 3)).astype(np.float32)
    through_ocio = oiio.ImageBufAlgo.colorconvert(oiio.ImageBuf(source), "ACEScg", "lin_rec709_scene")
    expected = np.asarray(through_ocio.get_pixels(oiio.FLOAT), dtype=np.float64)
    np.testing.assert_allclose(np.asarray(source @ color.ACESCG_TO_REC709.T), expected, atol=2e-5)
