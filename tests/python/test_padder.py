# SPDX-License-Identifier: GPL-3.0-or-later
import ast
import os
import pathlib
import pickle
import re
import subprocess
import sys
import threading
import time
import numpy as np
import padder
import pytest

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                  [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])


@pytest.fixture(scope="module")
def cube():
    return padder.pad(CUBE, FACES, edge_length="10%", unit="m", name="cube.obj", family=3, mask=5)


def brute(centers, radii, family=None, mask=None):
    n = len(centers)
    family = np.zeros(n, np.uint32) if family is None else family
    mask = np.zeros(n, np.uint32) if mask is None else mask
    out = []
    for i in range(n):
        for j in range(i + 1, n):
            hidden = family[i] == family[j] != 0
            for a, b in ((i, j), (j, i)):
                hidden |= 1 <= family[b] <= 32 and bool(int(mask[a]) >> (int(family[b]) - 1) & 1)
            if not hidden and np.linalg.norm(centers[i] - centers[j]) < radii[i] + radii[j]:
                out.append((i, j))
    return out


def scene(n=300, seed=1):
    g = np.random.default_rng(seed)
    return g.uniform(0, 10, (n, 3)), g.uniform(0.3, 1, n), g.integers(0, 5, n).astype(np.uint32), g.integers(0, 8, n).astype(np.uint32)


def pairs(contacts):
    return sorted(map(tuple, np.asarray(contacts.pairs).tolist()))


def ran(script):
    """What a process of its own prints, and how it ends."""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    return done.stdout, done.stderr, done.returncode


def test_cluster(cube):
    assert len(cube) == len(cube.radii) == len(cube.triangle) > 12
    assert cube.centers.shape == (len(cube), 3) and cube.centers.dtype == np.float64
    assert (cube.radii > 0).all()
    assert cube.volume == pytest.approx(1) and cube.center_of_mass == pytest.approx([0.5] * 3)
    assert cube.inertia == pytest.approx(np.eye(3) / 6)
    assert cube.accuracy["gap_max"] < 0.05
    assert (cube.family, cube.mask, cube.unit, cube.name) == (3, 5, "m", "cube")


def test_arrays_are_views_that_keep_the_cluster():
    cluster = padder.pad(CUBE, FACES, edge_length="20%")
    a, b = cluster.centers, cluster.centers
    assert np.shares_memory(a, b) and not a.flags.writeable
    before = a.copy()
    del cluster, b
    assert (a == before).all()


def test_tolerance_is_kept_and_takes_fewer():
    share, length = padder.pad(CUBE, FACES, tolerance="3%"), padder.pad(CUBE, FACES, tolerance=0.03 * 3**0.5)
    assert share.accuracy["certified"] and share.accuracy["protrusion_max"] <= 0.0301 * 3**0.5
    assert (share.radii == length.radii).all()


def test_a_path_in_place_of_a_mesh_names_pad_file():
    with pytest.raises(TypeError, match="pad_file"):
        padder.pad("part.stl", tolerance="1%")


# Arrays of wrong types and shapes, and numbers that are not finite, are those of test_arrays.py.
@pytest.mark.parametrize("arguments, error", [((CUBE, FACES + 1), IndexError), ((CUBE, FACES - 1), IndexError),
                                              ((CUBE, FACES[:0]), ValueError), ((CUBE * 0, FACES), padder.Error)])
def test_bad_meshes(arguments, error):
    with pytest.raises(error):
        padder.pad(*arguments)


