#!/usr/bin/env python3
"""What the programs are made of: every crate that is not ours, by whom it may be used, and where it comes from.

    scripts/supply.py --check           refuses a licence, a source or a list that is not as it should be; for CI
    scripts/supply.py --write           renews the list that `mon3tr licences` prints
    scripts/supply.py --sbom FILE.json  the same as a bill of materials (CycloneDX 1.5)
    scripts/supply.py --notices FILE    the texts of all licences, which go with programs that are given to others
    scripts/supply.py --advisories [FOLDER]
                                        refuses crates with known faults, by RustSec's advisories (a clone in FOLDER, else fetched from GitHub)

Of the programs themselves, on every system: what only tests and builds' own programs need is not shipped, and not in it.
Cargo fetches what it lacks; nothing else is asked but for advisories, which are about tests' crates too. Where those cannot be fetched that is an error,
in CI (CI=true) a warning.
"""

import json
import os
import re
import subprocess
import sys
import uuid
from contextlib import nullcontext
from pathlib import Path

import advisories

REPO = Path(__file__).resolve().parent.parent
LIST = REPO / "tools/mon3tr/licences.txt"
# The programs that are given to others.
PROGRAMS = ("mon3tr", "mon3tr-dev", "mon3tr-android")
SOURCE = "registry+https://github.com/rust-lang/crates.io-index"

# Licences under which a library may be part of a program under MIT or Apache-2.0 that is given away in binary form, and what they ask for: that their text goes
# with it, no more.
ALLOWED = {
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
    "bzip2-1.0.6",
}
# Crates with another licence, and why they may be there all the same.
EXCEPTIONS = {
    "epaint_default_fonts": "its fonts may be part of any program (OFL-1.1, Ubuntu-font-1.0); Hack alone is used, for panels in headsets",
    "triple_buffer": "MPL-2.0 is about its own files, which are used as they are, and whose source the list names",
    "webpki-root-certs": "CDLA-Permissive-2.0 is about data, here a list of certificates, which may be passed on",
}


def packages():
    """The crates of the programs that are not ours, by name and version, with their metadata."""
    asked = ["cargo", "metadata", "--locked", "--format-version", "1", "--all-features", "--manifest-path", str(REPO / "Cargo.toml")]
    metadata = json.loads(subprocess.check_output(asked))
    by_id = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    todo = [id for id, package in by_id.items() if package["name"] in PROGRAMS and package["source"] is None]
    seen = set(todo)
    while todo:
        for dependency in nodes[todo.pop()]["deps"]:
            # A dependency of tests alone has that kind alone.
            is_shipped = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            if is_shipped and dependency["pkg"] not in seen:
                seen.add(dependency["pkg"])
                todo.append(dependency["pkg"])
    theirs = [by_id[id] for id in seen if by_id[id]["source"] is not None]
    return sorted(theirs, key=lambda package: (package["name"], package["version"]))


def is_allowed(expression):
    """Whether an SPDX expression can be fulfilled by allowed licences."""
    tokens = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))
    at = 0

    def term():
        nonlocal at
        if tokens[at] == "(":
            at += 1
            fulfilled = either()
            at += 1
            return fulfilled
        name = tokens[at]
        at += 1
        if tokens[at : at + 1] == ["WITH"]:
            name = f"{name} WITH {tokens[at + 1]}"
            at += 2
        return name in ALLOWED

    def joined(word, part, fulfils):
        nonlocal at
        parts = [part()]
        while tokens[at : at + 1] == [word]:
            at += 1
            parts.append(part())
        return fulfils(parts)

    def both():
        return joined("AND", term, all)

    def either():
        return joined("OR", both, any)

    return either() and at == len(tokens)


def lines(theirs):
    """The list, a line for each crate."""
    for package in theirs:
        where = package["repository"] or package["homepage"] or f"https://crates.io/crates/{package['name']}"
        yield f"{package['name']} {package['version']} | {package['license'] or 'see ' + str(package['license_file'])} | {where}"


