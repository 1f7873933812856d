"""Sentences on a visitor's own recordings, and on the size limits of their files."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from stereolag.core.jobs import limits
from stereolag.core.searches import LagSearch
from stereolag.io.recordings import Recording


def own_facts(recordings: Sequence[Recording], channels: Sequence[int], counts: Sequence[int]) -> str:
    """Return one line of facts for each recording, as Markdown.

    Parameters
    ----------
    recordings
        One channel each, at a common rate if their files state any.
    channels, counts
        Number of each channel in its file, from 1, and how many channels the file has.
    """
    stated = next((one.sampling_rate for one in recordings if one.sampling_rate), None)
    lines = [
        f"Sensor {number}: " + ", ".join(_facts(one, channel, count, stated)) + "."
        for number, (one, channel, count) in enumerate(zip(recordings, channels, counts, strict=True), start=1)
    ]
    return "  \n".join(lines)


def _facts(recording: Recording, channel: int, count: int, stated: float | None) -> list[str]:
    samples, rate = recording.channels.shape[1], recording.sampling_rate
    facts = [f"{samples:,} samples"]
    if rate:
        facts = [f"{samples / rate:,.4g} s", *facts, f"{rate:,.10g} Hz"]
    if recording.resampled_from:
        facts.append(f"resampled from {recording.resampled_from:,.10g} Hz")
    if not rate and stated:
        facts.append(f"no rate in the file: {stated:,.10g} Hz assumed, as in the other")
    elif not rate:
        default = LagSearch().sampling_rate
        facts.append(f"no rate in the file: {default:,.10g} Hz assumed unless set below")
    if count > 1:
        facts.append(f"channel {channel} of {count}")
    if recording.mended_lines:
        facts.append(f"{recording.mended_lines} damaged line{'s' * (recording.mended_lines > 1)} mended")
    return facts


def upload_limits() -> str:
    """Return how large a file may be."""
    samples, rate = limits().max_samples, LagSearch().sampling_rate
    return (
        f"At most {st.get_option('server.maxUploadSize')} MB and {samples / 1e6:,.0f} million samples per file, over "
        f"all channels: {samples / rate / 60:,.0f} minutes of one channel at {rate:,.10g} Hz."
    )