@pytest.mark.parametrize("options, error", [
    ({"tolerance": "1"}, ValueError), ({"tolerance": "x%"}, ValueError), ({"tolerance": -1}, ValueError), ({"repair": "no"}, ValueError),
    ({"edge_length": 0}, ValueError), ({"depth": 2}, ValueError), ({"balance": "much"}, ValueError), ({"effort": 7}, ValueError),
    ({"effort": -1, "tolerance": "5%"}, ValueError), ({"max_radius": 0}, ValueError), ({"max_spheres": -1}, ValueError),
    ({"family": 2**32}, ValueError), ({"family": 1.5}, TypeError), ({"mask": -1}, ValueError), ({"tolerance": "5%", "force": "yes"}, TypeError),
    ({"lod": "10%"}, TypeError), ({"lod": 0.1}, TypeError),
    ({"balence": "mean"}, TypeError), ({"balance": "mean"}, ValueError), ({"smooth": float("nan")}, ValueError)])
def test_bad_options_are_errors_of_the_argument(options, error):
    with pytest.raises(error, match="lod must be a list" if "lod" in options else None):
        padder.pad(CUBE, FACES, **options)


def test_every_option_of_the_command_line():
    plain = padder.pad(CUBE, FACES, tolerance="3%")
    balanced = padder.pad(CUBE, FACES, tolerance="3%", balance="volume", effort=0)
    assert abs(balanced.accuracy["volume_ratio"] - 1) < abs(plain.accuracy["volume_ratio"] - 1)
    assert padder.pad(CUBE, FACES, tolerance="3%", max_radius=0.3).radii.max() <= 0.3 < plain.radii.max()
    assert padder.pad(CUBE, FACES, lod=["6%", "3%"]).settings["lod"] == pytest.approx([0.06 * 3**0.5, 0.03 * 3**0.5])


def test_warnings_of_padding_are_warnings():
    with pytest.warns(UserWarning, match="a thickness has no effect"):
        padder.pad(CUBE, FACES, tolerance="10%", thickness="1%")


def test_a_mesh_object_is_taken_as_it_is(cube):
    class Trimesh:
        vertices, faces = CUBE, FACES
    mesh = padder.pad(Trimesh(), edge_length="10%")
    assert (mesh.centers == cube.centers).all()
    with pytest.raises(TypeError):
        padder.pad(CUBE)


CLASSES = [c for c in vars(padder._core).values() if isinstance(c, type) and not issubclass(c, Exception)]


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_an_object_made_without_its_constructor_is_refused(kind):
    empty = kind.__new__(kind)
    properties = [name for name in dir(kind) if isinstance(vars(kind).get(name), property)]
    assert properties or kind is padder.Detector
    for name in properties:
        with pytest.raises(TypeError, match="without its constructor"):
            getattr(empty, name)
    if kind is padder.Detector:
        with pytest.raises(TypeError, match="without its constructor"):
            empty.detect(np.zeros((1, 3)), np.ones(1))


# In a process of its own, because it once ended the interpreter.
def test_pickle_of_an_old_protocol_is_refused():
    script = f"""
import numpy as np, padder, pickle
cluster = padder.pad(np.array({CUBE.tolist()}), np.array({FACES.tolist()}), tolerance="20%")
for thing in (cluster, padder.detect(cluster.centers, cluster.radii), padder.Detector()):
    for protocol in (0, 1):
        try:
            pickle.dumps(thing, protocol)
        except TypeError as e:
            assert "protocol 2" in str(e), e
        else:
            raise SystemExit("pickled")
"""
    assert ran(script) == ("", "", 0)


def test_pickle_and_html(cube):
    back = pickle.loads(pickle.dumps(cube))
    assert back.to_json() == cube.to_json() and back.mask == 5
    assert str(len(cube)) in cube._repr_html_() and "cube" in cube._repr_html_()
    named = pickle.loads(pickle.dumps(cube))
    named.name = "<script>"
    assert "<script>" not in named._repr_html_()


