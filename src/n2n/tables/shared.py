"""Who measures what: any number of `n2n tables run` on one results folder, on all machines that share it."""

import uuid
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from n2n.errors import OutputError
from n2n.formats.atomic import make_folder
from n2n.sweeps.claims import claim, is_held
from n2n.tables.methods import not_installed
from n2n.tables.plan import Job, Plan
from n2n.tables.spec import Fit
from n2n.tables.store import Store, sources

MINE, ELSEWHERE, DONE, FAILED = "mine", "elsewhere", "done", "failed"
_CLAIMS = ".claims"


class Share:
    """This process's part of a plan: a fit is measured by who claims it, and by nobody else while that one lives.

    Args:
        plan: What is wanted.
        store: Where results go.
        again: Also what was done by other sources.
        since: What failed later, by the clock of the folder, has been tried by those who work on the plan with us, and
            is not tried again; None: now.
    """

    def __init__(self, plan: Plan, store: Store, again: bool = False, since: float | None = None) -> None:
        self._plan, self._store, self._again = plan, store, again
        self._held: dict[Fit, ExitStack] = {}
        self._since = now(store) if since is None else since

    def __enter__(self) -> "Share":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for held in self._held.values():
            held.close()

    def take(self, job: Job) -> tuple[str, str]:
        """Claim a fit.

        Returns:
            `mine`; or whose it is: `elsewhere`, being measured now; `done` meanwhile; `failed` meanwhile, and why.
        """
        if job.fit in self._held:
            return MINE, ""
        with ExitStack() as stack:
            if not stack.enter_context(claim(_claim(self._store, job.fit))):
                return ELSEWHERE, ""
            state, error = self._look(job)
            if state == MINE:
                self._held[job.fit] = stack.pop_all()
        return state, error

    def release(self, job: Job) -> None:
        """Give a claim back; what came of it is in the store."""
        self._held.pop(job.fit).close()

    def _look(self, job: Job) -> tuple[str, str]:
        record = self._store.read(job.fit)
        is_stale = self._again and record is not None and record.get("made", {}).get("sources") != sources()
        if self._plan.is_done(job, self._store) and not is_stale:
            return DONE, ""
        error = failed_since(job.fit, self._store, self._since)
        return (FAILED, error) if error else (MINE, "")


def open_jobs(plan: Plan, store: Store, again: bool = False) -> list[Job]:
    """Return what is to be done at present, by whomsoever; `again`: also what was done by other sources.

    Nothing that needs a package that is not installed here: what another machine has measured by it stays as it is.
    """
    stale = [job for job in plan.stale(store) if not not_installed(job.fit.method)] if again else []
    return plan.open(store) + stale


def failed_since(fit: Fit, store: Store, since: float) -> str:
    """Return why a fit failed; empty where it did not, or before `since` by the clock of the folder."""
    record = store.read(fit)
    error = "" if record is None else failure(record)
    return error if error and store.path(fit).stat().st_mtime > since else ""


def failure(record: dict[str, Any]) -> str:
    """Return why a fit failed, or failed again after it had been measured; empty where it did not."""
    return record["error"] if record["status"] == "failed" else record.get("failed_again", "")


def measured_now(plan: Plan, store: Store) -> list[Job]:
    """Return the fits that a living process has claimed."""
    return [job for job in plan.jobs.values() if is_held(store.folder / _CLAIMS / job.fit.id)]


def now(store: Store) -> float:
    """Return the time by the clock of the results folder, which is not that of every machine.

    Raises:
        OutputError: The folder cannot be written.
    """
    probe = _claims(store) / f".now-{uuid.uuid4().hex}"
    try:
        probe.touch()
        return probe.stat().st_mtime
    except OSError as error:
        raise OutputError(f"{probe.parent}: cannot write there ({error.strerror}); choose another --results") from error
    finally:
        probe.unlink(missing_ok=True)


def _claim(store: Store, fit: Fit) -> Path:
    return _claims(store) / fit.id


def _claims(store: Store) -> Path:
    return make_folder(store.folder / _CLAIMS, "choose another --results")
