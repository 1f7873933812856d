"""One stereo camera in every calibration format in common use."""

from __future__ import annotations

import io
import json
from collections.abc import Callable

import cv2
import numpy as np
import scipy
import yaml

from stereolag.io.arrays import npy

SIZE = (640, 480)
M1 = np.array([[532.8, 0, 342.5], [0, 532.9, 234.1], [0, 0, 1]])
M2 = np.array([[537.4, 0, 327.1], [0, 537.0, 250.0], [0, 0, 1]])
D1 = np.array([[-0.28, 0.07, 0.001, 0.0002, 0]])
D2 = np.array([[-0.29, 0.1, -0.0005, 0.0001, 0]])
R = cv2.Rodrigues(np.array([0.01, 0.02, -0.005]))[0]
T = np.array([[-0.0834], [0.001], [0.0002]])
R1, R2, P1, P2, Q, *_ = cv2.stereoRectify(M1, D1, M2, D2, SIZE, R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0)

Values = dict[str, object]


def opencv(ending: str, **entries: object) -> bytes:
    storage = cv2.FileStorage(ending, cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for name, value in entries.items():
        storage.write(name, value)
    return storage.releaseAndGetString().encode()


def npz(packed: bool = False, **entries: object) -> bytes:
    file = io.BytesIO()
    (np.savez_compressed if packed else np.savez)(file, **entries)
    return file.getvalue()


def plain(values: object) -> object:
    """Return the values with arrays as lists, for JSON and YAML."""
    if isinstance(values, dict):
        return {name: plain(value) for name, value in values.items()}
    return values.tolist() if isinstance(values, np.ndarray) else values


def as_json(**entries: object) -> bytes:
    return json.dumps(plain(entries)).encode()


def as_yaml(flow: bool | None = None, **entries: object) -> bytes:
    return yaml.safe_dump(plain(entries), default_flow_style=flow).encode()


def ros(side: str, projection=None, matrix=None, distortion=None, rotation=None, model="plumb_bob") -> bytes:
    """Return a ROS ``camera_info`` file, by default of this camera."""
    first = side == "left"

    def entry(name: str, given, default: np.ndarray) -> str:
        values = default if given is None else given
        numbers = ", ".join(f"{value:.12g}" for value in values.ravel())
        return f"{name}:\n  rows: {values.shape[0]}\n  cols: {values.shape[1]}\n  data: [{numbers}]\n"

    return (
        f"image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo/{side}\n"
        f"{entry('camera_matrix', matrix, M1 if first else M2)}distortion_model: {model}\n"
        f"{entry('distortion_coefficients', distortion, D1 if first else D2)}"
        f"{entry('rectification_matrix', rotation, R1 if first else R2)}"
        f"{entry('projection_matrix', projection, P1 if first else P2)}"
    ).encode()


def ros_message(side: str) -> bytes:
    """Return the same file as printed by ``rostopic echo``."""
    first = side == "left"
    parts = (M1, D1, R1, P1) if first else (M2, D2, R2, P2)
    numbers = "".join(f"{name}: {part.ravel().tolist()}\n" for name, part in zip("KDRP", parts, strict=True))
    header = 'header: \n  seq: 7\n  frame_id: "cam"\nheight: 480\nwidth: 640\ndistortion_model: "plumb_bob"\n'
    return f"{header}{numbers}binning_x: 0\nroi: \n  do_rectify: False\n---\n".encode()


def kalibr(model: str = "radtan", lenses: tuple[np.ndarray, np.ndarray] = (D1, D2), **second: object) -> bytes:
    def camera(matrix: np.ndarray, distortion: np.ndarray) -> Values:
        return {
            "cam_overlaps": [1],
            "camera_model": "pinhole",
            "distortion_coeffs": distortion.ravel()[:4],
            "distortion_model": model,
            "intrinsics": np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]),
            "resolution": [*SIZE],
            "rostopic": "/cam/image_raw",
        }

    pose = np.vstack([np.hstack([R, T]), [0, 0, 0, 1]])
    return as_yaml(cam0=camera(M1, lenses[0]), cam1=camera(M2, lenses[1]) | {"T_cn_cnm1": pose} | second)


def named(m1: str, d1: str, m2: str, d2: str, r: str = "R", t: str = "T", size: str = "image_size") -> Values:
    return {m1: M1, d1: D1, m2: M2, d2: D2, r: R, t: T, size: np.array(SIZE)}


