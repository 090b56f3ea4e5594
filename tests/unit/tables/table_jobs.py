"""Stand-ins for a fit that a worker process can import: what happens is in the name of the shape."""

import os
import signal
import sys
import time
from pathlib import Path


def record(job):
    from n2n.tables.store import protocol_hash

    results = {
        e: {"definition": protocol_hash(e.split("/")[1]), "asked": [], "values": {}, "floors": {}, "blanks": {}}
        for e in job.evaluations
        if e
    }
    made = {"sources": "", "n2n": "0", "commit": "0", "machine": "m"}
    done = {"status": "done", "results": results, "cost": {"minutes": 1.0}, "made": made}
    return {**job.fit.described(), **done, "threads": os.environ["OMP_NUM_THREADS"], "pid": os.getpid()}


def measure(job, samples):
    kind, _, place = job.fit.shape.partition(":")
    if kind == "fails":
        return job.fit.failed("it is broken")
    if kind == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "killed-once" and not Path(place).exists():
        Path(place).touch()
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "notes":
        # A line for each time it is measured; the name of the shape goes on after the folder.
        folder, _, wait = place.partition("#")
        with (Path(folder) / "log").open("a") as log:
            log.write(f"{job.fit.shape}\n")
        time.sleep(float(wait.partition("#")[0]))
    if kind == "sleeps":
        Path(place).write_text(str(os.getpid()))
        time.sleep(60)
    return record(job)


def alone(job):
    return measure(job, None)


def plan_of(shapes, evaluation="denoise/sbp"):
    """Return a plan of one stand-in per name; without an evaluation, their cost is the result."""
    from n2n.tables.plan import Job, Plan
    from n2n.tables.spec import Fit, Profile

    jobs = [Job(Fit("n2n", "pu", shape, ()), {evaluation: set()}) for shape in shapes]
    return Plan(Profile("p", "a profile"), [], {}, {job.fit: job for job in jobs})


if __name__ == "__main__":
    from table_jobs import alone, measure

    from n2n.tables import run
    from n2n.tables.plan import Job
    from n2n.tables.spec import Fit
    from n2n.tables.store import Store

    if sys.argv[1] == "run":
        # `n2n tables run` as a process of its own: results, workers, shapes.
        run._measure = measure
        failures = run.run(plan_of(sys.argv[4:]), Store(sys.argv[2]), int(sys.argv[3]))
        sys.exit(2 if failures else 0)
    # A parent that is killed while its worker sleeps.
    run._pass(alone, [Job(Fit("n2n", "pu", sys.argv[1], ()))], 1, print, take=lambda job: True)
