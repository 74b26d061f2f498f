// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/pack_surfaces.h"

#include <array>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/bundle/codec/brick_kinds.h"
#include "formats/bundle/codec/patch_rows.h"
#include "formats/volume/boundary_record.h"

namespace sonocase::detail {
namespace {

struct Streams {  // of one layer of bricks
    std::vector<std::uint8_t> kind, one, mix, pair;
    std::array<std::vector<std::uint16_t>, kPatchCoefficients> coefficient;
    std::vector<SurfacePatch> patches;
    std::vector<std::uint32_t> first_patch;  // # bricks of the layer
};

std::vector<SurfacePatch> patches_for(const BoundaryBricks& boundary,
                                      std::size_t brick,
                                      const BrickLabels& label,
                                      const BrickRecords& record) {
    const std::uint32_t entry = boundary.table[brick];
    if (!(entry & kUniformBrick)) {
        const std::span<const SurfacePatch> known = boundary.patches.of(entry);
        if (!known.empty() && known.size() <= static_cast<std::size_t>(kMaxPatches))
            return {known.begin(), known.end()};
    }
    return fit_patches(label, record, boundary.patches.step);
}

// What stands for a brick's boundary records.
struct PatchedBrick {
    std::vector<SurfacePatch> patches;
    bool is_exact = true;       // the patches give the records back
    bool gives_labels = false;  // one patch, and the labels are those of its sides
};

PatchedBrick patched_brick(const BoundaryBricks& boundary,
                           std::size_t brick,
                           const BrickLabels& label,
                           int reach_steps) {
    PatchedBrick out;
    BrickRecords record;
    brick_values(boundary, brick, record.data());
    if (std::all_of(record.begin(), record.end(), [](std::uint32_t r) { return r == kNoBoundary; }))
        return out;
    out.patches = patches_for(boundary, brick, label, record);
    const int step = boundary.patches.step;
    for (SurfacePatch& patch : out.patches) patch = from_steps(in_steps(patch, step), step);
    BrickRecords prediction;
    records_from_patches(out.patches, label.data(), reach_steps, prediction.data());
    out.is_exact = prediction == record;
    if (out.patches.size() == 1 && !all_alike(label.data())) {
        BrickLabels by_side;
        labels_from_patch(out.patches[0], by_side.data());
        out.gives_labels = by_side == label;
    }
    return out;
}

Streams packed_layer(const BrickVolume<std::uint8_t>& labels,
                     const BoundaryBricks& boundary,
                     int reach_steps,
                     int layer) {
    Streams out;
    const Int3 bricks = brick_count(labels.size);
    const std::size_t count = layer_bricks(bricks);
    PatchRows rows(static_cast<std::size_t>(bricks.x), count);
    std::vector<SurfacePatch> coded;
    std::uint8_t before = 0;
    for (std::size_t b = 0; b < count; ++b) {
        const std::size_t brick = static_cast<std::size_t>(layer) * count + b;
        BrickLabels label;
        brick_values(labels, brick, label.data());
        PatchedBrick patched;
        if (!boundary.table.empty()) patched = patched_brick(boundary, brick, label, reach_steps);
        const std::vector<SurfacePatch>& patches = patched.patches;
        const unsigned labels_as = patched.gives_labels       ? kSidesOfPatch
                                   : !all_alike(label.data()) ? kMixedLabels
                                   : label[0] == before       ? kAsBefore
                                                              : kOneLabel;
        if (labels_as == kOneLabel) out.one.push_back(before = label[0]);
        if (labels_as == kMixedLabels) out.mix.insert(out.mix.end(), label.begin(), label.end());
        const unsigned kind = labels_as | static_cast<unsigned>(patches.size()) << 2 |
                              (patched.is_exact ? 0 : kCorrected);
        out.kind.push_back(static_cast<std::uint8_t>(kind));
        out.first_patch.push_back(static_cast<std::uint32_t>(out.patches.size()));
        for (const SurfacePatch& patch : patches) {
            out.pair.push_back(patch.low);
            out.pair.push_back(patch.high);
            const auto near = rows.prediction(coded.data(), b, patch);
            const SurfacePatch own = in_steps(patch, boundary.patches.step);
            for (std::size_t i = 0; i < kPatchCoefficients; ++i)
                out.coefficient[i].push_back(folded(static_cast<std::int16_t>(own.c[i] - near[i])));
        }
        for (const SurfacePatch& patch : patches)
            coded.push_back(in_steps(patch, boundary.patches.step));
        append(out.patches, patches);
        rows.close(b, coded.size());
    }
    return out;
}

// Where records of a block's bricks differ from what their patches say: one bit per voxel, then
// what is to be added to each byte of those words.
void add_corrections(const BlockGrid& grid,
                     std::size_t block,
                     const BrickVolume<std::uint8_t>& labels,
                     const BoundaryBricks& boundary,
                     const std::vector<Streams>& layers,
                     int reach_steps,
                     std::vector<std::uint8_t>* out) {
    std::array<std::vector<std::uint8_t>, 4> bytes;
    const std::size_t layer = layer_bricks(grid.bricks);
    grid.each_brick(block, [&](std::size_t brick, bool, bool) {
        const Streams& streams = layers[brick / layer];
        const std::size_t b = brick % layer;
        const unsigned kind = streams.kind[b];
        if (!corrected(kind)) return;
        BrickLabels label;
        BrickRecords record, prediction;
        brick_values(labels, brick, label.data());
        brick_values(boundary, brick, record.data());
        const std::span<const SurfacePatch> patches{streams.patches.data() + streams.first_patch[b],
                                                    patch_count(kind)};
        records_from_patches(patches, label.data(), reach_steps, prediction.data());
        std::array<std::uint8_t, kBrickVoxels / 8> mask{};
        for (std::size_t v = 0; v < kBrickVoxels; ++v) {
            if (record[v] == prediction[v]) continue;
            mask[v / 8] = static_cast<std::uint8_t>(mask[v / 8] | 1u << v % 8);
            for (std::size_t n = 0; n < 4; ++n)
                bytes[n].push_back(
                    static_cast<std::uint8_t>((record[v] >> 8 * n) - (prediction[v] >> 8 * n)));
        }
        out->insert(out->end(), mask.begin(), mask.end());
    });
    for (const auto& plane : bytes) append(*out, plane);
}

}  // namespace

void add_surfaces(ChunkWriter& writer,
                  const BlockGrid& grid,
                  const BrickVolume<std::uint8_t>& labels,
                  const BoundaryBricks& boundary,
                  int reach_steps,
                  JobRunner& jobs) {
    std::vector<Streams> layers(labels.table.empty() ? 0 : static_cast<std::size_t>(grid.bricks.z));
    jobs.run(layers.size(), [&](std::size_t k) {
        layers[k] = packed_layer(labels, boundary, reach_steps, static_cast<int>(k));
    });
    std::vector<std::uint8_t> kind, one, mix, pair, low, high;
    for (const Streams& layer : layers) {
        append(kind, layer.kind);
        append(one, layer.one);
        append(mix, layer.mix);
        append(pair, layer.pair);
    }
    // Each coefficient in a run of its own: its values have one distribution.
    for (std::size_t i = 0; i < kPatchCoefficients; ++i) {
        for (const Streams& layer : layers) {
            for (const std::uint16_t v : layer.coefficient[i]) {
                low.push_back(static_cast<std::uint8_t>(v));
                high.push_back(static_cast<std::uint8_t>(v >> 8));
            }
        }
    }
    writer.add("vox.kind", true, std::move(kind));
    writer.add("vox.one", true, std::move(one));
    writer.add("vox.mix", true, std::move(mix));
    writer.add("vox.pair", true, std::move(pair));
    writer.add("vox.low", true, std::move(low));
    writer.add("vox.high", true, std::move(high));
    if (boundary.table.empty()) return;
    writer.add_packed(
        "vox.fix", true,
        pack_blocks(grid, jobs, [&](std::size_t block, std::vector<std::uint8_t>* out) {
            add_corrections(grid, block, labels, boundary, layers, reach_steps, out);
        }));
}

}  // namespace sonocase::detail
