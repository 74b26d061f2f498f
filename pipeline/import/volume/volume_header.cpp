// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/volume_header.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <vector>

#include <bzlib.h>
#include <zlib.h>

#include "formats/files/atomic_file.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_volume {

namespace {

namespace fs = std::filesystem;

constexpr int kMaxHeaderLines = 1000;
constexpr const char* kVoxelsExpected = "expected a file with the voxels";

bool names_many_files(const std::string& data_file) {
    return data_file.find('%') != std::string::npos || lower_case(data_file).starts_with("list");
}

// The number in "%03d" or "%d", with what stands before and after it; nothing for other patterns,
// which the library would hand to printf.
struct NumberedName {
    std::string before, after;
    std::size_t width = 0;
    bool zeros = false;
};
std::optional<NumberedName> numbered_name(const std::string& pattern) {
    const std::size_t sign = pattern.find('%');
    if (sign == std::string::npos || pattern.find('%', sign + 1) != std::string::npos)
        return std::nullopt;
    std::size_t at = sign + 1;
    NumberedName name{pattern.substr(0, sign), {}, 0, false};
    name.zeros = at < pattern.size() && pattern[at] == '0';
    while (at < pattern.size() && pattern[at] >= '0' && pattern[at] <= '9' && name.width < 100)
        name.width = 10 * name.width + static_cast<std::size_t>(pattern[at++] - '0');
    if (at >= pattern.size() || pattern[at] != 'd' || name.width > 20) return std::nullopt;
    name.after = pattern.substr(at + 1);
    return name;
}

std::string beside(const std::string& path, const std::string& data_file) {
    return (fs::path(path).parent_path() / data_file).string();
}

std::string folder_of(const std::string& path) {
    const fs::path folder = fs::path(path).parent_path();
    return folder.empty() ? "." : folder.string();
}

// The value of "data file:" in a NRRD header; empty if the voxels follow the header.
std::string nrrd_data_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::string line;
    for (int n = 0; n < kMaxHeaderLines && std::getline(file, line); ++n) {
        line = std::string(trimmed(line));
        if (line.empty()) break;
        for (const char* key : {"data file:", "datafile:"}) {
            if (lower_case(line).starts_with(key))
                return std::string(trimmed(line.substr(std::char_traits<char>::length(key))));
        }
    }
    return {};
}

// The files of voxels that a header names one by one ("LIST", with a name in each line that
// follows) or by a pattern ("slice%03d.raw 1 48 1"), in order.
Result<std::vector<std::string>> listed_files(const std::string& path,
                                              const std::string& data_file) {
    std::vector<std::string> files;
    if (lower_case(data_file).starts_with("list")) {
        std::ifstream file(path, std::ios::binary);
        std::string line;
        bool listed = false;
        for (int n = 0; n < kMaxHeaderLines + 65535 && std::getline(file, line); ++n) {
            line = std::string(trimmed(line));
            if (listed && !line.empty()) files.push_back(beside(path, line));
            listed = listed || line.ends_with(data_file);
        }
        return files;
    }
    std::vector<std::string> words;
    for (std::string_view rest = data_file; !(rest = trimmed(rest)).empty();) {
        const std::size_t end = std::min(rest.find_first_of(" \t"), rest.size());
        words.emplace_back(rest.substr(0, end));
        rest.remove_prefix(end);
    }
    const auto name = words.empty() ? std::nullopt : numbered_name(words[0]);
    const Error unknown{"the pattern of its data files '" + data_file.substr(0, 60) + "' is none",
                        path, "expected one such as slice%03d.raw 1 48 1: first, last and step"};
    if (!name || words.size() < 3) return unknown;
    const auto first = number_in(words[1]), last = number_in(words[2]),
               step = number_in(words.size() > 3 ? words[3] : "1");
    const auto whole = [](const std::optional<double>& n) {
        return n && std::abs(*n) <= 1e6 && *n == std::floor(*n);
    };
    if (!whole(first) || !whole(last) || !whole(step) || !(*step > 0) || *first < 0) return unknown;
    for (double n = *first; n <= *last && files.size() <= 65535; n += *step) {
        std::string number = std::to_string(static_cast<long>(n));
        if (number.size() < name->width)
            number.insert(0, name->width - number.size(), name->zeros ? '0' : ' ');
        files.push_back(beside(path, name->before + number + name->after));
    }
    return files;
}

// Every file of the list is there: the library below leaves out what is not, without a word.
Status check_listed_files(const std::string& path, const std::string& data_file) {
    SONOCASE_TRY_DONE(check_source_folder(folder_of(path), kVoxelsExpected));
    SONOCASE_TRY(const auto files, listed_files(path, data_file));
    std::error_code code;
    for (const std::string& file : files)
        if (!fs::exists(file, code))
            return Error{
                "its data file " + file + " is not there, one of " + std::to_string(files.size()),
                path, "keep them together, or name those that there are"};
    return Done{};
}

Status check_data_file(const std::string& path, const std::string& data_path) {
    std::error_code code;
    if (!fs::exists(data_path, code))
        return Error{"its data file " + data_path + " is not there", path, "keep the two together"};
    return check_source_file(data_path, kVoxelsExpected);
}

}  // namespace

MetaHeader read_meta_header(const std::string& path) {
    // "Key = value" lines; ElementDataFile is the last, and LOCAL means that the voxels follow it.
    MetaHeader header;
    std::ifstream file(path, std::ios::binary);
    std::string line, data_file;
    std::uint64_t skip = 0;
    for (int n = 0; n < kMaxHeaderLines && data_file.empty() && std::getline(file, line); ++n) {
        const std::size_t equals = line.find('=');
        if (equals == std::string::npos) continue;
        const std::string key(trimmed(lower_case(line.substr(0, equals))));
        const std::string value(trimmed(line.substr(equals + 1)));
        if (key == "elementdatafile") data_file = value;
        if (key == "compresseddata") header.compressed = lower_case(value) == "true";
        if (key == "compresseddatasize")
            header.compressed_bytes =
                static_cast<std::uint64_t>(std::clamp(number_in(value).value_or(0), 0.0, 1e15));
        if (key == "headersize") {
            const double bytes = number_in(value).value_or(0);
            skip = static_cast<std::uint64_t>(std::clamp(bytes, 0.0, 1e15));
            header.voxels_from_end = bytes < 0;
        }
        if (key == "binarydata") header.is_binary = lower_case(value) != "false";
    }
    if (lower_case(data_file) == "local") {
        header.data_path = path;
        header.voxels_at = static_cast<std::uint64_t>(file.tellg());
    } else if (names_many_files(data_file)) {
        header.many_files = true;
        header.data_files = data_file;
        header.voxels_at = skip;
    } else if (!data_file.empty()) {
        header.data_path = beside(path, data_file);
        header.voxels_at = skip;
    }
    return header;
}

