"""What has been measured: one small JSON file per fit."""

import ast
import functools
import hashlib
import json
from collections.abc import Mapping, Set
from pathlib import Path
from typing import Any

from n2n.compose import conf_dir, config_hash
from n2n.evaluation.options import load_option
from n2n.formats import atomic_path
from n2n.formats.atomic import make_folder
from n2n.tables.spec import Fit

# What decides a number. Data is known by its content, which the hash of the configuration holds; tables, pictures and
# commands change no number.
_DECIDING = (
    "architectures", "baselines", "evaluation", "fitting", "geometry", "losses", "metrics", "tasks",
    "transport", "config.py",
)  # fmt: skip
_NOT_DECIDING = {"table", "profile", "protocol", "logger", "experiment", "debug", "hydra"}

# What a record of each status must hold.
_NEEDED: dict[str, dict[str, type]] = {"done": {"results": dict, "cost": dict, "made": dict}, "failed": {"error": str}}
_IN_RESULT = {"definition": str, "asked": list, "values": dict, "floors": dict, "blanks": dict}


class Store:
    """Results under a folder: `<datamodule>/<shape>-<id>.json`.

    Args:
        folder: Made when the first result is kept.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def path(self, fit: Fit) -> Path:
        """Return where the result of a fit is kept."""
        return self.folder / fit.datamodule / f"{fit.shape.replace('/', '_')}-{fit.id}.json"

    def read(self, fit: Fit) -> dict[str, Any] | None:
        """Return the result of a fit; None if there is none.

        One that cannot be read is a record of status `damaged` and an error that names the file: it holds no number,
        and is measured again like any other that is not there.
        """
        path = self.path(fit)
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
            why = _unfit(record)
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            why = f"cannot be read ({error})"
        return fit.damaged(f"{path}: {why}") if why else record

    def write(self, fit: Fit, record: dict[str, Any]) -> None:
        """Keep a result, whole or not at all.

        Raises:
            OutputError: The folder cannot be written.
        """
        path = self.path(fit)
        make_folder(path.parent, "choose another --results")
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(record, indent=1, default=float) + "\n", encoding="utf-8")


def _unfit(record: Any) -> str:
    """Say what a record lacks; empty where it is whole."""
    if not isinstance(record, dict):
        return "holds no record"
    if record.get("status") not in tuple(_NEEDED):
        return "has no known status"
    for key, kind in _NEEDED[record["status"]].items():
        if not isinstance(record.get(key), kind):
            return f"lacks {key}"
    if record["status"] != "done":
        return ""
    for name, result in record["results"].items():
        for key, kind in _IN_RESULT.items():
            if not isinstance(result, dict) or not isinstance(result.get(key), kind):
                return f"lacks {key} of {name}"
    return "" if "sources" in record["made"] else "does not say which sources made it"


def lacking(
    record: dict[str, Any] | None, evaluations: Mapping[str, Set[str]], protocols: Mapping[str, str]
) -> set[str]:
    """Return the evaluations a record does not hold, or holds by another definition of the protocol.

    Args:
        record: As stored, or None.
        evaluations: `task/protocol` and the floors wanted with it; empty text: only that the fit ended.
        protocols: Content hash of each protocol's definition.
    """
    if record is None or record["status"] != "done":
        return set(evaluations)
    return {e for e, floors in evaluations.items() if e and not _holds(record["results"].get(e), floors, protocols[e])}


def _holds(result: dict[str, Any] | None, floors: Set[str], definition: str) -> bool:
    """Tell whether a result is what is wanted now; one that was blank for want of a truth is asked for again."""
    if result is None or "blank" in result:
        return False
    return result["definition"] == definition and floors <= set(result["asked"])


@functools.cache
def protocol_hash(name: str) -> str:
    """Return 10 hex digits of a protocol's definition."""
    return config_hash(load_option("protocol", name))


@functools.cache
def sources() -> str:
    """Return 10 hex digits of all source files that decide a number: results of others may differ."""
    digest = hashlib.sha256()
    for path in deciding():
        digest.update(path.name.encode() + b"\0" + _meaning(path).encode())
    return digest.hexdigest()[:10]


def deciding() -> list[Path]:
    """Return the files that decide a number."""
    package, conf = Path(__file__).parent.parent, conf_dir()
    python = [path for name in _DECIDING for path in sorted(_python(package / name))]
    options = [path for path in sorted(conf.rglob("*.yaml")) if path.relative_to(conf).parts[0] not in _NOT_DECIDING]
    return python + options


def _meaning(path: Path) -> str:
    """Return what a file does: comments, documentation and layout of Python code decide no number."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return text
    tree = ast.parse(text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if (
            isinstance(body, list)
            and body
            and isinstance(body[0], ast.Expr)
            and isinstance(body[0].value, ast.Constant)
        ):
            body[0].value.value = ""
    return ast.dump(tree)


def _python(path: Path) -> list[Path]:
    return [path] if path.is_file() else list(path.rglob("*.py"))
