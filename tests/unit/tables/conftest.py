import json

import pytest
import yaml

from n2n.tables.expand import expand
from n2n.tables.spec import Profile, load_tables

TABLE = {
    "title": "a table",
    "experiments": [
        {
            "datamodule": "pu",
            "axes": {"noise": {"1%": 0.01, "2%": 0.02}},
            "settings": ["datamodule.noise={noise}"],
            "evaluate": "denoise/sbp",
            "cells": [{"row": "ours", "column": "{noise}", "value": "p2m", "scale": 10000}],
        }
    ],
}


@pytest.fixture
def write_table(tmp_path):
    """Return a function that writes a table, changed in some keys, into a folder of its own, which it returns."""

    def write(name="mine", experiment=None, **changes):
        spec = json.loads(json.dumps(TABLE)) | changes
        if experiment is not None:
            spec["experiments"] = [spec["experiments"][0] | experiment]
        folder = tmp_path / "own"
        folder.mkdir(exist_ok=True)
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(spec, sort_keys=False))
        return folder

    return write


@pytest.fixture
def cells(write_table):
    """Return a function that expands a table of which some keys are changed."""

    def expanded(experiment=None, profile=None, present=None, **changes):
        (table,) = load_tables(["mine"], write_table(experiment=experiment, **changes))
        here = present or (lambda name, variant: (["cow", "duck"], None))
        return expand(table, profile or Profile("p", "a profile"), here)

    return expanded
