# SPDX-License-Identifier: Apache-2.0
"""Arrays to and from Python by protocols alone: with NumPy of any layout, with others, and without it."""

import array
import ctypes
import struct
import subprocess
import sys

import numpy as np
import pytest

import sonocase

# DLPack's structures, from its specification.


class Tensor(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("device", ctypes.c_int32), ("device_id", ctypes.c_int32),
                ("ndim", ctypes.c_int32), ("code", ctypes.c_uint8), ("bits", ctypes.c_uint8),
                ("lanes", ctypes.c_uint16), ("shape", ctypes.POINTER(ctypes.c_int64)),
                ("strides", ctypes.POINTER(ctypes.c_int64)), ("byte_offset", ctypes.c_uint64)]


DELETER = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class Managed(ctypes.Structure):
    _fields_ = [("tensor", Tensor), ("owner", ctypes.c_void_p), ("deleter", DELETER)]


class Versioned(ctypes.Structure):
    _fields_ = [("major", ctypes.c_uint32), ("minor", ctypes.c_uint32), ("owner", ctypes.c_void_p),
                ("deleter", DELETER), ("flags", ctypes.c_uint64), ("tensor", Tensor)]


_new = ctypes.pythonapi.PyCapsule_New
_new.restype, _new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
_pointer = ctypes.pythonapi.PyCapsule_GetPointer
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
_rename = ctypes.pythonapi.PyCapsule_SetName
_rename.argtypes = [ctypes.py_object, ctypes.c_char_p]
_CODES = {"i": 0, "u": 1, "f": 2, "c": 5, "b": 6}


class OfBuffer(ctypes.Array):
    """Offers the buffer protocol alone: nothing of NumPy's structures can be looked into."""

    _type_, _length_ = ctypes.c_double * 4, 4

    @classmethod
    def of(cls, values):
        assert not any(hasattr(cls, n) for n in ("__array__", "__array_interface__", "__dlpack__"))
        return cls.from_buffer_copy(np.ascontiguousarray(values, float))


class OfInterface:
    """Offers `__array_interface__` alone."""

    def __init__(self, values):
        self.__values = values

    @property
    def __array_interface__(self):
        return self.__values.__array_interface__


class OfDlpack:
    """Offers DLPack alone, as torch's tensors do: the form of 1.0 where it is asked for and `newest` is set."""

    def __init__(self, values, newest=True, read_only=False, device=1, code=None):
        self.values, self.newest, self.read_only, self.device, self.code = values, newest, read_only, device, code
        self.freed = 0

    def __dlpack_device__(self):
        return (self.device, 0)

    def __dlpack__(self, **asked):
        if asked and not self.newest:
            raise TypeError("__dlpack__() got an unexpected keyword argument 'max_version'")
        form = Versioned(major=1, flags=int(self.read_only)) if asked else Managed()
        values, tensor = self.values, form.tensor
        self._shape = (ctypes.c_int64 * max(values.ndim, 1))(*values.shape)
        self._strides = (ctypes.c_int64 * max(values.ndim, 1))(*(s // values.itemsize for s in values.strides))
        tensor.data, tensor.device, tensor.ndim, tensor.lanes = values.ctypes.data, self.device, values.ndim, 1
        tensor.code = _CODES[values.dtype.kind] if self.code is None else self.code
        tensor.bits, tensor.shape, tensor.strides = 8 * values.itemsize, self._shape, self._strides
        self._form = form
        return _new(ctypes.addressof(form), b"dltensor_versioned" if asked else b"dltensor", None)


def tensor_of(holder, **asked):
    """What a consumer of DLPack sees: (address, shape, strides, code, bits), and lets go of it."""
    capsule = holder.__dlpack__(**asked)
    kind, name = (Versioned, b"dltensor_versioned") if asked else (Managed, b"dltensor")
    address = _pointer(capsule, name)
    form = ctypes.cast(address, ctypes.POINTER(kind)).contents
    t = form.tensor
    seen = (t.data + t.byte_offset, t.shape[:t.ndim], t.strides[:t.ndim], t.code, t.bits)
    used = b"used_" + name
    _rename(capsule, used)  # so that the capsule does not free it as well
    form.deleter(address)
    del capsule
    return seen


@pytest.fixture
def renderer(case):
    return sonocase.Renderer(case, size=(48, 40))


def test_the_module_knows_nothing_of_numpys_structures():
    """pybind11's own arrays look them up under these names, and read NumPy 2's wrongly before 2.12."""
    module = open(sonocase._core.__file__, "rb").read()
    for name in (b"numpy.core", b"numpy._core", b"multiarray", b"_ARRAY_API"):
        assert name not in module


@pytest.mark.parametrize("kind", [
    OfBuffer.of, OfInterface, OfDlpack, lambda v: OfDlpack(v, newest=False), np.asfortranarray,
    lambda v: OfInterface(np.asfortranarray(v)), lambda v: OfDlpack(np.asfortranarray(v)),
    lambda v: v.astype(">f8"), lambda v: OfInterface(v.astype(">f8")), lambda v: v.tolist(),
    lambda v: [array.array("d", row) for row in v], lambda v: [OfDlpack(row) for row in v],
    lambda v: memoryview(v), lambda v: v[::-1][::-1]])
def test_a_pose_of_any_kind_gives_the_same_picture(renderer, pose, kind):
    np.testing.assert_array_equal(renderer.render(kind(pose)), renderer.render(pose))


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", "longdouble", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8",
                                   ">f4", ">i2"])
