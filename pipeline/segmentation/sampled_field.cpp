// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/sampled_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "formats/volume/boundary_record.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline segmentation {

namespace {

struct TopTwo {                         // the two best labels at a point
    std::size_t first = 0, second = 0;  // indices of candidates
    float gap = 1e9f;                   // score of the second minus that of the first
};

TopTwo top_two(const float* score, std::size_t count) {
    TopTwo top;
    float best = 1e30f, next = 1e30f;
    for (std::size_t i = 0; i < count; ++i) {
        if (score[i] < best) {
            next = best;
            top.second = top.first;
            best = score[i];
            top.first = i;
        } else if (score[i] < next) {
            next = score[i];
            top.second = i;
        }
    }
    top.gap = next - best;
    return top;
}

// Label and packed boundary record of a voxel of the grid.
struct VoxelSample {
    std::uint8_t label = 0;
    std::uint32_t record = kNoBoundary;
};

// Samples a label field at single voxels: the label there, and the boundary record of the surface
// near it. Holds what is the same for all voxels.
class VoxelReader {
  public:
    // Largest size of a voxel of the grid in the field's frame, mm: maps stretch by less than 1.5.
    static float stretched_mm(const Grid& grid) {
        return static_cast<float>(1.5 * grid.spacing_mm.x);
    }
    // Largest distance there, mm, of a surface within the band.
    static float reach_mm(double band_vx, const Grid& grid) {
        return static_cast<float>(band_vx) * stretched_mm(grid);
    }

    VoxelReader(const LabelField& field, const Grid& grid, double band_vx)
        : field_(field),
          nodes_(field.nodes()),
          band_vx_(band_vx),
          flat_(0.2 * grid.spacing_mm.x),
          stretched_mm_(stretched_mm(grid)),
          reach_mm_(reach_mm(band_vx, grid)) {
        for (int a = 0; a < 3; ++a) {
            const auto u = static_cast<std::size_t>(a);
            h_[u] = static_cast<float>(nodes_.spacing_mm[a]);
            last_[u] = static_cast<float>(nodes_.size[a] - 1);
            rim_[u] = 0.5f * static_cast<float>(a == 2 ? field.factor() : 1) + 1e-3f;
        }
    }

    // Nodes along k from the first voxel of a brick up to which the reader looks for the others:
    // the diagonal of the brick, the band and what lies behind the plane.
    float reach_nodes(double band_vx) const {
        return (5.2f + static_cast<float>(band_vx) + 0.5f + static_cast<float>(kBeyondVx)) *
                   stretched_mm_ / h_[2] +
               2;
    }

    // Whether a point in node coordinates lies more than half a voxel outside the label map, where
    // the map holds no information.
    bool beyond(const float* v) const {
        bool out_of = false;
        for (std::size_t a = 0; a < 3; ++a)
            out_of = out_of || v[a] < -rim_[a] || v[a] > last_[a] + rim_[a];
        return out_of;
    }

    // v        point in node coordinates
    // slope()  d(node) / d(voxel of the grid) there; called only near surfaces
    template <class Slope>
    VoxelSample operator()(const float* v, const Slope& slope) const {
        std::array<int, 3> near;
        float apart_sq = 0;
        for (std::size_t a = 0; a < 3; ++a) {
            near[a] = static_cast<int>(std::clamp(v[a] + 0.5f, 0.0f, last_[a]));
            const float d = h_[a] * (v[a] - static_cast<float>(near[a]));
            apart_sq += d * d;
        }
        const std::size_t node = nodes_.index(near[0], near[1], near[2]);
        const float spare = field_.node_margin_mm(node) - reach_mm_;
        if (spare > 0 && spare * spare > apart_sq) return {field_.node_label(node)};

        const LabelField::Position at = field_.locate(v[0], v[1], v[2]);
        if (at.candidates == nullptr) return {at.block->labels[0]};
        std::array<float, 256> score;
        field_.scores(at, score.data());
        const auto& labels = at.candidates->labels;
        const TopTwo top = top_two(score.data(), labels.size());
        const std::uint8_t own = labels[top.first], second = labels[top.second];
        VoxelSample sample{own};
        if (band_vx_ <= 0 || top.gap > reach_mm_ * field_.slope(own, second)) return sample;
        const Matrix3& m = slope();
        BoundaryRecord record{second};
        if (!find_plane(at, v, m, own, &record)) return sample;
        if (third_may_lie_beyond(at, score.data(), top, record.distance_vx)) {
            // Scores tie where three labels meet: the second label is the one beyond the surface.
            const std::uint8_t other = winner(behind_plane(v, m, record, kBeyondVx), score.data());
            if (other != own && other != second && holds(at, other)) {
                record.second_label = other;
                if (!find_plane(at, v, m, own, &record)) return sample;
            }
        }
        record.distance_vx = std::max(record.distance_vx, 0.0);
        sample.record = pack_boundary(record);
        return sample;
    }

