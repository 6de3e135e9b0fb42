"""Bad files: each kind gives its typed error, with the line where one can be named."""

from pathlib import Path

import pytest

import partita as pt
from partita.errors import DescriptionError, FileFormatError, MissingFileError, PartitaError


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def test_missing_model_file(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"no-such\.toml") as caught:
        pt.load(tmp_path / "no-such.toml")
    assert isinstance(caught.value, FileNotFoundError)


def test_model_file_of_unknown_kind(tmp_path: Path) -> None:
    (tmp_path / "model.docx").write_text("x", "utf-8")
    with pytest.raises(FileFormatError, match="docx"):
        pt.load(tmp_path / "model.docx")


def toml(tmp_path: Path, old: str, new: str) -> Path:
    """The file of a pendulum with one piece of text replaced."""
    path = tmp_path / "pendulum.toml"
    pendulum().save(path)
    text = path.read_text("utf-8")
    assert old in text, text
    path.write_text(text.replace(old, new, 1), "utf-8")
    return path


def line_of(path: Path, piece: str) -> int:
    """Number of the first line that holds `piece`, from 1."""
    lines = path.read_text("utf-8").splitlines()
    return next(i for i, line in enumerate(lines, 1) if piece in line)


def test_model_file_with_an_unknown_key(tmp_path: Path) -> None:
    path = toml(tmp_path, "mass", "maas")
    with pytest.raises(FileFormatError, match="maas") as caught:
        pt.load(path)
    assert caught.value.line == line_of(path, "maas")


def test_model_file_with_bad_syntax(tmp_path: Path) -> None:
    path = toml(tmp_path, "mass =", "mass = =")
    with pytest.raises(FileFormatError) as caught:
        pt.load(path)
    assert caught.value.line == line_of(path, "mass = =")


def test_model_file_with_an_impossible_number(tmp_path: Path) -> None:
    path = toml(tmp_path, "mass = 1.0", "mass = -1.0")
    with pytest.raises((FileFormatError, DescriptionError), match="mass"):
        pt.load(path)


def test_empty_model_file(tmp_path: Path) -> None:
    path = tmp_path / "empty.toml"
    path.write_text("", "utf-8")
    with pytest.raises(FileFormatError):
        pt.load(path)


def test_result_file_of_unknown_kind(tmp_path: Path) -> None:
    with pytest.raises(PartitaError, match="docx"):
        pendulum().simulate(0.1).save(tmp_path / "run.docx")
