"""Learn signed distance functions from noisy point clouds by noise-to-noise mapping (Ma, Liu, Han, ICML 2023).

>>> import n2n                                  # doctest: +SKIP
>>> field = n2n.fit(points)                     # doctest: +SKIP
>>> mesh, clean = field.reconstruct(), field.denoise(points)    # doctest: +SKIP
"""

from importlib import import_module

__version__ = "0.1.0"
_LAZY = {"fit": "n2n.tasks.api", "Field": "n2n.tasks.field"}
__all__ = ["Field", "__version__", "fit"]


def __getattr__(name: str):
    """Import the public names on first use, so that `import n2n` does not import torch."""
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'n2n' has no attribute {name!r}")
