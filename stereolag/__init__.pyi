"""The public names and their modules: the only list of them, for ``__init__.py`` and for type checkers."""

from .doctor import Diagnosis, diagnose
from .export import write_disparity, write_matcher
from .geometry.calibrating import calibrate
from .geometry.calibration import Calibration
from .geometry.rectification import Rectified, rectify
from .motion.matcher import optical_flow
from .motion.result import FlowMap
from .motion.scene_flow import SceneFlow, scene_flow
from .reading import read_calibration, read_disparity, read_image, read_matcher, read_signal
from .signals import SignalLag, signal_lag
from .stereo.evaluation import Evaluation, evaluate
from .stereo.matcher import DisparityMap
from .stereo.methods import preset
from .stereo.opencv import StereoBM, StereoSGBM
from .stereo.reasons import Reason
from .stereo.semi_global.matcher import SemiGlobalMatcher
from .stereo.windows.matcher import CorrelationMatcher
from .stereo.windows.search import SearchArea
from .templates import TemplateMatch, TemplateSearch, match_template
from .tuning.search import Suggestion
from .tuning.suggestion import suggest

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
    "scene_flow",
    "signal_lag",
    "suggest",
    "write_disparity",
    "write_matcher",
]
