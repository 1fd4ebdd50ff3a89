"""Pictures with sliders: what is computed is what the page is given, and is light."""

import json
import re

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest

from rcbook import pictures
from rcbook.book import render, sliders
from rcbook.pictures.sliders import MIME

X = np.linspace(0, np.pi, 200)
AXES = {"xlabel": "angle (rad)", "ylabel": "cosine", "xlim": (0, np.pi), "ylim": (-1, 1)}


def powers(power, scale):
    """Curves with a closed form, and what is the same in all of them."""
    curves = {"power": (X, scale * np.cos(X / 2) ** power), "limit": ([0, np.pi], [1, np.nan])}
    return curves, f"scale {scale:g} <b>"


@pytest.fixture(scope="module")
def plot():
    made = pictures.with_sliders(powers, {"power": range(5), "scale": (0.5, 1.0)}, (2, 1.0), **AXES)
    return made, made._repr_mimebundle_()


def test_the_page_is_given_what_was_computed_at_every_setting(plot):
    data = plot[1][MIME]
    for i, (power, scale) in enumerate((p, s) for p in range(5) for s in (0.5, 1.0)):
        (x, y), _ = data["frames"][i]
        assert np.allclose(data["vectors"][x], X, rtol=1e-3)
        closed = scale * ((1 + np.cos(X)) / 2) ** (power / 2)  # of the half angle
        assert np.allclose(data["vectors"][y], closed, rtol=1e-3, atol=1e-12)
        assert data["notes"][i].startswith(f"scale {scale:g}")
    assert [slider["start"] for slider in data["sliders"]] == [2, 1]


def test_what_many_settings_share_is_sent_once_and_a_gap_as_null(plot):
    data = plot[1][MIME]
    assert len(data["vectors"]) == 10 + 1 + 2  # the curves, their x, both ends of the limit
    assert [1.0, None] in data["vectors"]
    json.dumps(data, allow_nan=False)
    digits = re.findall(r"\d+\.?\d*", json.dumps(data["vectors"]))
    assert max(len(d.replace(".", "").lstrip("0")) for d in digits) <= 4


def test_the_still_picture_is_that_of_the_start(plot):
    made, bundle = plot
    assert bundle["image/png"].startswith("iVBOR")
    assert bundle["text/plain"] == "power 2, scale 1: scale 1 <b>"
    assert made.at(2, 1.0) is made.frames[5]
    colours = {curve["color"] for curve in bundle[MIME]["curves"]}
    assert len(colours) == len(made.frames[0].curves)


def test_what_is_wrong_is_said_with_its_mend():
    with pytest.raises(ValueError, match=r"\(7,\) is no setting of power; take one"):
        pictures.with_sliders(lambda p: powers(p, 1), {"power": range(5)}, (7,), **AXES)
    with pytest.raises(ValueError, match=r"at \(1,\) the curves are 1, not 0; draw the same"):
        pictures.with_sliders(lambda p: ({f"{p}": (X, X)}, ""), {"p": range(2)}, (0,), **AXES)
    with pytest.raises(ValueError, match=r"c has x of shape \(200,\) and y of \(\); a curve is"):
        pictures.with_sliders(lambda p: ({"c": (X, p)}, ""), {"p": range(2)}, (0,), **AXES)


def test_the_element_has_named_sliders_and_data_that_no_browser_takes_for_markup(plot):
    element = sliders.element(plot[1][MIME], 'a "cosine"')
    assert re.findall(r'max="(\d)" step="1" value="(\d)" aria-label="(\w+)"', element) == [
        ("4", "2", "power"),
        ("1", "1", "scale"),
    ]
    assert 'aria-label="a &quot;cosine&quot;"' in element
    script = element.partition('<script type="application/json">')[2].removesuffix(
        "</script></div>"
    )
    assert "<" not in script
    sent = json.loads(script)
    assert sent["notes"] == plot[1][MIME]["notes"]
    assert {"curve-0", "curve-1"} <= set(re.findall(r'"name": ?"(curve-\d)"', script))


def test_bokeh_is_the_script_of_its_wheel_and_no_heavier_than_thought():
    assert 500_000 < render.bokeh().stat().st_size < 1_400_000
