#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""make_data.py OUT: writes small meshes into OUT, so that tests with real files run everywhere. CMake runs it, into build/.../data.

formats/ holds one hexagonal nut in every format: 13 mm across its flats, 6 mm high, its bore a polygon of 16 corners with a
radius of 4 mm. hard/ holds meshes that are no solids or look like none, malformed/ files that are to be refused.
"""
import base64
import io
import json
import math
import pathlib
import struct
import sys
import zipfile

CORNERS = 16  # of the bore, and points along the hexagon
FLATS, HEIGHT, BORE = 13.0, 6.0, 4.0


def rounded(value):
    """A number that float32 holds, so that every format can carry the same one."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def text(value):
    return format(value, ".9g")


# --- Shapes: points, and faces as lists of indices, seen from outside against the clock ---

def nut():
    """Points and 64 quadrilaterals; the hexagon's corners lie at angles that its 16 points do not all meet."""
    hexagon = [((FLATS / 2) / math.cos(math.pi / 6) * math.cos(k * math.pi / 3),
                (FLATS / 2) / math.cos(math.pi / 6) * math.sin(k * math.pi / 3)) for k in range(6)]
    # The six corners and ten more points on its sides: 3 on each of four sides, 2 on two.
    outer = []
    for side in range(6):
        (ax, ay), (bx, by) = hexagon[side], hexagon[(side + 1) % 6]
        parts = 3 if side in (0, 1, 3, 4) else 2
        outer += [(ax + (bx - ax) * k / parts, ay + (by - ay) * k / parts) for k in range(parts)]
    assert len(outer) == CORNERS
    inner = [(BORE * math.cos(math.atan2(y, x)), BORE * math.sin(math.atan2(y, x))) for x, y in outer]
    points = [(rounded(x), rounded(y), z) for z in (0.0, HEIGHT) for ring in (outer, inner) for x, y in ring]
    n, faces = CORNERS, []
    for k in range(n):
        j = (k + 1) % n
        faces.append([k, n + k, n + j, j])  # below
        faces.append([2 * n + k, 2 * n + j, 3 * n + j, 3 * n + k])  # above
        faces.append([k, j, 2 * n + j, 2 * n + k])  # outside
        faces.append([n + k, 3 * n + k, 3 * n + j, n + j])  # the bore
    return points, faces


def box(size, low=(0.0, 0.0, 0.0)):
    points = [tuple(low[k] + size[k] * (corner >> k & 1) for k in range(3)) for corner in range(8)]
    return points, [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def triangles_of(faces):
    return [[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)]


def moved(points, by):
    return [tuple(p[k] + by[k] for k in range(3)) for p in points]


# --- File formats ---

def obj(points, faces, note, from_the_end=False):
    """With from_the_end, faces count vertices backwards, as OBJ allows."""
    index = (lambda i: i - len(points)) if from_the_end else (lambda i: i + 1)
    lines = [f"# {note}"] + ["v " + " ".join(map(text, p)) for p in points]
    return "\n".join(lines + ["f " + " ".join(str(index(i)) for i in f) for f in faces]) + "\n"


def off(points, faces):
    lines = [f"OFF\n{len(points)} {len(faces)} 0"] + [" ".join(map(text, p)) for p in points]
    return "\n".join(lines + [" ".join(map(str, [len(f), *f])) for f in faces]) + "\n"


def stl_ascii(points, triangles, name):
    lines = [f"solid {name}"]
    for t in triangles:
        lines.append("facet normal 0 0 0\nouter loop")
        lines += ["vertex " + " ".join(map(text, points[i])) for i in t]
        lines.append("endloop\nendfacet")
    return "\n".join(lines + [f"endsolid {name}\n"])


def msh(points, triangles):
    out = struct.pack("<4i", len(points), 0, 0, len(triangles))
    out += b"".join(struct.pack("<3f", *p) for p in points)
    return out + b"".join(struct.pack("<3i", *t) for t in triangles)


def stl_binary(points, triangles):
    out = b"a nut".ljust(80, b" ") + struct.pack("<I", len(triangles))
    for t in triangles:
        out += struct.pack("<12fH", 0, 0, 0, *(c for i in t for c in points[i]), 0)
    return out


def ply(points, faces, binary):
    kind = "binary_little_endian" if binary else "ascii"
    head = (f"ply\nformat {kind} 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    if not binary:
        lines = [" ".join(map(text, p)) for p in points] + [" ".join(map(str, [len(f), *f])) for f in faces]
        return head + "\n".join(lines) + "\n"
    out = head.encode()
    for p in points:
        out += struct.pack("<3f", *p)
    for f in faces:
        out += struct.pack(f"<B{len(f)}i", len(f), *f)
    return out


def gltf(points, triangles, matrix=None):
    """A document without its buffer, and the buffer. glTF is in metres; a mirroring matrix turns the faces over."""
    data = b"".join(struct.pack("<3f", *p) for p in points)
    at = len(data)
    data += b"".join(struct.pack("<3H", *t) for t in triangles)
    data += b"\0" * (-len(data) % 4)
    node = {"mesh": 0, **({"matrix": matrix} if matrix else {})}
    document = {
        "asset": {"version": "2.0", "generator": "padder, tests/data/make_data.py"},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [node],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
             "min": [min(p[k] for p in points) for k in range(3)], "max": [max(p[k] for p in points) for k in range(3)]},
            {"bufferView": 1, "componentType": 5123, "count": 3 * len(triangles), "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": at},
                        {"buffer": 0, "byteOffset": at, "byteLength": 6 * len(triangles)}],
        "buffers": [{"byteLength": len(data)}]}
    return document, data


def gltf_in_one(points, triangles):
    document, data = gltf(points, triangles)
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return json.dumps(document, indent=1) + "\n"


