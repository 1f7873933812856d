"""Columns as loggers, oscilloscopes and spreadsheets write them: channels, on the clock of their times."""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import signal

from stereolag.io.clocks import Gap, Recording, at_one_rate, duplicate_warning, start_difference_s
from stereolag.io.columns import read_columns
from stereolag.io.stamps import read_stamps
from stereolag.signals import signal_lag

RATE = 200
A, B = np.random.default_rng(0).normal(size=(2, 300)).round(4)
START = datetime(2024, 5, 13, 10, 0, 0, tzinfo=UTC)
START_S = START.timestamp()


def read(text: str | bytes) -> Recording:
    return read_columns(text if isinstance(text, bytes) else text.encode())


def rows(row: Callable[[int], str], heading: str = "", footer: str = "", newline: str = "\n") -> str:
    return newline.join([*heading.splitlines(), *(row(index) for index in range(A.size)), *footer.splitlines()])


def stamp(pattern: str, seconds: float = 1 / RATE, start: datetime = START) -> Callable[[int], str]:
    """Return a function from the number of a row to its time; %L stands for milliseconds."""

    def of(index: int) -> str:
        moment = start + timedelta(seconds=round(index * seconds, 6))
        return moment.strftime(pattern.replace("%L", f"{moment.microsecond // 1000:03d}"))

    return of


def dated(pattern: str, row: str, heading: str = "") -> str:
    """Return a text whose rows hold a time by a pattern, A and B."""
    time = stamp(pattern)
    return rows(lambda index: row.format(time(index), A[index], B[index]), heading)


def comma(value: float) -> str:
    return f"{value:.4f}".replace(".", ",")


def sign(value: float) -> str:
    return f"{'+' if value >= 0 else '-'}   {abs(value):.4f}"


def timed(row: str, heading: str = "", unit: float = 1.0, decimals: int = 3, start: float = 0.0) -> str:
    """Return a text whose rows hold a time as a number, A and B."""
    return rows(lambda index: row.format(f"{start + index / RATE / unit:.{decimals}f}", A[index], B[index]), heading)


ELAPSED = {
    "seconds": timed("{},{},{}", "t,A,B"),
    "seconds without a heading": timed("{} {} {}"),
    "seconds in brackets, as the kernel logs": timed("[    {}] {} {}"),
    "trailing tabs": timed("{}\t{}\t{}\t\t", "t [ms]\tA\tB\t\t", 1e-3, 0),
    "a tab above the numbers of rows": rows(lambda i: f"{i}\t{i * 5}\t{A[i]}\t{B[i]}", "\tt [ms]\tA\tB"),
    "trailing commas": timed("{},{},{},", "t,A,B,"),
    "quotes": timed('"{}","{}","{}"', '"t","A","B"'),
    "footer": timed("{},{},{}", "t,A,B") + "\n\nMin,-3.2,-3.1\nMax,3.1,3.2\n",
    "last line cut off": timed("{},{},{}", "t,A,B") + "\n1.5,0.2",
    "a column of words": timed("acc,{},{},{}", "sensor,t,A,B"),
    "times in the last column": rows(lambda i: f"{A[i]},{B[i]},{i / RATE:.3f}", "A,B,Elapsed time [s]"),
    "milliseconds": timed("{};{};{}", "Time (ms);A;B", 1e-3, 0),
    "microseconds": timed("{}\t{}\t{}", "timestamp_us\tA\tB", 1e-6, 0),
    "units below the names": timed("{},{},{}", "Time,Channel A,Channel B\n(ms),(mV),(mV)\n", 1e-3, 1),
    "Keysight": timed("{},{},{}", "x-axis,1,2\nsecond,Volt,Volt"),
    "phyphox": timed("{},{:e},{:e}", '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)"'),
    "NumPy's savetxt": timed("{} {:.18e} {:.18e}", "# t A B"),
    "pandas with an index": rows(lambda i: f"{i},{i / RATE},{A[i]},{B[i]}", ",t,A,B"),
    "LabVIEW": timed(
        "{}\t{}\t{}",
        "LabVIEW Measurement\nWriter_Version\t2\n***End_of_Header***\t\nX_Value\tVoltage\tVoltage_0\tComment",
    ),
    "Graphtec without a date": rows(lambda i: f"{i + 1}\t{i * 5000}\t{sign(A[i])}\t{sign(B[i])}", "NO.\tus\tmV\tmV"),
    "Tektronix with side columns": f"Record Length,300,,0.000,{A[0]},{B[0]}\n"
    + "\n".join(f",,,{i / RATE:.3f},{A[i]},{B[i]}" for i in range(1, A.size)),
    "Tektronix": timed("{},{},{}", "Model,MSO44\nLabel,CH1,CH2\nRecord Length,300\n\nTIME,CH1,CH2"),
    "LeCroy": timed("{},{},{}", "LECROYWS,12345,Waveform\nSegments,1,SegmentSize,300\nTime,Ampl,Ampl"),
    "LabVIEW without times": rows(lambda i: f"\t{A[i]}\t{B[i]}", "Delta_X\t0.005\n***End***\nX_Value\tU\tI\tComment"),
    "LabVIEW with times for each": rows(
        lambda i: f"{i / RATE}\t{A[i]}\t{i / RATE}\t{B[i]}", "X_Value\tU\tX_Value\tI\tComment"
    ),
    "R with the numbers of rows": rows(lambda i: f'"{i + 1}" {i / RATE} {A[i]} {B[i]}', '"t" "A" "B"'),
    "OWON": rows(lambda i: f"{i},{A[i]},{B[i]}", "Time interval :,5.0ms,5.0ms\nIndex,A,B"),
    "an interval in German": rows(lambda i: f"{comma(A[i])};{comma(B[i])}", "Abtastintervall;5 ms\nA;B"),
    "microseconds by capitals": timed("{},{},{}", "TimeUS,A,B", 1e-6, 0),
    "Vicon": rows(lambda i: f"{i + 1},{A[i]},{B[i]}", "Devices\n200\n,Force plate,\nFrame,Fx,Fy\n,N,N"),
    "BIOPAC": timed("{}\t{}\t{}\t", "x.acq\n5 msec/sample\n2 channels\nmin\tA\tB\t\n\t300\t300\t", 60.0, 9),
    "Yokogawa": rows(lambda i: f",{A[i]},{B[i]}", '"Model Name","DL850"\n"HResolution",5.0E-03\n"HUnit","s"'),
    "OpenBCI": rows(lambda i: f"{i % 256}, {A[i]}, {B[i]}, {i / RATE:.3f}", "%Rate = 250 Hz\nIndex, A, B, Time"),
    "decimal commas": rows(lambda i: f"{comma(i / RATE)};{comma(A[i])};{comma(B[i])}", "Zeit [s];U [V];I [A]"),
    "decimal commas in quotes": rows(lambda i: f'"{comma(i / RATE)}","{comma(A[i])}","{comma(B[i])}"', "t,A,B"),
    "decimal commas between commas": rows(lambda i: f"{comma(i / RATE)},{comma(A[i])},{comma(B[i])}", "t,A,B"),
    "decimal commas between commas, without names": rows(lambda i: f"{comma(i / RATE)},{comma(A[i])},{comma(B[i])}"),
    "decimal commas and spaces": rows(lambda i: f"{comma(i / RATE)}  {comma(A[i])}  {comma(B[i])}"),
    "Fortran": rows(lambda i: f"  {i / RATE:.3f}  {A[i]:.6e}  {B[i]:.6e}".replace("e", "D")),
    "prices": timed("{},${},{} €", "t,A,B"),
    "units in every field": timed("{} s,{} V,{} V", "Time,A,B"),
    "bars": timed("{} | {} | {}", "t | A | B"),
    "Excel's first line": timed("{};{};{}", "sep=;\nt;A;B"),
    "days": timed("{},{},{}", "Time (days),A,B", 86_400, 15),
    "a version beside the times": timed("1.2.3;{};{};{}", "fw;time_s;A;B"),
    "one date beside the times": timed("2024-05-13;{};{};{}", "day;time_s;A;B"),
    "lines written twice": re.sub(r"(\n\d.\d45,.*)", r"\1\1", timed("{},{},{}", "t,A,B")),
    "heading written again": timed("{},{},{}", "t,A,B").replace("\n0.500,", "\nt,A,B\n0.500,"),
    "a rate in the heading": rows(lambda i: f"{A[i]},{B[i]}", "Sampling rate: 0.2 kHz\nA,B"),
    "an interval in the heading": rows(lambda i: f"{A[i]},{B[i]}", "Sample Interval,5.0e-03,s\nA,B"),
    "Rigol": rows(lambda i: f"{i},{A[i]},{B[i]},,", "X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,0,5.0e-03"),
    "clock of hours": rows(lambda i: f"0:00:{i / RATE:06.3f},{A[i]},{B[i]}", "Elapsed,A,B"),
    "clock of minutes": rows(lambda i: f"00:{i / RATE:06.3f},{A[i]},{B[i]}", "Elapsed,A,B"),
    "hours of days elapsed": rows(lambda i: f"0 days 00:00:{i / RATE:09.6f},{A[i]},{B[i]}", ",A,B"),
    "PhysioNet": rows(
        lambda i: f"'0:{i / RATE:06.3f}',{A[i]},{B[i]}", "'Elapsed time','A','B'\n'hh:mm:ss.mmm','mV','mV'"
    ),
    "labels": timed("t:{},A:{},B:{}", "Starting up") + "\nt:1.5,A:0",
    "labels and spaces": timed("t:{} A:{} B:{}"),
    "labels and signs of equality": timed("time_s={};A={};B={}"),
    "objects a line": rows(lambda i: f'{{"t": {i / RATE}, "A": {A[i]}, "B": {B[i]}, "id": "s1", "ok": true}}'),
    "objects in one line": "[" + timed('{{"t":{},"A":{},"B":{}}}').replace("\n", ",") + "]",
    "objects within objects": rows(lambda i: json.dumps({"t": i / RATE, "acc": {"x": A[i], "y": B[i]}})),
    "an object of columns": json.dumps({"sensor": "s1", "fs": RATE, "acc": {"x": [*A], "y": [*B]}}, indent=1),
    "rows in an object": json.dumps({"id": 7, "rows": [[i / RATE, A[i], B[i]] for i in range(A.size)]}),
    "names, then a mark of what follows": timed("{} {} {}", "[column names]\ntime A B\n[data]"),
    "a bare rate in the heading": rows(lambda i: f"{A[i]},{B[i]}", "# rate: 200 Hz"),
    "ActiGraph": rows(lambda i: f"{A[i]},{B[i]}", "--- Created By ActiGraph GT3X+ date format M/d/yyyy at 200 Hz ---"),
    "Rigol's interval": rows(lambda i: f"{A[i]},{B[i]},,", "CH1V,CH2V,t0 = -1.2E-03, tInc = 5.0E-03,"),
    "UTF-8 with its mark": ("\ufeff" + timed("{},{},{}", "t,A,B")).encode(),
    "UTF-16": timed("{}\t{}\t{}", "Zeit [ms]\tA [µV]\tB [µV]", 1e-3, 0).encode("utf-16"),
    "UTF-16 without its mark": timed("{}\t{}\t{}", "t\tA\tB").encode("utf-16-le"),
    "Latin-1": timed("{}\t{}\t{}", "t [µs]\tA [µV]\tB [µV]", 1e-6, 0).encode("latin-1"),
    "last first": "t,A,B\n" + "\n".join(reversed(timed("{},{},{}").splitlines())),
    "Unicode's minus": timed("{};{};{}", "t;A;B").replace("-", "\N{MINUS SIGN}").encode(),
    "lines end in CR LF, blank ones between": timed("{},{},{}\n", "t,A,B").replace("\n", "\r\n"),
}

