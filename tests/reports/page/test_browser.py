"""Pages in a browser: Chromium without a screen, driven by Playwright."""

import re
from concurrent.futures import ThreadPoolExecutor

import pytest
from PIL import ImageColor

from care_sim.reports.figures.styles import colours
from care_sim.reports.page.build import _embedded, write_page
from care_sim.sources.named import source_of
from care_sim.study.episode_config import PLAIN_FIELDS, grid
from care_sim.study.episode_play import run_episode
from care_sim.study.play_config import play_grid
from care_sim.study.rows.parquet import write_rows
from care_sim.study.rows.reading import with_added_columns, with_tags
from care_sim.study.scene_play import play_scene
from tests.helpers.made_rows import STUDY, row, rows

MOST_BYTES = 5e6
OPEN = "document.readyState === 'complete'"
READY = f"{OPEN} && !!document.querySelector('#views figure')"


@pytest.fixture
def opened(chromium):
    """Opens a file; at the end there must have been no error in the console and no request but for
    the file.
    """
    pages, troubles, requests = [], [], []

    def open_file(path, ready=OPEN, **context):
        # Playwright waits for functions by `eval`, which the page's own policy forbids.
        page = chromium.new_context(**{"bypass_csp": True} | context).new_page()
        page.on("console", lambda message: troubles.append(message.text))
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(path.as_uri())
        pages.append(path.as_uri())
        if ready:
            page.wait_for_function(ready)
        return page

    yield open_file
    assert troubles == []
    assert requests == pages


def folder_of(rows, folder, study):
    write_rows(
        rows, folder / ("plays.parquet" if study == "protocol" else "episodes.parquet"), study
    )
    return folder


def written(folder, rows, study, most=0, source=None):
    path = folder / "report.html"
    threads = lambda _workers: ThreadPoolExecutor(1)  # noqa: E731
    write_page(folder_of(rows, folder, study), path, most, 1, threads, source)
    return path


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """Episodes of two policies at two budgets on one seed, and one row that is not as it was
    played.
    """
    configs = grid(["dartout"], ["history", "care", "full"], [0.05, 0.1], [0])
    rows = with_added_columns([run_episode(config) for config in configs])
    rows[0] |= {"detection_distance_m": 1.25, "episode_hash": "0"}
    return written(tmp_path_factory.mktemp("played"), rows, "sweep", most=5), rows


def test_a_page_keeps_to_its_own_policy(opened, played):
    page = opened(played[0], None, bypass_csp=False)
    page.wait_for_selector("#views figure")
    page.locator("table.sortable th button").first.click()
    assert page.locator("[aria-sort]").count() == 1
    assert page.locator(".plot svg text").count() > 5


def test_a_walk_through_a_page(opened, played):
    """The page says what was played, shows two episodes side by side, and plays one to its end."""
    path, rows = played
    page = opened(path, READY)
    text = page.inner_text("body")
    assert "Sweep of the closed loop" in text
    assert "4 of 5 are the same as in the results" in text
    assert "Episodes that end otherwise when played again here, which are marked: 1." in text
    assert "config.json is missing" in text
    first, beside = page.locator(".view h3").all_inner_texts()
    assert (first, beside) == ("history 5%, dartout, seed 0", "care 5%, dartout, seed 0")
    otherwise = "Ends otherwise than in the results: detection_distance_m 1.25 →"
    assert otherwise in page.inner_text(".view >> nth=0")
    detected = f"detected by the LiDAR at 2.6 s ({rows[2]['detection_distance_m']:.1f} m away)"
    assert detected in page.inner_text(".view >> nth=1")
    page.select_option("#beside", "")
    page.wait_for_function("document.querySelectorAll('.view').length === 1")
    page.locator("[data-episode]").nth(2).click()
    page.wait_for_function("document.querySelector('.view h3').textContent.startsWith('care 5%')")
    assert "detected" in page.inner_text(".now")
    ring = page.locator(".view .ring").first
    assert ring.get_attribute("class") == "ring found"
    page.locator("#moment").fill("0")
    assert page.inner_text(".now").startswith("0.0 s")
    assert ring.get_attribute("class") == "ring unseen"
    view = page.locator(".view svg > g").first.get_attribute("transform")
    page.select_option("#speed", "1")
    page.locator("#play").click()
    page.wait_for_function("Number(document.querySelector('#moment').value) > 5")
    assert page.locator(".view svg > g").first.get_attribute("transform") != view
    page.locator("#play").click()
    assert page.inner_text("#play") == "Play"
    last = int(page.get_attribute("#moment", "max"))
    page.locator("#moment").fill(str(last - 1))
    assert "m away" in page.inner_text(".now")
    page.locator("#play").click()
    page.wait_for_function(f"document.querySelector('#moment').value === '{last}'")
    page.wait_for_function("document.querySelector('#play').textContent === 'Play'")
    # After the last keyframe nothing is said of the actor.
    assert re.fullmatch(r"[\d.]+ s, [\d.]+ m/s\.", page.inner_text(".now"))


