// SPDX-License-Identifier: Apache-2.0

#include "formats/text/json_reader.h"

#include <algorithm>

namespace sonocase::detail {
namespace {

const Json& nothing() {
    static const Json none = Json::object();
    return none;
}

// Parses a text and keeps only the message that says what is wrong with it.
struct ErrorListener final : nlohmann::json_sax<Json> {
    std::string what;

    bool null() override { return true; }
    bool boolean(bool) override { return true; }
    bool number_integer(number_integer_t) override { return true; }
    bool number_unsigned(number_unsigned_t) override { return true; }
    bool number_float(number_float_t, const string_t&) override { return true; }
    bool string(string_t&) override { return true; }
    bool binary(binary_t&) override { return true; }
    bool start_object(std::size_t) override { return true; }
    bool key(string_t&) override { return true; }
    bool end_object() override { return true; }
    bool start_array(std::size_t) override { return true; }
    bool end_array() override { return true; }
    bool parse_error(std::size_t, const std::string&, const Json::exception& error) override {
        what = error.what();
        return false;
    }
};

// The parser's message for a text that is not JSON. This second pass is the only way to get it
// without an exception.
std::string parse_error_of(std::string_view text) {
    ErrorListener listener;
    Json::sax_parse(text.begin(), text.end(), &listener);
    return listener.what;
}

}  // namespace

JsonObject::JsonObject(const Json& value, std::string path, JsonFault& fault)
    : value_(&value), path_(std::move(path)), fault_(&fault) {
    if (!value.is_object()) {
        if (!fault.error) fault.error = Error{path_ + " is not an object", fault.where, ""};
        value_ = &nothing();
    }
}

void JsonObject::add_fault(const char* key, const std::string& what, const std::string& expected) {
    if (fault_->error) return;
    fault_->error =
        Error{(path_.empty() ? "" : path_ + ".") + key + " " + what, fault_->where, expected};
}

const Json* JsonObject::member(const char* key) {
    const auto found = value_->find(key);
    if (found == value_->end()) {
        add_fault(key, "is missing");
        return nullptr;
    }
    return &*found;
}

bool JsonObject::has(const char* key) const {
    const auto found = value_->find(key);
    return found != value_->end() && !found->is_null();
}

std::vector<std::string> JsonObject::keys() const {
    std::vector<std::string> out;
    for (const auto& item : value_->items()) out.push_back(item.key());
    return out;
}

std::string JsonObject::text(const char* key) {
    const Json* found = member(key);
    if (!found) return {};
    if (!found->is_string()) {
        add_fault(key, "is not text");
        return {};
    }
    return found->get<std::string>();
}

std::string JsonObject::text_or(const char* key, const std::string& otherwise) {
    return has(key) ? text(key) : otherwise;
}

bool JsonObject::flag_or(const char* key, bool otherwise) {
    if (!has(key)) return otherwise;
    const Json* found = member(key);
    if (!found->is_boolean()) {
        add_fault(key, "is neither true nor false");
        return otherwise;
    }
    return found->get<bool>();
}

double JsonObject::number(const char* key) {
    const Json* found = member(key);
    if (!found) return 0;
    if (!found->is_number() || !std::isfinite(found->get<double>())) {
        add_fault(key, "is not a number");
        return 0;
    }
    return found->get<double>();
}

double JsonObject::number_or(const char* key, double otherwise) {
    return has(key) ? number(key) : otherwise;
}

std::int64_t JsonObject::integer(const char* key, std::int64_t low, std::int64_t high) {
    const double value = number(key);
    if (value != std::floor(value) || value < static_cast<double>(low) ||
        value > static_cast<double>(high)) {
        add_fault(
            key, "is out of range",
            "expected a whole number from " + std::to_string(low) + " to " + std::to_string(high));
        return low;
    }
    return static_cast<std::int64_t>(value);
}

std::int64_t JsonObject::integer_or(const char* key,
                                    std::int64_t otherwise,
                                    std::int64_t low,
                                    std::int64_t high) {
    return has(key) ? integer(key, low, high) : otherwise;
}

std::vector<double> JsonObject::numbers(const char* key, std::size_t count) {
    const Json* found = member(key);
    std::vector<double> values;
    if (found && (!found->is_array() || (count != 0 && found->size() != count))) {
        add_fault(key, "has the wrong shape",
                  "expected a list of " + std::to_string(count) + " numbers");
    } else if (found) {
        values.reserve(found->size());
        for (const Json& item : *found) {
            if (!item.is_number() || !std::isfinite(item.get<double>())) {
                add_fault(key, "holds something that is not a number");
                break;
            }
            values.push_back(item.get<double>());
        }
    }
    if (!ok() && count != 0) values.assign(count, 0);
    return values;
}

std::vector<std::string> JsonObject::texts_or_none(const char* key) {
    std::vector<std::string> out;
    if (!has(key)) return out;
    const Json* found = member(key);
    if (!found->is_array()) add_fault(key, "is not a list");
    if (!ok()) return out;
    for (const Json& item : *found) {
        if (!item.is_string()) {
            add_fault(key, "holds something that is not text");
            return out;
        }
        out.push_back(item.get<std::string>());
    }
    return out;
}

Vector3 JsonObject::vector(const char* key) {
    const std::vector<double> v = numbers(key, 3);
    return {v[0], v[1], v[2]};
}

Point3 JsonObject::point(const char* key) {
    const std::vector<double> v = numbers(key, 3);
    return {v[0], v[1], v[2]};
}

JsonObject JsonObject::object(const char* key) {
    const Json* found = member(key);
    return JsonObject(found ? *found : nothing(), (path_.empty() ? "" : path_ + ".") + key,
                      *fault_);
}

std::vector<JsonObject> JsonObject::objects(const char* key) {
    std::vector<JsonObject> out;
    const Json* found = member(key);
    if (found && !found->is_array()) add_fault(key, "is not a list");
    if (!found || !ok()) return out;
    const std::string base = (path_.empty() ? "" : path_ + ".") + key;
    for (std::size_t i = 0; i < found->size(); ++i) {
        out.emplace_back((*found)[i], base + "[" + std::to_string(i) + "]", *fault_);
    }
    return out;
}

void expect_format(JsonObject& object, const char* format, int version, const std::string& verb) {
    if (object.text("format") != format) {
        object.add_fault("format", "is not '" + std::string(format) + "'",
                         "give a file made by sonocase " + verb);
    }
    if (object.integer("version", 0, INT32_MAX) > version) {
        object.add_fault("version", "is newer than this program",
                         "update it or " + verb + " again");
    }
}

bool parse_json(std::string_view text, Json& out, JsonFault& fault) {
    out = Json::parse(text.begin(), text.end(), nullptr, false);
    if (out.is_discarded()) {
        std::string what = parse_error_of(text);
        const std::size_t start = what.find("parse error");
        what = start == std::string::npos ? "is not JSON" : what.substr(start);
        std::replace(what.begin(), what.end(), '\n', ' ');
        fault.error = Error{what, fault.where, "JSON is expected"};
        return false;
    }
    if (!out.is_object()) {
        fault.error = Error{"is not a JSON object", fault.where, ""};
        return false;
    }
    return true;
}

std::string json_text(const Json& value, bool indented) {
    return value.dump(indented ? 2 : -1, ' ', false, Json::error_handler_t::replace);
}

Json json_number(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json json_of(Vector3 v) {
    return Json::array({v.x, v.y, v.z});
}
Json json_of(Point3 p) {
    return Json::array({p.x, p.y, p.z});
}

Json json_of(const Rigid& t) {
    Json out = Json::object();
    out["rotation"] = t.rotation.m;
    out["translation"] = json_of(t.translation);
    return out;
}

Rigid rigid_from(JsonObject object) {
    Rigid t;
    const std::vector<double> m = object.numbers("rotation", 9);
    std::copy(m.begin(), m.end(), t.rotation.m.begin());
    t.translation = object.vector("translation");
    // 1e-3: the rounding of nine entries printed with six decimals, with a margin.
    if (object.ok() && (orthonormality_error(t.rotation) > 1e-3 || determinant(t.rotation) < 0)) {
        object.add_fault("rotation", "is not a rotation",
                         "expected nine numbers, row by row, of a right-handed rotation");
    }
    return t;
}

}  // namespace sonocase::detail
