"""The parts of the page that measures the lag of two recordings."""
