"""What the commands find, for people and for programs: positions, costs, JSON, examples of the help, completion."""

import json
import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

import partita as pt
from partita.cli import main
from partita.cli.arguments import EXAMPLES, parser


def found(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """What a command prints with --json; NaN is no JSON."""

    def refused(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out, parse_constant=refused)


def test_every_command_has_examples_that_parse() -> None:
    commands = next(a for a in parser()._actions if isinstance(a.choices, dict)).choices
    assert isinstance(commands, dict) and set(commands) == set(EXAMPLES)
    for command, lines in EXAMPLES.items():
        for line in lines:
            words = [word.strip("'") for word in line.replace("'500 ms'", "500ms").split(" >> ")[0].split()]
            assert callable(parser().parse_args([command, *words]).run), line
        assert f"partita {command}" in commands[command].format_help()


def test_assemble_prints_the_state_of_the_function(capsys: pytest.CaptureFixture[str]) -> None:
    reported = found(capsys, "assemble", "four-bar", "--target", "A=30deg", "--rate", "A=60rpm")
    m = pt.catalogue.load("four-bar")
    near = pt.catalogue.entry("four-bar").initial(m)
    state = m.assemble({"A": math.radians(30.0)}, {"A": "60 rpm"}, near)
    assert list(reported["coordinates"].items()) == list(zip(state.names, state.q.tolist(), strict=True))
    assert list(reported["velocities"].items()) == list(zip(state.velocity_names, state.v.tolist(), strict=True))
    assert main(["assemble", "four-bar", "--target", "A=30deg", "--rate", "A=60rpm"]) == 0
    printed = capsys.readouterr().out
    assert all(f"{value:.15g}" in printed for value in (*state.q, *state.v))


def test_assemble_prints_all_branches(capsys: pytest.CaptureFixture[str]) -> None:
    reported = found(capsys, "assemble", "four-bar", "--target", "A=0.5", "--inputs", "A", "--all")
    assert sorted(one["branch"] for one in reported["assemblies"]) == ["+", "-"]
    assert all(one["coordinates"]["A"] == 0.5 and one["residual"] < 1e-12 for one in reported["assemblies"])
    assert main(["assemble", "four-bar", "--target", "A=0.5", "--inputs", "A", "--all"]) == 0
    assert "assembly 1" in capsys.readouterr().out


def test_bench_reports_errors_that_fall_with_the_tolerance(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("bench", "four-bar", "--time", "1", "--tolerances", "1e-4,1e-7,1e-10", "--repeat", "1")
    rows = found(capsys, *words)["rows"]
    assert [row["rtol"] for row in rows] == [1e-4, 1e-7, 1e-10]
    assert rows[0]["error"] > 30.0 * rows[1]["error"] > 30.0 * 30.0 * rows[2]["error"] > 0.0
    assert rows[0]["evaluations"] < rows[1]["evaluations"] < rows[2]["evaluations"]
    assert all(row["status"] == "finished" and row["closure"] < 1e-12 for row in rows)
    assert main(list(words)) == 0
    assert capsys.readouterr().out.count("finished") == 3


def test_what_programs_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [entry["name"] for entry in found(capsys, "list")]
    assert names == list(pt.catalogue.names())
    m = pt.catalogue.load("four-bar")
    assert found(capsys, "report", "four-bar")["mobility"] == 1
    target = str(tmp_path / "run.json")
    reported = found(capsys, "simulate", "four-bar", "--time", "0.1", "--save", target)
    assert (reported["success"] and reported["verdict"] == "good") or reported["verdict"]
    assert (
        reported["certificate"]["closure"] < 1e-12
        and reported["work"]["evaluations"] > 0
        and reported["written"] == [target]
    )
    assert found(capsys, "check", "four-bar")["closes"] is True
    rows = found(
        capsys, "compare", "four-bar", "--time", "0.1", "--formulations", "projective,svd", "--rules", "collective"
    )
    assert {row["formulation"] for row in rows["rows"]} == {"projective", "svd"}
    assert found(capsys, "convert", "four-bar", str(tmp_path / "four-bar.toml")) is not None
    assert pt.load(tmp_path / "four-bar.toml").to_spec() == m.to_spec()


@pytest.mark.parametrize("words", [
    ["assemble", "four-bar", "--target", "Z=1"],
    ["assemble", "four-bar", "--target", "A=3 kg"],
    ["bench", "four-bar", "--tolerances", "0"],
    ["bench", "four-bar", "--repeat", "0"],
    ["bench", "no-such"],
    ["completion", "fish"],
])  # fmt: skip
def test_misuse_is_one_message(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    reported = capsys.readouterr()
    assert reported.err.startswith("partita: error: ") and reported.err.count("\n") == 1 and not reported.out


def test_the_shell_reads_the_completion(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("shtab")
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash here")
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    ask = "COMP_WORDS=(partita si); COMP_CWORD=1; COMP_LINE='partita si'; _shtab_partita; echo ${COMPREPLY[@]}"
    done = subprocess.run([bash, "-c", f"{script}\n{ask}"], capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["simulate"], done.stderr
