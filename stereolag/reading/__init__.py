"""Readers of untrusted bytes: a user's own images, recordings, disparity maps, calibrations and settings.

A reader takes a path, bytes or a binary file object, checks its size before decoding anything, and returns checked
arrays or raises a ``ValueError`` of one clear sentence. It writes nothing, runs nothing and emits no warnings; the text
that it quotes from a file in an error is short and harmless.
"""

from stereolag.reading.calibrations import read_calibration
from stereolag.reading.disparities import read_disparity
from stereolag.reading.images import read_image
from stereolag.reading.matchers import read_matcher
from stereolag.reading.recordings import Recording, read_signal
from stereolag.reading.sources import Source

__all__ = ["Recording", "Source", "read_calibration", "read_disparity", "read_image", "read_matcher", "read_signal"]