DATE_AND_CLOCK = stamp("%Y/%m/%d\t%H:%M:%S")
DATE_12 = stamp("%m/%d/%y %I:%M:%S.%L %p")
DATED = {
    "ISO": dated("%Y-%m-%dT%H:%M:%S.%f", "{},{},{}", "time,A,B"),
    "ISO in UTC": dated("%Y-%m-%dT%H:%M:%S.%LZ", "{},{},{}", "time,A,B"),
    "ISO of another zone": dated("%Y-%m-%d %H:%M:%S.%L+00:00", "{};{};{}", "time;A;B"),
    "pandas": rows(lambda i: f"{stamp('%Y-%m-%d %H:%M:%S.%f')(i)},{A[i]},{B[i]}", ",A,B"),
    "German": rows(lambda i: f"{stamp('%d.%m.%Y %H:%M:%S,%L')(i)};{comma(A[i])};{comma(B[i])}", "Zeit;U;I"),
    "American": dated("%m/%d/%Y %I:%M:%S.%L %p", "{},{},{}", "Date/Time,A,B"),
    "two columns": dated("%Y/%m/%d,%H:%M:%S.%L", "{},{},{}", "Date,Time,A,B"),
    "two columns of spaces": dated("%m/%d/%Y %I:%M:%S.%L %p", "{} {} {}"),
    "time before date": dated("%H:%M:%S.%L;%d.%m.%Y", "{};{};{}", "Uhrzeit;Datum;A;B"),
    "month by name": dated("%d-%b-%Y %H:%M:%S.%L", "{}\t{}\t{}"),
    "month first": dated("%b %d, %Y %H:%M:%S.%L", '"{}",{},{}', "Time,A,B"),
    "weekday and zone": dated("%a %d %b %Y %H:%M:%S.%L UTC", "{},{},{}", "Time,A,B"),
    "HOBO": rows(
        lambda i: f"{i + 1},{DATE_12(i)},{A[i]},{B[i]},", 'Title: x\n"#","Date Time, GMT","A, V","B, V","Coupler"'
    ),
    "Campbell": dated("%Y-%m-%d %H:%M:%S.%L", '"{}",{},{}', '"TOA5","CR1"\n"TS","A","B"\n"TS","V","V"\n"","Avg","Avg"'),
    "compact": dated("%Y%m%dT%H%M%S.%L", "{},{},{}"),
    "milliseconds after a colon": dated("%Y-%m-%d %H:%M:%S:%L", "{},{},{}", "t,A,B"),
    "Graphtec": rows(
        lambda i: f"{i + 1}\t{DATE_AND_CLOCK(i)}\t{i * 5000 % 10**6}\t{sign(A[i])}\t{sign(B[i])}\tLL",
        "Vendor\tX\nSampling interval\t5ms\nNO.\tDate\tTime\tus\tmV\tmV\tAlarm",
    ),
    "Apache": dated("%d/%b/%Y:%H:%M:%S.%L +0000", "{};{};{}", "Time;A;B"),
    "zone of hours, as of PostgreSQL": dated("%Y-%m-%d %H:%M:%S.%L+00", "{};{};{}", "Time;A;B"),
    "a log with its dates in brackets": dated("[%Y-%m-%d %H:%M:%S.%L]", "{} {} {}"),
    "C's ctime": dated("%a %b %d %H:%M:%S.%L %Y", "{},{},{}", "Time,A,B"),
    "C's ctime between spaces": dated("%a %b %d %H:%M:%S.%L UTC %Y", "{} {} {}"),
    "day of the year": dated("%Y-%jT%H:%M:%S.%LZ", "{},{},{}", "Time,A,B"),
    "day of the year after colons": dated("%Y:%j:%H:%M:%S.%L", "{} {} {}"),
    "hours and name of a zone": dated("%Y-%m-%dT%H:%M:%S.%L+00:00[Africa/Abidjan]", "{},{},{}", "Time,A,B"),
    "name of a zone": dated("%Y-%m-%d %H:%M:%S.%L Africa/Abidjan", "{},{},{}", "Time,A,B"),
    "in the last column, behind the numbers of the rows": rows(
        lambda i: f"{i},{A[i]},{B[i]},{stamp('%Y-%m-%d %H:%M:%S.%f+00:00')(i)}", ",A,B,when"
    ),
    "objects a line with dates": dated("%Y-%m-%dT%H:%M:%S.%LZ", '{{"time": "{}", "A": {}, "B": {}}}'),
    "dots within the time of day": dated("%d.%m.%Y %H.%M.%S", "{},{},{}", "Time,A,B"),
    "dashes within the time of day": dated("%d-%m-%Y_%H-%M-%S", "{},{},{}", "Time,A,B"),
    "dots in a column of its own": dated("%d.%m.%Y;%H.%M.%S", "{};{};{}", "Datum;Zeit;A;B"),
    "whole seconds": dated("%Y-%m-%d %H:%M:%S", "{},{},{}", "Timestamp,A,B"),
    "Unix": timed("{},{},{}", "timestamp,A,B", start=START_S),
    "Unix without a heading": timed("{} {} {}", start=START_S),
    "Unix in milliseconds": timed("{},{},{}", "time,A,B", 1e-3, 0, START_S * 1e3),
    "Unix in nanoseconds": rows(
        lambda i: f"{int(START_S) * 10**9 + i * 5_000_000},{i / RATE},{A[i]},{B[i]}", "time,seconds_elapsed,z,y"
    ),
    "Excel's serial days": timed("{},{},{}", "Date,A,B", 86_400, 10, START_S / 86_400 + 25_569),
    "Julian days": timed("{},{},{}", "BJD_TDB,A,B", 86_400, 10, START_S / 86_400 + 2_440_587.5),
    "modified Julian days": timed("{},{},{}", "MJD,A,B", 86_400, 10, START_S / 86_400 + 40_587),
    "ticks of .NET": rows(
        lambda i: f"{621_355_968 * 10**9 + int(START_S) * 10**7 + i * 50_000},{A[i]},{B[i]}", "t,A,B"
    ),
    "seconds and nanoseconds": rows(
        lambda i: f"{int(START_S) + i // RATE},{i % RATE * 5_000_000},{A[i]},{B[i]}", "stamp.secs,stamp.nsecs,A,B"
    ),
    "a date as a number": dated("%Y%m%d,%H:%M:%S.%L", "{},{},{}", "Date,Time,A,B"),
    "beside the start": dated("2024-05-13T10:00:00Z,%Y-%m-%dT%H:%M:%S.%LZ", "{},{},{}", "start,time,A,B"),
    "JavaScript": dated("%a %b %d %Y %H:%M:%S.%L GMT+0000 (Coordinated Universal Time)", "{},{},{}", "Time,A,B"),
    "hours from Greenwich": dated("%Y-%m-%d %H:%M:%S.%L UTC+0", "{},{},{}", "Time,A,B"),
    "a dash between": dated("%Y/%m/%d-%H:%M:%S.%L", "{},{},{}", "Time,A,B"),
    "CoolTerm": dated("%Y-%m-%d %H:%M:%S.%L", "{} {},{}"),
    "Tera Term": dated("[%a %b %d %H:%M:%S.%L %Y]", "{} {},{}"),
    "Lascar, its serial number behind the first row": rows(
        lambda i: f"{i + 1},{DATE_12(i)},{A[i]},{B[i]}" + ",010041234" * (i == 0),
        "EL-USB-2,Time,A(V),B(V),Serial Number",
    ),
    "Hungarian": dated("%Y. %m. %d. %H:%M:%S.%L", "{};{};{}", "Idő;A;B"),
    "Spanish": dated("%d/%m/%Y %H:%M:%S.%L a. m.", "{};{};{}", "Fecha;A;B"),
    "Japanese": dated("%Y年%m月%d日 %H:%M:%S.%L", "{},{},{}", "時刻,A,B"),
    "MATLAB's days": timed("{},{},{}", "datenum time,A,B", 86_400, 10, START_S / 86_400 + 719_529),
}


