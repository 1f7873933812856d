"""``stereolag lag``: how much later the second of two recordings hears it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import stereolag as sl
from stereolag.commands.flags import SettingsFlags
from stereolag.commands.parsing import DONE, CommandParser, add_output, read, tell
from stereolag.searches import LagSearch

if TYPE_CHECKING:
    from stereolag.arrays import Vector
    from stereolag.reading import Recording


def run(arguments: Sequence[str]) -> int:
    """Measure the lag that the arguments ask for, print it, and return the code to exit with."""
    parser = CommandParser(
        "lag",
        "Tell by how many samples the second recording lags behind the first: positive where it hears the event later. "
        "Recordings are WAV, FLAC, OGG, MP3, AIFF, NPY or columns of numbers; one file with two channels is enough. "
        "The sampling rate is that of the files, if they state one and no other is given.",
        "FIRST [SECOND] [--speed M/S] [--method NAME] [--json] [further settings]",
    )
    parser.add_argument("first", metavar="FIRST", help="the first recording, or one of both channels")
    parser.add_argument("second", metavar="SECOND", nargs="?", help="the second recording")
    parser.add_argument("--channels", type=int, nargs=2, metavar=("A", "B"), help="which channel of each, from 1")
    add_output(parser)
    flags = SettingsFlags(parser, LagSearch())
    options, settings = flags.parsed(arguments)

    from stereolag.export import lag_figures

    first = read(sl.read_signal, options.first)
    second = first if options.second is None else read(sl.read_signal, options.second)
    numbers = options.channels or (1, 2 if options.second is None else 1)
    signals = [
        _channel(one, number, name)
        for one, number, name in zip((first, second), numbers, (options.first, options.second), strict=True)
    ]
    if "sampling_rate" not in vars(options):
        settings = settings.model_copy(update={"sampling_rate": _common_rate(first, second) or settings.sampling_rate})
    result = sl.signal_lag(*signals, **settings.model_dump(), seed=0)
    tell(lag_figures(result, settings), _in_words(result, settings), as_json=options.json)
    return DONE


def _channel(recording: Recording, number: int, name: str | None) -> Vector:
    """Return a channel, counted from 1; ValueError where there is none, or nothing to compare in it."""
    from stereolag.inputs import as_signal

    count = len(recording.channels)
    if not 1 <= number <= count:
        raise ValueError(
            f"channel {number} is asked for, and {name or 'the recording'} has {count}: give a second recording, or "
            "other --channels."
        )
    return as_signal(recording.channels[number - 1], name or "the second channel")


def _common_rate(first: Recording, second: Recording) -> float | None:
    """Return the sampling rate that the files state, None where they state none; ValueError where they differ."""
    rates = {one.sampling_rate for one in (first, second)} - {None}
    if len(rates) > 1:
        raise ValueError(
            f"The recordings have {first.sampling_rate:g} and {second.sampling_rate:g} samples a second; both must "
            "have the same sampling rate."
        )
    return next(iter(rates), None)


_REASONS = {
    "clear": "a clear peak",
    "drift": "a clear peak that drifts",
    "repeats": "it repeats",
    "rivals": "other lags fit as well",
    "chance": "the highest point is what chance gives",
    "too_little": "too few samples stand out",
    "few_votes": "hardly two samples vote for the same lag",
    "opposite_sign": "the opposite sign fits: one microphone is reversed",
}


def _in_words(result: sl.SignalLag, settings: LagSearch) -> str:
    score = f"score     {result.score:.3f}, {settings.method} in {result.elapsed_s:.3g} s"
    judgement = result.judgement
    if judgement is None or judgement.verdict == "sure":
        lines = [
            f"lag       {result.lag} samples ({result.lag_subsample:.2f} with its fraction)",
            f"time      {result.time_s:.6g} s at {settings.sampling_rate:g} samples a second",
            f"distance  {result.distance_m:.6g} m of path at {settings.speed:g} m/s",
            score,
        ]
    else:
        lines = [f"highest   at {result.lag} samples: no lag to rely on", score]
        if judgement.rivals:
            lines.append("as good   " + ", ".join(map(str, judgement.rivals)))
        if judgement.opposite_lag is not None:
            lines.append(f"opposite  {judgement.opposite_lag} samples, with the sign of one recording turned")
    if judgement is not None:
        lines.append(f"verdict   {judgement.verdict}: {_REASONS[judgement.reason]}")
        if judgement.drift is not None:
            drift = judgement.drift
            lines.append(
                f"drift     {drift.ppm:+.2f} ppm, ± {drift.error_ppm:.1g}; ± {drift.spread:.2g} samples a block"
            )
    return "\n".join(lines)
