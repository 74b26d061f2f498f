// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/structure/fat_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace sonocase::pipeline {
namespace {

constexpr float kFar_mm = 250;  // finite, because neighbouring samples are interpolated
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
                if (!open[at] || field->value[at] < kFar_mm) continue;
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
                if (value < kFar_mm) continue;
                for (const auto& d : kNeighbours) {
                    const int x = i + d[0], y = j + d[1], z = k + d[2];
                    if (contains(field->size, x, y, z))
                        value = std::min(value, before[field->index(x, y, z)] + reach);
                }
            }
        }
    }
}

}  // namespace

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
    field.value.assign(count, kFar_mm);
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
    // By two samples, which keeps the far value out of the interpolation at the edge of the fat.
    for (int ring = 0; ring < 2; ++ring) extend(reach, &field);
    return field;
}

}  // namespace sonocase::pipeline
