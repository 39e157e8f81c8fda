"""The only file that touches Embree: building a scene, closest hits, any hits.

Embree 4 comes as a shared library inside embreex's wheel. It is loaded once for the process, set
up through ctypes, and its ray queries are declared to Numba as external functions, so that compiled
kernels call them without a detour and can still be cached on disk. Rays go in packets of sixteen,
Embree's structure of arrays: twelve rows of sixteen float32, which are named below.

Two triangles that share an edge must agree on which side of it a ray goes, or rays slip through
between them. Embree's robust tests take an edge alike for both; its usual ones do not, but they
place a hit in its triangle ten times more exactly. Any hits are therefore the robust ones', and
closest hits the usual ones' unless the robust ones meet something before. A ray that passes a
vertex within the rounding of float32, 2⁻²¹ of its distance, may slip past all of its triangles
even so.
"""

import ctypes
import importlib.util
import weakref
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numpy as np
from numba import types
from numpy.typing import NDArray

from samplers.compiled import address_of, inner, kernel
from samplers.errors import EnvlightError

LANES = 16
"""Rays per packet. Embree splits packets itself on processors that are narrower."""
ORG_X, ORG_Y, ORG_Z, T_NEAR, DIR_X, DIR_Y, DIR_Z, TIME, T_FAR, MASK, RAY_ID, FLAGS = range(12)
RAY_ROWS = 12
HIT_U, HIT_V, HIT_TRIANGLE, HIT_GEOMETRY = 15, 16, 17, 18
RAY_HIT_ROWS = 21
AGAIN, USUAL_T, USUAL_U, USUAL_V, USUAL_TRIANGLE = range(RAY_HIT_ROWS, RAY_HIT_ROWS + 5)
HIT_PACKET_ROWS = RAY_HIT_ROWS + 5
"""After Embree's rows: lanes to trace again, and what the usual tests found."""
NO_HIT = -1
NEARER = np.float32(1.0 - 2.0**-16)
"""Of a distance: what is found before that is nearer, not the same rounded in another way."""

_COHERENT = 1 << 16
_BUILD_HIGH = 2
_ROBUST = 1 << 2
_TRIANGLES = 0
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003


def _library_path() -> Path:
    spec = importlib.util.find_spec("embreex")
    if spec is None or spec.origin is None:
        raise EnvlightError("the package embreex is not installed; install it with pip")
    package = Path(spec.origin).parent
    for folder in (package.parent / "embreex.libs", package / ".dylibs", package):
        for pattern in ("libembree4*", "embree4*.dll"):
            found = sorted(folder.glob(pattern))
            if found:
                return found[0]
    raise EnvlightError(
        f"Embree's shared library was not found beside {package}; reinstall embreex from its wheel"
    )


def _load() -> ctypes.CDLL:
    path = _library_path()
    for dependency in sorted(path.parent.glob("*tbb*")):
        ctypes.CDLL(str(dependency), mode=ctypes.RTLD_GLOBAL)
    llvmlite.binding.load_library_permanently(str(path))
    return ctypes.CDLL(str(path))


_library = _load()
_pointer = types.intp
_intersect: Any = types.ExternalFunction(
    "rtcIntersect16", types.void(_pointer, _pointer, _pointer, _pointer)
)
_occluded: Any = types.ExternalFunction(
    "rtcOccluded16", types.void(_pointer, _pointer, _pointer, _pointer)
)


def _c_function(name: str, result, *arguments):
    function = getattr(_library, name)
    function.restype = result
    function.argtypes = arguments
    return function


_p, _u, _i, _z = ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_size_t
_new_device = _c_function("rtcNewDevice", _p, ctypes.c_char_p)
_device_error = _c_function("rtcGetDeviceError", _i, _p)
_new_scene = _c_function("rtcNewScene", _p, _p)
_set_flags = _c_function("rtcSetSceneFlags", None, _p, _i)
_set_quality = _c_function("rtcSetSceneBuildQuality", None, _p, _i)
_new_geometry = _c_function("rtcNewGeometry", _p, _p, _i)
_set_buffer = _c_function("rtcSetSharedGeometryBuffer", None, _p, _i, _u, _i, _p, _z, _z, _z)
_commit_geometry = _c_function("rtcCommitGeometry", None, _p)
_attach_geometry = _c_function("rtcAttachGeometry", _u, _p, _p)
_release_geometry = _c_function("rtcReleaseGeometry", None, _p)
_commit_scene = _c_function("rtcCommitScene", None, _p)
_release_scene = _c_function("rtcReleaseScene", None, _p)


@cache
def _device() -> int:
    device = _new_device(None)
    if not device:
        raise EnvlightError(f"Embree could not start a device (error {_device_error(None)})")
    return device


