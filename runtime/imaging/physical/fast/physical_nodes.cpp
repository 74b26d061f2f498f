// SPDX-License-Identifier: Apache-2.0

// Effects diaphragm, gas_ring_down, wall and speckle_reduction: where a frame's beams meet gas, how
// far their nodes lie from skin and organs, and the noise of the tissue there.
#include <algorithm>
#include <cmath>

#include "runtime/imaging/physical/fast/physical_fast.h"

namespace sonocase::runtime {

using namespace physical;

void PhysicalFast::prepare_nodes(const Tables& tables) {
    nodes_.create(geometry_, tables);
    faces_of_nodes_.resize(static_cast<std::size_t>(nodes_.nodes));
    const std::size_t count = scene_.fine.frames.size();
    node_kinds_.assign(256, 0);
    for (std::size_t l = 0; l < count && l < node_kinds_.size(); ++l) {
        const TissueKind kind = scene_.looks[l].kind;
        node_kinds_[l] = (kind == TissueKind::gas ? kNodeGas : 0) |
                         (kind == TissueKind::bone ? kNodeBone : 0) |
                         (scene_.fine.frames[l].cube == kParenchymaCube ? kNodeOrgan : 0) |
                         (scene_.is_lung[l] ? kNodeLung : 0);
    }
    for (int l = 0; l < lines_; ++l) {
        const int line = std::min(l, geometry_.scanlines - 1);
        node_of_.push_back(nodes_.spacing.node_of(line));
        node_part_.push_back(nodes_.spacing.part(line));
    }
    // The wall's rows.
    const WallTables& sheets = tables.wall;
    PhysicalWall& w = wall_;
    w.every = nodes_.spacing.samples;
    w.rows = std::min(geometry_.samples,
                      static_cast<int>(kWallDepthMm / geometry_.step_mm) / w.every * w.every);
    w.per_row = 1 / static_cast<float>(w.every);
    w.per_mm = 1 / static_cast<float>(w.every * geometry_.step_mm);
    w.ground = static_cast<float>(16 * tables_.wall.ground_db);
    w.structure = 16 * tables_.wall.structure_db;
    w.outer = sheets.outer.data();
    w.inner = sheets.inner.data();
    w.outer_size = static_cast<int>(sheets.outer.size());
    w.inner_size = static_cast<int>(sheets.inner.size());
    const auto rows = static_cast<std::size_t>(wall_node_rows());
    wall_nodes_.assign(3 * rows * static_cast<std::size_t>(lines_) + kRowSlack, 0.0f);
    wall_active_.assign(rows * static_cast<std::size_t>(lines_ / kBeamBlock), 0);
    layer_nodes_.assign(3 * nodes_.at(nodes_.rows, 0), 0.0f);
}

// Moves nodes to where their tissue lies at rest: n.x, n.y, n.z already hold where the beams run.
void PhysicalFast::press_nodes(int first, int end) {
    NodeLattice& n = nodes_;
    const bool dents = press_.field->needle().moves();
    for (int node = first; node < end; ++node) {
        const int line = n.spacing.line(node);
        const auto beam = static_cast<std::size_t>(node);
        float along[3], side[3];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            along[axis] = n.per_mm[axis][beam];
            side[axis] = beams_[(static_cast<std::size_t>(kSideways + kVoxelPerMm) + axis) *
                                    static_cast<std::size_t>(lines_) +
                                static_cast<std::size_t>(line)];
        }
        for (int row = 0; row < n.rows; ++row) {
            const int k = row * n.spacing.samples;
            if (k >= press_.active) break;
            const press::PressView::Shift shift =
                dents ? press_.at(line, k) : press_.by_probe(line, k);
            const std::size_t at = n.at(row, node);
            n.x[at] += along[0] * shift.along_mm + side[0] * shift.side_mm;
            n.y[at] += along[1] * shift.along_mm + side[1] * shift.side_mm;
            n.z[at] += along[2] * shift.along_mm + side[2] * shift.side_mm;
        }
    }
}

