"""The weights a fit returns: the last ones, or the mean of those it went through."""

import math
from itertools import chain

import lightning as L
import pytest
import torch
from torch.utils.data import DataLoader

import n2n.fitting.schedule as schedule
from n2n.datamodules.observations import Draw
from n2n.errors import ConfigError
from n2n.fitting.fit import quiet_lightning
from n2n.fitting.module import FitModule
from n2n.fitting.objective import Block, Objective
from n2n.testing import Ball

ITERATIONS = 10


class Drift(Objective):
    """An objective without matching: draws the radius away, and counts how often it is asked to begin."""

    def __init__(self):
        self.progress = []

    def begin(self, field, draw, generator, progress=0.0):
        self.progress.append(progress)
        return Block(draw, draw.source, draw.target, None, None, None)

    def loss(self, field, block, progress, generator):
        loss = field.radius.square() + (field.centre - torch.tensor([1.0, 2, 3])).square().sum()
        return loss, {"distance": loss.detach()}


class Recorder(torch.optim.SGD):
    """Keeps the parameters after each of its steps."""

    def __init__(self, parameters, record):
        super().__init__(parameters, lr=0.1)
        self.record = record

    def step(self, closure=None):
        loss = super().step(closure)
        self.record.append([p.detach().clone() for p in self.param_groups[0]["params"]])
        return loss


def _run(average_from, plan_reuse=4, iterations=ITERATIONS):
    """Fit a ball; return the module, the parameters after every step and the objective."""
    record, objective = [], Drift()
    module = FitModule(
        Ball(0.5),
        objective,
        lambda parameters: Recorder(parameters, record),
        schedule.constant,
        iterations,
        plan_reuse,
        average_from=average_from,
    )
    draws = DataLoader([Draw(torch.zeros(1, 3), torch.zeros(1, 3), True, None, 0)] * iterations, batch_size=None)
    with quiet_lightning():
        L.Trainer(
            max_steps=iterations,
            accelerator="cpu",
            logger=False,
            enable_checkpointing=False,
            enable_progress_bar=False,
            enable_model_summary=False,
        ).fit(module, draws)
    assert len(record) == iterations
    return module, record, objective


def _parameters(field):
    return [p.detach() for p in field.parameters()]


def _mean(record):
    return [torch.stack(parts).mean(0) for parts in zip(*record, strict=True)]


def _close(parts, others):
    return all(torch.allclose(a, b, atol=1e-6) for a, b in zip(parts, others, strict=True))


@pytest.mark.parametrize("plan_reuse", [1, 4, 20])
@pytest.mark.parametrize(("average_from", "skipped"), [(0.0, 0), (0.5, 5), (0.55, 6), (0.9, 9)])
def test_the_result_is_the_mean_after_each_step_from_the_share_on(average_from, skipped, plan_reuse):
    module, record, _ = _run(average_from, plan_reuse)
    result = _parameters(module.result)
    assert _close(result, _mean(record[skipped:]))
    # One step more or less would show.
    assert skipped == 0 or not _close(result, _mean(record[skipped - 1 :]))
    assert skipped == 9 or not _close(result, _mean(record[skipped + 1 :]))


def test_weights_that_are_not_finite_after_the_last_step_are_an_error(monkeypatch):
    step = Recorder.step

    def broken(self, closure=None):
        loss = step(self, closure)
        if len(self.record) == ITERATIONS:
            with torch.no_grad():
                self.param_groups[0]["params"][0].fill_(math.inf)
        return loss

    monkeypatch.setattr(Recorder, "step", broken)
    with pytest.raises(ConfigError, match="diverged"):
        _run(1.0)


def test_averaging_leaves_the_fit_itself_alone():
    module, record, _ = _run(0.5)
    assert all(torch.equal(a, b) for a, b in zip(_parameters(module.field), record[-1], strict=True))
    _, plain, _ = _run(1.0)
    assert all(map(torch.equal, chain(*record), chain(*plain)))
    assert module.result is not module.field


def test_without_averaging_there_is_one_field_only():
    module, record, _ = _run(1.0)
    assert module.result is module.field
    assert all(name.startswith("field.") for name in module.state_dict())
    assert all(torch.equal(a, b) for a, b in zip(_parameters(module.result), record[-1], strict=True))


@pytest.mark.parametrize(("iterations", "average_from"), [(1, 0.6), (2, 0.6), (10, 0.99)])
def test_a_fit_too_short_to_reach_the_share_returns_its_last_weights(iterations, average_from):
    module, record, _ = _run(average_from, iterations=iterations)
    assert all(torch.equal(a, b) for a, b in zip(_parameters(module.result), record[-1], strict=True))


def test_every_block_begins_with_its_share_of_the_fit():
    assert _run(1.0)[2].progress == pytest.approx([0.0, 0.4, 0.8])
