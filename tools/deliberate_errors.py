"""Deliberate errors, put into the core and the package one at a time: do the tests see each of them?

python tools/deliberate_errors.py               all of them
python tools/deliberate_errors.py NAME ...      these alone
python tools/deliberate_errors.py --package     those of the package, with the native module that is installed: no build
python tools/deliberate_errors.py --list        what they spoil

An error is an exact piece of text that stands once in its file, and what takes its place. The files that git knows are
copied to a folder of their own with their own builds, so the working tree stays as it is. Errors of the core are put
into one build, each to be chosen when it runs (`errors_together`); the few that do not fit there have builds of their
own. Unspoilt, the tests named beside the errors must pass. Then each error is made, and the tests that should see it
run, the narrowest first, until one fails: it is caught. Where none does, all that `make test` runs is asked. An error
that does not compile, or with which the tests come to no end, is not caught. The exit code is 1 if one was not.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from errors_together import CHOICE, HOME, VARIABLE, Body, together
from formulas_spoilt import FORMULAS, PACKAGE, Error
from package_spoilt import IN_PACKAGE

ERRORS = (*FORMULAS, *IN_PACKAGE)
ROOT = Path(__file__).resolve().parents[1]
SCRATCH = ROOT / "target" / "errors"
"""Tree and builds stay here, so that the next error costs one incremental build."""
LONGEST = 1200.0
"""Seconds for one command: `make test` as a whole takes less."""
LIST_TEST = "test_deliberate_errors.py"
NOT_ASKED = {
    "lib": ("tests", "tests-hand"),
    "whole": ("tests-hand",),
    "marching": ("tests",),
    "reducing": ("tests",),
}
"""For each kind of tests of the core, the crates that have none of that kind."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended: tests that failed, or why there is nothing to say."""

    failed: tuple[str, ...] = ()
    trouble: str = ""

    @property
    def passed(self) -> bool:
        """Nothing failed, and nothing stood in the way."""
        return not self.failed and not self.trouble


