// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/body/scan_body.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <vector>

#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_body {

namespace {

constexpr int kAirHu = -300, kFatHu = -30, kBoneHu = 200;
constexpr double kOpeningMm = 6;  // half the thickness of what the opening takes off
constexpr double kSkinMm = 2;
constexpr double kThickSkinMm = 6;
constexpr double kComplete = 0.95;

using Mask = std::vector<std::uint8_t>;

// The scan on the grid of the labels; outside it, air.
std::vector<std::int16_t> on_grid_of(const Grid& grid, const ScanVolume& scan) {
    std::vector<std::int16_t> hu(grid.voxel_count(), -1024);
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
            for (int j = 0; j < grid.size.y; ++j)
                for (int i = 0; i < grid.size.x; ++i) {
                    const Point3 at = scan.grid.voxel_from_point(
                        grid.point_from_voxel({double(i), double(j), double(k)}));
                    const int x = static_cast<int>(std::lround(at.x)),
                              y = static_cast<int>(std::lround(at.y)),
                              z = static_cast<int>(std::lround(at.z));
                    if (!scan.grid.contains(x, y, z)) continue;
                    hu[grid.index(i, j, static_cast<int>(k))] =
                        scan.values[scan.grid.index(x, y, z)];
                }
    });
    return hu;
}

// Along one row of a slice: each voxel becomes 1 if any within `radius` of it is `wanted`.
void spread_row(const std::uint8_t* from,
                std::uint8_t* to,
                int count,
                std::ptrdiff_t step,
                int radius,
                std::uint8_t wanted) {
    int last = -radius - 1;  // the last wanted one so far
    for (int n = 0; n < std::min(radius, count); ++n)
        if (from[n * step] == wanted) last = n;
    for (int n = 0; n < count; ++n) {
        if (n + radius < count && from[(n + radius) * step] == wanted) last = n + radius;
        to[n * step] = n - last <= radius ? 1 : 0;
    }
}

// Of each slice, what lies within a square of that radius about a voxel that is `wanted`. Beyond
// the slice nothing is.
Mask near_in_slices(const Grid& grid, const Mask& mask, std::uint8_t wanted, double radius_mm) {
    const int rx = std::max(1, static_cast<int>(std::lround(radius_mm / grid.spacing_mm.x))),
              ry = std::max(1, static_cast<int>(std::lround(radius_mm / grid.spacing_mm.y)));
    const auto slice = static_cast<std::size_t>(grid.size.x) * grid.size.y;
    Mask result(mask.size());
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        Mask rows(slice);
        for (std::size_t k = begin; k < end; ++k) {
            const std::uint8_t* from = mask.data() + k * slice;
            std::uint8_t* to = result.data() + k * slice;
            for (int j = 0; j < grid.size.y; ++j)
                spread_row(from + std::ptrdiff_t{j} * grid.size.x,
                           rows.data() + std::ptrdiff_t{j} * grid.size.x, grid.size.x, 1, rx,
                           wanted);
            for (int i = 0; i < grid.size.x; ++i)
                spread_row(rows.data() + i, to + i, grid.size.y, grid.size.x, ry, 1);
        }
    });
    return result;
}

// Leaves the largest part of a mask (six neighbours).
void keep_largest(const Grid& grid, Mask& mask) {
    const std::ptrdiff_t steps[3] = {1, grid.size.x,
                                     static_cast<std::ptrdiff_t>(grid.size.x) * grid.size.y};
    std::vector<std::uint32_t> stack, part, largest;
    Mask seen(mask.size(), 0);
    for (std::size_t first = 0; first < mask.size(); ++first) {
        if (mask[first] == 0 || seen[first] != 0) continue;
        part.clear();
        stack.assign(1, static_cast<std::uint32_t>(first));
        seen[first] = 1;
        while (!stack.empty()) {
            const std::uint32_t at = stack.back();
            stack.pop_back();
            part.push_back(at);
            const std::array<int, 3> v{
                static_cast<int>(at % static_cast<std::uint32_t>(grid.size.x)),
                static_cast<int>(at / static_cast<std::uint32_t>(steps[1]) %
                                 static_cast<std::uint32_t>(grid.size.y)),
                static_cast<int>(at / static_cast<std::uint32_t>(steps[2]))};
            for (int axis = 0; axis < 3; ++axis)
                for (const int side : {-1, 1}) {
                    const int n = v[static_cast<std::size_t>(axis)] + side;
                    if (n < 0 || n >= grid.size[axis]) continue;
                    const auto to = static_cast<std::uint32_t>(at + side * steps[axis]);
                    if (mask[to] == 0 || seen[to] != 0) continue;
                    seen[to] = 1;
                    stack.push_back(to);
                }
        }
        if (part.size() > largest.size()) largest.swap(part);
    }
    std::fill(mask.begin(), mask.end(), std::uint8_t{0});
    for (const std::uint32_t at : largest) mask[at] = 1;
}

