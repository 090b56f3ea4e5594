"""Scale parameters chosen from the data: everywhere a configuration says `auto`.

Two lengths are measured in unit coordinates, the noise sigma and the spacing (square root of the area per point, all
observations counted together); every scale of the fast recipe follows from them. docs/method.md derives the rules and
shows the measurements behind the constants.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from n2n.config import AUTO
from n2n.errors import ConfigError
from n2n.fitting.objective import DENOISED_POINTS
from n2n.geometry.scaffold import MAX_POINTS
from n2n.geometry.scale import Scales, estimate_scales

_PROBED_POINTS = 40_000
_NOISE = 0.88  # a cloud bears a little less smoothing than its noise seems to ask for
_NOISE_FLOOR = 0.057  # of the spacing: a clean cloud still has one length that limits what can be known
_VOXEL = 0.28
_STIFFNESS = 1.75
_THIN_PLATE = 0.02
_UNFOLDED = 0.3
_FAR_FIELD = 60.0
_MAX_CELLS = 3e6  # a whole street in one grid would need more; it gets a coarser one instead
_BAND_VOXELS = 3.0
_SIGNED = 1.5  # sample spacings of the scaffold: closer to the surface its winding number may be wrong
_MAX_BATCH = 32_768
_SEEN_BATCHES = 16  # over which the weights are averaged: more points than these are not seen often enough to count
_LEFT, _FITTED = 0.975, 0.03  # of the noise, what a fitted field leaves over, and what it loses per spacing / noise
_GLOBAL_BATCH = 1000  # matched as one leaf: its cost grows with the cube
_PLAN_REUSE = 20
_GRID_ITERATIONS, _GRID_RATE = 160, 0.02
_NETWORK_ITERATIONS, _NETWORK_RATE = 2000, 1e-4


@dataclass(frozen=True)
class Chosen:
    """What the data decided, unit coordinates.

    Attributes:
        noise: Deviation of the noise along the normal, at least 5.7 % of the spacing.
        spacing: Square root of the area per point over all observations, of those the fit sees at its end.
        area: Surface area.
        lower, upper: Box of the field.
        voxel: Finest cell of the grid.
        band: Half width of the zone around the data where smoothness is asked for.
        margin: Distance from the points beyond which sign and distance of the scaffold are trusted.
        batch_size: Points matched at once.
        plan_reuse: Optimiser steps per matching: fewer where one batch does not hold all points.
        observations: N.
        merged: Observations that the fit sees while weights are averaged, at most N.
    """

    noise: float
    spacing: float
    area: float
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    voxel: float
    band: float
    margin: float
    batch_size: int
    plan_reuse: int
    observations: int
    merged: float

    def values(self, config: dict[str, Any]) -> dict[str, Any]:
        """Return the values of the configuration's `auto` fields by dotted name."""
        noise = _NOISE * self.noise
        stiffness = (_STIFFNESS * noise) ** 2
        # The weights balance a squared distance; a distance of exponent 1 is larger by 1 / noise.
        unit = noise ** (config["distance"].get("p", 1) - 2)
        unsorted = config["pairing"].get("name") == "global"
        linear = config["architecture"].get("name") == "grid"
        # A fold of f to and fro inside the noise gains a share of noise^2 / area, less the more points are there, and
        # costs 1 / voxel of bending. Cells wider than the noise leave no room for one.
        room = min(1.0, noise / self.voxel) ** 4
        unfolded = _UNFOLDED * room * noise * self.voxel / self.merged ** (1 / 3)
        smoothness = max(_THIN_PLATE * self.spacing, unfolded) * noise / self.area
        effort = config["effort"]
        return {
            "iterations": max(1, round(effort * (_GRID_ITERATIONS if linear else _NETWORK_ITERATIONS))),
            "optimizer.lr": _GRID_RATE if linear else _NETWORK_RATE,
            "batch_size": min(self.batch_size, _GLOBAL_BATCH) if unsorted else self.batch_size,
            "plan_reuse": max(1, round(min(1.0, effort) * self.plan_reuse)),
            "queries.kind": "neighbour" if self.observations == 1 else "observation",
            # Of one cloud the curvature is known too badly to be trusted in full.
            "target_noise": self.noise * (1 + self.spacing / self.noise) ** -0.5,
            "queries.scale": 0.5 * noise,
            "architecture.voxel": self.voxel,
            "terms.eikonal.weight": stiffness * unit,
            "terms.smoothness.weight": smoothness * unit,
            "terms.scaffold.weight": unit,
            "terms.scaffold.normal_weight": stiffness,
            "terms.far_field.weight": _FAR_FIELD * noise**2 * unit,
        }

    def revised(self, residual: float, assumed: float) -> float:
        """Return the noise behind what a fitted field leaves over: at most what patches saw, who rarely see too little.

        Args:
            residual: Root mean square distance of the points from the zero set; NaN for unknown.
            assumed: Noise that the field was fitted with. It follows its points, more where they are sparse.
        """
        noise = residual / _LEFT * (1 + _FITTED * self.spacing / (_NOISE * assumed))
        return float(np.clip(noise, _NOISE_FLOOR * self.spacing, self.noise)) if noise > 0 else self.noise


