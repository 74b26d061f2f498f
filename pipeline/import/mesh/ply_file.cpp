// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/ply_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

#include "formats/files/atomic_file.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_mesh {
namespace {

enum class Type { i8, u8, i16, u16, i32, u32, f32, f64 };

struct Property {
    std::string name;
    bool is_list = false;
    Type count_type = Type::u8;
    Type type = Type::f32;
};

struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;
};

enum class Form { ascii, little, big };

bool type_named(const std::string& name, Type* type) {
    static const std::pair<const char*, Type> kNames[] = {
        {"char", Type::i8},    {"int8", Type::i8},     {"uchar", Type::u8},
        {"uint8", Type::u8},   {"short", Type::i16},   {"int16", Type::i16},
        {"ushort", Type::u16}, {"uint16", Type::u16},  {"int", Type::i32},
        {"int32", Type::i32},  {"uint", Type::u32},    {"uint32", Type::u32},
        {"float", Type::f32},  {"float32", Type::f32}, {"double", Type::f64},
        {"float64", Type::f64}};
    for (const auto& [known, value] : kNames) {
        if (name == known) {
            *type = value;
            return true;
        }
    }
    return false;
}

template <class T>
double as_double(const std::uint8_t* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
}

// Reads numbers one after the other; `good` becomes false, for good, at the end of the file or at a
// word that is not a number.
class Body {
  public:
    Body(const std::string& bytes, std::size_t at, Form form)
        : bytes_(bytes), at_(at), form_(form) {}

    bool good() const { return good_; }
    std::size_t left() const { return bytes_.size() - at_; }

    double next(Type type) {
        if (!good_) return 0;
        return form_ == Form::ascii ? next_word() : next_binary(type);
    }

  private:
    double next_word() {
        const auto blank = [](char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; };
        while (at_ < bytes_.size() && blank(bytes_[at_])) ++at_;
        const std::size_t first = at_;
        while (at_ < bytes_.size() && !blank(bytes_[at_])) ++at_;
        const auto number = number_in(std::string_view(bytes_).substr(first, at_ - first));
        good_ = number.has_value();
        return number.value_or(0.0);
    }

    double next_binary(Type type) {
        static constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
        const std::size_t size = kSizes[static_cast<int>(type)];
        if (left() < size) {
            good_ = false;
            return 0;
        }
        std::uint8_t raw[8];
        std::memcpy(raw, bytes_.data() + at_, size);
        at_ += size;
        if (form_ == Form::big) std::reverse(raw, raw + size);  // this machine is little-endian
        switch (type) {
            case Type::i8: return as_double<std::int8_t>(raw);
            case Type::u8: return as_double<std::uint8_t>(raw);
            case Type::i16: return as_double<std::int16_t>(raw);
            case Type::u16: return as_double<std::uint16_t>(raw);
            case Type::i32: return as_double<std::int32_t>(raw);
            case Type::u32: return as_double<std::uint32_t>(raw);
            case Type::f32: return as_double<float>(raw);
            case Type::f64: break;
        }
        return as_double<double>(raw);
    }

    const std::string& bytes_;
    std::size_t at_;
    Form form_;
    bool good_ = true;
};

struct Header {
    Form form = Form::ascii;
    std::vector<Element> elements;
    std::size_t body = 0;
};

