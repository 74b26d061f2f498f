// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/unpack_surfaces.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <tuple>

#include "formats/base/memory.h"
#include "formats/bundle/codec/brick_kinds.h"
#include "formats/bundle/codec/patch_rows.h"
#include "formats/bundle/codec/value_order.h"
#include "formats/volume/boundary_record.h"

namespace sonocase::detail {
namespace {

using Bytes = RawVector<std::uint8_t>;

// Where a layer's part of each stream and of each pool begins, in items of that name.
struct Starts {
    std::size_t one = 0, mix = 0, patch = 0, label_pool = 0, without_records = 0;

    void add(unsigned kind, std::size_t bricks) {
        one += bricks * (label_kind(kind) == kOneLabel);
        mix += bricks * (label_kind(kind) == kMixedLabels);
        patch += bricks * patch_count(kind);
        label_pool += bricks * (label_kind(kind) >= kMixedLabels);
        without_records += bricks * !has_records(kind);
    }
};

bool known(unsigned kind) {
    return kind < kKinds && patch_count(kind) <= static_cast<std::size_t>(kMaxPatches) &&
           (label_kind(kind) != kSidesOfPatch || patch_count(kind) == 1);
}

struct Packed {
    Bytes kind, one, mix, pair, low, high;
};

SurfacePatch decoded_patch(const Packed& in,
                           std::size_t p,
                           std::size_t patches,
                           const PatchRows& rows,
                           const SurfacePatch* known,
                           std::size_t brick) {
    SurfacePatch patch;
    patch.low = in.pair[2 * p];
    patch.high = in.pair[2 * p + 1];
    const auto prediction = rows.prediction(known, brick, patch);
    for (std::size_t i = 0; i < kPatchCoefficients; ++i) {
        const std::size_t from = i * patches + p;
        const auto v = static_cast<std::uint16_t>(in.low[from] | in.high[from] << 8);
        patch.c[i] = static_cast<std::int16_t>(prediction[i] + unfolded(v));
    }
    return patch;
}

void unpack_layer(const Packed& in,
                  Starts at,
                  std::size_t patches,
                  const std::array<std::uint32_t, 256>& uniform_of_label,
                  std::size_t layer,
                  PoolOrder* places,
                  BlockParts* parts,
                  VoxelVolumes* out) {
    const Int3 bricks = brick_count(out->labels.size);
    const std::size_t count = layer_bricks(bricks), first_patch = at.patch;
    const int step = out->boundary.patches.step;
    SurfacePatch* const own = out->boundary.patches.patches.data() + first_patch;
    PatchRows rows(static_cast<std::size_t>(bricks.x), count);
    std::uint8_t before = 0;
    const auto width = static_cast<std::size_t>(bricks.x);
    PoolOrder::Row row = places->row(layer, 0);
    for (std::size_t b = 0, i = 0, j = 0; b < count; ++b, ++i) {
        if (i == width) {
            i = 0;
            row = places->row(layer, static_cast<int>(++j));
        }
        const std::size_t brick = layer * count + b;
        const unsigned kind = in.kind[brick], labels_as = label_kind(kind);
        if (kind == 0) {  // air and the inside of organs: most bricks
            out->labels.table[brick] = kUniformBrick | uniform_of_label[before];
            if (!out->boundary.table.empty()) out->boundary.table[brick] = kUniformBrick;
            rows.close(b, at.patch - first_patch);
            continue;
        }
        const std::size_t end = at.patch + patch_count(kind);
        for (std::size_t p = at.patch; p < end; ++p)
            own[p - first_patch] = decoded_patch(in, p, patches, rows, own, b);
        rows.close(b, end - first_patch);
        if (labels_as < kMixedLabels) {
            if (labels_as == kOneLabel) before = in.one[at.one];
            out->labels.table[brick] = kUniformBrick | uniform_of_label[before];
        } else {
            std::uint8_t* to = out->labels.pool.data() + at.label_pool * kBrickVoxels;
            if (labels_as == kMixedLabels) {
                std::memcpy(to, in.mix.data() + at.mix * kBrickVoxels, kBrickVoxels);
            } else {
                labels_from_patch(from_steps(own[at.patch - first_patch], step), to);
            }
            out->labels.table[brick] = static_cast<std::uint32_t>(at.label_pool);
        }
        if (has_records(kind)) {
            const std::uint32_t place = row.next(static_cast<int>(i));
            out->boundary.table[brick] = place;
            out->boundary.patches.first[place] = static_cast<std::uint32_t>(at.patch);
            out->boundary.patches.count[place] = static_cast<std::uint8_t>(patch_count(kind));
            parts->corrected[place] = corrected(kind);
        } else if (!out->boundary.table.empty()) {
            out->boundary.table[brick] = kUniformBrick;
        }
        at.add(kind, 1);
    }
    for (std::size_t p = 0; p < at.patch - first_patch; ++p) own[p] = from_steps(own[p], step);
}

bool below(const Bytes& values, std::size_t limit) {
    std::uint8_t most = 0;
    for (const std::uint8_t v : values) most = std::max(most, v);
    return values.empty() || most < limit;
}

}  // namespace

Status read_surfaces(const ChunkReader& reader,
                     bool with_records,
                     JobRunner& jobs,
                     BlockParts* parts,
                     VoxelVolumes* out) {
    const Int3 bricks = parts->grid.bricks;
    const std::size_t layer = layer_bricks(bricks), layers = static_cast<std::size_t>(bricks.z);
    Packed in;
    const auto get = [&](const char* type, std::size_t size, Bytes* to) {
        auto bytes = reader.read_array<std::uint8_t, Bytes>(type, size, jobs);
        if (!bytes) return Status(bytes.error());
        *to = std::move(*bytes);
        return Status(Done{});
    };
    if (Status s = get("vox.kind", layer * layers, &in.kind); !s) return s;
    const LayerKinds kinds(in.kind, layer, jobs);
    std::vector<Starts> starts(layers + 1);
    bool good = true;
    for (std::size_t k = 0; k < layers; ++k) {
        starts[k + 1] = starts[k];
        for (unsigned kind = 0; kind < 256; ++kind) {
            const std::size_t n = kinds.count(k, kind);
            if (n == 0) continue;
            good &= known(kind);
            starts[k + 1].add(kind, n);
        }
    }
    const Starts& total = starts[layers];
    good &= with_records || total.without_records == in.kind.size();
    if (!good) return reader.fault("a brick of 'vox.kind' is of an unknown kind", "make it again");
    for (const auto& [type, size, to] :
         {std::tuple{"vox.one", total.one, &in.one},
          std::tuple{"vox.mix", total.mix * kBrickVoxels, &in.mix},
          std::tuple{"vox.pair", 2 * total.patch, &in.pair},
          std::tuple{"vox.low", kPatchCoefficients * total.patch, &in.low},
          std::tuple{"vox.high", kPatchCoefficients * total.patch, &in.high}}) {
        if (Status s = get(type, size, to); !s) return s;
    }
    if (!below(in.one, parts->palette) || !below(in.mix, parts->palette))
        return reader.fault("a voxel has a label beyond the palette", "make the file again");
    bool ordered = true;
    for (std::size_t p = 0; p < total.patch; ++p) ordered &= in.pair[2 * p] < in.pair[2 * p + 1];
    if (!ordered)
        return reader.fault("a surface patch does not separate two labels", "make it again");
    if (!below(in.pair, parts->palette)) {
        return reader.fault("a boundary record has a label beyond the palette",
                            "make the file again");
    }
    if (with_records) {
        auto frames = BlockFrames::open(reader, "vox.fix", parts->grid.count(),
                                        parts->grid.block_bricks() * (8 + 4 * kBrickVoxels));
        if (!frames) return frames.error();
        parts->corrections = std::move(*frames);
    }

    ValueOrder order;
    for (std::size_t k = 0; k < layers; ++k) {
        if (kinds.begins_as_before(k, [](unsigned kind) { return label_kind(kind); })) order.met(0);
        for (std::size_t n = starts[k].one; n < starts[k + 1].one; ++n) order.met(in.one[n]);
    }
    PoolOrder places(in.kind, parts->grid, jobs, has_records);
    if (!can_allocate(total.label_pool * kBrickVoxels) ||
        !can_allocate(places.total() * kBrickVoxels * sizeof(std::uint32_t)))
        return reader.fault("needs more memory than is available", "use larger voxels");
    out->labels.uniform = order.values();
    out->labels.table.resize(in.kind.size());
    out->labels.pool.resize(total.label_pool * kBrickVoxels);
    out->boundary.patches.patches.resize(total.patch);
    if (with_records) {
        out->boundary.table.resize(in.kind.size());
        out->boundary.pool.resize(places.total() * kBrickVoxels);
        // Renderers read the first record where they use none.
        if (places.total() > 0) out->boundary.pool[0] = kNoBoundary;
        out->boundary.patches.first.resize(places.total());
        out->boundary.patches.count.resize(places.total());
        parts->corrected.resize(places.total());
        if (total.without_records > 0) out->boundary.uniform = {kNoBoundary};
    }
    jobs.run(layers, [&](std::size_t k) {
        unpack_layer(in, starts[k], total.patch, order.index(), k, &places, parts, out);
    });
    parts->labels = BrickSpans(out->labels);
    parts->boundary = BrickSpans<std::uint32_t>(out->boundary);
    parts->first_patch = out->boundary.patches.first;
    parts->patch_count = out->boundary.patches.count;
    parts->patches = out->boundary.patches.patches;
    return Done{};
}

}  // namespace sonocase::detail
