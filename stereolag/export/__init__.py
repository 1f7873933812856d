"""Take it away: results, settings and the program that reproduces them, as the bytes of files that others read.

Nothing is written to disk here. What :mod:`stereolag.reading` reads comes back as it went out.
"""

from stereolag.export.archives import bundle, file_name
from stereolag.export.maps import (
    check_kitti,
    image_png,
    image_tiff,
    kitti_png,
    npy,
    pfm,
    ply,
    reason_png,
    valid_mask_png,
)
from stereolag.export.programs import script
from stereolag.export.settings import opencv_yaml, settings_json
from stereolag.export.tables import metrics_csv, wav

__all__ = [
    "bundle",
    "check_kitti",
    "file_name",
    "image_png",
    "image_tiff",
    "kitti_png",
    "metrics_csv",
    "npy",
    "opencv_yaml",
    "pfm",
    "ply",
    "reason_png",
    "script",
    "settings_json",
    "valid_mask_png",
    "wav",
]
