"""The layouts in which makers write calibrations: each a row of :data:`LAYOUTS`, recognised by its names.

A layout turns the entries of its files into parts (:mod:`stereolag.io.calibration_parts`). Files in none of these
layouts are read by the meaning of their names.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolag.io.calibration_files import Entries, Entry, Matrix
from stereolag.io.calibration_parts import (
    COEFFICIENT_KEYS,
    FISHEYE,
    NUM_DISPARITIES_NAMES,
    SIZE_NAMES,
    Parts,
    camera_parts,
    inverse,
    lens_of,
    numeric_entry,
    parts_by_meaning,
    pose_from_common_frame,
    pose_parts,
    relative_pose,
    rigid_transform,
)

Reader: TypeAlias = Callable[[Entries], list[Parts]]
"""A function from the entries of a calibration to the parts for each size of pictures that it covers."""


class Layout(NamedTuple):
    """A maker's layout of calibration files.

    Attributes
    ----------
    name
        Its maker or format.
    marks
        Patterns, in any case: all files of this layout have a name that matches each of them.
    read
        Its reader.
    unit
        The unit of its lengths, one of :data:`~stereolag.geometry.calibration.UNITS`.
    unit_is_fixed
        Whether all files use this unit; otherwise it is the default for files that do not state theirs.
    ignored
        A pattern of names that are expected to have no effect.
    """

    name: str
    marks: tuple[str, ...]
    read: Reader
    unit: str = "m"
    unit_is_fixed: bool = True
    ignored: str = ""


def layout_of(entries: Entries) -> Layout:
    """Return the first layout with all of its marks among the entries."""
    return next(
        layout
        for layout in LAYOUTS
        if all(any(re.fullmatch(mark, name, re.IGNORECASE) for name in entries) for mark in layout.marks)
    )


# Layouts of makers.


def named(**names: str) -> Reader:
    """Return a reader of parts that have these names; alternatives for one part are separated by ``|``."""

    def read(entries: Entries) -> list[Parts]:
        for part in ("focal", "M1", "baseline"):
            if part in names:
                entries.required(names[part])
        return [entries.select(names | SIZE_NAMES | {"num_disparities": NUM_DISPARITIES_NAMES})]

    return read


ZED_SIZES = {
    "HD": (1280, 720),
    "2K": (2208, 1242),
    "FHD": (1920, 1080),
    "FHD1200": (1920, 1200),
    "VGA": (672, 376),
    "SVGA": (960, 600),
    "4K": (3840, 2160),
    "QHDPLUS": (3200, 1800),
}
"""Sizes of pictures by Stereolabs' names."""


def _zed(entries: Entries) -> list[Parts]:
    """Read a pair of cameras for each size; the right one is at (Baseline, TY, TZ), rotated by the vector R.

    The coefficients of the lenses are given for each size, or once for all; then those of fisheyes have no p1 and p2.
    """
    modes = []
    is_shared = entries.find("LEFT_DISTO.k1") is not None
    is_fisheye = is_shared and entries.find("LEFT_DISTO.p1") is None
    keys = COEFFICIENT_KEYS[is_fisheye]
    for mode, size in ZED_SIZES.items():
        left, right = f"LEFT_CAM_{mode}", f"RIGHT_CAM_{mode}"
        if entries.find(f"{left}.fx") is None:
            continue
        angles = [f"STEREO.RX_{mode}", f"STEREO.CV_{mode}|STEREO.RY_{mode}", f"STEREO.RZ_{mode}"]
        vector = np.array([entries.required(name).numbers(1)[0] for name in angles])
        rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)
        ty_tz = [entries.number(f"STEREO.{axis}_{mode}|STEREO.{axis}") or 0.0 for axis in ("TY", "TZ")]
        position = np.array([entries.required("STEREO.Baseline").numbers(1)[0], *ty_tz])
        modes.append(
            camera_parts(entries, "1", left, "LEFT_DISTO" if is_shared else left, lens_keys=keys)
            | camera_parts(entries, "2", right, "RIGHT_DISTO" if is_shared else right, lens_keys=keys)
            | ({"lens": Entry("LEFT_DISTO", FISHEYE)} if is_fisheye else {})
            | pose_parts("STEREO", rotation, -rotation @ position)
            | {"size0": numeric_entry(mode, size)}
        )
    return modes


