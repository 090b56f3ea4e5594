"""Run folders as a fit leaves them, without fitting."""

import csv
import json

import numpy as np
import pytest
import trimesh
import yaml

CONFIG = {
    "seed": 0,
    "device": "cpu",
    "iterations": None,
    "batch_size": None,
    "num_observations": None,
    "regulariser_weight": 0.1,
    "distance": {"name": "emd", "p": 2},
    "regulariser": {"name": "consistency"},
    "datamodule": {"name": "pu", "shape": "duck", "points": 10000, "noise": 0.03},
    "logger": {"_target_": "CSVLogger"},
}
SUMMARY = {"iterations": 160, "observations": [200], "noise": [0.0297], "validation": 0.4, "seconds": 12.5}


def write_run(folder, state="done", settings=(), error=None, cd=4e-4, media=False, **config):
    """Write a run folder; `config` replaces top-level settings."""
    folder.mkdir(parents=True)
    composed = {**CONFIG, **config}
    (folder / "config.yaml").write_text(yaml.safe_dump(composed))
    with (folder / "metrics.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["distance", "loss", "step"])
        writer.writerows([1 / step, 2 / step, step] for step in range(1, 50))
    status = {"state": state, "attempt": 1, "settings": list(settings), "error": error, "seconds": 12.5}
    (folder / "status.json").write_text(json.dumps({**status, "started": "2026-01-01T10:00:00+00:00"}))
    if state == "done":
        used = {**composed, "iterations": 160, "batch_size": 10000}
        (folder / "summary.json").write_text(json.dumps({**SUMMARY, "config": used}))
        (folder / "field.ckpt").write_bytes(b"field")
        result = {"values": {"cd_sum2": cd, "p2m": 1e-4}, "floors": {"oracle": {"cd_sum2": 3e-4}}, "blanks": {}}
        (folder / "evaluation.json").write_text(json.dumps({"validation": 0.4, "evaluations": {"denoise/sbp": result}}))
    if media:
        write_media(folder / "media")
    return folder


def write_media(folder):
    folder.mkdir()
    sphere = trimesh.creation.icosphere(subdivisions=2)
    sphere.export(folder / "mesh.glb")
    points = np.asarray(sphere.vertices, np.float32)
    np.savez_compressed(folder / "points.npz", points=points, error=np.abs(points[:, 2]))
    from PIL import Image

    Image.new("RGB", (40, 20), "red").save(folder / "level_sets.png")


def write_sweep(folder, runs):
    """Write a sweep: `runs` by hash, each a dict of arguments of `write_run`, or None for one that did not start."""
    planned = {name: {"settings": (made or {}).get("settings", ["seed=9"])} for name, made in runs.items()}
    folder.mkdir(parents=True)
    record = {"name": folder.name, "command": ["-m", "seed=0,1"], "created": "2026-01-01T10:00:00", "axes": {}}
    (folder / "sweep.json").write_text(json.dumps({**record, "runs": planned}))
    for name, made in runs.items():
        if made is not None:
            write_run(folder / "runs" / name, **made)
    return folder


@pytest.fixture
def sweep(tmp_path):
    """Three weights and two seeds; one run failed, one is still to come."""
    runs = {
        f"aaaaaaaa{weight * 100:.0f}{seed}": {
            "settings": [f"regulariser_weight={weight}", f"seed={seed}"],
            "seed": seed,
            "regulariser_weight": weight,
            "cd": 1e-4 * (4 + seed + weight),
            "media": seed == 0,
        }
        for weight in (0.05, 0.1, 0.2)
        for seed in (0, 1)
    }
    failed = {"settings": ["regulariser_weight=9", "seed=0"], "state": "failed", "error": "weight out of range"}
    return write_sweep(tmp_path / "weights", {**runs, "ffffffffff": failed, "0000000000": None})
