// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/polygon_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>

#include "formats/files/atomic_file.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_mesh {
namespace {

enum class Type { i8, u8, i16, u16, i32, u32, f32, f64, i64 };

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
    std::size_t at() const { return at_; }

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
        static constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8, 8};
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
            case Type::i64: return as_double<std::int64_t>(raw);
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
    Axes axes = Axes::unsaid;
};

Result<Header> parse_header(const std::string& bytes, const std::string& path) {
    const auto bad = [&](const std::string& what) {
        return Error{what, path, "expected a PLY file; check that it is complete, export it again"};
    };
    if (!bytes.starts_with("ply")) return bad("not a PLY file");
    Header header;
    std::size_t at = 0;
    // Some programs end lines with a carriage return alone.
    const std::size_t first_end = bytes.find_first_of("\r\n");
    const bool returns =
        first_end < bytes.size() - 1 && bytes[first_end] == '\r' && bytes[first_end + 1] != '\n';
    for (int line_number = 1;; ++line_number) {
        const std::size_t end = bytes.find(returns ? '\r' : '\n', at);
        if (end == std::string::npos) return bad("PLY header is cut off");
        const std::string text = bytes.substr(at, end - at);
        std::istringstream line(text);
        at = end + 1;
        std::string word, type, count_type, name;
        line >> word;
        if (word == "comment" || word == "obj_info") {
            SONOCASE_TRY(const Axes axes, axes_said(text, path));
            if (axes != Axes::unsaid) header.axes = axes;
        }
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
            property.name = lower_case(name);
            if (!line || header.elements.empty() || !type_named(type, &property.type) ||
                (property.is_list && !type_named(count_type, &property.count_type)))
                return bad("PLY header, line " + std::to_string(line_number) +
                           " is not a property");
            header.elements.back().properties.push_back(property);
        }
    }
    header.body = at;
    for (const Element& element : header.elements)
        for (const char* axis : {"x", "y", "z"})
            if (element.name == "vertex" &&
                std::none_of(element.properties.begin(), element.properties.end(),
                             [&](const Property& p) { return p.name == axis && !p.is_list; }))
                return bad(std::string("vertices of a PLY file without the property ") + axis);
    return header;
}

Error no_such_vertex(std::uint64_t face, const std::string& path) {
    return {"face " + std::to_string(face) + " names a vertex that does not exist", path,
            "check that the file is complete; export it again"};
}

// The corners of strips one after another, as VTK's cells and Stanford's old scans have them; -1
// begins another strip. Every second triangle is turned.
void add_strips(const std::vector<double>& strip, PolygonFile& file) {
    std::size_t first = 0;
    for (std::size_t n = 0; n < strip.size(); ++n) {
        if (strip[n] < 0) {
            first = n + 1;
            continue;
        }
        if (n < first + 2) continue;
        const bool turned = (n - first) % 2 != 0;
        const double corners[3] = {strip[n - 2], strip[n - (turned ? 0 : 1)],
                                   strip[n - (turned ? 1 : 0)]};
        if (corners[0] == corners[1] || corners[1] == corners[2] || corners[0] == corners[2])
            continue;
        for (const double corner : corners)
            file.corners.push_back(static_cast<std::uint32_t>(corner));
        file.ends.push_back(file.corners.size());
    }
}

}  // namespace

