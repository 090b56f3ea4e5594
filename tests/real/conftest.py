"""Tests on real scans, in the folder named by N2N_DATA; they skip where it is missing."""

import os
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="session")
def data():
    folder = Path(os.environ.get("N2N_DATA", "../shared/data")).resolve()
    if not folder.is_dir():
        pytest.skip(f"no real data in {folder}; set N2N_DATA")
    return folder


@pytest.fixture(scope="session")
def peers(data):
    """Return a function: name of a case -> arrays clean, noisy, verts, faces, all in the unit sphere."""

    def load(case):
        with np.load(data / "peers" / f"{case}.npz") as arrays:
            return {name: arrays[name].astype(int if name == "faces" else float) for name in arrays.files}

    return load
