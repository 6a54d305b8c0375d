"""A headless browser without a network, and what is seen in it."""

from __future__ import annotations

import io
import os
import shutil

import numpy as np
import pytest

_NEVER = 180_000.0
"""What has not come in this time never will, however busy the machine is [ms]."""
CHROMIUM_FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@pytest.fixture(scope="module")
def _browser():
    """A headless browser, where there is one, for all tests of a file: to start it takes two seconds."""
    found = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if not found:
        pytest.skip("no Chromium on this machine; install it, or name it in the environment variable CHROMIUM")
    playwright = pytest.importorskip("playwright.sync_api", reason="driving a browser needs the package playwright")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=list(CHROMIUM_FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def chromium(_browser):
    """A window of the browser, without a network, of which other tests know nothing."""
    context = _browser.new_context(offline=True, viewport={"width": 400, "height": 320})
    context.set_default_timeout(_NEVER)
    yield context
    context.close()


def opened(chromium, file):
    """A page in the browser, stopped at its start; what it says on its console, and what it asks for."""
    page = chromium.new_page()
    page.set_viewport_size({"width": 520, "height": 640})
    said, asked = [], []
    page.on("console", lambda message: said.append((message.type, message.text)))
    page.on("pageerror", lambda error: said.append(("error", str(error))))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    wait_for(page, "window.page !== undefined")
    page.evaluate("page.clock.play(false); page.clock.show(0)")
    return page, said, asked


def wait_for(page, condition):
    """Return once a condition holds in the page; its policy lets nobody wait for a text within."""
    for _ in range(1200):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"never: {condition}")


def seen(page, time):
    """The picture of the scene at a time of the clock, drawn at once."""
    from PIL import Image

    page.evaluate("time => { page.clock.show(time); page.scene.draw(); }", time)
    shot = page.locator("#scene").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=int)


def furred(picture):
    """Rows and columns of what has the brown of the cat: red well above blue."""
    return np.argwhere(picture[..., 0] - picture[..., 2] > 60)