namespace {

Error cut_off(std::uint64_t found, std::uint64_t needed, const std::string& path) {
    return {"holds " + std::to_string(found) + " bytes of voxels and its header asks for " +
                std::to_string(needed),
            path, "the file is cut off or damaged; copy or export it again"};
}

// Bytes that a zlib or gzip stream unpacks to; less than `enough` if its end or its checksum is
// missing.
std::uint64_t inflated_bytes(const std::vector<std::uint8_t>& packed,
                             std::size_t at,
                             std::uint64_t enough) {
    z_stream stream{};
    if (inflateInit2(&stream, 15 + 32) != Z_OK) return 0;
    std::vector<std::uint8_t> out(1 << 20);
    std::uint64_t total = 0;
    int status = Z_OK;
    while (status == Z_OK) {
        if (stream.avail_in == 0) {
            const std::size_t piece = std::min<std::size_t>(packed.size() - at, 1u << 30);
            if (piece == 0) break;
            stream.next_in = const_cast<Bytef*>(packed.data() + at);
            stream.avail_in = static_cast<uInt>(piece);
            at += piece;
        }
        stream.next_out = out.data();
        stream.avail_out = static_cast<uInt>(out.size());
        status = inflate(&stream, Z_NO_FLUSH);
        total += out.size() - stream.avail_out;
    }
    inflateEnd(&stream);
    return status == Z_STREAM_END ? total : std::min(total, enough - 1);
}

}  // namespace

namespace {

constexpr const char* kWriteAgain = "write the volume again with its geometry in the header";

Error geometry_not_finite(const std::string& field, const std::string& path) {
    return {"geometry in the header is not a number (" + field + ")", path, kWriteAgain};
}

std::vector<std::string> words_of(std::string_view text) {
    std::vector<std::string> words;
    std::string word;
    for (const char c : text) {
        if (std::isspace(static_cast<unsigned char>(c)) == 0) {
            word += c;
        } else if (!word.empty()) {
            words.push_back(std::move(word));
            word.clear();
        }
    }
    if (!word.empty()) words.push_back(std::move(word));
    return words;
}

// `count` finite numbers in a field; 0: any number of them.
Result<std::vector<double>> finite_numbers(const std::vector<std::string>& cells,
                                           std::size_t count,
                                           const std::string& field,
                                           const std::string& path) {
    std::vector<double> numbers;
    for (const std::string& cell : cells) {
        const auto number = number_in(cell);
        if (!number || !std::isfinite(*number)) return geometry_not_finite(field, path);
        numbers.push_back(*number);
    }
    if (count > 0 && numbers.size() != count)
        return Error{field + " of the header holds " + std::to_string(numbers.size()) +
                         " numbers and not " + std::to_string(count),
                     path, kWriteAgain};
    return numbers;
}

std::string sizes_text(const std::vector<double>& sizes) {
    std::string text;
    for (const double size : sizes)
        text += (text.empty() ? "" : " x ") + std::to_string(static_cast<long long>(size));
    return text;
}

Status check_sizes(const std::vector<double>& sizes, const char* field, const std::string& path) {
    for (const double size : sizes)
        if (size != std::floor(size) || size < 1 || size > 65535)
            return Error{text("%s of the header holds %g", field, size), path,
                         "expected 1 to 65535 voxels per side"};
    return Done{};
}

// Millimetres per unit that a header names; 0 for words that are none.
double unit_in_mm(std::string unit) {
    std::erase(unit, '"');
    unit = lower_case(trimmed(unit));
    if (unit.empty() || unit == "mm" || unit == "???" || unit == "none" ||
        unit.starts_with("millimet"))
        return 1;
    if (unit == "m" || unit.starts_with("met")) return 1000;
    if (unit == "cm" || unit.starts_with("centimet")) return 10;
    if (unit == "um" || unit == "\xc2\xb5m" || unit.starts_with("micro")) return 0.001;
    return 0;
}

Status scale_to_mm(const std::string& unit,
                   const char* field,
                   const std::string& path,
                   Placement& placement) {
    const double factor = unit_in_mm(unit);
    if (factor == 0)
        return Error{std::string(field) + " of the header names the unit " + unit, path,
                     "expected mm; write the geometry in millimetres"};
    if (factor == 1) return Done{};
    for (double& entry : placement.columns.m) entry *= factor;
    placement.spacing_mm = factor * placement.spacing_mm;
    for (int axis = 0; axis < 3; ++axis) placement.origin_mm[axis] *= factor;
    placement.warnings.push_back(text("the header says %s (%s): its numbers are multiplied by %g",
                                      unit.c_str(), field, factor));
    return Done{};
}

const char* kNoOrientation =
    "the file does not say how its axes lie in the patient (%s), so right and left may be "
    "exchanged: its axes are taken to run to the left, to the back and to the head; check on which "
    "side the liver is, or export the file again with its orientation";

const char* kNoOrigin =
    "the header gives no origin (%s): the first voxel is taken to lie at 0, so that points given "
    "in "
    "the scan's coordinates do not fit; write the file again with its origin";

// "(1,0,0) none (0,1,0)": an empty vector for "none".
std::vector<std::vector<std::string>> vectors_in(std::string_view text) {
    std::vector<std::vector<std::string>> vectors;
    while (true) {
        text = trimmed(text);
        if (text.empty()) return vectors;
        std::vector<std::string> cells;
        if (text.front() == '(') {
            const std::size_t end = std::min(text.find(')'), text.size());
            std::string_view inside = text.substr(1, end - 1);
            while (true) {
                const std::size_t comma = inside.find(',');
                cells.emplace_back(trimmed(inside.substr(0, comma)));
                if (comma == std::string_view::npos) break;
                inside.remove_prefix(comma + 1);
            }
            text.remove_prefix(std::min(end + 1, text.size()));
        } else {
            const std::size_t end = std::min(text.find_first_of(" \t("), text.size());
            if (lower_case(text.substr(0, end)) != "none") cells.emplace_back(text.substr(0, end));
            text.remove_prefix(end);
        }
        vectors.push_back(std::move(cells));
    }
}

// "\"mm\" \"\"  \"mm\"": what stands between quotation marks.
std::vector<std::string> quoted_words(std::string_view text) {
    std::vector<std::string> words;
    while (true) {
        const std::size_t open = text.find('"');
        if (open == std::string_view::npos) return words;
        const std::size_t close = text.find('"', open + 1);
        if (close == std::string_view::npos) return words;
        words.emplace_back(text.substr(open + 1, close - open - 1));
        text.remove_prefix(close + 1);
    }
}

// The fields of an NRRD header, without blanks and in lower case: "spacedirections".
std::map<std::string, std::string> nrrd_fields(std::string_view header) {
    std::map<std::string, std::string> fields;
    while (!header.empty()) {
        const std::size_t end = std::min(header.find('\n'), header.size());
        const std::string_view line = trimmed(header.substr(0, end));
        header.remove_prefix(std::min(end + 1, header.size()));
        if (line.empty()) break;
        const std::size_t colon = line.find(": ");
        if (line.front() == '#' || colon == std::string_view::npos) continue;
        if (line.find(":=") < colon) continue;  // a key of the writer's own
        std::string key = lower_case(line.substr(0, colon));
        std::erase(key, ' ');
        fields.emplace(std::move(key), std::string(trimmed(line.substr(colon + 1))));
    }
    return fields;
}

// "rai": from right to left, from anterior, from inferior. Columns in MetaImage's axes (x to the
// left, y to the back). Empty for anything else.
std::optional<Matrix3> axes_of_letters(const std::string& letters) {
    constexpr std::string_view kFrom[3] = {"rl", "ap", "is"};
    if (letters.size() != 3) return std::nullopt;
    Matrix3 axes = Matrix3::diagonal({0, 0, 0});
    bool taken[3] = {false, false, false};
    for (int axis = 0; axis < 3; ++axis)
        for (int row = 0; row < 3; ++row) {
            const std::size_t side = kFrom[row].find(letters[static_cast<std::size_t>(axis)]);
            if (side == std::string_view::npos || taken[row]) continue;
            taken[row] = true;
            axes(row, axis) = side == 0 ? 1 : -1;
        }
    if (!taken[0] || !taken[1] || !taken[2]) return std::nullopt;
    return axes;
}

// The letters of columns in RAS+.
std::string letters_of_axes(const Matrix3& columns) {
    constexpr std::string_view kFrom[3] = {"rl", "ap", "is"};
    std::string letters;
    for (int axis = 0; axis < 3; ++axis) {
        int most = 0;
        for (int row = 1; row < 3; ++row)
            if (std::abs(columns(row, axis)) > std::abs(columns(most, axis))) most = row;
        const bool along = (most == 2) == (columns(most, axis) > 0);  // of MetaImage's own axes
        letters += kFrom[most][along ? 0 : 1];
    }
    return letters;
}

std::string upper_case(std::string text) {
    for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return text;
}

bool is_nothing(const std::vector<std::string>& cells) {
    return std::all_of(cells.begin(), cells.end(), [](const std::string& cell) {
        const auto number = number_in(cell);
        return number && std::isnan(*number);
    });
}

}  // namespace