// Fills what a slice's body encloses: all that is not joined to the slice's edge.
void fill_holes(const Grid& grid, Mask& mask) {
    const auto slice = static_cast<std::size_t>(grid.size.x) * grid.size.y;
    const int nx = grid.size.x, ny = grid.size.y;
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        Mask outside(slice);
        std::vector<int> stack;
        for (std::size_t k = begin; k < end; ++k) {
            std::uint8_t* body = mask.data() + k * slice;
            std::fill(outside.begin(), outside.end(), std::uint8_t{0});
            const auto visit = [&](int i, int j) {
                if (i < 0 || j < 0 || i >= nx || j >= ny) return;
                const int at = j * nx + i;
                if (body[at] != 0 || outside[static_cast<std::size_t>(at)] != 0) return;
                outside[static_cast<std::size_t>(at)] = 1;
                stack.push_back(at);
            };
            for (int i = 0; i < nx; ++i) {
                visit(i, 0);
                visit(i, ny - 1);
            }
            for (int j = 0; j < ny; ++j) {
                visit(0, j);
                visit(nx - 1, j);
            }
            while (!stack.empty()) {
                const int i = stack.back() % nx, j = stack.back() / nx;
                stack.pop_back();
                visit(i - 1, j);
                visit(i + 1, j);
                visit(i, j - 1);
                visit(i, j + 1);
            }
            for (std::size_t n = 0; n < slice; ++n) body[n] = outside[n] == 0 ? 1 : 0;
        }
    });
}

// 1 where the body is, with every voxel that is labelled.
Mask body_of(const Grid& grid, const Mask& labelled, const std::vector<std::int16_t>& hu) {
    Mask dense(hu.size());
    for (std::size_t n = 0; n < hu.size(); ++n) dense[n] = hu[n] > kAirHu ? 1 : 0;
    Mask core = near_in_slices(grid, dense, 0, kOpeningMm);  // near air
    for (std::size_t n = 0; n < core.size(); ++n) core[n] = core[n] == 0 && dense[n] != 0 ? 1 : 0;
    keep_largest(grid, core);
    // Corners come back as well: the square reaches a little farther than the opening took.
    Mask body =
        near_in_slices(grid, core, 1, kOpeningMm + std::max(grid.spacing_mm.x, grid.spacing_mm.y));
    for (std::size_t n = 0; n < body.size(); ++n)
        body[n] = (body[n] != 0 && dense[n] != 0) || labelled[n] != 0 ? 1 : 0;
    fill_holes(grid, body);
    return body;
}

std::int16_t median_about(const Grid& grid, const std::vector<std::int16_t>& hu, Int3 v) {
    std::array<std::int16_t, 27> values{};
    std::size_t count = 0;
    for (int k = std::max(0, v.z - 1); k <= std::min(grid.size.z - 1, v.z + 1); ++k)
        for (int j = std::max(0, v.y - 1); j <= std::min(grid.size.y - 1, v.y + 1); ++j)
            for (int i = std::max(0, v.x - 1); i <= std::min(grid.size.x - 1, v.x + 1); ++i)
                values[count++] = hu[grid.index(i, j, k)];
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(values.begin(), middle, values.begin() + static_cast<std::ptrdiff_t>(count));
    return *middle;
}

