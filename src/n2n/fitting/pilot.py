"""The pilot: a short fit to a sample of many observations that is thrown away but for the noise it found.

Patches see too much noise where parts are thin. The field of one observation finds out on the way (`revision.py`). That
of many has cells so fine that it must know from the start: too rough, it folds; too smooth, it loses the thin parts.
"""

import math
from dataclasses import replace
from typing import Any

import torch

from n2n.config import AUTO
from n2n.fitting.auto import choose
from n2n.fitting.prepare import Shape
from n2n.fitting.revision import ASKED_BY, is_dense
from n2n.geometry.scaffold import Scaffold

_EFFORT = 0.4
_ITERATIONS = 100  # a shorter fit than that, if told so, would take less time than its pilot
_ANOTHER = 0.9  # of the noise that patches saw; a scaffold takes seconds, and does not mind less than that


def is_worth_a_pilot(shape: Shape, config: dict[str, Any]) -> bool:
    """Say whether a pilot may find noise that patches do not see, in a small part of the time of the fit."""
    steps = config["iterations"]
    long_enough = steps == AUTO or steps >= _ITERATIONS
    return (
        shape.chosen.observations > 1 and is_dense(shape) and long_enough and config["architecture"]["name"] == "grid"
    )


def pilot_of(shape: Shape, config: dict[str, Any]) -> tuple[Shape, dict[str, Any]]:
    """Return the shape with its sample as the only observation, and how to fit it."""
    scales = replace(shape.scales, spacing=math.sqrt(shape.scales.area / len(shape.sample)))
    points = torch.as_tensor(shape.sample, dtype=torch.float32)
    pilot = replace(shape, observations=[points], scales=scales, chosen=choose(scales, [shape.sample]))
    shorter = {"iterations": AUTO, "plan_reuse": AUTO, "effort": _EFFORT * config["effort"], "average_from": 1.0}
    return pilot, {**config, **shorter}


def steps_of(config: dict[str, Any]) -> int:
    """Return the step of a pilot, whose configuration is filled, at which its field is asked for the last time."""
    return math.ceil(ASKED_BY * config["iterations"] / config["plan_reuse"]) * config["plan_reuse"]


def told(shape: Shape, noise: float, seed: int) -> Shape:
    """Return the shape with another noise than that of its patches, and a scaffold for it where they are far apart."""
    scales, scaffold = replace(shape.scales, noise=noise), shape.scaffold
    if scaffold is not None and noise < _ANOTHER * shape.scales.noise:
        scaffold = Scaffold.build(shape.sample, scales, seed)
    chosen = choose(scales, [cloud.double().numpy() for cloud in shape.observations])
    return replace(shape, scales=scales, chosen=chosen, scaffold=scaffold)