class EmbreeScene:
    """Triangles in two of Embree's hierarchies, whose handles go to the compiled queries below.

    handle : of the one with robust tests, which any hits are asked of
    usual : of the other one
    vertex : (n, 3) float32, triangle : (m, 3) int32
    """

    def __init__(self, vertex: NDArray[np.float32], triangle: NDArray[np.int32]) -> None:
        # Embree reads vertices sixteen bytes at a time, so one more must be readable.
        self._vertex = np.zeros((len(vertex) + 1, 3), np.float32)
        self._vertex[:-1] = vertex
        self._triangle = np.ascontiguousarray(triangle, np.uint32)
        device = _device()
        geometry = _new_geometry(device, _TRIANGLES)
        _set_buffer(
            geometry, _VERTEX_BUFFER, 0, _FLOAT3, self._vertex.ctypes.data, 0, 12, len(vertex)
        )
        _set_buffer(
            geometry, _INDEX_BUFFER, 0, _UINT3, self._triangle.ctypes.data, 0, 12, len(triangle)
        )
        _commit_geometry(geometry)
        self.handle = self._hierarchy(geometry, _ROBUST)
        self.usual = self._hierarchy(geometry, 0)
        _release_geometry(geometry)
        error = _device_error(device)
        if error:
            raise EnvlightError(f"Embree could not build the scene (error {error})")

    def _hierarchy(self, geometry: int, flags: int) -> int:
        handle: int = _new_scene(_device())
        weakref.finalize(self, _release_scene, handle)
        _set_flags(handle, flags)
        _set_quality(handle, _BUILD_HIGH)
        _attach_geometry(handle, geometry)
        _commit_scene(handle)
        return handle


@kernel
def aligned_rows(rows):
    """A (rows, 16) float32 array whose address is a multiple of 64 bytes."""
    memory = np.empty(rows * LANES + 16, np.float32)
    start = (-(memory.ctypes.data // 4)) % 16
    return memory[start : start + rows * LANES].reshape((rows, LANES))


@kernel
def new_hit_packet():
    """A packet of rays with room for their hits, (26, 16) float32; origins and directions are 0."""
    packet = aligned_rows(HIT_PACKET_ROWS)
    packet[:] = 0.0
    packet.view(np.uint32)[MASK, :] = np.uint32(0xFFFFFFFF)
    return packet


@kernel
def new_valid():
    """The lanes to trace, (16,) int32: −1 where a ray is, 0 where none is."""
    return aligned_rows(1).view(np.int32)[0]


@kernel
def query_arguments(coherent):
    """Embree's RTCOccludedArguments, which are laid out like its RTCIntersectArguments.

    coherent : whether the rays of a packet start and go alike, so that they are best traced
        together; others are traced one by one
    """
    arguments = np.zeros(8, np.uint32)
    arguments[0] = _COHERENT if coherent else 0
    arguments[1] = 0xFFFFFFFF
    return arguments


@inner
def occluded(scene, valid, packet, arguments):
    """Any hit for the valid lanes: afterwards row T_FAR is −inf where one was found.

    packet : one-dimensional, whose first twelve rows of sixteen are the rays
    """
    for k in range(LANES):
        packet[T_FAR * LANES + k] = np.inf
    _occluded(address_of(valid), scene, address_of(packet), address_of(arguments))


@inner
def _find_again(valid, packet):
    """Keep what the usual tests found and mark the lanes that met something before it."""
    again, marked = packet.view(np.int32)[AGAIN], 0
    for k in range(LANES):
        nearer = (valid[k] != 0) & (packet[T_FAR, k] == -np.inf)
        again[k] = -1 if nearer else 0
        marked += 1 if nearer else 0
        packet[T_FAR, k] = np.inf if nearer else packet[USUAL_T, k]
    return marked


@inner
def intersect(scene, usual, valid, packet, arguments):
    """Closest hits for the valid lanes, written into rows HIT_U, HIT_V, HIT_TRIANGLE (as int32).

    Those of the usual tests, where the robust ones meet nothing before them, else of the robust.

    scene, usual : `handle` and `usual` of an `EmbreeScene`
    """
    hit = packet.view(np.int32)
    packet[T_FAR, :] = np.inf
    hit[HIT_TRIANGLE:RAY_HIT_ROWS, :] = NO_HIT
    _intersect(address_of(valid), usual, address_of(packet), address_of(arguments))
    for k in range(LANES):
        packet[USUAL_T, k] = packet[T_FAR, k]
        packet[T_FAR, k] *= NEARER
    _occluded(address_of(valid), scene, address_of(packet), address_of(arguments))
    if _find_again(valid, packet) == 0:
        return
    for k in range(LANES):
        packet[USUAL_U, k], packet[USUAL_V, k] = packet[HIT_U, k], packet[HIT_V, k]
        hit[USUAL_TRIANGLE, k] = hit[HIT_TRIANGLE, k]
    again = hit[AGAIN]
    _intersect(address_of(again), scene, address_of(packet), address_of(arguments))
    for k in range(LANES):
        if hit[HIT_TRIANGLE, k] == hit[USUAL_TRIANGLE, k]:
            packet[HIT_U, k], packet[HIT_V, k] = packet[USUAL_U, k], packet[USUAL_V, k]
            packet[T_FAR, k] = packet[USUAL_T, k]
