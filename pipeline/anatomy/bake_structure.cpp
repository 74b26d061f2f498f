// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/bake_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/anatomy/boundary_layers.h"
#include "pipeline/anatomy/liver_vessels.h"
#include "pipeline/anatomy/voxel_structure.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/stopwatch.h"

namespace sonocase::pipeline::inline anatomy {

namespace {

constexpr int kBlock = 32;    // voxels per edge of a block of BoundaryLayers
constexpr float kMaxDb = 31;  // that an int8 of quarters holds

// A whole number of dB, in quarters.
std::int8_t stored(float db) {
    return static_cast<std::int8_t>(4 *
                                    static_cast<int>(std::lround(std::clamp(db, -kMaxDb, kMaxDb))));
}

// Tissue of each label, # palette.
Result<std::vector<const Tissue*>> tissues_of(const LabelVolume& cooked,
                                              std::span<const Tissue> tissues) {
    std::vector<const Tissue*> out;
    for (const Label& label : cooked.labels) {
        const auto found = std::find_if(tissues.begin(), tissues.end(),
                                        [&](const Tissue& t) { return t.name == label.tissue; });
        if (found == tissues.end()) {
            return Error{"label " + label.name + " is of tissue '" + label.tissue +
                             "', which is not in the tissue table",
                         "label volume", "name a tissue of the table, or add it to the recipe"};
        }
        out.push_back(&*found);
    }
    return out;
}

BoundaryLayerRules layer_rules(const std::vector<LabelFacts>& facts,
                               double voxel_mm,
                               const BakeStructureOptions& options) {
    BoundaryLayerRules rules;
    rules.voxel_mm = voxel_mm;
    rules.fascia = options.fascia;
    rules.bowel_wall = options.bowel_wall;
    for (const LabelFacts& f : facts) {
        rules.role.push_back(f.role);
        rules.gas.push_back(f.tissue->kind == TissueKind::gas);
        rules.echo_db.push_back(static_cast<float>(f.tissue->echo_db));
    }
    return rules;
}

// Offsets of the voxels lower <= (i, j, k) < upper.
void bake_block(const LabelVolume& cooked,
                const VoxelStructure& structure,
                const BoundaryLayers& layers,
                Int3 lower,
                Int3 upper,
                std::vector<std::int8_t>* offsets) {
    for (int k = lower.z; k < upper.z; ++k) {
        for (int j = lower.y; j < upper.y; ++j) {
            std::size_t at = cooked.grid.index(lower.x, j, k);
            for (int i = lower.x; i < upper.x; ++i, ++at) {
                const std::uint8_t label = cooked.voxels[at];
                if (label >= structure.facts().size() ||
                    structure.facts()[label].role == StructureRole::none)
                    continue;
                float db = structure.offset_db(label, i, j, k);
                if (layers.any()) {
                    db = layers.apply(db, label, i, j, k,
                                      [&] { return structure.layer_noise(i, j, k); });
                }
                (*offsets)[at] = stored(db);
            }
        }
    }
}

// Offsets of all voxels, # voxels, without vessels.
std::vector<std::int8_t> bake_voxels(const LabelVolume& cooked,
                                     const VoxelStructure& structure,
                                     const BoundaryLayerRules& rules) {
    const Int3 size = cooked.grid.size;
    std::vector<std::int8_t> offsets(cooked.voxels.size(), 0);
    const Int3 blocks{(size.x + kBlock - 1) / kBlock, (size.y + kBlock - 1) / kBlock,
                      (size.z + kBlock - 1) / kBlock};
    const std::size_t block_count = static_cast<std::size_t>(blocks.x) * blocks.y * blocks.z;
    parallel_for(block_count, 1, [&](std::size_t begin, std::size_t end) {
        BoundaryLayers layers;
        for (std::size_t b = begin; b < end; ++b) {
            const auto nx = static_cast<std::size_t>(blocks.x),
                       ny = static_cast<std::size_t>(blocks.y);
            const Int3 lower{static_cast<int>(b % nx) * kBlock,
                             static_cast<int>(b / nx % ny) * kBlock,
                             static_cast<int>(b / nx / ny) * kBlock};
            const Int3 upper{std::min(lower.x + kBlock, size.x), std::min(lower.y + kBlock, size.y),
                             std::min(lower.z + kBlock, size.z)};
            layers.prepare(cooked, lower, upper, rules);
            bake_block(cooked, structure, layers, lower, upper, &offsets);
        }
    });
    return offsets;
}

// Shifts the mean of each label to 0 dB, to a quarter. Returns the largest mean that remains, dB.
// Integer sums: any order gives the same result.
double level_labels(const LabelVolume& cooked,
                    const std::vector<LabelFacts>& facts,
                    std::vector<std::int8_t>* offsets) {
    const Int3 size = cooked.grid.size;
    std::vector<std::vector<std::int64_t>> slice_sums(size.z);
    const std::size_t slice = static_cast<std::size_t>(size.x) * size.y;
    parallel_for(slice_sums.size(), 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            slice_sums[k].assign(256, 0);
            for (std::size_t i = k * slice; i < (k + 1) * slice; ++i)
                slice_sums[k][cooked.voxels[i]] += (*offsets)[i];
        }
    });
    std::array<int, 256> shift{};
    double worst = 0;
    for (std::size_t l = 1; l < facts.size(); ++l) {
        const LabelFacts& f = facts[l];
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
                (*offsets)[i] = static_cast<std::int8_t>(std::clamp((*offsets)[i] + s, -127, 127));
        }
    });
    return worst;
}

}  // namespace