def _depthai(entries: Entries) -> list[Parts]:
    """Read the cameras on the left and the right socket, each with its transform into the frame of another socket."""
    sockets: dict[int, str] = {}
    while (socket := entries.number(f"cameraData.{len(sockets)}.0")) is not None:
        sockets[int(socket)] = f"cameraData.{len(sockets)}.1"

    def to_last(socket: int) -> Matrix:
        """Return the transform from a camera's frame into that of the last camera in its chain of sockets."""
        transform = np.eye(4)
        for _ in sockets:
            path = f"{sockets[socket]}.extrinsics"
            next_socket = int(entries.required(f"{path}.toCameraSocket").numbers(1)[0])
            if next_socket not in sockets:
                break
            step = np.eye(4)
            step[:3, :3] = entries.required(f"{path}.rotationMatrix").matrix(3, 3)
            for kind in ("specTranslation", "translation"):  # the measured one, if stated, replaces the designed one
                translation = [entries.number(f"{path}.{kind}.{axis}") or 0.0 for axis in "xyz"]
                step[:3, 3] = translation if any(translation) else step[:3, 3]
            transform, socket = step @ transform, next_socket
        return transform

    parts: Parts = {}
    chosen = []
    for side, name, default in (("1", "left", 1), ("2", "right", 2)):
        stated = entries.number(f"stereoRectificationData.{name}CameraSocket")
        socket = default if stated is None or stated < 0 else int(stated)
        if socket not in sockets:
            raise ValueError(f"The calibration (DepthAI) has no camera on socket {socket}, that of the {name} one.")
        chosen.append(socket)
        path = sockets[socket]
        camera_type = int(entries.number(f"{path}.cameraType") or 0)
        if camera_type > 1:
            raise ValueError(
                f"The calibration (DepthAI) has a camera of type {camera_type}; allowed are perspective and fisheye."
            )
        lens = entries.required(f"{path}.distortionCoeff").numbers()
        parts |= {
            f"M{side}": entries.required(f"{path}.intrinsicMatrix"),
            f"D{side}": numeric_entry(f"{path}.distortionCoeff", lens[:4] if camera_type else lens),
            f"width{side}": entries.required(f"{path}.width"),
            f"height{side}": entries.required(f"{path}.height"),
        }
        if camera_type:
            parts["lens"] = Entry(f"{path}.cameraType", FISHEYE)
    return [parts | relative_pose("extrinsics", *(inverse(to_last(socket)) for socket in chosen))]


def _realsense(entries: Entries) -> list[Parts]:
    """Read a rectified pair for each size; the baseline is negative: the left camera's position seen from the right."""
    baseline = numeric_entry("baseline", np.abs(entries.required("baseline").numbers(1)))
    names = {"cx": "ppx", "cy": "ppy", "width0": "width", "height0": "height"}
    modes, number = [], 0
    while (focal := entries.find(f"rectified.{number}.fx")) is not None:
        parts = {part: entries.required(f"rectified.{number}.{name}") for part, name in names.items()}
        if focal.numbers(1)[0] > 0 and parts["width0"].numbers(1)[0] > 0:
            modes.append(parts | {"focal": focal, "baseline": baseline})
        number += 1
    return modes


def _ros_ini(entries: Entries) -> list[Parts]:
    """Read cameras in sections with their names, as if they were in ROS's YAML."""
    cameras = []
    for file in entries.files:
        for name in filter(re.compile(r".*\.camera matrix", re.IGNORECASE).fullmatch, file):
            section = name.rpartition(".")[0]
            camera = {"camera_name": Entry("camera_name", section)}
            for part in ("camera matrix", "distortion", "rectification", "projection", "image.width", "image.height"):
                entry = file.find(part if part.startswith("image") else f"{section}.{part}")
                if entry is not None:
                    camera[part.replace(" ", "_").replace(".", "_")] = entry
            cameras.append(Entries(camera))
    return parts_by_meaning(Entries(*cameras))


