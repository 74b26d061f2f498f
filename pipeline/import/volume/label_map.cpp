// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/volume/label_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "formats/bundle/stage_files.h"
#include "formats/files/load_save.h"
#include "formats/text/excerpt.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/label_table.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/import/volume/label_numbering.h"
#include "pipeline/import/volume/native_volume.h"
#include "pipeline/import/volume/nifti_file.h"
#include "pipeline/import/volume/volume_file.h"

namespace sonocase::pipeline::inline import_volume {
namespace {

namespace fs = std::filesystem;

// What the readers give to import_label_map: structures as runs of voxels.
struct VoxelRun {
    std::uint32_t first = 0;  // voxel number
    std::uint32_t count = 0;
};

struct Structure {
    LabelTableEntry entry;  // the name is empty if none was found
    std::vector<VoxelRun> runs;
    std::uint64_t voxels = 0;
};

struct StructureList {
    Grid grid;
    std::vector<Structure> structures;
    std::vector<Note> notes;
    std::vector<std::string> warnings;
    int assumed_names = 0;  // given by the number alone
};

const LabelTableEntry* entry_of(const LabelTable& table, int value) {
    for (const LabelTableEntry& entry : table)
        if (entry.value == value) return &entry;
    return nullptr;
}

// Refuses a table with two names for one value.
Status check_table(const LabelTable& table, const std::string& where) {
    for (std::size_t i = 0; i < table.size(); ++i)
        for (std::size_t j = i + 1; j < table.size(); ++j)
            if (table[i].value == table[j].value && table[i].layer == table[j].layer &&
                table[i].name != table[j].name)
                return Error{"value " + std::to_string(table[i].value) + " has two names, '" +
                                 table[i].name + "' and '" + table[j].name + "'",
                             where, "give each value one row"};
    return Done{};
}

// Where voxel (0, 0, 0) of `grid` lies in voxels of `base`, if the two are parts of one lattice:
// same axes and spacing, and every voxel within a tenth of one of its place.
std::optional<Int3> place_on_lattice(const Grid& base, const Grid& grid) {
    const Point3 first = base.voxel_from_point(grid.origin_mm);
    Int3 offset;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(std::abs(first[axis]) < 1e5)) return std::nullopt;
        offset[axis] = static_cast<std::int32_t>(std::lround(first[axis]));
    }
    for (int corner = 0; corner < 8; ++corner) {
        const Int3 at{(corner & 1) ? grid.size.x - 1 : 0, (corner & 2) ? grid.size.y - 1 : 0,
                      (corner & 4) ? grid.size.z - 1 : 0};
        const Point3 there = base.voxel_from_point(
            grid.point_from_voxel({double(at.x), double(at.y), double(at.z)}));
        for (int axis = 0; axis < 3; ++axis)
            if (!(std::abs(there[axis] - (at[axis] + offset[axis])) <= 0.1)) return std::nullopt;
    }
    return offset;
}

std::string grid_text(const Grid& grid) {
    return std::to_string(grid.size.x) + " x " + std::to_string(grid.size.y) + " x " +
           std::to_string(grid.size.z);
}

Status check_size(const Grid& grid, const std::string& where) {
    if (grid.voxel_count() <= std::numeric_limits<std::uint32_t>::max()) return Done{};
    return Error{"volume of " + grid_text(grid) + " voxels", where,
                 "expected at most 4 thousand million"};
}

// Appends the runs of voxels whose index is `place`.
void append_runs(const std::vector<std::uint8_t>& voxels,
                 std::uint8_t place,
                 Structure& structure) {
    std::size_t i = 0;
    while (i < voxels.size()) {
        if (voxels[i] != place) {
            ++i;
            continue;
        }
        const std::size_t first = i;
        while (i < voxels.size() && voxels[i] == place) ++i;
        structure.runs.push_back(
            {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(i - first)});
        structure.voxels += i - first;
    }
}

// Names that a header or a file name gives in the code page of Windows are turned into UTF-8.
void mend_name(std::string& name, std::vector<std::string>& warnings) {
    if (is_utf8(name)) return;
    name = utf8_of_windows_1252(name);
    warnings.push_back("the name '" + name +
                       "' is not UTF-8 in the file and was read as Windows-1252: look whether it "
                       "is right, or give a table");
}

// Where names come from, in the order in which they count.
struct NameSources {
    std::vector<LabelTable> tables;
    LabelTable segments;  // of a .seg.nrrd, by value and layer
    std::string dataset;  // the dataset.json that is one of the tables
};

