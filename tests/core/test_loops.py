"""Compilation, machine code and bands of rows."""

import ast
import contextlib
import importlib
import inspect
import io
import logging
import multiprocessing
import os
import pkgutil
import re
import shutil
import subprocess
import sys
import threading
import time
import weakref
from itertools import chain
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

import numba
import numpy as np
import pytest

import stereolag
import stereolag as sl
from stereolag.core.jobs import silent
from stereolag.loops import bands, compilation, numba_inside
from stereolag.loops.bands import available_cores, in_threads, lone_threads, over_bands, row_bands
from stereolag.loops.compilation import MAKES_CODE, SOURCES, Loop, compiled
from stereolag.loops.memory import CACHE_LINE, MAX_KEPT_BYTES, release_memory, volume
from stereolag.samples import recordings, stereo_pairs
from stereolag.stereo import compiling
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import PresetName
from stereolag.warming import OF_PAGES, PARTS

COMPILATION = Path(compilation.__file__).relative_to(SOURCES)

TWO_LOOPS = """
from stereolag.loops.compilation import compiled
from stereolag.loops.inner import inner
@compiled
def outer(number):
    return inner(number)
"""
INNER = """
from stereolag.loops.compilation import compiled
@compiled
def inner(number):
    return number + {}
"""

pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")


class Start:
    """A process that has imported the two loops of a folder; it calls them when told, and ends.

    A fork, because Numba takes seconds to load.
    """

    def __init__(self, folder: Path, **variables: str) -> None:
        self._pipe, theirs = multiprocessing.Pipe()
        environment = variables_for(folder) | variables
        process = multiprocessing.get_context("fork").Process(target=called, args=(folder, environment, theirs))
        process.start()
        theirs.close()
        assert self._pipe.recv() == "ready"

    def go(self) -> "Start":
        self._pipe.send("go")
        return self

    def said(self) -> tuple[int, str]:
        """Return the answer of the loops and what was written to stderr."""
        return self._pipe.recv()


def called(folder: Path, environment: dict[str, str], told: Connection) -> None:
    """Import the two loops of a folder, in this environment, and call them when told."""
    os.environ.clear()
    os.environ.update(environment)
    sys.path.insert(0, str(folder.parents[1]))
    sys.dont_write_bytecode = True
    for name in [name for name in sys.modules if name.partition(".")[0] == "stereolag"]:
        del sys.modules[name]
    logging.getLogger().handlers.clear()
    with contextlib.redirect_stderr(io.StringIO()) as errors:
        outer = importlib.import_module("stereolag.loops.outer").outer
        told.send("ready")
        told.recv()
        answer = outer(1)
    told.send((answer, errors.getvalue()))


def run(folder: Path, **variables: str) -> tuple[int, str]:
    """Run the two loops of a folder; return their answer and what was written to stderr."""
    return Start(folder, **variables).go().said()


@pytest.fixture
def loops(tmp_path: Path) -> Path:
    """Return a folder with only the decorator and two loops, one of which calls the other."""
    return two_loops(tmp_path / "package")


@pytest.fixture(scope="module", autouse=True)
def _numba_ready() -> None:
    numba.njit(lambda: 0)()


def two_loops(package: Path, number: int = 1) -> Path:
    """Make a package that contains only a folder with the decorator and two loops, and return that folder."""
    room = package / "stereolag" / "loops"
    room.mkdir(parents=True)
    for source in ("__init__.py", "loops/__init__.py", "loops/compilation.py", "loops/numba_inside.py"):
        shutil.copy(SOURCES / source, room.parent / source)
    room.parent.joinpath("__init__.py").write_text("")
    (room / "outer.py").write_text(TWO_LOOPS)
    (room / "inner.py").write_text(INNER.format(number))
    return room


def variables_for(folder: Path) -> dict[str, str]:
    """Return the environment of a user without a home, with a temporary folder beside `folder`."""
    temporary = folder.parent / "temporary"
    temporary.mkdir(exist_ok=True)
    nowhere = folder.parent / "a file"
    nowhere.touch()
    return {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "XDG_CACHE_HOME": str(nowhere),
        "TMPDIR": str(temporary),
    }


def code_in(folder: Path) -> dict[str, int]:
    """Return the machine code files anywhere in a folder, with their modification times."""
    return {str(file): file.stat().st_mtime_ns for file in folder.rglob("*.code")}


