// SPDX-License-Identifier: Apache-2.0

// Checked reading of TOML: one reader for recipes and exercises.
//
//     const Result<TomlTable> root = TomlTable::parse(text, path);
//     root->number("depth_mm", probe.depth_mm, 1, 500);
//     if (auto needle = root->table("needle")) read_needle(*needle);
//     root->finish();                         // keys that nothing asked for are errors
//     if (root->fault()) return *root->fault();
//
// The first fault of the document is kept and reading goes on, so that a parser runs straight
// through and looks at the fault once, at the end. A fault names the file and line
// ("case.toml:12"), the key with the tables that lead to it ("targets[0].radius_mm"), what was
// found and what is expected; for an unknown name, the nearest known one.
//
// A reading function leaves its result as it was where the key is absent or faulty. Those that
// return bool return true when they have set it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase {

// A table of a parsed document. Cheap to copy: copies are the same table and share the list of keys
// that were asked for. The document lives as long as any of its tables.
class TomlTable {
  public:
    // `where` is the file's name, for faults. An error when the text is not TOML.
    static Result<TomlTable> parse(std::string_view text, const std::string& where);

    bool has(std::string_view key) const;
    // In alphabetical order. Does not count as asking for them.
    std::vector<std::string> keys() const;
    int line(std::string_view key) const;           // of the key, from 1; of the table if absent
    std::string place(std::string_view key) const;  // "case.toml:12"

    // `choices`: the texts that are allowed; empty: any.
    bool text(std::string_view key,
              std::string& to,
              const std::vector<std::string>& choices = {}) const;
    // `single_allowed`: a text alone stands for a list of one.
    bool texts(std::string_view key,
               std::vector<std::string>& to,
               bool single_allowed = false) const;
    // From `low` to `high`, both included unless `above_low`. Infinity and NaN are refused.
    bool number(
        std::string_view key, double& to, double low, double high, bool above_low = false) const;
    bool whole(std::string_view key, int& to, double low, double high) const;
    // A list of min_count to max_count numbers, each from `low` to `high`.
    bool numbers(std::string_view key,
                 std::vector<double>& to,
                 double low,
                 double high,
                 std::size_t min_count,
                 std::size_t max_count) const;
    bool flag(std::string_view key, bool& to) const;
    bool point(std::string_view key, Point3& to) const;       // three coordinates, at most 1e5 mm
    bool vector(std::string_view key, Vector3& to) const;     // likewise
    bool direction(std::string_view key, Vector3& to) const;  // made a unit vector; not zero

    // The index in `names` of the text under the key.
    std::optional<std::size_t> choice(std::string_view key,
                                      const std::vector<std::string>& names) const;
    // The value as it would stand on a command line: text without quotes, shortest form of a
    // number, "(a list)" and "(a table)". Empty when the key is absent.
    std::optional<std::string> plain_value(std::string_view key) const;

    std::optional<TomlTable> table(std::string_view key) const;  // [key]
    std::vector<TomlTable> tables(std::string_view key) const;   // [[key]]

    // Call after every key has been asked for: any other is a fault.
    void finish() const;
    // Adds a fault that the caller found: "KEY WHAT; EXPECTED", at the line of the key or the
    // table.
    void add_fault(std::string_view key,
                   const std::string& what,
                   const std::string& expected) const;
    // Adds a fault that has a place of its own.
    void keep(Error error) const;
    const std::optional<Error>& fault() const;

  private:
    struct Document;
    struct Part;
    explicit TomlTable(std::shared_ptr<Part> part) : part_(std::move(part)) {}
    template <class V>
    bool triple(std::string_view key, V& to) const;
    std::shared_ptr<Part> part_;
};

// Makes an Error of a fault of toml++ (error.description()).
Error toml_fault(std::string_view description, const std::string& where);

}  // namespace sonocase
