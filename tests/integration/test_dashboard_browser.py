"""The dashboard in a real browser: it draws, filters, sorts, brushes and turns, and talks to nobody."""

import shutil
from pathlib import Path

import pytest

from n2n.dashboard.page import write_page
from n2n.dashboard.sources import read_runs
from tests.unit.dashboard.conftest import write_sweep

playwright = pytest.importorskip("playwright.sync_api", reason="needs `pip install playwright`")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs a browser: apt install chromium")

HOSTILE = "</script><img src=x onerror=\"window.hacked=1\"><svg onload='window.hacked=1'>"
# WebGL without a graphics card.
WEBGL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
MISSING = "\u2013"
SIZES = {"desk": (1280, 800), "phone": (390, 844)}


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dashboard")
    runs = {
        f"aaaaaaaa{index}{seed}": {
            "settings": [f"regulariser_weight={weight}", f"seed={seed}"],
            "regulariser_weight": weight,
            "seed": seed,
            "cd": 1e-4 * (6 - index + 0.1 * seed),
            "media": index == 0,
        }
        for index, weight in enumerate((0.05, 0.1, 0.2))
        for seed in range(3)
    }
    runs["ffffffffff"] = {
        "settings": [f"experiment={HOSTILE}"],
        "state": "failed",
        "error": HOSTILE,
        "regulariser_weight": 0.02,
        "experiment": HOSTILE,
    }
    runs["eeeeeeeeee"] = {"settings": ["seed=7"], "state": "running", "seed": 7}
    runs["0000000000"] = None
    sweep = write_sweep(folder / HOSTILE.replace("/", "")[:20], runs)
    (sweep / "runs" / "aaaaaaaa22" / "evaluation.json").write_text("{")
    write_page(read_runs([str(sweep)]), folder / "page.html")
    return folder / "page.html"


@pytest.fixture(scope="module")
def browser(request, tmp_path_factory):
    has_webgl = getattr(request, "param", True)
    flags = ["--no-sandbox", "--disable-gpu", *(WEBGL if has_webgl else ["--disable-3d-apis"])]
    with playwright.sync_playwright() as engine:
        profile = tmp_path_factory.mktemp("profile")
        context = engine.chromium.launch_persistent_context(
            profile, executable_path=CHROMIUM, headless=True, args=flags
        )
        context.renderer = "webgl" if has_webgl else "flat"
        yield context
        context.close()


@pytest.fixture
def opened(browser, page_file):
    """A function that opens the page; whatever goes wrong meanwhile fails the test at its end."""
    wrong, pages = [], []

    def open_page(size="desk", route="", file=page_file):
        page = browser.new_page()
        pages.append(page)
        page.set_viewport_size(dict(zip(("width", "height"), SIZES[size], strict=True)))
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda sent: None if sent.url.startswith(("file:", "data:")) else wrong.append(sent.url))
        page.goto(file.as_uri() + route)
        page.wait_for_selector("main:visible")
        return page

    yield open_page
    hacked = [page.evaluate("window.hacked") for page in pages]
    for page in pages:
        page.close()
    assert not wrong and not any(hacked)


def expect_rows(page, count):
    playwright.expect(page.locator("#runs-table tbody tr")).to_have_count(count)


def column(page, index):
    return page.locator(f"#runs-table tbody td:nth-child({index})").all_inner_texts()


@pytest.mark.parametrize("size", SIZES)
def test_it_draws_everything_without_scrolling_sideways(opened, size):
    page = opened(size)
    expect_rows(page, 12)
    page.wait_for_selector("path.curve.paper")
    assert page.locator("path.thread").count() == 12
    assert page.locator("#section-training path.curve").count() >= 11  # loss and distance of what has begun
    assert page.locator("#section-health .failures li").count() == 2  # one failed, one is damaged
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert "12" in page.locator(".card-number").first.inner_text()
    cards = page.locator(".cards").inner_text()
    assert all(text in cards for text in ("9 done", "1 stale", "1 pending", "1 failed"))


def test_it_filters(opened):
    page = opened()
    page.fill("#filter", "regulariser_weight=0.1 seed<2")
    expect_rows(page, 2)
    playwright.expect(page.locator("path.thread.off")).to_have_count(10)
    assert page.locator(".tally").inner_text() == "2 of 12 runs"
    page.fill("#filter", "noise=0.03 distance=emd shape=duck denoise/sbp/cd_sum2<4.05e-4 validation>0.3")
    expect_rows(page, 1)
    page.fill("#filter", "state=failed")
    expect_rows(page, 1)
    page.fill("#filter", "nothing like this")
    expect_rows(page, 0)
    page.fill("#filter", "")
    expect_rows(page, 12)


def test_it_sorts_by_mouse_and_keyboard(opened):
    page = opened()
    heads = page.locator("#runs-table thead th").all_inner_texts()
    index = heads.index("denoise CD") + 1
    head = page.locator(f"#runs-table thead th:nth-child({index})")
    head.get_by_role("button").click()
    up = [text for text in column(page, index) if text != MISSING]
    assert head.get_attribute("aria-sort") == "ascending" and len(up) == 8
    values = [float(text.split(" ")[0]) for text in up]
    assert values == sorted(values)
    head.get_by_role("button").focus()
    page.keyboard.press("Enter")
    assert [text for text in column(page, index) if text != MISSING] == up[::-1]
    assert column(page, index)[-1] == MISSING  # missing values stay last


