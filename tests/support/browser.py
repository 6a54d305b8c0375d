"""A headless browser without a network, and what is seen in it."""

from __future__ import annotations

import io
import os
import shutil

import numpy as np
import pytest

# Frames that a browser draws from one picture to the next, and how many like the first show that nothing moves.
_FRAMES_BETWEEN = 3
_PICTURES_ALIKE = 3
_NEVER = 180_000.0
"""What has not come in this time never will, however busy the machine is [ms]."""
CHROMIUM_FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@pytest.fixture
def chromium():
    """A headless browser without a network, where there is one."""
    found = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if not found:
        pytest.skip("no Chromium on this machine; install it, or name it in the environment variable CHROMIUM")
    playwright = pytest.importorskip("playwright.sync_api", reason="driving a browser needs the package playwright")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=list(CHROMIUM_FLAGS))
        context = browser.new_context(offline=True, viewport={"width": 400, "height": 320})
        context.set_default_timeout(_NEVER)
        yield context
        context.close()
        browser.close()


def stopped(page, scene):
    """Stop the playing: the number beside the bar does not change any more."""
    number = scene.locator("input").first
    for _ in range(20):
        before = number.input_value()
        page.wait_for_timeout(500)
        if number.input_value() == before:
            return
        scene.locator("body").press("Space")
        page.wait_for_timeout(200)
    raise AssertionError("the playing does not stop")


def seen(page, scene, second):
    """The picture once it stands still at a second of the playing, the bar below and notices left out."""
    from PIL import Image

    scene.locator("input").first.fill(str(second))
    before, same = None, 0
    for _ in range(600):
        # On a busy machine frames are drawn seldom, and two pictures are alike before the new one is there.
        for _ in range(_FRAMES_BETWEEN):
            scene.locator("body").evaluate("() => new Promise(done => requestAnimationFrame(done))")
        page.wait_for_timeout(100)
        shot = scene.locator("canvas").first.screenshot()
        picture = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=int)
        same = same + 1 if before is not None and np.array_equal(picture, before) and np.ptp(picture) > 100 else 0
        if same == _PICTURES_ALIKE:
            return picture
        before = picture
    raise AssertionError("the picture never came to rest")


def furred(picture):
    """Rows and columns of what has the brown of the cat: red well above blue."""
    return np.argwhere(picture[..., 0] - picture[..., 2] > 60)