  private:
    static constexpr double kBeyondVx = 0.3;

    static std::size_t place(const LabelField::Position& at, std::uint8_t label) {
        const auto& labels = at.candidates->labels;
        return static_cast<std::size_t>(std::find(labels.begin(), labels.end(), label) -
                                        labels.begin());
    }
    static bool holds(const LabelField::Position& at, std::uint8_t label) {
        return place(at, label) < at.candidates->labels.size();
    }

    // Whether a third label can be better than the second on the other side of the surface.
    bool third_may_lie_beyond(const LabelField::Position& at,
                              const float* score,
                              const TopTwo& top,
                              double distance_vx) const {
        const auto path_mm =
            static_cast<float>(std::max(distance_vx, 0.0) + kBeyondVx) * stretched_mm_;
        const auto& labels = at.candidates->labels;
        for (std::size_t c = 0; c < labels.size(); ++c) {
            if (c == top.first || c == top.second) continue;
            if (score[c] - score[top.second] <=
                path_mm * field_.slope(labels[top.second], labels[c]))
                return true;
        }
        return false;
    }

    std::uint8_t winner(const LabelField::Position& at, float* score) const {
        if (at.candidates == nullptr) return at.block->labels[0];
        field_.scores(at, score);
        return at.candidates->labels[top_two(score, at.candidates->labels.size()).first];
    }

    // The point `more` voxels behind the point of a plane that is nearest to the voxel.
    LabelField::Position behind_plane(const float* v,
                                      const Matrix3& m,
                                      const BoundaryRecord& r,
                                      double more) const {
        const Vector3 back = m * ((r.distance_vx + more) * r.normal);
        return field_.locate(v[0] - static_cast<float>(back.x), v[1] - static_cast<float>(back.y),
                             v[2] - static_cast<float>(back.z));
    }

    // f of LabelField::difference, which is zero on the surface between the two labels, and its
    // gradient per voxel of the grid.
    double difference(const LabelField::Position& at,
                      const Matrix3& m,
                      std::uint8_t own,
                      std::uint8_t second,
                      Vector3* gradient) const {
        const auto n = field_.difference(at, place(at, own), place(at, second));
        for (int b = 0; b < 3; ++b)
            (*gradient)[b] = n[0] * m(0, b) + n[1] * m(1, b) + n[2] * m(2, b);
        return n[3];
    }

    // Plane of the surface to record->second_label, from f and its gradient at the voxel, improved
    // once at the nearest point of that plane, because f is curved near thin structures. False: no
    // surface within the band.
    bool find_plane(const LabelField::Position& at,
                    const float* v,
                    const Matrix3& m,
                    std::uint8_t own,
                    BoundaryRecord* record) const {
        Vector3 g;
        const double f = difference(at, m, own, record->second_label, &g);
        const double slope_vx = norm(g);
        // Scores separate by at least 1 mm per mm; much less means that no surface is near.
        if (!(slope_vx > flat_)) return false;
        record->distance_vx = f / slope_vx;
        if (record->distance_vx > band_vx_ + 0.5) return false;
        record->normal = g / slope_vx;
        const LabelField::Position on_plane = behind_plane(v, m, *record, 0);
        if (on_plane.candidates != nullptr && holds(on_plane, own) &&
            holds(on_plane, record->second_label)) {
            Vector3 g2;
            const double f2 = difference(on_plane, m, own, record->second_label, &g2);
            const double slope2_vx = norm(g2);
            if (slope2_vx > 0.5 * slope_vx) {
                record->distance_vx += std::clamp(f2 / slope2_vx, -0.5, 0.5);
                record->normal = g2 / slope2_vx;
            }
        }
        return record->distance_vx <= band_vx_;
    }

