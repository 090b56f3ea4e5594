"""`n2n evaluate`: the arguments and what is printed; the work is in n2n.evaluation."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from n2n.config import DEVICES

if TYPE_CHECKING:
    from n2n.evaluation.evaluation import Evaluation

_EPILOG = """\
protocols (docs/protocols.md; conf/protocol/ holds their settings):
  sbp         points against the clean cloud, P2M against the mesh: PU, PC
  onet        meshes, 100,000 samples: ShapeNet             p2s         meshes, even samples: ABC, FAMOUS
  sap         meshes, 50,000 samples: D-FAUST, SRB          neuralpull  meshes, squared distances: ABC, FAMOUS
  scene3d     meshes in metres, 1,000,000 samples: 3D Scene

examples:
  n2n evaluate clean.xyz --reference true.xyz --reference true.off --protocol sbp --noisy scan.xyz
  n2n evaluate mesh.ply --reference pointcloud.npz --protocol onet --json scores.json
  n2n evaluate runs/0123456789 --protocol sbp            a run on benchmark data knows its reference
"""
_FLOORS = {"oracle": "oracle", "resample": "resample", "split": "split", "do_nothing": "do nothing"}


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command and its arguments; imports nothing heavy."""
    command = commands.add_parser(
        "evaluate",
        help="score files or a run against a reference, by a published protocol",
        usage="n2n evaluate PRED --reference FILE [--reference FILE] --protocol NAME [options]",
        description="Score predicted points or a mesh against a clean cloud, a mesh or both, by a published protocol. "
        "Beside every number stands what a perfect method and doing nothing get.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("prediction", metavar="PRED", help="predicted points or mesh, or a run folder")
    command.add_argument(
        "--reference",
        action="append",
        default=[],
        metavar="FILE",
        help="clean cloud or mesh, told apart by their content; give one of each if you have both",
    )
    command.add_argument("--protocol", required=True, metavar="NAME", help="how to compare, see below")
    command.add_argument("--noisy", metavar="FILE", help="the points the prediction was made from, for the floors")
    command.add_argument("--json", metavar="FILE", help="also write raw numbers, units, definitions and floors")
    command.add_argument("--device", default="auto", choices=DEVICES, help="where to compute a run's result (auto)")
    command.set_defaults(run_command=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    import json

    from n2n.datamodules.shape_files import read_reference, read_shape
    from n2n.errors import ConfigError
    from n2n.evaluation.files import fingerprint, read_prediction
    from n2n.evaluation.protocol import load_protocol
    from n2n.evaluation.provenance import provenance
    from n2n.formats import atomic_path, check_writable

    protocol = load_protocol(options.protocol)
    if options.json:
        check_writable(options.json, (".json",))
    given, facts = [("reference", path) for path in options.reference], {}
    reference = read_reference(options.reference) if options.reference else None
    noisy = None
    if options.noisy:
        noisy = _points(read_shape(options.noisy))
        given.append(("noisy", options.noisy))
    if Path(options.prediction).is_dir():
        from n2n.evaluation.runs import read_run

        result = read_run(options.prediction, options.device)
        prediction, reference = result.prediction, reference or result.reference
        noisy = result.noisy if noisy is None else noisy
        facts = {"run": {"path": options.prediction, "description": result.description, "config": result.config}}
        if reference is None:
            raise ConfigError(f"the data of {options.prediction} have no reference; give one with --reference")
    else:
        prediction = read_prediction(options.prediction)
        given.insert(0, ("prediction", options.prediction))
    if reference is None:
        raise ConfigError("nothing to compare with; give a clean cloud or a mesh with --reference")
    evaluation = protocol.evaluate(prediction, reference, noisy)
    if facts:
        print(f"{options.prediction}: {facts['run']['description']}")
    print(render(evaluation, protocol.title))
    if options.json:
        files = [{"role": role, **fingerprint(path)} for role, path in given]
        record = {**provenance(), **facts, "files": files, "settings": protocol.settings(), **evaluation.as_json()}
        with atomic_path(options.json) as temporary:
            temporary.write_text(json.dumps(record, indent=1) + "\n")
    return 0


def render(evaluation: "Evaluation", title: str) -> str:
    """Return a table: metric, number in the unit of the published tables, raw number, floors in the former unit."""
    floors = [name for name in _FLOORS if name in evaluation.floors]
    rows = [["metric", "unit", "value", "raw", *(_FLOORS[name] for name in floors)]]
    for metric, definition in evaluation.definitions.items():
        row = [metric, _factor(definition["factor"])]
        if metric in evaluation.values:
            row += [f"{evaluation.printed(metric):.4g}", f"{evaluation.values[metric]:.6g}"]
        else:
            row += ["-", "-"]
        known = (evaluation.floors[name].get(metric) for name in floors)
        rows.append([*row, *("-" if raw is None else f"{evaluation.printed(metric, raw):.4g}" for raw in known)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [f"{evaluation.protocol}: {title}"]
    lines += [f"{side}: {facts['points']:,} points, {facts['origin']}" for side, facts in evaluation.samples.items()]
    for row in rows:
        texts = [text.ljust(width) for text, width in zip(row[:2], widths[:2], strict=True)]
        numbers = [text.rjust(width) for text, width in zip(row[2:], widths[2:], strict=True)]
        lines.append("  ".join(texts + numbers).rstrip())
    lines += [f"{', '.join(names)}: blank, {reason}" for reason, names in _by_reason(evaluation.blanks).items()]
    absent = {_FLOORS[name]: reason for name, reason in evaluation.floor_blanks.items()}
    lines += [f"floor {', '.join(names)}: none, {reason}" for reason, names in _by_reason(absent).items()]
    return "\n".join(lines + [f"note: {note}" for note in evaluation.notes])


def _factor(factor: float) -> str:
    return "" if factor == 1 else f"x {factor:,.0f}"


def _by_reason(blanks: dict[str, str]) -> dict[str, list[str]]:
    """Return reason -> names, so that each reason is said once."""
    reasons: dict[str, list[str]] = {}
    for name, reason in blanks.items():
        reasons.setdefault(reason, []).append(name)
    return reasons


def _points(shape: Any) -> Any:
    return shape.points if hasattr(shape, "attributes") else shape.vertices
