"""Which field learns most in the same time: `python -m benchmarks.fields`; docs/experiments.md has the table.

The fast recipe with other architectures, each given the CPU time that the grid takes and six times that; one thread, so
that CPU seconds are seconds. Networks match 2048 points at a time, which costs them least per step and point.
"""

import argparse
import math
import time
from itertools import pairwise

import numpy as np
import point_cloud_utils as pcu
import torch
from torch import nn

import n2n
from benchmarks.quality import _case
from n2n.architectures.base import SDF
from n2n.registry import ARCHITECTURES

_BUDGETS = (1, 6)
_RATES = {"grid": ("auto",), "hash": ("2e-3", "1e-2"), "mlp": ("1e-4", "1e-3"), "siren": ("1e-4", "5e-4")}
_CHOSEN = {
    # Not in conf/architecture: another network's option without its arguments.
    "hash": [
        "architecture=siren",
        *(f"~architecture.{key}" for key in ("frequency", "layers", "width")),
        "architecture.name=hash",
    ],
    "mlp": ["architecture=mlp"],
    "siren": ["architecture=siren"],
}
_PRIMES = (1, 2_654_435_761, 805_459_861)


@ARCHITECTURES.register("hash")
class Hash(SDF):
    """Features in hashed grids of several resolutions, interpolated, before a small network.

    Args:
        levels: Number of grids.
        features: Numbers per corner.
        entries: Corners kept per grid; more of them share these.
        coarsest, finest: Cells along the box [-1.2, 1.2].
        width: Units of the two hidden layers.
        radius: The field starts as a sphere.
        num_conditions: One; a shape each.

    Source: Mueller et al. 2022, Instant Neural Graphics Primitives; softplus and smoothstep, as Eq. 3 needs a gradient.
    """

    def __init__(
        self,
        levels: int = 8,
        features: int = 4,
        entries: int = 2**15,
        coarsest: int = 8,
        finest: int = 96,
        width: int = 64,
        radius: float = 0.5,
        num_conditions: int = 1,
    ) -> None:
        super().__init__()
        self.cells = [round(coarsest * (finest / coarsest) ** (level / (levels - 1))) for level in range(levels)]
        self.entries, self.radius = entries, radius
        self.tables = nn.Parameter(1e-4 * torch.randn(levels, entries, features))
        sizes = [3 + levels * features, width, width]
        self.hidden = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes))
        self.head = nn.Linear(width, 1)
        nn.init.normal_(self.head.weight, std=1e-3)
        nn.init.zeros_(self.head.bias)

    def forward(self, points, condition=None):
        corners = torch.tensor([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
        primes = torch.tensor(_PRIMES)
        found = [points]
        for table, cells in zip(self.tables, self.cells, strict=True):
            position = (points + 1.2) / 2.4 * cells
            base = position.detach().floor()
            t = position - base
            t = t * t * (3 - 2 * t)
            corner = base.long()[:, None] + corners
            key = corner * primes
            index = (key[..., 0] ^ key[..., 1] ^ key[..., 2]) % self.entries
            weight = torch.where(corners.bool(), t[:, None], 1 - t[:, None]).prod(-1)
            found.append((table[index] * weight[..., None]).sum(1))
        x = torch.cat(found, -1)
        for layer in self.hidden:
            x = nn.functional.softplus(layer(x), beta=100)
        return (points.square().sum(-1) + 1e-8).sqrt() - self.radius + self.head(x).squeeze(-1)


def main() -> None:
    """Fit every case with every field, print one line each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", default="fandisk:1,spot:2", help="shape:percent of noise, ... (fandisk:1,spot:2)")
    options = parser.parse_args()
    torch.set_num_threads(1)
    for case in options.cases.split(","):
        shape, noise = case.split(":")
        _, noisy, vertices, faces = _case(shape, float(noise), 10_000, np.random.default_rng(7))
        usual = _fit(noisy, vertices, faces, ["architecture=grid"], case, "grid")
        for name in ("hash", "mlp", "siren"):
            common = [*_CHOSEN[name], "batch_size=2048"]
            step = _step_seconds(noisy, common)
            for budget in _BUDGETS:
                iterations = max(20, math.floor(budget * usual / step))
                for rate in _RATES[name]:
                    settings = [*common, f"iterations={iterations}", f"optimizer.lr={rate}"]
                    _fit(noisy, vertices, faces, settings, case, f"{name} {rate} {iterations} iterations")


def _step_seconds(noisy: np.ndarray, settings: list[str]) -> float:
    seconds = []
    for iterations in (20, 60):
        start = time.process_time()
        n2n.fit(noisy, overrides=[*settings, f"iterations={iterations}", "redistance=false"])
        seconds.append(time.process_time() - start)
    return max(seconds[1] - seconds[0], 1e-3) / 40


def _fit(
    noisy: np.ndarray, vertices: np.ndarray, faces: np.ndarray, settings: list[str], case: str, label: str
) -> float:
    start = time.process_time()
    field = n2n.fit(noisy, overrides=settings)
    seconds = time.process_time() - start
    away = pcu.closest_points_on_mesh(field.denoise(noisy), vertices, faces)[0]
    print(f"{case}  {label}".ljust(44), f"P2M_e4={1e4 * (away**2).mean():.3f}  seconds={seconds:.1f}", flush=True)
    return seconds


if __name__ == "__main__":
    main()
