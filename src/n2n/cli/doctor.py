"""`n2n doctor`: is everything here, and what to do about what is not."""

import os
import platform
from importlib.metadata import PackageNotFoundError, requires, version
from typing import TYPE_CHECKING

from n2n import __version__

if TYPE_CHECKING:
    from packaging.requirements import Requirement


def run_doctor() -> int:
    """Print the state of the installation; return 1 if something required is missing or broken."""
    print(f"n2n {__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}")
    print(f"{os.cpu_count()} CPU cores{_available()}\n")
    problems = []
    for package, wanted in sorted(_required().items()):
        found = _version(package)
        state = found or f"MISSING: pip install '{wanted}'"
        if found and not _fits(found, wanted):
            state = f"{found} DOES NOT FIT: pip install '{wanted}'"
        if state != found:
            problems.append(package)
        print(f"  {package:<18} {state}")
    print("devices")
    if not _describe_devices():
        problems.append("torch")
    _describe_plugins()
    if problems:
        print(
            f"\nnot ready: {', '.join(dict.fromkeys(problems))} missing or broken; `pip install n2n` installs all of it"
        )
        return 1
    print("\nready: try `n2n demo`")
    return 0


def _required() -> dict[str, str]:
    """Return what n2n's own metadata asks for on this machine: package -> requirement."""
    try:
        needed = {requirement.name: requirement for requirement in _asked("n2n")}
        for requirement in list(needed.values()):
            for extra in requirement.extras if _version(requirement.name) else ():
                # laspy[lazrs]: what the extra brings and the package alone does not.
                plain = [further.name for further in _asked(requirement.name)]
                for further in _asked(requirement.name, extra):
                    if further.name not in plain:
                        needed.setdefault(further.name, further)
    except ImportError as error:
        # n2n is not installed (run from its source), or the package that reads requirements is not.
        return {error.name: error.name}
    return {name: _plain(requirement) for name, requirement in needed.items()}


def _asked(package: str, extra: str = "") -> "list[Requirement]":
    from packaging.requirements import Requirement

    asked = [Requirement(text) for text in requires(package) or ()]
    return [each for each in asked if each.marker is None or each.marker.evaluate({"extra": extra})]


def _plain(requirement: "Requirement") -> str:
    """Write a requirement without its marker, which is met."""
    extras = f"[{','.join(sorted(requirement.extras))}]" if requirement.extras else ""
    return f"{requirement.name}{extras}{requirement.specifier}"


def _fits(found: str, wanted: str) -> bool:
    try:
        from packaging.requirements import Requirement
    except ImportError:
        return True
    return Requirement(wanted).specifier.contains(found, prereleases=True)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _available() -> str:
    """Containers and schedulers often allow fewer cores than the machine has."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f", {allowed} of them for this process" if allowed != os.cpu_count() else ""


def _describe_devices() -> bool:
    try:
        import torch
    except Exception as error:
        print(f"  torch cannot be imported ({error}): pip install --force-reinstall torch")
        return False
    print(f"  {'cpu':<18} {torch.get_num_threads()} threads")
    for index in range(torch.cuda.device_count() if torch.cuda.is_available() else 0):
        chosen = "" if index else "; chosen by device=auto"
        memory = torch.cuda.get_device_properties(index).total_memory / 2**30
        print(f"  {f'cuda:{index}':<18} {torch.cuda.get_device_name(index)}, {memory:.0f} GiB{chosen}")
    if not torch.cuda.is_available():
        if torch.version.cuda is None:
            print(f"  {'cuda':<18} torch is a CPU build; with an NVIDIA card: make setup TORCH=torch")
        else:
            print(f"  {'cuda':<18} torch {torch.version.cuda} sees no card; check the driver with nvidia-smi")
    if torch.backends.mps.is_available():
        print(f"  {'mps':<18} Apple GPU; choose it with device=mps")
    return True


def _describe_plugins() -> None:
    """Name third-party components and say which of them are broken."""
    from n2n.registry import ALL

    lines = [
        f"  {f'{registry.kind} {name}':<18} {registry.describe(name)}"
        for registry in ALL
        for name in registry.plugin_names()
    ]
    if lines:
        print("plugins", *lines, sep="\n")
