"""The site in a browser: every page of it, wide and dark as on a desk and narrow as on a phone."""

import functools
import json
import os
import re
import subprocess
import sys
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from tests.helpers.places import ROOT

pytestmark = pytest.mark.slow
DESK = {"viewport": {"width": 1280, "height": 900}, "color_scheme": "dark"}
PHONE = {"width": 390, "height": 844}
PAPER = {"width": 718, "height": 1046}
"""A page of A4 without margins of 10 mm."""
TOO_WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
ABOUT = """() => ({
  mute: [...document.images].filter(each => !each.alt || !each.naturalWidth).map(each => each.src),
})"""


WIDEST_TABLE = """Math.max(0, ...Array.from(document.querySelectorAll(".md-content table"),
  each => each.getBoundingClientRect().right))"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder of the built site, with the notebook's outputs, and what the builder said."""
    for library in ("material", "nbclient", "ipykernel"):
        pytest.importorskip(library)
    folder = tmp_path_factory.mktemp("built") / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "-f", ".mkdocs.yml", "-d", str(folder)]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=quiet, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout + done.stderr


@pytest.fixture(scope="module")
def site(built):
    return built[0]


def test_the_site_is_built_without_a_warning(built):
    """MkDocs warns of every link, and every place on a page, that leads nowhere."""
    assert "WARNING" not in built[1]


def test_the_notebook_shows_what_came_out(site):
    text = (site / "quickstart.html").read_text()
    found = [float(number) for number in re.findall(r"detects the person at ([\d.]+) m", text)]
    assert len(found) == 3
    assert found[1] > found[0], "CARE sees the person before history does"
    pictures = re.findall(r'<img[^>]* src="(quickstart-\d+\.png)"', text)
    assert len(pictures) == 2
    assert all((site / picture).stat().st_size > 5000 for picture in pictures)
    assert 'href="quickstart.html"' in (site / "index.html").read_text()


def test_sections_are_tabs_beside_the_logo(site):
    text = (site / "index.html").read_text()
    tabs = re.findall(r'class="md-tabs__link">\s*(.+?)\s*</a>', text)
    assert tabs[:3] == ["Start", "Environments", "Guides"]
    assert 'src="logo.svg"' in text
    assert (site / "logo.svg").is_file()


@pytest.fixture(scope="module")
def address(site):
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def walked(chromium, site, address):
    """The data about every page by its path, with how much it is wider than a phone; and the
    troubles that the browser told.
    """
    page, troubles = chromium.new_context(**DESK).new_page(), []
    page.on("console", lambda message: troubles.append(f"{page.url}: {message.text}"))
    page.on("pageerror", lambda error: troubles.append(f"{page.url}: {error}"))
    page.on(
        "response",
        lambda answer: answer.status >= 400 and troubles.append(f"{answer.status} {answer.url}"),
    )
    page.on(
        "request",
        lambda asked: (
            asked.url.startswith((address, "data:", "blob:"))
            or troubles.append(f"{page.url} asks {asked.url}")
        ),
    )
    # Every page would index the site for its search, which takes half of the time here. It has a
    # test of its own.
    index = json.loads((site / "search" / "search_index.json").read_text()) | {"docs": []}
    page.route("**/search_index.json", lambda route: route.fulfill(json=index))
    about = {}
    for path in sorted(each.relative_to(site).as_posix() for each in site.rglob("*.html")):
        page.set_viewport_size(DESK["viewport"])
        page.goto(address + path)
        about[path] = page.evaluate(ABOUT)
        page.set_viewport_size(PHONE)
        about[path]["too wide"] = page.evaluate(TOO_WIDE)
        page.set_viewport_size(PAPER)
        page.emulate_media(media="print")
        about[path]["widest table"] = page.evaluate(WIDEST_TABLE)
        page.emulate_media(media="screen")
    page.context.close()
    return about, troubles


def test_no_page_tells_of_an_error_and_none_asks_another_host(walked):
    about, troubles = walked
    assert len(about) > 80
    assert troubles == []


def test_every_picture_is_there_and_says_what_it_shows(walked):
    about, _ = walked
    assert {path: told["mute"] for path, told in about.items() if told["mute"]} == {}


def test_no_page_is_wider_than_a_phone(walked):
    about, _ = walked
    assert {path: told["too wide"] for path, told in about.items() if told["too wide"] > 0} == {}


def test_paper_holds_every_table(walked):
    about, _ = walked
    widest = {path: told["widest table"] for path, told in about.items()}
    assert max(widest.values()) > 600
    assert {path: width for path, width in widest.items() if width > PAPER["width"]} == {}


def test_numbered_lists_go_on_behind_code(site):
    assert re.findall(r'<ol start="(\d)">', (site / "competition.html").read_text()) == ["2", "3"]


def test_tables_of_data_have_a_title_a_legend_and_whole_cells(site):
    text = (site / "results/data/crowding/tables.html").read_text()
    assert "<title>Tables: crowding" in text
    assert '<a href="../../../reading.html">marks and terms</a>' in text
    assert "\\~" not in text
    leaderboard = (site / "results/data/b90/leaderboard.html").read_text()
    assert re.search(r'<td class="unbroken">7\.\d \[\d\.\d,&nbsp;[\d.]+\]</td>', leaderboard)


def test_the_search_finds_a_page(chromium, address):
    page = chromium.new_context(**DESK).new_page()
    page.goto(address)
    page.locator("[data-md-component=search-query]").fill("Newcomer")
    page.wait_for_selector(".md-search-result__item a")
    assert "newcomer" in page.locator(".md-search-result__list").inner_text().lower()
    page.context.close()
