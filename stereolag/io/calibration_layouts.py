"""The layouts in which makers write calibrations: each a row of :data:`LAYOUTS`, recognised by its names.

A layout turns the entries of its files into parts (:mod:`stereolag.io.calibration_parts`). Files in no layout of their
own are read by what their names mean.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolag.io.calibration_files import Entries, Entry, Matrix
from stereolag.io.calibration_parts import (
    COEFFICIENTS,
    FISHEYE,
    MOST,
    SIZE,
    Parts,
    between,
    by_meaning,
    camera,
    inverted,
    lens_of,
    numbers,
    pose,
    pose_in_common,
    rigid,
)

Reader: TypeAlias = Callable[[Entries], list[Parts]]
"""Returns the parts for each size of pictures that the entries of one calibration are for."""


class Layout(NamedTuple):
    """A maker's layout of calibration files.

    Attributes
    ----------
    name
        Whose it is.
    marks
        Patterns: a name that fits each of them, whatever its case, is in all files of this layout.
    read
        Its reader.
    unit
        The unit of its lengths, one of :data:`~stereolag.geometry.calibration.UNITS`.
    sure
        Whether that holds for every file; if not, for those that do not state another one.
    ignored
        A pattern of names that are known to have no effect.
    """

    name: str
    marks: tuple[str, ...]
    read: Reader
    unit: str = "m"
    sure: bool = True
    ignored: str = ""


def layout_of(entries: Entries) -> Layout:
    """Return the first layout whose marks the entries bear."""
    return next(
        layout
        for layout in LAYOUTS
        if all(any(re.fullmatch(mark, name, re.IGNORECASE) for name in entries) for mark in layout.marks)
    )


# Layouts of makers.


def named(**names: str) -> Reader:
    """Return a reader of parts that have these names; several for one part are divided by ``|``."""

    def read(entries: Entries) -> list[Parts]:
        if not entries.keys() & {name for name in names.get("product", "").split("|")}:
            for part in ("focal", "M1", "baseline"):
                if part in names:
                    entries.required(names[part])
        return [entries.found(names | SIZE | {"most": MOST})]

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
"""Sizes of pictures by the names that Stereolabs gives them."""


def _zed(entries: Entries) -> list[Parts]:
    """Read a pair of cameras for each size; the right one stands at (Baseline, TY, TZ), turned by the vector R.

    The lenses stand with each size, or once for all of them, and then those of fisheyes have no p1 and p2.
    """
    found = []
    apart = entries.find("LEFT_DISTO.k1") is not None
    wide = apart and entries.find("LEFT_DISTO.p1") is None
    for mode, size in ZED_SIZES.items():
        left, right = f"LEFT_CAM_{mode}", f"RIGHT_CAM_{mode}"
        if entries.find(f"{left}.fx") is None:
            continue
        angles = [f"STEREO.RX_{mode}", f"STEREO.CV_{mode}|STEREO.RY_{mode}", f"STEREO.RZ_{mode}"]
        vector = np.array([entries.required(name).numbers(1)[0] for name in angles])
        turn = np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)
        aside = [entries.number(f"STEREO.{axis}_{mode}|STEREO.{axis}") or 0.0 for axis in ("TY", "TZ")]
        place = np.array([entries.required("STEREO.Baseline").numbers(1)[0], *aside])
        one = camera(entries, "1", left, "LEFT_DISTO" if apart else left, coefficients=COEFFICIENTS[wide])
        one |= camera(entries, "2", right, "RIGHT_DISTO" if apart else right, coefficients=COEFFICIENTS[wide])
        one |= {"lens": Entry("LEFT_DISTO", FISHEYE)} if wide else {}
        found.append(one | pose("STEREO", turn, -turn @ place) | {"size0": numbers(mode, size)})
    return found


def _depthai(entries: Entries) -> list[Parts]:
    """Read the cameras on the left and the right socket, whose poses lead from socket to socket."""
    sockets: dict[int, str] = {}
    while (socket := entries.number(f"cameraData.{len(sockets)}.0")) is not None:
        sockets[int(socket)] = f"cameraData.{len(sockets)}.1"

    def to_last(socket: int) -> Matrix:
        """Return the transform from a camera's frame into that of the last one on its way."""
        total = np.eye(4)
        for _ in sockets:
            place = f"{sockets[socket]}.extrinsics"
            following = int(entries.required(f"{place}.toCameraSocket").numbers(1)[0])
            if following not in sockets:
                break
            step = np.eye(4)
            step[:3, :3] = entries.required(f"{place}.rotationMatrix").matrix(3, 3)
            for kind in ("specTranslation", "translation"):
                along = [entries.number(f"{place}.{kind}.{axis}") or 0.0 for axis in "xyz"]
                step[:3, 3] = along if any(along) else step[:3, 3]
            total, socket = step @ total, following
        return total

    parts: Parts = {}
    chosen = []
    for side, name, usual in (("1", "left", 1), ("2", "right", 2)):
        stated = entries.number(f"stereoRectificationData.{name}CameraSocket")
        socket = usual if stated is None or stated < 0 else int(stated)
        if socket not in sockets:
            raise ValueError(f"The calibration (DepthAI) has no camera on socket {socket}, that of the {name} one.")
        chosen.append(socket)
        place = sockets[socket]
        wide = int(entries.number(f"{place}.cameraType") or 0)
        if wide > 1:
            raise ValueError(
                f"The calibration (DepthAI) has a camera of type {wide}; read are perspective and fisheye."
            )
        lens = entries.required(f"{place}.distortionCoeff").numbers()
        parts |= {
            f"M{side}": entries.required(f"{place}.intrinsicMatrix"),
            f"D{side}": numbers(f"{place}.distortionCoeff", lens[:4] if wide else lens),
            f"width{side}": entries.required(f"{place}.width"),
            f"height{side}": entries.required(f"{place}.height"),
        }
        if wide:
            parts["lens"] = Entry(f"{place}.cameraType", FISHEYE)
    left, right = (inverted(to_last(socket)) for socket in chosen)
    return [parts | between("extrinsics", left, right)]