    const LabelField& field_;
    const Grid& nodes_;
    double band_vx_;
    double flat_;  // gradients of f, per voxel of the grid, up to which no surface is near
    float stretched_mm_, reach_mm_;
    std::array<float, 3> h_, last_, rim_;
};

// Node coordinates from frame points, single precision.
struct NodeFromFrame {
    float m[9];
    float c[3];
    explicit NodeFromFrame(const Grid& nodes) {
        for (int a = 0; a < 3; ++a) {
            double shift = 0;
            for (int r = 0; r < 3; ++r) {
                const double v = nodes.direction(r, a) / nodes.spacing_mm[a];
                m[3 * a + r] = static_cast<float>(v);
                shift -= v * nodes.origin_mm[r];
            }
            c[a] = static_cast<float>(shift);
        }
    }
    void operator()(float x, float y, float z, float* out) const {
        for (int a = 0; a < 3; ++a)
            out[a] = m[3 * a] * x + m[3 * a + 1] * y + m[3 * a + 2] * z + c[a];
    }
};

// One row of bricks: 4 x 4 rows of voxels.
struct Strip {
    std::vector<std::uint32_t> table;  // pool entries count from 0 in the strip
    std::vector<std::uint32_t> pool;
    PreimageCounts counts;
    float low = 1e30f, high = -1e30f;  // where its voxels lie in the field, nodes along k
};

// Voxels between two heights of the field, in the layers that are held meanwhile.
struct Pass {
    int first_layer = 0, last_layer = 0;
    float low = -1e29f, high = 1e29f;  // nodes along k
    bool meets(const Strip& strip) const { return strip.low < high && strip.high >= low; }
};

// The passes over all voxels. Each reads voxels up to half a layer from the border between two
// layers, both of which are held.
std::vector<Pass> passes_through(const LabelField& field, float reach_nodes) {
    const int layers = field.layer_count(), half = field.layer_nodes() / 2;
    if (field.holds_all() || reach_nodes > static_cast<float>(half - 2)) return {{0, layers - 1}};
    std::vector<Pass> passes;
    for (int p = 0; p <= layers; ++p) {
        Pass pass;
        pass.first_layer = std::max(0, p - 1);
        pass.last_layer = std::min(layers - 1, p);
        if (p > 0) pass.low = static_cast<float>(p * 2 * half - half);
        if (p < layers) pass.high = static_cast<float>(p * 2 * half + half);
        passes.push_back(pass);
    }
    if (!field.holds(0)) std::reverse(passes.begin(), passes.end());
    return passes;
}

constexpr float kNoHeight = -1e30f;

// Scratch space of one thread.
struct RowScratch {
    explicit RowScratch(std::size_t nx, int bricks_x)
        : x(nx),
          y(nx),
          z(nx),
          status(nx),
          record(16 * nx),
          slope(static_cast<std::size_t>(bricks_x)),
          has_slope(slope.size()),
          height(slope.size()) {}
    std::vector<float> x, y, z;
    std::vector<MapStatus> status;
    std::vector<std::uint32_t> record;  // 16 rows
    // d(node) / d(voxel of the grid), one per brick, computed when first needed.
    std::vector<Matrix3> slope;
    std::vector<std::uint8_t> has_slope;
    // Height, in nodes along k, of the first voxel of each brick that lies in the field: a brick is
    // sampled as a whole, such that its slope does not depend on the passes. kNoHeight: none yet.
    std::vector<float> height;
};

Matrix3 node_slope(const Grid& nodes, const Grid& grid, const Matrix3& frame_from_grid) {
    Matrix3 slope;
    for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
            double sum = 0;
            for (int q = 0; q < 3; ++q)
                sum += nodes.direction(q, a) / nodes.spacing_mm[a] * frame_from_grid(q, b);
            slope(a, b) = sum * grid.spacing_mm.x;
        }
    }
    return slope;
}

