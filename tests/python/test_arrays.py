# SPDX-License-Identifier: GPL-3.0-or-later
"""Every array argument of every function, in every type and layout, against the same call with a clean copy."""
import array
import decimal
import fractions
import functools

import numpy as np
import padder
import pytest

from test_padder import CUBE, FACES, brute, heap, pairs, scene

CORNER = np.concatenate([np.zeros((1, 3)), np.eye(3)])  # a tetrahedron: padded in half the time of a cube
CORNER_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

REAL = ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "?", "f2", "f4", "f8", "g", ">f2", ">f4", ">f8", ">i4", ">u2"]
WHOLE = ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", ">i2", ">u4", ">i8"]
NONE = ["c8", "c16", ">c8", "O", "S4", "U4", "M8[s]", "m8[s]", "V8"]


class Sub(np.ndarray):
    pass


class Capsule:
    """Of DLPack's protocol the array alone, and not where it lies."""

    def __init__(self, a):
        self.a = a

    def __dlpack__(self, **_):
        return self.a.__dlpack__()


class OnlyDlpack(Capsule):
    def __dlpack_device__(self):
        return self.a.__dlpack_device__()


class OnlyArray:
    def __init__(self, a):
        self.a = a

    def __array__(self, *_, **__):
        return self.a


class Rows:
    """A sequence that is neither a list nor a tuple."""

    def __init__(self, rows):
        self.rows = rows

    def __len__(self):
        return len(self.rows)

    def __getitem__(self, k):
        return self.rows[k]


def misaligned(a):
    room = np.zeros(a.nbytes + 1, np.uint8)[1:]
    out = room.view(a.dtype).reshape(a.shape)
    out[...] = a
    return out


def read_only(a):
    a = a.copy()
    a.flags.writeable = False
    return a


def columns(a):
    """Between other numbers: rows apart, the last axis contiguous."""
    wide = np.full((len(a), 2 + (a.shape[1] if a.ndim > 1 else 1)), 77, a.dtype)
    wide[:, 1:-1] = a if a.ndim > 1 else a[:, None]
    return wide[:, 1:-1] if a.ndim > 1 else wide[:, 1]


def gaps(a):
    """Numbers of a row apart, too."""
    wide = np.full(a.shape[:-1] + (2 * a.shape[-1],), 77, a.dtype)
    wide[..., ::2] = a
    return wide[..., ::2]


LAYOUTS = {
    "F": np.asfortranarray, "reversed": lambda a: a[::-1].copy()[::-1], "mirrored": lambda a: a[..., ::-1].copy()[..., ::-1],
    "columns": columns, "gaps": gaps, "odd columns": lambda a: misaligned(columns(a)), "misaligned": misaligned, "read only": read_only,
    "subclass": lambda a: a.view(Sub), "list": lambda a: a.tolist(), "tuple": lambda a: tuple(map(tuple, a.tolist()) if a.ndim > 1 else a.tolist()),
    "not masked": lambda a: np.ma.array(a), "memoryview": memoryview, "dlpack": OnlyDlpack, "capsule": Capsule,
    "rows": lambda a: Rows(list(a)), "array": OnlyArray, "masked rows": lambda a: list(np.ma.array(a)),
    "dlpack columns": lambda a: OnlyDlpack(columns(a)), "big-endian gaps": lambda a: gaps(a.astype(a.dtype.newbyteorder(">"))),
}


def found(contacts):
    return pairs(contacts), contacts.hash, np.asarray(contacts.depth).tolist()


class Argument:
    """One argument: what is good for it, and the call with everything else as it should be."""

    def __init__(self, name, kind, good, call):
        self.name, self.kind, self.good, self.call = name, kind, good, call

    def __repr__(self):
        return self.name

    def clean(self, a):
        a = np.asarray(a)
        wide = {"real": "f4" if a.dtype in ("f4", ">f4") else "f8", "wide": "f8", "bits": "u4", "whole": "i8", "flags": "?"}[self.kind]
        return np.array(a, dtype=wide, order="C")


