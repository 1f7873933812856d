"""A sprite in a picture of few colours, as those of games."""

import numpy as np

from stereolag.core.arrays import EightBit

SPRITE_PLACE = (23, 41)


def sprite_scene(seed: int) -> tuple[EightBit, EightBit]:
    """Return a picture with few colours, and a round RGBA sprite drawn into it at its place."""
    random = np.random.default_rng(seed)
    palette = random.integers(0, 256, (40, 3), dtype=np.uint8)
    image = palette[random.integers(0, 40, (90, 120))]
    sprite = np.zeros((15, 17, 4), dtype=np.uint8)
    rows, cols = np.mgrid[:15, :17]
    opaque = (rows - 7) ** 2 + (cols - 8) ** 2 <= 49
    sprite[opaque, :3] = palette[random.integers(0, 40, opaque.sum())]
    sprite[opaque, 3] = 255
    image[23:38, 41:58][opaque] = sprite[opaque, :3]
    return image, sprite
