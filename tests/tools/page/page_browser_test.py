#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens pages that pad, detect and preview made in a headless browser and does with them what a person would.

What must be on the screen is worked out here, by rays through the camera that the page says it has. Takes the folder of
the programs. Leaves with 77, and a sentence, where there is no browser or no page script.
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import browser
from browser import Browser

BIN = os.path.abspath(sys.argv.pop(1))
WIDTH, HEIGHT = 720, 480
ORANGE, BACKGROUND = (232, 128, 58), (244, 246, 248)  # padding/view/view.cpp
RED, BLUE = (208, 64, 56), (48, 112, 192)              # families 1 and 2
ARROWS = {"left": "\ue012", "up": "\ue013", "right": "\ue014", "down": "\ue015"}
ESCAPE = "\ue00c"


def tool(name, *args):
    return subprocess.run([os.path.join(BIN, name), *map(str, args)], check=True, capture_output=True, text=True).stdout


def is_orange(c):
    return c[0] > c[1] > c[2] and c[0] > 1.6 * c[2]


def is_near(c, d, by=3):
    return all(abs(a - b) <= by for a, b in zip(c, d))


def hue(c):
    """Which family's colour this is a shade of."""
    return "red" if c[0] > 1.5 * c[2] else "blue" if c[2] > 1.5 * c[0] else "other"


