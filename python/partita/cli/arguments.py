"""Arguments of the command line: words and options."""

from __future__ import annotations

import argparse
import difflib
from functools import partial
from typing import Any, NoReturn

from ..options import BASES, COORDINATES, CORRECTIONS, FORMULATIONS, INERTIAS, METHODS, SELECTIONS, SERIALS
from ..tolerance import ATOL, RTOL
from .values import count, ladder, listed, pair, port, positive, repeats, seconds, setting

MODEL = "a model file (it exists or has an ending such as .toml), or a name from `partita list`"
BAUMGARTE = "the two numbers [1/s] that the formulation baumgarte needs"
WINDOW = "time [s] over which the rule persistence looks back"
EXAMPLES = {
    "simulate": (
        "four-bar --html four-bar.html",
        "four-bar --time 5 --rate A=60rpm --save run.nc",
        "four-bar --time '500 ms' --method rk4 --json",
    ),
    "compare": (
        "four-bar --time 1",
        "four-bar --time 1 --formulations projective,svd --tolerances 1e-6,1e-9",
        "bennett bricard scissor delta --time 1",
    ),
    "report": ("bricard", "four-bar --markdown"),
    "check": ("model.toml", "robot.urdf --base free --json"),
    "assemble": ("four-bar --target A=30deg", "four-bar --target A=0.5 --inputs A --all"),
    "equilibrium": ("four-bar-spring", "four-bar-spring --target D=20deg --json"),
    "modes": ("four-bar-spring", "four-bar-spring --html mode.html"),
    "inverse": ("four-bar --rate A=60rpm --time 1", "four-bar --rate A=60rpm --actuator D -o torque.png"),
    "list": ("",),
    "new": ("four-bar -o my.toml", "slider-crank --rods -o my.toml"),
    "watch": ("my.toml", "my.toml --time 10"),
    "draw": ("", "--port 8000 --no-browser", "--static draw.html"),
    "bench": ("four-bar --time 1", "andrews-squeezer --tolerances 1e-5,1e-7,1e-9"),
    "plot": ("run.nc", "run.nc --what energy --what A -o energy.pdf"),
    "view": ("run.nc", "run.nc -o run.html"),
    "convert": ("robot.urdf robot.toml", "four-bar four-bar.mjcf --json"),
    "mcp": ("--root models", "--root models --seconds 60 --memory 4000"),
    "completion": ("bash >> ~/.bash_completion",),
}
"""Examples of each command."""

LADDER = [1e-4, 1e-6, 1e-8, 1e-10]
"""Relative tolerances of `bench`."""


