// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/tissue_lattice.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline::inline registration_elastic {
namespace {

struct Row {
    std::string_view tissue;
    Stiffness stiffness;
};

constexpr Stiffness kAir{1, 0}, kFat{1, 0}, kOrgan{150, 200}, kOneTissue{10, 20};

// Tissues that are not listed count as fat.
constexpr Row kRows[] = {
    {"outside", kAir},
    {"bone", {300, 300}},
    {"metal", {300, 300}},
    {"cartilage", {60, 60}},
    {"liver", kOrgan},
    {"spleen", kOrgan},
    {"kidney_cortex", kOrgan},
    {"kidney_sinus", kOrgan},
    {"pancreas", kOrgan},
    {"gland", kOrgan},
    {"nerve", kOrgan},
    {"brain", kOrgan},
    {"cerebrospinal_fluid", kOrgan},
    {"lesion", kOrgan},
    {"cyst", {12, 40}},
    {"blood", {12, 20}},
    {"heart_muscle", {12, 20}},
    {"muscle", {10, 20}},
    {"tendon", {10, 20}},
    {"fascia", {10, 20}},
    {"bowel", {8, 10}},
    {"gas", {8, 10}},
    {"urine", {12, 40}},
    {"bile", {12, 40}},
    {"lung", {6, 4}},
};

constexpr double kCoarsestMm = 3;  // voxels closer together than this are skipped

struct Block {
    double shape = 0, volume = 0;
    long voxels = 0, body = 0;
};

}  // namespace

Stiffness tissue_stiffness(std::string_view tissue) {
    for (const Row& row : kRows) {
        if (row.tissue == tissue) return row.stiffness;
    }
    return kFat;
}

bool is_bone(std::string_view tissue) {
    return tissue == "bone";
}

bool is_solid_organ(std::string_view tissue) {
    return tissue == "liver" || tissue == "spleen" || tissue == "kidney_cortex" ||
           tissue == "kidney_sinus" || tissue == "pancreas" || tissue == "gland";
}

TissueLattice make_tissue_lattice(const SplineLattice& lattice,
                                  const LabelVolume* labels,
                                  double body_share) {
    const Int3 size = lattice.size();
    const DisplacementGrid& grid = lattice.grid();
    const Int3 halves{size.x - 2, size.y - 2, size.z - 2};  // blocks, two for each cell
    const auto block_index = [&](int i, int j, int k) {
        return i +
               static_cast<std::size_t>(halves.x) * (j + static_cast<std::size_t>(halves.y) * k);
    };
    std::vector<Block> blocks(block_index(0, 0, halves.z));
    TissueLattice tissue;
    const bool known = labels != nullptr && labels->labels.size() > 1;
    if (known) {
        std::vector<Stiffness> stiffness;
        const bool one_tissue = labels->labels.size() == 2;
        for (const Label& label : labels->labels)
            stiffness.push_back(tissue_stiffness(label.tissue));
        if (one_tissue) stiffness[1] = kOneTissue;
        const Grid& voxels = labels->grid;
        int step[3];
        for (int a = 0; a < 3; ++a) {
            step[a] =
                std::max(1, static_cast<int>(std::lround(kCoarsestMm / voxels.spacing_mm[a])));
        }
        const double per_mm = 2 / grid.spacing_mm;
        for (int k = 0; k < voxels.size.z; k += step[2]) {
            for (int j = 0; j < voxels.size.y; j += step[1]) {
                for (int i = 0; i < voxels.size.x; i += step[0]) {
                    const Vector3 at =
                        per_mm *
                        (voxels.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}) - grid.origin_mm);
                    if (!(at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < halves.x &&
                          at.y < halves.y && at.z < halves.z))
                        continue;
                    const std::uint8_t label = labels->voxels[voxels.index(i, j, k)];
                    Block& b = blocks[block_index(static_cast<int>(at.x), static_cast<int>(at.y),
                                                  static_cast<int>(at.z))];
                    b.shape += stiffness[label].shape;
                    b.volume += stiffness[label].volume;
                    ++b.voxels;
                    b.body += label != 0;
                }
            }
        }
    }
    for (const Block& b : blocks) tissue.inside += 2 * b.body > b.voxels;
    if (!known) tissue.inside = body_share * static_cast<double>(blocks.size());
    tissue.inside = std::max(1.0, tissue.inside);
    const Stiffness otherwise = known ? kAir : kOneTissue;
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i) {
                const int n[3] = {i, j, k};
                int at[3];
                bool on_face = false;
                for (int a = 0; a < 3; ++a) {
                    const auto& p = lattice.position(a, n[a]);
                    at[a] = 2 * p.cell + p.half;
                    on_face = on_face || p.on_face;
                }
                const Block& b = blocks[block_index(at[0], at[1], at[2])];
                const double voxels = static_cast<double>(b.voxels);
                const double share = on_face ? 0.5 : 1;
                tissue.shape.push_back(static_cast<float>(
                    share * (b.voxels > 0 ? b.shape / voxels : otherwise.shape)));
                tissue.volume.push_back(static_cast<float>(
                    share * (b.voxels > 0 ? b.volume / voxels : otherwise.volume)));
            }
        }
    }
    return tissue;
}

}  // namespace sonocase::pipeline::inline registration_elastic
