"""What a profile has to measure: every fit once, however many tables want it."""

import functools
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from n2n.errors import ConfigError, N2NError
from n2n.registry import DATAMODULES
from n2n.tables.expand import as_number, expand
from n2n.tables.methods import not_installed
from n2n.tables.spec import Fit, Profile, Table, Wanted, choose, load_tables, own_tables
from n2n.tables.store import Store, lacking, protocol_hash, sources


@dataclass
class Job:
    """A fit with everything that any table wants to know about it.

    Attributes:
        fit: What to run.
        evaluations: `task/protocol` and the floors wanted with it; an empty text where only the cost counts.
        tables: Who wants it.
    """

    fit: Fit
    evaluations: dict[str, set[str]] = field(default_factory=dict)
    tables: set[str] = field(default_factory=set)

    @property
    def is_timed(self) -> bool:
        """Tell whether what the fit costs is a result."""
        return "" in self.evaluations


@dataclass
class Plan:
    """The cells of the tables asked for, and the fits behind them.

    Attributes:
        profile: With which effort.
        tables: Asked for.
        wanted: Per table name its cells.
        jobs: By fit, in the order of the tables.
    """

    profile: Profile
    tables: list[Table]
    wanted: dict[str, list[Wanted]]
    jobs: dict[Fit, Job]

    def open(self, store: Store) -> list[Job]:
        """Return the jobs that are not done: a fit is not kept, so what lacks one evaluation is measured whole."""
        return [job for job in self.jobs.values() if self.is_open(job, store)]

    def is_open(self, job: Job, store: Store) -> bool:
        """Tell whether a job is to be done; what needs a package that is not installed is not."""
        return not self.is_done(job, store) and not not_installed(job.fit.method)

    def is_done(self, job: Job, store: Store) -> bool:
        """Tell whether the store holds all of a job by the present definitions."""
        record = store.read(job.fit)
        return (
            record is not None and record["status"] == "done" and not lacking(record, job.evaluations, self.protocols)
        )

    def stale(self, store: Store) -> list[Job]:
        """Return the jobs that are done, but by other sources than these."""
        now = sources()
        return [j for j in self.jobs.values() if self.is_done(j, store) and store.read(j.fit)["made"]["sources"] != now]

    @functools.cached_property
    def protocols(self) -> dict[str, str]:
        """Content hash of the protocol of every evaluation."""
        evaluations = {e for job in self.jobs.values() for e in job.evaluations if e}
        return {evaluation: protocol_hash(evaluation.split("/")[1]) for evaluation in evaluations}


def make_plan(names: Sequence[str], profile: Profile, root: str | None = None, folder: Path | None = None) -> Plan:
    """Return what the tables asked for need.

    A fit is wanted once with the evaluations of *all* tables: to ask for another table later fits nothing again.

    Args:
        names: Of tables; empty: all, or those of the folder where one is given.
        profile: With which effort.
        root: Data folder; None: environment N2N_DATA, else ./data.
        folder: With further tables.

    Raises:
        ConfigError: A name is unknown, or a table asks for something that does not exist.
    """
    everything = load_tables(folder=folder)
    chosen = choose(everything, names or list(own_tables(folder)))
    present = functools.cache(functools.partial(shapes_present, root=root))
    cells = {table.name: expand(table, profile, present) for table in everything}
    jobs: dict[Fit, Job] = {}
    for name, wanted in cells.items():
        for cell in wanted:
            for fit in cell.fits:
                job = jobs.setdefault(fit, Job(fit))
                job.evaluations.setdefault(cell.evaluation, set()).update({cell.floor} - {""})
                job.tables.add(name)
    asked = {table.name: cells[table.name] for table in chosen}
    ordered = {fit: jobs[fit] for wanted in asked.values() for cell in wanted for fit in cell.fits}
    plan = Plan(profile, chosen, asked, ordered)
    plan.protocols  # noqa: B018 - an unknown protocol is found now, not after the fit
    return plan


def shapes_present(datamodule: str, variant: str | None, root: str | None = None) -> tuple[list[str], str | None]:
    """Return the shapes of a dataset, or of a variant of it, at hand, and what is missing and where to get it."""
    component: Any = DATAMODULES.get(datamodule)
    if not hasattr(component, "names"):
        raise ConfigError(f"datamodule {datamodule!r} knows no true surface; tables need a BenchmarkDataModule")
    try:
        chosen = {"variant": variant} if variant else {}
        return component.names(root, **chosen), component.missing(root, **chosen)
    except N2NError as error:
        return [], str(error)


def estimate(job: Job, gpu: bool = False) -> float:
    """Return the seconds a job takes, from the measured costs in `_COSTS`."""
    settings = dict(text.split("=", 1) for text in job.fit.settings)
    if job.fit.method != "n2n":
        return 10.0
    costs = _COSTS["gpu" if gpu else "cpu"]
    points = as_number(settings.get("datamodule.points", ""), 10_000)
    observations = as_number(settings.get("num_observations", ""), 1)
    tasks = 1.0 * len(job.evaluations)
    if settings.get("recipe", "fast") == "paper":
        return as_number(settings.get("iterations", ""), 800_000) * costs["paper_step"] * _load(settings) + tasks
    total = points * observations
    return costs["start"] + costs["per_point"] * min(total, 50_000) + costs["per_input"] * total + tasks


def _load(settings: dict[str, str]) -> float:
    """Return how much dearer a step of the paper's recipe is than one with B = 250: the matching is cubic in B."""
    usual = 5000 if settings.get("task") == "reconstruct" else 250
    batch = as_number(settings.get("batch_size", ""), usual) / 250
    return max(1.0, 0.5 * batch + 0.002 * batch**2.5)


# Seconds. On 2 cores without a GPU: fits of `n2n tables run` (10K: 8 s, 50K: 16 s, 200 x 10K: 36 s). On one H100,
# 16 cores: `make bench BENCH=gpu`; its steps of the paper's recipe with 15 fits at a time (docs/experiments.md).
_COSTS: dict[str, dict[str, float]] = {
    "cpu": {"start": 6.0, "per_point": 2e-4, "per_input": 1e-5, "paper_step": 0.2},
    "gpu": {"start": 3.5, "per_point": 3e-5, "per_input": 1e-5, "paper_step": 0.02},
}


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
