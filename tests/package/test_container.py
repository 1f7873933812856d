"""The container and the compose file, as far as they run without Docker: each step in a bare folder."""

import json
import os
import re
import shutil
import signal
import subprocess
import sysconfig
import tomllib
import urllib.error
import urllib.request
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

import pytest
import yaml
from packaging.specifiers import SpecifierSet

from stereolag.core.jobs import PREFIX, Limits
from stereolag.loops.compilation import FOLDER
from tests.browser.serving import NGINX, PROJECT, free_port, served_alone, status_of, wait_until
from tests.protocol import faultless, visit

DEPLOYMENT = PROJECT / "deployment"

WATCH = """
import os, sys
def note(event, details):
    if event in ("socket.connect", "socket.sendto"):
        address = details[1]
    elif event in ("socket.getaddrinfo", "socket.gethostbyname"):
        address = details
    else:
        return
    host = address[0] if isinstance(address, tuple) else None
    if host not in (None, "", "localhost", "127.0.0.1", "::1", "::", "0.0.0.0"):
        with open(os.environ["ASKED"], "a") as asked:
            asked.write(f"{event} {host}\\n")
sys.addaudithook(note)
import pwd
pwd.getpwuid = {}.__getitem__  # as for a user nobody knows
"""
"""Runs in every Python process that starts, and logs every access to another host."""


