"""The cost to a server of hostile files read through the guard, and a search for worse ones by mutation."""

from __future__ import annotations

import argparse
import random
import re
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass

from benchmarks.hostile_files import READ, READERS, hostile_files, valid_files
from benchmarks.memory import peak_mb, reset_peak, resident_mb
from stereolag.core.jobs import set_defaults
from stereolag.io.guard import MAX_CPU_S, WALL_CLOCK_FACTOR, guarded, start_guard

MOST_SECONDS = 5.0
"""Processor time of the server."""
MOST_WAITED_S = WALL_CLOCK_FACTOR * MAX_CPU_S + 1
"""Time by the clock on a busy machine, with that to end a worker; on an idle one `MAX_CPU_S`."""
MOST_MB = 500.0


@dataclass(frozen=True)
class Reading:
    """Cost and outcome of reading one file.

    Attributes
    ----------
    name, reader
        Of the file.
    file_mb, waited_s, seconds, extra_mb
        The file's size, the time by the clock, and the server's own: its processor time, and the rise of its memory
        above the level with the file loaded.
    answer
        "read" and the shape of the result, or the sentence that refuses the file.
    fault
        What is wrong, empty if nothing is.
    """

    name: str
    reader: str
    file_mb: float
    waited_s: float
    seconds: float
    extra_mb: float
    answer: str
    fault: str


def measured(name: str, reader: str, data: bytes, expected: str = "") -> Reading:
    """Return cost and outcome of reading a file through the guard."""
    before = resident_mb()
    reset_peak()
    start, processor = time.perf_counter(), time.process_time()
    try:
        found = guarded(READERS[reader])(data)
        found = getattr(found, "channels", found)
        answer = f"read {getattr(found, 'shape', '')} {getattr(found, 'dtype', '')}".strip()
    except ValueError as error:
        answer = str(error)
    except Exception as error:
        answer = f"failed: {error}"
    waited, seconds, extra = time.perf_counter() - start, time.process_time() - processor, peak_mb() - before
    fault = "slow" if waited > MOST_WAITED_S or seconds > MOST_SECONDS else "large" if extra > MOST_MB else ""
    fault = fault or _unexpected(answer, expected)
    return Reading(name, reader, len(data) / 1e6, waited, seconds, extra, answer, fault)


def _unexpected(answer: str, expected: str) -> str:
    if answer.startswith("failed") or "\n" in answer or not answer:
        return "not one sentence"
    was_read = answer.startswith("read")
    if expected == READ:
        return "" if was_read else "refused"
    return "another answer" if expected and (was_read or not re.search(expected, answer)) else ""


def hostile_table(pattern: str = "") -> tuple[str, list[dict[str, object]]]:
    """Return the table as Markdown and its rows."""
    _be_a_server()
    lines = [
        "| file | reader | MB | waited, s | server, s | server, MB | answer | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    readings = []
    for file in hostile_files().values():
        if re.search(pattern, file.name):
            one = measured(file.name, file.reader, file.make(), file.answer)
            readings.append(one)
            lines.append(
                f"| {one.name} | {one.reader} | {one.file_mb:.3g} | {one.waited_s:.2f} | {one.seconds:.2f} |"
                f" {one.extra_mb:.0f} | {one.answer.replace('|', '/')} | {one.fault} |"
            )
    slowest = max(readings, key=lambda one: one.waited_s)
    largest = max(readings, key=lambda one: one.extra_mb)
    lines.append(
        f"\n{len(readings)} files, {sum(bool(one.fault) for one in readings)} with a fault. Slowest: {slowest.name}, "
        f"{slowest.waited_s:.1f} s; most memory: {largest.name}, {largest.extra_mb:.0f} MB."
    )
    return "\n".join(lines), [asdict(one) for one in readings]


def _be_a_server() -> None:
    set_defaults(max_megasamples=30)
    start_guard()


def mutated(original: bytes, chance: random.Random) -> bytes:
    """Return a valid file with some bytes changed, cut out, inserted, repeated or cut off."""
    data = bytearray(original)
    for _ in range(chance.choice([1, 1, 1, 2, 4])):
        place = chance.randint(0, min(len(data), chance.choice([40, 200, 10**6])))
        change = chance.choice(["flip", "flip", "replace", "insert", "remove", "cut", "double"])
        new = chance.choice(
            [b"\xff" * 4, b"\x7f\xff\xff\xff", b"9" * 9, b"\0", b"\0" * 4, b"1e308", chance.randbytes(3)]
        )
        if change == "flip" and place < len(data):
            data[place] ^= 1 << chance.randrange(8)
        elif change == "cut" and chance.random() < 0.2:
            del data[place:]
        elif change == "remove":
            del data[place : place + chance.randint(1, 8)]
        elif change == "double":
            data[place:place] = data[place : place + chance.randint(1, 400)] * chance.choice([1, 1, 50])
        elif change in ("replace", "insert"):
            data[place : place + (len(new) if change == "replace" else 0)] = new
    return bytes(data)


def fuzz(minutes: float, seed: int) -> bool:
    """Read mutated files for some minutes, print the outcome, and return whether nothing went wrong."""
    _be_a_server()
    chance, valid, end = random.Random(seed), valid_files(), time.monotonic() + 60 * minutes
    counts: Counter[str] = Counter()
    faults: list[str] = []
    slowest = largest = None
    while time.monotonic() < end:
        kind = chance.choice(list(valid))
        reader = chance.choice(["disparity", "disparity ÷ 4"]) if kind == "disparity" else kind
        one = measured(f"seed {seed}, file {sum(counts.values())}", reader, mutated(chance.choice(valid[kind]), chance))
        counts[f"{kind}: {'read' if one.answer.startswith('read') else 'refused'}"] += 1
        slowest = one if slowest is None or one.waited_s > slowest.waited_s else slowest
        largest = one if largest is None or one.extra_mb > largest.extra_mb else largest
        if one.fault:
            faults.append(
                f"{one.name}, {reader}: {one.fault}, {one.waited_s:.1f} s, {one.extra_mb:.0f} MB, {one.answer}"
            )
    print(f"{sum(counts.values()):,} mutated files, seed {seed}, {minutes:g} minutes")
    for name, count in sorted(counts.items()):
        print(f"  {name}: {count:,}")
    if slowest and largest:
        print(f"slowest: {slowest.waited_s:.2f} s ({slowest.name})")
        print(f"most memory: {largest.extra_mb:.0f} MB ({largest.name})")
    print(f"{len(faults)} faults", *faults[:50], sep="\n  ")
    return not faults


def main() -> None:
    """Print the table, or fuzz."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hostile", description=__doc__)
    parser.add_argument("--only", default="", help="a pattern of the names of the files")
    parser.add_argument("--fuzz", type=float, metavar="MINUTES", help="mutate valid files for so long instead")
    parser.add_argument("--seed", type=int, default=0, help="where fuzzing begins")
    options = parser.parse_args()
    if options.fuzz is not None:
        sys.exit(not fuzz(options.fuzz, options.seed))
    table, figures = hostile_table(options.only)
    print(table)
    sys.exit(any(row["fault"] for row in figures))


if __name__ == "__main__":
    main()