def test_a_drive_shows_its_way_whom_the_car_meets_and_the_collision(opened, tmp_path):
    (config,) = grid(["drive"], ["care"], [0.01], [105])
    rows = with_added_columns([run_episode(config)])
    page = opened(written(tmp_path, rows, "sweep", most=1), READY)
    page.locator("#moment").fill(page.get_attribute("#moment", "max"))
    assert page.inner_text(".now").endswith("the car hits the bicycle with 7.7 m/s.")
    assert page.locator(".view .ring").count() == 3
    assert page.locator(".view .way").count() == 1


def test_a_play_of_the_open_loop_is_watched_beside_another(opened, drive, tmp_path):
    source = source_of(f"argoverse2:{drive.parent}")
    rows = with_tags(
        play_scene(play_grid(source, source.scenes(), ["history", "care", "full"], [0.1]))
    )
    page = opened(written(tmp_path, rows, "protocol", 9, source), READY)
    assert "3 of 3 are the same as in the results" in page.inner_text("#episodes")
    page.locator("[data-episode]").nth(2).click()
    page.wait_for_function("document.querySelectorAll('.view').length === 1")
    page.select_option("#beside", label="care 10%")
    page.wait_for_function("document.querySelectorAll('.view').length === 2")
    titles = page.locator(".view h3").all_inner_texts()
    assert [title.partition(",")[0] for title in titles] == ["full 100%", "care 10%"]
    last = int(page.get_attribute("#moment", "max"))
    page.locator("#moment").fill(str(last))
    found = re.search(r"(\d+) of (\d+) objects found", page.inner_text(".now >> nth=0"))
    drawn = page.locator(".view >> nth=0").locator("rect.spotted:visible, rect.missed:visible")
    assert drawn.count() == int(found[2]) > 0
    spotted = page.locator(".view >> nth=0").locator("rect.spotted:visible")
    assert spotted.count() == int(found[1])
    # The person who stepped out of the house is not there before.
    assert page.locator(".view >> nth=0").locator("rect:has(title:text('pedestrian'))").count()
    page.locator("#moment").fill("0")
    assert "hidden" in page.locator(".view >> nth=0").locator("g[style]").evaluate_all(
        "all => all.map(each => each.style.visibility)"
    )
    page.locator("#play").click()
    page.wait_for_function(f"document.querySelector('#moment').value === '{last}'")


def test_a_heading_sorts_its_column_up_and_down(opened, tmp_path):
    """A median that was never detected is the least."""
    medians = {"history": None, "care": 9.0, "all-camera": 10.0, "full": 7.0, "care-sbf": 8.0}
    made = [each for policy, distance in medians.items() for each in rows(policy, [distance] * 3)]
    table = opened(written(tmp_path, made, "sweep"), "true").locator("table.sortable >> nth=0")
    heading = table.locator("th", has_text="first detection")
    column = heading.evaluate("head => head.cellIndex") + 1

    def texts():
        cells = table.locator(f"tbody td:nth-child({column})").all_inner_texts()
        return [text.split(" [")[0] for text in cells]

    up = ["not detected", "7.0", "8.0", "9.0", "10.0"]
    assert texts() not in (up, up[::-1])
    heading.locator("button").click()
    assert (texts(), heading.get_attribute("aria-sort")) == (up, "ascending")
    heading.locator("button").press("Enter")
    assert (texts(), heading.get_attribute("aria-sort")) == (up[::-1], "descending")


def test_of_two_quick_clicks_the_later_wins(opened, played):
    page = opened(played[0], READY)
    page.evaluate(
        "() => { const json = Response.prototype.json; let slow = true;"
        "Response.prototype.json = async function () {"
        "  const late = slow; slow = false;"
        "  if (late) await new Promise((done) => setTimeout(done, 300));"
        "  window.unpacked = (window.unpacked ?? 0) + 1;"
        "  return json.call(this);"
        "}; }"
    )
    page.evaluate("for (const n of [2, 4]) document.querySelectorAll('[data-episode]')[n].click()")
    page.wait_for_function("window.unpacked === 2")
    page.wait_for_timeout(100)
    assert page.locator(".view h3").all_inner_texts() == ["full 100%, dartout, seed 0"]


