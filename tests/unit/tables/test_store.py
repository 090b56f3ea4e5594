"""Results on disk: whole or absent, damaged ones named, and what decides whether they still hold."""

import pytest

from n2n.compose import conf_dir
from n2n.errors import OutputError
from n2n.tables import store as module
from n2n.tables.spec import Fit
from n2n.tables.store import Store, deciding, lacking, protocol_hash, sources

FIT = Fit("n2n", "shapenet", "chair/1006be65", ("a=1",))
DONE = {"status": "done", "results": {}, "cost": {}, "made": {"sources": "now"}}


def test_one_file_per_fit(tmp_path):
    store = Store(tmp_path / "deep" / "results")
    assert store.read(FIT) is None
    store.write(FIT, DONE)
    (file,) = (path for path in tmp_path.rglob("*") if path.is_file())
    assert file == tmp_path / "deep" / "results" / "shapenet" / f"chair_1006be65-{FIT.id}.json" == store.path(FIT)
    assert store.read(FIT) == DONE
    assert store.read(Fit("n2n", "shapenet", "chair/1006be65", ("a=2",))) is None


RESULT = '{"definition": "", "asked": [], "values": {}, "floors": {}}'


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('{"status": "do', "cannot be read ("),
        ("", "cannot be read ("),
        ("\udcff", "cannot be read ("),
        ("[]", "holds no record"),
        ("{}", "has no known status"),
        ('{"status": ["done"]}', "has no known status"),
        ('{"status": "damaged", "error": "x"}', "has no known status"),
        ('{"status": "done", "results": {}, "cost": {}}', "lacks made"),
        ('{"status": "done", "results": 3, "cost": {}, "made": {"sources": ""}}', "lacks results"),
        ('{"status": "done", "results": {}, "cost": {}, "made": {}}', "does not say which sources made it"),
        (f'{{"status": "done", "results": {{"a/b": {RESULT}}}, "cost": {{}}, "made": {{}}}}', "lacks blanks of a/b"),
        ('{"status": "done", "results": {"a/b": 1}, "cost": {}, "made": {}}', "lacks definition of a/b"),
        ('{"status": "failed"}', "lacks error"),
    ],
)
def test_a_damaged_file_is_a_record_that_names_it_in_one_line(tmp_path, text, what):
    store = Store(tmp_path)
    store.write(FIT, DONE)
    store.path(FIT).write_text(text, encoding="utf-8", errors="surrogateescape")
    record = store.read(FIT)
    assert record["status"] == "damaged" and record["id"] == FIT.id
    assert record["error"].startswith(f"{store.path(FIT)}: {what}") and "\n" not in record["error"]
    assert lacking(record, {"": set()}, {}) == {""}
    store.write(FIT, DONE)
    assert store.read(FIT) == DONE


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot make this folder"):
        Store(tmp_path / "file").write(FIT, DONE)


def test_a_result_that_cannot_be_written_leaves_the_old_one(tmp_path):
    store = Store(tmp_path)
    store.write(FIT, DONE)
    with pytest.raises(TypeError):
        store.write(FIT, {"status": object()})
    assert store.read(FIT) == DONE and len(list(tmp_path.rglob("*.*"))) == 1


def test_what_a_record_lacks():
    held = {"definition": "old", "asked": ["oracle"]}
    record = {"status": "done", "results": {"denoise/sbp": held, "reconstruct/onet": held}}
    protocols = {"denoise/sbp": "old", "reconstruct/onet": "old", "upsample/sbp": "old"}
    both = {"denoise/sbp": set(), "reconstruct/onet": {"oracle"}}
    assert lacking(record, both, protocols) == set()
    assert lacking(record, {**both, "upsample/sbp": set()}, protocols) == {"upsample/sbp"}
    assert lacking(record, {"denoise/sbp": {"do_nothing"}}, protocols) == {"denoise/sbp"}
    assert lacking(record, both, {**protocols, "denoise/sbp": "new"}) == {"denoise/sbp"}
    assert lacking(record, {"": set()}, protocols) == set()
    assert lacking(None, both, protocols) == lacking({"status": "failed"}, both, protocols) == set(both)


def test_a_protocol_is_named_by_its_definition(monkeypatch):
    spec = {"name": "sbp", "seed": 0}
    monkeypatch.setattr(module, "load_option", lambda group, name: spec)
    first = protocol_hash.__wrapped__("sbp")
    assert first == protocol_hash.__wrapped__("sbp") and len(first) == 10
    monkeypatch.setattr(module, "load_option", lambda group, name: {**spec, "seed": 1})
    assert protocol_hash.__wrapped__("sbp") != first


CODE = '"""A module."""\n\n\ndef twice(x):\n    """Double."""\n    return 2 * x\n'


@pytest.fixture
def of(tmp_path, monkeypatch):
    """Return a function that tells the hash of sources which consist of one file."""

    def named(text, name="a.py"):
        (tmp_path / name).write_text(text)
        monkeypatch.setattr(module, "deciding", lambda: [tmp_path / name])
        return sources.__wrapped__()

    return named


@pytest.mark.parametrize(
    "same",
    [
        CODE.replace("A module.", "Another text."),
        CODE.replace("Double.", "Return two times x."),
        CODE.replace("    return 2 * x", "    # why not\n\n    return (2\n            * x)  # so"),
        "# a licence\n" + CODE,
    ],
)
def test_comments_documentation_and_layout_leave_results_valid(of, same):
    assert of(same) == of(CODE)


@pytest.mark.parametrize(
    "other",
    [
        CODE.replace("2 * x", "2.0 * x"),
        CODE.replace("2 * x", "x * 2"),
        CODE.replace("twice", "double"),
        CODE + "LIMIT = 3\n",
        CODE.replace("return 2", 'print("text")\n    return 2'),
    ],
)
def test_code_does_not(of, other):
    assert of(other) != of(CODE)


def test_options_of_a_fit_decide_as_they_are_written(of):
    assert of("iterations: 160\n", "fast.yaml") != of("iterations: 161\n", "fast.yaml")


def test_what_decides_a_number():
    names = {path.as_posix() for path in deciding()}
    package = module.__file__.rpartition("/tables/")[0]
    inside = {f"{package}/fitting/fit.py", f"{package}/config.py", f"{package}/metrics/chamfer.py"}
    assert inside | {f"{conf_dir()}/recipe/fast.yaml", f"{conf_dir()}/datamodule/pu.yaml"} <= names
    outside = ("/tables/", "/cli/", "/report/", "conf/table/", "conf/profile/", "conf/protocol/", "conf/logger/")
    assert not [name for name in names if any(part in name for part in outside)]
    assert len(sources()) == 10 and int(sources(), 16) >= 0
