"""A server that plays Poly Haven's API and downloads, with faults on demand."""

import hashlib
import json
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

PIECE = 1 << 16


class PolyHaven(ThreadingHTTPServer):
    """Offers `maps` (bytes by id) at resolution 1k as .exr.

    faults : by path, one for each request to come: a status, or the name of a fault of a download
    requests : path and Range header of all that was asked for
    pause : seconds between pieces of a download"""

    daemon_threads = True

    def __init__(self, maps: dict[str, bytes]) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.maps = maps
        self.faults: dict[str, list[int | str]] = {}
        self.listed: dict[str, dict] = {}
        self.requests: list[tuple[str, str]] = []
        self.agents: set[str] = set()
        self.pause = 0.0

    @property
    def api(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"

    def listing(self, name: str) -> dict:
        content = self.maps[name]
        entry = {
            "url": f"{self.api}/file/{name}",
            "size": len(content),
            "md5": hashlib.md5(content).hexdigest(),
        }
        exr = {"exr": entry | self.listed.get(name, {}), "hdr": entry}
        return {"hdri": {"1k": exr, "2k": {"hdr": entry}}, "tonemapped": entry}

    def ranges(self, name: str) -> list[str]:
        """The Range headers with which a map's file was asked for."""
        return [asked for path, asked in self.requests if path == f"/file/{name}"]

    def handle_error(self, request, client_address) -> None:
        """A client that is gone is part of the play."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: PolyHaven

    def log_message(self, format, *args) -> None: ...

    def do_GET(self) -> None:
        asked = self.headers.get("Range", "")
        self.server.requests.append((self.path, asked))
        self.server.agents.add(self.headers.get("User-Agent", ""))
        waiting = self.server.faults.get(self.path, [])
        fault = waiting.pop(0) if waiting else ""
        place, _, name = self.path.strip("/").rpartition("/")
        if isinstance(fault, int):
            self._answer(fault, b"trouble")
        elif fault == "redirect":
            self._answer(302, b"", {"Location": f"/{self.path}"})
        elif fault == "redirect without end":
            self.server.faults[self.path] = [fault]
            self._answer(302, b"", {"Location": self.path})
        elif fault == "silence":
            time.sleep(1.0)
            self.close_connection = True
        elif name not in self.server.maps:
            self._answer(404, b"No asset with that id")
        elif place == "files":
            strange = {"no list": b"<html>", "nested": b"[" * 100_000}
            body = json.dumps(self.server.listing(name)).encode()
            self._answer(200, strange.get(fault, body))
        else:
            self._file(self.server.maps[name], asked, fault)

    def _file(self, content: bytes, asked: str, fault: str) -> None:
        start = int(asked.removeprefix("bytes=").removesuffix("-")) if asked else 0
        if fault == "ignores ranges":
            start = 0
        elif fault == "wrong range":
            start += 1
        if fault == "damaged":
            content = content[:-1] + bytes([content[-1] ^ 1])
        elif fault == "too long":
            content += b"x"
        elif fault == "too short":
            content = content[:-1]
        partial = bool(start)
        more = {"Content-Range": f"bytes {start}-{len(content) - 1}/{len(content)}"}
        body = content[start:]
        self._head(206 if partial else 200, len(body), more if partial else {})
        end = len(body) // 2 if fault in ("cut", "stalls") else len(body)
        for position in range(0, end, PIECE):
            self.wfile.write(body[position : min(position + PIECE, end)])
            time.sleep(self.server.pause)
        if fault == "stalls":
            time.sleep(1.0)
        self.close_connection = fault in ("cut", "stalls")

    def _head(self, status: int, length: int, more: dict[str, str]) -> None:
        self.send_response(status)
        for key, value in ({"Content-Length": str(length)} | more).items():
            self.send_header(key, value)
        self.end_headers()

    def _answer(self, status: int, body: bytes, more: dict[str, str] | None = None) -> None:
        self._head(status, len(body), more or {})
        self.wfile.write(body)


@contextmanager
def serving(maps: dict[str, bytes]):
    """A running server."""
    with PolyHaven(maps) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
