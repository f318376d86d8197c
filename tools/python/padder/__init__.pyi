# SPDX-License-Identifier: GPL-3.0-or-later
from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
Path = str | PathLike[str]
Length = float | str  # in the mesh's unit, or a share of the bounding box's diagonal as "1%"
Repair = Literal["auto", "union", "fill", "sheet", "never", "wrap"]
Width = Literal["pairs", "normals", "points"]
Backend = Literal["auto", "omp", "cuda"]
Precision = Literal["exact", "fast"]
Answer = Literal["any", "count", "distance"]
NO_CONTACT: int  # in Contacts.history: the list of the call before does not have the pair
EVERY_WORLD: int  # the world whose spheres meet those of all worlds
Doubles = NDArray[np.float64]
Integers = NDArray[np.uint32]
Reals = NDArray[np.floating[Any]] | DeviceArray  # float32 where centres and radii are, else float64

class Error(RuntimeError): ...

class Cluster:
    name: str
    unit: str
    family: int
    mask: int
    @property
    def centers(self) -> Doubles: ...  # (N, 3), a read-only view
    @property
    def radii(self) -> Doubles: ...  # (N,), a read-only view
    @property
    def triangle(self) -> NDArray[np.int64]: ...  # (N,), of the surface that the spheres were made on
    @property
    def volume(self) -> float: ...  # of the body, length^3
    @property
    def mass_of(self) -> str: ...  # whose body that is: "input", "filled" (holes) or "wrap" (around the mesh)
    @property
    def volume_union(self) -> float: ...  # of the spheres, overlaps once
    @property
    def center_of_mass(self) -> Doubles: ...  # (3,)
    @property
    def inertia(self) -> Doubles: ...  # (3, 3), density 1, about the centre of mass, length^5
    @property
    def accuracy(self) -> dict[str, Any]: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...
    def to_json(self) -> str: ...
    def save(self, path: Path, format: str = "", density: float = 1000.0) -> None: ...
    def page(self, vertices: Any = None, faces: Any = None, colour: str = "family") -> str: ...  # one HTML page, with its data
    def _repr_html_(self) -> str: ...  # the page, and a table

class Robot:
    @property
    def name(self) -> str: ...
    @property
    def links(self) -> dict[str, Cluster]: ...  # those with spheres
    @property
    def apart(self) -> list[tuple[str, str, str]]: ...  # links that need no test, and why: a word of MoveIt's
    @property
    def notes(self) -> list[str]: ...
    def __len__(self) -> int: ...  # spheres in all
    def save(self, path: Path, format: str = "", density: float = 1000.0) -> None: ...

class DeviceArray:
    @property
    def __cuda_array_interface__(self) -> dict[str, Any]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    def __dlpack__(
        self, *, stream: int | None = None, max_version: tuple[int, int] | None = None,
        dl_device: tuple[int, int] | None = None, copy: bool | None = None,
    ) -> Any: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...

# Shapes (in their own frames) put at places. All members but `shape` may be written to: see Detector.detect.
class Bodies:
    def __init__(
        self,
        shapes: Sequence[Cluster | tuple[ArrayLike, ArrayLike]],  # or centers (N, 3) and radii, (N,) or one number
        poses: ArrayLike,  # (B, 12): the rotation row by row, then the position
        shape: ArrayLike | None = None,  # (B,), which shape each takes; None: the first
        *,
        family: ArrayLike | None = None,  # (B,); None: those of the body's Cluster, 0 for arrays
        mask: ArrayLike | None = None,
        is_static: ArrayLike | None = None,  # (B,), what stands still: two static ones are no contact
        world: ArrayLike | None = None,  # (B,); only bodies of one world meet, and those of EVERY_WORLD meet all
    ) -> None: ...
    @property
    def poses(self) -> Doubles: ...  # (B, 12)
    @property
    def shape(self) -> Integers: ...  # (B,), a read-only view
    @property
    def family(self) -> Integers: ...
    @property
    def mask(self) -> Integers: ...
    @property
    def is_static(self) -> NDArray[np.bool_]: ...
    @property
    def world(self) -> Integers: ...
    def with_lod(
        self,
        lod: str = "auto",  # or "0", the finest, "1", …
        *,
        centers: ArrayLike | None = None,  # loose spheres that can touch the bodies
        radii: ArrayLike | None = None,
        smallest: float | None = None,  # given: everything moves
        margin: float = 0.0,
        share: float = 0.1,  # of the smallest thing that can touch a body
    ) -> Bodies: ...
    @property
    def lod(self) -> Integers: ...  # (B,), what with_lod() took
    @property
    def lod_error(self) -> float: ...
    def __len__(self) -> int: ...