Result<NameSources> name_sources(const LabelLayers& file,
                                 const std::string& path,
                                 const ImportOptions& options,
                                 std::vector<Note>& notes,
                                 std::vector<std::string>& warnings) {
    NameSources sources;
    const bool given = !options.table.empty();
    if (given) {
        SONOCASE_TRY(auto table, load_label_table(options.table));
        SONOCASE_TRY_DONE(check_table(table, options.table));
        sources.tables.push_back(std::move(table));
    }
    if (const Numbering* numbering = find_numbering(options.names)) {
        LabelTable table;
        for (std::size_t n = 0; n < numbering->names.size(); ++n)
            table.push_back({static_cast<int>(n) + 1, std::string(numbering->names[n]), {}, {}, 0});
        sources.tables.push_back(std::move(table));
    }
    auto segments = segments_of_fields(file.fields, path);
    if (!segments && !given) return segments.error();
    if (segments) {
        if (Status fine = check_table(*segments, path); !fine && !given) {
            Error twice = fine.error();
            twice.expected =
                "its segments have one LabelValue on one Layer: save the segmentation "
                "again, or give --table with one name for the value";
            return twice;
        }
        sources.segments = *std::move(segments);
    }
    if (is_nifti_name(path)) {
        auto table = load_nifti_label_table(path, options.reading.orientation);
        if (table && check_table(*table, path)) {
            if (!table->empty()) sources.tables.push_back(*std::move(table));
        } else if (!given) {
            if (!table) return table.error();
            SONOCASE_TRY_DONE(check_table(*table, path));
        }
    }
    if (const std::string side = given ? "" : table_beside(path); !side.empty()) {
        auto table = load_label_table(side);
        Status fine = table ? check_table(*table, side) : Status(table.error());
        const bool dataset = !side.ends_with(".csv");
        for (const std::int32_t value : file.values)
            if (fine && dataset && value != 0 && entry_of(*table, value) == nullptr)
                fine = Error{"no name for the value " + std::to_string(value), side,
                             "it is another map's"};
        if (fine) {
            if (dataset) sources.dataset = side;
            sources.tables.push_back(*std::move(table));
            notes.push_back({"table", side.ends_with(".csv") ? "the CSV beside the map"
                                                             : "the dataset.json of the map"});
        } else {
            warnings.push_back("the file beside the map names no values and is left out (" +
                               fine.error().message().text() + "): give --table if there is one");
        }
    }
    return sources;
}

// Channels of 0 and 1 without names of segments are one structure each, as networks write them.
// Gives each its value: its number where channel 0 is the background, else its number and 1; the
// value of a background is 0.
Result<std::vector<int>> channel_values(const LabelLayers& file,
                                        const std::string& path,
                                        std::vector<std::string>& warnings) {
    const std::size_t channels = file.layers.size();
    for (const std::int32_t value : file.values)
        if (value != 0 && value != 1)
            return Error{"volume of " + std::to_string(channels) +
                             " channels whose values are not 0 and 1 alone",
                         path, "expected three dimensions; export one time step, or a label map"};
    const auto one =
        static_cast<std::uint8_t>(file.values.back() == 1 ? file.values.size() - 1 : 255);
    // Channel 0 is the background where it holds the corners of the volume and no other channel's
    // voxel.
    const Grid& grid = file.grid;
    bool background = true;
    for (int corner = 0; corner < 8; ++corner)
        background =
            background && file.layers[0][grid.index((corner & 1) ? grid.size.x - 1 : 0,
                                                    (corner & 2) ? grid.size.y - 1 : 0,
                                                    (corner & 4) ? grid.size.z - 1 : 0)] == one;
    for (std::size_t c = 1; c < channels && background; ++c)
        for (std::size_t v = 0; v < file.layers[0].size() && background; ++v)
            background = file.layers[0][v] != one || file.layers[c][v] != one;
    std::vector<int> values(channels);
    for (std::size_t c = 0; c < channels; ++c)
        values[c] = static_cast<int>(c) + (background ? 0 : 1);
    warnings.push_back("the file has " + std::to_string(channels) +
                       " channels of 0 and 1: each is taken as one structure, the first as " +
                       (background ? "the background" : "value 1"));
    return values;
}

// Sizes and places of the structures, without names.
BodySummary summary_of(const StructureList& list, double scale) {
    const Grid& grid = list.grid;
    const auto x = static_cast<std::uint64_t>(grid.size.x),
               y = static_cast<std::uint64_t>(grid.size.y);
    const auto place = [&](const Vector3& v) {
        return Point3{} + scale * (grid.point_from_voxel({v.x, v.y, v.z}) - Point3{});
    };
    BodySummary body;
    body.voxel_mm = scale * grid.spacing_mm;
    body.field.include(place({0, 0, 0}));
    body.field.include(place({grid.size.x - 1.0, grid.size.y - 1.0, grid.size.z - 1.0}));
    for (const Structure& s : list.structures) {
        if (s.voxels == 0) continue;
        Vector3 sum, squares;
        Box3 box;  // in voxels
        for (const VoxelRun run : s.runs) {
            // A run may go on into the rows that follow: its middle is near enough.
            const std::uint64_t middle = run.first + run.count / 2;
            const std::uint64_t j = middle / x % y, k = middle / (x * y);
            const Vector3 at{static_cast<double>(middle % x), static_cast<double>(j),
                             static_cast<double>(k)};
            sum = sum + run.count * at;
            squares = squares + run.count * Vector3{at.x * at.x, at.y * at.y, at.z * at.z};
            const double half = std::min(0.5 * (run.count - 1.0), 0.5 * (grid.size.x - 1.0));
            squares.x += run.count * half * (half + 1) / 3;
            box.include(Point3{std::max(0.0, at.x - half), at.y, at.z});
            box.include(Point3{std::min(grid.size.x - 1.0, at.x + half), at.y, at.z});
        }
        LabelSummary one;
        one.value = s.entry.value;
        one.ml =
            static_cast<double>(s.voxels) * grid.voxel_volume_mm3() * std::pow(scale, 3) / 1000;
        const Vector3 mean = sum / static_cast<double>(s.voxels);
        one.centre = place(mean);
        one.box.include(place(box.lower - Point3{}));
        one.box.include(place(box.upper - Point3{}));
        for (int axis = 0; axis < 3; ++axis) {
            const double spread =
                squares[axis] / static_cast<double>(s.voxels) - mean[axis] * mean[axis];
            one.length_mm[axis] = std::sqrt(12 * std::max(spread, 0.0) + 1) * body.voxel_mm[axis];
            const auto a = static_cast<std::size_t>(axis);
            one.cut_low[a] = box.lower[axis] < 1;
            one.cut_high[a] = box.upper[axis] > grid.size[axis] - 2;
        }
        body.labels.push_back(one);
    }
    return body;
}

