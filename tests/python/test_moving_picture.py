"""The moving picture of the README: small, without scripts, closed in every pose, legible on light and dark."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from chromium import PROGRAM, Chromium

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "moving.svg"
PICTURES = [PICTURE, *sorted(PICTURE.parent.glob("tile-*.svg"))]
MOST = 300_000
SVG = "{http://www.w3.org/2000/svg}"


def numbers(animation: Any) -> np.ndarray:
    return np.array([[float(x) for x in row.split(",")] for row in animation.get("values").split(";")])


def test_there_are_six_tiles() -> None:
    assert len(PICTURES) == 7


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.stem)
def test_it_is_small_and_asks_for_nothing(picture: Path) -> None:
    text = picture.read_text("utf-8")
    assert len(text) < MOST
    for danger in ("<script", "href", "url(http", "foreignObject", "onload", "<image"):
        assert danger not in text.replace("url(#tip)", ""), danger
    assert "prefers-color-scheme" in text


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.stem)
def test_links_meet_in_every_pose(picture: Path) -> None:
    """Ends of rods, moved by their groups, lie on pins all the time; one turn ends where it began."""
    tree = ElementTree.parse(picture)
    checked = 0
    for machine in tree.getroot().findall(f"{SVG}g"):
        pins, ends = [], []
        for group in machine.findall(f"{SVG}g"):
            place = numbers(group.find(f"{SVG}animateTransform"))
            assert np.allclose(place[0], place[-1], atol=0.11)
            inner = group.find(f"{SVG}g")
            if inner is None:
                pins.append(place)
                continue
            angle = np.radians(numbers(inner.find(f"{SVG}animateTransform"))[:, 0])
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
            for path in inner.findall(f"{SVG}path"):
                points = re.findall(r"(-?[\d.]+),(-?[\d.]+)", path.get("d"))
                ends += [place + turn @ np.array(point, dtype=float) for point in points]
        pins += [
            np.tile([float(c.get("cx")), float(c.get("cy"))], (len(ends[0]), 1))
            for c in machine.findall(f"{SVG}circle")
        ]
        for end in ends:
            apart = min(float(np.abs(end - pin).max()) for pin in pins)
            assert apart < 0.4, machine.get(
                "id"
            )  # places are written to a tenth of a pixel, angles to a tenth of a degree
            checked += 1
    assert checked > (20 if picture == PICTURE else 3)


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open the picture in")
def test_it_moves_and_is_seen_on_light_and_dark(tmp_path: Path) -> None:
    from PIL import Image

    with Chromium() as browser:
        for scheme, paper in (("light", "#ffffff"), ("dark", "#0d1117")):
            page = tmp_path / f"{scheme}.html"
            page.write_text(f'<body style="margin:0;background:{paper}"><img src="{PICTURE.as_uri()}" width="900">')
            browser.open(page, (900, 330, False), scheme)
            shots = []
            for n in range(2):
                browser.value("new Promise((r) => setTimeout(r, 400))")
                browser.picture(tmp_path / f"{n}.png")
                shots.append(np.asarray(Image.open(tmp_path / f"{n}.png").convert("L"), dtype=int))
            assert np.mean(np.abs(shots[0] - shots[1]) > 20) > 0.005  # it moved
            assert np.mean(np.abs(shots[0] - int(shots[0][0, 450])) > 60) > 0.05  # and stands out from the paper
            assert browser.reported == []
