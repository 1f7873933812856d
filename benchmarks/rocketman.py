"""Results of template search with known truth, compared with OpenCV: found, found at a wrong place, found absent."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import starmap
from typing import Any, Literal

import cv2
import numpy as np

from benchmarks.pairs import DATA
from benchmarks.searches import KINDS, Place, Trial, trial
from stereolag import match_template

TRIALS = 15
"""Searches of each kind."""

SEED = 1_000_000
"""Seed of the first search; smaller seeds may be used while the search is being developed."""

THRESHOLD = 0.8
"""Least score of a match by OpenCV."""

REQUIRED: dict[str, tuple[float, tuple[str, ...]]] = {
    "photographs and screens": (
        98,
        (
            "screens",
            "screens as jpeg",
            "screens at other sizes",
            "photographs as taken",
            "photographs turned and resized",
        ),
    ),
    "half a pixel off": (95, ("icons off the grid", "symmetric icons off the grid")),
    "white balance": (97, ("other white balance", "icons in other white balance")),
    "covered by 10 to 30 %": (70, ("covered by 10 to 30 percent",)),
    "up to 30 % outside": (80, ("outside by 5 to 30 percent",)),
    "silhouettes": (90, ("silhouettes",)),
    "copies counted exactly": (95, ("copies", "rows of a list")),
}
"""{name: (least share of searches that must be found correctly, %; their kinds)}."""

MAX_ABSENT_PERCENT = 1.0
"""Largest share of absent templates that are found, %."""

MAX_WRONG_PERCENT = 0.5
"""Largest share of searches that find a wrong place, %."""

Outcome = Literal["right", "wrong", "missed", "absent found"]


@dataclass(frozen=True)
class Answer:
    """All places found, best first; empty if the template is reported as absent."""

    places: tuple[Place, ...]
    reason: str
    seconds: float


@dataclass(frozen=True)
class Judged:
    """The outcomes of one search, ours and OpenCV's."""

    kind: str
    seed: int
    present: bool
    ours: Outcome
    theirs: Outcome
    said: str
    seconds: float


def our_answer(given: Trial) -> Answer:
    """Return the answer of :func:`stereolag.match_template`, or its error message."""
    start = time.perf_counter()
    try:
        search = match_template(given.picture, given.template, mask=given.mask, **given.options)
    except ValueError as refusal:
        return Answer((), f"ValueError: {refusal}", time.perf_counter() - start)
    seconds = time.perf_counter() - start
    told = [
        f"{match.row, match.col} {match.score:.3f}"
        + (f" × {match.scale:.2f}, {match.rotation:+.0f}°" if given.options.keys() & {"scales", "rotations"} else "")
        for match in ([search.best] if search.best is not None else []) + search.rivals[:1]
    ]
    named = search.matches[: search.clear] if search.found else []
    places = tuple(Place(one.row, one.col, one.height, one.width, one.scale, one.rotation) for one in named)
    return Answer(places, f"{search.reason}, best and rival {'; '.join(told)}", seconds)


