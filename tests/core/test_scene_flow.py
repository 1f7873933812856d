"""Scene flow on ray-cast scenes, where the own motion and the moving things and speeds are known exactly."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from pairs import texture

from stereolag import Calibration
from stereolag.motion.moving_objects import Camera, MovingTest, better_correlated
from stereolag.motion.scene_flow import disparity_at, scene_flow

CAMERA = Calibration(focal_px=300.0, baseline_m=0.5)
SHAPE = (150, 240)
RATE = 10.0
GROUND, WALL = 1.5, 40.0
POST = (-6.0, -4.0, 9.0)
"""A standing box: left, right, distance; metres."""
CAR = (-0.5, 2.0, 14.0)


@dataclass(frozen=True)
class Scene:
    """Two disparity maps, the flow between them, NaN where the second frame hides the pixel, and the car's mask."""

    first: np.ndarray
    second: np.ndarray
    flow: tuple[np.ndarray, np.ndarray]
    car: np.ndarray


def cast(rotation, position, car):
    """Return the depth and the surface of each pixel of a camera: 0 ground or wall, 1 post, 2 car."""
    row, col = np.indices(SHAPE)
    ray = np.stack([(col - 119.5) / 300, (row - 74.5) / 300, np.ones(SHAPE)], axis=-1) @ rotation.T
    depth, kind = np.full(SHAPE, np.inf), np.zeros(SHAPE, int)

    def meet(distance, inside, number):
        nearer = inside & (distance > 0) & (distance < depth)
        depth[nearer], kind[nearer] = distance[nearer], number

    with np.errstate(divide="ignore", invalid="ignore"):
        meet((WALL - position[2]) / ray[..., 2], np.ones(SHAPE, bool), 0)
        meet((GROUND - position[1]) / ray[..., 1], np.ones(SHAPE, bool), 0)
    for number, (left, right, away) in ((1, POST), (2, car)):
        distance = (away - position[2]) / ray[..., 2]
        at = position + distance[..., None] * ray
        meet(distance, (at[..., 0] > left) & (at[..., 0] < right) & (at[..., 1] > -0.3) & (at[..., 1] < GROUND), number)
    return depth, kind


def scene(*, turn=0.01, travelled=(0.05, 0.0, 1.0), car_moves=(0.6, 0.0, 0.9), noise=0.0, car=CAR):
    rotation = cv2.Rodrigues(np.array([0.002, turn, 0.0]))[0]
    position, car_moves = np.array(travelled), np.array(car_moves)
    depth, kind = cast(np.eye(3), np.zeros(3), car)
    moved_car = (car[0] + car_moves[0], car[1] + car_moves[0], car[2] + car_moves[2])
    depth_2, kind_2 = cast(rotation, position, moved_car)
    scale = CAMERA.focal_px * CAMERA.baseline_m
    row, col = places = np.indices(SHAPE, dtype=np.float32)
    points = Camera.of(CAMERA, SHAPE).points((scale / depth).astype(np.float32), places)
    points = np.where((kind == 2)[..., None], points + car_moves, points)
    seen = (points - position) @ rotation
    rng = np.random.default_rng(3)
    there = 74.5 + 300 * seen[..., 1] / seen[..., 2], 119.5 + 300 * seen[..., 0] / seen[..., 2]
    hidden = disparity_at(kind_2.astype(np.float32), np.stack(there)) != kind
    seen[hidden] = np.nan
    dy = 74.5 + 300 * seen[..., 1] / seen[..., 2] - row + rng.normal(0, noise, SHAPE)
    dx = 119.5 + 300 * seen[..., 0] / seen[..., 2] - col + rng.normal(0, noise, SHAPE)
    disparities = [(scale / one + rng.normal(0, noise, SHAPE)).astype(np.float32) for one in (depth, depth_2)]
    return Scene(*disparities, (dy.astype(np.float32), dx.astype(np.float32)), kind == 2)


