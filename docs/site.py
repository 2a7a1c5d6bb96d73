#!/usr/bin/env python3
"""Build the documents as a site with mdBook.

    docs/site.py -o FOLDER           writes FOLDER/index.html and the rest
    docs/site.py -o FOLDER --gather  only gathers the pages in FOLDER/src, for `mdbook serve FOLDER`

Pages lie in several folders of the repository and link to each other. So they, and the files that they link to, are
copied with their paths, and docs/SUMMARY.md becomes the table of contents. mdBook comes by `cargo install mdbook`.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import links  # noqa: E402


def targets(page):
    """Files that a page links to or shows."""
    return [path for _, _, path, _ in links.links_of(page) if path.is_file()]


def gather(folder):
    """The pages and what they link to, under FOLDER/src; returns the names of the pages in the table of contents."""
    source = folder / "src"
    shutil.rmtree(source, ignore_errors=True)
    docs = links.TOP / "docs"
    summary = (docs / "SUMMARY.md").read_text(encoding="utf-8")

    def moved(match):
        path = Path(os.path.normpath(docs / match.group(2)))
        return f"{match.group(1)}({path.relative_to(links.TOP)})"

    summary = re.sub(r"(\[[^\]]*\])\(([^)]+)\)", moved, summary)
    listed = [links.TOP / name for name in re.findall(r"\]\(([^)]+)\)", summary)]
    for page in listed:
        for path in [page, *targets(page)]:
            copy = source / path.relative_to(links.TOP)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
    (source / "SUMMARY.md").write_text(summary, encoding="utf-8")
    shutil.copyfile(docs / "book.toml", folder / "book.toml")
    return [page.relative_to(links.TOP) for page in listed]


def unlisted(listed):
    """Pages of docs and of the report that the table of contents lacks."""
    pages = [page.relative_to(links.TOP) for page in links.pages()]
    folders = (Path("docs"), Path("bench-data/report"))
    is_ours = [page for page in pages if any(page.is_relative_to(folder) for folder in folders)]
    return [page for page in is_ours if page.name != "SUMMARY.md" and page not in listed]


def broken(book):
    """Links of the site's pages to files that it lacks."""
    for page in sorted(book.rglob("*.html")):
        if page.name in ("404.html", "print.html", "toc.html"):
            continue
        for target in re.findall(r'(?:href|src)="([^"#?]+)', page.read_text(encoding="utf-8")):
            if not re.match(r"[a-z]+:|//", target) and not (page.parent / target).exists():
                yield f"{page.relative_to(book)}: {target}: the site lacks it"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", required=True, type=Path, help="folder of the site")
    parser.add_argument("--gather", action="store_true", help="build nothing")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    listed = gather(options.output)
    for page in unlisted(listed):
        print(f"{page}: not in docs/SUMMARY.md", file=sys.stderr)
    if unlisted(listed):
        return 1
    if not options.gather:
        mdbook = shutil.which("mdbook") or os.path.expanduser("~/.cargo/bin/mdbook")
        subprocess.run([mdbook, "build", options.output, "--dest-dir", options.output.resolve() / "book"], check=True)
        book = options.output / "book"
        faults = list(broken(book))
        print("\n".join(faults) or book / "index.html")
        return bool(faults)
    return 0


if __name__ == "__main__":
    sys.exit(main())
