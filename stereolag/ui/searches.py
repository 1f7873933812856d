"""Names and explanations of the methods of the lag page and the template search page."""

from __future__ import annotations

LAG_METHODS = {"fft": "FFT", "phat": "GCC-PHAT", "sampled": "Sampled", "direct": "Direct"}

LAG_METHODS_EXPLAINED = {
    "fft": "Every lag at once: a fast Fourier transform turns the sliding and multiplying into one product. "
    "The method of choice.",
    "phat": "Like FFT, but every pitch counts the same: a needle-sharp peak, also in rooms that echo; "
    "loud noise hurts it more.",
    "sampled": "The report’s Appendix A: pick samples at random, look them up in the other recording, and let each "
    "vote for a lag. Reliable while the noise stays well below the sound.",
    "direct": "Slide by one sample, multiply, add up; again for every lag. Slow, and simple enough to trust.",
}

CURVES = {
    "fft": "correlation × √overlap",
    "phat": "phase correlation",
    "sampled": "votes",
    "direct": "correlation × √overlap",
}
"""The quantity that the curve of each method shows."""

TEMPLATE_METHODS = {"fft": "FFT", "sampled": "Sampled", "direct": "Direct"}

TEMPLATE_METHODS_EXPLAINED = {
    "fft": "Scores every place at once through a fast Fourier transform. Finds him dulled and half hidden too.",
    "sampled": "The report’s Appendix B: look for one rare pixel of the template and score only where the image has "
    "it. Very fast, but finds nothing once every pixel has changed.",
    "direct": "Slides the template over the image pixel by pixel. The same scores as FFT, in minutes: "
    "for comparison only.",
}
