"""Fetching against a real server on this machine that can misbehave on purpose."""

import errno
import hashlib
import os
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

import pytest

from dynresp.motion.sources import download
from dynresp.motion.sources import download as download_module
from dynresp.motion.sources import fetch as fetch_module
from dynresp.motion.sources.catalogue import Licence, SourceFile
from dynresp.motion.sources.fetch import FetchPlan, FetchProgress, fetch, plan_fetch
from dynresp.support.errors import DynrespError, FetchError, UsageError
from dynresp.support.paths import CACHE_VARIABLE

COMMIT = "c0ffee" + "0" * 34
LICENCES = {"o/r": Licence("o/r", "MIT", "MIT License", "by o", "keep it", "http://o")}
FIRST_DELAY_S = download._FIRST_DELAY_S
LONGEST_DELAY_S = download._LONGEST_DELAY_S
BODY = bytes(range(256)) * 40  # 10,240 bytes


class _Server(ThreadingHTTPServer):
    """Serves `files`; each request takes the next word of `script`, "" being good behaviour."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.files: dict[str, bytes] = {}
        self.script: list[str] = []
        self.asked: list[tuple[str, str | None]] = []
        self.release = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def ranges(self) -> list[str | None]:
        return [asked_range for _, asked_range in self.asked]

    def handle_error(self, request: object, client_address: object) -> None:
        """Stay silent where the client hangs up."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: _Server

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        pass

    def do_GET(self) -> None:
        asked = self.headers.get("Range")
        self.server.asked.append((self.path, asked))
        how, _, detail = (self.server.script.pop(0) if self.server.script else "").partition(" ")
        body = self.server.files.get(unquote(self.path))
        if body is None or how == "status":
            self.send_response(int(detail or 404))
            if detail in ("429", "503"):
                self.send_header("Retry-After", "5000")
            self._finish(b"no")
            return
        start = 0
        if asked and how != "ignore-range":
            start = int(asked.removeprefix("bytes=").removesuffix("-"))
            self.send_response(206)
            first = start + 1 if how == "wrong-range" else start
            self.send_header("Content-Range", f"bytes {first}-{len(body) - 1}/{len(body)}")
        else:
            self.send_response(200)
        rest = body[start:]
        if how == "wrong":
            self._finish(bytes(len(rest)))
        elif how == "gzip":
            self.send_header("Content-Encoding", "gzip")
            self._finish(rest)
        elif how == "short":
            self._finish(rest[:-1])
        elif how == "endless":
            self.send_header("Connection", "close")
            self.end_headers()
            while True:
                self.wfile.write(rest)
        elif how == "unannounced":
            self.send_header("Connection", "close")
            self.end_headers()
            self.wfile.write(rest[: int(detail)])
        elif how in ("drop", "stall"):
            self.send_header("Content-Length", str(len(rest)))
            self.end_headers()
            self.wfile.write(rest[: int(detail)])
            self.wfile.flush()
            if how == "stall":
                self.server.release.wait(10)
            self.close_connection = True
        else:
            self._finish(rest)

    def _finish(self, body: bytes) -> None:
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Server]:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.delenv(fetch_module.URL_VARIABLE, raising=False)
    running = _Server()
    thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield running
    running.release.set()
    running.shutdown()
    thread.join()
    running.server_close()


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Waits that a test can bear, and small pieces."""
    monkeypatch.setattr(download, "_FIRST_DELAY_S", 0.0)
    monkeypatch.setattr(download, "_LONGEST_DELAY_S", 0.01)
    monkeypatch.setattr(download, "_CHUNK_BYTES", 1000)


def _publish(server: _Server, file: str = "d/a.bvh", body: bytes = BODY) -> SourceFile:
    original = f"Data/{Path(file).name}"
    server.files[f"/o/r/{COMMIT}/{original}"] = body
    sha256 = hashlib.sha256(body).hexdigest()
    return SourceFile(
        "clip", file, "o/r", COMMIT, original, "MIT", len(body), sha256, 30.0, 0.01, None
    )


def _fetch(server: _Server, folder: Path, *files: SourceFile, **options: object) -> FetchPlan:
    plan = plan_fetch(files, folder, LICENCES)
    fetch(plan, **{"base_url": server.url, **options})  # type: ignore[arg-type]
    return plan


def _assert_only_file(folder: Path, file: str = "d/a.bvh", body: bytes = BODY) -> None:
    assert [p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()] == [file]
    assert (folder / file).read_bytes() == body


def _leave_part(folder: Path, content: bytes) -> Path:
    part = folder / "d" / "a.bvh.part"
    part.parent.mkdir(parents=True)
    part.write_bytes(content)
    return part


def test_files_come_with_progress_and_licences(server: _Server, tmp_path: Path) -> None:
    files = [_publish(server), _publish(server, "e/f/b c#1.amc", BODY[:5000])]
    seen: list[FetchProgress] = []
    plan = plan_fetch(files, tmp_path, LICENCES)
    assert (plan.missing, plan.missing_bytes) == (tuple(files), 15_240)
    assert plan.licences == (LICENCES["o/r"],)
    assert server.asked == [], "a plan must not use the network"
    fetch(plan, base_url=server.url, progress=seen.append)
    assert (tmp_path / "d/a.bvh").read_bytes() == BODY
    assert (tmp_path / "e/f/b c#1.amc").read_bytes() == BODY[:5000]
    assert server.asked[1][0] == f"/o/r/{COMMIT}/Data/b%20c%231.amc"
    totals = [step.total_received for step in seen]
    assert totals == sorted(totals)
    assert (totals[0], totals[-1], seen[-1].total_bytes) == (0, 15_240, 15_240)
    assert [(s.number, s.count, s.received) for s in seen if s.source == files[1]][-1] == (
        2,
        2,
        5000,
    )


def test_right_files_are_left_alone_and_wrong_ones_replaced(
    server: _Server, tmp_path: Path
) -> None:
    good, damaged, short = (_publish(server, f"d/{name}.bvh") for name in "abc")
    (tmp_path / "d").mkdir()
    (tmp_path / "d/a.bvh").write_bytes(BODY)
    (tmp_path / "d/b.bvh").write_bytes(BODY[:-1] + b"!")
    (tmp_path / "d/c.bvh").write_bytes(BODY[:-1])
    plan = _fetch(server, tmp_path, good, damaged, short)
    assert plan.missing == (damaged, short)
    assert len(server.asked) == 2
    assert all((tmp_path / f"d/{name}.bvh").read_bytes() == BODY for name in "abc")
    assert plan_fetch(plan.files, tmp_path, LICENCES).missing == ()


def test_broken_connections_are_resumed(server: _Server, tmp_path: Path) -> None:
    server.script = ["drop 4096", "drop 2500", "unannounced 1000", ""]
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert server.ranges() == [None, "bytes=4000-", "bytes=6000-", "bytes=7000-"]


def test_ctrl_c_leaves_a_part_that_the_next_call_resumes(server: _Server, tmp_path: Path) -> None:
    source = _publish(server)

    def interrupt(step: FetchProgress) -> None:
        if step.received >= 3000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _fetch(server, tmp_path, source, progress=interrupt)
    assert (tmp_path / "d/a.bvh.part").read_bytes() == BODY[:3000]
    assert not (tmp_path / "d/a.bvh").exists()
    _fetch(server, tmp_path, source)
    _assert_only_file(tmp_path)
    assert server.ranges() == [None, "bytes=3000-"]


@pytest.mark.parametrize("how", ["ignore-range", "wrong-range", "status 416"])
def test_server_that_does_not_resume_restarts_cleanly(
    how: str, server: _Server, tmp_path: Path
) -> None:
    _leave_part(tmp_path, BODY[:3000])
    server.script = [how]
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert server.ranges()[0] == "bytes=3000-"


def test_complete_part_needs_no_network(server: _Server, tmp_path: Path) -> None:
    _leave_part(tmp_path, BODY)
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert server.asked == []


@pytest.mark.parametrize("content", [BODY + b"more", bytes(len(BODY))])
def test_part_that_is_too_long_or_wrong_is_dropped(
    content: bytes, server: _Server, tmp_path: Path
) -> None:
    _leave_part(tmp_path, content)
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert server.ranges() == [None]


def test_part_with_a_wrong_beginning_is_found_out(server: _Server, tmp_path: Path) -> None:
    _leave_part(tmp_path, bytes(3000))
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert server.ranges() == ["bytes=3000-", None]


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("wrong", r"d/a.bvh: .*other content than expected \(SHA-256"),
        ("short", r"announces 10239 bytes; expected 10240"),
        ("gzip", r"announces a compressed answer"),
        ("endless", r"sends more than the expected 10240 bytes"),
        ("status 404", r"answered 404 Not Found"),
        ("status 403", r"answered 403"),
    ],
)
def test_wrong_answers_are_refused_at_once(
    how: str, message: str, server: _Server, tmp_path: Path
) -> None:
    server.script = [how]
    with pytest.raises(FetchError, match=message):
        _fetch(server, tmp_path, _publish(server))
    assert len(server.asked) == 1
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_refused_file_does_not_stop_the_others(server: _Server, tmp_path: Path) -> None:
    files = [_publish(server, f"d/{name}.bvh") for name in "abcdefgh"]
    server.script = ["status 404"] * 7
    with pytest.raises(FetchError, match=r"7 of 8 files .*\n.*d/a.bvh") as caught:
        _fetch(server, tmp_path, *files)
    assert str(caught.value).endswith("and 2 more")
    _assert_only_file(tmp_path, "d/h.bvh")


def test_passing_failures_are_retried(
    server: _Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(download, "_FIRST_DELAY_S", FIRST_DELAY_S)
    monkeypatch.setattr(download, "_LONGEST_DELAY_S", LONGEST_DELAY_S)
    monkeypatch.setattr(time, "sleep", waits.append)
    server.script = ["status 500", "status 502", "status 503", "status 429"]
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert waits == [0.5, 1.0, 30.0, 30.0], "doubled each time; a server may ask for 30 s at most"


def test_retries_end_and_stop_the_whole_fetch(server: _Server, tmp_path: Path) -> None:
    server.script = ["drop 3000"] + ["status 500"] * 10
    files = [_publish(server), _publish(server, "d/b.bvh")]
    with pytest.raises(FetchError, match=r"d/a.bvh .* in 5 attempts: .*500.*fetch again to resume"):
        _fetch(server, tmp_path, *files)
    assert len(server.asked) == 5
    assert (tmp_path / "d/a.bvh.part").read_bytes() == BODY[:3000]


def test_server_that_falls_silent_is_left(
    server: _Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.script = ["stall 5000"]
    monkeypatch.setattr(download, "_READ_TIMEOUT_S", 0.2)
    _fetch(server, tmp_path, _publish(server))
    _assert_only_file(tmp_path)
    assert server.ranges() == [None, "bytes=5000-"]


def test_no_server(server: _Server, tmp_path: Path) -> None:
    source = _publish(server)
    with pytest.raises(FetchError, match=r"d/a.bvh could not be fetched from http://127.0.0.1:1/"):
        _fetch(server, tmp_path, source, base_url="http://127.0.0.1:1/")


def test_folder_that_cannot_be_made(server: _Server, tmp_path: Path) -> None:
    (tmp_path / "d").write_text("a file where a folder should be")
    with pytest.raises(FetchError, match=r"cannot write .*/d: .*DYNRESP_CACHE"):
        _fetch(server, tmp_path, _publish(server))


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission(server: _Server, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(FetchError, match=r"cannot write .*Permission denied"):
            _fetch(server, tmp_path, _publish(server))
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_full_disk(server: _Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Path.open

    def on_full_disk(path: Path, *args: str) -> object:
        return opened(Path("/dev/full") if path.suffix == ".part" else path, *args)

    monkeypatch.setattr(Path, "open", on_full_disk)
    with pytest.raises(FetchError, match=os.strerror(errno.ENOSPC) + r"\. Free space there"):
        _fetch(server, tmp_path, _publish(server, body=BODY * 20))


def test_address_from_the_environment_and_templates(
    server: _Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = _publish(server)
    server.files[f"/mirror/{COMMIT}/Data/a.bvh"] = BODY
    monkeypatch.setenv(fetch_module.URL_VARIABLE, server.url + "/mirror/{commit}/{path}?raw=1")
    server.files[f"/mirror/{COMMIT}/Data/a.bvh?raw=1"] = BODY
    _fetch(server, tmp_path / "one", source, base_url=None)
    _assert_only_file(tmp_path / "one")
    assert server.asked[0][0] == f"/mirror/{COMMIT}/Data/a.bvh?raw=1"
    _fetch(server, tmp_path / "two", source, base_url=server.url + "/")
    assert server.asked[1][0] == f"/o/r/{COMMIT}/Data/a.bvh", "an argument goes before"


def test_default_address_is_the_pinned_public_one(server: _Server) -> None:
    url = fetch_module.file_url(fetch_module.DEFAULT_URL, _publish(server))
    assert url == f"https://raw.githubusercontent.com/o/r/{COMMIT}/Data/a.bvh"


@pytest.mark.parametrize(
    "address",
    ["ftp://host/", "host/x", "http://", "http://host/{branch}/{path}", "http://[host", "file:///"],
)
def test_wrong_addresses_are_refused(address: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the address to fetch from is"):
        fetch(plan_fetch([], tmp_path, LICENCES), base_url=address)


def test_cache_is_the_default_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    plan = plan_fetch("all")
    assert plan.folder == tmp_path / "motions"
    assert len(plan.missing) == len(plan.files) == 287
    assert not plan.folder.exists()
    with pytest.raises(DynrespError, match="unknown collection"):
        plan_fetch("everything")


def test_file_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, source: SourceFile) -> bool:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(download_module, "_has_content", refuse)
    source = SourceFile("clip", "a.bvh", "o/r", COMMIT, "a", "MIT", 1, "0" * 64, 30.0, 1.0, None)
    with pytest.raises(FetchError, match=r"cannot read .*a.bvh: Permission denied"):
        plan_fetch([source], tmp_path, LICENCES)