enum Fill : std::size_t { kGas, kFat, kMuscle, kBone, kSkin, kFills };
struct FillLabel {
    const char* name;
    const char* tissue;
    std::array<std::uint8_t, 3> colour;
};
constexpr std::array<FillLabel, kFills> kFillLabels{{{"gas_in_body", "gas", {60, 60, 90}},
                                                     {"other_fat", "fat", {240, 218, 130}},
                                                     {"other_muscle", "muscle", {170, 68, 62}},
                                                     {"other_bone", "bone", {236, 232, 214}},
                                                     {"skin", "skin", {233, 194, 166}}}};

// The palette's labels of the fillings: those that it has by name, and new ones at its end.
Result<std::array<std::uint8_t, kFills>> fill_labels(LabelVolume& labels,
                                                     const std::string& where) {
    std::array<std::uint8_t, kFills> index{};
    int next = 201;
    for (const Label& label : labels.labels) next = std::max(next, label.source_value + 1);
    for (std::size_t f = 0; f < kFills; ++f) {
        std::size_t at = 1;
        while (at < labels.labels.size() && labels.labels[at].name != kFillLabels[f].name) ++at;
        if (at == labels.labels.size()) {
            if (at >= kMaxLabels)
                return Error{"no label is free for " + std::string(kFillLabels[f].name), where,
                             "expected at most 249 structures beside a scan: merge or drop labels"};
            labels.labels.push_back(
                {kFillLabels[f].name, kFillLabels[f].tissue, next++, kFillLabels[f].colour});
        }
        index[f] = static_cast<std::uint8_t>(at);
    }
    return index;
}

// Takes labels without voxels out of the palette: covers, and those behind the given ones.
void drop_unused(LabelVolume& labels, std::size_t given, const std::vector<bool>& cover) {
    std::vector<std::uint8_t> to(labels.labels.size(), 0);
    std::vector<bool> used(labels.labels.size(), false);
    for (const std::uint8_t label : labels.voxels) used[label] = true;
    std::vector<Label> kept;
    for (std::size_t l = 0; l < labels.labels.size(); ++l) {
        if (!used[l] && (l >= given || cover[l])) continue;
        to[l] = static_cast<std::uint8_t>(kept.size());
        kept.push_back(std::move(labels.labels[l]));
    }
    labels.labels = std::move(kept);
    for (std::uint8_t& label : labels.voxels) label = to[label];
}

// Whether a label is all that lies within the skin, as TotalSegmentator's task "body" and planning
// systems draw it: it does not tell what lies there. A skin counts where it is no thin layer.
bool is_cover(const LabelVolume& labels, std::size_t label) {
    const Label& of = labels.labels[label];
    if (of.tissue != "soft_tissue" && of.tissue != "skin") return false;
    std::string name;
    for (const char c : of.name)
        if (std::isalpha(static_cast<unsigned char>(c)) != 0)
            name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const char* whole : {"body", "bodytrunc", "bodytrunk", "bodyextremities", "wholebody",
                              "trunk", "torso", "external", "outerbody", "outercontour"})
        if (name == whole) return true;
    if (name != "skin") return false;
    Mask skin(labels.voxels.size());
    std::size_t all = 0, inner = 0;
    for (std::size_t n = 0; n < skin.size(); ++n) all += skin[n] = labels.voxels[n] == label;
    const Mask edge = near_in_slices(labels.grid, skin, 0, kThickSkinMm);
    for (std::size_t n = 0; n < skin.size(); ++n) inner += skin[n] != 0 && edge[n] == 0;
    return 10 * inner > all;
}

bool is_gut(std::string_view name) {
    return name == "stomach" || name == "duodenum" || name == "small_bowel" || name == "colon";
}

// Organs that hold neither fat nor air. In the shared CT 0.4 % of their voxels are below kFatHu -
// 10, along their edges; where it is mirrored or lies 20 mm aside, 15 % and more.
bool is_organ(std::string_view tissue) {
    for (const char* organ : {"liver", "spleen", "kidney_cortex", "blood", "vein", "artery"})
        if (tissue == organ) return true;
    return false;
}
constexpr double kMaxFatInOrgans = 0.12;
constexpr double kEnoughMl = 50;
constexpr int kThinBoneHu = 110;  // median of bones with their marrow: 150 to 250