def _realsense(entries: Entries) -> list[Parts]:
    """Read a rectified pair for each size; the baseline is negative: the left camera's place seen from the right."""
    baseline = numbers("baseline", np.abs(entries.required("baseline").numbers(1)))
    names = {"cx": "ppx", "cy": "ppy", "width0": "width", "height0": "height"}
    found, number = [], 0
    while (focal := entries.find(f"rectified.{number}.fx")) is not None:
        one = {part: entries.required(f"rectified.{number}.{name}") for part, name in names.items()}
        if focal.numbers(1)[0] > 0 and one["width0"].numbers(1)[0] > 0:
            found.append(one | {"focal": focal, "baseline": baseline})
        number += 1
    return found


def _ros_ini(entries: Entries) -> list[Parts]:
    """Read cameras below headings with their names, as in the YAML of ROS."""
    cameras = []
    for one in entries.files:
        for name in filter(re.compile(r".*\.camera matrix", re.IGNORECASE).fullmatch, one):
            title = name.rpartition(".")[0]
            own = {"camera_name": Entry("camera_name", title)}
            for part in ("camera matrix", "distortion", "rectification", "projection", "image.width", "image.height"):
                entry = one.find(part if part.startswith("image") else f"{title}.{part}")
                if entry is not None:
                    own[part.replace(" ", "_").replace(".", "_")] = entry
            cameras.append(Entries(own))
    return by_meaning(Entries(*cameras))


def _matlab(entries: Entries) -> list[Parts]:
    """Read ``toStruct(stereoParams)``: pixels count from 1, sizes are rows and columns, older matrices transposed."""
    first = next(name for name in entries if "CameraParameters1." in name)
    before = first[: first.index("CameraParameters1.")]
    parts: Parts = {}
    for side in "12":
        place = f"{before}CameraParameters{side}"
        newer = entries.find(f"{place}.K")
        matrix = newer.matrix(3, 3) if newer else entries.required(f"{place}.IntrinsicMatrix").matrix(3, 3).T
        radial = entries.required(f"{place}.RadialDistortion").numbers()
        tangential = entries.required(f"{place}.TangentialDistortion").numbers(2)
        parts[f"M{side}"] = numbers(f"{place}.K", matrix - [[0, 0, 1], [0, 0, 1], [0, 0, 0]])
        parts[f"D{side}"] = numbers(f"{place}.RadialDistortion", [*radial[:2], *tangential, *radial[2:]])
        if size := entries.find(f"{place}.ImageSize"):
            parts[f"size{side}"] = numbers(size.name, size.numbers(2)[::-1])
    if unit := entries.find(f"{before}CameraParameters1.WorldUnits|{before}WorldUnits"):
        parts["unit"] = unit
    if turn := entries.find(f"{before}RotationOfCamera2"):
        place_of = entries.required(f"{before}TranslationOfCamera2")
        return [parts | pose(turn.name, turn.matrix(3, 3).T, place_of.numbers(3))]
    whole = entries.required(f"{before}PoseCamera2.A|{before}PoseCamera2.R")
    if whole.numbers().size == 16:
        return [parts | pose(whole.name, whole.matrix(4, 4)[:3, :3], whole.matrix(4, 4)[:3, 3])]
    place_of = entries.required(f"{before}PoseCamera2.Translation")
    return [parts | pose(whole.name, whole.matrix(3, 3), place_of.numbers(3))]


