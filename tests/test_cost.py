"""The page Cost and scale: what it says is what the stored run holds."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rcbook.book import cost

ROOT = Path(__file__).parent.parent
ROW = {
    "area": "Repetitive loop",
    "question": "run with limits",
    "against": "plain Python",
    "median": 12.34,
    "low": 10.0,
    "high": 15.0,
    "unit": "x",
    "sense": "at least",
    "goal": 20,
    "met": False,
    "took": 0.00123,
    "peak": 1_500_000,
    "peak_against": 30_000,
}
GROWING = {
    "area": "Periodic loop",
    "question": "verdict",
    "against": "its own size",
    "median": 1.05,
    "low": 0.98,
    "high": 1.12,
    "unit": " exponent",
    "sense": "at most",
    "goal": 1.2,
    "met": True,
    "points": [[10, 0.1], [20, 0.2], [10, 0.11], [20, 0.21]],
}
RUN = {
    "datetime": "2026-11-26T22:15:02",
    "commit_info": {"id": "0123456789", "dirty": True, "time": ""},
    "machine_info": {"cpu": "a processor", "cores": 2, "python": "3.11.7", "system": "Linux"},
    "versions": {"numpy": "2.4.6"},
    "benchmarks": [{"extra_info": ROW}, {"extra_info": GROWING}],
}


@pytest.fixture
def run(tmp_path):
    (tmp_path / cost.RUN).write_text(json.dumps(RUN), encoding="utf-8")
    return cost.read(tmp_path)


def test_a_row_is_shown_with_result_goal_and_costs(run):
    shown = cost.pages(run)["cost_rows.md"]
    assert "### Repetitive loop" in shown and "### Periodic loop" in shown
    line, grows = (line for line in shown.splitlines() if line.startswith('<tr role="row"><td'))
    cells = re.findall(r'data-label="([^"]+)">(.*?)</td>', line)
    assert cells == [
        ("Question", "run with limits"),
        ("Compared with", "plain Python"),
        ("Result", "12.3 times faster<br><small>10 to 15</small>"),
        ("Goal", "at least 20 times faster<br><b>missed</b>"),
        ("One call", "1.2 ms"),
        ("Memory at most", "1.5 MB / 0.03 MB"),
    ]
    assert r"\(N^{1.05}\)" in grows and "0.98 to 1.12" in grows
    assert r"at most <span" in grows and r"\(N^{1.2}\)</span><br>met" in grows


def test_the_stamp_says_when_where_and_how_many_goals_were_met(run):
    stamp = cost.stamp(run)
    for part in ("2026-11-26", "`0123456`", "not committed", "numpy 2.4.6", "2 cores"):
        assert part in stamp
    assert "2 questions; 1 goals are met and 1 missed" in stamp


def test_the_picture_of_growth_is_drawn_and_told(run):
    assert cost.pictures(run)["growth.png"].startswith(b"\x89PNG")
    assert "verdict: as N to the power 1.05, 0.98 to 1.12" in cost.growth_in_words(run["rows"])


@pytest.mark.parametrize(
    "content",
    [None, "", "[]", "{}", '{"benchmarks": []}', '{"benchmarks": [1]}'],
)
def test_a_run_that_is_none_is_refused_with_the_mend(tmp_path, content):
    if content is not None:
        (tmp_path / cost.RUN).write_text(content, encoding="utf-8")
    with pytest.raises(ValueError, match=r"cost\.json.*make bench"):
        cost.read(tmp_path)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(12.34, "12 s"), (1.0, "1 s"), (0.256, "260 ms"), (0.00123, "1.2 ms"), (3.21e-6, "3.2 µs")],
)
def test_durations_have_two_digits(seconds, text):
    assert cost.duration(seconds) == text


def test_the_page_includes_every_fragment_and_types_no_number():
    page = (ROOT / "book" / "cost.md").read_text(encoding="utf-8")
    for fragment in cost.pages(cost.read(ROOT / "book")):
        assert f"```{{include}} {fragment}" in page


def test_the_stored_run_is_whole_and_of_this_project():
    run = cost.read(ROOT / "book")
    for row in run["rows"]:
        assert ROW.keys() - {"took", "peak", "peak_against"} <= row.keys()
        better = row["median"] >= row["goal"], row["median"] <= row["goal"]
        assert row["met"] == better[row["sense"] == "at most"]
    assert len({(row["question"], row["against"]) for row in run["rows"]}) == len(run["rows"])
    assert "node" not in run["machine_info"]


def test_a_row_that_misses_its_goal_fails_nothing_and_is_said_to(tmp_path):
    """The fixture at work, on a peer that cannot be a million times slower."""
    shutil.copy(ROOT / "benchmarks" / "conftest.py", tmp_path)
    (tmp_path / "test_rows.py").write_text(
        '"""An area."""\n'
        "def test_a(row):\n"
        "    row.faster(list, dict, 1e6, rounds=2, question='a list', against='a dict')\n"
        "def test_b(row):\n"
        "    row.growth([1, 2], lambda n: list, 9, question='lists', against='none')\n"
        "def test_c(row):\n"
        "    row.faster(list, list, 1e3, 2, parts=1e6, question='whole', against='a millionth')\n",
        encoding="utf-8",
    )
    command = [sys.executable, "-m", "pytest", str(tmp_path), "--benchmark-quiet"]
    command += ["--benchmark-json", str(tmp_path / cost.RUN), "-p", "no:cacheprovider"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "a list" in done.stdout and "NOT MET" in done.stdout
    first, second, third = cost.read(tmp_path)["rows"]
    assert (first["area"], first["met"], first["goal"]) == ("An area", False, 1e6)
    assert len(second["points"]) == 6
    assert third["met"] and third["low"] > 1e3  # of the whole question, and not of the part asked