def test_brushing_an_axis_filters_the_page(opened):
    page = opened()
    page.locator("path.thread").first.scroll_into_view_if_needed()
    axis = page.locator('.brush-axis[data-axis="regulariser_weight"] .brush-hit')
    box = axis.bounding_box()
    x, top, bottom = box["x"] + box["width"] / 2, box["y"], box["y"] + box["height"]
    page.mouse.move(x, top + 2)
    page.mouse.down()
    page.mouse.move(x, (top + bottom) / 2 - 30, steps=4)
    page.mouse.up()
    expect_rows(page, 3)
    heads = page.locator("#runs-table thead th").all_inner_texts()
    assert set(column(page, heads.index("regulariser_weight") + 1)) == {"0.2"}
    page.get_by_role("button", name="Clear brushes").click()
    expect_rows(page, 12)


def once_changed(page, canvas, before):
    """Return what the canvas shows, once that is something else and stays: a busy machine draws late."""
    last = before
    for _ in range(100):
        page.wait_for_timeout(100)
        now = canvas.screenshot()
        if now == last != before:
            return now
        last = now
    raise AssertionError("the view stays as it is")


@pytest.mark.parametrize("browser", [True, False], ids=["webgl", "canvas"], indirect=True)
def test_a_run_has_a_page_and_its_3d_view_turns(opened, browser):
    page = opened()
    page.locator("#runs-table").get_by_role("link", name="aaaaaaaa00").click()
    page.wait_for_selector(".run-page")
    assert "regulariser_weight=0.05 seed=0" in page.locator(".run-head").inner_text()
    page.wait_for_selector(".run-page path.curve")  # drawn once the size of the page is known
    assert page.locator(".run-page path.curve").count() >= 2
    picture = page.locator("img.picture")
    page.wait_for_function("image => image.complete && image.naturalWidth > 0", arg=picture.element_handle())
    canvas = page.locator("canvas.scene")
    assert page.locator(".view").get_attribute("data-renderer") == browser.renderer
    page.wait_for_timeout(300)
    seen = [canvas.screenshot()]
    assert len(seen[0]) > 5_000  # more than an empty rectangle
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 320, box["y"] + 150, steps=5)
    page.mouse.up()
    seen.append(once_changed(page, canvas, seen[-1]))
    page.keyboard.press("ArrowUp")
    seen.append(once_changed(page, canvas, seen[-1]))
    page.mouse.wheel(0, -400)
    seen.append(once_changed(page, canvas, seen[-1]))
    page.get_by_label("mesh").uncheck()
    seen.append(once_changed(page, canvas, seen[-1]))
    assert len(set(seen)) == 5
    page.get_by_label("mesh").check()
    page.get_by_role("button", name="Reset view").click()
    page.mouse.move(0, 0)
    page.locator("h1").click()
    page.wait_for_selector("#runs-table:visible")


def test_only_one_3d_view_is_open(opened):
    page = opened()
    page.get_by_role("button", name="Open 3D view").click()
    page.wait_for_selector("#section-scenes canvas.scene")
    page.locator("#section-scenes select").select_option(index=1)
    assert page.locator("canvas.scene").count() == 1
    page.locator("a.thumb").first.click()
    page.wait_for_selector(".run-page canvas.scene")
    assert page.locator("canvas.scene").count() == 1
    page.go_back()
    page.get_by_role("button", name="Open 3D view").click()
    page.wait_for_selector("#section-scenes canvas.scene")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["aaaaaaaa00", "aaaaaaaa10", "aaaaaaaa22", "ffffffffff", "eeeeeeeeee", "0000000000"])
def test_every_kind_of_run_can_be_shown(opened, size, name):
    page = opened(size)
    page.evaluate(f"location.hash = document.querySelector('#runs-table a[title=\"{name}\"]').hash")
    page.wait_for_selector(".run-page")
    text = page.locator(".run-page").inner_text()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    told = {
        "ffffffffff": HOSTILE,
        "eeeeeeeeee": "No sign of life",
        "aaaaaaaa22": "evaluation.json",
        "aaaaaaaa10": "media=true",
    }
    assert told.get(name, "") in text
    page.go_back()
    page.wait_for_selector("#runs-table:visible")


def test_an_unknown_address_is_told(opened):
    page = opened(route="#/run/%E0%A4%A")
    assert "no run is called" in page.locator(".empty:visible").first.inner_text()


def test_no_runs_is_told(opened, tmp_path):
    write_page([], tmp_path / "page.html")
    page = opened(file=tmp_path / "page.html")
    assert "No runs yet" in page.locator("main").first.inner_text()


def test_dark_and_light_differ(opened):
    colours = []
    for scheme in ("dark", "light"):
        page = opened()
        page.emulate_media(color_scheme=scheme)
        colours.append(page.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert colours[0] != colours[1]


def test_the_page_needs_no_other_file(page_file, opened, tmp_path):
    alone = tmp_path / "sent by mail.html"
    shutil.copy(page_file, alone)
    page = opened(file=Path(alone))
    expect_rows(page, 12)
