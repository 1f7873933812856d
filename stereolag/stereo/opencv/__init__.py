"""OpenCV's block matchers behind the same face as ours."""

from stereolag.stereo.opencv.matchers import SUBPIXEL, BlockMatcher, StereoBM, StereoSGBM

__all__ = ["SUBPIXEL", "BlockMatcher", "StereoBM", "StereoSGBM"]
