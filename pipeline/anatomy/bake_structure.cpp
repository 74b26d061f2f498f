// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/bake_structure.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>

#include "pipeline/anatomy/boundary_layers.h"
#include "pipeline/anatomy/structure_scene.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

constexpr float kMost = 31;  // dB that an int8 of quarters holds

// Bright fibres on dark ground: the exponential of a Gaussian, standardised. Skew 1.75 for k = 0.5.
float sparse(float g) {
    constexpr float k = 0.5f;
    constexpr float mean = 1.1331485f;       // exp(k k / 2)
    constexpr float deviation = 0.6039124f;  // mean * sqrt(exp(k k) - 1)
    return (std::exp(k * g) - mean) / deviation;
}

// Fascicles: isotropic noise drawn out along the fibres by a weighted sum of samples along them.
class FibreNoise {
  public:
    FibreNoise(double voxel_mm, std::uint64_t seed)
        : noise_(std::max(1.6, 2.0 * voxel_mm), seed), spacing_mm_(static_cast<float>(1.3)) {
        double square = 0;
        for (int t = -kReach; t <= kReach; ++t) {
            weight_[static_cast<std::size_t>(t + kReach)] = static_cast<float>(
                std::exp(-0.5 * t * t * spacing_mm_ * spacing_mm_ / (2.6 * 2.6)));
        }
        // unit variance, measured once: the samples overlap
        constexpr int kProbes = 4096;
        for (std::uint64_t i = 0; i < kProbes; ++i) {
            const auto x = [&](std::uint64_t a) {
                return static_cast<float>(400 * uniform_at(seed, 3 * i + a));
            };
            const float v = raw(x(0), x(1), x(2), {0.48, 0.6, 0.64});
            square += static_cast<double>(v) * v / kProbes;
        }
        for (float& w : weight_) w /= static_cast<float>(std::sqrt(square));
    }
    float at(float x, float y, float z, Vector3 along) const { return raw(x, y, z, along); }

  private:
    static constexpr int kReach = 4;
    float raw(float x, float y, float z, Vector3 along) const {
        float sum = 0;
        const auto dx = static_cast<float>(along.x) * spacing_mm_;
        const auto dy = static_cast<float>(along.y) * spacing_mm_;
        const auto dz = static_cast<float>(along.z) * spacing_mm_;
        for (int t = -kReach; t <= kReach; ++t) {
            const auto s = static_cast<float>(t);
            sum += weight_[static_cast<std::size_t>(t + kReach)] *
                   noise_.at(x + s * dx, y + s * dy, z + s * dz);
        }
        return sum;
    }
    StructureNoise noise_;
    float spacing_mm_;
    std::array<float, 2 * kReach + 1> weight_{};
};

