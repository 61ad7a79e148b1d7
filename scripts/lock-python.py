#!/usr/bin/env python3
"""Writes python.lock: the Python packages that tests call with or store into, each with the hashes of all its wheels.

For maintainers, when the packages are to be renewed; `./run` only reads the lock. pip chooses the versions, from the index it
is configured for, as for the oldest CPython of the lock; PyPI's JSON says which wheels each version has. A version
without a wheel for every CPython on every architecture ends it: pin an older one in ROOTS.

    scripts/lock-python.py    (needs a python3 with pip 23 or newer)
"""

import json
import os
import subprocess
import sys
import urllib.request

from pip._vendor.packaging import requirements, tags, utils

REPO = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LOCK = os.path.join(REPO, "scripts", "python.lock")
PYPI = "https://pypi.org/pypi"
# Oldest first; scripts/python.sh reads the line they are written to.
PYTHONS = ["3.10", "3.11", "3.12", "3.13", "3.14"]
ARCHES = ["x86_64", "aarch64"]
# Debian 12's and Ubuntu 22.04's glibc are newer.
GLIBC = range(35, 16, -1)
# A WebRTC that is not ours, and an S3 server. moto[server] would bring every other service of AWS with it.
ROOTS = ["aiortc", "moto[s3]", "flask", "flask-cors"]


def platforms(arch):
    """Wheel platforms that such a machine takes, the best first."""
    names = [f"manylinux_2_{minor}_{arch}" for minor in GLIBC]
    return names + [f"manylinux2014_{arch}", f"linux_{arch}"]


def chosen_by_pip(roots):
    """What pip would install for the roots on the oldest Python: canonical name -> metadata."""
    asked = ["--python-version", PYTHONS[0], "--implementation", "cp", "--only-binary", ":all:"]
    for name in platforms(ARCHES[0]):
        asked += ["--platform", name]
    asked += ["--dry-run", "--ignore-installed", "--no-user", "--target", "unused", "--quiet", "--report", "-"]
    out = subprocess.run([sys.executable, "-m", "pip", "install", *asked, *roots], check=True, stdout=subprocess.PIPE)
    report = json.loads(out.stdout)
    return {utils.canonicalize_name(one["metadata"]["name"]): one["metadata"] for one in report["install"]}


def needed(chosen):
    """Requirements of what was chosen that hold on some Python or architecture, by canonical name of what is required."""
    wanted = {utils.canonicalize_name(requirements.Requirement(one).name): one for one in ROOTS}
    extras = {utils.canonicalize_name(one.name): one.extras for one in map(requirements.Requirement, ROOTS)}
    for name, metadata in chosen.items():
        for text in metadata.get("requires_dist", []):
            one = requirements.Requirement(text)
            environments = [
                {
                    "python_version": python,
                    "python_full_version": f"{python}.0",
                    "implementation_name": "cpython",
                    "platform_python_implementation": "CPython",
                    "platform_machine": arch,
                    "platform_system": "Linux",
                    "sys_platform": "linux",
                    "os_name": "posix",
                    "extra": extra,
                }
                for python in PYTHONS
                for arch in ARCHES
                for extra in ["", *extras.get(name, [])]
            ]
            if one.marker is None or any(one.marker.evaluate(each) for each in environments):
                one.marker = None
                wanted.setdefault(utils.canonicalize_name(one.name), str(one))
    return wanted


def closure():
    """All that is needed on any of the Pythons. pip reads markers as the Python it runs on: what another one needs is added."""
    roots = list(ROOTS)
    while True:
        chosen = chosen_by_pip(roots)
        more = [one for name, one in needed(chosen).items() if name not in chosen]
        if not more:
            return chosen
        roots += more


def wheels(name, version):
    """(hash, bytes) of every wheel that one of the Pythons on one of the architectures takes, and the most one machine fetches."""
    with urllib.request.urlopen(f"{PYPI}/{name}/json") as answer:
        files = json.load(answer)["releases"].get(version, [])
    parsed = [
        (utils.parse_wheel_filename(one["filename"])[3], one)
        for one in files
        if one["packagetype"] == "bdist_wheel" and not one["yanked"]
    ]
    hashes, largest = set(), 0
    for python in PYTHONS:
        for arch in ARCHES:
            wanted = tuple(int(part) for part in python.split("."))
            names = platforms(arch)
            takes = set(tags.cpython_tags(wanted, platforms=names))
            takes |= set(tags.compatible_tags(wanted, f"cp{wanted[0]}{wanted[1]}", names))
            fit = [one for of_wheel, one in parsed if not takes.isdisjoint(of_wheel)]
            if not fit:
                sys.exit(f"{name} {version} has no wheel for CPython {python} on {arch}: pin another version in ROOTS")
            hashes |= {one["digests"]["sha256"] for one in fit}
            largest = max(largest, *(one["size"] for one in fit))
    return sorted(hashes), largest


def main():
    lines, total = [], 0
    chosen = closure()
    for name in sorted(chosen):
        version = chosen[name]["version"]
        hashes, largest = wheels(name, version)
        total += largest
        lines.append(" \\\n    ".join([f"{name}=={version}", *(f"--hash=sha256:{one}" for one in hashes)]))
    with open(LOCK, "w", encoding="ascii") as out:
        out.write("# Python packages that tests call with or store into, from PyPI. Written by scripts/lock-python.py.\n")
        out.write(f"# pythons {PYTHONS[0]} {PYTHONS[-1]}\n# megabytes {round(total / 1e6)}\n")
        out.write("\n".join(lines) + "\n")
    print(f"{LOCK}: {len(lines)} packages, at most {total / 1e6:.1f} MB")


main()
