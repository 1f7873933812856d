"""Frame sequences of stereo cameras: sources, doctor, the job over all frames, and the video of its maps."""

from stereolag.sequences.examination import diagnose_sequence
from stereolag.sequences.frames import SequenceMemory, SequenceTarget
from stereolag.sequences.motion import SequenceMotion, SequenceSettings, Steadiness
from stereolag.sequences.running import SequenceResult, SequenceState, run_sequence
from stereolag.sequences.sources import (
    StereoFrame,
    StereoSequence,
    example_sequence,
    open_sequence,
    rectified_sequence,
)
from stereolag.sequences.video import SequenceVideo

__all__ = [
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
    "diagnose_sequence",
    "example_sequence",
    "open_sequence",
    "rectified_sequence",
    "run_sequence",
]
