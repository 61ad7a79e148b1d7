#!/usr/bin/env python3
"""Writes tools/android-native/api-29/LIBRARY.txt: what Android's libraries export to applications on arm64 at API level 29.

For maintainers, when the least level is raised. The source is the platform's published interface, the map files that the
NDK's own stub libraries are made from; nothing is read from a library of ours, so that what is linked can be checked against it.

    scripts/android-api.py                 (map files from the Android Open Source Project's mirror on GitHub, at the commits below)
    scripts/android-api.py --maps FOLDER   (copies of them, FOLDER/libc/libc.map.txt and so on)
"""

import os
import re
import sys
import urllib.request

LEVEL = 29
ARCH = "arm64"
ARCHES = {"arm", "arm64", "x86", "x86_64", "riscv64", "mips", "mips64"}
# Not for applications: vendor modules', system modules', and those of the platform itself.
NOT_FOR_APPS = {"llndk", "apex", "systemapi", "platform-only", "future"}
MIRROR = "https://raw.githubusercontent.com/aosp-mirror"
BIONIC = ("platform_bionic", "731631f300090436d7f5df80d50b6275c8c60a93")
SOURCES = {
    "libc": (*BIONIC, "libc/libc.map.txt"),
    "libm": (*BIONIC, "libm/libm.map.txt"),
    "libdl": (*BIONIC, "libdl/libdl.map.txt"),
    "liblog": ("platform_system_core", "0391a879f7624d4671d7c304042155a1e32d0e7c", "liblog/liblog.map.txt"),
    "libandroid": ("platform_frameworks_base", "02d8919614b7920aa2c5c3820be77bba8c54846f", "native/android/libandroid.map.txt"),
    "libaaudio": ("platform_frameworks_av", "7eca0885c57247703adca2506992bad0fa7dc9b5", "media/libaaudio/src/libaaudio.map.txt"),
}
REPO = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

HEAD = """\
# What {library}.so exports to applications on {arch} at Android API level {level}, a name a line.
# Written by scripts/android-api.py from {path} of {repo}
# at {commit},
# Copyright The Android Open Source Project, Apache License 2.0.
"""


def included(tags):
    """Whether what carries these tags is for applications of LEVEL on ARCH."""
    names = {tag.split("=")[0] for tag in tags}
    if names & NOT_FOR_APPS or (names & ARCHES and ARCH not in names):
        return False
    values = dict(tag.split("=", 1) for tag in tags if "=" in tag)
    introduced = values.get(f"introduced-{ARCH}", values.get("introduced"))
    # Levels that have a number by now stand there by name too, all of them newer.
    return introduced is None or (introduced.isdigit() and int(introduced) <= LEVEL)


def symbols(text):
    """The names in a map file that are included."""
    found, section, visible = set(), None, False
    for line in text.splitlines():
        code, _, comment = line.partition("#")
        code, tags = code.strip(), comment.split()
        if match := re.fullmatch(r"(\w+) \{", code):
            section = None if match[1].endswith(("_PRIVATE", "_PLATFORM", "_DEPRECATED")) else match[1]
            section_tags, visible = tags, True
        elif code.endswith(":"):
            visible = code == "global:"
        elif code.startswith("}"):
            section = None
        elif match := re.fullmatch(r"(\w+);", code):
            if section and visible and included(section_tags) and included(tags):
                found.add(match[1])
    return sorted(found)


def main():
    folder = sys.argv[2] if sys.argv[1:2] == ["--maps"] else None
    for library, (repo, commit, path) in SOURCES.items():
        if folder:
            with open(os.path.join(folder, path), encoding="utf-8") as file:
                text = file.read()
        else:
            with urllib.request.urlopen(f"{MIRROR}/{repo}/{commit}/{path}") as answer:
                text = answer.read().decode()
        names = symbols(text)
        out = os.path.join(REPO, "tools/android-native/api-29", f"{library}.txt")
        with open(out, "w", encoding="ascii") as file:
            file.write(HEAD.format(library=library, arch=ARCH, level=LEVEL, path=path, repo=repo, commit=commit))
            file.write("".join(f"{name}\n" for name in names))
        print(f"{out}: {len(names)} names")


main()
