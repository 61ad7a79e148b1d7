#!/usr/bin/env python3
"""Programs to give to others: built twice from one commit, in two folders that have nothing in common, and taken only if both are the same to the byte.

    scripts/release.py build OUT [--only NAME]... [--key KEY]   mon3tr, mon3tr-dev and the package for Quest, or those that are named; signed with KEY,
                                                                an Ed25519 key of ssh-keygen's
    scripts/release.py --check FOLDER --signer KEY.pub          that what was downloaded is whole, and signed by whom you know

With the programs go the licences of what they are made of, a bill of materials (CycloneDX) and SHA256SUMS. Run it where `./run setup` has run.
`ssh-keygen -t ed25519 -f release-key` makes a key. Whoever has the commit and the same Rust gets the same bytes, but for the signature in the package for
Quest, which is of the key store in MON3TR_KEYSTORE (its password in MON3TR_KEY_PASS), else of the debug key.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
APK = "mon3tr-quest3.apk"
NAMES = ("mon3tr", "mon3tr-dev", APK)
SUMS = "SHA256SUMS"
SIGNATURE = f"{SUMS}.sig"
# What ssh-keygen's signature is for, so that one for another purpose is none.
NAMESPACE = "mon3tr-release"
# In front of it lie an APK's signatures, which are no part of the zip file.
APK_MAGIC = b"APK Sig Block 42"
END_OF_ZIP = b"PK\x05\x06"


class Refused(Exception):
    """What is wrong, for people."""


def output(*command, **options):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, **options).stdout.strip()


def environment(checkout):
    """For a build in which neither the folders of this machine nor the time show."""
    sysroot = output("rustc", "--print", "sysroot", cwd=checkout)
    commit = next(line.split()[1] for line in output("rustc", "-vV", cwd=checkout).splitlines() if line.startswith("commit-hash"))
    cargo_home = os.environ.get("CARGO_HOME") or str(Path.home() / ".cargo")
    # Of several that fit a path, the last counts.
    folders = {sysroot: "rust", f"{sysroot}/lib/rustlib/src/rust": f"/rustc/{commit}", cargo_home: "crates", str(checkout): "mon3tr"}
    own = os.environ | {
        "CARGO_ENCODED_RUSTFLAGS": "\x1f".join(f"--remap-path-prefix={folder}={name}" for folder, name in folders.items()),
        "CARGO_INCREMENTAL": "0",
        "SOURCE_DATE_EPOCH": output("git", "log", "-1", "--format=%ct", cwd=checkout),
        # The compilers of what is written in C and C++.
        **{flags: " ".join(f"-ffile-prefix-map={folder}={name}" for folder, name in folders.items()) for flags in ("CFLAGS", "CXXFLAGS")},
    }
    for name in ("CARGO_TARGET_DIR", "RUSTFLAGS", "CARGO_BUILD_TARGET"):
        own.pop(name, None)
    return own


def build(checkout, names, out):
    """Builds the programs of a checkout from nothing, and copies them to a folder."""
    own = environment(checkout)
    out.mkdir()
    for name in names:
        if name != APK:
            subprocess.run(["cargo", "build", "--locked", "--release", "--package", name, "--bin", name], cwd=checkout, env=own, check=True)
            shutil.copy2(checkout / "target/release" / name, out)
    if APK in names:
        # It arranges the flags of its own build itself.
        package = ["cargo", "run", "--locked", "--release", "--package", "mon3tr-dev", "--bin", "mon3tr-dev", "--", "apk", "--release", "--out", str(out / APK)]
        if store := os.environ.get("MON3TR_KEYSTORE"):
            package += ["--keystore", store]
        subprocess.run(package, cwd=checkout, env=own, check=True)


def without_signatures(package):
    """The bytes of an APK but for its signatures, which lie between the members and the zip file's directory, and for where that begins."""
    end = package.rfind(END_OF_ZIP)
    directory = int.from_bytes(package[end + 16 : end + 20], "little")
    members = directory
    if package[directory - 16 : directory] == APK_MAGIC:
        members -= int.from_bytes(package[directory - 24 : directory - 16], "little") + 8
    return package[:members] + package[directory : end + 16] + package[end + 20 :]


def difference(name, first, second):
    """Where two builds differ, in words; nothing where they do not."""
    if name == APK:
        first, second = without_signatures(first), without_signatures(second)
    if first == second:
        return None
    at = next((at for at, (one, other) in enumerate(zip(first, second)) if one != other), min(len(first), len(second)))
    here = slice(max(at - 40, 0), at + 60)
    return f"the two builds of {name} ({len(first)} and {len(second)} bytes) differ from byte {at} on: {first[here]} and {second[here]}"


