# SPDX-License-Identifier: GPL-3.0-or-later
"""padder.detect on arrays that lie on a GPU, through each of the doors they come and go by. Skipped without one.

Device memory comes from the driver itself (libcuda), so that neither CuPy nor PyTorch is needed; where PyTorch is at hand
its tensors go the same ways.
"""
import ctypes

import numpy as np
import padder
import pytest

from test_padder import heap, pairs, scene, wanted


class Cuda:
    """The driver's primary context, which the module's own runtime uses too."""

    def __init__(self):
        self.lib = ctypes.CDLL("libcuda.so.1")
        self("cuInit", 0)
        context = ctypes.c_void_p()
        self("cuDevicePrimaryCtxRetain", ctypes.byref(context), 0)
        self("cuCtxSetCurrent", context)

    def __call__(self, name, *args):
        code = getattr(self.lib, name)(*args)
        if code:
            raise OSError(f"{name} gives {code}")


class OnDevice:
    """A copy of a NumPy array on the device, with __cuda_array_interface__ and, when asked for, DLPack alone."""

    def __init__(self, cuda, array):
        array = np.ascontiguousarray(array)
        at = ctypes.c_uint64()
        cuda("cuMemAlloc_v2", ctypes.byref(at), ctypes.c_size_t(max(array.nbytes, 1)))
        cuda("cuMemcpyHtoD_v2", at, ctypes.c_void_p(array.ctypes.data), ctypes.c_size_t(array.nbytes))
        self.cuda, self.at = cuda, at
        self.__cuda_array_interface__ = {"version": 3, "typestr": array.dtype.str, "shape": array.shape, "strides": None,
                                         "data": (at.value, False)}

    def __del__(self):
        self.cuda("cuMemFree_v2", self.at)


