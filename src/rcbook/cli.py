"""The command `rcbook`: build the book, check its claims, print its ledger."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from rcbook import __version__

# What executes and renders is imported where it is used: `rcbook --help` must not wait for it.

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 0 fine, 1 failed, 2 usage, 130 Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):  # a C locale must not stop us from printing µ
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="replace")
    # Whoever stops us by SIGTERM gets the clean-up that Ctrl-C gets.
    signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a job in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
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
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    build = commands.add_parser("build", help="execute, judge and render to book/_build/html")
    build.set_defaults(run=_build)
    pdf = commands.add_parser("pdf", help="print the book to book/_build/rcbook.pdf")
    pdf.set_defaults(run=_pdf)
    check = commands.add_parser("check", help="execute and judge; exit 1 when a verdict flips")
    check.add_argument("--paper", metavar="KEY", help="only this paper, with all its verdicts")
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


def _pdf(arguments: argparse.Namespace) -> int:
    from rcbook.book import pdf
    from rcbook.book.project import find
    from rcbook.book.render import RenderError

    project = find(Path.cwd())
    try:
        browser = pdf.browser()  # before minutes are spent on a book that cannot be printed
        if pdf.is_old(project) and _build(arguments) != OK:
            return FAILED
        print("printing the book ...", flush=True)
        print(f"open {pdf.make(project, browser)}")
    except RenderError as error:
        print(f"rcbook: {error}", file=sys.stderr)
        return FAILED
    return OK


def _falsify(arguments: argparse.Namespace) -> int:
    from rcbook.book import falsify
    from rcbook.book.project import find

    if not _known(arguments.paper):
        return USAGE
    project = find(Path.cwd())
    papers = [paper for paper in project.papers if arguments.paper in (None, paper.key)]
    change, measure = arguments.change or "", arguments.measure
    return OK if falsify.falsify(papers, project.notebooks, change, measure) else FAILED


def _numbers(arguments: argparse.Namespace) -> int:
    from rcbook.book import numbers
    from rcbook.book.project import find

    project = find(Path.cwd())
    if arguments.rewrite:
        numbers.execute_and_rewrite(project, arguments.file)
    return OK if numbers.report(project, arguments.file) else FAILED


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
    from rcbook.book import last
    from rcbook.book.project import Project, root_of

    if not _known(arguments.paper):
        return USAGE
    project = Project(root_of(Path.cwd()), ())  # the rows of the last run say all of the papers
    rows = [row for row in last.read(project) if arguments.paper in (None, row["paper"])]
    if project.stale_mark.exists():
        print("rcbook: the last run failed; this is the ledger of an earlier one", file=sys.stderr)
    if arguments.json:
        sys.stdout.write(ledger.dumps(rows))
    else:
        last.print_table(rows)
    return OK


def _known(paper: str | None) -> bool:
    """Whether `paper` is the key of a paper, or none was asked for; says so if not."""
    from rcbook import ledger

    if paper is None or paper in (known := ledger.papers()):
        return True
    print(f"rcbook: no paper {paper!r}; choose one of {', '.join(known)}", file=sys.stderr)
    return False


if __name__ == "__main__":
    sys.exit(main())
