"""Tables: one row per output, one column per number (CSV, Parquet, pandas)."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ..errors import MissingDependencyError
from ..readable import Readable
from .names import coordinate_units
from .variables import axes

if TYPE_CHECKING:
    import pandas


XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Column:
    """One number over time: its name, its unit ("" where not known) and its nt values."""

    name: str
    unit: str
    values: NDArray[Any]


def columns(result: Readable) -> list[Column]:
    """Columns of the table, time first: `q.A`, `v.A`, `joint.A.force.x`, `body.crank.position.x`, ...

    Rotation matrices of bodies and joints and indices of the independent coordinates are left to the other formats.
    """
    names = result.names
    q_units, v_units = coordinate_units(result.summary, names)
    found = [Column("t", "s", result.t)]
    found += _spread("q.{}", names.coordinates, q_units, result.q)
    found += _spread("v.{}", names.velocities, v_units, result.v)
    found += _spread("vdot.{}", names.velocities, [f"{u}^2" if u else "" for u in v_units], result.vdot)
    found += _spread("multiplier.{}", names.multipliers, [""] * len(names.multipliers), result.multipliers)
    found += _spread("rho.{}", names.velocities, ["1"] * len(names.velocities), result.measure)
    for name in ("closure", "velocity_closure", "sigma", "sqrt_mu"):
        found.append(Column(name, "", getattr(result, name)))
    if result.has_energy:
        energy = result.energy
        for name in ("kinetic", "potential", "total", "work"):
            found.append(Column(f"energy.{name}", "J", getattr(energy, name)))
    if result.is_mechanism:
        found += _joints(result) + _bodies(result) + _sensors(result)
    return [column for column in found if len(column.values) == len(result.t)]


def _joints(result: Readable) -> list[Column]:
    every = axes(result)
    position, freedom = every["joint_coordinate"], every["joint_freedom"]
    efforts = ["N" if unit == "m/s" else "N m" for unit in freedom.units]
    seen, reactions = result.observed, result.reactions
    found = _spread("joint.{}.position", position.labels, position.units, seen["joint_position"])
    found += _spread("joint.{}.velocity", freedom.labels, freedom.units, seen["joint_velocity"])
    per_second = [f"{unit}^2" for unit in freedom.units]
    found += _spread("joint.{}.acceleration", freedom.labels, per_second, result.joint_accelerations)
    found += _spread("joint.{}.drive", freedom.labels, efforts, reactions["drive"])
    conditions = every["condition"].labels
    found += _spread("effort.{}", conditions, [""] * len(conditions), reactions["effort"])
    for j, name in enumerate(result.names.joints):
        for what, unit in (("force", "N"), ("moment", "N m")):
            found += _spread(f"joint.{name}.{what}.{{}}", XYZ, (unit,) * 3, reactions[what][:, j])
    return found


def _bodies(result: Readable) -> list[Column]:
    found: list[Column] = []
    for b, name in enumerate(result.names.bodies):
        for what, unit in (("position", "m"), ("velocity", "m/s"), ("angular_velocity", "rad/s")):
            found += _spread(f"body.{name}.{what}.{{}}", XYZ, (unit,) * 3, result.observed[f"body_{what}"][:, b])
    return found


def _sensors(result: Readable) -> list[Column]:
    found: list[Column] = []
    for item in result.summary.get("sensors", ()):
        read = result.sensor(item["name"])
        if read.values.ndim == 1:
            found.append(Column(f"sensor.{read.name}", read.unit, read.values))
        elif read.values.ndim == 2:
            width = read.values.shape[1]
            labels = XYZ if width == 3 else tuple(map(str, range(width)))
            found += _spread(
                f"sensor.{read.name.replace('{', '(').replace('}', ')')}.{{}}",
                labels,
                (read.unit,) * width,
                read.values,
            )
    return found


def _spread(pattern: str, labels: Any, units: Any, values: NDArray[Any]) -> list[Column]:
    head, tail = pattern.rsplit("{}", 1)
    pairs = enumerate(zip(labels, units, strict=True))
    return [Column(f"{head}{label}{tail}", unit, values[:, i]) for i, (label, unit) in pairs]


def as_csv(result: Readable) -> bytes:
    """Comma separated, one header line with units in brackets, numbers to full precision."""
    found = columns(result)
    file = StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(f"{c.name} [{c.unit}]" if c.unit not in ("", "1") else c.name for c in found)
    writer.writerows(map(repr, row) for row in zip(*(c.values.tolist() for c in found), strict=True))
    return file.getvalue().encode("utf-8")


def as_parquet(result: Readable) -> bytes:
    """Parquet through pyarrow, with checksums of its pages; a column's unit stands in the metadata of its field."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise missing("pyarrow", "parquet", "saving to Parquet") from error
    found = columns(result)
    schema = pyarrow.schema(
        [pyarrow.field(c.name, pyarrow.from_numpy_dtype(c.values.dtype), metadata={"unit": c.unit}) for c in found],
        metadata={"title": result.title, "status": result.status},
    )
    table = pyarrow.table([pyarrow.array(c.values) for c in found], schema=schema)
    stream = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, stream, write_page_checksum=True)
    content: bytes = stream.getvalue().to_pybytes()
    return content


def to_pandas(result: Readable) -> pandas.DataFrame:
    """See `Result.to_pandas`."""
    try:
        import pandas
    except ImportError as error:
        raise missing("pandas", "pandas", "to_pandas") from error
    found = columns(result)
    frame = pandas.DataFrame({c.name: c.values for c in found[1:]}, index=pandas.Index(found[0].values, name="t"))
    frame.attrs["units"] = {c.name: c.unit for c in found}
    frame.attrs["title"] = result.title
    return frame


def missing(package: str, extra: str, purpose: str) -> MissingDependencyError:
    """The error for an optional package that is not installed."""
    return MissingDependencyError(
        f"{purpose} needs {package}, which is not installed; pip install 'partita[{extra}]'", package=package
    )
