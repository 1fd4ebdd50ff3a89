"""Read `papers/KEY.toml` and refuse what cannot be judged, with the mend."""

from __future__ import annotations

import json
import math
import string
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, fields
from importlib import resources

from rcbook.ledger.claim import (
    CORRECTED,
    KINDS,
    NOT_COMPUTABLE,
    NOT_REPRODUCED,
    ROLES,
    VERDICTS,
    Chapter,
    Claim,
    Paper,
    tolerances,
)
from rcbook.ledger.marks import without_marks
from rcbook.ledger.words import ROW_OF


def papers() -> tuple[str, ...]:
    """Keys of all papers in the package, in the order of their chapters."""
    files = resources.files("rcbook").joinpath("papers").iterdir()
    found = {f.name.removesuffix(".toml"): f for f in files if f.name.endswith(".toml")}
    places = {key: _parsed(f).get("chapter") for key, f in found.items()}
    known = {key: place if isinstance(place, int) else 0 for key, place in places.items()}
    return tuple(sorted(found, key=lambda key: (known[key], key)))


def load(key: str) -> Paper:
    """Read and validate `papers/KEY.toml`.

    Raises ValueError for an unknown key, a claim given twice, an unknown kind or verdict, a
    reference to a convention or erratum that is not there, and a claim expected to fail whose
    reason quotes nothing computed.
    """
    data = source(key)
    if data.get("key") != key:
        raise ValueError(f"{key}.toml: its key is {data.get('key')!r}; make it {key!r}")
    parts = [f.name for f in fields(Paper) if f.name not in ("key", "margins", "further")]
    if absent := [part for part in parts if part not in data]:
        raise ValueError(f"{key}.toml lacks {', '.join(absent)}; add them")
    if unknown := data.keys() - {"key", "further", *parts}:
        raise ValueError(f"{key}.toml: unknown part {', '.join(sorted(unknown))}; remove it")
    _check_types(key, data)
    _check_tables(key, data)
    try:
        claims = _claims(key, data)
    except ValueError as error:
        raise ValueError(f"{key}.toml, {error}") from None
    margins = resources.files("rcbook").joinpath("papers", f"{key}.margins.json")
    try:
        measured = json.loads(margins.read_text(encoding="utf-8")) if margins.is_file() else {}
        measured = measured.get("claims", {})
    except (ValueError, AttributeError):
        raise ValueError(f"{margins.name} is damaged; remove it and measure anew") from None
    given = _unmarked({part: data[part] for part in parts}) | {"claims": claims}
    further = [Chapter(**_unmarked(entry)) for entry in data.get("further", [])]
    return Paper(key, **given, margins=measured, further=further)


_TYPES = {"title": str, "citation": str, "notebook": str, "chapter": int, "claims": list}


def _check_types(key: str, data: Mapping) -> None:
    tables = dict.fromkeys(("idea", "conventions", "errata", "changes"), dict)
    for name, kind in (_TYPES | tables).items():
        if not isinstance(data[name], kind) or isinstance(data[name], bool):
            raise ValueError(f"{key}.toml: {name} = {data[name]!r} is no {kind.__name__}; mend it")
    if data["chapter"] < 1 or not data["title"].strip():
        raise ValueError(f"{key}.toml: give a title and a chapter of 1 or more")
    _check_chapters(key, data)
    for entry in data["claims"]:
        if not isinstance(entry, dict):
            raise ValueError(f"{key}.toml: claim {entry!r} is no table; write [[claims]]")
        for name, given in entry.items():
            number = isinstance(given, int | float) and not isinstance(given, bool)
            if not (number if name == "tolerance" else isinstance(given, str)):
                wanted = "a number" if name == "tolerance" else "a text in quotes"
                at = entry.get("id", "a claim without id")
                raise ValueError(f"{key}.toml, {at}: {name} = {given!r}; give {wanted}")


