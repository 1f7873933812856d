"""Frame sequences of stereo cameras: where frames come from, the job over all of them, and the video of its maps."""

from stereolag.sequences.opening import open_sequence
from stereolag.sequences.running import SequenceResult, SequenceState, run_sequence
from stereolag.sequences.sources import StereoFrame, StereoSequence

__all__ = ["SequenceResult", "SequenceState", "StereoFrame", "StereoSequence", "open_sequence", "run_sequence"]
