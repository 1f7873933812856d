"""The lag between two recordings: by FFT correlation, by phase, by votes of samples, or lag by lag."""

from stereolag.core.searches import SignalMethod
from stereolag.signals.alignment import align
from stereolag.signals.lag import SignalLag, estimate_lag, signal_lag

__all__ = ["SignalLag", "SignalMethod", "align", "estimate_lag", "signal_lag"]