// A scan whose values are no Hounsfield units, or which lies elsewhere, would give another body.
Status check_scan(const LabelVolume& labels,
                  const std::vector<std::int16_t>& hu,
                  const ScanVolume& scan,
                  const std::string& where,
                  StageReport& report) {
    std::size_t labelled = 0, covered = 0, soft = 0, organ = 0, organ_fat = 0;
    std::vector<std::int16_t> bone;
    std::array<bool, 256> of_organ{}, of_bone{};
    for (std::size_t l = 1; l < labels.labels.size(); ++l) {
        of_organ[l] = is_organ(labels.labels[l].tissue);
        of_bone[l] = labels.labels[l].tissue == "bone";
    }
    std::array<int, 2> range{32767, -32768};
    const Grid& grid = labels.grid;
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const std::size_t n = grid.index(i, j, k);
                const std::uint8_t label = labels.voxels[n];
                if (label == 0) continue;
                ++labelled;
                const Point3 at = scan.grid.voxel_from_point(
                    grid.point_from_voxel({double(i), double(j), double(k)}));
                const bool inside = scan.grid.contains(static_cast<int>(std::lround(at.x)),
                                                       static_cast<int>(std::lround(at.y)),
                                                       static_cast<int>(std::lround(at.z)));
                covered += inside;
                soft += hu[n] > -200 && hu[n] < 400;
                if (!inside) continue;
                range = {std::min<int>(range[0], hu[n]), std::max<int>(range[1], hu[n])};
                if (of_bone[label]) bone.push_back(hu[n]);
                if (!of_organ[label]) continue;
                ++organ;
                organ_fat += hu[n] < kFatHu - 10;
            }
    if (10 * covered < 9 * labelled)
        return Error{text("the scan covers %.0f %% of what is labelled",
                          100.0 * static_cast<double>(covered) / static_cast<double>(labelled)),
                     where, "expected the scan that the labels were drawn on"};
    if (std::none_of(scan.values.begin(), scan.values.end(),
                     [](int value) { return value < -700; }))
        return Error{text("nothing in the scan is as thin as air: its values within the labels are "
                          "%d to %d",
                          range[0], range[1]),
                     where,
                     "expected the CT that the labels were drawn on, in Hounsfield units (air is "
                     "-1000): neither an MR image, nor grey levels of 0 to 255, nor the label map"};
    if (3 * soft < labelled)
        return Error{text("%.0f %% of what is labelled has the density of a body",
                          100.0 * static_cast<double>(soft) / static_cast<double>(labelled)),
                     where,
                     "expected the CT that the labels were drawn on, in Hounsfield units: an MR "
                     "image tells no density"};
    const auto enough = static_cast<std::size_t>(kEnoughMl * 1000 / grid.voxel_volume_mm3());
    double fat = 0, bone_hu = 0;
    if (organ > enough) fat = static_cast<double>(organ_fat) / static_cast<double>(organ);
    if (bone.size() > enough) {
        const auto middle = bone.begin() + static_cast<std::ptrdiff_t>(bone.size() / 2);
        std::nth_element(bone.begin(), middle, bone.end());
        bone_hu = *middle;
        report.measures.push_back({"scan_bone_hu", bone_hu});
    }
    if (organ > enough) report.measures.push_back({"scan_fat_in_organs", fat});
    if (fat <= kMaxFatInOrgans) return Done{};
    const std::string found = text(
        "%.0f %% of liver, spleen, kidneys and vessels have the density of fat or air", 100 * fat);
    const char* likely = "is the scan mirrored, upside down or of another examination?";
    if (bone.size() > enough && bone_hu < kThinBoneHu)
        return Error{found + text(", and half of the bone is below %.0f HU", bone_hu), where,
                     std::string("expected the scan to lie where the labels do: ") + likely};
    report.warnings.push_back("the scan may not lie where the labels do: " + found + "; " + likely);
    return Done{};
}

}  // namespace