// Fat that the skin reaches without leaving fat: distance through skin and fat alone, on coarse
// samples, in mm; large elsewhere.
CoarseField distance_through_fat(const LabelVolume& labels, const std::vector<LabelFacts>& facts) {
    const double voxel_mm = labels.grid.spacing_mm.x;
    CoarseField field;
    field.step = std::max(1, static_cast<int>(std::lround(3 / voxel_mm)));
    const Int3 fine = labels.grid.size;
    const int s = field.step;
    field.size = {(fine.x + s - 1) / s, (fine.y + s - 1) / s, (fine.z + s - 1) / s};
    const std::size_t count = static_cast<std::size_t>(field.size.x) *
                              static_cast<std::size_t>(field.size.y) *
                              static_cast<std::size_t>(field.size.z);
    constexpr float kFar = 250;  // mm; finite, as neighbours are mixed
    field.value.assign(count, kFar);
    std::vector<std::uint8_t> open(count, 0);
    std::vector<std::array<std::int16_t, 3>> front, next;
    for (int k = 0; k < field.size.z; ++k) {
        for (int j = 0; j < field.size.y; ++j) {
            for (int i = 0; i < field.size.x; ++i) {
                const std::uint8_t l = labels.voxels[labels.grid.index(i * s, j * s, k * s)];
                const std::size_t at = field.index(i, j, k);
                const bool skin = l != 0 && facts[l].tissue->name == "skin";
                open[at] = skin || facts[l].role == StructureRole::fat;
                if (l == 0 || skin) {
                    field.value[at] = 0;
                    front.push_back({static_cast<std::int16_t>(i), static_cast<std::int16_t>(j),
                                     static_cast<std::int16_t>(k)});
                }
            }
        }
    }
    const auto reach = static_cast<float>(s * voxel_mm);
    for (float depth = reach; !front.empty() && depth < 150; depth += reach) {
        next.clear();
        for (const auto& p : front) {
            constexpr int kBeside[6][3] = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                           {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
            for (const auto& d : kBeside) {
                const int i = p[0] + d[0], j = p[1] + d[1], k = p[2] + d[2];
                if (i < 0 || j < 0 || k < 0 || i >= field.size.x || j >= field.size.y ||
                    k >= field.size.z)
                    continue;
                const std::size_t at = field.index(i, j, k);
                if (!open[at] || field.value[at] < kFar) continue;
                field.value[at] = depth;
                next.push_back({static_cast<std::int16_t>(i), static_cast<std::int16_t>(j),
                                static_cast<std::int16_t>(k)});
            }
        }
        front.swap(next);
    }
    // Two samples into what is not fat, so that fat at its edge does not mix with the far value.
    for (int ring = 0; ring < 2; ++ring) {
        const std::vector<float> before = field.value;
        for (int k = 0; k < field.size.z; ++k) {
            for (int j = 0; j < field.size.y; ++j) {
                for (int i = 0; i < field.size.x; ++i) {
                    float& value = field.value[field.index(i, j, k)];
                    if (value < kFar) continue;
                    if (i > 0) value = std::min(value, before[field.index(i - 1, j, k)] + reach);
                    if (j > 0) value = std::min(value, before[field.index(i, j - 1, k)] + reach);
                    if (k > 0) value = std::min(value, before[field.index(i, j, k - 1)] + reach);
                    if (i + 1 < field.size.x)
                        value = std::min(value, before[field.index(i + 1, j, k)] + reach);
                    if (j + 1 < field.size.y)
                        value = std::min(value, before[field.index(i, j + 1, k)] + reach);
                    if (k + 1 < field.size.z)
                        value = std::min(value, before[field.index(i, j, k + 1)] + reach);
                }
            }
        }
    }
    return field;
}

// Everything that the voxel loop reads.
struct Bake {
    const LabelVolume& labels;
    const BakeStructureOptions& options;
    std::vector<LabelFacts> facts;
    float voxel_mm = 1;
    CoarseField skin_depth;   // voxels
    CoarseField through_fat;  // mm
    MuscleDirections directions;
    std::vector<Kidney> kidneys;
    StructureNoise grain3, grain5, grain14, grain30;
    FibreNoise fibres;

    Bake(const LabelVolume& volume, const BakeStructureOptions& o)
        : labels(volume),
          options(o),
          voxel_mm(static_cast<float>(volume.grid.spacing_mm.x)),
          grain3(3.2, derive_seed(o.seed, 1)),
          grain5(5, derive_seed(o.seed, 2)),
          grain14(14, derive_seed(o.seed, 3)),
          grain30(30, derive_seed(o.seed, 4)),
          fibres(volume.grid.spacing_mm.x, derive_seed(o.seed, 5)) {}

    float fat(int i, int j, int k, float x, float y, float z) const {
        const auto fi = static_cast<float>(i), fj = static_cast<float>(j),
                   fk = static_cast<float>(k);
        const float depth = skin_depth.at(fi, fj, fk) * voxel_mm;
        // Steps along the axes make paths up to sqrt(3) longer than the straight line. The change
        // from one kind of fat to the other is soft: nothing in the label volume marks it.
        const float detour = 1.8f * depth + 12 - through_fat.at(fi, fj, fk);
        const float under_skin =
            std::clamp(detour / 10 + 0.5f, 0.f, 1.f) * std::clamp((64 - depth) / 12, 0.f, 1.f);
        // round the organs: echogenic, mixed
        const float inner = under_skin < 1 ? 9 + 2.5f * grain5.at(x, y, z) : 0.f;
        if (under_skin <= 0) return inner;
        return inner + under_skin * (sheets(depth, x, y, z) - inner);
    }

    float sheets(float depth, float x, float y, float z) const {
        // Sheets 6 mm apart, wavy, torn, of varying strength.
        const float wave = depth + 2.2f * grain14.at(x, y, z) + 1.6f * grain30.at(x, y, z);
        const float sheet = wave / 6.2f;
        const float nearest = std::round(sheet);
        const float off_mm = std::abs(sheet - nearest) * 6.2f;
        const float cover =
            std::clamp((0.55f - off_mm) / std::max(voxel_mm, 0.5f) + 0.5f, 0.f, 1.f);
        if (cover <= 0) return 0;
        // each sheet has its own tears
        const float torn = grain14.at(x + 97 * nearest, y - 61 * nearest, z + 43 * nearest);
        const float strength = std::clamp(0.8f + 0.7f * torn, 0.f, 1.25f);
        return 17 * cover * strength;
    }

    bool in_hilum(int i, int j, int k) const {
        for (const Kidney& kidney : kidneys) {
            if (kidney.depth.contains(i, j, k) && kidney.depth.at(i, j, k) * voxel_mm > 1.5f)
                return true;
        }
        return false;
    }

    float at(std::uint8_t label, int i, int j, int k) const {
        const LabelFacts& f = facts[label];
        const float x = static_cast<float>(i) * voxel_mm, y = static_cast<float>(j) * voxel_mm,
                    z = static_cast<float>(k) * voxel_mm;
        const auto sd = static_cast<float>(f.tissue->structure_db);
        switch (f.role) {
            case StructureRole::none:
                return 0;
            case StructureRole::muscle:
                // What segmentations call muscle in the hilum is vessels and fat.
                if (in_hilum(i, j, k)) return 9 + 3 * grain3.at(x, y, z);
                if (!options.muscle_fibres) break;
                return std::clamp(sd * sparse(fibres.at(x, y, z,
                                                        directions.at(label, static_cast<float>(i),
                                                                      static_cast<float>(j),
                                                                      static_cast<float>(k)))),
                                  -14.f, 16.f);
            case StructureRole::fat:
                // fat in the hilum is the sinus: its own echo, not that of fat round organs
                if (in_hilum(i, j, k)) return 14 + 2 * grain3.at(x, y, z);
                if (!options.fat_septa) break;
                return fat(i, j, k, x, y, z);
            case StructureRole::kidney: {
                const float noise = options.parenchyma ? sd * grain3.at(x, y, z) : 0;
                for (const Kidney& kidney : kidneys) {
                    if (kidney.label == label)
                        return noise +
                               kidney_offset_db(kidney, voxel_mm, i, j, k, grain5.at(x, y, z));
                }
                return noise;
            }
            case StructureRole::bowel:
                if (!options.parenchyma) return 0;
                return sd * (0.75f * grain5.at(x, y, z) + 0.66f * grain14.at(x, y, z));
            case StructureRole::liver:
            case StructureRole::plain:
                break;
        }
        if (!options.parenchyma || sd <= 0) return 0;
        return sd * (0.7f * grain3.at(x, y, z) + 0.71f * grain5.at(x, y, z));
    }
};

std::int8_t stored(float db) {
    return static_cast<std::int8_t>(4 *
                                    static_cast<int>(std::lround(std::clamp(db, -kMost, kMost))));
}

constexpr int kBlock = 32;

}  // namespace

