// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/voxel_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/coarse_field.h"
#include "pipeline/anatomy/label_facts.h"
#include "pipeline/base/counter_random.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

constexpr float kFarMm = 250;  // finite, because neighbouring samples are interpolated
using Sample = std::array<std::int16_t, 3>;

constexpr int kNeighbours[6][3] = {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1},
                                   {1, 0, 0},  {0, 1, 0},  {0, 0, 1}};

Sample sample_at(int i, int j, int k) {
    return {static_cast<std::int16_t>(i), static_cast<std::int16_t>(j),
            static_cast<std::int16_t>(k)};
}

bool contains(Int3 size, int i, int j, int k) {
    return i >= 0 && j >= 0 && k >= 0 && i < size.x && j < size.y && k < size.z;
}

// Breadth-first search from the samples of `front` through open samples, `reach` mm per step.
void spread(std::vector<Sample> front,
            const std::vector<std::uint8_t>& open,
            float reach,
            CoarseField* field) {
    std::vector<Sample> next;
    for (float depth = reach; !front.empty() && depth < 150; depth += reach) {
        next.clear();
        for (const Sample& p : front) {
            for (const auto& d : kNeighbours) {
                const int i = p[0] + d[0], j = p[1] + d[1], k = p[2] + d[2];
                if (!contains(field->size, i, j, k)) continue;
                const std::size_t at = field->index(i, j, k);
                if (!open[at] || field->value[at] < kFarMm) continue;
                field->value[at] = depth;
                next.push_back(sample_at(i, j, k));
            }
        }
        front.swap(next);
    }
}

// Extends the field by one sample into what is not fat.
void extend(float reach, CoarseField* field) {
    const std::vector<float> before = field->value;
    for (int k = 0; k < field->size.z; ++k) {
        for (int j = 0; j < field->size.y; ++j) {
            for (int i = 0; i < field->size.x; ++i) {
                float& value = field->value[field->index(i, j, k)];
                if (value < kFarMm) continue;
                for (const auto& d : kNeighbours) {
                    const int x = i + d[0], y = j + d[1], z = k + d[2];
                    if (contains(field->size, x, y, z))
                        value = std::min(value, before[field->index(x, y, z)] + reach);
                }
            }
        }
    }
}

// Shows where fat is the subcutaneous layer rather than the fat around organs:
// length, mm, of the shortest path from the skin to each sample through skin and fat alone, along
// the axes of the grid (up to sqrt(3) longer than a straight line); 250 where no such path of up to
// 150 mm exists.
CoarseField distance_through_fat(const LabelVolume& labels, const std::vector<LabelFacts>& facts) {
    const double voxel_mm = labels.grid.spacing_mm.x;
    CoarseField field;
    field.step = depth_step(voxel_mm, kFatSampleMm);
    const Int3 fine = labels.grid.size;
    const int s = field.step;
    field.size = {(fine.x + s - 1) / s, (fine.y + s - 1) / s, (fine.z + s - 1) / s};
    const std::size_t count = static_cast<std::size_t>(field.size.x) * field.size.y * field.size.z;
    field.value.assign(count, kFarMm);
    std::vector<std::uint8_t> open(count, 0);
    std::vector<Sample> front;
    for (int k = 0; k < field.size.z; ++k) {
        for (int j = 0; j < field.size.y; ++j) {
            for (int i = 0; i < field.size.x; ++i) {
                const std::uint8_t l = labels.voxels[labels.grid.index(i * s, j * s, k * s)];
                const std::size_t at = field.index(i, j, k);
                const bool skin = l != 0 && facts[l].tissue->name == "skin";
                open[at] = skin || facts[l].role == StructureRole::fat;
                if (l == 0 || skin) {
                    field.value[at] = 0;
                    front.push_back(sample_at(i, j, k));
                }
            }
        }
    }
    const auto reach = static_cast<float>(s * voxel_mm);
    spread(std::move(front), open, reach, &field);
    // Extends it by two samples, which keeps the far value out of the interpolation at the edge of
    // the fat.
    for (int ring = 0; ring < 2; ++ring) extend(reach, &field);
    return field;
}

// Bright fibres on a dark ground: the exponential of a Gaussian, standardised. Skewness 1.75 for
// k = 0.5.
float sparse(float g) {
    constexpr float k = 0.5f;
    constexpr float mean = 1.1331485f;       // exp(k k / 2)
    constexpr float deviation = 0.6039124f;  // mean * sqrt(exp(k k) - 1)
    return (std::exp(k * g) - mean) / deviation;
}

CoarseField depth_below_skin(const LabelVolume& labels) {
    const int step = depth_step(labels.grid.spacing_mm.x, kSkinSampleMm);
    return distance_inside(labels.grid.size, step, [&](int i, int j, int k) {
        return labels.voxels[labels.grid.index(i, j, k)] != 0;
    });
}

}  // namespace

int depth_step(double voxel_mm, double apart_mm) {
    return std::max(1, static_cast<int>(std::lround(apart_mm / voxel_mm)));
}

