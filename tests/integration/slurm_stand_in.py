"""A Slurm of one machine: sbatch, srun, sacct and scontrol as far as submitit uses them.

`install(folder)` writes the commands; they keep what they know under `folder/state`. A job's tasks run as processes of
this machine; `scontrol requeue` starts one again once it has ended, as Slurm does.
"""

import contextlib
import os
import re
import shlex
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

COMMANDS = ("sbatch", "srun", "sacct", "scontrol")
JOB = "4242"


def install(folder):
    """Write the commands; return the folder to put on the PATH."""
    (folder / "bin").mkdir(parents=True)
    (folder / "state").mkdir()
    for name in COMMANDS:
        path = folder / "bin" / name
        path.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} {__file__} {folder}/state {name} "$@"\n')
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return folder / "bin"


def sbatch(state, script):
    text = Path(script).read_text()
    (state / "script").write_text(text)
    if "STAND_IN_RECORDS" in os.environ:
        print(f"Submitted batch job {JOB}")
        return
    # The folder of submitit's pickles gets the job's number only after this command has returned.
    array = re.search(r"--array=0-(\d+)", text)
    tasks = [f"{JOB}_{number}" for number in range(int(array.group(1)) + 1)] if array else [JOB]
    for task in tasks:
        (state / f"{task}.state").write_text("PENDING")
        with (state / f"{task}.log").open("w") as log:
            subprocess.Popen(
                [sys.executable, __file__, str(state), "task", task, str(state / "script")],
                start_new_session=True, stdout=log, stderr=log,
            )  # fmt: skip
    print(f"Submitted batch job {JOB}")


def task(state, name, script):
    """Run a task of an array until it ends without having been requeued."""
    (state / f"{name}.group").write_text(str(os.getpid()))
    time.sleep(1)
    number = name.partition("_")[2]
    names = {"SLURM_JOB_ID": str(int(JOB) + 1 + int(number or 0)), "SLURM_NTASKS": "1", "SLURM_JOB_NUM_NODES": "1"}
    names |= {"SLURM_NODEID": "0", "SLURM_PROCID": "0", "SLURM_LOCALID": "0", "SLURM_JOB_NODELIST": "here"}
    names |= {"SLURM_ARRAY_JOB_ID": JOB, "SLURM_ARRAY_TASK_ID": number} if number else {"SLURM_JOB_ID": JOB}
    names |= {"SLURM_CPUS_PER_TASK": re.search(r"--cpus-per-task=(\d+)", Path(script).read_text()).group(1)}
    while True:
        (state / f"{name}.state").write_text("RUNNING")
        with (state / f"{name}.starts").open("a") as starts:
            starts.write(".")
        subprocess.run(["bash", script], env={**os.environ, **names, "STAND_IN_TASK": name})
        again = state / f"{name}.requeue"
        if not again.exists():
            break
        again.unlink()
    (state / f"{name}.state").write_text("COMPLETED")


def srun(state, *arguments):
    """Run the command that follows the options, in the place of this process: signals reach it."""
    command = list(arguments[next(i for i, text in enumerate(arguments) if text == sys.executable) :])
    (state / f"{os.environ['STAND_IN_TASK']}.pid").write_text(str(os.getpid()))
    (state / f"{os.environ['STAND_IN_TASK']}.cpus").write_text(os.environ.get("SRUN_CPUS_PER_TASK", ""))
    os.execv(command[0], command)


def sacct(state, *_):
    print("JobID|State|NodeList")
    for path in sorted(state.glob("*.state")):
        print(f"{path.stem}|{path.read_text()}|here")


def scontrol(state, verb, job):
    assert verb == "requeue", verb
    # Slurm knows a task of an array by both of its names.
    (state / f"{os.environ['STAND_IN_TASK']}.requeue").write_text(job)


def end(state):
    """End what is left of all tasks."""
    for path in state.glob("*.group"):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(int(path.read_text()), signal.SIGKILL)


def preempt(state, name):
    """Warn a task that its time is over."""
    os.kill(int((state / f"{name}.pid").read_text()), signal.SIGUSR2)


if __name__ == "__main__":
    state, command, *rest = sys.argv[1:]
    globals()[command](Path(state), *rest)
