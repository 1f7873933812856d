"""Source of ``assets/drive``: six seconds on a motorway, path-traced with exact disparity and motion.

The objects of `tools.scenes` are animated here. The world has z up and is measured in metres; y points ahead.
"""