Result<Placement> nrrd_placement(std::string_view header, const std::string& path) {
    const auto fields = nrrd_fields(header);
    const auto field = [&](const char* key) {
        const auto found = fields.find(key);
        return found == fields.end() ? std::string() : found->second;
    };
    SONOCASE_TRY(const auto sizes, finite_numbers(words_of(field("sizes")), 0, "sizes", path));
    SONOCASE_TRY_DONE(check_sizes(sizes, "sizes", path));
    const auto vectors = vectors_in(field("spacedirections"));
    const std::vector<std::string> kinds = words_of(lower_case(field("kinds")));
    if (!vectors.empty() && vectors.size() != sizes.size())
        return Error{"space directions of the header are " + std::to_string(vectors.size()) +
                         " and there are " + std::to_string(sizes.size()) + " axes",
                     path, kWriteAgain};
    // The axes of space among those of the array.
    std::vector<std::size_t> spatial;
    for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
        const bool known_kind = axis < kinds.size() && kinds[axis] != "???";
        const bool in_space = !vectors.empty() ? !(sizes.size() > 3 && is_nothing(vectors[axis]))
                              : known_kind     ? kinds[axis] == "domain" || kinds[axis] == "space"
                                               : true;
        if (in_space) spatial.push_back(axis);
    }
    if (sizes.size() < 3)
        return Error{"an image of " + sizes_text(sizes) + " pixels", path,
                     "expected a volume of three dimensions"};
    if (spatial.size() != 3)
        return Error{"volume of " + sizes_text(sizes) + " voxels", path,
                     "expected three dimensions; export one time step"};

    Placement placement;
    std::vector<double> spacings;  // of the axes that have one
    const std::vector<std::string> spacing_cells = words_of(field("spacings"));
    for (std::size_t n = 0; n < 3; ++n) {
        const std::size_t axis = spatial[n];
        placement.size[static_cast<int>(n)] = static_cast<std::int32_t>(sizes[axis]);
        if (axis >= spacing_cells.size()) continue;
        // Beside directions NaN means that it is not given.
        if (!vectors.empty() && is_nothing({spacing_cells[axis]})) continue;
        SONOCASE_TRY(const auto one, finite_numbers({spacing_cells[axis]}, 1, "spacings", path));
        if (!(one[0] > 0))
            return Error{text("spacings of the header holds %g", one[0]), path,
                         "expected voxel sizes above 0"};
        spacings.push_back(one[0]);
    }
    const std::string space = lower_case(field("space"));
    double sign[3] = {-1, -1, 1};
    bool known_space = true;
    if (space == "right-anterior-superior" || space == "ras") {
        sign[0] = sign[1] = 1;
    } else if (space == "left-anterior-superior" || space == "las") {
        sign[1] = 1;
    } else if (space != "left-posterior-superior" && space != "lps") {
        known_space = false;
        constexpr std::string_view kNamed[] = {"",
                                               "scanner-xyz",
                                               "3d-right-handed",
                                               "3d-left-handed",
                                               "scanner-xyz-time",
                                               "3d-right-handed-time",
                                               "3d-left-handed-time",
                                               "right-anterior-superior-time",
                                               "left-anterior-superior-time",
                                               "left-posterior-superior-time",
                                               "rast",
                                               "last",
                                               "lpst"};
        if (std::find(std::begin(kNamed), std::end(kNamed), space) == std::end(kNamed))
            return Error{"the space '" + field("space").substr(0, 40) + "' is none of NRRD's", path,
                         "expected left-posterior-superior, right-anterior-superior or "
                         "left-anterior-superior: write the volume again in one of them"};
    }
    if (!vectors.empty()) {
        for (std::size_t n = 0; n < 3; ++n) {
            SONOCASE_TRY(const auto vector,
                         finite_numbers(vectors[spatial[n]], 3, "space directions", path));
            for (int row = 0; row < 3; ++row)
                placement.columns(row, static_cast<int>(n)) =
                    sign[row] * vector[static_cast<std::size_t>(row)];
        }
        const auto origins = vectors_in(field("spaceorigin"));
        if (!origins.empty()) {
            SONOCASE_TRY(const auto origin, finite_numbers(origins[0], 3, "space origin", path));
            for (int row = 0; row < 3; ++row)
                placement.origin_mm[row] = sign[row] * origin[static_cast<std::size_t>(row)];
        } else {
            placement.warnings.push_back(text(kNoOrigin, "space origin"));
        }
        if (!known_space)
            placement.warnings.push_back(
                text(kNoOrientation, space.empty() ? "no space" : ("space " + space).c_str()));
        for (std::size_t n = 0; n < 3 && spacings.size() == 3; ++n) {
            const double length = norm(placement.columns.column(static_cast<int>(n)));
            if (std::abs(length - spacings[n]) * sizes[spatial[n]] > 0.5 * length)
                placement.warnings.push_back(
                    text("voxels are %g mm along axis %zu by space directions and %g by spacings: "
                         "the directions are taken",
                         length, spatial[n] + 1, spacings[n]));
        }
    } else {
        bool sized = spacings.size() == 3;
        const std::vector<std::string> minima = words_of(field("axismins")),
                                       maxima = words_of(field("axismaxs"));
        const std::vector<std::string> centres = words_of(
            lower_case(field("centerings").empty() ? field("centers") : field("centerings")));
        std::vector<double> first(3, 0.0), steps;  // of the middles of voxels
        for (std::size_t n = 0; n < 3; ++n) {
            const std::size_t axis = spatial[n];
            const bool node = axis < centres.size() && centres[axis] == "node";
            const auto bound = [&](const std::vector<std::string>& cells) {
                const auto value = axis < cells.size() ? number_in(cells[axis]) : std::nullopt;
                return value && std::isfinite(*value) ? value : std::nullopt;
            };
            const auto least = bound(minima), most = bound(maxima);
            if (least && most && *most > *least && (sizes[axis] > 1 || !node))
                steps.push_back((*most - *least) / (sizes[axis] - node));
            if (least) first[n] = *least;
            if (least && !node && steps.size() == n + 1) first[n] += steps[n] / 2;
        }
        if (!sized && steps.size() == 3) {
            spacings = steps;
            sized = true;
            placement.warnings.push_back(
                text("the header gives no spacings: voxels of %.4g x %.4g x %.4g mm are taken from "
                     "axis mins and axis maxs",
                     steps[0], steps[1], steps[2]));
        }
        for (int axis = 0; axis < 3; ++axis) {
            const auto n = static_cast<std::size_t>(axis);
            for (int row = 0; row < 3; ++row)
                placement.columns(row, axis) =
                    row == axis ? (axis < 2 ? -1 : 1) * (sized ? spacings[n] : 1) : 0;
            placement.origin_mm[axis] = (axis < 2 ? -1 : 1) * first[n];
        }
        placement.warnings.push_back(text(kNoOrientation, "no space directions"));
        if (!sized)
            placement.warnings.push_back(
                "the header gives no voxel size (space directions, spacings): 1 mm is assumed; "
                "write the file again with it, or give --scale");
    }
    // A quoted unit per axis of space: all must be the same one.
    std::vector<std::string> units = words_of(field("spaceunits"));
    const char* units_field = "space units";
    if (vectors.empty()) {  // then each axis of the array may have its own
        units_field = "units";
        const std::vector<std::string> of_axes = quoted_words(field("units"));
        for (const std::size_t axis : spatial)
            if (axis < of_axes.size()) units.push_back(of_axes[axis]);
    }
    if (!units.empty()) {
        for (const std::string& unit : units)
            if (unit_in_mm(unit) != unit_in_mm(units[0]))
                return Error{std::string(units_field) + " of the header differ between axes", path,
                             kWriteAgain};
        SONOCASE_TRY_DONE(scale_to_mm(units[0], units_field, path, placement));
    }
    if (!is_finite(placement)) return geometry_not_finite("axes or origin", path);
    return placement;
}

