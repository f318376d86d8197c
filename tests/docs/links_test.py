#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""links_test.py ROOT: every relative link of README.md and docs/ leads to a file and to a heading that are there,
every page can be reached from docs/README.md, and the changelog says nothing twice. Needs no network: links to other sites
are not followed."""
import collections
import pathlib
import re
import sys
import urllib.parse

LINK = re.compile(r"\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)")


def prose(text):
    """The text without blocks and spans of code, in which brackets are no links. Lines stay where they are."""
    text = re.sub(r"^```.*?^```", lambda m: "\n" * m.group().count("\n"), text, flags=re.M | re.S)
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^ {4}.*$", "", text, flags=re.M))


def headings(page):
    """The anchors that a viewer such as GitHub makes of a page's headings."""
    anchors, text = set(), re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for heading in re.findall(r"^#{1,6} +(.*?) *$", text, flags=re.M):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        count = 0
        while (anchor if count == 0 else f"{anchor}-{count}") in anchors:
            count += 1
        anchors.add(anchor if count == 0 else f"{anchor}-{count}")
    return anchors


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    pages = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    faults, leads_to = [], {}
    for page in pages:
        text = prose(page.read_text(encoding="utf-8"))
        for match in LINK.finditer(text):
            link = urllib.parse.unquote(match.group(1))
            if re.match(r"[a-z][a-z0-9+.-]*:", link):
                continue
            where = f"{page.relative_to(root)}:{text.count(chr(10), 0, match.start()) + 1}: ({link})"
            path, _, anchor = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            if not target.exists():
                faults.append(f"{where} leads to no file")
            elif not target.is_relative_to(root):
                faults.append(f"{where} leads out of the project")
            elif anchor and (target.suffix != ".md" or anchor not in headings(target)):
                faults.append(f"{where} leads to no heading of that page")
            else:
                leads_to.setdefault(page, set()).add(target)
    reached, waiting = set(), [root / "docs" / "README.md"]
    while waiting:
        page = waiting.pop()
        if page not in reached:
            reached.add(page)
            waiting += [target for target in leads_to.get(page, ()) if target.suffix == ".md"]
    faults += [f"{page.relative_to(root)}: no link leads here from docs/README.md" for page in pages[1:] if page not in reached]
    # Branches that are merged line by line can bring the same entry twice.
    entries = collections.Counter(re.findall(r"^ *- .+$", (root / "docs" / "changelog.md").read_text(encoding="utf-8"), re.M))
    faults += [f"docs/changelog.md has {count} times: {entry}" for entry, count in entries.items() if count > 1]
    if faults:
        sys.exit("\n".join(faults))
    print(f"{len(pages)} pages, all links lead somewhere")


main()
