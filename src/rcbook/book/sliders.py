"""Pictures with sliders for the rendered book, drawn by Bokeh in the page."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping

from bokeh.embed import json_item
from bokeh.models import ColumnDataSource, HoverTool, Legend, Range1d
from bokeh.plotting import figure

_HEIGHT = 330  # pixels, of the picture without its legend


def element(data: Mapping, alt: str) -> str:
    """The HTML of a picture with sliders, for `assets/sliders.js` to start; hidden until then.

    `data` is what the picture shows under its mime type, and `alt` its alternative text.
    """
    controls = "".join(_control(slider) for slider in data["sliders"])
    sent = {name: data[name] for name in ("vectors", "frames", "notes", "sliders")}
    sent["item"] = json_item(_chart(data))
    text = json.dumps(sent, allow_nan=False, separators=(",", ":")).replace("<", r"\u003c")
    return (
        '<div class="rcbook-sliders" hidden>'
        f'<div class="rcbook-controls" role="group" aria-label="Sliders">{controls}</div>'
        '<p class="rcbook-note" role="status"></p>'
        f'<div class="rcbook-chart" role="figure" aria-label="{html.escape(alt)}"></div>'
        f'<script type="application/json">{text}</script></div>'
    )


def _control(slider: Mapping) -> str:
    label, last = html.escape(slider["label"]), len(slider["settings"]) - 1
    return (
        f'<label><span>{label}</span> <input type="range" min="0" max="{last}" step="1" '
        f'value="{slider["start"]}" aria-label="{label}"> <output></output></label>'
    )


def _chart(data: Mapping) -> figure:
    """The picture with a source named `curve-0`, `curve-1`, ... for each of its curves, empty."""
    axes = data["axes"]
    chart = figure(
        height=_HEIGHT + 22 * len(data["curves"]),
        sizing_mode="stretch_width",
        x_axis_label=axes["xlabel"],
        y_axis_label=axes["ylabel"],
        x_range=Range1d(*axes["xlim"]),
        y_range=Range1d(*axes["ylim"]),
        y_axis_type=axes["yscale"],
        toolbar_location=None,
        tools=[HoverTool(tooltips=[(axes["xlabel"], "@x"), (axes["ylabel"], "@y")])],
    )
    items = []
    for i, curve in enumerate(data["curves"]):
        ink = {
            "source": ColumnDataSource({"x": [], "y": []}, name=f"curve-{i}"),
            "color": curve["color"],
        }
        drawn = [chart.line("x", "y", line_dash=curve["dash"], line_width=2, **ink)]
        if curve["points"]:
            drawn.append(chart.scatter("x", "y", size=6, **ink))
        items.append((curve["label"], drawn))
    legend = Legend(items=items, location="top_left", border_line_color=None, margin=0, padding=0)
    chart.add_layout(legend, "above")
    return chart