// first: of a block of nodes. After place_beams and weigh_breathing of all beams.
void PhysicalFast::place_nodes(const PhysicalFrame& f, bool breathes, int first) {
    NodeLattice& n = nodes_;
    const int end = std::min(first + kBeamBlock, n.nodes);
    const auto number = [&](int row, int node) {
        return beams_[static_cast<std::size_t>(row) * static_cast<std::size_t>(lines_) +
                      static_cast<std::size_t>(n.spacing.line(node))];
    };
    for (int node = first; node < end; ++node) {
        const auto at = static_cast<std::size_t>(node);
        for (int axis = 0; axis < 3; ++axis) {
            n.origin[axis][at] = number(kVoxelOrigin + axis, node);
            n.per_mm[axis][at] = number(kVoxelPerMm + axis, node);
        }
        n.gap[at] = number(kGap, node);
    }
    const auto walk = [&](int axis, std::vector<float>& out) {
        const float *from = n.origin[axis].data(), *way = n.per_mm[axis].data(),
                    *gap = n.gap.data();
        for (int row = 0; row < n.rows; ++row) {
            const auto r = static_cast<float>(n.spacing.r_mm(row));
            const float contact = n.contact[static_cast<std::size_t>(row)];
            float* to = out.data() + n.at(row, 0);
            for (int node = first; node < end; ++node)
                to[node] = from[node] + way[node] * (r + gap[node] * contact);
        }
    };
    walk(0, n.x);
    walk(1, n.y);
    walk(2, n.z);
    if (f.press != nullptr) press_nodes(first, end);
    if (!breathes) return;
    const Vector3 shift = (1 / scene_.voxel_mm) * f.motion.breathing_mm;
    const int last = geometry_.samples - 1;
    for (int row = 0; row < n.rows; ++row) {
        const int k = std::min(row * n.spacing.samples, last);
        const float* above =
            breathing_.data() + static_cast<std::ptrdiff_t>(k / kBreathingNode) * lines_;
        const float part = static_cast<float>(k % kBreathingNode) / kBreathingNode;
        for (int node = first; node < end; ++node) {
            const float* w = above + n.spacing.line(node);
            const float weight = w[0] + (w[lines_] - w[0]) * part;
            const std::size_t at = n.at(row, node);
            n.x[at] -= weight * static_cast<float>(shift.x);
            n.y[at] -= weight * static_cast<float>(shift.y);
            n.z[at] -= weight * static_cast<float>(shift.z);
        }
    }
}

void PhysicalFast::search_nodes(const PhysicalFrame& f, const PhysicalBlock& base, bool breathes) {
    faces_.any_dome = false;
    faces_found_ = scene_.has_gas && (f.effects.diaphragm || f.effects.gas_ring_down);
    wall_shows_ = f.effects.wall && !scene_.layers.empty();
    const bool reduced = reduces_speckle(f);
    if (!faces_found_ && !wall_shows_ && !reduced) return;
    context_.workers.for_each(nodes_.stride / kBeamBlock, [&](int, int block) {
        const int first = block * kBeamBlock;
        place_nodes(f, breathes, first);
        if (faces_found_) find_faces(f, base, first);
        if (reduced) {
            search_noise(context_.simd, {&nodes_, first, contrast_.rows, kHazeCell, &scene_.layers,
                                         contrast_.noise.data()});
        }
        if (!wall_shows_) return;
        float* out = layer_nodes_.data();
        const std::size_t plane = nodes_.at(nodes_.rows, 0);
        search_layers(
            context_.simd,
            {&nodes_, first, wall_node_rows(), &scene_.layers,
             static_cast<float>(tables_.wall.wave_mm), static_cast<float>(tables_.wall.own_wave_mm),
             static_cast<float>(tables_.wall.strength_db), out, out + plane, out + 2 * plane});
    });
    if (faces_found_) join_faces(geometry_, nodes_.spacing, faces_of_nodes_, faces_);
}