def back(cuda, array):
    """What a DeviceArray shows, copied to the host by what it says of itself."""
    d = array.__cuda_array_interface__
    item = np.dtype(d["typestr"])
    span = 1 + sum((n - 1) * (s // item.itemsize) for n, s in zip(d["shape"], d["strides"])) if min(d["shape"]) else 0
    flat = np.empty(span, item)
    if span:
        cuda("cuMemcpyDtoH_v2", ctypes.c_void_p(flat.ctypes.data), ctypes.c_uint64(d["data"][0]), ctypes.c_size_t(flat.nbytes))
    return np.lib.stride_tricks.as_strided(flat, d["shape"], d["strides"])


@pytest.fixture(scope="module")
def cuda():
    try:
        cuda = Cuda()
        padder.detect(np.zeros((1, 3)), 1.0, backend="cuda")
    except (OSError, padder.Error) as e:
        pytest.skip(f"no GPU for this module: {e}")
    return cuda


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_contacts_of_device_arrays_stay_there_and_are_those_of_the_host(cuda, kind):
    centers, radii, family, mask = scene()
    centers, radii = centers.astype(kind), radii.astype(kind)
    host = padder.detect(centers, radii, family, mask, width="points", backend="omp")
    device = padder.detect(*(OnDevice(cuda, a) for a in (centers, radii, family, mask)), width="points")
    assert device.backend == "cuda" and isinstance(device.pairs, padder.DeviceArray)
    assert len(device) == len(host) > 100 and device.hash == host.hash
    found = back(cuda, device.pairs)
    assert found.dtype == np.uint32 and sorted(map(tuple, found.tolist())) == pairs(host)
    here, there = (np.lexsort((p[:, 1], p[:, 0])) for p in (np.asarray(host.pairs), found))
    for name in ("normals", "depth", "points_i", "points_j"):
        a, b = np.asarray(getattr(host, name))[here], back(cuda, getattr(device, name))[there]
        assert b.dtype == kind and a.shape == b.shape == getattr(device, name).shape
        # In double to the last bit; a float record is made in float on a GPU.
        np.testing.assert_allclose(b, a, rtol=0, atol=0 if kind == np.float64 else 4e-7 * np.abs(a).max(), err_msg=name)


def test_rows_of_four_and_one_radius_for_all(cuda):
    centers, _, _, _ = scene()
    rows = OnDevice(cuda, np.hstack([centers, np.zeros((len(centers), 1))]))
    shown = dict(rows.__cuda_array_interface__, shape=centers.shape, strides=(32, 8))
    rows.__cuda_array_interface__ = shown
    radius = OnDevice(cuda, np.full(len(centers), 0.6))
    one = padder.detect(rows, radius)
    assert one.hash == padder.detect(centers, 0.6, backend="omp").hash


def test_what_a_device_array_is_not_is_said(cuda):
    centers, radii, family, _ = scene()
    with pytest.raises(TypeError, match="radii"):
        padder.detect(OnDevice(cuda, centers), OnDevice(cuda, radii.astype(np.float16)))
    with pytest.raises(TypeError, match="family"):
        padder.detect(OnDevice(cuda, centers), OnDevice(cuda, radii), OnDevice(cuda, family.astype(np.int64)))
    with pytest.raises(ValueError, match="one place"):
        padder.detect(OnDevice(cuda, centers), radii)


def test_poses_on_the_device(cuda):
    shapes, poses, shape, is_static = heap()
    bodies, detector = padder.Bodies(shapes, poses, shape, is_static=is_static), padder.Detector()
    assert detector.backend == "cuda"
    for step in range(4):
        contacts = detector.detect(bodies=bodies, revision=1, poses=OnDevice(cuda, poses))
        found = sorted(map(tuple, back(cuda, contacts.pairs).tolist()))
        assert found == wanted(shapes, poses, shape, is_static)
        poses[~is_static, 9:] += 0.1  # what stands still is read once
    with pytest.raises(padder.Error, match="device memory"):
        padder.Detector(backend="omp").detect(bodies=bodies, poses=OnDevice(cuda, poses))
    with pytest.raises(TypeError, match="poses"):
        detector.detect(bodies=bodies, poses=OnDevice(cuda, poses.astype(np.float32)))


class DlTensor(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("kind", ctypes.c_int32), ("device", ctypes.c_int32), ("ndim", ctypes.c_int32),
                ("code", ctypes.c_uint8), ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16),
                ("shape", ctypes.POINTER(ctypes.c_int64)), ("strides", ctypes.POINTER(ctypes.c_int64)), ("offset", ctypes.c_uint64)]


class Passed:
    """Passes a DeviceArray on as something that has DLPack and nothing else."""

    def __init__(self, array):
        self.__dlpack__, self.__dlpack_device__ = array.__dlpack__, array.__dlpack_device__


def test_dlpack_shows_the_same_memory_and_comes_back_in(cuda):
    centers, radii, _, _ = scene()
    device = padder.detect(OnDevice(cuda, centers), OnDevice(cuda, radii))
    n = len(device)
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    for array, code, bits, shape in ((device.pairs, 1, 32, [n, 2]), (device.normals, 2, 64, [n, 3]), (device.depth, 2, 64, [n])):
        assert array.__dlpack_device__() == (2, 0)
        capsule = array.__dlpack__(stream=None)
        t = DlTensor.from_address(pointer(capsule, b"dltensor"))
        about = array.__cuda_array_interface__
        assert (t.data + t.offset, t.kind, t.device, t.code, t.bits) == (about["data"][0], 2, 0, code, bits)
        assert t.shape[:t.ndim] == shape
        assert [s * bits // 8 for s in t.strides[:t.ndim]] == list(about["strides"])
    # Normals as centres: in by DLPack, strides and all. The contacts they come from live on by their views alone.
    normals, depth = device.normals, device.depth
    del device
    copied = back(cuda, normals), back(cuda, depth)
    again = padder.detect(Passed(normals), Passed(depth))
    assert again.backend == "cuda" and again.hash == padder.detect(*copied, backend="omp").hash


def test_dlpack_neither_copies_nor_moves(cuda):
    centers, radii, _, _ = scene()
    depth = padder.detect(OnDevice(cuda, centers), OnDevice(cuda, radii)).depth
    depth.__dlpack__(max_version=(1, 0), dl_device=(2, 0), copy=False)
    for what in ({"copy": True}, {"dl_device": (1, 0)}):
        with pytest.raises(BufferError):
            depth.__dlpack__(**what)


def test_pytorch_gives_and_takes_tensors(cuda):
    torch = pytest.importorskip("torch")
    centers, radii, family, _ = scene()
    host = padder.detect(centers, radii, family, backend="omp")
    device = padder.detect(*(torch.from_numpy(a).cuda() for a in (centers, radii, family)))
    assert device.hash == host.hash
    for take in (torch.from_dlpack, lambda a: torch.as_tensor(a, device="cuda")):
        depth, found = take(device.depth), take(device.pairs)
        assert depth.is_cuda and depth.dtype == torch.float64
        assert depth.data_ptr() == device.depth.__cuda_array_interface__["data"][0]  # no copy
        assert sorted(depth.cpu().tolist()) == sorted(np.asarray(host.depth).tolist())
        assert sorted(map(tuple, found.cpu().numpy().tolist())) == pairs(host)


def test_cupy_gives_and_takes_arrays(cuda):
    cupy = pytest.importorskip("cupy")
    centers, radii, family, _ = scene()
    host = padder.detect(centers, radii, family, backend="omp")
    device = padder.detect(*(cupy.asarray(a) for a in (centers, radii, family)))
    assert device.hash == host.hash
    for take in (cupy.from_dlpack, cupy.asarray):
        assert take(device.pairs).data.ptr == device.pairs.__cuda_array_interface__["data"][0]
        assert sorted(map(tuple, cupy.asnumpy(take(device.pairs)).tolist())) == pairs(host)
        np.testing.assert_array_equal(np.sort(cupy.asnumpy(take(device.depth))), np.sort(np.asarray(host.depth)))
