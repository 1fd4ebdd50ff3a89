"""Figures of the built book: legible in the dark, and with their numbers as CSV beside them."""

import base64
import io
import re
import zipfile

import matplotlib
import nbformat
import numpy as np
import pandas as pd
import pytest
from bs4 import BeautifulSoup
from layouts import STYLE, contrast
from PIL import Image

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from rcbook.book import data, execute
from rcbook.pictures import comparison, sketch
from rcbook.pictures.series import long_form
from rcbook.pictures.sliders import MIME as SLIDERS


def sheet(figure) -> pd.DataFrame:
    """What a figure says of itself, read as a user would; the figure is closed."""
    text = long_form(figure)
    plt.close(figure)
    return pd.read_csv(io.StringIO(text), keep_default_na=False, na_values=[""])


# ---- the numbers of a figure ----


def test_curves_have_their_names_and_six_digits():
    figure, ax = plt.subplots()
    x = np.linspace(0, 1, 5)
    ax.plot(x, np.pi * x, label="rising\n$\\pi$")
    ax.plot([0, 1], [np.nan, 2e-9])
    ax.set(xlabel="time (s)", ylabel="force (N)")
    found = sheet(figure)
    assert list(found) == ["panel", "series", "x_name", "y_name", "x", "y"]
    first = found[found.series == "rising $\\pi$"]
    assert np.allclose(first.y, np.pi * x, rtol=1e-5)
    assert first.y.astype(str).iloc[-1] == "3.14159"
    assert {*found.x_name} == {"time (s)"} and {*found.y_name} == {"force (N)"}
    second = found[found.series == "curve 2"]
    assert second.y.isna().tolist() == [True, False] and second.y.iloc[1] == 2e-9


def test_panels_have_their_titles_and_the_labels_of_their_row_and_column():
    figure, axes = plt.subplots(2, 2)
    for ax in axes.flat:
        ax.plot([0, 1])
    axes[0, 0].set(title="before", ylabel="force (N)")
    axes[1, 1].set(xlabel="turns")
    found = sheet(figure)
    assert list(found.panel.unique()) == ["before", "panel 2", "panel 3", "panel 4"]
    named = found.drop_duplicates("panel")[["x_name", "y_name"]].to_numpy().tolist()
    assert named == [["x", "force (N)"], ["turns", "force (N)"], ["x", "y"], ["turns", "y"]]


def test_decoration_is_left_out_unless_it_has_a_name():
    figure, (ax, schematic) = plt.subplots(1, 2)
    ax.axhline(3)
    ax.axhspan(0, 1)
    ax.axvline(4, label="the turn")
    ax.plot([0.2, 0.8], [0.5, 0.5], transform=ax.transAxes)
    ax.plot([1], [1], label="hidden", visible=False)
    schematic.plot([0, 1])
    schematic.axis("off")
    found = sheet(figure)
    assert found[["series", "x"]].to_numpy().tolist() == [["the turn", 4]]
    assert found.y.isna().all()


def test_a_figure_without_data_has_no_sheet():
    figure, ax = plt.subplots()
    ax.plot([0, 1])
    ax.axis("off")
    assert long_form(figure) is None
    plt.close(figure)


def test_points_bars_steps_and_bands():
    figure, ax = plt.subplots()
    ax.scatter([1, 2], [3, 4], label="seen")
    ax.bar([0, 1], [5, 7], bottom=1, label="levels")
    ax.stairs([8, 9], [0, 1, 2], label="held")
    ax.fill_between([0, 1], [0, 0], [1, 1], label="between")
    found = sheet(figure).set_index("series")[["x", "y"]]
    assert found.loc["seen"].to_numpy().tolist() == [[1, 3], [2, 4]]
    assert found.loc["levels"].to_numpy().tolist() == [[0, 6], [1, 8]]
    assert found.loc["held"].to_numpy().tolist() == [[0, 8], [1, 9], [2, 9]]
    corners = {tuple(corner) for corner in found.loc["between"].to_numpy()}
    assert corners == {(0, 0), (1, 0), (1, 1), (0, 1)}