Result<Placement> meta_placement(std::string_view header, const std::string& path) {
    std::map<std::string, std::string> fields;
    while (!header.empty()) {
        const std::size_t end = std::min(header.find('\n'), header.size());
        const std::string_view line = header.substr(0, end);
        header.remove_prefix(std::min(end + 1, header.size()));
        const std::size_t equals = line.find('=');
        if (equals == std::string_view::npos) continue;
        const std::string key = lower_case(trimmed(line.substr(0, equals)));
        fields.emplace(key, std::string(trimmed(line.substr(equals + 1))));
        if (key == "elementdatafile") break;
    }
    // The first of several names of one field: its name, and its value.
    const auto field = [&](std::initializer_list<const char*> names) {
        for (const char* name : names)
            if (const auto found = fields.find(lower_case(name)); found != fields.end())
                return std::pair{std::string(name), found->second};
        return std::pair{std::string(), std::string()};
    };
    SONOCASE_TRY(const auto sizes,
                 finite_numbers(words_of(field({"DimSize"}).second), 0, "DimSize", path));
    SONOCASE_TRY_DONE(check_sizes(sizes, "DimSize", path));
    const std::size_t dimensions = sizes.size();
    if (dimensions < 3)
        return Error{"an image of " + sizes_text(sizes) + " pixels", path,
                     "expected a volume of three dimensions"};
    for (std::size_t d = 3; d < dimensions; ++d)
        if (sizes[d] != 1)
            return Error{"volume of " + sizes_text(sizes) + " voxels", path,
                         "expected three dimensions; export one time step"};
    Placement placement;
    const auto [spacing_name, spacing_text] = field({"ElementSpacing", "ElementSize"});
    const auto [origin_name, origin_text] = field({"Offset", "Position", "Origin"});
    const auto [matrix_name, matrix_text] = field({"TransformMatrix", "Rotation", "Orientation"});
    const std::string letters = lower_case(field({"AnatomicalOrientation"}).second);
    std::vector<double> spacing(dimensions, 1.0), origin(dimensions, 0.0), matrix;
    if (!spacing_name.empty()) {
        SONOCASE_TRY(spacing,
                     finite_numbers(words_of(spacing_text), dimensions, spacing_name, path));
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (!(spacing[axis] > 0))
                return Error{text("%s of the header holds %g", spacing_name.c_str(), spacing[axis]),
                             path, "expected voxel sizes above 0"};
    } else {
        placement.warnings.push_back(
            "the header gives no voxel size (ElementSpacing): 1 mm is assumed; write the file "
            "again with it, or give --scale");
    }
    if (!origin_name.empty()) {
        SONOCASE_TRY(origin, finite_numbers(words_of(origin_text), dimensions, origin_name, path));
    } else {
        placement.warnings.push_back(text(kNoOrigin, "Offset"));
    }
    if (!matrix_name.empty()) {
        SONOCASE_TRY(matrix, finite_numbers(words_of(matrix_text), dimensions * dimensions,
                                            matrix_name, path));
    } else if (const auto axes = axes_of_letters(letters)) {
        matrix.assign(dimensions * dimensions, 0);
        for (std::size_t a = 0; a < dimensions; ++a)
            for (std::size_t row = 0; row < dimensions; ++row)
                matrix[a * dimensions + row] =
                    a < 3 && row < 3 ? (*axes)(static_cast<int>(row), static_cast<int>(a))
                                     : a == row;
        placement.warnings.push_back(
            "the header has no TransformMatrix: its axes are taken from AnatomicalOrientation (" +
            field({"AnatomicalOrientation"}).second +
            ", the sides that they run from); check on which side the liver is");
    } else {
        placement.warnings.push_back(text(kNoOrientation, "no TransformMatrix"));
    }
    if (const std::string size_text = field({"ElementSize"}).second;
        spacing_name == "ElementSpacing" && !size_text.empty()) {
        SONOCASE_TRY(const auto element,
                     finite_numbers(words_of(size_text), dimensions, "ElementSize", path));
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (std::abs(element[axis] - spacing[axis]) * sizes[axis] > 0.5 * spacing[axis]) {
                placement.warnings.push_back(text(
                    "voxels lie %g x %g x %g mm apart by ElementSpacing and are %g x %g x %g mm "
                    "large by ElementSize: the spacing is taken",
                    spacing[0], spacing[1], spacing[2], element[0], element[1], element[2]));
                break;
            }
    }
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        placement.size[axis] = static_cast<std::int32_t>(sizes[a]);
        placement.spacing_mm[axis] = spacing[a];
        placement.origin_mm[axis] = (axis < 2 ? -1 : 1) * origin[a];
        Vector3 along{axis == 0 ? -1.0 : 0, axis == 1 ? -1.0 : 0, axis == 2 ? 1.0 : 0};
        if (!matrix.empty())
            along = {-matrix[a * dimensions], -matrix[a * dimensions + 1],
                     matrix[a * dimensions + 2]};
        if (std::abs(norm(along) - 1) > 1e-3)
            return Error{text("axis %d of %s is of length %g and not 1", axis + 1,
                              matrix_name.c_str(), norm(along)),
                         path, "write directions of length 1, and sizes in ElementSpacing"};
        for (int row = 0; row < 3; ++row) placement.columns(row, axis) = spacing[a] * along[row];
    }
    if (const auto axes = axes_of_letters(letters); axes && !matrix_name.empty()) {
        const std::string by_matrix = letters_of_axes(placement.columns);
        if (by_matrix != letters)
            placement.warnings.push_back("AnatomicalOrientation says " +
                                         field({"AnatomicalOrientation"}).second + " and " +
                                         matrix_name + " " + upper_case(by_matrix) +
                                         ": the matrix is taken; check on which side the liver is");
    }
    SONOCASE_TRY_DONE(
        scale_to_mm(field({"DistanceUnits"}).second, "DistanceUnits", path, placement));
    if (!is_finite(placement)) return geometry_not_finite("axes or origin", path);
    return placement;
}

