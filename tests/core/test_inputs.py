"""Arrays are checked once, on entry, and refused in one sentence that names the value."""

from collections.abc import Callable

import numpy as np
import pytest

from stereolag.core.arrays import median, percentiles
from stereolag.core.inputs import as_grey, as_image, as_signal, as_stereo_pair


@pytest.mark.parametrize(
    ("check", "value", "says"),
    [
        (as_signal, [], "0 samples"),
        (as_signal, [1.0], "1 sample;"),
        (as_signal, [1.0, np.nan], "1 NaN or infinite sample;"),
        (as_signal, np.zeros((3, 3)), "one-dimensional"),
        (as_signal, [1.0, np.nan, np.inf], "2 NaN"),
        (as_signal, np.ma.masked_equal([1.0, -9999.0, 2.0], -9999.0), "1 NaN"),
        (as_signal, [2.5, 2.5, 2.5], "constant"),
        (as_signal, [1 + 2j, 3.0], "complex"),
        (as_signal, ["a", "b"], "numbers only"),
        (as_image, np.zeros(4), r"shape \(4,\)"),
        (as_image, np.zeros((2, 2, 5)), "shape"),
        (as_image, np.zeros((0, 4)), "no pixels"),
        (as_image, np.array([[-1, 2]]), "from -1 to 2"),
        (as_image, np.array([[0, 70000]]), "70000"),
        (as_image, np.array([[np.nan, 1.0]]), "1 NaN"),
        (as_image, np.array([["a", "b"]]), "type"),
    ],
)
def test_what_is_no_signal_or_image_is_refused(check: Callable[..., object], value: object, says: str) -> None:
    with pytest.raises(ValueError, match=f"this one.*{says}"):
        check(value, "this one")


@pytest.mark.parametrize(
    ("given", "becomes"),
    [
        (np.bool_, np.uint8),
        (np.int32, np.uint8),
        (np.float16, np.float32),
        (np.float64, np.float64),
        (np.longdouble, np.float64),
    ],
)
def test_types(given: type, becomes: type) -> None:
    image = as_image(np.array([[0, 1], [1, 0]], dtype=given), "left")
    assert image.dtype == becomes
    assert as_image(np.array([[0, 300]]), "left").dtype == np.uint16
    assert as_image(np.zeros((4, 5, 1), given), "left").shape == (4, 5)
    grey_alpha = np.arange(8).reshape(2, 2, 2).astype(given)
    np.testing.assert_array_equal(as_image(grey_alpha, "left"), as_image(grey_alpha[:, :, [0, 0, 0, 1]], "left"))
    signal = as_signal(np.array([0, 1, 1, 0], dtype=given), "signal_1")
    assert signal.dtype == np.float64 and signal.tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [3, 4])
def test_grey_keeps_the_type_and_ignores_alpha(dtype: type, channels: int) -> None:
    image = np.zeros((2, 2, channels), dtype=dtype)
    image[..., 1] = 100
    image[..., 3:] = 7
    grey = as_grey(image)
    assert grey.dtype == dtype
    np.testing.assert_allclose(grey, 58.7, atol=0.5)


def test_integers_of_one_type_stay_of_one_type_however_bright() -> None:
    dark, bright = np.array([[0, 200]], np.int32), np.array([[0, 300]], np.int32)
    for pair in ((dark, bright), (bright, dark), (dark.tolist(), bright.tolist())):
        left, right = as_stereo_pair(*pair)
        assert left.dtype == right.dtype == np.uint16
        assert sorted((left.max(), right.max())) == [200, 300]
    assert [image.dtype for image in as_stereo_pair(dark, dark)] == [np.uint8, np.uint8]
    with pytest.raises(ValueError, match="left holds uint8 and right uint16"):
        as_stereo_pair(dark.astype(np.uint8), bright)


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float32, np.float64])
@pytest.mark.parametrize("size", [1, 2, 7, 1000])
def test_percentiles_are_those_of_numpy(dtype, size):
    values = (200 * np.random.default_rng(size).random((size, 1))).astype(dtype)
    np.testing.assert_allclose(percentiles(values, 0, 1, 33.3, 100), np.percentile(values, [0, 1, 33.3, 100]), 1e-6)
    assert median(values) == pytest.approx(np.median(values), 1e-6)
