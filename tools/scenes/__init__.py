"""Path-traced stereo pairs with exact ground truth, the source of ``assets/stereo``.

This package needs Mitsuba 3, which nothing else in the project needs.
The world has z up and is measured in metres; colours are given in sRGB, 0 to 1.
"""

import mitsuba

mitsuba.set_variant("llvm_ad_rgb")
