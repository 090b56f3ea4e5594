"""A fitted field in world coordinates: surface, denoised points, upsampled points."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
import trimesh
from numpy.typing import NDArray

from n2n.architectures.base import SDF
from n2n.errors import InputError
from n2n.fitting.assemble import build_field
from n2n.fitting.checkpoint import read_state, unreadable, write_state
from n2n.fitting.fit import FitResult, pick_device
from n2n.fitting.held_out import HeldOut
from n2n.geometry.frame import Frame
from n2n.geometry.sparse_grid import triple
from n2n.metrics.point_mesh import distances_to_mesh, line_distances
from n2n.tasks.points import denoise_points, upsample_points
from n2n.tasks.surface import field_box, reconstruct_surface

FIELD_FILE = "field.ckpt"
_MOSTLY = 0.5
_FAR, _FAR_NOISE = 4.0, 2.5  # median distances; deviations of the noise


@dataclass
class Field:
    """A signed distance field of one shape, or of several told apart by `shape`.

    All positions are world coordinates, float64. Inside is negative.

    Attributes:
        sdf: The network or grid, unit coordinates.
        frames: World <-> unit map per shape.
        config: Configuration of the fit, every `auto` filled in.
        report: Measured scales, iterations, seconds, final losses.
    """

    sdf: SDF
    frames: list[Frame]
    config: dict[str, Any]
    report: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, result: FitResult) -> "Field":
        """Wrap the result of a fit; the points it held out, if any, score it (`validation` in the report).

        Raises:
            SurfaceError: There is no surface that points could be held against.
        """
        field = cls(result.field, result.frames, result.config, result.report)
        if any(len(unseen.points) for unseen in result.held_out):
            field.report["validation"], field.report["validation_relative"] = _score(field, result.held_out)
        return field

    def reconstruct(
        self, resolution: int = 256, edge: float | None = None, shape: int = 0, keep_all: bool = False
    ) -> trimesh.Trimesh:
        """Extract the zero level set as a mesh with outward normals.

        Args:
            resolution: Voxels along the longest side of the surface's box.
            edge: Voxel edge in world units; overrides `resolution`.
            shape: Which shape of a field that holds several.
            keep_all: Also return specks: components smaller than 1 % of the largest.

        Raises:
            SurfaceError: The field has no zero level set; the message says why.
        """
        return reconstruct_surface(self.sdf, self.frames[shape], self.config, resolution, edge, shape, keep_all)

    def denoise(self, points: NDArray[np.float64], shape: int = 0, even: bool = False) -> NDArray[np.float64]:
        """Pull (n, 3) noisy points onto the surface; number and order are kept.

        Args:
            points: (n, 3).
            shape: Which shape of a field that holds several.
            even: Also spread them evenly over the part of the surface they cover.

        Raises:
            InputError: Most points lie where the field knows nothing: they are another cloud's.
        """
        near, pulls = self._near(points, shape), self.config["pulls"]
        return denoise_points(self.sdf, self.frames[shape], near, shape, pulls, even)

    def upsample(
        self, points: NDArray[np.float64], rate: int = 4, seed: int = 0, shape: int = 0, even: bool = False
    ) -> NDArray[np.float64]:
        """Return (rate * n, 3) points on the surface: the n denoised points, then rate - 1 perturbed copies, pulled.

        With `even` all of them are spread evenly over the part of the surface they cover; the order stays.

        Raises:
            InputError: As for `denoise`, or rate < 1.
        """
        near, pulls = self._near(points, shape), self.config["pulls"]
        return upsample_points(self.sdf, self.frames[shape], near, rate, seed, shape, pulls, even)

    def sdf_at(self, points: NDArray[np.float64], shape: int = 0) -> NDArray[np.float64]:
        """Return signed distances (n,) in world units at (n, 3) positions, inside negative."""
        frame = self.frames[shape]
        with torch.no_grad():
            unit = torch.as_tensor(frame.to_unit(_points(points)), dtype=torch.float32, device=self.device)
            codes = torch.full((len(unit),), shape, dtype=torch.long, device=self.device)
            return self.sdf(unit, codes).cpu().double().numpy() * frame.scale

    def _near(self, points: NDArray[np.float64], shape: int) -> NDArray[np.float64]:
        """Return the points, after a check that they are where the field was fitted."""
        points = _points(points)
        lower, upper = (self.frames[shape].to_world(corner) for corner in field_box(self.config))
        inside = ((points >= lower) & (points <= upper)).all(axis=1)
        if inside.sum() < _MOSTLY * len(points):
            raise InputError(
                f"{np.count_nonzero(~inside):,} of {len(points):,} points lie outside the box the field was fitted in, "
                f"{triple(lower, 6)} to {triple(upper, 6)}; give the cloud it was fitted to, or fit this one"
            )
        return points

    @property
    def device(self) -> torch.device:
        """Where the field computes."""
        return next(self.sdf.parameters()).device

    def save(self, run_dir: str | Path) -> Path:
        """Write the field into a run folder as plain numbers and tensors; return the file."""
        path = Path(run_dir) / FIELD_FILE
        path.parent.mkdir(parents=True, exist_ok=True)
        state = {
            "config": self.config,
            "frames": [frame.state() for frame in self.frames],
            "report": self.report,
            "weights": self.sdf.state_dict(),
        }
        write_state(path, state)
        return path

    @classmethod
    def load(cls, run_dir: str | Path, device: str = "auto") -> "Field":
        """Read a field from a run folder.

        Raises:
            InputError: There is no finished run.
        """
        path = Path(run_dir) / FIELD_FILE
        if not path.exists():
            raise InputError(f"{run_dir} holds no finished run ({FIELD_FILE} is missing); make one with `n2n fit`")
        state = read_state(path)
        try:
            frames = [Frame(tuple(frame["centre"]), frame["scale"]) for frame in state["frames"]]
            sdf = build_field(state["config"], len(frames))
            sdf.load_state_dict(state["weights"])
        except (RuntimeError, KeyError, ValueError, TypeError) as error:
            raise unreadable(path, error) from error
        return cls(sdf.eval().to(pick_device(device)), frames, state["config"], state["report"])


def _score(field: Field, held_out: list[HeldOut]) -> tuple[float, float]:
    """Return the mean distance of held-out points to the surface along their lines, in world units and of the noise.

    The surface itself is what they are held against: a field whose values shrink would look ever closer. How far is too
    far is not up to the surface alone: a bumpy one is near.
    """
    distances, relative = [], []
    for shape, (unseen, noise) in enumerate(zip(held_out, field.report["noise"], strict=True)):
        mesh = field.reconstruct(shape=shape)
        surface = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        usual = float(np.median(distances_to_mesh(unseen.points, *surface)))
        reach = max(_FAR * usual, _FAR_NOISE * unseen.noise)
        distances.append(line_distances(unseen.points, unseen.directions, *surface, reach))
        relative.append(distances[-1] / noise)
    return float(np.concatenate(distances).mean()), float(np.concatenate(relative).mean())


def _points(points: NDArray[np.float64]) -> NDArray[np.float64]:
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must be an array of shape (n, 3), got {points.shape}")
    return points