class Camera:
    """The page's camera, in the user's frame: spheres and meshes are given as in their files."""

    def __init__(self, state, low, high):
        self.view, self.projection = state["view"], state["projection"]
        self.center = [(a + b) / 2 for a, b in zip(low, high)]
        self.scale = math.dist(low, high)
        v = self.view
        rows = [[v[0], v[4], v[8]], [v[1], v[5], v[9]], [v[2], v[6], v[10]]]
        self.rows = rows
        self.eye = [-sum(rows[i][k] * v[12 + i] for i in range(3)) for k in range(3)]

    def ray(self, x, y):  # in the page's frame
        d = [(2 * (x + 0.5) / WIDTH - 1) / self.projection[0], (1 - 2 * (y + 0.5) / HEIGHT) / self.projection[5], -1]
        w = [sum(self.rows[i][k] * d[i] for i in range(3)) for k in range(3)]
        n = math.hypot(*w)
        return [a / n for a in w]

    def into(self, p):
        return [(a - c) / self.scale for a, c in zip(p, self.center)]

    def pixel(self, p):
        q = [a - e for a, e in zip(self.into(p), self.eye)]
        x, y, z = (sum(r[k] * q[k] for k in range(3)) for r in self.rows)
        return (1 + x / -z * self.projection[0]) * WIDTH / 2, (1 - y / -z * self.projection[5]) * HEIGHT / 2

    def azimuth(self):
        return math.degrees(math.atan2(self.rows[2][1], self.rows[2][0]))

    def elevation(self):
        return math.degrees(math.asin(self.rows[2][2]))

    def first(self, spheres, x, y):
        """The sphere that the ray through a pixel meets first, and by how much of the ray's reach, or (-1, …)."""
        d, best, nearest, edge = self.ray(x, y), -1, math.inf, math.inf
        for k, (c, r) in enumerate(spheres):
            q = [a - e for a, e in zip(self.into(c), self.eye)]
            r /= self.scale
            t = sum(a * b for a, b in zip(q, d))
            beside = sum(a * a for a in q) - t * t
            edge = min(edge, abs(math.sqrt(max(0, beside)) - r))
            if beside < r * r and t - math.sqrt(r * r - beside) < nearest:
                best, nearest = k, t - math.sqrt(r * r - beside)
        return best, edge

    def meets_box(self, low, high, x, y):
        d, low, high = self.ray(x, y), self.into(low), self.into(high)
        enter, leave = -math.inf, math.inf
        for k in range(3):
            a, b = (low[k] - self.eye[k]) / d[k], (high[k] - self.eye[k]) / d[k]
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        return enter < leave


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.browser = Browser(WIDTH, HEIGHT)
        corners = [(x, y, z) for x in (0, 2) for y in (0, 1) for z in (0, 1)]
        quads = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
        cls.path("brick.obj").write_text("".join("v {} {} {}\n".format(*c) for c in corners) + "".join("f {} {} {} {}\n".format(*q) for q in quads))
        tool("pad", cls.path("brick.obj"), "-o", cls.path("brick.spheres.json"), "--edge-length", "20%", "--unit", "m", "-q",
             "--preview", cls.path("brick.html"))
        cls.cluster = json.loads(cls.path("brick.spheres.json").read_text())
        s = cls.cluster["spheres"]
        cls.spheres = list(zip(s["centers"], s["radii"]))

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.folder.cleanup()

    @classmethod
    def path(cls, name):
        return pathlib.Path(cls.folder.name, name)

    def setUp(self):
        self.b = self.browser
        self.load("brick.html")

    def tearDown(self):
        self.assertEqual(self.b.log(), [], "the console must stay silent")

    def load(self, name):
        """Opens a page in a window that is as much larger as its panels take, so that the picture has the size known here."""
        self.b.resize(WIDTH + 310, HEIGHT + 60)
        self.b.open(self.path(name))
        self.b.wait("window.padder && padder.state().frames > 0")
        box = self.box("canvas")
        self.b.resize(WIDTH + 310 + WIDTH - round(box["width"]), HEIGHT + 60 + HEIGHT - round(box["height"]))
        self.b.wait(f"(() => {{ const b = document.querySelector('canvas').getBoundingClientRect(); return b.width === {WIDTH} && b.height === {HEIGHT}; }})()", 10)
        self.next_frames()
        self.b.wait("!padder.state().busy")

    def next_frames(self):
        self.b.send("execute/async", {"script": "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))", "args": []})

    def box(self, selector):
        return self.b.run("return document.querySelector(arguments[0]).getBoundingClientRect().toJSON()", selector)

    def state(self):
        return self.b.run("return padder.state()")

    def camera(self, spheres=None, boxes=()):
        spheres = self.spheres if spheres is None else spheres
        low = [min([c[k] - r for c, r in spheres] + [b[0][k] for b in boxes]) for k in range(3)]
        high = [max([c[k] + r for c, r in spheres] + [b[1][k] for b in boxes]) for k in range(3)]
        return Camera(self.state(), low, high)

    def brick(self):
        return self.camera(boxes=[((0, 0, 0), (2, 1, 1))])

    def picture(self):
        """The screen without what is drawn over the picture, which is its upper left part."""
        self.b.run("document.querySelectorAll('#rulers, #divider').forEach((e) => e.style.visibility = 'hidden');"
                   "document.activeElement.blur()")
        self.next_frames()
        image = self.b.screenshot()
        self.b.run("document.querySelectorAll('#rulers, #divider').forEach((e) => e.style.visibility = '')")
        self.assertGreater(image.width, WIDTH)
        return image

    def spots(self, camera, xs, ys):
        """Pixels that lie well inside what is seen of one sphere, with the sphere's number."""
        for y in ys:
            for x in xs:
                found = {camera.first(self.spheres, x + i, y + j)[0] for i in (-2, 0, 2) for j in (-2, 0, 2)}
                if len(found) == 1 and -1 not in found and camera.first(self.spheres, x, y)[1] > 0.0005:
                    yield x, y, found.pop()

    def do(self, action):
        before = self.state()["frames"]
        action()
        self.b.wait(f"padder.state().frames > {before}")

    def test_both_halves_show_what_rays_meet(self):
        image, camera = self.picture(), self.brick()
        wrong, seen = [], {"mesh": 0, "spheres": 0}
        for y in range(4, HEIGHT, 9):
            for x in range(4, WIDTH, 9):
                got = image.at(x, y)
                if x < WIDTH // 2 - 1:
                    hits = camera.meets_box((0, 0, 0), (2, 1, 1), x, y)
                    kind, ok = "mesh", is_near(got, BACKGROUND) if not hits else not is_orange(got) and not is_near(got, BACKGROUND)
                elif x > WIDTH // 2:
                    k, edge = camera.first(self.spheres, x, y)
                    if edge < 0.002:
                        continue  # a pixel on an outline may fall to either side
                    hits = k >= 0
                    kind, ok = "spheres", is_orange(got) if hits else is_near(got, BACKGROUND)
                seen[kind] += hits
                if not ok:
                    wrong.append((x, y, got, hits))
        self.assertGreater(min(seen.values()), 200)
        # Pixels on the outline of the brick are the only ones in doubt.
        self.assertLessEqual(len(wrong), 8, wrong)

    def test_everything_fits_and_nothing_is_fetched(self):
        camera = self.brick()
        for c, _ in self.spheres:
            x, y = camera.pixel(c)
            self.assertTrue(0 < x < WIDTH and 0 < y < HEIGHT)
        self.assertEqual(self.b.run("return performance.getEntriesByType('resource').length"), 0)
        self.assertEqual(self.b.text("#title"), "brick")
        self.assertIn("brick.obj", self.b.text("#note"))
        self.assertEqual(self.state()["drawn"], len(self.spheres))

    def test_a_click_picks_the_sphere_under_it(self):
        self.b.keys("3")
        camera, picked = self.brick(), set()
        spots = list(self.spots(camera, range(200, 390, 23), range(180, 330, 31)))[::4]
        self.assertGreater(len(spots), 3)
        for x, y, k in spots:
            self.b.click(x, y)
            self.assertEqual(self.state()["picked"], k)
            self.assertEqual(self.b.text("#picked-index"), str(k))
            rows = self.b.run("return Object.fromEntries([...document.querySelectorAll('#picked tr')].map((r) => [...r.children].map((c) => c.textContent)))")
            for name, want in zip("xyz", self.spheres[k][0]):
                self.assertAlmostEqual(float(rows[name].split()[0]), want, delta=2e-6)
            self.assertTrue(rows["x"].endswith(" m"))
            self.assertAlmostEqual(float(rows["radius"].split()[0]), self.spheres[k][1], delta=1e-6)
            self.assertEqual(rows["source triangle"], str(self.cluster["spheres"]["triangle"][k]))
            self.assertEqual(rows["family"], "none")
            picked.add(k)
        self.assertGreater(len(picked), 2)
        self.b.click(10, 300)  # beside everything
        self.assertEqual(self.state()["picked"], -1)
        self.assertIsNone(self.b.text("#picked-index"))
        self.b.keys("2")
        self.b.click(300, 240)  # on the mesh: there is no sphere to be seen
        self.assertEqual(self.state()["picked"], -1)

    def test_the_picked_sphere_stands_out(self):
        self.b.keys("3")
        x, y, k = next(self.spots(self.brick(), range(250, 390, 7), range(200, 300, 7)))
        self.b.click(x, y)
        self.assertEqual(self.state()["picked"], k)
        c = self.picture().at(x, y)
        self.assertTrue(c[0] > 1.5 * c[1] and c[2] > 1.5 * c[1], c)

    def test_slider_and_its_keys(self):
        count = lambda image: sum(is_orange(image.at(x, y)) for y in range(0, HEIGHT, 5) for x in range(0, WIDTH, 5))
        self.do(lambda: self.b.keys("1"))
        self.assertEqual(self.state()["split"], 1)
        self.assertEqual(count(self.picture()), 0)
        self.do(lambda: self.b.keys("3"))
        self.assertEqual(self.state()["split"], 0)
        full = count(self.picture())
        self.assertGreater(full, 1000)
        box = self.b.run("const r = document.querySelector('#split').getBoundingClientRect(); return [r.left, r.top, r.width, r.height]")
        middle = box[1] + box[3] / 2
        self.b.drag([(box[0] + 8, middle), (box[0] + box[2] * 0.3, middle), (box[0] + box[2] * 0.6, middle)])
        split = self.state()["split"]
        self.assertAlmostEqual(split, 0.6, delta=0.04)
        image = self.picture()
        columns = [x for x in range(0, WIDTH, 5) if any(is_orange(image.at(x, y)) for y in range(0, HEIGHT, 5))]
        self.assertAlmostEqual(min(columns), split * WIDTH, delta=6)
        self.b.run("document.querySelector('#canvas').focus()")
        self.b.keys("[[")
        self.assertAlmostEqual(self.state()["split"], split - 0.1, places=6)

    def test_keys_turn_move_and_zoom(self):
        before = self.brick()
        self.b.keys(ARROWS["right"])
        turned = self.brick()
        self.assertAlmostEqual((before.azimuth() - turned.azimuth() + 180) % 360 - 180, 5, places=3)
        self.b.keys(ARROWS["up"])
        self.assertAlmostEqual(self.brick().elevation() - turned.elevation(), 5, places=3)
        self.b.keys("f")
        self.assertAlmostEqual(self.brick().azimuth(), before.azimuth(), places=3)
        span = lambda c: math.dist(c.pixel((0, 0, 0)), c.pixel((2, 1, 1)))
        self.b.keys("+")
        self.assertGreater(span(self.brick()), 1.15 * span(before))
        self.b.keys("--")
        self.assertLess(span(self.brick()), 0.9 * span(before))

    def test_mouse_and_touch_turn_and_a_tap_picks(self):
        for kind in ("mouse", "touch"):
            with self.subTest(kind):
                self.load("brick.html")
                before = self.brick()
                self.b.drag([(200, 240), (260, 240), (320, 240)], kind=kind)
                after = self.brick()
                self.assertGreater(abs(after.azimuth() - before.azimuth()), 10)
                self.assertEqual(self.state()["picked"], -1)  # a drag is no click
                x, y, k = next(self.spots(after, range(365, 400, 3), range(200, 300, 7)))
                self.b.click(x, y, kind)
                self.assertEqual(self.state()["picked"], k)

    def test_colours_and_their_legend(self):
        radii = [r for _, r in self.spheres]
        largest = radii.index(max(radii))
        colour = lambda k: tuple(self.b.run("return padder.colour(arguments[0])", k))
        self.assertEqual(colour(largest), ORANGE)
        names = self.b.run("return [...document.querySelector('#colour').options].map((o) => o.value)")
        self.assertEqual(names, ["family", "radius", "protrusion", "gap", "triangle"])
        self.b.keys("c")
        self.assertEqual(self.state()["colour"], "radius")
        self.assertEqual(colour(largest), (250, 220, 70))
        self.assertAlmostEqual(float(self.b.run("return document.querySelectorAll('.ends span')[1].textContent").split()[0]),
                               max(radii), delta=1e-3)
        self.b.keys("ccc")
        self.assertEqual(self.state()["colour"], "triangle")
        self.assertGreater(len({colour(k) for k in range(20)}), 10)

    def test_errors_are_drawn_on_the_mesh(self):
        tool("pad", self.path("brick.obj"), "-o", self.path("bare.spheres.json"), "--tolerance", "4%", "-q", "--preview", self.path("gap.html"), "--colour", "gap")
        cluster = json.loads(self.path("bare.spheres.json").read_text())
        spheres = list(zip(cluster["spheres"]["centers"], cluster["spheres"]["radii"]))
        self.load("gap.html")
        self.assertEqual(self.state()["colour"], "gap")
        gap = lambda p: max(0, min(math.dist(p, c) - r for c, r in spheres))
        largest = max(gap((x, y, z)) for x in (0, 2) for y in (0, 1) for z in (0, 1))
        self.assertGreater(largest, 0)
        high = float(self.b.run("return document.querySelectorAll('.ends span')[1].textContent").split()[0])
        self.assertTrue(0.99 * largest < high < 1.01 * cluster["accuracy"]["gap_max"], (largest, high))
        self.do(lambda: self.b.keys("1"))
        image, seen = self.picture(), []
        camera = self.camera(spheres, [((0, 0, 0), (2, 1, 1))])
        for k in range(40):  # along a line on the upper face: brighter and greener where the gap is larger
            p = (0.05 * k + 0.02, 0.3, 1)
            x, y = camera.pixel(p)
            seen.append((gap(p) / high, image.at(round(x), round(y))))
        green = lambda c: c[1] / c[2]
        least, most = min(seen), max(seen)
        self.assertGreater(most[0], least[0] + 0.1, seen)
        self.assertLess(green(least[1]), 0.6, seen)
        self.assertGreater(green(most[1]), 1.2 * green(least[1]), seen)
        self.do(lambda: self.b.run("const e = document.querySelector('#colour'); e.value = 'family'; e.dispatchEvent(new Event('change'))"))
        self.assertNotEqual(self.picture().rows, image.rows)

    def test_the_scale_bar_and_the_axes(self):
        label, path = self.b.run("const s = document.querySelector('#rulers'); return [s.lastElementChild.textContent, s.lastElementChild.previousElementSibling.getAttribute('d')]")
        length, unit = label.split()
        self.assertEqual(unit, "m")
        state, camera = self.state(), self.brick()
        far = abs(state["view"][14])
        pixels = HEIGHT / 2 * state["projection"][5] / far / camera.scale * float(length)
        self.assertAlmostEqual(float(path.split("h")[1].split("m")[0]), pixels, delta=0.01 * pixels)
        self.assertEqual(self.b.run("return [...document.querySelectorAll('#rulers text')].map((e) => e.textContent).slice(0, 3).sort().join('')"), "xyz")

    def test_no_panel_lies_on_the_picture(self):
        for width, height in ((1280, 800), (390, 844), (700, 500)):
            with self.subTest((width, height)):
                self.b.resize(width, height)
                self.b.open(self.path("brick.html"))
                self.b.wait("window.padder && padder.state().frames > 0")
                picture = self.box("canvas")
                self.assertGreater(picture["width"] * picture["height"], 0.4 * width * height)
                for panel in ("aside", "footer"):
                    box = self.box(panel)
                    self.assertTrue(box["left"] >= picture["right"] or box["top"] >= picture["bottom"], (panel, box, picture))
                    self.assertTrue(box["right"] <= width and box["bottom"] <= height, (panel, box))

    def test_dark_as_the_system_is_and_by_key(self):
        self.addCleanup(self.b.prefer, "light")
        for scheme, colour in (("dark", (22, 26, 31)), ("light", BACKGROUND)):
            self.b.prefer(scheme)
            self.load("brick.html")
            self.assertTrue(is_near(self.picture().at(4, 4), colour))
        self.do(lambda: self.b.keys("b"))
        self.assertTrue(is_near(self.picture().at(4, 4), (22, 26, 31)))

    def test_overlay_detail_and_panels(self):
        self.b.keys("3")
        plain = self.picture()
        for overlay in ("wire", "glass"):
            self.do(lambda: self.b.keys("o"))
            self.assertEqual(self.state()["overlay"], overlay)
            image = self.picture()
            changed = sum(image.at(x, y) != plain.at(x, y) for y in range(0, HEIGHT, 3) for x in range(0, WIDTH, 3))
            self.assertGreater(changed, {"wire": 30, "glass": 500}[overlay])
        self.b.keys("dd")
        self.assertEqual(self.b.run("return document.querySelector('#detail').value"), "0.25")
        self.b.wait("padder.state().drawn === Math.round(padder.state().spheres / 4)")
        self.assertIs(self.b.run("return document.querySelector('#accuracy-panel').open"), False)
        self.b.keys("a")
        self.assertIs(self.b.run("return document.querySelector('#accuracy-panel').open"), True)
        table = self.b.text("#accuracy")
        self.assertIn(f"{100 * self.cluster['accuracy']['coverage']:.4g} %", table)

    def test_next_and_previous_sphere(self):
        self.b.keys("nnp")
        self.assertEqual(self.state()["picked"], 0)
        self.b.keys("p")
        self.assertEqual(self.state()["picked"], len(self.spheres) - 1)
        self.b.keys(ESCAPE)
        self.assertEqual(self.state()["picked"], -1)

    def test_scene_with_families_and_contacts(self):
        ball = {"format": "padder.cluster", "version": 1, "name": "ball", "spheres": {"centers": [[0, 0, 0]], "radii": [1]}}
        scene = {"format": "padder.scene", "version": 1, "clusters": {"ball": "ball.spheres.json"}, "bodies": [
            {"cluster": "ball", "position": [0, 0, 0], "family": 1}, {"cluster": "ball", "position": [1.8, 0, 0], "family": 2},
            {"cluster": "ball", "position": [0, 6, 0], "family": 1}]}
        for name, document in ("ball.spheres.json", ball), ("scene.json", scene):
            self.path(name).write_text(json.dumps(document))
        tool("detect", self.path("scene.json"), "-o", self.path("contacts.csv"), "-q")
        tool("preview", self.path("scene.json"), "--contacts", self.path("contacts.csv"), "-o", self.path("scene.html"), "-q")
        self.load("scene.html")
        balls = [([0, 0, 0], 1), ([1.8, 0, 0], 1), ([0, 6, 0], 1)]
        camera = self.camera(balls)
        self.assertEqual(self.state()["contacts"], 1)
        self.assertIn("contacts1", self.b.text("#scene"))
        self.assertIn("from i to j", self.b.text("#contacts-legend"))
        self.assertTrue(self.b.text("#contacts-ramp").startswith("00.2"), self.b.text("#contacts-ramp"))
        image = self.picture()
        spots = [[round(v) for v in camera.pixel(c)] for c, _ in balls]
        self.assertEqual([hue(image.at(*p)) for p in spots], ["red", "blue", "red"])
        # The arrow runs along x through the contact, over both spheres.
        self.b.run("document.querySelector('#show-contacts').click()")
        self.b.wait("!document.querySelector('#show-contacts').checked")
        without = self.picture()
        arrow = [round(v) for v in camera.pixel([0.9, 0, 0])]
        self.assertNotEqual(image.at(*arrow), without.at(*arrow))
        self.assertEqual(image.at(*spots[2]), without.at(*spots[2]))
        # One body alone.
        self.b.run("const e = document.querySelector('#only-body'); e.value = '1'; e.dispatchEvent(new Event('input'))")
        alone = self.picture()
        self.assertEqual(hue(alone.at(*spots[1])), "blue")
        self.assertTrue(is_near(alone.at(*spots[2]), BACKGROUND))
        self.b.click(*spots[2])
        self.assertEqual(self.state()["picked"], -1)  # what is hidden is not picked
        self.b.click(*spots[1])
        rows = self.b.text("#picked")
        for part in ("body1 (ball)", "family2", "contacts1", "with 0"):
            self.assertIn(part, rows)

    def test_a_level_of_detail_is_chosen_from_a_list(self):
        tool("pad", self.path("brick.obj"), "--lod", "8%,4%,2%", "-o", self.path("ladder.spheres.json"), "-q")
        ladder = json.loads(self.path("ladder.spheres.json").read_text())
        levels = [ladder["spheres"]["count"]] + [lod["spheres"]["count"] for lod in reversed(ladder["lods"])]
        self.assertGreater(levels[0], levels[1])
        self.assertGreater(levels[1], levels[2])
        tool("preview", self.path("ladder.spheres.json"), "-o", self.path("ladder.html"), "-q")
        self.load("ladder.html")
        self.assertEqual(self.b.run("return [...document.querySelector('#rung').options].map((o) => o.text)"),
                         [f"within {t} % ({n:,})" for t, n in zip((2, 4, 8), levels)])
        self.assertEqual((self.state()["rung"], self.state()["drawn"]), (0, levels[0]))
        finest = self.b.text("#accuracy")
        self.b.keys("3")  # spheres alone
        fine = self.picture()
        self.b.run("const e = document.querySelector('#rung'); e.value = '2'; e.dispatchEvent(new Event('change'))")
        self.b.wait(f"padder.state().drawn === {levels[2]}")
        self.assertIn(f": {levels[2]}", self.b.text("#legend"))
        self.assertNotEqual(self.b.text("#accuracy"), finest)
        self.assertNotEqual(self.picture().rows, fine.rows)
        self.b.keys("n")
        self.assertEqual(self.state()["picked"], levels[0] + levels[1])  # the first of the coarsest
        self.assertEqual(self.b.text("#picked-index"), "0")
        self.b.keys("l")  # round to the finest
        self.assertEqual((self.state()["rung"], self.state()["drawn"], self.state()["picked"]), (0, levels[0], -1))
        # The page opens with the level asked for.
        tool("preview", self.path("ladder.spheres.json"), "--lod", "1", "-o", self.path("ladder.html"), "-q")
        self.load("ladder.html")
        self.assertEqual((self.state()["rung"], self.state()["drawn"]), (1, levels[1]))

    def test_a_page_without_data_says_so(self):
        self.b.open(os.path.join(BIN, "..", "page", "page.html"))
        self.assertIn("holds no data", self.b.text("#message"))
        self.assertEqual(len(self.b.log()), 1)  # the same sentence


if __name__ == "__main__":
    why = browser.absent()
    if not os.path.exists(os.path.join(BIN, "..", "page", "page.html")):
        why = "the page is not built (cmake --build BUILD --target page)"
    if why:
        print("skipped:", why)
        sys.exit(77)
    unittest.main()
