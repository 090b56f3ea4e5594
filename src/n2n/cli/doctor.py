"""`n2n doctor`: is everything here, and what to do about what is not."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from n2n import __version__

_REQUIRED = (
    "torch", "lightning", "hydra-core", "omegaconf", "numpy", "scipy", "scikit-image", "trimesh", "matplotlib", "rich",
    "jaxtyping",
)  # fmt: skip
# Package -> module, what it is for, how to get it.
_OPTIONAL = {
    "laspy": ("laspy", "reading and writing .las", "pip install 'laspy[lazrs]'"),
    "lazrs": ("lazrs", "compressed .laz", "pip install 'laspy[lazrs]'"),
    "wandb": ("wandb", "logger=wandb", "pip install wandb"),
    "point-cloud-utils": ("point_cloud_utils", "mesh distances", "pip install point-cloud-utils"),
}
if platform.machine() == "aarch64" and platform.system() == "Linux":
    # No wheel of point-cloud-utils there.
    _OPTIONAL.pop("point-cloud-utils")
    _OPTIONAL["libigl"] = ("igl", "mesh distances", "pip install libigl")


def run_doctor() -> int:
    """Print the state of the installation; return 1 if something required is missing or broken."""
    print(f"n2n {__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}")
    print(f"{os.cpu_count()} CPU cores{_available()}\n")
    problems = []
    for package in _REQUIRED:
        found = _version(package)
        print(f"  {package:<18} {found or f'MISSING: pip install {package}'}")
        if found is None:
            problems.append(package)
    print("optional")
    for package, (module, purpose, remedy) in _OPTIONAL.items():
        found = _version(package) if find_spec(module) else None
        print(
            f"  {package:<18} {f'{found} ({purpose})' if found else f'not installed, needed for {purpose}: {remedy}'}"
        )
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
        memory = torch.cuda.get_device_properties(index).total_memory / 2**30
        print(f"  {f'cuda:{index}':<18} {torch.cuda.get_device_name(index)}, {memory:.0f} GiB; chosen by device=auto")
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