def parser() -> argparse.ArgumentParser:
    """The parser; every command stores its function in `run`."""
    from .. import __version__
    from . import check, commands
    from .assemble import assemble
    from .bench import bench
    from .compare import compare
    from .completion import completion
    from .inverse import inverse
    from .mcp import mcp
    from .simulate import simulate
    from .started import new, watch
    from .statics import equilibrium, modes

    top = _Parser(prog="partita", description="Motion and forces of mechanisms with closed loops.")
    top.add_argument("--version", action="version", version=f"partita {__version__}")
    top.set_defaults(run=partial(_shown, top))
    words = top.add_subparsers(title="commands", metavar="COMMAND")

    _simulate(_command(words, "simulate", simulate, "simulate a motion and report the findings"))

    _compare(_command(words, "compare", compare, "run every formulation on a mechanism and report the costs"))

    report = _command(words, "report", commands.report, "mobility, redundancy, coordinates and reactions, in words")
    report.add_argument("model", metavar="FILE|NAME", help=MODEL)
    report.add_argument("--markdown", action="store_true", help="headings and tables instead of plain text")
    _reading(report)
    _json(report)
    about = "check a model file: what was read and omitted, whether it closes, its mobility, likely mistakes"
    lint = _command(words, "check", check.check, about)
    lint.add_argument("model", metavar="FILE|NAME", help=MODEL)
    _json(lint)
    _reading(lint)

    _assemble(_command(words, "assemble", assemble, "close the loops and print all positions"))

    _equilibrium(_command(words, "equilibrium", equilibrium, "find a position of rest and the forces that hold it"))
    _modes(_command(words, "modes", modes, "frequencies, damping and shapes of small motions about an equilibrium"))

    _inverse(_command(words, "inverse", inverse, "efforts that a motion needs, for the choice of motors"))

    _json(_command(words, "list", commands.list_names, "list the mechanisms of the catalogue"))

    _new(_command(words, "new", new, "print a mechanism of the catalogue as a model file with comments, to change"))
    _watch(_command(words, "watch", watch, "show a model file on a page, drawn anew whenever the file is saved"))

    _draw(_command(words, "draw", commands.draw, "open a page on which a planar mechanism is drawn with the mouse"))

    _bench(_command(words, "bench", bench, "run at several tolerances and report costs and errors"))

    plot = _command(words, "plot", commands.plot, "draw a stored result")
    plot.add_argument("result", metavar="RESULT", help="a stored result (.nc, .zarr, .json, .csv, .parquet, .mat)")
    plot.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="figure to write (.png, .pdf, .svg); default: a new file beside RESULT",
    )
    plot.add_argument(
        "--what",
        metavar="WORD",
        action="append",
        help="overview (default), coordinates, closure, energy, measure, reactions, or the name of a joint; repeatable",
    )

    view = _command(words, "view", commands.view, "open the animated page of a stored result, or write it")
    view.add_argument("result", metavar="RESULT", help="a stored result (.nc, .zarr, .json, .csv, .parquet, .mat)")
    view.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="page (.html) or film (.gif, .mp4) to write; default: a page that is opened and not kept",
    )

    convert = _command(words, "convert", commands.convert, "read one model file and write another")
    convert.add_argument("source", metavar="A", help="model file to read, or a name of the catalogue")
    convert.add_argument("target", metavar="B", help="model file to write; its ending decides the format")
    convert.add_argument("--strict", action="store_true", help="fail if the format cannot represent the model")
    _json(convert, "print changes and omissions as JSON")
    _reading(convert)

    _mcp(_command(words, "mcp", mcp, "serve ten tools to an assistant over the Model Context Protocol (stdio)"))

    shell = _command(words, "completion", completion, "print the completion script of a shell")
    shell.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="shell for which the script is written")
    shell.set_defaults(words=top)
    return top


def _reading(command: argparse.ArgumentParser) -> None:
    """How a model file is read: arguments of `partita.load`."""
    add = command.add_argument
    add("--base", choices=BASES, default="fixed", help="how the root of a URDF is attached (default fixed)")
    add("--loops", metavar="FILE", help="YAML file that lists the loops and joint types of a URDF or SDFormat file")
    add("--inertia", choices=INERTIAS, help="whether an inertia that no body can have is repaired (robots) or refused")
    add("--serial-joints", choices=SERIALS, help="what several joints of USD between the same two bodies are")
    add("--root", metavar="FOLDER", help="folder around the model in which the files that it names may lie")


