// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_wall.h"

#include <cmath>

namespace sonocase::runtime {

using namespace physical;

WallEcho wall_echo(
    const ReferenceInput& in, Point3 above, Point3 voxel, Point3 below, double node_mm) {
    const WallTables& sheets = in.tables.wall;
    const auto place = [&](Point3 v) { return wall_place(in.scene.layers, sheets, v); };
    const WallPlace here = place(voxel), before = place(above), after = place(below);
    const auto sheet = [&](const std::vector<float>& table, double mm, double before_mm,
                           double after_mm) {
        const double cosine = std::min(std::abs(after_mm - before_mm) / node_mm, 1.0);
        return static_cast<double>(table[static_cast<std::size_t>(wall_step(mm, table.size()))]) *
               std::pow(cosine, 4);
    };
    const double outer = sheet(sheets.outer, here.depth, before.depth, after.depth),
                 inner = sheet(sheets.inner, here.above, before.above, after.above);
    const double share = std::clamp(0.5 + (here.above - here.depth) / kWallBlendMm, 0.0, 1.0);
    return {(outer * share + inner * (1 - share)) * std::exp2(here.strength_db / kDbPerLog2),
            here.above > 0, wall_ground_db(sheets, here.depth, here.above)};
}

}  // namespace sonocase::runtime
