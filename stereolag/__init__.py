"""Lag by correlation: between two recordings, of a template in an image, between the two images of a stereo camera.

>>> import stereolag as sl
>>> lag = sl.signal_lag(signal_1, signal_2, sampling_rate=44_100.0)
>>> search = sl.match_template(image, template)
>>> result = sl.preset("accurate", num_disparities=64).compute(left, right)

The public names are listed in ``__init__.pyi``; each is imported when it is first used.
"""

import lazy_loader

from stereolag.version import VERSION

__version__ = VERSION

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
