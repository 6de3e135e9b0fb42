"""`partita mcp`: a Model Context Protocol server of ten tools over stdio, for assistants that draw and run mechanisms.

The server checks each call and hands it to a child process of its own, with bounded time and memory, which reads and
writes files in one folder only.
"""

from __future__ import annotations

import argparse

from ...errors import ArgumentError
from ...extras import wanted
from .folder import Folder
from .limits import LEAST, Limits


def mcp(arguments: argparse.Namespace) -> int:
    """Serve until the client closes stdin."""
    wanted(("mcp", "jsonschema"), "mcp", "a Model Context Protocol server")
    from .server import serve

    if arguments.memory < LEAST:
        raise ArgumentError(
            f"memory is {arguments.memory} MB; a call needs at least {LEAST} MB to begin: give --memory {LEAST}",
            argument="memory",
        )
    serve(Folder.of(arguments.root), Limits(arguments.seconds, arguments.memory))
    return 0
