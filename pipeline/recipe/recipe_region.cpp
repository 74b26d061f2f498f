// SPDX-License-Identifier: Apache-2.0

#include "pipeline/recipe/recipe_sections.h"

namespace sonocase::pipeline {
namespace {

constexpr double kMostMm = 1000;

// Either size_mm, or a ball's radius.
void read_size(const TomlTable& table, RegionRequest& request) {
    std::vector<double> size;
    double radius_mm = 0;
    const bool has_size = table.numbers("size_mm", size, 1, kMostMm, 3, 3);
    const bool has_radius = table.number("radius_mm", radius_mm, 1, kMostMm / 2);
    if (has_size) request.size_mm = {size[0], size[1], size[2]};
    if (has_radius) request.size_mm = {2 * radius_mm, 2 * radius_mm, 2 * radius_mm};
    if (has_size == has_radius && !table.fault())
        table.complain("size_mm", has_size ? "is given beside radius_mm" : "is missing",
                       "expected size_mm = [x, y, z] or radius_mm");
}

void read_one(const TomlTable& table, RegionRequest& request) {
    table.text("name", request.name);
    table.number("voxel_mm", request.voxel_mm, kFinestRegionMm, 2);
    Point3 centre;
    if (table.point("centre", centre)) request.centre = centre;
    table.text("label", request.label);
    table.text("target", request.target);
    const int places = (request.centre ? 1 : 0) + (request.label.empty() ? 0 : 1) +
                       (request.target.empty() ? 0 : 1);
    if (places != 1 && !table.fault())
        table.complain("centre", places == 0 ? "is missing" : "is given beside another place",
                       "expected one of centre, label and target");
    if (request.centre) {
        std::string frame = "mannequin";
        table.text("frame", frame, {"ct", "mannequin"});
        request.in_ct = frame == "ct";
    }
    if (request.label.empty())
        read_size(table, request);
    else
        table.number("margin_mm", request.margin_mm, 0, 200);
    table.finish();
}

}  // namespace

void read_region(const TomlTable& root, std::optional<RegionRequest>& region) {
    for (const TomlTable& table : root.tables("region")) {
        if (region) {
            table.complain("name", "is that of a second region", "expected one [[region]] a case");
            return;
        }
        read_one(table, region.emplace());
    }
}

}  // namespace sonocase::pipeline
