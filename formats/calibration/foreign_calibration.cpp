// SPDX-License-Identifier: Apache-2.0

#include "formats/calibration/foreign_calibration.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "formats/recording/sequence.h"
#include "formats/text/lower_case.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

using Matrix4 = std::array<double, 16>;

Matrix4 product(const Matrix4& a, const Matrix4& b) {
    Matrix4 out{};
    for (std::size_t r = 0; r < 4; ++r) {
        for (std::size_t c = 0; c < 4; ++c) {
            for (std::size_t k = 0; k < 4; ++k) out[4 * r + c] += a[4 * r + k] * b[4 * k + c];
        }
    }
    return out;
}

// Of an affine map; empty where it flattens space.
std::optional<Matrix4> inverse_of(const Matrix4& m) {
    Matrix3 a;
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) a.m[3 * r + c] = m[4 * r + c];
    }
    const double volume = determinant(a);
    if (!(std::abs(volume) > 1e-12)) return {};
    const Vector3 x = a.column(0), y = a.column(1), z = a.column(2);
    const Vector3 rows[3] = {cross(y, z) / volume, cross(z, x) / volume, cross(x, y) / volume};
    const Vector3 t{m[3], m[7], m[11]};
    Matrix4 out{};
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) out[static_cast<std::size_t>(4 * r + c)] = rows[r][c];
        out[static_cast<std::size_t>(4 * r + 3)] = -dot(rows[r], t);
    }
    out[15] = 1;
    return out;
}

// Numbers between blanks, commas, semicolons and brackets; empty if another word is among them.
std::optional<std::vector<double>> numbers_in(std::string_view text) {
    constexpr std::string_view kBetween = " \t\r\n,;[]()";
    std::vector<double> out;
    while (true) {
        const std::size_t from = text.find_first_not_of(kBetween);
        if (from == std::string_view::npos) return out;
        text.remove_prefix(from);
        const std::size_t end = std::min(text.find_first_of(kBetween), text.size());
        double value = 0;
        if (!parse_number(text.substr(0, end), value) || out.size() > 64) return {};
        out.push_back(value);
        text.remove_prefix(end);
    }
}

// The same for the cells of a matrix. Commas are decimal where semicolons stand between cells, of
// which a matrix has more than rows, and no point does.
std::optional<std::vector<double>> matrix_cells(std::string_view text) {
    const bool decimal =
        std::count(text.begin(), text.end(), ';') > 8 && text.find('.') == std::string_view::npos;
    if (!decimal) return numbers_in(text);
    std::string with_points(text);
    std::replace(with_points.begin(), with_points.end(), ',', '.');
    return numbers_in(with_points);
}

bool holds(std::string_view text, std::string_view word) {
    const auto same = [](char a, char b) { return lower_case(a) == b; };
    return std::search(text.begin(), text.end(), word.begin(), word.end(), same) != text.end();
}

std::string attribute(std::string_view element, std::string_view name) {
    for (std::size_t at = element.find(name); at != std::string_view::npos;
         at = element.find(name, at + 1)) {
        const std::size_t sign = at + name.size();
        const bool starts = at > 0 && std::isspace(static_cast<unsigned char>(element[at - 1]));
        if (!starts || sign + 1 >= element.size() || element[sign] != '=') continue;
        const std::size_t end = element.find(element[sign + 1], sign + 2);
        if (end == std::string_view::npos) return {};
        return std::string(element.substr(sign + 2, end - sign - 2));
    }
    return {};
}

struct NamedMatrix {
    std::string from, to;
    Matrix4 to_from{};
    std::string date;
    double rms_mm = -1;
};

// The elements of XML: without comments and character data, in which elements are text.
std::string without_comments(std::string_view xml) {
    std::string out;
    while (true) {
        const std::size_t comment = xml.find("<!--"), data = xml.find("<![CDATA[");
        const std::size_t from = std::min(comment, data);
        out += xml.substr(0, from);
        if (from == std::string_view::npos) return out;
        const std::string_view end = comment < data ? "-->" : "]]>";
        const std::size_t to = xml.find(end, from + 4);
        if (to == std::string_view::npos) return out;
        xml.remove_prefix(to + end.size());
    }
}

