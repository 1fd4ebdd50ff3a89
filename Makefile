# make book: set up, execute every notebook, judge every claim, render book/_build/html/index.html
# make test: set up, run the test suite        make check: as `book`, without rendering
# make pdf: the book as one PDF, book/_build/rcbook.pdf; builds it first where it is not up to date
# make bench: time the library against what else would answer, and store the run (ten minutes)
# PYTHON=/path/to/python3.12 chooses the interpreter.

.PHONY: book pdf test check bench clean
.DELETE_ON_ERROR:

book: .venv/ready
	.venv/bin/python -m rcbook.cli build

pdf: .venv/ready
	.venv/bin/python -m rcbook.cli pdf

check: .venv/ready
	.venv/bin/python -m rcbook.cli check

test: .venv/ready
	.venv/bin/python -m pytest

# On one thread, as the notebooks run; stored only if every row could be measured.
bench: .venv/ready
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 .venv/bin/python -m pytest benchmarks -m "not long" \
	  --benchmark-quiet --benchmark-json=book/cost.json.part
	mv book/cost.json.part book/cost.json

clean:
	rm -rf .venv book/_build

CANDIDATES = $(or $(PYTHON),python3.11 python3.12 python3.13 python3 python)
FITS = import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info < (3, 14))

# A candidate is run and asked, since a name on the path need not be an interpreter that works.
# The marker is made last, so a set-up that was interrupted is made again from nothing.
.venv/ready: environment.txt pyproject.toml
	@for python in $(CANDIDATES); do \
	  if "$$python" -c '$(FITS)' >/dev/null 2>&1; then \
	    rm -rf .venv && echo "setting up .venv with $$("$$python" --version) (once)" && \
	    "$$python" -m venv .venv && exit 0; rm -rf .venv; exit 1; \
	  fi; \
	done; \
	echo "rcbook needs Python 3.11, 3.12 or 3.13 with venv; none found among: $(CANDIDATES)" >&2; \
	exit 1
	.venv/bin/python -m pip install --disable-pip-version-check --require-hashes -r environment.txt
	.venv/bin/python -m pip install --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@
