// SPDX-License-Identifier: Apache-2.0

// Checked reading of JSON objects. Include this header in .cpp files only, because it exposes a
// third-party type.
//
// The first fault is kept, with the path of keys that leads to it ("labels[3].name"), and
// everything read after it is a default: a parser reads straight through and looks at the fault
// once, at the end.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

// Errors of the parser come back as values; its other exceptions are mistakes of ours and abort.
#ifndef JSON_NOEXCEPTION
#define JSON_NOEXCEPTION
#endif
#include <nlohmann/json.hpp>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::detail {

using Json = nlohmann::ordered_json;

struct JsonFault {
    std::string where;
    std::optional<Error> error;
};

class JsonObject {
  public:
    JsonObject(const Json& value, std::string path, JsonFault& fault);

    bool has(const char* key) const;  // present and not null
    std::vector<std::string> keys() const;
    std::string text(const char* key);
    std::string text_or(const char* key, const std::string& otherwise);
    bool flag_or(const char* key, bool otherwise);
    double number(const char* key);  // finite
    double number_or(const char* key, double otherwise);
    std::int64_t integer(const char* key, std::int64_t low, std::int64_t high);
    std::int64_t integer_or(const char* key,
                            std::int64_t otherwise,
                            std::int64_t low,
                            std::int64_t high);
    // count 0: any number of numbers.
    std::vector<double> numbers(const char* key, std::size_t count);
    std::vector<std::string> texts_or_none(const char* key);
    Vector3 vector(const char* key);
    Point3 point(const char* key);
    JsonObject object(const char* key);
    std::vector<JsonObject> objects(const char* key);
    const std::string& path() const { return path_; }
    void add_fault(const char* key, const std::string& what, const std::string& expected = "");
    bool ok() const { return !fault_->error; }

  private:
    const Json* member(const char* key);
    const Json* value_;
    std::string path_;
    JsonFault* fault_;
};

// Adds a fault unless the object's "format" is `format` and its "version" is at most `version`.
// verb: what makes such files, as "calibrate" does; the fault says to use it again.
void expect_format(JsonObject& object, const char* format, int version, const std::string& verb);
// Parses text into `out`; false, with a fault, when it is not a JSON object.
bool parse_json(std::string_view text, Json& out, JsonFault& fault);
// Two-space indented, or on one line; bytes that are not UTF-8 are replaced.
std::string json_text(const Json& value, bool indented);
Json json_number(double value);  // null where not finite: JSON has no NaN or infinity

Json json_of(Vector3 v);
Json json_of(Point3 p);
Json json_of(const Rigid& t);
Rigid rigid_from(JsonObject object);

}  // namespace sonocase::detail