CLOCK_OF_DAY = {
    "dots": dated("%H.%M.%S", "{};{};{}", "Zeit;A;B"),
    "a word behind": dated("%H:%M:%S.%L Uhr", "{};{};{}", "Zeit;A;B"),
    "a date without a year": dated("%d.%m. %H:%M:%S.%L", "{};{};{}", "Zeit;A;B"),
    "serial monitor, commas": dated("%H:%M:%S.%L", "{} -> {},{}"),
    "serial monitor, spaces": dated("%H:%M:%S.%L", "{} -> {} {}"),
    "serial monitor, brackets": dated("%H:%M:%S.%L", "[{}] {} {}"),
    "serial monitor, brackets and commas": dated("%H:%M:%S.%L", "[{}] {},{}"),
}


@pytest.mark.parametrize("name", [*ELAPSED, *DATED, *CLOCK_OF_DAY])
def test_times_give_the_rate_and_are_no_channel(name: str) -> None:
    recording = read((ELAPSED | DATED | CLOCK_OF_DAY)[name])
    assert recording.sampling_rate == pytest.approx(RATE, rel=1e-9)
    np.testing.assert_allclose(recording.channels, [A, B], atol=1e-12)
    assert recording.gaps == ()
    epoch, start_s = ("start", 0) if name in ELAPSED else ("1970", START_S) if name in DATED else ("midnight", 36_000)
    assert (recording.epoch, recording.start_s) == (epoch, pytest.approx(start_s, abs=1e-4))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("left,right\n1,2\n3,4\n", [[1, 3], [2, 4]]),
        ("1,5;2\n-3,25;4", [[1.5, -3.25], [2, 4]]),
        ("0,5 1\n1,5 2", [[0.5, 1.5], [1, 2]]),
        ("  1   2 \n 3  4", [[1, 3], [2, 4]]),
        ("1, 2\n3, 4", [[1, 3], [2, 4]]),
        ("U\n0,5\n1,05\n-0,25", [[0.5, 1.05, -0.25]]),
        ("# a remark\nV, V\n% another\n1,2\n// 7\n3,4 # at the end", [[1, 3], [2, 4]]),
        ("Gain: 44100 dB\nSensor 1\n\n1\n2", [[1, 2]]),
    ],
)
def test_columns_of_numbers(text: str | bytes, expected: list[list[float]]) -> None:
    recording = read(text)
    assert recording.sampling_rate is None
    np.testing.assert_array_equal(recording.channels, expected)


