"""Results, settings and the program that reproduces them, as files that other programs read.

All but :mod:`stereolag.export.writing` returns bytes or text and touches no disk. :mod:`stereolag.reading` reads
disparity maps and settings back.
"""

from stereolag.export.archives import bundle, file_name
from stereolag.export.calibrations import calibration_json, opencv_calibration, ros_calibration
from stereolag.export.confidence import confidence, confidence_png, has_scores, measured_mask_png
from stereolag.export.enlargement import enlarged
from stereolag.export.maps import (
    check_kitti,
    image_png,
    image_tiff,
    kitti_png,
    npy,
    pfm,
    ply,
    valid_mask_png,
)
from stereolag.export.opencv_programs import opencv_script
from stereolag.export.programs import script
from stereolag.export.sessions import session_json
from stereolag.export.settings import opencv_yaml, settings_json
from stereolag.export.tables import figures_of, metrics_csv, wav
from stereolag.export.writing import write_disparity, write_file, write_matcher

__all__ = [
    "bundle",
    "calibration_json",
    "check_kitti",
    "confidence",
    "confidence_png",
    "enlarged",
    "figures_of",
    "file_name",
    "has_scores",
    "image_png",
    "image_tiff",
    "kitti_png",
    "measured_mask_png",
    "metrics_csv",
    "npy",
    "opencv_calibration",
    "opencv_script",
    "opencv_yaml",
    "pfm",
    "ply",
    "ros_calibration",
    "script",
    "session_json",
    "settings_json",
    "valid_mask_png",
    "wav",
    "write_disparity",
    "write_file",
    "write_matcher",
]