def test_a_robot(tmp_path):
    box = "<collision><geometry><box size='0.2 0.2 0.4'/></geometry></collision>"
    (tmp_path / "r.urdf").write_text(
        f"<robot name='r'><link name='a'>{box}</link><link name='b'>{box}</link><joint name='j' type='continuous'><parent link='a'/>"
        "<child link='b'/><origin xyz='0 0 0.4'/><axis xyz='1 0 0'/></joint></robot>")
    robot = padder.pad_urdf(tmp_path / "r.urdf", tolerance="5%", effort=0)
    assert set(robot.links) == {"a", "b"} and robot.apart == [("a", "b", "Adjacent")]
    assert len(robot) == len(robot.links["a"]) + len(robot.links["b"])
    robot.save(tmp_path / "r.xml")
    assert (padder.load(tmp_path / "r.xml", "b").radii == robot.links["b"].radii).all()
    with pytest.raises(FileNotFoundError):
        padder.pad_urdf(tmp_path / "absent.urdf")


# Ctrl-C while the spheres are chosen, which would go on for minutes.
def test_ctrl_c_ends_padding():
    script = """
import os, signal, threading, numpy as np, padder
n = 60
u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n, endpoint=False), np.linspace(0, 2 * np.pi, n, endpoint=False), indexing="ij")
r = 1 + 0.3 * np.cos(v)
points = np.stack([r * np.cos(u), r * np.sin(u), 0.3 * np.sin(v)], -1).reshape(-1, 3)
i, j = np.meshgrid(range(n), range(n), indexing="ij")
at = lambda a, b: (a % n) * n + b % n
faces = np.concatenate([np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], -1).reshape(-1, 3),
                        np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], -1).reshape(-1, 3)])
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    padder.pad(points, faces, tolerance="0.3%", effort=3)
    print("padded to the end")
except KeyboardInterrupt:
    print("interrupted")
"""
    assert ran(script) == ("interrupted\n", "", 0)


def test_files(cube, tmp_path):
    for name in ("c.spheres.json", "c.npz", "c.vtp"):
        cube.save(tmp_path / name)
        back = padder.load(tmp_path / name)
        assert (back.centers == cube.centers).all() and (back.radii == cube.radii).all() and back.family == 3
    with pytest.raises(padder.Error):
        cube.save(tmp_path / "c.csv")
    with pytest.raises(padder.Error, match='c.npz has no part called "x": it holds one part, so leave the name out'):
        padder.load(tmp_path / "c.npz", "x")
    (tmp_path / "t.obj").write_text("".join("v %g %g %g\n" % tuple(v) for v in CUBE) + "".join("f %d %d %d\n" % tuple(f + 1) for f in FACES))
    assert (padder.pad_file(tmp_path / "t.obj", edge_length="10%").centers == cube.centers).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_detect_is_brute_force(dtype):
    c, r, family, mask = scene()
    c, r = c.astype(dtype), r.astype(dtype)
    contacts = padder.detect(c, r, family, mask, width="points", backend="omp")
    assert pairs(contacts) == brute(c.astype(float), r.astype(float), family, mask)
    assert contacts.pairs.dtype == np.uint32 and contacts.normals.dtype == dtype
    i, j = contacts.pairs.T
    d = c[j].astype(float) - c[i]
    length = np.linalg.norm(d, axis=1)
    assert contacts.normals == pytest.approx(d / length[:, None], abs=1e-5)
    assert contacts.depth == pytest.approx(r[i] + r[j] - length, abs=1e-5)
    assert contacts.points_i == pytest.approx(c[i] + r[i, None] * contacts.normals, abs=1e-5)
    assert contacts.hash == padder.detect(c, r, family, mask, backend="omp").hash


def test_rows_that_overlap_are_copied():
    line = np.arange(12.0)
    windows = np.lib.stride_tricks.sliding_window_view(line, 3)
    assert pairs(padder.detect(windows, 1.0, backend="omp")) == brute(windows.copy(), np.ones(len(windows)))


def test_contacts_outlive_what_made_them():
    c, r, _, _ = scene()
    p = padder.detect(c, r, backend="omp").pairs
    del c, r
    assert sorted(map(tuple, p.tolist())) == brute(*scene()[:2])