BOTH_CAMERAS: Values = named("M1", "D1", "M2", "D2")
NAMES = [
    named("K1", "D1", "K2", "D2"),
    named("mtxL", "distL", "mtxR", "distR", "R", "T", "imageSize"),
    named("mtx_l", "dist_l", "mtx_r", "dist_r", "rot", "trans"),
    named("mtx0", "dist0", "mtx1", "dist1"),
    named("KL", "DL", "KR", "DR"),
    named("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2"),
    named("leftCameraMatrix", "leftDistCoeffs", "rightCameraMatrix", "rightDistCoeffs"),
    named("left_camera_matrix", "left_distortion", "right_camera_matrix", "right_distortion", "rotation", "trans"),
    named("camera_matrix_left", "dist_coeffs_left", "camera_matrix_right", "dist_coeffs_right"),
    named("K_left", "D_left", "K_right", "D_right", "rotation_matrix", "translation_vector", "img_size"),
    named("LeftCameraMatrix", "LeftDistortionCoefficients", "RightCameraMatrix", "RightDistortionCoefficients"),
    named("intrinsics1", "distortion1", "intrinsics2", "distortion2", "rvec", "tvec"),
]  # fmt: skip

RAW: dict[str, Callable[[], list[bytes]]] = {
    "OpenCV YAML": lambda: [opencv(".yml", **named("M1", "D1", "M2", "D2"))],
    "OpenCV XML": lambda: [opencv(".xml", **named("M1", "D1", "M2", "D2"))],
    "OpenCV JSON": lambda: [opencv(".json", **named("M1", "D1", "M2", "D2"))],
    "OpenCV in two files": lambda: [
        opencv(".yml", M1=M1, D1=D1, M2=M2, D2=D2),
        opencv(".xml", R=R, T=T, image_width=SIZE[0], image_height=SIZE[1]),
    ],
    "a file of each camera, and one of the pose": lambda: [
        npz(mtx=M1, dist=D1),
        npz(mtx=M2, dist=D2),
        npz(R=R, T=T, E=np.eye(3), image_size=np.array(SIZE)),
    ],
    "NPZ": lambda: [npz(**BOTH_CAMERAS, rms=0.3, map_x=np.zeros((480, 640), np.float32), notes=np.array(["a"]))],
    "NPZ, packed": lambda: [npz(True, **BOTH_CAMERAS)],
    "JSON": lambda: [as_json(**BOTH_CAMERAS, date="today", units=None, good=True)],
    "JSON, nested": lambda: [
        as_json(
            left={"camera_matrix": M1, "distortion": D1, "image_width": 640, "image_height": 480},
            right={"camera_matrix": M2, "distortion": D2},
            R=R,
            T=T,
            images=["a.png", "b.png"],
        )
    ],
    "YAML, its lists in lines": lambda: [as_yaml(False, **BOTH_CAMERAS)],
    "YAML, its lists in brackets": lambda: [as_yaml(True, **BOTH_CAMERAS)],
    "YAML in UTF-16": lambda: [as_yaml(True, **BOTH_CAMERAS).decode().encode("utf-16")],
    "YAML in Latin-1": lambda: ["# Kamera für Übungen\n".encode("latin-1") + as_yaml(True, **BOTH_CAMERAS)],
    "Kalibr": lambda: [kalibr()],
    **{f"NPZ, {next(iter(names))}": lambda names=names: [npz(**names)] for names in NAMES},
    "a rotation vector": lambda: [npz(**(BOTH_CAMERAS | {"R": cv2.Rodrigues(R)[0]}))],
}
"""Both cameras before rectification, without rectifying transforms."""