def test_a_first_start_keeps_machine_code_beside_the_sources_and_later_ones_load_it_without_numba(loops: Path) -> None:
    def started() -> str:
        script = "import sys; from stereolag.loops.outer import outer; print(outer(1), 'numba' in sys.modules)"
        command = [sys.executable, "-B", "-W", "error", "-c", script]
        environment = variables_for(loops.parents[1])
        return subprocess.check_output(command, env=environment, cwd="/", stderr=subprocess.STDOUT, text=True)

    assert started() == "2 True\n"
    code = code_in(loops / "__pycache__")
    assert code and code_in(loops.parents[2]) == code
    assert started() == "2 False\n"
    damaged = Path(next(iter(code)))
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"?")
    assert started() == "2 True\n"
    assert started() == "2 False\n"


def test_without_a_place_beside_the_sources_code_is_kept_in_the_user_s_cache_folder(loops: Path) -> None:
    (loops / "__pycache__").touch()  # a file: not even root can create a folder there
    cache = loops.parent / "cache"
    first = run(loops, XDG_CACHE_HOME=str(cache))
    kept = code_in(cache)
    assert run(loops, XDG_CACHE_HOME=str(cache)) == first
    assert kept and code_in(cache) == kept
    assert cache.joinpath("stereolag").stat().st_mode & 0o077 == 0
    answer, said = first
    assert answer == 2 and said.count("\n") == 1
    assert said.startswith(f"Machine code is kept in {cache / 'stereolag'}: ")
    assert said.endswith("set NUMBA_CACHE_DIR to a folder that only this user can write to.\n")


def test_without_any_place_loops_are_compiled_anew_unless_the_operator_names_one(loops: Path) -> None:
    (loops / "__pycache__").touch()
    answer, said = run(loops)
    assert answer == 2 and said.count("\n") == 1
    assert said.startswith("Machine code is not kept, and compiled anew at every start")
    assert not code_in(loops.parent)
    assert run(loops, NUMBA_CACHE_DIR=str(loops.parent / "named")) == (2, "")
    assert code_in(loops.parent / "named")


def test_an_answer_is_never_that_of_older_sources_whatever_their_dates(loops: Path) -> None:
    def answer(mtime: int) -> tuple[int, str]:
        for source in loops.glob("*.py"):
            os.utime(source, (mtime, mtime))
        return run(loops)

    late = 4_000_000_000
    assert answer(late) == (2, "")
    kept = code_in(loops)
    assert answer(0) == (2, "")
    assert code_in(loops) == kept
    for number, mtime in ((2, 0), (3, late)):
        (loops / "inner.py").write_text(INNER.format(number))
        assert answer(mtime) == (number + 1, "")


def test_processes_that_start_at_once_keep_the_code_of_their_own_sources(tmp_path: Path) -> None:
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    releases = [two_loops(tmp_path / "older", 1), two_loops(tmp_path / "newer", 2)]
    begun = [process.go() for process in [Start(loops, **kept) for loops in 2 * releases]]
    assert [process.said() for process in begun] == 2 * [(2, ""), (3, "")]
    code = code_in(tmp_path / "kept")
    assert len({Path(file).relative_to(tmp_path / "kept").parts[0] for file in code}) == 2
    assert [run(loops, **kept) for loops in releases] == [(2, ""), (3, "")]
    assert code_in(tmp_path / "kept") == code


def test_an_upgrade_leaves_a_process_its_code_until_it_is_long_unused_and_takes_none_from_it(loops: Path) -> None:
    assert run(loops) == (2, "")
    running = Start(loops)
    (older,) = (loops / "__pycache__").iterdir()
    code = code_in(older)
    others = [loops / "__pycache__" / name for name in ("another", "stereolag-notes")]
    for other in others:
        other.mkdir()
        os.utime(other, (0, 0))
    (loops / "inner.py").write_text(INNER.format(2))
    assert run(loops) == (3, "")
    assert code_in(older) == code
    os.utime(older, (0, 0))
    (loops / "inner.py").write_text(INNER.format(3))
    assert run(loops) == (4, "")
    assert not older.exists()
    assert all(other.exists() for other in others)
    assert running.go().said() == (2, "")
    assert code_in(older)
    assert run(loops) == (4, "")