Result<BakeStructureResult> bake_structure(const LabelVolume& cooked,
                                           std::span<const Tissue> tissues,
                                           const BakeStructureOptions& options,
                                           const Progress& progress) {
    const auto start = std::chrono::steady_clock::now();
    const Vector3 spacing = cooked.grid.spacing_mm;
    if (std::abs(spacing.x - spacing.y) > 1e-6 * spacing.x ||
        std::abs(spacing.x - spacing.z) > 1e-6 * spacing.x) {
        return Error{"voxels are not cubes", "label volume", "resample the labels first"};
    }
    std::vector<const Tissue*> tissue_of;
    for (const Label& label : cooked.labels) {
        const auto found = std::find_if(tissues.begin(), tissues.end(),
                                        [&](const Tissue& t) { return t.name == label.tissue; });
        if (found == tissues.end()) {
            return Error{"label " + label.name + " is of tissue '" + label.tissue +
                             "', which is not in the tissue table",
                         "label volume", "name a tissue of the table, or add it to the recipe"};
        }
        tissue_of.push_back(&*found);
    }
    BakeStructureResult out;
    out.report.stage = "structure";
    report_progress(progress, 0, "finding organs");
    Bake bake(cooked, options);
    bake.facts = label_facts(cooked, tissue_of);

    const int coarse = std::max(1, static_cast<int>(std::lround(2 / spacing.x)));
    bake.skin_depth = distance_inside(cooked.grid.size, coarse, [&](int i, int j, int k) {
        return cooked.voxels[cooked.grid.index(i, j, k)] != 0;
    });
    if (options.fat_septa) bake.through_fat = distance_through_fat(cooked, bake.facts);
    bake.directions = find_muscle_directions(cooked, bake.facts, &bake.skin_depth);
    bool sinus_labelled = false;
    for (std::size_t l = 1; l < bake.facts.size(); ++l) {
        if (bake.facts[l].count > 0 && bake.facts[l].tissue->name == "kidney_sinus")
            sinus_labelled = true;
    }
    if (options.kidney) {
        for (std::size_t l = 1; l < bake.facts.size(); ++l) {
            const LabelFacts& f = bake.facts[l];
            const double ml = static_cast<double>(f.count) * cooked.grid.voxel_volume_mm3() / 1000;
            if (f.role != StructureRole::kidney || ml < 5) continue;
            bake.kidneys.push_back(find_kidney(cooked, f, static_cast<int>(l)));
            if (sinus_labelled) bake.kidneys.back().solid = false;
        }
    }
    for (const FibreField& f : bake.directions.fields) {
        if (f.label > 0) out.fibres.push_back(f);
    }
    report_progress(progress, 0.15, "growing vessels");
    if (options.liver_vessels)
        out.trees = grow_liver_vessels(cooked, bake.facts, derive_seed(options.seed, 6));

    report_progress(progress, 0.3, "baking structure");
    const Int3 size = cooked.grid.size;
    std::vector<std::int8_t> offsets(cooked.voxels.size(), 0);
    const Int3 blocks{(size.x + kBlock - 1) / kBlock, (size.y + kBlock - 1) / kBlock,
                      (size.z + kBlock - 1) / kBlock};
    const std::size_t block_count = static_cast<std::size_t>(blocks.x) *
                                    static_cast<std::size_t>(blocks.y) *
                                    static_cast<std::size_t>(blocks.z);
    BoundaryLayerRules rules;
    rules.voxel_mm = spacing.x;
    rules.fascia = options.fascia;
    rules.bowel_wall = options.bowel_wall;
    for (const LabelFacts& f : bake.facts) {
        rules.role.push_back(f.role);
        rules.gas.push_back(f.tissue->kind == TissueKind::gas);
        rules.echo_db.push_back(static_cast<float>(f.tissue->echo_db));
    }
    parallel_for(block_count, 1, [&](std::size_t begin, std::size_t end) {
        BoundaryLayers layers;
        for (std::size_t b = begin; b < end; ++b) {
            const Int3 lower{static_cast<int>(b % static_cast<std::size_t>(blocks.x)) * kBlock,
                             static_cast<int>(b / static_cast<std::size_t>(blocks.x) %
                                              static_cast<std::size_t>(blocks.y)) *
                                 kBlock,
                             static_cast<int>(b / static_cast<std::size_t>(blocks.x) /
                                              static_cast<std::size_t>(blocks.y)) *
                                 kBlock};
            const Int3 upper{std::min(lower.x + kBlock, size.x), std::min(lower.y + kBlock, size.y),
                             std::min(lower.z + kBlock, size.z)};
            layers.prepare(cooked, lower, upper, rules);
            for (int k = lower.z; k < upper.z; ++k) {
                for (int j = lower.y; j < upper.y; ++j) {
                    std::size_t at = cooked.grid.index(lower.x, j, k);
                    for (int i = lower.x; i < upper.x; ++i, ++at) {
                        const std::uint8_t label = cooked.voxels[at];
                        if (label >= bake.facts.size() ||
                            bake.facts[label].role == StructureRole::none)
                            continue;
                        float db = bake.at(label, i, j, k);
                        if (layers.any()) {
                            const float x = static_cast<float>(i) * bake.voxel_mm,
                                        y = static_cast<float>(j) * bake.voxel_mm,
                                        z = static_cast<float>(k) * bake.voxel_mm;
                            db = layers.apply(db, label, i, j, k, [&] {
                                return std::array<float, 2>{bake.grain14.at(x, y, z),
                                                            bake.grain5.at(z, x, y)};
                            });
                        }
                        offsets[at] = stored(db);
                    }
                }
            }
        }
    });
    for (std::size_t l = 1; l < bake.facts.size(); ++l) {
        if (bake.facts[l].role == StructureRole::liver && !out.trees.empty()) {
            draw_vessels(cooked, static_cast<int>(l), out.trees, offsets);
        }
    }

    report_progress(progress, 0.85, "levelling");
    // The mean of each label back to 0 dB, to a quarter. Integer sums: any order gives the same.
    const std::size_t palette = bake.facts.size();
    std::vector<std::vector<std::int64_t>> slice_sums(static_cast<std::size_t>(size.z));
    const std::size_t slice = static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y);
    parallel_for(slice_sums.size(), 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            slice_sums[k].assign(256, 0);
            for (std::size_t i = k * slice; i < (k + 1) * slice; ++i) {
                slice_sums[k][cooked.voxels[i]] += offsets[i];
            }
        }
    });
    std::array<int, 256> shift{};
    double worst = 0;
    for (std::size_t l = 1; l < palette; ++l) {
        const LabelFacts& f = bake.facts[l];
        if (f.role == StructureRole::none || f.count == 0) continue;
        std::int64_t sum = 0;
        for (const auto& s : slice_sums) sum += s[l];
        const double mean = static_cast<double>(sum) / static_cast<double>(f.count);
        shift[l] = -static_cast<int>(std::lround(mean));
        worst = std::max(worst, std::abs(mean + shift[l]) / 4);
    }
    parallel_for(slice_sums.size(), 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin * slice; i < end * slice; ++i) {
            const int s = shift[cooked.voxels[i]];
            if (s != 0)
                offsets[i] = static_cast<std::int8_t>(std::clamp(offsets[i] + s, -127, 127));
        }
    });
    report_progress(progress, 0.92, "packing bricks");
    out.echo_offset = bricks_from_dense<std::int8_t>(offsets, size);
    double pieces = 0;
    for (const VesselTree& tree : out.trees) pieces += static_cast<double>(tree.nodes.size());
    out.report.measures = {{"vessel_pieces", pieces},
                           {"kidneys", static_cast<double>(bake.kidneys.size())},
                           {"muscles", static_cast<double>(out.fibres.size())},
                           {"worst_mean_offset_db", worst}};
    out.report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    report_progress(progress, 1, "baking structure");
    return out;
}

}  // namespace sonocase::pipeline
