"""What a finished run predicts, and the truth its benchmark knows."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.errors import ConfigError, InputError
from n2n.geometry.reference import Reference
from n2n.registry import DATAMODULES
from n2n.tasks.field import Field


class Run(NamedTuple):
    """A run's prediction with all that is needed to judge it, world coordinates.

    Attributes:
        prediction: Denoised or upsampled points (n, 3), or the reconstructed mesh, by the run's task.
        reference: None where its data have no truth.
        noisy: The first observation, (m, 3).
        description: One line: task, shape, where the data come from.
        config: As the run was made, every `auto` filled in.
    """

    prediction: NDArray[np.float64] | trimesh.Trimesh
    reference: Reference | None
    noisy: NDArray[np.float64]
    description: str
    config: dict[str, Any]


def read_run(folder: str | Path, device: str = "auto") -> Run:
    """Load a run's field, build its data anew and do its task.

    Raises:
        InputError: No finished run, several shapes, or data that have changed since the fit.
        ConfigError: The data cannot be built from the run's configuration.
    """
    field = Field.load(folder, device)
    if len(field.frames) > 1:
        raise InputError(f"{folder} holds {len(field.frames)} shapes; evaluate their results as files, one by one")
    data = _data(field.config)
    # Two frames that agree in every digit belong to the same first cloud, or to none that was changed by chance.
    if data.frames[0] != field.frames[0]:
        raise InputError(f"{folder}: its data have changed since the fit; fit anew, or evaluate its result as a file")
    noisy = noisy_points(data)
    task, name = field.config["task"], getattr(data, "name", field.config["datamodule"]["name"])
    description = f"{task} of {name}: {getattr(data, 'source', 'the first observation')}"
    return Run(predict(field, noisy), getattr(data, "reference", None), noisy, description, field.config)


def noisy_points(data: Any) -> NDArray[np.float64]:
    """Return the first observation of the first shape, (n, 3) world coordinates: what is to be denoised."""
    noisy = getattr(data, "noisy", None)
    return data.frames[0].to_world(data.shapes[0][0].double().numpy()) if noisy is None else noisy


def predict(field: Field, noisy: NDArray[np.float64], task: str | None = None) -> NDArray[np.float64] | trimesh.Trimesh:
    """Do a task with its defaults; None for the one a field was fitted for."""
    task = task or field.config["task"]
    if task == "reconstruct":
        return field.reconstruct()
    return field.denoise(noisy) if task == "denoise" else field.upsample(noisy)


def _data(config: dict[str, Any]) -> Any:
    spec = config["datamodule"]
    try:
        return DATAMODULES.build(spec, num_observations=config["num_observations"])
    except (ValueError, TypeError) as error:
        raise ConfigError(f"the run's datamodule {spec['name']!r} cannot be built again ({error})") from error