def _matlab_for_opencv(entries: Entries) -> list[Parts]:
    """Read the results of ``stereoParametersToOpenCV`` under their own names; the size is rows and columns."""
    parts = {"R": entries.required("rotationOfCamera2"), "T": entries.required("translationOfCamera2")}
    for side in "12":
        parts[f"M{side}"] = entries.required(f"intrinsicMatrix{side}")
        parts[f"D{side}"] = entries.required(f"distortionCoefficients{side}")
    if size := entries.find("imageSize"):
        parts["size0"] = numbers(size.name, size.numbers(2)[::-1])
    return [parts]


def _bouguet(entries: Entries) -> list[Parts]:
    """Read ``Calib_Results_stereo`` of the toolbox for MATLAB: focal lengths fc, centre cc, lens kc; om turns."""
    parts = {"R": entries.required("om|R"), "T": entries.required("T")}
    for side, name in (("1", "left"), ("2", "right")):
        (fx, fy), (cx, cy) = (entries.required(f"{part}_{name}").numbers(2) for part in ("fc", "cc"))
        skew = fx * (entries.number(f"alpha_c_{name}") or 0.0)
        parts[f"M{side}"] = numbers(f"fc_{name}", [[fx, skew, cx], [0, fy, cy], [0, 0, 1]])
        parts[f"D{side}"] = entries.required(f"kc_{name}")
    return [parts | entries.found({"width0": "nx", "height0": "ny"})]


def _drivingstereo(entries: Entries) -> list[Parts]:
    """Read the rectified pair; at half size the projections still hold the baseline of the full one, T the true one."""
    left, right = (entries.required(f"P_rect_{number}").projection() for number in (101, 103))
    return [
        {
            "M1": numbers("P_rect_101", left[:, :3]),
            "M2": numbers("P_rect_103", right[:, :3]),
            "baseline": numbers("T_103", np.linalg.norm(entries.required("T_103").numbers(3)).reshape(1)),
            "size0": entries.required("S_rect_101"),
        }
    ]


_ACROSS = np.array([[1.0, 1, 1, 1], [1, 1, 1, 0], [1, 1, 1, 0]])


def kitti(left: int, right: int) -> Reader:
    """Return a reader of two cameras of KITTI: rectified, and where the file has both, as taken."""

    def read(entries: Entries) -> list[Parts]:
        straight, raw = {}, {}
        for side, number in (("1", left), ("2", right)):
            names = ("P_rect", "P", "S_rect", "K", "D", "R_rect", "S")
            of = {name: entries.match(rf"{name}_?0*{number}") for name in names}
            projection = of["P_rect"] or of["P"]
            if projection is not None:
                straight[f"P{side}"] = projection
                # What it says of heights and depths is less than a centimetre, and more than rows may differ here.
                raw[f"P{side}"] = numbers(projection.name, projection.projection() * _ACROSS)
            straight |= {"size0": size} if (size := of["S_rect"]) else {}
            found = {f"M{side}": of["K"], f"D{side}": of["D"], f"R{side}": of["R_rect"], "size0": of["S"]}
            raw |= {part: entry for part, entry in found.items() if entry is not None}
        return [straight, raw] if {"M1", "R1", "M2", "R2", "size0"} <= set(raw) else [straight]

    return read


def _rows(entries: Entries) -> list[Parts]:
    """Read rows of numbers alone: two projections, or a camera matrix and a baseline (the learned matchers' K.txt)."""
    entries.used.update(entries)
    values = np.concatenate([entry.numbers() for entry in entries.values()])
    if values.size == 10:
        return [{"M1": numbers("the first row", values[:9].reshape(3, 3)), "baseline": numbers("the last", values[9:])}]
    if values.size >= 24 and entries["row0"].numbers().size in (4, 12):
        halves = values[:24].reshape(2, 3, 4)
        return [{f"P{side}": numbers(f"row{side}", one) for side, one in enumerate(halves, 1)}]
    raise ValueError(
        f"The calibration is {values.size} numbers without names; accepted are a camera matrix and the baseline (9 and "
        "1), or two projections (12 each)."
    )


