"""The preview picture of a shared link matches the drawing program, and has GitHub's size and file size."""

import numpy as np
from PIL import Image

from tools.share_card import CARD, draw


def test_the_card_is_drawn_again_as_it_is() -> None:
    assert CARD.stat().st_size < 1_000_000
    with Image.open(CARD) as kept:
        assert kept.size == (1280, 640)
        differences = np.abs(np.asarray(kept, dtype=np.int16) - np.asarray(draw(), dtype=np.int16))
    assert (differences > 8).any(axis=2).mean() < 0.01
