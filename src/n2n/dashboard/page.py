"""One self-contained HTML page: styles, scripts and data inside, nothing loaded from anywhere."""

import base64
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from n2n.dashboard.data import page_data
from n2n.dashboard.run import Run
from n2n.formats import atomic_path

MEDIA_MEGABYTES = 12.0
_WEB = Path(__file__).parent / "web"
# In the order in which they build on each other.
_SCRIPTS = (
    "dom", "format", "store", "scale", "chart", "lines", "scatter", "parallel", "table", "overview", "runs", "shapes",
    "health", "camera", "webgl", "flat", "scene", "gallery", "run", "main",
)  # fmt: skip


def write_page(runs: Sequence[Run], path: Path, media_megabytes: float = MEDIA_MEGABYTES) -> dict[str, Any]:
    """Write a dashboard of runs; return the data that is in it.

    Args:
        runs: To be shown.
        path: Of the HTML file.
        media_megabytes: Most that pictures and 3D views may take.

    Raises:
        OutputError: It cannot be written.
    """
    data = page_data(runs, int(media_megabytes * 1e6))
    with atomic_path(path) as temporary:
        temporary.write_text(render(data), encoding="utf-8")
    return data


def render(data: dict[str, Any]) -> str:
    """Return the page that shows data.

    Text of runs (settings, errors) is data for the script, which never reads it as HTML; the policy in the page's head
    lets no other script run and nothing be loaded, whatever that text says.
    """
    style = _text("style.css")
    script = '"use strict";\n(() => {\n' + "\n".join(_text(f"{name}.js") for name in _SCRIPTS) + "\n})();\n"
    # "</script>" or "<!--" within a text would end the data.
    content = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    policy = f"default-src 'none'; img-src data:; style-src {_hash(style)}; script-src {_hash(script)}"
    parts = {"POLICY": policy, "STYLE": style, "SCRIPT": script, "DATA": content}
    page = _text("page.html")
    head, *rest = page.split("{{")
    return head + "".join(parts[name] + after for name, after in (part.split("}}", 1) for part in rest))


def _text(name: str) -> str:
    return (_WEB / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