// How well names fit, for a body of the size of one: that of another unit is told of as that, and
// sizes say nothing of names.
struct AssumedFit {
    bool human = false;
    NamesFit fit;
    bool refused = false;  // a volume that nobody has, or other names that fit far better
};
AssumedFit fit_of(const BodySummary& body) {
    AssumedFit of;
    Box3 box;
    for (const LabelSummary& label : body.labels) {
        box.include(label.box.lower);
        box.include(label.box.upper);
    }
    const Vector3 extent = box.extent() + body.voxel_mm;
    const double length_mm = std::max({extent.x, extent.y, extent.z});
    of.human = length_mm >= kMinTorsoMm && length_mm <= kMaxTorsoMm;
    if (!of.human) return of;
    constexpr int kManyExchanged = 3;
    of.fit = names_fit(body);
    of.refused = of.fit.gross;
    if (!of.fit.misfits.empty())
        for (const AnatomyFinding& finding : check_anatomy(body).findings)
            of.refused = of.refused || finding.renamed >= kManyExchanged;
    return of;
}

// The folder's dataset.json may be another map's.
Status check_dataset(const std::string& path,
                     const ImportOptions& options,
                     const NameSources& sources,
                     const StructureList& list) {
    if (sources.dataset.empty()) return Done{};
    BodySummary body = summary_of(list, options.scale);
    for (LabelSummary& label : body.labels)
        for (const Structure& s : list.structures)
            if (s.entry.value == label.value) label.name = s.entry.name;
    const AssumedFit of = fit_of(body);
    if (!of.refused) return Done{};
    return Error{"the names of " + sources.dataset + " do not fit: " + of.fit.misfits.front(), path,
                 "if it is another map's, give --table with rows of value,name, or --names; if it "
                 "is right, give it as --table"};
}

// Names by the number alone, where the file and the tables name none or name others as
// TotalSegmentator does. Sizes and places must not speak against them.
Status assume_names(const std::string& path,
                    const ImportOptions& options,
                    bool none_named,
                    StructureList& list) {
    if (options.names == "none" || find_numbering(options.names) != nullptr) return Done{};
    const Numbering& total = numberings().front();
    std::vector<std::string> named;
    for (const Structure& s : list.structures) {
        const std::string_view name = total.name(s.entry.value);
        if (s.voxels == 0 || !s.entry.name.empty() || name.empty()) continue;
        named.push_back(std::to_string(s.entry.value) + " " + std::string(name));
    }
    if (named.empty()) return Done{};
    const std::string examples = excerpt(named);
    const BodySummary body = summary_of(list, options.scale);
    const auto [human, fit, misnamed] = fit_of(named_by(total, body));
    std::vector<const Numbering*> others;
    if (human && none_named) others = other_numberings(total, body);
    // Of a few organs in an order that few people have, another numbering is the less likely cause.
    constexpr std::size_t kMany = 5;
    const bool refused =
        misnamed || (!fit.misfits.empty() && !others.empty() && body.labels.size() >= kMany);
    const std::string source =
        none_named ? "neither the file nor a table names its values" : "no table names some values";
    if (refused) {
        std::string advice = "give --table with rows of value,name";
        if (!others.empty())
            advice = "the numbers fit " + std::string(others.front()->title) + ": give --names " +
                     std::string(others.front()->key) + ", or --table with rows of value,name";
        return Error{source + ", and they are not numbered as in TotalSegmentator v2 total: " +
                         fit.misfits.front(),
                     path, advice + ", or --names none"};
    }
    for (Structure& s : list.structures)
        if (s.entry.name.empty()) s.entry.name = std::string(total.name(s.entry.value));
    list.assumed_names = static_cast<int>(named.size());
    list.notes.push_back({"names", "assumed: " + std::string(total.title)});
    if (!fit.misfits.empty()) {
        list.warnings.push_back(source + ": they are taken as " + std::string(total.title) + " (" +
                                examples + "), though " + fit.misfits.front() +
                                "; give --table or --names none if that is wrong");
    } else if (!fit.agrees() || !others.empty()) {
        std::string also;
        if (!others.empty())
            also = ", and would fit " + std::string(others.front()->title) + " as well";
        list.warnings.push_back(source + ": they are taken as " + std::string(total.title) + " (" +
                                examples + ")" + also +
                                "; give --table, or --names none, if that is wrong");
    }
    return Done{};
}

bool holds(const Structure& structure, std::uint64_t voxel) {
    const auto after =
        std::upper_bound(structure.runs.begin(), structure.runs.end(), voxel,
                         [](std::uint64_t v, const VoxelRun& run) { return v < run.first; });
    return after != structure.runs.begin() &&
           voxel - std::prev(after)->first < std::prev(after)->count;
}

