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

#include "formats/base/message.h"

namespace sonocase {

struct Error {
    Message what;       // what was found: "label map holds no body voxel"
    std::string where;  // file, offset, line or key; may be empty
    Message expected;   // what was expected and what to do; may be empty

    // One line for people: "where: what; expected". What is quoted of a file may hold line breaks
    // and escape sequences: blanks stand for them.
    Message message() const {
        if (where.empty() && expected.empty()) return what.on_one_line();
        if (expected.empty()) return Message("{}: {}", {where, what}).on_one_line();
        if (where.empty()) return Message("{}; {}", {what, expected}).on_one_line();
        return Message("{}: {}; {}", {where, what, expected}).on_one_line();
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

#define SONOCASE_JOIN_NAMES_(a, b) a##b
#define SONOCASE_JOIN_NAMES(a, b) SONOCASE_JOIN_NAMES_(a, b)
#define SONOCASE_TRY_IN_(result, declaration, ...) \
    auto result = (__VA_ARGS__);                   \
    if (!result) return result.error();            \
    declaration = *std::move(result)

// SONOCASE_TRY returns the error to the caller, or declares the value and goes on;
// SONOCASE_TRY_DONE does the same for a Status:
//     SONOCASE_TRY(const std::string text, read_text_file(path));
//     SONOCASE_TRY_DONE(write_file(path, text));
// SONOCASE_TRY is several statements: never the body of an `if` without braces.
#define SONOCASE_TRY(declaration, ...) \
    SONOCASE_TRY_IN_(SONOCASE_JOIN_NAMES(try_result_, __LINE__), declaration, __VA_ARGS__)
#define SONOCASE_TRY_DONE(...)                                                       \
    do {                                                                             \
        if (auto try_status = (__VA_ARGS__); !try_status) return try_status.error(); \
    } while (false)