RECTIFICATION: Values = {"R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": Q}
RECTIFYING: dict[str, Callable[[], list[bytes]]] = {
    "OpenCV YAML": lambda: [opencv(".yml", **BOTH_CAMERAS, **RECTIFICATION)],
    "OpenCV XML in two files": lambda: [
        opencv(".xml", M1=M1, D1=D1, M2=M2, D2=D2),
        opencv(".xml", R=R, T=T, **RECTIFICATION),
    ],
    "NPZ": lambda: [npz(**BOTH_CAMERAS, **RECTIFICATION)],
    "NPZ with Q alone": lambda: [npz(**BOTH_CAMERAS, R1=R1, R2=R2, Q=Q)],
    "NPZ without a pose": lambda: [npz(M1=M1, D1=D1, M2=M2, D2=D2, **RECTIFICATION)],
    "NPZ with other names": lambda: [npz(**BOTH_CAMERAS, rectL=R1, rectR=R2, projMatrixL=P1, projMatrixR=P2)],
    "ROS": lambda: [ros("left"), ros("right")],
    "ROS, right before left": lambda: [ros("right"), ros("left")],
    "ROS, printed": lambda: [ros_message("left"), ros_message("right")],
    "ROS, right before left, printed": lambda: [ros_message("right"), ros_message("left")],
}
"""Both cameras, with the rectification of the software that made the file."""

SINGLE_NUMBERS = {"fx": P1[0, 0], "fy": P1[0, 0], "cx": P1[0, 2], "cy": P1[1, 2], "baseline": -P2[0, 3] / P2[0, 0]}
RECTIFIED: dict[str, Callable[[], list[bytes]]] = {
    "Q in YAML": lambda: [opencv(".yml", Q=Q, image_size=np.array(SIZE))],
    "Q in XML": lambda: [opencv(".xml", Q=Q, image_width=640, image_height=480)],
    "Q in NPZ": lambda: [npz(Q=Q)],
    "Q in NPY": lambda: [npy(Q)],
    "Q in rows": lambda: ["\n".join(" ".join(map(str, row)) for row in Q).encode()],
    "P1 and P2": lambda: [opencv(".json", P1=P1, P2=P2)],
    "ROS, right camera": lambda: [ros("right")],
    "KITTI": lambda: [
        "".join(f"P{2 + n}: {' '.join(map(str, p.ravel()))}\n" for n, p in enumerate((P1, P2))).encode() + b"R0 1 0 0\n"
    ],
    "bare rows": lambda: ["\n".join(" ".join(map(str, p.ravel())) for p in (P1, P2)).encode()],
    "Middlebury": lambda: [
        f"cam0=[{P1[0, 0]} 0 {P1[0, 2]}; 0 {P1[0, 0]} {P1[1, 2]}; 0 0 1]\ncam1=[1 0 0; 0 1 0; 0 0 1]\ndoffs=0\n"
        f"baseline={-P2[0, 3] / P2[0, 0] * 1000}\nwidth=640\nheight=480\nndisp=64\n".encode()
    ],
    "a name and a number a line": lambda: [
        "\n".join(f"{name} {value}" for name, value in SINGLE_NUMBERS.items()).encode()
    ],
    "single numbers, nested": lambda: [
        as_json(intrinsics=SINGLE_NUMBERS, baseline=SINGLE_NUMBERS["baseline"], width=640, height=480)
    ],
    "a matrix and a baseline": lambda: [opencv(".yml", mtx=P1[:, :3], baselineLR=SINGLE_NUMBERS["baseline"])],
    "stereodemo": lambda: [
        as_json(
            comment="a camera", width=640, height=480, fx=P1[0, 0], fy=P1[0, 0], cx0=P1[0, 2], cx1=P2[0, 2],
            cy=P1[1, 2], baseline_meters=-P2[0, 3] / P2[0, 0], depth_range=[1.0, 100.0],
        )
    ],
    "JSON of this project": lambda: [
        as_json(focal_px=P1[0, 0], baseline_m=-P2[0, 3] / P2[0, 0], cx=P1[0, 2], cy=P1[1, 2], width=640, height=480)
    ],
}  # fmt: skip
"""Only the rectified pair."""


# The layouts of makers, each written by hand, for the same rig, whose rectified pair has P1 and P2.

BASELINE = float(np.linalg.norm(T))
FOCAL = float(P1[0, 0])
POSE = np.vstack([np.hstack([R, T]), [0, 0, 0, 1]])
BODY = np.array([[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, -0.3], [0, 0, 0, 1]])
"""Pose of the left camera in the frame of a body."""

BODIES = (BODY, BODY @ np.linalg.inv(POSE))
"""Poses of both cameras in that frame."""


def quaternion(pose: np.ndarray) -> list[float]:
    """Return w, x, y, z of a transform."""
    x, y, z, w = scipy.spatial.transform.Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return [w, x, y, z]


