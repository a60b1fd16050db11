"""Tables of figures in documents, between markers."""

import re

from . import store
from .store import FigureError
from .tables import TABLES, rendered

# A line of its own.
MARKER = re.compile(r"(?m)^<!-- (?:figure: (?P<name>[^>]*?)|/figure) -->$")


def documents(tree):
    """README and the pages below docs."""
    return [path for path in [tree.root / "README.md", *sorted((tree.root / "docs").rglob("*.md"))] if path.is_file()]


def sections(path, text):
    """(name, begin, end) of what lies between each pair of markers; errors name the document `path`."""
    found, name, begin = [], None, 0
    for marker in MARKER.finditer(text):
        line = text.count("\n", 0, marker.start()) + 1
        if (marker["name"] is None) == (name is None):
            wrong = "ends no figure" if name is None else f"stands before the end of the figure {name}"
            raise FigureError(f"{path}:{line}: the marker {marker[0]} {wrong}")
        if marker["name"] is None:
            found.append((name, begin, marker.start()))
            name = None
        else:
            name, begin = marker["name"], marker.end()
    if name is not None:
        raise FigureError(f"{path}: the figure {name} has no end: <!-- /figure --> is missing")
    return found


def filled(tree, path, text):
    """The text with its tables made again, and names of those that changed."""
    parts, changed, at = [], [], 0
    for name, begin, end in sections(path, text):
        try:
            content = f"\n\n{rendered(tree, name)}\n\n"
        except FigureError as error:
            raise FigureError(f"{path}: {error}") from None
        if content != text[begin:end]:
            changed.append(name)
        parts += [text[at:begin], content]
        at = end
    return "".join([*parts, text[at:]]), changed


def render(tree):
    """Writes all tables; returns lines about what changed."""
    said = []
    for path in documents(tree):
        name = path.relative_to(tree.root)
        new, changed = filled(tree, name, path.read_text())
        if changed:
            store.replace(path, new)
            said.append(f"{name}: {', '.join(changed)}")
    return said


def faults(tree):
    """Lines about tables that differ from their data, markers that are wrong, and data that no document shows."""
    said, shown = [], set()
    for path in documents(tree):
        name = path.relative_to(tree.root)
        try:
            text = path.read_text()
            shown |= {TABLES[table][0] for table, _, _ in sections(name, text) if table in TABLES}
            _, changed = filled(tree, name, text)
        except FigureError as error:
            said.append(str(error))
            continue
        said += [f"{name}: the table {table} differs from its data; scripts/figures --render writes it" for table in changed]
    for name in tree.names():
        tables = [table for table, (data, _) in TABLES.items() if data == name]
        if not tables:
            said.append(f"docs/figures/{name}.json is the data of no known figure")
        elif name not in shown:
            said.append(f"docs/figures/{name}.json is shown nowhere: put <!-- figure: {tables[0]} --> and <!-- /figure --> in a document")
    return said