def test_nobody_who_wants_calm_sees_a_body_between_two_keyframes(opened, played):
    page = opened(played[0], READY, reduced_motion="reduce")
    page.locator("#moment").fill("10")
    page.evaluate(
        "window.seen = new Set(); new MutationObserver(() => "
        "seen.add(document.querySelector('.view svg > g').getAttribute('transform')))"
        ".observe(document.querySelector('.view svg > g'), {attributes: true})"
    )
    page.locator("#play").click()
    page.wait_for_function("Number(document.querySelector('#moment').value) > 13")
    assert len(page.evaluate("[...seen]")) <= 6


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_fits_a_phone_and_reads_in_any_light(scheme, opened, played):
    page = opened(played[0], READY, viewport={"width": 360, "height": 740}, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    ink, paper = (
        page.evaluate(f"getComputedStyle(document.body).{name}")
        for name in ("color", "backgroundColor")
    )
    assert contrast(ink, paper) > 7
    quiet = page.evaluate("getComputedStyle(document.querySelector('.note')).color")
    assert contrast(quiet, paper) > 4.5


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_figure_is_read_on_a_light_and_a_dark_page_and_on_paper(scheme, opened, played):
    page = opened(played[0], READY, color_scheme=scheme)

    def look():
        return page.locator(".plot").first.evaluate(
            """each => [
              getComputedStyle(each.querySelector("text")).fill,
              getComputedStyle(document.body).backgroundColor,
              getComputedStyle([...each.querySelectorAll("text")].find(
                (one) => one.textContent === "care")).fill,
            ]"""
        )

    *texts, care = look()
    assert contrast(*texts) > 7
    assert care == f"rgb{ImageColor.getrgb(colours(['care'])['care'])}"
    page.emulate_media(media="print", color_scheme=scheme)
    ink, paper, _ = look()
    assert paper == "rgb(255, 255, 255)"
    assert contrast(ink, paper) > 7


def test_on_paper_everything_is_open_and_no_column_is_lost(opened, tmp_path):
    """A table wider than the sheet, and more seeds than fit in a row."""
    configs = grid(["dartout"], ["history", "care"], [0.1], range(40))
    path = written(tmp_path, [row(config, 9.0) for config in configs], "paper")
    wide = "".join(f"<td>[-{number}.6,-18.0]</td>" for number in range(20, 44))
    table = f'<table class="sortable"><thead><tr></tr></thead><tr>{wide}</tr></table>'
    html = path.read_text().replace("<footer>", f'<div class="scroll">{table}</div><footer>')
    path.write_text(html)
    # A sheet of A4 on its longer side, less 1 cm at either.
    page = opened(path, viewport={"width": 1047, "height": 700})
    closed = page.locator("details:not([open])")
    assert closed.count() > 0
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert closed.count() == 0
    page.emulate_media(media="print")
    rights = page.evaluate(
        "[...document.querySelectorAll('th, td')].map((cell) => cell.getBoundingClientRect().right)"
    )
    assert len(rights) > 120
    assert max(rights) <= 1047
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert closed.count() > 0


def test_text_from_outside_is_text(opened, tmp_path):
    evil = "</script><b id=evil>"
    both = [*STUDY, *rows("care", [9.0], budget=0.1), *rows("history", [9.0], budget=0.1)]
    made = [
        each | {"policy": evil, "tags": "causal"} if each["policy"] == "history" else each
        for each in both
    ]
    page = opened(written(tmp_path, [{"tags": "causal"} | each for each in made], "sweep"))
    assert page.locator("#evil").count() == 0
    assert "</script>" not in _embedded({"policy": evil})
    assert evil in page.inner_text("#tables")
    assert evil in page.inner_html("#figures svg").replace("&lt;", "<").replace("&gt;", ">")


class OneSeed(ThreadPoolExecutor):
    """Plays every cell of a study on its first seed, and shows that episode for each of its seeds:
    how long the stories are does not depend on the seed, and to play all 305 takes 40 s.
    """

    def __init__(self):
        super().__init__(1)
        self.first = {}

    def submit(self, call, play, row, source):
        cell = tuple(row.get(name) for name in PLAIN_FIELDS if name != "seed")
        if cell not in self.first:
            self.first[cell] = super().submit(call, play, row, source)
        return self.first[cell]


@pytest.mark.slow
def test_the_page_of_the_papers_study_is_small(published, tmp_path):
    path, played = tmp_path / "report.html", OneSeed()
    made = write_page(published / "closed-loop-5", path, 400, 1, lambda _workers: played)
    assert len(played.first) == 61
    assert made.watchable == len(made.rows) == 305
    assert path.stat().st_size < MOST_BYTES


def contrast(one, other):
    """The contrast of two colours, 1 to 21 (WCAG 2.2)."""
    lighter, darker = sorted(map(luminance, (one, other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour):
    parts = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