// Bricks of records from the 16 rows of a strip.
void store_bricks(
    const Grid& grid, int by, int bz, const std::vector<std::uint32_t>& record, Strip* strip) {
    const int bricks_x = brick_count(grid.size).x;
    strip->table.clear();
    strip->pool.clear();
    strip->table.reserve(bricks_x);
    for (int bx = 0; bx < bricks_x; ++bx) {
        std::array<std::uint32_t, kBrickVoxels> brick;
        bool empty = true;
        for (int q = 0; q < kBrickVoxels; ++q) {
            const int i = std::min(4 * bx + q % 4, grid.size.x - 1);
            const int j = std::min(q / 4 % 4, grid.size.y - 1 - 4 * by);
            const int k = std::min(q / 16, grid.size.z - 1 - 4 * bz);
            const std::uint32_t value = record[static_cast<std::size_t>(j + 4 * k) * grid.size.x +
                                               static_cast<std::size_t>(i)];
            brick[q] = value;
            empty = empty && value == kNoBoundary;
        }
        if (empty) {
            strip->table.push_back(kUniformBrick);
        } else {
            strip->table.push_back(static_cast<std::uint32_t>(strip->pool.size() / kBrickVoxels));
            strip->pool.insert(strip->pool.end(), brick.begin(), brick.end());
        }
    }
}

// The rows that store_bricks was given.
void load_bricks(
    const Grid& grid, int by, int bz, const Strip& strip, std::vector<std::uint32_t>* record) {
    for (std::size_t bx = 0; bx < strip.table.size(); ++bx) {
        if (strip.table[bx] & kUniformBrick) continue;
        const std::uint32_t* brick =
            strip.pool.data() + static_cast<std::size_t>(strip.table[bx]) * kBrickVoxels;
        for (int q = 0; q < kBrickVoxels; ++q) {
            const int i = 4 * static_cast<int>(bx) + q % 4, j = q / 4 % 4, k = q / 16;
            if (i >= grid.size.x || 4 * by + j >= grid.size.y || 4 * bz + k >= grid.size.z)
                continue;
            (*record)[static_cast<std::size_t>(j + 4 * k) * grid.size.x +
                      static_cast<std::size_t>(i)] = brick[q];
        }
    }
}

void join_bricks(std::vector<Strip>* strips, const Grid& grid, BoundaryBricks* boundary) {
    boundary->size = grid.size;
    boundary->uniform = {kNoBoundary};
    std::size_t stored = 0, entries = 0;
    for (const Strip& strip : *strips) {
        stored += strip.pool.size();
        entries += strip.table.size();
    }
    boundary->pool.reserve(stored);
    boundary->table.reserve(entries);
    for (Strip& strip : *strips) {
        const auto base = static_cast<std::uint32_t>(boundary->pool.size() / kBrickVoxels);
        for (const std::uint32_t entry : strip.table)
            boundary->table.push_back(entry & kUniformBrick ? entry : entry + base);
        boundary->pool.insert(boundary->pool.end(), strip.pool.begin(), strip.pool.end());
        std::vector<std::uint32_t>().swap(strip.pool);
    }
}

