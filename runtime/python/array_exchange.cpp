// SPDX-License-Identifier: Apache-2.0

#include "array_exchange.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <new>
#include <type_traits>
#include <utility>

#include <pybind11/stl.h>

namespace sonocase::python {
namespace {

// The C structures of DLPack 1.0 (dmlc.github.io/dlpack), in which libraries hand each other
// tensors. A capsule "dltensor" holds the first form, "dltensor_versioned" the second.
namespace dlpack {

constexpr std::int32_t kCpu = 1, kCudaHost = 3, kRocmHost = 11;  // all of main memory
constexpr std::uint8_t kWhole = 0, kUnsigned = 1, kReal = 2, kBrain = 4, kComplex = 5, kBool = 6;
constexpr std::uint64_t kReadOnly = 1;

struct Tensor {
    void* data;
    std::int32_t device, device_id;
    std::int32_t dimensions;
    std::uint8_t code, bits;
    std::uint16_t lanes;
    std::int64_t *shape, *strides;  // strides in elements; null: C order
    std::uint64_t byte_offset;
};
struct Managed {
    Tensor tensor;
    void* owner;
    void (*deleter)(Managed*);
};
struct Versioned {
    std::uint32_t major, minor;
    void* owner;
    void (*deleter)(Versioned*);
    std::uint64_t flags;
    Tensor tensor;
};
constexpr char kName[] = "dltensor", kVersionedName[] = "dltensor_versioned";

template <class Form>
constexpr const char* name_of() {
    return std::is_same_v<Form, Versioned> ? kVersionedName : kName;
}

}  // namespace dlpack

// What an array of ours holds.
struct Element {
    const char* name;    // as NumPy has it
    const char* format;  // PEP 3118
    const char* type;    // __array_interface__
    std::uint8_t code;   // DLPack
    std::size_t bytes;
};
constexpr Element kElements[] = {{"uint8", "B", "|u1", dlpack::kUnsigned, 1},
                                 {"bool", "?", "|b1", dlpack::kBool, 1},
                                 {"int64", "l", "<i8", dlpack::kWhole, 8},
                                 {"float32", "f", "<f4", dlpack::kReal, 4},
                                 {"float64", "d", "<f8", dlpack::kReal, 8}};
static_assert(sizeof(long) == 8 && std::endian::native == std::endian::little,
              "the table is of 64 bit, lower byte first");

template <class T>
const Element& element_of() {
    if constexpr (std::is_same_v<T, std::uint8_t>) return kElements[0];
    if constexpr (std::is_same_v<T, bool>) return kElements[1];
    if constexpr (std::is_same_v<T, std::int64_t>) return kElements[2];
    if constexpr (std::is_same_v<T, float>) return kElements[3];
    if constexpr (std::is_same_v<T, double>) return kElements[4];
}

Shape c_strides(const Shape& shape, std::size_t item_bytes) {
    Shape strides(shape.size());
    auto step = static_cast<py::ssize_t>(item_bytes);
    for (std::size_t i = shape.size(); i-- > 0;) {
        strides[i] = step;
        step *= shape[i];
    }
    return strides;
}

std::size_t count_of(const Shape& shape) {
    std::size_t count = 1;
    for (const py::ssize_t n : shape) count *= static_cast<std::size_t>(n);
    return count;
}

// sonocase.Array: memory of ours with a shape. What it was given to keeps the memory.
struct Array {
    std::shared_ptr<char> memory;
    Shape shape;
    const Element* element;