def measure(observations: list[NDArray[np.float64]], seed: int = 0) -> tuple[Scales, NDArray[np.float64]]:
    """Estimate the scales of all observations together from a sample of them.

    Returns:
        Scales with the spacing of the *merged* observations, and the sample (at most 40 000 points).
    """
    generator = np.random.default_rng(seed)
    chosen: list[NDArray[np.float64]] = []
    for index in generator.permutation(len(observations)):
        chosen.append(observations[index])
        if sum(map(len, chosen)) >= _PROBED_POINTS:
            break
    pool = np.concatenate(chosen)
    if len(pool) > _PROBED_POINTS:
        pool = pool[generator.choice(len(pool), _PROBED_POINTS, replace=False)]
    scales = estimate_scales(pool, seed)
    total = sum(map(len, observations))
    return replace(scales, spacing=float(np.sqrt(scales.area / total))), pool


def choose(scales: Scales, observations: list[NDArray[np.float64]]) -> Chosen:
    """Turn measured scales into the parameters of the fast recipe."""
    noise = max(scales.noise, _NOISE_FLOOR * scales.spacing)
    smoothed = _NOISE * noise
    pad = max(0.12, 4 * scales.noise, scales.spacing)
    total = sum(map(len, observations))
    seen = min(total, _SEEN_BATCHES * _MAX_BATCH)
    sampled = min(DENOISED_POINTS, max(map(len, observations)))
    lower = np.min([points.min(axis=0) for points in observations], axis=0) - pad
    upper = np.max([points.max(axis=0) for points in observations], axis=0) + pad
    spacing = scales.spacing * (total / seen) ** 0.5
    voxel = max(_VOXEL * (smoothed * spacing) ** 0.25, float(np.prod(upper - lower) / _MAX_CELLS) ** (1 / 3))
    return Chosen(
        noise=noise,
        spacing=spacing,
        area=scales.area,
        lower=tuple(float(x) for x in lower),
        upper=tuple(float(x) for x in upper),
        voxel=voxel,
        band=_BAND_VOXELS * voxel,
        margin=max(
            3 * smoothed,
            2 * voxel,
            2 * float(np.sqrt(scales.area / sampled)),
            _SIGNED * float(np.sqrt(scales.area / MAX_POINTS)),
        ),
        batch_size=min(total, _MAX_BATCH),
        plan_reuse=int(np.clip(_PLAN_REUSE * _MAX_BATCH // total, 4, _PLAN_REUSE)),
        observations=len(observations),
        merged=len(observations) * seen / total,
    )


def fill(config: Any, values: dict[str, Any], path: str = "") -> Any:
    """Return a copy of nested dicts with every `auto` replaced by the value of its dotted name.

    Raises:
        ConfigError: An `auto` without a value.
    """
    if isinstance(config, dict):
        return {key: fill(item, values, f"{path}.{key}" if path else str(key)) for key, item in config.items()}
    if config != AUTO:
        return config
    if path not in values:
        raise ConfigError(f"{path}=auto: nothing in the data tells its value; give a number")
    return values[path]
