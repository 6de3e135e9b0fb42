"""`partita.draw`: the page on which a mechanism is drawn, served by this process to this machine alone."""

from __future__ import annotations

import threading
import webbrowser
from typing import Any

from ..errors import ArgumentError, PartitaError
from ..mechanism import Mechanism
from ..mechanism.playground import playground_page
from ..numeric import shown
from ..options import yes_or_no
from ..serving import HTML, Content, serving
from ..viewer.page import DRAWS
from ..webpage import in_notebook, whole_page
from .answer import answer, runs
from .calls import mechanism_of
from .drawing import EMPTY, Drawing, drawing_of

SUPERSEDED = {"kind": "superseded", "message": "another drawing was sent meanwhile"}
SCRIPTS = ("document.js", "picture.js", "link.js", "controls.js")


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
        self._lock = threading.Lock()  # of the data alone, for no time that one notices
        self._computing = threading.Lock()
        self._asked = 0
        self._data: dict[str, Any] = EMPTY
        self._drawing = drawing_of(EMPTY)
        self._run: tuple[int, bytes] | None = None
        content = Content(self._read, {"drawing": self._judge, "run": self._started})
        self._server = serving(content, port, "partita draw")

    @property
    def url(self) -> str:
        """Address of the page. It contains a secret: who knows it can read and change the drawing from this machine."""
        return self._server.url

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism as drawn last; a new one each time.

        Raises `DescriptionError` where the drawing has no meaning, as the page says.
        """
        return mechanism_of(self._drawing)

    def close(self) -> None:
        """Stop serving; the mechanism remains."""
        self._server.end()

    def wait(self) -> None:
        """Serve until the program is interrupted."""
        self._server.wait()

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

    def _read(self, path: str) -> tuple[bytes, str] | None:
        """The page, and that of the last run."""
        if path == "":
            return self._page(), HTML
        running = self._running(path)
        return None if running is None else (running, HTML)

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
