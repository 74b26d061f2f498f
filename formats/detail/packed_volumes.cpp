#include "formats/detail/packed_volumes.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <numeric>
#include <vector>

#include "formats/boundary_record.h"
#include "formats/detail/bundle_parts.h"
#include "formats/detail/run_jobs.h"
#include "formats/surface_patch.h"

namespace sonocase::detail {
namespace {

// What a brick of `vox.kind` holds: its labels in bits 0 and 1, its number of patches in bits 2 to 4,
// and in bit 5 whether 64 words correct what they say.
enum LabelKind : unsigned { kAsBefore = 0, kOneLabel = 1, kMixedLabels = 2, kSidesOfPatch = 3 };
constexpr unsigned kCorrected = 32, kKinds = 64;
unsigned label_kind(std::uint8_t kind) {
    return kind & 3u;
}
std::size_t patch_count(std::uint8_t kind) {
    return kind >> 2 & 7u;
}
bool corrected(std::uint8_t kind) {
    return (kind & kCorrected) != 0;
}
bool has_records(std::uint8_t kind) {
    return kind >> 2 != 0;
}
// And of `ofs.kind`, for the echo offsets.
enum OffsetKind : unsigned { kOffsetAsBefore = 0, kOneOffset = 1, kMixedOffsets = 2, kCells = 3 };

template <class T>
void brick_values(const BrickVolume<T>& volume, std::size_t brick, T* out) {
    const std::uint32_t entry = volume.table[brick];
    if (entry & kUniformBrick) {
        std::fill(out, out + kBrickVoxels, volume.uniform[entry & ~kUniformBrick]);
    } else {
        std::copy_n(volume.pool.begin() + static_cast<std::ptrdiff_t>(entry) * kBrickVoxels,
                    kBrickVoxels, out);
    }
}

template <class T>
bool all_alike(const T* values) {
    return std::all_of(values, values + kBrickVoxels, [&](T v) { return v == values[0]; });
}

std::size_t layer_bricks(Int3 bricks) {
    return static_cast<std::size_t>(bricks.x) * static_cast<std::size_t>(bricks.y);
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
    to.insert(to.end(), from.begin(), from.end());
}

// --- coefficients ---

// The patches of one layer of bricks, for guessing at the next one from its neighbours.
class PatchRows {
  public:
    explicit PatchRows(Int3 bricks) : width_(static_cast<std::size_t>(bricks.x)) {
        first_.assign(layer_bricks(bricks) + 1, 0);
    }
    // Bricks come in order; every brick of the layer is told, with its patches added before.
    std::vector<SurfacePatch> patches;
    void close(std::size_t brick) { first_[brick + 1] = patches.size(); }

    // Of the brick to the left and of the one in front, where they part the same labels.
    std::array<std::int16_t, kPatchCoefficients> guess(std::size_t brick,
                                                       const SurfacePatch& patch) const {
        SurfacePatch found[2];
        int count = 0;
        if (brick % width_ != 0) count += find(brick - 1, patch, 0, &found[count]);
        if (brick >= width_) count += find(brick - width_, patch, 1, &found[count]);
        if (count == 2) {
            for (std::size_t i = 0; i < kPatchCoefficients; ++i)
                found[0].c[i] = static_cast<std::int16_t>((found[0].c[i] + found[1].c[i]) >> 1);
        }
        return found[0].c;
    }