@pytest.mark.parametrize("noise", [0.0, 0.15])
def test_own_motion_and_the_moving_car_are_found(noise):
    known = scene(noise=noise)
    found = scene_flow(known.first, known.second, known.flow, CAMERA, frame_rate=RATE)
    np.testing.assert_allclose(found.own_motion.travelled, (0.05, 0, 1), atol=0.003 if noise == 0 else 0.03)
    angles = cv2.Rodrigues(found.own_motion.rotation)[0][:, 0]
    np.testing.assert_allclose(angles, (-0.002, -0.01, 0), atol=2e-4 if noise == 0 else 1e-3)
    assert found.own_speed_kmh == pytest.approx(3.6 * RATE * np.hypot(0.05, 1), rel=0.01 if noise == 0 else 0.03)
    (car,) = found.regions
    assert car.speed_kmh == pytest.approx(3.6 * RATE * np.hypot(0.6, 0.9), rel=0.02 if noise == 0 else 0.1)
    assert car.distance_m == pytest.approx(CAR[2] + 0.9 - 1, rel=0.03)
    overlap = (found.moving & known.car).sum() / (found.moving | known.car).sum()
    assert overlap > 0.85
    rows, cols = np.nonzero(known.car)
    assert abs(car.row - rows.min()) <= 3 and abs(car.col - cols.min()) <= 3
    assert abs(car.height - np.ptp(rows) - 1) <= 5 and abs(car.width - np.ptp(cols) - 1) <= 5
    np.testing.assert_array_equal(found.labels > 0, found.moving)


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_nothing_moves_in_a_static_world(noise):
    known = scene(car_moves=(0, 0, 0), noise=noise)
    found = scene_flow(known.first, known.second, known.flow, CAMERA)
    assert found.regions == () and not found.moving.any()
    assert found.own_speed_kmh is None
    near = known.first > 6
    assert np.nanmedian(np.abs(found.against_world[near])) < (0.01 if noise == 0 else 1)


def test_a_standing_camera_stands_and_sees_who_comes():
    known = scene(turn=0, travelled=(0, 0, 0), car_moves=(0, 0, -1.2))
    found = scene_flow(known.first, known.second, known.flow, CAMERA, frame_rate=RATE)
    assert found.own_speed_kmh == pytest.approx(0, abs=0.3)
    (car,) = found.regions
    assert car.motion_m[2] == pytest.approx(-1.2, abs=0.03)
    assert car.speed_kmh == pytest.approx(43.2, rel=0.03)


@pytest.mark.parametrize(
    ("lorry", "doubt"), [((-4.0, 4.0, 9.0), "two motions"), ((-2.5, 4.0, 10.0), "two motions"), ((-1, 1, 9.0), "")]
)
def test_which_of_two_motions_is_the_world_s_is_not_claimed(lorry, doubt):
    known = scene(car=lorry, car_moves=(0.05, 0.0, 1.0), turn=0, noise=0.1)
    found = scene_flow(known.first, known.second, known.flow, CAMERA, frame_rate=RATE)
    assert found.own_motion.doubt == found.doubt == doubt and len(found.regions) == (not doubt)
    assert doubt or found.own_speed_kmh == pytest.approx(36, abs=1)


def test_no_motion_is_the_world_s_that_explains_less_than_half_of_it():
    known = scene(noise=0.1)
    dy, dx = (part.copy() for part in known.flow)
    wild = np.random.default_rng(1).random(SHAPE) < 0.7
    dx[wild] += np.random.default_rng(2).uniform(-40, 40, wild.sum())
    assert scene_flow(known.first, known.second, (dy, dx), CAMERA).doubt == "nothing static"


@pytest.mark.parametrize(
    ("nearest", "expected", "doubt"), [(30, 0.5, ""), (8, 0.5, ""), (5, 0.5, ""), (5, 1, "inaccurate")]
)
def test_the_own_speed_s_error_counts_what_all_disparities_have_in_common(nearest, expected, doubt):
    # The world as far as it is seen: the farther it is, the more a bias of a quarter of a pixel means.
    known = scene(car_moves=(0, 0, 0), noise=0.15)
    first = np.where(known.first < nearest, known.first - np.float32(0.25), np.float32(np.nan))
    test = MovingTest(disparity_error=expected)
    found = scene_flow(first, known.second - np.float32(0.25), known.flow, CAMERA, frame_rate=2 * RATE, test=test)
    off = abs(found.own_speed_kmh - 7.2 * RATE * np.hypot(0.05, 1))
    assert 0.4 * off < found.own_speed_error_kmh < 6 * off
    assert found.doubt == doubt


