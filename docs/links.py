#!/usr/bin/env python3
"""Check the links between documents: files that are there, headings that are there. No network.

    docs/links.py            status 1 and a line each for links that lead nowhere, and for pages that no page links to

Headings are named as GitHub and mdBook name them: in lower case, without punctuation, blanks as hyphens.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

TOP = Path(__file__).resolve().parent.parent

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)|<img[^>]*\ssrc=\"([^\"]+)\"")


def pages():
    """Markdown files of the repository, but for fixtures."""
    command = ["git", "ls-files", "-co", "--exclude-standard", "*.md"]
    names = subprocess.run(command, cwd=TOP, capture_output=True, text=True, check=True).stdout.split()
    return [TOP / name for name in names if not name.startswith("tests/data/") and (TOP / name).is_file()]


def without_code(text):
    """The text with code blocks and code spans blanked; lines stay where they are."""
    out, in_fence = [], False
    for line in text.splitlines():
        if line.strip().startswith(("```", "~~~")):
            in_fence = not in_fence
            line = ""
        is_block = line.startswith("    ") and (not out or not out[-1].strip() or out[-1].startswith("\0"))
        if in_fence or is_block:
            out.append("\0")
        else:
            out.append(re.sub(r"`[^`]*`", "", line))
    return "\n".join(out).replace("\0", "")


def links_of(page):
    """What a page links to or shows within the repository: the line, the target as written, the file, the heading."""
    text = without_code(page.read_text(encoding="utf-8"))
    for match in LINK.finditer(text):
        target = match.group(1) or match.group(2)
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = unquote(target).partition("#")
        path = Path(os.path.normpath(page.parent / file)) if file else page
        yield text.count("\n", 0, match.start()) + 1, target, path, anchor


def anchors(path):
    """The names of a page's headings."""
    names, seen, in_fence = set(), {}, False
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.strip().startswith(("```", "~~~")):
            in_fence = not in_fence
        heading = re.match(r"#{1,6}\s+(.*?)\s*#*$", line)
        if in_fence or not heading:
            continue
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.group(1)).lower()
        name = re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
        count = seen.get(name, 0)
        seen[name] = count + 1
        names.add(f"{name}-{count}" if count else name)
    return names


def main():
    faults, linked, known = [], set(), {}
    for page in pages():
        for number, target, path, anchor in links_of(page):
            place = f"{page.relative_to(TOP)}:{number}"
            if not path.exists():
                faults.append(f"{place}: {target}: there is no such file")
                continue
            linked.add(path)
            if anchor and path.suffix == ".md" and anchor not in known.setdefault(path, anchors(path)):
                faults.append(f"{place}: {target}: there is no such heading")
    for page in pages():
        is_page = page.is_relative_to(TOP / "docs") or page.is_relative_to(TOP / "bench-data" / "report")
        if is_page and page.name != "SUMMARY.md" and page not in linked:
            faults.append(f"{page.relative_to(TOP)}: no page links to it")
    print("\n".join(faults) or f"{len(pages())} pages, all links lead somewhere")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