C, R, FAMILY, MASK = scene(80, 5)
C, R = C * 0.6, R.astype("f4").astype("f8")
STILL = np.arange(80) % 3 == 0
SHAPES, POSES, SHAPE, IS_STATIC = heap(20)
BODIES = padder.Bodies(SHAPES, POSES, SHAPE)


def moved(numbers):
    d = padder.Detector(backend="omp")
    bodies = padder.Bodies(SHAPES, POSES, SHAPE)
    d.detect(bodies=bodies, revision=1)
    bodies.poses[:, 9:] *= 0.8
    return found(d.detect(bodies=bodies, revision=1, moved=numbers))


def loose(**changed):
    given = dict(centers=C, radii=R, family=FAMILY, mask=MASK, is_static=STILL)
    return found(padder.detect(**{**given, **changed}, backend="omp"))


def bodies(**changed):
    given = dict(shapes=SHAPES, poses=POSES, shape=SHAPE, family=FAMILY[:20], mask=MASK[:20], is_static=IS_STATIC)
    return found(padder.detect(bodies=padder.Bodies(**{**given, **changed}), backend="omp"))


def padded(vertices=CORNER, faces=CORNER_FACES):
    return padder.pad(vertices, faces, edge_length="40%").centers.tolist()


ARGUMENTS = [
    Argument("centers", "real", C, lambda a: loose(centers=a)),
    Argument("radii", "real", R, lambda a: loose(radii=a)),
    Argument("family", "bits", FAMILY, lambda a: loose(family=a)),
    Argument("mask", "bits", MASK, lambda a: loose(mask=a)),
    Argument("is_static", "flags", STILL, lambda a: loose(is_static=a)),
    Argument("moved", "bits", np.array([3, 1, 15]), moved),
    Argument("poses of detect", "wide", POSES, lambda a: found(padder.Detector(backend="omp").detect(bodies=BODIES, poses=a))),
    Argument("centers of a shape", "wide", SHAPES[0][0], lambda a: bodies(shapes=[(a, SHAPES[0][1]), SHAPES[1]])),
    Argument("radii of a shape", "wide", SHAPES[0][1], lambda a: bodies(shapes=[(SHAPES[0][0], a), SHAPES[1]])),
    Argument("poses", "wide", POSES, lambda a: bodies(poses=a)),
    Argument("shape", "bits", SHAPE, lambda a: bodies(shape=a)),
    Argument("family of bodies", "bits", FAMILY[:20], lambda a: bodies(family=a)),
    Argument("mask of bodies", "bits", MASK[:20], lambda a: bodies(mask=a)),
    Argument("is_static of bodies", "flags", IS_STATIC, lambda a: bodies(is_static=a)),
    Argument("vertices", "wide", CORNER, lambda a: padded(vertices=a)),
    Argument("faces", "whole", CORNER_FACES, lambda a: padded(faces=a)),
]
every = pytest.mark.parametrize("argument", ARGUMENTS, ids=repr)


def outcome(argument, a):
    """What the call gives, or the kind of error that the numbers themselves deserve (poses that are no rotation, radii of 0)."""
    try:
        return argument.call(a)
    except (ValueError, IndexError, padder.Error) as e:
        return type(e), str(e)


@functools.lru_cache(maxsize=None)
def expected(number, code, shape, numbers):
    """Of the clean copy. Many types hold the same numbers, and padding takes a while."""
    return outcome(ARGUMENTS[number], np.frombuffer(numbers, code).reshape(shape))


def wanted_of(argument, a):
    clean = argument.clean(a)
    return expected(ARGUMENTS.index(argument), clean.dtype.str, clean.shape, clean.tobytes())


@every
def test_types(argument):
    allowed = REAL if argument.kind in ("real", "wide") else WHOLE + ["?"] if argument.kind == "flags" else WHOLE
    for code in allowed:
        a = argument.good.astype(code)
        assert outcome(argument, a) == wanted_of(argument, a), code
    for code in set(REAL) - set(allowed):
        if np.dtype(code).kind in "f?":
            with pytest.raises(TypeError):
                argument.call(argument.good.astype(code))
    for code in NONE:
        with pytest.raises(TypeError):
            argument.call(np.zeros(argument.good.shape, code))


