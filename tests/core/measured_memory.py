"""Memory of jobs, each run in its own fork: the measurement is the job's alone, and imports happen only once."""

import json
import os
import sys

import cv2
import numba
import numpy as np

import stereolag as sl
from benchmarks.memory import peak_extra_memory
from stereolag import signals, templates
from stereolag.assess import diagnosis
from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.motion import flow
from stereolag.stereo.matcher import PixelMatches, StereoMatcher
from stereolag.templates import trials

__all__ = ["diagnosis", "flow", "signals", "sl", "templates", "trials"]

random = np.random.default_rng(0)


class Still(StereoMatcher):
    """A method without an estimate of its own: each pixel is matched with itself."""

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        apart = cv2.GaussianBlur(left.astype(np.float64) - right, (0, 0), 2)
        disparity = np.where(np.abs(apart) < 99, np.float32(0), np.float32(np.nan))
        return PixelMatches(disparity, np.isnan(disparity).astype(np.uint8), -np.abs(apart).astype(np.float32))


def image(rows: int, cols: int) -> np.ndarray:
    return cv2.GaussianBlur(random.integers(0, 256, (rows, cols), dtype=np.uint8), (0, 0), 1)


def colours(rows: int, cols: int) -> np.ndarray:
    return np.dstack([image(rows, cols) for _ in range(3)])


def masked(template: np.ndarray) -> np.ndarray:
    alpha = np.full(template.shape[:2], 255, np.uint8)
    alpha[:5, :5] = 0
    return np.dstack([template, alpha])


def pair(rows: int, cols: int) -> tuple[np.ndarray, np.ndarray]:
    left = image(rows, cols)
    return left, np.roll(left, -8, axis=1)


def noise(size: int) -> np.ndarray:
    return random.standard_normal(size)


def measured(setup: str, warm: str, job: str, estimate: str) -> tuple[int, int]:
    """Return the bytes that a job takes and the bytes of its estimate; all arguments are Python code."""
    names = dict(globals())
    exec(setup, names)
    eval(warm, names)
    taken = peak_extra_memory(lambda: eval(job, names))
    return int(taken * 1e6), eval(estimate, names).memory


if __name__ == "__main__":
    numba.njit(lambda: 0)()  # the first compilation initialises Numba for all forks
    for name, job in json.load(sys.stdin).items():
        child = os.fork()
        if not child:
            print(json.dumps([name, *measured(*job)]), flush=True)
            os._exit(0)
        os.waitpid(child, 0)
