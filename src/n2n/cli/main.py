"""`n2n`: where commands are dispatched and errors become exit codes."""

import argparse
import gc
import signal
import sys
from collections.abc import Sequence

from n2n.cli.arguments import parse
from n2n.errors import N2NError

DONE, FAILED, BROKEN, INTERRUPTED = 0, 2, 3, 130
_OBJECTS = 100_000


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns:
        Exit code: 0 done, 1 something is missing (doctor), 2 an error the user can mend, 3 an error of n2n
        itself, 130 interrupted by Ctrl-C or SIGTERM.
    """
    if argv is not None:
        return _run(list(argv))
    # Torch and Lightning bring a million objects, none of them garbage: looking for it took a second while they were
    # imported, and another one as the process ended.
    gc.set_threshold(_OBJECTS)
    signal.signal(signal.SIGTERM, _stop)
    try:
        return _run(sys.argv[1:], is_own_process=True)
    finally:
        gc.freeze()


def _run(arguments: list[str], is_own_process: bool = False) -> int:
    try:
        return _dispatch(parse(arguments))
    except N2NError as error:
        return _fail(str(error))
    except MemoryError:
        return _fail("not enough memory; use fewer points, a lower --resolution or a smaller batch_size")
    except KeyboardInterrupt as stop:
        if is_own_process:
            # It ends now: pressing Ctrl-C again must not end it in another way. Callers with a process of their own,
            # which may be in a thread, keep their Ctrl-C.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        return _interrupted(str(stop))
    except BrokenPipeError:
        # The reader of our output has gone (n2n list | head); the interpreter would complain once more at exit.
        sys.stdout = None
        return DONE
    except Exception as error:
        return _broken(error)


def _dispatch(options: argparse.Namespace) -> int:
    """Import what a command needs only when it runs: --help and list stay fast."""
    if options.command == "fit":
        from n2n.cli.fit import run_fit

        return run_fit(options.overrides)
    if hasattr(options, "run_command"):
        return options.run_command(options)
    if options.command == "list":
        from n2n.cli.listing import run_list

        return run_list(options.kind)
    if options.command == "doctor":
        from n2n.cli.doctor import run_doctor

        return run_doctor()
    if options.command == "demo":
        from n2n.cli.demo import run_demo

        return run_demo(options.output)
    from n2n.cli.work import run_work

    return run_work(options)


def _stop(*_: object) -> None:
    """End like Ctrl-C, which leaves nothing half-written: a container or a scheduler asks by SIGTERM."""
    raise KeyboardInterrupt


def _fail(message: str) -> int:
    print("n2n: error:", message.replace("\n", " "), file=sys.stderr)
    return FAILED


def _broken(error: Exception) -> int:
    """Say where n2n itself failed, in one line; whoever wants to mend it asks for the rest."""
    from n2n.messages import unexpected

    _fail(unexpected(error))
    return BROKEN


def _interrupted(advice: str = "") -> int:
    # A terminal shows ^C at the start of the line.
    start = "\n" if sys.stderr.isatty() else ""
    print(f"{start}n2n: interrupted; {advice or 'no unfinished file was left'}", file=sys.stderr)
    return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