def test_only_the_depth_tells_of_a_thing_that_recedes_without_growing_smaller():
    # At the centre of a looming flow, the flow hardly changes, but the disparity does.
    known = scene(turn=0, travelled=(0, 0, 0), car_moves=(0, 0, 4.0))
    still = tuple(np.zeros_like(part) for part in known.flow)
    test = MovingTest(disparity_error=0.1)
    found = scene_flow(known.first, known.second, still, CAMERA, test=test)
    assert (found.moving & known.car).sum() > 0.5 * known.car.sum()


def test_the_same_scene_gives_the_same_answer_and_holes_are_left_out():
    known = scene(noise=0.2)
    first = known.first.copy()
    first[:40] = np.nan
    one, other = (scene_flow(first, known.second, known.flow, CAMERA) for _ in range(2))
    np.testing.assert_array_equal(one.own_motion.translation, other.own_motion.translation)
    np.testing.assert_array_equal(one.labels, other.labels)
    assert np.isnan(one.motion[:40]).all() and not one.moving[:37].any()


def test_a_flow_that_the_frames_contradict_moves_nothing():
    known = scene(car_moves=(0, 0, 0), travelled=(0, 0, 0), turn=0)
    picture = texture(*SHAPE, seed=1).astype(np.uint8)
    wrong = tuple(np.zeros(SHAPE, np.float32) for _ in range(2))
    wrong[1][30:80, 100:170] = 6
    believed = scene_flow(known.first, known.first, wrong, CAMERA)
    assert believed.moving[35:75, 105:165].all()
    seen = scene_flow(known.first, known.first, wrong, CAMERA, frames=(picture, picture))
    assert not seen.moving.any()
    second = picture.copy()
    second[30:80, 106:176] = picture[30:80, 100:170]
    moved = scene_flow(known.first, known.first, wrong, CAMERA, frames=(picture, second))
    assert moved.moving[35:75, 105:165].mean() > 0.85


def test_a_flow_is_better_only_where_it_is_known_and_within_the_frame():
    first = texture(60, 90, seed=2).astype(np.float32)
    second = np.roll(first, 5, axis=1)
    right, wrong = np.zeros((2, 2, 60, 90), np.float32)
    right[1] = 5
    right[:, :, :20] = np.nan
    better = better_correlated((first, second), right, wrong, 0.1)
    assert better[8:-8, 24:-12].mean() > 0.98
    assert not better[:, :20].any() and not better[:, -8:].any()
    assert not better_correlated((first, second), wrong, right, 0.1).any()


def test_a_disparity_is_taken_of_the_nearest_pixel():
    disparity = np.array([[1.0, 2.0], [3.0, np.nan]], np.float32)
    row = np.array([[0.4, 0.0], [0.6, 1.2], [np.nan, 0.0]], np.float32)
    col = np.array([[0.4, 1.4], [0.4, 0.8], [0.0, 1.6]], np.float32)
    np.testing.assert_array_equal(
        disparity_at(disparity, np.stack([row, col])), [[1, 2], [3, np.nan], [np.nan, np.nan]]
    )


def test_what_is_refused_is_named():
    known = scene()
    wild = tuple(np.random.default_rng(0).uniform(-300, 300, (2, *SHAPE)).astype(np.float32))
    picture = np.zeros((8, 9), np.uint8)
    for changes, message in (
        ({"frame_rate": 0}, "frame_rate is 0"),
        ({"first": known.first[:, :-1]}, r"\(150, 239\)"),
        ({"first": np.full_like(known.first, np.nan)}, "Only 0 pixels"),
        ({"flow": wild}, "nothing static"),
        ({"frames": (picture, picture)}, r"The frames have the shape \(8, 9\) and the disparities"),
    ):
        given = {"first": known.first, "second": known.second, "flow": known.flow} | changes
        with pytest.raises(ValueError, match=message):
            scene_flow(**given, calibration=CAMERA)
