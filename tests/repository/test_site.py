"""The site in a browser: every page of it, wide and dark as on a desk and narrow as on a phone."""

import functools
import os
import shutil
import subprocess
import sys
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import unquote, urlsplit

import pytest

from tests.helpers.places import ROOT

sync_api = pytest.importorskip(
    "playwright.sync_api", reason="the browser tests need the PyPI package playwright"
)
CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None, reason="the browser tests need Chromium: apt-get install chromium"
    ),
]
SWITCHES = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
DESK = {"viewport": {"width": 1280, "height": 900}, "color_scheme": "dark"}
PHONE = {"viewport": {"width": 390, "height": 844}, "color_scheme": "light"}
ABOUT = """() => ({
  wide: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  links: [...document.querySelectorAll('a[href]')].map(each => each.href),
  ids: [...document.querySelectorAll('[id]')].map(each => each.id),
  mute: [...document.images].filter(each => !each.alt || !each.naturalWidth).map(each => each.src),
})"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site; the notebook is not run, for its page has tests of its own."""
    pytest.importorskip("material")
    folder = tmp_path_factory.mktemp("built") / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-f", ".mkdocs.yml", "-d", folder]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    subprocess.run(command, cwd=ROOT, env=quiet, check=True)
    return folder


@pytest.fixture(scope="module")
def address(site):
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def chromium():
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SWITCHES)
        yield browser
        browser.close()


def walked(chromium, site, address, look):
    """What is said of every page by its path, and the troubles that the browser told."""
    page, troubles = chromium.new_context(**look).new_page(), []
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
    about = {}
    for path in sorted(each.relative_to(site).as_posix() for each in site.rglob("*.html")):
        page.goto(address + path)
        about[path] = page.evaluate(ABOUT)
    page.context.close()
    return about, troubles


@pytest.fixture(scope="module")
def at_a_desk(chromium, site, address):
    return walked(chromium, site, address, DESK)


def test_no_page_tells_of_an_error_and_none_asks_another_host(at_a_desk):
    about, troubles = at_a_desk
    assert len(about) > 80
    assert troubles == []


def test_every_picture_is_there_and_says_what_it_shows(at_a_desk):
    about, _ = at_a_desk
    assert {path: told["mute"] for path, told in about.items() if told["mute"]} == {}


def test_every_link_within_the_site_leads_to_a_page_and_a_place_on_it(at_a_desk, site, address):
    about, _ = at_a_desk
    # The page of what is not found is shown under any address: it links from the root.
    links = {
        (path, link)
        for path, told in about.items()
        if path != "404.html"
        for link in told["links"]
        if link.startswith(address)
    }
    assert len(links) > 5000
    dead = []
    for path, link in links:
        asked = urlsplit(link)
        target, place = unquote(asked.path[1:]) or "index.html", unquote(asked.fragment)
        known = about.get(target)
        if not (site / target).is_file() or (place and known and place not in known["ids"]):
            dead.append(f"{path}: {link.removeprefix(address)}")
    assert sorted(dead) == []


def test_no_page_is_wider_than_a_phone(chromium, site, address):
    about, troubles = walked(chromium, site, address, PHONE)
    assert {path: told["wide"] for path, told in about.items() if told["wide"] > 0} == {}
    assert troubles == []


def test_the_search_finds_a_page(chromium, address):
    page = chromium.new_context(**DESK).new_page()
    page.goto(address)
    page.locator("[data-md-component=search-query]").fill("Pareto")
    page.wait_for_selector(".md-search-result__item a")
    assert "pareto" in page.locator(".md-search-result__list").inner_text().lower()
    page.context.close()


def test_code_is_copied_with_a_button_and_the_palette_turns(chromium, address):
    context = chromium.new_context(**PHONE | {"viewport": DESK["viewport"]})
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(address)
    block = page.locator(".highlight").first
    block.hover()
    block.locator("button[title='Copy to clipboard']").first.click()
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied.strip() == block.locator("code").inner_text().strip()
    paper = "getComputedStyle(document.body).backgroundColor"
    before = page.evaluate(paper)
    page.locator("label[title='Dark']").first.click()
    page.wait_for_function(f"{paper} !== '{before}'")
    context.close()