def _check_chapters(key: str, data: Mapping) -> None:
    """The paper's own notebook and further ones, which are tables with title and idea."""
    further = data.get("further", [])
    if not isinstance(further, list) or not all(isinstance(entry, dict) for entry in further):
        raise ValueError(f"{key}.toml: further = {further!r} is no list; write [[further]]")
    wanted = {field.name for field in fields(Chapter)}
    for entry in further:
        if wrong := wanted ^ entry.keys():
            raise ValueError(
                f"{key}.toml, [[further]]: {', '.join(sorted(wrong))} is missing or unknown; "
                f"give {', '.join(sorted(wanted))}"
            )
        if not str(entry["title"]).strip():
            raise ValueError(f"{key}.toml, [[further]]: give a title")
    names = [data["notebook"], *(entry["notebook"] for entry in further)]
    for name in names:
        named = isinstance(name, str) and name.endswith(".ipynb")
        if not named or {"/", "\\"} & {*name} or names.count(name) > 1:
            raise ValueError(f"{key}.toml: notebook {name!r}; give the name of a notebook, once")


_TABLES = {  # fields that must be there, and fields that may be
    "conventions": ({"title", "text"}, set()),
    "errata": ({"where", "printed", "corrected", "why"}, set()),
    "changes": ({"what", "apply"}, {"sizes", "unit"}),
}


def _check_tables(key: str, data: Mapping) -> None:
    ideas = [data["idea"], *(chapter["idea"] for chapter in data.get("further", []))]
    entries = [("idea", idea, ({"cite", "loop", "index", "period"}, set())) for idea in ideas]
    for name, allowed in _TABLES.items():
        entries += [(f"{name}.{at}", entry, allowed) for at, entry in data[name].items()]
    for at, entry, (needed, optional) in entries:
        if not isinstance(entry, dict):
            raise ValueError(f"{key}.toml, [{at}]: {entry!r} is no table; give {sorted(needed)}")
        if absent := needed - entry.keys():
            raise ValueError(f"{key}.toml, [{at}]: lacks {', '.join(sorted(absent))}; add it")
        if unknown := entry.keys() - needed - optional:
            raise ValueError(f"{key}.toml, [{at}]: unknown {', '.join(sorted(unknown))}; remove it")
        for name, given in entry.items():
            if name != "sizes" and not isinstance(given, str):
                raise ValueError(f"{key}.toml, [{at}]: {name} = {given!r}; give a text in quotes")
        sizes = entry.get("sizes", [1])
        if not isinstance(sizes, list) or not sizes or not all(map(_is_size, sizes)):
            raise ValueError(f"{key}.toml, [{at}]: sizes {sizes!r}; give one or more above 0")
        if "rcbook.ledger" in entry.get("apply", "") or ".check" in entry.get("apply", ""):
            raise ValueError(f"{key}.toml, [{at}]: it reaches for the verdicts; change the model")


def _is_size(size: object) -> bool:
    number = isinstance(size, int | float) and not isinstance(size, bool)
    return number and 0 < size < math.inf


def source(key: str) -> dict:
    """What `papers/KEY.toml` holds, marks and all.  Raises ValueError for an unknown key."""
    file = resources.files("rcbook").joinpath("papers", f"{key}.toml")
    if not file.is_file():
        raise ValueError(f"no paper {key!r}; choose one of {', '.join(papers())}")
    return _parsed(file)


def _parsed(file) -> dict:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:  # no UTF-8, or no TOML
        raise ValueError(f"{file.name}: {error}; mend it there") from None


def _claims(key: str, data: Mapping) -> dict[str, Claim]:
    claims: dict[str, Claim] = {}
    for entry in data["claims"]:
        claim = _claim(key, entry)
        if claim.id in claims:
            raise ValueError(f"{claim.id} stands twice; remove one")
        _validate(claim, data)
        claims[claim.id] = claim
    return claims


