"""Quality of a setting on the clouds of ../shared/data/peers: `python -m benchmarks.quality [options] [key=value ...]`.

The command behind the experiment log (docs/experiments.md). One process fits every case; scores are those of
../shared/accept/accept.py, which judges the installed command instead.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import point_cloud_utils as pcu

import n2n
from n2n.geometry.outliers import outliers

SHARED = Path(__file__).resolve().parents[2] / "shared"
SHAPES = ("fandisk", "rocker-arm", "spot", "stanford-bunny")
_BAND = (0.02, 0.1)


def main() -> None:
    """Fit every case, print one line for each and the means for each noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shapes", default=",".join(SHAPES))
    parser.add_argument("--noise", default="1,2,3", help="percent of the unit sphere's radius; any number (1,2,3)")
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--observations", type=int, default=1)
    parser.add_argument("--outliers", type=float, default=0.0, help="share of uniform points added (0)")
    parser.add_argument("--dense", type=float, default=1.0, help="thin half of the cloud by this factor (1)")
    parser.add_argument("--even", action="store_true")
    options, overrides = parser.parse_known_args()
    sys.path.insert(0, str(SHARED / "accept"))
    for noise in options.noise.split(","):
        rows = [_score(shape, float(noise), options, overrides) for shape in options.shapes.split(",")]
        mean = {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
        print(f"mean of {len(rows)} at {noise} %".ljust(28), _line(mean), flush=True)


def _score(shape: str, noise: float, options: argparse.Namespace, overrides: list[str]) -> dict[str, float]:
    import accept

    random = np.random.default_rng(7)
    clean, noisy, vertices, faces = _case(shape, noise, options.points, random)
    if options.dense > 1:
        kept = (clean[:, 0] < np.median(clean[:, 0])) | (random.random(len(clean)) < 1 / options.dense)
        clean, noisy = clean[kept], noisy[kept]
    more = [clean + noise / 100 * random.standard_normal(clean.shape) for _ in range(options.observations - 1)]
    low, high = noisy.min(axis=0), noisy.max(axis=0)
    stray = random.uniform(
        low - 0.05 * (high - low), high + 0.05 * (high - low), (int(options.outliers * len(noisy)), 3)
    )
    start = time.perf_counter()
    field = n2n.fit([np.concatenate([noisy, stray]), *more], overrides=overrides)
    seconds = time.perf_counter() - start
    moved = field.denoise(noisy, even=options.even)
    oracle = accept.project(noisy, vertices, faces)[1]
    mesh = field.reconstruct(256)
    scores = {
        "CD_sum_e4": accept.cd_sum(moved, clean),
        "P2M_e4": 1e4 * (accept.project(moved, vertices, faces)[0] ** 2).mean(),
        "floor_CD": accept.cd_sum(oracle, clean),
        **accept.mesh_scores(mesh.vertices.view(np.ndarray), mesh.faces.view(np.ndarray), vertices, faces),
        "watertight": float(mesh.is_watertight),
        "components": float(mesh.body_count),
        **_distance_error(field, noisy, vertices, faces),
        "seconds": seconds,
    }
    if len(stray):
        found = outliers(np.concatenate([noisy, stray]))
        far = accept.project(stray, vertices, faces)[0] > 8 * noise / 100
        scores |= {"recall_8sigma": found[len(noisy) :][far].mean(), "lost": found[: len(noisy)].mean()}
    print(f"{shape} {noise:g} %".ljust(28), _line(scores), flush=True)
    return scores


def _case(shape: str, noise: float, points: int, random: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return clean and noisy points and the true mesh; noise that has no file is added to the clean points."""
    path = SHARED / "data" / "peers" / f"{shape}_{points}_{noise:g}.npz"
    exists = path.exists()
    data = np.load(path if exists else path.with_name(f"{shape}_{points}_1.npz"))
    clean = data["clean"].astype(float)
    noisy = data["noisy"].astype(float) if exists else clean + noise / 100 * random.standard_normal(clean.shape)
    return clean, noisy, data["verts"].astype(float), data["faces"].astype(np.int64)


def _distance_error(field: "n2n.Field", noisy: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> dict[str, float]:
    """Return the share of wrong signs beyond 0.03 and the median relative error of |f| at 0.02 to 0.1."""
    low, high = noisy.min(axis=0) - 0.1, noisy.max(axis=0) + 0.1
    points = np.random.default_rng(0).uniform(low, high, (6000, 3))
    true, found = pcu.signed_distance_to_mesh(points, vertices, faces)[0], field.sdf_at(points)
    away, band = np.abs(true) > 0.03, (np.abs(true) > _BAND[0]) & (np.abs(true) < _BAND[1])
    error = np.abs(found - true)[band] / np.abs(true[band])
    return {"wrong_signs": float((np.sign(found) != np.sign(true))[away].mean()), "f_error": float(np.median(error))}


def _line(scores: dict[str, float]) -> str:
    return "  ".join(f"{key}={value:.4g}" for key, value in scores.items())


if __name__ == "__main__":
    main()
