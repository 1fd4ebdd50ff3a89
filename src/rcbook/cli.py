"""The command `rcbook`: build the book, check its claims, print its ledger."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

# What executes and renders is imported where it is used: `rcbook --help` must not wait for it.

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 0 fine, 1 failed, 2 usage, 130 Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):  # a C locale must not stop us from printing µ
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="replace")
    # Whoever stops us by SIGTERM gets the clean-up that Ctrl-C gets.
    signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    arguments = _parser().parse_args(argv)
    try:
        return arguments.run(arguments)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # `rcbook ledger | head`
        sys.stderr.close()
        return OK
    except ModuleNotFoundError as error:
        print(f"rcbook: {error.name} is missing; pip install 'rcbook[book]'", file=sys.stderr)
    except (ValueError, OSError) as error:
        print(f"rcbook: {error}", file=sys.stderr)
    return FAILED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="rcbook", description=__doc__)
    parser.add_argument("--version", action="version", version=metadata.version("rcbook"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    build = commands.add_parser("build", help="execute, judge and render to book/_build/html")
    build.set_defaults(run=_build)
    check = commands.add_parser("check", help="execute and judge; exit 1 when a verdict flips")
    check.add_argument("--paper", metavar="KEY", help="only this chapter, with all its verdicts")
    check.set_defaults(run=_check)
    falsify = commands.add_parser("falsify", help="change the model and see each verdict flip")
    falsify.add_argument("--paper", metavar="KEY", help="only this paper, such as horng1989")
    falsify.add_argument("--change", metavar="NAME", help="only this change of the paper")
    falsify.add_argument("--measure", action="store_true", help="at all sizes; store the margins")
    falsify.set_defaults(run=_falsify)
    numbers = commands.add_parser("numbers", help="account for every number in the book's text")
    numbers.add_argument("--rewrite", action="store_true", help="execute, and type what comes out")
    numbers.add_argument("--file", metavar="NAME", help="only this file, such as one_idea.ipynb")
    numbers.set_defaults(run=_numbers)
    new = commands.add_parser("new", help="write the skeletons of a new case study")
    new.add_argument("key", metavar="KEY", help="such as smith2001")
    new.add_argument("--title", default="", help="of its chapter")
    new.set_defaults(run=_new)
    show = commands.add_parser("ledger", help="print the ledger of the last run")
    show.add_argument("--json", action="store_true", help="as a list of objects")
    show.add_argument("--paper", metavar="KEY", help="only this paper, such as horng1989")
    show.set_defaults(run=_ledger)
    return parser


def _check(arguments: argparse.Namespace) -> int:
    from rcbook.book import run
    from rcbook.book.project import find

    if not _known(arguments.paper):
        return USAGE
    project = find(Path.cwd())
    if arguments.paper:
        paper = next(paper for paper in project.papers if paper.key == arguments.paper)
        return OK if run.check_paper(project, paper).ok else FAILED
    return OK if run.check(project).ok else FAILED


def _build(_) -> int:
    from rcbook.book import render, run
    from rcbook.book.project import find

    project = find(Path.cwd())
    judged = run.check(project)
    if not judged.ok:
        print("the book was not rendered")
        return FAILED
    print("rendering the book ...", flush=True)
    try:
        print(f"open {render.render(project, judged)}")
    except render.RenderError as error:
        print(f"rcbook: {error}", file=sys.stderr)
        return FAILED
    return OK


def _falsify(arguments: argparse.Namespace) -> int:
    from rcbook import ledger
    from rcbook.book import falsify
    from rcbook.book.project import find

    if not _known(arguments.paper):
        return USAGE
    project = find(Path.cwd())
    keys = (arguments.paper,) if arguments.paper else ledger.papers()
    problems = shown = 0
    for paper in map(ledger.load, keys):
        names = [arguments.change] if arguments.change else list(paper.changes)
        first = 0 if arguments.measure else -1  # all sizes, or the largest
        wanted = [("", None)] if not arguments.change else []
        for name in names:
            wanted += [(name, size) for size in falsify.sizes(paper.changes.get(name, {}))[first:]]
        tried = falsify.trials(paper, project.notebooks, wanted)
        for trial in tried:
            turned = [id for id, v in trial.verdicts.items() if v != paper.claims[id].expected]
            head = f"{trial.change or 'no change'} {trial.size or ''}".strip()
            print(f"{paper.key}, {head}: {len(turned)} verdicts turned: {', '.join(turned)}")
            print("".join(f"    failed: {trouble}\n" for trouble in trial.troubles), end="")
        if arguments.change:
            continue
        print(falsify.listing(paper, tried))
        lacking = falsify.unflipped(paper, tried)
        print("".join(f"UNFLIPPED {problem}\n" for problem in lacking), end="")
        problems += len(lacking)
        shown += sum(claim.scored for claim in paper.claims.values())
        if arguments.measure and not lacking:
            falsify.store(paper, falsify.margins(paper, tried))
    print(f"{shown} scored claims, {problems} not shown to be falsifiable")
    return FAILED if problems else OK


def _numbers(arguments: argparse.Namespace) -> int:
    from rcbook.book import execute, numbers, run
    from rcbook.book.project import find
    from rcbook.ledger import marks

    project = find(Path.cwd())
    if arguments.rewrite:
        paths = sorted(project.notebooks.glob(arguments.file or "*.ipynb"))
        if not paths:
            raise ValueError(f"no notebook {arguments.file!r} in {project.notebooks}; name one")
        _, failures, typed = execute.execute(paths)
        for failure in failures:
            print(f"{failure.notebook}, {failure.cell}: {run.plain(failure.what)}")
        print(f"{numbers.rewrite(project, typed)} numbers rewritten")
    places = [p for p in numbers.survey(project) if arguments.file in (None, p.file)]
    if not places and arguments.file:
        raise ValueError(f"no text of the book is called {arguments.file!r}; name a file of it")
    lost = [place for place in places if place.number.kind == marks.UNACCOUNTED]
    print("".join(f"UNACCOUNTED {place}\n" for place in lost), end="")
    print(numbers.table(places))
    print(f"\n{len(places)} numbers in the text, {len(lost)} unaccounted")
    return FAILED if lost else OK


def _new(arguments: argparse.Namespace) -> int:
    from rcbook.book.new import create
    from rcbook.book.project import find

    project = find(Path.cwd())
    for path in create(project, arguments.key, arguments.title):
        print(f"wrote {path.relative_to(project.root)}")
    print(f"next: fill them in, then `rcbook check --paper {arguments.key}`")
    return OK


def _ledger(arguments: argparse.Namespace) -> int:
    from rcbook import ledger
    from rcbook.book.project import find

    if not _known(arguments.paper):
        return USAGE
    project = find(Path.cwd())
    file = project.ledger_file
    if project.stale_mark.exists():
        print("rcbook: the last run failed; this is the ledger of an earlier one", file=sys.stderr)
    if not file.is_file():
        raise ValueError("there is no ledger yet; run `rcbook check` first")
    rows = json.loads(file.read_text(encoding="utf-8"))
    rows = [row for row in rows if arguments.paper in (None, row["paper"])]
    if arguments.json:
        sys.stdout.write(ledger.dumps(rows))
    else:
        _print_table(rows)
    return OK


def _known(paper: str | None) -> bool:
    """Whether `paper` is the key of a paper, or none was asked for; says so if not."""
    from rcbook import ledger

    known = ledger.papers()
    if paper in (None, *known):
        return True
    print(f"rcbook: no paper {paper!r}; choose one of {', '.join(known)}", file=sys.stderr)
    return False


def _print_table(rows: Sequence[dict]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from rcbook.ledger import show

    table = Table(box=None, pad_edge=False)
    table.add_column("claim", min_width=max((len(row["id"]) for row in rows), default=5))
    for name in ("printed", "ours", "verdict", "reason"):
        table.add_column(name, overflow="fold")
    for row in rows:
        flip = "" if row["verdict"] == row["expected_verdict"] else " (NOT EXPECTED)"
        shown = (
            show.printed(row),
            show.value(row["computed"]),
            row["verdict"] + flip,
            row["reason"],
        )
        table.add_row(*(Text(cell) for cell in (row["id"], *shown)))  # brackets are no markup
    Console(width=None if sys.stdout.isatty() else 160).print(table)
    print(f"\n{show.counts(rows)}")


if __name__ == "__main__":
    sys.exit(main())