Result<BakeStructureResult> bake_structure(const LabelVolume& cooked,
                                           std::span<const Tissue> tissues,
                                           const BakeStructureOptions& options,
                                           const Progress& progress) {
    const Stopwatch watch;
    const Vector3 spacing = cooked.grid.spacing_mm;
    if (std::abs(spacing.x - spacing.y) > 1e-6 * spacing.x ||
        std::abs(spacing.x - spacing.z) > 1e-6 * spacing.x) {
        return Error{"voxels are not cubes", "label volume", "resample the labels first"};
    }
    SONOCASE_TRY(const auto tissue_of, tissues_of(cooked, tissues));
    BakeStructureResult out;
    out.report.stage = stage_names::kStructure;
    report_progress(progress, 0, "finding organs");
    const VoxelStructure structure(cooked, tissue_of, options);
    const std::vector<LabelFacts>& facts = structure.facts();
    for (const FibreField& f : structure.directions().fields) {
        if (f.label > 0) out.fibres.push_back(f);
    }
    report_progress(progress, 0.15, "growing vessels");
    if (options.liver_vessels)
        out.trees = grow_liver_vessels(cooked, facts, derive_seed(options.seed, 6));

    report_progress(progress, 0.3, "baking structure");
    std::vector<std::int8_t> offsets =
        bake_voxels(cooked, structure, layer_rules(facts, spacing.x, options));
    for (std::size_t l = 1; l < facts.size(); ++l) {
        if (facts[l].role == StructureRole::liver && !out.trees.empty())
            draw_vessels(cooked, static_cast<int>(l), out.trees, offsets);
    }
    report_progress(progress, 0.85, "levelling");
    const double worst_mean_db = level_labels(cooked, facts, &offsets);
    report_progress(progress, 0.92, "packing bricks");
    out.echo_offset = bricks_from_dense<std::int8_t>(offsets, cooked.grid.size);

    double pieces = 0;
    for (const VesselTree& tree : out.trees) pieces += static_cast<double>(tree.nodes.size());
    out.report.measures = {{"vessel_pieces", pieces},
                           {"kidneys", static_cast<double>(structure.kidneys().size())},
                           {"muscles", static_cast<double>(out.fibres.size())},
                           {"worst_mean_offset_db", worst_mean_db}};
    out.report.seconds = watch.seconds();
    report_progress(progress, 1, "baking structure");
    return out;
}

int structure_cell(double voxel_mm) {
    for (const int cell : {4, 2}) {
        if (cell * voxel_mm <= kStructureCellMm * 1.0001) return cell;
    }
    return 1;
}

double structure_depth_bytes(double voxel_mm) {
    const int cell = structure_cell(voxel_mm);
    double bytes = 0;
    for (const double apart_mm : {kSkinSampleMm, kFatSampleMm})
        bytes += sizeof(float) / std::pow(cell * depth_step(cell * voxel_mm, apart_mm), 3);
    return bytes;
}

Result<BakeStructureResult> bake_structure_in_cells(const LabelVolume& cooked,
                                                    std::span<const Tissue> tissues,
                                                    const BakeStructureOptions& options,
                                                    const Progress& progress) {
    const Grid& fine = cooked.grid;
    const int cell = structure_cell(fine.spacing_mm.x);
    if (cell == 1) return bake_structure(cooked, tissues, options, progress);
    LabelVolume coarse;
    coarse.labels = cooked.labels;
    coarse.grid = fine;
    for (int a = 0; a < 3; ++a) {
        coarse.grid.size[a] = (fine.size[a] + cell - 1) / cell;
        coarse.grid.spacing_mm[a] = cell * fine.spacing_mm[a];
    }
    const double middle = 0.5 * (cell - 1);
    coarse.grid.origin_mm = fine.point_from_voxel({middle, middle, middle});
    coarse.voxels.resize(coarse.grid.voxel_count());
    const auto inside = [&](int at, int size) { return std::min(at * cell + cell / 2, size - 1); };
    parallel_for(coarse.grid.size.z, 4, [&](std::size_t b, std::size_t e) {
        for (int k = static_cast<int>(b); k < static_cast<int>(e); ++k) {
            for (int j = 0; j < coarse.grid.size.y; ++j) {
                const std::uint8_t* row =
                    cooked.voxels.data() +
                    fine.index(0, inside(j, fine.size.y), inside(k, fine.size.z));
                std::uint8_t* to = coarse.voxels.data() + coarse.grid.index(0, j, k);
                for (int i = 0; i < coarse.grid.size.x; ++i) to[i] = row[inside(i, fine.size.x)];
            }
        }
    });
    auto baked = bake_structure(coarse, tissues, options, progress);
    if (!baked) return baked;
    const std::vector<std::int8_t> values = dense_from_bricks(baked->echo_offset);
    std::vector<std::int8_t> offsets(fine.voxel_count());
    parallel_for(fine.size.z, 4, [&](std::size_t b, std::size_t e) {
        for (int k = static_cast<int>(b); k < static_cast<int>(e); ++k) {
            for (int j = 0; j < fine.size.y; ++j) {
                const std::int8_t* row = values.data() + coarse.grid.index(0, j / cell, k / cell);
                std::int8_t* to = offsets.data() + fine.index(0, j, k);
                for (int i = 0; i < fine.size.x; ++i) to[i] = row[i / cell];
            }
        }
    });
    baked->echo_offset = bricks_from_dense<std::int8_t>(offsets, fine.size);
    return baked;
}

}  // namespace sonocase::pipeline::inline anatomy
