"""How each logger takes pictures and 3D models; CSV takes none, the files in the run folder are its own."""

from functools import singledispatch

import numpy as np
import torch
from lightning.pytorch.loggers import Logger, TensorBoardLogger, WandbLogger

from n2n.tracking import names
from n2n.tracking.media import Media


@singledispatch
def show(logger: Logger, media: Media, step: int) -> None:
    """Hand pictures and 3D models to a logger that has a place for them."""


@show.register
def _wandb(logger: WandbLogger, media: Media, step: int) -> None:
    import wandb

    coloured = np.hstack([media.points, media.colours])
    shown = {
        names.LEVEL_SETS: wandb.Image(str(media.picture)),
        names.MESH: wandb.Object3D(str(media.model)),
        names.POINTS: wandb.Object3D.from_numpy(coloured),
    }
    logger.log_metrics(shown, step)


@show.register
def _tensorboard(logger: TensorBoardLogger, media: Media, step: int) -> None:
    from PIL import Image

    writer = logger.experiment
    with Image.open(media.picture) as picture:
        writer.add_image(names.LEVEL_SETS, np.asarray(picture.convert("RGB")), step, dataformats="HWC")
    vertices, faces = (torch.as_tensor(np.asarray(array))[None] for array in (media.mesh.vertices, media.mesh.faces))
    writer.add_mesh(names.MESH, vertices.float(), faces=faces.int(), global_step=step)
    points, colours = torch.as_tensor(media.points)[None], torch.as_tensor(media.colours)[None]
    writer.add_mesh(names.POINTS, points.float(), colors=colours, global_step=step)
