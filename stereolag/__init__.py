"""Lag by correlation: between two recordings, of a template in an image, between the two images of a stereo camera.

>>> import stereolag as sl
>>> lag = sl.signal_lag(signal_1, signal_2, sampling_rate=44_100.0)
>>> search = sl.match_template(image, template)
>>> result = sl.preset("accurate", num_disparities=64).compute(left, right)
"""

from stereolag.doctor import Diagnosis, diagnose
from stereolag.export import write_disparity, write_matcher
from stereolag.geometry.calibrating import calibrate
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import Rectified, rectify
from stereolag.motion.matcher import optical_flow
from stereolag.motion.result import FlowMap
from stereolag.reading import read_calibration, read_disparity, read_image, read_matcher, read_signal
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
from stereolag.tuning.search import Suggestion
from stereolag.tuning.suggestion import suggest
from stereolag.version import VERSION

__version__ = VERSION

__all__ = [
    "Calibration",
    "CorrelationMatcher",
    "Diagnosis",
    "DisparityMap",
    "Evaluation",
    "FlowMap",
    "Reason",
    "Rectified",
    "SearchArea",
    "SemiGlobalMatcher",
    "SignalLag",
    "StereoBM",
    "StereoSGBM",
    "Suggestion",
    "TemplateMatch",
    "TemplateSearch",
    "__version__",
    "calibrate",
    "diagnose",
    "evaluate",
    "match_template",
    "optical_flow",
    "preset",
    "read_calibration",
    "read_disparity",
    "read_image",
    "read_matcher",
    "read_signal",
    "rectify",
    "signal_lag",
    "suggest",
    "write_disparity",
    "write_matcher",
]