  private:
    int find(std::size_t brick, const SurfacePatch& patch, int axis, SurfacePatch* out) const {
        for (std::size_t p = first_[brick]; p < first_[brick + 1]; ++p) {
            if (patches[p].low != patch.low || patches[p].high != patch.high) continue;
            *out = continued(patches[p], axis);
            return 1;
        }
        return 0;
    }
    std::size_t width_;
    std::vector<std::size_t> first_;  // # bricks of the layer + 1
};

// Small numbers of either sign as small numbers.
std::uint16_t folded(std::int16_t v) {
    return static_cast<std::uint16_t>(v < 0 ? -2 * v - 1 : 2 * v);
}
std::int16_t unfolded(std::uint16_t v) {
    return static_cast<std::int16_t>(v & 1 ? -(v / 2) - 1 : v / 2);
}

// --- labels and records ---

struct SurfaceStreams {
    std::vector<std::uint8_t> kind, one, mix, pair;
    std::array<std::vector<std::uint16_t>, kPatchCoefficients> coefficient;
    std::array<std::vector<std::uint8_t>, 4> record;  // the bytes of each word apart
};

// The bytes of what is less what was guessed, each alone.
void add_corrections(const BrickRecords& records, const BrickRecords& guess, SurfaceStreams* out) {
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        for (std::size_t b = 0; b < 4; ++b) {
            out->record[b].push_back(
                static_cast<std::uint8_t>((records[v] >> 8 * b) - (guess[v] >> 8 * b)));
        }
    }
}

SurfaceStreams packed_layer(const BrickVolume<std::uint8_t>& labels,
                            const BrickVolume<std::uint32_t>& boundary,
                            int reach_steps,
                            int layer) {
    SurfaceStreams out;
    const Int3 bricks = brick_count(labels.size);
    const std::size_t count = layer_bricks(bricks);
    PatchRows rows(bricks);
    std::uint8_t before = 0;
    for (std::size_t b = 0; b < count; ++b) {
        const std::size_t brick = static_cast<std::size_t>(layer) * count + b;
        BrickLabels label;
        BrickRecords record;
        brick_values(labels, brick, label.data());
        const bool uniform = all_alike(label.data());
        bool none = true;
        if (!boundary.table.empty()) {
            brick_values(boundary, brick, record.data());
            none = std::all_of(record.begin(), record.end(),
                               [](std::uint32_t r) { return r == kNoBoundary; });
        }
        unsigned kind = 0;
        bool sides = false;
        std::vector<SurfacePatch> patches;
        BrickRecords guess;
        if (!none) {
            patches = find_patches(label, record, reach_steps);
            if (patches.empty()) {
                kind = kCorrected;
                patches = fit_patches(label, record);
            }
            records_from_patches(patches, label.data(), reach_steps, guess.data());
            if (patches.size() == 1 && !uniform) {
                BrickLabels by_side;
                labels_from_patch(patches[0], by_side.data());
                sides = by_side == label;
            }
        }
        const unsigned labels_as = sides      ? kSidesOfPatch
                                   : !uniform ? kMixedLabels
                                   : label[0] == before ? kAsBefore
                                                        : kOneLabel;
        if (labels_as == kOneLabel) out.one.push_back(before = label[0]);
        if (labels_as == kMixedLabels) out.mix.insert(out.mix.end(), label.begin(), label.end());
        kind |= labels_as | static_cast<unsigned>(patches.size()) << 2;
        out.kind.push_back(static_cast<std::uint8_t>(kind));
        for (const SurfacePatch& patch : patches) {
            out.pair.push_back(patch.low);
            out.pair.push_back(patch.high);
            const auto near = rows.guess(b, patch);
            for (std::size_t i = 0; i < kPatchCoefficients; ++i) {
                out.coefficient[i].push_back(
                    folded(static_cast<std::int16_t>(patch.c[i] - near[i])));
            }
        }
        append(rows.patches, patches);
        if ((kind & kCorrected) != 0) add_corrections(record, guess, &out);
        rows.close(b);
    }
    return out;
}

void add_surfaces(ChunkWriter& writer,
                  const BrickVolume<std::uint8_t>& labels,
                  const BrickVolume<std::uint32_t>& boundary,
                  int reach_steps) {
    const int layers = brick_count(labels.size).z;
    std::vector<SurfaceStreams> parts(labels.table.empty() ? 0 : static_cast<std::size_t>(layers));
    run_jobs(parts.size(), 0, [&](std::size_t k) {
        parts[k] = packed_layer(labels, boundary, reach_steps, static_cast<int>(k));
    });
    std::vector<std::uint8_t> kind, one, mix, pair, low, high, record;
    for (SurfaceStreams& part : parts) {
        append(kind, part.kind);
        append(one, part.one);
        append(mix, part.mix);
        append(pair, part.pair);
    }
    // Each coefficient, and each byte of the words, apart: they are distributed alike.
    for (std::size_t i = 0; i < kPatchCoefficients; ++i) {
        for (const SurfaceStreams& part : parts) {
            for (const std::uint16_t v : part.coefficient[i]) {
                low.push_back(static_cast<std::uint8_t>(v));
                high.push_back(static_cast<std::uint8_t>(v >> 8));
            }
        }
    }
    for (std::size_t b = 0; b < 4; ++b) {
        for (const SurfaceStreams& part : parts) append(record, part.record[b]);
    }
    writer.add("vox.kind", true, std::move(kind));
    writer.add("vox.one", true, std::move(one));
    writer.add("vox.mix", true, std::move(mix));
    writer.add("vox.pair", true, std::move(pair));
    writer.add("vox.low", true, std::move(low));
    writer.add("vox.high", true, std::move(high));
    writer.add("vox.rec", true, std::move(record));
}

// Where a layer's part of each stream begins, and its part of each pool.
struct SurfaceStarts {
    std::size_t one = 0, mix = 0, patch = 0, record = 0;  // labels, bricks, patches, bricks
    std::size_t label_pool = 0, record_pool = 0;          // bricks
};

SurfaceStarts operator+(SurfaceStarts s, std::uint8_t kind) {
    s.one += label_kind(kind) == kOneLabel;
    s.mix += label_kind(kind) == kMixedLabels;
    s.patch += patch_count(kind);
    s.record += corrected(kind);
    s.label_pool += label_kind(kind) >= kMixedLabels;
    s.record_pool += has_records(kind);
    return s;
}

struct PackedSurfaces {
    std::vector<std::uint8_t> kind, one, mix, pair, low, high, record;
};

// Fills one layer of the tables and the pools. False: a record's label is beyond the palette.
bool unpack_layer(const PackedSurfaces& in,
                  const SurfaceStarts& start,
                  const SurfaceStarts& total,
                  const std::array<std::uint32_t, 256>& uniform_of_label,
                  int reach_steps,
                  std::size_t palette,
                  int layer,
                  VoxelVolumes* out) {
    bool good = true;
    const Int3 bricks = brick_count(out->labels.size);
    const std::size_t count = layer_bricks(bricks);
    SurfaceStarts at = start;
    PatchRows rows(bricks);
    std::uint8_t before = 0;
    for (std::size_t b = 0; b < count; ++b) {
        const std::size_t brick = static_cast<std::size_t>(layer) * count + b;
        const std::uint8_t kind = in.kind[brick];
        const unsigned labels_as = label_kind(kind);
        const std::size_t own_patches = patch_count(kind);
        const std::size_t first_patch = rows.patches.size();
        for (std::size_t p = at.patch; p < at.patch + own_patches; ++p) {
            SurfacePatch patch;
            patch.low = in.pair[2 * p];
            patch.high = in.pair[2 * p + 1];
            const auto guess = rows.guess(b, patch);
            for (std::size_t i = 0; i < kPatchCoefficients; ++i) {
                const std::size_t from = i * total.patch + p;
                const std::uint16_t v =
                    static_cast<std::uint16_t>(in.low[from] | in.high[from] << 8);
                patch.c[i] = static_cast<std::int16_t>(guess[i] + unfolded(v));
            }
            rows.patches.push_back(patch);
        }
        rows.close(b);
        const std::span<const SurfacePatch> patches{rows.patches.data() + first_patch, own_patches};

        BrickLabels alike;
        const std::uint8_t* label = alike.data();
        if (labels_as < kMixedLabels) {
            if (labels_as == kOneLabel) before = in.one[at.one];
            out->labels.table[brick] = kUniformBrick | uniform_of_label[before];
            alike.fill(before);
        } else {
            std::uint8_t* to = out->labels.pool.data() + at.label_pool * kBrickVoxels;
            if (labels_as == kMixedLabels) {
                std::memcpy(to, in.mix.data() + at.mix * kBrickVoxels, kBrickVoxels);
            } else {
                labels_from_patch(patches[0], to);
            }
            out->labels.table[brick] = static_cast<std::uint32_t>(at.label_pool);
            label = to;
        }
        if (has_records(kind)) {
            std::uint32_t* to = out->boundary.pool.data() + at.record_pool * kBrickVoxels;
            out->boundary.table[brick] = static_cast<std::uint32_t>(at.record_pool);
            records_from_patches(patches, label, reach_steps, to);
            if (corrected(kind)) {
                const std::size_t plane = total.record * kBrickVoxels;
                const std::uint8_t* from = in.record.data() + at.record * kBrickVoxels;
                for (std::size_t v = 0; v < kBrickVoxels; ++v) {
                    std::uint32_t word = 0;
                    for (std::size_t q = 0; q < 4; ++q) {
                        const std::uint32_t byte = (to[v] >> 8 * q) + from[q * plane + v];
                        word |= (byte & 0xFFu) << 8 * q;
                    }
                    good &= (word & 0xFFu) < palette || word == kNoBoundary;
                    to[v] = word;
                }
            }
        } else if (!out->boundary.table.empty()) {
            out->boundary.table[brick] = kUniformBrick;
        }
        at = at + kind;
    }
    return good;
}

Status read_surfaces(const ChunkReader& reader,
                     bool with_records,
                     int reach_steps,
                     std::size_t palette,
                     int threads,
                     VoxelVolumes* out) {
    const Int3 bricks = brick_count(out->labels.size);
    const std::size_t layer = layer_bricks(bricks), layers = static_cast<std::size_t>(bricks.z);
    PackedSurfaces in;
    const auto get = [&](const char* type, std::size_t size, std::vector<std::uint8_t>* to) {
        auto bytes = reader.read_array<std::uint8_t>(type, size, threads);
        if (!bytes) return Status(bytes.error());
        *to = std::move(*bytes);
        return Status(Done{});
    };
    if (Status s = get("vox.kind", layer * layers, &in.kind); !s) return s;
    std::vector<SurfaceStarts> starts(layers + 1);
    bool good = true, any_without = false;
    for (std::size_t k = 0; k < layers; ++k) {
        SurfaceStarts at = starts[k];
        for (std::size_t b = k * layer; b < (k + 1) * layer; ++b) {
            const std::uint8_t kind = in.kind[b];
            good &= kind < kKinds && patch_count(kind) <= kMaxPatches &&
                    (label_kind(kind) != kSidesOfPatch || patch_count(kind) == 1);
            any_without |= !has_records(kind);
            at = at + kind;
        }
        starts[k + 1] = at;
    }
    const SurfaceStarts& total = starts[layers];
    good &= with_records || total.record_pool == 0;
    if (!good) return reader.fault("a brick of 'vox.kind' is of no known kind", "make it again");
    for (const auto& [type, size, to] :
         {std::tuple{"vox.one", total.one, &in.one},
          std::tuple{"vox.mix", total.mix * kBrickVoxels, &in.mix},
          std::tuple{"vox.pair", 2 * total.patch, &in.pair},
          std::tuple{"vox.low", kPatchCoefficients * total.patch, &in.low},
          std::tuple{"vox.high", kPatchCoefficients * total.patch, &in.high},
          std::tuple{"vox.rec", 4 * total.record * kBrickVoxels, &in.record}}) {
        if (Status s = get(type, size, to); !s) return s;
    }
    const auto in_palette = [&](const std::vector<std::uint8_t>& values) {
        return std::all_of(values.begin(), values.end(),
                           [&](std::uint8_t v) { return v < palette; });
    };
    if (!in_palette(in.one) || !in_palette(in.mix))
        return reader.fault("a voxel has a label beyond the palette", "make the file again");
    bool ordered = true;
    for (std::size_t p = 0; p < total.patch; ++p) ordered &= in.pair[2 * p] < in.pair[2 * p + 1];
    if (!ordered) return reader.fault("a surface patch parts no two labels", "make it again");
    const Error beyond = reader.fault("a boundary record has a label beyond the palette",
                                      "make the file again");
    if (!in_palette(in.pair)) return beyond;

    // The values of uniform bricks, in the order in which they appear.
    std::array<std::uint32_t, 256> uniform_of_label{};
    std::array<bool, 256> met{};
    std::size_t next = 0;
    for (std::size_t k = 0; k < layers; ++k) {
        std::uint8_t before = 0;
        for (std::size_t b = k * layer; b < (k + 1) * layer; ++b) {
            const unsigned label = label_kind(in.kind[b]);
            if (label >= kMixedLabels) continue;
            if (label == kOneLabel) before = in.one[next++];
            if (met[before]) continue;
            met[before] = true;
            uniform_of_label[before] = static_cast<std::uint32_t>(out->labels.uniform.size());
            out->labels.uniform.push_back(before);
        }
    }
    out->labels.table.resize(in.kind.size());
    out->labels.pool.resize(total.label_pool * kBrickVoxels);
    if (with_records) {
        out->boundary.table.resize(in.kind.size());
        out->boundary.pool.resize(total.record_pool * kBrickVoxels);
        if (any_without) out->boundary.uniform = {kNoBoundary};
    }
    std::atomic<bool> all_good{true};
    run_jobs(layers, threads, [&](std::size_t k) {
        if (!unpack_layer(in, starts[k], total, uniform_of_label, reach_steps, palette,
                          static_cast<int>(k), out))
            all_good = false;
    });
    if (!all_good) return beyond;
    return Done{};
}

// --- echo offsets ---

// A brick is `edge` values an edge here: 4 voxels, or 2 cells of 2 x 2 x 2 alike voxels.
// Each value is told as its difference from a guess by those to the left, in front and below;
// across the brick's left and front faces too, never across layers, which are unpacked side by side.
class OffsetGuess {
  public:
    // left, front: the 64 values of those bricks, or null at the border.
    OffsetGuess(int edge, const std::int8_t* left, const std::int8_t* front) : edge_(edge) {
        const int step = kBrickEdge / edge;
        for (int k = 0; k < edge; ++k) {
            for (int j = 0; j < edge; ++j) {
                const auto face = static_cast<std::size_t>(step * (kBrickEdge * j + 16 * k));
                left_[at(j, k)] = left ? left[face + kBrickEdge - 1] : 0;
                front_[at(j, k)] =
                    front ? front[static_cast<std::size_t>(step * (j + 16 * k)) + 12] : 0;
            }
        }
    }
    // values: of the brick, edge^3, those before (i, j, k) known.
    std::uint8_t operator()(const std::int8_t* values, int i, int j, int k) const {
        const auto value = [&](int x, int y, int z) -> int {
            return values[static_cast<std::size_t>(x + edge_ * (y + edge_ * z))];
        };
        const int a = i > 0 ? value(i - 1, j, k) : left_[at(j, k)];
        const int b = j > 0 ? value(i, j - 1, k) : front_[at(i, k)];
        const int ab = i > 0   ? (j > 0 ? value(i - 1, j - 1, k) : front_[at(i - 1, k)])
                       : j > 0 ? left_[at(j - 1, k)]
                               : (a + b) / 2;
        // Of three values the middle one: a, b, and the plane through them.
        const int plane = std::max(std::min(a, b), std::min(std::max(a, b), a + b - ab));
        const int guess = k == 0 ? plane : (plane + value(i, j, k - 1)) >> 1;
        // Values of one label are whole dB apart.
        return static_cast<std::uint8_t>(a + 4 * ((guess - a + 2) >> 2));
    }

