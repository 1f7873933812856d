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

MAX_SERVER_CPU_S = 5.0
"""Processor time of the server for one file."""
MAX_WAIT_S = WALL_CLOCK_FACTOR * MAX_CPU_S + 1
"""Elapsed time for one file on a busy machine, with that to end a worker; on an idle one `MAX_CPU_S`."""
MAX_EXTRA_MB = 500.0
"""Rise of the server's memory for one file."""


@dataclass(frozen=True)
class Reading:
    """Cost and outcome of reading one file.

    Attributes
    ----------
    name, reader
        The file's name and the name of its reader.
    file_mb, waited_s, seconds, extra_mb
        The file's size, the elapsed time, the server's processor time, and the rise of its memory above the level with
        the file loaded.
    answer
        "read" and the shape of the result, or the sentence that refuses the file.
    fault
        The fault of the reader, "" if there is none.
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
    """Return the cost and outcome of reading a file through the guard."""
    before = resident_mb()
    reset_peak()
    start, processor = time.perf_counter(), time.process_time()
    try:
        content = guarded(READERS[reader])(data)
        array = getattr(content, "channels", content)
        answer = f"read {getattr(array, 'shape', '')} {getattr(array, 'dtype', '')}".strip()
    except ValueError as error:
        answer = str(error)
    except Exception as error:
        answer = f"failed: {error}"
    waited, seconds, extra = time.perf_counter() - start, time.process_time() - processor, peak_mb() - before
    fault = "slow" if waited > MAX_WAIT_S or seconds > MAX_SERVER_CPU_S else "large" if extra > MAX_EXTRA_MB else ""
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
    _start_server()
    lines = [
        "| file | reader | MB | waited, s | server, s | server, MB | answer | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    readings = []
    for file in hostile_files().values():
        if re.search(pattern, file.name):
            reading = measured(file.name, file.reader, file.make(), file.answer)
            readings.append(reading)
            lines.append(
                f"| {reading.name} | {reading.reader} | {reading.file_mb:.3g} | {reading.waited_s:.2f} |"
                f" {reading.seconds:.2f} | {reading.extra_mb:.0f} | {reading.answer.replace('|', '/')} |"
                f" {reading.fault} |"
            )
    slowest = max(readings, key=lambda reading: reading.waited_s)
    largest = max(readings, key=lambda reading: reading.extra_mb)
    faults = sum(bool(reading.fault) for reading in readings)
    lines.append(
        f"\n{len(readings)} files, {faults} with a fault. Slowest: {slowest.name}, "
        f"{slowest.waited_s:.1f} s; most memory: {largest.name}, {largest.extra_mb:.0f} MB."
    )
    return "\n".join(lines), [asdict(reading) for reading in readings]


def _start_server() -> None:
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
    """Read mutated files for some minutes, print the outcome, and return whether there were no faults."""
    _start_server()
    chance, valid, end = random.Random(seed), valid_files(), time.monotonic() + 60 * minutes
    counts: Counter[str] = Counter()
    faults: list[str] = []
    slowest = largest = None
    while time.monotonic() < end:
        kind = chance.choice(list(valid))
        reader = chance.choice(["disparity", "disparity ÷ 4"]) if kind == "disparity" else kind
        name = f"seed {seed}, file {sum(counts.values())}"
        reading = measured(name, reader, mutated(chance.choice(valid[kind]), chance))
        counts[f"{kind}: {'read' if reading.answer.startswith('read') else 'refused'}"] += 1
        slowest = reading if slowest is None or reading.waited_s > slowest.waited_s else slowest
        largest = reading if largest is None or reading.extra_mb > largest.extra_mb else largest
        if reading.fault:
            cost = f"{reading.waited_s:.1f} s, {reading.extra_mb:.0f} MB"
            faults.append(f"{name}, {reader}: {reading.fault}, {cost}, {reading.answer}")
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
    parser.add_argument("--only", default="", help="a regular expression for the names of the files")
    parser.add_argument(
        "--fuzz", type=float, metavar="MINUTES", help="read mutations of valid files for this long instead"
    )
    parser.add_argument("--seed", type=int, default=0, help="the seed of the mutations")
    options = parser.parse_args()
    if options.fuzz is not None:
        sys.exit(not fuzz(options.fuzz, options.seed))
    table, figures = hostile_table(options.only)
    print(table)
    sys.exit(any(row["fault"] for row in figures))


if __name__ == "__main__":
    main()