def test_bars_at_named_places_say_the_names():
    figure, ax = plt.subplots(subplot_kw={"projection": "polar"})
    ax.bar([0, np.pi], [1, 2])
    ax.set_xticks([0, np.pi], ["tooth one", "tooth two"])
    found = sheet(figure)
    assert found[["x", "y"]].to_numpy().tolist() == [["tooth one", 1], ["tooth two", 2]]
    assert found.x_name.iloc[0] == "angle (rad)"


@pytest.mark.parametrize("origin", ["upper", "lower"])
def test_the_cells_of_an_image_stand_where_they_are_drawn(origin):
    figure, ax = plt.subplots()
    image = ax.imshow([[1, 2, 3], [4, 5, 6]], origin=origin)
    figure.colorbar(image, label="growth (1/s)")
    found = sheet(figure)
    assert {*found.series} == {"growth (1/s)"}
    assert {(x, y): v for x, y, v in found[["x", "y", "value"]].to_numpy()} == {
        (column, row): 3 * row + column + 1 for row in range(2) for column in range(3)
    }


def test_a_mesh_gives_the_middles_of_its_cells_and_contours_their_levels():
    figure, (ax, lines) = plt.subplots(1, 2)
    ax.pcolormesh([0, 2, 4], [0, 1], [[7, 8]])
    grid = np.linspace(-1, 1, 41)
    lines.contour(grid, grid, np.hypot(*np.meshgrid(grid, grid)), levels=[0.5, 0.8])
    found = sheet(figure)
    mesh = found[found.panel == "panel 1"]
    assert mesh[["x", "y", "value"]].to_numpy().tolist() == [[1, 0.5, 7], [3, 0.5, 8]]
    rings = found[(found.panel == "panel 2") & found.x.notna()]
    assert {*rings.value} == {0.5, 0.8}
    assert np.allclose(np.hypot(rings.x, rings.y), rings.value, atol=1e-2)


def test_filled_contours_give_the_outline_of_each_layer():
    figure, ax = plt.subplots()
    ax.contourf([[0, 1], [0, 1]], levels=[0, 0.5, 1])
    found = sheet(figure).dropna(subset="x")
    assert {*found.value} == {0.25, 0.75}
    assert found[found.value == 0.25].x.agg(["min", "max"]).tolist() == [0, 0.5]


def test_a_heat_map_gives_its_numbers_and_not_its_shades():
    figure, ax = plt.subplots()
    table = pd.DataFrame({"mill": [0.5, 20.0], "bar": [np.nan, 3.0]}, index=["PI", "filtered"])
    comparison.draw_heat_map(ax, table)
    found = sheet(figure)
    values = {(x, y): v for x, y, v in found[["x", "y", "value"]].to_numpy()}
    assert values["mill", "PI"] == 0.5 and values["bar", "filtered"] == 3
    assert np.isnan(values["bar", "PI"])


# ---- their way into the book ----


def drawn(sheets: list[str], **figure: str) -> nbformat.NotebookNode:
    """A cell that shows a picture for each of the CSV texts given."""
    shown = [nbformat.v4.new_output("display_data", {data.CSV: text}) for text in sheets]
    metadata = {"mystnb": {"figure": figure}} if figure else {}
    return nbformat.v4.new_code_cell("draw()", id="drawn", metadata=metadata, outputs=shown)


def test_a_figure_gets_a_link_that_says_of_what_and_a_file(tmp_path):
    cells = [drawn(["x,y\n1,2\n"], name="fig-mill-rise"), nbformat.v4.new_markdown_cell("**Up**.")]
    notebook = nbformat.v4.new_notebook(cells=cells)
    data.write(tmp_path, {"mill.ipynb": notebook})
    path = tmp_path / "data" / "mill" / "fig-mill-rise.csv"
    assert path.read_text(encoding="utf-8") == "x,y\n1,2\n"
    data.link(cells, "mill")
    picture, link = cells[0].outputs
    assert data.CSV not in picture["data"]
    anchor = BeautifulSoup(link["data"]["text/html"], "html.parser").a
    assert anchor["href"] == "../data/mill/fig-mill-rise.csv"
    assert anchor.has_attr("download")
    assert anchor.get_text() == "Data (CSV) of Up"


