"""One fit from observations to a trained field: measure, choose, assemble, train."""

import logging
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import lightning as L
import torch
from lightning.pytorch.callbacks import ModelCheckpoint

from n2n.architectures.base import SDF
from n2n.compose import config_hash
from n2n.config import AUTO
from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import ConfigError
from n2n.fitting.assemble import build_field, build_objective, build_optimizer
from n2n.fitting.callbacks import ProgressReport, Report
from n2n.fitting.checkpoint import AtomicCheckpointIO, read_state
from n2n.fitting.held_out import HeldOut
from n2n.fitting.module import FitModule
from n2n.fitting.objective import Objective
from n2n.fitting.pilot import is_worth_a_pilot, pilot_of, steps_of, told
from n2n.fitting.prepare import Shape, fill_config, prepare
from n2n.fitting.redistance import redistance
from n2n.fitting.revision import Revision
from n2n.formats.atomic import make_folder
from n2n.geometry.frame import Frame

LAST_CHECKPOINT = "last.ckpt"
_REDISTANCE_STEPS = 100
_LOGGED = 1000  # rows of the log, at most twice as many
_NOT_THE_FIT = ("device", "logger", "evaluate", "media")  # an interrupted fit goes on whatever they say


@dataclass
class FitResult:
    """A trained field with everything needed to use it again.

    Attributes:
        field: In evaluation mode, on the device it was trained on.
        frames: World <-> unit map of each shape.
        config: The configuration with every `auto` filled in.
        report: Measured scales, iterations, seconds, final loss.
        held_out: Per shape the points that were kept out of the fit.
    """

    field: SDF
    frames: list[Frame]
    config: dict[str, Any]
    report: dict[str, Any]
    held_out: list[HeldOut]