Result<std::vector<NamedMatrix>> transforms_of_xml(std::string_view xml, const std::string& where) {
    const std::string text = without_comments(xml);
    std::vector<NamedMatrix> out;
    for (std::size_t at = text.find("<Transform"); at != std::string_view::npos;
         at = text.find("<Transform", at + 1)) {
        const std::size_t end = text.find('>', at);
        if (end == std::string_view::npos)
            return Error{"ends inside an element", where, "copy the file again"};
        const std::string_view element = std::string_view(text).substr(at, end - at);
        NamedMatrix one{
            attribute(element, "From"), attribute(element, "To"), {}, attribute(element, "Date")};
        const auto numbers = numbers_in(attribute(element, "Matrix"));
        if (one.from.empty() || one.to.empty()) continue;
        if (!numbers || numbers->size() != 16)
            return Error{"the matrix from " + one.from + " to " + one.to + " has not 16 numbers",
                         where, "expected 4 rows of 4"};
        std::copy(numbers->begin(), numbers->end(), one.to_from.begin());
        if (!parse_number(attribute(element, "Error"), one.rms_mm)) one.rms_mm = -1;
        out.push_back(std::move(one));
    }
    return out;
}

// The affine map between two frames of a list, composed and inverted where it has to be.
std::optional<Matrix4> map_between(const std::vector<NamedMatrix>& list,
                                   const std::string& from,
                                   const std::string& to) {
    struct Reached {
        std::string frame;
        Matrix4 frame_from_start;
    };
    std::vector<Reached> reached{{from, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}};
    for (std::size_t next = 0; next < reached.size(); ++next) {
        if (reached[next].frame == to) return reached[next].frame_from_start;
        for (const NamedMatrix& one : list) {
            const bool inverted = one.to == reached[next].frame;
            if (!inverted && one.from != reached[next].frame) continue;
            const std::string& other = inverted ? one.from : one.to;
            if (std::any_of(reached.begin(), reached.end(),
                            [&](const Reached& r) { return r.frame == other; }))
                continue;
            const auto step = inverted ? inverse_of(one.to_from) : std::optional(one.to_from);
            if (step) reached.push_back({other, product(*step, reached[next].frame_from_start)});
        }
    }
    return {};
}

Result<Calibration> calibration_of(const char* kind,
                                   const Matrix4& sensor_from_tool,
                                   const std::string& where) {
    const auto rigid = rigid_from_matrix(sensor_from_tool);
    if (!rigid)
        return Error{std::string("the transform of the ") + kind + " is not rigid", where,
                     "expected a rotation without scale or mirror, millimetres, and 0 0 0 1 as "
                     "the last row"};
    Calibration out;
    out.kind = kind;
    out.sensor_from_tool = {nearest_rotation(rigid->rotation), rigid->translation};
    return out;
}