def test_a_second_figure_of_a_cell_has_a_name_of_its_own_and_a_heavy_one_is_packed(tmp_path):
    heavy = "x\n" + "1\n" * data.HEAVY
    notebook = nbformat.v4.new_notebook(cells=[drawn(["x\n1\n", heavy])])
    data.write(tmp_path, {"mill.ipynb": notebook})
    folder = tmp_path / "data" / "mill"
    names = {"fig-mill-drawn.csv", "fig-mill-drawn-1.csv.zip"}
    assert {path.name for path in folder.iterdir()} == names
    assert len(pd.read_csv(folder / "fig-mill-drawn-1.csv.zip")) == data.HEAVY
    (member,) = zipfile.ZipFile(folder / "fig-mill-drawn-1.csv.zip").infolist()
    assert member.date_time == (1980, 1, 1, 0, 0, 0)  # two builds of one commit are alike


def test_a_picture_with_sliders_gives_every_setting(tmp_path):
    moved = {
        "axes": {"xlabel": "turns", "ylabel": "error"},
        "sliders": [{"label": "gain", "settings": ["0.5", "1"]}],
        "curves": [{"label": "left"}],
        "vectors": [[0, 1], [1, 0.5], [1, None]],
        "frames": [[[0, 1]], [[0, 2]]],
    }
    output = nbformat.v4.new_output("display_data", {SLIDERS: moved})
    cell = nbformat.v4.new_code_cell("draw()", id="drawn", outputs=[output])
    data.write(tmp_path, {"mill.ipynb": nbformat.v4.new_notebook(cells=[cell])})
    found = pd.read_csv(tmp_path / "data" / "mill" / "fig-mill-drawn.csv")
    assert list(found) == ["gain", "series", "x_name", "y_name", "x", "y"]
    assert found.gain.tolist() == [0.5, 0.5, 1, 1]
    assert found.y.fillna(-1).tolist() == [1, 0.5, 1, -1]


def test_a_kernel_of_the_build_shows_the_numbers_of_a_figure(tmp_path):
    source = "import matplotlib.pyplot as plt\nplt.plot([1, 4, 9], label='squares')\nplt.show()"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)])
    nbformat.write(notebook, tmp_path / "one.ipynb")
    done, failures, _ = execute.execute([tmp_path / "one.ipynb"])
    assert not failures
    (output,) = done["one.ipynb"].cells[0].outputs
    assert output["data"][data.CSV].splitlines()[-1] == ",squares,x,y,2,9"
    assert {"image/png", "image/svg+xml"} <= {*output["data"]}


# ---- the book ----

PLOTS = re.compile(
    r"\.(plot|loglog|semilog[xy]|bar|imshow|contourf?|stem|step|scatter|draw_lines|draw_signal"
    r"|draw_heat_map|with_sliders)\("
)


def figures(built) -> list[tuple[str, BeautifulSoup, str]]:
    """Every figure of the chapters: its page, itself, and where its numbers are, or nothing."""
    found = []
    for page in sorted((built / "book" / "_build" / "html" / "notebooks").glob("*.html")):
        soup = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")
        for figure in soup.select("article figure"):
            beside = figure.find_parent(class_="cell").find_next_sibling()
            link = beside.select_one(".rcbook-data a") if beside is not None else None
            found.append((page, figure, link["href"] if link else ""))
    return found


def test_every_figure_that_shows_data_has_its_numbers(built):
    sources = {}
    for path in (built / "notebooks").glob("*.ipynb"):
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "code":
                sources[data.name(cell, path.stem).replace("_", "-")] = cell.source
    found = figures(built)
    assert sum(bool(address) for *_, address in found) > 50
    for page, figure, address in found:
        if not address:
            source = sources[figure["id"]]
            assert not PLOTS.search(source), (page.name, figure["id"])
            assert ".draw_" in source, (page.name, figure["id"])


