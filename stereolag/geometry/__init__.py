"""From pixels to metres: calibration, rectification, scaling, point clouds, distances."""
