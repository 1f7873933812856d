"""OpenCV's block matchers behind the project's own matcher interface."""

from stereolag.stereo.opencv.matchers import SUBPIXEL, BlockMatcher, StereoBM, StereoSGBM

__all__ = ["SUBPIXEL", "BlockMatcher", "StereoBM", "StereoSGBM"]
