"""The input doctor on raw pairs, on rectified pairs and on lenses with a known distortion."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.pairs import DATA, true_pairs
from stereolag.assess.diagnosis import Diagnosis, apply_remedy, diagnose
from stereolag.assess.features import Correspondences
from stereolag.assess.findings import Finding, FindingCode
from stereolag.assess.orientation import best_rectification, find_correspondences
from stereolag.core.inputs import as_grey
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs
from stereolag.sequences import StereoFrame, StereoSequence, diagnose_sequence

Array = npt.NDArray[Any]

BOARD = (9, 6)
COEFFICIENTS = (-0.05, -0.1, -0.2, -0.3, 0.1)
CORNER = 0.4
"""Distance from the centre, as a fraction of the image's diagonal, beyond which a point is in a corner."""


def doctor_tables() -> tuple[str, dict[str, object]]:
    """Return the tables as Markdown, and their figures."""
    tables = {
        "Raw pairs of a chessboard": raw_rows(),
        "Pairs": pair_rows(),
        "Disturbances": disturbance_rows(),
        "Frames that are late": late_rows(),
        "Synthetic lenses": lens_rows(),
    }
    body, values = [], {}
    for heading, found in tables.items():
        rows = list(found)
        body += [f"{heading}:", "", f"| {' | '.join(rows[0])} |", "|---" * len(rows[0]) + "|"]
        body += [f"| {' | '.join(str(value) for value in row.values())} |" for row in rows] + [""]
        values[heading] = rows
    return "\n".join(body).rstrip(), values


def raw_rows() -> Iterator[dict[str, object]]:
    """Yield the findings on each raw pair, judged by the board's corners, to which no feature was fitted."""
    for path in sorted((DATA / "calibration" / "opencv_chessboard").glob("left*.jpg")):
        views = read_image(path), read_image(path.with_name(path.name.replace("left", "right")))
        diagnosis, row = examined(path.stem, *views)
        corners = board_corners(*views)
        found = best_rectification(find_correspondences(*views))
        swapped = diagnose(*views[::-1]).finding(FindingCode.SWAPPED)
        row["swapped is told"] = "yes" if swapped is not None and not swapped.healthy else "no"
        row["corners' rows off"] = f"{rms(corners.dy):.2f}"
        row["after rectifying"] = "" if found is None else f"{rms(found.row_errors(corners)):.2f}"
        nearest = float(np.max(-corners.dx))
        row["nearest corner"] = f"{nearest:.0f} px, {'inside' if covered(diagnosis, -corners.dx) == 1 else 'OUTSIDE'}"
        yield row


def pair_rows() -> Iterator[dict[str, object]]:
    """Yield the findings on each rectified pair, and its suggested range compared with the true one."""
    for name, left, right, truth in rectified_pairs():
        diagnosis, row = examined(name, left, right)
        known = truth[np.isfinite(truth)]
        count = 0 if diagnosis.suggested_range is None else diagnosis.suggested_range[1]
        row["truth"] = f"{known.min():.0f} to {known.max():.0f}"
        row["truth inside"] = f"{covered(diagnosis, known):.2%}"
        row["range / truth's"] = f"{count / (np.ceil(known.max()) - np.floor(known.min()) + 1):.2f}"
        row["range / 0 to truth's end"] = f"{count / (np.ceil(known.max()) + 1):.2f}"
        yield row


Views = tuple[Array, Array]


def _rolled(left: Array, right: Array) -> Views:
    return left, np.roll(right, 4, axis=0)


def _tilted(left: Array, right: Array) -> Views:
    turn = cv2.getRotationMatrix2D(((right.shape[1] - 1) / 2, (right.shape[0] - 1) / 2), 1.0, 1.0)
    return left, np.asarray(cv2.warpAffine(right, turn, right.shape[1::-1], borderMode=cv2.BORDER_REFLECT))


def _turned(left: Array, right: Array) -> Views:
    height, width = left.shape[:2]
    seen_by = np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1.0]])
    turn = seen_by @ cv2.Rodrigues(np.radians([1.0, 3.0, 1.0]))[0] @ np.linalg.inv(seen_by)
    return left, np.asarray(cv2.warpPerspective(left, turn, (width, height), borderMode=cv2.BORDER_REFLECT))


