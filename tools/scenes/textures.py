"""Procedural textures, all of them tileable: ``(rows, columns, 3)`` sRGB, 0 to 1."""

import cv2
import numpy as np
from scipy.spatial import cKDTree

Shape = tuple[int, int]
Rgb = tuple[float, float, float]


def fractal_noise(
    shape: Shape,
    rng: np.random.Generator,
    *,
    slope: float = 1.5,
    stretch: tuple[float, float] = (1.0, 1.0),
    finest: float = 2.0,
    coarsest: float | None = None,
) -> np.ndarray:
    """Return noise whose amplitude falls with frequency to the power `slope`; mean 0, standard deviation 1.

    It is generated in the Fourier domain, hence periodic. `stretch` lengthens it along rows and columns; `finest` and
    `coarsest` bound its wavelengths, in px.
    """
    vertical = np.fft.fftfreq(shape[0])[:, None] * stretch[0]
    horizontal = np.fft.rfftfreq(shape[1])[None, :] * stretch[1]
    frequency = np.hypot(vertical, horizontal)
    frequency[0, 0] = np.inf
    amplitude = frequency**-slope
    amplitude[frequency > 1 / finest] = 0
    if coarsest is not None:
        amplitude[frequency < 1 / coarsest] = 0
    noise = np.fft.irfft2(np.fft.rfft2(rng.standard_normal(shape)) * amplitude, s=shape)
    return ((noise - noise.mean()) / noise.std()).astype(np.float32)


