"""Executing and judging: each check is shown to fail, and a failure changes nothing."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time

import nbformat
import pytest
from conftest import COVER, LEDGER, alive

from rcbook import ledger
from rcbook.book import render, run

PID = "import os\nopen('pid', 'w').write(str(os.getpid()))"


def test_all_is_well_and_the_ledger_is_kept(make):
    project = make(one=[LEDGER])
    judged = run.check(project)
    assert judged.ok
    rows = json.loads(project.ledger_file.read_text(encoding="utf-8"))
    assert [row["id"] for row in rows] == ["fake.x", "fake.y", "fake.z"]
    assert [path.name for path in project.build.iterdir()] == ["ledger.json"]


def test_a_failing_notebook_is_named_with_cell_source_and_traceback(make, capsys):
    project = make(one=[LEDGER], two=["a = 1", "b = a / 0", "c = 3"])
    judged = run.check(project)
    said = capsys.readouterr().out
    assert not judged.ok
    assert not project.ledger_file.exists()
    assert "FAILED two.ipynb, code cell 2 of 3: ZeroDivisionError" in said
    assert "    b = a / 0" in said
    assert "Traceback" in said
    assert "\x1b" not in said
    assert not judged.missing, "the other notebook came to its end"


def test_a_hanging_notebook_is_stopped(make, capsys):
    project = make(one=[LEDGER, PID, "import time; time.sleep(60)"])
    judged = run.check(project, limit=8.0)
    assert "code cell 3 of 3: still running after 8 s" in capsys.readouterr().out
    assert not judged.ok
    assert not alive(int((project.notebooks / "pid").read_text()))


def test_a_dead_kernel_is_a_failure(make, capsys):
    judged = run.check(make(one=[LEDGER, "import os; os._exit(3)"]))
    assert "code cell 2 of 2: its kernel died" in capsys.readouterr().out
    assert not judged.ok


def test_a_warning_is_a_failure(make, capsys):
    judged = run.check(make(one=[LEDGER, "import warnings; warnings.warn('beware of this')"]))
    said = capsys.readouterr().out
    assert "code cell 2 of 2: it wrote to stderr" in said
    assert "beware of this" in said
    assert not judged.ok


def test_a_claim_never_computed_fails_and_keeps_the_old_ledger(make, capsys):
    project = make(one=[LEDGER.replace('ledger.check("fake.z")\n', "")])
    run.write(project.ledger_file, "old\n")
    judged = run.check(project)
    assert judged.missing == ["fake.z"]
    assert "NEVER COMPUTED fake.z" in capsys.readouterr().out
    assert not judged.ok
    assert project.ledger_file.read_text() == "old\n"


def test_a_flipped_verdict_fails_and_is_written_down(make, capsys):
    project = make(one=[LEDGER.replace("2.01", "2.2")])
    judged = run.check(project)
    said = capsys.readouterr().out
    assert "FLIPPED fake.x: printed 2.0, ours 2.2" in said
    assert "verdict not reproduced, expected reproduced" in said
    assert not judged.ok
    assert judged.complete
    row = json.loads(project.ledger_file.read_text(encoding="utf-8"))[0]
    assert (row["verdict"], row["expected_verdict"]) == ("not reproduced", "reproduced")


def test_a_later_display_overrides_an_earlier_one(make):
    partial = 'from fake_paper import ledger\nledger.check("fake.x", 9.0)\nledger'
    assert run.check(make(one=[partial, LEDGER])).ok


def test_two_notebooks_that_disagree_are_a_failure(make, capsys):
    other = 'from fake_paper import ledger\nledger.check("fake.x", 9.0)\nledger'
    judged = run.check(make(one=[LEDGER], two=[other]))
    assert not judged.ok
    assert "it contradicts one.ipynb about fake.x" in capsys.readouterr().out


def test_a_claim_of_no_paper_is_a_failure(make, capsys):
    bundle = {ledger.MIME: [{"id": "fake.q"}]}
    stray = f"from IPython.display import display\ndisplay({bundle!r}, raw=True)"
    assert not run.check(make(one=[LEDGER, stray])).ok
    assert "it judges fake.q" in capsys.readouterr().out


def test_a_file_that_is_no_notebook_is_named(make):
    project = make(one=[LEDGER])
    (project.notebooks / "two.ipynb").write_text("{")
    with pytest.raises(ValueError, match=r"two\.ipynb is not a notebook"):
        run.check(project)


def test_the_users_own_setup_stays_outside(make, monkeypatch, tmp_path):
    """A kernel of the same name, a start-up file, a style and a backend change nothing."""
    kernel = tmp_path / "home" / "kernels" / "python3"
    kernel.mkdir(parents=True)
    argv = [sys.executable, "-c", "raise SystemExit('the wrong kernel')", "{connection_file}"]
    spec = {"argv": argv, "display_name": "Python 3", "language": "python"}
    (kernel / "kernel.json").write_text(json.dumps(spec))
    startup = tmp_path / "home" / "profile_default" / "startup"
    startup.mkdir(parents=True)
    (startup / "00.py").write_text("leaked = 1")
    (tmp_path / "home" / "matplotlibrc").write_text("lines.linewidth: 77")
    for name in ("JUPYTER_PATH", "JUPYTER_DATA_DIR", "IPYTHONDIR", "MPLCONFIGDIR"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    monkeypatch.setenv("MATPLOTLIBRC", str(tmp_path / "home" / "matplotlibrc"))
    monkeypatch.setenv("MPLBACKEND", "svg")
    look = f"""import os, sys, matplotlib