class Workshop:
    """The copied tree and its builds."""

    def __init__(self, scratch: Path, installed: bool = False) -> None:
        self.installed = installed
        self.tree = scratch / "tree"
        self.builds = scratch / "build"
        self.log = scratch / "last.txt"
        self.all_pass = False
        self.numbers: dict[str, int] = {}
        """Of the errors in the build, by name."""
        self.environment = os.environ | {
            "CARGO_TARGET_DIR": str(self.builds),
            "CARGO_PROFILE_RELEASE_INCREMENTAL": "true",  # one line changes at a time
            "CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "16",
            "PYO3_PYTHON": sys.executable,
            "PYO3_BUILD_EXTENSION_MODULE": "1",
            "PYTHONPATH": str(self.tree / "python"),
            "PYTHONDONTWRITEBYTECODE": "1",  # a source changed twice in a second keeps its old bytecode
            "MPLBACKEND": "Agg",
        }

    def copy(self) -> None:
        """Bring the tree to the state of the files that git knows; what has not changed keeps its date and build."""
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout
        names = {name for name in listed.decode().split("\0") if name and (ROOT / name).is_file()}
        if self.tree.exists():
            for path in (self.tree / top for top in ("crates", "python", "tests")):
                for there in [p for p in path.rglob("*") if p.is_file()]:
                    if str(there.relative_to(self.tree)) not in names:
                        there.unlink()
        for name in sorted(names):
            source, there = ROOT / name, self.tree / name
            if not there.exists() or there.read_bytes() != source.read_bytes():
                there.parent.mkdir(parents=True, exist_ok=True)
                there.write_bytes(source.read_bytes())

    def join(self, errors: Sequence[Error]) -> None:
        """Put errors of the core into one build, as many as compile together."""
        numbers = {error.name: number for number, error in enumerate(errors, 1)}
        left = [error for error in errors if error.file.endswith(".rs")]
        while left:
            self.copy()
            written: dict[str, list[tuple[Error, Body]]] = {}
            for file in dict.fromkeys(error.file for error in left):
                own = [(numbers[error.name], error) for error in left if error.file == file]
                text, written[file] = together((self.tree / file).read_text("utf-8"), own, file)
                (self.tree / file).write_text(text, "utf-8")
            home = self.tree / HOME
            home.write_text(home.read_text("utf-8") + CHOICE, "utf-8")
            # of cargo's own commands the quickest that finds every error of types
            code, output = self.run(["cargo", "check", "--release", "--workspace", "--all-targets", "--locked"])
            joined = [error for found in written.values() for error, _ in found]
            if code == 0:
                self.numbers = {error.name: numbers[error.name] for error in joined}
                return
            blamed = self._blamed(output, written)
            if not blamed:
                raise SystemExit(f"the errors do not compile together:\n{tail(output)}")
            left = [error for error in joined if error.name not in blamed]
        self.copy()

    def _blamed(self, output: str, written: dict[str, list[tuple[Error, Body]]]) -> set[str]:
        """Names of the errors in functions that the compiler refuses."""
        blamed = set()
        for file, line in re.findall(r"^\s*--> (\S+?):(\d+):\d+$", output, re.M):
            if file not in written:
                continue
            text = (self.tree / file).read_text("utf-8")
            at = sum(len(x) for x in text.splitlines(keepends=True)[: int(line)])
            blamed |= {
                error.name for error, body in written[file] if body.begin < at and text.rfind("\n", 0, at) < body.end
            }
        return blamed

    @contextmanager
    def spoilt(self, error: Error) -> Iterator[None]:
        """The tree, or what is run, with this error in it."""
        if error.name in self.numbers:
            self.environment[VARIABLE] = str(self.numbers[error.name])
            try:
                yield
            finally:
                del self.environment[VARIABLE]
            return
        path = self.tree / error.file
        right = path.read_text("utf-8")
        path.write_text(spoil(error, right), "utf-8")
        try:
            yield
        finally:
            path.write_text(right, "utf-8")

    def run(self, command: Sequence[str]) -> tuple[int | None, str]:
        """Exit code (none if there was no end) and what was said."""
        with subprocess.Popen(
            command,
            cwd=self.tree,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        ) as process:
            try:
                output, _ = process.communicate(timeout=LONGEST)
                code: int | None = process.returncode
            except subprocess.TimeoutExpired:
                self.cut_short(process)
                output, code = process.communicate()[0], None
            except BaseException:
                self.cut_short(process)
                raise
        self.log.write_text(f"{' '.join(command)}\n{output}", "utf-8")
        return code, output

    def cut_short(self, process: subprocess.Popen[str]) -> None:
        """End a command with all that it started. A compiler cut short may leave pieces of spoilt code in its cache."""
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        shutil.rmtree(self.builds / "release" / "incremental", ignore_errors=True)

    def tests(self, tests: str) -> Outcome:
        """Run some of the tests, see `Error.seen_by`."""
        kind, *rest = tests.split()
        if kind in ("python", "docstrings"):
            folder = "tests/python" if kind == "python" else PACKAGE
            return self.python([f"{folder}/{name}" for name in rest])
        # of the whole workspace always: a crate by itself has other features of its dependencies, and other builds
        names = [f"{kind}::{name}" for name in rest or [""]] if kind in ("marching", "reducing") else rest
        return self.rust([f"--exclude=partita-{crate}" for crate in NOT_ASKED[kind]], names)

    def check_all_tests(self) -> None:
        """Unspoilt they pass; asked when that is first needed."""
        if not self.all_pass:
            outcome = self.all_tests()
            if not outcome.passed:
                raise SystemExit(f"unspoilt, make test fails: {outcome.trouble or ' '.join(outcome.failed)}")
            self.all_pass = True

    def all_tests(self) -> Outcome:
        """What `make test` runs."""
        outcome = self.rust([], [])
        # the list of errors knows the right text: that a spoilt one differs from it proves nothing
        return self.python([f"--ignore=tests/python/{LIST_TEST}"]) if outcome.passed else outcome

    def rust(self, which: Sequence[str], names: Sequence[str]) -> Outcome:
        """`cargo test`, built first: what does not compile is no failure of a test."""
        command = ["cargo", "test", "--release", "--workspace", "--locked", *which]
        code, output = self.run([*command, "--no-run"])
        if code != 0:
            return Outcome(trouble=f"it does not compile:\n{tail(output)}")
        code, output = self.run([*command, "--", *names])
        if code is None:
            return Outcome(trouble=f"the tests did not end within {LONGEST:.0f} s")
        if code != 0:
            failed = re.findall(r"^test (\S+)(?: - should panic)? \.\.\. FAILED", output, re.M)
            return Outcome(tuple(failed) or ("aborted",))
        ran = sum(int(n) for n in re.findall(r"^running (\d+) tests?$", output, re.M))
        return Outcome() if ran > 0 else Outcome(trouble=f"{' '.join(command)} has no tests named {' '.join(names)}")

    def python(self, files: Sequence[str]) -> Outcome:
        """`pytest` on these files, or on all, with the native module and the FMU binary of the tree, or with those
        installed."""
        built = {"_core.abi3.so": ROOT / PACKAGE / "_core.abi3.so"}
        built |= {f"_fmu/{path.name}": path for path in (ROOT / PACKAGE / "_fmu").glob("*partita_fmu*")}
        if not self.installed:
            code, output = self.run(["cargo", "build", "--release", "--workspace", "--locked"])
            if code != 0:
                return Outcome(trouble=f"it does not compile:\n{tail(output)}")
            release = self.builds / "release"
            found = [
                path for path in (*release.glob("lib*"), *release.glob("deps/lib*")) if path.suffix in (".so", ".dylib")
            ]
            built = {"_core.abi3.so": next(path for path in found if path.stem == "lib_core")}
            built |= {f"_fmu/{path.name}": path for path in found if path.stem == "libpartita_fmu"}
        built |= {f"_fmu/{path.name}": path for path in ROOT.glob("LICENSE-*")}
        for name, path in built.items():
            there = self.tree / PACKAGE / name
            if not there.exists() or there.read_bytes() != path.read_bytes():
                there.parent.mkdir(exist_ok=True)
                there.unlink(missing_ok=True)
                shutil.copyfile(path, there)
        code, output = self.run([sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *files])
        if code is None:
            return Outcome(trouble=f"the tests did not end within {LONGEST:.0f} s")
        if code == 0:
            return Outcome()
        if code == 1 or code < 0:
            return Outcome(tuple(re.findall(r"^(?:FAILED|ERROR) (\S+)", output, re.M)) or ("aborted",))
        return Outcome(trouble=f"pytest could not run the tests (exit code {code}):\n{tail(output)}")


