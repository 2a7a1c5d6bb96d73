#!/usr/bin/env python3
"""Words per sentence and per paragraph of documents, help texts and doc comments.

    docs/prose.py                                   table of all documents
    docs/prose.py --check                           status 1 if a document is above the limits
    docs/prose.py --program target/release/brickfield          the --help of every command, too
    docs/prose.py --comments engine tools           doc comments of public items, too
    docs/prose.py --worst 10 README.md              the longest sentences, with their places

Limits: 20 words a sentence on average in a file, 40 in any sentence, 60 in any paragraph. Code blocks, headings and
pictures do not count. Cells of tables and list items are paragraphs of their own; cells do not count for the average,
since their scraps would lower it. A code span is one word.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

SENTENCE_MEAN_MAX = 20.0
SENTENCE_MAX = 40
PARAGRAPH_MAX = 60

TOP = Path(__file__).resolve().parent.parent
DOCUMENTS = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "bench-data/REPORT.md", "docs"]

ABBREVIATIONS = re.compile(r"\b(et al|e\.g|i\.e|vs|cf|Fig|Eq|No|approx)\.$")


class Paragraph:
    """Text without a blank line, from one place."""

    def __init__(self, place, text, is_cell=False):
        self.place, self.text, self.is_cell = place, text, is_cell

    def sentences(self):
        """The sentences, each as a list of words."""
        words, out = [], []
        for word in plain(self.text).split():
            if re.search(r"\w", word):
                words.append(word)
            if words and re.search(r"[.!?][\"')\]*_]*$", word) and not ABBREVIATIONS.search(word) and "al." != word:
                out.append(words)
                words = []
        if words:
            out.append(words)
        return out


def plain(text):
    """Markdown without its marks; a code span is one word."""
    text = re.sub(r"<!--.*?-->", " ", text, flags=re.S)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", " ", text)
    text = re.sub(r"<[a-z/][^>]*>", " ", text)
    text = re.sub(r"``[^`]+``|`[^`]*`", "CODE", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"\[([^\]]*)\]\[[^\]]*\]", r"\1", text)
    return text.replace("*", "")


def of_markdown(text, name):
    """Paragraphs of a Markdown text."""
    paragraphs, lines, begin = [], [], 0
    in_fence = False
    is_code_allowed = True

    def finish():
        nonlocal lines
        if lines:
            paragraphs.append(Paragraph(f"{name}:{begin}", " ".join(lines)))
        lines = []

    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        if bare.startswith(("```", "~~~")):
            finish()
            in_fence = not in_fence
            continue
        if in_fence:
            continue
        if not bare:
            finish()
            is_code_allowed = True
            continue
        if line.startswith("    ") and not lines and is_code_allowed:
            continue
        if bare.startswith("#") or re.fullmatch(r"[-=*_]{3,}", bare):
            finish()
            continue
        if bare.startswith("|"):
            finish()
            if not re.fullmatch(r"[|:\-\s]+", bare):
                cells = re.split(r"(?<!\\)\|", bare)
                paragraphs += [Paragraph(f"{name}:{number}", cell, True) for cell in cells if cell.strip()]
            continue
        item = re.match(r"\s*([-*+]|\d+\.)\s+(.*)", line)
        if item:
            finish()
            bare = item.group(2)
            is_code_allowed = False
        if not lines:
            begin = number
        lines.append(bare.lstrip("> "))
    finish()
    return paragraphs


def of_help(text, name):
    """Paragraphs of what `--help` prints: descriptions, one for each option or value, and the text behind them."""
    paragraphs, lines = [], []

    def finish():
        nonlocal lines
        if lines:
            paragraphs.append(Paragraph(name, " ".join(lines)))
        lines = []

    in_examples = False
    for line in text.splitlines():
        bare = line.strip()
        if re.match(r"Examples?:$", bare):
            in_examples = True
        elif not bare:
            finish()
            in_examples = False
            continue
        if in_examples or re.match(r"(Usage:|-\w?,? ?-?-?[\w-]+( |=|\[|$)|<[\w.|/-]+>|\[[A-Z.]+\])", bare) and not bare.startswith("- "):
            finish()
            continue
        if re.fullmatch(r"[A-Z][\w, ]*:", bare):
            finish()
            continue
        if re.match(r"  [^\s-]", line):
            # A row of a table, or a line of a file.
            finish()
            if not re.search(r"^\[| = ", bare):
                paragraphs.append(Paragraph(name, re.split(r"\s{2,}", bare, maxsplit=1)[-1], True))
            continue
        value = re.match(r"(?:- )?([\w-]+):?\s{1,}(.*)", bare)
        if bare.startswith("- ") and value:
            finish()
            bare = value.group(2)
        bare = re.sub(r"\[(default|possible values): [^\]]*\]", "", bare)
        if bare:
            lines.append(bare)
    finish()
    return paragraphs


def commands_of(program, words):
    """A command and those below it, with what their `--help` prints."""
    env = dict(os.environ, COLUMNS="110")
    text = subprocess.run([program, *words, "--help"], capture_output=True, text=True, env=env, check=True).stdout
    yield words, text
    usage = re.search(r"^Usage: .*<COMMAND>", text, flags=re.M)
    if not usage:
        return
    for name in re.findall(r"^  ([a-z][\w-]*)\s{2,}\S", text, flags=re.M):
        if name != "help":
            yield from commands_of(program, [*words, name])


PUBLIC = re.compile(r"\s*(pub(?!\s*\()|macro_rules!|#\[macro_export)")
VARIANT = re.compile(r"\s*[A-Z]\w*\s*([({,=]|$)")


def of_comments(text, name):
    """Doc comments of public items, of variants, and of modules."""
    paragraphs, block, begin = [], [], 0
    module = []
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        bare = line.strip()
        if bare.startswith("//!"):
            module.append(bare[3:].removeprefix(" "))
        elif bare.startswith("///"):
            if not block:
                begin = number
            block.append(bare[3:].removeprefix(" "))
        elif bare.startswith("#[") or (block and bare.endswith(")]")):
            continue
        else:
            if block and (PUBLIC.match(line) or VARIANT.match(line)):
                for paragraph in of_markdown("\n".join(block), name):
                    at = int(paragraph.place.rsplit(":", 1)[1])
                    paragraphs.append(Paragraph(f"{name}:{begin + at - 1}", paragraph.text, paragraph.is_cell))
            block = []
    return of_markdown("\n".join(module), name) + paragraphs


class Figures:
    """What a file, or a set of texts, comes to."""

    def __init__(self, name, paragraphs, size=None):
        self.name, self.size = name, size
        sentences = [(len(words), p, words) for p in paragraphs for words in p.sentences()]
        self.lengths = sorted(((n, p.place, words) for n, p, words in sentences), reverse=True, key=lambda s: s[0])
        counted = [n for n, p, _ in sentences if not p.is_cell]
        self.words = sum(counted)
        self.count = len(counted)
        self.mean = self.words / self.count if counted else 0.0
        self.longest = self.lengths[0][0] if sentences else 0
        self.over = [s for s in self.lengths if s[0] > SENTENCE_MAX]
        sizes = [(sum(len(words) for words in p.sentences()), p) for p in paragraphs]
        self.paragraph = max((n for n, _ in sizes), default=0)
        self.long = [(n, p.place) for n, p in sizes if n > PARAGRAPH_MAX]

    def faults(self):
        """What is above the limits, a line each."""
        if self.mean > SENTENCE_MEAN_MAX:
            yield f"{self.name}: {self.mean:.1f} words a sentence on average, at most {SENTENCE_MEAN_MAX:.0f}"
        for n, place, words in self.over:
            yield f"{place}: a sentence of {n} words, at most {SENTENCE_MAX}: {' '.join(words[:8])} ..."
        for n, place in self.long:
            yield f"{place}: a paragraph of {n} words, at most {PARAGRAPH_MAX}"


def pages(paths):
    """Markdown files of files and folders."""
    for path in paths:
        path = Path(path) if Path(path).is_absolute() else TOP / path
        if path.is_dir():
            yield from sorted(p for p in path.rglob("*.md") if p.name != "SUMMARY.md")
        else:
            yield path


def measured(options):
    """Figures of everything that was asked for."""
    for path in pages(options.files or DOCUMENTS):
        name = os.path.relpath(path, TOP)
        text = path.read_text(encoding="utf-8")
        yield Figures(name, of_markdown(text, name), len(text.encode()))
    if options.program:
        program = os.path.abspath(options.program)
        texts = list(commands_of(program, []))
        help_name = Path(program).name + " {} --help"
        yield Figures(
            help_name.format("..."),
            [p for words, text in texts for p in of_help(text, help_name.format(" ".join(words)))],
            sum(len(text.encode()) for _, text in texts),
        )
    for folder in options.comments:
        paragraphs = []
        for path in sorted((TOP / folder).rglob("*.rs")):
            if "tests" not in path.parts and path.name != "tests.rs" and "target" not in path.parts:
                paragraphs += of_comments(path.read_text(encoding="utf-8"), os.path.relpath(path, TOP))
        yield Figures(f"doc comments in {folder}", paragraphs)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", help="Markdown files or folders; the documents by default")
    parser.add_argument("--program", help="a program whose help is measured")
    parser.add_argument("--comments", nargs="+", default=[], metavar="FOLDER", help="folders of Rust sources")
    parser.add_argument("--check", action="store_true", help="fail if anything measured is above the limits")
    parser.add_argument("--worst", type=int, default=0, metavar="N", help="print the N longest sentences of each")
    options = parser.parse_args()
    print(f"{'text':44} {'bytes':>7} {'sentences':>9} {'mean':>5} {'longest':>7} {'> 40':>5} {'paragraph':>9} {'> 60':>5}")
    faults = []
    for figures in measured(options):
        size = "" if figures.size is None else figures.size
        print(
            f"{figures.name:44} {size:>7} {figures.count:>9} {figures.mean:>5.1f} {figures.longest:>7} "
            f"{len(figures.over):>5} {figures.paragraph:>9} {len(figures.long):>5}"
        )
        for n, place, words in figures.lengths[: options.worst]:
            print(f"    {n:3} {place}: {' '.join(words)}")
        faults += figures.faults()
    if options.check and faults:
        print("\n".join(faults), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