def _matlab(entries: Entries) -> list[Parts]:
    """Read ``toStruct(stereoParams)``: pixels count from 1, sizes are (rows, cols), older matrices are transposed."""
    first = next(name for name in entries if "CameraParameters1." in name)
    prefix = first[: first.index("CameraParameters1.")]
    parts: Parts = {}
    for side in "12":
        path = f"{prefix}CameraParameters{side}"
        newer = entries.find(f"{path}.K")
        matrix = newer.matrix(3, 3) if newer else entries.required(f"{path}.IntrinsicMatrix").matrix(3, 3).T
        radial = entries.required(f"{path}.RadialDistortion").numbers()
        tangential = entries.required(f"{path}.TangentialDistortion").numbers(2)
        parts |= {
            f"M{side}": numeric_entry(f"{path}.K", matrix - [[0, 0, 1], [0, 0, 1], [0, 0, 0]]),
            f"D{side}": numeric_entry(f"{path}.RadialDistortion", [*radial[:2], *tangential, *radial[2:]]),
        }
        if size := entries.find(f"{path}.ImageSize"):
            parts[f"size{side}"] = numeric_entry(size.name, size.numbers(2)[::-1])
    parts |= entries.select({"unit": f"{prefix}CameraParameters1.WorldUnits|{prefix}WorldUnits"})
    if rotation := entries.find(f"{prefix}RotationOfCamera2"):
        translation = entries.required(f"{prefix}TranslationOfCamera2")
        return [parts | pose_parts(rotation.name, rotation.matrix(3, 3).T, translation.numbers(3))]
    pose = entries.required(f"{prefix}PoseCamera2.A|{prefix}PoseCamera2.R")
    if pose.numbers().size == 16:
        return [parts | pose_parts(pose.name, pose.matrix(4, 4)[:3, :3], pose.matrix(4, 4)[:3, 3])]
    translation = entries.required(f"{prefix}PoseCamera2.Translation")
    return [parts | pose_parts(pose.name, pose.matrix(3, 3), translation.numbers(3))]


def _matlab_for_opencv(entries: Entries) -> list[Parts]:
    """Read the results of ``stereoParametersToOpenCV``, saved under their own names; the size is (rows, cols)."""
    names = {
        "R": "rotationOfCamera2",
        "T": "translationOfCamera2",
        **{f"M{side}": f"intrinsicMatrix{side}" for side in "12"},
        **{f"D{side}": f"distortionCoefficients{side}" for side in "12"},
    }
    parts = {part: entries.required(name) for part, name in names.items()}
    if size := entries.find("imageSize"):
        parts["size0"] = numeric_entry(size.name, size.numbers(2)[::-1])
    return [parts]


def _bouguet(entries: Entries) -> list[Parts]:
    """Read Bouguet's toolbox for MATLAB: focal lengths fc, centre cc, distortion kc, rotation om."""
    parts = {"R": entries.required("om|R"), "T": entries.required("T")}
    for side, name in (("1", "left"), ("2", "right")):
        (fx, fy), (cx, cy) = (entries.required(f"{part}_{name}").numbers(2) for part in ("fc", "cc"))
        skew = fx * (entries.number(f"alpha_c_{name}") or 0.0)
        parts |= {
            f"M{side}": numeric_entry(f"fc_{name}", [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]),
            f"D{side}": entries.required(f"kc_{name}"),
        }
    return [parts | entries.select({"width0": "nx", "height0": "ny"})]


def _drivingstereo(entries: Entries) -> list[Parts]:
    """Read the rectified pair, with the baseline from T: half-size projections still hold that of the full size."""
    left, right = (entries.required(f"P_rect_{number}").projection() for number in (101, 103))
    return [
        {
            "M1": numeric_entry("P_rect_101", left[:, :3]),
            "M2": numeric_entry("P_rect_103", right[:, :3]),
            "baseline": numeric_entry("T_103", np.linalg.norm(entries.required("T_103").numbers(3)).reshape(1)),
            "size0": entries.required("S_rect_101"),
        }
    ]


def kitti(left: int, right: int) -> Reader:
    """Return a reader of two cameras of KITTI: of the rectified pair, and also of the raw one if the file has both."""

    def read(entries: Entries) -> list[Parts]:
        rectified, raw = {}, {}
        for side, number in (("1", left), ("2", right)):
            of = {
                name: entries.match(rf"{name}_?0*{number}")
                for name in ("P_rect", "P", "S_rect", "K", "D", "R_rect", "S")
            }
            projection = of["P_rect"] or of["P"]
            if projection is not None:
                rectified[f"P{side}"] = projection
                # The vertical and axial offsets of the cameras are below a centimetre, but exceed the row difference
                # that a rectification may have here.
                without_offsets = projection.projection() * [[1, 1, 1, 1], [1, 1, 1, 0], [1, 1, 1, 0]]
                raw[f"P{side}"] = numeric_entry(projection.name, without_offsets)
            rectified |= {"size0": size} if (size := of["S_rect"]) else {}
            found = {f"M{side}": of["K"], f"D{side}": of["D"], f"R{side}": of["R_rect"], "size0": of["S"]}
            raw |= {part: entry for part, entry in found.items() if entry is not None}
        return [rectified, raw] if {"M1", "R1", "M2", "R2", "size0"} <= set(raw) else [rectified]

    return read