def spoil(error: Error, text: str) -> str:
    """`text` with the error in it; the text to replace must stand there once."""
    if (count := text.count(error.old)) != 1:
        raise SystemExit(f"{error.name}: {error.old!r} stands {count} times in {error.file}; it must be once")
    return text.replace(error.old, error.new)


def tail(output: str) -> str:
    """The last lines of what a command said."""
    return "\n".join(output.splitlines()[-15:])


def named(names: Sequence[str]) -> list[Error]:
    """The errors called so, all if none is."""
    known = {error.name: error for error in ERRORS}
    if unknown := [name for name in names if name not in known]:
        raise SystemExit(f"no error is called {', '.join(unknown)}; there are {', '.join(known)}")
    return [known[name] for name in names] if names else list(ERRORS)


def main() -> int:
    """Make the errors that the arguments name; 1 if one was not caught."""
    parser = argparse.ArgumentParser(description="Deliberate errors: do the tests see each of them?")
    parser.add_argument("names", nargs="*", metavar="NAME", help="errors to make; all if none is named")
    parser.add_argument("--list", action="store_true", help="say what each spoils")
    parser.add_argument("--narrow", action="store_true", help="do not ask all of make test where the named tests pass")
    parser.add_argument("--package", action="store_true", help="errors of the package alone; nothing is built")
    arguments = parser.parse_args()
    errors = named(arguments.names)
    if arguments.package:
        errors = [error for error in errors if error.file.startswith(PACKAGE)]
    if arguments.list:
        print("\n".join(f"{error.name:24} {error.spoils}" for error in errors))
        return 0
    workshop = Workshop(SCRATCH, arguments.package)
    workshop.copy()
    for error in errors:
        spoil(error, (workshop.tree / error.file).read_text("utf-8"))
    workshop.join(errors)
    # those with builds of their own come last, when the tree is as it was
    alone = [error for error in errors if error.file.endswith(".rs") and error.name not in workshop.numbers]
    errors = [error for error in errors if error not in alone]
    missed: list[str] = []
    caught = 0
    try:
        check_unspoilt(workshop, [*errors, *alone])
        for number, error in enumerate([*errors, *alone], 1):
            if error in alone[:1]:
                workshop.numbers = {}
                workshop.copy()
            print(f"[{number}/{len(errors) + len(alone)}] {error.name}: {error.spoils}", flush=True)
            began = time.monotonic()
            by = hunt(workshop, error, arguments.narrow or arguments.package)
            took = f"({time.monotonic() - began:.0f} s)"
            if by is None:
                missed.append(error.name)
                print(f"    NOT CAUGHT {took}", flush=True)
            else:
                caught += 1
                print(f"    caught by {by} {took}", flush=True)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    finally:
        left = f"; not caught: {', '.join(missed)}" if missed else ""
        print(f"{caught} of {len(errors) + len(alone)} errors were caught{left}")
    return 1 if missed else 0


def check_unspoilt(workshop: Workshop, errors: Sequence[Error]) -> None:
    """Without an error the named tests pass: otherwise they would prove nothing."""
    for tests in dict.fromkeys(tests for error in errors for tests in error.seen_by):
        began = time.monotonic()
        outcome = workshop.tests(tests)
        if not outcome.passed:
            raise SystemExit(f"unspoilt, {tests}: {outcome.trouble or ' '.join(outcome.failed)}; see {workshop.log}")
        print(f"unspoilt, {tests}: passes ({time.monotonic() - began:.0f} s)", flush=True)


def hunt(workshop: Workshop, error: Error, narrow: bool) -> str | None:
    """The first test that sees the error."""
    with workshop.spoilt(error):
        for tests in error.seen_by:
            outcome = workshop.tests(tests)
            if outcome.failed:
                return f"{tests}: {outcome.failed[0]}" + more(outcome)
            if outcome.trouble:
                print(f"    {outcome.trouble}", flush=True)
                return None
    if narrow:
        return None
    print("    the named tests pass; asking all of make test", flush=True)
    workshop.check_all_tests()
    with workshop.spoilt(error):
        outcome = workshop.all_tests()
    if outcome.trouble:
        print(f"    {outcome.trouble}", flush=True)
    return f"make test: {outcome.failed[0]}" + more(outcome) if outcome.failed else None


def more(outcome: Outcome) -> str:
    """How many other tests failed with the first."""
    return f" and {len(outcome.failed) - 1} more" if len(outcome.failed) > 1 else ""


if __name__ == "__main__":
    sys.exit(main())
