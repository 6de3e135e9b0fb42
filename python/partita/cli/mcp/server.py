"""The server: lists the tools, checks arguments, and hands each call to a child process within limits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import suppress
from typing import Any

import anyio
import mcp_types as types
from anyio.abc import Process
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError, best_match
from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server

from ... import __version__
from .folder import Folder
from .limits import CALLS, Limits
from .tools import MODELS, TOOLS

INSTRUCTIONS = (
    "Partita computes motion and forces of mechanisms with closed loops. Begin with describe without arguments; give a "
    "mechanism as TOML text (model), as a file of the folder (file) or by name (catalogue). Use check before run, and "
    "draw to look at it. SI units and radians; a run counts only if it has success and its verdict is valid."
)
_READS = types.ToolAnnotations(read_only_hint=True, open_world_hint=False)
_WRITES = types.ToolAnnotations(read_only_hint=False, destructive_hint=False, open_world_hint=False)


def serve(folder: Folder, limits: Limits) -> None:
    """Serve over stdin and stdout until the client closes them."""
    anyio.run(_serve, folder, limits)


async def _serve(folder: Folder, limits: Limits) -> None:
    children = Children(folder, limits)

    async def list_tools(context: Any, parameters: Any) -> types.ListToolsResult:
        return types.ListToolsResult(
            tools=[
                types.Tool(
                    name=name,
                    description=words,
                    input_schema=schema,
                    annotations=_WRITES if name == "export" else _READS,
                )
                for name, (words, schema) in TOOLS.items()
            ]
        )

    async def call_tool(context: Any, parameters: types.CallToolRequestParams) -> types.CallToolResult:
        arguments = parameters.arguments or {}
        refused = refusal(parameters.name, arguments)
        return result_of(refused or await children.answer(parameters.name, arguments))

    server: Server[Any] = Server(
        "partita",
        version=__version__,
        instructions=INSTRUCTIONS,
        on_list_tools=list_tools,
        on_call_tool=call_tool,
    )
    try:
        async with stdio_server() as (read, write):
            await server.run(read, write, server.create_initialization_options())
    finally:
        children.close()


def refusal(tool: str, arguments: dict[str, Any]) -> dict[str, Any] | None:
    """Why a call cannot be made; None if it can."""
    if tool not in TOOLS:
        return _error(
            "UnknownNameError", f"there is no tool {tool[:100]!r}; there are {', '.join(TOOLS)}", name=tool[:100]
        )
    schema = TOOLS[tool][1]
    given = [word for word in MODELS if word in arguments]
    if len(given) > 1 or (not given and tool != "describe"):
        return _error(
            "ArgumentError",
            f"{tool} needs one of model (TOML text), file and catalogue, and got {' and '.join(given) or 'none'}",
            argument="model",
        )
    unknown = next((name for name in arguments if name not in schema["properties"]), None)
    if unknown is not None:
        known = ", ".join(schema["properties"])
        return _error(
            "ArgumentError", f"{tool} has no argument {unknown[:100]!r}; it has {known}", argument=unknown[:100]
        )
    wrong = best_match(Draft202012Validator(schema).iter_errors(arguments))
    if wrong is None:
        return None
    where = ".".join(str(part) for part in wrong.absolute_path)[:200]
    return _error("ArgumentError", f"{where or tool}: {_why(wrong)}", argument=where.partition(".")[0])


def _why(wrong: ValidationError) -> str:
    """What is wrong with an argument, and what it should be."""
    if wrong.validator == "anyOf":  # whose own message names the alternatives by nothing
        given = json.dumps(wrong.instance)
        message = f"{given if len(given) <= 100 else f'{given[:100]} ...'} does not fit"
    else:
        message = wrong.message if len(wrong.message) <= 300 else f"{wrong.message[:140]} ... {wrong.message[-140:]}"
    about = wrong.schema.get("description") if isinstance(wrong.schema, dict) else None
    return f"{message}; give {about}" if about else f"{message}; see the schema of the tool"


def _error(kind: str, message: str, **fields: Any) -> dict[str, Any]:
    """The form of every error; text that is no Unicode is replaced, for it cannot be sent."""
    found = {"kind": kind, "message": message, **fields}
    return {
        "error": {
            key: value.encode("utf-8", "replace").decode("utf-8") if isinstance(value, str) else value
            for key, value in found.items()
        }
    }


def result_of(found: dict[str, Any]) -> types.CallToolResult:
    """JSON as text and as structure; a picture as an image beside it."""
    data = dict(found)
    image = data.pop("png", None)
    content: list[types.ContentBlock] = [
        types.TextContent(type="text", text=json.dumps(data, ensure_ascii=False, allow_nan=False))
    ]
    if image is not None:
        content.append(types.ImageContent(type="image", data=image, mime_type="image/png"))
    return types.CallToolResult(content=content, structured_content=data, is_error="error" in data)


class Children:
    """Child processes, one for each call; one waits for the next, so that a call does not wait for imports."""

    def __init__(self, folder: Folder, limits: Limits) -> None:
        self._folder, self._limits = folder, limits
        self._free = anyio.Semaphore(CALLS)
        self._spare: Process | None = None
        self._starting = anyio.Lock()

    async def _start(self) -> Process:
        command = [sys.executable, "-m", "partita.cli.mcp.worker", str(self._folder.path)]
        command += [repr(self._limits.seconds), str(self._limits.megabytes)]
        # Python looks for modules in the working folder of `-m`: never in one that others may write to
        return await anyio.open_process(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=self._folder.path.anchor,
            # what the allocator of the core reserves is not to count before it is used
            env={**os.environ, "PYTHONSAFEPATH": "1", "MIMALLOC_ARENA_EAGER_COMMIT": "0"},
        )

    async def answer(self, tool: str, arguments: dict[str, Any]) -> dict[str, Any]:
        """The answer of a child, or the error that ended it."""
        async with self._free:
            child, self._spare = self._spare, None
            if child is None or child.returncode is not None:
                child = await self._start()
            try:
                with anyio.move_on_after(self._limits.seconds):
                    async with self._starting:
                        if self._spare is None:
                            self._spare = await self._start()
                    return await self._asked(child, {"tool": tool, "arguments": arguments})
                return self._late(tool)
            finally:
                with suppress(ProcessLookupError):
                    child.kill()
                with anyio.CancelScope(shield=True):
                    await child.aclose()

    async def _asked(self, child: Process, request: dict[str, Any]) -> dict[str, Any]:
        assert child.stdin is not None and child.stdout is not None
        with suppress(anyio.BrokenResourceError, anyio.ClosedResourceError):
            await child.stdin.send(json.dumps(request).encode() + b"\n")
        text = b"".join([part async for part in child.stdout])
        if text.endswith(b"\n"):  # complete; how long the child takes to end does not matter
            found: dict[str, Any] = json.loads(text)
            return found
        code = await child.wait()
        return _error(
            "MemoryError",
            f"{request['tool']} was ended by the system (code {code}), most likely because it needs more than "
            f"{self._limits.megabytes} MB; ask for a smaller model or fewer outputs, or start the server with a larger "
            "--memory",
            megabytes=self._limits.megabytes,
        )

    def _late(self, tool: str) -> dict[str, Any]:
        return _error(
            "TimeoutError",
            f"{tool} took more than {self._limits.seconds:g} s and was stopped; ask for a shorter duration, fewer "
            "members or a larger rtol, or start the server with a larger --seconds",
            seconds=self._limits.seconds,
        )

    def close(self) -> None:
        """End the child that waits."""
        if self._spare is not None:
            with suppress(ProcessLookupError):
                self._spare.kill()
