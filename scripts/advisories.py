"""The RustSec advisories about crates of a Cargo.lock. Their database is a git repository with a file for each; `scripts/supply.py --advisories` asks this.

A crate's version is affected unless a requirement in `patched` or `unaffected` takes it. Advisories that were withdrawn, and those for systems that
the programs do not run on, are passed over.
"""

import os
import re
import subprocess
import tempfile
import tomllib
from contextlib import contextmanager
from pathlib import Path

DATABASE = "https://github.com/rustsec/advisory-db"
# Of `affected.os` in advisories.
SYSTEMS = {"android", "linux"}
# Advisories that may stand, and why.
EXCEPTIONS = {
    "RUSTSEC-2026-0192": "ttf-parser has no maintainer any more: it reads one font here, which is part of the program (Hack, for panels)",
}


@contextmanager
def database():
    """A folder with the newest advisories; raises OSError if they cannot be fetched."""
    with tempfile.TemporaryDirectory() as folder:
        clone = ["git", "clone", "--quiet", "--depth", "1", DATABASE, folder]
        done = subprocess.run(clone, capture_output=True, text=True, env=os.environ | {"GIT_TERMINAL_PROMPT": "0"}, timeout=300)
        if done.returncode != 0:
            raise OSError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "git clone failed")
        yield Path(folder)


def version(text):
    """A version as what sorts as versions do: a pre-release before its release, build metadata left out.

    >>> version("1.2.3") < version("1.10.0"), version("1.2.3-rc.9") < version("1.2.3-rc.10") < version("1.2.3"), version("1.2.3+5") == version("1.2.3")
    (True, True, True)
    """
    numbers, _, pre = text.partition("+")[0].partition("-")
    numbers = [int(number) for number in numbers.split(".")]
    numbers += [0] * (3 - len(numbers))
    # By SemVer 11.4: numbers before words.
    parts = tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in pre.split(".") if pre)
    return (*numbers, not pre, parts)


def comparators(requirement):
    """The comparisons that a requirement is short for: an operator and a version each.

    >>> comparators("^1.2"), comparators("~0.3.1"), comparators("*") == [(">=", version("0.0.0"))]
    ([('>=', (1, 2, 0, True, ())), ('<', (2, 0, 0, True, ()))], [('>=', (0, 3, 1, True, ())), ('<', (0, 4, 0, True, ()))], True)
    """
    found = []
    for part in requirement.split(","):
        operator, text = re.fullmatch(r"\s*(>=|<=|>|<|=|\^|~)?\s*([0-9A-Za-z.*+-]+)\s*", part).groups()
        given = [int(number) for number in re.split(r"[-+]", text)[0].split(".") if number.isdecimal()]
        if operator in (">=", "<=", ">", "<", "=") and "*" not in text:
            found.append((operator, version(text)))
            continue
        least = version(text.replace("*", "0"))
        # The part that may not change: for ^ the first that is not 0, for ~ and * the last but one or the last that is given.
        if "*" in text:
            fixed = len(given)
        elif operator == "~":
            fixed = min(len(given), 2)
        else:
            fixed = next((at + 1 for at, number in enumerate(given) if number), len(given))
        found.append((">=", least))
        if fixed:
            upper = given[: fixed - 1] + [given[fixed - 1] + 1]
            found.append(("<", version(".".join(map(str, upper)))))
    return found


def takes(requirement, given):
    """Whether a requirement takes a version.

    >>> [takes(">= 1.2.3, < 2", v) for v in ("1.2.2", "1.2.3", "2.0.0")], [takes("^0.3.1", v) for v in ("0.3.0", "0.3.9", "0.4.0")]
    ([False, True, False], [False, True, False])
    >>> takes("1.4", "1.9.0"), takes("1.*", "2.0.0"), takes("=1.0.0", "1.0.0"), takes("> 1.0.0-alpha", "1.0.0-beta"), takes(">= 1.0.0", "1.0.0-rc.1")
    (True, False, True, True, False)
    """
    given = version(given)
    means = {">=": given.__ge__, "<=": given.__le__, ">": given.__gt__, "<": given.__lt__, "=": given.__eq__}
    return all(means[operator](bound) for operator, bound in comparators(requirement))


def is_affected(advisory, given):
    """Whether a version of the advisory's crate has the fault, on systems that the programs run on."""
    systems = advisory.get("affected", {}).get("os")
    if "withdrawn" in advisory["advisory"] or (systems and not SYSTEMS & set(systems)):
        return False
    versions = advisory.get("versions", {})
    return not any(takes(requirement, given) for requirement in versions.get("patched", []) + versions.get("unaffected", []))


def about(locked, folder):
    """The advisories in a database's folder about crates, pairs of name and version: each with the pair."""
    for name, given in locked:
        for file in sorted((folder / "crates" / name).glob("RUSTSEC-*.md")):
            text = re.match(r"```toml\n(.*?)\n```\s*\n(?:# (.*))?", file.read_text(encoding="utf-8"), re.S)
            if text is None:
                raise ValueError(f"{file.name} is not written as advisories are")
            advisory = tomllib.loads(text[1])
            if is_affected(advisory, given):
                title = text[2].splitlines()[0] if text[2] else "no title"
                yield advisory["advisory"]["id"], advisory["advisory"].get("informational", "vulnerability"), name, given, title


def wrong(lock, folder):
    """What should not be so of the crates in a Cargo.lock, a line each."""
    packages = tomllib.loads(lock.read_text())["package"]
    locked = [(package["name"], package["version"]) for package in packages if package.get("source", "").startswith("registry+")]
    if not (folder / "crates").is_dir():
        raise OSError(f"{folder} is no database of advisories: it has no folder crates")
    found = list(about(locked, folder))
    for identifier, kind, name, given, title in found:
        if identifier not in EXCEPTIONS:
            yield f"{identifier} ({kind}) is about {name} {given}: {title}. Update it, or give the reason why it may stand (EXCEPTIONS in scripts/advisories.py)"
    for identifier in EXCEPTIONS:
        if all(one[0] != identifier for one in found):
            yield f"the exception for {identifier} is no longer needed"
