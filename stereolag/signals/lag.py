"""The lag between two recordings of one event."""

from __future__ import annotations

import math
import operator
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from numbers import Real
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array, Vector
from stereolag.core.inputs import check_positive, checked_signal
from stereolag.core.jobs import COSTS, Estimate, Progress, Pulse, check_memory, silent
from stereolag.core.searches import SignalMethod
from stereolag.core.showing import Shown
from stereolag.signals.correlation import (
    SHORTEST_BLOCK,
    block_curve,
    block_length,
    direct_curve,
    fft_curve,
    overlap_length,
    overlap_pearson,
    phat_curve,
    transform_length,
)
from stereolag.signals.over_time import LagOverTime, Step
from stereolag.signals.peaks import main_lobe, peak_ratio
from stereolag.signals.recordings import ConvertedRecording, HeldRecording, Recording
from stereolag.signals.search import (
    REFINED_REACH,
    FoundLag,
    cell_size,
    lags_within,
    search_bands,
    search_curve,
    search_votes,
)
from stereolag.signals.verdict import Arrival, LagJudgement, Verdict, judge, judged_samples


def common_rate(signal_1: object, signal_2: object, given: float | None) -> float:
    """Return the sampling rate of both recordings, samples per second.

    Parameters
    ----------
    signal_1, signal_2
        Arrays, or recordings with a `sampling_rate` of their own, which may be None.
    given
        The requested rate; None: the rate of the recordings, or 44,100 if neither has one.

    Raises
    ------
    ValueError
        A rate that is not positive and finite, two recordings with different rates, or a given rate that differs from a
        recording's.
    """
    if given is not None:
        check_positive(given, "sampling_rate", "samples per second")
    named = (("signal_1", signal_1), ("signal_2", signal_2))
    own = {name: rate for name, signal in named if (rate := _own_rate(signal)) is not None}
    if len(set(own.values())) > 1:
        raise ValueError(
            f"signal_1 has {own['signal_1']:,.10g} Hz and signal_2 {own['signal_2']:,.10g} Hz; a lag is measured at "
            "one rate: resample one of them (`Recording.resampled`)."
        )
    for name, rate in own.items():
        check_positive(rate, f"the sampling_rate of {name}", "samples per second")
        if given is not None and rate != given:
            raise ValueError(
                f"sampling_rate is {given:,.10g} Hz and {name} has {rate:,.10g} Hz; leave sampling_rate out, or give "
                "the samples alone (`channels[0]`)."
            )
    return float(given) if given is not None else next(iter(own.values()), 44_100.0)


def _own_rate(signal: object) -> float | None:
    rate = getattr(signal, "sampling_rate", None)
    return float(rate) if isinstance(rate, Real) else None


MAX_WHOLE_LENGTH = 2**23
"""Samples; longest recording that is always transformed as a whole: three minutes at 44.1 kHz, 1.2 GB."""


def estimate_lag(size_1: int, size_2: int, *, method: SignalMethod = "fft", max_lag: int | None = None) -> Estimate:
    """Return the memory and time that :func:`stereolag.signals.signal_lag` needs.

    "fft" takes one block of each recording at a time if `max_lag` is small against them, and a few bands of both for
    recordings above ``MAX_WHOLE_LENGTH`` samples. Otherwise both recordings are kept as float64, with the arrays listed
    in the method's row of :data:`stereolag.core.jobs.COSTS`.

    Parameters
    ----------
    size_1, size_2
        Samples of the recordings, 2 or more.
    method, max_lag
        As for :func:`~stereolag.signals.signal_lag`.
    """
    total, longest, shortest = size_1 + size_2, max(size_1, size_2), min(size_1, size_2)
    reach = longest - 1 if max_lag is None else max_lag
    first, last = lags_within((size_1, size_2), reach)
    lags = last - first + 1
    chosen = algorithm(size_1, size_2, method, reach)
    judged = judged_samples(size_1, size_2, held=chosen == "whole")
    if chosen == "blocks":
        return _estimate_blocks(size_1, size_2, lags, judged)
    if chosen == "bands":
        step = cell_size(size_1, size_2)
        points, around = total // step, _estimate_blocks(SHORTEST_BLOCK, SHORTEST_BLOCK, 16 * REFINED_REACH, 0)
        return COSTS["lag by bands"].estimate(
            samples=total,
            longest=longest,
            points=points,
            turns=step // 2 * points * math.log2(points),
            cells=lags // step + 2,
            blocks=around.memory,
            judged=judged,
        )
    points = transform_length(longest)
    sorted_or_transformed = longest if method == "sampled" else points
    row = {"sampled": "lag by votes", "direct": "lag by products"}.get(method, "lag by fft")
    return COSTS[row].estimate(
        samples=total,
        longest=longest,
        shortest=shortest,
        lags=lags,
        ties=min(lags, longest),
        points=points,
        turns=sorted_or_transformed * math.log2(sorted_or_transformed),
        products=product_count(size_1, size_2, reach),
        judged=judged,
    )


