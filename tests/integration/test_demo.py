"""`n2n demo` as the README shows it; the truth is the bracket's own formula."""

import numpy as np
import trimesh

from n2n.cli.demo import OFFSET, sample_path
from n2n.cli.main import main
from n2n.formats import read_cloud
from n2n.geometry.shapes import bracket


def test_demo_cleans_the_bundled_scan(tmp_path, capsys):
    assert main(["demo", "-o", str(tmp_path / "demo")]) == 0
    assert {path.name for path in (tmp_path / "demo").iterdir()} == {"mesh.ply", "denoised.ply", "before_after.png"}

    def error(points):
        return np.sqrt((bracket(points - OFFSET) ** 2).mean())

    noisy, clean = read_cloud(sample_path()), read_cloud(tmp_path / "demo" / "denoised.ply")
    assert len(clean) == len(noisy)
    assert error(clean.points) < 0.45 * error(noisy.points)
    mesh = trimesh.load(tmp_path / "demo" / "mesh.ply")
    assert mesh.is_watertight and mesh.body_count == 1
    assert error(mesh.vertices) < 0.5 * error(noisy.points)
    printed = capsys.readouterr().err
    assert f"{error(clean.points):.3f}" in printed and "watertight, 1 component" in printed
