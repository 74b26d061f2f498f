// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/vessel_parts.h"

#include <algorithm>

#include "formats/volume/tissue.h"

namespace sonocase::pipeline::inline flow {
namespace {

struct Box {
    Int3 low{INT32_MAX, INT32_MAX, INT32_MAX}, high{INT32_MIN, INT32_MIN, INT32_MIN};
    bool empty() const { return low.x > high.x; }
};

Box box_of(const LabelVolume& labels, const std::array<std::uint8_t, 256>& kinds, int kind) {
    Box box;
    const Int3 n = labels.grid.size;
    std::size_t at = 0;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i, ++at) {
                if (kinds[labels.voxels[at]] != kind) continue;
                box.low = {std::min(box.low.x, i), std::min(box.low.y, j), std::min(box.low.z, k)};
                box.high = {std::max(box.high.x, i), std::max(box.high.y, j),
                            std::max(box.high.z, k)};
            }
    return box;
}

// Returns the kind's voxels on a padded box, every `step`-th of the map's.
VesselPart cropped(const LabelVolume& labels,
                   const std::array<std::uint8_t, 256>& kinds,
                   int kind,
                   const Box& box,
                   int step) {
    VesselPart part;
    part.kind = static_cast<FlowKind>(kind - 1);
    part.grid = labels.grid;
    Point3 first;
    for (int axis = 0; axis < 3; ++axis) {
        part.grid.size[axis] = (box.high[axis] - box.low[axis]) / step + 3;
        part.grid.spacing_mm[axis] *= step;
        first[axis] = box.low[axis] - step;
    }
    part.grid.origin_mm = labels.grid.point_from_voxel(first);
    part.label.assign(part.grid.voxel_count(), 0);
    part.beyond.assign(part.grid.voxel_count(), 0);
    const Int3 n = part.grid.size;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i) {
                const int x = box.low.x + step * (i - 1), y = box.low.y + step * (j - 1),
                          z = box.low.z + step * (k - 1);
                const std::size_t to = part.grid.index(i, j, k);
                if (!labels.grid.contains(x, y, z)) {
                    part.beyond[to] = 1;
                    continue;
                }
                const std::uint8_t label = labels.voxels[labels.grid.index(x, y, z)];
                if (kinds[label] == kind) part.label[to] = label;
            }
    return part;
}

// Numbers the pieces from 1. count[i]: voxels of piece i.
std::vector<std::int32_t> pieces_of(const VesselPart& part, std::vector<std::size_t>& count) {
    const Grid& grid = part.grid;
    std::vector<std::int32_t> piece(part.label.size(), 0);
    std::vector<std::size_t> open;
    count.assign(1, 0);
    const std::size_t x = grid.size.x, y = grid.size.y;
    for (std::size_t start = 0; start < piece.size(); ++start) {
        if (part.label[start] == 0 || piece[start] != 0) continue;
        const auto number = static_cast<std::int32_t>(count.size());
        count.push_back(0);
        open.assign(1, start);
        piece[start] = number;
        while (!open.empty()) {
            const std::size_t at = open.back();
            open.pop_back();
            ++count.back();
            // The padding keeps neighbours inside the box.
            for (int q = 0; q < 27; ++q) {
                const std::size_t next = at + q % 3 + x * (q / 3 % 3 + y * (q / 9)) - 1 - x - x * y;
                if (part.label[next] == 0 || piece[next] != 0) continue;
                piece[next] = number;
                open.push_back(next);
            }
        }
    }
    return piece;
}

