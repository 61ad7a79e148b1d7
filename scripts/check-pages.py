#!/usr/bin/env python3
"""Checks that what pages name is there: each test in docs/faults.md and docs/security.md, and each file that a page links. Prints what is not, and ends with 1."""

import re
import subprocess
import sys
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
ROWS_OF_TESTS = ("docs/faults.md",)


def tracked(pattern):
    listed = subprocess.check_output(["git", "-C", str(REPO), "ls-files", "-co", "--exclude-standard", pattern], text=True)
    return [REPO / line for line in listed.splitlines()]


def functions():
    """The names of all functions."""
    names = set()
    for file in tracked("*.rs"):
        if file.exists():
            names.update(re.findall(r"\bfn (\w+)", file.read_text()))
    return names


def missing_tests(known):
    for page in ROWS_OF_TESTS:
        for number, line in enumerate((REPO / page).read_text().splitlines(), 1):
            if not line.startswith("| ") or line.startswith("| what") or set(line) <= set("|-: "):
                continue
            tests = re.findall(r"`(\w+)`", line.rsplit("|", 2)[1])
            if not tests:
                yield f"{page}:{number}: no test shows it"
            yield from (f"{page}:{number}: there is no test {test}" for test in tests if test not in known)


def broken_links():
    for page in tracked("*.md"):
        for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text()):
            if not (page.parent / target).exists():
                yield f"{page.relative_to(REPO)}: there is no {target}"


def main():
    wrong = [*missing_tests(functions()), *broken_links()]
    for line in wrong:
        print(line)
    print(f"pages: {len(wrong)} things wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
