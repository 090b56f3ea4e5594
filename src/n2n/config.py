"""The typed configuration: every key of conf/ with its range; no Hydra, no torch."""

from dataclasses import dataclass, field
from typing import Any

from n2n.errors import ConfigError

AUTO = "auto"
DEVICES = ("auto", "cpu", "cuda", "mps")
TASKS = ("reconstruct", "denoise", "upsample")
PAIRS = ("random", "same")
# Keys whose entries are a component's own arguments: checked against its signature, not against this schema.
OPEN_KEYS = (
    "architecture", "distance", "pairing", "regulariser", "terms", "optimizer", "scheduler", "datamodule", "logger",
)  # fmt: skip

# Seeds of numpy, torch and Lightning; larger ones are refused by one or the other.
MAX_SEED = 2**31 - 1
_MAX_HELD_OUT = 0.5
# Whole numbers and the lowest value of each; `auto` is kept.
_WHOLE = {
    "iterations": 1,
    "batch_size": 1,
    "plan_reuse": 1,
    "checkpoint_every": 1,
    "pulls": 1,
    "num_observations": 1,
}


@dataclass
class QueriesConfig:
    """Where the field is asked; see `n2n.geometry.sampling.QuerySampler`."""

    kind: str = "observation"
    neighbour: int = 50
    scale: Any = 1.0
    pulls: int = 0

    def __post_init__(self) -> None:
        _one_of("queries.kind", self.kind, ("auto", "observation", "neighbour", "jitter"))
        self.neighbour = _whole("queries.neighbour", self.neighbour, 1)
        _at_least("queries.scale", self.scale, 0)
        self.pulls = _whole("queries.pulls", self.pulls, 0)


@dataclass
class Config:
    """One fit. Component entries are mappings of `name` and that component's arguments.

    Attributes:
        seed: Seed of everything random, 0 to 2^31 - 1.
        device: auto | cpu | cuda | mps.
        task: What the field is for; the paper chooses lambda and B by it.
        iterations: Optimiser steps; auto = what the architecture needs.
        batch_size: B, points matched at once; auto = all points, up to what one matching can take.
        num_observations: N, observations used per shape; null = all.
        regulariser_weight: lambda of Eq. 7; null without a regulariser.
        plan_reuse: Optimiser steps per matching; auto = fewer where a batch cannot hold all points.
        pairs: Observations of a pair: random (i, j) or same (i = j).
        scaffold: Build an oriented local fit before the fit (needed by the terms scaffold, far_field).
        target_noise: Noise whose outward shift, on a curved surface, is taken off the targets; unit coordinates.
        effort: Factor on the iterations that `auto` chooses.
        average_from: Share of the fit from which on the weights are averaged; 1 for never.
        redistance: Make f a distance after the fit; its zero set stays.
        checkpoint_every: Iterations between checkpoints.
        pulls: Times F is applied to denoise a point, at most: again only where that leads closer to the surface.
        terms: Further weighted terms of the loss: name -> {weight, arguments}.
        validation: Share of the points of every observation that is held out of the fit, 0 to 0.5; their mean distance
            to the fitted surface, along the normal of the cloud, is the run's score where no truth is known.
        evaluate: What is measured after the fit, where the data have a truth: `task/protocol`, e.g. denoise/sbp.
        media: Keep pictures and 3D models in the run folder; null = wherever a logger is in use.
        recipe: Name of the recipe that was chosen.
    """

    seed: int = 0
    device: str = "auto"
    task: str = "reconstruct"
    recipe: str = ""
    iterations: Any = AUTO
    batch_size: Any = AUTO
    num_observations: int | None = None
    regulariser_weight: float | None = None
    plan_reuse: Any = 1
    pairs: str = "random"
    scaffold: bool = False
    redistance: bool = False
    target_noise: Any = 0.0
    average_from: float = 1.0
    effort: float = 1.0
    checkpoint_every: int = 1000
    pulls: int = 3
    validation: float = 0.0
    evaluate: list[str] = field(default_factory=list)
    media: bool | None = None
    queries: QueriesConfig = field(default_factory=QueriesConfig)
    architecture: dict[str, Any] = field(default_factory=dict)
    distance: dict[str, Any] = field(default_factory=dict)
    pairing: dict[str, Any] = field(default_factory=dict)
    regulariser: dict[str, Any] = field(default_factory=dict)
    terms: dict[str, Any] = field(default_factory=dict)
    optimizer: dict[str, Any] = field(default_factory=dict)
    scheduler: dict[str, Any] = field(default_factory=dict)
    datamodule: dict[str, Any] = field(default_factory=dict)
    logger: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _one_of("device", self.device, DEVICES)
        _one_of("task", self.task, TASKS)
        _one_of("pairs", self.pairs, PAIRS)
        if self.regulariser_weight is not None:
            _at_least("regulariser_weight", self.regulariser_weight, 0)
        for key, lowest in _WHOLE.items():
            # null: all observations; no other number may be missing.
            if key != "num_observations" or self.num_observations is not None:
                setattr(self, key, _whole(key, getattr(self, key), lowest))
        check_seed(self.seed)
        _at_least("target_noise", self.target_noise, 0)
        _at_least("average_from", self.average_from, 0)
        _at_least("effort", self.effort, 0)
        if self.effort == 0:
            raise ConfigError("effort=0 is out of range; give a number > 0")
        if self.average_from > 1:
            raise ConfigError(f"average_from={self.average_from} is out of range; give a share from 0 to 1")
        if self.effort != 1 and self.iterations != AUTO:
            raise ConfigError(
                f"effort={self.effort} (--quality) has no effect on iterations={self.iterations}; leave one of them out"
            )
        _at_least("validation", self.validation, 0)
        if self.validation > _MAX_HELD_OUT:
            raise ConfigError(f"validation={self.validation} is out of range; give a share from 0 to {_MAX_HELD_OUT}")
        for wanted in self.evaluate:
            task, slash, protocol = wanted.partition("/")
            if task not in TASKS or not slash or not protocol:
                raise ConfigError(f"evaluate={wanted} is not known; give task/protocol, e.g. evaluate=[denoise/sbp]")
        for name, spec in self.terms.items():
            if spec is not None:
                if not isinstance(spec, dict):
                    raise ConfigError(f"terms.{name}={spec} is not a term; give its weight as terms.{name}.weight=...")
                _at_least(f"terms.{name}.weight", spec.get("weight", 1.0), 0)


def _one_of(key: str, value: Any, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ConfigError(f"{key}={value} is not known; choose one of: {', '.join(known)}")


def check_seed(seed: int) -> None:
    """Raise ConfigError for a seed that some random generator would refuse."""
    if not 0 <= seed <= MAX_SEED:
        raise ConfigError(f"seed={seed} is out of range; give a whole number from 0 to {MAX_SEED}")


def _whole(key: str, value: Any, lowest: int) -> Any:
    """Return a whole number; 1e5 is one, although YAML reads it as a float."""
    if value == AUTO:
        return value
    _at_least(key, value, lowest)
    if value != value // 1:
        raise ConfigError(f"{key}={value} is not a whole number; give one >= {lowest}")
    return int(value)


def _at_least(key: str, value: Any, lowest: int) -> None:
    if value == AUTO:
        return
    value = "null" if value is None else value  # as it is written
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(f"{key}={value} is not a number; give a number >= {lowest}")
    if not lowest <= value < float("inf"):
        raise ConfigError(f"{key}={value} is out of range; give a number >= {lowest}")
