"""Preprocessor of mdBook: makes the links of the pages work in the book, as they do beside the code.

A link to a page or a picture of the book leads to it, also from README.md and CONTRIBUTING.md, which stand at the top. A
link to any other file leads to $REPOSITORY_URL/FILE; without that variable only its text is left, with the path.
"""

import json
import os
import posixpath
import re
import sys

LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s#]*)(#[^()\s]*)?\)")
# Chapters that include a page from the top of the repository.
AT_TOP = {"introduction.md": "README.md", "contributing.md": "CONTRIBUTING.md"}


def chapters(items):
    for item in items:
        if chapter := isinstance(item, dict) and item.get("Chapter"):
            yield chapter
            yield from chapters(chapter["sub_items"])


def linked(chapter, pages):
    """Returns the content of a chapter with its links as the book needs them.

    `pages` has the book's pages, by their paths from the top of the repository.
    """
    here = chapter["path"]
    folder = "" if here in AT_TOP else posixpath.dirname(posixpath.join("docs", here))

    def replaced(link):
        is_picture, text, path, anchor = link[1], link[2], link[3], link[4] or ""
        if not path or "://" in path or path.startswith("mailto:"):
            return link[0]
        path = posixpath.normpath(posixpath.join(folder, path))
        if is_picture:
            return f"![{text}]({posixpath.relpath(path, posixpath.join('docs', posixpath.dirname(here)))})"
        if path.endswith("docs/decisions") or path == "docs/decisions":
            path += "/README.md"
        if path in pages:
            return f"[{text}]({posixpath.relpath(pages[path], posixpath.dirname(here) or '.')}{anchor})"
        if url := os.environ.get("REPOSITORY_URL"):
            return f"[{text}]({url}/{path}{anchor})"
        return text if posixpath.basename(path) in text else f"{text} (`{path}`)"

    # Links in blocks of code stay as they are.
    parts = re.split(r"(^```.*?^```)", chapter["content"], flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else LINK.sub(replaced, part) for part in parts)


def main():
    if sys.argv[1:2] == ["supports"]:
        return
    _, book = json.load(sys.stdin)
    items = book.get("items") or book["sections"]
    pages = {posixpath.join("docs", c["path"]): c["path"] for c in chapters(items) if c["path"]}
    pages |= {page: chapter for chapter, page in AT_TOP.items()}
    for chapter in chapters(items):
        if chapter["path"]:
            chapter["content"] = linked(chapter, pages)
    json.dump(book, sys.stdout)


main()
