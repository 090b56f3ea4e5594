"""The learning-rate schedule of a fit, counted in iterations."""

import math

import torch


def cosine(optimizer: torch.optim.Optimizer, iterations: int, final: float = 0.02) -> torch.optim.lr_scheduler.LambdaLR:
    """Decay the learning rate along a half cosine to `final` times its start over the whole fit.

    Args:
        optimizer: Its learning rates are scaled.
        iterations: Length of the fit, >= 1.
        final: Factor reached at the end, 0 to 1.
    """

    def factor(step: int) -> float:
        return final + (1 - final) * 0.5 * (1 + math.cos(math.pi * min(step / iterations, 1.0)))

    return torch.optim.lr_scheduler.LambdaLR(optimizer, factor)


def constant(optimizer: torch.optim.Optimizer, iterations: int) -> torch.optim.lr_scheduler.LambdaLR:
    """Keep the learning rate (the paper's choice); `iterations` is not used."""
    return torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: 1.0)