def test_what_detect_does_not_have():
    c, r, _, _ = scene()
    with pytest.raises(ValueError):
        padder.detect(c, r, backend="gpu")
    with pytest.raises(AttributeError):
        padder.detect(c, r, width="pairs", backend="omp").depth


def turned(angle, position):
    """A pose: turned about z, then put at the position."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c, -s, 0, s, c, 0, 0, 0, 1, *position])


def heap(count=36, seed=2):
    """Bodies of two shapes with their spheres placed by NumPy: poses, shape, is_static; centers, radii, body of each."""
    g = np.random.default_rng(seed)
    shapes = [(g.uniform(-1, 1, (9, 3)), g.uniform(0.2, 0.5, 9)), (g.uniform(-1, 1, (4, 3)), 0.4)]
    poses = np.array([turned(g.uniform(0, 6), g.uniform(0, 4.5, 3)) for _ in range(count)])
    return shapes, poses, g.integers(0, 2, count), g.integers(0, 2, count).astype(bool)


def wanted(shapes, poses, shape, is_static, centers=np.zeros((0, 3)), radii=np.zeros(0), loose_static=None):
    c, r, body, still = [], [], [], []
    for b, (pose, k, s) in enumerate(zip(poses, shape, is_static)):
        own, own_r = shapes[k]
        c.append(own @ pose[:9].reshape(3, 3).T + pose[9:])
        r.append(np.broadcast_to(own_r, len(own)))
        body += [b] * len(own)
        still += [s] * len(own)
    body += range(len(poses), len(poses) + len(centers))
    still += list(np.zeros(len(centers), bool) if loose_static is None else loose_static)
    c, r = np.concatenate(c + [centers]), np.concatenate(r + [radii])
    return [(i, j) for i, j in brute(c, r) if body[i] != body[j] and not (still[i] and still[j])]


def test_static_spheres_do_not_meet():
    c, r, _, _ = scene()
    still = np.arange(len(c)) % 3 > 0
    expected = [(i, j) for i, j in brute(c, r) if not (still[i] and still[j])]
    for given in (still, still.astype(np.uint8), still.astype(np.int64) * 512, still.tolist()):
        assert pairs(padder.detect(c, r, is_static=given, backend="omp")) == expected


def test_bodies_are_brute_force():
    shapes, poses, shape, is_static = heap()
    c, r, _, _ = scene(40)
    bodies = padder.Bodies(shapes, poses, shape, is_static=is_static)
    assert len(bodies) == 36 and len(wanted(shapes, poses, shape, is_static)) > 100
    assert pairs(padder.detect(bodies=bodies, backend="omp")) == wanted(shapes, poses, shape, is_static)
    found = padder.detect(c, r, bodies=bodies, is_static=np.ones(40, bool), width="points", backend="omp")
    assert pairs(found) == wanted(shapes, poses, shape, is_static, c, r, np.ones(40, bool))
    assert found.points_i.shape == (len(found), 3)
    bodies.family[:] = 7
    assert len(padder.detect(bodies=bodies, backend="omp")) == 0


def test_bodies_show_their_memory(cube):
    shapes, poses, shape, is_static = heap()
    bodies = padder.Bodies([cube, *shapes], poses, shape, is_static=is_static)
    assert (bodies.poses == poses).all() and (bodies.shape == shape).all() and (bodies.is_static == is_static).all()
    assert (bodies.family == np.where(shape == 0, cube.family, 0)).all()  # those of the Cluster
    assert (bodies.mask == np.where(shape == 0, cube.mask, 0)).all()
    view = bodies.poses
    view[3, 9:] += 1
    assert (bodies.poses[3, 9:] == poses[3, 9:] + 1).all() and not bodies.shape.flags.writeable
    before = view.copy()
    del bodies
    assert (view == before).all()
    given = padder.Bodies(shapes, poses[::2], family=np.arange(18), mask=np.arange(18))
    assert (given.poses == poses[::2]).all() and (given.family == np.arange(18)).all() and not given.shape.any()


def test_bodies_take_the_level_of_detail_that_their_partners_need():
    part = padder.pad(CUBE, FACES, lod=["10%", "2%"])
    poses = np.zeros((4, 12))
    poses[:, [0, 4, 8]] = 1
    poses[:, 9] = [0, 1.0, 10, 30]  # two that touch, one near a small ball, one alone
    bodies = padder.Bodies([part], poses)
    c, r = [[10.5, 0.5, 1.0]], [0.06]
    taken = bodies.with_lod("auto", centers=c, radii=r, share=1)
    assert taken.lod.tolist() == [1, 1, 0, 2**32 - 1] and 0 < taken.lod_error < 0.5 and len(bodies.lod) == 0
    assert len(padder.detect(bodies=taken, backend="omp")) > 0
    assert len(padder.detect(c, r, bodies=taken, backend="omp")) > len(padder.detect(bodies=taken, backend="omp"))
    assert bodies.with_lod("auto", smallest=0.001).lod.tolist() == [0, 0, 0, 0]
    assert bodies.with_lod("1").lod.tolist() == [1, 1, 1, 1] and bodies.with_lod("0").lod_error == 0
    with pytest.raises(ValueError, match="auto or a whole number"):
        bodies.with_lod("fine")
    with pytest.raises(ValueError):
        bodies.with_lod(centers=c)
    for wrong in ({"smallest": -1}, {"smallest": float("nan")}, {"margin": -1}, {"margin": 1e200}, {"centers": c, "radii": [-1]},
                  {"centers": [[np.inf, 0, 0]], "radii": r}, {"smallest": 1, "margin": np.nan}, {"smallest": 1, "centers": c, "radii": [-1]},
                  {"smallest": 1, "centers": c, "radii": [np.nan]}):
        with pytest.raises(ValueError):
            bodies.with_lod(**wrong)
    with pytest.raises(ValueError, match="^loose sphere 1 at .* has the negative radius -1"):
        bodies.with_lod(centers=c + c, radii=[1, -1])
    with pytest.raises(TypeError):
        bodies.with_lod(smallest="0.1")
    with pytest.raises(ValueError, match="^the radii of the loose spheres must be of the shape"):
        bodies.with_lod(centers=c, radii=[1, 2])


def test_what_stands_still_is_kept():
    shapes, poses, shape, is_static = heap()
    bodies, detector = padder.Bodies(shapes, poses, shape, is_static=is_static), padder.Detector(backend="omp")
    assert detector.backend == "omp"

    def found(**arguments):
        return pairs(detector.detect(bodies=bodies, **arguments))

    assert found(revision=1) == wanted(shapes, poses, shape, is_static)
    moving, still = np.flatnonzero(~is_static), np.flatnonzero(is_static)
    # Only what is said to have moved is read: not the other moving body, nor a static one.
    bodies.poses[[moving[0], moving[1], still[0]], 9:] += 0.7
    poses[moving[0], 9:] += 0.7
    assert found(revision=1, moved=[moving[0]]) == wanted(shapes, poses, shape, is_static)
    assert found(revision=1, moved=[]) == wanted(shapes, poses, shape, is_static)
    poses[moving[1], 9:] += 0.7
    assert found(revision=1, moved=moving) == wanted(shapes, poses, shape, is_static)
    poses[still[0], 9:] += 0.7
    assert found(revision=2) == wanted(shapes, poses, shape, is_static)
    # All poses from elsewhere, in whatever rows.
    other = np.zeros((len(poses), 16))
    other[:, :12] = poses
    other[moving, 9:12] -= 0.3
    assert found(revision=2, poses=other[:, :12]) == wanted(shapes, other[:, :12], shape, is_static)
    bodies.is_static[:] = False
    assert found(poses=poses) == wanted(shapes, poses, shape, np.zeros(len(poses), bool))


def test_contacts_of_a_detector_are_there_until_the_next_call():
    c, r, _, _ = scene()
    detector = padder.Detector(backend="omp")
    contacts = detector.detect(c, r)
    kept = contacts.pairs[5:]
    with pytest.raises(padder.Error, match="still in use"):
        detector.detect(c, r)
    assert pairs(contacts) == brute(c, r)
    before = kept.copy()
    del kept
    again = detector.detect(c, r)
    assert len(contacts) == len(again)
    for gone in ("pairs", "depth", "hash"):
        with pytest.raises(padder.Error, match="gone"):
            getattr(contacts, gone)
    again = again.pairs
    del detector, contacts
    assert (again[5:] == before).all()  # what shows the memory keeps it


def test_bad_bodies():
    shapes, poses, shape, _ = heap()
    c, r, _, _ = scene(40)
    bodies, detector = padder.Bodies(shapes, poses), padder.Detector(backend="omp")
    for error, make in [
            (IndexError, lambda: padder.Bodies(shapes, poses, shape + 1)), (IndexError, lambda: padder.Bodies([], poses)),
            (TypeError, lambda: padder.Bodies([3], poses)), (TypeError, lambda: padder.Bodies(["ab"], poses)),
            (ValueError, lambda: detector.detect(bodies=bodies, poses=poses[1:])), (ValueError, lambda: detector.detect(poses=poses)),
            (TypeError, lambda: detector.detect(bodies=shapes)), (ValueError, lambda: detector.detect(c)), (ValueError, lambda: detector.detect(radii=r))]:
        with pytest.raises(error):
            make()
    assert pairs(detector.detect(bodies=bodies)) == wanted(shapes, poses, np.zeros(36, int), np.zeros(36, bool))
    for first in (0, 1.01, 1e300, np.inf):  # what is no rotation: a number of the matrix, or all of them
        for columns in (0, slice(0, 9)):
            bad = poses.copy()
            bad[7, columns] = first
            with pytest.raises(ValueError, match="body 7 "):
                padder.Bodies(shapes, bad)
            with pytest.raises(ValueError, match="body 7 "):
                detector.detect(bodies=bodies, poses=bad)
    for mirror in (-np.eye(3), np.diag([1.0, 1, -1])):
        bad = poses.copy()
        bad[7, :9] = mirror.ravel()
        with pytest.raises(ValueError, match="body 7 begins with a mirror image"):
            padder.Bodies(shapes, bad)
    changed = padder.Bodies(shapes, poses)
    detector.detect(bodies=changed, revision=1)
    changed.poses[7, :9] = 0
    for more in ({}, {"revision": 2}, {"revision": 1, "moved": [7]}):
        with pytest.raises(ValueError, match="body 7 "):
            detector.detect(bodies=changed, **more)
    detector.worlds(1, bodies=bodies, poses=poses + np.where(np.arange(12) < 9, 1e-5, 0))  # drifted
    assert len(padder.detect(bodies=padder.Bodies(shapes, poses[:0]), backend="omp")) == 0
    assert len(padder.detect(bodies=padder.Bodies([(c[:0], r[:0])], poses), backend="omp")) == 0


def test_other_threads_run_meanwhile():
    c, r, _, _ = scene(400_000)
    c *= 10
    done, ticks = threading.Event(), 0

    def work():
        padder.detect(c, r, backend="omp", threads=1)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        ticks += 1
        time.sleep(0.001)
    thread.join()
    assert ticks > 3  # with the lock held all the while it would be one or two


# multiprocessing forks by default on Linux. OpenMP's threads are not in the child, where a call would wait for them.
def test_calls_go_on_after_a_fork():
    script = f"""
