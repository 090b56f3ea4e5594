"""Theorem 1 as a program: points fitted to many noisy observations under EMD become clean, under CD they do not.

No network and no signed distance here, only Eq. 4: free points G' minimise sum_i L(G', N_i), from random positions. The
one-to-one map of EMD gives every point of G' a partner of its own in each observation, and the mean of those partners
is a clean point. The nearest neighbours of CD are no such map: several points share a partner, others have none.

    python examples/theorem1.py -o out/theorem1.png

Source: Ma et al. 2023, Theorem 1 and Fig. 4.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from n2n.geometry.shapes import sample_surface
from n2n.registry import DISTANCES


def observe(clean: np.ndarray, noise: float, count: int, seed: int = 0) -> torch.Tensor:
    """Return (count, n, 3) observations: the clean points (n, 3), each time with fresh noise and in another order."""
    random = np.random.default_rng(seed)
    noisy = clean + noise * random.standard_normal((count, *clean.shape))
    return torch.as_tensor(np.stack([random.permutation(cloud) for cloud in noisy]), dtype=torch.float32)


def optimise(distance: str, observations: torch.Tensor, sweeps: int = 15, seed: int = 0) -> np.ndarray:
    """Minimise sum_i L(G', N_i) over free points G' by gradient descent.

    Args:
        distance: Registered name; used with exponent 2, as in the proof.
        observations: (N, n, 3).
        sweeps: Gradient steps, each over all observations.
        seed: Of the start, uniform in [-1, 1]^3.

    Returns:
        G', (n, 3).
    """
    measure = DISTANCES.build(distance, p=2)
    points = torch.rand(observations.shape[1:], generator=torch.Generator().manual_seed(seed)) * 2 - 1
    points.requires_grad_(True)
    # This rate moves a point to the mean of its partners in one step of EMD.
    optimizer = torch.optim.SGD([points], lr=len(points) / 2)
    for _ in range(sweeps):
        optimizer.zero_grad()
        measure(points.expand_as(observations), observations).backward()
        optimizer.step()
    return points.detach().double().numpy()


def matched(clean: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the partner in `points` of each clean point under EMD, (n, 3), and its distance, (n,); the mean is L."""
    pair = [torch.as_tensor(cloud, dtype=torch.float32)[None] for cloud in (clean, points)]
    partner = points[DISTANCES.build("emd", p=1).match(*pair)[0].numpy()]
    return partner, np.linalg.norm(partner - clean, axis=1)


def draw(path: Path, clean: np.ndarray, clouds: dict[str, np.ndarray]) -> None:
    """Write the picture: the torus from above, each point with a line to the clean point it should be."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * len(clouds), 4.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, points) in zip(figure.subplots(1, len(clouds)), clouds.items(), strict=True):
        partner, distance = matched(clean, points)
        axes.add_collection(LineCollection(np.stack([clean, partner], axis=1)[..., :2], color="0.75", linewidth=0.8))
        dots = axes.scatter(*partner[:, :2].T, c=distance, cmap="plasma", vmin=0, vmax=0.15, s=10, zorder=2)
        axes.set(title=f"{name}: L = {distance.mean():.3f}", aspect="equal", xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
        axes.axis("off")
    figure.colorbar(dots, ax=figure.axes, label="distance to its clean point", shrink=0.8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("-o", "--output", type=Path, default=Path("out/theorem1.png"), help="picture to write")
    options.add_argument("--points", type=int, default=400)
    options.add_argument("--noise", type=float, default=0.03, help="standard deviation; the torus has radius 0.95")
    options.add_argument("--observations", type=int, default=60)
    given = options.parse_args()
    clean = sample_surface("torus", given.points)
    observations = observe(clean, given.noise, given.observations)
    clouds = {"one observation": observations[0].double().numpy()}
    clouds |= {f"under {name.upper()}": optimise(name, observations) for name in ("cd", "emd")}
    for name, points in clouds.items():
        print(f"{name:<16} L(G, G') = {matched(clean, points)[1].mean():.4f}")
    draw(given.output, clean, clouds)
    print(f"picture: {given.output}")


if __name__ == "__main__":
    main()
