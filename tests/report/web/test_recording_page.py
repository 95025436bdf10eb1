import base64
import io
import re

import numpy as np
from PIL import Image

from pcsr import Touch
from pcsr.recorded import Recording
from pcsr.report.recording.facts import touch_facts
from pcsr.report.web import recording_page as module
from pcsr.report.web.recording_page import recording_page

POINTS = np.random.default_rng(0).uniform(0, 3, size=(60, 3))


def page(count=2, odd=(), pose=True):
    touches = [Touch.single(POINTS, np.eye(4) if pose else None, 1.0, "digit")] * count
    recording = Recording(touches, [f"<{k}>" for k in range(count)], {"x": "lost"})
    return recording_page("a & b", recording, touch_facts(recording), odd)


def test_the_page_has_a_picture_and_a_row_for_each_touch_and_needs_no_network():
    text = page(odd=["3 < 4"])
    assert "<title>a &amp; b: recording</title>" in text
    assert "2 touches can be used, 1 are skipped" in text
    assert "<li>3 &lt; 4</li>" in text
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)"', text)
    assert len(pictures) == 2
    assert Image.open(io.BytesIO(base64.b64decode(pictures[0]))).format == "PNG"
    assert "&lt;0&gt;, 60 points, 2.9" in text
    assert text.count('<th scope="row">') == 2
    assert "<script" not in text
    assert "http" not in re.sub(r"base64,[^\"]+", "", text)


def test_without_poses_there_are_no_pictures():
    text = page(pose=False)
    assert "<img" not in text
    assert "<h2>Depth</h2>" not in text
    assert "<h2>Odd</h2>" not in text


def test_many_touches_have_no_more_pictures_than_a_page_can_show(monkeypatch):
    monkeypatch.setattr(module, "MOST_PICTURES", 3)
    text = page(count=5)
    assert text.count("<img") == 3
    assert "The first 3 of 5 touches have a picture." in text
