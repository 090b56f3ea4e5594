"""Whether the data of a run are those it was fitted to."""

import functools
import json
from typing import Any

from n2n.errors import N2NError
from n2n.registry import DATAMODULES


def fingerprint(config: dict[str, Any]) -> str | None:
    """Return what names the data of a configuration by content; None where they cannot be read."""
    try:
        data = DATAMODULES.build(config["datamodule"], num_observations=config["num_observations"])
    except (N2NError, ValueError, TypeError, OSError):
        return None  # the fit itself will say why
    return data.fingerprint()


class Fingerprints:
    """Fingerprints of many configurations; data that several share are read once."""

    def __init__(self) -> None:
        self._of = functools.lru_cache(maxsize=None)(lambda text: fingerprint(json.loads(text)))

    def of(self, config: dict[str, Any]) -> str | None:
        """Return the fingerprint of a configuration's data."""
        wanted = {key: config[key] for key in ("datamodule", "num_observations")}
        return self._of(json.dumps(wanted, sort_keys=True))
