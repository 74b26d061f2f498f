// SPDX-License-Identifier: Apache-2.0

// Effect wall: the distances to skin and organs at the nodes of a frame's beams.
#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/fast/physical_fast.h"

namespace sonocase::runtime {

using namespace physical;

namespace {
// Beams between nodes, linear in between; few beams are far apart.
int every_beam(int scanlines) {
    return scanlines < 96 ? 1 : 4;
}

}  // namespace

void PhysicalFast::prepare_wall(const Tables& tables) {
    const ScanGeometry& g = geometry_;
    const WallTables& sheets = tables.wall;
    PhysicalWall& w = wall_;
    w.every = std::clamp(static_cast<int>(sheets.node_mm / g.step_mm), 1, kWallMostRows);
    w.rows = std::min(g.samples, static_cast<int>(kWallDepthMm / g.step_mm) / w.every * w.every);
    w.per_row = 1 / static_cast<float>(w.every);
    w.per_mm = 1 / static_cast<float>(w.every * g.step_mm);
    w.outer = sheets.outer.data();
    w.inner = sheets.inner.data();
    w.outer_size = static_cast<int>(sheets.outer.size());
    w.inner_size = static_cast<int>(sheets.inner.size());
    const std::size_t nodes = static_cast<std::size_t>(w.rows / w.every + 2),
                      plane = nodes * static_cast<std::size_t>(lines_);
    wall_nodes_.assign(3 * plane + kRowSlack, 0.0f);
    wall_active_.assign(nodes * static_cast<std::size_t>(lines_ / kBeamBlock), 0);
}

// first: of a block of beams. Fills the nodes of the block, and which rows of nodes can show a
// sheet: beyond the ends of both tables there is none.
void PhysicalFast::place_wall(const PhysicalFrame& f,
                              const BreathingField* breathing,
                              bool keep_all,
                              int first,
                              PhysicalWall& w) {
    const ScanGeometry& g = geometry_;
    w = wall_;
    const int nodes = w.rows / w.every + 2;
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(nodes) * lines_;
    float* out = wall_nodes_.data() + first;
    w.depth = out;
    w.above = out + plane;
    w.strength = out + 2 * plane;
    std::uint8_t* active =
        wall_active_.data() + static_cast<std::ptrdiff_t>(first / kBeamBlock) * nodes;
    w.active = active;
    const double outer_end = w.outer_size / static_cast<double>(kWallSteps) - kWallBeforeMm,
                 inner_end = w.inner_size / static_cast<double>(kWallSteps) - kWallBeforeMm;
    const int every = every_beam(g.scanlines);
    for (int node = 0; node < nodes; ++node) {
        const double r = (node * w.every + 0.5) * g.step_mm;
        const double contact = std::exp(-r / kGapReachMm);
        WallPlace left;
        bool shows = keep_all;
        for (int l = 0; l <= kBeamBlock; l += every) {
            const int line = std::min(first + l, g.scanlines - 1);
            // Also beyond the last beam.
            const double gap = static_cast<double>(gaps_[static_cast<std::size_t>(line)]);
            Point3 x = point_on_beam(g, f, first + l, r, gap * contact);
            if (breathing != nullptr) x = x - breathing->weight(x) * f.motion.breathing_mm;
            const WallPlace right =
                wall_place(scene_.layers, tables_.wall, scene_.grid.voxel_from_point(x));
            shows = shows || (right.depth > -kWallBeforeMm && right.above > -kWallBeforeMm &&
                              (right.depth < outer_end || right.above < inner_end));
            for (int j = 0; l > 0 && j < every; ++j) {
                const double part = static_cast<double>(j) / every;
                float* at = out + static_cast<std::ptrdiff_t>(node) * lines_ + l - every + j;
                at[0] = static_cast<float>(left.depth + (right.depth - left.depth) * part);
                at[plane] = static_cast<float>(left.above + (right.above - left.above) * part);
                at[2 * plane] = static_cast<float>(left.strength_db +
                                                   (right.strength_db - left.strength_db) * part);
            }
            left = right;
        }
        active[node] = shows;
        if (shows && node > 0) active[node - 1] = 1;
    }
}

}  // namespace sonocase::runtime