Result<Header> parse_header(const std::string& bytes, const std::string& path) {
    const auto bad = [&](const std::string& what) {
        return Error{what, path, "expected a PLY file; check that it is complete, export it again"};
    };
    if (!bytes.starts_with("ply")) return bad("not a PLY file");
    Header header;
    std::size_t at = 0;
    for (int line_number = 1;; ++line_number) {
        const std::size_t end = bytes.find('\n', at);
        if (end == std::string::npos) return bad("PLY header is cut off");
        std::istringstream line(bytes.substr(at, end - at));
        at = end + 1;
        std::string word, type, count_type, name;
        line >> word;
        if (word == "end_header") break;
        if (word == "format") {
            line >> type;
            if (type == "ascii")
                header.form = Form::ascii;
            else if (type == "binary_little_endian")
                header.form = Form::little;
            else if (type == "binary_big_endian")
                header.form = Form::big;
            else
                return bad("PLY format '" + type + "' is unknown");
        } else if (word == "element") {
            Element element;
            line >> element.name >> element.count;
            if (!line)
                return bad("PLY header, line " + std::to_string(line_number) + " has no count");
            header.elements.push_back(element);
        } else if (word == "property") {
            Property property;
            line >> type;
            property.is_list = type == "list";
            if (property.is_list) line >> count_type >> type;
            line >> name;
            property.name = name;
            if (!line || header.elements.empty() || !type_named(type, &property.type) ||
                (property.is_list && !type_named(count_type, &property.count_type)))
                return bad("PLY header, line " + std::to_string(line_number) +
                           " is not a property");
            header.elements.back().properties.push_back(property);
        }
    }
    header.body = at;
    return header;
}

}  // namespace

Result<PolygonFile> read_ply_file(const std::string& path) {
    SONOCASE_TRY(auto bytes, read_text_file(path));
    SONOCASE_TRY(auto header, parse_header(bytes, path));
    PolygonFile file;
    Body body(bytes, header.body, header.form);
    for (const Element& element : header.elements) {
        const auto cut_off = [&](std::uint64_t read) {
            return Error{"file ends or is damaged after " + std::to_string(read) + " of " +
                             std::to_string(element.count) + " '" + element.name + "' entries",
                         path, "check that the file is complete; export it again"};
        };
        // An entry takes at least one byte in either form; one without properties means damage.
        if (element.count > body.left()) return cut_off(0);
        const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
        const bool has_normals =
            is_vertex && std::any_of(element.properties.begin(), element.properties.end(),
                                     [](const Property& p) { return p.name == "nx"; });
        if (is_vertex) file.points.reserve(file.points.size() + element.count);
        if (is_face) file.ends.reserve(element.count);
        if (is_face) file.corners.reserve(3 * element.count);
        for (std::uint64_t n = 0; n < element.count; ++n) {
            Point3 point{NAN, NAN, NAN};
            Vector3 normal;
            for (const Property& property : element.properties) {
                if (!property.is_list) {
                    const double value = body.next(property.type);
                    if (!is_vertex) continue;
                    if (property.name == "x") point.x = value;
                    if (property.name == "y") point.y = value;
                    if (property.name == "z") point.z = value;
                    if (property.name == "nx") normal.x = value;
                    if (property.name == "ny") normal.y = value;
                    if (property.name == "nz") normal.z = value;
                    continue;
                }
                const double count = body.next(property.count_type);
                if (!body.good() || !(count >= 0) || count > static_cast<double>(body.left()))
                    return cut_off(n);
                const std::size_t first = file.corners.size();
                const bool is_polygon = is_face && (property.name == "vertex_indices" ||
                                                    property.name == "vertex_index");
                for (int c = 0; c < static_cast<int>(count); ++c) {
                    const double corner = body.next(property.type);
                    if (!is_polygon) continue;
                    if (!(corner >= 0) || corner >= static_cast<double>(file.points.size()))
                        return Error{
                            "face " + std::to_string(n) + " names a vertex that does not exist",
                            path, "check that the file is complete; export it again"};
                    file.corners.push_back(static_cast<std::uint32_t>(corner));
                }
                if (is_polygon && file.corners.size() - first >= 3) {
                    file.ends.push_back(file.corners.size());
                } else {
                    file.corners.resize(first);
                }
            }
            if (!body.good()) return cut_off(n);
            if (is_vertex) file.points.push_back(point);
            if (has_normals) file.normals.push_back(normal);
        }
    }
    if (file.normals.size() != file.points.size()) file.normals.clear();
    return file;
}

}  // namespace sonocase::pipeline::inline import_mesh
