from os import PathLike
from typing import Any, Literal, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
Length = Union[float, str]  # in the mesh's unit, or a share of the bounding box's diagonal as "1%"
Repair = Literal["auto", "never", "wrap"]

class Error(RuntimeError): ...

class Cluster:
    name: str
    unit: str
    family: int
    mask: int
    @property
    def centers(self) -> NDArray[np.float64]: ...  # (N, 3), a read-only view
    @property
    def radii(self) -> NDArray[np.float64]: ...  # (N,), a read-only view
    @property
    def triangle(self) -> NDArray[np.int64]: ...  # (N,), of the remeshed surface
    @property
    def volume(self) -> float: ...  # of the body, length^3
    @property
    def volume_union(self) -> float: ...  # of the spheres, overlaps once
    @property
    def center_of_mass(self) -> NDArray[np.float64]: ...  # (3,)
    @property
    def inertia(self) -> NDArray[np.float64]: ...  # (3, 3), density 1, about the centre of mass, length^5
    @property
    def accuracy(self) -> dict[str, Any]: ...
    @property
    def settings(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...
    def to_json(self) -> str: ...
    def save(self, path: Union[str, PathLike[str]], format: str = "", density: float = 1000.0) -> None: ...

class DeviceArray:
    @property
    def __cuda_array_interface__(self) -> dict[str, Any]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    def __dlpack__(
        self,
        *,
        stream: Optional[int] = None,
        max_version: Optional[tuple[int, int]] = None,
        dl_device: Optional[tuple[int, int]] = None,
        copy: Optional[bool] = None,
    ) -> Any: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...

class Contacts:
    @property
    def pairs(self) -> Union[NDArray[np.uint32], DeviceArray]: ...  # (M, 2), i < j
    @property
    def normals(self) -> Union[NDArray[np.floating[Any]], DeviceArray]: ...  # (M, 3), unit, from i to j
    @property
    def depth(self) -> Union[NDArray[np.floating[Any]], DeviceArray]: ...  # (M,), r_i + r_j - distance
    @property
    def points_i(self) -> Union[NDArray[np.floating[Any]], DeviceArray]: ...  # (M, 3), deepest point of i in j
    @property
    def points_j(self) -> Union[NDArray[np.floating[Any]], DeviceArray]: ...
    @property
    def backend(self) -> str: ...
    @property
    def hash(self) -> int: ...
    def __len__(self) -> int: ...

def load(path: Union[str, PathLike[str]], part: str = "") -> Cluster: ...
def pad(
    vertices: ArrayLike,
    faces: ArrayLike,
    depth: Optional[float] = None,
    tolerance: Optional[Length] = None,
    edge_length: Optional[Length] = None,
    max_spheres: int = 0,
    sharp_angle: float = 40.0,
    repair: Repair = "auto",
    family: int = 0,
    mask: int = 0,
    unit: str = "",
    name: str = "mesh",
) -> Cluster: ...
def pad_file(
    path: Union[str, PathLike[str]],
    depth: Optional[float] = None,
    tolerance: Optional[Length] = None,
    edge_length: Optional[Length] = None,
    max_spheres: int = 0,
    sharp_angle: float = 40.0,
    repair: Repair = "auto",
    family: int = 0,
    mask: int = 0,
    unit: str = "",
    scale: float = 1.0,
) -> Cluster: ...
def detect(
    centers: Any,
    radii: Any,
    family: Any = None,
    mask: Any = None,
    *,
    width: Literal["pairs", "normals", "points"] = "normals",
    backend: Literal["auto", "omp", "cuda"] = "auto",
    precision: Literal["exact", "fast"] = "exact",
    threads: int = 0,
    device: int = 0,
) -> Contacts: ...
