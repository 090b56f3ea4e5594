"""Which number of the paper a run is to be compared with."""

from dataclasses import dataclass

from n2n.dashboard.definition import CD, P2M


@dataclass(frozen=True)
class Counterpart:
    """Which number of the paper a run is to be compared with.

    Attributes:
        where: Settings that the run must have, e.g. {"datamodule.name": "pu"}.
        metric: `task/protocol/metric` of the run.
        table, row, column: The paper's cell.
        scale: Factor from the run's raw value to the paper's unit.
        shapes: The paper's number is a mean over so many; 0 where it does not say.
    """

    where: tuple[tuple[str, object], ...]
    metric: str
    table: str
    row: str
    column: str
    scale: float
    shapes: int


_SHAPES = {"pu": 20, "pc": 10, "abc": 100, "famous": 22, "dfaust": 5, "srb": 5, "scene3d": 1}


def _counterparts() -> tuple[Counterpart, ...]:
    found = []

    def add(
        datamodule: str, settings: dict[str, object], metric: str, table: str, place: tuple[str, str], scale: float
    ):
        where = (("datamodule.name", datamodule), *((f"datamodule.{k}", v) for k, v in settings.items()))
        found.append(Counterpart(where, metric, table, *place, scale, _SHAPES.get(datamodule, 0)))

    for name, group in (("pu", "PU"), ("pc", "PC")):
        for points, label in ((10_000, "10K"), (50_000, "50K")):
            for noise, percent in ((0.01, "1%"), (0.02, "2%"), (0.03, "3%")):
                for metric, short in ((CD, "CD"), (P2M, "P2M")):
                    place = (f"{group}/Ours", f"{label}/{percent}/{short}")
                    add(name, {"points": points, "noise": noise}, metric, "T01_denoising_PU_PC", place, 1e4)
    for points, label in ((5_000, "5K"), (10_000, "10K")):
        for metric, short in (("cd_sum2", "CD"), ("p2m", "P2M")):
            place = (short, f"{label}/Ours")
            add("pu", {"points": points}, f"upsample/sbp/{metric}", "T02_upsampling", place, 1e4)
    for name, protocol, table in (
        ("shapenet", "onet", "T03_shapenet_mean"),
        ("dfaust", "sap", "T05_dfaust"),
        ("srb", "sap", "T06_srb"),
    ):
        for metric, row, scale in (("cd_mean1", "L1CD_x10", 10.0), ("fscore", "F-Score", 1.0), ("nc", "NC", 1.0)):
            if (name, metric) != ("srb", "nc"):
                add(name, {}, f"reconstruct/{protocol}/{metric}", table, (row, "Ours"), scale)
    for name, variant, row in (
        ("abc", "abc", "ABC var"),
        ("abc", "abc_extra_noisy", "ABC max"),
        ("famous", "famous_original", "F-med"),
        ("famous", "famous_extra_noisy", "F-max"),
    ):
        add(name, {"variant": variant}, "reconstruct/neuralpull/cd_mean2", "T04_abc_famous", (row, "Ours"), 100.0)
    for shape in ("Lounge", "Copyroom"):
        for metric, short, scale in (("cd_mean2", "L2CD", 1000.0), ("cd_mean1", "L1CD", 1.0), ("nc", "NC", 1.0)):
            place = ("Ours", f"{shape}/{short}")
            add("scene3d", {"shape": shape.lower()}, f"reconstruct/scene3d/{metric}", "T07_3dscene", place, scale)
    return tuple(found)


COUNTERPARTS = _counterparts()