// Some programs write the outside as a label of its own: -1, 255, "Exterior". Only 0 is outside
// here.
void leave_out_background(StructureList& list) {
    const Grid& grid = list.grid;
    std::uint64_t labelled = 0;
    for (const Structure& s : list.structures) labelled += s.voxels;
    std::erase_if(list.structures, [&](const Structure& s) {
        const std::string name = lower_case(s.entry.name);
        bool outside = name == "background" || name == "exterior" || name == "clear label" ||
                       name == "clear_label" || name == "unlabeled" || name == "unlabelled";
        if (!outside && name.empty() && labelled == grid.voxel_count()) {
            outside = true;
            for (int corner = 0; corner < 8; ++corner)
                outside = outside && holds(s, grid.index((corner & 1) ? grid.size.x - 1 : 0,
                                                         (corner & 2) ? grid.size.y - 1 : 0,
                                                         (corner & 4) ? grid.size.z - 1 : 0));
        }
        if (outside && s.voxels > 0)
            list.warnings.push_back(
                (s.entry.value == 0 ? "the mask" : "value " + std::to_string(s.entry.value)) +
                (name.empty() ? " holds all corners of the map, and no voxel is 0: it is"
                              : " ('" + s.entry.name + "') is") +
                " taken as the outside; if it is a structure, give it a name with --table");
        return outside;
    });
}

// Labels are small numbers: multiples of 256 alone are their bytes in the other order.
Status check_byte_order(const StructureList& list,
                        const NameSources& sources,
                        const std::string& path) {
    if (list.structures.size() < 2) return Done{};
    for (const Structure& s : list.structures) {
        if (s.entry.value % 256 != 0) return Done{};
        for (const LabelTable& table : sources.tables)
            if (entry_of(table, s.entry.value) != nullptr) return Done{};
    }
    return Error{"every value is a multiple of 256, such as " +
                     std::to_string(list.structures.front().entry.value),
                 path,
                 "the bytes of its voxels lie in the other order than its header says "
                 "(BinaryDataByteOrderMSB, endian): correct it there; if the values are right, "
                 "give --table with their names"};
}

// Reads a single file or a DICOM series.
Result<StructureList> read_label_file(const std::string& path, const ImportOptions& options) {
    SONOCASE_TRY(auto file, read_label_layers(path, options.reading));
    SONOCASE_TRY_DONE(check_size(file.grid, path));
    StructureList list;
    list.grid = file.grid;
    list.notes = std::move(file.notes);
    list.warnings = std::move(file.warnings);
    SONOCASE_TRY(const auto sources, name_sources(file, path, options, list.notes, list.warnings));
    std::vector<int> channels;
    if (file.layers.size() > 1 && sources.segments.empty()) {
        SONOCASE_TRY(channels, channel_values(file, path, list.warnings));
    }
    for (std::size_t layer = 0; layer < file.layers.size(); ++layer) {
        // One pass over the voxels: a run ends where the value changes.
        const std::vector<std::uint8_t>& voxels = file.layers[layer];
        std::vector<Structure> of_place(file.values.size());
        for (std::size_t i = 0; i < voxels.size();) {
            const std::uint8_t place = voxels[i];
            const std::size_t first = i;
            while (i < voxels.size() && voxels[i] == place) ++i;
            if (file.values[place] == 0) continue;
            of_place[place].runs.push_back(
                {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(i - first)});
            of_place[place].voxels += i - first;
        }
        for (std::size_t place = 0; place < of_place.size(); ++place) {
            Structure& structure = of_place[place];
            if (structure.voxels == 0) continue;
            structure.entry.value = channels.empty() ? file.values[place] : channels[layer];
            structure.entry.layer = channels.empty() ? static_cast<int>(layer) : 0;
            if (structure.entry.value != 0) list.structures.push_back(std::move(structure));
        }
    }

    SONOCASE_TRY_DONE(check_byte_order(list, sources, path));
    bool none_named = true, unlike_total = false;
    std::map<int, int> layers_with;  // how many layers hold a value
    for (const Structure& s : list.structures) ++layers_with[s.entry.value];
    for (Structure& structure : list.structures) {
        const int value = structure.entry.value, layer = structure.entry.layer;
        const auto take = [&](const LabelTableEntry& entry) {
            if (!structure.entry.name.empty()) return;
            structure.entry = entry;
            mend_name(structure.entry.name, list.warnings);
        };
        // A table that was given comes before the segments; it cannot tell layers apart.
        const bool given = !options.table.empty() || find_numbering(options.names) != nullptr;
        if (given && !sources.tables.empty() && layers_with[value] == 1)
            if (const auto* entry = entry_of(sources.tables[0], value)) take(*entry);
        for (const LabelTableEntry& segment : sources.segments)
            if (segment.value == value && segment.layer == layer) take(segment);
        for (const LabelTable& table : sources.tables)
            if (const auto* entry = entry_of(table, value)) take(*entry);
        structure.entry.value = value;
        structure.entry.layer = layer;
        if (structure.entry.name.empty()) continue;
        none_named = false;
        const std::string_view total = totalsegmentator_name(value);
        unlike_total = unlike_total || (!total.empty() && structure.entry.name != total);
    }
    leave_out_background(list);
    SONOCASE_TRY_DONE(check_dataset(path, options, sources, list));
    // Segments and names unlike TotalSegmentator's say that it did not number the values.
    if (sources.segments.empty() && !unlike_total) {
        SONOCASE_TRY_DONE(assume_names(path, options, none_named, list));
    }
    return list;
}