def rows(matrix: np.ndarray, between: str = "\n") -> str:
    return between.join(" ".join(f"{value:.12g}" for value in row) for row in np.atleast_2d(matrix))


def zed(separate_lenses: tuple[np.ndarray, np.ndarray] | None = None) -> bytes:
    """Return a file of Stereolabs; with separate lenses, in sections of their own as for a ZED One."""

    def camera(side: str, mode: str, matrix: np.ndarray, lens: np.ndarray, factor: float) -> str:
        fx, fy, cx, cy = (factor * matrix[place] for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
        own_lens = "" if separate_lenses else coefficients(lens)
        return f"[{side}_CAM_{mode}]\nfx={fx}\nfy={fy}\ncx={cx}\ncy={cy}\n{own_lens}\n"

    def coefficients(lens: np.ndarray) -> str:
        names = ("k1", "k2", "p1", "p2", "k3") if lens.size == 5 else ("k1", "k2", "k3", "k4")
        return "".join(f"{name}={value}\n" for name, value in zip(names, lens.ravel(), strict=True))

    modes = {"FHD": 3.0, "HD": 2.0, "VGA": 1.05}
    cameras = "".join(
        camera("LEFT", mode, M1, D1, factor) + camera("RIGHT", mode, M2, D2, factor) for mode, factor in modes.items()
    )
    x, y, z = cv2.Rodrigues(R)[0].ravel()
    turns = "".join(f"CV_{mode}={y}\nRX_{mode}={x}\nRZ_{mode}={z}\n" for mode in modes)
    place = 1000 * np.linalg.inv(POSE)[:3, 3]
    lenses = zip(("LEFT", "RIGHT"), separate_lenses or (), strict=False)
    cameras += "".join(f"[{side}_DISTO]\n{coefficients(lens)}\n" for side, lens in lenses)
    return (
        f"{cameras}[STEREO]\nBaseline={place[0]}\nTY={place[1]}\nTZ={place[2]}\n{turns}[MISC]\nSensor_ID=1\n".encode()
    )


def depthai(wide: bool = False) -> bytes:
    def camera(matrix: np.ndarray, lens: np.ndarray, turn: np.ndarray, place: np.ndarray, to: int) -> Values:
        xyz = dict(zip("xyz", (100 * place.ravel()).tolist(), strict=True))
        return {
            "cameraType": int(wide),
            "distortionCoeff": np.pad(lens.ravel(), (0, 14 - lens.size)),
            "extrinsics": {
                "rotationMatrix": turn, "specTranslation": {"x": -8.0, "y": 0.0, "z": 0.0}, "toCameraSocket": to,
                "translation": xyz,
            },
            "height": SIZE[1], "width": SIZE[0], "intrinsicMatrix": matrix, "lensPosition": 0, "specHfovDeg": 72.0,
        }  # fmt: skip

    nowhere = np.zeros(3)
    # Both poses are relative to the colour camera in the middle, the last camera.
    back = np.linalg.inv(POSE)
    middle = np.eye(4)
    middle[0, 3] = -0.04
    right = middle @ back
    cameras = [
        [0, camera(M1, D1, np.zeros((3, 3)), nowhere, -1)],
        [1, camera(M1, FISHEYE if wide else D1, middle[:3, :3], middle[:3, 3], 0)],
        [2, camera(M2, FISHEYE if wide else D2, right[:3, :3], right[:3, 3], 0)],
    ]
    sockets = {"leftCameraSocket": 1, "rightCameraSocket": 2, "rectifiedRotationLeft": R1, "rectifiedRotationRight": R2}
    plain_cameras = [[socket, plain(one)] for socket, one in cameras]
    document = {"boardName": "", "cameraData": plain_cameras, "stereoRectificationData": plain(sockets), "version": 7}
    return json.dumps(document).encode()


def realsense() -> bytes:
    entries: Values = {"baseline": str(-1000 * BASELINE), "intrinsic_left.x.x": "0.5"}
    for number, (width, height, factor) in enumerate(
        ((1920, 1080, 3.0), (640, 480, 1.0), (0, 0, 0.0), (320, 240, 0.5))
    ):
        values = (factor * FOCAL, factor * FOCAL, factor * P1[0, 2], factor * P1[1, 2], width, height)
        names = ("fx", "fy", "ppx", "ppy", "width", "height")
        entries |= {f"rectified.{number}.{name}": str(value) for name, value in zip(names, values, strict=True)}
    return json.dumps(entries).encode()


def ost(side: str) -> str:
    first = side == "left"
    parts = (M1, D1, R1, P1) if first else (M2, D2, R2, P2)
    names = ("camera matrix", "distortion", "rectification", "projection")
    values = "\n\n".join(f"{name}\n{rows(part)}" for name, part in zip(names, parts, strict=True))
    size = "[image]\n\nwidth\n640\n\nheight\n480"
    return f"# oST version 5.0 parameters\n\n\n{size}\n\n[narrow_stereo/{side}]\n\n{values}\n"


def matlab(newer: bool = False, unit: str = "millimeters") -> Values:
    shift = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])  # pixels are counted from 1

    def camera(matrix: np.ndarray, lens: np.ndarray) -> Values:
        k1, k2, p1, p2, _ = lens.ravel()
        one: Values = {"RadialDistortion": np.array([k1, k2]), "TangentialDistortion": np.array([p1, p2])}
        one |= {"ImageSize": np.array(SIZE[::-1]), "WorldUnits": unit, "Version": {"Name": "MATLAB"}}
        return one | ({"K": matrix + shift} if newer else {"IntrinsicMatrix": (matrix + shift).T})

    factor = {"millimeters": 1000, "m": 1}[unit]
    both: Values = {"CameraParameters1": camera(M1, D1), "CameraParameters2": camera(M2, D2)}
    if newer:
        return both | {"PoseCamera2": {"Dimensionality": 3, "Translation": factor * T.ravel(), "R": R}}
    return both | {"RotationOfCamera2": R.T, "TranslationOfCamera2": factor * T.ravel(), "RectificationParams": []}