Status fill_from_scan(const ScanVolume& scan, const std::string& where, ImportedLabels& imported) {
    LabelVolume& labels = imported.labels;
    StageReport& report = imported.report;
    const Grid& grid = labels.grid;
    const std::vector<std::int16_t> hu = on_grid_of(grid, scan);
    SONOCASE_TRY_DONE(check_scan(labels, hu, scan, where, report));
    for (const std::string& warning : scan.warnings) report.warnings.push_back("scan: " + warning);
    const std::size_t given = labels.labels.size();
    std::vector<bool> cover(given, false);
    std::string covers;
    for (std::size_t l = 1; l < given; ++l)
        if ((cover[l] = is_cover(labels, l)))
            covers += (covers.empty() ? "'" : ", '") + labels.labels[l].name + "'";
    Mask has_label(hu.size());
    for (std::size_t n = 0; n < hu.size(); ++n)
        has_label[n] = labels.voxels[n] != 0 && !cover[labels.voxels[n]] ? 1 : 0;
    const Mask body = body_of(grid, has_label, hu);
    std::size_t in_body = 0, without = 0;
    for (std::size_t n = 0; n < body.size(); ++n) {
        in_body += body[n];
        without += body[n] != 0 && has_label[n] == 0;
    }
    const double voxel_ml = grid.voxel_volume_mm3() / 1000;
    const double labelled =
        in_body == 0 ? 1 : 1 - static_cast<double>(without) / static_cast<double>(in_body);
    report.measures.push_back({"scan_body_ml", static_cast<double>(in_body) * voxel_ml});
    if (labelled >= kComplete) {
        report.notes.push_back(
            {"scan", text("not needed: %.0f %% of the body has a label", 100 * labelled)});
        report.warnings.push_back(
            text("the scan is not used, as %.0f %% of the body has a label", 100 * labelled) +
            "; leave it out, or take labels out of the map where it is to fill in the body");
        return Done{};
    }
    if (!covers.empty())
        report.warnings.push_back(
            "the scan fills in what only " + covers +
            " names, as that is all of the body; leave the scan out to keep it as it is");
    SONOCASE_TRY(const auto fill, fill_labels(labels, where));
    std::vector<bool> gut(labels.labels.size(), false);
    for (std::size_t l = 1; l < given; ++l) gut[l] = is_gut(labels.labels[l].name);
    for (std::uint8_t& label : labels.voxels)
        if (cover[label]) label = 0;
    const Mask near_air = near_in_slices(grid, body, 0, kSkinMm);
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
            for (int j = 0; j < grid.size.y; ++j)
                for (int i = 0; i < grid.size.x; ++i) {
                    const std::size_t n = grid.index(i, j, k);
                    std::uint8_t& label = labels.voxels[n];
                    if (label != 0) {
                        if (gut[label] && hu[n] < kAirHu) label = fill[kGas];
                        continue;
                    }
                    if (body[n] == 0) continue;
                    const int value = median_about(grid, hu, {i, j, k});
                    const Fill of = value < kAirHu     ? kGas
                                    : value < kFatHu   ? kFat
                                    : value <= kBoneHu ? kMuscle
                                                       : kBone;
                    // Towards air the median of a skin voxel is that of the air beside it.
                    label = fill[near_air[n] != 0 ? kSkin : of];
                }
    });
    drop_unused(labels, given, cover);
    report.measures.push_back({"scan_filled_ml", static_cast<double>(without) * voxel_ml});
    report.notes.push_back(
        {"scan", text("filled in %.0f %% of the body by its density", 100 * (1 - labelled))});
    for (Measure& m : report.measures) {
        if (m.name == "labels") m.value = static_cast<double>(labels.labels.size() - 1);
        if (m.name == "body_volume_ml") m.value = static_cast<double>(in_body) * voxel_ml;
    }
    const Vector3 extent = body_box(labels).extent();
    for (Measure& m : report.measures) {
        if (m.name == "body_width_mm") m.value = extent.x;
        if (m.name == "body_depth_mm") m.value = extent.y;
        if (m.name == "body_height_mm") m.value = extent.z;
    }
    return Done{};
}

}  // namespace sonocase::pipeline::inline import_body
