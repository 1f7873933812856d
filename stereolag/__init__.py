"""Lag by correlation between two recordings, a template and an image, or the two images of a stereo camera.

A tour of the bundled examples. Two sensors hear the surf: how much later does the second one hear it, and how much
longer is its path?

>>> import stereolag as sl
>>> from stereolag import samples
>>> coast = samples.recordings()["coast"]
>>> lag = sl.signal_lag(sl.read_signal(coast.signal_1), sl.read_signal(coast.signal_2), sampling_rate=44_100.0)
>>> lag.verdict, lag.lag, round(lag.time_s, 3), round(lag.distance_m, 2)  # samples, seconds, metres
('sure', 50082, 1.136, 378.17)

Where in the maze is Rocketman? The transparent pixels of his picture do not count.

>>> maze = samples.mazes()["maze"]
>>> search = sl.match_template(sl.read_image(maze.picture), sl.read_image(maze.template), method="sampled")
>>> search.found, search.matches[0].row, search.matches[0].col  # px, of the top-left pixel
(True, 528, 982)

How far away is an object that two cameras see? A large disparity means near.

>>> cube = samples.stereo_pairs()["cube"]
>>> result = sl.preset("fast", num_disparities=64).compute(sl.read_image(cube.left), sl.read_image(cube.right))
>>> disparity = result.disparity[240, 320]  # px, of the pixel at (row, col)
>>> round(float(disparity), 1), round(float(sl.read_calibration(cube.calibration).depth(disparity)), 2)  # px, metres
(45.1, 0.34)

Every public name has an example of its own: ``help(sl.signal_lag)``.

files
    `read_signal`, `read_image`, `read_disparity`, `read_depth`, `read_calibration`, `read_matcher`;
    `write_disparity`, `write_depth`, `write_matcher`
matchers
    `CorrelationMatcher` over a `SearchArea`, `SemiGlobalMatcher`, `StereoBM`, `StereoSGBM`; `preset` makes one;
    `suggest` finds better settings for a pair and returns a `Suggestion`
recordings
    `align` puts one recording on the clock of another
results
    `SignalLag`; `TemplateSearch`, with a `TemplateMatch` for every place found; `DisparityMap`, with a `Reason` for
    every pixel; notebooks show them, and `show` does so elsewhere, or with the image
accuracy
    `evaluate` a map against ground truth: an `Evaluation`; `diagnose` a pair before matching: a `Diagnosis`
metres
    `calibrate` a camera from pictures of a board: a `Calibration`; `rectify` a raw pair into a `Rectified` one
motion
    `optical_flow` between two frames: a `FlowMap`; `scene_flow` in metres: a `SceneFlow`

The names are listed in ``__init__.pyi``; each is imported on first use.
"""

import lazy_loader

from stereolag.core.showing import DRAWN_IN
from stereolag.version import VERSION

__version__ = VERSION

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]

DRAWN_IN.append("stereolag.figures.notebooks")