def _claim(paper: str, entry: Mapping) -> Claim:
    known = {f.name: f.default is MISSING for f in fields(Claim) if f.init and f.name != "paper"}
    known["role"] = True
    name = entry.get("id", "a claim without id")
    if unknown := entry.keys() - known:
        raise ValueError(f"{name}: unknown field {', '.join(sorted(unknown))}; remove it")
    if absent := [field for field, needed in known.items() if needed and field not in entry]:
        raise ValueError(f"{name}: lacks {', '.join(absent)}; add it")
    if entry["kind"] not in KINDS:
        raise ValueError(f"{name}: kind {entry['kind']!r} is none of {', '.join(KINDS)}")
    return Claim(paper=paper, **_unmarked(entry))


def _unmarked(item):
    """`item` with the marks of its numbers taken out of every text."""
    if isinstance(item, str):
        return without_marks(item)
    if isinstance(item, dict):
        return {name: _unmarked(part) for name, part in item.items()}
    return item


def _validate(claim: Claim, data: Mapping) -> None:
    found = _unknown(claim, data) or _unfit_tolerance(claim) or _unfit_verdict(claim)
    if found:
        raise ValueError(f"{claim.id}: {found}")


def _unknown(claim: Claim, data: Mapping) -> str:
    """What the claim names that is not there, or nothing."""
    if not claim.id.startswith(f"{claim.paper}."):
        return "its id does not begin with the paper's key"
    known = {
        "expected": VERDICTS,
        "role": ROLES,
        "convention": data["conventions"],
        "erratum": ("", *data["errata"]),
        "flips_under": ("", *data["changes"]),
        "word": ("", *ROW_OF),
        "notebook": ("", *(chapter["notebook"] for chapter in data.get("further", []))),
    }
    for name, choices in known.items():
        if (given := getattr(claim, name)) not in choices:
            among = ", ".join(filter(None, choices)) or "nothing: the paper has none"
            return f"{name} {given!r} is none of {among}"
    if claim.flips_under and not claim.scored:
        return f"an {claim.role} has no verdict to flip; remove flips_under"
    return ""


def _unfit_tolerance(claim: Claim) -> str:
    if claim.word and claim.tolerance is not None:
        return "it has a word and a tolerance of its own; remove one"
    if (claim.tolerance is not None) != bool(claim.tolerance_reason):
        return "a tolerance of its own needs a tolerance_reason, and the other way round"
    if claim.tolerance is not None and not 0 <= claim.tolerance < math.inf:
        return f"tolerance {claim.tolerance!r} is not a finite number of 0 or more"
    if claim.tolerance is not None and tolerances(claim) is None:
        return f"a tolerance means nothing for {claim.printed!r}; remove it"
    return ""


def _unfit_verdict(claim: Claim) -> str:
    if claim.mended and not claim.erratum:
        return f"mended {claim.mended!r} names no erratum that mends it; add its key"
    if claim.beyond_computation != (claim.expected == NOT_COMPUTABLE):
        return "a measurement, or what says what is `lost`, is not computable, and nothing else"
    if claim.expected in (NOT_REPRODUCED, NOT_COMPUTABLE) and not claim.reason:
        return "it is expected to fail and gives no reason"
    try:
        quoted = quotes(claim.reason)
    except ValueError as error:
        return f"its reason cannot be read ({error}); write a brace that is no evidence twice"
    if claim.expected == NOT_REPRODUCED and not quoted - {"printed"}:
        return "its reason quotes nothing computed; put evidence in {braces}"
    if claim.expected == CORRECTED and not claim.erratum and claim.convention == "primary":
        return "a correction names its erratum or its convention"
    return ""


def quotes(reason: str) -> set[str]:
    """The names in the braces of a claim's reason.

    Raises ValueError for a brace without a plain name, and for one within another.
    """
    found = set()
    for _, name, spec, _ in string.Formatter().parse(reason):
        if name is None:
            continue
        if not name.isidentifier() or "{" in (spec or ""):
            raise ValueError(f"{{{name}}} is no name of a piece of evidence")
        found.add(name)
    return found