def glb(points, triangles, matrix=None):
    document, data = gltf(points, triangles, matrix)
    head = json.dumps(document).encode()
    head += b" " * (-len(head) % 4)
    return (struct.pack("<4sII", b"glTF", 2, 28 + len(head) + len(data)) + struct.pack("<I4s", len(head), b"JSON") + head
            + struct.pack("<I4s", len(data), b"BIN\0") + data)


def dae(points, triangles):
    numbers = " ".join(text(c) for p in points for c in p)
    indices = " ".join(str(i) for t in triangles for i in t)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified><unit name="millimeter" meter="0.001"/><up_axis>Y_UP</up_axis></asset>
 <library_geometries><geometry id="nut"><mesh>
  <source id="p"><float_array id="a" count="{3 * len(points)}">{numbers}</float_array>
   <technique_common><accessor source="#a" count="{len(points)}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="{len(triangles)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{indices}</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#nut"/></node></visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""


def threemf(points, triangles):
    vertices = "".join(f'<vertex x="{text(x)}" y="{text(y)}" z="{text(z)}"/>' for x, y, z in points)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    files = {
        "[Content_Types].xml": '<?xml version="1.0" encoding="UTF-8"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
        "_rels/.rels": '<?xml version="1.0" encoding="UTF-8"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        '<Relationship Id="r" Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>',
        "3D/3dmodel.model": '<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<resources><object id="1" type="model"><mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object></resources>'
        '<build><item objectid="1"/></build></model>'}
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in files.items():  # stored, not packed: zlib's bytes differ from version to version
            archive.writestr(zipfile.ZipInfo(name, (2026, 1, 1, 0, 0, 0)), content)
    return out.getvalue()


# --- The folders ---

def formats():
    points, faces = nut()
    triangles = triangles_of(faces)
    metres = [tuple(rounded(c / 1000) for c in p) for p in points]
    mirrored = [(-x, y, z) for x, y, z in metres]
    return {
        "nut.obj": obj(points, faces, "a hexagonal nut, in millimetres, of quadrilaterals"),
        "nut_negative_indices.obj": obj(points, faces, "the nut, its vertices counted from the end", True).replace("\n", "\r\n"),
        "nut.off": off(points, faces),
        "nut_ascii.stl": stl_ascii(points, triangles, "nut"),
        "nut_binary.stl": stl_binary(points, triangles),
        "nut_ascii.ply": ply(points, faces, False),
        "nut_binary.ply": ply(points, faces, True),
        "nut.gltf": gltf_in_one(metres, triangles),
        # The node mirrors, so the faces must be stored turned over to be seen from outside in the end.
        "nut_mirrored.glb": glb(mirrored, [[a, b, c] for a, c, b in triangles],
                                [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "nut.dae": dae(points, triangles),
        "nut.3mf": threemf(points, triangles),
        "nut.msh": msh(points, triangles),
    }


def hard():
    points, faces = nut()
    triangles = triangles_of(faces)
    turned = [t if k % 3 else t[::-1] for k, t in enumerate(triangles)]
    plate, sides = box((20.0, 10.0, 0.25))
    block, second = box((4.0, 3.0, 2.0))[0], box((2.0, 2.0, 2.0), (3.0, 0.5, 1.0))[0]
    soup = [[tuple(c + 1e-7 * ((31 * k + 7 * j) % 5 - 2) for c in points[i]) for j, i in enumerate(t)] for k, t in enumerate(triangles)]
    sheet = [(float(x), float(y), 0.0) for y in range(5) for x in range(5)]
    squares = [[5 * y + x, 5 * y + x + 1, 5 * y + x + 6, 5 * y + x + 5] for y in range(4) for x in range(4) if (x, y) != (1, 2)]
    return {
        "turned.off": off(points, turned),
        "overlapping.obj": obj(block + second, sides + [[i + 8 for i in f] for f in sides], "two boxes through each other"),
        "cracked_soup.stl": stl_binary([p for t in soup for p in t], [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(len(soup))]),
        "sheet_with_hole.obj": obj(sheet, squares, "an open sheet with a hole"),
        "double_sided.obj": obj(points, faces + [f[::-1] for f in faces], "each face twice, once from each side"),
        "degenerate.obj": obj(points + [(99.0, 99.0, 99.0)], faces + [[0, 0, 1], [0, 1, 0], *faces[:2]],
                              "faces without area, faces twice and a point that no face uses"),
        "thin_plate.obj": obj(plate, sides, "80 times as long as thick"),
        "far_away.obj": obj(moved(points, (1e6, -1e6, 1e6)), faces, "a million units from the origin"),
    }


def malformed():
    points, faces = nut()
    binary = ply(points, faces, True)
    packed = threemf(points, triangles_of(faces))
    broken, _ = gltf(points, triangles_of(faces))
    broken["buffers"][0]["uri"] = "absent.bin"
    return {
        "empty.obj": "",
        "no_faces.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        "index_beyond.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
        "index_zero.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
        "not_a_number.obj": "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
        "too_few.off": "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n",
        "absurd_count.off": "OFF\n999999999999 1 0\n0 0 0\n",
        "cut.ply": binary[:len(binary) // 2],
        "cut.3mf": packed[:len(packed) // 2],
        "cut.stl": stl_binary(points, triangles_of(faces))[:1000],
        "no_facet.stl": "solid nothing\nendsolid nothing\n",
        "absent_buffer.gltf": json.dumps(broken, indent=1) + "\n",
    }


def main(out):
    for folder, files in (("formats", formats()), ("hard", hard()), ("malformed", malformed())):
        (out / folder).mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (out / folder / name).write_bytes(content.encode() if isinstance(content, str) else content)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
