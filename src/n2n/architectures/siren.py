"""A sinusoidal network: smooth derivatives of every order."""

import math
from itertools import pairwise

import torch
from torch import nn

from n2n.architectures.base import SDF, ConditionCode
from n2n.shapes import Index, Points, Values


class Siren(SDF):
    """Fully connected layers with sine activations.

    Args:
        layers: Number of hidden layers, >= 1.
        width: Units per hidden layer.
        frequency: omega_0 of the first layer, radians per unit; larger fits finer detail and noise.
        radius: The field starts as |x| - radius plus a small network output, so that inside is negative.
        num_conditions: Shapes held by one network.

    Source: Sitzmann et al. 2020, Implicit Neural Representations with Periodic Activation Functions, Sec. 3.2.
    """

    def __init__(
        self, layers: int = 4, width: int = 256, frequency: float = 15.0, radius: float = 0.5, num_conditions: int = 1
    ) -> None:
        super().__init__()
        self.code = ConditionCode(num_conditions)
        sizes = [3 + self.code.width] + [width] * layers
        self.hidden = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes))
        self.head = nn.Linear(width, 1)
        self.frequency, self.radius = frequency, radius
        for index, layer in enumerate(self.hidden):
            fan_in = layer.in_features
            bound = 1 / fan_in if index == 0 else math.sqrt(6 / fan_in) / frequency
            nn.init.uniform_(layer.weight, -bound, bound)
        nn.init.uniform_(self.head.weight, -1e-2 / math.sqrt(width), 1e-2 / math.sqrt(width))
        nn.init.zeros_(self.head.bias)

    def forward(self, points: Points, condition: Index | None = None) -> Values:
        x = self.code.append(points, condition)
        for layer in self.hidden:
            x = torch.sin(self.frequency * layer(x))
        sphere = (points.square().sum(-1) + 1e-8).sqrt() - self.radius
        return sphere + self.head(x).squeeze(-1)