def _orb_slam(entries: Entries) -> list[Parts]:
    """Read cameras as taken with their rectification (ORB-SLAM2) or pose (3), else a rectified pair."""
    if entries.find("LEFT.K"):
        own = Entries({name: entry for name, entry in entries.items() if name.startswith(("LEFT", "RIGHT"))})
        return by_meaning(Entries(own))
    size = entries.found(SIZE)
    first = "Camera1" if entries.find("Camera1.fx") else "Camera"
    way = entries.find("Stereo.T_c1_c2|Tlr")
    if entries.find("Camera2.fx") and way is not None:
        wide = lens_of(entries) == FISHEYE
        cameras = camera(entries, "1", first, first, coefficients=COEFFICIENTS[wide])
        cameras |= camera(entries, "2", "Camera2", "Camera2", coefficients=COEFFICIENTS[wide])
        back = way.numbers().reshape(-1, 4) if way.numbers().size in (12, 16) else way.matrix(4, 4)
        return [cameras | size | between(way.name, np.eye(4), inverted(back))]
    bent = [name for lens in ("k1", "k2", "k3", "p1", "p2") if entries.number(name := f"{first}.{lens}")]
    if bent:
        raise ValueError(
            f"The calibration (ORB-SLAM) has a lens with distortion ({', '.join(bent)}), but neither Camera2 with "
            "Stereo.T_c1_c2 nor LEFT.K with the rectification: its pictures cannot be rectified."
        )
    parts = camera(entries, "1", first, "no lens")
    parts |= {"baseline": entries.required("Stereo.b")} if entries.find("Stereo.b") else {}
    return [parts | size | ({} if "baseline" in parts else {"product": entries.required("Camera.bf")})]


def _vins(entries: Entries) -> list[Parts]:
    """Read the two cameras of VINS-Fusion, each in its file, and the file with their poses."""
    cameras = [one for one in entries.files if one.match(r"projection_parameters\.(fx|mu)")]
    wide = lens_of(entries) == FISHEYE
    if len(cameras) != 2:
        raise ValueError(
            f"The calibration (VINS) is of {len(cameras)} camera{'s' * (len(cameras) != 1)}; give the files of both "
            "together with the one that has body_T_cam0 and body_T_cam1."
        )
    parts: Parts = {}
    for side, one in zip("12", cameras, strict=True):
        if wide:
            centre, lens = ("mu", "mv", "u0", "v0"), ("k2", "k3", "k4", "k5")
            parts |= camera(one, side, "projection_parameters", "projection_parameters", centre, lens)
        else:
            parts |= camera(one, side, "projection_parameters", "distortion_parameters")
        parts |= {f"{part[:-1]}{side}": one.required(name) for part, name in SIZE.items()}
    found = pose_in_common(entries)
    if found is None:
        raise ValueError("The calibration (VINS) lacks body_T_cam0 and body_T_cam1; give the file that has them too.")
    return [parts | found]


def _okvis(entries: Entries) -> list[Parts]:
    """Read the first two cameras of a list, whose poses T_SC or T_BS lead out of the cameras' frames."""
    parts: Parts = {}
    for side, place in (("1", "cameras.0"), ("2", "cameras.1")):
        (fx, fy), (cx, cy) = (
            entries.required(f"{place}.{name}").numbers(2) for name in ("focal_length", "principal_point")
        )
        parts[f"M{side}"] = numbers(f"{place}.focal_length", [fx, fy, cx, cy])
        parts |= entries.found(
            {f"D{side}": f"{place}.distortion_coefficients", f"size{side}": f"{place}.image_dimension"}
        )
    poses = [entries.required(f"cameras.{number}.T_SC|cameras.{number}.T_BS").matrix(4, 4) for number in (0, 1)]
    return [parts | between("T_SC", *map(inverted, poses))]


def _basalt(entries: Entries) -> list[Parts]:
    """Read the first two cameras, whose poses as quaternions lead out of the cameras' frames."""
    parts: Parts = {}
    poses = []
    before = "value0." if entries.find("value0.T_imu_cam.0.px") else ""
    wide = lens_of(entries) == FISHEYE
    for side, number in (("1", 0), ("2", 1)):
        place = f"{before}intrinsics.{number}.intrinsics"
        parts |= camera(entries, side, place, place, coefficients=COEFFICIENTS[wide])
        x, y, z, *turn = (
            entries.required(f"{before}T_imu_cam.{number}.{name}").numbers(1)[0]
            for name in ("px", "py", "pz", "qw", "qx", "qy", "qz")
        )
        poses.append(rigid(turn, (x, y, z)))
    if size := entries.find(f"{before}resolution"):
        parts["size0"] = numbers(size.name, size.numbers()[:2])
    return [parts | between("T_imu_cam", *map(inverted, poses))]


