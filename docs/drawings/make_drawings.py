#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""make_drawings.py [--check]: draws the pictures of docs/ as SVG, beside this script.

With --check nothing is written: it leaves with 1 when a picture is not what the script would draw.
It needs only the standard library, and the same script always writes the same bytes.
"""
import html
import math
import pathlib
import sys

INK, QUIET, PAPER = "#222222", "#8a8a8a", "#ffffff"
BLUE, ORANGE, GREEN, RED = "#2f6fb2", "#d9822b", "#3a8f5a", "#c23b3b"
PALE_BLUE, PALE_ORANGE, PALE_GREEN, PALE_GREY = "#dbe8f5", "#fbe6cf", "#dcefe2", "#f1f1f1"


ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def number(x):
    """Two decimals, no trailing zeros and no minus before a zero: the same text on every machine."""
    text = f"{x:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


class Drawing:
    """A picture: shapes are added in the order in which they are painted. y grows downwards, as in SVG."""

    def __init__(self, width, height, title):
        self.width, self.height, self.title, self.parts = width, height, title, []

    def add(self, name, attributes, text=None):
        said = " ".join(f'{k.rstrip("_").replace("_", "-")}="{number(v) if isinstance(v, (int, float)) else v}"'
                        for k, v in attributes.items() if v is not None)
        self.parts.append(f"<{name} {said}/>" if text is None else f"<{name} {said}>{html.escape(text)}</{name}>")

    def line(self, x1, y1, x2, y2, stroke=INK, width=1.5, dash=None, arrow=False):
        self.add("line", {"x1": x1, "y1": y1, "x2": x2, "y2": y2, "stroke": stroke, "stroke_width": width,
                          "stroke_dasharray": dash, "marker_end": f"url(#arrow{stroke[1:]})" if arrow else None})

    def circle(self, x, y, r, fill="none", stroke=INK, width=1.5, dash=None, opacity=None):
        self.add("circle", {"cx": x, "cy": y, "r": r, "fill": fill, "stroke": stroke, "stroke_width": width,
                            "stroke_dasharray": dash, "fill_opacity": opacity})

    def dot(self, x, y, fill=INK, r=3.5):
        self.circle(x, y, r, fill, "none", 0)

    def box(self, x, y, w, h, fill="none", stroke=INK, width=1.5, round_=0, dash=None):
        self.add("rect", {"x": x, "y": y, "width": w, "height": h, "rx": round_, "fill": fill, "stroke": stroke,
                          "stroke_width": width, "stroke_dasharray": dash})

    def polygon(self, points, fill="none", stroke=INK, width=1.5):
        self.add("polygon", {"points": " ".join(f"{number(x)},{number(y)}" for x, y in points), "fill": fill,
                             "stroke": stroke, "stroke_width": width})

    def text(self, x, y, text, size=15, fill=INK, anchor="start", weight=None, style=None):
        self.add("text", {"x": x, "y": y, "font_size": size, "fill": fill, "text_anchor": anchor,
                          "font_weight": weight, "font_style": style}, text)

    def svg(self):
        colours = (INK, QUIET, BLUE, ORANGE, GREEN, RED)
        arrows = "".join(
            f'<marker id="arrow{c[1:]}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
            f'orient="auto-start-reverse"><path d="M0 0L10 5L0 10z" fill="{c}"/></marker>' for c in colours)
        return "\n".join([
            "<!-- SPDX-License-Identifier: MIT. Made by docs/drawings/make_drawings.py: change that and run it. -->",
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" width="{self.width}" '
            f'height="{self.height}" font-family="Helvetica, Arial, sans-serif">',
            f"<title>{html.escape(self.title)}</title>", f"<defs>{arrows}</defs>",
            f'<rect width="{self.width}" height="{self.height}" fill="{PAPER}"/>', *self.parts, "</svg>", ""])


def lattice(d, x, y, columns, rows, edge, stroke=QUIET, width=1):
    for k in range(columns + 1):
        d.line(x + k * edge, y, x + k * edge, y + rows * edge, stroke, width)
    for k in range(rows + 1):
        d.line(x, y + k * edge, x + columns * edge, y + k * edge, stroke, width)


def grid():
    d = Drawing(860, 400, "A sphere searches its own bin and the forward half of the neighbours; large spheres have a level of their own")
    # Left: the forward half.
    d.text(30, 30, "One level: the forward half", 17, weight="bold")
    x, y, edge = 30, 50, 60
    d.box(x + 2 * edge, y + 2 * edge, edge, edge, PALE_BLUE, "none")
    for column, row in ((3, 2), (1, 3), (2, 3), (3, 3)):
        d.box(x + column * edge, y + row * edge, edge, edge, PALE_ORANGE, "none")
    lattice(d, x, y, 5, 5, edge)
    for cx, cy, r in ((2.55, 2.45, 0.45), (3.3, 2.8, 0.38), (1.5, 3.45, 0.4), (0.6, 1.5, 0.4), (3.6, 0.7, 0.42), (4.4, 4.4, 0.4)):
        main = (cx, cy) == (2.55, 2.45)
        d.circle(x + cx * edge, y + cy * edge, r * edge, PALE_GREY if not main else BLUE, BLUE if main else INK, 1.5,
                 opacity=0.35 if main else 0.6)
        d.dot(x + cx * edge, y + cy * edge, BLUE if main else INK, 2.5)
    d.box(30, 368, 14, 14, PALE_BLUE, BLUE)
    d.text(52, 380, "own bin", 14)
    d.box(125, 368, 14, 14, PALE_ORANGE, ORANGE)
    d.text(147, 380, "forward half: 4 of 8 here, 13 of 26 in space", 14)
    # Right: two levels.
    d.text(470, 30, "Two levels: small and large bins", 17, weight="bold")
    x, y, edge = 470, 50, 30
    lattice(d, x, y, 12, 10, edge, "#cfcfcf")
    lattice(d, x, y, 3, 2, 4 * edge, ORANGE, 2)
    d.line(x, y + 10 * edge, x + 12 * edge, y + 10 * edge, ORANGE, 2)
    for k in range(4):
        d.line(x + 4 * k * edge, y + 8 * edge, x + 4 * k * edge, y + 10 * edge, ORANGE, 2)
    d.circle(x + 5.6 * edge, y + 4.4 * edge, 1.9 * edge, ORANGE, ORANGE, 2, opacity=0.25)
    d.dot(x + 5.6 * edge, y + 4.4 * edge, ORANGE)
    for cx, cy, r in ((1.4, 1.5, 0.45), (2.5, 6.4, 0.4), (7.6, 5.5, 0.45), (8.4, 5.9, 0.45), (9.5, 1.4, 0.4), (4.5, 8.6, 0.45), (10.6, 8.5, 0.42), (3.4, 3.5, 0.44)):
        d.circle(x + cx * edge, y + cy * edge, r * edge, BLUE, BLUE, 1.2, opacity=0.35)
    d.line(470, 375, 494, 375, "#cfcfcf", 2)
    d.text(502, 380, "finer level", 14)
    d.line(600, 375, 624, 375, ORANGE, 2.5)
    d.text(632, 380, "coarser level", 14)
    return d


def midpoint():
    d = Drawing(800, 380, "The bin that holds the midpoint of two spheres' deepest points owns their contact")
    x, y, edge = 40, 62, 240
    d.box(x + edge, y, edge, edge, PALE_GREEN, "none")
    lattice(d, x, y, 2, 1, edge)
    d.text(x + 12, y + 24, "bin A", 16, QUIET, weight="bold")
    d.text(x + 2 * edge - 12, y + 24, "bin B", 16, GREEN, "end", "bold")
    ax, ay, ar = x + 205, y + 135, 82
    bx, by, br = x + 330, y + 135, 72
    d.circle(ax, ay, ar, BLUE, BLUE, 1.8, opacity=0.2)
    d.circle(bx, by, br, ORANGE, ORANGE, 1.8, opacity=0.2)
    d.line(ax, ay, bx, by, QUIET, 1.2, "4 3")
    d.dot(ax, ay, BLUE)
    d.dot(bx, by, ORANGE)
    d.text(ax - 8, ay + 5, "i", 16, BLUE, "end", style="italic")
    d.text(bx + 8, by + 5, "j", 16, ORANGE, style="italic")
    left, right = bx - br, ax + ar
    d.dot(left, by, ORANGE)
    d.dot(right, ay, BLUE)
    middle = (left + right) / 2
    d.line(middle, ay + 105, middle, ay + 7, GREEN, 1.5, arrow=True)
    d.dot(middle, ay, GREEN, 5)
    d.text(middle, ay + 122, "midpoint", 15, GREEN, "middle", "bold")
    d.line(left, y - 14, left, ay - 6, ORANGE, 1.2, arrow=True)
    d.text(left - 2, y - 20, "deepest point of j", 14, ORANGE, "end")
    d.line(right, y - 14, right, ay - 6, BLUE, 1.2, arrow=True)
    d.text(right + 2, y - 20, "deepest point of i", 14, BLUE)
    for k, words in enumerate(("Both spheres touch", "bins A and B, so both", "bins hold the pair.", "", "The midpoint lies in", "bin B alone: bin B", "reports the contact,", "bin A does not.")):
        d.text(560, 105 + 25 * k, words, 16)
    d.text(40, 357, "A midpoint on a shared face belongs to the bin above it: low face included, high face excluded.", 15)
    return d


def medial_ball():
    d = Drawing(840, 460, "An inner medial ball, dilated by the allowed protrusion, covers a disc of surface of radius rho")
    top, left, right, bottom = 150, 40, 530, 410
    d.polygon([(left, top), (right, top), (right, bottom), (left, bottom)], PALE_GREY, "none")
    d.line(left, top, right, top, INK, 2.5)
    d.text(right - 6, bottom - 12, "body B", 16, QUIET, "end", style="italic")
    d.text(left + 6, top - 8, "surface S", 15)
    cx, depth, dilation, gap = 290, 120, 26, 26
    cy = top + depth
    reach = depth + dilation + gap
    rho = math.sqrt(reach * reach - depth * depth)
    d.circle(cx, cy, reach, "none", GREEN, 1.5, "3 4")
    d.circle(cx, cy, depth + dilation, BLUE, BLUE, 2, opacity=0.12)
    d.circle(cx, cy, depth, "none", INK, 1.5, "7 4")
    d.line(cx - rho, top, cx + rho, top, GREEN, 6)
    d.dot(cx, cy)
    d.text(cx + 10, cy + 20, "c", 17, style="italic")
    d.line(cx, cy, cx, top + 4, INK, 1.5, arrow=True)
    d.text(cx - 8, cy - 50, "D", 17, anchor="end", style="italic")
    # The end of the covered disc.
    d.line(cx, cy, cx + rho, top, GREEN, 1.5)
    d.dot(cx + rho, top, GREEN, 4.5)
    d.text(cx + rho + 10, top + 22, "x", 17, GREEN, style="italic")
    d.line(468, cy + 12, cx + 62, cy - 57, GREEN, 1)
    d.text(472, cy + 24, "D+p+g", 14, GREEN, style="italic")
    # Protrusion and gap above the surface.
    d.line(cx, top - 4, cx, top - dilation, BLUE, 1.8, arrow=True)
    d.line(cx - 4, top - 15, 150, 75, BLUE, 1)
    d.text(146, 70, "p: protrusion", 15, BLUE, "middle")
    d.line(cx, top - dilation, cx, top - dilation - gap, GREEN, 1.8, arrow=True)
    d.line(cx + 4, top - dilation - 15, 370, 62, GREEN, 1)
    d.text(374, 60, "g: gap that is allowed", 15, GREEN)
    d.line(90, top + 40, cx - 66, top + 5, GREEN, 1)
    d.text(86, top + 46, "2 rho", 16, GREEN, "end", style="italic")
    d.line(570, 130, 606, 130, INK, 1.5, "7 4")
    d.text(616, 135, "medial ball, radius D", 15)
    d.line(570, 165, 606, 165, BLUE, 2)
    d.text(616, 170, "sphere, radius D + p", 15)
    d.line(570, 200, 606, 200, GREEN, 1.5, "3 4")
    d.text(616, 205, "radius D + p + g", 15)
    d.line(570, 235, 606, 235, GREEN, 6)
    d.text(616, 240, "surface that it covers: a disc", 15)
    d.text(570, 290, "rho = sqrt(s (2 D + s))", 16, weight="bold")
    d.text(570, 315, "s = p + g is the tolerance sum", 15)
    return d


def pipeline():
    d = Drawing(900, 365, "Padding, from a mesh file to a cluster of spheres")

    def step(x, y, name, words, fill, stroke, width=118):
        d.box(x, y, width, 58, fill, stroke, 1.5, 8)
        d.text(x + width / 2, y + 25, name, 16, INK, "middle", "bold")
        d.text(x + width / 2, y + 45, words, 12.5, INK, "middle")

    def join(x1, y1, x2, y2, colour=INK):
        d.line(x1, y1, x2, y2, colour, 1.6, arrow=True)

    middle = 171
    step(20, middle, "read", "file to triangles", PALE_GREY, INK)
    step(168, middle, "repair", "closed surface", PALE_GREY, INK)
    join(138, middle + 29, 168, middle + 29)
    # By depth ratio, above.
    d.text(330, 48, "by depth ratio: --depth", 15, BLUE, weight="bold")
    for k, (name, words) in enumerate((("remesh", "even triangles"), ("fit", "one per triangle"), ("refit", "edges, thin walls"))):
        step(330 + 142 * k, 62, name, words, PALE_BLUE, BLUE)
        if k:
            join(306 + 142 * k, 91, 330 + 142 * k, 91, BLUE)
    # By tolerance, below.
    d.text(330, 340, "by tolerance: --tolerance, --max-spheres, --lod", 15, ORANGE, weight="bold")
    for k, (name, words) in enumerate((("candidates", "medial balls"), ("set cover", "fewest balls"), ("certify", "prove, refine"))):
        step(330 + 142 * k, 264, name, words, PALE_ORANGE, ORANGE)
        if k:
            join(306 + 142 * k, 293, 330 + 142 * k, 293, ORANGE)
    join(286, middle + 20, 326, 95, BLUE)
    join(286, middle + 38, 326, 289, ORANGE)
    # From refit to set cover: both options together.
    d.line(673, 120, 673, 192, QUIET, 1.5, "5 4")
    d.line(673, 192, 531, 192, QUIET, 1.5, "5 4")
    d.line(531, 192, 531, 261, QUIET, 1.5, "5 4", arrow=True)
    d.text(541, 216, "both options: thin the spheres", 13, QUIET)
    step(768, middle, "measure", "errors, volume", PALE_GREEN, GREEN, 112)
    join(732, 91, 800, middle - 3, BLUE)
    join(732, 293, 800, middle + 61, ORANGE)
    d.line(824, middle + 58, 824, 306, GREEN, 1.6, arrow=True)
    d.text(824, 326, "cluster", 16, GREEN, "middle", "bold")
    d.text(824, 345, ".spheres.json", 13, GREEN, "middle")
    return d


def coarse_to_fine():
    d = Drawing(860, 440, "A large sphere searches the rows of finer bins that its reach covers")
    x, y, edge = 30, 50, 30
    cx, cy, radius, fine = 6.3, 5.6, 3.6, 0.45
    reach = radius + fine
    d.text(30, 30, "Rows of finer bins within reach", 17, weight="bold")
    rows = []
    for row in range(11):
        near = max(row - cy, cy - row - 1, 0)
        if near < reach:
            half = math.sqrt(reach * reach - near * near)
            first, last = max(0, math.floor(cx - half)), min(12, math.floor(cx + half))
            rows.append((row, first, last))
            d.box(x + first * edge, y + row * edge, (last - first + 1) * edge, edge, PALE_ORANGE, "none")
    lattice(d, x, y, 13, 11, edge, "#cfcfcf")
    for row, first, last in rows:
        d.box(x + first * edge + 1.5, y + row * edge + 1.5, (last - first + 1) * edge - 3, edge - 3, "none", ORANGE, 1.2, 5)
    d.circle(x + cx * edge, y + cy * edge, radius * edge, BLUE, BLUE, 2, opacity=0.15)
    d.circle(x + cx * edge, y + cy * edge, reach * edge, "none", BLUE, 1.5, "6 4")
    for sx, sy in ((2.5, 1.4), (3.4, 2.6), (5.6, 1.5), (9.4, 2.5), (10.6, 5.4), (9.5, 8.4), (7.4, 9.6), (3.5, 8.5), (2.4, 6.3), (1.4, 4.5), (11.6, 9.5), (0.6, 9.4), (11.5, 0.6), (5.3, 4.4), (7.7, 6.6)):
        inside = (sx - cx) ** 2 + (sy - cy) ** 2 <= (radius + 0.4) ** 2
        d.circle(x + sx * edge, y + sy * edge, 0.4 * edge, GREEN if inside else QUIET, GREEN if inside else QUIET, 1.2, opacity=0.45)
    d.dot(x + cx * edge, y + cy * edge, BLUE)
    d.text(30, 402, "dashed: the sphere's radius + the largest radius of the finer level", 14, BLUE)
    d.text(30, 424, "green: contacts", 14, GREEN)
    d.text(150, 424, "grey within the rows: candidates that do not touch", 14, QUIET)
    # How a warp shares the work.
    left = 470
    d.text(left, 30, "How the 32 lanes of a warp share it", 17, weight="bold")
    for k in range(6):
        colour = ORANGE
        d.box(left + 58 * k, 70, 48, 26, PALE_ORANGE, colour, 1.3, 5)
        d.text(left + 58 * k + 24, 88, f"row {k + 1}", 13, INK, "middle")
        d.line(left + 58 * k + 24, 98, left + 58 * k + 24, 126, QUIET, 1.3, arrow=True)
        d.text(left + 58 * k + 24, 143, f"lane {k + 1}", 13, QUIET, "middle")
    d.text(left, 60, "1. each lane takes a row and finds its candidates", 14)
    counts = (3, 1, 5, 2, 4, 1)
    d.text(left, 190, "2. the candidates of all rows are laid end to end", 14)
    position = 0
    for k, count in enumerate(counts):
        for _ in range(count):
            d.box(left + 21 * position, 202, 19, 19, (PALE_ORANGE, PALE_GREEN)[k % 2], (ORANGE, GREEN)[k % 2], 1.2, 3)
            position += 1
    d.text(left, 262, "3. each lane tests one candidate: rows may be short,", 14)
    d.text(left + 17, 281, "and still all lanes are busy", 14)
    for k in range(16):
        d.line(left + 21 * k + 9.5, 292, left + 21 * k + 9.5, 310, QUIET, 1.2, arrow=True)
        d.text(left + 21 * k + 9.5, 325, str(k + 1), 11, QUIET, "middle")
    d.text(left, 348, "lanes", 13, QUIET)
    return d


def rooms():
    """The folders of padding/ and detect/ as the house test sees them: an arrow says that headers there include headers here."""
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(ROOT / "tests" / "house"))
    import house_test
    tree = house_test.Tree(str(ROOT))
    graph = {a: {b for b in others if b.startswith(("padding", "detect"))} for a, others in house_test.folder_graph(tree).items()
             if a.startswith(("padding", "detect"))}
    names = sorted(set(graph) | {b for others in graph.values() for b in others})
    below = {}

    def reached(a):
        if a not in below:
            below[a] = set().union(*({b} | reached(b) for b in graph.get(a, ())))
        return below[a]

    height = {}
    for a in sorted(names, key=lambda a: len(reached(a))):  # what a room includes comes before it
        height[a] = 1 + max((height[b] for b in graph.get(a, ())), default=-1)
    gpl = {pathlib.PurePosixPath(f).parent.as_posix() for f in tree.text if tree.licence(f).startswith("GPL")}
    width, step = 150, 74
    top = max(height.values())
    d = Drawing(1300, 60 + (top + 1) * step, "The folders of padding and detect, and which includes which")
    d.text(30, 30, "A folder includes only folders below it", 17, weight="bold")
    d.box(760, 17, 14, 14, PALE_BLUE, BLUE)
    d.text(782, 29, "MIT", 14)
    d.box(830, 17, 14, 14, PALE_ORANGE, ORANGE)
    d.text(852, 29, "GPL: includes CGAL, or what does", 14)
    place = {}
    for level in range(top + 1):
        for half, left, room in (("detect", 20, 560), ("padding", 600, 680)):
            row = [a for a in names if height[a] == level and a.startswith(half)]
            for k, a in enumerate(row):
                place[a] = (left + (k + 0.5) * (room / len(row)), 50 + (top - level) * step + 20)
    for a in names:  # without those arrows that follow from others
        for b in sorted(graph.get(a, ())):
            if not any(b in reached(c) for c in graph[a] if c != b):
                d.line(place[a][0], place[a][1] + 16, place[b][0], place[b][1] - 16, QUIET, 1.2, arrow=True)
    for a in names:
        x, y = place[a]
        d.box(x - width / 2, y - 15, width, 30, *((PALE_ORANGE, ORANGE) if a in gpl else (PALE_BLUE, BLUE)), 1.5, 5)
        d.text(x, y + 5, a, 13, anchor="middle")
    return d


DRAWINGS = {"rooms": rooms, "grid": grid, "midpoint": midpoint, "medial_ball": medial_ball, "pipeline": pipeline, "coarse_to_fine": coarse_to_fine}


def main():
    folder, stale = pathlib.Path(__file__).resolve().parent, []
    for name, draw in DRAWINGS.items():
        path, fresh = folder / f"{name}.svg", draw().svg()
        if "--check" not in sys.argv:
            path.write_text(fresh, encoding="utf-8", newline="\n")
        elif not path.exists() or path.read_text(encoding="utf-8") != fresh:
            stale.append(path.name)
    if stale:
        sys.exit(f"docs/drawings: {', '.join(stale)} out of date: run docs/drawings/make_drawings.py")


if __name__ == "__main__":
    main()