def modules_with_loops() -> dict[ModuleType, list[Loop]]:
    """Return every module of the library that defines loops, with these."""
    names = [module.name for module in pkgutil.walk_packages(stereolag.__path__, "stereolag.")]
    library = [importlib.import_module(name) for name in names if name.split(".")[1] not in ("ui", "app", "commands")]
    compiled_in = {
        module: [
            value
            for value in vars(module).values()
            if isinstance(value, Loop) and value.py_func.__module__ == module.__name__
        ]
        for module in library
    }
    return {module: found for module, found in compiled_in.items() if found}


def test_every_loop_is_kept_in_the_folder_that_is_named_by_all_that_loops_are_made_of() -> None:
    constants = 0
    for module, found in modules_with_loops().items():
        assert MAKES_CODE.search(Path(inspect.getfile(module)).read_bytes()), module
        used = {name for loop in found for name in loop.py_func.__code__.co_names}
        for statement in ast.walk(ast.parse(inspect.getsource(module))):
            if isinstance(statement, ast.ImportFrom) and str(statement.module).startswith("stereolag."):
                borrowed = used & {alias.asname or alias.name for alias in statement.names}
                source = Path(inspect.getfile(sys.modules[str(statement.module)])).read_bytes()
                assert not borrowed or MAKES_CODE.search(source), (module, statement.module, borrowed)
                constants += len(borrowed)
    assert constants


def test_nothing_is_divided_by_zero_with_an_error_and_nan_is_an_answer() -> None:
    @compiled
    def ratio(a: float, b: float) -> float:
        return a / b

    @compiled(fastmath={"reassoc", "contract"})
    def loose(a: float, b: float) -> float:
        return a / b

    for function in (ratio, loose):
        assert np.isnan(function(0.0, 0.0)) and function(1.0, 0.0) == np.inf


def of_each_kind(numbers: np.ndarray, pair: tuple[int, np.ndarray], factor: float = 2.0) -> tuple[np.ndarray, float]:
    """Return an array and a number made of arrays, a tuple and a number."""
    if numbers.size < 2:
        raise ValueError("too few")
    return factor * numbers[::-1].astype(np.float64) + pair[0] * pair[1], numbers.sum()


def test_a_loop_takes_every_kind_of_argument_and_its_kept_code_answers_as_it_did() -> None:
    loop = compiled(of_each_kind)
    numbers = (np.random.default_rng(1).random((8, 6)) * 9).astype(np.uint8)
    fixed = numbers[:, 1].copy()
    fixed.flags.writeable = False
    columns = (numbers[:, 1], numbers[:, 1].copy(), fixed)
    for column, factors in zip(columns, ((), (np.float32(0.5),), (3,)), strict=True):
        pair = (2, np.arange(float(column.size)))
        expected = of_each_kind(column, pair, *factors)
        arguments = (column, pair, *(factors or of_each_kind.__defaults__))
        kept = numba_inside.compile_loop(loop.for_python(), arguments)[1]
        again = numba_inside.load(numba_inside.MachineCode.unpacked(kept.packed()), of_each_kind)
        for found in (loop(column, pair, *factors), again(*arguments)):
            assert np.array_equal(found[0], expected[0]) and found[1] == expected[1]
    with pytest.raises(ValueError, match="too few"):
        again(fixed[:1], pair, 3)
    assert numba_inside.load(kept._replace(calls=("no_such_function",)), of_each_kind) is None
    with pytest.raises(TypeError, match="not str"):
        loop("text", pair)