bool is_mask_folder(const std::string& path) {
    std::error_code code;
    if (!fs::is_directory(path, code)) return false;
    for (const auto& entry : fs::directory_iterator(path, code))
        if (!entry.path().filename().string().starts_with('.') &&
            is_volume_file_name(entry.path().string()))
            return true;
    return false;
}

// A mask in voxels of the lattice that all masks of a folder lie on.
struct MaskPlace {
    Int3 size;
    Int3 first;
};

// Gives a list of structures the smallest grid that holds all masks, and moves their runs onto it.
Status join_masks(const Grid& base,
                  const std::vector<MaskPlace>& places,
                  const std::string& folder,
                  StructureList& list) {
    Int3 low{0, 0, 0}, high{base.size.x, base.size.y, base.size.z};
    bool same = true;
    for (const MaskPlace& place : places) {
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], place.first[axis]);
            high[axis] = std::max(high[axis], place.first[axis] + place.size[axis]);
        }
        same = same && place.size == base.size && place.first == Int3{0, 0, 0};
    }
    list.grid = base;
    if (same) return Done{};
    Grid& grid = list.grid;
    grid.origin_mm = base.point_from_voxel({double(low.x), double(low.y), double(low.z)});
    for (int axis = 0; axis < 3; ++axis) grid.size[axis] = high[axis] - low[axis];
    if (std::max({grid.size.x, grid.size.y, grid.size.z}) > 65535)
        return Error{"masks lie far apart", folder, "expected masks of one body"};
    SONOCASE_TRY_DONE(check_size(grid, folder));
    for (std::size_t s = 0; s < list.structures.size(); ++s) {
        const MaskPlace& place = places[s];
        const auto width = static_cast<std::uint32_t>(place.size.x),
                   height = static_cast<std::uint32_t>(place.size.y);
        std::vector<VoxelRun> moved;
        for (const VoxelRun run : list.structures[s].runs) {
            for (std::uint32_t at = run.first; at < run.first + run.count;) {  // row by row
                const std::uint32_t i = at % width, j = at / width % height,
                                    k = at / width / height;
                const std::uint32_t count = std::min(width - i, run.first + run.count - at);
                moved.push_back({static_cast<std::uint32_t>(
                                     grid.index(static_cast<int>(i) + place.first.x - low.x,
                                                static_cast<int>(j) + place.first.y - low.y,
                                                static_cast<int>(k) + place.first.z - low.z)),
                                 count});
                at += count;
            }
        }
        list.structures[s].runs = std::move(moved);
    }
    return Done{};
}

// A mask holds 0 and one other value, or one value alone.
Status check_mask(const LabelLayers& mask, const std::string& path) {
    if (mask.layers.size() != 1 || mask.values.size() > 2)
        return Error{"mask holds " + std::to_string(mask.values.size()) + " different values", path,
                     "expected 0 and one other value in each file of the folder: give a label map "
                     "by its own path, and keep the scan itself in another folder than its masks"};
    if (mask.values.size() == 2 && mask.values[0] != 0 && mask.values[1] != 0)
        return Error{"mask holds the values " + std::to_string(mask.values[0]) + " and " +
                         std::to_string(mask.values[1]) + " and no 0",
                     path,
                     "expected 0 outside the structure: write 0 in the place of the one that "
                     "is outside"};
    return Done{};
}

// Files of one case often have a part of their names in common ("case01_liver", "liver_mask").
// Where no name is known with it and most are without it, it is left out.
void leave_out_common_parts(std::vector<Structure>& structures, std::vector<Note>& notes) {
    if (structures.size() < 2) return;
    const auto known = [&](std::size_t cut_front, std::size_t cut_back) {
        std::size_t count = 0;
        for (const Structure& s : structures) {
            const std::string& name = s.entry.name;
            if (name.size() <= cut_front + cut_back) return std::size_t{0};
            count += is_known_structure(name.substr(cut_front, name.size() - cut_front - cut_back));
        }
        return count;
    };
    if (known(0, 0) > 0) return;
    const std::string& first = structures.front().entry.name;
    std::size_t front = first.size(), back = first.size();
    for (const Structure& s : structures) {
        const std::string& name = s.entry.name;
        const auto [a, b] = std::mismatch(first.begin(), first.end(), name.begin(), name.end());
        front = std::min(front, static_cast<std::size_t>(a - first.begin()));
        const auto [c, d] = std::mismatch(first.rbegin(), first.rend(), name.rbegin(), name.rend());
        back = std::min(back, static_cast<std::size_t>(c - first.rbegin()));
    }
    const auto parts = [](char c) { return c == '_' || c == '-' || c == ' ' || c == '.'; };
    std::vector<std::size_t> fronts{0}, backs{0};
    for (std::size_t n = 0; n < front; ++n)
        if (parts(first[n])) fronts.push_back(n + 1);
    for (std::size_t n = 0; n < back; ++n)
        if (parts(first[first.size() - 1 - n])) backs.push_back(n + 1);
    std::size_t best = structures.size() / 2 + 1, cut_front = 0, cut_back = 0;
    for (const std::size_t f : fronts)
        for (const std::size_t b : backs)
            if (const std::size_t count = known(f, b); count >= best) {
                best = count;
                cut_front = f;
                cut_back = b;
            }
    if (cut_front + cut_back == 0) return;
    // What they share may be a patient's name, and the note is kept in the case.
    notes.push_back({"names", "those of the files without what all of them have in common"});
    for (Structure& s : structures)
        s.entry.name = s.entry.name.substr(cut_front, s.entry.name.size() - cut_front - cut_back);
}

