"""`n2n figure`: from the command line to a picture."""

import matplotlib.image
import numpy as np
import pytest

from n2n.cli.main import main
from n2n.report.figures import FIGURES

QUICK = ["shape=bracket", "points=1500", "size=120", "resolution=32", "debug=default"]


def test_a_figure_is_drawn_into_a_new_folder(tmp_path, capsys):
    path = tmp_path / "pictures" / "denoising.png"
    assert main(["figure", "denoising", *QUICK, "-o", str(path)]) == 0
    image = matplotlib.image.imread(path)[..., :3]
    assert image.shape[1] > 2 * 120
    assert len(np.unique(image.reshape(-1, 3).round(1), axis=0)) > 50
    told = capsys.readouterr()
    assert "fitting ..." in told.err and f"figure denoising -> {path}" in told.err.replace("\n", "")
    assert told.out == ""


def test_list_names_every_figure(capsys):
    assert main(["figure", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(FIGURES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["denoisin", "-o", "a.png"], "Unknown figure 'denoisin'. Did you mean 'denoising'?"),
        (["denoising"], "give one with -o denoising.png"),
        (["denoising", "-o", "a.jpg"], "choose one of: .png"),
        (["denoising", "-o", "a.png", "shape=cube"], "unknown shape 'cube'"),
        (["denoising", "-o", "new/a.png", "iteration=3"], "Did you mean 'iterations'"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert main(["figure", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())