def _rows(entries: Entries) -> list[Parts]:
    """Read numbers without names: two projections, Q, or a matrix and a baseline (the learned matchers' K.txt)."""
    entries.used.update(entries)
    values = np.concatenate([entry.numbers() for entry in entries.values()])
    if values.size == 10:
        return [
            {
                "M1": numeric_entry("the first row", values[:9].reshape(3, 3)),
                "baseline": numeric_entry("the last", values[9:]),
            }
        ]
    if values.size == 16:
        return [{"Q": numeric_entry("the rows", values)}]
    if values.size >= 24 and entries["row0"].numbers().size in (4, 12):
        return [{f"P{side}": numeric_entry(f"row{side}", values[12 * side - 12 : 12 * side]) for side in (1, 2)}]
    raise ValueError(
        f"The calibration is {values.size} numbers without names; accepted are a camera matrix and the baseline (9 and "
        "1), Q (16), or two projections (12 each)."
    )


def _orb_slam(entries: Entries) -> list[Parts]:
    """Read raw cameras with their rectification (ORB-SLAM2) or pose (ORB-SLAM3), or a rectified pair."""
    if entries.find("LEFT.K"):
        cameras = Entries({name: entry for name, entry in entries.items() if name.startswith(("LEFT", "RIGHT"))})
        return parts_by_meaning(Entries(cameras))
    size = entries.select(SIZE_NAMES)
    first = "Camera1" if entries.find("Camera1.fx") else "Camera"
    right_to_left = entries.find("Stereo.T_c1_c2|Tlr")
    if entries.find("Camera2.fx") and right_to_left is not None:
        keys = COEFFICIENT_KEYS[lens_of(entries) == FISHEYE]
        parts = camera_parts(entries, "1", first, first, lens_keys=keys) | camera_parts(
            entries, "2", "Camera2", "Camera2", lens_keys=keys
        )
        elements = right_to_left.numbers()
        transform = elements.reshape(-1, 4) if elements.size in (12, 16) else right_to_left.matrix(4, 4)
        return [parts | size | relative_pose(right_to_left.name, np.eye(4), inverse(transform))]
    distorting = [name for lens in ("k1", "k2", "k3", "p1", "p2") if entries.number(name := f"{first}.{lens}")]
    if distorting:
        raise ValueError(
            f"The calibration (ORB-SLAM) has a lens with distortion ({', '.join(distorting)}), but neither Camera2 "
            "with Stereo.T_c1_c2 nor LEFT.K with the rectification: its pictures cannot be rectified."
        )
    parts = camera_parts(entries, "1", first, "no lens")
    parts |= {"baseline": entries.required("Stereo.b")} if entries.find("Stereo.b") else {}
    return [parts | size | ({} if "baseline" in parts else {"product": entries.required("Camera.bf")})]


def _vins(entries: Entries) -> list[Parts]:
    """Read the two cameras of VINS-Fusion, each in its own file, and the file with their poses."""
    cameras = [file for file in entries.files if file.match(r"projection_parameters\.(fx|mu)")]
    if len(cameras) != 2:
        raise ValueError(
            f"The calibration (VINS) is of {len(cameras)} camera{'s' * (len(cameras) != 1)}; give the files of both "
            "together with the one that has body_T_cam0 and body_T_cam1."
        )
    lens, matrix_keys, lens_keys = (
        ("projection_parameters", ("mu", "mv", "u0", "v0"), ("k2", "k3", "k4", "k5"))
        if lens_of(entries) == FISHEYE
        else ("distortion_parameters", ("fx", "fy", "cx", "cy"), COEFFICIENT_KEYS[False])
    )
    parts: Parts = {}
    for side, camera in zip("12", cameras, strict=True):
        parts |= camera_parts(camera, side, "projection_parameters", lens, matrix_keys, lens_keys) | {
            f"{part[:-1]}{side}": camera.required(name) for part, name in SIZE_NAMES.items()
        }
    pose = pose_from_common_frame(entries)
    if pose is None:
        raise ValueError("The calibration (VINS) lacks body_T_cam0 and body_T_cam1; give the file that has them too.")
    return [parts | pose]


