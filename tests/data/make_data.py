#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes the small meshes of tests/data, so that tests with real files run in every checkout.

  make_data.py            writes them into the folder of this script
  make_data.py --check    compares them with what stands there; exit code 1 and a sentence for each that differs

It needs only Python's standard library and writes the same bytes on every machine. Every file in formats/ holds the same
hexagonal nut: 13 mm across its flats, 6 mm high, its bore a polygon of 16 corners with a radius of 4 mm.
"""
import base64
import io
import json
import math
import pathlib
import struct
import sys
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
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


def volume(points, triangles):
    total = 0.0
    for a, b, c in triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = points[a], points[b], points[c]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6


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


FOLDING = '''<?xml version="1.0"?>
<!-- The arm with joints wide enough that it reaches itself, a mirrored mesh, a capsule, a gripper whose second finger follows the
     first, and moments that no body has. -->
<robot name="folding">
  <link name="base">
    <collision><geometry><mesh filename="package://arm_description/meshes/base.stl"/></geometry></collision>
  </link>
  <link name="upper">
    <inertial><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.05"/></inertial>
    <collision><geometry><mesh filename="package://arm_description/meshes/upper.stl"/></geometry></collision>
  </link>
  <link name="fore">
    <collision><geometry><mesh filename="package://arm_description/meshes/fore.stl" scale="1 -1 1"/></geometry></collision>
  </link>
  <link name="palm">
    <collision><origin xyz="0 0 0.03" rpy="1.5707963 0 0"/><geometry><capsule radius="0.03" length="0.06"/></geometry></collision>
  </link>
  <link name="finger">
    <collision><origin xyz="0 0 0.03"/><geometry><box size="0.02 0.01 0.06"/></geometry></collision>
  </link>
  <link name="other_finger">
    <collision><origin xyz="0 0 0.03"/><geometry><box size="0.02 0.01 0.06"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.1"/><axis xyz="0 1 0"/><limit lower="-2.9" upper="2.9" effort="10" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0.2"/><limit lower="-2.9" upper="2.9" effort="10" velocity="1"/>
  </joint>
  <joint name="wrist" type="continuous">
    <parent link="fore"/><child link="palm"/>
    <origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="grip" type="prismatic">
    <parent link="palm"/><child link="finger"/>
    <origin xyz="0 -0.005 0.06"/><axis xyz="0 -1 0"/><limit lower="0" upper="0.03" effort="5" velocity="1"/>
  </joint>
  <joint name="other_grip" type="prismatic">
    <parent link="palm"/><child link="other_finger"/>
    <origin xyz="0 0.005 0.06"/><axis xyz="0 1 0"/><limit lower="0" upper="0.03" effort="5" velocity="1"/>
    <mimic joint="grip"/>
  </joint>
</robot>
'''

NESTED = '''<?xml version="1.0"?>
<!-- A link that slides inside another: no two surfaces meet. Its first shape is a flake outside. -->
<robot name="nested">
  <link name="base"><collision><geometry><box size="0.4 0.4 0.4"/></geometry></collision></link>
  <link name="post"><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
  <link name="inner">
    <collision><origin xyz="0.3 0 0"/><geometry><box size="0.01 0.01 0.01"/></geometry></collision>
    <collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision>
  </link>
  <joint name="lift" type="prismatic">
    <parent link="base"/><child link="post"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-0.02" upper="0.02" effort="1" velocity="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="post"/><child link="inner"/><origin xyz="0 0 -0.5"/><axis xyz="1 0 0"/>
    <limit lower="-0.02" upper="0.02" effort="1" velocity="1"/>
  </joint>
</robot>
'''


SHELLED = '''<?xml version="1.0"?>
<!-- A link inside an open shell: it touches the walls in some poses, and stands free of them in others. -->
<robot name="shelled">
  <link name="shell"><collision><geometry><mesh filename="package://arm_description/meshes/shell.stl"/></geometry></collision></link>
  <link name="post"><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
  <link name="inner"><collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision></link>
  <joint name="lift" type="prismatic">
    <parent link="shell"/><child link="post"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-0.02" upper="0.02" effort="1" velocity="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="post"/><child link="inner"/><origin xyz="0 0 -0.5"/><axis xyz="1 0 0"/>
    <limit lower="-0.09" upper="0.09" effort="1" velocity="1"/>
  </joint>
</robot>
'''

GRIPPER_PACKAGE = '''<?xml version="1.0"?>
<package format="3">
  <name>gripper_description</name>
  <version>1.0.0</version>
  <description>A gripper for the tests. The package has another name than its folder.</description>
  <export><build_type>ament_cmake</build_type></export>
</package>
'''

GRIPPER = '''<?xml version="1.0"?>
<!-- Jaws of 1 x 2 x 4 inches from a COLLADA file in inches, the right one mirrored, in a package of ROS 2 that has another name
     than its folder. The jaws meet in some poses. -->
<robot name="gripper">
  <link name="palm">
    <inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><geometry><box size="0.03 0.2 0.03"/></geometry></collision>
  </link>
  <link name="left">
    <inertial><mass value="0.2"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
    <collision><geometry><mesh filename="package://gripper_description/meshes/jaw.dae"/></geometry></collision>
  </link>
  <link name="right">
    <inertial><mass value="0.2"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
    <collision><geometry><mesh filename="package://gripper_description/meshes/jaw.dae" scale="1 -1 1"/></geometry></collision>
  </link>
  <joint name="left_slide" type="prismatic">
    <parent link="palm"/><child link="left"/>
    <origin xyz="0 0.06 0.07"/><axis xyz="0 1 0"/><limit lower="-0.06" upper="0.02" effort="10" velocity="1"/>
  </joint>
  <joint name="right_turn" type="revolute">
    <parent link="palm"/><child link="right"/>
    <origin xyz="0 -0.06 0.07"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/>
  </joint>
</robot>
'''


def collada_in_inches(points, triangles):
    numbers = " ".join(f"{x:g}" for p in points for x in p)
    corners = " ".join(str(i) for t in triangles for i in t)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis></asset>
  <library_geometries><geometry id="jaw" name="jaw"><mesh>
    <source id="jaw-points">
      <float_array id="jaw-array" count="24">{numbers}</float_array>
      <technique_common><accessor source="#jaw-array" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
    </source>
    <vertices id="jaw-vertices"><input semantic="POSITION" source="#jaw-points"/></vertices>
    <triangles count="12"><input semantic="VERTEX" source="#jaw-vertices" offset="0"/><p>{corners}</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene"><node id="node"><instance_geometry url="#jaw"/></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""


def robot():
    def link(name, size, low):
        points, faces = box(size, low)
        return f"arm_description/meshes/{name}.stl", stl_binary(points, triangles_of(faces))
    out = dict([link("base", (0.2, 0.2, 0.1), (-0.1, -0.1, 0.0)), link("upper", (0.06, 0.06, 0.3), (-0.03, -0.03, 0.0)),
                link("fore", (0.04, 0.04, 0.25), (-0.02, -0.02, 0.0))])
    shape = '<geometry><mesh filename="package://arm_description/meshes/{}.stl"/></geometry>'
    links = "".join(
        f'  <link name="{name}">\n    <inertial><mass value="{mass}"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>\n'
        f"    <collision>{shape.format(name)}</collision>\n  </link>\n" for name, mass in (("base", 4), ("upper", 2), ("fore", 1)))
    joints = "".join(
        f'  <joint name="{child}_joint" type="revolute">\n    <parent link="{parent}"/><child link="{child}"/>\n    <origin xyz="0 0 {z}"/>\n'
        f'    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="10" velocity="1"/>\n  </joint>\n'
        for parent, child, z in (("base", "upper", 0.1), ("upper", "fore", 0.3)))
    tool = ('  <link name="tool">\n    <collision><origin xyz="0 0 0.03"/><geometry><cylinder radius="0.03" length="0.06"/></geometry></collision>\n  </link>\n'
            '  <joint name="tool_joint" type="fixed">\n    <parent link="fore"/><child link="tool"/>\n    <origin xyz="0 0 0.25"/>\n  </joint>\n')
    out["arm_description/arm.urdf"] = f'<?xml version="1.0"?>\n<robot name="arm">\n{links}{joints}{tool}</robot>\n'
    out["arm_description/folding.urdf"] = FOLDING
    out["arm_description/nested.urdf"] = NESTED
    out["arm_description/shelled.urdf"] = SHELLED
    points, faces = box((0.2, 0.2, 0.2), (-0.1, -0.1, -0.1))
    out["arm_description/meshes/shell.stl"] = stl_binary(points, triangles_of(faces[1:]))
    points, faces = box((1, 2, 4), (-0.5, -1, -2))
    out["gripper_of_ros2/package.xml"] = GRIPPER_PACKAGE
    out["gripper_of_ros2/meshes/jaw.dae"] = collada_in_inches(points, triangles_of(faces))
    out["gripper_of_ros2/urdf/gripper.urdf"] = GRIPPER
    out["robots.txt"] = ("# What tests/tools/robots/table.py pads in every run: name, file, options of pad.\n"
                         "folding   arm_description/folding.urdf\n"
                         "nested    arm_description/nested.urdf\n"
                         "shelled   arm_description/shelled.urdf\n"
                         "gripper   gripper_of_ros2/urdf/gripper.urdf\n")
    return out


def main():
    made = {}
    for folder, files in (("formats", formats()), ("hard", hard()), ("malformed", malformed()), ("robot", robot())):
        for name, content in files.items():
            made[HERE / folder / name] = content.encode() if isinstance(content, str) else content
    if "--check" not in sys.argv:
        for path, content in made.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        points, faces = nut()
        print(f"{len(made)} files, {sum(map(len, made.values()))} bytes; the nut has {len(triangles_of(faces))} triangles and "
              f"{volume(points, triangles_of(faces)):.6f} mm3")
        return 0
    wrong = [f"{path.relative_to(HERE)} is not what make_data.py writes: run it" for path, content in made.items()
             if not path.exists() or path.read_bytes() != content]
    stood = {p for folder in ("formats", "hard", "malformed", "robot") for p in (HERE / folder).rglob("*") if p.is_file()}
    wrong += [f"{path.relative_to(HERE)} is not written by make_data.py: add it there, or remove it" for path in sorted(stood - set(made))]
    print("\n".join(wrong) or f"{len(made)} files are as make_data.py writes them")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
