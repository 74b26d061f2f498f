// SPDX-License-Identifier: Apache-2.0

// Arrays to and from Python by protocols alone: the buffer protocol (PEP 3118),
// `__array_interface__` and DLPack. Nothing here is compiled against NumPy, whose structures change
// with its major versions, and nothing needs it: what is made is NumPy's where it can be imported,
// a view without a copy, and a sonocase.Array otherwise.
#pragma once

#include <pybind11/pybind11.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace sonocase::python {

namespace py = pybind11;
using namespace pybind11::literals;

using Shape = std::vector<py::ssize_t>;

enum class NumberKind { real, whole, unsigned_whole, truth_value, complex, other };

// Somebody else's array, seen in place. Its memory stays for as long as the view.
class ArrayView {
  public:
    // nullopt where the object offers no protocol. name: of the argument, for messages. Raises
    // TypeError where a protocol is offered and does not lead to main memory.
    static std::optional<ArrayView> of(py::handle value, const char* name);

    const Shape& shape() const { return shape_; }
    NumberKind kind() const { return kind_; }
    std::size_t item_bytes() const { return item_bytes_; }
    bool read_only() const { return read_only_; }
    bool contiguous() const;  // in C order, of the machine's byte order
    void* data() const { return data_; }
    // Every element in C order; kind() must be real, whole or unsigned_whole.
    std::vector<double> values() const;

  private:
    static std::optional<ArrayView> of_buffer(py::handle value);
    static std::optional<ArrayView> of_interface(py::handle value, const char* name);
    static std::optional<ArrayView> of_dlpack(py::handle value, const char* name);
    void set_format(const char* format);

    Shape shape_, strides_;  // strides in bytes
    NumberKind kind_ = NumberKind::other;
    std::size_t item_bytes_ = 1;
    bool swapped_ = false;  // not of the machine's byte order
    bool brain_ = false;    // real of 16 bits: the upper half of a float
    bool read_only_ = false;
    char* data_ = nullptr;
    std::shared_ptr<Py_buffer> buffer_;
    py::object keeps_;
};

struct Numbers {
    Shape shape;
    std::vector<double> values;  // in C order
};
// Real numbers of an array, a number, or sequences of them. Raises TypeError where `value` is none
// of these and ValueError where its rows differ in length.
Numbers numbers_from(py::handle value, const char* name);
std::string shape_text(const Shape& shape);  // "(4, 4)"

// An array that Python owns, in C order, its values not set.
template <class T>
struct NewArray {
    py::object object = py::none();
    T* data = nullptr;
};
// T: std::uint8_t, bool, std::int64_t, float or double.
template <class T>
NewArray<T> new_array(const Shape& shape);

// `out` of the caller's, to write bytes to. Raises TypeError or ValueError unless it is a
// writeable array of uint8 of this shape in C order.
ArrayView writeable_bytes(py::handle out, const Shape& shape);

void bind_array(py::module_& module);  // Array

}  // namespace sonocase::python
