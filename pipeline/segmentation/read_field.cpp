#include "pipeline/segmentation/read_field.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/boundary_record.h"
#include "pipeline/parallel.h"

namespace sonocase::pipeline {
namespace {

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

struct Contest {                        // the two best labels at a point
    std::size_t first = 0, second = 0;  // candidates
    float gap = 1e9f;                   // score of the second less that of the first
};

Contest contest(const float* score, std::size_t count) {
    Contest c;
    float best = 1e30f, next = 1e30f;
    for (std::size_t i = 0; i < count; ++i) {
        if (score[i] < best) {
            next = best;
            c.second = c.first;
            best = score[i];
            c.first = i;
        } else if (score[i] < next) {
            next = score[i];
            c.second = i;
        }
    }
    c.gap = next - best;
    return c;
}

// One row of bricks: 4 x 4 rows of voxels.
struct Strip {
    std::vector<std::uint32_t> table;  // pool entries count from 0 in the strip
    std::vector<std::uint32_t> pool;
    PreimageCounts counts;
};

}  // namespace

FieldRead read_field(const LabelField& field,
                     const Grid& grid,
                     const FieldMap& map,
                     const FieldReadOptions& options,
                     const Progress& progress) {
    FieldRead out;
    out.volume.grid = grid;
    out.volume.labels = field.source().labels;
    out.volume.voxels.assign(grid.voxel_count(), 0);
    const Int3 bricks = brick_count(grid.size);
    const std::size_t strip_count =
        static_cast<std::size_t>(bricks.y) * static_cast<std::size_t>(bricks.z);
    const std::size_t nx = static_cast<std::size_t>(grid.size.x);
    const Grid& nodes = field.nodes();
    const NodeFromFrame node_from_frame(nodes);
    const Vector3 h = nodes.spacing_mm;
    const double band_mm = options.record_band_vx * grid.spacing_mm.x;
    // No surface within the band of a point whose nearest node has this margin: half a cell lies
    // between, maps stretch by less than 1.5, and node margins are read half a voxel roughly.
    const float sure_mm =
        static_cast<float>(1.5 * band_mm + 0.5 * norm(h) + 0.5 * std::max(h.x, h.y));
    const bool records = options.record_band_vx > 0;
    // The map says nothing further out than half a voxel beyond its last ones.
    float rim[3];
    for (int a = 0; a < 3; ++a) rim[a] = 0.5f * static_cast<float>(a == 2 ? field.factor() : 1) + 1e-3f;
    const auto beyond = [&](const float* v) {
        bool out_of = false;
        for (int a = 0; a < 3; ++a)
            out_of = out_of || v[a] < -rim[a] || v[a] > static_cast<float>(nodes.size[a] - 1) + rim[a];
        return out_of;
    };
    std::vector<Strip> strips(strip_count);
    tell(progress, 0, "voxels");
    // In a few parts, so that progress can be told from the calling thread.
    constexpr std::size_t kParts = 20;
    for (std::size_t part = 0; part < kParts; ++part) {
        const std::size_t part_first = strip_count * part / kParts;
        const std::size_t part_count = strip_count * (part + 1) / kParts - part_first;
        parallel_for(part_count, 4, [&](std::size_t begin, std::size_t end) {
            std::vector<float> x(nx), y(nx), z(nx);
            std::vector<MapStatus> status(nx);
            std::vector<std::uint32_t> record(16 * nx);
            std::array<float, 256> score;
            for (std::size_t s = part_first + begin; s < part_first + end; ++s) {
                Strip& strip = strips[s];
                const int by = static_cast<int>(s % static_cast<std::size_t>(bricks.y));
                const int bz = static_cast<int>(s / static_cast<std::size_t>(bricks.y));
                std::fill(record.begin(), record.end(), kNoBoundary);
                // d(node) / d(voxel of the grid), one for each brick, made when first needed.
                std::vector<Matrix3> slope(static_cast<std::size_t>(bricks.x));
                std::vector<bool> has_slope(static_cast<std::size_t>(bricks.x), false);
                for (int r = 0; r < 16; ++r) {
                    const int j = 4 * by + r % 4, k = 4 * bz + r / 4;
                    if (j >= grid.size.y || k >= grid.size.z) continue;
                    map.row(j, k, x.data(), y.data(), z.data(), status.data());
                    std::uint8_t* to = out.volume.voxels.data() + grid.index(0, j, k);
                    for (std::size_t i = 0; i < nx; ++i) {
                        if (status[i] != MapStatus::ok) {
                            ++(status[i] == MapStatus::outside ? strip.counts.outside
                                                               : strip.counts.no_preimage);
                            continue;
                        }
                        float v[3];
                        node_from_frame(x[i], y[i], z[i], v);
                        if (beyond(v)) {
                            ++strip.counts.outside;
                            continue;
                        }
                        std::size_t node = 0;
                        {
                            const auto near = [&](int a) {
                                return std::clamp(static_cast<int>(v[a] + 0.5f), 0,
                                                  nodes.size[a] - 1);
                            };
                            node = nodes.index(near(0), near(1), near(2));
                        }
                        if (field.node_margin_mm(node) > sure_mm) {
                            to[i] = field.node_label(node);
                            continue;
                        }
                        const LabelField::Position at = field.locate(v[0], v[1], v[2]);
                        if (at.block->labels.size() < 2) {
                            to[i] = at.block->labels[0];
                            continue;
                        }
                        field.scores(at, score.data());
                        Contest c = contest(score.data(), at.block->labels.size());
                        to[i] = at.block->labels[c.first];
                        if (!records || c.gap > 1.5 * band_mm *
                                                    field.slope(*at.block, at.block->labels[c.first],
                                                                at.block->labels[c.second]))
                            continue;
                        const std::size_t brick = i / 4;
                        if (!has_slope[brick]) {
                            has_slope[brick] = true;
                            const Matrix3 frame_from_grid = map.jacobian({x[i], y[i], z[i]});
                            for (int a = 0; a < 3; ++a) {
                                for (int b = 0; b < 3; ++b) {
                                    double sum = 0;
                                    for (int q = 0; q < 3; ++q) {
                                        sum += nodes.direction(q, a) / h[a] * frame_from_grid(q, b);
                                    }
                                    slope[brick](a, b) = sum * grid.spacing_mm.x;
                                }
                            }
                        }
                        // f and its gradient per voxel of the grid, at the voxel; then once more at
                        // the foot of the plane found, because f bends near thin structures.
                        const Matrix3& m = slope[brick];
                        const auto plane = [&](const LabelField::Position& p, Vector3* g) {
                            const auto n = field.difference(p, c.first, c.second);
                            for (int b = 0; b < 3; ++b) {
                                (*g)[b] = n[0] * m(0, b) + n[1] * m(1, b) + n[2] * m(2, b);
                            }
                            return static_cast<double>(n[3]);
                        };
                        double d = 0;
                        Vector3 normal;
                        const auto find_plane = [&] {
                            Vector3 g;
                            const double f = plane(at, &g);
                            const double steep = norm(g);
                            // The scores part by at least 1 mm a mm; much less means no surface here.
                            if (!(steep > 0.2 * grid.spacing_mm.x)) return false;
                            d = f / steep;
                            if (d > options.record_band_vx + 0.5) return false;
                            normal = g / steep;
                            const Vector3 back = m * (d * normal);
                            const auto foot = field.locate(v[0] - static_cast<float>(back.x),
                                                           v[1] - static_cast<float>(back.y),
                                                           v[2] - static_cast<float>(back.z));
                            // Only inside the block: the candidates' order is the block's.
                            if (foot.block == at.block) {
                                Vector3 g2;
                                const double f2 = plane(foot, &g2);
                                const double steep2 = norm(g2);
                                if (steep2 > 0.5 * steep) {
                                    d += std::clamp(f2 / steep2, -0.5, 0.5);
                                    normal = g2 / steep2;
                                }
                            }
                            return d <= options.record_band_vx;
                        };
                        if (!find_plane()) continue;
                        if (at.block->labels.size() > 2) {
                            // Labels tie where they meet: the second is whoever lies beyond.
                            const Vector3 back = m * ((d + 0.3) * normal);
                            const auto past = field.locate(v[0] - static_cast<float>(back.x),
                                                             v[1] - static_cast<float>(back.y),
                                                             v[2] - static_cast<float>(back.z));
                            field.scores(past, score.data());
                            const auto& there = past.block->labels;
                            const auto& here = at.block->labels;
                            const auto w = std::find(
                                here.begin(), here.end(),
                                there[contest(score.data(), there.size()).first]);
                            const auto other = static_cast<std::size_t>(w - here.begin());
                            if (w != here.end() && other != c.first && other != c.second) {
                                c.second = other;
                                if (!find_plane()) continue;
                            }
                        }
                        record[static_cast<std::size_t>(r) * nx + i] =
                            pack_boundary({at.block->labels[c.second], std::max(d, 0.0), normal});
                    }
                }
                if (!records) continue;
                strip.table.reserve(static_cast<std::size_t>(bricks.x));
                for (int bx = 0; bx < bricks.x; ++bx) {
                    std::array<std::uint32_t, kBrickVoxels> brick;
                    bool empty = true;
                    for (int q = 0; q < kBrickVoxels; ++q) {
                        const std::size_t i =
                            std::min(static_cast<std::size_t>(4 * bx + q % 4), nx - 1);
                        const int j = std::min(q / 4 % 4, grid.size.y - 1 - 4 * by);
                        const int k = std::min(q / 16, grid.size.z - 1 - 4 * bz);
                        const std::uint32_t value =
                            record[static_cast<std::size_t>(j + 4 * k) * nx + i];
                        brick[static_cast<std::size_t>(q)] = value;
                        empty = empty && value == kNoBoundary;
                    }
                    if (empty) {
                        strip.table.push_back(kUniformBrick);
                    } else {
                        strip.table.push_back(
                            static_cast<std::uint32_t>(strip.pool.size() / kBrickVoxels));
                        strip.pool.insert(strip.pool.end(), brick.begin(), brick.end());
                    }
                }
            }
        });
        tell(progress, static_cast<double>(part + 1) / kParts, "voxels");
    }
    if (records) {
        out.boundary.size = grid.size;
        out.boundary.uniform = {kNoBoundary};
        std::size_t stored = 0;
        for (const Strip& strip : strips) stored += strip.pool.size();
        out.boundary.pool.reserve(stored);
        out.boundary.table.reserve(strip_count * static_cast<std::size_t>(bricks.x));
        for (Strip& strip : strips) {
            const auto base = static_cast<std::uint32_t>(out.boundary.pool.size() / kBrickVoxels);
            for (const std::uint32_t entry : strip.table) {
                out.boundary.table.push_back(entry & kUniformBrick ? entry : entry + base);
            }
            out.boundary.pool.insert(out.boundary.pool.end(), strip.pool.begin(), strip.pool.end());
            std::vector<std::uint32_t>().swap(strip.pool);
        }
    }
    for (const Strip& strip : strips) {
        out.counts.outside += strip.counts.outside;
        out.counts.no_preimage += strip.counts.no_preimage;
    }

    // Guard: no label of the source may vanish without a word.
    std::array<bool, 256> in_source{}, in_answer{};
    for (const std::uint8_t v : field.source().voxels) in_source[v] = true;
    for (const std::uint8_t v : out.volume.voxels) in_answer[v] = true;
    for (std::size_t l = 1; l < out.volume.labels.size(); ++l) {
        if (!in_source[l] || in_answer[l]) continue;
        float nearest = 1e30f;
        Point3 place;
        std::array<float, 256> score;
        for (const LabelField::Block& block : field.blocks()) {
            const auto at = std::find(block.labels.begin(), block.labels.end(), l);
            if (at == block.labels.end()) continue;
            const auto own = static_cast<std::size_t>(at - block.labels.begin());
            for (int q = 0; q < kFieldBlock * kFieldBlock * kFieldBlock; ++q) {
                const Int3 node{block.first.x + q % kFieldBlock,
                                block.first.y + q / kFieldBlock % kFieldBlock,
                                block.first.z + q / kFieldBlock / kFieldBlock};
                if (!nodes.contains(node.x, node.y, node.z)) continue;
                field.scores(field.locate(static_cast<float>(node.x), static_cast<float>(node.y),
                                          static_cast<float>(node.z)),
                             score.data());
                float other = 1e30f;
                for (std::size_t c = 0; c < block.labels.size(); ++c) {
                    if (c != own) other = std::min(other, score[c]);
                }
                if (score[own] - other < nearest) {
                    nearest = score[own] - other;
                    place = nodes.point_from_voxel({static_cast<double>(node.x),
                                                    static_cast<double>(node.y),
                                                    static_cast<double>(node.z)});
                }
            }
        }
        const Point3 voxel = grid.voxel_from_point(map.forward(place));
        const int i = static_cast<int>(std::lround(voxel.x)),
                  j = static_cast<int>(std::lround(voxel.y)),
                  k = static_cast<int>(std::lround(voxel.z));
        if (!grid.contains(i, j, k)) {
            out.lost.push_back(static_cast<int>(l));
            continue;
        }
        out.volume.voxels[grid.index(i, j, k)] = static_cast<std::uint8_t>(l);
        out.rescued.push_back(static_cast<int>(l));
        if (records) {  // the voxel is drawn whole
            const std::size_t brick =
                static_cast<std::size_t>(i / 4) +
                static_cast<std::size_t>(bricks.x) *
                    (static_cast<std::size_t>(j / 4) +
                     static_cast<std::size_t>(bricks.y) * static_cast<std::size_t>(k / 4));
            const std::uint32_t entry = out.boundary.table[brick];
            if (!(entry & kUniformBrick)) {
                out.boundary.pool[static_cast<std::size_t>(entry) * kBrickVoxels +
                                  static_cast<std::size_t>(i % 4 + 4 * (j % 4) + 16 * (k % 4))] =
                    kNoBoundary;
            }
        }
    }
    return out;
}

}  // namespace sonocase::pipeline
