"""Array shapes used in signatures (jaxtyping); checked for real while the tests run."""

from jaxtyping import Float, Int
from torch import Tensor

Points = Float[Tensor, "n 3"]
Values = Float[Tensor, " n"]
Leaves = Float[Tensor, "b k 3"]
LeafIndex = Int[Tensor, "b k"]
Coupling = Float[Tensor, "b k k"]
Index = Int[Tensor, " n"]
