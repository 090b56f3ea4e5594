"""Every section of `make bench` runs, at toy sizes, and gives numbers that can be; how large they are is not tested."""

import contextlib
import math
import sys
import time

import pytest
import torch

from benchmarks import __main__ as command
from benchmarks import extraction, job, matching, reference, scaling, section, sweep
from benchmarks.processes import measure
from benchmarks.traffic import Traffic
from n2n.sweeps.status import Status
from n2n.sweeps.store import Sweep

# A process of its own for every measurement costs seconds; here they share this one.
CHILDREN = {
    "matching": matching.plan,
    "extraction": extraction.once,
    "reference": lambda repeats: {"seconds": reference.workload(repeats)},
}
MAY_BE_ZERO = {"disagreement", "extra", "largest", "ratio_of_blocks", "room", "pictures", "scenes"}


def done_sweep(folder, arguments, threads):
    """Leave what a sweep of two runs leaves, without fitting."""
    measure([sys.executable, "-S", "-c", "sum(range(3_000_000))"])
    planned = {"a": ["seed=0"], "b": ["seed=1"]}
    with contextlib.chdir(folder):
        made = Sweep.plan("bench", list(arguments), {"seed": ["0", "1"]}, planned)
    for number, (name, settings) in enumerate(planned.items()):
        run = folder / made.run_dir(name)
        run.mkdir(parents=True)
        time.sleep(0.1)
        (run / "field.ckpt").touch()
        (run / "summary.json").write_text('{"seconds": 0.02}')
        Status("done", 1, "here", number, "", settings, None, "", seconds=0.03).write(run)


@pytest.fixture
def one_process(monkeypatch):
    for module in (matching, extraction, job):
        monkeypatch.setattr(module, "child", lambda name, *arguments: CHILDREN[name](*arguments))
    monkeypatch.setattr(sweep, "launch", done_sweep)
    for module in (job, scaling):
        monkeypatch.setattr(module, "n2n", lambda *arguments: measure([sys.executable, "-S", "-c", "pass"]))


def numbers(data, name=""):
    if isinstance(data, dict):
        return [found for key, value in data.items() for found in numbers(value, key)]
    if isinstance(data, list):
        return [found for value in data for found in numbers(value, name)]
    return [(name, data)] if isinstance(data, int | float) and not isinstance(data, bool) else []


@pytest.mark.parametrize("name", section.NAMES)
def test_sections_give_finite_positive_numbers(one_process, name):
    result = section.measure(name, trial=True)["result"]
    found = numbers({key: value for key, value in result.items() if key != "baseline"})
    assert len(found) > 2
    for where, value in found:
        assert math.isfinite(value) and (value > 0 or where in MAY_BE_ZERO), (where, value)


def test_a_section_without_its_device_is_one_line(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    gpu = section.module("gpu")
    assert gpu.render(gpu.run()) == "Skipped: no CUDA device."


def test_peak_memory_is_that_of_the_command_alone():
    usage = measure([sys.executable, "-S", "-c", "x = b'1' * 50_000_000; print(len(x))"])
    assert usage.output == "50000000\n"
    assert 50e6 < usage.peak < 100e6  # this process, with torch, has more


def test_a_command_that_fails_is_no_result():
    with pytest.raises(RuntimeError, match=r"code 3.*sorry"):
        measure([sys.executable, "-c", "import sys; print('sorry', file=sys.stderr); sys.exit(3)"])


def test_traffic_counts_products_and_what_gathers_touch():
    a, b, table, index = torch.ones(8, 16), torch.ones(16, 4), torch.ones(10_000), torch.arange(10)
    with Traffic() as traffic:
        a @ b
        table[index]
        a.view(-1)
    assert traffic.operations == 2
    assert traffic.flops == 2 * 8 * 16 * 4 + 10
    assert traffic.bytes == 4 * (8 * 16 + 16 * 4 + 8 * 4) + 10 * (4 + 8 + 4)


def test_results_are_kept_and_reported(one_process, monkeypatch, tmp_path, capsys):
    def measured(arguments, **_):
        section.write(arguments[3], arguments[4], trial=True)
        return type("Done", (), {"returncode": 0})

    monkeypatch.setattr(command.subprocess, "run", measured)
    monkeypatch.setattr(command, "DOCS", tmp_path / "benchmarks.md")
    monkeypatch.setattr(command.machine, "commit", lambda: "0123456")
    assert command.main(["matching", "--trial", "--out", str(tmp_path)]) == 0
    assert "## Matching" in capsys.readouterr().out
    monkeypatch.setattr(command.subprocess, "run", None)  # measured already
    assert command.main(["matching", "--trial", "--out", str(tmp_path)]) == 0
    assert command.main(["--docs", "--trial", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "benchmarks.md").read_text()
    assert "## Matching" in text and "0123456" in text


def test_the_ratios_of_a_release_are_kept_and_compared(monkeypatch, tmp_path):
    monkeypatch.setattr(job, "BASELINE", tmp_path / "baseline.json")
    one = {"median": 4.0, "min": 4.0, "max": 4.0}
    tasks = {"denoise": {"seconds": one, "reference": one, "ratio": one, "peak": 10**9}}
    job.record({"machine": {"cpu": "x"}, "result": {"tasks": tasks}}, "1.0")
    baseline = job.json.loads(job.BASELINE.read_text())
    tasks["denoise"]["ratio"] = {"median": 3.0, "min": 3.0, "max": 3.0}
    text = job.render({"points": 10, "tasks": tasks, "baseline": baseline})
    assert "release 1.0" in text and "-25 %" in text
