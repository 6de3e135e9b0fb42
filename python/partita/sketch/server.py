"""`partita.draw`: the page on which a mechanism is drawn, served by this process to this machine alone."""

from __future__ import annotations

import json
import secrets
import socket
import sys
import threading
import webbrowser
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from ..errors import ArgumentError, PartitaError
from ..logger import logger
from ..mechanism import Mechanism
from ..mechanism.playground import playground_page
from ..numeric import shown
from ..options import yes_or_no
from ..viewer.page import DRAWS
from ..webpage import in_notebook, whole_page
from .answer import answer, runs
from .calls import mechanism_of
from .drawing import EMPTY, Drawing, drawing_of

HOST = "127.0.0.1"
MOST_BYTES = 1_000_000
"""Length of what the page may send."""
CONNECTIONS = 24
"""Served at the same time: a browser opens six."""
PATIENCE = 30
"""Seconds to wait for what a connection sends next."""
SUPERSEDED = {"kind": "superseded", "message": "another drawing was sent meanwhile"}
SCRIPTS = ("document.js", "picture.js", "link.js", "controls.js")
_HEADERS = {
    "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}  # fmt: skip


def draw(*, port: int = 0, browser: bool = True) -> DrawingPage:
    """Open a page on which a planar mechanism is drawn with the mouse or a finger, and runs.

    Bars, pins, slides, springs, motors and the ground are drawn; the core says at once how many degrees of freedom it
    has, or why it does not assemble, with the gap. Run shows it as a playground (`Mechanism.to_playground`). TOML and
    Python on the page are the drawing as a model file and as a script. For other elements or three dimensions describe
    it by calls: `Mechanism`.

    The page is served by this process, on 127.0.0.1, at an address that contains a secret, as long as the process lives
    or until `close`; what the page sends is read as numbers and names alone.

    Args:
        port: port of the server; 0: a free one.
        browser: open it in the browser. In a notebook the page shows itself below the cell instead.

    Returns:
        The page, with its `url` and the `mechanism` as drawn last.

    Raises:
        ArgumentError: port or browser is invalid, or the port is taken.

    >>> import partita as pt
    >>> page = pt.draw(browser=False)
    >>> page.url.startswith("http://127.0.0.1:")
    True
    >>> page.mechanism.bodies
    <bodies: none>
    >>> page.close()
    """
    opens = yes_or_no("browser", browser) and not in_notebook()
    page = DrawingPage(port)
    if opens:
        webbrowser.open(page.url)
    return page


class DrawingPage:
    """A page on which a mechanism is drawn, made by `partita.draw`; `with pt.draw() as page:` closes it.

    >>> import partita as pt
    >>> with pt.draw(browser=False) as page:
    ...     page.mechanism.name
    'drawing'
    """

    def __init__(self, port: int = 0) -> None:
        if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
            raise ArgumentError(f"port is {shown(port)}; it must be an integer, 0 to 65535", argument="port")
        self._secret = secrets.token_urlsafe(16)
        self._lock = threading.Lock()  # of the data alone, for no time that one notices
        self._computing = threading.Lock()
        self._asked = 0
        self._data: dict[str, Any] = EMPTY
        self._drawing = drawing_of(EMPTY)
        self._run: tuple[int, bytes] | None = None
        try:
            self._server = _Server((HOST, port), self)
        except OSError as error:
            raise ArgumentError(f"port {port} cannot be used ({error}); 0 takes a free one", argument="port") from error
        self._thread = threading.Thread(target=self._server.serve_forever, name="partita draw", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page. It contains a secret: who knows it can read and change the drawing from this machine."""
        return f"http://{HOST}:{self._server.server_address[1]}/{self._secret}/"

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism as drawn last; a new one each time.

        Raises `DescriptionError` where the drawing has no meaning, as the page says.
        """
        return mechanism_of(self._drawing)

    def close(self) -> None:
        """Stop serving; the mechanism remains."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def wait(self) -> None:
        """Serve until the program is interrupted."""
        while self._thread.is_alive():
            self._thread.join(0.2)

    def __enter__(self) -> DrawingPage:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<drawing at {self.url}>"

    def _repr_html_(self) -> str:
        """The page in a frame."""
        return (
            f'<iframe src="{self.url}" style="width:100%;height:640px;border:1px solid #8888" title="drawing"></iframe>'
        )

    # what the server asks for

    def _page(self) -> bytes:
        data = {"drawing": self._data, "empty": EMPTY}
        connects = "connect-src 'self'; frame-src 'self'"
        below = ("partita.viewer", DRAWS)
        return whole_page(__package__, "Draw a mechanism", data, SCRIPTS, below=below, connects=connects).encode(
            "utf-8"
        )

    def _taken(self, data: Any) -> tuple[Drawing, int]:
        drawing = drawing_of(data)
        with self._lock:
            self._data, self._drawing, self._asked = data, drawing, self._asked + 1
            return drawing, self._asked

    def _judge(self, data: Any) -> dict[str, Any]:
        try:
            drawing, number = self._taken(data)
            with self._computing:  # one at a time, and none that is out of date when its turn comes
                return answer(drawing) if number == self._asked else dict(SUPERSEDED)
        except PartitaError as error:
            return {"kind": "refused", "message": error.message}

    def _started(self, data: Any) -> dict[str, Any]:
        try:
            drawing, asked = self._taken(data)
            with self._computing:
                if asked != self._asked:
                    return {"message": SUPERSEDED["message"]}
                page = playground_page(runs(drawing))
        except PartitaError as error:
            return {"message": error.message}
        with self._lock:
            number = 1 if self._run is None else self._run[0] + 1
            self._run = (number, page.encode("utf-8"))
        return {"run": f"run/{number}"}

    def _running(self, name: str) -> bytes | None:
        return self._run[1] if self._run is not None and name == f"run/{self._run[0]}" else None


class _Server(ThreadingHTTPServer):
    """Serves few connections at a time. A new one takes the place of the oldest of those that have not shown yet that
    they know the address, so that who sends slowly keeps nobody out."""

    daemon_threads = True
    request_queue_size = 128

    def __init__(self, address: tuple[str, int], page: DrawingPage) -> None:
        super().__init__(address, _Handler)
        self.page = page
        self._open: dict[Any, bool] = {}
        self._of_open = threading.Lock()

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
            logger.debug("draw: a connection broke off: %s", error)
        else:
            logger.error("draw: a request failed", exc_info=error)


class _Handler(BaseHTTPRequestHandler):
    """Answers the page of its server alone: the address has the secret, and the request comes from this page."""

    server: _Server
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE

    def do_GET(self) -> None:
        path = self._path()
        page = self.server.page
        if path == "":
            self._send(page._page(), "text/html; charset=utf-8")
        elif path is not None and (found := page._running(path)) is not None:
            self._send(found, "text/html; charset=utf-8")
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        path, page = self._path(), self.server.page
        serve = {"drawing": page._judge, "run": page._started}.get(path or "")
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
        self._send(json.dumps(serve(data), allow_nan=False).encode(), "application/json")

    def _path(self) -> str | None:
        """What is asked for, below the secret; None where the request is not from this page."""
        own = f"{HOST}:{self.server.server_address[1]}"
        if self.headers.get("Host") != own or self.headers.get("Origin", f"http://{own}") != f"http://{own}":
            return None
        first, _, rest = self.path.removeprefix("/").partition("/")
        known = secrets.compare_digest(first.encode(), self.server.page._secret.encode())
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
        logger.debug("draw: " + format, *args)
