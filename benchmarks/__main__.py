"""Print tables, and write them as Markdown and JSON to benchmarks/results/."""

from __future__ import annotations

import argparse
import json
import os
import platform
from dataclasses import asdict
from pathlib import Path

import cv2
import numba
import numpy as np
import scipy

from benchmarks.accuracy import accuracy_tables
from benchmarks.browser import latency_table
from benchmarks.doctor import doctor_tables
from benchmarks.flow import flow_table
from benchmarks.hostile import hostile_table
from benchmarks.live import live_table
from benchmarks.load import load_table, short_load_table
from benchmarks.long import LENGTHS, long_table
from benchmarks.long_drive import long_drive_table
from benchmarks.pairs import DATA
from benchmarks.recordings import KINDS
from benchmarks.rocketman import SEED, rocketman_table
from benchmarks.rocketman import TRIALS as SEARCHES
from benchmarks.searches import KINDS as SEARCHED
from benchmarks.sequences import DRIVE, sequence_table
from benchmarks.speed import REPORT, signal_rows, stereo_rows, template_rows
from benchmarks.steadiness import steadiness_table
from benchmarks.suggestion import suggestion_table
from benchmarks.timing import Row
from benchmarks.verdict import METHODS, TRIALS, methods_table, recordings_table

DEFAULT_TABLES = ["speed", "accuracy", "sequences", "browser", "flow"]
TABLES = [
    *DEFAULT_TABLES,
    "steadiness",
    "doctor",
    "suggestion",
    "verdict",
    "long",
    "rocketman",
    "load",
    "live",
    "hostile",
]
RESULTS = Path(__file__).parent / "results"


def conditions() -> dict[str, str]:
    """Return the versions and the machine on which the figures depend."""
    return {
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "SciPy": scipy.__version__,
        "OpenCV": f"{cv2.__version__}, {cv2.getNumThreads()} threads",
        "numba": numba.__version__,
        "cores": str(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()),
        "machine": platform.machine(),
    }


def with_unit(value: float, unit: str) -> str:
    """Return a value with three digits in a suitable unit."""
    for factor, name in ((1, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")):
        if unit == "s" and value * factor >= 1:
            return f"{value * factor:.3g} {name}"
    return f"{value:.3g} {unit}" if unit != "s" else f"{value * 1e12:.3g} ps"


def table(rows: list[Row]) -> str:
    """Return rows as a Markdown table."""
    lines = [
        "| task | ours | peer | | ratio | must | aim | the report | times faster |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        reported = REPORT.get(row.task)
        then = f"{reported:g} s | {reported / row.ours:,.0f} ×" if reported else " | "
        lines.append(
            f"| {row.task} | {with_unit(row.ours, row.unit)} | {row.peer_name} | {with_unit(row.peer, row.unit)} |"
            f" {row.ratio:.3g} | {row.must} | {row.aim} | {then} |"
        )
    notes = [f"\n{row.task}: {row.note}." for row in rows if row.note]
    return "\n".join(lines + notes)


def save(name: str, title: str, body: str, values: object) -> None:
    """Print a table and save it with its conditions."""
    state = conditions()
    text = f"# {title}\n\n{body}\n\n" + ", ".join(f"{key} {value}" for key, value in state.items()) + ".\n"
    print(text, flush=True)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.md").write_text(text, encoding="utf-8")
    document = json.dumps({"conditions": state, "figures": values}, indent=1)
    (RESULTS / f"{name}.json").write_text(document + "\n", encoding="utf-8")


def main() -> None:
    """Run the requested tables, or the default ones."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "tables", nargs="*", choices=[*TABLES, []], help=f"which tables; {', '.join(DEFAULT_TABLES)} unless named"
    )
    parser.add_argument(
        "--frames", type=int, help="of sequences: run the command on a drive of this many, and measure memory"
    )
    parser.add_argument("--lengths", nargs="*", choices=LENGTHS, help="of long: which recordings; all unless named")
    drawn = parser.add_argument_group("of verdict and rocketman", "part of a table is printed, but not written")
    kinds = [*KINDS, *SEARCHED]
    drawn.add_argument("--kinds", nargs="*", choices=kinds, help="of recordings or searches; all unless named")
    drawn.add_argument("--trials", type=int, help=f"of each kind; {TRIALS} and {SEARCHES} unless given")
    drawn.add_argument("--seed", type=int, help=f"of the first trial; 0 and {SEED} unless given")
    drawn.add_argument("--method", choices=METHODS, default="fft", help="of verdict; %(default)s unless named")
    drawn.add_argument("--jobs", type=int, default=1, help="processes at once")
    options = parser.parse_args()
    wanted = options.tables or DEFAULT_TABLES
    if "speed" in wanted:
        rows = [*stereo_rows(), *signal_rows(), *template_rows()]
        save("speed", "Speed", table(rows), [asdict(row) | {"ratio": row.ratio} for row in rows])
    if "accuracy" in wanted:
        if DATA.is_dir():
            save("accuracy", "Accuracy", *accuracy_tables())
        else:
            print(f"Accuracy is left out: the pairs with truth are not at {DATA} (set STEREOLAG_DATA).")
    if "sequences" in wanted:
        if DRIVE.is_dir() and options.frames:
            save("long_drive", "A long drive", *long_drive_table(options.frames))
        elif options.frames:
            print(f"The long drive is left out: there is none at {DRIVE} (set STEREOLAG_DATA).")
        else:
            save("sequences", "Frame sequences", *sequence_table())
    if "steadiness" in wanted:
        save("steadiness", "Steady maps", *steadiness_table())
    if "flow" in wanted:
        save("flow", "Optical flow", *flow_table())
    if "browser" in wanted:
        latency = latency_table()
        if latency:
            save("browser", "In the browser", *latency)
        else:
            print("The latency is left out: there is no Chromium (set CHROMIUM).")
    if "doctor" in wanted:
        save("doctor", "The input doctor", *doctor_tables())
    if "suggestion" in wanted:
        if DATA.is_dir():
            save("suggestion", "Suggested settings", *suggestion_table())
        else:
            print(f"Suggestions are left out: the pairs with truth are not at {DATA} (set STEREOLAG_DATA).")
    whole = not options.kinds and options.trials is None and options.seed is None
    if "verdict" in wanted:
        body, figures = recordings_table(
            options.kinds or list(KINDS),
            trials=options.trials or TRIALS,
            seed=options.seed or 0,
            method=options.method,
            jobs=options.jobs,
        )
        if not whole or options.method != "fft":
            print(body, flush=True)
        else:
            methods, verdicts = methods_table()
            save("verdict", "Verdicts on lags", f"{body}\n\n{methods}", {"recordings": figures, "methods": verdicts})
    if "long" in wanted:
        save("long", "Long recordings", *long_table({name: LENGTHS[name] for name in options.lengths or LENGTHS}))
    if "rocketman" in wanted:
        body, searches = rocketman_table(
            options.kinds or list(SEARCHED),
            trials=options.trials or SEARCHES,
            seed=SEED if options.seed is None else options.seed,
            jobs=options.jobs,
        )
        if whole:
            save("rocketman", "Template search with doubt", body, searches)
        else:
            print(body, flush=True)
    if "load" in wanted:
        save("load", "Many visitors at once", *load_table())
    elif not options.tables:
        print(short_load_table(), flush=True)
    if "live" in wanted:
        save("live", "Live cameras", *live_table())
    if "hostile" in wanted:
        save("hostile", "Hostile files", *hostile_table())


if __name__ == "__main__":
    main()