def wrong(theirs):
    """What should not be so."""
    for package in theirs:
        name = f"{package['name']} {package['version']}"
        if package["source"] != SOURCE:
            yield f"{name} comes from {package['source']}: crates come from crates.io"
        licence = package["license"]
        if package["name"] not in EXCEPTIONS and not (licence and is_allowed(licence)):
            yield f"{name} has the licence {licence or package['license_file']}: none that is allowed here (ALLOWED), and no exception with a reason"
    for name in EXCEPTIONS:
        if all(package["name"] != name for package in theirs):
            yield f"the exception for {name} is no longer needed"
    if not LIST.exists() or LIST.read_text().splitlines() != list(lines(theirs)):
        yield f"{LIST.relative_to(REPO)} is not what the programs are made of: scripts/supply.py --write renews it"


def bill(theirs):
    """CycloneDX 1.5."""
    version = re.search(r'^version = "([^"]+)"', (REPO / "Cargo.toml").read_text(), re.M).group(1)
    components = []
    for package in theirs:
        component = {
            "type": "library",
            "name": package["name"],
            "version": package["version"],
            "purl": f"pkg:cargo/{package['name']}@{package['version']}",
            "bom-ref": f"{package['name']}@{package['version']}",
        }
        if package["license"]:
            component["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
        if package["repository"]:
            component["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
        components.append(component)
    # The same list gives the same bill.
    serial = uuid.uuid5(uuid.NAMESPACE_URL, "\n".join(lines(theirs)))
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{serial}",
        "version": 1,
        "metadata": {"component": {"type": "application", "name": "mon3tr", "version": version, "bom-ref": "mon3tr"}},
        "components": components,
        "dependencies": [{"ref": "mon3tr", "dependsOn": [component["bom-ref"] for component in components]}],
    }


def notices(theirs):
    """The texts that the crates bring, each once, with those that bring it."""
    brought = {}
    for package in theirs:
        folder = Path(package["manifest_path"]).parent
        found = [file for file in sorted(folder.iterdir()) if re.match(r"(?i)(licen[cs]e|copying|notice|copyright|unlicense)", file.name) and file.is_file()]
        for file in found:
            text = file.read_text(encoding="utf-8", errors="replace").strip()
            brought.setdefault(text, []).append(f"{package['name']} {package['version']}")
        if not found:
            brought.setdefault(f"(no text comes with it; {package['license']})", []).append(f"{package['name']} {package['version']}")
    for text, names in sorted(brought.items(), key=lambda entry: entry[1]):
        yield f"{'=' * 80}\n{', '.join(names)}\n{'=' * 80}\n\n{text}\n"


def check_advisories(folder):
    """Checks the lock file against a database in a folder, or the newest."""
    lock = REPO / "Cargo.lock"
    try:
        with nullcontext(Path(folder)) if folder else advisories.database() as database:
            found = list(advisories.wrong(lock, database))
    except (OSError, subprocess.TimeoutExpired) as why:
        print(f"WARNING: known faults of crates were not looked for: the advisories of {folder or advisories.DATABASE} cannot be had: {why}", file=sys.stderr)
        return 0 if os.environ.get("CI") == "true" and not folder else 1
    for line in found:
        print(line)
    print(f"{lock.name} by RustSec's advisories: {len(found)} things wrong, {len(advisories.EXCEPTIONS)} exceptions")
    return 1 if found else 0


def main():
    arguments = sys.argv[1:]
    if arguments[:1] == ["--advisories"] and len(arguments) <= 2:
        return check_advisories(*arguments[1:] or [None])
    theirs = packages()
    match arguments:
        case ["--write"]:
            LIST.write_text("".join(f"{line}\n" for line in lines(theirs)))
        case ["--sbom", file]:
            Path(file).write_text(json.dumps(bill(theirs), indent=1) + "\n")
            return 0
        case ["--notices", file]:
            Path(file).write_text("\n".join(notices(theirs)), encoding="utf-8")
            return 0
        case ["--check"]:
            pass
        case _:
            sys.exit(__doc__.strip())
    found = list(wrong(theirs))
    for line in found:
        print(line)
    print(f"{len(theirs)} crates of others, {len(found)} things wrong")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