// Reads a folder of binary masks; every value other than 0 is inside.
// The value in the name of a mask that is called by its number alone: "5", "seg-5", "label_005".
std::optional<int> number_of_mask(std::string_view stem) {
    const std::size_t last = stem.find_last_not_of("0123456789");
    const std::string_view digits = last == stem.npos ? stem : stem.substr(last + 1);
    std::string word = lower_case(stem.substr(0, stem.size() - digits.size()));
    while (!word.empty() && std::string_view("-_ .").find(word.back()) != std::string_view::npos)
        word.pop_back();
    for (const char* plain : {"", "seg", "segment", "label", "mask", "value", "class", "structure"})
        if (word == plain && !digits.empty() && digits.size() < 9)
            return static_cast<int>(number_in(digits).value_or(0));
    return std::nullopt;
}

Result<StructureList> read_mask_folder(const std::string& folder, const ImportOptions& options) {
    std::vector<std::string> files;
    std::error_code code;
    for (const auto& entry : fs::directory_iterator(folder, code)) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with('.') && is_volume_file_name(name))
            files.push_back(entry.path().string());
    }
    std::sort(files.begin(), files.end());  // a folder lists its files in no fixed order
    LabelTable table;
    if (!options.table.empty()) {
        SONOCASE_TRY(auto loaded, load_label_table(options.table));
        table = std::move(loaded);
    }
    StructureList list;
    Grid first_grid;
    std::vector<MaskPlace> places;
    std::set<std::string> told;
    for (const std::string& path : files) {
        SONOCASE_TRY(auto mask, read_label_layers(path, options.reading));
        SONOCASE_TRY_DONE(check_mask(mask, path));
        if (places.empty()) first_grid = mask.grid;
        SONOCASE_TRY_DONE(check_size(mask.grid, path));
        const auto offset = place_on_lattice(first_grid, mask.grid);
        if (!offset)
            return Error{"mask of " + grid_text(mask.grid) + " voxels lies on another grid than " +
                             files[0] + " (" + grid_text(first_grid) + ")",
                         path, "resample all masks to one grid"};
        places.push_back({mask.grid.size, *offset});
        for (const std::string& warning : mask.warnings)
            if (told.insert(warning).second)
                list.warnings.push_back(fs::path(path).filename().string() + ": " + warning);
        Structure structure;
        structure.entry.name = volume_stem(path);
        mend_name(structure.entry.name, list.warnings);
        // A file of 3D Slicer with one segment may have its name inside.
        if (!is_known_structure(structure.entry.name))
            if (const auto segments = segments_of_fields(mask.fields, path);
                segments && segments->size() == 1)
                structure.entry.name = segments->front().name;
        for (std::size_t place = 0; place < mask.values.size(); ++place)
            if (mask.values[place] != 0)
                append_runs(mask.layers[0], static_cast<std::uint8_t>(place), structure);
        list.structures.push_back(std::move(structure));
    }
    leave_out_common_parts(list.structures, list.notes);
    const auto row_of = [&](const std::string& path, const std::string& name) {
        auto row = std::find_if(table.begin(), table.end(),
                                [&](const LabelTableEntry& entry) { return entry.name == name; });
        if (const auto number = number_of_mask(volume_stem(path)); row == table.end() && number)
            row = std::find_if(table.begin(), table.end(), [&](const LabelTableEntry& entry) {
                return entry.value == *number;
            });
        return row;
    };
    bool matched = table.empty();
    for (std::size_t n = 0; n < files.size(); ++n) {
        LabelTableEntry& own = list.structures[n].entry;
        if (const auto row = row_of(files[n], own.name); row != table.end()) {
            own = *row;
            matched = true;
        }
        if (own.value == 0) own.value = totalsegmentator_value(own.name);
        for (std::size_t m = 0; m < n; ++m)
            if (list.structures[m].entry.name == own.name)
                return Error{"two masks are named '" + own.name +
                                 "': " + fs::path(files[m]).filename().string() + " and " +
                                 fs::path(files[n]).filename().string(),
                             folder,
                             "keep one of them in the folder, or give it a name of its own"};
    }
    if (!matched)
        return Error{"no row of the table is about a mask of the folder, such as '" +
                         list.structures.front().entry.name + "'",
                     options.table,
                     "expected rows value,name with the masks' file names as names, or with the "
                     "numbers of files such as seg-5.nii.gz as values"};
    SONOCASE_TRY_DONE(join_masks(first_grid, places, folder, list));
    leave_out_background(list);
    // Names that TotalSegmentator does not define get values above its own.
    int next = 1001;
    for (Structure& structure : list.structures)
        if (structure.entry.value == 0) structure.entry.value = next++;
    return list;
}

Status check_names(const std::vector<Structure>& structures, const std::string& path) {
    for (std::size_t i = 0; i < structures.size(); ++i) {
        const LabelTableEntry& a = structures[i].entry;
        for (std::size_t j = i + 1; j < structures.size(); ++j) {
            const LabelTableEntry& b = structures[j].entry;
            if (a.name == b.name)
                return Error{"two labels are named '" + a.name + "' (values " +
                                 std::to_string(a.value) + " and " + std::to_string(b.value) + ")",
                             path, "give each label its own name in the label table"};
        }
        if (a.name == "outside")
            return Error{"value " + std::to_string(a.value) + " is named 'outside'", path,
                         "that name is kept for 0; rename it in the label table"};
    }
    return Done{};
}

