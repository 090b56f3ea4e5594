"""Stand-ins for a fit that a worker process can import: what happens is in the name of the shape."""

import os
import signal
import sys
import time
from pathlib import Path


def record(job):
    results = {
        e: {"definition": "", "asked": [], "values": {}, "floors": {}, "blanks": {}} for e in job.evaluations if e
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
    if kind == "sleeps":
        Path(place).write_text(str(os.getpid()))
        time.sleep(60)
    return record(job)


def alone(job):
    return measure(job, None)


if __name__ == "__main__":
    # A parent that is killed while its worker sleeps.
    from table_jobs import alone

    from n2n.tables import run
    from n2n.tables.plan import Job
    from n2n.tables.spec import Fit

    run._pass(alone, [Job(Fit("n2n", "pu", sys.argv[1], ()))], 1, print)