    Array(Shape of, const Element& what) : shape(std::move(of)), element(&what) {
        std::size_t room = PTRDIFF_MAX / element->bytes;
        for (const py::ssize_t n : shape) {
            if (n < 0) throw py::value_error("shape: give numbers from 0 on");
            if (n > 0) room /= static_cast<std::size_t>(n);
        }
        if (room == 0) throw std::bad_alloc();
        constexpr std::align_val_t kAlign{64};
        memory = {static_cast<char*>(operator new(std::max<std::size_t>(bytes(), 1), kAlign)),
                  [](char* p) { operator delete(p, kAlign); }};
    }
    std::size_t bytes() const { return count_of(shape) * element->bytes; }
};

py::tuple tuple_of(const Shape& shape) {
    py::tuple t(shape.size());
    for (std::size_t i = 0; i < shape.size(); ++i) t[i] = shape[i];
    return t;
}

// numpy.asarray, or None for good where NumPy cannot be imported.
py::handle numpy_asarray() {
    static const py::handle kept = [] {
        PyObject* numpy = PyImport_ImportModule("numpy");
        if (numpy == nullptr) {
            PyErr_Clear();
            return py::none().release();
        }
        return py::object(py::reinterpret_steal<py::object>(numpy).attr("asarray")).release();
    }();
    return kept;
}

// What a capsule of ours keeps.
template <class Form>
struct Lent {
    Form form{};
    std::shared_ptr<char> memory;
    std::vector<std::int64_t> shape, strides;
};

template <class Form>
void forget(Form* form) {
    delete static_cast<Lent<Form>*>(form->owner);
}

template <class Form>
py::object lend(const Array& array) {
    auto lent = std::make_unique<Lent<Form>>();
    lent->memory = array.memory;
    lent->shape.assign(array.shape.begin(), array.shape.end());
    for (const py::ssize_t s : c_strides(array.shape, 1)) lent->strides.push_back(s);
    lent->form.tensor = {array.memory.get(),
                         dlpack::kCpu,
                         0,
                         static_cast<std::int32_t>(array.shape.size()),
                         array.element->code,
                         static_cast<std::uint8_t>(8 * array.element->bytes),
                         1,
                         lent->shape.data(),
                         lent->strides.data(),
                         0};
    if constexpr (std::is_same_v<Form, dlpack::Versioned>) lent->form.major = 1;
    lent->form.owner = lent.get();
    lent->form.deleter = forget<Form>;
    PyObject* capsule = PyCapsule_New(&lent->form, dlpack::name_of<Form>(), [](PyObject* self) {
        const char* name = dlpack::name_of<Form>();
        if (PyCapsule_IsValid(self, name) == 0) return;  // renamed by whoever took the tensor
        forget(static_cast<Form*>(PyCapsule_GetPointer(self, name)));
    });
    if (capsule == nullptr) throw py::error_already_set();
    (void)lent.release();
    return py::reinterpret_steal<py::object>(capsule);
}

py::object to_dlpack(const Array& array,
                     const py::object& stream,
                     const py::object& max_version,
                     const py::object& device,
                     const py::object& copy) {
    if (!stream.is_none() || !(device.is_none() || device.equal(py::make_tuple(dlpack::kCpu, 0)))) {
        PyErr_SetString(PyExc_BufferError, "array: is in main memory, and has no stream");
        throw py::error_already_set();
    }
    Array given = array;
    if (!copy.is_none() && py::cast<bool>(copy)) {
        given = Array(array.shape, *array.element);
        std::memcpy(given.memory.get(), array.memory.get(), array.bytes());
    }
    const bool versioned = !max_version.is_none() &&
                           py::cast<int>(py::reinterpret_borrow<py::sequence>(max_version)[0]) >= 1;
    return versioned ? lend<dlpack::Versioned>(given) : lend<dlpack::Managed>(given);
}

double half(std::uint16_t bits) {
    const int exponent = bits >> 10 & 31, fraction = bits & 1023;
    double value = exponent == 0    ? std::ldexp(fraction, -24)
                   : exponent == 31 ? (fraction == 0 ? INFINITY : NAN)
                                    : std::ldexp(1024 + fraction, exponent - 25);
    return (bits & 0x8000) != 0 ? -value : value;
}

template <class T>
T read_as(const unsigned char* item) {
    T value;
    std::memcpy(&value, item, sizeof value);
    return value;
}

double real_at(const unsigned char* item, std::size_t bytes, bool brain) {
    if (bytes == 2 && brain)
        return std::bit_cast<float>(static_cast<std::uint32_t>(read_as<std::uint16_t>(item)) << 16);
    if (bytes == 2) return half(read_as<std::uint16_t>(item));
    if (bytes == 4) return read_as<float>(item);
    if (bytes == 8) return read_as<double>(item);
    return static_cast<double>(read_as<long double>(item));
}

double whole_at(const unsigned char* item, std::size_t bytes, bool is_signed) {
    if (bytes == 1) return is_signed ? read_as<std::int8_t>(item) : item[0];
    if (bytes == 2) return is_signed ? read_as<std::int16_t>(item) : read_as<std::uint16_t>(item);
    if (bytes == 4) return is_signed ? read_as<std::int32_t>(item) : read_as<std::uint32_t>(item);
    return is_signed ? static_cast<double>(read_as<std::int64_t>(item))
                     : static_cast<double>(read_as<std::uint64_t>(item));
}

bool readable(NumberKind kind, std::size_t bytes) {
    const bool power = bytes == 1 || bytes == 2 || bytes == 4 || bytes == 8;
    if (kind == NumberKind::real) return (power && bytes > 1) || bytes == sizeof(long double);
    return (kind == NumberKind::whole || kind == NumberKind::unsigned_whole) && power;
}

// The error that Python has raised, as the end of a sentence of ours.
std::string raised_text() {
    const py::error_already_set error;  // takes it
    std::string text = py::cast<std::string>(py::str(error.value()));
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
}

bool has(py::handle value, const char* attribute) {
    // Of the type, as Python looks up special methods: a class is no array.
    return PyObject_HasAttrString(reinterpret_cast<PyObject*>(Py_TYPE(value.ptr())), attribute) !=
           0;
}

}  // namespace

bool ArrayView::contiguous() const {
    py::ssize_t step = static_cast<py::ssize_t>(item_bytes_);
    for (std::size_t i = shape_.size(); i-- > 0;) {
        if (shape_[i] == 0) return true;
        if (shape_[i] > 1 && strides_[i] != step) return false;
        step *= shape_[i];
    }
    return !swapped_;
}

std::vector<double> ArrayView::values() const {
    std::vector<double> values(count_of(shape_));
    Shape at(shape_.size(), 0);
    unsigned char item[sizeof(long double)];
    for (double& value : values) {
        const char* from = data_;
        for (std::size_t i = 0; i < at.size(); ++i) from += at[i] * strides_[i];
        std::memcpy(item, from, item_bytes_);
        if (swapped_) std::reverse(item, item + item_bytes_);
        value = kind_ == NumberKind::real ? real_at(item, item_bytes_, brain_)
                                          : whole_at(item, item_bytes_, kind_ == NumberKind::whole);
        for (std::size_t i = at.size(); i-- > 0 && ++at[i] == shape_[i];) at[i] = 0;
    }
    return values;
}

void ArrayView::set_format(const char* format) {
    if (format == nullptr) format = "B";
    if (*format == '>' || *format == '!') swapped_ = item_bytes_ > 1;
    if (std::strchr("@=<>!", *format) != nullptr) ++format;
    const std::string code = format;
    const auto one_of = [&](const char* codes) {
        return code.size() == 1 && std::strchr(codes, code[0]) != nullptr;
    };
    kind_ = one_of("efdg")                    ? NumberKind::real
            : one_of("bhilqn")                ? NumberKind::whole
            : one_of("BHILQN")                ? NumberKind::unsigned_whole
            : one_of("?")                     ? NumberKind::truth_value
            : !code.empty() && code[0] == 'Z' ? NumberKind::complex
                                              : NumberKind::other;
}

std::optional<ArrayView> ArrayView::of_buffer(py::handle value) {
    if (PyObject_CheckBuffer(value.ptr()) == 0) return std::nullopt;
    auto got = std::make_unique<Py_buffer>();
    if (PyObject_GetBuffer(value.ptr(), got.get(), PyBUF_FULL_RO) != 0) {
        PyErr_Clear();  // as arrays of dates: another protocol may say more
        return std::nullopt;
    }
    ArrayView view;
    view.buffer_ = {got.release(), [](Py_buffer* b) {
                        PyBuffer_Release(b);
                        delete b;
                    }};
    const Py_buffer& buffer = *view.buffer_;
    view.item_bytes_ = static_cast<std::size_t>(buffer.itemsize);
    view.set_format(buffer.format);
    view.read_only_ = buffer.readonly != 0;
    view.data_ = static_cast<char*>(buffer.buf);
    view.shape_.assign(buffer.shape, buffer.shape + buffer.ndim);
    if (buffer.strides != nullptr) {
        view.strides_.assign(buffer.strides, buffer.strides + buffer.ndim);
    } else {
        view.strides_ = c_strides(view.shape_, view.item_bytes_);
    }
    if (buffer.suboffsets != nullptr) view.kind_ = NumberKind::other;  // rows apart: not read
    return view;
}

std::optional<ArrayView> ArrayView::of_interface(py::handle value, const char* name) {
    if (!has(value, "__array_interface__")) return std::nullopt;
    const std::string broken = std::string(name) + ": its __array_interface__ is not understood";
    ArrayView view;
    try {
        const py::dict said = value.attr("__array_interface__");
        const auto type = py::cast<std::string>(said["typestr"]);
        if (type.size() < 3) throw py::type_error(broken);
        view.item_bytes_ = std::stoul(type.substr(2));
        view.kind_ = type[1] == 'f'   ? NumberKind::real
                     : type[1] == 'i' ? NumberKind::whole
                     : type[1] == 'u' ? NumberKind::unsigned_whole
                     : type[1] == 'b' ? NumberKind::truth_value
                     : type[1] == 'c' ? NumberKind::complex
                                      : NumberKind::other;
        view.swapped_ = type[0] == '>' && view.item_bytes_ > 1;
        for (const py::handle n : py::tuple(said["shape"]))
            view.shape_.push_back(py::cast<py::ssize_t>(n));
        const py::object strides = said.attr("get")("strides");
        if (strides.is_none()) {
            view.strides_ = c_strides(view.shape_, view.item_bytes_);
        } else {
            for (const py::handle n : py::tuple(strides))
                view.strides_.push_back(py::cast<py::ssize_t>(n));
        }
        if (view.strides_.size() != view.shape_.size()) throw py::type_error(broken);
        const py::tuple data = said["data"];
        view.data_ = reinterpret_cast<char*>(py::cast<std::uintptr_t>(data[0]));
        view.read_only_ = py::cast<bool>(data[1]);
        view.keeps_ = py::make_tuple(value, said);
    } catch (const py::type_error&) {
        throw;
    } catch (const std::exception&) {  // of Python, of a cast, of a number's text
        throw py::type_error(broken);
    }
    return view;
}

std::optional<ArrayView> ArrayView::of_dlpack(py::handle value, const char* name) {
    if (!has(value, "__dlpack__") || !has(value, "__dlpack_device__")) return std::nullopt;
    const std::string refused = std::string(name) + ": cannot be read by DLPack: ";
    ArrayView view;
    const auto device_pair = py::reinterpret_steal<py::object>(
        PyObject_CallMethod(value.ptr(), "__dlpack_device__", nullptr));
    if (!device_pair) throw py::type_error(refused + raised_text());
    const int device = py::cast<int>(py::int_(py::tuple(device_pair)[0]));
    if (device != dlpack::kCpu && device != dlpack::kCudaHost && device != dlpack::kRocmHost)
        throw py::type_error(std::string(name) +
                             ": is in the memory of another device; give it in main memory, as "
                             "tensor.cpu()");
    const py::object method = value.attr("__dlpack__");
    const py::dict newest("max_version"_a = py::make_tuple(1, 0));
    auto capsule = py::reinterpret_steal<py::object>(
        PyObject_Call(method.ptr(), py::tuple().ptr(), newest.ptr()));
    if (!capsule && PyErr_ExceptionMatches(PyExc_TypeError) != 0) {  // before DLPack 1.0
        PyErr_Clear();
        capsule = py::reinterpret_steal<py::object>(PyObject_CallNoArgs(method.ptr()));
    }
    if (!capsule) throw py::type_error(refused + raised_text());
    const dlpack::Tensor* tensor = nullptr;
    if (PyCapsule_IsValid(capsule.ptr(), dlpack::kVersionedName) != 0) {
        const auto* form = static_cast<dlpack::Versioned*>(
            PyCapsule_GetPointer(capsule.ptr(), dlpack::kVersionedName));
        if (form->major != 1) throw py::type_error(refused + "its version is not 1");
        view.read_only_ = (form->flags & dlpack::kReadOnly) != 0;
        tensor = &form->tensor;
    } else if (PyCapsule_IsValid(capsule.ptr(), dlpack::kName) != 0) {
        tensor = &static_cast<dlpack::Managed*>(PyCapsule_GetPointer(capsule.ptr(), dlpack::kName))
                      ->tensor;
    } else {
        throw py::type_error(refused + "__dlpack__ gives no tensor");
    }
    view.item_bytes_ = tensor->bits / 8;
    view.brain_ = tensor->code == dlpack::kBrain;
    const bool plain = tensor->lanes == 1 && tensor->bits % 8 == 0;
    view.kind_ = !plain                              ? NumberKind::other
                 : tensor->code == dlpack::kWhole    ? NumberKind::whole
                 : tensor->code == dlpack::kUnsigned ? NumberKind::unsigned_whole
                 : tensor->code == dlpack::kReal     ? NumberKind::real
                 : view.brain_ && tensor->bits == 16 ? NumberKind::real
                 : tensor->code == dlpack::kComplex  ? NumberKind::complex
                 : tensor->code == dlpack::kBool     ? NumberKind::truth_value
                                                     : NumberKind::other;
    view.data_ = static_cast<char*>(tensor->data) + tensor->byte_offset;
    view.shape_.assign(tensor->shape, tensor->shape + tensor->dimensions);
    if (tensor->strides == nullptr) {
        view.strides_ = c_strides(view.shape_, view.item_bytes_);
    } else {
        for (std::int32_t i = 0; i < tensor->dimensions; ++i)
            view.strides_.push_back(tensor->strides[i] *
                                    static_cast<py::ssize_t>(view.item_bytes_));
    }
    view.keeps_ = capsule;  // its name is unchanged, so that it lets go of the tensor itself
    return view;
}

std::optional<ArrayView> ArrayView::of(py::handle value, const char* name) {
    std::optional<ArrayView> view = of_buffer(value);
    if (!view) view = of_interface(value, name);
    if (!view) view = of_dlpack(value, name);
    if (view &&
        std::any_of(view->shape_.begin(), view->shape_.end(), [](py::ssize_t n) { return n < 0; }))
        throw py::type_error(std::string(name) + ": an array of shape " + shape_text(view->shape_));
    return view;
}

std::string shape_text(const Shape& shape) {
    std::string text = "(";
    for (std::size_t i = 0; i < shape.size(); ++i)
        text += (i > 0 ? ", " : "") + std::to_string(shape[i]);
    return text + (shape.size() == 1 ? ",)" : ")");
}

namespace {

constexpr int kDeepest = 8;  // of sequences in sequences: a list may hold itself

py::type_error no_numbers(py::handle value, const char* name) {
    return py::type_error(std::string(name) + ": not an array of numbers, but of type " +
                          Py_TYPE(value.ptr())->tp_name);
}

void append(py::handle value, const char* name, int depth, Numbers& to);

void append_rows(py::handle value, const char* name, int depth, Numbers& to) {
    const auto rows =
        py::reinterpret_steal<py::object>(PySequence_Fast(value.ptr(), "not a sequence"));
    if (!rows) throw py::error_already_set();
    const py::ssize_t count = PySequence_Fast_GET_SIZE(rows.ptr());
    Shape row_shape;
    for (py::ssize_t i = 0; i < count; ++i) {
        to.shape.clear();
        append(PySequence_Fast_GET_ITEM(rows.ptr(), i), name, depth + 1, to);
        if (i == 0) row_shape = to.shape;
        if (to.shape != row_shape)
            throw py::value_error(std::string(name) + ": rows of different shapes, " +
                                  shape_text(row_shape) + " and " + shape_text(to.shape));
    }
    to.shape = row_shape;
    to.shape.insert(to.shape.begin(), count);
}

// Sets to.shape and appends to to.values.
void append(py::handle value, const char* name, int depth, Numbers& to) {
    if (PyFloat_Check(value.ptr()) || (PyLong_Check(value.ptr()) && !PyBool_Check(value.ptr()))) {
        to.values.push_back(PyFloat_AsDouble(value.ptr()));
        if (PyErr_Occurred() != nullptr)
            throw py::value_error(std::string(name) + ": " + raised_text());
        to.shape.clear();
        return;
    }
    if (const std::optional<ArrayView> view = ArrayView::of(value, name)) {
        if (!readable(view->kind(), view->item_bytes()))
            throw py::type_error(std::string(name) + ": an array of " +
                                 (view->kind() == NumberKind::truth_value ? "truth values"
                                  : view->kind() == NumberKind::complex
                                      ? "complex numbers"
                                      : "values that are not numbers") +
                                 "; give real numbers");
        const std::vector<double> values = view->values();
        to.values.insert(to.values.end(), values.begin(), values.end());
        to.shape = view->shape();
        return;
    }
    if (depth < kDeepest && has(value, "__array__")) {
        append(value.attr("__array__")(), name, kDeepest, to);
        return;
    }
    const bool rows = PySequence_Check(value.ptr()) != 0 && !PyUnicode_Check(value.ptr());
    if (!rows || depth >= kDeepest) throw no_numbers(value, name);
    append_rows(value, name, depth, to);
}

}  // namespace

Numbers numbers_from(py::handle value, const char* name) {
    Numbers numbers;
    append(value, name, 0, numbers);
    return numbers;
}

template <class T>
NewArray<T> new_array(const Shape& shape) {
    Array array(shape, element_of<T>());
    T* data = reinterpret_cast<T*>(array.memory.get());
    py::object object = py::cast(std::move(array));
    const py::handle asarray = numpy_asarray();
    return {asarray.is_none() ? object : asarray(object), data};
}
template NewArray<std::uint8_t> new_array(const Shape&);
template NewArray<bool> new_array(const Shape&);
template NewArray<std::int64_t> new_array(const Shape&);
template NewArray<float> new_array(const Shape&);
template NewArray<double> new_array(const Shape&);

ArrayView writeable_bytes(py::handle out, const Shape& shape) {
    std::optional<ArrayView> view = ArrayView::of(out, "out");
    if (!view || view->kind() != NumberKind::unsigned_whole || view->item_bytes() != 1 ||
        !view->contiguous())
        throw py::type_error("out: give a C-contiguous array of dtype uint8");
    if (view->shape() != shape)
        throw py::value_error("out: give an array of shape " + shape_text(shape));
    if (view->read_only()) throw py::value_error("out: the array is read-only");
    return std::move(*view);
}

void bind_array(py::module_& module) {
    const auto make = [](const Shape& shape, const std::string& dtype) {
        for (const Element& element : kElements) {
            if (dtype != element.name) continue;
            Array array(shape, element);
            std::memset(array.memory.get(), 0, array.bytes());
            return array;
        }
        throw py::value_error("dtype: no dtype " + dtype +
                              "; give uint8, bool, int64, float32 or float64");
    };
    py::class_<Array>(
        module, "Array", py::buffer_protocol(),
        "Numbers in main memory, in C order: what functions give where NumPy cannot be imported. "
        "NumPy, torch and others see it without a copy, by the buffer protocol, "
        "__array_interface__ or DLPack.")
        .def(py::init([make](const py::object& shape, const py::object& dtype) {
                 if (!py::isinstance<py::sequence>(shape) || py::isinstance<py::str>(shape))
                     throw py::type_error("shape: give a tuple of whole numbers");
                 if (!py::isinstance<py::str>(dtype))
                     throw py::type_error("dtype: give its name, as 'uint8'");
                 Shape of;
                 for (const py::handle n : shape) {
                     of.push_back(PyNumber_AsSsize_t(n.ptr(), PyExc_OverflowError));
                     if (PyErr_Occurred() == nullptr) continue;
                     const std::string said = raised_text();
                     throw py::type_error("shape: " + said + "; give a tuple of whole numbers");
                 }
                 return make(of, py::cast<std::string>(dtype));
             }),
             "shape"_a, "dtype"_a = "uint8", "Zeros.")
        .def_buffer([](Array& a) {
            return py::buffer_info(a.memory.get(), static_cast<py::ssize_t>(a.element->bytes),
                                   a.element->format, static_cast<py::ssize_t>(a.shape.size()),
                                   a.shape, c_strides(a.shape, a.element->bytes));
        })
        .def_property_readonly(
            "__array_interface__",
            [](const Array& a) {
                return py::dict("version"_a = 3, "shape"_a = tuple_of(a.shape),
                                "typestr"_a = a.element->type, "strides"_a = py::none(),
                                "data"_a = py::make_tuple(
                                    reinterpret_cast<std::uintptr_t>(a.memory.get()), false));
            })
        .def("__dlpack__", to_dlpack, py::kw_only(), "stream"_a = py::none(),
             "max_version"_a = py::none(), "dl_device"_a = py::none(), "copy"_a = py::none())
        .def("__dlpack_device__", [](const Array&) { return py::make_tuple(dlpack::kCpu, 0); })
        .def_property_readonly(
            "shape", [](const Array& a) { return tuple_of(a.shape); }, "Length of each axis.")
        .def_property_readonly(
            "dtype", [](const Array& a) { return a.element->name; }, "Name, as 'uint8'.")
        .def_property_readonly(
            "nbytes", [](const Array& a) { return a.bytes(); }, "Bytes of all its numbers.")
        .def(py::pickle(
            [](const Array& a) {
                return py::make_tuple(tuple_of(a.shape), a.element->name,
                                      py::bytes(a.memory.get(), a.bytes()));
            },
            [make](const py::tuple& t) {
                Array array = make(py::cast<Shape>(t[0]), py::cast<std::string>(t[1]));
                const auto content = py::cast<std::string>(t[2]);
                if (content.size() != array.bytes())
                    throw py::value_error("array: a pickle of another length");
                std::memcpy(array.memory.get(), content.data(), content.size());
                return array;
            }))
        .def("__len__",
             [](const Array& a) {
                 if (a.shape.empty()) throw py::type_error("an array of shape () has no length");
                 return a.shape.front();
             })
        .def(
            "__getitem__",
            [](const py::object& self, const py::object& index) {
                return py::object(py::memoryview(self)[index]);  // before the view goes
            },
            "One number, by an index for each axis.")
        .def(
            "tolist",
            [](const py::object& self) {
                return py::object(py::memoryview(self).attr("tolist")());
            },
            "Lists in lists of numbers.")
        .def("__repr__", [](const Array& a) {
            return "<sonocase.Array " + shape_text(a.shape) + " " + a.element->name + ">";
        });
}

}  // namespace sonocase::python