def test_numbers_of_any_type_are_read(case, dtype):
    values = np.array([[1, 2, 40], [100, 7, 0], [3, 0.5, 99]]).astype(dtype)
    expected = case.labels_at(values.astype(float).tolist())
    assert case.labels_at(values) == expected
    assert case.labels_at(OfInterface(values)) == expected
    if values.dtype.isnative and dtype != "longdouble":
        assert case.labels_at(OfDlpack(values)) == expected
    brain = (values.astype("f4").view("u4") >> 16).astype("u2")  # bfloat16, which NumPy has not
    back = (brain.astype("u4") << 16).view("f4")
    assert case.labels_at(OfDlpack(brain, code=4)) == case.labels_at(back)


def test_halves_are_exact():
    """All 65,536 of them but what is not finite, beside NumPy's."""
    halves = np.arange(65536, dtype="u2").view("f2")
    halves = halves[np.isfinite(halves)]
    for start in range(0, len(halves) - 2, 3 * 977):
        three = halves[start:start + 3]
        moved = sonocase.Pose.moved(np.eye(4), three)
        np.testing.assert_array_equal(moved[:3, 3], three.astype(float))


@pytest.mark.parametrize("bad, error, words", [
    (np.eye(4, dtype=bool), TypeError, "truth values"), (np.eye(4, dtype=object), TypeError, "values that are not numbers"),
    (np.zeros((4, 4), "M8[s]"), TypeError, "values that are not numbers"), ([[True] * 4] * 4, TypeError, "bool"),
    (OfDlpack(np.eye(4), device=2), TypeError, "another device"), (OfDlpack(np.eye(4, dtype="c16")), TypeError, "complex"),
    (OfDlpack(np.eye(4), code=9), TypeError, "not numbers"), (object(), TypeError, "object"), (b"\0" * 16, ValueError, "(16,)"),
    ([[1, 2], [3]], ValueError, "(2,) and (1,)"), ([[1, 2, 3, 10**400]] * 4, ValueError, "too large")])
def test_what_is_no_array_of_numbers_is_refused_in_one_line(renderer, bad, error, words):
    with pytest.raises(error) as raised:
        renderer.render(bad)
    assert words in str(raised.value) and str(raised.value).startswith("pose: ") and "\n" not in str(raised.value)


def test_protocols_that_fail_are_refused_in_one_line(renderer):
    class Bad:
        def __init__(self, **said):
            self.__array_interface__ = said

    Bad.__array_interface__ = None  # special names are looked up in the type
    itself = []
    itself.append(itself)
    grown = OfDlpack(np.eye(4))
    grown.__class__ = type("Grown", (OfDlpack,), {
        "__dlpack__": lambda self, **_: (_ for _ in ()).throw(BufferError("has a gradient:\ndetach it"))})
    none = type("None_", (), {"__dlpack_device__": lambda self: (1, 0), "__dlpack__": lambda self, **_: 3})()
    for bad, words in ((Bad(), "not understood"), (Bad(shape=(4, 4)), "not understood"),
                       (Bad(shape=(4, 4), typestr="<f8", data=(0, True), strides=(8,)), "not understood"),
                       (Bad(shape=(-4, 4), typestr="<f8", data=(0, True)), "(-4, 4)"),
                       (grown, "has a gradient: detach it"), (none, "gives no tensor"), (itself, "not an array")):
        with pytest.raises(TypeError) as raised:
            renderer.render(bad)
        assert words in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("kind", [OfInterface, OfDlpack, lambda v: OfDlpack(v, newest=False), memoryview])
def test_out_of_any_kind_is_written_in_place(renderer, pose, kind):
    values = np.zeros((40, 48), np.uint8)
    out = kind(values)
    assert renderer.render(pose, out=out) is out
    np.testing.assert_array_equal(values, renderer.render(pose))


def test_out_that_may_not_be_written_is_refused(renderer, pose):
    locked = np.zeros((40, 48), np.uint8)
    locked.flags.writeable = False
    for out in (locked, OfInterface(locked), OfDlpack(locked, read_only=True), memoryview(bytes(40 * 48)).cast("B", (40, 48))):
        with pytest.raises(ValueError, match="read-only"):
            renderer.render(pose, out=out)


def test_a_view_lets_go_of_what_it_looked_at(renderer, pose):
    counts = []
    tensor = OfDlpack(pose)
    grown = bytearray(40 * 48)
    for _ in range(3):
        renderer.render(tensor, out=memoryview(grown).cast("B", (40, 48)))
        counts.append(sys.getrefcount(pose))
    assert counts[0] == counts[-1]
    grown.append(1)  # refused while any view of it is held


