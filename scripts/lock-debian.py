#!/usr/bin/env python3
"""Writes the .lock files: every Debian package that a private prefix is unpacked from.

For maintainers, when a prefix is to be renewed; `./run` only reads the lock files.
It follows Depends/Pre-Depends of a prefix's roots in the suites' indices, taking the first alternative that exists. It does
not check an index's signature: review the diff.

    scripts/lock-debian.py [lavapipe] [spirv-val] [nats-server] [pulseaudio] [ip] [nft] [faketime] [monado] [android-tools] [java] [clang] [arm64] [adreno]    (all without a name; from https://deb.debian.org/debian)

Where only a few files of the roots are wanted, a prefix names them (`linked`), and of the packages it keeps those with a
library that these files link, directly or through others; this fetches all of them, and needs dpkg-deb and readelf.
"""

import datetime
import functools
import lzma
import os
import re
import subprocess
import sys
import tempfile
import urllib.request

MIRROR = os.environ.get("MON3TR_DEBIAN_MIRROR", "https://deb.debian.org/debian")
REPO = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
STABLE = "trixie"
BACKPORTS = "trixie-backports"
# Hold nothing a program opens.
EMPTY = {"gcc-14-base", "libdrm-common"}

PREFIXES = {
    "lavapipe": {
        "what": "Mesa's lavapipe and what it needs",
        "lock": "scripts/lavapipe-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": [
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
        ],
    },
    "spirv-val": {
        "what": "The SPIR-V validator and what it needs",
        "lock": "scripts/spirv-val-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["spirv-tools"],
    },
    "nats-server": {
        "what": "The NATS server and what it needs",
        "lock": "scripts/nats-server-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["nats-server"],
        # Makes the account that Debian's service runs under.
        "left_out": ["adduser"],
    },
    "pulseaudio": {
        "what": "The sound server PulseAudio and what it needs to play and record nothing",
        "lock": "scripts/pulseaudio-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["pulseaudio"],
        # Devices, desktops and networks, which a test's server does without.
        "linked": ["pulseaudio", "module-native-protocol-unix.so", "module-null-sink.so", "module-remap-source.so"],
    },
    "ip": {
        "what": "iproute2's ip, which makes the networks of a test, and what it needs",
        "lock": "scripts/ip-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["iproute2"],
        # Neither questions at installation nor accounts.
        "left_out": ["debconf", "adduser"],
        "linked": ["ip"],
    },
    "nft": {
        "what": "nftables' nft, which makes the NATs of a test, and what it needs",
        "lock": "scripts/nft-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["nftables"],
        "linked": ["nft"],
    },
    "faketime": {
        "what": "libfaketime, which sets the clock of a test's program",
        "lock": "scripts/faketime-{arch}.lock",
        "arches": ["amd64", "arm64"],
        # The release before: a program's own C library may be older than the present one's.
        "suite": "bookworm",
        "roots": ["libfaketime"],
        # The program's own.
        "left_out": ["libc6"],
    },
    "monado": {
        "what": "Monado, OpenXR's loader, an X server without a screen, and what they need",
        "lock": "scripts/monado-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["monado-service", "libopenxr1-monado", "libopenxr-loader1", "xvfb", "xkb-data"],
        # Of the 290 packages most come through cameras and picture formats that a simulated headset never opens.
        "linked": ["monado-service", "libopenxr_monado.so", "libopenxr_loader.so.1", "Xvfb", "xkbcomp"],
        # scripts/monado.sh puts a stand-in there: through it come 100 packages, 60 MB.
        "stand_ins": ["libopencv_imgcodecs.so.410"],
        # The keyboard's description, which no library links.
        "kept": ["xkb-data"],
    },
    "android-tools": {
        "what": "Android's own programs for packages (aapt, aapt2, zipalign, apksigner), the framework's resources, and what they need but for Java",
        "lock": "scripts/android-tools-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["aapt", "zipalign", "apksigner", "android-framework-res"],
        "left_out": ["default-jre"],
        "linked": ["aapt", "aapt2", "zipalign"],
        # Java's own and resources, which no library links.
        "kept": ["apksigner", "libapksig-java", "android-framework-res"],
    },
    "java": {
        "what": "Java without a screen, for apksigner, and what it needs for that",
        "lock": "scripts/java-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["openjdk-21-jre-headless"],
        # What reading a signed package opens; pictures, printers and smart cards stay away.
        "linked": ["java", "libjvm.so", "libjava.so", "libnio.so", "libnet.so", "libzip.so", "libjimage.so", "libextnet.so"],
    },
    "clang": {
        "what": "clang, which compiles C for Android where there is no NDK, and what it needs",
        "lock": "scripts/clang-{arch}.lock",
        "arches": ["amd64", "arm64"],
        "roots": ["clang-19"],
        # The compiler alone: neither a linker nor headers or start files of this machine's own C library.
        "linked": ["clang"],
        # Its own headers, which no library links.
        "kept": ["libclang-common-19-dev"],
    },
    "arm64": {
        "what": "What links a program for arm64 and runs it here",
        "lock": "scripts/arm64-{arch}.lock",
        # An arm64 machine needs none of it.
        "arches": ["amd64"],
        "roots": ["qemu-user", "libc6-dev-arm64-cross", "libgcc-s1-arm64-cross"],
        # Headers: no C is compiled.
        "left_out": ["linux-libc-dev-arm64-cross", "gcc-14-cross-base"],
    },
    "adreno": {
        "what": "Mesa's turnip, the shim that pretends to be an Adreno, and what they need",
        "lock": "scripts/adreno-{suite}-{arch}.lock",
        "arches": ["amd64"],
        "roots": ["mesa-vulkan-drivers", "mesa-drm-shim", "libvulkan1"],
        "backports": ["mesa-vulkan-drivers", "mesa-drm-shim"],
        # Other drivers of the package need these.
        "left_out": ["libdrm-amdgpu1", "libelf1t64", "libllvm19", "libx11-data"],
    },
}


