"""Frame sequences of stereo cameras: their sources, the job over all frames, and the video of its maps."""

from stereolag.sequences.motion import SequenceMotion, SequenceSettings
from stereolag.sequences.running import SequenceResult, SequenceState, run_sequence
from stereolag.sequences.sources import RectifiedSequence, StereoFrame, StereoSequence, example_sequence, open_sequence
from stereolag.sequences.steadying import Steadiness
from stereolag.sequences.targets import SequenceMemory, SequenceTarget
from stereolag.sequences.video import SequenceVideo

__all__ = [
    "RectifiedSequence",
    "SequenceMemory",
    "SequenceMotion",
    "SequenceResult",
    "SequenceSettings",
    "SequenceState",
    "SequenceTarget",
    "SequenceVideo",
    "Steadiness",
    "StereoFrame",
    "StereoSequence",
    "example_sequence",
    "open_sequence",
    "run_sequence",
]
