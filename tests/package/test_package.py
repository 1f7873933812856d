"""The wheel: it contains all files that the library and the app need, and works away from the checkout."""

import signal
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest

from stereolag.commands import main
from stereolag.loops.compilation import FOLDER
from stereolag.version import VERSION
from tests.browser.serving import PROJECT, free_port, served_alone
from tests.protocol import faultless, visit


def run(command: Sequence[str | Path], folder: Path) -> str:
    """Run a command in a folder, assert that it succeeds, and return its output."""
    environment = {"PATH": sysconfig.get_path("scripts"), "HOME": str(folder), "NUMBA_CACHE_DIR": code()}
    ran = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def code() -> str:
    """Return the folder of the checkout's machine code, so that the same loops are not compiled again."""
    assert FOLDER is not None
    return str(FOLDER.parent)


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet", "--no-deps"]
    run([*command, "--no-build-isolation", "--no-index", "--wheel-dir", folder, PROJECT], folder)
    (wheel,) = folder.glob("*.whl")
    return wheel


def names_in(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


@pytest.fixture(scope="session")
def scripts(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into an environment that borrows its dependencies from this one; return its scripts folder."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    places = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)})
    Path(places["purelib"], "dependencies.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", folder, "install", "--quiet"]
    run([*command, "--no-deps", "--no-compile", "--no-index", wheel], folder)
    return Path(places["scripts"])


def test_it_holds_the_library_the_app_and_the_examples_and_nothing_else(wheel: Path) -> None:
    tracked = subprocess.run(["git", "ls-files"], cwd=PROJECT, capture_output=True, text=True, check=False)
    if tracked.returncode:
        pytest.skip("this is no checkout")
    files = tracked.stdout.splitlines()
    expected = {name for name in files if name.startswith("stereolag/")}
    expected |= {f"stereolag/{name}" for name in files if name.startswith("assets/")}
    expected |= {f"stereolag/app/{name}" for name in files if name.startswith(("app.py", "pages/", ".streamlit/"))}
    assert {Path(name).suffix for name in expected} >= {".py", ".js", ".css", ".html", ".svg", ".toml", ".flac", ".png"}
    assert {"stereolag/py.typed", "stereolag/__init__.pyi"} <= expected
    assert {name for name in names_in(wheel) if ".dist-info/" not in name} == expected
    assert f"stereolag-{VERSION}.dist-info/licenses/LICENSE" in names_in(wheel)


def test_an_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    run([sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", tmp_path], PROJECT)
    (sdist,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path], tmp_path / sdist.name[:-7])
    (again,) = tmp_path.glob("*.whl")
    assert names_in(again) == names_in(wheel)


def test_the_program_in_the_readme_runs_in_another_folder(scripts: Path, tmp_path: Path) -> None:
    """Its two searches; the rest of it runs in ``tests/core/test_docs.py``."""
    readme = (PROJECT / "README.md").read_text(encoding="utf-8")
    program = readme.partition("```python\n")[2].partition("# A stereo pair")[0]
    program += "print(samples.__file__, sl.__version__)"
    lag, found, place = run([scripts / "python", "-W", "error", "-c", program], tmp_path).splitlines()
    assert lag.startswith("50082 1.1356") and found.startswith("True 528 982 ")
    file, version = place.split()
    assert Path(file).is_relative_to(scripts.parent)
    assert version == VERSION


def test_the_command_tells_its_version(scripts: Path, tmp_path: Path) -> None:
    assert run([scripts / "stereolag", "--version"], tmp_path) == f"{VERSION}\n"


def test_the_command_tells_its_options_and_refuses_what_it_does_not_know(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, code, said in (
        (["--help"], 0, "app"),
        (["app", "--help"], 0, "--port"),
        ([], 2, "command"),
        (["ap"], 2, "invalid choice: 'ap'"),
        (["app", "--port", "http"], 2, "invalid int value: 'http'"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == code
        assert said in "".join(capsys.readouterr())


def test_the_command_serves_its_pages_from_any_folder(scripts: Path, tmp_path: Path) -> None:
    (tmp_path / ".streamlit").mkdir()
    (tmp_path / ".streamlit/config.toml").write_text('[server]\nbaseUrlPath = "another/app"\n')
    port, printed = free_port(), tmp_path / "printed"
    command = [scripts / "stereolag", "app", "--port", str(port)]
    environment = {"HOME": str(scripts), "NUMBA_CACHE_DIR": code(), "PYTHONUNBUFFERED": "1"}
    with served_alone(command, port, printed, ended_by=signal.SIGINT, cwd=tmp_path, env=environment) as server:
        for page, said in {"": "50,082 samples", "Sensor_lag": "378.17\N{NO-BREAK SPACE}m"}.items():
            messages = visit(f"http://localhost:{port}", page)
            assert any(said in str(element) for element in faultless(messages)), page
        assert "#5a4a9c" in str(messages[0].new_session)  # the theme of the app's own settings
        assert printed.read_text().count("://") == 1
        # Watching the files of the pages, and an environment beside them, can take more time than the maps.
        opened = Path(f"/proc/{server.pid}/fd").glob("*")
        assert not [one for one in opened if "inotify" in str(one.readlink())]