Result<PolygonFile> read_ply_file(const std::string& path) {
    SONOCASE_TRY(auto bytes, read_text_file(path));
    SONOCASE_TRY(auto header, parse_header(bytes, path));
    PolygonFile file;
    file.axes = header.axes;
    Body body(bytes, header.body, header.form);
    for (const Element& element : header.elements) {
        const auto cut_off = [&](std::uint64_t read) {
            return Error{"file ends or is damaged after " + std::to_string(read) + " of " +
                             std::to_string(element.count) + " '" + element.name + "' entries",
                         path, "check that the file is complete; export it again"};
        };
        // An entry takes at least one byte in either form; one without properties means damage.
        if (element.count > body.left()) return cut_off(0);
        const bool is_vertex = element.name == "vertex", is_strip = element.name == "tristrips",
                   is_face = element.name == "face" || is_strip;
        std::vector<double> strip;
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
                strip.clear();
                for (int c = 0; c < static_cast<int>(count); ++c) {
                    const double corner = body.next(property.type);
                    if (!is_polygon) continue;
                    if (is_strip && corner == -1) {
                        strip.push_back(corner);
                        continue;
                    }
                    if (!(corner >= 0) || corner > UINT32_MAX) return no_such_vertex(n, path);
                    if (is_strip)
                        strip.push_back(corner);
                    else
                        file.corners.push_back(static_cast<std::uint32_t>(corner));
                }
                add_strips(strip, file);
                if (is_strip) continue;
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
    // Faces may stand before the vertices.
    for (std::size_t c = 0; c < file.corners.size(); ++c)
        if (file.corners[c] >= file.points.size())
            return no_such_vertex(
                static_cast<std::uint64_t>(std::upper_bound(file.ends.begin(), file.ends.end(), c) -
                                           file.ends.begin()),
                path);
    if (file.normals.size() != file.points.size()) file.normals.clear();
    return file;
}

namespace {

bool vtk_type_named(std::string word, Type* type) {
    word = lower_case(word);
    static const std::pair<const char*, Type> kNames[] = {
        {"char", Type::i8},          {"signed_char", Type::i8},     {"unsigned_char", Type::u8},
        {"short", Type::i16},        {"unsigned_short", Type::u16}, {"int", Type::i32},
        {"unsigned_int", Type::u32}, {"float", Type::f32},          {"double", Type::f64},
        {"long", Type::i64},         {"vtkidtype", Type::i32},      {"vtktypeint64", Type::i64},
        {"vtktypeint32", Type::i32}, {"vtktypeuint32", Type::u32}};
    for (const auto& [known, value] : kNames) {
        if (word == known) {
            *type = value;
            return true;
        }
    }
    return false;
}

// The parts of a legacy VTK file one after another: lines of words, and blocks of numbers.
class VtkReader {
  public:
    VtkReader(const std::string& bytes, const std::string& path) : bytes_(bytes), path_(path) {}

    Result<PolygonFile> read() {
        if (!bytes_.starts_with("# vtk DataFile Version")) return bad("not a legacy VTK file");
        std::istringstream version(line().substr(22));
        version >> version_;
        SONOCASE_TRY(file_.axes, axes_said(line(), path_ + ":2"));
        const std::string form = lower_case(trimmed(line()));
        if (form != "ascii" && form != "binary") return bad("neither ASCII nor BINARY");
        form_ = form == "ascii" ? Form::ascii : Form::big;
        std::istringstream set(next_line());
        std::string word, kind;
        set >> word >> kind;
        if (lower_case(word) != "dataset" || lower_case(kind) != "polydata")
            return Error{"the data set is '" + kind + "' and not POLYDATA", path_,
                         "export the surface as polygons (in ParaView: Extract Surface)"};
        while (at_ < bytes_.size()) {
            std::istringstream words(next_line());
            std::string key;
            words >> key;
            key = lower_case(key);
            if (key == "point_data" || key == "cell_data") break;
            SONOCASE_TRY_DONE(read_part(key, words));
        }
        if (file_.points.empty()) return bad("VTK file has no points");
        for (const std::uint32_t corner : file_.corners)
            if (corner >= file_.points.size())
                return bad("a polygon names a vertex that does not exist");
        return std::move(file_);
    }

  private:
    Error bad(const std::string& what) const { return {what, path_, kExportMeshAgain}; }

    std::string line() {
        const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
        std::string text = bytes_.substr(at_, std::min<std::size_t>(end - at_, 4096));
        at_ = std::min(end + 1, bytes_.size());
        return text;
    }
    std::string next_line() {
        std::string text;
        while (at_ < bytes_.size() && trimmed(text).empty()) text = line();
        return text;
    }

    // use(value) is called `count` times.
    template <class Use>
    Status numbers(std::uint64_t count, Type type, const std::string& what, Use use) {
        Body body(bytes_, at_, form_);
        if (count > body.left()) return bad("file ends before its " + what);
        for (std::uint64_t n = 0; n < count; ++n) {
            const double value = body.next(type);
            if (!body.good())
                return bad("file ends or is damaged after " + std::to_string(n) + " of " +
                           std::to_string(count) + " numbers of its " + what);
            use(value);
        }
        at_ = body.at();
        return Done{};
    }

    Status read_part(const std::string& key, std::istringstream& words) {
        if (key == "points") return read_points(words);
        if (key == "polygons" || key == "triangle_strips")
            return read_cells(words, key, key == "polygons" ? Cells::polygons : Cells::strips);
        if (key == "vertices" || key == "lines") return read_cells(words, key, Cells::skipped);
        if (key == "field") return skip_field(words);
        if (key == "metadata") {
            while (at_ < bytes_.size() && !trimmed(line()).empty()) {
            }
            return Done{};
        }
        if (key.empty()) return Done{};
        return bad("VTK file has a part '" + key.substr(0, 40) + "', which is not known");
    }

    Status read_points(std::istringstream& words) {
        std::uint64_t count = 0;
        std::string word;
        Type type;
        if (!(words >> count >> word) || !vtk_type_named(word, &type) || count > bytes_.size())
            return bad("VTK file has no number and type of points");
        double p[3];
        std::uint64_t n = 0;
        file_.points.clear();
        file_.points.reserve(count);
        return numbers(3 * count, type, "points", [&](double value) {
            p[n % 3] = value;
            if (++n % 3 == 0) file_.points.push_back({p[0], p[1], p[2]});
        });
    }

    enum class Cells { polygons, strips, skipped };

    void add_cell(const std::vector<double>& cell, Cells kind) {
        const auto corner = [&](std::size_t n) {
            // Beyond the range of an index: refused as one that names no vertex.
            return cell[n] >= 0 && cell[n] < 4294967295.0 ? static_cast<std::uint32_t>(cell[n])
                                                          : 4294967295u;
        };
        if (cell.size() < 3 || kind == Cells::skipped) return;
        if (kind == Cells::polygons) {
            for (std::size_t n = 0; n < cell.size(); ++n) file_.corners.push_back(corner(n));
            file_.ends.push_back(file_.corners.size());
            return;
        }
        for (std::size_t n = 0; n + 2 < cell.size(); ++n) {
            const std::size_t odd = n % 2;
            for (const std::size_t c : {n, n + 1 + odd, n + 2 - odd})
                file_.corners.push_back(corner(c));
            file_.ends.push_back(file_.corners.size());
        }
    }

    Status read_cells(std::istringstream& words, const std::string& key, Cells kind) {
        std::uint64_t first = 0, second = 0;
        if (!(words >> first >> second)) return bad("VTK file has no number of " + key);
        std::vector<double> cell;
        if (version_ < 5) {
            std::uint64_t left = 0, cells = 0;
            SONOCASE_TRY_DONE(numbers(second, Type::i32, key, [&](double value) {
                if (left == 0) {
                    left =
                        value >= 0 && value < 4294967295.0 ? static_cast<std::uint64_t>(value) : 0;
                    ++cells;
                    return;
                }
                cell.push_back(value);
                if (--left > 0) return;
                add_cell(cell, kind);
                cell.clear();
            }));
            if (left > 0 || cells != first) return bad("VTK file's " + key + " are damaged");
            return Done{};
        }
        std::vector<double> offsets, corners;
        SONOCASE_TRY_DONE(read_list("offsets", first, offsets));
        SONOCASE_TRY_DONE(read_list("connectivity", second, corners));
        for (std::size_t n = 0; n + 1 < offsets.size(); ++n) {
            if (!(offsets[n] >= 0) || !(offsets[n + 1] >= offsets[n]) ||
                offsets[n + 1] > static_cast<double>(corners.size()))
                return bad("VTK file's " + key + " are damaged");
            cell.assign(corners.begin() + static_cast<std::ptrdiff_t>(offsets[n]),
                        corners.begin() + static_cast<std::ptrdiff_t>(offsets[n + 1]));
            add_cell(cell, kind);
        }
        return Done{};
    }

    Status read_list(const char* name, std::uint64_t count, std::vector<double>& out) {
        std::istringstream words(next_line());
        std::string key, word;
        Type type;
        words >> key >> word;
        if (lower_case(key) != name || !vtk_type_named(word, &type) || count > bytes_.size())
            return bad(std::string("VTK file lacks the list '") + name + "'");
        out.reserve(count);
        return numbers(count, type, name, [&](double value) { out.push_back(value); });
    }

    Status skip_field(std::istringstream& words) {
        std::string name;
        std::uint64_t arrays = 0;
        words >> name >> arrays;
        for (std::uint64_t n = 0; n < arrays && at_ < bytes_.size(); ++n) {
            std::istringstream array(next_line());
            std::uint64_t components = 0, tuples = 0;
            std::string word;
            Type type;
            array >> name >> components >> tuples >> word;
            if (lower_case(name) == "metadata") {
                while (at_ < bytes_.size() && !trimmed(line()).empty()) {
                }
                --n;
                continue;
            }
            if (lower_case(word) == "string" && form_ == Form::ascii) {
                for (std::uint64_t t = 0; t < components * tuples && at_ < bytes_.size(); ++t) {
                    const std::string value = next_line();
                    if (lower_case(name) != "space") continue;
                    SONOCASE_TRY(file_.axes, axes_said("SPACE=" + value, path_));
                }
                continue;
            }
            if (!vtk_type_named(word, &type) || components > bytes_.size() ||
                tuples > bytes_.size())
                return bad("VTK file has a field of type '" + word.substr(0, 40) +
                           "', which is not read");
            SONOCASE_TRY_DONE(numbers(components * tuples, type, "field", [](double) {}));
        }
        return Done{};
    }

    const std::string& bytes_;
    const std::string& path_;
    PolygonFile file_;
    double version_ = 0;
    Form form_ = Form::ascii;
    std::size_t at_ = 0;
};

}  // namespace

Result<PolygonFile> read_vtk_file(const std::string& path) {
    SONOCASE_TRY(const auto bytes, read_text_file(path));
    return VtkReader(bytes, path).read();
}

bool is_vtk_surface(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    std::string head(1024, '\0');
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    head = lower_case(head.substr(0, static_cast<std::size_t>(in.gcount())));
    const std::size_t set = head.find("\ndataset");
    return head.starts_with("# vtk") && set != head.npos &&
           head.find("polydata", set) < head.find('\n', set + 1);
}

namespace {

class StlText {
  public:
    StlText(std::string_view text, const std::string& path) : text_(text), path_(path) {}

    Result<TriangleFile> read() {
        bool open = false;
        int solids = 0, corners = 0;
        for (std::string word = next(); !word.empty(); word = next()) {
            if (word == "solid" || word == "endsolid") {
                open = word == "solid";
                solids += open;
                const std::size_t end = std::min(text_.find_first_of("\n\r", at_), text_.size());
                SONOCASE_TRY(const Axes axes, axes_said(text_.substr(at_, end - at_), path_));
                if (axes != Axes::unsaid) file_.axes = axes;
                at_ = end;
            } else if (word == "vertex") {
                if (++corners > 3)
                    return Error{"a facet has more than three corners", where(),
                                 "cut its polygons into triangles and export it again"};
                for (int axis = 0; axis < 3; ++axis) {
                    const std::string number = next();
                    const auto value = number_in(number);
                    if (!value)
                        return Error{"'" + number.substr(0, 40) + "' is not a number", where(),
                                     kExportMeshAgain};
                    file_.corners.push_back(static_cast<float>(*value));
                }
            } else if (word == "endfacet") {
                if (corners != 3)
                    return Error{"a facet has " + std::to_string(corners) + " corners", where(),
                                 kExportMeshAgain};
                corners = 0;
            }
        }
        if (solids == 0) return Error{"not an STL file", path_, kExportMeshAgain};
        if (open || corners != 0)
            return Error{"STL file is cut off: its last line is not 'endsolid'", path_,
                         "export it again; if it is whole, add the line endsolid"};
        return std::move(file_);
    }

  private:
    std::string next() {
        const char* blanks = " \t\r\n\f\v";
        at_ = std::min(text_.find_first_not_of(blanks, at_), text_.size());
        const std::size_t end = std::min(text_.find_first_of(blanks, at_), text_.size());
        const std::string word = lower_case(text_.substr(at_, end - at_));
        at_ = end;
        return word;
    }
    std::string where() const {
        const auto lines = std::count(text_.begin(), text_.begin() + static_cast<long>(at_), '\n');
        return path_ + ":" + std::to_string(1 + lines);
    }

    std::string_view text_;
    const std::string& path_;
    TriangleFile file_;
    std::size_t at_ = 0;
};

bool is_stl_text(std::string_view bytes) {
    const std::string head = lower_case(bytes.substr(0, 4096));
    const std::size_t first = head.find_first_not_of(" \t\r\n");
    return first != head.npos && head.find('\0') == head.npos &&
           head.compare(first, 5, "solid") == 0 &&
           (head.find("facet", first) != head.npos || head.find("endsolid", first) != head.npos);
}

// The two bytes behind a triangle say how many of the writer's own follow; most programs put a
// colour or anything there, and no bytes.
std::size_t attribute_bytes(std::string_view bytes, std::size_t at) {
    std::uint16_t own = 0;
    std::memcpy(&own, bytes.data() + at + 48, sizeof own);
    return own;
}

// Whether those numbers account for the file's length.
bool more_behind_triangles(std::string_view bytes, std::uint32_t count) {
    std::size_t at = 84;
    for (std::uint32_t n = 0; n < count; ++n) {
        if (bytes.size() - at < 50) return false;
        at += 50 + attribute_bytes(bytes, at);
        if (at > bytes.size()) return false;
    }
    return at == bytes.size();
}

}  // namespace

Result<TriangleFile> read_stl_file(const std::string& path) {
    SONOCASE_TRY(const auto raw, read_large_file(path));
    std::string_view bytes(reinterpret_cast<const char*>(raw.data()), raw.size());
    std::uint32_t count = 0;
    if (bytes.size() >= 84) std::memcpy(&count, bytes.data() + 80, sizeof count);
    const std::uint64_t size = 84 + 50ull * count;
    if (bytes.size() < 84 || bytes.size() != size) {
        if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF"))
            return Error{"the text is UTF-16", path, "save it as UTF-8"};
        std::string_view text = bytes;
        if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
        if (is_stl_text(text)) return StlText(text, path).read();
        if (bytes.size() < 84) return Error{"not an STL file", path, kExportMeshAgain};
        if (bytes.size() < size)
            return Error{"STL file is cut off: it holds " +
                             std::to_string((bytes.size() - 84) / 50) + " of " +
                             std::to_string(count) + " triangles",
                         path, kExportMeshAgain};
        if (count == 0)
            return Error{"STL file says that it holds no triangle", path, kExportMeshAgain};
    }
    TriangleFile file;
    const std::string header(bytes.substr(0, 80));
    SONOCASE_TRY(file.axes, axes_said(header.substr(0, header.find('\0')), path));
    file.corners.resize(9ull * count);
    const bool more = bytes.size() > size && more_behind_triangles(bytes, count);
    std::size_t at = 84;
    for (std::uint64_t n = 0; n < count; ++n) {
        std::memcpy(&file.corners[9 * n], bytes.data() + at + 12, 36);
        at += 50 + (more ? attribute_bytes(bytes, at) : 0);
    }
    // A second solid, or a count that was never set right.
    constexpr std::size_t kTail = 134;
    if (bytes.size() - at >= kTail)
        return Error{"STL file holds " + std::to_string(bytes.size() - at) + " bytes behind the " +
                         std::to_string(count) + " triangles that it says it has",
                     path, "join its solids into one mesh and export it again"};
    return file;
}

}  // namespace sonocase::pipeline::inline import_mesh
