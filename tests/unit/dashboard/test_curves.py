"""Curves of interrupted fits are joined; thinned ones keep their extremes."""

import numpy as np
import pytest

from n2n.dashboard.curves import read_curves, thin


def test_parts_of_an_interrupted_fit_are_one_curve(tmp_path):
    (tmp_path / "metrics.0.csv").write_text("loss,step\n9,10\n8,20\n7,30\n")
    (tmp_path / "metrics.1.csv").write_text("loss,step\n5,25\n4,35\n")
    (tmp_path / "metrics.csv").write_text("loss,step,noise\n3,40,\n,50,0.5\n")
    curves = read_curves(tmp_path, [])
    assert curves["loss"][0].tolist() == [10, 20, 25, 35, 40]
    assert curves["loss"][1].tolist() == [9, 8, 5, 4, 3]
    assert curves["noise"][0].tolist() == [50]


def test_ten_parts_are_in_the_order_of_their_numbers(tmp_path):
    for part in range(11):
        (tmp_path / f"metrics.{part}.csv").write_text(f"loss,step\n{part},{part}\n")
    assert read_curves(tmp_path, [])["loss"][1].tolist() == list(range(11))


@pytest.mark.parametrize(
    ("text", "left"),
    [("loss,step\n1,1\n2,", 1), ("loss,step\n1,1\n2", 1), ("loss,step\n", 0), ("", 0), ("loss,step\nnan,1\n2,2\n", 1)],
)
def test_half_a_line_is_left_out(tmp_path, text, left):
    (tmp_path / "metrics.csv").write_text(text)
    problems = []
    curves = read_curves(tmp_path, problems)
    assert len(curves.get("loss", [[]])[0]) == left and not problems


@pytest.mark.parametrize("text", ["loss,step\na,1\n", "loss\n1\n", "\x00\xff,\x01\n\x00,\x00\n"])
def test_damage_is_a_problem_that_is_told(tmp_path, text):
    (tmp_path / "metrics.csv").write_bytes(text.encode("latin-1"))
    problems = []
    assert read_curves(tmp_path, problems) == {}
    assert len(problems) == 1 and problems[0].startswith("metrics.csv")


@pytest.mark.parametrize("count", [8, 50, 299])
def test_thinned_curves_keep_ends_and_every_spike(count):
    steps, values = np.arange(10_000.0), np.sin(np.arange(10_000.0) / 700)
    values[[37, 5_000, 9_990]] = 50, -60, 70
    few_steps, few = thin(steps, values, count)
    assert len(few) <= count
    assert few_steps[0] == 0 and few_steps[-1] == 9_999
    assert few.max() == 70 and few.min() == -60
    assert (np.diff(few_steps) > 0).all()
    assert np.array_equal(values[few_steps.astype(int)], few)


def test_short_curves_are_left_alone():
    steps, values = thin(np.arange(5.0), np.ones(5), 8)
    assert len(steps) == len(values) == 5