import os, signal, numpy as np, padder
centers, radii = np.random.default_rng(1).random((20000, 3)), np.full(20000, 0.02)
shape = padder.pad(np.array({CUBE.tolist()}), np.array({FACES.tolist()}), tolerance="20%")
bodies = padder.Bodies([shape], np.tile(np.r_[np.eye(3).ravel(), 0, 0, 0], (20000, 1)))
bodies.poses[:, 9] = 10 * np.arange(20000)
detector = padder.Detector(backend="omp", threads=2)
def work():
    found = detector.detect(centers, radii)
    return (len(found), found.hash, len(padder.detect(centers, radii, backend="omp", threads=2)), len(shape._repr_html_()),
            bodies.with_lod().lod_error, len(padder.pad(np.array({CUBE.tolist()}), np.array({FACES.tolist()}), tolerance="20%")))
expected = work()
if os.fork() == 0:
    signal.alarm(60)
    assert work() == work() == expected
    try:
        detector.detect(centers, -radii)
        os._exit(2)
    except ValueError:
        os._exit(0)
assert os.waitstatus_to_exitcode(os.wait()[1]) == 0
"""
    assert ran(script) == ("", "", 0)


def test_stubs_name_what_is_there():
    stub = ast.parse((pathlib.Path(padder.__file__).parent / "__init__.pyi").read_text())
    for node in stub.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            assert hasattr(padder, node.name), node.name
            if isinstance(node, ast.ClassDef):
                for inner in node.body:
                    if isinstance(inner, ast.FunctionDef):
                        assert hasattr(getattr(padder, node.name), inner.name), (node.name, inner.name)
            else:
                names = [a.arg for a in node.args.args + node.args.kwonlyargs]
                signature = getattr(padder, node.name).__doc__.splitlines()[0]
                assert all(name + ":" in signature for name in names), node.name
    named = {n.name for n in stub.body if isinstance(n, (ast.FunctionDef, ast.ClassDef))}
    named |= {n.target.id for n in stub.body if isinstance(n, ast.AnnAssign) and n.target.id != "__version__"}
    assert set(padder.__all__) == named


def test_help_says_what_each_name_is():
    for name in padder.__all__:
        thing = getattr(padder, name)
        if callable(thing) and thing is not padder.Error:
            assert "." in (thing.__doc__ or ""), name


def test_numbers_out_of_range_are_value_errors():
    centers, radii = np.zeros((2, 3)), np.ones(2)
    for options in ({"margin": -1}, {"margin": float("nan")}, {"margin": 1e200}, {"device": 2**31}, {"device": 5, "backend": "omp"}):
        with pytest.raises(ValueError):
            padder.detect(centers, radii, **options)
    for threads in (-1, 1025, 10**5000):
        with pytest.raises(ValueError, match="^threads must be a whole number from 0 to 1024$"):
            padder.detect(centers, radii, threads=threads)
    with pytest.raises(ValueError, match="^margin is beyond what a float holds$"):
        padder.detect(centers, radii, margin=10**400)
    cluster = padder.pad(CUBE, FACES, tolerance="20%")
    for call in (lambda: setattr(cluster, "family", 2**32), lambda: setattr(cluster, "unit", "km"),
                 lambda: padder.detect(centers + 1e200, radii), lambda: padder.detect(centers, radii * 1e200),
                 lambda: padder.Detector(device=5, backend="omp"), lambda: padder.Detector().detect(centers, radii, revision=2**64),
                 lambda: padder.worlds(-1, centers=centers, radii=radii)):
        with pytest.raises(ValueError):
            call()
    cluster.family, cluster.mask, cluster.unit = np.uint32(7), 2**32 - 1, "mm"
    assert (cluster.family, cluster.mask, cluster.unit) == (7, 2**32 - 1, "mm")


def test_arguments_of_another_type_are_named():
    centers, radii = np.zeros((2, 3)), np.ones(2)
    cluster = padder.pad(CUBE, FACES, tolerance="20%")
    bodies = padder.Bodies([cluster], np.zeros((0, 12)))
    for said, call in (("threads must be a whole number, not str", lambda: padder.detect(centers, radii, threads="2")),
                       ("threads must be a whole number, not float", lambda: padder.Detector(threads=2.0)),
                       ("margin must be a number, not str", lambda: padder.detect(centers, radii, margin="1")),
                       ("margin must be a number, not NoneType", lambda: padder.Detector().worlds(1, "any", centers, radii, margin=None)),
                       ("width must be text, not int", lambda: padder.detect(centers, radii, width=3)),
                       ("count must be a whole number, not float", lambda: padder.worlds(1.5, centers=centers, radii=radii)),
                       ("smallest must be a number, not str", lambda: bodies.with_lod("auto", smallest="1")),
                       ("sharp_angle must be a number, not str", lambda: padder.pad(CUBE, FACES, sharp_angle="x")),
                       ("repair must be text, not NoneType", lambda: padder.pad(CUBE, FACES, repair=None)),
                       ("density must be a number, not str", lambda: cluster.save("a.xml", density="1")),
                       ("name must be text, not int", lambda: setattr(cluster, "name", 3))):
        with pytest.raises(TypeError, match=f"^{said}$"):
            call()
    with pytest.raises(ValueError, match="^name must be text that UTF-8 can hold$"):
        cluster.name = "\udc80"
    assert len(padder.detect(centers, radii, margin=np.float32(1), threads=np.int8(1), width="pairs")) == 1


def test_a_cluster_as_a_page():
    cluster = padder.pad(CUBE, FACES, tolerance="10%", name="cube")
    assert "<table>" in cluster._repr_html_()
    with pytest.raises(ValueError, match="colour"):
        cluster.page(colour="taste")
    try:
        page = cluster.page(CUBE, FACES.tolist(), colour="gap")
    except padder.Error as e:
        pytest.skip(str(e))  # the page is not built
    assert '"colour":"gap"' in page and 'id="mesh-gap0"' in page
    assert 'id="mesh-gap0"' not in cluster.page()
    with pytest.raises(padder.Error, match="gap"):
        cluster.page(colour="gap")  # without a mesh
    assert cluster.page(CUBE * 1000, FACES.tolist(), colour="gap") == page  # before it was scaled
    with pytest.raises(padder.Error, match="not the mesh that cluster cube was made from"):
        cluster.page(CUBE * [1, 1, 2], FACES)
    with pytest.raises(TypeError, match="vertices"):
        cluster.page(faces=FACES)
    assert "<iframe sandbox='allow-scripts'" in cluster._repr_html_()


def test_snippets_of_the_page_run(tmp_path, monkeypatch):
    page = (pathlib.Path(__file__).resolve().parents[2] / "docs" / "python.md").read_text()
    first, bodies, worlds = re.findall(r"```python\n(.*?)```", page, re.S)
    monkeypatch.chdir(tmp_path)
    names = {"vertices": CUBE, "faces": FACES}
    exec(first, names)
    shapes, poses, shape, ground = heap()
    shoe, (centers, radii) = names["cluster"], shapes[0]
    names = {"np": np, "padder": padder, "shoe": shoe, "centers": centers, "radii": radii, "poses": poses, "shape": shape, "ground": ground,
             "moved": np.flatnonzero(~ground), "velocity": np.ones(3), "dt": 1e-4}
    exec(bodies, names)
    count = len(poses)
    names = {"np": np, "padder": padder, "links": shapes, "B": count, "poses": np.tile(poses, (1000, 1)), "shape": np.tile(shape, 1000),
             "family": np.ones(1000 * count, int), "mask": np.zeros(1000 * count, int), "obstacles": centers, "radii": radii,
             "new_poses": np.tile(poses, (1000, 1))}
    exec(worlds, names)
    assert names["hits"].shape == (1000,) and names["hits"].all() and (names["near"].distance < 0).all()
