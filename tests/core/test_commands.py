"""The measuring commands except ``depth``: their output, exit codes and start-up."""

import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
import soundfile
from commanded import Command, assert_refused
from PIL import Image
from scipy.signal import resample_poly
from straight_and_raw import RIG, T

import stereolag as sl
from benchmarks.recording_bytes import filmed
from stereolag.commands import MEASURING
from stereolag.geometry.boards import Board
from stereolag.geometry.drawn_boards import drawn_pairs
from stereolag.io.images import image_png, image_tiff
from stereolag.io.pairing import board_pictures

PROJECT = Path(__file__).resolve().parents[2]
SQUARE_M, PAIRS = 0.03, 11


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with recordings, pictures and boards.

    Two recordings 123 samples apart, in several formats and rates. A picture, a template from its rows 20 to 40 and
    columns 30 to 60, and an unrelated one. Pictures of a board in ``sides/left`` and ``sides/right``, the same in
    ``flat``, and as ``pairs.zip``.
    """
    folder = tmp_path_factory.mktemp("files")
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, 4123)
    first, second = noise[123:], noise[:4000]
    sounds = {"first": (first, 8000), "second": (second, 8000), "faster": (resample_poly(second, 2, 1), 16000)}
    sounds |= {"both": (np.column_stack([first, second]), 8000)}
    sounds |= {"other": (np.random.default_rng(1).uniform(-0.5, 0.5, 4000), 8000), "silence": (np.zeros(4000), 8000)}
    for name, (heard, rate) in sounds.items():
        soundfile.write(folder / f"{name}.wav", heard, rate)
    np.savetxt(folder / "first.txt", first)
    np.savetxt(folder / "second.txt", second)

    picture = np.random.default_rng(0).integers(0, 255, (100, 120, 3), dtype=np.uint8)
    stranger = picture[::-1, ::-1][50:70, 50:80].copy()
    images = {"image": picture, "template": picture[20:40, 30:60].copy(), "stranger": stranger}
    for side in ("left", "right"):
        (folder / "sides" / side).mkdir(parents=True)
    (folder / "flat").mkdir()
    for number, pair in enumerate(drawn_pairs(RIG, Board(6, 4), PAIRS, square_m=SQUARE_M, seed=3)):
        for side, image in zip(("left", "right"), pair, strict=True):
            images |= {f"sides/{side}/{number}": image, f"flat/{side}{number}": image}
    for name, image in images.items():
        (folder / f"{name}.png").write_bytes(image_png(image))
    with zipfile.ZipFile(folder / "pairs.zip", "w") as archive:
        for path in sorted((folder / "sides").rglob("*.png")):
            archive.write(path, path.relative_to(folder / "sides"))
    (folder / "text.txt").write_text("no ZIP")
    (folder / "cut.zip").write_bytes(b"PK\x03\x04" + bytes(99))
    return folder


@pytest.fixture(autouse=True)
def _in_the_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)


@pytest.mark.parametrize(
    "files",
    [("first.wav", "second.wav"), ("both.wav",), ("both.wav", "second.wav"), ("both.wav", "--channels", "1", "2")],
)
def test_lag_tells_samples_and_metres(files: tuple[str, ...], ran: Command) -> None:
    figures = ran("lag", *files, "--speed", 340, "--json").figures
    assert (figures["lag_samples"], figures["settings"]["sampling_rate"]) == (123, 8000)
    assert figures["distance_m"] == pytest.approx(123 / 8000 * 340)
    said = ran("lag", *files).out
    assert said.startswith("lag       123 samples")
    assert "verdict   sure: a clear peak" in said


@pytest.mark.parametrize("seed", [2, 3])
def test_no_lag_has_no_sign(seed: int, ran: Command) -> None:
    np.savetxt("same.txt", np.random.default_rng(seed).normal(size=800).round(3), "%.3f")
    told = ran("lag", "same.txt", "same.txt")
    assert told.out.startswith("lag       0 samples (0.00 with its fraction)")
    assert "doubtful: Both recordings are one signal" in told.out
    assert (told.code, ran("lag", "first.wav", "second.wav").code) == (3, 0)


def test_lag_gives_no_metres_where_it_is_not_sure(ran: Command) -> None:
    tone = 0.5 * np.sin(2 * np.pi * np.arange(4100) / 100)
    soundfile.write("tone_1.wav", tone[:4000], 8000)
    soundfile.write("tone_2.wav", tone[100:], 8000)
    soundfile.write("turned.wav", -soundfile.read("second.wav")[0], 8000)
    for files, verdict in (
        (("first.wav", "other.wav"), "verdict   nothing: the highest point is at chance level"),
        (("first.wav", "second.wav", "--max-lag", "0"), "verdict   nothing: only a lag of 0 was searched"),
        (("tone_1.wav", "tone_2.wav"), "verdict   ambiguous: it repeats"),
        (("first.wav", "turned.wav"), "opposite  123 samples, with the sign of one recording reversed"),
    ):
        told = ran("lag", *files)
        assert verdict in told.out
        assert " m " not in told.out and told.out.startswith("highest   at ")
        assert told.code == 3


def test_lag_tells_steps_and_arrivals_and_writes_the_second_recording_on_the_clock_of_the_first(ran: Command) -> None:
    noise = np.random.default_rng(2).uniform(-0.3, 0.3, 40_000)
    second = np.delete(noise, slice(20_000, 20_400))
    second[500:] += 0.5 * second[:-500]
    soundfile.write("whole.wav", noise[300:], 8000)
    soundfile.write("lossy.wav", second, 8000)
    for name in ("out.wav", "out.CSV"):
        told = ran("lag", "whole.wav", "lossy.wav", "--aligned", name)
        assert ran("lag", "whole.wav", name).out.startswith("lag       0 samples")
    assert "over time 300 samples later until 2.5 s, then 100 earlier: 0.05 s are missing in recording 2" in told.out
    assert re.search(r"^arrivals  300 \(\d+\.\d σ\), 800 \(\d+\.\d σ\)", told.out, re.MULTILINE)
    for name in ("none/out.wav", "none/out.csv"):
        missing = ran("lag", "whole.wav", "lossy.wav", "--aligned", name)
        assert missing.err == f"stereolag lag: {name}: No such file or directory.\n"
    refused = ran("lag", "whole.wav", "other.wav", "--aligned", "none.wav")
    assert (refused.code, Path("none.wav").exists()) == (4, False)
    assert "The lag is 'nothing' (chance), and only one that is sure is undone" in refused.err


def test_lag_takes_the_rate_that_is_given_before_that_of_the_files_and_says_what_it_assumes(ran: Command) -> None:
    assumed = "at 44100 samples a second, assumed\ndistance  0.928776 m of path at 333 m/s, assumed\n"
    assert assumed in ran("lag", "first.txt", "second.txt").out
    texts, sounds = ("first.txt", "second.txt"), ("first.wav", "second.wav")
    for arguments, rate, expected in (
        (texts, 44_100, {"speed": 333, "sampling_rate": 44_100}),
        ((*texts, "--speed", 333), 44_100, {"sampling_rate": 44_100}),
        ((*texts, "--speed", 333, "--sampling-rate", 1000), 1000, {}),
        (sounds, 8000, {"speed": 333}),
        ((*sounds, "--sampling-rate", 1000), 1000, {"speed": 333}),
    ):
        told = ran("lag", *arguments, "--json").figures
        assert (told["assumed"], told["time_s"]) == (expected, pytest.approx(123 / rate))


def test_lag_brings_two_rates_to_one_and_tells_what_it_compares(folder: Path, ran: Command) -> None:
    figures = ran("lag", "first.wav", "faster.wav", "--json").figures
    assert (figures["lag_samples"], figures["settings"]["sampling_rate"]) == (123, 8000)
    told = [(one["resampled"], one["sampling_rate_in_file"], one["samples"]) for one in figures["recordings"]]
    assert told == [(False, 8000, 4000), (True, 16000, 4000)]
    said = ran("lag", "first.wav", "faster.wav").out
    assert "faster.wav: 0.5 s, 4000 samples at 8000 Hz, resampled from 16000 Hz" in said
    lines = (folder / "first.txt").read_bytes().split(b"\n")
    (folder / "damaged.txt").write_bytes(b"\n".join([*lines[:5], lines[5] + b"\0", *lines[6:]]))
    said = ran("lag", "damaged.txt", "second.txt").out
    assert "at 44100 Hz, rate assumed, the file states none, 1 damaged line mended" in said
    assert "channel 2 of 2" in ran("lag", "both.wav").out


def test_lag_tells_tracks_gaps_and_how_far_apart_dated_recordings_begin(tmp_path: Path, ran: Command) -> None:
    sound = np.random.default_rng(0).normal(scale=0.1, size=4100).round(4)
    film = tmp_path / "film.mkv"
    film.write_bytes(filmed("matroska", "flac", sound[100:], sound[:-100], languages=["eng", "deu"]))
    for tracks in (("1", "2"), ("1", "2 (deu)")):
        assert ran("lag", film, "--tracks", *tracks, "--json").figures["lag_samples"] == 100
    assert "track 2 of 2" in ran("lag", film, film, "--tracks", "2", "1").out
    texts = (
        "".join(f"2024-05-13T10:00:{i / 100:09.6f},{sound[i + 37]},ok\n" for i in range(3000)),
        "".join(f"13.05.2024;10:00:{5 + i / 100:06.3f};{sound[i]}\n" for i in range(3000) if not 1000 <= i < 1300),
    )
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    told = ran("lag", *paths, "--json").figures
    assert (told["lag_samples"], told["settings"]["sampling_rate"], told["starts_apart_s"]) == (37, 100, 5)
    assert told["recordings"][1]["gaps"] == [[pytest.approx(9.99), pytest.approx(3)]]
    assert told["recordings"][0]["start"] == "2024-05-13T10:00:00+00:00"
    said = ran("lag", *paths).out
    assert "By their own clocks, the second recording begins +5 s after the first." in said
    assert "3 s missing after 9.99 s, filled, begins 2024-05-13 10:00:05" in said
    assert "words left out: column 3" in said


def test_a_ratio_without_end_is_null(tmp_path: Path, ran: Command) -> None:
    np.savetxt(tmp_path / "a.txt", [0, 0, 1, 0])
    told = ran("lag", tmp_path / "a.txt", tmp_path / "a.txt", "--max-lag", 0, "--json")
    assert told.figures["peak_ratio"] is None


def test_a_frame_of_an_animation_can_be_searched_and_its_number_is_told(ran: Command, tmp_path: Path) -> None:
    scene, other = (Image.open(name).convert("RGB") for name in ("image.png", "stranger.png"))
    other.resize(scene.size).save(tmp_path / "scenes.tif", save_all=True, append_images=[scene])
    found = "row 20, column 30, score 1.000\n" + f"{tmp_path / 'scenes.tif'}: frame 2 of 2\n"
    assert ran("find", tmp_path / "scenes.tif", "template.png", "--frames", 2, 1).out == found
    told = ran("find", tmp_path / "scenes.tif", "template.png", "--json")
    assert [(one["frame"], one["frames"]) for one in told.figures["images"]] == [(1, 2), (1, 1)]
    assert "no frame 3; it holds 2" in ran("find", tmp_path / "scenes.tif", "template.png", "--frames", 3, 1).err


def test_find_tells_how_many_places_hold_missing_values(ran: Command, tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(2, 0.3, (40, 60)).astype(np.float32)
    (tmp_path / "template.tif").write_bytes(image_tiff(heights[20:30, 40:52]))
    left_out = "13 % of the places hold missing values and were left out.\n"
    for mark in (np.nan, -32768):
        heights[:10, :20] = mark
        (tmp_path / "heights.tif").write_bytes(image_tiff(heights))
        told = ran("find", tmp_path / "heights.tif", tmp_path / "template.tif")
        assert told.out == f"row 20, column 40, score 1.000\n{left_out}"


def test_find_ends_with_three_where_there_is_nothing(ran: Command) -> None:
    arguments = "find", "image.png", "stranger.png", "--min-score", "0.9"
    told = ran(*arguments)
    assert (told.code, ran(*arguments, "--json").code) == (3, 3)
    assert told.out.startswith("Not found: no place scores 0.9 or more. The best: row ")
    assert told.out.endswith("Other sizes and angles: --min-scale, --max-scale, --max-rotation.\n")
    assert "--max-scale" not in ran(*arguments, "--max-rotation", "3").out
    assert "3 nothing is found" in ran("find", "--help").out.replace("\n", " ")


def test_find_tells_size_angle_and_look_alikes(ran: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    noise = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (100, 120, 3), dtype=np.uint8), (0, 0), 2)
    cut = noise[20:50, 30:60]
    larger = cv2.resize(cut, (40, 40), interpolation=cv2.INTER_AREA)
    for name, image in {"image": noise, "twice": np.hstack([noise, noise]), "cut": cut, "larger": larger}.items():
        Path(f"{name}.png").write_bytes(image_png(image))
    told = ran("find", "image.png", "larger.png", "--min-scale", "0.6", "--max-rotation", "10")
    assert told.code == 0
    assert re.match(r"row (20|21), column (30|31), score 0\.9\d+, size 0\.7\d, turned [+-]\d\.\d°\n", told.out)
    told = ran("find", "twice.png", "cut.png")
    assert told.code == 3
    first, *places = told.out.splitlines()
    assert first == "Not found: 2 places fit about equally well."
    assert sorted(places) == ["row 20, column 150, score 1.000", "row 20, column 30, score 1.000"]
    assert ran("find", "twice.png", "cut.png", "--max-matches", "2").code == 0


def test_find_prints_no_place_that_cannot_be_relied_on(ran: Command, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 200, (200, 240), dtype=np.uint8)
    image = cv2.GaussianBlur(noise, (0, 0), 1.0)
    template = image[40:60, 70:100].copy()
    for place in (np.s_[100:120, 180:210], np.s_[140:160, 20:50]):
        image[place] = np.rint(0.42 * template + 0.58 * image[place])
    files = tmp_path / "image.png", tmp_path / "template.png"
    for path, pixels in zip(files, (image, template), strict=True):
        path.write_bytes(image_png(pixels))
    figures = ran("find", *files, "--max-matches", "2", "--json").figures
    assert (len(figures["matches"]), figures["clear"]) == (2, 1)
    told = ran("find", *files, "--max-matches", "2")
    assert (told.code, told.out) == (0, "row 40, column 70, score 1.000\n")


def test_calibrate_finds_the_camera_and_writes_what_others_read(tmp_path: Path, ran: Command) -> None:
    arguments = ("--square", SQUARE_M, "--out", tmp_path, "--json")
    told = ran("calibrate", "pairs.zip", *arguments)
    figures = told.figures
    assert (told.code, len(figures["doubts"]) > 0) == (3, True)
    assert (figures["pairs"], figures["board"]) == (PAIRS, [6, 4])
    assert figures["pairs_used"] >= PAIRS - 1
    assert figures["rms_px"] < 0.5
    assert figures["baseline_m"] == pytest.approx(np.linalg.norm(T), rel=0.02)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(figures["files"])
    for files in (["stereo.yml"], ["calibration.json"], ["left.yaml", "right.yaml"]):
        read = sl.read_calibration(*(tmp_path / name for name in files))
        assert read.focal_px == pytest.approx(figures["focal_px"], rel=1e-6)
        assert read.baseline_m == pytest.approx(figures["baseline_m"], rel=1e-6)


@pytest.mark.parametrize(
    "pictures",
    [["sides"], ["flat"], ["pairs.zip"], ["flat/left*.png", "flat/right*.png"], ["sides/left", "sides/right"]],
    ids=str,
)
def test_pictures_are_paired_however_they_are_given(pictures: list[str]) -> None:
    names, pairs = board_pictures(pictures)
    assert len(names) == len(pairs) == PAIRS
    for number, pair in enumerate(pairs):
        for side, image in zip(("left", "right"), pair, strict=True):
            np.testing.assert_array_equal(image, sl.read_image(f"flat/{side}{number}.png"))


@pytest.mark.parametrize(
    ("command", "code", "said"),
    [
        ("lag first.wav", 4, "channel 2 is asked for, and first.wav has channel 1"),
        ("lag first.wav second.wav --channels 1 0", 4, "channel 0 is asked for, and second.wav has channel 1"),
        ("lag first.wav silence.wav", 4, "silence.wav"),
        ("lag first.wav none.wav", 4, "none.wav: No such file or directory."),
        ("lag first.wav second.wav --aligned out.mp3", 2, "--aligned is out.mp3; its name ends in .wav"),
        ("lag first.wav second.wav --speed 0", 2, "--speed is 0; allowed are numbers above 0."),
        (
            "lag first.wav second.wav --maxlag 9",
            2,
            "The search for a lag has no setting '--maxlag'; did you mean --max-lag?",
        ),
        ("find template.png image.png", 4, "template is 120 × 100 pixels"),
        ("find image.png template.png --min-score 2", 2, "--min-score is 2; allowed are numbers from 0 to 1."),
        ("find image.png template.png --mask image.png", 4, "mask"),
        ("find image.png", 2, "TEMPLATE"),
        ("calibrate flat", 2, "--square"),
        ("calibrate flat --square 3cm", 2, "'3cm' is not a length; allowed are metres above 0"),
        ("calibrate flat --square 0", 2, "'0' is not a length"),
        ("calibrate flat --square 1 --board 6-4", 2, "'6-4' is not a board"),
        ("calibrate flat --square 1 --board 1x4", 2, "allowed are 2 to 50 inner corners"),
        ("calibrate flat --square 1 --board 2x4", 4, "has 2 × 4 inner corners; at least 3 × 3 are needed"),
        ("calibrate flat/left1.png flat/right1.png --square 1 --board 6x4", 4, "pairs"),
        ("calibrate none --square 1 --out new", 4, "none: there is no such file or folder."),
        ("calibrate cut.zip --square 1", 4, "cut.zip: The archive is not a ZIP file, or it is damaged"),
        ("calibrate text.txt --square 1", 4, "text.txt is one file but not a ZIP"),
        ("calibrate flat/left*.png flat/x*.png --square 1", 4, "flat/x*.png: no file matches."),
        ("calibrate flat/left*.png flat/right1*.png --square 1", 4, "matches 11 files and flat/right1*.png 2"),
        ("calibrate sides/left --square 1", 4, "No left and right pictures match by name"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(command: str, code: int, said: str, ran: Command) -> None:
    name, *arguments = command.split()
    assert_refused(ran(name, *arguments), name, code, said)
    assert not Path("new").exists()


def by_console(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run code that may call ``main`` in its own process, as the console script does."""
    code = f"import sys\nfrom stereolag.commands import main\n{code}"
    command = [sys.executable, "-W", "error", "-c", code, *map(str, arguments)]
    return subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=False)


