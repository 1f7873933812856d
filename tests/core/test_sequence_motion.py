"""Motion in a sequence, on a small drive with known speeds."""

import csv
import io
from dataclasses import replace

import av
import numpy as np
import pytest
from moving_drives import CAMERA, CAR_KMH, COLS, OWN_KMH, RATE, ROWS, archive, car_mask

from stereolag import preset
from stereolag.figures.pictures import FRAME, NO_ANSWER, with_outlines
from stereolag.sequences import SequenceMemory, SequenceSettings, StereoSequence, open_sequence, run_sequence
from stereolag.sequences.frames import MOTION, read_records, table_lines
from stereolag.sequences.motion import MotionDetector, SequenceMotion

COUNT = 3
MATCHER = preset("fast", num_disparities=32)


@pytest.fixture(scope="module")
def drive() -> StereoSequence:
    return open_sequence(archive(COUNT))


def test_own_speed_and_that_of_the_car_are_told(drive: StereoSequence) -> None:
    detector = MotionDetector(drive, MATCHER, CAMERA)
    assert detector.motion_of(0) is None
    for number in range(1, COUNT):
        found = detector.motion_of(number)
        assert found.scene.own_speed_kmh == pytest.approx(OWN_KMH, rel=0.04)
        (car,) = found.scene.regions
        assert car.trusted and car.speed_kmh == pytest.approx(CAR_KMH, abs=3)
        assert car.speed_error_kmh is not None and abs(car.speed_kmh - CAR_KMH) < 3 * car.speed_error_kmh
        assert car.distance_m == pytest.approx(9 + number, rel=0.03)
        true = car_mask(number)
        assert (found.scene.moving & true).sum() / (found.scene.moving | true).sum() > 0.7
        told = f"{car.distance_m:.1f} m {car.speed_kmh:.0f} ± {car.speed_error_kmh:.0f} km/h"
        assert found.figures()["moving"] == told and found.figures()["problem"] == ""
        # Driving ahead moves the right half to the right and the left half to the left.
        assert np.nanmedian(found.flow_back.dx[:60, COLS - 60 :]) < 0 < np.nanmedian(found.flow_back.dx[:60, :60])
    with_gap = replace(drive, intervals=np.array([0.0, 2.0, 3.0]))
    faster = MotionDetector(with_gap, MATCHER, CAMERA, SequenceMotion(frame_rate=4 * RATE)).motion_of(1)
    assert faster.scene.own_speed_kmh == pytest.approx(2 * OWN_KMH, rel=0.04)


def test_without_a_calibration_there_is_the_flow_alone(drive: StereoSequence) -> None:
    detector = MotionDetector(drive, MATCHER, None)
    found = detector.motion_of(1)
    assert found is not None and found.scene is None and found.flow_back.coverage > 0.7
    left = drive.frame(1).left
    picture, flow = detector.pictures(left, found)
    assert (picture[..., 0] == left).all() and flow.shape == (ROWS, COLS, 3)
    assert [*found.figures()] == ["coverage", "milliseconds", "problem"]
    _, arrows = MotionDetector(drive, MATCHER, None, SequenceMotion(arrows=True)).pictures(left, found)
    assert 0.3 < arrows.mean() / left.mean() < 0.7, "they stand on the dimmed picture"
    assert np.ptp(arrows.astype(int), axis=2).max() > 100


def test_no_speed_is_told_of_a_frame_that_repeats_the_one_before_it() -> None:
    found = MotionDetector(open_sequence(archive(2, every=0)), MATCHER, CAMERA).motion_of(1)
    assert found.scene is None and found.flow_back.coverage == 1 and found.figures()["problem"] == "identical"


def test_table_and_video_tell_of_motion(drive: StereoSequence) -> None:
    moving, kept, film = SequenceSettings(motion=SequenceMotion()), SequenceMemory(), io.BytesIO()
    run_sequence(drive, {"fast": MATCHER}, kept, calibration=CAMERA, video=film, settings=moving)
    rows = [*csv.DictReader(io.StringIO(table_lines(kept.records.values(), header=True)))]
    told = [row for row in rows if row["method"] == MOTION]
    assert [row["number"] for row in told] == ["1", "2"]
    assert all(float(row["own_speed_kmh"]) == pytest.approx(OWN_KMH, rel=0.04) for row in told)
    assert all(0 < float(row["own_speed_error_kmh"]) < 2 for row in told)
    assert all(" m 7" in row["moving"] and " ± " in row["moving"] for row in told)
    assert all(row["own_speed_kmh"] == row["moving"] == "" for row in rows if row["method"] != MOTION)
    with av.open(io.BytesIO(film.getvalue())) as container:
        shown = [one.to_ndarray(format="rgb24") for one in container.decode(video=0)]
    assert [one.shape for one in shown] == [(ROWS, 3 * COLS, 3)] * COUNT
    assert np.abs(shown[0][:, 2 * COLS :].astype(int) - NO_ANSWER[0]).max() < 12, "the first frame has none before it"
    assert np.ptp(shown[2][:, 2 * COLS :].astype(int), axis=2).max() > 60
    # A resumed run draws the same, because the colours are locked.
    largest = kept.largest_motion
    again = io.BytesIO()
    run_sequence(drive, {"fast": MATCHER}, kept, calibration=CAMERA, video=again, settings=moving)
    assert kept.largest_motion == largest and again.getvalue() == film.getvalue()


@pytest.mark.parametrize("kept_in", ["memory", "folder"])
def test_motion_asked_for_later_is_told_of_finished_frames(drive, tmp_path, kept_in, monkeypatch):
    kept = SequenceMemory() if kept_in == "memory" else tmp_path / "maps"
    run_sequence(drive, {"fast": MATCHER}, kept, calibration=CAMERA)
    moving = SequenceSettings(motion=SequenceMotion())
    later = run_sequence(drive, {"fast": MATCHER}, kept, calibration=CAMERA, settings=moving)
    assert later.matched == 0
    records = [*kept.records.values()] if isinstance(kept, SequenceMemory) else read_records(kept / "frames.csv")
    told = [one for one in records if one.method == MOTION]
    assert [one.number for one in told] == [1, 2] and len(records) == COUNT + 2
    assert all(one.own_speed_kmh == pytest.approx(OWN_KMH, rel=0.04) for one in told)
    seen: list[int] = []
    monkeypatch.setattr(MotionDetector, "motion_of", lambda _, number, look: seen.append(number))
    run_sequence(drive, {"fast": MATCHER}, kept, calibration=CAMERA, settings=moving)
    assert seen == [0], "each is told once, and the first has none"


def test_a_thing_is_outlined_and_named_within_the_picture() -> None:
    mask = np.zeros((90, 160), np.bool_)
    mask[5:40, 140:158] = True
    grey = np.full((90, 160), 100, np.uint8)
    plain, named = (with_outlines(grey, [(mask, words)]) for words in ("", "97 km/h"))
    pink = (np.abs(plain.astype(int) - FRAME).sum(axis=2) < 60).nonzero()
    assert pink[0].min() in (4, 5) and pink[1].max() in (157, 158) and (plain[15:30, 145:153] == 100).all()
    written = (named != plain).any(axis=2).nonzero()
    assert written[1].size > 50 and written[1].min() > 60
    assert (with_outlines(grey, [(np.zeros_like(mask), "nothing")]) == 100).all()
