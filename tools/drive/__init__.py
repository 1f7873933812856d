"""Six seconds on a motorway, path-traced frame by frame with exact disparity and motion: what ``assets/drive`` is.

The things of `tools.scenes` are put in motion here. The world has z up and is measured in metres; y is the way ahead.
"""