VoxelStructure::VoxelStructure(const LabelVolume& labels,
                               const std::vector<const Tissue*>& tissue_of,
                               const BakeStructureOptions& options)
    : labels_(labels),
      options_(options),
      voxel_mm_(static_cast<float>(labels.grid.spacing_mm.x)),
      facts_(label_facts(labels, tissue_of)),
      skin_depth_(depth_below_skin(labels)),
      directions_(find_muscle_directions(labels, facts_, &skin_depth_)),
      grain3_(3.2, derive_seed(options.seed, 1)),
      grain5_(5, derive_seed(options.seed, 2)),
      grain14_(14, derive_seed(options.seed, 3)),
      grain30_(30, derive_seed(options.seed, 4)),
      fibres_(labels.grid.spacing_mm.x, derive_seed(options.seed, 5)) {
    if (options.fat_septa) through_fat_ = distance_through_fat(labels, facts_);
    if (options.kidney) find_kidneys();
}

void VoxelStructure::find_kidneys() {
    bool sinus_labelled = false;
    for (std::size_t l = 1; l < facts_.size(); ++l) {
        if (facts_[l].count > 0 && facts_[l].tissue->name == "kidney_sinus") sinus_labelled = true;
    }
    for (std::size_t l = 1; l < facts_.size(); ++l) {
        const LabelFacts& f = facts_[l];
        const double ml = static_cast<double>(f.count) * labels_.grid.voxel_volume_mm3() / 1000;
        if (f.role != StructureRole::kidney || ml < 5) continue;
        kidneys_.push_back(find_kidney(labels_, f, static_cast<int>(l)));
        if (sinus_labelled) kidneys_.back().solid = false;
    }
}

bool VoxelStructure::in_hilum(int i, int j, int k) const {
    for (const Kidney& kidney : kidneys_) {
        if (kidney.depth.contains(i, j, k) && kidney.depth.at(i, j, k) * voxel_mm_ > 1.5f)
            return true;
    }
    return false;
}

float VoxelStructure::fat_db(int i, int j, int k, float x, float y, float z) const {
    const auto fi = static_cast<float>(i), fj = static_cast<float>(j), fk = static_cast<float>(k);
    const float depth = skin_depth_.at(fi, fj, fk) * voxel_mm_;
    // Paths along the axes are up to sqrt(3) longer than the straight line. The transition between
    // the two kinds of fat is gradual, because nothing in the label volume marks it.
    const float detour = 1.8f * depth + 12 - through_fat_.at(fi, fj, fk);
    const float under_skin =
        std::clamp(detour / 10 + 0.5f, 0.f, 1.f) * std::clamp((64 - depth) / 12, 0.f, 1.f);
    // Fat around organs is echogenic and mixed.
    const float inner = under_skin < 1 ? 9 + 2.5f * grain5_.at(x, y, z) : 0.f;
    if (under_skin <= 0) return inner;
    return inner + under_skin * (septa_db(depth, x, y, z) - inner);
}

// Sheets 6 mm apart that are wavy, torn and of varying strength.
float VoxelStructure::septa_db(float depth, float x, float y, float z) const {
    const float wave = depth + 2.2f * grain14_.at(x, y, z) + 1.6f * grain30_.at(x, y, z);
    const float sheet = wave / 6.2f;
    const float nearest = std::round(sheet);
    const float off_mm = std::abs(sheet - nearest) * 6.2f;
    const float cover = std::clamp((0.55f - off_mm) / std::max(voxel_mm_, 0.5f) + 0.5f, 0.f, 1.f);
    if (cover <= 0) return 0;
    // Each sheet has its own tears.
    const float torn = grain14_.at(x + 97 * nearest, y - 61 * nearest, z + 43 * nearest);
    const float strength = std::clamp(0.8f + 0.7f * torn, 0.f, 1.25f);
    return 17 * cover * strength;
}

float VoxelStructure::offset_db(std::uint8_t label, int i, int j, int k) const {
    const LabelFacts& f = facts_[label];
    const float x = static_cast<float>(i) * voxel_mm_, y = static_cast<float>(j) * voxel_mm_,
                z = static_cast<float>(k) * voxel_mm_;
    const auto sd = static_cast<float>(f.tissue->structure_db);
    switch (f.role) {
        case StructureRole::none: return 0;
        case StructureRole::muscle:
            // What segmentations label as muscle in the hilum is vessels and fat.
            if (in_hilum(i, j, k)) return 9 + 3 * grain3_.at(x, y, z);
            if (!options_.muscle_fibres) break;
            return std::clamp(sd * sparse(fibres_.at(x, y, z,
                                                     directions_.at(label, static_cast<float>(i),
                                                                    static_cast<float>(j),
                                                                    static_cast<float>(k)))),
                              -14.f, 16.f);
        case StructureRole::fat:
            // Fat in the hilum is the sinus, with an echo different from that of fat around organs.
            if (in_hilum(i, j, k)) return 14 + 2 * grain3_.at(x, y, z);
            if (!options_.fat_septa) break;
            return fat_db(i, j, k, x, y, z);
        case StructureRole::kidney: {
            const float noise = options_.parenchyma ? sd * grain3_.at(x, y, z) : 0;
            for (const Kidney& kidney : kidneys_) {
                if (kidney.label == label)
                    return noise +
                           kidney_offset_db(kidney, voxel_mm_, i, j, k, grain5_.at(x, y, z));
            }
            return noise;
        }
        case StructureRole::bowel:
            if (!options_.parenchyma) return 0;
            return sd * (0.75f * grain5_.at(x, y, z) + 0.66f * grain14_.at(x, y, z));
        case StructureRole::liver:
        case StructureRole::plain: break;
    }
    if (!options_.parenchyma || sd <= 0) return 0;
    return sd * (0.7f * grain3_.at(x, y, z) + 0.71f * grain5_.at(x, y, z));
}

}  // namespace sonocase::pipeline::inline anatomy