def test_every_file_of_numbers_can_be_read_and_is_linked_once(built):
    html = built / "book" / "_build" / "html"
    linked = [(page.parent / address).resolve() for page, _, address in figures(built) if address]
    assert sorted(linked) == sorted(path.resolve() for path in (html / "data").rglob("*.*"))
    for path in linked:
        found = pd.read_csv(path)
        assert {"series", "x_name", "y_name", "x", "y"} <= {*found}, path
        assert len(found) > 1, path
        assert found.y.notna().any(), path
        assert path.stat().st_size <= 2 * data.HEAVY, path


def test_the_words_of_a_link_tell_it_from_all_others(built):
    for page in (built / "book" / "_build" / "html" / "notebooks").glob("*.html"):
        soup = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")
        words = [link.get_text() for link in soup.select(".rcbook-data a")]
        assert all(re.match(r"Data \(CSV(, packed)?\) of \S", text) for text in words), page.name
        assert len(words) == len({*words}), page.name


# ---- the dark ----


def inks() -> list[str]:
    """Colours of words and curves that stand out on white: of the style, and of the drawings."""
    with plt.style.context(STYLE):
        cycle = [entry["color"] for entry in plt.rcParams["axes.prop_cycle"]]
        words = [plt.rcParams[name] for name in ("axes.labelcolor", "xtick.labelcolor")]
    drawn = [v for v in vars(sketch).values() if isinstance(v, str) and v.startswith("#")]
    found = {matplotlib.colors.to_hex(colour) for colour in (*cycle, *words, *drawn, "black")}
    return sorted(colour for colour in found if contrast(colour, "white") >= 4.5)


def pixels(tab, selector: str) -> np.ndarray:
    picture = tab.locator(selector).first
    picture.scroll_into_view_if_needed()
    return np.asarray(Image.open(io.BytesIO(picture.screenshot())).convert("RGB"))


def ground(tab) -> np.ndarray:
    colour = tab.evaluate("getComputedStyle(document.body).backgroundColor")
    return np.array([int(part) for part in re.findall(r"\d+", colour)[:3]])


def test_what_stands_out_on_white_stands_out_in_the_dark(visit):
    """Swatches go through the very rules that the figures of a page do."""
    colours = inks()
    assert len(colours) > 4
    row = np.array([[matplotlib.colors.to_rgb(c)] * 8 for c in (*colours, "white")])
    swatches = np.repeat((row.reshape(1, -1, 3) * 255).round().astype(np.uint8), 8, axis=0)
    packed = io.BytesIO()
    Image.fromarray(swatches).save(packed, "png")
    source = f"data:image/png;base64,{base64.b64encode(packed.getvalue()).decode()}"
    tab = visit("index.html", scheme="dark")
    tab.evaluate(
        "s => { const i = new Image(); i.src = s; i.id = 'swatches';"
        f" i.style = 'width: {swatches.shape[1]}px; max-width: none; display: block';"
        " document.querySelector('article').prepend(i); return i.decode(); }",
        source,
    )
    shown = pixels(tab, "#swatches")[4, 4::8] / 255
    for colour, seen in zip(colours, shown, strict=False):
        assert contrast(seen, ground(tab) / 255) >= 4.5, colour
    assert np.abs(shown[len(colours)] * 255 - ground(tab)).max() <= 2, "white is the page"


@pytest.mark.parametrize(
    ("page", "picture"),
    [
        ("index.html", "main img"),
        ("house.html", "main img"),
        ("notebooks/one_idea.html", "figure img"),
        ("notebooks/vsm_chatter.html", "figure img"),
    ],
)
def test_a_figure_lies_on_the_page_and_on_no_card(visit, page, picture):
    tab = visit(page, scheme="dark")
    seen = pixels(tab, picture).reshape(-1, 3)
    most = np.median(seen, axis=0)
    assert np.abs(most - ground(tab)).max() <= 3, page


def test_a_picture_with_sliders_lies_on_the_page_too(visit):
    tab = visit("notebooks/one_idea.html", scheme="dark")
    tab.locator(".cell_output:has(.rcbook-sliders)").first.scroll_into_view_if_needed()
    tab.wait_for_selector(".rcbook-sliders[data-ready]")
    seen = pixels(tab, ".rcbook-chart").reshape(-1, 3)
    assert np.abs(np.median(seen, axis=0) - ground(tab)).max() <= 3