// The tissue of a structure, by the class in its table, else by its name. The class "fluid" names
// only a kind of tissue: which fluid it is, the name says if it names one.
TissueChoice tissue_of(const LabelTableEntry& entry) {
    const TissueChoice by_name = tissue_for_label(entry.name);
    if (entry.tissue_class.empty()) return by_name;
    if (entry.tissue_class != "fluid") return tissue_for_label(entry.tissue_class);
    const Tissue* named = find_tissue(by_name.tissue);
    return named != nullptr && named->kind == TissueKind::fluid ? by_name
                                                                : TissueChoice{"cyst", true};
}

Status check_classes(const std::vector<Structure>& structures, const std::string& table) {
    std::vector<std::string> names;
    for (const Tissue& tissue : built_in_tissues()) names.push_back(tissue.name);
    for (const Structure& structure : structures) {
        const std::string& given = structure.entry.tissue_class;
        if (given.empty() || given == "fluid" || tissue_for_label(given).known) continue;
        return Error{"'" + structure.entry.name + "' has the unknown tissue_class '" + given + "'",
                     table, suggest_name(given, names)};
    }
    return Done{};
}

// A .labels file of this program's own import, unchanged.
Result<ImportedLabels> from_stage_file(const std::string& path) {
    SONOCASE_TRY(auto file, load_label_file(path));
    if (file.frame != "ct")
        return Error{"labels are in the frame '" + file.frame + "'", path,
                     "expected labels of the patient, in the frame 'ct', as import writes them"};
    ImportedLabels result;
    result.labels = std::move(file.volume);
    if (!file.reports.empty()) result.report = file.reports.front();
    result.report.warnings.clear();  // they were reported when the file was made
    return result;
}

// Gives structures that no table names a name made from their value, and warns of them. Returns
// their number.
int name_unnamed(std::vector<Structure>& structures, std::vector<std::string>& warnings) {
    std::string unnamed;
    int unnamed_count = 0;
    for (Structure& structure : structures) {
        if (!structure.entry.name.empty()) continue;
        structure.entry.name = "label_" + std::to_string(structure.entry.value);
        if (structure.entry.layer > 0)
            structure.entry.name += "_layer_" + std::to_string(structure.entry.layer);
        unnamed += (unnamed_count++ > 0 ? ", " : "") + std::to_string(structure.entry.value);
    }
    if (unnamed_count > 0)
        warnings.push_back("no table names the values " + unnamed +
                           ": they are taken as soft tissue; give a table of value,name");
    return unnamed_count;
}

// Appends each structure to the palette; warns of names that no rule gives a tissue. Returns their
// number.
int fill_palette(const std::vector<Structure>& structures,
                 LabelVolume& labels,
                 std::vector<std::string>& warnings) {
    std::string unknown;
    int unknown_count = 0;
    for (const Structure& structure : structures) {
        const LabelTableEntry& entry = structure.entry;
        const TissueChoice choice = tissue_of(entry);
        if (!choice.known && !entry.name.starts_with("label_"))
            unknown += (unknown_count++ > 0 ? ", " : "") + entry.name;
        labels.labels.push_back({entry.name, std::string(choice.tissue), entry.value,
                                 entry.colour.value_or(label_colour(entry.name))});
    }
    if (unknown_count > 0)
        warnings.push_back(
            "no rule knows what tissue these are, and they are taken as soft tissue: " + unknown +
            "; say so in the recipe's [labels]");
    return unknown_count;
}

struct PaintCount {
    std::uint64_t overlaps = 0;  // voxels of more than one structure
    std::uint64_t body_voxels = 0;
    std::string covered;  // names of structures of which nothing is left
};

// Writes the structures' runs into the volume; where they overlap the smaller structure remains.
PaintCount paint(const std::vector<Structure>& structures, LabelVolume& labels) {
    // Large structures first, so that small ones end on top.
    std::vector<std::size_t> order(structures.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return structures[a].voxels > structures[b].voxels;
    });
    labels.voxels.assign(labels.grid.voxel_count(), 0);
    PaintCount count;
    for (const std::size_t s : order) {
        for (const VoxelRun run : structures[s].runs) {
            for (std::uint32_t v = run.first; v < run.first + run.count; ++v) {
                if (labels.voxels[v] != 0)
                    ++count.overlaps;
                else
                    ++count.body_voxels;
                labels.voxels[v] = static_cast<std::uint8_t>(s + 1);
            }
        }
    }
    if (count.overlaps == 0) return count;
    std::vector<bool> left(256, false);
    for (const std::uint8_t voxel : labels.voxels) left[voxel] = true;
    for (std::size_t s = 0; s < structures.size(); ++s)
        if (!left[s + 1])
            count.covered += (count.covered.empty() ? "" : ", ") + structures[s].entry.name;
    return count;
}

}  // namespace

std::vector<std::string> names_options() {
    std::vector<std::string> options{"auto", "none"};
    for (const Numbering& numbering : numberings()) options.emplace_back(numbering.key);
    return options;
}

std::string table_beside(const std::string& map) {
    if (!is_volume_file_name(map)) return "";
    const fs::path folder = fs::absolute(map).lexically_normal().parent_path();
    std::error_code code;
    for (const fs::path& side : {folder / (volume_stem(map) + ".csv"), folder / "dataset.json",
                                 folder.parent_path() / "dataset.json"})
        if (fs::is_regular_file(side, code)) return side.string();
    return "";
}

