"""Sentences and names that several pages show: the core returns codes and numbers; this module puts them in words."""

from __future__ import annotations

MOTION_IN_WORDS = {
    "unrelated": "Motion unknown: this frame has nothing in common with the one before it.",
    "blank": "Motion unknown: this frame or the one before it shows nothing but noise.",
    "static background": "Motion unknown: things move everywhere in front of a static background, so two motions fit.",
    "identical": "This frame is an exact copy of the one before it, so it says nothing about speed.",
    "nothing static": "Own speed unknown: no single motion explains half of the picture.",
    "two motions": "Own speed unknown: two motions share the picture. A bonnet or a lorry ahead may fill much of it.",
    "inaccurate": "Own speed unknown: too little of the scene is near enough to measure it.",
}
"""Why the motion between two frames, or our own motion, is unknown, by reason."""

CHOICE_NAMES = {
    "zncc": "ZNCC",
    "ncc": "NCC",
    "cross": "Plain",
    "phase": "Phase",
    "auto": "Automatic",
    "window_sums": "Window sums",
    "fft": "FFT",
    "sgbm": "5",
    "hh": "8",
    "sgbm_3way": "3",
    "hh4": "4",
}
"""Display names of the choices in settings."""


# Methods of the lag page and the template search page

LAG_METHODS = {"fft": "FFT", "phat": "GCC-PHAT", "sampled": "Sampled", "direct": "Direct"}

LAG_METHODS_EXPLAINED = {
    "fft": "Every lag at once: a fast Fourier transform turns the sliding and multiplying into one product. "
    "The method of choice.",
    "phat": "Like FFT, but every frequency counts the same: a needle-sharp peak, even in rooms that echo, but more "
    "easily hidden by loud noise.",
    "sampled": "The report’s Appendix A: pick samples at random, look them up in the other recording, and let each "
    "vote for a lag. Reliable while the noise stays well below the sound.",
    "direct": "Slide by one sample, multiply, add up, and repeat for every lag. Slow, but simple enough to trust.",
}

CURVES = {
    "fft": "correlation, weighted by overlap",
    "phat": "phase correlation",
    "sampled": "votes",
    "direct": "correlation, weighted by overlap",
}
"""The quantity that the curve of each method shows."""

TEMPLATE_METHODS = {"fft": "FFT", "sampled": "Sampled", "direct": "Direct"}

TEMPLATE_METHODS_EXPLAINED = {
    "fft": "Scores every place at once through a fast Fourier transform. Finds a dimmed or half hidden template too.",
    "sampled": "The report’s Appendix B: look for one rare pixel of the template and score only where the image has "
    "it. Very fast, but finds nothing once every pixel has changed.",
    "direct": "Slides the template over the image pixel by pixel. The same scores as FFT, in minutes: "
    "for comparison only.",
}


# Live

LIVE_WORDS = {
    "start": "Start",
    "stop": "Stop",
    "off": "Nothing is recorded or sent before you start.",
    "asking": "The browser is asking for your permission …",
    "connecting": "Connecting …",
    "on": "Live",
    "carried": "Live, over the page's own connection: slower",
    "paused": "Paused while this tab is hidden.",
    "waiting": "All places are taken. You are number {ahead} in the queue.",
    "insecure": "Browsers allow cameras and microphones only at https addresses and on localhost. Ask the operator of "
    "this server for an https address.",
    "NotAllowedError": "The browser does not allow it: allow the camera or microphone for this page in the address "
    "bar, then start again.",
    "NotFoundError": "No such device is connected. Connect one, then start again.",
    "NotReadableError": "The device is in use by another program. Close that program, then start again.",
    "OverconstrainedError": "The chosen device is no longer connected. Choose another one.",
    "unplugged": "The device was unplugged. Connect it again, then start.",
    "failed": "The device cannot be used: {error}",
    "1009": "The frame is larger than this server accepts. Choose a smaller size.",
    "4400": "The server did not understand a message and ended the stream. Start again.",
    "4401": "This stream belongs to another tab, or the page is too old. Reload it.",
    "4408": "The time allowed for one stream is over. Start again if you like.",
    "4429": "The browser sent more than this server accepts, so it ended the stream. Start again.",
    "4503": "All places are taken, and the queue is full. Try again later.",
    "lost": "The connection to the server was lost. Start again.",
}
"""Sentences of all live panels, by state, by name of the browser's error, and by the code with which a stream ended."""
