// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/surface_codec.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <tuple>
#include <vector>

#include "formats/base/jobs.h"
#include "formats/base/memory.h"
#include "formats/bundle/codec/brick_kinds.h"
#include "formats/volume/boundary_record.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::detail {
namespace {

// The patches of one layer of bricks, to predict the next patch from its neighbours.
class PatchRows {
  public:
    // width, bricks: of a row and of the layer.
    PatchRows(std::size_t width, std::size_t bricks) : width_(width), first_(bricks + 1, 0) {}
    // Call it for every brick of the layer in order, with the number of patches that the layer has
    // up to the end of that brick.
    void close(std::size_t brick, std::size_t patches) {
        first_[brick + 1] = static_cast<std::uint32_t>(patches);
    }

    // Predicts from the patches of the bricks to the left and in front that separate the same
    // labels as `patch`. known: the layer's patches so far.
    std::array<std::int16_t, kPatchCoefficients> prediction(const SurfacePatch* known,
                                                            std::size_t brick,
                                                            const SurfacePatch& patch) const {
        SurfacePatch found[2]{};
        int count = 0;
        if (brick % width_ != 0) count += find(known, brick - 1, patch, 0, &found[count]);
        if (brick >= width_) count += find(known, brick - width_, patch, 1, &found[count]);
        if (count == 2) {
            for (std::size_t i = 0; i < kPatchCoefficients; ++i)
                found[0].c[i] = static_cast<std::int16_t>((found[0].c[i] + found[1].c[i]) >> 1);
        }
        return found[0].c;
    }

  private:
    int find(const SurfacePatch* patches,
             std::size_t brick,
             const SurfacePatch& patch,
             int axis,
             SurfacePatch* out) const {
        for (std::size_t p = first_[brick]; p < first_[brick + 1]; ++p) {
            if (patches[p].low != patch.low || patches[p].high != patch.high) continue;
            *out = continued(patches[p], axis);
            return 1;
        }
        return 0;
    }
    std::size_t width_;
    std::vector<std::uint32_t> first_;  // # bricks of the layer + 1
};

// Files hold coefficients in units of BrickPatches::step.
SurfacePatch in_steps(SurfacePatch patch, int step) {
    for (std::int16_t& c : patch.c) c = static_cast<std::int16_t>(c / step);
    return patch;
}
SurfacePatch from_steps(SurfacePatch patch, int step) {
    for (std::int16_t& c : patch.c) c = static_cast<std::int16_t>(c * step);
    return patch;
}

// Zigzag code: small numbers of either sign become small numbers without one.
std::uint16_t folded(std::int16_t v) {
    return static_cast<std::uint16_t>(v < 0 ? -2 * v - 1 : 2 * v);
}
std::int16_t unfolded(std::uint16_t v) {
    return static_cast<std::int16_t>(v & 1 ? -(v / 2) - 1 : v / 2);
}

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

// What a file holds in place of a brick's boundary records.
struct PatchedBrick {
    std::vector<SurfacePatch> patches;
    bool is_exact = true;       // the patches give exactly the records
    bool gives_labels = false;  // there is one patch, and each voxel has the label of its side
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

// Appends where the records of a block's bricks differ from what their patches give: one bit per
// voxel, then the difference of each byte of those records.
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

bool is_known(unsigned kind) {
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

bool all_below(const Bytes& values, std::size_t limit) {
    std::uint8_t highest = 0;
    for (const std::uint8_t v : values) highest = std::max(highest, v);
    return values.empty() || highest < limit;
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
            good &= is_known(kind);
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
    if (!all_below(in.one, parts->palette) || !all_below(in.mix, parts->palette))
        return reader.fault("a voxel has a label beyond the palette", "make the file again");
    bool ordered = true;
    for (std::size_t p = 0; p < total.patch; ++p) ordered &= in.pair[2 * p] < in.pair[2 * p + 1];
    if (!ordered)
        return reader.fault("a surface patch does not separate two labels", "make it again");
    if (!all_below(in.pair, parts->palette)) {
        return reader.fault("a boundary record has a label beyond the palette",
                            "make the file again");
    }
    if (with_records) {
        SONOCASE_TRY(auto frames,
                     BlockFrames::open(reader, "vox.fix", parts->grid.count(),
                                       parts->grid.block_bricks() * (8 + 4 * kBrickVoxels)));
        parts->corrections = std::move(frames);
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
