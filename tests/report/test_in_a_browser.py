"""The page in a real browser: buttons do what they say, on a phone and in the dark as well, and without a mouse."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
POINT_ON_LINE = """
const line = arguments[0].querySelector(".line");
line.scrollIntoView({block: "center", behavior: "instant"});
const point = line.getPointAtLength(line.getTotalLength() / 2).matrixTransform(line.getScreenCTM());
return [Math.round(point.x), Math.round(point.y)];
"""
PHONE = 390  # px
SCRIPT_TIMEOUT = 60  # s; many times what a busy machine needs

pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="chromium and chromedriver are not installed (Debian: chromium, chromium-driver)"
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    """A browser that nobody has used before."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(BROWSER)
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(SCRIPT_TIMEOUT)
    yield driver
    driver.quit()


@pytest.fixture
def visit(browser):
    """Opens a page at a width (px) and in a colour scheme; no message may stand on the console."""

    def go(page: Path, *, width: int = 1300, scheme: str = "light") -> webdriver.Chrome:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width == PHONE}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        # a page that is still scrolling is hard to hit
        features = [
            {"name": "prefers-color-scheme", "value": scheme},
            {"name": "prefers-reduced-motion", "value": "reduce"},
        ]
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        browser.get("about:blank")
        browser.get(page.as_uri())
        return browser

    yield go
    assert browser.get_log("browser") == []


def displayed(browser: webdriver.Chrome, selector: str) -> bool:
    return browser.execute_script(
        "return getComputedStyle(document.querySelector(arguments[0])).display !== 'none'", selector
    )


def open_pairs(browser: webdriver.Chrome) -> list[str]:
    return [pair.get_attribute("id") for pair in browser.find_elements(By.CSS_SELECTOR, ".pairs details[open]")]


@pytest.mark.parametrize("part", ["seams", "outlines"])
def test_buttons_show_and_hide_what_they_say(visit, made, part):
    browser = visit(made.page)
    button = browser.find_element(By.CSS_SELECTOR, f"button[data-shows={part}]")
    assert not displayed(browser, f".overlay .{part}")

    for press, shown in ((button.click, True), (button.click, False), (lambda: button.send_keys(Keys.ENTER), True)):
        press()
        assert displayed(browser, f".overlay .{part}") == shown
        assert button.get_attribute("aria-pressed") == str(shown).lower()


def test_the_slider_moves_the_border(visit, made):
    browser = visit(made.page)
    slider = browser.find_element(By.ID, "share")

    def clip() -> str:
        first = browser.find_element(By.CSS_SELECTOR, ".split .first")
        return first.value_of_css_property("clip-path")

    assert clip() == "inset(0px 50% 0px 0px)"
    slider.send_keys(Keys.ARROW_LEFT)
    assert clip() == "inset(0px 51% 0px 0px)"
    slider.send_keys(Keys.END)
    assert clip() in ("inset(0px)", "inset(0px 0% 0px 0px)")


def test_a_link_shows_its_picture(visit, made):
    def enter(link: WebElement) -> None:
        link.send_keys(Keys.ENTER)

    def click(link: WebElement) -> None:
        # the middle of the line is where a mouse meets it; that of its bounding box is beside it
        x, y = browser.execute_script(POINT_ON_LINE, link)
        actions = ActionBuilder(browser)
        actions.pointer_action.move_to_location(x, y).click()
        actions.perform()

    browser = visit(made.page)
    links = browser.find_elements(By.CSS_SELECTOR, "a.edge")
    assert len(links) >= 2
    assert open_pairs(browser) == []

    for link, press in ((links[0], enter), (links[1], click), (links[0], click), (links[1], enter)):
        press(link)
        number = str(link.get_dom_attribute("href")).removeprefix("#")
        browser.execute_async_script("setTimeout(arguments[0], 50)")
        assert open_pairs(browser) == [number]
        picture = browser.find_element(By.CSS_SELECTOR, f"#{number} svg.matches")
        assert picture.size["width"] > 0
        assert picture.size["height"] > 0


def test_all_controls_are_reached_by_the_tab_key(visit, made):
    browser = visit(made.page)
    wanted = browser.execute_script(
        "return document.querySelectorAll('nav a, button, a.edge, .pairs summary, #share').length"
    )
    reached = set()
    for _ in range(wanted + 20):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        at = browser.execute_script(
            "const e = document.activeElement;"
            "return e.matches('nav a, button, a.edge, .pairs summary, #share') ?"
            " [...document.querySelectorAll('*')].indexOf(e) : null"
        )
        reached.add(at)
    assert len(reached - {None}) == wanted


@pytest.mark.parametrize("width", [PHONE, 1300])
def test_nothing_is_wider_than_the_screen(visit, either, width):
    browser = visit(either.page, width=width)
    browser.execute_script("document.querySelectorAll('details').forEach(one => one.open = true)")

    assert browser.execute_script("return document.documentElement.scrollWidth") <= width


def test_the_dark_is_dark(visit, made):
    def light_of(what: str) -> float:
        colour = browser.find_element(By.TAG_NAME, "body").value_of_css_property(what)
        return sum(map(float, colour.partition("(")[2].rstrip(")").split(",")[:3])) / 3

    browser = visit(made.page, scheme="light")
    assert light_of("background-color") > 230 > 80 > light_of("color")
    browser = visit(made.page, scheme="dark")
    assert light_of("background-color") < 40 < 200 < light_of("color")


def test_all_can_be_read_without_a_script(visit, made, browser):
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        visit(made.page)
        shown = [e for e in browser.find_elements(By.CSS_SELECTOR, ".split img") if e.is_displayed()]
        tops = [e.location["y"] for e in shown]
        buttons = browser.find_element(By.CLASS_NAME, "buttons").is_displayed()
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
    assert not buttons
    assert len(shown) == 2
    assert tops[0] < tops[1]
