"""Names of everything that is logged: columns of metrics.csv, keys in W&B and TensorBoard."""

EVALUATION_FILE = "evaluation.json"  # in a run folder

# While fitting. A further term of the loss is logged under its own name (eikonal, smoothness, ...), unweighted.
STEP = "step"
LOSS = "loss"  # Eq. 7: distance plus the weighted terms
DISTANCE = "distance"  # L of Eq. 4, unit coordinates to the power of its exponent
REGULARISER = "regulariser"  # R of Eq. 7, without lambda
GRADIENT_NORM = "gradient_norm"  # mean |grad f| at the queries
EIKONAL_DEVIATION = "eikonal_deviation"  # mean ||grad f| - 1| at the queries
MATCHED_DISTANCE = "matched_distance"  # world units: mean for exponent 1, root mean square for exponent 2
LEARNING_RATE = "learning_rate"
STEPS_PER_SECOND = "steps_per_second"
MEMORY = "memory_gib"  # resident memory of the process
GPU_MEMORY = "gpu_memory_gib"  # largest so far; where a CUDA device is used
TRAINING = (
    LOSS, DISTANCE, REGULARISER, GRADIENT_NORM, EIKONAL_DEVIATION, MATCHED_DISTANCE, LEARNING_RATE, STEPS_PER_SECOND,
    MEMORY, GPU_MEMORY,
)  # fmt: skip

# Once, after the fit.
NOISE = "noise"  # estimated, world units; mean over the shapes
SPACING = "spacing"  # estimated, world units; mean over the shapes
VOXEL = "voxel"  # finest cell of a grid, world units
SECONDS = "seconds"
VALIDATION = "validation"  # mean distance of held-out points to the fitted surface along normals, world units
VALIDATION_RELATIVE = "validation_relative"  # the same, in units of the estimated noise; 0.80 for a perfect surface
RESULTS = (NOISE, SPACING, VOXEL, SECONDS, VALIDATION, VALIDATION_RELATIVE)

# Pictures and 3D.
LEVEL_SETS, MESH, POINTS = "media/level_sets", "media/mesh", "media/points"
MEDIA = (LEVEL_SETS, MESH, POINTS)


def evaluation(task: str, protocol: str, metric: str) -> str:
    """Return the name of an evaluated metric, raw units.

    >>> evaluation("denoise", "sbp", "cd_sum2")
    'denoise/sbp/cd_sum2'
    """
    return f"{task}/{protocol}/{metric}"