def _framed(left: Array, right: Array) -> Views:
    black = right.copy()
    black[-right.shape[0] // 10 :] = 0
    return left, black


def _blank(left: Array, right: Array) -> Views:
    views = left.copy(), right.copy()
    for view in views:
        view[view.shape[0] // 3 :] = 128
    return views


DISTURBANCES: dict[str, tuple[Callable[[Array, Array], Views], str]] = {
    "none": (lambda left, right: (left, right), ""),
    "sides exchanged": (lambda left, right: (right, left), "swapped"),
    "cropped, all behind": (lambda left, right: (left[:, 60:], right[:, :-60]), ""),
    "one file twice": (lambda left, right: (left, left), "identical"),
    "a camera that turned": (_turned, "one_moving_camera"),
    "right mirrored": (lambda left, right: (left, right[:, ::-1]), "mirrored"),
    "right upside down": (lambda left, right: (left, right[::-1, ::-1]), "rotation"),
    "left mirrored": (lambda left, right: (left[:, ::-1], right), "mirrored"),
    "both mirrored": (lambda left, right: (left[:, ::-1], right[:, ::-1]), "swapped"),
    "the left above": (lambda left, right: (np.rot90(left, -1), np.rot90(right, -1)), "above_each_other"),
    "the right above": (lambda left, right: (np.rot90(left), np.rot90(right)), "above_each_other"),
    "rows 4 px apart": (_rolled, "rows"),
    "turned by 1 degree": (_tilted, "rotation"),
    "barrel lenses": (lambda left, right: (through_lens(left, -0.3), through_lens(right, -0.3)), "bent_rows"),
    "darker": (lambda left, right: (left, np.rint(right * 0.6).astype(right.dtype)), "exposure"),
    "a tenth black": (_framed, "empty_border"),
    "two thirds blank": (_blank, "texture"),
    "both views in each": (lambda left, right: (np.hstack([left, right]),) * 2, "layout"),
    "another scene": (lambda left, right: (left, right), "matches"),
}
"""{disturbance: (function that applies it to a pair, code of the finding expected)}."""


def disturbance_rows() -> Iterator[dict[str, object]]:
    """Yield the number of rectified pairs whose disturbance is reported, and what else is reported."""
    pairs = [(left, right) for _, left, right, _ in rectified_pairs()]
    scenes = pairs[1:] + pairs[:1]
    for name, (disturb, code) in DISTURBANCES.items():
        told, also, misled, seen = 0, dict[str, int](), 0, 0
        for (left, right), (other, _) in zip(pairs, scenes, strict=True):
            second = cv2.resize(other, right.shape[1::-1]) if code == "matches" else right
            views = (left, second) if code == "matches" else disturb(left, second)
            if left.ndim != views[1].ndim:
                views = as_grey(views[0]), as_grey(views[1])
            views = np.ascontiguousarray(views[0]), np.ascontiguousarray(views[1])
            diagnosis = diagnose(*views)
            ill = [one for one in diagnosis.ill if one.code != FindingCode.RANGE]
            told += any(one.code == code for one in ill)
            misled += any(misleading(views, one) for one in ill)
            seen += diagnosis.suggested_range is not None
            for one in ill:
                if one.code != code:
                    also[one.code] = also.get(one.code, 0) + 1
        yield {
            "disturbance": name,
            "told": "" if not code else f"{code}: {told} of {len(pairs)}",
            "also told": ", ".join(f"{one} {count}" for one, count in also.items()) or "nothing",
            "remedies after which it is as before": misled,
            "ranges": seen,
        }


def misleading(views: Views, finding: Finding) -> bool:
    """Return whether a finding has a remedy after which it is found again."""
    if finding.remedy is None:
        return False
    again = diagnose(*apply_remedy(*views, finding.remedy)).finding(finding.code)
    return again is None or not again.healthy


def late_rows() -> Iterator[dict[str, object]]:
    """Yield the number of pairs whose late right frame is reported, and the number of frames by which it seems late."""
    folder = DATA / "sequences" / "kitti_seq1"
    views = [[read_image(path) for path in sorted((folder / side).iterdir())] for side in ("left", "right")]
    for late in range(6):
        pairs = list(zip(views[0][: len(views[0]) - late : 5], views[1][late::5], strict=False))
        told = [diagnose(*pair).finding(FindingCode.NOT_SAME_MOMENT) for pair in pairs]
        count = sum(one is not None and not one.healthy for one in told)
        found = diagnose_sequence(drive_of(views[0][: len(views[0]) - late], views[1][late:]))
        moment = None if found is None else found.finding(FindingCode.NOT_SAME_MOMENT)
        fits = 0 if moment is None else moment.numbers.get("frames", 0)
        yield {"frames late": late, "told": f"{count} of {len(pairs)}", "frames that fit, by the drive": f"{fits:+.0f}"}


def drive_of(left: list[Array], right: list[Array]) -> StereoSequence:
    """Return a drive of these pictures."""
    names = tuple(map(str, range(len(left))))
    return StereoSequence(names, 10.0, lambda number: partial(StereoFrame, left[number], right[number]))


def lens_rows() -> Iterator[dict[str, object]]:
    """Yield the findings on rectified pairs whose images were both distorted by a lens of known k1."""
    for name, left, right, truth in rectified_pairs():
        if name not in {"road", "cube", "giraffes", "motorcycle_q", "teddy", "kitti2015_000046"}:
            continue
        for k1 in COEFFICIENTS:
            views = through_lens(left, k1), through_lens(right, k1)
            diagnosis, row = examined(f"{name}, k1 {k1:+.2f}", *views)
            true = true_matches(truth, k1)
            found = best_rectification(find_correspondences(*views))
            row["true spread"] = f"{float(np.std(true.dy)):.2f}"
            errors = None if found is None else found.row_errors(true)
            centre = (np.array(true.shape[::-1]) - 1) / 2
            outer = np.linalg.norm(true.left - centre, axis=1) > CORNER * np.hypot(*true.shape)
            row["after"] = "" if errors is None else f"{rms(errors):.2f}"
            row["after, corners"] = "" if errors is None else f"{rms(errors[outer]):.2f}"
            row["truth inside"] = f"{covered(diagnosis, -true.dx):.2%}"
            yield row


def examined(name: str, left: Array, right: Array) -> tuple[Diagnosis, dict[str, object]]:
    """Return the diagnosis of a pair and its table cells."""
    began = time.process_time()
    diagnosis = diagnose(left, right)
    spent = time.process_time() - began
    numbers = {found.code: found.numbers for found in diagnosis.findings}
    bent = numbers.get(FindingCode.BENT_ROWS, {})
    amber = [str(found.code) for found in diagnosis.findings if not found.healthy and found.code != FindingCode.RANGE]
    first, count = diagnosis.suggested_range or (0, 0)
    return diagnosis, {
        "pair": name,
        "matches": f"{numbers[FindingCode.MATCHES]['count']:.0f}",
        "bent": f"{bent['spread_px']:.2f} (noise {bent['noise_px']:.2f})" if bent else "",
        "amber": ", ".join(amber) or "none",
        "range": f"{first} + {count}",
        "CPU": f"{spent * 1e3:.0f} ms",
    }


def rectified_pairs() -> Iterator[tuple[str, Array, Array, Array]]:
    """Yield the name, images and ground truth of every rectified pair."""
    for pair in true_pairs():
        yield pair.name, pair.left, pair.right, pair.truth
    for name, sample in stereo_pairs().items():
        yield name, read_image(sample.left), read_image(sample.right), read_disparity(sample.disparity)


def board_corners(left: Array, right: Array) -> Correspondences:
    """Return the inner corners of the board as matches."""
    found = []
    for image in (left, right):
        seen, corners = cv2.findChessboardCorners(as_grey(image), BOARD)
        if not seen:
            raise ValueError("the board was not found")
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.01)
        found.append(cv2.cornerSubPix(as_grey(image), corners, (5, 5), (-1, -1), stop).reshape(-1, 2))
    turned = (found[0][-1] - found[0][0]) @ (found[1][-1] - found[1][0]) < 0
    return Correspondences(found[0], found[1][::-1] if turned else found[1], (left.shape[0], left.shape[1]))


def covered(diagnosis: Diagnosis, disparities: Array) -> float:
    """Return the share of disparities inside the suggested range."""
    first, count = diagnosis.suggested_range or (0, 0)
    return float(np.mean((disparities >= first) & (disparities < first + count)))


def rms(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


def through_lens(image: Array, k1: float) -> Array:
    """Return an image as seen through a lens with OpenCV's k1 and a focal length of one image width."""
    height, width = image.shape[:2]
    rows, cols = np.indices((height, width))
    centre = (np.array([width, height]) - 1) / 2
    distorted = (np.column_stack([cols.ravel(), rows.ravel()]) - centre) / width
    straight = distorted
    for _ in range(60):
        straight = distorted / (1 + k1 * (straight**2).sum(axis=1, keepdims=True))
    where = (straight * width + centre).astype(np.float32).reshape(height, width, 2)
    return np.asarray(cv2.remap(image, where, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def true_matches(truth: Array, k1: float) -> Correspondences:
    """Return matching points of a rectified pair as that lens displaces them, sampled evenly from the ground truth."""
    rows, cols = np.nonzero(np.isfinite(truth))
    drawn = np.random.default_rng(0).choice(len(rows), 4000, replace=False)
    left = np.column_stack([cols[drawn], rows[drawn]]).astype(np.float64)
    right = left - np.column_stack([truth[rows[drawn], cols[drawn]], np.zeros(len(drawn))])
    size = np.array(truth.shape[::-1])
    seen = []
    for points in (left, right):
        straight = (points - (size - 1) / 2) / size[0]
        seen.append(straight * (1 + k1 * (straight**2).sum(axis=1, keepdims=True)) * size[0] + (size - 1) / 2)
    inside = np.logical_and(*(((points >= 0) & (points < size)).all(axis=1) for points in seen))
    places = [points[inside].astype(np.float32) for points in seen]
    return Correspondences(places[0], places[1], (truth.shape[0], truth.shape[1]))