// Returns one piece on a box of its own.
VesselPart piece_alone(const VesselPart& part,
                       const std::vector<std::int32_t>& piece,
                       std::int32_t number,
                       std::size_t voxels) {
    Box box;
    const Int3 n = part.grid.size;
    std::size_t at = 0;
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i, ++at) {
                if (piece[at] != number) continue;
                box.low = {std::min(box.low.x, i), std::min(box.low.y, j), std::min(box.low.z, k)};
                box.high = {std::max(box.high.x, i), std::max(box.high.y, j),
                            std::max(box.high.z, k)};
            }
    VesselPart out;
    out.kind = part.kind;
    out.voxels = voxels;
    out.grid = part.grid;
    out.grid.size = {box.high.x - box.low.x + 3, box.high.y - box.low.y + 3,
                     box.high.z - box.low.z + 3};
    const Int3 first{box.low.x - 1, box.low.y - 1, box.low.z - 1};
    out.grid.origin_mm = part.grid.point_from_voxel(
        {static_cast<double>(first.x), static_cast<double>(first.y), static_cast<double>(first.z)});
    out.label.assign(out.grid.voxel_count(), 0);
    out.beyond.assign(out.grid.voxel_count(), 0);
    const Int3 m = out.grid.size;
    for (int k = 0; k < m.z; ++k)
        for (int j = 0; j < m.y; ++j)
            for (int i = 0; i < m.x; ++i) {
                const std::size_t to = out.grid.index(i, j, k),
                                  from = part.grid.index(first.x + i, first.y + j, first.z + k);
                if (piece[from] == number) out.label[to] = part.label[from];
                out.beyond[to] = part.beyond[from];
            }
    return out;
}

}  // namespace

std::optional<FlowKind> flow_kind(std::string_view label, std::string_view tissue) {
    const Vessel vessel = vessel_of_label(label);
    if (vessel == Vessel::thrombus || holds_word(label, "heart") || holds_word(label, "atri"))
        return std::nullopt;
    const bool blood = holds_word(tissue, "blood") || holds_word(tissue, "vessel") ||
                       tissue == "vein" || tissue == "artery";
    if (!blood) return std::nullopt;
    if (holds_word(label, "portal")) return FlowKind::portal;
    return vessel == Vessel::vein || tissue == "vein" ? FlowKind::vein : FlowKind::artery;
}

std::array<std::uint8_t, 256> flow_kinds(const std::vector<Label>& palette) {
    std::array<std::uint8_t, 256> kinds{};
    for (std::size_t i = 1; i < palette.size() && i < kinds.size(); ++i)
        if (const auto kind = flow_kind(palette[i].name, palette[i].tissue))
            kinds[i] = static_cast<std::uint8_t>(1 + static_cast<int>(*kind));
    return kinds;
}

std::vector<VesselPart> vessel_parts(const LabelVolume& labels,
                                     double min_ml,
                                     std::size_t max_voxels) {
    const auto kinds = flow_kinds(labels.labels);
    std::vector<VesselPart> out;
    for (int kind = 1; kind <= 3; ++kind) {
        const Box box = box_of(labels, kinds, kind);
        if (box.empty()) continue;
        int step = 1;
        const auto size = [&](int axis) {
            return static_cast<std::size_t>((box.high[axis] - box.low[axis]) / step + 3);
        };
        while (size(0) * size(1) * size(2) > max_voxels) ++step;
        const VesselPart all = cropped(labels, kinds, kind, box, step);
        std::vector<std::size_t> count;
        const auto piece = pieces_of(all, count);
        const double voxel_ml = all.grid.voxel_volume_mm3() / 1000;
        for (std::size_t number = 1; number < count.size(); ++number) {
            if (static_cast<double>(count[number]) * voxel_ml < min_ml) continue;
            out.push_back(
                piece_alone(all, piece, static_cast<std::int32_t>(number), count[number]));
        }
    }
    std::stable_sort(out.begin(), out.end(), [](const VesselPart& a, const VesselPart& b) {
        return static_cast<double>(a.voxels) * a.grid.voxel_volume_mm3() >
               static_cast<double>(b.voxels) * b.grid.voxel_volume_mm3();
    });
    return out;
}

}  // namespace sonocase::pipeline::inline flow
