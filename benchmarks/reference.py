"""A fixed amount of work of the kinds a fit does, to measure a machine with.

Never change it: recorded ratios rest on it. It imports nothing of n2n.
"""

import json
import sys
import time

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree


def workload(repeats: int = 7) -> float:
    """Do it; return the seconds it took."""
    random = np.random.default_rng(0)
    matrix = torch.as_tensor(random.standard_normal((768, 768)), dtype=torch.float32)
    values = torch.as_tensor(random.standard_normal(1_000_000), dtype=torch.float32)
    rows = torch.as_tensor(random.integers(0, len(values), (10_000, 27)))
    costs = random.random((64, 96, 96))
    points = random.standard_normal((20_000, 3))
    start = time.perf_counter()
    for _ in range(repeats):
        product = matrix
        for _ in range(8):
            product = torch.nn.functional.normalize(product @ matrix)
        values.sort()
        for _ in range(40):
            leaf = values.clone().requires_grad_(True)
            leaf[rows].square().sum().backward()
        for cost in costs:
            linear_sum_assignment(cost)
        cKDTree(points).query(points, 8)
        sum(i * i for i in range(500_000))
    return time.perf_counter() - start


if __name__ == "__main__":
    repeats = int(sys.argv[1])
    workload(1)
    print(json.dumps({"seconds": workload(repeats)}))