  private:
    static std::size_t at(int u, int v) { return static_cast<std::size_t>(u + kBrickEdge * v); }
    int edge_;
    std::array<std::int8_t, 16> left_{}, front_{};
};

// Whether the brick is 8 cells of alike voxels, and the cells.
bool cells_of(const std::int8_t* values, std::int8_t* cells) {
    for (std::size_t v = 0; v < kBrickVoxels; ++v) {
        const std::size_t i = v % 4, j = v / 4 % 4, k = v / 16;
        const std::size_t first = (i & 2u) + 4 * (j & 2u) + 16 * (k & 2u);
        if (values[v] != values[first]) return false;
        cells[i / 2 + 2 * (j / 2) + 4 * (k / 2)] = values[first];
    }
    return true;
}

struct OffsetStreams {
    std::vector<std::uint8_t> kind, one, mix;
};

OffsetStreams packed_offsets(const BrickVolume<std::int8_t>& volume, int layer) {
    OffsetStreams out;
    const Int3 bricks = brick_count(volume.size);
    const std::size_t count = layer_bricks(bricks), width = static_cast<std::size_t>(bricks.x);
    using Values = std::array<std::int8_t, kBrickVoxels>;
    std::vector<Values> row(width);  // the bricks in front, then this row's
    std::int8_t before = 0;
    for (std::size_t b = 0; b < count; ++b) {
        Values values;
        std::array<std::int8_t, 8> cells;
        brick_values(volume, static_cast<std::size_t>(layer) * count + b, values.data());
        if (all_alike(values.data())) {
            out.kind.push_back(values[0] == before ? kOffsetAsBefore : kOneOffset);
            if (values[0] != before) out.one.push_back(static_cast<std::uint8_t>(values[0]));
            before = values[0];
        } else {
            const bool in_cells = cells_of(values.data(), cells.data());
            out.kind.push_back(in_cells ? kCells : kMixedOffsets);
            const int edge = in_cells ? 2 : kBrickEdge;
            const std::int8_t* from = in_cells ? cells.data() : values.data();
            const OffsetGuess guess(edge, b % width != 0 ? row[b % width - 1].data() : nullptr,
                                    b >= width ? row[b % width].data() : nullptr);
            for (int v = 0; v < edge * edge * edge; ++v) {
                out.mix.push_back(static_cast<std::uint8_t>(
                    from[v] - guess(from, v % edge, v / edge % edge, v / edge / edge)));
            }
        }
        row[b % width] = values;
    }
    return out;
}

void add_offsets(ChunkWriter& writer, const BrickVolume<std::int8_t>& volume) {
    const int layers = brick_count(volume.size).z;
    std::vector<OffsetStreams> parts(static_cast<std::size_t>(layers));
    run_jobs(parts.size(), 0,
             [&](std::size_t k) { parts[k] = packed_offsets(volume, static_cast<int>(k)); });
    std::vector<std::uint8_t> kind, one, mix;
    for (const OffsetStreams& part : parts) {
        append(kind, part.kind);
        append(one, part.one);
        append(mix, part.mix);
    }
    writer.add("ofs.kind", false, std::move(kind));
    writer.add("ofs.one", false, std::move(one));
    writer.add("ofs.mix", false, std::move(mix));
}

struct OffsetStarts {
    std::size_t one = 0, mix = 0, pool = 0;  // values, bytes, bricks
};

void unpack_offsets(const std::vector<std::uint8_t>& kinds,
                    const std::vector<std::uint8_t>& one,
                    const std::vector<std::uint8_t>& mix,
                    OffsetStarts at,
                    const std::array<std::uint32_t, 256>& uniform_of_value,
                    int layer,
                    BrickVolume<std::int8_t>* out) {
    const Int3 bricks = brick_count(out->size);
    const std::size_t count = layer_bricks(bricks), width = static_cast<std::size_t>(bricks.x);
    std::array<std::int8_t, kBrickVoxels> left, front, cells;
    std::uint8_t before = 0;
    for (std::size_t b = 0; b < count; ++b) {
        const std::size_t brick = static_cast<std::size_t>(layer) * count + b;
        const unsigned kind = kinds[brick];
        if (kind <= kOneOffset) {
            if (kind == kOneOffset) before = one[at.one++];
            out->table[brick] = kUniformBrick | uniform_of_value[before];
            continue;
        }
        if (b % width != 0) brick_values(*out, brick - 1, left.data());
        if (b >= width) brick_values(*out, brick - width, front.data());
        const int edge = kind == kCells ? 2 : kBrickEdge;
        const OffsetGuess guess(edge, b % width != 0 ? left.data() : nullptr,
                                b >= width ? front.data() : nullptr);
        std::int8_t* to = out->pool.data() + at.pool * kBrickVoxels;
        std::int8_t* values = kind == kCells ? cells.data() : to;
        for (int k = 0, v = 0; k < edge; ++k) {
            for (int j = 0; j < edge; ++j) {
                for (int i = 0; i < edge; ++i, ++v)
                    values[v] = static_cast<std::int8_t>(mix[at.mix++] + guess(values, i, j, k));
            }
        }
        if (kind == kCells) {
            for (std::size_t v = 0; v < kBrickVoxels; ++v)
                to[v] = cells[v % 4 / 2 + 2 * (v / 4 % 4 / 2) + 4 * (v / 32)];
        }
        // What follows an uneven brick is told from the last uniform one.
        out->table[brick] = static_cast<std::uint32_t>(at.pool++);
    }
}

Status read_offsets(const ChunkReader& reader, int threads, BrickVolume<std::int8_t>* out) {
    const Int3 bricks = brick_count(out->size);
    const std::size_t layer = layer_bricks(bricks), layers = static_cast<std::size_t>(bricks.z);
    const auto kind = reader.read_array<std::uint8_t>("ofs.kind", layer * layers, threads);
    if (!kind) return kind.error();
    std::vector<OffsetStarts> starts(layers + 1);
    for (std::size_t k = 0; k < layers; ++k) {
        OffsetStarts at = starts[k];
        for (std::size_t b = k * layer; b < (k + 1) * layer; ++b) {
            const std::uint8_t v = (*kind)[b];
            if (v > kCells)
                return reader.fault("a brick of 'ofs.kind' is of no known kind", "make it again");
            at.one += v == kOneOffset;
            at.mix += v == kCells ? 8 : v == kMixedOffsets ? kBrickVoxels : 0;
            at.pool += v >= kMixedOffsets;
        }
        starts[k + 1] = at;
    }
    const auto one = reader.read_array<std::uint8_t>("ofs.one", starts[layers].one, threads);
    if (!one) return one.error();
    const auto mix = reader.read_array<std::uint8_t>("ofs.mix", starts[layers].mix, threads);
    if (!mix) return mix.error();
    std::array<std::uint32_t, 256> uniform_of_value{};
    std::array<bool, 256> met{};
    std::size_t next = 0;
    for (std::size_t k = 0; k < layers; ++k) {
        std::uint8_t before = 0;
        for (std::size_t b = k * layer; b < (k + 1) * layer; ++b) {
            if ((*kind)[b] > kOneOffset) continue;
            if ((*kind)[b] == kOneOffset) before = (*one)[next++];
            if (met[before]) continue;
            met[before] = true;
            uniform_of_value[before] = static_cast<std::uint32_t>(out->uniform.size());
            out->uniform.push_back(static_cast<std::int8_t>(before));
        }
    }
    out->table.resize(kind->size());
    out->pool.resize(starts[layers].pool * kBrickVoxels);
    run_jobs(layers, threads, [&](std::size_t k) {
        unpack_offsets(*kind, *one, *mix, starts[k], uniform_of_value, static_cast<int>(k), out);
    });
    return Done{};
}

// The largest distance of any record, in 1/48 voxel.
int reach_of(const BrickVolume<std::uint32_t>& boundary) {
    std::uint32_t most = 0;
    const auto look = [&](const std::vector<std::uint32_t>& values) {
        for (const std::uint32_t v : values) {
            const std::uint32_t steps = v >> 8 & 0xFFu;
            if (steps < 128) most = std::max(most, steps);
        }
    };
    look(boundary.uniform);
    look(boundary.pool);
    return static_cast<int>(most);
}

template <class T, class Good>
bool all_values(const BrickVolume<T>& bricks, Good good) {
    return std::all_of(bricks.uniform.begin(), bricks.uniform.end(), good) &&
           std::all_of(bricks.pool.begin(), bricks.pool.end(), good);
}

// Chunks lab.*, bnd.* and echo.*: table, uniform values and pool as they are in memory.
Result<VoxelVolumes> read_first_layout(const ChunkReader& reader,
                                       bool with_records,
                                       bool with_offsets,
                                       Int3 size,
                                       std::size_t palette,
                                       int threads) {
    VoxelVolumes out;
    auto labels = read_bricks<std::uint8_t>(reader, "lab", size, threads);
    if (!labels) return labels.error();
    out.labels = std::move(*labels);
    if (!all_values(out.labels, [&](std::uint8_t v) { return v < palette; }))
        return reader.fault("a voxel has a label beyond the palette", "make the file again");
    if (with_offsets) {
        auto echo = read_bricks<std::int8_t>(reader, "echo", size, threads);
        if (!echo) return echo.error();
        out.echo_offset = std::move(*echo);
    }
    if (with_records) {
        auto boundary = read_bricks<std::uint32_t>(reader, "bnd", size, threads);
        if (!boundary) return boundary.error();
        out.boundary = std::move(*boundary);
        if (!all_values(out.boundary, [&](std::uint32_t v) {
                return (v & 0xFFu) < palette || v == kNoBoundary;
            })) {
            return reader.fault("a boundary record has a label beyond the palette",
                                "make the file again");
        }
    }
    return out;
}

}  // namespace

