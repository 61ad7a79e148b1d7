#!/usr/bin/env python3
"""Checks the order of crates and modules: every crate of the workspace states its floor (`[package.metadata.mon3tr] floor = N`) and
depends, also in its tests, on crates of lower floors only; and within a crate no two sibling modules import one another, neither directly nor
around a circle. And a crate that has no `unsafe` forbids it. Prints what breaks that, and ends with 1."""

import json
import re
import subprocess
import sys
from pathlib import Path

USE = re.compile(r"\b(?:pub(?:\([a-z ]+\))? )?use ([^;]+);")
PATH = re.compile(r"(?<![\w:])(?:crate|self|super)(?:::\w+)+")


def flatten(tree, prefix=""):
    """`a::{b, c::{d}}` as the list of its paths."""
    tree = tree.strip()
    brace = tree.find("{")
    if brace < 0:
        return [prefix + tree.split(" as ")[0].strip()]
    head, body = tree[:brace], tree[brace + 1 : tree.rindex("}")]
    parts, depth, start = [], 0, 0
    for at, char in enumerate(body):
        depth += (char == "{") - (char == "}")
        if char == "," and depth == 0:
            parts.append(body[start:at])
            start = at + 1
    parts.append(body[start:])
    return [path for part in parts if part.strip() for path in flatten(part, prefix + head.strip())]


def code(text):
    """The file without comments, strings and its tests."""
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text, flags=re.S)
    return re.split(r"#\[cfg\(test\)\]\s*(?:#\[[^\]]*\]\s*)*mod \w+ \{", text)[0]


def modules(source):
    """Module path -> its code, of a crate's src folder."""
    found = {}
    for file in sorted(source.rglob("*.rs")):
        parts = list(file.relative_to(source).with_suffix("").parts)
        if parts[0] == "bin" or "tests" in parts or "testing" in parts:
            continue
        if parts[-1] in ("lib", "main", "mod"):
            parts.pop()
        # A library and a program may be of one crate.
        found[tuple(parts)] = found.get(tuple(parts), "") + code(file.read_text())
    return found


def absolute(path, here):
    """The path from the crate's root, or nothing for another crate's."""
    words = path.split("::")
    if words[0] == "crate":
        return words[1:]
    base = list(here)
    if words[0] == "self":
        return base + words[1:]
    if words[0] != "super":
        return None
    while words and words[0] == "super":
        if not base:
            return None
        base.pop()
        words.pop(0)
    return base + words


def references(text, here, known):
    """Every path into the crate that a module names."""
    for match in USE.finditer(text):
        for path in flatten(match.group(1)):
            first = path.split("::")[0]
            if here + (first,) in known:
                path = "self::" + path
            yield path
    for match in PATH.finditer(USE.sub("", text)):
        yield match.group(0)


def circles(source):
    known = modules(source)
    exported = {}
    for here, text in known.items():
        for match in re.finditer(r"\bpub(?:\([a-z ]+\))? use ([^;]+);", text):
            for path in flatten(match.group(1)):
                first = path.split("::")[0]
                path = "self::" + path if here + (first,) in known else path
                target = absolute(path, here)
                if target:
                    exported[here + (target[-1],)] = target
    edges = {}
    for here, text in known.items():
        for path in references(text, here, known):
            target = absolute(path, here)
            for _ in range(8):
                again = next((tuple(target[:n]) for n in range(len(target), 0, -1) if tuple(target[:n]) in exported), None) if target else None
                if again is None:
                    break
                target = list(exported[again]) + target[len(again) :]
            if not target:
                continue
            there = next((tuple(target[:n]) for n in range(len(target), 0, -1) if tuple(target[:n]) in known), ())
            level = 0
            while level < min(len(here), len(there)) and here[level] == there[level]:
                level += 1
            if level < len(here) and level < len(there):
                edges.setdefault(here[:level], {}).setdefault(here[level], {}).setdefault(there[level], "::".join(here))
    for level, graph in sorted(edges.items()):
        yield from ((level, circle) for circle in strongly_connected(graph))


def strongly_connected(graph):
    """Groups of more than one node that reach one another."""

    def reach(start):
        seen, todo = set(), [start]
        while todo:
            for node in graph.get(todo.pop(), {}):
                if node not in seen:
                    seen.add(node)
                    todo.append(node)
        return seen

    reached = {node: reach(node) for node in graph}
    done = set()
    for node in graph:
        group = {other for other in reached[node] if node in reached.get(other, ())}
        if len(group) > 1 and node not in done:
            done |= group
            yield sorted(group)


def may_be_unsafe(source):
    """Whether a crate without `unsafe` does not say that it has none."""
    roots = [file for file in (source / "lib.rs", source / "main.rs") if file.exists()]
    texts = [file.read_text() for file in sorted(source.rglob("*.rs"))]
    has_any = any(re.search(r"\bunsafe\b", re.sub(r"//[^\n]*", "", text)) for text in texts)
    return not has_any and any("#![forbid(unsafe_code)]" not in file.read_text() for file in roots)


def main():
    metadata = json.loads(subprocess.check_output(["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"]))
    packages = {package["name"]: package for package in metadata["packages"]}
    floors = {name: ((package["metadata"] or {}).get("mon3tr") or {}).get("floor") for name, package in packages.items()}
    wrong = []
    arrows = 0
    for name, package in sorted(packages.items()):
        if floors[name] is None:
            wrong.append(f"{name} does not state its floor: [package.metadata.mon3tr] floor = N")
            continue
        for dependency in package["dependencies"]:
            other = dependency["name"]
            # A crate's tests may name the crate itself, to have its features.
            if other == name or other not in packages or floors[other] is None:
                continue
            arrows += 1
            if floors[other] >= floors[name]:
                kind = dependency["kind"] or "normal"
                wrong.append(f"{name} (floor {floors[name]}) depends on {other} (floor {floors[other]}), {kind}")
        source = Path(package["manifest_path"]).parent / "src"
        for level, circle in circles(source):
            where = "::".join((name,) + level)
            wrong.append(f"{where}: modules import one another: {', '.join(circle)}")
        if may_be_unsafe(source):
            wrong.append(f"{name} has no `unsafe`, and no #![forbid(unsafe_code)] in its lib.rs or main.rs")
    for line in wrong:
        print(line)
    print(f"{len(packages)} crates, {arrows} dependencies between them, {len(wrong)} things wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