@pytest.mark.parametrize("name", ["fast", "accurate"])
def test_the_process_that_helps_compiles_what_completes_a_map(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    called: set[tuple[str, object]] = set()
    run = Loop.__call__

    def noted(loop: Loop, *arguments: object) -> object:
        called.add((f"{loop.__module__}.{loop.__qualname__}", tuple(map(compilation._kind, arguments))))
        return run(loop, *arguments)

    monkeypatch.setattr(Loop, "__call__", noted)
    matcher = sl.preset(name, num_disparities=16)
    left = np.random.default_rng(0).integers(0, 256, (40, 80, 3), dtype=np.uint8)
    matcher.compute(left, np.roll(left, -4, axis=1))
    needed = {one for one in called if ".finishing." in one[0] or ".pixels." in one[0]}
    called.clear()
    compiling.complete(matcher, left, left)
    assert not any(".scores." in name or ".cost." in name for name, _ in called)
    assert len(called) > 5 and len(needed - called) <= 0.2 * len(needed), needed - called


def test_a_loop_that_counts_no_references_leaves_those_of_its_arrays() -> None:
    @compiled(counted=False)
    def double(row: Any) -> None:
        for x in range(row.size):
            row[x] *= 2

    @compiled(counted=False)
    def double_rows(arrays: Any) -> float:
        first, second = arrays
        for y in range(first.shape[0]):
            double(first[y])
            double(second[y, 1:])
        return float(second[0, -1])

    values = np.ones((30, 5)), np.ones((30, 5))
    before = [sys.getrefcount(one) for one in values]
    assert double_rows(values) == 2
    assert [sys.getrefcount(one) for one in values] == before
    assert (values[0] == 2).all() and (values[1][:, 1:] == 2).all() and (values[1][:, 0] == 1).all()


def test_the_first_that_compiles_is_helped_by_another_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "sharing.py").write_text("def compile_share(path, text):\n    open(path, 'w').write(text)\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compilation, "FOLDER", tmp_path)
    monkeypatch.setattr(compilation, "_HELP_TAKEN", threading.Lock())
    started: list[object] = []
    start = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *asked, **more: started.append(asked) or start(*asked, **more))
    told = tmp_path / "told"
    with compilation.compiling_beside("sharing", str(told), "compiled"):
        while not (told.exists() and told.read_text()):
            time.sleep(0.01)
    assert told.read_text() == "compiled"
    with compilation.compiling_beside("sharing", str(told), "again"):
        pass
    assert len(started) == 1
    monkeypatch.setattr(compilation, "_HELP_TAKEN", threading.Lock())
    (tmp_path / "loop.code").touch()
    with compilation.compiling_beside("sharing", str(told), "again"):
        pass
    assert len(started) == 1


@pytest.mark.parametrize("all_of_them", [False, True], ids=["pages", "all"])
def test_once_warm_nothing_is_left_to_compile_or_load(monkeypatch: pytest.MonkeyPatch, all_of_them: bool) -> None:
    for loop in chain.from_iterable(modules_with_loops().values()):
        monkeypatch.setattr(loop, "_code", {})
    for part in PARTS if all_of_them else OF_PAGES:
        part()
    late: list[str] = []
    find = Loop._find_code

    def noted(loop: Loop, *asked: Any) -> Any:
        late.append(loop.__qualname__)
        return find(loop, *asked)

    monkeypatch.setattr(Loop, "_find_code", noted)
    matchers: list[StereoMatcher] = [sl.preset("fast")]
    if all_of_them:
        matchers += [*map(sl.preset, get_args(PresetName)), sl.CorrelationMatcher(), sl.SemiGlobalMatcher()]
    for example in ("cube", "square"):
        pair = stereo_pairs()[example]
        # Parts of them run the same loops on the same types of arguments.
        images = [sl.read_image(side)[100:260, 100:340].copy() for side in (pair.left, pair.right)]
        for matcher in matchers:
            matcher.compute(*images)
    if all_of_them:
        sl.optical_flow(*images)
    sl.match_template(images[0], images[0][20:60, 30:80])
    for heard in recordings().values():
        sl.signal_lag(sl.read_signal(heard.signal_1), sl.read_signal(heard.signal_2))
    assert not late


def test_nothing_else_imports_numba_or_compiles() -> None:
    sources = {path: path.read_text(encoding="utf-8") for path in SOURCES.rglob("*.py")}
    importing = re.compile(r"^\s*(?:from|import) (?:numba|llvmlite)\b", re.MULTILINE)
    assert {path.parent.name for path, source in sources.items() if importing.search(source)} == {"loops"}
    compiling = re.compile(r"\b(?:njit|jit|vectorize|guvectorize|generated_jit|cfunc|stencil)\b")
    assert {path for path, source in sources.items() if compiling.search(source)} == {SOURCES / COMPILATION}
    with_loops = {path.relative_to(SOURCES).parts[0] for path, source in sources.items() if "\n@compiled" in source}
    assert with_loops <= set(compilation.WITH_LOOPS)