// Per label the node at which it comes nearest to winning; empty if it is a candidate nowhere.
std::vector<std::optional<Int3>> nearest_to_winning(LabelField* field,
                                                    const std::vector<std::uint8_t>& labels) {
    std::vector<float> nearest(labels.size(), 1e30f);
    std::vector<std::optional<Int3>> place(labels.size());
    const int edge = field->block_edge();
    std::array<float, 256> score;
    const auto search = [&](const LabelField::Block& block, std::size_t n) {
        const auto at = std::find(block.labels.begin(), block.labels.end(), labels[n]);
        if (at == block.labels.end() || block.labels.size() < 2) return;
        const auto own = static_cast<std::size_t>(at - block.labels.begin());
        for (int q = 0; q < edge * edge * edge; ++q) {
            const Int3 node{block.first.x + q % edge, block.first.y + q / edge % edge,
                            block.first.z + q / edge / edge};
            if (!field->nodes().contains(node.x, node.y, node.z)) continue;
            LabelField::Position position = field->locate(
                static_cast<float>(node.x), static_cast<float>(node.y), static_cast<float>(node.z));
            position.candidates = &block.candidate_sets[0];
            field->scores(position, score.data());
            float other = 1e30f;
            for (std::size_t c = 0; c < block.labels.size(); ++c) {
                if (c != own) other = std::min(other, score[c]);
            }
            if (score[own] - other < nearest[n]) {
                nearest[n] = score[own] - other;
                place[n] = node;
            }
        }
    };
    for (int layer = 0; layer < field->layer_count() && !labels.empty(); ++layer) {
        field->hold(layer, layer);
        const auto [first, last] = field->blocks_of_layer(layer);
        for (std::size_t b = first; b < last; ++b) {
            for (std::size_t n = 0; n < labels.size(); ++n) search(field->blocks()[b], n);
        }
    }
    return place;
}

// Restores the labels of the source that the result lacks, or reports them as lost.
void restore_lost(LabelField* field, const FieldMap& map, SampledField* out) {
    const Grid& grid = out->volume.grid;
    const Int3 bricks = brick_count(grid.size);
    std::array<bool, 256> in_source{}, in_result{};
    for (const std::uint8_t v : field->source().voxels) in_source[v] = true;
    for (const std::uint8_t v : out->volume.voxels) in_result[v] = true;
    std::vector<std::uint8_t> missing;
    for (std::size_t l = 1; l < out->volume.labels.size(); ++l) {
        if (in_source[l] && !in_result[l]) missing.push_back(static_cast<std::uint8_t>(l));
    }
    const std::vector<std::optional<Int3>> nodes = nearest_to_winning(field, missing);
    for (std::size_t n = 0; n < missing.size(); ++n) {
        const std::uint8_t l = missing[n];
        const std::optional<Int3>& node = nodes[n];
        Int3 v{-1, -1, -1};
        if (node) {
            const Point3 voxel = grid.voxel_from_point(map.forward(field->nodes().point_from_voxel(
                {static_cast<double>(node->x), static_cast<double>(node->y),
                 static_cast<double>(node->z)})));
            for (int a = 0; a < 3; ++a) v[a] = static_cast<int>(std::lround(voxel[a]));
        }
        if (!grid.contains(v.x, v.y, v.z)) {
            out->lost.push_back(l);
            continue;
        }
        out->volume.voxels[grid.index(v.x, v.y, v.z)] = l;
        out->rescued.push_back(l);
        if (out->boundary.table.empty()) continue;
        // No surface crosses the voxel.
        const std::size_t brick =
            static_cast<std::size_t>(v.x / 4) +
            static_cast<std::size_t>(bricks.x) *
                (static_cast<std::size_t>(v.y / 4) +
                 static_cast<std::size_t>(bricks.y) * static_cast<std::size_t>(v.z / 4));
        const std::uint32_t entry = out->boundary.table[brick];
        if (!(entry & kUniformBrick)) {
            out->boundary.pool[static_cast<std::size_t>(entry) * kBrickVoxels +
                               static_cast<std::size_t>(v.x % 4 + 4 * (v.y % 4) + 16 * (v.z % 4))] =
                kNoBoundary;
        }
    }
}

}  // namespace

