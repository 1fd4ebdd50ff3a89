"""What stands round the library says the same everywhere: versions, tools, templates."""

import re
import tomllib
from importlib import metadata

import pytest
import yaml
from conftest import ROOT

import rcbook
from rcbook import ledger
from rcbook.book import pages

TEXTS = [f"book/{path.name}" for path in sorted((ROOT / "book").glob("*.md"))]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LOCK = dict(
    re.findall(r"^([\w-]+)==([\w.]+)", (ROOT / "environment.txt").read_text("utf-8"), re.MULTILINE)
)


def test_the_version_stands_in_the_package_and_is_the_released_one():
    assert "version" not in PROJECT["project"] and PROJECT["project"]["dynamic"] == ["version"]
    read_from = PROJECT["tool"]["setuptools"]["dynamic"]["version"]
    assert read_from == {"attr": "rcbook.__version__"}
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    released = re.findall(
        r"^## (\d\S*) \((\S+)\)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE
    )
    given = str(citation["version"]), str(citation["date-released"])
    assert released[0] == given == (rcbook.__version__, given[1])


def test_the_hooks_run_the_tools_of_the_environment():
    """At the versions of the lock, then, and without asking another host."""
    text = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    assert "://" not in text
    (repo,) = yaml.safe_load(text)["repos"]
    assert repo["repo"] == "local"
    for hook in repo["hooks"]:
        folder, _, tool = hook["entry"].split()[0].rpartition("/")
        assert (folder, hook["language"]) == (".venv/bin", "system")
        assert metadata.version(tool) == LOCK[tool], f"{tool}; set up .venv anew"


def test_editors_are_told_the_line_length_that_ruff_holds():
    told = re.findall(r"max_line_length = (\d+)", (ROOT / ".editorconfig").read_text("utf-8"))
    assert told == [str(PROJECT["tool"]["ruff"]["line-length"])]


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.md")), ids=lambda path: path.stem
)
def test_a_template_has_a_head_that_can_be_read(path):
    _, head, body = path.read_text(encoding="utf-8").split("---\n", 2)
    assert {"name", "about", "title"} <= yaml.safe_load(head).keys()
    assert body.strip()


COUNTED = r"\b(\d+|one|two|three|four|five|six|seven|eight|nine|ten)\s+"
COUNTED += r"(\w+ )?(papers?|chapters?|case studies|claims?|verdicts|headlines|errata)\b"


def test_the_readme_lists_the_chapters_as_their_data_have_them():
    listed = pages.chapters([ledger.load(key) for key in ledger.papers()])
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"\n\n{listed}\n" in readme, f"its list of chapters has to be\n{listed}"


@pytest.mark.parametrize("path", ["README.md", "CONTRIBUTING.md", *TEXTS])
def test_nobody_types_how_many_chapters_or_claims_there_are(path):
    assert not counted((ROOT / path).read_text(encoding="utf-8")), "let it be computed"


def counted(text):
    """Counts of chapters or claims in a text, but for those that are of any number of them."""
    found = {match[0] for match in re.finditer(COUNTED, " ".join(text.split()), re.IGNORECASE)}
    return found - {"one paper"}


def test_a_typed_count_is_seen():
    assert counted("This edition holds four\ncase studies; a table for one paper.") == {
        "four case studies"
    }