@given(
    samples=hnp.arrays(
        np.float64,
        st.tuples(st.integers(1, 4), st.integers(5, 30)),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    ),
    separator=st.sampled_from([",", ";", "\t", " "]),
    newline=st.sampled_from(["\n", "\r\n", "\r"]),
    header=st.sampled_from(["", "Samples", "# made today"]),
)
def test_numbers_survive_the_way_through_text(samples: np.ndarray, separator: str, newline: str, header: str) -> None:
    lines = [header] * bool(header) + [separator.join(map(repr, row)) for row in samples.T.tolist()]
    np.testing.assert_array_equal(read(newline.join(lines)).channels, samples)


# Gaps and uneven times.


def sparse(kept: Iterable[int], rate: float = RATE, decimals: int = 3) -> Recording:
    """Return what is read of a file that holds some of the samples alone, at their own times."""
    return read("\n".join(["t,A,B", *(f"{i / rate:.{decimals}f},{A[i]},{B[i]}" for i in kept)]))


@pytest.mark.parametrize("rate", [100, 200, 1000])
def test_one_sample_that_is_missing_moves_no_other(rate: int) -> None:
    kept = np.delete(np.arange(A.size), [70, 71, 200])
    for decimals in (2, 3, 6) if rate == 100 else (3, 6):
        recording = sparse(kept, rate, decimals)
        assert (recording.sampling_rate, len(recording.gaps)) == (rate, 2)
        np.testing.assert_array_equal(recording.channels[:, kept], [A[kept], B[kept]])


def test_a_gap_is_named_and_filled_by_a_line_so_that_samples_stay_in_their_places() -> None:
    kept = np.delete(np.arange(A.size), [*range(100, 160), 200])
    recording = sparse(kept)
    assert recording.sampling_rate == RATE
    lines = [np.interp(np.arange(A.size), kept, values[kept]) for values in (A, B)]
    np.testing.assert_allclose(recording.channels, lines, atol=1e-12)
    found = [(RATE * gap.start_s, RATE * gap.length_s) for gap in recording.gaps]
    assert found == [pytest.approx((99, 60)), pytest.approx((199, 1))]
    assert "0.3 s missing after 0.495 s, filled" in recording.remarks


@pytest.mark.parametrize(
    ("rates", "uneven", "gaps"), [((200, 99.1), (0.0, 0.3), (2.5, 0.0)), ((97.3, 50), (0.3, 0.0), (2.5, 3.7))]
)
def test_the_lag_is_true_from_one_logger_to_another_across_gaps(rates, uneven, gaps):
    random = np.random.default_rng(7)
    sos = signal.butter(4, [1, 20], fs=1000, btype="band", output="sos")
    sound = signal.sosfiltfilt(sos, random.normal(size=64_000))

    def logged(rate: float, uneven: float, gap: float, later: float) -> Iterator[tuple[float, float]]:
        times = np.arange(int(55 * rate)) / rate
        times = np.sort(times + random.uniform(-uneven, uneven, times.size) / rate)
        times = times[(times < 20) | (times >= 20 + gap)] - times[0]
        heard = np.interp(times + 2 - later, np.arange(sound.size) / 1000, sound) / sound.std()
        return zip(times, heard + random.normal(scale=0.3, size=times.size), strict=True)

    first = "\n".join(["t,A", *(f"{t:.4f},{v:.4f}" for t, v in logged(rates[0], uneven[0], gaps[0], 0.0))])
    second = "\n".join(
        f"{(START + timedelta(seconds=round(t, 3))).strftime('%d.%m.%Y %H:%M:%S,%f')[:-3]};{comma(v)}"
        for t, v in logged(rates[1], uneven[1], gaps[1], 0.37)
    )
    pair = at_one_rate(read(first), read(second))
    result = signal_lag(*pair)
    assert result.verdict == "sure"
    assert result.lag_subsample / pair[0].sampling_rate == pytest.approx(0.37, abs=0.2 / min(rates))
    assert len(pair[0].gaps) + len(pair[1].gaps) == np.count_nonzero(gaps)


def test_uneven_times_are_brought_onto_an_even_clock() -> None:
    random = np.random.default_rng(1)
    times = np.cumsum(random.uniform(0.6, 1.4, 2000)) / 100
    values = np.sin(2 * np.pi * 1.5 * times)
    recording = read("\n".join(["t,A", *(f"{t:.6f},{v:.6f}" for t, v in zip(times, values, strict=True))]))
    assert recording.sampling_rate == pytest.approx(100, rel=0.02)
    even = times[0] + np.arange(recording.channels.shape[1]) / recording.sampling_rate
    np.testing.assert_allclose(recording.channels[0], np.sin(2 * np.pi * 1.5 * even), atol=5e-3)
    assert recording.gaps == ()
    assert any("uneven" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("rate", "decimals"), [(44_100, 6), (60, 3), (333.25, 4), (104.1666, 6), (25.6, 2), (1 / 30, 0)]
)
def test_rounded_times_are_even_and_their_rate_is_found(rate: float, decimals: int) -> None:
    recording = sparse(range(A.size), rate, decimals)
    assert recording.sampling_rate == pytest.approx(rate, abs=rate**2 * 10.0**-decimals / 250)
    np.testing.assert_array_equal(recording.channels, [A, B])


