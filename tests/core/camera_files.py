"""One stereo camera in every calibration format in common use."""

from __future__ import annotations

import io
import json
from collections.abc import Callable

import cv2
import numpy as np
import yaml

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

    def entry(name: str, given, usual: np.ndarray) -> str:
        values = usual if given is None else given
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
    """Return the same as printed by ``rostopic echo``."""
    first = side == "left"
    parts = (M1, D1, R1, P1) if first else (M2, D2, R2, P2)
    numbers = "".join(f"{name}: {part.ravel().tolist()}\n" for name, part in zip("KDRP", parts, strict=True))
    header = 'header: \n  seq: 7\n  frame_id: "cam"\nheight: 480\nwidth: 640\ndistortion_model: "plumb_bob"\n'
    return f"{header}{numbers}binning_x: 0\nroi: \n  do_rectify: False\n---\n".encode()


def kalibr(**second: object) -> bytes:
    def camera(matrix: np.ndarray, distortion: np.ndarray) -> Values:
        return {
            "cam_overlaps": [1],
            "camera_model": "pinhole",
            "distortion_coeffs": distortion.ravel()[:4],
            "distortion_model": "radtan",
            "intrinsics": np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]),
            "resolution": [*SIZE],
            "rostopic": "/cam/image_raw",
        }

    pose = np.vstack([np.hstack([R, T]), [0, 0, 0, 1]])
    return as_yaml(cam0=camera(M1, D1), cam1=camera(M2, D2) | {"T_cn_cnm1": pose} | second)


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
    "Kalibr": lambda: [kalibr()],
    **{f"NPZ, {next(iter(names))}": lambda names=names: [npz(**names)] for names in NAMES},
    "a rotation vector": lambda: [npz(**(BOTH_CAMERAS | {"R": cv2.Rodrigues(R)[0]}))],
}
"""Both cameras before rectification, without rectifying transforms."""

MADE = {"R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": Q}
RECTIFYING: dict[str, Callable[[], list[bytes]]] = {
    "OpenCV YAML": lambda: [opencv(".yml", **BOTH_CAMERAS, **MADE)],
    "OpenCV XML in two files": lambda: [opencv(".xml", M1=M1, D1=D1, M2=M2, D2=D2), opencv(".xml", R=R, T=T, **MADE)],
    "NPZ": lambda: [npz(**BOTH_CAMERAS, **MADE)],
    "NPZ with Q alone": lambda: [npz(**BOTH_CAMERAS, R1=R1, R2=R2, Q=Q)],
    "NPZ without a pose": lambda: [npz(M1=M1, D1=D1, M2=M2, D2=D2, **MADE)],
    "NPZ with other names": lambda: [npz(**BOTH_CAMERAS, rectL=R1, rectR=R2, projMatrixL=P1, projMatrixR=P2)],
    "ROS": lambda: [ros("left"), ros("right")],
    "ROS, right before left": lambda: [ros("right"), ros("left")],
    "ROS, printed": lambda: [ros_message("left"), ros_message("right")],
    "ROS, right before left, printed": lambda: [ros_message("right"), ros_message("left")],
}
"""Both cameras, with the rectifying transforms used by their maker."""

RECTIFIED: dict[str, Callable[[], list[bytes]]] = {
    "Q in YAML": lambda: [opencv(".yml", Q=Q, image_size=np.array(SIZE))],
    "Q in XML": lambda: [opencv(".xml", Q=Q, image_width=640, image_height=480)],
    "Q in NPZ": lambda: [npz(Q=Q)],
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
"""The rectified pair alone."""
