"""Figures at tiny sizes: a picture is written and is not blank; what it shows is measured against known values."""

import matplotlib.image
import numpy as np
import pytest

from n2n.errors import ConfigError
from n2n.geometry.noise import NOISE_MODELS
from n2n.report.figures import FIGURES, draw_figure, find
from n2n.report.figures.errors import point_errors, summary, surface_errors, upper
from n2n.report.figures.request import Request, Subject, read_request
from n2n.report.figures.slices import Slice
from n2n.report.figures.style import ERROR, Panel, Scale, gallery, save

TINY = ["shape=sphere", "points=400", "size=80", "resolution=24", "iterations=2", "plan_reuse=1"]


def picture(path):
    return matplotlib.image.imread(path)[..., :3]


def is_drawn(image):
    """Tell whether there is more than paper: every third of the picture has ink of several colours."""
    thirds = np.array_split(image, 3, axis=1)
    return all(len(np.unique(part.reshape(-1, 3).round(2), axis=0)) > 20 for part in thirds)


@pytest.mark.parametrize("name", [name for name in FIGURES if name not in ("noise_types", "large_noise")])
def test_every_figure_is_drawn(tmp_path, name):
    path = tmp_path / "figure.png"
    draw_figure(name, path, TINY)
    assert is_drawn(picture(path))
    assert [file.name for file in tmp_path.iterdir()] == ["figure.png"]


def test_both_distances_are_fitted_without_and_with_the_regulariser(tmp_path, monkeypatch):
    fitted, fit = [], Request.fit

    def told(self, subject, label="", *settings):
        config = self.config(*settings)
        weight = config["regulariser_weight"] if config["regulariser"]["name"] == "consistency" else 0
        fitted.append((config["distance"]["name"], weight))
        return fit(self, subject, label, *settings)

    monkeypatch.setattr(Request, "fit", told)
    draw_figure("distances", tmp_path / "figure.png", TINY)
    assert fitted == [("cd", 0), ("cd", 0.1), ("emd", 0), ("emd", 0.1)]
    # Five columns of two rows and a colour bar.
    assert picture(tmp_path / "figure.png").shape[1] > 5 * 80


def test_figures_of_noise_fit_each_kind(tmp_path, monkeypatch):
    monkeypatch.setattr("n2n.report.figures.noise.NOISE_MODELS", {k: NOISE_MODELS[k] for k in ("uniform", "range")})
    monkeypatch.setattr("n2n.report.figures.noise._AMOUNTS", (0.02, 0.1))
    for name in ("noise_types", "large_noise"):
        draw_figure(name, tmp_path / f"{name}.png", TINY)
        assert is_drawn(picture(tmp_path / f"{name}.png"))


def test_a_scan_of_ones_own_needs_no_truth(tmp_path):
    random = np.random.default_rng(0)
    points = random.normal(size=(600, 3))
    points = points / np.linalg.norm(points, axis=1, keepdims=True) + 0.01 * random.normal(size=points.shape)
    np.savetxt(tmp_path / "scan.xyz", points)
    settings = [f"scan={tmp_path / 'scan.xyz'}", *TINY[2:]]
    for name in ("denoising", "reconstruction", "level_sets", "distances"):
        draw_figure(name, tmp_path / f"{name}.png", settings)
        assert is_drawn(picture(tmp_path / f"{name}.png"))


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("denoising", ["noise"], "cannot read the setting 'noise'; write key=value"),
        ("denoising", ["noise=lots"], "noise=lots is not a number"),
        ("denoising", ["noise=2"], "noise=2 is out of range"),
        ("denoising", ["points=3"], "points=3 is out of range; give 100 or more"),
        ("denoising", ["points=1.5"], "points=1.5 is not a whole number"),
        ("denoising", ["seed=-1"], "seed=-1 is out of range"),
        ("denoising", ["shape=spere"], "Did you mean 'sphere'"),
        ("denoising", ["iteratoins=5"], "Did you mean 'iterations'"),
        ("denoising", ["scan=a.ply", "shape=sphere"], "shape=sphere has no effect on scan=a.ply"),
        ("denoising", ["scan=a.ply", "noise=0.1"], "noise=0.1 has no effect on scan=a.ply"),
        ("noise_types", ["scan=a.ply"], "noise_types adds noise to a clean shape"),
        ("optimisation", ["shape=sphere", "distance=cd"], "distance=cd matches no single target"),
    ],
)
def test_settings_that_cannot_be_used(tmp_path, name, settings, message):
    with pytest.raises(ConfigError, match=message):
        draw_figure(name, tmp_path / "figure.png", settings)
    assert not list(tmp_path.iterdir())