def loaded(names: set[str]) -> str:
    """Return code that prints as an error which of these modules are imported."""
    return f"print(*{names} & set(sys.modules), file=sys.stderr)"


def test_a_process_that_refuses_ends_with_the_code_and_depth_brings_in_no_screen(folder: Path, tmp_path: Path) -> None:
    refused = by_console("sys.exit(main())", "find", folder / "image.png", folder / "none.png")
    assert (refused.returncode, refused.stdout) == (4, "")
    assert "Traceback" not in refused.stderr
    noise = np.random.default_rng(0).integers(0, 255, (60, 127, 3), dtype=np.uint8)
    pair = tmp_path / "left.png", tmp_path / "right.png"
    for path, image in zip(pair, (noise[:, :-7], noise[:, 7:]), strict=True):
        path.write_bytes(image_png(image))
    (tmp_path / "camera.json").write_text(json.dumps({"focal_px": 100.0, "baseline_m": 0.2}))
    unneeded = loaded({"streamlit", "plotly", "pandas", "scipy.fft", "scipy.linalg", "scipy.spatial"})
    given = ("depth", *pair, "--calibration", tmp_path / "camera.json", "--out", tmp_path / "out", "--json")
    ran = by_console(f"main()\n{unneeded}", *given)
    assert (ran.returncode, ran.stderr) == (0, "\n")
    assert "cloud.ply" in json.loads(ran.stdout)["files"]


HELP = """
for command in ("lag", "find", "calibrate"):
    try:
        main([command, "--help"])
    except SystemExit:
        pass
"""


def test_help_waits_for_nothing() -> None:
    ran = by_console(HELP + loaded({"numba", "scipy", "cv2", "streamlit", "plotly"}))
    assert ran.stdout.count("exit codes") == 3
    assert (ran.returncode, ran.stderr) == (0, "\n")


def test_the_list_of_commands_is_in_the_help(ran: Command) -> None:
    said = ran("--help").out
    for name, gives in MEASURING.items():
        assert name in said
        assert gives in " ".join(said.split())
