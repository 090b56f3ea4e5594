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
_ANOTHER = 0.9  # of the noise that patches saw; a scaffold takes seconds, and does not mind less than that


def is_worth_a_pilot(shapes: list[Shape], config: dict[str, Any]) -> bool:
    """Say whether a pilot may find noise that patches do not see, in a small part of the time of the fit."""
    many = any(shape.chosen.observations > 1 and is_dense(shape) for shape in shapes)
    return many and config["architecture"].get("name") == "grid"


def pilot_of(shapes: list[Shape], config: dict[str, Any]) -> tuple[list[Shape], dict[str, Any]]:
    """Return shapes with their sample as the only observation, and how to fit them."""
    few = []
    for shape in shapes:
        scales = replace(shape.scales, spacing=math.sqrt(shape.scales.area / len(shape.sample)))
        points = torch.as_tensor(shape.sample, dtype=torch.float32)
        few.append(replace(shape, observations=[points], scales=scales, chosen=choose(scales, [shape.sample])))
    return few, {**config, "iterations": AUTO, "plan_reuse": AUTO, "effort": _EFFORT * config["effort"]}


def steps_of(config: dict[str, Any]) -> int:
    """Return after how many steps of the pilot, whose configuration is filled, the field has been asked."""
    blocks = math.ceil(ASKED_BY * config["iterations"] / config["plan_reuse"])
    return blocks * config["plan_reuse"] + 1


def told(shapes: list[Shape], pilots: list[Shape], seed: int) -> list[Shape]:
    """Return the shapes with the noise that their pilots ended with, and scaffolds for it where it is another."""
    result = []
    for shape, pilot in zip(shapes, pilots, strict=True):
        scales = replace(shape.scales, noise=min(shape.scales.noise, pilot.chosen.noise))
        scaffold = shape.scaffold
        if scaffold is not None and scales.noise < _ANOTHER * shape.scales.noise:
            scaffold = Scaffold.build(shape.sample, scales, seed)
        chosen = choose(scales, [cloud.double().numpy() for cloud in shape.observations])
        result.append(replace(shape, scales=scales, chosen=chosen, scaffold=scaffold))
    return result