def algorithm(size_1: int, size_2: int, method: SignalMethod, reach: int) -> Literal["whole", "blocks", "bands"]:
    """Return how recordings of these sizes are searched, for lags up to `reach` both ways."""
    longest = max(size_1, size_2)
    if method != "fft":
        return "whole"
    first, last = lags_within((size_1, size_2), reach)
    # Blocks take less memory and time than one transform of a recording at least four times as long.
    if 4 * block_length(last - first + 1) <= longest:
        return "blocks"
    return "whole" if longest <= MAX_WHOLE_LENGTH else "bands"


def _estimate_blocks(size_1: int, size_2: int, lags: int, judged: int) -> Estimate:
    points = block_length(lags)
    blocks = -(-min(size_1, size_2) // (points - lags + 1))
    return COSTS["lag by blocks"].estimate(
        samples=size_1 + size_2,
        longest=max(size_1, size_2),
        points=points,
        turns=blocks * points * math.log2(points),
        judged=judged,
    )


def product_count(size_1: int, size_2: int, reach: int) -> int:
    """Return the number of sample pairs that overlap, over all lags up to `reach` both ways."""

    def of_one_sign(first: int, second: int) -> int:
        """Sum ``min(first, second - lag)`` over the lags from 0 on."""
        count = min(reach, second - 1) + 1
        whole = min(count, max(0, second - first + 1))
        rest = count - whole
        return whole * first + rest * second - (whole + count - 1) * rest // 2

    return of_one_sign(size_1, size_2) + of_one_sign(size_2, size_1) - min(size_1, size_2)


_SEARCH_SHARE = 0.8
"""Share of the time that the search of long recordings takes; the judgement takes the rest."""


@dataclass(frozen=True, eq=False)
class SignalLag(Shown):
    """The lag of `signal_2` behind `signal_1`, and how reliable it is.

    The lag is the one with the most evidence, whatever curve the method shows; with drift, that in the middle of the
    longest stretch. "direct" and "sampled" always return the lag that they find themselves, "fft" and "phat" if it is
    obvious.

    Attributes
    ----------
    lags, correlation
        (N,) int64 and float64: the lags searched and the curve that peaks at `lag`. None for "sampled". If every lag of
        long recordings was searched ("fft", see :func:`signal_lag`), both are reduced to one point per stretch of lags:
        where the curve may be highest, and its height there. Within 4,096 samples of the peak and its rivals the
        heights are measured; elsewhere they are an upper bound, never above the peak.
    votes
        Votes per lag, the winner first; "sampled" only, otherwise None.
    elapsed_s
        Duration of the search, without input checks and judgement, seconds.
    sampling_rate, speed
        As given to :func:`signal_lag`, or taken from the recordings.
    max_lag
        Largest lag searched, samples; None if every lag was.
    begins_again_at
        The number at which the values of both recordings wrap around, as headings do at 360: their steps were
        correlated. None if they do not, and for "sampled".

    Examples
    --------
    A tone with a period of 50 samples fits equally well one period later:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> tone = np.sin(2 * np.pi * np.arange(1000) / 50)
    >>> result = sl.signal_lag(tone, tone)
    >>> result.lag, result.verdict, result.rivals[:2]  # samples
    (0, 'ambiguous', (-50, 50))
    """

    lags: npt.NDArray[np.int64] | None
    correlation: npt.NDArray[np.float64] | None
    votes: dict[int, int] | None
    elapsed_s: float
    sampling_rate: float
    speed: float
    max_lag: int | None
    begins_again_at: float | None
    _found: FoundLag = field(repr=False)
    _score: float = field(repr=False)
    _fixed: bool = field(repr=False)
    _recordings: tuple[Recording, Recording] | None = field(repr=False)

    @cached_property
    def _decided(self) -> tuple[LagJudgement, float]:
        """The judgement, and Pearson's correlation at its lag; the recordings are released."""
        assert self._recordings is not None
        reach = _checked_reach(self.max_lag, max(recording.size for recording in self._recordings))
        judgement = judge(self._recordings, self._found, reach, fixed=self._fixed)
        lag = self._found.rounded(judgement.lag)
        score = self._score if lag == self._found.lag else overlap_pearson(*self._recordings, lag)
        object.__setattr__(self, "_recordings", None)
        return judgement, score

    @property
    def judgement(self) -> LagJudgement:
        """Whether the lag is reliable, and why; read by `verdict`, `rivals` and the properties below.

        Computed on first access; until then the result keeps the recordings in memory. Computed at once for long
        recordings, and if :func:`signal_lag` is given a `progress`.
        """
        return self._decided[0]

    @property
    def lag_subsample(self) -> float:
        """The lag including its fraction, samples."""
        return self._found.lag + self._found.fraction if self._fixed else self.judgement.lag

    @property
    def lag(self) -> int:
        """Samples; positive if signal 2 records the event later."""
        return self._found.rounded(self.lag_subsample)

    @property
    def time_s(self) -> float:
        """``lag / sampling_rate``, seconds, signed as `lag`."""
        return self.lag / self.sampling_rate

    @property
    def distance_m(self) -> float:
        """``abs(time_s) * speed``, metres."""
        return abs(self.time_s) * self.speed

    @property
    def score(self) -> float:
        """Pearson's correlation of the samples that overlap at `lag`, -1..1."""
        return self._score if self._fixed else self._decided[1]

    @property
    def peak_ratio(self) -> float:
        """Height of the curve at `lag` over its highest value outside the main lobe there.

        For "sampled" the votes for the lag over those for the runner-up. Infinite if there is no rival, NaN if nothing
        outside the main lobe was searched or the peak is not positive.
        """
        if self.lags is None or self.correlation is None or self.lag == self._found.lag:
            return self._found.peak_ratio
        place = min(int(np.searchsorted(self.lags, self.lag)), self.lags.size - 1)
        return float(peak_ratio(self.correlation, place))

    @property
    def ties(self) -> int:
        """Number of equally good lags, including this one: more than 1 for periodic recordings."""
        return self._found.ties if self.lag == self._found.lag else 1

    @property
    def verdict(self) -> Verdict:
        """``"sure"``, ``"ambiguous"`` (see `rivals`), or ``"nothing"``: no better than chance."""
        return self.judgement.verdict

    @property
    def rivals(self) -> tuple[int, ...]:
        """Lags as good as this one, samples, nearest first."""
        return self.judgement.rivals

    @property
    def arrivals(self) -> tuple[Arrival, ...]:
        """All lags found beyond chance, the one with the most evidence first: the direct sound and its echoes."""
        return self.judgement.arrivals

    @property
    def inverted(self) -> bool:
        """Whether one recording fits better with its sign inverted, as from a microphone with reversed polarity."""
        return self.judgement.opposite_lag is not None

    @property
    def over_time(self) -> LagOverTime | None:
        """The lag over time; None if it cannot be measured or the verdict is not "sure"."""
        return self.judgement.over_time

    @property
    def drift_ppm(self) -> float:
        """Growth of the lag in samples per million samples; NaN if it cannot be measured."""
        return self.over_time.ppm if self.over_time else float("nan")

    @property
    def steps(self) -> tuple[Step, ...]:
        """The jumps of the lag in order of time, where samples are missing in one of the recordings."""
        return self.over_time.steps if self.over_time else ()

    @property
    def uncertainty(self) -> float:
        """Standard deviation of the lag over blocks of the recordings, samples; NaN if it cannot be measured."""
        return self.over_time.spread if self.over_time else float("nan")

    def lag_at(self, seconds: float) -> float:
        """Return the lag at a time of recording 1, samples; `lag_subsample` if it does not change."""
        if self.over_time is None or not self.over_time.changes:
            return self.lag_subsample
        return self.over_time.lag_at(seconds * self.sampling_rate)


def signal_lag(
    signal_1: npt.ArrayLike,
    signal_2: npt.ArrayLike,
    *,
    sampling_rate: float | None = None,
    speed: float = 333.0,
    method: SignalMethod = "fft",
    max_lag: int | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> SignalLag:
    """Return the lag of `signal_2` behind `signal_1`: positive if signal 2 records the event later.

    Means are removed first, and nothing wraps around: a delay beyond half a recording does not alias. The peak is that
    of the signed correlation, so an inverted copy is not a match. If the values of both wrap around at the same number,
    as a heading in degrees or the count of an encoder does, all methods but "sampled" correlate their steps.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) numbers of any type, or recordings from :func:`stereolag.read_signal`; lengths may differ.
    sampling_rate
        Samples per second of both. None: the rate of recordings read from files, or 44,100 if neither has one.
    speed
        Speed of the wave, metres per second.
    method
        ``"fft"``
            Pearson's correlation of every overlap, by FFT and running sums. The plain product sum favours long overlaps
            and loud passages; Pearson's correlation alone favours overlaps of two or three samples, which agree by
            chance. The curve is therefore Pearson's correlation times ``sqrt(overlap / longest overlap)``, proportional
            to the number of standard deviations by which the agreement exceeds chance.
        ``"phat"``
            Phase correlation (GCC-PHAT): sharp to fractions of a sample, even in rooms with echoes.
        ``"sampled"``
            Random samples of one recording, looked up by value in the other, vote for a lag (see
            :func:`stereolag.signals.search.sampled_votes`). Reliable if the noise of each recording is at least 10 dB
            below the sound; reads no more of the recordings than necessary.
        ``"direct"``
            The curve of "fft", with the products summed lag by lag: slow, and simple enough to trust.
    max_lag
        Search ``-max_lag..max_lag`` only, samples. If that is small compared with the recordings, "fft" processes them
        in blocks, with the same result: an hour takes only the memory of a few `max_lag`. Above 8 million samples
        (3 minutes at 44.1 kHz) every other "fft" search works in bands of frequency
        (:func:`stereolag.signals.search.search_bands`): the lag is that of the whole curve if the recordings have
        something in common, `correlation` is reduced, and `peak_ratio` and `ties` do not exceed those of the whole
        curve. The other methods process the recordings as a whole, and refuse them if that takes too much memory.
    seed
        Seed of the random samples for "sampled"; None draws new ones each time.
    progress
        Called with the fraction done, 0..1, including the judgement. Where recordings are processed as a whole, not
        before their correlation is done: about a second for 2 million samples.

    Raises
    ------
    ValueError
        A recording that is empty, constant or not finite; a sampling rate or speed that is not positive; sampling
        rates that contradict each other; an unknown method; a `max_lag` that is not an integer from 0 to the longer
        recording's length - 1; recordings that are constant wherever they overlap within `max_lag`; more memory needed
        than one job may take (:func:`~stereolag.signals.estimate_lag`).

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> sound = np.random.default_rng(0).standard_normal(5000)
    >>> result = sl.signal_lag(sound[300:], sound, sampling_rate=1000.0, speed=340.0)
    >>> result.lag, result.time_s, result.distance_m  # samples, seconds, metres
    (300, 0.3, 102.0)
    >>> result.verdict
    'sure'
    """
    given_1, given_2 = checked_signal(signal_1, "signal_1"), checked_signal(signal_2, "signal_2")
    rate = common_rate(signal_1, signal_2, sampling_rate)
    check_positive(speed, "speed", "metres per second")
    if method not in get_args(SignalMethod):
        raise ValueError(f"method is {method!r}; allowed are {', '.join(map(repr, get_args(SignalMethod)))}.")
    reach = _checked_reach(max_lag, max(given_1.size, given_2.size))
    report = progress or silent
    check_memory(estimate_lag(given_1.size, given_2.size, method=method, max_lag=max_lag))

    started = time.perf_counter()
    chosen = algorithm(given_1.size, given_2.size, method, reach)
    modulus = None if method == "sampled" else _common_modulus(given_1, given_2)
    if modulus is not None:
        given_1, given_2 = (_wrapped_steps(given, modulus) for given in (given_1, given_2))
    if chosen == "whole":
        first, second = normalised(given_1), normalised(given_2)
        if method == "sampled":
            found = search_votes(first, second, reach, seed, report)
        else:
            direct = partial(direct_curve, progress=report)
            curves: dict[str, Callable[..., Vector]] = {"fft": fft_curve, "phat": phat_curve, "direct": direct}
            found = search_curve(first, second, reach, curves[method])
        recordings: tuple[Recording, Recording] = (HeldRecording(first), HeldRecording(second))
    else:
        pulse = Pulse(report)
        long_1, long_2 = ConvertedRecording(given_1, pulse.again), ConvertedRecording(given_2, pulse.again)
        if chosen == "blocks":
            curve = partial(block_curve, progress=lambda done: pulse(_SEARCH_SHARE * done))
            found = search_curve(long_1, long_2, reach, curve)
        else:
            found = search_bands(long_1, long_2, reach, lambda done: pulse(_SEARCH_SHARE * done))
        recordings = (long_1, long_2)
    score = overlap_pearson(*recordings, found.lag)
    if np.isnan(score):
        raise ValueError(
            f"nothing varies where the recordings overlap within ±{reach} samples; allow a larger max_lag."
        )
    result = SignalLag(
        lags=found.lags,
        correlation=found.correlation,
        votes=found.votes,
        elapsed_s=time.perf_counter() - started,
        sampling_rate=rate,
        speed=speed,
        max_lag=reach if reach < max(given_1.size, given_2.size) - 1 else None,
        begins_again_at=modulus,
        _found=found,
        _score=score,
        _fixed=method in {"direct", "sampled"} or _is_plain(found, score, (given_1.size, given_2.size)),
        _recordings=recordings,
    )
    if chosen != "whole" or progress:
        _ = result.judgement
    report(1.0)
    return result


_MIN_PLAIN_SCORE = 0.5
"""Correlation, weighted by the overlap, from which on a lag is obvious."""

_MIN_PLAIN_HEIGHT = 20.0
"""Standard deviations of noise as coloured as the recordings that may take its place."""

_MIN_PLAIN_RATIO = 2.0
"""Ratio to the next peak that an obvious lag needs besides: with less, a hum in both can move the peak."""


def _is_plain(found: FoundLag, score: float, sizes: tuple[int, int]) -> bool:
    """Return whether the lag is obvious: the recordings agree far better there than elsewhere."""
    weighted = score * math.sqrt(overlap_length(*sizes, np.array([found.lag]))[0] / min(sizes))
    assert found.lags is not None and found.correlation is not None
    first, end = main_lobe(found.correlation, int(np.searchsorted(found.lags, found.lag)))
    # Samples are independent of each other beyond about a lobe.
    is_high = weighted * math.sqrt(min(sizes) / (end - first)) >= _MIN_PLAIN_HEIGHT
    return (is_high or weighted >= _MIN_PLAIN_SCORE) and found.peak_ratio >= _MIN_PLAIN_RATIO


_MODULI = 360.0, 2 * math.pi, *(2.0**bits for bits in range(8, 17))
"""Numbers at which headings, phases and the counts of encoders wrap around."""

_MIN_RANGE_SHARE = 0.95
"""Share of the range up to the modulus that wrapped values fill at least."""

_MIN_MIDDLE_SHARE = 0.1
"""Share of the values in the middle half of their range, at least: a switch has none there."""

_MAX_SAMPLES_EXAMINED = 2**20
"""Samples from the start whose steps are examined."""


def _common_modulus(given_1: Array, given_2: Array) -> float | None:
    """Return the number at which the values of both recordings wrap around, or None."""
    modulus = _modulus(given_1)
    return modulus if modulus is not None and modulus == _modulus(given_2) else None


def _modulus(given: Array) -> float | None:
    """Return the one of ``_MODULI`` at which the values of a recording wrap around, None if they do not.

    They fill the range from 0, or from minus half the modulus, and jump by nearly the whole range or by little of it.
    """
    low, high = float(given.min()), float(given.max())
    modulus = next((each for each in _MODULI if _MIN_RANGE_SHARE * each <= high - low <= each), None)
    if modulus is None or not 0 <= min(low, low + modulus / 2, key=abs) <= (1 - _MIN_RANGE_SHARE) * modulus:
        return None
    signal = given[:_MAX_SAMPLES_EXAMINED].astype(np.float64, copy=False)
    steps = np.abs(np.diff(signal))
    far, between = (steps > 0.75 * modulus).sum(), ((steps > 0.25 * modulus) & (steps <= 0.75 * modulus)).sum()
    in_middle = np.abs(signal - (low + high) / 2) < modulus / 4
    return modulus if far > 10 * between and in_middle.mean() > _MIN_MIDDLE_SHARE else None


def _wrapped_steps(given: Array, modulus: float) -> Vector:
    """Return the step to each sample from the one before, the shorter way around; the signal if all are equal."""
    signal = given.astype(np.float64, copy=False)
    steps = np.diff(signal, prepend=signal[:1])
    shorter = steps - modulus * np.round(steps / modulus)
    return shorter if np.ptp(shorter[1:]) > 0 else signal


def normalised(given: Array) -> Vector:
    """Return the signal with zero mean and a largest value of 1, so that squares neither over- nor underflow."""
    signal = given.astype(np.float64, copy=False)
    centred = signal - signal.mean()
    return np.asarray(centred / max(centred.max(), -centred.min()))


def _checked_reach(max_lag: int | None, longest: int) -> int:
    if max_lag is None:
        return longest - 1
    try:
        reach = operator.index(max_lag)
    except TypeError:
        reach = -1
    if not 0 <= reach < longest:
        raise ValueError(
            f"max_lag is {max_lag!r}; allowed are whole samples from 0 to {longest - 1}, one less than the longer "
            "recording."
        )
    return reach
