"""A page served by this process to this machine alone: at an address with a secret, on 127.0.0.1."""

from __future__ import annotations

import json
import secrets
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from .errors import ArgumentError
from .logger import logger

HOST = "127.0.0.1"
MOST_BYTES = 1_000_000
"""Length of what the page may send."""
CONNECTIONS = 24
"""Served at the same time: a browser opens six."""
PATIENCE = 30
"""Seconds to wait for what a connection sends next."""
HTML, JSON = "text/html; charset=utf-8", "application/json"
_HEADERS = {
    "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}  # fmt: skip


@dataclass(frozen=True)
class Content:
    """What a server answers.

    `read`: content and kind of what stands at a path below the address of the page, "" the page itself; None: nothing.
    `calls`: what answers the data that the page sends to a path.
    """

    read: Callable[[str], tuple[bytes, str] | None]
    calls: Mapping[str, Callable[[Any], dict[str, Any]]] = field(default_factory=dict)


def serving(content: Content, port: int, name: str) -> LocalServer:
    """A server of a page, which answers in a thread of this name until it is closed.

    Raises `ArgumentError`: the port is taken.
    """
    try:
        server = LocalServer(content, port)
    except OSError as error:
        raise ArgumentError(f"port {port} cannot be used ({error}); 0 takes a free one", argument="port") from error
    server.thread = threading.Thread(target=server.serve_forever, name=name, daemon=True)
    server.thread.start()
    return server


class LocalServer(ThreadingHTTPServer):
    """Serves few connections at a time. A new one takes the place of the oldest of those that have not shown yet that
    they know the address, so that who sends slowly keeps nobody out."""

    daemon_threads = True
    thread: threading.Thread
    request_queue_size = 128

    def __init__(self, content: Content, port: int) -> None:
        super().__init__((HOST, port), Handler)
        self.content, self.secret = content, secrets.token_urlsafe(16)
        self._open: dict[Any, bool] = {}
        self._of_open = threading.Lock()

    @property
    def url(self) -> str:
        """Address of the page. It contains the secret."""
        return f"http://{HOST}:{self.server_address[1]}/{self.secret}/"

    def end(self) -> None:
        """Stop serving."""
        self.shutdown()
        self.server_close()
        self.thread.join()

    def wait(self) -> None:
        """Serve until the program is interrupted."""
        while self.thread.is_alive():
            self.thread.join(0.2)

    def process_request(self, request: Any, client_address: Any) -> None:
        with self._of_open:
            oldest = next((one for one, known in self._open.items() if not known), None)
            full = len(self._open) >= CONNECTIONS
            if full and oldest is not None:
                del self._open[oldest]
            if not full or oldest is not None:
                self._open[request] = False
        if full and oldest is None:
            self.shutdown_request(request)
            return
        if full and oldest is not None:
            with suppress(OSError):
                oldest.shutdown(socket.SHUT_RDWR)  # its thread, which waits for it, ends
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self._of_open:
                self._open.pop(request, None)

    def known(self, request: Any) -> None:
        """A connection that knows the address."""
        with self._of_open:
            if request in self._open:
                self._open[request] = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A request that was broken off is none of the user's business."""
        error = sys.exception() if sys.version_info >= (3, 11) else sys.exc_info()[1]
        if isinstance(error, OSError):
            logger.debug("page: a connection broke off: %s", error)
        else:
            logger.error("page: a request failed", exc_info=error)


class Handler(BaseHTTPRequestHandler):
    """Answers the page of its server alone: the address has the secret, and the request comes from this page."""

    server: LocalServer
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE

    def do_GET(self) -> None:
        path = self._path()
        found = None if path is None else self.server.content.read(path)
        if found is None:
            self._refuse(HTTPStatus.NOT_FOUND)
        else:
            self._send(*found)

    def do_POST(self) -> None:
        path = self._path()
        serve = self.server.content.calls.get(path or "")
        length = self.headers.get("Content-Length", "")
        if serve is None:
            return self._refuse(HTTPStatus.NOT_FOUND)
        if self.headers.get("Content-Type") != "application/json":
            return self._refuse(HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        if not length.isascii() or not length.isdigit():
            return self._refuse(HTTPStatus.LENGTH_REQUIRED)
        if int(length) > MOST_BYTES:
            return self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        try:
            data = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            return self._refuse(HTTPStatus.BAD_REQUEST)
        self._send(json.dumps(serve(data), allow_nan=False).encode(), JSON)

    def _path(self) -> str | None:
        """What is asked for, below the secret; None where the request is not from this page."""
        own = f"{HOST}:{self.server.server_address[1]}"
        if self.headers.get("Host") != own or self.headers.get("Origin", f"http://{own}") != f"http://{own}":
            return None
        first, _, rest = self.path.removeprefix("/").partition("/")
        known = secrets.compare_digest(first.encode(), self.server.secret.encode())
        if known:
            self.server.known(self.connection)
        return rest if known else None

    def _send(self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        self.send_response(status)
        for key, value in {**_HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(body)

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True  # what it sends is not read
        self._send(status.phrase.encode(), "text/plain", status)

    def log_message(self, format: str, *args: Any) -> None:
        logger.debug("page: " + format, *args)