@every
@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts(argument, layout):
    for code in {"real": ["f4", "f8"], "wide": ["f8", "f4"], "bits": ["u4", "i8"], "whole": ["i8", "u4"], "flags": ["u1", "i4"]}[argument.kind]:
        a = argument.good.astype(code)
        given = LAYOUTS[layout](a)
        clean = a if layout != "list" and layout != "tuple" else np.asarray(given)
        assert argument.call(given) == wanted_of(argument, clean), code


@every
def test_what_is_refused(argument):
    a = argument.good
    for bad in (a[..., None], a[None], np.array(a.flat[0]), a.flat[0], a[:, :-1] if a.ndim > 1 else a.reshape(1, -1)):
        if np.ndim(bad) == 0 and argument.name.startswith("radii"):
            continue
        with pytest.raises(ValueError):
            argument.call(bad)
    masked = np.ma.array(a, mask=np.arange(a.size).reshape(a.shape) == 1)
    for bad in (masked, list(masked), tuple(masked), Rows(list(masked)), OnlyArray(masked)):
        with pytest.raises(ValueError, match="has masked entries: fill them or remove them"):
            argument.call(bad)
    for bad in ("text", {}, object(), [[1], [1, 2]], a.astype(object), [None] * len(a), fractions.Fraction(1, 2), decimal.Decimal(1)):
        with pytest.raises(TypeError):
            argument.call(bad)
    if a.ndim == 1 and argument.name != "moved":
        for bad in (a[:1], a[:-1], a[:0], np.append(a, a[0])):
            with pytest.raises(ValueError):
                argument.call(bad)
    if argument.kind == "bits":
        for value in (-1, 2**32, 2**63 - 1):
            bad = a.astype("i8")
            bad[0] = value
            with pytest.raises(ValueError, match="from 0 to 4294967295"):
                argument.call(bad)
        with pytest.raises(ValueError):
            argument.call(np.where(np.arange(a.size) == 0, np.uint64(2**64 - 1), a.astype("u8")))
    if argument.kind in ("real", "wide"):
        for value in (np.nan, np.inf, -np.inf):
            for code in ("f2", "f4", "f8", ">f8"):
                bad = a.astype(code)
                bad.flat[-1] = value
                with pytest.raises(ValueError):
                    argument.call(bad)


def test_numbers_without_a_type_are_out_of_range():
    for family in ([0, 2**70], [2**63, -1]):
        with pytest.raises(ValueError, match="family has whole numbers that no type of NumPy holds together"):
            padder.detect(np.zeros((2, 3)), 1.0, family)
    with pytest.raises(ValueError, match="centers has whole numbers"):
        padder.detect([[2**70, 0, 0]], 1.0)
    with pytest.raises(TypeError, match="family must be whole numbers, not bool"):
        padder.detect(np.zeros((2, 3)), 1.0, [True, False])
    for bad in ({"tolerance": 10**400}, {"depth": 10**400}):
        with pytest.raises(ValueError, match="beyond what a float holds"):
            padder.pad(CUBE, FACES, **bad)


def test_a_wrong_shape_is_told():
    for centers, told in ((np.zeros((3, 5)), "(3, 5)"), (np.zeros(6), "(6,)"), (0.0, "()")):
        with pytest.raises(ValueError) as e:
            padder.detect(centers, 1.0)
        assert str(e.value) == "centers must be of the shape (N, 3), and not " + told
    with pytest.raises(ValueError) as e:
        padder.detect(np.zeros((3, 3)), np.ones(2))
    assert str(e.value) == "radii must be of the shape (N,), or one number for all, and not (2,)"