Result<std::vector<Calibration>> parse_plus(std::string_view text, const std::string& where) {
    SONOCASE_TRY(const std::vector<NamedMatrix> list, transforms_of_xml(text, where));
    std::vector<Calibration> out;
    std::string names;
    const auto add = [&](const char* kind, const Matrix4& map, const NamedMatrix* said) -> Status {
        if (std::any_of(out.begin(), out.end(),
                        [&](const Calibration& c) { return c.kind == kind; }))
            return Done{};
        SONOCASE_TRY(Calibration one, calibration_of(kind, map, where));
        if (said && said->rms_mm >= 0) one.rms_mm = said->rms_mm;
        out.push_back(std::move(one));
        return Done{};
    };
    // A stylus is another tool: it is taken for the needle only where there is none.
    const auto is_tip = [](const NamedMatrix& one, std::string_view tool) {
        return holds(one.from, tool) && holds(one.from, "tip");
    };
    for (const std::string_view tool : {"needle", "stylus"}) {
        const auto tip = std::find_if(list.begin(), list.end(),
                                      [&](const NamedMatrix& one) { return is_tip(one, tool); });
        if (tip == list.end()) continue;
        SONOCASE_TRY_DONE(add("needle", tip->to_from, &*tip));
        std::string others;
        for (const NamedMatrix& one : list) {
            if (&one != &*tip && (is_tip(one, "needle") || is_tip(one, "stylus")))
                others += (others.empty() ? "" : ", ") + one.from + " to " + one.to;
        }
        if (!others.empty())
            out.back().warnings.push_back(tip->from + " to " + tip->to +
                                          " is the needle; not taken: " + others + ".");
        break;
    }
    for (const NamedMatrix& one : list) {
        names += (names.empty() ? "" : ", ") + one.from + " to " + one.to;
        if (one.from == "Mannequin") SONOCASE_TRY_DONE(add("mannequin", one.to_from, &one));
        if (one.from == "ProbeFace") SONOCASE_TRY_DONE(add("probe", one.to_from, &one));
    }
    if (const auto map = map_between(list, "TransducerOrigin", "Probe")) {
        // PLUS: x along the face, y into the body; ours: x along the face, z into the body.
        constexpr Matrix4 kTurn{1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1};
        SONOCASE_TRY_DONE(add("probe", product(*map, kTurn), nullptr));
    }
    if (out.empty())
        return Error{"holds no transform of a tool; found " + (names.empty() ? "none" : names),
                     where,
                     "expected NeedleTip or StylusTip to their sensor, Mannequin to Reference, or "
                     "TransducerOrigin to Probe"};
    return out;
}

// Flips x and y of both sides: RAS+ and LPS+.
Matrix4 other_axes(Matrix4 m) {
    for (std::size_t r = 0; r < 4; ++r) {
        for (std::size_t c = 0; c < 4; ++c) {
            if ((r < 2) != (c < 2)) m[4 * r + c] = -m[4 * r + c];
        }
    }
    return m;
}

Result<Matrix4> parse_itk(std::string_view text, const std::string& where) {
    std::string_view type, parameters, fixed;
    int count = 0;
    while (!text.empty()) {
        const std::size_t end = text.find('\n');
        const std::string_view line = trimmed(text.substr(0, end));
        text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
        const auto value = [&](std::string_view key) { return trimmed(line.substr(key.size())); };
        if (line.starts_with("Transform:")) type = value("Transform:"), ++count;
        if (line.starts_with("Parameters:")) parameters = value("Parameters:");
        if (line.starts_with("FixedParameters:")) fixed = value("FixedParameters:");
    }
    if (count != 1)
        return Error{"holds " + std::to_string(count) + " transforms", where, "expected one"};
    if (!type.starts_with("AffineTransform_") && !type.starts_with("MatrixOffsetTransformBase_"))
        return Error{"holds a transform of type " + std::string(type.substr(0, 60)), where,
                     "save it from 3D Slicer as a linear transform (AffineTransform_double_3_3)"};
    const auto p = numbers_in(parameters), c = numbers_in(fixed);
    if (!p || p->size() != 12 || !c || (!c->empty() && c->size() != 3))
        return Error{"has not 12 parameters and a centre", where, "save it again"};
    Matrix4 lps{};
    for (std::size_t r = 0; r < 3; ++r) {
        // x' = M (x - c) + t + c
        double at = (*p)[9 + r] + (c->empty() ? 0 : (*c)[r]);
        for (std::size_t k = 0; k < 3; ++k) {
            lps[4 * r + k] = (*p)[3 * r + k];
            if (!c->empty()) at -= (*p)[3 * r + k] * (*c)[k];
        }
        lps[4 * r + 3] = at;
    }
    lps[15] = 1;
    const auto to_parent = inverse_of(other_axes(lps));
    if (!to_parent) return Error{"its matrix has no inverse", where, "save it again"};
    return *to_parent;
}

const char* kind_in_name(const std::string& path) {
    const std::string name = path.substr(path.find_last_of('/') + 1);
    if (holds(name, "needle") || holds(name, "stylus")) return "needle";
    if (holds(name, "mannequin") || holds(name, "phantom")) return "mannequin";
    return holds(name, "probe") || holds(name, "transducer") ? "probe" : nullptr;
}

