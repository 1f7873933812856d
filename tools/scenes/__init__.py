"""Path-traced stereo pairs with exact ground truth: what ``assets/stereo`` is made by.

Mitsuba 3 is needed to run this package and nothing else of the project needs it.
The world has z up and is measured in metres; colours are given in sRGB, 0 to 1.
"""

import mitsuba

mitsuba.set_variant("llvm_ad_rgb")
