"""A fit in slow motion: what a few queries are matched to, and the field at chosen moments."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import ConfigError
from n2n.fitting.assemble import build_field, build_objective, build_optimizer
from n2n.fitting.callbacks import Report
from n2n.fitting.fit import pick_device
from n2n.fitting.objective import Block
from n2n.fitting.prepare import fill_config, prepare
from n2n.tasks.field import Field

_SINGLE = "emd"  # the one distance whose plan names a target for each query


@dataclass(frozen=True)
class Moment:
    """The state of a fit; world coordinates.

    Attributes:
        iteration: Optimiser steps done.
        field: As it is then.
        pulled: Where the field pulls the queries, (q, 3).
        targets: What they were matched to so far, (matchings, q, 3).
    """

    iteration: int
    field: Field
    pulled: NDArray[np.float64]
    targets: NDArray[np.float64]


def watch(
    points: NDArray[np.float64],
    queries: NDArray[np.float64],
    config: dict[str, Any],
    shares: Sequence[float],
    report: Report | None = None,
) -> list[Moment]:
    """Fit one cloud and look at it in between.

    The steps are those of `n2n.fit`, without the average of weights at its end, and with the noise that patches see. A
    query is matched to what the drawn query nearest to it, after the pull, is matched to.

    Args:
        points: (n, 3) world coordinates.
        queries: (q, 3) world coordinates, to be followed.
        config: As composed.
        shares: When to look, 0 (before the fit) to 1 (after it), rising; in between at the start of a matching.
        report: Told about progress.

    Raises:
        ConfigError: The distance is no one-to-one matching.
    """
    if config["distance"]["name"] != _SINGLE:
        raise ConfigError(
            f"distance={config['distance']['name']} matches no single target to a query; "
            "draw this figure with distance=emd or emd_squared"
        )
    seed, device = config["seed"], pick_device(config["device"])
    torch.manual_seed(seed)
    data = ObservationsDataModule([[points]])
    shapes = prepare(data, config)
    config = fill_config(config, shapes, device)
    sdf = build_field(config, 1)
    shapes[0].start(sdf, 0)
    sdf = sdf.to(device)
    objective = build_objective(config, [shapes[0].guide(device, seed)])
    make_optimizer, make_scheduler = build_optimizer(config)
    iterations, reuse = config["iterations"], config["plan_reuse"]
    optimizer = make_optimizer(sdf.parameters())
    scheduler = make_scheduler(optimizer, iterations)
    starts = range(0, iterations, reuse)
    wanted = [iterations if share >= 1 else round(share * (len(starts) - 1)) * reuse for share in shares]
    data.configure_draws(config["pairs"], config["batch_size"], seed, 0, reuse)
    frame = data.frames[0]
    moments, targets = {}, np.empty((0, *queries.shape))

    def look(iteration: int) -> None:
        field = Field(copy.deepcopy(sdf).eval(), data.frames, config)
        moments[iteration] = Moment(iteration, field, field.denoise(queries), targets)

    for start, draw in zip(starts, data.train_dataloader(), strict=False):
        if start in wanted:
            look(start)
        generator = torch.Generator().manual_seed(seed * 1_000_003 + start)
        block = objective.begin(sdf, data.transfer_batch_to_device(draw, device, 0), generator, start / iterations)
        pulled = frame.to_unit(Field(sdf, data.frames, config).denoise(queries))
        targets = np.concatenate([targets, frame.to_world(_matched(block, pulled))[None]])
        end = min(start + reuse, iterations)
        for iteration in range(start, end):
            optimizer.zero_grad()
            with sdf.shared():
                loss, _ = objective.loss(sdf, block, iteration / iterations, generator)
                loss.backward()
            optimizer.step()
            scheduler.step()
        if report:
            report(end, iterations, {})
    look(iterations)
    return [moments[iteration] for iteration in wanted]


def _matched(block: Block, pulled: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the targets (q, 3) of the drawn queries nearest to `pulled` (q, 3); unit coordinates."""
    drawn = block.queries.reshape(-1, 3).double().cpu()
    partner = block.targets.gather(1, block.plan[..., None].expand(-1, -1, 3)).reshape(-1, 3)
    nearest = torch.cdist(torch.as_tensor(pulled), drawn).argmin(dim=1)
    return partner.double().cpu().numpy()[nearest.numpy()]
