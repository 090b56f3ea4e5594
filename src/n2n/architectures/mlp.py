"""The paper's network: fully connected layers with a bounded output (App. A)."""

import math
from itertools import pairwise

import torch
from torch import nn

from n2n.architectures.base import SDF, ConditionCode
from n2n.shapes import Index, Points, Values


class MLP(SDF):
    """OccNet-like decoder with fully connected layers instead of residual blocks.

    Args:
        layers: Number of hidden layers, >= 1.
        width: Units per hidden layer.
        output: `tanh` (App. A: signed distances in [-1, 1]) or `linear` (the released script).
        geometric_init: Start from an approximate sphere of this radius, so that inside is negative from the first
            step; None keeps PyTorch's initialisation.
        num_conditions: Shapes held by one network.

    Source: Ma et al. 2023, App. A. Differs: the geometric initialisation (Atzmon and Lipman 2020) is added, because the
        sign of f is otherwise left to chance.
    """

    def __init__(
        self,
        layers: int = 8,
        width: int = 512,
        output: str = "tanh",
        geometric_init: float | None = 0.5,
        num_conditions: int = 1,
    ) -> None:
        super().__init__()
        if output not in ("tanh", "linear"):
            raise ValueError(f"output must be 'tanh' or 'linear', got {output!r}")
        self.code = ConditionCode(num_conditions)
        sizes = [3 + self.code.width] + [width] * layers
        self.hidden = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes))
        self.head = nn.Linear(width, 1)
        self.output = output
        if geometric_init is not None:
            self._start_from_sphere(geometric_init)

    def _start_from_sphere(self, radius: float) -> None:
        for index, layer in enumerate(self.hidden):
            nn.init.normal_(layer.weight, 0.0, math.sqrt(2 / layer.out_features))
            nn.init.zeros_(layer.bias)
            if index == 0 and self.code.width:
                nn.init.normal_(layer.weight[:, 3:], 0.0, 1e-3)
        nn.init.normal_(self.head.weight, math.sqrt(math.pi / self.head.in_features), 1e-5)
        nn.init.constant_(self.head.bias, -radius)

    def forward(self, points: Points, condition: Index | None = None) -> Values:
        x = self.code.append(points, condition)
        for layer in self.hidden:
            x = torch.relu(layer(x))
        x = self.head(x).squeeze(-1)
        return torch.tanh(x) if self.output == "tanh" else x
