"""Numbers as Markdown."""

from collections.abc import Iterable, Sequence


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table.

    >>> print(table(["a", "b"], [[1, "x"]]))
    | a | b |
    |---|---|
    | 1 | x |
    """
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("|" + "|".join(str(x) if x == "---" else f" {x} " for x in line) + "|" for line in lines)


def number(value: float) -> str:
    """Write three digits that mean something.

    >>> number(1234.5), number(12.345), number(0.012345)
    ('1234', '12.3', '0.0123')
    """
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def span(values: dict[str, float], unit: str = "") -> str:
    """Write median (smallest..largest), or what was measured once.

    >>> span({"median": 2.0, "min": 1.0, "max": 3.0}, " s")
    '2 s (1..3)'
    """
    if values["min"] == values["max"]:
        return f"{number(values['median'])}{unit}"
    return f"{number(values['median'])}{unit} ({number(values['min'])}..{number(values['max'])})"


def megabytes(size: float) -> str:
    """Write a size in MB."""
    return f"{size / 1e6:,.0f} MB"
