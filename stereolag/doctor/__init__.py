"""The input doctor: what is wrong with a stereo pair, and what mends it."""