// first: of a block of nodes.
void PhysicalFast::find_faces(const PhysicalFrame& f, const PhysicalBlock& base, int first) {
    FaceSearch search;
    search.nodes = &nodes_;
    search.first = first;
    search.depth_mm = static_cast<float>(geometry_.depth_mm);
    search.block = &base;
    search.kinds = node_kinds_.data();
    search_faces(context_.simd, search);
    for (int i = 0; i < std::min(kBeamBlock, nodes_.nodes - first); ++i) {
        FaceNode& face = faces_of_nodes_[static_cast<std::size_t>(first + i)];
        face = {search.depth[i], 0};
        if (search.dome[i] == 0 || !f.effects.diaphragm) continue;
        const std::size_t at = nodes_.at(search.row[i], first + i);
        face.peak =
            dome_peak(scene_, {static_cast<double>(nodes_.x[at]), static_cast<double>(nodes_.y[at]),
                               static_cast<double>(nodes_.z[at])});
    }
}

// line: of the block's first beam.
void PhysicalFast::show_faces(int line, PhysicalBlock& b) const {
    if (!faces_found_) return;
    b.face_mm = faces_.depth_mm.data() + line;
    b.face_peak = faces_.peak.data() + line;
    b.cosine = faces_.cosine.data() + line;
    if (!faces_.any_dome) return;
    const float* dome = faces_.dome_mm.data() + line;
    if (std::all_of(dome, dome + kBeamBlock, [](float mm) { return mm >= kNoFace; })) return;
    b.dome_mm = dome;
    b.dome_scale = static_cast<float>(tables_.dome_scale);
}

// first: of a block of beams. Fills the nodes of the block's beams, and which rows of nodes can
// show a sheet: beyond the ends of both tables there is none.
void PhysicalFast::place_wall(bool keep_all, int first, PhysicalWall& w) {
    w = wall_;
    const int rows = wall_node_rows();
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(rows) * lines_;
    float* out = wall_nodes_.data() + first;
    w.depth = out;
    w.above = out + plane;
    w.strength = out + 2 * plane;
    std::uint8_t* active =
        wall_active_.data() + static_cast<std::ptrdiff_t>(first / kBeamBlock) * rows;
    w.active = active;
    constexpr auto kBefore = static_cast<float>(kWallBeforeMm);
    const float outer_end = static_cast<float>(w.outer_size) / kWallSteps - kBefore,
                inner_end = static_cast<float>(w.inner_size) / kWallSteps - kBefore;
    const std::size_t node_plane = nodes_.at(nodes_.rows, 0);
    const auto line = static_cast<std::size_t>(first);
    const int begin = node_of_[line], end = node_of_[line + kBeamBlock - 1] + 1;
    for (int row = 0; row < rows; ++row) {
        const float *depth = layer_nodes_.data() + nodes_.at(row, 0), *above = depth + node_plane;
        bool shows = keep_all;
        for (int node = begin; node <= end; ++node) {
            shows = shows || (depth[node] > -kBefore && above[node] > -kBefore &&
                              (depth[node] < outer_end || above[node] < inner_end));
        }
        active[row] = shows;
        if (shows && row > 0) active[row - 1] = 1;
    }
    for (int row = 0; row < rows; ++row) {
        if (!active[row] && (row == 0 || !active[row - 1])) continue;
        for (int number = 0; number < 3; ++number) {
            const float* from = layer_nodes_.data() + nodes_.at(row, 0) +
                                static_cast<std::size_t>(number) * node_plane;
            float* to = out + number * plane + static_cast<std::ptrdiff_t>(row) * lines_;
            for (std::size_t l = 0; l < kBeamBlock; ++l) {
                const float* p = from + node_of_[line + l];
                to[l] = p[0] + (p[1] - p[0]) * node_part_[line + l];
            }
        }
    }
}

}  // namespace sonocase::runtime
