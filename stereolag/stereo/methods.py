"""The stereo methods by name: a new one is listed here and nowhere else."""

from __future__ import annotations

from stereolag.stereo.correlation import CorrelationMatcher
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.opencv import StereoBM, StereoSGBM

METHODS: dict[str, type[StereoMatcher]] = {
    method.__name__: method for method in (CorrelationMatcher, StereoBM, StereoSGBM)
}
"""Every settings class by the name that files and pages call it."""
