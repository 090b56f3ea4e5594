"""`n2n doctor`: is everything here, and what to do about what is not."""

import os
import platform
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from n2n import __version__

_REQUIRED = (
    "torch", "lightning", "hydra-core", "omegaconf", "numpy", "scipy", "scikit-image", "trimesh", "matplotlib", "rich",
    "jaxtyping", "wandb", "laspy",
)  # fmt: skip
_OPTIONAL = {
    "lazrs": ("lazrs", "compressed .laz files", "pip install 'laspy[lazrs]'"),
    "point-cloud-utils": ("point_cloud_utils", "mesh distances in benchmarks", "pip install point-cloud-utils"),
    "mpl-toolkits": ("mpl_toolkits", "plots", "pip install matplotlib"),
}


def run_doctor() -> int:
    """Print the state of the installation; return 1 if something required is missing."""
    print(f"n2n {__version__}   Python {platform.python_version()}   {platform.system()} {platform.machine()}")
    print(f"{os.cpu_count()} CPU cores")
    missing = []
    for package in _REQUIRED:
        try:
            print(f"  {package:<20} {version(package)}")
        except PackageNotFoundError:
            missing.append(package)
            print(f"  {package:<20} MISSING: pip install {package}")
    for package, (module, purpose, remedy) in _OPTIONAL.items():
        try:
            import_module(module)
            print(f"  {package:<20} present ({purpose})")
        except ImportError:
            print(f"  {package:<20} not installed ({purpose}): {remedy}")
    if "torch" not in missing:
        _describe_devices()
    if missing:
        print(f"\n{len(missing)} required package(s) missing; reinstall with: pip install n2n", file=sys.stderr)
        return 1
    print("\nready: try `n2n demo`")
    return 0


def _describe_devices() -> None:
    import torch

    print(f"  torch threads        {torch.get_num_threads()}")
    if torch.cuda.is_available():
        for index in range(torch.cuda.device_count()):
            print(f"  cuda:{index}               {torch.cuda.get_device_name(index)}")
    elif torch.version.cuda is None:
        print("  GPU                  torch is a CPU build; with an NVIDIA card: pip install --force-reinstall torch")
    else:
        print("  GPU                  none visible to torch")
    if torch.backends.mps.is_available():
        print("  mps                  Apple GPU (use device=mps)")