def mat(**entries: object) -> bytes:
    file = io.BytesIO()
    scipy.io.savemat(file, entries)
    return file.getvalue()


def bouguet() -> bytes:
    cameras = {}
    for side, matrix, lens in (("left", M1, D1), ("right", M2, D2)):
        cameras |= {f"fc_{side}": matrix[[0, 1], [0, 1]], f"cc_{side}": matrix[:2, 2], f"kc_{side}": lens.T}
        cameras |= {f"alpha_c_{side}": 0.0}
    return mat(**cameras, om=cv2.Rodrigues(R)[0], R=R, T=1000 * T, nx=SIZE[0], ny=SIZE[1])


def kitti(**more: np.ndarray) -> bytes:
    entries = {"S_rect_02": np.array(SIZE), "P_rect_02": P1, "P_rect_03": P2} | more
    lines = "".join(f"{name}: {rows(value, ' ')}\n" for name, value in entries.items())
    return f"calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.95e-02\n{lines}".encode()


def drivingstereo() -> bytes:
    full = P2 * [[1, 1, 1, 2]]  # in images of half size, focal length × baseline is that of the full size
    entries = {"S_101": np.array([1280, 960]), "K_101": M1, "D_101": D1, "R_101": np.eye(3), "T_101": np.zeros(3)}
    entries |= {"S_rect_101": np.array(SIZE), "P_rect_101": P1, "R_rect_101": R1, "K_103": M2, "D_103": D2, "R_103": R}
    entries |= {"T_103": T.ravel(), "S_rect_103": np.array(SIZE), "P_rect_103": full, "R_rect_103": R2}
    return "".join(f"{name}: {rows(value, ' ')}\n" for name, value in entries.items()).encode()


def orb_slam(model: str = "PinHole") -> bytes:
    def camera(name: str, matrix: np.ndarray, lens: np.ndarray) -> str:
        fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
        names = ("k1", "k2", "k3", "k4") if model == "KannalaBrandt8" else ("k1", "k2", "p1", "p2")
        values = zip(("fx", "fy", "cx", "cy", *names), (fx, fy, cx, cy, *lens.ravel()[:4]), strict=True)
        return "".join(f"{name}.{key}: {value}\n" for key, value in values)

    lenses = (FISHEYE, FISHEYE) if model == "KannalaBrandt8" else (D1, D2)
    back = ", ".join(f"{value:.12g}" for value in np.linalg.inv(POSE).ravel())
    return (
        f'%YAML:1.0\n\nFile.version: "1.0"\nCamera.type: "{model}"\n{camera("Camera1", M1, lenses[0])}'
        f"{camera('Camera2', M2, lenses[1])}Camera.width: 640\nCamera.height: 480\nCamera.fps: 20\n"
        f"Stereo.ThDepth: 60.0\nStereo.T_c1_c2: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [{back}]\n"
        "ORBextractor.nFeatures: 1200\n"
    ).encode()


