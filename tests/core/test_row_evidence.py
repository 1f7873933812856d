"""The rows show whether a pair with a full calibration has already been rectified."""

from __future__ import annotations

import json

import numpy as np
import pytest
from straight_and_raw import ENTRIES, RECTIFYING, SIZE, raw_pair, straight_pair

from stereolag import read_calibration, rectify
from stereolag.assess.orientation import RowEvidence, row_evidence

NAN = float("nan")


def calibration(**more):
    entries = ENTRIES | more
    return read_calibration(json.dumps({name: np.asarray(value).tolist() for name, value in entries.items()}).encode())


@pytest.mark.parametrize("given", [{}, RECTIFYING], ids=["alpha", "the file's own"])
def test_a_rectified_pair_is_not_rectified_again_and_a_raw_one_is(given):
    cameras = calibration(**given)
    straight, raw = straight_pair(), raw_pair()
    again = row_evidence(straight, rectify(*straight, cameras)[:2])
    assert again.already_rectified
    assert again.given_px < 0.1
    assert again.rectified_px > 1.0
    first = row_evidence(raw, rectify(*raw, cameras)[:2])
    assert not first.already_rectified
    assert first.given_px > 1.0
    assert first.rectified_px < 0.2
    assert min(first.given_matches, first.rectified_matches) > 25


@pytest.mark.parametrize(
    ("given", "rectified", "already"),
    [
        (0.1, 3.0, True),
        (3.0, 0.1, False),
        (0.30, 0.35, False),
        (3.0, 9.0, True),
        (9.0, 12.0, False),
        (0.2, NAN, True),
        (3.0, NAN, False),
        (NAN, 0.2, False),
        (NAN, NAN, False),
    ],
)
def test_what_the_rows_say(given, rectified, already):
    assert RowEvidence(given, rectified, 50, 50).already_rectified is already


def test_images_without_features_tell_nothing():
    flat = np.full((SIZE[1], SIZE[0]), 99, np.uint8)
    evidence = row_evidence((flat, flat), (flat, flat))
    assert np.isnan([evidence.given_px, evidence.rectified_px]).all()
    assert not evidence.already_rectified
