"""Films: their pictures, how long each is shown, and the messages where none can be made."""

from pathlib import Path

import numpy as np
import pytest
from fake_runs import Fake, four_bar
from mesh_files import tetrahedra

import partita as pt
from partita.errors import ArgumentError, FileFormatError, MissingDependencyError, MissingFileError
from partita.viewer.film import save_film


def frames_of(path: Path) -> list[np.ndarray]:
    from PIL import Image, ImageSequence

    with Image.open(path) as film:
        return [np.asarray(frame.convert("RGB"), dtype=float) for frame in ImageSequence.Iterator(film)]


def test_a_film_shows_the_motion(tmp_path: Path) -> None:
    """So many pictures as asked, of that size; the crank is where the run says, in its colour."""
    fake = four_bar(nt=101)  # one turn of the crank in five seconds
    path = save_film(fake, tmp_path / "film.gif", fps=4, size=(400, 300), forces=False)
    pictures = frames_of(path)
    assert len(pictures) == 20 and pictures[0].shape == (300, 400, 3)
    crank = [np.argwhere(np.abs(picture - (0x8F, 0xB0, 0xD0)).max(axis=2) < 10) for picture in pictures]
    seen = [k for k, pixels in enumerate(crank) if len(pixels) > 100]  # else the coupler lies over it
    middles = np.array([crank[k].mean(axis=0)[::-1] for k in seen]) * (1.0, -1.0)
    # They lie on a circle about the pin: x^2 + y^2 = 2 a x + 2 b y + c.
    fit = np.linalg.lstsq(np.column_stack([2 * middles, np.ones(len(seen))]), (middles**2).sum(axis=1), rcond=None)[0]
    x, y = (middles - fit[:2]).T
    off = np.arctan2(y, x) - (1.0 + 2 * np.pi * np.array(seen) / 20)
    assert len(seen) > 14 and np.abs(np.angle(np.exp(1j * off))).max() < 0.1


def test_few_outputs_stand_as_long_as_they_last(tmp_path: Path) -> None:
    """Three outputs at 0, 2.5 and 5 s: three pictures, which together last as long as the run."""
    from PIL import Image

    path = save_film(four_bar(nt=3), tmp_path / "x.gif", fps=10, size=(200, 150))
    with Image.open(path) as film:
        lasts = []
        for n in range(film.n_frames):
            film.seek(n)
            lasts.append(film.info["duration"])
    assert np.allclose(lasts, [1250, 2500, 1250], atol=101)
    assert sum(lasts) == 5000


def test_films_report_what_is_not_unique(tmp_path: Path) -> None:
    """Arrows of reactions that are not unique are hollow, and words below say so."""
    red = []
    for unique in (True, False):
        fake = four_bar(nt=3, determined=np.full(6, unique))
        picture = frames_of(save_film(fake, tmp_path / f"{unique}.gif", fps=1, size=(400, 300)))[0]
        red.append(np.abs(picture - (0xB3, 0x26, 0x1E)).max(axis=2) < 60)
    above, words = [r[:230].sum() for r in red], [r[240:264].sum() for r in red]
    assert 0 < above[1] < 0.8 * above[0] and words[0] < 20 < words[1]


def test_a_film_of_every_kind_of_part(tmp_path: Path) -> None:
    """Gears, belts, cams, rods, slides, springs, solids, loads: a picture of each entry holds its bodies' colours."""
    for name in (
        "planetary-gear",
        "belt-drive",
        "cam-rocker",
        "rack-steering",
        "whipple-bicycle",
        "gyroscope",
        "bricard",
    ):
        entry = pt.catalogue.entry(name)
        run = entry.simulate(t_eval=np.linspace(0.0, entry.duration, 3))
        path = save_film(run, tmp_path / f"{name}.gif", fps=1, speed=entry.duration / 2, size=(200, 150))
        first = frames_of(path)[0]
        assert np.all(first[0, 0] == 255) and len(np.unique(first.reshape(-1, 3), axis=0)) > 20, name
        ink = np.argwhere(np.abs(first - 255).max(axis=2) > 40)
        assert ink.min() >= 0 and np.ptp(ink[:, 0]) > 75, name


def test_solids_and_meshes_are_filmed(tmp_path: Path) -> None:
    shapes = {
        "crank": [
            {"kind": "mesh", "file": tetrahedra(tmp_path) / "part.stl", "scale": 4.0},
            {"kind": "ball", "radius": 0.1},
        ],
        "coupler": [{"kind": "box", "size": (1, 0.2, 0.2)}, {"kind": "wheel", "radius": 0.2, "length": 0.1}],
        "ground": [
            {"kind": "plate", "points": [(0, 0, 0), (1, 0, 0), (0, -1, 0)]},
            {"kind": "rod", "start": (0, 0, 0), "end": (3, 0, 0)},
        ],
    }
    points = {"P": ("coupler", (1, 1, 0))}
    path = save_film(four_bar(), tmp_path / "s.gif", fps=1, size=(200, 150), shapes=shapes, points=points)
    assert len(frames_of(path)) == 5


def test_films_that_cannot_be_made_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.gif"
    for more, words in (
        ({"fps": 0}, "fps"), ({"fps": "fast"}, "fps"), ({"speed": -1.0}, "speed"), ({"size": (10, 10)}, "pixels"),
        ({"size": 800}, "pixels"), ({"fps": 1e4}, "pictures"), ({"speed": 1e-6}, "pictures"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=words):
            save_film(four_bar(nt=5), path, **more)
    with pytest.raises(ArgumentError, match=r"\.gif or \.mp4"):
        save_film(four_bar(nt=5), tmp_path / "x.avi")
    with pytest.raises(ArgumentError, match="no bodies"):
        save_film(Fake(np.linspace(0, 1, 9), {}, [], has_energy=False), path)
    with pytest.raises(ArgumentError, match="no outputs"):
        save_film(Fake(np.empty(0), {}, []), path)
    with pytest.raises(MissingFileError, match="does not exist"):
        save_film(four_bar(nt=5), tmp_path / "nowhere" / "x.gif")
    monkeypatch.setattr("shutil.which", lambda program: None)
    with pytest.raises(MissingDependencyError, match="ffmpeg"):
        save_film(four_bar(nt=5), tmp_path / "x.mp4")
    assert not list(tmp_path.iterdir())


def test_an_mp4_is_what_ffmpeg_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program instead of ffmpeg that records its input: all pictures, whole; its message is reported."""
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr("shutil.which", lambda name: str(program))
    path = save_film(four_bar(), tmp_path / "x.mp4", fps=2, size=(120, 120))
    assert path.stat().st_size == 10 * 120 * 120 * 3
    program.write_text('#!/bin/sh\ncat > /dev/null\necho "no such codec" >&2\nexit 1\n', encoding="utf-8")
    with pytest.raises(FileFormatError, match="no such codec"):
        save_film(four_bar(), tmp_path / "y.mp4", fps=2, size=(120, 120))