def their_answer(given: Trial) -> Answer:
    """Return the places at which OpenCV's score exceeds the threshold and is the highest within half a template."""
    start = time.perf_counter()
    picture, template, mask = given.picture, given.template, given.mask
    if mask is None and template.ndim == 3 and template.shape[2] == 4:
        mask = template[:, :, 3]
    picture, template = (one if one.ndim == 2 else one[:, :, :3] for one in (picture, template))
    if picture.ndim != template.ndim:
        picture, template = (
            one if one.ndim == 2 else one.mean(axis=2, dtype=np.float32) for one in (picture, template)
        )
    if {picture.dtype, template.dtype} != {np.dtype(np.uint8)}:
        picture, template = picture.astype(np.float32), template.astype(np.float32)
    height, width = template.shape[:2]
    if height > picture.shape[0] or width > picture.shape[1]:
        return Answer((), "", 0.0)
    weights = None if mask is None else np.dstack([mask / np.float32(255)] * 3)
    pixels = np.ascontiguousarray(picture), np.ascontiguousarray(template)
    score = cv2.matchTemplate(*pixels, cv2.TM_CCOEFF_NORMED, mask=weights)
    score[~np.isfinite(score)] = -1
    places = []
    while len(places) < given.options.get("max_matches", 1) and score.max() >= THRESHOLD:
        row, col = (int(one) for one in np.unravel_index(score.argmax(), score.shape))
        places.append(Place(row, col, height, width))
        near = (
            slice(max(0, row - height // 2), row + height // 2 + 1),
            slice(max(0, col - width // 2), col + width // 2 + 1),
        )
        score[near] = -1
    return Answer(tuple(places), "", time.perf_counter() - start)


def outcome(given: Trial, answer: Answer, posed: bool) -> Outcome:
    """Return the outcome of an answer; `posed`: whether it has sizes and angles."""
    missing, shape, wrong = list(given.places), given.picture.shape, 0
    for named in answer.places:
        near = [one for one in missing if one.is_near(named, shape) and (not posed or one.has_pose(named))]
        if near:
            missing.remove(near[0])
        elif answer.reason.startswith("clear") or not any(one.is_near(named, shape) for one in given.pale):
            wrong += 1
    if wrong:
        return "wrong" if given.places else "absent found"
    return "missed" if missing else "right"


def judged(kind: str, seed: int) -> Judged:
    """Return the outcomes of one search."""
    given = trial(kind, seed)
    ours, theirs = our_answer(given), their_answer(given)
    places = "; ".join(f"({one.row:.0f}, {one.col:.0f})" for one in ours.places[:4])
    return Judged(
        kind=kind,
        seed=seed,
        present=bool(given.places),
        ours=outcome(given, ours, posed=True),
        theirs=outcome(given, theirs, posed=False),
        said=f"{len(ours.places)} of {len(given.places)} named [{places}], {ours.reason}; true {_words(given.places)}",
        seconds=ours.seconds,
    )


def _words(places: Sequence[Place]) -> str:
    first = [f"({one.row:.0f}, {one.col:.0f}) × {one.scale:.2f}, {one.rotation:+.0f}°" for one in places[:2]]
    return "; ".join(first) if first else "none"


def judged_trials(kinds: Sequence[str], seeds: Sequence[int], jobs: int) -> Iterator[Judged]:
    """Yield the outcomes of the searches of these kinds with these seeds, computed by `jobs` processes."""
    pairs = [(kind, seed) for kind in kinds for seed in seeds]
    if jobs == 1:
        yield from starmap(judged, pairs)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), cv2.setNumThreads, (1,)) as processes:
        yield from processes.map(judged, *zip(*pairs, strict=True), chunksize=4)


def rocketman_table(
    kinds: Sequence[str] = tuple(KINDS), *, trials: int = TRIALS, seed: int = SEED, jobs: int = 1
) -> tuple[str, list[dict[str, Any]]]:
    """Return the outcomes of searches of each kind as Markdown, with each fault, and as figures."""
    kinds = [kind for kind in kinds if kind != "public pictures" or DATA.is_dir()]
    every = list(judged_trials(kinds, range(seed, seed + trials), jobs))
    lines = [
        "| search | trials | found, right | **at a wrong place** | **absent, found** | OpenCV: found, right"
        " | at a wrong place | absent, found | s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in kinds:
        lines.append(f"| {kind} | " + " | ".join(_cells([one for one in every if one.kind == kind])) + " |")
    lines.append("| **all** | " + " | ".join(_cells(every)) + " |")
    lines += ["", "| of these | ours | OpenCV's | must |", "|---|---|---|---|", *_musts(every)]
    faults = [f"- {one.kind}, seed {one.seed}: {one.ours}; {one.said}" for one in every if one.ours != "right"]
    return "\n".join([*lines, "", "Faults:", "", *(faults or ["- none"])]), [asdict(one) for one in every]


def _count(judged: Sequence[Judged], ours: bool, result: Outcome, present: bool) -> str:
    of = [one.ours if ours else one.theirs for one in judged if one.present is present]
    return f"{of.count(result)} of {len(of)}" if of else ""


def _cells(judged: Sequence[Judged]) -> list[str]:
    both = [
        [
            _count(judged, ours, "right", True),
            _count(judged, ours, "wrong", True),
            _count(judged, ours, "absent found", False),
        ]
        for ours in (True, False)
    ]
    right, wrong, absent = both[0]
    emphasised = [right, f"**{wrong}**" if wrong else "", f"**{absent}**" if absent else ""]
    return [str(len(judged)), *emphasised, *both[1], f"{np.mean([one.seconds for one in judged]):.2f}"]


def _musts(judged: Sequence[Judged]) -> Iterator[str]:
    """Yield a row for each required share of the kinds that were tried."""

    def row(name: str, of: Sequence[Judged], results: tuple[Outcome, ...], must: str) -> str:
        shares = (
            np.mean([result in results for result in told])
            for told in zip(*((one.ours, one.theirs) for one in of), strict=True)
        )
        return f"| {name} | " + " | ".join(f"{100 * share:.1f} %" for share in shares) + f" | {must} |"

    for name, (least, kinds) in REQUIRED.items():
        of = [one for one in judged if one.kind in kinds]
        if of:
            yield row(f"{name}: found, right", of, ("right",), f"≥ {least:g} %")
    absent = [one for one in judged if not one.present]
    if absent:
        yield row("absent, found", absent, ("absent found",), f"≤ {MAX_ABSENT_PERCENT:g} %")
    yield row("found at a wrong place", judged, ("wrong",), f"≤ {MAX_WRONG_PERCENT:g} %")
