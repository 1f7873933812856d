"""The public names and their modules: the only list of them, for ``__init__.py`` and for type checkers."""

from .assess.diagnosis import Diagnosis, diagnose
from .assess.suggestion import Suggestion, suggest
from .core.showing import show
from .geometry.calibrating import calibrate
from .geometry.calibration import Calibration
from .geometry.rectification import Rectified, rectify
from .io.calibrations import read_calibration
from .io.depths import read_depth, write_depth
from .io.disparities import read_disparity, write_disparity
from .io.images import read_image
from .io.recordings import read_signal
from .io.settings import read_matcher, write_matcher
from .motion.flow import FlowMap, optical_flow
from .motion.scene_flow import SceneFlow, scene_flow
from .signals import SignalLag, align, signal_lag
from .stereo.evaluation import Evaluation, evaluate
from .stereo.matcher import DisparityMap, Reason
from .stereo.methods import preset
from .stereo.opencv import StereoBM, StereoSGBM
from .stereo.semi_global.matcher import SemiGlobalMatcher
from .stereo.windows.matcher import CorrelationMatcher
from .stereo.windows.search import SearchArea
from .templates import TemplateMatch, TemplateSearch, match_template

__version__: str

__all__ = [
    "Calibration",
    "CorrelationMatcher",
    "Diagnosis",
    "DisparityMap",
    "Evaluation",
    "FlowMap",
    "Reason",
    "Rectified",
    "SceneFlow",
    "SearchArea",
    "SemiGlobalMatcher",
    "SignalLag",
    "StereoBM",
    "StereoSGBM",
    "Suggestion",
    "TemplateMatch",
    "TemplateSearch",
    "__version__",
    "align",
    "calibrate",
    "diagnose",
    "evaluate",
    "match_template",
    "optical_flow",
    "preset",
    "read_calibration",
    "read_depth",
    "read_disparity",
    "read_image",
    "read_matcher",
    "read_signal",
    "rectify",
    "scene_flow",
    "show",
    "signal_lag",
    "suggest",
    "write_depth",
    "write_disparity",
    "write_matcher",
]
