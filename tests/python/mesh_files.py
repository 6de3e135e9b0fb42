"""One mesh in every format that is read."""

from pathlib import Path

import numpy as np
import pytest


def tetrahedra(folder: Path) -> Path:
    """Write one tetrahedron in every format, and a glTF whose data lies beside it; the folder."""
    trimesh = pytest.importorskip("trimesh")
    corners = np.array([(0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.1)])
    mesh = trimesh.Trimesh(corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    for ending in ("stl", "obj", "glb"):
        mesh.export(folder / f"part.{ending}")
    (folder / "text.stl").write_text(mesh.export(file_type="stl_ascii"), encoding="utf-8")
    for name, content in trimesh.Scene(mesh).export(file_type="gltf").items():
        (folder / name).write_bytes(content)
    (folder / "below").mkdir()
    model = (folder / "model.gltf").read_text(encoding="utf-8")
    (folder / "below" / "model.gltf").write_text(model.replace('"uri":"', '"uri":"../'), encoding="utf-8")
    return folder
