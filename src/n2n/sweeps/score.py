"""What an optimising sweep goes by: one number of a finished run."""

import math
from pathlib import Path

from n2n.sweeps.status import read_json
from n2n.tracking.names import EVALUATION_FILE, VALIDATION


def score(run_dir: Path, of: str | None = None) -> float | None:
    """Return a number that was measured of a run; None where it was not.

    Args:
        run_dir: Of a finished run.
        of: `validation`, or `task/protocol/metric`; None: what the sweeper of the running Hydra application asks for.
    """
    wanted = of or _asked_for()
    record = read_json(run_dir / EVALUATION_FILE)
    if wanted == VALIDATION:
        value = record.get(VALIDATION)
    else:
        evaluation, _, metric = wanted.rpartition("/")
        value = record.get("evaluations", {}).get(evaluation, {}).get("values", {}).get(metric)
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _asked_for() -> str:
    from hydra.core.hydra_config import HydraConfig

    return HydraConfig.get().sweeper.get("score", VALIDATION) if HydraConfig.initialized() else VALIDATION
