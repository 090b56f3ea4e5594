"""Whether the data of a run are those it was fitted to."""

import functools
import json
from typing import Any

from n2n.errors import N2NError
from n2n.registry import DATAMODULES


def read_data(config: dict[str, Any]) -> Any:
    """Return the datamodule of a configuration; None where its data cannot be read."""
    try:
        return DATAMODULES.build(config["datamodule"], num_observations=config["num_observations"])
    except (N2NError, ValueError, TypeError, OSError):
        return None  # the fit itself will say why


def fingerprint(data: Any) -> str | None:
    """Return what names data by content; None where there are none."""
    return None if data is None else data.fingerprint()


class Fingerprints:
    """Fingerprints of many configurations; data that several share are read once."""

    def __init__(self) -> None:
        self._of = functools.lru_cache(maxsize=None)(lambda text: fingerprint(read_data(json.loads(text))))

    def of(self, config: dict[str, Any]) -> str | None:
        """Return the fingerprint of a configuration's data."""
        wanted = {key: config[key] for key in ("datamodule", "num_observations")}
        return self._of(json.dumps(wanted, sort_keys=True))
