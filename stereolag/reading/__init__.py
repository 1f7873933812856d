"""Where every untrusted byte enters: a user's own images, recordings, disparity maps, calibrations and settings.

A reader takes a path, bytes or a binary file object, bounds what it will decode before it decodes it, and answers
with checked arrays or with a ``ValueError`` of one clear sentence. It writes nothing, runs nothing and lets no warning
out; what it quotes from a file in an error is short and harmless.
"""

from stereolag.reading.calibrations import read_calibration
from stereolag.reading.disparities import read_disparity
from stereolag.reading.images import read_image
from stereolag.reading.matchers import read_matcher
from stereolag.reading.recordings import Recording, read_signal
from stereolag.reading.sources import Source

__all__ = ["Recording", "Source", "read_calibration", "read_disparity", "read_image", "read_matcher", "read_signal"]