SampledField sample_label_field(LabelField* field,
                                const Grid& grid,
                                const FieldMap& map,
                                const FieldSamplingOptions& options,
                                const Progress& progress) {
    SampledField out;
    out.volume.grid = grid;
    out.volume.labels = field->source().labels;
    out.volume.voxels.assign(grid.voxel_count(), 0);
    const bool records = options.record_band_vx > 0;
    report_progress(progress, 0, "voxels");
    field->find_candidates(VoxelReader::reach_mm(options.record_band_vx, grid));
    const VoxelReader reader(*field, grid, options.record_band_vx);
    const NodeFromFrame node_from_frame(field->nodes());
    const Int3 bricks = brick_count(grid.size);
    std::vector<Strip> strips(static_cast<std::size_t>(bricks.y) * bricks.z);

    bool first_pass = true;
    const auto read_row = [&](int by, int bz, int r, const Pass& pass, RowScratch* rows,
                              Strip* strip) {
        const int j = 4 * by + r % 4, k = 4 * bz + r / 4;
        if (j >= grid.size.y || k >= grid.size.z) return;
        map.row(j, k, rows->x.data(), rows->y.data(), rows->z.data(), rows->status.data());
        std::uint8_t* to = out.volume.voxels.data() + grid.index(0, j, k);
        std::uint32_t* record = rows->record.data() + static_cast<std::size_t>(r) * rows->x.size();
        for (std::size_t i = 0; i < rows->x.size(); ++i) {
            if (rows->status[i] != MapStatus::ok) {
                if (!first_pass) continue;
                ++(rows->status[i] == MapStatus::outside ? strip->counts.outside
                                                         : strip->counts.no_preimage);
                continue;
            }
            float v[3];
            node_from_frame(rows->x[i], rows->y[i], rows->z[i], v);
            if (reader.beyond(v)) {
                strip->counts.outside += first_pass;
                continue;
            }
            strip->low = std::min(strip->low, v[2]);
            strip->high = std::max(strip->high, v[2]);
            float& height = rows->height[i / 4];
            if (height == kNoHeight) height = v[2];
            if (!(height >= pass.low && height < pass.high)) continue;
            const VoxelSample sample = reader(v, [&]() -> const Matrix3& {
                Matrix3& slope = rows->slope[i / 4];
                if (!rows->has_slope[i / 4]) {
                    rows->has_slope[i / 4] = true;
                    slope = node_slope(field->nodes(), grid,
                                       map.jacobian({rows->x[i], rows->y[i], rows->z[i]}));
                }
                return slope;
            });
            to[i] = sample.label;
            record[i] = sample.record;
        }
    };
    const auto read_strip = [&](std::size_t s, const Pass& pass, RowScratch* rows) {
        if (!first_pass && !pass.meets(strips[s])) return;
        const auto y = static_cast<std::size_t>(bricks.y);
        const int by = static_cast<int>(s % y), bz = static_cast<int>(s / y);
        std::fill(rows->record.begin(), rows->record.end(), kNoBoundary);
        std::fill(rows->has_slope.begin(), rows->has_slope.end(), 0);
        std::fill(rows->height.begin(), rows->height.end(), kNoHeight);
        load_bricks(grid, by, bz, strips[s], &rows->record);
        for (int r = 0; r < 16; ++r) read_row(by, bz, r, pass, rows, &strips[s]);
        if (records) store_bricks(grid, by, bz, rows->record, &strips[s]);
    };
    // In a few parts, because progress is reported from the calling thread only.
    constexpr std::size_t kParts = 20;
    const std::vector<Pass> passes =
        passes_through(*field, reader.reach_nodes(options.record_band_vx));
    for (std::size_t p = 0; p < passes.size(); ++p) {
        field->hold(passes[p].first_layer, passes[p].last_layer);
        for (std::size_t part = 0; part < kParts; ++part) {
            const std::size_t first = strips.size() * part / kParts;
            parallel_for(strips.size() * (part + 1) / kParts - first, 4,
                         [&](std::size_t begin, std::size_t end) {
                             RowScratch rows(static_cast<std::size_t>(grid.size.x), bricks.x);
                             for (std::size_t s = first + begin; s < first + end; ++s)
                                 read_strip(s, passes[p], &rows);
                         });
            report_progress(progress,
                            static_cast<double>(p * kParts + part + 1) /
                                static_cast<double>(passes.size() * kParts),
                            "voxels");
        }
        first_pass = false;
    }
    if (records) join_bricks(&strips, grid, &out.boundary);
    for (const Strip& strip : strips) {
        out.counts.outside += strip.counts.outside;
        out.counts.no_preimage += strip.counts.no_preimage;
    }
    if (options.keep_labels) restore_lost(field, map, &out);
    return out;
}

}  // namespace sonocase::pipeline::inline segmentation