@pytest.mark.parametrize("a_second", [7, 10.24, 100])
def test_a_clock_of_whole_seconds_gives_the_rate_of_the_samples_between(a_second: float) -> None:
    first, clock = 0.37, stamp("%H:%M:%S")
    seconds = [int(first + index / a_second) for index in range(2000)]
    values = np.random.default_rng(2).normal(size=2000).round(4)
    recording = read("\n".join(f"{clock(200 * second)},{value}" for second, value in zip(seconds, values, strict=True)))
    assert recording.sampling_rate == pytest.approx(a_second, rel=2e-3)
    np.testing.assert_array_equal(recording.channels[0], values)
    assert recording.start_s == pytest.approx(36_000 + first, abs=2 / a_second)


def clocked(heading: str, pattern: str, seconds: float, start: datetime) -> Recording:
    """Return what is read of A beside times by a pattern, whose rate is found and which are no channel."""
    clock = stamp(pattern, seconds, start)
    recording = read(rows(lambda index: f"{clock(index)},{A[index]}", heading))
    assert (recording.sampling_rate, recording.gaps) == (pytest.approx(1 / seconds, rel=1e-11), ())
    np.testing.assert_array_equal(recording.channels, [A])
    return recording


DAY_S = 86_400
MIDNIGHT, EVENING, OVER_MIDNIGHT, OCTOBER = (
    datetime(*parts, tzinfo=UTC) for parts in ((2024, 5, 13), (2024, 6, 5, 20), (2024, 5, 13, 23, 58), (2023, 10, 1))
)


@pytest.mark.parametrize(
    ("heading", "pattern", "seconds", "start"),
    [
        ("", "%d/%m/%Y %H:%M", 600, EVENING),
        ("", "%m/%d/%Y %H:%M", 600, EVENING),
        ("", "%d/%m/%y %H:%M", 600, EVENING),
        ("", "%y-%m-%d %H:%M", 600, EVENING),
        ("Date,A", "%Y-%m-%d", DAY_S, MIDNIGHT),
        ("Date,A", "%Y-%m-%d", 7 * DAY_S, MIDNIGHT),
        ("Date,A", "%d.%m.%y", DAY_S, MIDNIGHT),
        ("Date,A", "%y%m%d", DAY_S, OCTOBER),  # six digits, but no time of day
        ("Date,A", "%y%m%d", 7 * DAY_S, OCTOBER),
        ("MESS_DATUM,A", "%Y%m%d", DAY_S, MIDNIGHT),
        ("MESS_DATUM,A", "%Y%m%d%H", 3_600, MIDNIGHT),
        ("MESS_DATUM,A", "%Y%m%d%H%M", 600, MIDNIGHT),
        ("time,A", "%Y%m%d%H%M%S", 1, START),
        ("date,time,A", "%Y%m%d,%H%M%S.%f", 0.5, START),
        ("date,time,A", "%Y%m%d,%H%M%S.%f", 0.5, OVER_MIDNIGHT),
        ("date,time,A", "%y%m%d,%H%M%S", 1, START),
        ("date,time,A", "%y%m%d,%H%M%S", 1, OVER_MIDNIGHT),
        ("<DATE>,<TIME>,A", "%Y%m%d,%H%M%S", 300, START),
        ("", "%Y-%m-%d %H:%M:%S Europe/Berlin", 1, START),
        ("Time,A", "%d.%m.%Y %H.%M", 60, START),
        ("Date,Time,A", "%d.%m.%Y,%H.%M", 60, START),
        ("time,A", "%Y-%m-%d %H:%M:%S", 3_600, datetime(1600, 1, 1, tzinfo=UTC)),
        ("time,A", "%Y-%m-%d %H:%M:%S", 3_600, datetime(2300, 1, 1, tzinfo=UTC)),
    ],
)
def test_dates_are_told_from_other_digits(heading: str, pattern: str, seconds: float, start: datetime) -> None:
    recording = clocked(heading, pattern, seconds, start)
    zone = timedelta(hours=2 * pattern.endswith("Berlin"))
    assert (recording.start, recording.epoch) == (start - zone, "1970")


@pytest.mark.parametrize(
    ("pattern", "seconds", "start", "start_s"),
    [
        ("%H:%M:%S.%L", 0.1, datetime(2024, 5, 13, 23, 59, 50, tzinfo=UTC), 86_390),  # goes on after midnight
        ("%d/%m/%Y %H:%M:%S.%L", 0.1, EVENING, 72_000),  # a date that can be read both ways
        ("%H%M%S", 1, START, 36_000),
        ("%H%M%S.5", 1, START, 36_000.5),
        ("%Hh%M", 60, START, 36_000),
        ("%d.%m. %H:%M", 600, EVENING, 72_000),
        ("%-H%M", 300, datetime(2024, 5, 13, 1, 30, tzinfo=UTC), 5_400),
    ],
)
def test_without_dates_time_counts_from_midnight(pattern: str, seconds: float, start: datetime, start_s: float) -> None:
    recording = clocked("time,A", pattern, seconds, start)
    assert (recording.epoch, recording.start_s) == ("midnight", start_s)


@pytest.mark.parametrize(
    ("text", "clock"),
    [
        ("05/13/2024 12:30:00 AM", "00:30:00"),
        ("05/13/2024 12:30:00 PM", "12:30:00"),
        ("05/13/2024 1:30:00.5 p.m.", "13:30:00.5"),
        ("05/13/2024 1:30p", "13:30:00"),
        ("2024-05-13T12:30:00+02:00", "10:30:00"),
        ("2024-05-13 12:30:00 -0530", "18:00:00"),
        ("13. Mai 2024 12:30", "12:30:00"),
        ("13 maj 2024 12:30", "12:30:00"),
    ],
)
def test_halves_of_the_day_zones_and_months(text: str, clock: str) -> None:
    times = read_stamps([text])
    assert (times.epoch, times.start_s) == ("1970", datetime.fromisoformat(f"2024-05-13T{clock}+00:00").timestamp())


def test_the_rate_of_a_coarse_clock_is_a_round_number() -> None:
    recording = read(rows(lambda index: f"{index / 44_100:.4f},{A[index]}", "time,A"))
    assert recording.sampling_rate == 44_000  # as near as seven milliseconds by tenths of one tell


@pytest.mark.parametrize(
    ("heading", "pattern", "seconds"),
    [
        ("#YY MM DD hh mm A\n#yr mo dy hr mn m", "%Y %m %d %H %M", 600.0),
        ("Year Day Hour A", "%Y %j %H", 3600.0),
        ("year month day hour minute second A", "%y %m %d %H %M %S.%f", 0.5),
        ("", "%Y%m%d %H%M%S", 30.0),
    ],
)
@pytest.mark.parametrize("turned", [1, -1])
def test_a_time_may_be_in_columns_of_its_parts(heading: str, pattern: str, seconds: float, turned: int) -> None:
    lines = rows(lambda index: f"{stamp(pattern, seconds)(index)} {A[index] if index != 7 else 'MM'}").splitlines()
    recording = read("\n".join([heading, *lines[::turned]]))
    assert (recording.sampling_rate, recording.start, recording.gaps) == (pytest.approx(1 / seconds), START, ())
    np.testing.assert_array_equal(np.delete(recording.channels, 7, axis=1), [np.delete(A, 7)])


