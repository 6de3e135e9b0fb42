"""How the arrays of a run are stored in its page: thinned where they must be, and by how much is stated."""

import json

import numpy as np
import pytest
from fake_runs import data, four_bar, placed, unpacked

import partita as pt
from partita import viewer
from partita.viewer.packing import BYTES, FEWEST_FRAMES, LEVELS, MOST_FRAMES, pack_tables
from partita.viewer.page import fixed_bytes


def test_tables_hold_the_run() -> None:
    fake = four_bar()
    scene = data(viewer.html(fake))
    frames = scene["frames"]
    assert frames == scene["outputs"] == len(fake.t)
    table = {name: unpacked(packed, frames) for name, packed in scene["tables"].items()}
    # Single precision: 6e-8 of the value, and the negligible motion that packing lets go, 1e-7 of the largest.
    assert np.allclose(table["t"][:, 0], fake.t, rtol=1e-7, atol=5e-7)
    assert np.allclose(table["measure"], fake.measure, rtol=1e-7, atol=1e-7)
    assert np.allclose(placed(scene, 2), fake.joint("C").point, atol=2e-6)
    assert np.allclose(table["force"][:, 3:6], fake.joint("B").force, rtol=1e-7, atol=1e-6)
    x, y, z, w = table["turn"][:, 4:8].T
    rotation = fake.body("coupler").rotation
    assert np.allclose(1 - 2 * (y * y + z * z), rotation[:, 0, 0], atol=1e-6)
    assert np.allclose(2 * (x * y + z * w), rotation[:, 1, 0], atol=1e-6)


def test_still_columns_cost_nothing() -> None:
    wave = np.sin(np.linspace(0, 9, 400))
    table = np.stack([wave, np.full(400, 7.0), 1e-12 * wave], axis=1)
    packed = pack_tables({"x": table})
    assert packed.tables["x"]["moving"] == [0] and len(packed.frames) == 400 and not packed.coarse
    assert packed.tables["x"]["still"] == [7.0, 0.0]


@pytest.mark.parametrize(("nt", "columns", "kept"), [(50, 3, 50), (4000, 3, MOST_FRAMES), (240, 20_000, FEWEST_FRAMES)])
def test_long_and_large_runs_are_thinned(nt: int, columns: int, kept: int) -> None:
    time = np.linspace(0, 1, nt)[:, None]
    frames = pack_tables({"x": time * np.arange(1, columns + 1)}).frames
    assert len(frames) == kept and frames[0] == 0 and frames[-1] == nt - 1
    assert np.all(np.diff(frames) <= 2 * nt / kept + 2)


def test_a_bend_is_not_thinned_away() -> None:
    """What is said of the outputs left out is so, and a sudden motion among many slow ones is kept."""
    t = np.linspace(0.0, 10.0, 8001)
    table = np.stack([0.1 * t, np.exp(-(((t - 3.3) / 0.01) ** 2))], axis=1)
    packed = pack_tables({"x": table}, steering=table)
    kept = packed.frames
    between = np.stack([np.interp(t, t[kept], column[kept]) for column in table.T], axis=1)
    stray = float(np.abs(between - table).max())
    assert stray == pytest.approx(packed.strays) and stray < 0.01
    assert np.sum(np.abs(t[kept] - 3.3) < 0.02) == np.sum(np.abs(t - 3.3) < 0.02)


def test_two_bytes_keep_what_is_stated() -> None:
    """1/65534 of the range of each column, whatever lies beside it; what is not finite stays so; times stay exact."""
    random = np.random.default_rng(4)
    table = random.normal(size=(500, 900)) * 10.0 ** random.uniform(-9, 9, size=900)
    table[7, 3] = np.nan
    packed = pack_tables({"t": np.linspace(0, 1, 500)[:, None], "x": table})
    assert packed.coarse and "low" not in packed.tables["t"]
    found = unpacked(packed.tables["x"], len(packed.frames))
    wanted = table[packed.frames]
    assert np.isnan(found[7, 3] if 7 in packed.frames else np.nan)
    ranges = np.nanmax(wanted, axis=0) - np.nanmin(wanted, axis=0)
    moving = np.cumsum(packed.tables["x"]["moving"])  # kept from one to the next
    assert np.nanmax(np.abs(found - wanted)[:, moving] / ranges[moving]) < 0.51 / LEVELS
    assert sum(len(json.dumps(t)) for t in packed.tables.values()) < BYTES


def test_every_page_of_a_large_mechanism_stays_small() -> None:
    entry = pt.catalogue.entry("n-four-bar")
    m = entry.mechanism()
    run = m.simulate(0.5, t_eval=np.linspace(0.0, 0.5, 501), initial=entry.initial(m))
    page = viewer.html(run)
    assert len(page.encode()) - fixed_bytes() < 1_000_000
    assert data(page)["coarse"]