@functools.cache
def index(suite, arch):
    """The suite's packages by name, and the providers of each virtual name."""
    url = f"{MIRROR}/dists/{suite}/main/binary-{arch}/Packages.xz"
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
        fields["Suite"] = suite
        packages[fields["Package"]] = fields
        for name in fields.get("Provides", "").split(","):
            if name.strip():
                providers.setdefault(name.split()[0], []).append(fields["Package"])
    return packages, providers


def closure(roots, packages, providers, left_out):
    """The roots and everything they depend on, sorted by name."""
    chosen = set()

    def take(name):
        if name not in packages:
            if name not in providers:
                return False
            name = providers[name][0]
        if name in chosen or name in left_out:
            return True
        chosen.add(name)
        for field in ("Pre-Depends", "Depends"):
            for clause in packages[name].get(field, "").split(","):
                names = [one.split()[0].split(":")[0] for one in clause.split("|") if one.strip()]
                if not names or any(one in chosen for one in names):
                    continue
                if not any(take(one) for one in names):
                    sys.exit(f"{name}: there is none of {names}")
        return True

    for root in roots:
        if not take(root):
            sys.exit(f"there is no {root}")
    return [packages[name] for name in sorted(chosen)]


def is_elf(path):
    """Packages name other files after their programs too."""
    if not os.path.isfile(path):
        return False
    with open(path, "rb") as file:
        return file.read(4) == b"\x7fELF"


def linked(chosen, prefix):
    """Of the packages chosen those that hold prefix["linked"], or a library that these link, and prefix["kept"]."""
    with tempfile.TemporaryDirectory() as folder:
        # By name: the packages' libraries and the programs asked for.
        files = {}
        for one in chosen:
            deb, root = os.path.join(folder, "deb"), os.path.join(folder, one["Package"])
            urllib.request.urlretrieve(f"{MIRROR}/{one['Filename']}", deb)
            subprocess.run(["dpkg-deb", "--extract", deb, root], check=True)
            for below, _, names in os.walk(root):
                for name in names:
                    path = os.path.join(below, name)
                    if (".so" in name or name in prefix["linked"]) and is_elf(path):
                        files.setdefault(name, (one["Package"], path))
        done, todo, packages = set(prefix.get("stand_ins", [])), list(prefix["linked"]), set(prefix.get("kept", []))
        while todo:
            name = todo.pop()
            if name in done:
                continue
            done.add(name)
            if name not in files:
                sys.exit(f"none of the packages has {name}")
            package, path = files[name]
            packages.add(package)
            told = subprocess.run(["readelf", "--dynamic", path], check=True, capture_output=True, text=True).stdout
            todo += re.findall(r"\(NEEDED\).*\[(.*)\]", told)
        return [one for one in chosen if one["Package"] in packages]


def main():
    day = datetime.datetime.now(datetime.timezone.utc).strftime("%Y%m%dT000000Z")
    for prefix in (PREFIXES[name] for name in sys.argv[1:] or PREFIXES):
        for arch in prefix["arches"]:
            packages, providers = index(prefix.get("suite", STABLE), arch)
            packages = dict(packages)
            for name in prefix.get("backports", []):
                packages[name] = index(BACKPORTS, arch)[0][name]
            left_out = EMPTY.union(prefix.get("left_out", []))
            chosen = closure(prefix["roots"], packages, providers, left_out)
            if "linked" in prefix:
                chosen = linked(chosen, prefix)
            for suite in sorted({one["Suite"] for one in chosen}):
                of_suite = [one for one in chosen if one["Suite"] == suite]
                total = sum(int(one["Size"]) for one in of_suite)
                path = os.path.join(REPO, prefix["lock"].format(arch=arch, suite=suite))
                with open(path, "w", encoding="ascii") as out:
                    out.write(f"# {prefix['what']}, from Debian {suite}. Written by scripts/lock-debian.py.\n")
                    out.write("# package version sha256 bytes path-below-the-mirror\n")
                    out.write(f"suite {suite}\nsnapshot {day}\n")
                    for one in of_suite:
                        out.write(f"{one['Package']} {one['Version']} {one['SHA256']} {one['Size']} {one['Filename']}\n")
                print(f"{path}: {len(of_suite)} packages, {total / 1e6:.1f} MB")


main()