assert sys.executable == {sys.executable!r}
assert "leaked" not in globals()
assert matplotlib.rcParams["lines.linewidth"] == 1.5
assert "inline" in matplotlib.get_backend()
assert os.environ["OMP_NUM_THREADS"] == "1"
assert os.environ["PYTHONHASHSEED"] == "0"
assert os.path.basename(os.getcwd()) == "notebooks\""""
    judged = run.check(make(one=[look, LEDGER]))
    assert judged.ok, judged.failures


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
@pytest.mark.parametrize(
    ("number", "ctrl_c"),
    [
        (signal.SIGINT, signal.SIG_DFL),
        (signal.SIGTERM, signal.SIG_DFL),
        (signal.SIGTERM, signal.SIG_IGN),  # as a shell starts a job in the background
    ],
)
def test_an_interrupt_leaves_nothing_behind(make, number, ctrl_c):
    project = make(one=[LEDGER, PID, "import time; time.sleep(60)"])
    for paper in map(ledger.load, ledger.papers()):  # the command looks for all of the package
        for chapter in paper.chapters:
            title = nbformat.v4.new_markdown_cell(f"# {chapter.title}")
            own = [c.id for c in paper.claims.values() if paper.place(c) == chapter.notebook]
            judges = "\n".join(f"lambda: check({id!r})" for id in own)
            stub = nbformat.v4.new_notebook(cells=[title, nbformat.v4.new_code_cell(judges)])
            nbformat.write(stub, project.notebooks / chapter.notebook)
    run.write(project.ledger_file, "old\n")
    command = [sys.executable, "-m", "rcbook.cli", "check"]
    before = signal.signal(signal.SIGINT, ctrl_c)  # a child inherits whether it is ignored
    try:
        process = subprocess.Popen(command, cwd=project.root, stdout=-1, stderr=-1)
    finally:
        signal.signal(signal.SIGINT, before)
    pid = project.notebooks / "pid"
    for _ in range(600):
        if pid.is_file() and pid.read_text():
            break
        time.sleep(0.1)
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 130, (out, err)
    assert err.decode().strip() == "interrupted"
    assert not alive(int(pid.read_text()))
    assert [path.name for path in project.build.iterdir()] == ["ledger.json"]
    assert project.ledger_file.read_text() == "old\n"


def test_the_executed_run_is_the_rendered_one(make):
    """Executed once; the old book gives way; ledger, errata and cover are of this run."""
    count = "open('count', 'a').write('x')"
    project = make(one=[count, "import time; stamp = time.time_ns(); print(stamp)", COVER, LEDGER])
    (project.html).mkdir(parents=True)
    (project.html / "old").touch()
    judged = run.check(project)
    first = render.render(project, judged)
    assert (project.notebooks / "count").read_text() == "x"
    stamp = judged.notebooks["one.ipynb"].cells[2].outputs[0].text.strip()
    chapter = (project.html / "notebooks" / "one.html").read_text(encoding="utf-8")
    assert stamp in chapter
    assert '<a href="../ledger.html#fake.y"><code>fake.y</code></a>' in chapter
    assert "The gain" in (project.html / "ledger.html").read_text(encoding="utf-8")
    assert "typographical" in (project.html / "errata.html").read_text(encoding="utf-8")
    assert (project.html / "_images" / "cover.png").is_file()
    landing = (project.html / "index.html").read_text(encoding="utf-8")
    assert 'alt="a curve"' in landing and "From the chapter" in landing
    assert first.is_file()
    assert not (project.html / "old").exists()
    assert sorted(path.name for path in project.build.iterdir()) == ["html", "ledger.json"]


def test_a_warning_of_the_renderer_leaves_the_old_book(make):
    project = make(one=[COVER, LEDGER])
    project.html.mkdir(parents=True)
    (project.html / "index.html").write_text("old")
    with open(project.book / "index.md", "a", encoding="utf-8") as file:
        file.write("\n[nowhere](nowhere.md)\n")
    with pytest.raises(render.RenderError, match="nowhere"):
        render.render(project, run.check(project))
    assert (project.html / "index.html").read_text() == "old"
    assert sorted(path.name for path in project.build.iterdir()) == ["html", "ledger.json"]


def test_a_swap_that_fails_half_way_is_undone(tmp_path):
    target, aside = tmp_path / "html", tmp_path / "aside"
    target.mkdir()
    with pytest.raises(FileNotFoundError):
        render.swap(tmp_path / "not there", target, aside)
    assert target.is_dir()
    assert not aside.exists()


def test_a_book_without_a_cover_is_refused():
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1")])
    with pytest.raises(render.RenderError, match="tag a code cell"):
        render.cover({"one.ipynb": notebook})


def test_mathjax_is_the_self_contained_file():
    assert importlib.util.find_spec("rcbook") is not None
    assert render.mathjax().stat().st_size > 2_000_000