void add_volumes(ChunkWriter& writer,
                 Json& manifest,
                 const BrickVolume<std::uint8_t>& labels,
                 const BrickVolume<std::uint32_t>& boundary,
                 const BrickVolume<std::int8_t>& echo_offset) {
    const int reach_steps = reach_of(boundary);
    manifest["echo_offset"] = !echo_offset.table.empty();
    manifest["boundary"] = !boundary.table.empty();
    manifest["record_reach"] = reach_steps;
    add_manifest(writer, manifest);
    add_surfaces(writer, labels, boundary, reach_steps);
    if (!echo_offset.table.empty()) add_offsets(writer, echo_offset);
}

Result<VoxelVolumes> read_volumes(const ChunkReader& reader,
                                  JsonObject& manifest,
                                  Int3 size,
                                  std::size_t palette,
                                  int threads) {
    const bool with_offsets = manifest.flag_or("echo_offset", false);
    const bool with_records = manifest.flag_or("boundary", false);
    if (!reader.has("vox.kind"))
        return read_first_layout(reader, with_records, with_offsets, size, palette, threads);
    const auto reach = static_cast<int>(manifest.integer("record_reach", 0, 127));
    VoxelVolumes out;
    out.labels.size = size;
    if (with_records) out.boundary.size = size;
    if (Status s = read_surfaces(reader, with_records, reach, palette, threads, &out); !s)
        return s.error();
    if (with_offsets) {
        out.echo_offset.size = size;
        if (Status s = read_offsets(reader, threads, &out.echo_offset); !s) return s.error();
    }
    return out;
}

}  // namespace sonocase::detail
