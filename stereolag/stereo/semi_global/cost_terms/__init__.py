"""Terms of the matching cost: each is a module listed here, and its weight is a field of the settings.

A compiled loop adds a term's cost for a run of neighbouring pixels at every lag. Inner loops over the lags are separate
functions: in the body of the loop over the pixels they take four times as long.
"""

from stereolag.stereo.semi_global.cost_terms.census import CENSUS
from stereolag.stereo.semi_global.cost_terms.correlation import CORRELATION
from stereolag.stereo.semi_global.cost_terms.gradient import GRADIENT

TERMS = (CORRELATION, CENSUS, GRADIENT)
"""Every term, in the order their costs are added."""