std::string header_text(const std::string& path) {
    constexpr std::size_t kMaxHeader = 16 << 20;
    const bool meta = has_ending(path, ".mha") || has_ending(path, ".mhd");
    std::ifstream file(path, std::ios::binary);
    std::string header, line;
    while (header.size() < kMaxHeader && std::getline(file, line)) {
        header += line + "\n";
        if (meta ? lower_case(trimmed(line)).starts_with("elementdatafile") : trimmed(line).empty())
            break;
    }
    return header;
}

namespace {

// Without a number of dimensions behind "LIST" or the pattern each file of an NRRD is one slice.
Status check_slice_count(const std::string& path, const std::string& data_file) {
    SONOCASE_TRY(const auto files, listed_files(path, data_file));
    const std::size_t words = words_of(data_file).size();
    if (words != (lower_case(data_file).starts_with("list") ? 1u : 4u)) return Done{};
    const auto fields = nrrd_fields(header_text(path));
    const auto sizes = fields.find("sizes");
    const std::vector<std::string> cells =
        sizes == fields.end() ? std::vector<std::string>{} : words_of(sizes->second);
    const auto slices = cells.empty() ? std::nullopt : number_in(cells.back());
    if (!slices || *slices == static_cast<double>(files.size())) return Done{};
    return Error{"names " + std::to_string(files.size()) +
                     " data files where its header asks for " + cells.back() + " slices",
                 path, "name one file for each slice"};
}

}  // namespace