def test_an_unknown_figure_names_the_nearest():
    with pytest.raises(ConfigError, match="Did you mean 'level_sets'"):
        find("levelsets")


def test_a_figures_defaults_give_way_to_settings():
    figure = FIGURES["optimisation"]
    assert read_request("optimisation", figure, []).noise == 0.03
    chosen = read_request("optimisation", figure, ["noise=0.01", "effort=2"])
    assert (chosen.noise, chosen.shape, chosen.overrides) == (0.01, "torus", ("effort=2",))


def cube():
    """Return the cube of side 2 around the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])


def test_errors_are_distances_to_the_true_surface():
    subject = Subject("cube", "mm", np.zeros((1, 3)), *cube())
    points = np.array([[0.0, 0, 1.25], [0.5, 0, 0], [4, 5, 1], [1, 1, 1]])
    expected = [0.25, 0.5, 5.0, 0.0]
    assert point_errors(points, subject, None) == pytest.approx(expected)
    assert surface_errors(points, subject) == pytest.approx(expected)
    assert subject.radius == pytest.approx(np.sqrt(3))


def test_without_a_truth_a_surface_is_measured_against_the_scan():
    subject = Subject("scan", "units of the scan", np.array([[0.0, 0, 0], [10, 0, 0]]))
    assert surface_errors(np.array([[3.0, 4, 0], [10, 0, 2]]), subject) == pytest.approx([5, 2])


def test_summary_and_end_of_scale():
    subject = Subject("x", "mm", np.zeros((1, 3)))
    assert summary(np.array([3.0, 4.0] * 50), subject) == "rms 3.54 mm,  95 % below 4 mm"
    errors = np.concatenate([np.full(990, 0.0123), np.full(10, 99.0)])
    assert upper(errors) == pytest.approx(0.013)


def test_a_cut_through_a_cube_is_its_outline():
    vertices, faces = cube()
    cut = Slice.through(vertices, axis=1)
    segments = cut.cut(vertices, faces)
    assert np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum() == pytest.approx(8)
    assert np.abs(segments).max(axis=2) == pytest.approx(1.0)


def test_a_cut_samples_the_field_where_it_says():
    class Plain:
        def sdf_at(self, points):
            return points @ [1.0, 10.0, 100.0]

    cut = Slice(1, 0.5, np.array([0.0, -1.0]), np.array([4.0, 1.0]))
    x, y, values = cut.values(Plain(), 5)
    assert (cut.aspect, len(x), len(y)) == (2.0, 5, 2)
    assert values == pytest.approx(x + 5 + 100 * y[:, None])
    assert cut.near(np.array([[0, 0.4, 0], [0, 0.7, 0]]), 0.15).tolist() == [True, False]


def test_colours_mean_what_the_bar_says(tmp_path):
    scale = Scale(2.0, "error  [mm]")
    assert scale(np.array([0.0, 1.0, 2.0, 9.0])) == pytest.approx(ERROR(np.array([0.0, 0.5, 1.0, 1.0]))[:, :3])
    image = np.full((60, 90, 3), 200, np.uint8)
    figure = gallery([[Panel(image, "below"), None]], ["first", "second"], ["side"], scale)
    save(tmp_path / "a.png", figure)
    drawn = (255 * picture(tmp_path / "a.png")).round()
    # The picture is shown pixel by pixel.
    assert (drawn == 200).all(axis=2).sum() == pytest.approx(60 * 90, rel=0.02)
    bar = figure.axes[-1]
    assert bar.get_ylabel() == "error  [mm]"
    assert bar.get_ylim() == (0, 2)