def instructions() -> list[tuple[str, str]]:
    text = re.sub(r"^#.*\n", "", (PROJECT / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = text.replace("\\\n", "").splitlines()
    return [(word, said.strip()) for word, _, said in (line.partition(" ") for line in lines if line)]


def said(word: str) -> list[str]:
    return [arguments for instruction, arguments in instructions() if instruction == word]


@cache
def compose() -> dict[str, Any]:
    services: dict[str, Any] = yaml.safe_load((DEPLOYMENT / "compose.yaml").read_text(encoding="utf-8"))["services"]
    return services


@pytest.fixture(scope="module")
def tracked() -> list[str]:
    listed = subprocess.run(["git", "ls-files"], cwd=PROJECT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("this is no checkout")
    return listed.stdout.splitlines()


def below(names: list[str], place: str) -> list[str]:
    """Return the tracked files that a path covers: the file itself or all files in the folder."""
    return [name for name in names if name == place or name.startswith(f"{place}/")]


def reaches_the_build(name: str) -> bool:
    """Return whether .dockerignore lets a file through: the last rule for it or for a folder above it decides."""
    reached = True
    for rule in (PROJECT / ".dockerignore").read_text(encoding="utf-8").splitlines():
        if rule and not rule.startswith("#"):
            pattern = re.escape(rule.removeprefix("!")).replace(r"\*\*/", "(.*/)?").replace(r"\*", "[^/]*")
            if re.fullmatch(f"{pattern}(/.*)?", name):
                reached = rule.startswith("!")
    return reached


def surroundings(home: Path, **variables: str) -> dict[str, str]:
    """Return the environment of a step: the Dockerfile's variables, and from this machine only the path to Python."""
    assert FOLDER is not None
    path = os.pathsep.join([sysconfig.get_path("scripts"), "/usr/bin", "/bin"])
    stated = dict(one.split("=", 1) for one in said("ENV"))
    # The checkout's machine code, so that the same loops are not compiled again.
    return stated | {"PATH": path, "HOME": str(home), "NUMBA_CACHE_DIR": str(FOLDER.parent)} | variables


def step(command: list[str], folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = surroundings(folder, **variables)
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory, tracked: list[str]) -> Path:
    """Run the Dockerfile's instructions in a temporary folder and return that folder.

    The packages are the ones installed here, and the user is the one running the tests.
    """
    folder = tmp_path_factory.mktemp("image")
    for word, arguments in instructions():
        if word == "COPY":
            source, target = arguments.split()
            for name in below(tracked, source):
                into = folder / target / PurePosixPath(name).relative_to(source)
                if target.endswith("/"):
                    into = folder / target / PurePosixPath(name).name
                into.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(PROJECT / name, into)
        elif word == "RUN" and not arguments.startswith("useradd"):
            command = re.sub(r"\bpip install\b", "python -m pip install --dry-run --no-index", arguments)
            command = command.removesuffix(" && python -P stereolag/commands/serving.py --check")  # CMD starts with it
            done = step(["sh", "-c", command], folder)
            assert done.returncode == 0, done.stdout + done.stderr
            assert "Would install" not in done.stdout
    return folder


def test_only_what_is_copied_reaches_the_build_and_all_of_it_is_in_git(tracked: list[str]) -> None:
    sources = [arguments.split()[0] for arguments in said("COPY")]
    assert not [source for source in sources if not below(tracked, source)]
    copied = {name for source in sources for name in below(tracked, source)}
    assert {name for name in tracked if reaches_the_build(name)} == copied
    for name in (
        "stereolag/__pycache__/limits.pyc",
        "stereolag/loops/__pycache__/a",
        ".streamlit/secrets.toml",
        ".env",
    ):
        assert not reaches_the_build(name)


def test_it_runs_as_a_user_of_its_own_on_a_python_that_is_supported() -> None:
    (base,) = said("FROM")
    (user,) = said("USER")
    words = [word for word, _ in instructions()]
    assert words.index("USER") < words.index("CMD")
    assert re.fullmatch(r"[1-9]\d+", user)  # by number, so that a host can verify that it is not root
    assert said("RUN")[0].startswith(f"useradd --uid {user} ")
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert re.search(r"python:([\d.]+)", base)[1] in SpecifierSet(project["requires-python"])  # type: ignore[index]


def test_it_serves_its_page_at_the_one_address_it_prints_passes_its_check_and_asks_nobody(image, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(WATCH)
    port = free_port()
    check = json.loads(said("HEALTHCHECK")[0].partition(" CMD ")[2])
    command = json.loads(said("CMD")[0])
    assert step(check, image, PORT=str(port)).returncode == 1
    environment = surroundings(image, PORT=str(port), PYTHONPATH=str(tmp_path), ASKED=str(tmp_path / "asked"))
    del environment["HOME"]  # it needs no home folder
    printed = tmp_path / "printed"
    # docker stop sends the same signal, and need not kill it.
    with served_alone(command, port, printed, ended_by=signal.SIGTERM, cwd=image, env=environment):
        checked = step(check, image, PORT=str(port))
        assert (checked.returncode, checked.stderr) == (0, "")
        (address,) = [line.split()[-1] for line in printed.read_text().splitlines() if "://" in line]
        assert address == f"http://localhost:{port}"
        assert any("50,082 samples" in element.markdown.body for element in faultless(visit(address)))
    assert printed.read_text().count("://") == 1
    assert "Traceback" not in printed.read_text()
    assert not (tmp_path / "asked").exists(), (tmp_path / "asked").read_text()


def test_the_processes_stand_where_the_proxy_looks_for_them() -> None:
    services = compose()
    proxy = (DEPLOYMENT / "nginx.conf").read_text(encoding="utf-8")
    apps = {name: service for name, service in services.items() if service["image"] == "stereolag"}
    addresses = [
        f"{app['environment']['STREAMLIT_SERVER_ADDRESS']}:{app['environment']['PORT']}" for app in apps.values()
    ]
    assert addresses == re.findall(r"server (127\.0\.0\.1:\d+);", proxy)
    (holder,) = services.keys() - apps.keys() - {"proxy"}
    assert {services[name]["network_mode"] for name in (*apps, "proxy")} == {f"service:{holder}"}
    (published,) = services[holder]["ports"]
    assert {published.split(":")[1]} == set(re.findall(r"listen (\d+)", proxy))
    assert f"//localhost:{published.split(':')[1]}/" in services["proxy"]["healthcheck"]["test"][-1]
    for app in apps.values():
        assert (DEPLOYMENT / app["build"] / "Dockerfile").is_file()
        taken = {name for name in app["environment"] if name.startswith(PREFIX)}
        assert taken == {f"{PREFIX}{name.upper()}" for name in Limits.model_fields}


def test_no_container_may_take_all_of_the_machine_or_become_root() -> None:
    for service in compose().values():
        assert service["mem_limit"]
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert service["image"] == "stereolag" or (service["user"] != "root" and service["read_only"])


@pytest.mark.skipif(NGINX is None, reason="nginx is not installed")
def test_the_proxy_starts_in_an_empty_folder_and_logs_to_its_output(tmp_path: Path) -> None:
    assert NGINX is not None
    proxy = compose()["proxy"]
    mounted = [mount.split(":")[:2] for mount in proxy["volumes"]]
    port = free_port()
    settings = (DEPLOYMENT / "nginx.conf").read_text(encoding="utf-8")
    settings = re.sub(r"listen \d+", f"listen {port}", settings)
    # The port must be free of any server, whatever else runs on this machine.
    settings = re.sub(r"server 127\.0\.0\.1:\d+;", "server 127.0.0.1:1;", settings)
    shell, option, command = proxy["entrypoint"]
    for here, there in mounted:
        shutil.copy(DEPLOYMENT / here, tmp_path)
        assert command.count(there) == 1
        command = command.replace(there, str(tmp_path / here))
    # A worker of root's nginx would run as nobody, who may not read the tests' folders.
    (tmp_path / "nginx.conf").write_text("user root;\n" + settings, encoding="utf-8")
    folder = tmp_path / "empty"
    folder.mkdir()
    environment = {"PATH": os.pathsep.join([str(Path(NGINX).parent), "/usr/bin", "/bin"])}
    with subprocess.Popen(
        [shell, option, command],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as nginx:
        try:
            wait_until(lambda: status_of(f"http://localhost:{port}/_stcore/health"), nginx)
            assert nginx.stdout is not None
            assert '"GET /_stcore/health HTTP/1.1" 502' in nginx.stdout.readline()
            with urllib.request.urlopen(f"http://localhost:{port}/share-card.png") as card:
                assert card.headers.get_all("Content-Type") == ["image/png"]
                assert card.read() == (DEPLOYMENT / "share-card.png").read_bytes()
        finally:
            nginx.terminate()
