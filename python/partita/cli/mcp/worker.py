"""The child process of one call: reads it from stdin, bounds itself, writes the answer to stdout, a line each."""

from __future__ import annotations

import base64
import errno
import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

from ...errors import PartitaError
from ..printing import plain
from .calls import call
from .folder import Folder
from .limits import ANSWER, FILE, Limits


def answer(request: dict[str, Any], folder: Folder, limits: Limits) -> dict[str, Any]:
    """What the tool found, or the error as data: its kind, its sentence and its fields."""
    try:
        return plain(_encoded(call(request["tool"], request["arguments"], folder, limits)))  # type: ignore[no-any-return]
    except PartitaError as error:
        kind, message, fields = type(error).__name__, str(error), error.fields
    except (MemoryError, OSError) as error:
        if isinstance(error, OSError) and error.errno != errno.ENOMEM:  # a system call asks for memory too
            kind, message, fields = "OSError", f"cannot use a file: {error.strerror}; give another name", {}
        else:
            kind, fields = "MemoryError", {}
            message = f"the call needs more than {limits.megabytes} MB; ask for a smaller model, or for fewer outputs"
    except BaseException as error:  # a panic of the core too: the client gets a sentence, never a traceback
        kind, fields = type(error).__name__, {}
        message = f"{request['tool']} failed on this model ({str(error)[:300]}); please report it, and change the model"
    found = fields | {"kind": kind, "message": message}
    return {"error": {key: _shown(value, folder) for key, value in found.items()}}


def _shown(value: Any, folder: Folder) -> Any:
    """A field of an error: text where JSON has no such kind, files by their names in the folder."""
    if isinstance(value, str):
        return value.replace(f"{folder.path}{os.sep}", "").replace(str(folder.path), ".")
    return plain(value) if isinstance(value, (int, float, list, tuple, dict, type(None))) else str(value)


def _encoded(found: dict[str, Any]) -> dict[str, Any]:
    return {key: base64.b64encode(x).decode("ascii") if isinstance(x, bytes) else x for key, x in found.items()}


def bounded(text: bytes) -> bytes:
    """The answer, unless it is too long."""
    if len(text) <= ANSWER:
        return text
    message = (
        f"the answer has {len(text)} bytes, more than the {ANSWER} that are returned; ask for fewer outputs or joints, "
        "or let export write a file (to)"
    )
    return json.dumps({"error": {"kind": "ArgumentError", "message": message, "argument": "outputs"}}).encode()


def bound(limits: Limits) -> None:
    """End this process when it exceeds its limits, whatever it computes and whether or not the server still runs.
    Without POSIX only the server's own clock bounds it."""
    if sys.platform == "win32":
        return
    import resource

    size = limits.megabytes * 1_000_000
    for kind, most in ((resource.RLIMIT_DATA, size), (resource.RLIMIT_FSIZE, FILE), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(kind)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (most, most))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # a file that is too long is then an error of the system
    signal.setitimer(signal.ITIMER_REAL, limits.seconds + 1.0)  # its default ends the process


def main() -> None:
    """Serve one call, given as one line."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which ends its children
    out = os.dup(1)
    os.dup2(2, 1)  # whatever prints, the answer stays alone
    folder, limits = Folder(Path(sys.argv[1])), Limits(float(sys.argv[2]), int(sys.argv[3]))
    line = sys.stdin.buffer.readline()
    if not line:
        return
    bound(limits)
    found = json.dumps(answer(json.loads(line), folder, limits), ensure_ascii=False, allow_nan=False)
    with os.fdopen(out, "wb") as stream:
        stream.write(bounded(found.encode("utf-8", "replace")) + b"\n")


if __name__ == "__main__":
    main()
