"""Texts of the sliding panel and its examples."""

from __future__ import annotations

from typing import Any, Final

WORDS: Final[dict[str, Any]] = {
    "recording": "Recording 2, with the cut laid over it",
    "cut": "Cut from recording 1: drag it",
    "axis": "lag, samples: where the cut begins",
    "perfect": "perfect match",
    "lag": "Lag",
    "plain": {
        "products": "Products: up where the signs agree",
        "curve": "Sum of the products, at the places tried",
        "sum": "sum",
    },
    "normalised": {
        "products": "Products, normalised: up where the signs agree",
        "curve": "Correlation, at the places tried",
        "sum": "correlation",
    },
}

EXAMPLES: Final[dict[str, dict[str, Any]]] = {
    "seven": {
        "title": "Seven numbers",
        "try": "These seven numbers are hidden in recording 2. Drag them until they line up, and watch the products.",
        "said": {
            "plain": "The peak is at lag 8: there every number meets itself, every product is a square, and "
            "nothing cancels.",
            "normalised": "Same peak, at lag 8. Only a perfect match reaches 1.",
        },
    },
    "coast": {
        "title": "Coast",
        "try": "Forty points of sensor 1, each the mean of six samples, and sensor 2’s recording about a second later. "
        "Where does the cut belong?",
        "said": {
            "plain": "The peak is at 50,082 samples: there the waves line up and every product points up. "
            "Elsewhere ups and downs cancel.",
            "normalised": "The peak at 50,082 samples reaches 1: it is the same sound. Elsewhere nothing exceeds 0.3.",
        },
    },
    "tone": {
        "title": "Pure tone",
        "try": "A tone that repeats every 20 samples. Drag the cut along and count the places where it fits.",
        "said": {
            "plain": "Many equal peaks, 20 samples apart: a tone fits again after every period, so the lag stays "
            "ambiguous.",
            "normalised": "Still many peaks, all at 1: no method can tell one period from the next.",
        },
    },
    "noise": {
        "title": "Unrelated noise",
        "try": "The cut comes from somewhere else: it is nowhere in recording 2. Does any place stand out?",
        "said": {
            "plain": "No peak comes near a perfect match: nothing is shared, so ups and downs cancel everywhere. The "
            "highest point is chance.",
            "normalised": "Nothing near 1. Among 201 places, one reaches 0.45 by chance.",
        },
    },
    "loud": {
        "title": "Loud stretch",
        "try": "The cut fits at lag 90, but recording 2 gets loud later on. Play, then switch Normalise on.",
        "said": {
            "plain": "The loud stretch wins, though the cut does not fit there: big samples make big sums. Now switch "
            "Normalise on.",
            "normalised": "Divided by loudness, only the shape counts: the true place, lag 90, reaches 1 and wins.",
        },
    },
}
