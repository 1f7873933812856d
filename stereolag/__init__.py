"""Lag by correlation: between two recordings, of a template in a picture, between two eyes of a stereo camera.

>>> import stereolag as sl
>>> lag = sl.signal_lag(signal_1, signal_2, sampling_rate=44_100.0)
>>> search = sl.match_template(picture, template)
>>> result = sl.preset("accurate", num_disparities=64).compute(left, right)
"""

from stereolag.geometry.calibration import Calibration
from stereolag.reading import read_calibration, read_disparity, read_image, read_signal
from stereolag.signals import SignalLag, signal_lag
from stereolag.stereo.evaluation import Evaluation, evaluate
from stereolag.stereo.matcher import DisparityMap
from stereolag.stereo.methods import preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.reasons import Reason
from stereolag.stereo.semi_global.matcher import SemiGlobalMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.templates import TemplateMatch, TemplateSearch, match_template
from stereolag.version import VERSION

__version__ = VERSION

__all__ = [
    "Calibration",
    "CorrelationMatcher",
    "DisparityMap",
    "Evaluation",
    "Reason",
    "SearchArea",
    "SemiGlobalMatcher",
    "SignalLag",
    "StereoBM",
    "StereoSGBM",
    "TemplateMatch",
    "TemplateSearch",
    "__version__",
    "evaluate",
    "match_template",
    "preset",
    "read_calibration",
    "read_disparity",
    "read_image",
    "read_signal",
    "signal_lag",
]