def orb_slam_2() -> bytes:
    def matrix(name: str, values: np.ndarray) -> str:
        numbers = ", ".join(f"{value:.12g}" for value in values.ravel())
        size = f"rows: {values.shape[0]}\n   cols: {values.shape[1]}"
        return f"{name}: !!opencv-matrix\n   {size}\n   dt: d\n   data: [{numbers}]\n"

    sides = {"LEFT": (D1, M1, R1, P1), "RIGHT": (D2, M2, R2, P2)}
    return (
        f"%YAML:1.0\nCamera.fx: {FOCAL}\nCamera.fy: {FOCAL}\nCamera.cx: {P1[0, 2]}\nCamera.cy: {P1[1, 2]}\n"
        f"Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.width: 640\nCamera.height: 480\nCamera.bf: {-P2[0, 3]}\nThDepth: 35\n"
        + "".join(
            f"{side}.height: 480\n{side}.width: 640\n"
            + "".join(matrix(f"{side}.{name}", part) for name, part in zip("DKRP", parts, strict=True))
            for side, parts in sides.items()
        )
    ).encode()


def vins(wide: bool = False) -> list[bytes]:
    def camera(matrix: np.ndarray, lens: np.ndarray) -> bytes:
        centre = matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
        head = "%YAML:1.0\n---\nmodel_type: {}\ncamera_name: camera\nimage_width: 640\nimage_height: 480\n"
        if wide:
            names = (*(f"k{n}" for n in range(2, 6)), "mu", "mv", "u0", "v0")
            pairs = zip(names, (*lens.ravel(), *centre), strict=True)
            return (head.format("KANNALA_BRANDT") + "projection_parameters:\n" + _below(pairs)).encode()
        lens_pairs, pairs = zip(("k1", "k2", "p1", "p2"), lens.ravel()[:4]), zip(("fx", "fy", "cx", "cy"), centre)  # noqa: B905
        below = f"distortion_parameters:\n{_below(lens_pairs)}projection_parameters:\n{_below(pairs)}"
        return (head.format("PINHOLE") + below).encode()

    poses = opencv(".yml", imu=1, body_T_cam0=BODIES[0], body_T_cam1=BODIES[1])
    lenses = (FISHEYE, FISHEYE) if wide else (D1, D2)
    return [poses, camera(M1, lenses[0]), camera(M2, lenses[1])]


def _below(pairs) -> str:
    return "".join(f"   {name}: {value:.12g}\n" for name, value in pairs)


def okvis(model: str, lenses: tuple[np.ndarray, np.ndarray]) -> bytes:
    cameras = [
        {
            "T_SC": pose.ravel(), "image_dimension": [*SIZE], "distortion_coefficients": lens.ravel()[:4],
            "distortion_type": model, "focal_length": matrix[[0, 1], [0, 1]], "principal_point": matrix[:2, 2],
        }
        for matrix, lens, pose in zip((M1, M2), lenses, BODIES, strict=True)
    ]  # fmt: skip
    return b"%YAML:1.0\n" + as_yaml(cameras=[plain(one) for one in cameras], imu_params={"a_max": 176.0})


def basalt(model: str, lenses: tuple[np.ndarray, np.ndarray]) -> bytes:
    names = ("k1", "k2", "k3", "k4") if model == "kb4" else ("k1", "k2", "p1", "p2", "k3")
    cameras, poses = [], []
    for matrix, lens, pose in zip((M1, M2), lenses, BODIES, strict=True):
        values = [*matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), *lens.ravel().tolist()]
        single = dict(zip(("fx", "fy", "cx", "cy", *names), values, strict=True))
        cameras.append({"camera_type": model, "intrinsics": single})
        place = [*pose[:3, 3].tolist(), *quaternion(pose)]
        poses.append(dict(zip(("px", "py", "pz", "qw", "qx", "qy", "qz"), place, strict=True)))
    document = {"T_imu_cam": poses, "intrinsics": cameras, "resolution": [[*SIZE]] * 2, "vignette": []}
    return json.dumps({"value0": document}).encode()