def test_an_array_of_ours_is_seen_in_place_by_every_protocol():
    for name, code in (("uint8", "B"), ("bool", "?"), ("int64", "l"), ("float32", "f"), ("float64", "d")):
        ours = sonocase.Array((2, 3, 4), name)
        seen, view = np.asarray(ours), memoryview(ours)
        assert seen.dtype == name and seen.shape == view.shape == ours.shape == (2, 3, 4) and view.format == code
        assert not seen.any() and ours.dtype == name and ours.nbytes == seen.nbytes and len(ours) == 2
        seen[1, 2, 3] = 1
        assert ours[1, 2, 3] == 1 and ours.tolist() == seen.tolist()
        by_interface = np.asarray(OfInterface(ours))
        taken = seen if name == "bool" else np.from_dlpack(ours)  # NumPy's DLPack has no truth values before 2
        assert seen.ctypes.data == by_interface.ctypes.data == taken.ctypes.data
        assert by_interface.dtype == taken.dtype == name
        for asked in ({}, {"max_version": (1, 1)}):
            address, shape, strides, kind, bits = tensor_of(ours, **asked)
            assert (address, shape, strides) == (seen.ctypes.data, [2, 3, 4], [12, 4, 1])
            assert (kind, bits) == (_CODES[seen.dtype.kind], 8 * seen.itemsize)
        assert tensor_of(ours, copy=True, max_version=(1, 0))[0] != seen.ctypes.data
        del ours  # the memory stays for as long as anything looks at it
        assert taken[1, 2, 3] == 1
    assert np.asarray(sonocase.Array((0, 5))).shape == (0, 5)


def test_arrays_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="no dtype complex64"):
        sonocase.Array((2,), "complex64")
    for shape in ("ab", 5, (1.5,), ("a",), None):
        with pytest.raises(TypeError, match="shape: .*give a tuple of whole numbers"):
            sonocase.Array(shape)
    with pytest.raises(TypeError, match="dtype: give its name"):
        sonocase.Array((2,), np.float32)
    with pytest.raises(ValueError, match="from 0 on"):
        sonocase.Array((2, -1))
    with pytest.raises(MemoryError):
        sonocase.Array((2**40, 2**40))
    for asked in ({"stream": 1}, {"dl_device": (2, 0)}):
        with pytest.raises(BufferError):
            sonocase.Array((2,)).__dlpack__(**asked)


def test_everything_but_data_sets_works_without_numpy(small, pose, renderer, tmp_path):
    """In a process that cannot import NumPy, and in one whose NumPy is a stand-in of version 2 that has nothing but
    `asarray`: the same pixels."""
    numbers = [float(v) for v in pose.ravel()]
    program = f"""
import sys
if sys.argv[1] == "none":
    sys.modules["numpy"] = None  # import numpy raises ImportError
else:
    class Seen:
        def __init__(self, given): self.given, self.seen = given, memoryview(given)
        def tobytes(self): return self.seen.tobytes()
        __array_interface__ = property(lambda self: self.given.__array_interface__)
    sys.modules["numpy"] = type(sys)("numpy")
    sys.modules["numpy"].__version__, sys.modules["numpy"].asarray = "2.1.0", Seen
import sonocase
case = sonocase.Case.open({str(small[0])!r})
rows = {numbers}
pose = [rows[i:i + 4] for i in range(0, 16, 4)]
renderer = sonocase.Renderer(case, size=(48, 40))
picture = renderer.render(pose)
assert (type(picture) is sonocase.Array) == (sys.argv[1] == "none"), type(picture)
batch, planes, facts = renderer.render_batch([pose, sonocase.Pose.inverse(sonocase.Pose.inverse(pose))], truth=["labels"])
out = bytearray(48 * 40)
renderer.render(sonocase.Pose.turned(pose), out=memoryview(out).cast("B", (40, 48)))
start = case.exercise().start_pose
assert sonocase.Pose.on_skin(case, (0, -20, 90), (0, 0, -1)) is not None
if sys.argv[1] == "none":
    assert start[3, 3] == 1 and picture.shape == (40, 48) and picture[20, 24] in range(256)
    assert len(sonocase.read_session({str(small[1])!r})["time_s"]) == 60
    try:
        sonocase.environment
        sys.exit("environments need NumPy")
    except ImportError as error:
        assert "numpy" in str(error)
sys.stdout.buffer.write(memoryview(picture if sys.argv[1] == "none" else picture.seen).tobytes() + bytes(out))
for array in (batch, planes.labels):
    sys.stdout.buffer.write((memoryview(array) if sys.argv[1] == "none" else array).tobytes())
"""
    shown = {how: subprocess.run([sys.executable, "-c", program, how], capture_output=True) for how in ("none", "two")}
    for done in shown.values():
        assert done.returncode == 0, done.stderr.decode()
    assert shown["none"].stdout == shown["two"].stdout
    alone = renderer.render(pose).tobytes()
    pictures, planes, _ = renderer.render_batch(np.stack([pose] * 2), truth=["labels"])
    expected = alone + renderer.render(sonocase.Pose.turned(pose)).tobytes() + pictures.tobytes() + planes.labels.tobytes()
    assert shown["none"].stdout == expected