def build_twice(work, names):
    """Builds twice in folders below `work`; gives the first checkout and the folder of its programs."""
    if output("git", "status", "--porcelain", cwd=REPO):
        raise Refused("files differ from the commit: commit them, or put them away")
    commit = output("git", "rev-parse", "HEAD", cwd=REPO)
    # Paths of unlike lengths.
    checkouts = [work / "a", work / "another/folder/of/some/length"]
    built = [work / "first", work / "second"]
    for checkout, out in zip(checkouts, built):
        checkout.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["git", "clone", "--quiet", "--no-checkout", str(REPO), str(checkout)], check=True)
        subprocess.run(["git", "checkout", "--quiet", "--detach", commit], cwd=checkout, check=True)
        print(f"building {', '.join(names)} of {commit} in {checkout}", flush=True)
        build(checkout, names, out)
    found = [difference(name, *((out / name).read_bytes() for out in built)) for name in names]
    if any(found):
        raise Refused("\n".join(filter(None, found)))
    return checkouts[0], built[0]


def sums(folder):
    """The lines of SHA256SUMS for what is in a folder."""
    files = sorted(file for file in folder.iterdir() if file.name not in (SUMS, SIGNATURE))
    lines = ((hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "no file", file.name) for file in files)
    return "".join(f"{digest}  {name}\n" for digest, name in lines)


def sign(folder, key):
    subprocess.run(["ssh-keygen", "-q", "-Y", "sign", "-n", NAMESPACE, "-f", str(key), str(folder / SUMS)], check=True)


def release(out, names, key):
    if out.exists():
        raise Refused(f"{out} is there already: name a new folder")
    if key and not key.is_file():
        raise Refused(f"there is no key {key}: ssh-keygen -t ed25519 -f {key} makes one")
    with tempfile.TemporaryDirectory(prefix="mon3tr-release-") as work:
        checkout, programs = build_twice(Path(work), names)
        for option, file in (("--sbom", "mon3tr.cdx.json"), ("--notices", "NOTICES.txt")):
            subprocess.run([sys.executable, str(checkout / "scripts/supply.py"), option, str(programs / file)], check=True)
        for file in ("LICENSE-MIT", "LICENSE-APACHE"):
            shutil.copy2(checkout / file, programs)
        (programs / SUMS).write_text(sums(programs))
        if key:
            sign(programs, key)
        shutil.copytree(programs, out)
    print(f"{out}: {', '.join(names)}, the same in both builds; {f'signed with {key}' if key else 'not signed: --key KEY signs'}")


def check(folder, signer):
    """Refuses a folder whose sums the signer has not signed, or that holds something else than they say."""
    for file in (SUMS, SIGNATURE):
        if not (folder / file).is_file():
            raise Refused(f"{folder} has no {file}")
    with tempfile.NamedTemporaryFile("w", suffix=".signers") as signers:
        signers.write(f'release namespaces="{NAMESPACE}" {signer.read_text().strip()}\n')
        signers.flush()
        verify = ["ssh-keygen", "-Y", "verify", "-n", NAMESPACE, "-f", signers.name, "-I", "release", "-s", str(folder / SIGNATURE)]
        with (folder / SUMS).open("rb") as signed:
            done = subprocess.run(verify, stdin=signed, capture_output=True, text=True)
    if done.returncode != 0:
        raise Refused(f"{signer} has not signed {folder / SUMS}: {(done.stdout + done.stderr).strip()}")
    told, there = (set(text.splitlines()) for text in ((folder / SUMS).read_text(), sums(folder)))
    if told != there:
        names = sorted({line.split("  ", 1)[-1] for line in told ^ there})
        raise Refused(f"{', '.join(names)} in {folder}: missing, changed, or not part of the release")
    print(f"{folder}: {len(told)} files, all as {signer} signed them")


def main():
    if sys.argv[1:2] == ["--check"]:
        parser = argparse.ArgumentParser(usage=__doc__)
        parser.add_argument("--check", type=Path, metavar="FOLDER")
        parser.add_argument("--signer", type=Path, metavar="KEY.pub", required=True)
        given = parser.parse_args()
        return check(given.check, given.signer)
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("build", choices=["build"])
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", action="append", choices=NAMES)
    parser.add_argument("--key", type=Path)
    given = parser.parse_args()
    return release(given.out, given.only or list(NAMES), given.key)


if __name__ == "__main__":
    try:
        main()
    except Refused as why:
        sys.exit(f"scripts/release.py: {why}")
    except subprocess.CalledProcessError as failed:
        sys.exit(f"scripts/release.py: {' '.join(failed.cmd)} failed")
