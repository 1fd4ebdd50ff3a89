"""The end of every chapter: where to run it, and where to report an error."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import yaml

from rcbook.book.project import read_text

_ON_GITHUB = re.compile(r"https://github\.com/([\w.-]+/[\w.-]+?)(?:\.git)?/?")


@dataclass(frozen=True)
class Repository:
    """Where the notebooks can be had from: an address, empty when there is none, and a branch."""

    url: str = ""
    branch: str = "main"


def repository(book: Path) -> Repository:
    """The `repository` of the configuration in the folder `book`.

    Raises ValueError for an address that is neither empty nor one of the web.
    """
    path = book / "_config.yml"
    said = (yaml.safe_load(read_text(path)) or {}).get("repository") or {}
    url, branch = said.get("url") or "", said.get("branch") or "main"
    if url and not re.fullmatch(r"https://[^\s/]+/[^\s<>\"()]+", url):
        raise ValueError(
            f"{path}: repository.url is {url!r}; give an address that begins with https://, or none"
        )
    return Repository(url.rstrip("/"), branch)


def section(name: str, repository: Repository) -> str:
    """The last section of the chapter made from the notebook `name`, as MyST Markdown."""
    source = f"git+{repository.url}@{repository.branch}" if repository.url else "."
    where = "" if repository.url else ", said in a checkout,"
    parts = [
        "## Run this chapter",
        f"{{download}}`{name} <../downloads/{name}>` is this chapter as a notebook. It runs in any "
        f"Jupyter whose Python has the library; this{where} installs both:",
        f'```\npip install jupyterlab "{source}"\n```',
        *_in_the_browser(name, repository),
        _errors(repository),
    ]
    return "\n\n".join(parts)


def _in_the_browser(name: str, repository: Repository) -> list[str]:
    """Where the notebook runs on machines of others; nothing without a repository they can read."""
    found = _ON_GITHUB.fullmatch(repository.url)
    if not found:
        return []
    place = f"{found[1]}/{quote(repository.branch)}"
    binder = f"https://mybinder.org/v2/gh/{place}?labpath={quote(f'notebooks/{name}', safe='')}"
    colab = (
        f"https://colab.research.google.com/github/{found[1]}/blob/{quote(repository.branch)}"
        f"/notebooks/{quote(name)}"
    )
    return [f"Without an installation: [on Binder]({binder}) or [on Colab]({colab})."]


def _errors(repository: Repository) -> str:
    where = "who gave you this book"
    if repository.url:
        where = f"[the authors]({repository.url}/issues)"
    return (
        f"An error, or a doubt? Tell {where}, with the number of the figure or equation, or the "
        "name of the claim as the [ledger](../ledger.md) has it. A claim that you can show to be "
        "judged wrongly is the best report of all."
    )
