"""The parts of the page that calibrates a stereo camera."""