Status check_data_files(const std::string& path) {
    if (has_ending(path, ".mha") || has_ending(path, ".mhd")) {
        const MetaHeader header = read_meta_header(path);
        if (header.many_files) return check_listed_files(path, header.data_files);
        // A header that is cut off names no file: the reader reports it.
        if (header.data_path.empty() || header.data_path == path) return Done{};
        return check_data_file(path, header.data_path);
    }
    if (has_ending(path, ".nrrd") || has_ending(path, ".nhdr")) {
        const std::string data_file = nrrd_data_file(path);
        if (data_file.empty()) return Done{};
        if (names_many_files(data_file)) {
            SONOCASE_TRY_DONE(check_listed_files(path, data_file));
            return check_slice_count(path, data_file);
        }
        return check_data_file(path, beside(path, data_file));
    }
    return Done{};
}

namespace {

// Voxels that are stored as they are, in files that hold `found` bytes of them.
Status check_plain_length(std::uint64_t found,
                          std::uint64_t needed,
                          const std::string& path,
                          std::vector<std::string>& warnings) {
    if (found < needed) return cut_off(found, needed, path);
    constexpr std::uint64_t kLineEnds = 16;
    if (found > needed + kLineEnds)
        warnings.push_back(
            "the file holds " + std::to_string(found - needed) +
            " bytes more than its header asks for: the voxels are taken from the beginning; if "
            "they are the last bytes, behind a header of another program, say so (HeaderSize = -1 "
            "in MetaImage, byte skip: -1 in NRRD), and check the type of the voxels");
    return Done{};
}

Result<std::uint64_t> bytes_of_files(const std::string& path, const std::string& data_file) {
    SONOCASE_TRY(const auto files, listed_files(path, data_file));
    std::uint64_t bytes = 0;
    for (const std::string& file : files) {
        std::error_code code;
        const std::uint64_t size = fs::file_size(file, code);
        bytes += code ? 0 : size;
    }
    return bytes;
}

}  // namespace

Status check_meta_length(const std::string& path,
                         std::uint64_t voxel_bytes,
                         std::vector<std::string>& warnings) {
    if (!has_ending(path, ".mha") && !has_ending(path, ".mhd")) return Done{};
    const MetaHeader header = read_meta_header(path);
    if (header.many_files) {
        if (header.compressed || header.voxels_from_end || header.voxels_at > 0) return Done{};
        SONOCASE_TRY(const auto bytes, bytes_of_files(path, header.data_files));
        return check_plain_length(bytes, voxel_bytes, path, warnings);
    }
    std::error_code code;
    const std::uint64_t size = fs::file_size(header.data_path, code);
    if (code)
        return Error{"its data file " + header.data_path + " is not there", path,
                     "keep the two together"};
    const std::uint64_t there = size > header.voxels_at ? size - header.voxels_at : 0;
    if (!header.compressed) {
        if (!header.is_binary || (header.voxels_from_end && there >= voxel_bytes)) return Done{};
        return check_plain_length(there, voxel_bytes, path, warnings);
    }
    SONOCASE_TRY(auto packed, read_file(header.data_path));
    // The library reads as many as are stated.
    if (header.compressed_bytes > 0 && header.compressed_bytes < there)
        packed.resize(header.voxels_at + header.compressed_bytes);
    const std::uint64_t found =
        inflated_bytes(packed, std::min<std::size_t>(header.voxels_at, packed.size()), voxel_bytes);
    if (found < voxel_bytes && packed.size() < size)
        return Error{"CompressedDataSize of the header is " +
                         std::to_string(header.compressed_bytes) + ", and " +
                         std::to_string(there) + " bytes follow",
                     path, "export it again"};
    if (found < voxel_bytes) return cut_off(found, voxel_bytes, path);
    return Done{};
}

Status check_nrrd_length(const std::string& path,
                         std::uint64_t voxel_bytes,
                         std::vector<std::string>& warnings) {
    if (!has_ending(path, ".nrrd") && !has_ending(path, ".nhdr")) return Done{};
    const std::string header = header_text(path);
    const auto fields = nrrd_fields(header);
    const auto field = [&](const char* key) {
        const auto found = fields.find(key);
        return found == fields.end() ? std::string() : lower_case(found->second);
    };
    const bool gzip = field("encoding") == "gzip" || field("encoding") == "gz";
    if (!gzip && field("encoding") != "raw") return Done{};
    const double skipped = number_in(field("byteskip")).value_or(0);
    if (number_in(field("lineskip")).value_or(0) != 0 || skipped < 0) return Done{};
    const std::string data_file = nrrd_data_file(path);
    if (names_many_files(data_file)) {
        if (gzip || skipped > 0) return Done{};
        SONOCASE_TRY(const auto bytes, bytes_of_files(path, data_file));
        return check_plain_length(bytes, voxel_bytes, path, warnings);
    }
    const std::string data_path = data_file.empty() ? path : beside(path, data_file);
    const std::size_t at = data_file.empty() ? header.size() : 0;
    if (gzip) {
        if (skipped > 0) return Done{};
        SONOCASE_TRY(const auto bytes, read_file(data_path));
        const std::uint64_t found = inflated_bytes(bytes, std::min(at, bytes.size()), voxel_bytes);
        if (found < voxel_bytes) return cut_off(found, voxel_bytes, path);
        return Done{};
    }
    std::error_code code;
    const std::uint64_t size = fs::file_size(data_path, code);
    const std::uint64_t before = at + static_cast<std::uint64_t>(std::min(skipped, 1e15));
    if (code) return Done{};  // the reader says why
    return check_plain_length(size > before ? size - before : 0, voxel_bytes, path, warnings);
}

