"""Run a command from a small process: on Linux a child's peak memory starts at that of the process it came from.

Usage: launcher.py RESULT COMMAND [ARGUMENT ...]; writes exit code, wall seconds and peak memory as JSON. Only the
standard library, and as little of it as possible.
"""

import json
import os
import sys
import time


def main(result: str, command: list[str]) -> None:
    start = time.perf_counter()
    _, status, usage = os.wait4(os.posix_spawn(command[0], command, os.environ), 0)
    seconds = time.perf_counter() - start
    unit = 1 if sys.platform == "darwin" else 1024
    with open(result, "w") as file:  # noqa: PTH123
        json.dump({"code": os.waitstatus_to_exitcode(status), "seconds": seconds, "peak": usage.ru_maxrss * unit}, file)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
