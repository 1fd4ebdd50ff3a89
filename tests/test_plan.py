"""The page on how the library is built shows what the code says, and fails with it."""

import io
from itertools import pairwise

import matplotlib
import matplotlib.pyplot as plt
import pytest
import test_imports
from conftest import ROOT
from layouts import texts_stay_inside_and_apart

import rcbook
from rcbook.book import house

STYLE = "rcbook.pictures.rcbook"


@pytest.fixture
def drawn():
    """Draws a picture as the book does and gives its axes."""

    def drawn(name):
        draw, size = house._PICTURES[name]
        with plt.style.context(STYLE):
            figure, ax = plt.subplots(figsize=size)
            draw(ax)
            figure.draw_without_rendering()
        return ax

    yield drawn
    plt.close("all")


def test_the_arrows_are_the_imports():
    """Read once more, module by module, by the test that holds imports to their floors."""
    read = {
        room: set().union(*map(test_imports.rooms_used, paths))
        for room, paths in test_imports.ROOMS.items()
    }
    assert house.imports() == read


def test_every_room_and_every_import_is_drawn(drawn):
    texts = [text.get_text() for text in drawn("floors").texts]
    assert sorted(texts) == sorted(room for rooms in rcbook.FLOORS for room in rooms)
    used = house.imports()
    _, lines = house._lay_out(rcbook.FLOORS, used)
    assert len(lines) == sum(map(len, used.values()))


def test_a_line_passes_through_no_room_but_its_own_ends():
    used = house.imports()
    places, lines = house._lay_out(rcbook.FLOORS, used)
    assert not passed(places, lines)
    x = places["zdomain"][0]
    across = [[(x, -0.5), (x, 0.5)]]
    assert passed(places, across) == ["zdomain"]


def passed(places, lines):
    """Rooms that a line goes through, from floor to floor as its corners are set."""
    found = []
    for line in lines:
        for (x0, y0), (x1, y1) in pairwise(line):
            for room, (x, y) in places.items():
                low, high = sorted((y0, y1))
                across = low < y - 0.4 and high > y + 0.4
                at = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
                if across and abs(at - x) < house._WIDE / 2:
                    found.append(room)
    return found


def test_an_arrow_for_each_import_ends_in_a_head(drawn):
    heads = len(drawn("floors").patches) - len(house.imports())
    assert heads == sum(map(len, house.imports().values()))


@pytest.mark.parametrize("name", house._PICTURES)
def test_words_stay_inside_and_apart(drawn, name):
    texts_stay_inside_and_apart(drawn(name))


@pytest.mark.parametrize("name", [name for row in house.WAY for s in row for name in s.names])
def test_every_function_of_the_way_exists_and_says_what_it_does(name):
    assert house.resolve(name).__doc__


@pytest.mark.parametrize("name", ["rcbook.zdomain:phase", "rcbook.zdomain:inverse"])
def test_what_is_gone_or_no_function_is_named(name):
    with pytest.raises(ValueError, match=rf"house\.py: WAY names {name}.*mend"):
        house.resolve(name)


def test_every_room_import_and_station_is_said_in_words():
    floors, way = house.floors_in_words(), house.way_in_words()
    for room, others in house.imports().items():
        assert room in floors
        assert not others or f"{room} to {', '.join(sorted(others))}" in floors
    for station in (station for row in house.WAY for station in row):
        assert station.what in way
        assert all(house._short(name) in way for name in station.names)
    assert "$" not in floors + way and "\n" not in floors + way


def test_the_page_shows_both_pictures_and_its_text_is_short():
    text = (ROOT / "book" / "house.md").read_text(encoding="utf-8")
    for fragment, content in house.pages().items():
        assert f"```{{include}} {fragment}\n```" in text
        assert fragment.replace(".md", ".png") in content
    assert {f"{name}.png" for name in house._PICTURES} == house.pictures().keys()
    assert 200 <= len(text.split()) <= 400


def test_pictures_are_png_on_white_so_that_the_dark_theme_frames_them():
    for png in house.pictures().values():
        pixels = matplotlib.image.imread(io.BytesIO(png))
        assert pixels[0, 0, :3].tolist() == [1.0, 1.0, 1.0]