namespace {

std::optional<Component> component_named(std::string type) {
    std::erase(type, ' ');
    for (const char* ending : {"_t", "int"})
        if (type.ends_with(ending) && type.size() > std::string_view(ending).size() &&
            type != "uint" && type != "signedint" && type != "unsignedint")
            type.resize(type.size() - std::string_view(ending).size());
    constexpr std::pair<std::string_view, Component> kNames[] = {
        {"uchar", Component::u8},
        {"unsignedchar", Component::u8},
        {"uint8", Component::u8},
        {"signedchar", Component::i8},
        {"int8", Component::i8},
        {"ushort", Component::u16},
        {"unsignedshort", Component::u16},
        {"uint16", Component::u16},
        {"short", Component::i16},
        {"signedshort", Component::i16},
        {"int16", Component::i16},
        {"uint", Component::u32},
        {"unsignedint", Component::u32},
        {"uint32", Component::u32},
        {"int", Component::i32},
        {"signedint", Component::i32},
        {"int32", Component::i32},
        {"ulonglong", Component::u64},
        {"unsignedlonglong", Component::u64},
        {"uint64", Component::u64},
        {"longlong", Component::i64},
        {"signedlonglong", Component::i64},
        {"int64", Component::i64},
        {"float", Component::f32},
        {"double", Component::f64}};
    for (const auto& [name, component] : kNames)
        if (name == type) return component;
    return std::nullopt;
}

}  // namespace

Status check_nrrd_encoding(std::string_view header, const std::string& path) {
    const auto fields = nrrd_fields(header);
    const auto field = [&](const char* key) {
        const auto found = fields.find(key);
        return found == fields.end() ? std::string() : lower_case(found->second);
    };
    const std::size_t axes = words_of(field("sizes")).size();
    if (axes > 4)
        return Error{"volume of " + std::to_string(axes) + " axes", path,
                     "expected three of space, and one of layers at most"};
    const auto component = component_named(field("type"));
    const std::string encoding = field("encoding");
    const bool as_text = encoding == "ascii" || encoding == "text" || encoding == "txt";
    if (component && bytes_of(*component) > 1 && !as_text && field("endian").empty())
        return Error{"the header does not say in which order the bytes of its voxels are (endian)",
                     path,
                     "give it the line 'endian: little', as nearly all programs write, or big"};
    return Done{};
}

Result<Placement> placement_in_header(const std::string& path) {
    const bool meta = has_ending(path, ".mha") || has_ending(path, ".mhd");
    const std::string header = header_text(path);
    return meta ? meta_placement(header, path) : nrrd_placement(header, path);
}

namespace {

// A value of the writer's own, in which "\\n" stands for the end of a line.
std::string without_escapes(std::string_view text) {
    std::string out;
    for (std::size_t at = 0; at < text.size(); ++at) {
        const bool escaped = text[at] == '\\' && at + 1 < text.size();
        if (escaped) ++at;
        out += escaped && text[at] == 'n' ? '\n' : text[at];
    }
    return out;
}

}  // namespace

bool is_bzip2(std::string_view nrrd_header) {
    const auto fields = nrrd_fields(nrrd_header);
    const auto found = fields.find("encoding");
    if (found == fields.end()) return false;
    const std::string encoding = lower_case(found->second);
    return encoding == "bzip2" || encoding == "bz2";
}