def fit(
    data: ObservationsDataModule,
    config: dict[str, Any],
    run_dir: Path | None = None,
    report: Report | None = None,
    logger: Any = False,
    callbacks: Sequence[L.Callback] = (),
    watched: Mapping[str, Any] | None = None,
) -> FitResult:
    """Fit one field to the observations.

    Args:
        data: Observations of one or several shapes.
        config: Nested plain dict as composed from conf/; `auto` values are chosen here from the data.
        run_dir: Where checkpoints go; an unfinished fit found there is resumed. None keeps nothing.
        report: Told about progress.
        logger: A Lightning logger, or False.
        callbacks: Further Lightning callbacks.
        watched: Name -> what is measured of each step's `FieldState` and logged beside the losses.

    Raises:
        ConfigError: The configuration cannot be used, or `run_dir` holds another fit.
        InputError: The checkpoint in `run_dir` is damaged.
        OutputError: A checkpoint cannot be written.
    """
    start = time.perf_counter()
    seed = config["seed"]
    torch.manual_seed(seed)
    device = pick_device(config["device"])
    identity = config_hash({**{k: v for k, v in config.items() if k not in _NOT_THE_FIT}, "data": data.fingerprint()})
    data, unseen = data.hold_out(config["validation"], seed)
    shapes = prepare(data, config)
    held_out = [HeldOut.of(*each) for each in zip(unseen, data.frames, shapes, strict=True)]
    resume = _resume_from(run_dir)
    begun = _begun(resume, identity) if resume else None
    first = begun["global_step"] if begun else 0
    if run_dir:
        make_folder(run_dir)
    # What a pilot said is kept: a resumed fit must have the same cells on any device.
    noise = begun["pilots"] if begun else [_pilot(data, shape, config, device) for shape in shapes]
    shapes = [shape if n is None else told(shape, n, seed) for shape, n in zip(shapes, noise, strict=True)]
    revision, module = _assemble(shapes, config, device, watched)
    module.kept = {"identity": identity, "pilots": noise}
    objective, config = module.objective, revision.config
    iterations, plan_reuse = config["iterations"], config["plan_reuse"]
    prepared = time.perf_counter()

    data.configure_draws(config["pairs"], config["batch_size"], seed, first, plan_reuse)
    callbacks = [revision, *callbacks, *([ProgressReport(report)] if report else [])]
    if run_dir:
        every = max(1, config["checkpoint_every"] // plan_reuse)
        callbacks.append(
            ModelCheckpoint(
                run_dir, filename="last", every_n_train_steps=every * plan_reuse, enable_version_counter=False
            )
        )
    with quiet_lightning():
        trainer = _trainer(
            iterations,
            device,
            logger=logger,
            callbacks=callbacks,
            plugins=[AtomicCheckpointIO()],
            enable_checkpointing=bool(run_dir),
            log_every_n_steps=max(1, iterations // plan_reuse // _LOGGED),
        )
        if first < iterations:
            _train(trainer, module, data, resume)
        else:
            module.load_state_dict(begun["state_dict"])
            if found := begun["callbacks"].get(revision.state_key):
                revision.load_state_dict(found)
    shapes, config = revision.shapes, revision.config
    losses = {"loss", "distance", *objective.terms} - set(watched or ())
    field = module.result.eval().to(device)
    if config["redistance"]:
        boxes = [(shape.chosen.lower, shape.chosen.upper) for shape in shapes]
        voxel = config["architecture"].get("voxel") or min(shape.chosen.voxel for shape in shapes)
        rate = build_optimizer(config)[0]([torch.nn.Parameter(torch.zeros(1))]).defaults["lr"]
        redistance(field, boxes, voxel, rate, min(iterations, _REDISTANCE_STEPS), seed)
    return FitResult(
        field=field,
        frames=data.frames,
        config=config,
        report={
            "iterations": iterations,
            "resumed_at": first,
            "device": str(device),
            "points": [sum(len(c) for c in clouds) for clouds in data.shapes],
            "observations": [len(clouds) for clouds in data.shapes],
            "left_out": data.left_out,
            "outliers": data.outliers,
            "noise": [min(s.scales.noise, s.chosen.noise) * f.scale for s, f in zip(shapes, data.frames, strict=True)],
            "spacing": [s.scales.spacing * f.scale for s, f in zip(shapes, data.frames, strict=True)],
            "held_out": [len(points) for points in unseen],
            "losses": {name: float(value) for name, value in trainer.callback_metrics.items() if name in losses},
            "seconds_prepare": round(prepared - start, 2),
            "seconds_fit": round(time.perf_counter() - prepared, 2),
        },
        held_out=held_out,
    )


def _assemble(
    shapes: list[Shape],
    config: dict[str, Any],
    device: torch.device,
    watched: Mapping[str, Any] | None = None,
) -> tuple[Revision, FitModule]:
    """Build what is trained, and the callback that holds its filled configuration."""
    guides = [shape.guide(device, config["seed"]) for shape in shapes]

    def build(config: dict[str, Any]) -> Objective:
        objective = build_objective(config, guides)
        # A term of weight 0 sees what the others see and leaves the sum as it is, to the last bit.
        objective.terms = {**{name: (0.0, measure) for name, measure in (watched or {}).items()}, **objective.terms}
        return objective

    revision = Revision(shapes, partial(fill_config, config, device=device), build)
    filled = revision.config
    field = build_field(filled, len(shapes))
    for condition, shape in enumerate(shapes):
        shape.start(field, condition)
    steps = filled["iterations"], filled["plan_reuse"], filled["seed"], filled["average_from"]
    return revision, FitModule(field, build(filled), *build_optimizer(filled), *steps)


def _pilot(data: ObservationsDataModule, shape: Shape, config: dict[str, Any], device: torch.device) -> float | None:
    """Return the noise that a short fit to a sample of a shape's observations finds; None if that is not worth it."""
    if not is_worth_a_pilot(shape, config):
        return None
    pilot, config = pilot_of(shape, config)
    revision, module = _assemble([pilot], config, device)
    if not revision.asks:
        return None
    data = data.only([pilot.observations])
    data.configure_draws(config["pairs"], revision.config["batch_size"], config["seed"], 0, module.plan_reuse)
    with quiet_lightning():
        trainer = _trainer(
            steps_of(revision.config), device, callbacks=[revision], logger=False, enable_checkpointing=False
        )
        _train(trainer, module, data, None)
    revision.on_train_batch_start(trainer, module)
    return revision.shapes[0].chosen.noise


def _trainer(steps: int, device: torch.device, **settings: Any) -> L.Trainer:
    return L.Trainer(
        max_steps=steps,
        accelerator="gpu" if device.type == "cuda" else device.type,
        devices=1,
        enable_progress_bar=False,
        enable_model_summary=False,
        inference_mode=False,
        num_sanity_val_steps=0,
        **settings,
    )


def pick_device(name: str) -> torch.device:
    """Turn auto | cpu | cuda | mps into a device that exists."""
    if name == AUTO:
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device 'cuda' asked for, but torch sees no CUDA device; use device=cpu, or see `n2n doctor`")
    if name == "mps" and not torch.backends.mps.is_available():
        raise ConfigError("device 'mps' asked for, but torch sees no Apple GPU; use device=cpu")
    return torch.device(name)


@contextmanager
def quiet_lightning() -> Iterator[None]:
    """Hide Lightning's remarks that a user of n2n cannot act on."""
    loggers = [logging.getLogger(name) for name in ("lightning.pytorch", "lightning.fabric", "pytorch_lightning")]
    levels = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="lightning.*")
        warnings.filterwarnings("ignore", module="torch.utils.data.*")
        warnings.filterwarnings("ignore", message=".*treespec.*|.*LeafSpec.*")
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)


def _train(trainer: L.Trainer, module: FitModule, data: ObservationsDataModule, resume: Path | None) -> None:
    try:
        trainer.fit(module, data, ckpt_path=resume, weights_only=True if resume else None)
    except SystemExit as stop:
        # Lightning turns Ctrl-C into an exit, which would end a notebook.
        if isinstance(stop.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from stop
        raise


def _resume_from(run_dir: Path | None) -> Path | None:
    checkpoint = run_dir / LAST_CHECKPOINT if run_dir else None
    return checkpoint if checkpoint and checkpoint.exists() else None


def _begun(checkpoint: Path, identity: str) -> dict[str, Any]:
    """Read where an interrupted fit stands."""
    state = read_state(checkpoint)
    if state.get("identity") != identity or "pilots" not in state:
        raise ConfigError(
            f"{checkpoint.parent} holds a fit of other points or with other settings; "
            "choose another folder, or delete this one"
        )
    return state