@pytest.mark.parametrize("rows", [1, 2, 7, 100])
@pytest.mark.parametrize("max_rows", [1, 3, 1000])
def test_bands_cover_every_row_once(rows: int, max_rows: int) -> None:
    seen: list[int] = []
    lock = threading.Lock()

    def work(first: int, end: int) -> None:
        assert end - first <= max_rows
        with lock:
            seen.extend(range(first, end))

    told: list[float] = []
    over_bands(work, rows, max_rows=max_rows, progress=told.append)
    assert sorted(seen) == list(range(rows))
    assert told == sorted(told)
    bands = len(row_bands(rows, max_rows))
    assert len(set(told)) == (bands if bands > available_cores() else 1)
    assert told[-1] == 1


def test_a_short_job_does_not_wait_for_all_of_a_long_one() -> None:
    """Submitting all bands at once used to make the short job wait for the last of them."""
    bands = 40 * available_cores()
    begun = threading.Event()

    def slow(first: int, end: int) -> None:
        begun.set()
        time.sleep(0.02)

    long_job = threading.Thread(target=over_bands, args=(slow, bands), kwargs={"max_rows": 1})
    long_job.start()
    begun.wait()
    over_bands(lambda first, end: None, 2)
    assert long_job.is_alive()
    long_job.join()


def test_work_of_a_lone_thread_stays_in_it() -> None:
    def work() -> set[int]:
        seen: set[int] = set()
        over_bands(lambda first, end: seen.add(threading.get_ident()), 1000, max_rows=10)
        assert seen == {threading.get_ident()}
        return seen

    with lone_threads("test") as threads:
        pieces = [threads.submit(work) for _ in range(20)]
        assert 1 <= len(set().union(*(one.result() for one in pieces))) <= available_cores()


@pytest.mark.parametrize("progress", [silent, lambda fraction: None])
def test_no_jobs_have_no_results_and_an_error_is_raised_once_all_that_began_has_ended(progress, monkeypatch):
    monkeypatch.setattr(bands, "available_cores", lambda: 2)
    assert in_threads([], progress) == []
    begun, ended = threading.Event(), threading.Event()

    def own() -> None:
        assert begun.wait(10)
        raise ValueError("a bad job")

    def other() -> None:
        begun.set()
        time.sleep(0.05)
        ended.set()

    with pytest.raises(ValueError, match="a bad job"):
        in_threads([own, other], progress)
    assert ended.is_set()


def test_the_first_error_ends_the_job() -> None:
    done: list[int] = []

    def work(first: int, end: int) -> None:
        if first == 0:
            raise ValueError("a bad row")
        time.sleep(0.01)
        done.append(first)

    with pytest.raises(ValueError, match="a bad row"):
        over_bands(work, 1000, max_rows=1)
    assert len(done) < 900


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing forks")
def test_a_forked_process_has_threads_of_its_own() -> None:
    over_bands(lambda first, end: time.sleep(0.05), available_cores())  # all threads of the pool have begun
    child = multiprocessing.get_context("fork").Process(target=over_bands, args=(lambda first, end: None, 2))
    child.start()
    child.join(20)
    code = child.exitcode
    child.kill()
    assert code == 0


FREED = """
import resource
import numpy as np
from stereolag.loops.memory import keep_freed_memory
keep_freed_memory()
faults = []
for _ in range(3):
    blocks = [np.ones(20 * 2**20, np.uint8) for _ in range(8)]
    del blocks
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
print(faults[1] - faults[0], faults[2] - faults[1])
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only glibc gives freed memory back at once")
def test_what_a_job_has_freed_is_there_for_the_next_one_without_fresh_pages() -> None:
    run = subprocess.run([sys.executable, "-c", FREED], check=True, capture_output=True, text=True)
    assert all(int(faults) < 1000 for faults in run.stdout.split())


def test_memory_is_used_again_once_its_last_view_is_gone() -> None:
    first = volume((3, 5, 7), np.uint16)
    view, place = first[1:, ::2].T, first.ctypes.data
    assert first.shape == (3, 5, 7) and place % CACHE_LINE == 0
    del first
    view[:] = 1
    other = volume((3, 5, 7), np.uint16)
    other[:] = 2
    assert (view == 1).all()
    del view
    assert volume((105,), np.uint16).ctypes.data == place
    assert volume((MAX_KEPT_BYTES,), np.uint8).size == MAX_KEPT_BYTES
    memory = weakref.ref(other.base.base.memory)
    del other
    assert memory() is not None
    release_memory()
    assert memory() is None