Result<NrrdVoxels> nrrd_voxels(std::string_view header, const std::string& path) {
    NrrdVoxels voxels;
    const auto fields = nrrd_fields(header);
    const auto field = [&](const char* key) {
        const auto found = fields.find(key);
        return found == fields.end() ? std::string() : found->second;
    };
    const auto component = component_named(lower_case(field("type")));
    if (!component) return Error{"voxels of type " + field("type"), path, "expected whole numbers"};
    voxels.component = *component;
    const bool big = lower_case(field("endian")) == "big";
    voxels.swapped = big != (std::endian::native == std::endian::big);
    for (const char* key : {"lineskip", "byteskip"})
        if (number_in(field(key)).value_or(0) != 0)
            return Error{"the header skips lines or bytes of what is packed with bzip2", path,
                         "save it with gzip or without compression"};
    // Of the axes one alone may be none of space, the first or the last.
    SONOCASE_TRY(const auto placement, nrrd_placement(header, path));
    SONOCASE_TRY(const auto sizes, finite_numbers(words_of(field("sizes")), 0, "sizes", path));
    if (sizes.size() > 4)
        return Error{"volume of " + sizes_text(sizes) + " voxels", path,
                     "expected three dimensions; export one time step"};
    if (sizes.size() == 4) {
        const auto matches = [&](std::size_t from) {
            for (int axis = 0; axis < 3; ++axis)
                if (sizes[from + static_cast<std::size_t>(axis)] != placement.size[axis])
                    return false;
            return true;
        };
        const auto vectors = vectors_in(field("spacedirections"));
        const std::vector<std::string> kinds = words_of(lower_case(field("kinds")));
        const auto is_space = [&](std::size_t axis) {
            if (!vectors.empty()) return !is_nothing(vectors[axis]);
            return axis < kinds.size() && (kinds[axis] == "domain" || kinds[axis] == "space");
        };
        voxels.planar = is_space(0);
        if ((voxels.planar && is_space(3)) || !matches(voxels.planar ? 0 : 1))
            return Error{"volume of " + sizes_text(sizes) +
                             " voxels has its axes in another order than its geometry",
                         path, kWriteAgain};
        voxels.layers = static_cast<int>(voxels.planar ? sizes[3] : sizes[0]);
    }
    voxels.data_path = path;
    voxels.voxels_at = header.size();
    if (const std::string file = nrrd_data_file(path); !file.empty()) {
        if (names_many_files(file))
            return Error{"voxels in several files that are packed with bzip2", path,
                         "save it with gzip or without compression"};
        voxels.data_path = beside(path, file);
        voxels.voxels_at = 0;
    }
    for (std::string_view rest = header; !rest.empty();) {
        const std::size_t end = std::min(rest.find('\n'), rest.size());
        const std::string_view line = trimmed(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
        const std::size_t assigned = line.find(":=");
        if (line.starts_with('#') || assigned == std::string_view::npos) continue;
        voxels.fields[std::string(line.substr(0, assigned))] =
            without_escapes(line.substr(assigned + 2));
    }
    return voxels;
}

Result<std::vector<std::byte>> unpack_bzip2(std::span<const std::uint8_t> file,
                                            std::uint64_t at,
                                            std::uint64_t count,
                                            const std::string& path) {
    std::vector<std::byte> out;
    std::vector<std::byte> beyond(4096);  // what comes after the last byte: nothing should
    std::uint64_t total = 0;
    const auto damaged = [&] { return cut_off(std::min(total, count), count, path); };
    while (at < file.size()) {
        bz_stream stream{};
        if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return damaged();
        int status = BZ_OK;
        while (status == BZ_OK) {
            if (stream.avail_in == 0) {
                const auto piece = std::min<std::uint64_t>(file.size() - at, 1u << 30);
                if (piece == 0) break;
                stream.next_in =
                    reinterpret_cast<char*>(const_cast<std::uint8_t*>(file.data() + at));
                stream.avail_in = static_cast<unsigned>(piece);
                at += piece;
            }
            if (total < count && total == out.size())
                out.resize(
                    std::min<std::uint64_t>(count, std::max<std::uint64_t>(2 * total, 1 << 20)));
            const bool wanted = total < count;
            std::byte* to = wanted ? out.data() + total : beyond.data();
            const std::uint64_t room = wanted ? out.size() - total : beyond.size();
            const auto piece = static_cast<unsigned>(std::min<std::uint64_t>(room, 1u << 30));
            stream.next_out = reinterpret_cast<char*>(to);
            stream.avail_out = piece;
            status = BZ2_bzDecompress(&stream);
            const unsigned got = piece - stream.avail_out;
            if (!wanted && got > 0) {
                BZ2_bzDecompressEnd(&stream);
                return Error{"holds more voxels than its header asks for (" +
                                 std::to_string(count) + " bytes)",
                             path, "export it again"};
            }
            total += got;
        }
        at -= stream.avail_in;
        BZ2_bzDecompressEnd(&stream);
        if (status == BZ_DATA_ERROR_MAGIC && total == count)
            break;  // padding behind the last stream
        if (status != BZ_STREAM_END) return damaged();
    }
    if (total < count) return damaged();
    return out;
}

namespace {

// The geometry that programs write where they were given none.
bool is_lost(const Placement& placement) {
    if (placement.origin_mm != Point3{0, 0, 0}) return false;
    for (int row = 0; row < 3; ++row)
        for (int axis = 0; axis < 3; ++axis)
            if (std::abs(placement.columns(row, axis)) != (row == axis ? 1.0 : 0.0)) return false;
    return true;
}

}  // namespace

Status place_volume(const Placement& placement,
                    const VolumeReading& reading,
                    const std::string& path,
                    NativeVolume& volume) {
    Grid& grid = volume.grid;
    grid.size = placement.size;
    Matrix3 direction;
    for (int axis = 0; axis < 3; ++axis) {
        const Vector3 column = placement.columns.column(axis);
        const double length = norm(column);
        if (!(length > 1e-9) || !std::isfinite(length))
            return Error{text("voxels have the size %g mm along axis %d", length, axis + 1), path,
                         kWriteAgain};
        const double given = placement.spacing_mm[axis];
        grid.spacing_mm[axis] = given > 0 ? given : length;
        for (int row = 0; row < 3; ++row) direction(row, axis) = column[row] / length;
    }
    grid.direction = direction;
    grid.origin_mm = placement.origin_mm;
    volume.warnings.insert(volume.warnings.end(), placement.warnings.begin(),
                           placement.warnings.end());
    if (placement.warnings.empty() && is_lost(placement))
        volume.warnings.push_back(
            "voxels of 1 mm that begin at 0, along plain axes: so a file looks that was written "
            "from an array without the geometry of its scan; check size and sides of the body, or "
            "write it again with the geometry of the scan");
    if (orthonormality_error(direction) < 1e-6) return Done{};

    const double side = determinant(direction);
    if (!(std::abs(side) > 1e-3))
        return Error{"two axes of the header run along each other", path, kWriteAgain};
    Matrix3 mirror;
    mirror(0, 0) = side < 0 ? -1 : 1;
    const Matrix3 square = nearest_rotation(direction * mirror) * mirror;
    Vector3 half;
    for (int axis = 0; axis < 3; ++axis)
        half[axis] = 0.5 * grid.spacing_mm[axis] * (grid.size[axis] - 1);
    double moved = 0;
    for (int corner = 0; corner < 4; ++corner) {  // the other four are their mirror images
        const Vector3 to{half.x, (corner & 1) ? half.y : -half.y, (corner & 2) ? half.z : -half.z};
        moved = std::max(moved, norm(direction * to - square * to));
    }
    const double shortest = std::min({grid.spacing_mm.x, grid.spacing_mm.y, grid.spacing_mm.z});
    grid.origin_mm = placement.origin_mm + (direction * half - square * half);
    grid.direction = square;
    if (moved <= 0.1 * shortest) {
        if (moved > 0.01 * shortest)
            volume.warnings.push_back(
                text("voxel axes are not quite at right angles and were squared off about the "
                     "middle, which moves voxels by up to %.2g mm",
                     moved));
        return Done{};
    }
    if (!reading.resample_shear)
        return Error{text("voxel axes are not at right angles: squaring them off would move voxels "
                          "by %.3g mm (a tilted gantry?)",
                          moved),
                     path,
                     std::string(kResampleShear) +
                         "resample the volume to an orthogonal grid (Slicer: Resample Image)"};
    volume.slanted = placement;
    volume.warnings.push_back(
        text("voxel axes are not at right angles (squaring them off would move voxels by %.3g mm): "
             "the labels were resampled, each voxel from the nearest one",
             moved));
    return Done{};
}

Status check_room(const NativeVolume& volume, std::uint64_t bytes, const std::string& path) {
    const double values = static_cast<double>(volume.grid.voxel_count()) * volume.layers;
    const double mb = (static_cast<double>(bytes) + values) / 1e6;
    if (mb <= memory_limit_mb()) return Done{};
    return Error{text("its %.0f million voxels take %.0f MB, and there are %.0f MB", values / 1e6,
                      mb, memory_limit_mb()),
                 path, "a coarser or cropped label map, or more memory"};
}

}  // namespace sonocase::pipeline::inline import_volume
