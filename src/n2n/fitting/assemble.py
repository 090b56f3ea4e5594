"""Names become objects here and nowhere else: a filled configuration in, the parts of a fit out."""

from collections.abc import Callable
from typing import Any

import torch
from hydra.utils import instantiate

from n2n.architectures.base import SDF
from n2n.errors import ConfigError
from n2n.fitting.objective import Objective
from n2n.geometry.sampling import QuerySampler
from n2n.losses.state import Guide
from n2n.registry import ARCHITECTURES, DISTANCES, PAIRINGS, REGULARISERS


def build_field(config: dict[str, Any], num_conditions: int) -> SDF:
    """Build the architecture for `num_conditions` shapes."""
    return _checked(ARCHITECTURES.build, config["architecture"], num_conditions=num_conditions)


def build_objective(config: dict[str, Any], guides: list[Guide | None]) -> Objective:
    """Build Eq. 7: distance, pairing, queries, lambda R and the further terms."""
    terms = {"regulariser": (config["regulariser_weight"] or 0.0, _checked(REGULARISERS.build, config["regulariser"]))}
    for key, spec in config["terms"].items():
        if spec is None:
            continue
        arguments = {name: value for name, value in spec.items() if name != "weight"}
        terms[key] = (spec.get("weight", 1.0), _checked(REGULARISERS.build, {"name": key, **arguments}))
    return Objective(
        distance=_checked(DISTANCES.build, config["distance"]),
        pairing=_checked(PAIRINGS.build, config["pairing"], batch_size=config["batch_size"]),
        queries=QuerySampler(**config["queries"]),
        terms=terms,
        guides=guides,
        target_noise=config["target_noise"],
    )


def build_optimizer(config: dict[str, Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the optimiser and scheduler as functions of what they act on."""
    try:
        optimizer, scheduler = (instantiate({**config[key], "_partial_": True}) for key in ("optimizer", "scheduler"))
        # Tried out now: a wrong value must not end in the middle of a fit.
        scheduler(optimizer([torch.nn.Parameter(torch.zeros(1))]), config["iterations"])
        return optimizer, scheduler
    except Exception as error:
        raise ConfigError(f"optimizer or scheduler cannot be built: {error}") from error


def _checked(build: Callable[..., Any], spec: Any, **extra: Any) -> Any:
    """Turn a component's own complaint about an argument's value into an error the user can act on."""
    try:
        return build(spec, **extra)
    except (ValueError, TypeError) as error:
        name = spec if isinstance(spec, str) else spec.get("name")
        raise ConfigError(f"{name}: {error}") from error
