from __future__ import annotations

import time
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from dynresp.view.recording import write_recording
from dynresp.view.story import Story
from tests.view.browser import Browser, chromium

_TIME = "document.querySelector('input')?.value"
_SET_TIME = """(() => {
  const field = document.querySelector('input');
  const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set;
  set.call(field, '%g');
  field.dispatchEvent(new Event('input', {bubbles: true}));
})()"""


@pytest.mark.slow
@pytest.mark.skipif(chromium() is None, reason="no Chromium here to open the recording with")
def test_it_plays_in_a_browser_without_a_network(tmp_path: Path, story: Story) -> None:
    file = tmp_path / "recording.html"
    write_recording(story, file)
    executable = chromium()
    assert executable is not None
    with Browser(executable) as browser:
        browser.call("Page.navigate", url=file.as_uri())
        deadline = time.monotonic() + 300
        while not browser.evaluate(_TIME):
            assert time.monotonic() < deadline, browser.console
            time.sleep(0.2)
        times = set()
        while len(times) < 3:
            assert time.monotonic() < deadline, "it does not play"
            times.add(browser.evaluate(_TIME))
            time.sleep(0.2)
        pictures = []
        for moment in (0.0, 0.4):
            browser.evaluate(_SET_TIME % moment)
            time.sleep(2.0)
            assert float(browser.evaluate(_TIME)) == moment
            browser.screenshot(tmp_path / "shot.png")
            pictures.append(matplotlib.image.imread(tmp_path / "shot.png")[..., :3])
        assert browser.evaluate("document.title") == "a <ball> & a walk"
        elsewhere = [u for u in browser.requests if not u.startswith(("file:", "data:", "blob:"))]
        assert elsewhere == []
        assert not [line for line in browser.console if "exception" in line.lower()]
        assert not [line for line in browser.console if "Content Security Policy" in line]

    def colored(picture: np.ndarray, more: int, less: int) -> np.ndarray:
        return np.argwhere(picture[..., more] - picture[..., less] > 0.25)

    # The blue shirt of the base motion, then the red one under physics, upright in the middle.
    blue, red = colored(pictures[0], 2, 0), colored(pictures[1], 0, 2)
    assert len(blue) > 500
    assert len(red) > 500
    height, width = pictures[0].shape[:2]
    assert 0.2 * height < blue[:, 0].mean() < 0.6 * height
    assert 0.2 * width < blue[:, 1].mean() < 0.8 * width
