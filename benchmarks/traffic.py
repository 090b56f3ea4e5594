"""What a computation asks of a device: operations, floating-point operations and bytes, counted as torch runs it."""

import math
from typing import Any

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

_PRODUCTS = {"mm", "bmm", "addmm", "baddbmm"}
_GATHERS = {"index", "gather", "index_select", "take"}
_SCATTERS = {"index_put_", "_unsafe_index_put", "index_put", "scatter_add_", "scatter_add", "index_add_"}
_FREE = {"empty", "empty_like", "new_empty", "new_empty_strided", "empty_strided", "detach", "_local_scalar_dense"}


class Traffic(TorchDispatchMode):
    """Count inside a `with` block.

    Every operation reads its tensors and writes its results once, as if nothing stayed in a cache: what eager mode asks
    of memory at most. Matrix products count 2 m n k, all else one for each result. Views cost nothing.

    Attributes:
        operations: Operations that are not views: about as many kernels.
        flops: Floating-point operations.
        bytes: Read and written.
    """

    def __init__(self) -> None:
        super().__init__()
        self.operations, self.flops, self.bytes = 0, 0, 0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        result = func(*args, **(kwargs or {}))
        name = func.overloadpacket.__name__
        if func.is_view or name in _FREE:
            return result
        read = [x for x in tree_leaves((args, kwargs or {})) if isinstance(x, torch.Tensor)]
        # Operations on lists in place (the optimiser's) return nothing.
        written = [x for x in tree_leaves(args[:1] if result is None else result) if isinstance(x, torch.Tensor)]
        self.operations += 1
        self.bytes += _moved(name, read, written)
        self.flops += sum(x.numel() for x in written) * (2 * read[-1].shape[-2] if name in _PRODUCTS else 1)
        return result


def _moved(name: str, read: list[torch.Tensor], written: list[torch.Tensor]) -> int:
    """Return the bytes read and written; gathers and scatters touch no more of a table than what they move."""
    sizes = [_stored(x) for x in read], [_stored(x) for x in written]
    if name in _GATHERS:
        sizes[0][0] = min(sizes[0][0], sizes[1][0])
    if name in _SCATTERS:
        sizes[0][0] = sizes[1][0] = min(sizes[0][0], _stored(read[-1]))
    return sum(map(sum, sizes))


def _stored(x: torch.Tensor) -> int:
    """Return the bytes of a tensor, what it repeats by broadcasting counted once."""
    return math.prod(n for n, step in zip(x.shape, x.stride(), strict=True) if step) * x.element_size()
