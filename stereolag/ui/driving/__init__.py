"""The parts of the driving page."""