# Arrays are views; those of a Detector's contacts are in its way until they are deleted.
class Contacts:
    @property
    def pairs(self) -> Integers | DeviceArray: ...  # (M, 2), i < j: spheres of bodies[0], bodies[1], ..., then of centers
    @property
    def normals(self) -> Reals: ...  # (M, 3), unit, from i to j
    @property
    def depth(self) -> Reals: ...  # (M,), r_i + r_j - distance; negative for pairs within the margin that do not touch
    @property
    def points_i(self) -> Reals: ...  # (M, 3), deepest point of i in j
    @property
    def points_j(self) -> Reals: ...
    @property
    def history(self) -> Integers | DeviceArray: ...  # (M,), index of the pair in the list of the call before, or NO_CONTACT
    @property
    def backend(self) -> str: ...
    @property
    def hash(self) -> int: ...
    def __len__(self) -> int: ...

# An answer for each world. Arrays are views, as those of Contacts; one that was not asked for raises AttributeError.
class WorldAnswers:
    @property
    def any(self) -> NDArray[np.bool_] | DeviceArray: ...  # (W,), is there a contact?
    @property
    def count(self) -> NDArray[np.uint64] | DeviceArray: ...  # (W,), how many are there?
    @property
    def distance(self) -> Doubles | DeviceArray: ...  # (W,), the smallest signed distance; inf if there is no contact
    @property
    def pair(self) -> Integers | DeviceArray: ...  # (W, 2), the spheres with that distance; 4294967295 if there is no contact
    @property
    def backend(self) -> str: ...
    def __len__(self) -> int: ...

# Keeps its memory, and what stands still, from call to call.
class Detector:
    def __init__(
        self, *, width: Width = "normals", backend: Backend = "auto", precision: Precision = "exact",
        threads: int = 0, device: int = 0,
        history: bool = False,  # contacts have a history
    ) -> None: ...
    @property
    def backend(self) -> str: ...
    def detect(
        self, centers: Any = None, radii: Any = None, family: Any = None, mask: Any = None, *,
        is_static: Any = None, world: Any = None, bodies: Bodies | None = None,
        revision: int = 0,  # as in the call before: of `bodies` only poses of `moved` are read, of static spheres nothing
        moved: ArrayLike | None = None,  # (M,), which bodies have another pose than in the call before
        poses: Any = None,  # (B, 12) float64 of all bodies, on host or device, instead of those in `bodies`
        margin: float = 0.0,  # pairs whose gap is at most this are contacts
    ) -> Contacts: ...
    def worlds(
        self, count: int, answer: Answer = "any",  # for the worlds 0 to count - 1
        centers: Any = None, radii: Any = None, family: Any = None, mask: Any = None, *,
        is_static: Any = None, world: Any = None, bodies: Bodies | None = None, revision: int = 0,
        moved: ArrayLike | None = None, poses: Any = None, margin: float = 0.0,
    ) -> WorldAnswers: ...

def load(path: Path, part: str = "") -> Cluster: ...
def pad(
    vertices: Any, faces: ArrayLike | None = None,  # two arrays, or one object that has .vertices and .faces
    depth: float | None = None, tolerance: Length | None = None,
    edge_length: Length | None = None, max_spheres: int = 0, sharp_angle: float = 40.0, repair: Repair = "auto",
    family: int = 0, mask: int = 0, unit: str = "", name: str = "mesh",
    protrusion: Length | None = None, gap: Length | None = None,
    # by name only: balance: Literal["none", "volume", "mean"], effort: int, smooth: float, lod: Sequence[Length],
    # min_radius, max_radius, reach, thickness: Length, force: bool
    **more: Any,
) -> Cluster: ...
def pad_file(
    path: Path, depth: float | None = None, tolerance: Length | None = None,
    edge_length: Length | None = None, max_spheres: int = 0, sharp_angle: float = 40.0, repair: Repair = "auto",
    family: int = 0, mask: int = 0, unit: str = "", scale: float = 1.0,
    protrusion: Length | None = None, gap: Length | None = None,
    # by name only: balance: Literal["none", "volume", "mean"], effort: int, smooth: float, lod: Sequence[Length],
    # min_radius, max_radius, reach, thickness: Length, force: bool
    **more: Any,
) -> Cluster: ...
def pad_urdf(
    path: Path, depth: float | None = None, tolerance: Length | None = None, edge_length: Length | None = None,
    max_spheres: int = 0, robot_spheres: int = 0, visual: bool = False, package_path: Sequence[Path] = (),
    poses: int = 10000, repair: Repair = "auto", **more: Any,  # those of pad that are given by their names
) -> Robot: ...
def detect(
    centers: Any = None, radii: Any = None, family: Any = None, mask: Any = None, *,
    is_static: Any = None, world: Any = None, bodies: Bodies | None = None, margin: float = 0.0,
    width: Width = "normals", backend: Backend = "auto", precision: Precision = "exact", threads: int = 0,
    device: int = 0,
) -> Contacts: ...
def worlds(
    count: int, answer: Answer = "any", centers: Any = None, radii: Any = None, family: Any = None,
    mask: Any = None, *, is_static: Any = None, world: Any = None, bodies: Bodies | None = None,
    margin: float = 0.0, backend: Backend = "auto", threads: int = 0, device: int = 0,
) -> WorldAnswers: ...
