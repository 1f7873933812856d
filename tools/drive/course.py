"""Poses of the camera and of every vehicle over time."""

from dataclasses import dataclass

import numpy as np

from ..scenes.camera import StereoCamera
from ..scenes.meshes import rotation

FRAME_RATE = 10.0
FRAMES = 60
FOCAL_PX = 960.0
BASELINE_M = 0.36
SPEED = 25.0
RIGHT_LANE, MIDDLE_LANE = 3.2, 0.15
LANE_CHANGE = (0.8, 4.4)  # s, from the right lane to the middle one


@dataclass(frozen=True)
class Run:
    """A vehicle driving straight with a slight sway: `start` is ``(x, y)`` at time 0; `speed`, m/s, is along y."""

    start: tuple[float, float]
    speed: float
    sway: float = 0.06
    period: float = 4.0
    phase: float = 0.0

    def pose(self, time: float) -> np.ndarray:
        """Return the 4 × 4 pose, vehicle to world; the vehicle's own y points forwards."""
        turn = 2 * np.pi / self.period
        across = self.sway * np.sin(turn * time + self.phase)
        drift = self.sway * turn * np.cos(turn * time + self.phase)
        pose = np.eye(4)
        pose[:3, :3] = rotation(-np.degrees(np.arctan2(drift, self.speed)), 2)
        pose[:3, 3] = self.start[0] + across, self.start[1] + self.speed * time, 0.0
        return pose


RUNS = {
    "slow_hatchback": Run((3.4, 49.0), 18.5, phase=1.0),
    "overtaking_estate": Run((-3.55, 5.0), 32.0, sway=0.10, phase=2.0),
    "overtaking_saloon": Run((-3.65, -34.0), 33.0, sway=0.03),
    "saloon_ahead": Run((0.0, 44.0), 27.0, sway=0.10, phase=4.0),
    "lorry": Run((3.5, 84.0), 22.5, sway=0.04, period=6.0),
    "oncoming_hatchback": Run((-13.2, 150.0), -27.0, phase=0.5),
    "oncoming_saloon": Run((-9.7, 235.0), -33.0, phase=1.5),
    "oncoming_estate": Run((-16.6, 322.0), -25.0, phase=2.5),
}
"""Vehicles by name, in the order of their object numbers from 1; 0 is everything that stands still."""


def camera(time: float) -> StereoCamera:
    """Return the stereo camera in our car, which changes lanes, leans and pitches a little on its springs."""
    begin, end = LANE_CHANGE
    share = np.clip((time - begin) / (end - begin), 0.0, 1.0)
    across = RIGHT_LANE + (MIDDLE_LANE - RIGHT_LANE) * share**3 * (10 - 15 * share + 6 * share**2)
    drift = (MIDDLE_LANE - RIGHT_LANE) * 30 * share**2 * (1 - share) ** 2 / (end - begin)
    heading = np.arctan2(drift, SPEED)
    pitch = np.radians(0.30 + 0.10 * np.sin(2 * np.pi * 1.3 * time) + 0.04 * np.sin(2 * np.pi * 3.1 * time + 1))
    roll = np.radians(0.35 * np.sin(2 * np.pi * share) + 0.10 * np.sin(2 * np.pi * 0.9 * time + 2))
    height = 1.5 + 0.012 * np.sin(2 * np.pi * 1.3 * time + 0.7)
    position = np.array([across, SPEED * time, height])
    forward = np.array([np.sin(heading) * np.cos(pitch), np.cos(heading) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.cos(heading), -np.sin(heading), 0.0])
    up = np.cos(roll) * np.cross(right, forward) + np.sin(roll) * right
    return StereoCamera(
        width=881,
        height=400,
        focal_px=FOCAL_PX,
        baseline_m=BASELINE_M,
        position=tuple(position.tolist()),
        target=tuple((position + 10 * forward).tolist()),
        up=tuple(up.tolist()),
    )


def camera_pose(view: StereoCamera) -> np.ndarray:
    """Return the 4 × 4 pose, left camera to world, with the camera's x to the right, y down and z forwards."""
    pose = np.eye(4)
    pose[:3, 0] = view.rightward
    pose[:3, 1] = np.cross(view.forward, view.rightward)
    pose[:3, 2] = view.forward
    pose[:3, 3] = view.position
    return pose