@pytest.mark.parametrize("centers", ["f4", "f8", "i4", ">f4"])
@pytest.mark.parametrize("radius", [0.4, 1, True, np.float16(0.4), np.float32(0.4), np.float64(0.4), np.int8(1), np.bool_(True), np.array(0.4),
                                    np.array(0.4, ">f8"), np.array(1), np.array(0.4).view(Sub), np.array([0.4, 0.7])[:1].reshape(())], ids=repr)
def test_one_radius(centers, radius):
    c = (C * 1.4).astype(centers)
    clean = np.ascontiguousarray(c.astype("f4" if c.dtype.itemsize == 4 and c.dtype.kind == "f" else "f8"))
    all_of_them = np.full(len(c), radius, dtype=clean.dtype)
    got = padder.detect(c, radius, backend="omp")
    assert found(got) == found(padder.detect(clean, all_of_them, backend="omp"))
    assert got.depth.dtype == clean.dtype
    if centers != "i4":  # on a grid spheres touch exactly, which brute() leaves out
        assert pairs(got) == brute(clean.astype(float), all_of_them.astype(float))
    one = padder.Bodies([(c, radius)], POSES)
    assert found(padder.detect(bodies=one, backend="omp")) == found(
        padder.detect(bodies=padder.Bodies([(c.astype("f8"), np.full(len(c), radius, dtype="f8"))], POSES), backend="omp"))


@pytest.mark.parametrize("n", [0, 1])
def test_few(n):
    for layout in LAYOUTS.values():
        c, r = layout(C[:n]), layout(R[:n])
        assert len(padder.detect(c, r, layout(FAMILY[:n]), layout(MASK[:n]), is_static=layout(STILL[:n].astype("u1")), backend="omp")) == 0
        assert len(padder.detect(c, 0.4, backend="omp")) == 0
    assert len(padder.detect(np.zeros((0, 3)), [], [], [], is_static=[], backend="omp")) == 0
    assert len(padder.Bodies(SHAPES, np.zeros((0, 12)), [], family=[], mask=[], is_static=[])) == 0
    assert moved([]) == moved(np.zeros(0, "u4"))


def test_other_sequences():
    assert loose(radii=array.array("d", R)) == loose()
    assert loose(radii=array.array("f", R)) == loose(radii=R.astype("f4"))
    assert loose(family=array.array("B", FAMILY.tolist())) == loose()
    assert loose(centers=np.asmatrix(C)) == loose()
    same = np.broadcast_to(np.float64(0.4), (80,))  # a stride of 0
    assert loose(radii=same) == loose(radii=0.4) == loose(radii=same.copy())
    still = np.broadcast_to(C[0], (80, 3))
    assert loose(centers=still) == loose(centers=still.copy())
    records = np.zeros(80, [("x", "f4"), ("c", "f8", 3), ("r", ">f4"), ("family", "u2")])  # numbers of a record, not aligned
    records["c"], records["r"], records["family"] = C, R, FAMILY
    assert loose(centers=records["c"], radii=records["r"], family=records["family"]) == loose()


class Endless:
    """NumPy asks such an object for one entry after the other, until memory ends."""

    def __getitem__(self, k):
        return [0.0, 0.0, 0.0]


class Long(Endless):
    def __len__(self):
        return 3


def test_a_sequence_without_an_end_is_refused():
    with pytest.raises(TypeError, match="centers is not an array of numbers|centers must be real numbers"):
        padder.detect(Endless(), 1.0)
    with pytest.raises(TypeError, match="more entries than its length"):
        padder.detect(Long(), 1.0)


def test_what_an_object_raises_is_kept():
    class Raises(OnlyArray):
        def __array__(self, *_, **__):
            raise self.a

    for error in (KeyboardInterrupt, MemoryError, SystemExit):
        with pytest.raises(error):
            padder.detect(Raises(error("mine")), 1.0)
    with pytest.raises(TypeError, match="centers is not an array of numbers") as e:
        padder.detect(Raises(RuntimeError("mine")), 1.0)
    assert str(e.value.__cause__) == "mine"