def cells(shape: Shape, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return periodic Voronoi cells: the cell of each pixel, and the distances to its two nearest seeds, px."""
    seeds = rng.random((count, 2)) * shape
    places = np.indices(shape).reshape(2, -1).T.astype(float)
    distance, index = cKDTree(seeds, boxsize=shape).query(places, k=2)
    return index[:, 0].reshape(shape), distance[:, 0].reshape(shape), distance[:, 1].reshape(shape)


def blend(amount: np.ndarray, *colours: Rgb) -> np.ndarray:
    """Return colours interpolated by `amount`, 0 for the first to 1 for the last."""
    stops = np.linspace(0.0, 1.0, len(colours))
    palette = np.asarray(colours)
    return np.stack([np.interp(amount, stops, palette[:, c]) for c in range(3)], axis=-1).astype(np.float32)


def mottle(
    shape: Shape, rng: np.random.Generator, *colours: Rgb, slope: float = 1.0, spread: float = 0.22
) -> np.ndarray:
    """Return a cloudy mixture of `colours`: earth, plaster, stone."""
    return blend(0.5 + spread * fractal_noise(shape, rng, slope=slope), *colours)


def wood(shape: Shape, rng: np.random.Generator, light: Rgb, dark: Rgb, rings: float = 14.0) -> np.ndarray:
    """Return a board whose grain runs along the columns."""
    rows = np.linspace(0, 1, shape[0], endpoint=False)[:, None]
    warp = fractal_noise(shape, rng, slope=2.2, stretch=(1.0, 7.0))
    phase = rings * rows + 0.55 * warp
    late_wood = (phase - np.floor(phase)) ** 2.5
    fibre = fractal_noise(shape, rng, slope=0.5, stretch=(1.0, 40.0))
    pores = fractal_noise(shape, rng, slope=0.3, stretch=(1.0, 16.0)) > 2.1
    amount = 0.28 + 0.42 * late_wood + 0.13 * fibre + 0.08 * warp
    return blend(amount, light, dark) * np.where(pores, 0.62, 1.0)[..., None]


def planks(shape: Shape, rng: np.random.Generator, light: Rgb, dark: Rgb, count: int = 5) -> np.ndarray:
    """Return boards side by side, each with its own tone, with dark joints between them."""
    height = shape[0] // count
    boards = []
    for _ in range(count):
        board = wood((height, shape[1]), rng, light, dark, rings=rng.uniform(3, 7))
        board = board * rng.uniform(0.82, 1.08)
        edge = np.minimum(np.arange(height), np.arange(height)[::-1])
        boards.append(board * np.clip(0.25 + edge / (0.012 * height), 0, 1)[:, None, None])
    return cv2.resize(np.concatenate(boards), (shape[1], shape[0]))


def asphalt(shape: Shape, rng: np.random.Generator) -> np.ndarray:
    """Return dark binder with light and dark chippings, stains and cracks."""
    kind, _, _ = cells(shape, rng, shape[0] * shape[1] // 30)
    stone = rng.normal(0.0, 1.0, kind.max() + 1)[kind]
    grey = 0.40 + 0.065 * stone + 0.035 * fractal_noise(shape, rng, slope=1.3)
    grey = grey + 0.03 * fractal_noise(shape, rng, slope=0.2, coarsest=60)
    _, first, second = cells(shape, rng, 9)
    wobble = 6 * fractal_noise(shape, rng, slope=1.6, coarsest=200)
    cracks = np.abs(second - first + wobble) < 1.6
    cracks &= fractal_noise(shape, rng, slope=2.0) > 0.3
    grey = np.where(cracks, 0.16, grey)
    return grey[..., None] * np.array([1.0, 0.985, 0.96])


def turf(shape: Shape, rng: np.random.Generator, dryness: float = 0.35) -> np.ndarray:
    """Return short grass seen from above; `dryness` is the share of dry patches."""
    blades = fractal_noise(shape, rng, slope=0.5)
    dry = fractal_noise(shape, rng, slope=1.6)
    grass = blend(0.5 + 0.2 * blades, (0.13, 0.19, 0.06), (0.34, 0.42, 0.14), (0.55, 0.60, 0.28))
    straw = blend(0.5 + 0.2 * blades, (0.30, 0.25, 0.13), (0.62, 0.54, 0.32), (0.78, 0.71, 0.47))
    share = np.clip(dryness + 0.35 * dry, 0, 1)[..., None]
    return grass * (1 - share) + straw * share


def bark(shape: Shape, rng: np.random.Generator) -> np.ndarray:
    """Return grey-brown bark with furrows along the rows."""
    furrow = fractal_noise(shape, rng, slope=1.0, stretch=(5.0, 1.0))
    return blend(0.5 + 0.25 * furrow, (0.12, 0.09, 0.07), (0.36, 0.29, 0.23), (0.58, 0.51, 0.44))


def concrete(shape: Shape, rng: np.random.Generator) -> np.ndarray:
    """Return cast concrete with rain streaks and small holes."""
    streaks = fractal_noise(shape, rng, slope=1.0, stretch=(6.0, 1.0))
    stains = fractal_noise(shape, rng, slope=1.4)
    holes = fractal_noise(shape, rng, slope=0.4, finest=3, coarsest=12) > 2.3
    grey = 0.60 + 0.045 * streaks + 0.05 * stains
    grey = grey + 0.03 * fractal_noise(shape, rng, slope=0.2)
    return np.where(holes, 0.34, grey)[..., None] * np.array([1.0, 0.98, 0.94])


def bricks(shape: Shape, rng: np.random.Generator, courses: int, across: int) -> np.ndarray:
    """Return a wall of `courses` by `across` bricks in stretcher bond, each of its own tone, in pale mortar."""
    rows, columns = np.indices(shape)
    wobble = 1.5 * fractal_noise(shape, rng, slope=1.4, coarsest=shape[0] / courses)
    up = (rows + wobble) * courses / shape[0]
    course = np.floor(up).astype(int) % courses
    along = (columns + wobble) * across / shape[1] + 0.5 * (course % 2)
    brick = np.floor(along).astype(int) % across
    height, width = shape[0] / courses, shape[1] / across
    to_joint = np.minimum(
        height * (0.5 - np.abs(up - np.floor(up) - 0.5)), width * (0.5 - np.abs(along - np.floor(along) - 0.5))
    )
    clay = blend(rng.random((courses, across)), (0.40, 0.17, 0.12), (0.58, 0.27, 0.18), (0.68, 0.40, 0.28))[
        course, brick
    ]
    grain = fractal_noise(shape, rng, slope=0.6, finest=3)
    mortar = mottle(shape, rng, (0.60, 0.57, 0.52), (0.74, 0.71, 0.65))
    joint = to_joint < 0.065 * height
    return np.where(joint[..., None], mortar, clay * (1 + 0.10 * grain[..., None]))
