"""The parts of the page that measures the lag of two recordings, and the colours of its components."""

from typing import Final

from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2

COLOURS: Final = {"sensor-1": SENSOR_1, "sensor-2": SENSOR_2, "curve": CORRELATION, "peak": PEAK}