def mrpt() -> bytes:
    def camera(side: str, matrix: np.ndarray, lens: np.ndarray) -> str:
        values = zip(("fx", "fy", "cx", "cy"), matrix[[0, 1, 0, 1], [0, 1, 2, 2]], strict=True)
        single = "".join(f"{name} = {value}  // +/- 0.3\n" for name, value in values)
        return f"[CAMERA_PARAMS_{side}]\nresolution = [640 480]\n{single}dist = [{rows(lens)}]  // K1 K2 T1 T2 K3\n"

    back = np.linalg.inv(POSE)
    place = rows(np.array([*back[:3, 3], *quaternion(back)]))
    pose = f"[CAMERA_PARAMS_LEFT2RIGHT_POSE]\npose_quaternion = [{place}]\n"
    return (camera("LEFT", M1, D1) + camera("RIGHT", M2, D2) + pose).encode()


FISHEYE = np.array([[-0.02, 0.004, -0.003, 0.0005]])

OF_MAKERS: dict[str, Callable[[], list[bytes]]] = {
    "single numbers": lambda: [
        as_json(
            **{
                side: dict(zip(("fx", "fy", "ppx", "ppy"), matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), strict=True))
                | {"coeffs": lens}
                for side, matrix, lens in (("left", M1, D1), ("right", M2, D2))
            },
            rotation=R, translation=T, image_size=np.array(SIZE),
        )
    ],
    "DepthAI": lambda: [depthai()],
    "MATLAB, a struct as JSON": lambda: [as_json(**matlab())],
    "MATLAB, a newer struct, inside another": lambda: [as_json(stereoParams=matlab(newer=True, unit="m"))],
    "MATLAB, a struct as MAT": lambda: [mat(params=plain(matlab()))],
    "MATLAB, for OpenCV": lambda: [
        as_json(
            intrinsicMatrix1=M1, distortionCoefficients1=D1, intrinsicMatrix2=M2, distortionCoefficients2=D2,
            rotationOfCamera2=R, translationOfCamera2=1000 * T, imageSize=np.array(SIZE[::-1]),
        )
    ],
    "Bouguet's toolbox": lambda: [bouguet()],
    "ORB-SLAM3": lambda: [orb_slam()],
    "VINS": vins,
    "EuRoC": lambda: [
        as_yaml(
            T_BS={"cols": 4, "rows": 4, "data": pose.ravel()}, rate_hz=20, resolution=np.array(SIZE),
            camera_model="pinhole", intrinsics=matrix[[0, 1, 0, 1], [0, 1, 2, 2]],
            distortion_model="radial-tangential", distortion_coefficients=lens[0, :4],
        )
        for matrix, lens, pose in ((M1, D1, np.eye(4)), (M2, D2, np.linalg.inv(POSE)))
    ],
    "Kalibr, with an IMU": lambda: [kalibr_imu()],
    "OKVIS": lambda: [okvis("radialtangential", (D1, D2))],
    "Basalt": lambda: [basalt("pinhole-radtan8", (D1, D2))],
    "MRPT": lambda: [mrpt()],
    "MC-Calib": lambda: [
        as_json(
            nb_camera=2,
            **{
                f"camera_{number}": {
                    "camera_matrix": matrix, "distortion_vector": lens, "distortion_type": 0, "img_width": 640,
                    "img_height": 480, "camera_pose_matrix": pose,
                }
                for number, (matrix, lens, pose) in enumerate(zip((M1, M2), (D1, D2), BODIES, strict=True))
            },
        )
    ],
    "RealSense's SDK, rotations down the columns": lambda: [
        as_json(
            **{
                side: dict(zip(("fx", "fy", "ppx", "ppy"), matrix[[0, 1, 0, 1], [0, 1, 2, 2]].tolist(), strict=True))
                | {"coeffs": lens, "width": 640, "height": 480}
                for side, matrix, lens in (("left", M1, D1), ("right", M2, D2))
            },
            extrinsics={"rotation": R.T.ravel(), "translation": T.ravel()},
        )
    ],
    "the pose in one matrix": lambda: [as_json(**(BOTH_CAMERAS | {"T": POSE}))],
}  # fmt: skip
"""Both cameras before rectification, in the layouts of makers."""

