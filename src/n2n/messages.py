"""Hydra's and OmegaConf's complaints in one line that says what to change."""

import os
import re
import traceback
from dataclasses import asdict
from pathlib import Path
from typing import Any

from n2n.config import Config
from n2n.errors import ConfigError
from n2n.registry import suggest

_PACKAGE = Path(__file__).parent


def explain(error: BaseException) -> str:
    """Reduce a Hydra or OmegaConf error to one line: got, expected, fix."""
    chain = [error]
    while (cause := chain[-1].__cause__ or chain[-1].__context__) is not None and cause not in chain:
        chain.append(cause)
    for link in chain:
        if isinstance(link, ConfigError):
            return str(link)
    texts = [" ".join(str(link).split()) for link in chain]
    return (
        _several(texts)
        or _option(chain)
        or _syntax(chain)
        or _missing(texts)
        or _key(texts)
        or _type(texts)
        or texts[0]
    )


def _several(texts: list[str]) -> str | None:
    """A sweep where one value is needed."""
    several = re.match(r"Ambiguous value for argument '(.*?)' 1\.", texts[0])
    return several and (
        f"{several.group(1)!r} gives several values where one is needed; quote commas and write lists as key=[a,b]; "
        "`n2n fit -m` fits with each value in turn"
    )


def _option(chain: list[BaseException]) -> str | None:
    """An option that no folder of conf/ holds, e.g. distance=emdd."""
    for link in chain:
        path, options = getattr(link, "missing_cfg_file", None), getattr(link, "options", None)
        if path and options is not None:
            group, _, option = str(path).removeprefix("/").rpartition("/")
            return f"Unknown {group} {option!r}.{suggest(option, list(options))}"
    text = " ".join(str(chain[0]).split())
    group = re.search(r"(?:Could not override|No match in the defaults list for) '([\w/@]+)'", text)
    if group and "/" in group.group(1):
        return unknown_key(group.group(1))
    if text.startswith("Config group override must be a string or a list"):
        return "cannot read a setting: it chooses an option by something other than a name; write key=value"
    return None


def _syntax(chain: list[BaseException]) -> str | None:
    for link in chain:
        override = getattr(link, "override", None)
        if override is not None:
            return (
                f"cannot read the setting {override!r}; write key=value, and quote spaces and brackets: 'key=\"a b\"'"
            )
    return None


def _missing(texts: list[str]) -> str | None:
    for text in texts:
        if text.startswith("Missing mandatory value") and (key := re.search(r"full_key: ([\w.]+)", text)):
            return f"{key.group(1)} is not set; give it as {key.group(1)}=..."
    return None


def _key(texts: list[str]) -> str | None:
    for text in texts:
        key = re.search(r"(?:Could not override|Could not delete from config\.|Key) '([\w./]+)'", text)
        if key:
            full = re.search(r"full_key: ([\w.]+)", text)
            return unknown_key(full.group(1) if full else key.group(1))
    return None


def _type(texts: list[str]) -> str | None:
    override = re.search(r"Error merging override (\S+)", texts[0])
    reason = next((t for t in texts if t.startswith("Value ") or "could not be converted" in t), None)
    if reason is None:
        return f"cannot use the setting {override.group(1)}: it does not fit the key's type" if override else None
    reason = reason.split(" full_key")[0]
    return f"{override.group(1)}: {reason}" if override else reason


def unknown_key(name: str) -> str:
    """Return the message for a key that is not in the schema."""
    siblings: Any = asdict(Config())
    for part in name.split("."):
        known = list(siblings) if isinstance(siblings, dict) else []
        if part not in known:
            break
        siblings = siblings[part]
    return f"Unknown configuration key {name!r}.{suggest(part, known)}"


def unexpected(error: Exception) -> str:
    """Describe an error nobody foresaw: what, and the last place of ours that it passed.

    The environment variable N2N_TRACEBACK prints the rest, for whoever wants to mend it.
    """
    if os.environ.get("N2N_TRACEBACK"):
        traceback.print_exception(error)
    ours = [
        frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename).is_relative_to(_PACKAGE)
    ]
    where = f" at {Path(ours[-1].filename).relative_to(_PACKAGE)}:{ours[-1].lineno}" if ours else ""
    return f"{type(error).__name__}{where}: {error}; unforeseen, please report it with what N2N_TRACEBACK=1 prints"
