"""Second thoughts about the noise: the field that is being fitted measures it better than local patches can."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import lightning as L
import torch

from n2n.architectures.base import SDF
from n2n.fitting.objective import Objective
from n2n.fitting.prepare import Shape
from n2n.geometry.residual import residual_noise

_BEGIN = 0.7  # of the measured noise: a field that is too smooth takes thin parts for noise, and goes on doing so
_SPARSE = 3.0  # noise deviations between points; beyond that a field follows single points, and knows no better
_WHEN = (0.25, 0.4)  # of the fit; sooner it has not settled, later it could not follow any more
ASKED_BY = _WHEN[-1]
_ROOM = 2.0  # noise deviations
_PROBES = 16_384


class Revision(L.Callback):
    """Begin with less noise than patches saw, ask the field twice how noisy the points are, and go on with its answer.

    Sparse points are not asked about. Of many observations the fit begins with all of the noise that it is given: their
    cells are so fine that a field which is too rough at first never gets rid of its folds (see `pilot.py`). Nothing is
    asked if no setting depends on it.

    Args:
        shapes: As measured.
        fill: Shapes -> the configuration that suits them.
        build: Configuration -> objective.

    Attributes:
        shapes: With the noise of now.
        config: The configuration of now.
        asks: Whether there is anything to ask.
    """

    def __init__(
        self,
        shapes: list[Shape],
        fill: Callable[[list[Shape]], dict[str, Any]],
        build: Callable[[dict[str, Any]], Objective],
    ) -> None:
        self._measured, self._fill, self._build = shapes, fill, build
        self._resumed = False
        measured = [shape.chosen.noise for shape in shapes]
        self._go_on_with(measured)
        less = [_BEGIN * shape.chosen.noise if is_dense(shape) else shape.chosen.noise for shape in shapes]
        matters = fill(_with_noise(shapes, less)) != self.config
        self.asks = matters and self.config["iterations"] > self.config["plan_reuse"]
        self._asked = 0 if self.asks else len(_WHEN)
        if self.asks:
            is_single = [shape.chosen.observations == 1 for shape in shapes]
            self._go_on_with([a if one else b for a, b, one in zip(less, measured, is_single, strict=True)])

    def on_train_start(self, trainer: Any, pl_module: Any) -> None:
        if self._resumed:
            pl_module.objective = self._build(self.config)

    def on_train_batch_start(self, trainer: Any, pl_module: Any, *unused: Any) -> None:
        progress = pl_module.global_step / pl_module.iterations
        if self._asked < len(_WHEN) and progress >= _WHEN[self._asked]:
            self._asked += 1
            before = self.config
            self._go_on_with([self._ask(pl_module.field, index) for index in range(len(self.shapes))])
            if self.config != before:
                pl_module.objective = self._build(self.config)

    def state_dict(self) -> dict[str, Any]:
        return {"asked": self._asked, "noise": self._noise()}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        self._asked, self._resumed = state_dict["asked"], True
        self._go_on_with(state_dict["noise"])

    def _noise(self) -> list[float]:
        return [shape.chosen.noise for shape in self.shapes]

    def _go_on_with(self, noise: list[float]) -> None:
        self.shapes = _with_noise(self._measured, noise)
        self.config = self._fill(self.shapes)

    @torch.no_grad()
    def _ask(self, field: SDF, condition: int) -> float:
        if not is_dense(self._measured[condition]):
            return self._measured[condition].chosen.noise
        sample, noise = self.shapes[condition].sample, self.shapes[condition].chosen.noise
        device = next(field.parameters()).device
        points = torch.as_tensor(sample[:: math.ceil(len(sample) / _PROBES)], dtype=torch.float32, device=device)
        codes = torch.full((len(points),), condition, dtype=torch.long, device=device)
        with field.shared():
            residual = residual_noise(lambda x: field.value_and_gradient(x, codes), points, _ROOM * noise)
        return self._measured[condition].chosen.revised(residual, noise)


def is_dense(shape: Shape) -> bool:
    """Say whether a field could tell the noise of a shape's points."""
    return shape.chosen.spacing < _SPARSE * shape.chosen.noise


def _with_noise(shapes: list[Shape], noise: list[float]) -> list[Shape]:
    return [
        replace(shape, chosen=replace(shape.chosen, noise=value)) for shape, value in zip(shapes, noise, strict=True)
    ]
