"""All tables of a plan as files, and an index that says what is there and what is not."""

from pathlib import Path

from n2n.formats import atomic_path
from n2n.formats.atomic import make_folder
from n2n.tables.fill import fill
from n2n.tables.plan import Plan
from n2n.tables.render import Rendered, render
from n2n.tables.store import Store


def write_tables(plan: Plan, store: Store, out: Path) -> dict[str, Rendered]:
    """Write `<table>.md`, `.tex` and `.csv` for each table asked for, and `index.md`; return them by name."""
    make_folder(out, "give another one with --out")
    made = {}
    for table in plan.tables:
        grid, paper = fill(table, plan, store)
        about = [
            f"Profile {plan.profile.name}: {plan.profile.title}.",
            *([f"Paper: {paper.dataset}; {paper.unit}."] if paper.dataset else []),
            *(f"Of the paper's table: {note}." for note in paper.notes),
        ]
        made[table.name] = render(f"{table.name}: {table.title}", about, grid)
        for suffix, text in (
            ("md", made[table.name].markdown),
            ("tex", made[table.name].latex),
            ("csv", made[table.name].csv),
        ):
            _write(out / f"{table.name}.{suffix}", text)
    _write(out / "index.md", _index(plan, store, made))
    return made


def _index(plan: Plan, store: Store, made: dict[str, Rendered]) -> str:
    lines = [
        f"# Tables, profile {plan.profile.name}",
        "",
        f"{plan.profile.title}. Our numbers stand beside the published ones. **Bold** in a row or column of the paper "
        "is the paper's mark; in one of ours it means that no other number for the same whole dataset is better. A "
        "dash carries its reason as a footnote.",
        "",
        "| table | | cells of ours | blank |",
        "|---|---|---:|---:|",
    ]
    for table in plan.tables:
        result = made[table.name]
        lines.append(f"| [{table.name}]({table.name}.md) | {table.title} | {result.ours} | {result.blank} |")
    lines += ["", *_origins(plan, store)]
    return "\n".join(lines) + "\n"


def _origins(plan: Plan, store: Store) -> list[str]:
    """Say by which commits and machines the results were made."""
    counts: dict[tuple[str, str], int] = {}
    for fit in plan.jobs:
        record = store.read(fit)
        if record is not None and record["status"] == "done":
            made = record["made"]
            key = (f"n2n {made['n2n']}, commit {made['commit']}, sources {made['sources']}", made["machine"])
            counts[key] = counts.get(key, 0) + 1
    return [f"- {count} fits by {version} on {machine}" for (version, machine), count in sorted(counts.items())]


def _write(path: Path, text: str) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
