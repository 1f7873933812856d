"""``stereolag lag``: the lag between two recordings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stereolag as sl
from stereolag.commands.arguments import DONE, DOUBTFUL, CommandParser, SettingsFlags, print_result, read
from stereolag.core.searches import LagSearch

if TYPE_CHECKING:
    from stereolag.io.clocks import Recording


def run(arguments: Sequence[str]) -> int:
    """Measure the lag that the arguments ask for, print it, and return the exit code."""
    from stereolag.io.formats import ACCEPTED

    parser = CommandParser(
        "lag",
        "Measure how many samples the second recording lags behind the first: positive where it hears the event later. "
        f"Recordings are {ACCEPTED}; one file with two channels is enough. Times in a column give rate and gaps. "
        "The sampling rate is that of the files, unless they state none or another is given; of two rates, the lower.",
        "FIRST [SECOND] [--speed M/S] [--method NAME] [--aligned FILE] [--json] [further settings]",
        f"; {DOUBTFUL} done, but the lag is not sure, or both recordings are one signal",
    )
    parser.add_argument("first", metavar="FIRST", help="the first recording, or one of both channels")
    parser.add_argument("second", metavar="SECOND", nargs="?", help="the second recording")
    parser.add_argument("--channels", type=int, nargs=2, metavar=("A", "B"), help="which channel of each, from 1")
    parser.add_argument(
        "--tracks",
        nargs=2,
        metavar=("A", "B"),
        default=("1", "1"),
        help="which audio track of each, or array of an NPZ or MAT file: its number, from 1, or its name",
    )
    parser.add_argument(
        "--aligned",
        type=Path,
        metavar="FILE",
        help="write the second recording on the clock of the first: WAV or CSV, lag, drift and steps undone",
    )
    options, settings = SettingsFlags(parser, LagSearch()).parsed(arguments)
    if options.aligned and options.aligned.suffix.lower() not in (".wav", ".csv"):
        parser.error(f"--aligned is {options.aligned}; its name ends in .wav or .csv.")

    from stereolag.core.inputs import checked_signal
    from stereolag.io.clocks import at_one_rate, duplicate_warning, start_difference_s
    from stereolag.io.results import lag_figures

    names = options.first, options.second or options.first
    first = second = read(sl.read_signal, names[0], track=options.tracks[0])
    if options.second is not None or options.tracks[0] != options.tracks[1]:
        second = read(sl.read_signal, names[1], track=options.tracks[1])
    numbers = options.channels or (first.numbers[0], (*second.numbers, 2)[second is first])
    channels = _channel(first, numbers[0], names[0]), _channel(second, numbers[1], names[1])
    apart = start_difference_s(*channels)
    assumed = {"speed", "sampling_rate"} - vars(options).keys()
    if "sampling_rate" in assumed:
        channels = at_one_rate(*channels)
        stated = next((one.sampling_rate for one in channels if one.sampling_rate), None)
        if stated:
            assumed -= {"sampling_rate"}
            settings = settings.model_copy(update={"sampling_rate": stated})
    facts = [
        _facts(one, name, number, count, settings.sampling_rate)
        for one, name, number, count in zip(
            channels, names, numbers, (first.highest_channel, second.highest_channel), strict=True
        )
    ]
    one, other = (checked_signal(one.channels[0], name) for one, name in zip(channels, names, strict=True))
    result = sl.signal_lag(one, other, **settings.model_dump(), seed=0)
    doubt = duplicate_warning(*channels)
    figures = lag_figures(result, settings, assumed)
    figures |= {"recordings": facts, "starts_apart_s": apart, "doubts": [doubt] if doubt else []}
    words = _in_words(result, settings, facts, assumed) + (f"\ndoubtful: {doubt}" if doubt else "")
    clocks = f"\nBy their own clocks, the second recording begins {apart:+.6g} s after the first." if apart else ""
    print_result(figures, words + clocks, as_json=options.json)
    if options.aligned:
        from stereolag.io.recordings import write_aligned

        write_aligned(options.aligned, options.aligned.suffix.lower(), one, other, result, settings.sampling_rate)
    return DOUBTFUL if doubt or result.verdict != "sure" else DONE


def _channel(recording: Recording, number: int, name: str) -> Recording:
    """Return a channel, counted from 1; ValueError if there is no such channel."""
    from stereolag.io.clocks import channel_list

    if number not in recording.numbers:
        raise ValueError(
            f"channel {number} is asked for, and {name} has {channel_list(recording.numbers)}: give a second "
            "recording, or other --channels."
        )
    return recording.channel(number)


def _facts(recording: Recording, name: str, number: int, count: int, rate: float) -> dict[str, Any]:
    """Return the facts about one of `count` channels of a recording, at the common `rate`."""
    samples = recording.channels.shape[1]
    return {
        "file": name,
        "channel": number,
        "channels": count,
        "samples": samples,
        "duration_s": samples / rate,
        "sampling_rate_in_file": recording.resampled_from or recording.sampling_rate,
        "resampled": recording.resampled_from is not None,
        "mended_lines": recording.mended_lines,
        "track": recording.tracks[recording.track - 1],
        "start_s": recording.start_s,
        "start": recording.start and recording.start.isoformat(),
        "gaps": [[gap.start_s, gap.length_s] for gap in recording.gaps],
        "remarks": recording.remarks,
    }


def _fact_line(facts: dict[str, Any], rate: float) -> str:
    parts = [f"{facts['duration_s']:.6g} s, {facts['samples']} samples at {rate:g} Hz"]
    if facts["channels"] > 1:
        parts.append(f"channel {facts['channel']} of {facts['channels']}")
    if facts["resampled"]:
        parts.append(f"resampled from {facts['sampling_rate_in_file']:g} Hz")
    if facts["sampling_rate_in_file"] is None:
        parts.append("rate assumed, the file states none")
    return f"{facts['file']}: {', '.join([*parts, *facts['remarks']])}"


_REASONS = {
    "clear": "a clear peak",
    "drift": "a clear peak once the drift of the clocks is undone",
    "steps": "a clear peak once the steps are undone",
    "repeats": "it repeats",
    "rivals": "other lags fit as well",
    "chance": "the highest point is at chance level",
    "one_lag": "only a lag of 0 was searched, and the recordings do not agree there",
    "too_little": "so few samples agree that chance could line them up",
    "few_votes": "hardly two samples vote for the same lag",
    "opposite_sign": "the opposite sign fits: one microphone is reversed",
}


def _in_words(result: sl.SignalLag, settings: LagSearch, facts: list[dict[str, Any]], assumed: Collection[str]) -> str:
    from stereolag.io.results import over_time_in_words

    def at(name: str, value: str) -> str:
        return f"{value}, assumed" if name in assumed else value

    rate = settings.sampling_rate
    score = f"score     {result.score:.3f}, {settings.method} in {result.elapsed_s:.3g} s"
    judgement, over_time = result.judgement, result.over_time
    if judgement.verdict == "sure":
        lines = [
            f"lag       {result.lag} samples ({round(result.lag_subsample, 2) + 0.0:.2f} with its fraction)",
            f"time      {result.time_s:.6g} s at {at('sampling_rate', f'{rate:g} samples a second')}",
        ]
        if over_time is None or not over_time.changes:
            speed = at("speed", f"{settings.speed:g} m/s")
            lines.append(f"distance  {result.distance_m:.6g} m of path at {speed}")
        lines.append(score)
    else:
        lines = [f"highest   at {result.lag} samples: no lag to rely on", score]
        if judgement.rivals:
            lines.append("as good   " + ", ".join(map(str, judgement.rivals)))
        if judgement.opposite_lag is not None:
            lines.append(f"opposite  {judgement.opposite_lag} samples, with the sign of one recording reversed")
    unsearched = judgement.reason in ("chance", "too_little") and result.max_lag
    limit = f"; only lags within ±{result.max_lag} were searched" if unsearched else ""
    lines.append(f"verdict   {judgement.verdict}: {_REASONS[judgement.reason]}{limit}")
    if result.begins_again_at is not None:
        lines.append(f"values    wrap around every {result.begins_again_at:.4g}: their steps were compared")
    if over_time is not None:
        steady = f"clocks    {over_time.ppm:+.2f} ppm, ± {over_time.error_ppm:.1g}: no drift"
        changes = f"over time {over_time_in_words(over_time, rate)}" if over_time.changes else steady
        lines += [changes, f"doubt     ± {over_time.spread:.2g} samples, over {over_time.blocks} blocks"]
    if len(result.arrivals) > 1:
        lines.append("arrivals  " + ", ".join(f"{round(one.lag)} ({one.sigma:.1f} σ)" for one in result.arrivals))
    return "\n".join([*lines, *(_fact_line(each, rate) for each in facts)])
