// SPDX-License-Identifier: Apache-2.0

// Result<T>: a value, or an Error that says what was found, where, and what to do.
//
// For failures of the outside world (a missing file, malformed bytes, an unplugged tracker).
// A caller's mistake is an assert; a poor numerical outcome is a field of a report.
// Member names are those of C++23's std::expected, which can replace it one day.
#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace sonocase {

struct Error {
    std::string what;      // what was found: "label map holds no body voxel"
    std::string where;     // file, offset, line or key; may be empty
    std::string expected;  // what was expected and what to do; may be empty

    // One line for people: "where: what; expected". What is quoted of a file may hold line breaks
    // and escape sequences: blanks stand for them.
    std::string message() const {
        std::string line = where.empty() ? what : where + ": " + what;
        if (!expected.empty()) line += "; " + expected;
        for (char& c : line) {
            if (static_cast<unsigned char>(c) < 32 || c == 127) c = ' ';
        }
        return line;
    }
};

template <class T>
class [[nodiscard]] Result {
  public:
    Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

    bool has_value() const { return state_.index() == 0; }
    explicit operator bool() const { return has_value(); }

    T& operator*() & { return *pointer(); }
    const T& operator*() const& { return *pointer(); }
    T&& operator*() && { return std::move(*pointer()); }
    T* operator->() { return pointer(); }
    const T* operator->() const { return pointer(); }

    const Error& error() const {
        assert(!has_value());
        return *std::get_if<1>(&state_);
    }

  private:
    T* pointer() {
        assert(has_value());
        return std::get_if<0>(&state_);
    }
    const T* pointer() const {
        assert(has_value());
        return std::get_if<0>(&state_);
    }
    std::variant<T, Error> state_;
};

// Success without a value: `return Done{};`
struct Done {};
using Status = Result<Done>;

}  // namespace sonocase
