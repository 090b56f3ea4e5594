"""`n2n list`: what can be named in a configuration."""

from n2n.errors import ConfigError
from n2n.registry import ALL, suggest


def run_list(kind: str | None = None) -> int:
    """Print every registered component; nothing is imported but third-party ones."""
    kinds = [registry.kind for registry in ALL]
    if kind is not None and kind.rstrip("s") not in kinds:
        raise ConfigError(f"Unknown kind {kind!r}.{suggest(kind, kinds)}")
    for registry in ALL:
        if kind is not None and registry.kind != kind.rstrip("s"):
            continue
        print(f"{registry.kind}:")
        for name in registry.names():
            print(f"  {name:<20} {registry.describe(name)}")
    return 0