def _mrpt(entries: Entries) -> list[Parts]:
    """Read both cameras; the pose is that of the right one in the left one's frame: x, y, z and a quaternion."""
    parts: Parts = {}
    for side, name in (("1", "LEFT"), ("2", "RIGHT")):
        place = f"CAMERA_PARAMS_{name}"
        parts |= camera(entries, side, place, "no lens")
        parts |= entries.found({f"D{side}": f"{place}.dist", f"size{side}": f"{place}.resolution"})
    way = entries.required("CAMERA_PARAMS_LEFT2RIGHT_POSE.pose_quaternion")
    place_of, turn = np.split(way.numbers(7), [3])
    return [parts | between(way.name, np.eye(4), inverted(rigid(turn, place_of)))]


def _mc_calib(entries: Entries) -> list[Parts]:
    """Read two cameras with the pose of each, which leads out of its frame; lengths are in the unit of the board."""
    (parts,) = by_meaning(entries)
    poses = [entries.required(f"camera_{number}.camera_pose_matrix").matrix(4, 4) for number in (0, 1)]
    return [parts | between("camera_pose_matrix", *map(inverted, poses))]


def _dsec(entries: Entries) -> list[Parts]:
    """Read the rectified pairs of the frame cameras, 1 and 2, and of the event cameras, 0 and 3."""
    return [
        entries.found({"Q": f"disparity_to_depth.cams_{pair}", "size0": f"intrinsics.camRect{pair[0]}.resolution"})
        for pair in ("12", "03")
    ]


def _cityscapes(entries: Entries) -> list[Parts]:
    """Read the rectified pair; the data set's pictures, whose size is not stated, have 2048 × 1024 pixels."""
    (parts,) = named(focal="intrinsic.fx", baseline="extrinsic.baseline", cx="intrinsic.u0", cy="intrinsic.v0")(entries)
    centre = [parts[name].numbers(1)[0] for name in ("cx", "cy") if name in parts]
    if len(centre) == 2 and np.abs(np.array(centre) / (1024, 512) - 1).max() < 0.1:
        parts["size0"] = numbers("size", (2048, 1024))
    return [parts]


FOCAL = "focal_px|fx|focal_length_px"
LAYOUTS = (
    Layout("ZED", (r"LEFT_CAM_\w+\.fx", r"STEREO\.Baseline"), _zed, "mm", ignored=r"MISC\..*|STEREO\..*"),
    Layout("DepthAI", (r"cameraData\.0\.0",), _depthai, "cm", ignored=".*"),
    Layout("RealSense", (r"rectified\.0\.fx", "baseline"), _realsense, "mm", ignored=".*"),
    Layout("ROS", (r".*\.camera matrix",), _ros_ini),
    Layout("MATLAB", (r"(.*\.)?CameraParameters1\..*",), _matlab, "mm", sure=False, ignored=".*"),
    Layout("MATLAB", ("intrinsicMatrix1", "rotationOfCamera2"), _matlab_for_opencv, "mm", sure=False),
    Layout("MATLAB", ("fc_left", "fc_right"), _bouguet, "mm", sure=False, ignored=".*"),
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
    Layout("MC-Calib", (r"camera_1\.camera_pose_matrix",), _mc_calib, sure=False, ignored=".*"),
    Layout("DSEC", (r"disparity_to_depth\.cams_12",), _dsec, ignored=".*"),
    *(
        Layout(
            "JSON",
            (FOCAL, *marks),
            named(
                focal=FOCAL,
                baseline=baseline,
                doffs="doffs_px|doffs",
                cx="cx|cx0",
                cx2="cx1",
                cy="cy|cy0|cy1",
                turn="turn",
            ),
            unit,
            ignored="fy|left_image_rect_normalized",
        )
        for marks, baseline, unit in (
            (("baseline_mm",), "baseline_mm", "mm"),
            (("baseline_cm",), "baseline_cm", "cm"),
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
    Layout("rows", ("row0",), _rows, sure=False),
    Layout("OpenCV", (), by_meaning, sure=False, ignored=r"(header|roi|stamp)\..*|binning_[xy]"),
)
"""The layouts, tried in this order. What is in none of the others is read by the meaning of its names."""
