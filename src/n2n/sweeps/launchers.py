"""Hydra's launchers: what they need besides n2n, and other work than fits handed to them."""

import os
import shutil
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from n2n.compose import conf_dir, hydra_arguments, register_schema, sweep_dir
from n2n.errors import ConfigError, N2NError
from n2n.messages import explain

# Module of a class named by hydra.launcher._target_ or hydra.sweeper._target_: library behind it, and our extra.
_EXTRAS = {
    "hydra_plugins.hydra_submitit_launcher": ("submitit", "slurm"),
    "hydra_plugins.hydra_ray_launcher": ("ray", "ray"),
    "hydra_plugins.n2n_optuna": ("optuna", "optuna"),
}
_SLURM = "SlurmLauncher"


def check_installed(hydra: Any) -> None:
    """Check that launcher and sweeper can do their work here.

    Args:
        hydra: The part `hydra` of a composed configuration.

    Raises:
        ConfigError: A package is missing, or this is no machine of a Slurm cluster.
    """
    for kind in ("launcher", "sweeper"):
        target = str(hydra[kind]._target_)
        module, extra = next((found for name, found in _EXTRAS.items() if target.startswith(name)), ("", ""))
        plugin = target.rpartition(".")[0]
        if module and not (find_spec(module) and find_spec(plugin.rpartition(".")[0]) and find_spec(plugin)):
            raise ConfigError(f"this {kind} needs packages that are not installed; pip install 'n2n[{extra}]'")
        if target.endswith(_SLURM) and not (shutil.which("sbatch") and shutil.which("srun")):
            raise ConfigError(
                "there is no Slurm here (sbatch and srun are not on the PATH); start this on a login node of the "
                "cluster, or leave the launcher out to use this machine"
            )
    # Ray tells its makers how it is used, unless told not to.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")


def start(launcher: str, settings: Sequence[str], folder: Path, count: int, work: Callable[[], Any]) -> None:
    """Do the same work in several jobs of a launcher; return once all have ended.

    Args:
        launcher: An option of conf/hydra/launcher, e.g. slurm_gpu.
        settings: Of the launcher, e.g. hydra.launcher.partition=gpu.
        folder: For the launcher's logs; absolute, and the same on all machines.
        count: Jobs.
        work: Called in each of them, maybe on another machine.

    Raises:
        ConfigError: The launcher is not there, cannot use its settings, or a job was lost.
    """
    from hydra import compose, initialize_config_dir
    from hydra._internal.callbacks import Callbacks
    from hydra.core.global_hydra import GlobalHydra
    from hydra.core.plugins import Plugins
    from hydra.types import HydraContext

    register_schema()
    overrides = hydra_arguments([f"hydra/launcher={launcher}", *settings, sweep_dir(folder)])
    try:
        with initialize_config_dir(str(conf_dir()), version_base="1.3", job_name="n2n"):
            config = compose("config", overrides=overrides, return_hydra_config=True)
            check_installed(config.hydra)
            context = HydraContext(config_loader=GlobalHydra.instance().config_loader(), callbacks=Callbacks(config))
            started = Plugins.instance().instantiate_launcher(
                hydra_context=context, task_function=_Task(work), config=config
            )
            results = started.launch([[] for _ in range(count)], initial_job_idx=0)
            for result in results:
                result.return_value  # noqa: B018 - raises what the job raised
    except N2NError:
        raise
    except Exception as error:
        raise ConfigError(f"hydra/launcher={launcher}: {explain(error)}") from error


def told_threads() -> int | None:
    """Return how many threads the user wants per process; None where nothing is said.

    OMP_NUM_THREADS may hold a number per level of nesting (`2,1`): the first is meant.

    Raises:
        ConfigError: It is no number.
    """
    told = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    if told and not told.isdecimal():
        raise ConfigError(f"OMP_NUM_THREADS={told} is not a number; give one, or unset it")
    return int(told or 0) or None


class _Task:
    """What a launcher calls: with a composed configuration, which this work does not ask for."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self._work = work

    def __call__(self, composed: Any) -> None:
        self._work()
