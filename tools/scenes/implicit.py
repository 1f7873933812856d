"""Smooth bodies: signed distances on a grid, blended and turned into a mesh by marching cubes."""

import numpy as np
from numpy.typing import ArrayLike
from skimage.measure import marching_cubes

from .meshes import Mesh


class Volume:
    """A grid of signed distances (negative inside) over a box of the world."""

    def __init__(self, low: ArrayLike, high: ArrayLike, spacing: float) -> None:
        self.low = np.asarray(low, dtype=np.float32)
        self.spacing = spacing
        axes = [
            np.arange(a, b, spacing, dtype=np.float32) for a, b in zip(np.asarray(low), np.asarray(high), strict=True)
        ]
        self.x, self.y, self.z = np.meshgrid(*axes, indexing="ij", sparse=True)
        self.distance = np.full([len(axis) for axis in axes], 10.0, dtype=np.float32)

    def add_limb(self, start: ArrayLike, end: ArrayLike, radii: tuple[float, float], blend: float) -> None:
        """Add a bone with flesh of a given radius at either end, blended with the existing body."""
        a, b = np.asarray(start, dtype=np.float32), np.asarray(end, dtype=np.float32)
        axis = b - a
        along = (self.x - a[0]) * axis[0] + (self.y - a[1]) * axis[1] + (self.z - a[2]) * axis[2]
        along = np.clip(along / float(axis @ axis), 0, 1)
        distance = np.sqrt(
            (self.x - a[0] - along * axis[0]) ** 2
            + (self.y - a[1] - along * axis[1]) ** 2
            + (self.z - a[2] - along * axis[2]) ** 2
        ) - (radii[0] + along * (radii[1] - radii[0]))
        self.distance = smooth_union(self.distance, distance, blend)

    def mesh(self) -> Mesh:
        vertices, faces, _, _ = marching_cubes(self.distance, 0.0, spacing=(self.spacing,) * 3)
        return Mesh(vertices + self.low, faces)


def smooth_union(first: np.ndarray, second: np.ndarray, radius: float) -> np.ndarray:
    """Return the lesser of two distances, with the seam rounded over `radius` (polynomial minimum)."""
    overlap = np.maximum(radius - np.abs(first - second), 0) / radius
    return np.minimum(first, second) - overlap * overlap * radius / 4


def smooth_intersection(first: np.ndarray, second: np.ndarray, radius: float) -> np.ndarray:
    """Return the greater of two distances, with the edge rounded over `radius`."""
    return -smooth_union(-first, -second, radius)
