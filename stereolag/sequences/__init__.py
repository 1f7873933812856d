"""Frame sequences of stereo cameras: their sources, the job over all frames, and the video of its maps."""

from stereolag.sequences.opening import example_sequence, open_sequence
from stereolag.sequences.running import run_sequence
from stereolag.sequences.settings import SequenceMotion, SequenceSettings
from stereolag.sequences.sources import RectifiedSequence, StereoFrame, StereoSequence
from stereolag.sequences.states import SequenceResult, SequenceState
from stereolag.sequences.steadying import Steadiness
from stereolag.sequences.targets import SequenceMemory, SequenceTarget

__all__ = [
    "RectifiedSequence",
    "SequenceMemory",
    "SequenceMotion",
    "SequenceResult",
    "SequenceSettings",
    "SequenceState",
    "SequenceTarget",
    "Steadiness",
    "StereoFrame",
    "StereoSequence",
    "example_sequence",
    "open_sequence",
    "run_sequence",
]