def _simulate(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE|NAME", help=MODEL)
    add(
        "--time",
        metavar="S",
        type=seconds,
        help="length of the run [s, or such as '2 min']; default for a NAME: that of its problem",
    )
    add("--outputs", metavar="N", type=count, default=501, help="number of equally spaced outputs (default 501)")
    add("--rtol", metavar="X", type=positive, help="relative tolerance of the step control (default 1e-8)")
    add("--atol", metavar="X", type=positive, help="absolute tolerance of the step control (default 1e-10)")
    add("--method", choices=METHODS, help="integrator (default dop853; stiff: radau or auto)")
    add("--formulation", choices=FORMULATIONS, help="equations of motion (default projective)")
    add("--coordinates", choices=COORDINATES, default="relative", help="coordinates of the model (default relative)")
    add("--selection", choices=SELECTIONS, help="rule that chooses the coordinates of projective (default collective)")
    add("--independent", metavar="A,B", type=listed, help="velocities to integrate throughout, instead of a choice")
    add("--window", metavar="S", type=seconds, help=WINDOW)
    add("--correction", choices=CORRECTIONS, help="what closes the loops after a step (default partition)")
    add("--baumgarte", metavar="ALPHA,BETA", type=pair, help=BAUMGARTE)
    _start(command)
    add("--html", metavar="FILE", help="write the animated page")
    add("--save", metavar="FILE", help="write the result (.nc, .zarr, .json, .csv, .parquet, .mat)")
    add("--plot", metavar="FILE", help="write the figure (.png, .pdf, .svg)")
    add("--quiet", action="store_true", help="print nothing but errors")
    _reading(command)
    _json(command)


def _compare(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("models", metavar="FILE|NAME", nargs="+", help=f"{MODEL}; several are compared one after the other")
    add("--time", metavar="S", type=seconds, help="length of the runs [s]; default for a NAME: that of its problem")
    add("--rtol", metavar="X", type=positive, default=RTOL, help=f"relative tolerance (default {RTOL:g})")
    add("--atol", metavar="X", type=positive, default=ATOL, help=f"absolute tolerance (default {ATOL:g})")
    add("--method", choices=METHODS, default="dop853", help="integrator (default dop853; stiff: radau or auto)")
    known = ", ".join(FORMULATIONS)
    add(
        "--formulations",
        metavar="A,B",
        type=listed,
        help=f'names separated by commas, or rows such as "svd: each step" (default all: {known})',
    )
    rules = ", ".join(SELECTIONS)
    add("--rules", "--selections", metavar="A,B", type=listed, help=f"rules of projective (default all: {rules})")
    removals = ", ".join(CORRECTIONS)
    add("--correction", metavar="A,B", type=listed, help=f"corrections of projective, a row for each ({removals})")
    add("--coordinates", choices=COORDINATES, default="relative", help="coordinates of the model (default relative)")
    add(
        "--tolerances",
        metavar="X,Y",
        type=ladder,
        help="run the rows that finish again with each of these rtol, and print errors and costs",
    )
    add("--baumgarte", metavar="ALPHA,BETA", type=pair, help=BAUMGARTE)
    add("--window", metavar="S", type=seconds, help=WINDOW)
    add("--plot", metavar="FILE", help="write a figure of errors and costs (.png, .pdf, .svg)")
    add("--work-precision", metavar="FILE", help="run over the tolerances, and write the figure of error over work")
    add("--csv", metavar="FILE", help="write the rows")
    _json(command)


def _assemble(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE|NAME", help=MODEL)
    _start(command)
    add("--all", action="store_true", help="all positions that close for these targets, branch by branch")
    add("--inputs", metavar="A,B", type=listed, help="with --all: velocities whose positions are given")
    _reading(command)
    _json(command)


def _equilibrium(command: argparse.ArgumentParser) -> None:
    command.add_argument("model", metavar="FILE|NAME", help=MODEL)
    command.add_argument("--nearest", action="store_true", help="the nearest equilibrium, stable or not")
    _start(command)
    _reading(command)
    _json(command)


def _modes(command: argparse.ArgumentParser) -> None:
    command.add_argument("model", metavar="FILE|NAME", help=MODEL)
    command.add_argument("--here", action="store_true", help="about the start itself, which must be steady")
    command.add_argument("--html", metavar="FILE", help="write the animated page of the slowest mode that moves")
    _start(command)
    _reading(command)
    _json(command)


def _inverse(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE|NAME", help=MODEL)
    add("--time", metavar="S", type=seconds, default=1.0, help="length of the motion [s]; default 1")
    add(
        "--rate",
        metavar="JOINT=VALUE",
        type=setting,
        action="append",
        default=[],
        help="constant rate of a joint [rad/s or m/s; or with its unit: 60rpm], from where it is drawn, instead of the "
        "drives of the model; repeatable",
    )
    about = (
        "a joint, a coordinate such as C.slide, a spring, a force such as push.x; default: what is moved; repeatable"
    )
    add("--actuator", metavar="NAME", action="append", help=about)
    add("-o", "--output", metavar="FILE", help="figure to write (.png, .pdf, .svg)")
    _reading(command)
    _json(command)


def _bench(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE|NAME", help=MODEL)
    add("--time", metavar="S", type=seconds, help="length of the runs [s]; default for a NAME: that of its problem")
    add("--tolerances", metavar="X,Y", type=ladder, default=LADDER,
        help=f"relative tolerances (default {','.join(f'{x:g}' for x in LADDER)})")  # fmt: skip
    add("--outputs", metavar="N", type=count, default=101, help="number of equally spaced outputs (default 101)")
    add("--repeat", metavar="N", type=repeats, default=3, help="number of repetitions; the median counts (default 3)")
    add("--method", choices=METHODS, help="integrator (default dop853; stiff: radau or auto)")
    add("--formulation", choices=FORMULATIONS, help="equations of motion (default projective)")
    add("--coordinates", choices=COORDINATES, default="relative", help="coordinates of the model (default relative)")
    _start(command)
    _json(command)


def _new(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("name", metavar="NAME", help="a name from `partita list`")
    add("-o", "--output", metavar="FILE", help="file to write (.toml); default: print it")
    add("--rods", action="store_true", help="keep slender rods instead of plates")


def _watch(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("model", metavar="FILE", help="a model file")
    shown = command.add_mutually_exclusive_group()
    shown.add_argument("--time", metavar="S", type=seconds, help="show a run of this length [s] instead of the drawing")
    shown.add_argument("--live", action="store_true", help="show a page that computes: pull links, change numbers")
    add("--port", type=port, default=0, help="port of the page (default: a free one)")
    add("--no-browser", action="store_true", help="do not open the page in the browser")
    _reading(command)


def _draw(command: argparse.ArgumentParser) -> None:
    command.add_argument("--port", metavar="N", type=port, default=0, help="port on this machine; default: a free one")
    command.add_argument("--no-browser", action="store_true", help="print the address of the page, but open no browser")
    about = "write the page as one file that computes without Python (.html), instead of serving it"
    command.add_argument("--static", metavar="FILE", help=about)


def _mcp(command: argparse.ArgumentParser) -> None:
    from .mcp.limits import LEAST, MEGABYTES, SECONDS

    add = command.add_argument
    add("--root", metavar="FOLDER", required=True, help="the one folder in which models are read and files written")
    about = f"wall time that a call may take [s, or such as '2 min']; default {SECONDS:g}"
    add("--seconds", metavar="S", type=seconds, default=SECONDS, help=about)
    about = f"memory that a call may use [MB]; at least {LEAST}; default {MEGABYTES}; enforced on Linux"
    add("--memory", metavar="MB", type=repeats, default=MEGABYTES, help=about)


def _start(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--target",
        metavar="JOINT=VALUE",
        type=setting,
        action="append",
        default=[],
        help="position of a joint at the start [rad or m; or with its unit: 30deg, '5 mm']; repeatable",
    )
    command.add_argument(
        "--rate",
        metavar="JOINT=VALUE",
        type=setting,
        action="append",
        default=[],
        help="velocity of a joint at the start [rad/s or m/s; or with its unit: 60rpm]; repeatable",
    )


def _json(command: argparse.ArgumentParser, text: str = "print all findings as JSON") -> None:
    command.add_argument("--json", action="store_true", help=text)


def _command(words: argparse._SubParsersAction, name: str, run: object, text: str) -> argparse.ArgumentParser:  # type: ignore[type-arg]
    command: argparse.ArgumentParser = words.add_parser(
        name,
        help=text,
        description=text[0].upper() + text[1:] + ".",
        epilog="for example:\n" + "\n".join(f"  partita {name} {line}" for line in EXAMPLES[name]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=run)
    return command


def _shown(top: argparse.ArgumentParser, _: argparse.Namespace) -> int:
    """What can be done, for a call without a command."""
    top.print_help()
    print("\nfirst steps: `partita list`, then `partita simulate four-bar --plot four-bar.png`, or `partita draw`")
    return 0


class _Parser(argparse.ArgumentParser):
    """Reports an incorrect call in one sentence instead of a page of usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"partita: error: {message}; see `{self.prog} --help`\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """With the nearest of the choices, instead of all of them."""
        if action.choices is not None and value not in action.choices:
            near = difflib.get_close_matches(str(value), [str(choice) for choice in action.choices], n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"choose one of {', '.join(map(str, action.choices))}"
            raise argparse.ArgumentError(action, f"{value!r} is not known; {hint}")