bool is_itk(std::string_view text) {
    return text.starts_with("#Insight Transform File");
}

// ITK's transforms in HDF5 or in MATLAB's form.
bool is_binary(std::string_view text) {
    return text.substr(0, 1024).find('\0') != std::string_view::npos;
}

bool is_xml(std::string_view text) {
    return trimmed(text.substr(0, 512)).starts_with("<") &&
           text.find("<Transform") != std::string_view::npos;
}

std::string matrix_text(const Matrix4& m, const char* row_end) {
    std::string out;
    for (std::size_t i = 0; i < 16; ++i) {
        append_number(out, m[i] == 0 ? 0 : m[i]);
        out += i % 4 == 3 ? row_end : " ";
    }
    return out;
}

}  // namespace

bool looks_like_foreign_calibration(std::string_view text) {
    if (is_itk(text) || is_xml(text) || is_binary(text)) return true;
    const auto numbers = matrix_cells(text);
    return numbers && (numbers->size() == 16 || numbers->size() == 12);
}

Result<std::vector<Calibration>> parse_foreign_calibrations(std::string_view text,
                                                            const std::string& where) {
    if (is_binary(text))
        return Error{"is a binary file", where,
                     "save the transform as text, from 3D Slicer as .tfm or .txt"};
    if (is_xml(text)) return parse_plus(text, where);
    Matrix4 matrix{};
    if (is_itk(text)) {
        SONOCASE_TRY(matrix, parse_itk(text, where));
    } else {
        const auto numbers = matrix_cells(text);
        if (!numbers || (numbers->size() != 16 && numbers->size() != 12))
            return Error{"is no matrix", where, "expected 4 rows of 4 numbers"};
        std::copy(numbers->begin(), numbers->end(), matrix.begin());
        if (numbers->size() == 12) matrix[15] = 1;
        if (matrix[12] != 0 || matrix[13] != 0 || matrix[14] != 0)
            return Error{"the last row of its matrix is not 0 0 0 1", where,
                         "write it row by row, the place in the last column"};
    }
    const char* kind = kind_in_name(where);
    if (!kind)
        return Error{"does not say which tool it is of", where,
                     "name the file needle, probe or mannequin, such as needle.tfm"};
    SONOCASE_TRY(Calibration one, calibration_of(kind, matrix, where));
    return std::vector<Calibration>{std::move(one)};
}

std::string format_foreign_calibration(const Calibration& c, const std::string& path) {
    const Matrix4 matrix = matrix_from_rigid(c.sensor_from_tool);
    if (path.ends_with(".txt")) return matrix_text(matrix, "\n");
    if (path.ends_with(".xml")) {
        const bool needle = c.kind == "needle", probe = c.kind == "probe";
        std::string out = "<PlusConfiguration version=\"2.1\">\n  <CoordinateDefinitions>\n";
        out += std::string("    <Transform From=\"") +
               (needle  ? "NeedleTip"
                : probe ? "ProbeFace"
                        : "Mannequin") +
               "\" To=\"" +
               (needle  ? "Needle"
                : probe ? "Probe"
                        : "Reference") +
               "\" Matrix=\"" + matrix_text(matrix, " ");
        out.pop_back();
        out += "\"";
        if (c.rms_mm >= 0) out += " Error=\"" + number_text(c.rms_mm) + "\"";
        if (!c.date.empty()) out += " Date=\"" + c.date + "\"";
        return out + " />\n  </CoordinateDefinitions>\n</PlusConfiguration>\n";
    }
    if (!path.ends_with(".tfm")) return {};
    const Matrix4 lps = other_axes(matrix_from_rigid(inverse(c.sensor_from_tool)));
    std::string out =
        "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
        "Parameters:";
    const auto add = [&](std::size_t i) { out += " " + number_text(lps[i] == 0 ? 0 : lps[i]); };
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t k = 0; k < 3; ++k) add(4 * r + k);
    }
    for (std::size_t r = 0; r < 3; ++r) add(4 * r + 3);
    return out + "\nFixedParameters: 0 0 0\n";
}

}  // namespace sonocase