Box3 body_box(const LabelVolume& labels) {
    const Grid& grid = labels.grid;
    Int3 low{grid.size.x, grid.size.y, grid.size.z}, high{-1, -1, -1};
    std::size_t number = 0;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i, ++number) {
                if (labels.voxels[number] == 0) continue;
                low = {std::min(low.x, i), std::min(low.y, j), std::min(low.z, k)};
                high = {std::max(high.x, i), std::max(high.y, j), std::max(high.z, k)};
            }
        }
    }
    Box3 box;
    if (high.x < 0) return box;
    for (int corner = 0; corner < 8; ++corner)
        box.include(grid.point_from_voxel({(corner & 1) ? high.x + 0.5 : low.x - 0.5,
                                           (corner & 2) ? high.y + 0.5 : low.y - 0.5,
                                           (corner & 4) ? high.z + 0.5 : low.z - 0.5}));
    return box;
}

Result<ImportedLabels> import_label_map(const std::string& path,
                                        const ImportOptions& options,
                                        const Progress& progress) {
    const Stopwatch watch;
    std::error_code code;
    if (!std::filesystem::is_directory(path, code)) {
        SONOCASE_TRY_DONE(check_source_file(path, "expected a label map"));
    }
    if (path.ends_with(".labels")) return from_stage_file(path);
    const auto names = names_options();
    if (std::find(names.begin(), names.end(), options.names) == names.end())
        return Error{"'" + options.names + "' is no numbering of labels", "names",
                     suggest_name(options.names, names)};
    report_progress(progress, 0, "reading labels");
    SONOCASE_TRY(auto list, is_mask_folder(path) ? read_mask_folder(path, options)
                                                 : read_label_file(path, options));
    std::vector<Structure>& structures = list.structures;
    std::erase_if(structures, [](const Structure& s) { return s.voxels == 0; });
    if (structures.empty())
        return Error{"label map holds no body: every voxel is 0", path,
                     "expected the segmentation of a torso; check that this is the right file"};
    if (structures.size() > kMaxLabels - 1)
        return Error{std::to_string(structures.size()) + " labels", path,
                     "expected at most 254 structures and 0 outside; merge or drop labels"};

    ImportedLabels result;
    StageReport& report = result.report;
    report.stage = stage_names::kImport;
    report.version = kImportVersion;
    report.notes = std::move(list.notes);
    report.warnings = std::move(list.warnings);
    for (Structure& structure : structures) mend_name(structure.entry.name, report.warnings);
    const int unnamed_count = name_unnamed(structures, report.warnings);
    std::stable_sort(
        structures.begin(), structures.end(),
        [](const Structure& a, const Structure& b) { return a.entry.value < b.entry.value; });
    SONOCASE_TRY_DONE(check_names(structures, path));
    const std::string& table = options.table.empty() ? path : options.table;
    SONOCASE_TRY_DONE(check_classes(structures, table));

    if (std::min({list.grid.size.x, list.grid.size.y, list.grid.size.z}) < 2)
        return Error{"a single slice of " + grid_text(list.grid) + " voxels", path,
                     "expected a volume: give the whole map, or the folder of all its slices"};
    report_progress(progress, 0.6, "painting labels");
    LabelVolume& labels = result.labels;
    labels.grid = list.grid;
    if (options.scale != 1) {
        labels.grid.spacing_mm = options.scale * labels.grid.spacing_mm;
        for (int axis = 0; axis < 3; ++axis) labels.grid.origin_mm[axis] *= options.scale;
    }
    labels.labels.push_back({"outside", "outside", 0, {0, 0, 0}});
    const int unknown_count = fill_palette(structures, labels, report.warnings);
    const PaintCount painted = paint(structures, labels);
    if (painted.overlaps > 0)
        report.warnings.push_back(
            std::to_string(painted.overlaps) +
            " voxels lie in more than one structure and went to the smaller one");
    if (!painted.covered.empty())
        report.warnings.push_back(
            "smaller structures cover these wholly, so that nothing is left of them: " +
            painted.covered + "; are they drawn twice, or are masks turned inside out (0 inside)?");
    const Box3 box = body_box(labels);
    if (const auto error = check_torso_extent(box.extent(), "body", path, "--scale")) return *error;

    const double voxel_ml = labels.grid.voxel_volume_mm3() / 1000;
    report.measures = {
        {"labels", static_cast<double>(structures.size())},
        {"unnamed_labels", static_cast<double>(unnamed_count)},
        {"unknown_tissues", static_cast<double>(unnamed_count + unknown_count)},
        {"overlapping_voxels", static_cast<double>(painted.overlaps)},
        {"voxel_volume_mm3", labels.grid.voxel_volume_mm3()},
        {"body_width_mm", box.extent().x},
        {"body_depth_mm", box.extent().y},
        {"body_height_mm", box.extent().z},
        {"body_volume_ml", static_cast<double>(painted.body_voxels) * voxel_ml},
    };
    if (list.assumed_names > 0)
        report.measures.push_back({"assumed_names", static_cast<double>(list.assumed_names)});
    report.seconds = watch.seconds();
    report_progress(progress, 1, "labels read");
    return result;
}

}  // namespace sonocase::pipeline::inline import_volume
