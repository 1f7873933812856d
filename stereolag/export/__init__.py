"""Results, settings and programs that reproduce them, as files for other programs.

Everything but :mod:`stereolag.export.writing` returns bytes or text without touching the disk.
:mod:`stereolag.reading` reads disparity maps and settings back.
"""

from stereolag.export.archives import bundle, file_name
from stereolag.export.calibrations import calibration_json, opencv_calibration, ros_calibration
from stereolag.export.confidence import confidence, confidence_png, has_scores, measured_mask_png
from stereolag.export.enlargement import enlarged
from stereolag.export.lags import aligned_wav, check_aligned_wav, curve_csv, lag_figures, lag_json
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
from stereolag.export.matches import matches_csv, matches_json, search_figures
from stereolag.export.opencv_programs import opencv_script
from stereolag.export.programs import script
from stereolag.export.search_programs import find_command, find_script, lag_command, lag_script
from stereolag.export.sessions import session_json
from stereolag.export.settings import opencv_yaml, settings_json
from stereolag.export.tables import figures_of, metrics_csv, wav
from stereolag.export.writing import write_disparity, write_file, write_matcher

__all__ = [
    "aligned_wav",
    "bundle",
    "calibration_json",
    "check_aligned_wav",
    "check_kitti",
    "confidence",
    "confidence_png",
    "curve_csv",
    "enlarged",
    "figures_of",
    "file_name",
    "find_command",
    "find_script",
    "has_scores",
    "image_png",
    "image_tiff",
    "kitti_png",
    "lag_command",
    "lag_figures",
    "lag_json",
    "lag_script",
    "matches_csv",
    "matches_json",
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
    "search_figures",
    "session_json",
    "settings_json",
    "valid_mask_png",
    "wav",
    "write_disparity",
    "write_file",
    "write_matcher",
]
