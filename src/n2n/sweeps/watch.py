"""How a sweep goes on, from the folders of its runs: the same whatever computes them, and wherever."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

from n2n.sweeps.store import RunInfo, Sweep


@dataclass
class Watch:
    """Those runs of a sweep that have ended since it was made.

    Attributes:
        sweep: What is watched.
        wanted: Hashes of runs that are to end, told in this order; None for all that appear.
        ended: Those that have.
        states: How many runs are in which state, as of the last look.
    """

    sweep: Sweep
    wanted: Collection[str] | None
    ended: dict[str, RunInfo] = field(default_factory=dict)
    states: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._attempts = {run.hash: run.attempt for run in self.sweep.runs}
        self._finished = {run.hash for run in self.sweep.runs if run.state == "done"}

    def look(self) -> list[RunInfo]:
        """Return the runs that have ended since the last look."""
        news, self.states = [], Counter[str]()
        for run in self._open():
            self.states[run.state] += 1
            if self._has_ended(run):
                self.ended[run.hash] = run
                news.append(run)
        return news

    def count(self, state: str) -> int:
        """Return how many of the ended runs are done, or failed."""
        return sum(run.state == state for run in self.ended.values())

    def _open(self) -> list[RunInfo]:
        if self.wanted is None:
            return [run for run in self.sweep.runs if run.hash not in self.ended]
        open_ = [name for name in self.wanted if name not in self.ended]
        return [RunInfo.read(self.sweep.run_dir(name), self.sweep.planned.get(name)) for name in open_]

    def _has_ended(self, run: RunInfo) -> bool:
        is_new = run.attempt > self._attempts.get(run.hash, 0)
        return (run.state == "failed" and is_new) or (
            run.state == "done" and (is_new or run.hash not in self._finished)
        )
