"""The proxy of deployment/nginx.conf in front of the app, in a real browser."""

import re
import socket
import subprocess
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from email.message import Message
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from stereolag.ui.navigation import PAGES
from tests.app import uploads
from tests.browser.fake_media import played_cameras, stereo_scene
from tests.browser.serving import NGINX, PROJECT, Server, free_port, status_of, wait_until
from tests.browser.visits import expect_visible, faultless_pages, file_of, give, settled

PROMISED = {"X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY", "Referrer-Policy": "no-referrer"}


@dataclass(frozen=True)
class Proxy:
    """A running proxy: its address, the addresses behind it, which it takes for processes, and its log."""

    address: str
    processes: frozenset[str]
    log: Path

    def visits(self) -> list[list[str]]:
        """Return the answering process, status and path of each completed request."""
        return [line.split(" ", 2) for line in self.log.read_text().splitlines()]


def ask(
    address: str, path: str, *, method: str = "GET", body: bytes | None = None, **headers: str
) -> tuple[int, Message]:
    """Return the status and headers of an answer."""
    request = urllib.request.Request(address + path, body, headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, answer.headers
    except urllib.error.HTTPError as answer:
        with answer:
            return answer.code, answer.headers


@pytest.fixture(scope="module")
def proxy(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Proxy]:
    """Put nginx before the app, with deployment/nginx.conf except for a more detailed log and its addresses.

    Both are of one process, which listens on every address of this machine.
    """
    if NGINX is None:
        pytest.skip("nginx is not installed")
    folder = tmp_path_factory.mktemp("proxy")
    with ExitStack() as running:
        app = server.address.rpartition(":")[2]
        processes = [f"127.0.0.{number}:{app}" for number in (1, 2)]
        port = free_port()
        settings = (PROJECT / "deployment" / "nginx.conf").read_text(encoding="utf-8")
        for there, here, times in (
            ("listen 8080", f"listen {port}", 2),
            ("127.0.0.1:8501", processes[0], 1),
            ("127.0.0.1:8502", processes[1], 1),
            (
                "access_log access.log;",
                "log_format process '$upstream_addr $status $uri'; access_log access.log process;",
                1,
            ),
        ):
            assert settings.count(there) == times
            settings = settings.replace(there, here)
        # A worker of root's nginx would run as nobody, who may not read the tests' folders.
        (folder / "nginx.conf").write_text("user root;\n" + settings, encoding="utf-8")
        nginx = running.enter_context(subprocess.Popen([NGINX, "-p", str(folder), "-c", "nginx.conf", "-e", "stderr"]))
        running.callback(nginx.terminate)
        address = f"http://localhost:{port}"
        wait_until(lambda: status_of(f"{address}/_stcore/health"), nginx)
        started = Proxy(address, frozenset(processes), folder / "access.log")
        wait_until(started.visits)  # the first request is logged after its answer
        yield started


def test_the_policy_breaks_no_page_and_a_session_with_uploads_stays_with_one_process(browser, proxy):
    before = len(proxy.visits())
    scene = uploads.texture(120, 165)
    labels = [label for label, _ in PAGES.values() if label not in ("Home", "Calibrate")]
    with faultless_pages(browser, proxy.address) as open_page:
        page = open_page()
        # Depth maps last, because the pair is uploaded there.
        for label in sorted(labels, key="Depth maps".__eq__):
            page.get_by_test_id("stPageLink").get_by_text(label, exact=True).click()
            expect(page.get_by_role("heading", level=1)).to_have_text(label)
            settled(page)
            if label == "Driving":  # the example is played from its first frames on, and done in a few seconds
                page.get_by_role("button", name="Cancel").evaluate_all("(all) => all.forEach((one) => one.click())")
            expect(page.get_by_test_id("stException")).to_have_count(0)
            expect(page.get_by_test_id("stAlertContentError")).to_have_count(0)
        page.get_by_text("choose a pair or bring your own").click()
        settled(page)
        page.get_by_text("Your own files").click()
        settled(page)
        pair = {"left.png": scene[:, :-5], "right.png": scene[:, 5:]}
        give(page, *(file_of(name, uploads.png(picture)) for name, picture in pair.items()))
        expect_visible(page.get_by_text("Your own pair").first)
        expect_visible(page.locator(".linked figure").first)
        page.reload()
        settled(page)
        expect(page.get_by_test_id("stException")).to_have_count(0)
        expect_visible(page.get_by_text("The files of this page are gone"))
    # A socket is logged only once it has closed.
    wait_until(lambda: sum("/_stcore/stream" in visit for visit in proxy.visits()[before:]) >= 2)
    visits = proxy.visits()[before:]
    assert len({process for process, _, _ in visits}) == 1, visits
    paths = [path for _, _, path in visits]
    assert sum(path.startswith("/_stcore/upload_file/") for path in paths) >= 2
    assert [status for _, status, path in visits if path == "/_stcore/stream"] == ["101", "101"]


def test_a_visitor_is_named_once_and_visitors_are_shared_out_among_the_processes(proxy: Proxy) -> None:
    before = len(proxy.visits())
    for _ in range(32):
        status, headers = ask(proxy.address, "/")
        assert status == 200
    assert {process for process, _, _ in proxy.visits()[before:]} == proxy.processes
    (cookie,) = [one for one in headers.get_all("Set-Cookie", []) if one.startswith("stereolag_visitor=")]
    assert re.fullmatch(r"stereolag_visitor=[0-9a-f]{32}; Path=/; HttpOnly; SameSite=Lax", cookie)
    _, headers = ask(proxy.address, "/", Cookie=cookie.partition(";")[0])
    assert not [one for one in headers.get_all("Set-Cookie", []) if one.startswith("stereolag_visitor=")]


def test_every_answer_carries_the_security_headers_once_and_what_is_for_the_operator_is_refused(proxy: Proxy) -> None:
    for path in ("/", "/_stcore/health", "/_stcore/metrics"):
        _, headers = ask(proxy.address, path)
        for name, value in PROMISED.items():
            assert headers.get_all(name) == [value]
        (policy,) = headers.get_all("Content-Security-Policy", [])
        assert "default-src 'none'" in policy and "unsafe-eval" not in policy
        assert re.search(r"script-src [^;]*unsafe-inline", policy) is None
    for path in ("metrics", "/metrics", "agent/mcp"):
        assert ask(proxy.address, f"/_stcore/{path}")[0] in (403, 404)
    for path in ("//_stcore/metrics", "/%5fstcore/metrics"):
        assert ask(proxy.address, path)[0] in (403, 404)


def test_an_upload_above_the_limit_is_refused_before_it_reaches_the_app(proxy: Proxy) -> None:
    before = len(proxy.visits())
    port = int(proxy.address.rpartition(":")[2])
    with socket.create_connection(("localhost", port), timeout=60) as connection:
        head = f"PUT /_stcore/upload_file/session/file HTTP/1.1\r\nHost: localhost:{port}\r\n"
        connection.sendall(f"{head}Content-Length: {66 * 2**20}\r\n\r\n".encode())
        assert connection.recv(1000).startswith(b"HTTP/1.1 413 ")
    assert {process for process, _, _ in proxy.visits()[before:]} <= {"-"}


def test_requests_in_another_name_or_from_the_page_of_another_site_are_refused(proxy: Proxy) -> None:
    assert ask(proxy.address, "/", Host="elsewhere.example")[0] == 421
    assert ask(proxy.address, "/", Origin="http://elsewhere.example")[0] == 403
    assert ask(proxy.address, "/", Origin=proxy.address)[0] == 200


def test_a_link_that_is_shared_is_shown_with_a_name_and_a_picture(proxy: Proxy) -> None:
    for path in ("/", "/Depth_maps"):
        with urllib.request.urlopen(proxy.address + path, timeout=60) as answer:
            page = answer.read().decode()
        assert "<title>stereolag</title>" in page and "Streamlit</title>" not in page
        (picture,) = re.findall(r"property='og:image' content='(.*?)'", page)
        assert picture == "http://localhost/share-card.png"  # served as such: tests/package/test_container.py


def test_a_live_camera_reaches_its_process_and_no_other_page_does(browser: Browser, proxy: Proxy) -> None:
    left, right, _ = stereo_scene(3, near=20, far=8, shape=(120, 200))
    with faultless_pages(browser, proxy.address) as open_page:
        cameras = played_cameras(both=[np.hstack([left, right])])
        page = open_page("Depth_maps?pair=own", choose="Live camera", script=cameras)
        page.get_by_role("button", name="Start", exact=True).click()
        expect(page.locator(".live .rates")).to_contain_text("a second")
        expect(page.locator(".viewport")).to_have_count(2)
    assert ask(proxy.address, "/live", Origin="http://elsewhere.example", Upgrade="websocket")[0] == 403
