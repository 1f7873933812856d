"""What hostile files cost: time, memory and answer of every one; and a search for worse ones by mutation."""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "core"))

from hostile_cases import READ, READERS, HostileFile
from hostile_files import hostile_files, valid_files
from measured_reading import Reading, answer_of, in_own_process, measured

from benchmarks.memory import peak_mb, reset_peak, resident_mb

MOST_SECONDS = 5.0
MOST_MB = 500.0
LARGE_COLOUR = re.compile("16-bit RGB|16 bits, colour|40 megapixels, 16 bits")
MOST_MB_OF_LARGE_COLOUR = 800.0
BATCH = 400
"""Files per process, so that a crash loses no more than these."""


def rows(files: Iterable[HostileFile]) -> list[tuple[Reading, str]]:
    """Return the reading of every file with its fault, empty if there is none."""
    found = []
    for file in files:
        reading = measured(file)
        found.append((reading, wrong(reading, file.answer)))
    return found


def wrong(reading: Reading, answer: str) -> str:
    """Return the fault of a reading, or an empty string."""
    allowed = MOST_MB_OF_LARGE_COLOUR if LARGE_COLOUR.search(reading.name) else MOST_MB
    if reading.fault:
        return "fault"
    if reading.seconds > MOST_SECONDS:
        return "slow"
    if reading.extra_mb > allowed:
        return "large"
    was_read = reading.answer.startswith("read")
    if answer == READ:
        return "" if was_read else "refused"
    if answer and (was_read or not re.search(answer, reading.answer)):
        return "another answer"
    return ""


def hostile_table(pattern: str = "") -> tuple[str, list[dict[str, object]]]:
    """Return the table as Markdown and its rows."""
    files = [file for name, file in hostile_files().items() if re.search(pattern, name)]
    lines = ["| file | reader | MB | s | extra MB | answer | |", "|---|---|---|---|---|---|---|"]
    figures: list[dict[str, object]] = []
    for reading, verdict in rows(files):
        answer = reading.answer.replace("|", "/")
        lines.append(
            f"| {reading.name} | {reading.reader} | {reading.file_mb:.3g} | {reading.seconds:.2f} |"
            f" {reading.extra_mb:.0f} | {answer} | {verdict} |"
        )
        figures.append(asdict(reading) | {"wrong": verdict})
    worst = max(figures, key=lambda row: float(str(row["seconds"])), default={})
    largest = max(figures, key=lambda row: float(str(row["extra_mb"])), default={})
    lines.append(
        f"\n{len(figures)} files, {sum(bool(row['wrong']) for row in figures)} with a fault. Slowest: "
        f"{worst.get('name')}; most memory: {largest.get('name')}."
    )
    return "\n".join(lines), figures


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


def fuzz_batch(seed: int) -> dict[str, object]:
    """Return the outcome of a batch of mutated files."""
    chance, valid = random.Random(seed), valid_files()
    counts: Counter[str] = Counter()
    faults: list[str] = []
    slowest, largest = (0.0, ""), (0.0, "")
    for number in range(BATCH):
        kind = chance.choice(list(valid))
        reader = chance.choice(["disparity", "disparity ÷ 4"]) if kind == "disparity" else kind
        data = mutated(chance.choice(valid[kind]), chance)
        before = resident_mb()
        reset_peak()
        start = time.perf_counter()
        answer, fault = answer_of(READERS[reader], data)
        seconds, extra = time.perf_counter() - start, peak_mb() - before
        counts[f"{kind}: {'read' if answer.startswith('read') else 'refused'}"] += 1
        slowest = max(slowest, (seconds, f"seed {seed}, file {number}, {reader}"))
        largest = max(largest, (extra, f"seed {seed}, file {number}, {reader}"))
        if fault or seconds > MOST_SECONDS or extra > MOST_MB:
            faults.append(f"seed {seed}, file {number}, {reader}: {seconds:.1f} s, {extra:.0f} MB, {answer[:300]}")
    return {"counts": dict(counts), "faults": faults, "slowest": slowest, "largest": largest}


def fuzz(minutes: float, seed: int) -> bool:
    """Mutate files for some minutes, print the outcome, and return whether nothing went wrong."""
    end, first = time.monotonic() + 60 * minutes, seed
    counts: Counter[str] = Counter()
    faults: list[str] = []
    slowest, largest = (0.0, ""), (0.0, "")
    while time.monotonic() < end:
        answer = in_own_process(lambda batch=seed: json.dumps(fuzz_batch(batch)))  # type: ignore[misc]
        if answer is None:
            faults.append(f"seed {seed}: the process died or did not end")
        else:
            batch = json.loads(answer)
            counts.update(batch["counts"])
            faults += batch["faults"]
            slowest, largest = max(slowest, tuple(batch["slowest"])), max(largest, tuple(batch["largest"]))
        seed += 1
    print(f"{sum(counts.values()):,} mutated files, seeds {first} to {seed - 1}, {minutes:g} minutes")
    for name, count in sorted(counts.items()):
        print(f"  {name}: {count:,}")
    print(f"slowest: {slowest[0]:.2f} s ({slowest[1]}); most memory: {largest[0]:.0f} MB ({largest[1]})")
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
    sys.exit(any(row["wrong"] for row in figures))


if __name__ == "__main__":
    main()
