"""What Lightning costs: a whole fit's loop against a bare loop of the same steps."""

import copy
import cProfile
import pstats
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import lightning as L
import torch

from benchmarks.scene import at_training
from benchmarks.tables import number, span, table
from benchmarks.timing import ratio, spread
from n2n.datamodules.observations import ObservationsDataModule
from n2n.fitting.module import FitModule
from n2n.fitting.revision import Revision

TITLE = "Lightning"
TRIAL = {"points": 300, "rounds": 2, "overrides": ["iterations=8", "plan_reuse=4"]}
_LIMIT = 0.05
_SHOWN = 6
_train = L.Trainer.fit


def run(points: int = 10_000, rounds: int = 5, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Measure.

    Args:
        points: Of the cloud.
        rounds: Turns.
        overrides: Settings of the fit.
    """
    stamps: list[float] = []
    report = lambda *_: stamps.append(time.perf_counter())  # noqa: E731
    turns = []
    for turn in range(rounds):
        stamps.clear()
        both = partial(_both, stamps=stamps, bare_first=turn % 2 == 1)
        turns.append(at_training(points, both, overrides, report=report))
    ours, bare = zip(*turns, strict=True)
    return {
        "points": points,
        "iterations": bare[0]["iterations"],
        "blocks": len(bare[0]["blocks"]),
        "lightning": spread([one["seconds"] for one in ours]),
        "bare": spread([one["seconds"] for one in bare]),
        "ratio": ratio([one["seconds"] for one in ours], [one["seconds"] for one in bare]),
        "ratio_of_blocks": ratio([_later(one) for one in ours], [_later(one) for one in bare]),
        "disagreement": float((ours[0]["weights"] - bare[0]["weights"]).abs().max()),
        "profile": at_training(points, _profile, overrides),
    }


def render(result: dict[str, Any]) -> str:
    def percent(values: dict[str, float]) -> str:
        return span({name: 100 * (value - 1) for name, value in values.items()}, " %")

    median, blocks = result["ratio"]["median"] - 1, result["blocks"]
    fixed = result["lightning"]["median"] - result["bare"]["median"] * result["ratio_of_blocks"]["median"]
    own = result["profile"]["own"]
    lines = [
        f"{result['iterations']} optimiser steps in {blocks} blocks on {result['points']:,} points: `Trainer.fit` "
        "from call to return against the same training step and copies of the same objects in a Python loop. Their "
        f"fitted weights differ by {result['disagreement']:.1g} at most.",
        "",
        table(
            ["Lightning", "bare loop", "Lightning costs", "of these, inside the loop"],
            [
                [
                    span(result["lightning"], " s"),
                    span(result["bare"], " s"),
                    percent(result["ratio"]),
                    percent(result["ratio_of_blocks"]),
                ]
            ],
        ),
        "",
        f"Start and end, whatever the number of steps: about {number(1e3 * max(0.0, fixed))} ms. Own time of "
        f"Lightning's functions, profiled and so too long rather than too short: {number(1e3 * own)} ms, "
        f"{number(100 * own / result['bare']['median'])} % of the bare loop. "
        + (f"Within the limit of {_LIMIT:.0%}." if median < _LIMIT else f"**Above the limit of {_LIMIT:.0%}.**"),
    ]
    if median >= _LIMIT:
        rows = [
            [f"`{row['function']}`", row["calls"], f"{1e3 * row['own']:.1f} ms"] for row in result["profile"]["largest"]
        ]
        lines += ["Where it goes:", "", table(["function", "calls", "time"], rows)]
    return "\n".join(lines)


def _both(
    trainer: L.Trainer, module: FitModule, data: ObservationsDataModule, stamps: list[float], bare_first: bool
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run the same fit under Lightning and without."""
    bare, revision = copy.deepcopy(module), copy.copy(next(c for c in trainer.callbacks if isinstance(c, Revision)))
    if bare_first:
        loop = _bare_loop(bare, data, revision)
        return _lightning(trainer, module, data, stamps), loop
    return _lightning(trainer, module, data, stamps), _bare_loop(bare, data, revision)


def _lightning(
    trainer: L.Trainer, module: FitModule, data: ObservationsDataModule, stamps: list[float]
) -> dict[str, Any]:
    start = time.perf_counter()
    _train(trainer, module, data)
    seconds = time.perf_counter() - start
    return {"seconds": seconds, "blocks": list(stamps), "weights": _weights(module.field)}


class _Bare:
    """What a training step asks of Lightning, in plain torch."""

    def __init__(self, module: FitModule) -> None:
        configured = module.configure_optimizers()
        self.module, self.global_step = module, 0
        self.optimizers, self.lr_schedulers = (lambda: configured["optimizer"]), (lambda: configured["lr_scheduler"])

    def __getattr__(self, name: str) -> Any:
        return getattr(self.module, name)

    def manual_backward(self, loss: torch.Tensor) -> None:
        loss.backward()

    def log_dict(self, *_: Any, **__: Any) -> None:
        pass


def _bare_loop(module: FitModule, data: ObservationsDataModule, revision: Revision) -> dict[str, Any]:
    stamps, start = [], time.perf_counter()
    bare, draws = _Bare(module), iter(data.train_dataloader().dataset)
    for bare.global_step in range(0, module.iterations, module.plan_reuse):
        revision.on_train_batch_start(None, bare)
        FitModule.training_step(bare, next(draws), 0)
        stamps.append(time.perf_counter())
    seconds = time.perf_counter() - start
    return {"seconds": seconds, "blocks": stamps, "weights": _weights(module.field), "iterations": module.iterations}


def _later(one: dict[str, Any]) -> float:
    """Return the time of all blocks but the first."""
    return one["blocks"][-1] - one["blocks"][0]


def _weights(field: torch.nn.Module) -> torch.Tensor:
    return torch.cat([p.detach().flatten() for p in field.parameters()])


def _profile(trainer: L.Trainer, module: FitModule, data: ObservationsDataModule) -> dict[str, Any]:
    """Return the time that all functions of Lightning spend of their own in one fit, and those that spend most."""
    with cProfile.Profile() as profile:
        _train(trainer, module, data)
    entries = [
        {"function": f"{Path(file).stem}.{name}", "calls": calls, "own": own}
        for (file, _, name), (_, calls, own, _, _) in pstats.Stats(profile).stats.items()
        if "lightning" in file
    ]
    largest = sorted(entries, key=lambda entry: -entry["own"])[:_SHOWN]
    return {"own": sum(entry["own"] for entry in entries), "largest": largest}
