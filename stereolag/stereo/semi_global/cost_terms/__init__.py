"""The terms of the matching cost: each is one module, listed here, and its weight a field of the settings.

A compiled loop adds a term's cost for a run of neighbouring pixels at every lag. Inner loops over the lags are
functions of their own: in the body of the loop over the pixels they take four times as long.
"""

from stereolag.stereo.semi_global.cost_terms.census import CENSUS
from stereolag.stereo.semi_global.cost_terms.correlation import CORRELATION
from stereolag.stereo.semi_global.cost_terms.gradient import GRADIENT

TERMS = (CORRELATION, CENSUS, GRADIENT)
"""Every term, in the order in which their costs are added up."""
