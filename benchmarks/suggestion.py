"""Benefit of suggested settings: true bad-2 before and after, and with the best settings among those tried."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

from benchmarks.pairs import true_pairs
from stereolag import StereoBM, StereoSGBM, preset, samples, suggest
from stereolag.assess.judging import TuningPair
from stereolag.assess.suggestion import candidates
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.windows.matcher import CorrelationMatcher

BUDGET_S = 10.0
BLIND, SEEING = "blind", "with truth"

MAX_WORSENING = 0.5
"""Largest increase of bad-2 allowed, percentage points."""

MAX_FROM_BEST = 1.0
"""Largest mean distance from the best settings allowed, percentage points of bad-2."""

STARTS: dict[str, StereoMatcher] = {
    "plain windows": CorrelationMatcher(),
    "StereoBM": StereoBM(),
    "StereoSGBM": StereoSGBM(),
    "accurate": preset("accurate"),
}


@dataclass(frozen=True)
class Suggested:
    """One search: true bad-2, %, and the figures reported by the search itself."""

    pair: str
    start: str
    judged: str
    before: float
    after: float
    best: float
    said_before: float
    said_after: float
    outcome: str
    tried: int


def named_pairs() -> Iterator[tuple[str, TuningPair, int]]:
    """Yield every pair with ground truth, external and bundled: its name and the number of disparities it needs."""
    for pair in true_pairs():
        yield pair.name, TuningPair.of(pair.left, pair.right, pair.truth), pair.num_disparities
    for name, example in samples.stereo_pairs().items():
        images = read_image(example.left), read_image(example.right)
        count = -(-example.num_disparities // 16) * 16
        yield f"example {name}", TuningPair.of(*images, read_disparity(example.disparity)), count


def searches(name: str, pair: TuningPair, num_disparities: int) -> Iterator[Suggested]:
    """Search from every start, without and with the ground truth."""
    for title, method in STARTS.items():
        start = method.with_search_range(0, num_disparities)
        before = pair.judge(start).bad
        founds = {
            judged: suggest(
                start,
                pair.left,
                pair.right,
                ground_truth=pair.reference if judged == SEEING else None,
                budget_s=BUDGET_S,
            )
            for judged in (BLIND, SEEING)
        }
        known = {trial.matcher: trial.bad for trial in founds[SEEING].trials if trial.whole}
        best = min(before, *(known[one] if one in known else pair.judge(one).bad for one in candidates(start)))
        for judged, found in founds.items():
            yield Suggested(
                name, title, judged, before, pair.judge(found.matcher).bad, best,
                found.bad_before, found.bad, str(found.outcome), found.tried,
            )  # fmt: skip


def suggestion_table() -> tuple[str, list[dict[str, object]]]:
    """Return the tables as Markdown, and their figures."""
    rows: list[Suggested] = []
    for name, pair, count in named_pairs():
        rows += searches(name, pair, count)
        print(f"{name} done", flush=True)
    return rendered(rows), [asdict(row) for row in rows]


def rendered(rows: Sequence[Suggested]) -> str:
    """Return the tables as Markdown."""
    lines = [
        f"True bad-2, %, before → after {BUDGET_S:g} s; in brackets that of the best settings among those it may try.",
        "",
        "| start | judged | mean gain | worst change | mean distance from the best | must |",
        "|---|---|---|---|---|---|",
    ]
    for title in STARTS:
        for judged in (BLIND, SEEING):
            selected = [row for row in rows if (row.start, row.judged) == (title, judged)]
            gain = math.fsum(row.before - row.after for row in selected) / len(selected)
            distance = math.fsum(row.after - row.best for row in selected) / len(selected)
            worst = max(row.after - row.before for row in selected)
            must = (
                f"worst ≤ {MAX_WORSENING}, gain > 0, distance ≤ {MAX_FROM_BEST:g}" if judged == BLIND else "worst ≤ 0"
            )
            must = "unchanged: nothing to judge it by" if (title, judged) == ("accurate", BLIND) else must
            lines.append(f"| {title} | {judged} | {gain:.2f} | {worst:+.2f} | {distance:.2f} | {must} |")
    for judged in (BLIND, SEEING):
        lines += ["", f"Searched {judged}:", "", f"| pair | {' | '.join(STARTS)} |", "|---" * (1 + len(STARTS)) + "|"]
        for name in dict.fromkeys(row.pair for row in rows):
            selected = [row for row in rows if (row.pair, row.judged) == (name, judged)]
            cells = (f"{row.before:.1f} → {row.after:.1f} ({row.best:.1f})" for row in selected)
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(suggestion_table()[0])