def test_a_dlpack_that_is_none_is_told():
    class No(OnlyDlpack):
        def __dlpack__(self, **_):
            return 5

    with pytest.raises(TypeError, match="centers has a __dlpack__ that gives no fresh capsule of DLPack"):
        padder.detect(No(np.array(C)), R)


def test_an_empty_list_has_no_rows():
    assert len(padder.detect([], [], backend="omp")) == len(padder.detect(np.zeros(0), 1.0, backend="omp")) == 0
    assert len(padder.Bodies(SHAPES, [], [], family=[], mask=[], is_static=[])) == 0


def test_memory_is_kept_while_it_is_read():
    assert loose(centers=OnlyDlpack(np.array(C)), radii=memoryview(np.array(R))) == loose()


class Claims:
    """An object that says where on a GPU its numbers are. Nothing reads them, because what it says is refused."""

    def __init__(self, interface):
        self.__cuda_array_interface__ = interface


def test_a_device_array_that_does_not_describe_itself_is_told():
    good = {"version": 3, "shape": (2, 3), "typestr": "<f4", "strides": None, "data": (4096, False)}
    for key in ("shape", "typestr", "data"):
        lacking = {k: v for k, v in good.items() if k != key}
        for bad in (lacking, {**good, key: None}, {**good, key: 1.5}, {**good, key: ("x",)}):
            with pytest.raises(TypeError, match=f'centers has a __cuda_array_interface__ whose "{key}" is missing or of another type'):
                padder.detect(Claims(bad), 1.0)
    for bad in (None, [], "f4"):
        with pytest.raises(TypeError, match="that is no dict"):
            padder.detect(Claims(bad), 1.0)
    for bad in ({"shape": (-1, 3)}, {"strides": (12,)}, {"mask": Claims(good)}):
        with pytest.raises(ValueError, match="centers"):
            padder.detect(Claims({**good, **bad}), 1.0)
    for typestr in (">f4", "<f16", "f", "<fx"):
        with pytest.raises(TypeError, match="centers on a device must be"):
            padder.detect(Claims({**good, "typestr": typestr}), [1.0, 1.0])


def test_errors_are_pythons_own(tmp_path):
    for call in (padder.load, padder.pad_file):
        with pytest.raises(FileNotFoundError):
            call("")
        with pytest.raises(FileNotFoundError) as e:
            call(tmp_path / "absent.obj")
        assert e.value.filename == str(tmp_path / "absent.obj") and e.value.errno == 2
    for call, name, said in ((padder.load, "part.obj", "in Python with pad_file"), (padder.pad_file, "arm.urdf", "pad_urdf in Python")):
        (tmp_path / name).write_text("v 0 0 0\n")
        with pytest.raises(padder.Error, match=said):
            call(tmp_path / name)
    cluster = padder.pad(CUBE, FACES, edge_length="40%")
    with pytest.raises(FileNotFoundError):
        cluster.save(tmp_path / "absent" / "c.npz")
    for bad in ({"depth": np.nan}, {"tolerance": np.nan}, {"tolerance": np.inf}, {"edge_length": np.nan}, {"sharp_angle": np.nan}, {"unit": "ft"}):
        with pytest.raises(ValueError):
            padder.pad(CUBE, FACES, **bad)
    for bad in ({"depth": "x"}, {"depth": 1j}, {"tolerance": [1, 2]}, {"edge_length": object()}):
        with pytest.raises(TypeError):
            padder.pad(CUBE, FACES, **bad)
    with pytest.raises(ValueError):
        cluster.save(tmp_path / "c.npz", density=np.nan)
    with pytest.raises(ValueError):
        padder.pad_file(tmp_path, scale=np.nan)
    with pytest.raises(IndexError):
        moved([20])
    with pytest.raises(padder.Error, match="is a folder"):
        (tmp_path / "folder.obj").mkdir()
        padder.pad_file(tmp_path / "folder.obj")
    with pytest.raises(padder.Error, match="device"):
        padder.load("/dev/zero")