def _okvis(entries: Entries) -> list[Parts]:
    """Read the first two cameras of a list; T_SC or T_BS are transforms from the cameras' frames into a common one."""
    parts: Parts = {}
    for side, path in (("1", "cameras.0"), ("2", "cameras.1")):
        (fx, fy), (cx, cy) = (
            entries.required(f"{path}.{name}").numbers(2) for name in ("focal_length", "principal_point")
        )
        parts |= {f"M{side}": numeric_entry(f"{path}.focal_length", [fx, fy, cx, cy])} | entries.select(
            {f"D{side}": f"{path}.distortion_coefficients", f"size{side}": f"{path}.image_dimension"}
        )
    poses = [entries.required(f"cameras.{number}.T_SC|cameras.{number}.T_BS").matrix(4, 4) for number in (0, 1)]
    return [parts | relative_pose("T_SC", *map(inverse, poses))]


def _basalt(entries: Entries) -> list[Parts]:
    """Read the first two cameras; their poses are transforms from the cameras' frames, with quaternions."""
    parts: Parts = {}
    poses = []
    prefix = "value0." if entries.find("value0.T_imu_cam.0.px") else ""
    keys = COEFFICIENT_KEYS[lens_of(entries) == FISHEYE]
    for side, number in (("1", 0), ("2", 1)):
        path = f"{prefix}intrinsics.{number}.intrinsics"
        parts |= camera_parts(entries, side, path, path, lens_keys=keys)
        x, y, z, *quaternion = (
            entries.required(f"{prefix}T_imu_cam.{number}.{name}").numbers(1)[0]
            for name in ("px", "py", "pz", "qw", "qx", "qy", "qz")
        )
        poses.append(rigid_transform(quaternion, (x, y, z)))
    if size := entries.find(f"{prefix}resolution"):
        parts["size0"] = numeric_entry(size.name, size.numbers()[:2])
    return [parts | relative_pose("T_imu_cam", *map(inverse, poses))]


def _mrpt(entries: Entries) -> list[Parts]:
    """Read both cameras; the pose is that of the right one in the left one's frame: x, y, z and a quaternion."""
    parts: Parts = {}
    for side, name in (("1", "LEFT"), ("2", "RIGHT")):
        path = f"CAMERA_PARAMS_{name}"
        parts |= camera_parts(entries, side, path, "no lens") | entries.select(
            {f"D{side}": f"{path}.dist", f"size{side}": f"{path}.resolution"}
        )
    pose = entries.required("CAMERA_PARAMS_LEFT2RIGHT_POSE.pose_quaternion")
    translation, quaternion = np.split(pose.numbers(7), [3])
    return [parts | relative_pose(pose.name, np.eye(4), inverse(rigid_transform(quaternion, translation)))]


def _mc_calib(entries: Entries) -> list[Parts]:
    """Read two cameras; their poses are transforms from the cameras' frames; lengths are in the unit of the board."""
    (parts,) = parts_by_meaning(entries)
    poses = [entries.required(f"camera_{number}.camera_pose_matrix").matrix(4, 4) for number in (0, 1)]
    return [parts | relative_pose("camera_pose_matrix", *map(inverse, poses))]


def _dsec(entries: Entries) -> list[Parts]:
    """Read the rectified pairs of the frame cameras, 1 and 2, and of the event cameras, 0 and 3."""
    return [
        entries.select({"Q": f"disparity_to_depth.cams_{pair}", "size0": f"intrinsics.camRect{pair[0]}.resolution"})
        for pair in ("12", "03")
    ]


def _cityscapes(entries: Entries) -> list[Parts]:
    """Read the rectified pair; the data set's pictures, whose size is not stated, have 2048 × 1024 pixels."""
    (parts,) = named(focal="intrinsic.fx", baseline="extrinsic.baseline", cx="intrinsic.u0", cy="intrinsic.v0")(entries)
    centre = [parts[name].numbers(1)[0] for name in ("cx", "cy") if name in parts]
    if len(centre) == 2 and np.abs(np.array(centre) / (1024, 512) - 1).max() < 0.1:
        parts["size0"] = numeric_entry("size", (2048, 1024))
    return [parts]