OF_MAKERS_RECTIFYING: dict[str, Callable[[], list[bytes]]] = {
    "ROS, ost.txt of both": lambda: [(ost("left") + "\n" + ost("right")).encode()],
    "ROS, INI": lambda: [ost("right").encode(), ost("left").encode()],
    "ORB-SLAM2": lambda: [orb_slam_2()],
}

OF_MAKERS_RECTIFIED: dict[str, Callable[[], list[bytes]]] = {
    "DrivingStereo": lambda: [drivingstereo()],
    "KITTI": lambda: [kitti()],
    "KITTI, the grey cameras": lambda: [kitti().replace(b"_03", b"_01").replace(b"_02", b"_00")],
    "Cityscapes": lambda: [
        as_json(
            extrinsic={"baseline": BASELINE, "pitch": 0.03, "roll": 0.0, "x": 1.7, "y": 0.1, "yaw": 0.01, "z": 1.2},
            intrinsic={"fx": FOCAL, "fy": FOCAL, "u0": P1[0, 2], "v0": P1[1, 2]},
        )
    ],
    "K.txt": lambda: [f"{rows(P1[:, :3], ' ')}\n{BASELINE}\n".encode()],
    "K.txt, the matrix in rows": lambda: [f"{rows(P1[:, :3])}\n{BASELINE}\n".encode()],
    "cvkit": lambda: [
        f"# Created by gc_stream\ncamera.A=[{rows(P1[:, :3], '; ')}]\ncamera.height=480\ncamera.width=640\n"
        f"rho={-P2[0, 3]}\nt={BASELINE}\n".encode()
    ],
    "ORB-SLAM3, rectified": lambda: [
        f'%YAML:1.0\nCamera.type: "Rectified"\nCamera1.fx: {FOCAL}\nCamera1.fy: {FOCAL}\nCamera1.cx: {P1[0, 2]}\n'
        f"Camera1.cy: {P1[1, 2]}\nStereo.b: {BASELINE}\nCamera.width: 640\nCamera.height: 480\n".encode()
    ],
    "DSEC": lambda: [
        as_yaml(
            intrinsics={f"camRect{number}": {"resolution": [*SIZE]} for number in (0, 1, 2, 3)},
            disparity_to_depth={"cams_03": Q * 2, "cams_12": Q},
        )
    ],
    "the unit in the baseline's name": lambda: [
        as_json(focal_px=FOCAL, baseline_mm=1000 * BASELINE, cx=P1[0, 2], cy=P1[1, 2], width=640, height=480)
    ],
    "ORB-SLAM2, rectified": lambda: [orb_slam_2().partition(b"LEFT.height")[0]],
}


def kalibr_imu() -> bytes:
    chain = yaml.safe_load(kalibr())
    for name, pose in (("cam0", np.eye(4)), ("cam1", POSE)):
        chain[name].pop("T_cn_cnm1", None)
        chain[name]["T_cam_imu"] = pose.tolist()
    return yaml.safe_dump(chain).encode()


WIDE: dict[str, Callable[[], list[bytes]]] = {
    "OpenCV, said by name": lambda: [
        opencv(".yml", camera_model="fisheye", **(BOTH_CAMERAS | {"D1": FISHEYE.T, "D2": FISHEYE.T}))
    ],
    "OpenCV, said by number": lambda: [
        opencv(".yml", fisheye=1, model="kannala_brandt4", **(BOTH_CAMERAS | {"D1": FISHEYE.T, "D2": FISHEYE.T}))
    ],
    "Kalibr": lambda: [kalibr("equidistant", (FISHEYE, FISHEYE))],
    "DepthAI": lambda: [depthai(wide=True)],
    "ORB-SLAM3": lambda: [orb_slam("KannalaBrandt8")],
    "VINS": lambda: vins(wide=True),
    "ZED One": lambda: [zed((FISHEYE, FISHEYE))],
    "Stereolabs' tool": lambda: [
        opencv(".yml", K_LEFT=M1, K_RIGHT=M2, D_LEFT_FE=FISHEYE, D_RIGHT_FE=FISHEYE, R=cv2.Rodrigues(R)[0], T=T)
    ],
    "OKVIS": lambda: [okvis("equidistant", (FISHEYE, FISHEYE))],
    "Basalt": lambda: [basalt("kb4", (FISHEYE, FISHEYE))],
}  # fmt: skip
"""Both cameras with fisheyes."""