@pytest.mark.parametrize(
    ("name", "number", "gaps"),
    [
        ("time", lambda index: 100_000 + index, ()),  # passes sixty seconds
        ("t", lambda index: 600 * (index // 50) + index % 50, [Gap(49.0 + 600 * one, 550.0) for one in range(5)]),
        ("Time of day (s)", lambda index: 36_000 + index, ()),
        ("time_of_day", lambda index: 36_000 + index, ()),
        ("Seconds of the day", lambda index: 36_000 + index, ()),
    ],
)
def test_numbers_that_are_no_times_of_day_are_seconds(name: str, number: Callable[[int], int], gaps: Any) -> None:
    recording = read(rows(lambda index: f"{number(index)},{A[index]}", f"{name},A"))
    assert (recording.sampling_rate, recording.epoch, recording.start_s) == (1.0, "start", number(0))
    assert [*recording.gaps] == [*gaps]


def test_months_are_no_days_and_hours_with_minutes_beside_a_date_no_minutes_with_seconds() -> None:
    months = rows(lambda index: f"{200_101 + index // 12 * 100 + index % 12},{A[index]}", "date,A")
    assert read(months).epoch == "start"
    text = rows(lambda index: f"{stamp('%Y%m%d,%H%M', 600, START)(index)},{A[index]}", "date,time,A")
    assert read(text).sampling_rate == pytest.approx(1 / 600, rel=1e-3)


@pytest.mark.parametrize(("name", "unit"), [("millis", 1e-3), ("time_us", 1e-6), ("", 1.0)])
@pytest.mark.parametrize("missing", [(), (7,), (49,)])
def test_a_counter_of_32_bits_goes_on_when_it_begins_again(name: str, unit: float, missing: tuple[int, ...]) -> None:
    there = np.delete(np.arange(A.size), missing)
    counts = (2**32 - 1000 + 20 * there) % 2**32
    lines = [f"{count},{value}" for count, value in zip(counts, A[there], strict=True)]
    recording = read("\n".join([f"{name},A"] * bool(name) + lines))
    assert recording.sampling_rate == (pytest.approx(0.05 / unit) if name else None)
    assert recording.notes[0].endswith("began again at 2^32 and was continued")
    np.testing.assert_array_equal(recording.channels[0, there], A[there])
    with pytest.raises(ValueError, match="goes back in time"):
        read("\n".join(["millis,A", *lines]).replace(f"\n{counts[60]},", "\n5,"))


def test_numbers_around_zero_without_a_sign_are_no_counter() -> None:
    values = np.round(100 * A).astype(int) % 2**32
    np.testing.assert_array_equal(read(rows(lambda index: f"{values[index]},{B[index]}")).channels, [values, B])


@pytest.mark.parametrize(
    ("mark", "point", "decimals", "row"),
    [
        (",", ".", 0, '{},"{}"'),
        (",", ".", 1, '{},"{}"'),
        ("’", ".", 1, "{};{}"),
        (",", ".", 0, "{};{}"),
        (",", ".", 1, "{}\t{}"),
        (".", ",", 1, "{};{}"),
        ("'", ".", 1, "{};{}"),
        ("\u202f", ",", 1, "{};{}"),
        ("\xa0", ",", 0, "{};{}"),
    ],
)
def test_thousands_may_be_set_apart(mark: str, point: str, decimals: int, row: str) -> None:
    values = np.round(10 ** (3 + A) - 1000 * A, decimals)
    english = (f"{value:,.{decimals}f}" for value in values)
    fields = [text.translate({ord(","): mark, ord("."): point}) for text in english]
    text = "\n".join(["t" + row[2] + "A", *(row.format(index, field) for index, field in enumerate(fields))])
    assert any(mark in field for field in fields) and any(len(field) <= 3 + 2 * decimals for field in fields)
    np.testing.assert_array_equal(read(text).channels, values[None])


def test_null_in_json_is_a_missing_value_and_names_without_most_values_are_refused() -> None:
    values = [None if index == 7 else value for index, value in enumerate(A.tolist())]
    recording = read(json.dumps(values))
    assert recording.mended_lines == 1
    np.testing.assert_array_equal(np.delete(recording.channels[0], 7), np.delete(A, 7))
    for text in ("[[" * 2000, json.dumps([{f"k{index}": [index]} for index in range(99)])):
        with pytest.raises(ValueError, match="is a JSON file, which is not read"):
            read(text)


def test_integers_with_leading_zeros_are_no_decimals_of_other_numbers() -> None:
    recording = read(rows(lambda i: f"{A[i]},{i % 60:02},{B[i]},{i % 24:02}"))
    np.testing.assert_allclose(recording.channels, [A, np.arange(A.size) % 60, B, np.arange(A.size) % 24])


@pytest.mark.parametrize("mark", [",", "."])
def test_a_single_mark_is_of_thousands_between_numbers_as_large(mark: str) -> None:
    for numbers, factor in (("950 1,040 -2,235 12", 1), ("499,667 500 501,333 12", 1e-3)):
        expected = [float(one.replace(",", "")) * (factor if "," in one else 1) for one in numbers.split()]
        np.testing.assert_allclose(
            read(f"A;B\n{numbers}".replace(" ", ";7\n").replace(",", mark) + ";7").channels[0], expected
        )


def test_the_days_of_a_trial_are_no_times() -> None:
    recording = read(rows(lambda index: f"{1 + index // 100},{index / RATE:.3f},{A[index]}", "day,time_s,A"))
    assert (recording.sampling_rate, recording.names) == (RATE, ("day", "A"))


def test_a_zone_in_letters_changes_when_summer_ends() -> None:
    start = datetime(2024, 10, 27, 0, 30, tzinfo=UTC)
    berlin = (start + timedelta(minutes=index) for index in range(A.size))
    stamps = [moment.astimezone(ZoneInfo("Europe/Berlin")).strftime("%Y-%m-%d %H:%M:%S %Z") for moment in berlin]
    recording = read(rows(lambda index: f"{stamps[index]},{A[index]}", "Time,A"))
    assert recording.sampling_rate == pytest.approx(1 / 60)
    assert (recording.start_s, recording.gaps) == (start.timestamp(), ())


@pytest.mark.parametrize(
    ("row", "noted"),
    [
        ("{0},4d-{2},{1}", "words left out: column 2"),
        ("{0},{2:03}d-4d-11,{1}", "words left out: column 2"),
        ("10:15:00 -11;{1}", "words left out: column 1"),
    ],
)
def test_a_name_with_d_is_no_exponent_and_a_number_behind_a_time_no_zone(row: str, noted: str) -> None:
    recording = read(rows(lambda index: row.format(index, A[index], int(3 * abs(B[index])))))
    np.testing.assert_array_equal(recording.channels, [A])
    assert noted in recording.notes


@pytest.mark.parametrize("form", ["SLIST", "TSPAIR"])
def test_a_seismogram_in_stretches_is_one_series(form: str) -> None:
    kept, parts = (range(100), range(120, 300)), []
    for places in kept:
        first = f"{stamp('%Y-%m-%dT%H:%M:%S.%f')(places[0])}"
        parts.append(f"TIMESERIES IU_ANMO_00_BHZ_R, {len(places)} samples, 200 sps, {first}, {form}, FLOAT, M/S")
        if form == "SLIST":
            parts += ["\t".join(map(str, A[places[0] : places[-1] + 1][row : row + 6])) for row in range(0, 180, 6)]
        else:
            parts += [f"{stamp('%Y-%m-%dT%H:%M:%S.%f')(index)}  {A[index]}" for index in places]
    recording = read("\n".join(parts))
    assert (recording.sampling_rate, recording.start_s, recording.epoch) == (RATE, START_S, "1970")
    assert (recording.names, len(recording.gaps)) == (("IU_ANMO_00_BHZ_R",), 1)
    there = np.r_[0:100, 120:300]
    np.testing.assert_array_equal(recording.channels[0, there], A[there])


@pytest.mark.parametrize("written", ["2023-366T%H:%M:%S", "2023-05-06 %H:%M:%S Europe/Atlantis"])
def test_a_day_or_a_zone_that_there_is_not_stays_a_word(written: str) -> None:
    clock = stamp(written, 1.0)
    recording = read(rows(lambda index: f"{clock(index)},{A[index]}"))
    assert (recording.sampling_rate, recording.notes) == (None, ("words left out: column 1",))


def test_a_zone_that_only_some_times_have_counts_there() -> None:
    times = read_stamps(["2024-05-13 10:00:00", "2024-05-13 10:00:01Z", "2024-05-13 12:00:02+02:00"])
    np.testing.assert_array_equal(times.seconds, [0, 1, 2])


def test_two_recordings_with_dates_tell_how_far_apart_they_begin() -> None:
    first = read(DATED["ISO"])
    second = read(
        rows(lambda index: f"{stamp('%d.%m.%Y %H:%M:%S,%L', start=START + timedelta(seconds=5))(index)};{A[index]}")
    )
    assert start_difference_s(first, second) == pytest.approx(5)
    assert start_difference_s(first, read(ELAPSED["seconds"])) is None
    assert "begins 2024-05-13 10:00:05" in second.remarks


def test_one_signal_saved_twice_is_told_however_loud_and_two_sensors_are_not() -> None:
    sound = np.random.default_rng(4).normal(size=(1, 3000)) * 0.2
    first = Recording(sound, RATE)
    for other in (sound, -0.3 * sound + 0.1, np.round(0.3 * sound * 32767) / 32767, 1e200 * sound):
        assert "one signal, saved twice" in duplicate_warning(first, Recording(other, RATE))
    for other in (sound + 0.01 * A.std() * sound[:, ::-1], np.roll(sound, 3), sound[:, 1:], 0 * sound):
        assert duplicate_warning(first, Recording(other, RATE)) == ""
    triggers = Recording((sound > 0.3).astype(float), RATE)
    assert duplicate_warning(triggers, triggers) == ""


LOST_ALL, LOST_SOME = range(40, 100), range(1, 300, 3)
WITH_LOST = [
    ("{t},{A}", LOST_ALL, 0),
    ("{t},{B},{A}", LOST_ALL, 1),
    ("{t};{A}", LOST_SOME, 0),
    ("{A}", LOST_SOME, 0),
    ("{A}\t{B}", [50, 299], 0),
    ("{B},{A}", [50, 51, 299], 1),
    ("{B};{A}", [0, 50], 1),
]
MARKED = [(*one, mark) for one in WITH_LOST for mark in ("NaN", "") if mark or one[0] != "{A}"]  # not of blank lines
MARKED += [(*WITH_LOST[2], mark) for mark in (" ", "---", "#N/A", "#DIV/0!", "OL", "-9999")]


@pytest.mark.parametrize(("row", "lost", "column", "mark"), MARKED)
def test_missing_values_lie_on_a_line_and_are_counted(row: str, lost: Sequence[int], column: int, mark: str) -> None:
    text = rows(lambda i: row.format(t=i / RATE, A=mark if i in lost else A[i], B=B[i]), re.sub("[{}]", "", row))
    recording = read(text)
    there = np.delete(np.arange(A.size), lost)
    assert recording.mended_lines == len(lost)
    expected = np.interp(np.arange(A.size), there, A[there])
    np.testing.assert_allclose(recording.channels[column], expected, atol=1e-12)
    gap = Gap(pytest.approx(39 / RATE), pytest.approx(60 / RATE))
    assert recording.gaps == ((gap,) if row == "{t},{A}" else ())


def test_a_trigger_of_two_values_is_no_column_with_missing_ones() -> None:
    trigger = np.where(np.arange(A.size) % 40 < 20, 999.0, 0.0)
    recording = read(rows(lambda i: f"{i / RATE},{A[i]},{trigger[i]:g}", "t,A,trigger"))
    assert recording.mended_lines == 0
    np.testing.assert_array_equal(recording.channels[1], trigger)


def test_what_is_left_out_is_said_and_columns_keep_their_numbers_and_names() -> None:
    recording = read(
        rows(lambda i: f"acc,{i / RATE},{A[i]},{'' if i % 3 else 5},{B[i]}", "sensor [m/s],t [s],A (V),C,B", "\nMean,1")
    )
    assert (recording.numbers, recording.names) == ((3, 5), ("A (V)", "B"))
    assert recording.notes == (
        "times in column 2 “t (s)”",
        "mostly empty, left out: column 4 “C”",
        "words left out: column 1 “sensor (m/s)”",
        "1 line below the columns left out",
    )
    np.testing.assert_array_equal(recording.channel(5).channels[0], B)
    with pytest.raises(ValueError, match="The channel number is 2; the recording has channels 3, 5"):
        recording.channel(2)


def test_sensors_that_take_turns_are_tracks() -> None:
    lines = (f"{name},{i / RATE:.3f},{values[i]}" for i in range(A.size) for name, values in (("acc", A), ("gyr", B)))
    text = "\n".join(["sensor,t,value", *lines])
    for track, values in (("acc", A), (2, B)):
        recording = read_columns(text.encode(), track)
        assert (recording.tracks, recording.sampling_rate) == (("acc", "gyr"), RATE)
        np.testing.assert_array_equal(recording.channels, [values])
    with pytest.raises(ValueError, match="has no track “mag”; there are “acc”, “gyr”"):
        read_columns(text.encode(), "mag")
    with pytest.raises(ValueError, match="Line 5 holds “x” in column 3 “value”"):
        read_columns(text.replace(f"gyr,0.005,{B[1]}", "gyr,0.005,x").encode(), 2)


@pytest.mark.parametrize(
    ("heading", "row", "rate"),
    [
        ("Sampling rate: 1 MHz", "{}", 1e6),
        ("Sample Rate: 48 KHz", "{}", 48e3),
        ("Sample rate: 2 MSa/s", "{}", 2e6),
        ("Sample rate: 0.5 mHz", "{}", 5e-4),
        ("# fs: 1,000 Hz", "{}", 1000.0),
        ("# fs = 44 100 Hz", "{}", 44_100.0),
        ("Abtastrate;2,5;kHz", "{}", 2500.0),
        ("Sampling Rate (Hz),1000,2", "{},{}", 1000.0),
        ("Sample rate,250,3", "{},{}", 250.0),
        ("Sampling period (ms): 20", "{}", 50.0),
        ("Sampling rate [1/s]: 4", "{}", 4.0),
        ("Sample interval: 5 min", "{}", 1 / 300),
        ("Sampling interval: 1 hour", "{}", 1 / 3600),
        ("Sample Interval [ms];20\nNr;V", "{1};{0}", 50.0),
        ("fs = 100, G = 24", "{}", 100.0),
        ("Sampling rate: 30/min", "{}", 0.5),
        ("Sampling rate: 30 samples per minute", "{}", 0.5),
        ("Sampling rate: 30 min^-1", "{}", 0.5),
        ("Sampling rate (1/min): 30", "{}", 0.5),
        ("Sampling rate: 2 kS/s", "{}", 2000.0),
        ("Sampling rate: 250 Hz per channel", "{}", 250.0),
        ("Sampling rate: 5 min", "{}", 1 / 300),
        ("trial.acq\n0.5 msec/sample\n1 channels\nECG\nmV", "{}", 2000.0),
    ],
)
def test_a_heading_states_the_rate_in_any_unit_and_with_any_comma(heading: str, row: str, rate: float) -> None:
    recording = read(rows(lambda index: row.format(A[index], index), heading))
    assert recording.sampling_rate == pytest.approx(rate, rel=1e-12)
    np.testing.assert_array_equal(recording.channels[0], A)


@pytest.mark.parametrize("heading", ["dt = 1e-320", "fs = 1e400", "fs: 1e-310 ms", "dt=1e400", "0 msec/sample"])
def test_a_rate_beyond_belief_is_none(heading: str) -> None:
    assert read(rows(lambda index: f"{A[index]}", heading)).sampling_rate is None


@pytest.mark.parametrize("columns", [1, 2])
def test_a_start_and_a_rate_above_the_samples_are_no_samples(columns: int) -> None:
    values = np.stack([A, B])[:columns]
    table = np.column_stack([np.full(columns, START_S), np.full(columns, 64.0), values]).T
    recording = read("\n".join(", ".join(f"{value:.6f}" for value in row) for row in table))
    assert (recording.sampling_rate, recording.start_s, recording.epoch) == (64, START_S, "1970")
    np.testing.assert_array_equal(recording.channels, values)


def test_counts_give_no_rate_but_their_gaps() -> None:
    recording = read(rows(lambda i: f"{i + (i >= 100) * 7},{A[i]}", "No.,A"))
    assert recording.sampling_rate is None
    np.testing.assert_array_equal(recording.channels[0, [*range(100), *range(107, 307)]], A)
    assert "7 samples missing by their counts, filled" in recording.notes


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_nul_bytes_behind_a_number_go_and_are_counted_as_missing_values_are(newline: str) -> None:
    nul, lost = (3, 99), (20, 21, 299)
    recording = read(rows(lambda i: f"{A[i]};{'' if i in lost else B[i]}" + "\0\0" * (i in nul), newline=newline))
    there = np.delete(np.arange(B.size), lost)
    assert recording.mended_lines == 5
    np.testing.assert_allclose(recording.channels, [A, np.interp(np.arange(B.size), there, B[there])], atol=1e-12)


# Refusals.


REFUSED = {
    "Line 3 holds “x1y” in column 2 “A”, where other lines hold numbers; correct or": "t,A\n0.1,1\n0.2,x1y\n0.3,2\n",
    "Line 4 holds “hello”, where other lines hold numbers": "Samples\n1\n2\nhello\n3\n",
    "Line 2 holds “-inf”, where other lines hold finite numbers": "1\n-inf\n",
    "Line 2 holds 1 field and the lines before it 2; complete or remove it": "1,2\n3\n",
    "Line 2 holds 3 fields and the lines before it 2": "1,2\n3,4,5\n",
    "Line 4 holds “1_000”": "# r\n1 # ok\n\n1_000\n",
    r"Line 3 holds “\?\(x\)\(http:\?e\.org": "1\n2\n![x](http://e.org/long/long)\n4\n",
    "No line of the text holds a number: line 1 is “word”; allowed are numbers, times": "word\nand more words\n",
    "No line of the text holds a number": "2024-05-06,word\n2024-05-07,word\n",
    "Line 4 goes back in time by 0.05 s; sort the file": "t,A\n0.1,1\n0.2,2\n0.15,3\n0.3,4\n" + "0.4,1\n" * 10,
    "Line 61 goes back in time by 7,140 s": rows(lambda i: f"2024-05-06 {10 - (i >= 60)}:{i % 60:02d}:00,{A[i]}"),
    "Line 8 holds “soon” in column 1, where other lines hold times": rows(
        lambda i: f"{'soon' if i == 7 else stamp('%H:%M:%S')(i)},{A[i]}"
    ),
    "jump by 1e[+]06 s after 5 s, while its usual step is 1 s; cut": rows(
        lambda i: f"{i + (i > 5) * 1e6},{A[i]}", "t,A"
    ),
    "jump by 1e[+]300 s after 298 s": rows(lambda i: f"{i if i < 299 else 1e300},{A[i]}", "t,A"),
    "times of the recording are all the same": rows(lambda i: f"{START:%H:%M:%S},{A[i]}"),
    r"values in fewer than half of its lines \(column 1 “A”\)": rows(lambda i: f"{'' if i % 3 else A[i]},x", "A,B"),
    "holds no numbers beside the times in column 1 “t”; column 2 “A” holds words": rows(
        lambda i: f"{i},[{A[i]}]", "t,A"
    ),
    "holds 1 sample; at least 2": "7\n",
    "Line 3 holds v, t, and the lines before it t, v; a line must": "t:1,v:2\nt:2,v:2\nv:2,t:3\nt:4,v:2\n",
    "Line 31 holds a NUL byte; allowed are": rows(lambda i: f"{A[i]};{B[i]}" + "\0" * (30 <= i < 36)),
    "Line 11 holds a NUL byte": rows(lambda i: "1.5\0002;3" if i == 10 else f"{A[i]};{B[i]}"),
    "Line 11 holds a NUL byte; allowed": rows(lambda i: "\0" if i == 10 else f"{A[i]};{B[i]}"),
    "65 channels; allowed are 1 to 64": ",".join(["1.5"] * 65) + "\n" + ",".join(["1"] * 65),
    "Line 2 has 200,000 characters; at most 100,000": "1\n" + "2" * 200_000,
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_refusal_names_the_line_the_column_and_the_field(message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        read(REFUSED[message])
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200