FOCAL_NAMES = "focal_px|fx|focal_length_px|focal_length|intrinsics.fx|intrinsic.fx"
LAYOUTS = (
    Layout("ZED", (r"LEFT_CAM_\w+\.fx", r"STEREO\.Baseline"), _zed, "mm", ignored=r"MISC\..*|STEREO\..*"),
    Layout("DepthAI", (r"cameraData\.0\.0",), _depthai, "cm", ignored=".*"),
    Layout("RealSense", (r"rectified\.0\.fx", "baseline"), _realsense, "mm", ignored=".*"),
    Layout("ROS", (r".*\.camera matrix",), _ros_ini),
    Layout("MATLAB", (r"(.*\.)?CameraParameters1\..*",), _matlab, "mm", unit_is_fixed=False, ignored=".*"),
    Layout("MATLAB", ("intrinsicMatrix1", "rotationOfCamera2"), _matlab_for_opencv, "mm", unit_is_fixed=False),
    Layout("MATLAB", ("fc_left", "fc_right"), _bouguet, "mm", unit_is_fixed=False, ignored=".*"),
    Layout("DrivingStereo", ("P_rect_101", "P_rect_103", "T_103"), _drivingstereo, ignored=r"\w+_10[13]|corner_dist"),
    Layout(
        "ORB-SLAM",
        (r"Camera1?\.fx",),
        _orb_slam,
        ignored=r"(ORBextractor|Viewer|Stereo|IMU|System)\..*|ThDepth|Camera\.(fps|RGB)",
    ),
    Layout("VINS", (r"projection_parameters\.\w+",), _vins, ignored=r"(?!\w+_parameters).*"),
    Layout(
        "Cityscapes", (r"intrinsic\.fx", r"extrinsic\.baseline"), _cityscapes, ignored=r"extrinsic\..*|intrinsic.fy"
    ),
    Layout("cvkit", (r"camera\.A", "rho"), named(M1="camera.A", product="rho"), ignored=r"t|camera\..*|disp\..*"),
    Layout("cvkit", (r"camera\.A", "t"), named(M1="camera.A", baseline="t"), ignored=r"camera\..*|disp\..*"),
    Layout("OKVIS", (r"cameras\.0\.focal_length", r"cameras\.1\.T_(SC|BS)"), _okvis, ignored=".*"),
    Layout("Basalt", (r"(value0\.)?T_imu_cam\.1\.px",), _basalt, ignored=".*"),
    Layout("MRPT", (r"CAMERA_PARAMS_LEFT2RIGHT_POSE\..*",), _mrpt, ignored=".*"),
    Layout("MC-Calib", (r"camera_1\.camera_pose_matrix",), _mc_calib, unit_is_fixed=False, ignored=".*"),
    Layout("DSEC", (r"disparity_to_depth\.cams_12",), _dsec, ignored=".*"),
    *(
        Layout(
            "JSON",
            (FOCAL_NAMES, *marks),
            named(
                focal=FOCAL_NAMES,
                baseline=baseline,
                doffs="doffs_px|doffs",
                cx="cx|cx0|intrinsics.cx|intrinsic.cx",
                cx2="cx1",
                cy="cy|cy0|cy1|intrinsics.cy|intrinsic.cy",
                turn="turn",
            ),
            unit,
            unit_is_fixed=baseline != "baseline",
            ignored=r"(intrinsics?\.)?fy|left_image_rect_normalized",
        )
        for marks, baseline, unit in (
            (("baseline_mm",), "baseline_mm", "mm"),
            (("baseline_cm",), "baseline_cm", "cm"),
            (("baseline",), "baseline", "m"),
            ((), "baseline_m|baseline_meters|baseline_metres", "m"),
        )
    ),
    Layout(
        "Middlebury",
        ("cam0",),
        named(M1="cam0", M2="cam1", baseline="baseline", doffs="doffs"),
        "mm",
        ignored="isint|vmin|vmax|dyavg|dymax",
    ),
    *(
        Layout("KITTI", tuple(mark.format(number) for number in both), kitti(*both), ignored=r"[A-Za-z]\w*")
        for mark, both in (("P_rect_0?{}", (2, 3)), ("P_?0*{}", (2, 3)), ("P_rect_0?{}", (0, 1)))
    ),
    Layout("rows", ("row0",), _rows, unit_is_fixed=False),
    Layout("OpenCV", (), parts_by_meaning, unit_is_fixed=False, ignored=r"(header|roi|stamp)\..*|binning_[xy]"),
)
"""The layouts, tried in this order. The last one matches every file, and reads it by the meaning of its names."""
