"""Names become components; every mistake is one line that says the fix."""

from importlib.metadata import EntryPoint

import pytest

from n2n import registry
from n2n.errors import ConfigError
from n2n.registry import Builtin, Registry


class Blur:
    """Smear by a radius.

    More text that no listing shows.
    """

    def __init__(self, radius: float, steps: int = 3) -> None:
        self.radius, self.steps = radius, steps


class Plain:
    """Take nothing."""


class Open:
    def __init__(self, **anything) -> None:
        self.anything = anything


@pytest.fixture
def tools(monkeypatch):
    """A registry with two built-in components, a good plugin and two broken ones."""
    points = [
        EntryPoint("extra", f"{__name__}:Blur", "n2n.tools"),
        EntryPoint("rotten", "n2n_no_such_module:Thing", "n2n.tools"),
        EntryPoint("hollow", f"{__name__}:NoSuchClass", "n2n.tools"),
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == "n2n.tools" else [])
    table = {"blur": Builtin(f"{__name__}:Blur", "smear"), "plain": Builtin(f"{__name__}:Plain", "nothing")}
    return Registry("tool", "n2n.tools", table)


def test_names_come_from_the_table_plugins_and_notebooks(tools):
    tools.register("mine")(Open)
    assert tools.names() == ["blur", "extra", "hollow", "mine", "plain", "rotten"]
    assert tools.plugin_names() == ["extra", "hollow", "rotten"]


def test_names_import_nothing():
    lazy = Registry("tool", "n2n.tools", {"ghost": Builtin("n2n_no_such_module:Ghost", "not there")})
    assert lazy.names() == ["ghost"]
    assert lazy.describe("ghost") == "not there"


def test_build_passes_the_arguments(tools):
    blur = tools.build({"name": "blur", "radius": 2.0})
    assert (blur.radius, blur.steps) == (2.0, 3)
    assert isinstance(tools.build("plain"), Plain)
    assert tools.build({"name": "extra", "radius": 1}).radius == 1


def test_defaults_of_the_caller_fill_gaps_only_where_they_are_accepted(tools):
    assert tools.build({"name": "blur"}, radius=5, unknown=1).radius == 5
    assert tools.build({"name": "blur", "radius": 2}, radius=5).radius == 2
    assert isinstance(tools.build("plain", radius=5), Plain)


def test_open_ended_components_take_everything(tools):
    tools.register("open")(Open)
    assert tools.build({"name": "open", "a": 1}, b=2).anything == {"a": 1, "b": 2}


def test_a_spec_is_not_changed(tools):
    spec = {"name": "blur", "radius": 2.0}
    tools.build(spec, steps=7)
    assert spec == {"name": "blur", "radius": 2.0}


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("blurr", "Unknown tool 'blurr'. Did you mean 'blur'? Known: blur, extra, hollow, plain, rotten."),
        ("zzz", "Unknown tool 'zzz'. Known: blur, extra, hollow, plain, rotten."),
        (
            {"name": "blur", "radius": 1, "stepz": 2},
            "tool 'blur' has no argument 'stepz'. Did you mean 'steps'? Known: radius, steps.",
        ),
        ({"name": "plain", "radius": 1}, "tool 'plain' has no argument 'radius'. It takes none."),
        ({"name": "blur"}, "tool 'blur' needs radius; give it as tool.radius=..."),
        ({"radius": 1}, "a tool needs a name. Known: blur, extra, hollow, plain, rotten."),
        ({"name": None}, "a tool needs a name. Known: blur, extra, hollow, plain, rotten."),
    ],
)
def test_mistakes_are_told_before_anything_is_built(tools, spec, message):
    for attempt in (tools.build, tools.check):
        with pytest.raises(ConfigError) as caught:
            attempt(spec)
        assert str(caught.value) == message


def test_check_knows_what_the_caller_will_give(tools):
    tools.check("blur", "radius")
    with pytest.raises(ConfigError, match=r"has no argument 'stepz'. Did you mean 'steps'\? Known: steps."):
        tools.check({"name": "blur", "stepz": 1}, "radius")


def test_broken_plugins_are_listed_with_the_reason(tools):
    assert tools.describe("extra") == "Smear by a radius."
    assert "broken" in tools.describe("rotten") and "n2n_no_such_module" in tools.describe("rotten")
    assert "broken" in tools.describe("hollow") and "NoSuchClass" in tools.describe("hollow")
    with pytest.raises(ConfigError, match="reinstall or remove it"):
        tools.get("rotten")
    assert tools.get("blur") is tools.get("extra")


def test_registering_in_a_notebook_wins(tools):
    @tools.register("blur")
    class Sharper:
        """Sharpen instead."""

    assert isinstance(tools.build("blur"), Sharper)
    assert tools.describe("blur") == "Sharpen instead."


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in registry.ALL for name in kind.names()])
def test_every_registered_component_is_there_and_says_what_it_does(kind, name):
    component = kind.get(name)
    assert callable(component)
    summary = kind.describe(name)
    assert summary and "\n" not in summary and len(summary) < 80 and "broken" not in summary


def test_groups_folders_and_entry_points_agree():
    plural = {"regulariser": "regularisers", "distance": "distances", "architecture": "architectures"}
    for kind in registry.ALL:
        assert kind.group == f"n2n.{plural.get(kind.kind, kind.kind + 's')}"
