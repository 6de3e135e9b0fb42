"""The gallery: every mechanism of the catalogue with its picture, its facts and its animated page."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from partita import catalogue
from partita.errors import PartitaError
from partita.plots.measure import draw_measure
from partita.plots.style import COLOURS, dressed, new_figure
from partita.results import Result
from partita.viewer import scene

Points = NDArray[np.float64]
ANSWERED = "With published or closed-form answers"
WIDTH, HEIGHT, MARGIN = 220.0, 150.0, 16.0
GROUND = -1
QUALITY, OUTPUTS = "quality", 121


def build(folder: Path, live: Path, only: tuple[str, ...] | None = None) -> None:
    """Pages into `folder`, animated pages into `live`; `only` some of the mechanisms."""
    folder.mkdir(parents=True, exist_ok=True)
    live.mkdir(parents=True, exist_ok=True)
    cards: dict[str, list[str]] = {}
    names: list[str] = []
    for theme, members in themes().items():
        for name in members:
            if only is None or name in only:
                cards.setdefault(theme, []).append(_mechanism(name, folder, live))
                names.append(name)
    parts = ["# Gallery", INTRODUCTION]
    parts += [f'## {theme}\n\n<div class="gallery">\n{"".join(shown)}</div>' for theme, shown in cards.items()]
    listed = "\n".join(names)
    parts.append(f"```{{toctree}}\n:hidden:\n\n{listed}\n```")
    (folder / "index.md").write_text("\n\n".join([*parts, ""]), encoding="utf-8")


INTRODUCTION = (
    "Every mechanism of the [catalogue](../catalogue.md), drawn and run when these pages were made. Open one to play "
    "its motion: drag to turn, wheel to zoom, slide through time. The pages ask for no network."
)


def themes() -> dict[str, list[str]]:
    """Theme -> names; all entries of the catalogue, each once."""
    found = {theme: list(members) for theme, members in catalogue.zoo.THEMES.items()}
    return {ANSWERED: [name for name in catalogue.names() if name not in catalogue.zoo.ENTRIES], **found}


def _mechanism(name: str, folder: Path, live: Path) -> str:
    """Write the pages of one mechanism; its card."""
    entry = catalogue.entry(name)
    run = entry.simulate()
    run.to_html(live / f"{name}.html")
    judged = []
    if run.independent.shape[1]:  # else every position is prescribed
        over = quality(entry, run, folder / QUALITY / f"{name}.png")
        judged = [
            f"[The measure](../measure.md) of each velocity and the quality of the choice over {over}:",
            f"![rho of the velocities with the chosen ones on top; volume, sigma and sqrt(mu)]({QUALITY}/{name}.png)",
        ]
    title = entry.title[0].upper() + entry.title[1:]
    summary = run.summary
    facts = [
        ("bodies, joints", f"{len(summary['bodies'])}, {len(summary['joints'])}"),
        ("degrees of freedom", str(summary["mobility"])),
        ("redundant constraints", str(len(summary["removed"]))),
        ("run", f"{entry.duration:g} s, {run.certificate.verdict}"),
        ("largest closure error", f"{run.certificate.closure:.1e}"),
    ]
    if run.certificate.energy_balance is not None:
        facts.append(("energy balance", f"{run.certificate.energy_balance:.1e}"))
    why = [f"{entry.truth.why[0].upper()}{entry.truth.why[1:]}."] if entry.truth else []
    text = [
        f"# {name}",
        f"{title}.",
        f'<iframe class="live" src="../live/{name}.html" title="{escape(name)} in motion" loading="lazy"></iframe>',
        f'<p><a href="../live/{name}.html">The animated page alone</a></p>',
        "| | |\n|---|---|\n" + "\n".join(f"| {what} | {value} |" for what, value in facts),
        *why,
        *([entry.notes] if entry.notes else []),
        *judged,
        f"Source: {entry.source}.",
        f'```python\nimport partita as pt\n\nentry = pt.catalogue.entry("{name}")\nrun = entry.simulate()\n'
        f'run.to_html("{name}.html")\n```',
    ]
    (folder / f"{name}.md").write_text("\n\n".join([*text, ""]), encoding="utf-8")
    return (
        f'<a class="card" href="{name}.html">{picture(scene.describe(run, None), run)}'
        f"<b>{escape(name)}</b><span>{escape(entry.title)}</span></a>\n"
    )


def turn(run: Result) -> tuple[float, str]:
    """When the first hinge has made a whole turn, and what it is; the whole run where none does."""
    found = [(float(run.t[-1]), f"the run of {run.t[-1]:g} s")]
    for joint in run.summary["joints"]:
        angle = run.joint(joint["name"]).position
        if joint["kind"] == "revolute" and angle.shape[1] == 1:
            far = np.flatnonzero(np.abs(angle[:, 0] - angle[0, 0]) >= 2.0 * np.pi)
            found += [(float(run.t[far[0]]), f"the first turn of {joint['name']}")] if len(far) else []
    return min(found)


def quality(entry: catalogue.Entry, run: Result, path: Path) -> str:
    """Draw rho, volume, sigma and sqrt(mu) over one turn; what it is over, in words."""
    end, words = turn(run)
    m = entry.mechanism()
    shown = m.simulate(end, initial=entry.initial(m), t_eval=np.linspace(0.0, end, OUTPUTS), **entry.options)
    k = shown.independent.shape[1]
    figure = new_figure(8.6, 2.6 if k <= 3 else 3.6)  # more bands on top of the measure leave less room below
    grid = figure.add_gridspec(1, 2, width_ratios=[1.3, 1.0])
    draw_measure(shown, figure, grid[0])
    ax = dressed(figure.add_subplot(grid[1]), "Quality of the choice", "")
    lines = {"volume": volumes(shown), "σ": shown.sigma, "√μ": shown.sqrt_mu}
    for n, (label, values) in enumerate(lines.items()):
        ax.plot(shown.t, values, ("-", "--", ":")[n], color=COLOURS[n], lw=1.3, label=label)
    ax.set_ylim(-0.03, 1.05)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    for each in figure.axes:
        each.xaxis.set_major_locator(MaxNLocator(5))
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path)
    return words


def volumes(run: Result) -> Points:
    """Volume of the choice at each output; NaN at singular positions."""

    def volume(output: int) -> float:
        try:
            return run.geometry(output).volume
        except PartitaError:
            return float("nan")

    return np.array([volume(output) for output in range(len(run.t))])


def picture(drawn: dict[str, Any], run: Any) -> str:
    """The mechanism at its start as a small drawing in the colours of the page, seen from where its page shows it."""
    view = drawn["view"]
    sight = np.array([view["right"], view["up"]], dtype=float)
    pieces: list[tuple[str, Points]] = []
    for body in drawn["bodies"]:
        at = run.body(body["name"])
        world = np.array(body["points"], dtype=float) @ at.rotation[0].T + at.position[0]
        pieces.append((body["kind"], world @ sight.T))
    pins = {joint["name"]: run.joint(joint["name"]).point[0] @ sight.T for joint in drawn["joints"]}
    outlines = [(look, points @ sight.T) for look, points in _outlines(drawn, run, sight)]
    shown = [points for _, points in [*pieces, *outlines]]
    fit = _fit(np.concatenate([*shown, *(p.reshape(1, 2) for p in pins.values())]))
    lines = [f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(drawn["title"])}">']
    for look, points in outlines:
        path = "L".join(f"{x:.1f},{y:.1f}" for x, y in fit(points))
        lines.append(f'<path class="{look}" d="M{path}"/>')
    for number, (kind, points) in enumerate(pieces):
        lines.append(_shape(kind, fit(points), f"hue{number % 6}"))
    for joint in drawn["joints"]:
        place = fit(pins[joint["name"]].reshape(1, 2))[0]
        held = " ground" if joint["parent"] == GROUND else ""
        lines.append(f'<circle class="pin{held}" cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="3.2"/>')
    return "".join([*lines, "</svg>"])


def _outlines(drawn: dict[str, Any], run: Any, sight: Points) -> Iterator[tuple[str, Points]]:
    """Wheels, balls that roll, belts, cams, rods without mass and springs: their look and their points in the world."""
    names = [body["name"] for body in drawn["bodies"]]

    def world(body: int, points: Any) -> Points:
        local = np.atleast_2d(np.array(points, dtype=float))
        at = run.body(names[body]) if body != GROUND else None
        return local if at is None else local @ at.rotation[0].T + at.position[0]

    def hue(body: int) -> str:
        return f"thin hue{body % 6}" if body != GROUND else "thin"

    angle = np.linspace(0.0, 2.0 * np.pi, 49)[:, None]
    rounds = [(wheel["body"], wheel) for wheel in drawn["wheels"]]
    rounds += [(solid["body"], part) for solid in drawn["solids"] for part in solid["parts"] if "radius" in part]
    for body, part in rounds:
        middle, across = world(body, part["center"])[0], sight
        if part.get("kind") != "ball":  # a circle about its axis; a ball is round from everywhere
            axis = world(body, part["axis"])[0] - world(body, (0, 0, 0))[0]
            across = np.linalg.svd(axis[None, :])[2][1:]
        yield hue(body), middle + part["radius"] * (np.cos(angle) * across[0] + np.sin(angle) * across[1])
    for line in drawn["lines"]:
        points = world(line["body"], line["points"])
        yield hue(line["body"]), np.concatenate((points, points[:1])) if line["closed"] else points
    for look, two in [*(("thin", rod) for rod in drawn["rods"]), *(("spring", spring) for spring in drawn["springs"])]:
        yield look, np.concatenate([world(two[f"body{end}"], two[f"point{end}"]) for end in (1, 2)])


def _shape(kind: str, points: Points, hue: str) -> str:
    """One body."""
    if kind == "plate":
        corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        return f'<polygon class="{hue}" points="{corners}"/>'
    if kind == "frame":
        ring = "L".join(f"{x:.1f},{y:.1f}" for x, y in points)
        return f'<path class="{hue}" fill="none" d="M{ring}Z"/>'
    if len(points) == 1:
        return f'<circle class="body {hue}" cx="{points[0, 0]:.1f}" cy="{points[0, 1]:.1f}" r="6"/>'
    middle, ends = points[0], points[1:]
    rays = "".join(f"M{middle[0]:.1f},{middle[1]:.1f}L{x:.1f},{y:.1f}" for x, y in ends)
    return f'<path class="{hue}" d="{rays}"/>'


def _fit(points: Points) -> Any:
    """What moves points into the drawing."""
    low, high = points.min(axis=0), points.max(axis=0)
    span = np.maximum(high - low, 1e-9 * max(float(np.abs(points).max()), 1e-9))
    scale = min((WIDTH - 2 * MARGIN) / span[0], (HEIGHT - 2 * MARGIN) / span[1])
    middle = (low + high) / 2

    def fit(found: Points) -> Points:
        return (found - middle) * [scale, -scale] + [WIDTH / 2, HEIGHT / 2]

    return fit
