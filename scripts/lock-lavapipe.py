#!/usr/bin/env python3
"""Writes scripts/lavapipe-ARCH.lock: every Debian package the private lavapipe prefix is unpacked from.

For maintainers, when lavapipe is to be renewed; `./run` only reads the lock files.
It follows Depends/Pre-Depends of ROOTS in one suite's index, taking the first alternative that exists. It does not
check the index's signature: review the diff.

    scripts/lock-lavapipe.py            (both architectures, from https://deb.debian.org/debian)
"""

import datetime
import lzma
import os
import sys
import urllib.request

MIRROR = os.environ.get("MON3TR_DEBIAN_MIRROR", "https://deb.debian.org/debian")
SUITE = "trixie"
ROOTS = [
    # The driver, the loader and the layer our tests run under.
    "mesa-vulkan-drivers",
    "libvulkan1",
    "vulkan-validationlayers",
    # What winit opens by name for a window (`--window`): programs on the prefix's libc look here first.
    "libx11-6",
    "libx11-xcb1",
    "libxcb1",
    "libxcursor1",
    "libxi6",
    "libxrandr2",
    "libxkbcommon0",
    "libxkbcommon-x11-0",
    "libwayland-client0",
    "libwayland-cursor0",
]
# Hold nothing a program opens.
LEFT_OUT = {"gcc-14-base", "libdrm-common"}


def index(arch):
    """The suite's packages by name, and who provides which virtual name."""
    url = f"{MIRROR}/dists/{SUITE}/main/binary-{arch}/Packages.xz"
    with urllib.request.urlopen(url) as answer:
        text = lzma.decompress(answer.read()).decode()
    packages, providers = {}, {}
    for block in text.split("\n\n"):
        fields = dict(
            line.split(": ", 1)
            for line in block.split("\n")
            if ": " in line and not line.startswith(" ")
        )
        if "Package" not in fields:
            continue
        packages[fields["Package"]] = fields
        for name in fields.get("Provides", "").split(","):
            if name.strip():
                providers.setdefault(name.split()[0], []).append(fields["Package"])
    return packages, providers


def closure(packages, providers):
    """ROOTS and everything they depend on, sorted by name."""
    chosen = set()

    def take(name):
        if name not in packages:
            if name not in providers:
                return False
            name = providers[name][0]
        if name in chosen or name in LEFT_OUT:
            return True
        chosen.add(name)
        for field in ("Pre-Depends", "Depends"):
            for clause in packages[name].get(field, "").split(","):
                names = [one.split()[0].split(":")[0] for one in clause.split("|") if one.strip()]
                if not names or any(one in chosen for one in names):
                    continue
                if not any(take(one) for one in names):
                    sys.exit(f"{name}: none of {names} is in {SUITE}")
        return True

    for root in ROOTS:
        if not take(root):
            sys.exit(f"{root} is not in {SUITE}")
    return [packages[name] for name in sorted(chosen)]


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    day = datetime.datetime.now(datetime.timezone.utc).strftime("%Y%m%dT000000Z")
    for arch in ("amd64", "arm64"):
        chosen = closure(*index(arch))
        total = sum(int(one["Size"]) for one in chosen)
        path = os.path.join(here, f"lavapipe-{arch}.lock")
        with open(path, "w", encoding="ascii") as out:
            out.write(f"# Mesa's lavapipe and what it needs, from Debian {SUITE}. Written by scripts/lock-lavapipe.py.\n")
            out.write("# package version sha256 bytes path-below-the-mirror\n")
            out.write(f"suite {SUITE}\nsnapshot {day}\n")
            for one in chosen:
                out.write(f"{one['Package']} {one['Version']} {one['SHA256']} {one['Size']} {one['Filename']}\n")
        print(f"{path}: {len(chosen)} packages, {total / 1e6:.1f} MB")


main()
