// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/skin/skin_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/base/geometry.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration_skin {

namespace {

// Binary masks on a small grid, and the operations that clean the body.
using Mask = std::vector<std::uint8_t>;  // i fastest; 0 or 1

// One slice of a mask, in place.
struct Slice {
    int width, height;
    std::uint8_t* at;
    std::size_t count() const { return static_cast<std::size_t>(width) * height; }
};

// Voxel offsets of a disc with the given radii, in voxels.
using Disc = std::vector<std::array<int, 2>>;
// Connected parts of a mask (voxels that share a face).
struct Parts {
    std::vector<std::int32_t> number;  // # voxels; 0 outside the mask, parts from 1
    std::vector<long> size{0};         // voxels of each part, by number
    std::int32_t largest() const;      // 0 if there is none
};
// Sets every voxel that no path through zeros joins to the slice's border.
void fill_holes(Slice slice) {
    std::vector<int> stack;
    Mask outside(slice.count(), 0);
    const auto push = [&](int i, int j) {
        const int n = i + slice.width * j;
        if (slice.at[n] || outside[n]) return;
        outside[n] = 1;
        stack.push_back(n);
    };
    for (int i = 0; i < slice.width; ++i) push(i, 0), push(i, slice.height - 1);
    for (int j = 0; j < slice.height; ++j) push(0, j), push(slice.width - 1, j);
    while (!stack.empty()) {
        const int n = stack.back();
        stack.pop_back();
        const int i = n % slice.width, j = n / slice.width;
        if (i > 0) push(i - 1, j);
        if (i + 1 < slice.width) push(i + 1, j);
        if (j > 0) push(i, j - 1);
        if (j + 1 < slice.height) push(i, j + 1);
    }
    for (std::size_t n = 0; n < slice.count(); ++n) {
        if (!outside[n]) slice.at[n] = 1;
    }
}

Disc disc(double radius_x, double radius_y) {
    Disc offsets;
    const int nx = static_cast<int>(radius_x), ny = static_cast<int>(radius_y);
    for (int j = -ny; j <= ny; ++j) {
        for (int i = -nx; i <= nx; ++i) {
            const double x = radius_x > 0 ? i / radius_x : 0, y = radius_y > 0 ? j / radius_y : 0;
            if (x * x + y * y <= 1 + 1e-9) offsets.push_back({i, j});
        }
    }
    return offsets;
}

// Voxels whose whole disc is set. Outside the slice counts as set, so that a face at which the body
// is cut is not eroded.
Mask eroded(Slice slice, const Disc& offsets) {
    Mask out(slice.count(), 0);
    for (int j = 0; j < slice.height; ++j) {
        for (int i = 0; i < slice.width; ++i) {
            if (!slice.at[i + slice.width * j]) continue;
            bool keep = true;
            for (const auto& o : offsets) {
                const int x = i + o[0], y = j + o[1];
                if (x < 0 || y < 0 || x >= slice.width || y >= slice.height) continue;
                if (!slice.at[x + slice.width * y]) {
                    keep = false;
                    break;
                }
            }
            out[i + slice.width * j] = keep;
        }
    }
    return out;
}

std::int32_t Parts::largest() const {
    std::int32_t best = 0;
    for (std::size_t n = 1; n < size.size(); ++n) {
        if (best == 0 || size[n] > size[best]) {
            best = static_cast<std::int32_t>(n);
        }
    }
    return best;
}

Parts parts_of(const std::uint8_t* mask, Int3 size) {
    Parts parts;
    const int row = size.x, slice = size.x * size.y, total = slice * size.z;
    parts.number.assign(total, 0);
    std::vector<int> stack;
    for (int seed = 0; seed < total; ++seed) {
        if (!mask[seed] || parts.number[seed]) continue;
        const auto label = static_cast<std::int32_t>(parts.size.size());
        long count = 0;
        parts.number[seed] = label;
        stack.push_back(seed);
        while (!stack.empty()) {
            const int n = stack.back();
            stack.pop_back();
            ++count;
            const int i = n % row, j = n % slice / row, k = n / slice;
            const auto visit = [&](bool there, int m) {
                if (!there || !mask[m] || parts.number[m]) return;
                parts.number[m] = label;
                stack.push_back(m);
            };
            visit(i > 0, n - 1);
            visit(i + 1 < size.x, n + 1);
            visit(j > 0, n - row);
            visit(j + 1 < size.y, n + row);
            visit(k > 0, n - slice);
            visit(k + 1 < size.z, n + slice);
        }
        parts.size.push_back(count);
    }
    return parts;
}

// Dilates `seed` by the disc, slice by slice, and keeps what is in `mask`: restores the edge that
// an erosion removed.
void restore_edge(Mask& seed, const Mask& mask, Int3 size, const Disc& offsets) {
    const std::size_t count = static_cast<std::size_t>(size.x) * size.y;
    parallel_for(size.z, 4, [&](std::size_t begin, std::size_t end) {
        Mask grown(count);
        for (std::size_t k = begin; k < end; ++k) {
            std::fill(grown.begin(), grown.end(), std::uint8_t{0});
            std::uint8_t* s = seed.data() + k * count;
            const std::uint8_t* m = mask.data() + k * count;
            for (int j = 0; j < size.y; ++j) {
                for (int i = 0; i < size.x; ++i) {
                    if (!s[i + size.x * j]) continue;
                    for (const auto& o : offsets) {
                        const int x = i + o[0], y = j + o[1];
                        if (x >= 0 && y >= 0 && x < size.x && y < size.y) {
                            grown[x + size.x * y] = 1;
                        }
                    }
                }
            }
            for (std::size_t n = 0; n < count; ++n) s[n] = grown[n] && m[n];
        }
    });
}

// Number of set voxels in each plane across an axis.
std::vector<long> plane_counts(const Mask& mask, Int3 size, int axis) {
    std::vector<long> counts(size[axis], 0);
    std::size_t n = 0;
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i, ++n) {
                if (mask[n]) ++counts[axis == 0 ? i : axis == 1 ? j : k];
            }
        }
    }
    return counts;
}

// Share of labelled voxels in blocks of `factor`; an incomplete last block is dropped.
std::vector<float> averaged(const LabelVolume& labels, Int3 factor, Int3 size) {
    std::vector<float> share(static_cast<std::size_t>(size.x) * size.y * size.z);
    const float scale = 1.0f / static_cast<float>(factor.x * factor.y * factor.z);
    parallel_for(size.z, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<int> row(size.x);
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < size.y; ++j) {
                std::fill(row.begin(), row.end(), 0);
                for (int c = 0; c < factor.z; ++c) {
                    for (int b = 0; b < factor.y; ++b) {
                        const std::uint8_t* v =
                            labels.voxels.data() +
                            labels.grid.index(0, j * factor.y + b, k * factor.z + c);
                        for (int i = 0; i < size.x; ++i) {
                            int n = 0;
                            for (int a = 0; a < factor.x; ++a) n += *v++ != 0;
                            row[i] += n;
                        }
                    }
                }
                float* out = share.data() + static_cast<std::size_t>(size.x) *
                                                (j + static_cast<std::size_t>(size.y) * k);
                for (int i = 0; i < size.x; ++i) {
                    out[i] = scale * static_cast<float>(row[i]);
                }
            }
        }
    });
    return share;
}

// Whether the body is cut at plane `first`, going inwards by `step`. In planes across a round body
// the area grows gradually from zero; at a cut the full area appears at once.
bool is_cut(const std::vector<long>& counts, int first, int step, int axis, double voxel_area_mm2) {
    const int count = static_cast<int>(counts.size());
    if (first + 3 * step < 0 || first + 3 * step >= count) return false;
    const auto at = [&](int n) { return static_cast<double>(counts[n]); };
    if (at(first) * voxel_area_mm2 < 2500) return false;
    // Growth per plane. Flanks are round; a back that lay on a table is nearly flat.
    const double growth = axis == 2 ? 1.6 : axis == 0 ? 1.3 : 1.12;
    return at(first + step) < growth * at(first) &&
           at(first + 2 * step) < growth * at(first + step);
}

// Separable Gaussian; beyond the faces the nearest voxel is repeated.
void smooth(std::vector<float>& field, Int3 size, Vector3 sigma_vx) {
    for (int axis = 0; axis < 3; ++axis) {
        const double sigma = sigma_vx[axis];
        if (sigma < 0.1) continue;
        const int radius = static_cast<int>(std::ceil(3 * sigma));
        std::vector<float> weight(2 * radius + 1);
        double sum = 0;
        for (int n = -radius; n <= radius; ++n) sum += std::exp(-0.5 * n * n / (sigma * sigma));
        for (int n = -radius; n <= radius; ++n) {
            weight[n + radius] = static_cast<float>(std::exp(-0.5 * n * n / (sigma * sigma)) / sum);
        }
        const int length = size[axis];
        const std::size_t stride = axis == 0   ? 1
                                   : axis == 1 ? static_cast<std::size_t>(size.x)
                                               : static_cast<std::size_t>(size.x) * size.y;
        const std::size_t lines = field.size() / static_cast<std::size_t>(length);
        parallel_for(lines, 256, [&](std::size_t begin, std::size_t end) {
            std::vector<float> line(length);
            for (std::size_t l = begin; l < end; ++l) {
                const std::size_t start =
                    l % stride + l / stride * stride * static_cast<std::size_t>(length);
                for (int n = 0; n < length; ++n) {
                    line[n] = field[start + stride * static_cast<std::size_t>(n)];
                }
                for (int n = 0; n < length; ++n) {
                    float v = 0;
                    for (int m = -radius; m <= radius; ++m) {
                        v += weight[m + radius] * line[std::clamp(n + m, 0, length - 1)];
                    }
                    field[start + stride * static_cast<std::size_t>(n)] = v;
                }
            }
        });
    }
}

// Drops the planes before `first` and after `last`.
void crop(Grid& grid, std::vector<float>& field, Mask& mask, Int3 first, Int3 last) {
    const Grid old = grid;
    grid.size = {last.x - first.x + 1, last.y - first.y + 1, last.z - first.z + 1};
    if (grid.size == old.size) return;
    grid.origin_mm = old.point_from_voxel({1.0 * first.x, 1.0 * first.y, 1.0 * first.z});
    std::size_t n = 0;
    for (int k = first.z; k <= last.z; ++k) {
        for (int j = first.y; j <= last.y; ++j) {
            for (int i = first.x; i <= last.x; ++i, ++n) {
                field[n] = field[old.index(i, j, k)];
                mask[n] = mask[old.index(i, j, k)];
            }
        }
    }
    field.resize(n);
    mask.resize(n);
}

// Radius of a round field of view that cuts the body, 0 if none does: many voxels of the body's
// edge then lie on one circle about the middle of the slice.
double round_view_radius(const Mask& mask, const Grid& grid) {
    const double rx = 0.5 * grid.size.x * grid.spacing_mm.x,
                 ry = 0.5 * grid.size.y * grid.spacing_mm.y;
    const double radius = std::min(rx, ry), band = std::max(grid.spacing_mm.x, grid.spacing_mm.y);
    long on_circle = 0, beyond = 0, slices = 0;
    for (int k = 0; k < grid.size.z; ++k) {
        long here = 0;
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                if (!mask[grid.index(i, j, k)]) continue;
                const double r = std::hypot((i + 0.5) * grid.spacing_mm.x - rx,
                                            (j + 0.5) * grid.spacing_mm.y - ry);
                here += r > radius - 1.5 * band && r <= radius;
                beyond += r > radius + 0.5 * band;
            }
        }
        on_circle += here;
        slices += here > 0;
    }
    const double arc_mm =
        slices > 0 ? static_cast<double>(on_circle) * band / 1.5 / static_cast<double>(slices) : 0;
    return beyond == 0 && slices >= 3 && arc_mm > 40 ? radius : 0;
}

// The body's voxels as they are found, step by step.
struct BodyMasks {
    Mask labelled;  // at least half of the voxel carries a label
    Mask filled;    // with closed slices
    Mask loose;     // eroded parts that do not belong to the trunk: arms have one, sheets do not
    Mask trunk;     // what is kept
};

// In each slice, the eroded parts that are not much smaller than the largest; the others are loose.
void split_slices(
    BodyMasks& masks, Mask& core, Int3 size, const Disc& small_disc, double min_part) {
    const std::size_t slice_count = static_cast<std::size_t>(size.x) * size.y;
    parallel_for(size.z, 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const Slice slice{size.x, size.y, masks.filled.data() + k * slice_count};
            fill_holes(slice);
            const Mask small = eroded(slice, small_disc);
            const Parts parts = parts_of(small.data(), {size.x, size.y, 1});
            const std::int32_t largest = parts.largest();
            if (largest == 0) continue;
            const double min_size = min_part * static_cast<double>(parts.size[largest]);
            for (std::size_t n = 0; n < slice_count; ++n) {
                const std::int32_t part = parts.number[n];
                if (part == 0) continue;
                const bool keep = static_cast<double>(parts.size[part]) >= min_size;
                core[k * slice_count + n] = keep;
                masks.loose[k * slice_count + n] = !keep;
            }
        }
    });
}

// Closed slices; then the trunk: of the parts that survive an erosion in each slice, the largest
// connected one in space, with its edge restored.
void find_trunk(BodyMasks& masks,
                Int3 size,
                Vector3 spacing_mm,
                const SkinSurfaceOptions& options) {
    const double rx = 0.5 * options.bridge_mm / spacing_mm.x;
    const double ry = 0.5 * options.bridge_mm / spacing_mm.y;
    masks.filled = masks.labelled;
    masks.loose.assign(masks.labelled.size(), 0);
    Mask core(masks.labelled.size(), 0);
    split_slices(masks, core, size, disc(rx, ry), options.min_part);
    masks.trunk = masks.filled;
    const Parts parts = parts_of(core.data(), size);
    const std::int32_t largest = parts.largest();
    if (largest == 0) return;  // a body that is thinner than the bridges everywhere is kept whole
    for (std::size_t n = 0; n < core.size(); ++n) {
        if (core[n] && parts.number[n] != largest) masks.loose[n] = 1;
        core[n] = parts.number[n] == largest;
    }
    masks.trunk = core;
    restore_edge(masks.trunk, masks.filled, size, disc(rx + 1.5, ry + 1.5));
}

// Counts what was left out, part by part: an arm has a loose core, a sheet or a fragment has none.
void count_left_out(const BodyMasks& masks, Int3 size, SkinField& body) {
    const Mask &mask = masks.labelled, &filled = masks.filled, &kept = masks.trunk;
    const std::size_t slice_count = static_cast<std::size_t>(size.x) * size.y;
    Mask left_out(mask.size());
    for (std::size_t n = 0; n < mask.size(); ++n) left_out[n] = filled[n] && !kept[n];
    const Parts others = parts_of(left_out.data(), size);
    std::vector<std::uint8_t> is_arm(others.size.size(), 0);
    for (std::size_t n = 0; n < mask.size(); ++n) {
        if (masks.loose[n]) is_arm[others.number[n]] = 1;
    }
    long filled_voxels = 0, kept_voxels = 0;
    const auto touches_air = [&](std::size_t n, int i, int j, int k) {
        const std::size_t slice = slice_count, row = static_cast<std::size_t>(size.x);
        return (i > 0 && !filled[n - 1]) || (i + 1 < size.x && !filled[n + 1]) ||
               (j > 0 && !filled[n - row]) || (j + 1 < size.y && !filled[n + row]) ||
               (k > 0 && !filled[n - slice]) || (k + 1 < size.z && !filled[n + slice]);
    };
    std::size_t n = 0;
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            for (int i = 0; i < size.x; ++i, ++n) {
                kept_voxels += kept[n];
                filled_voxels += kept[n] && !mask[n];
                if (filled[n] && !kept[n] && touches_air(n, i, j, k)) {
                    const auto part = static_cast<std::size_t>(others.number[n]);
                    ++(is_arm[part] ? body.arm_voxels : body.table_voxels);
                }
            }
        }
    }
    body.body_ml = static_cast<double>(kept_voxels) * body.grid.voxel_volume_mm3() / 1000;
    body.hollow =
        static_cast<double>(filled_voxels) / static_cast<double>(std::max(1L, kept_voxels));
}

// Planes that cut the body inside a padded grid, first and last per axis, to which the field is
// cropped so that the surface stays open there. Counts the voxels at the cuts.
void find_cut_planes(const Mask& kept, SkinField& body, Int3* first_plane, Int3* last_plane) {
    const Int3 size = body.grid.size;
    Int3 first{0, 0, 0}, last{size.x - 1, size.y - 1, size.z - 1};
    for (int axis = 0; axis < 3; ++axis) {
        const std::vector<long> counts = plane_counts(kept, size, axis);
        const double area = body.grid.voxel_volume_mm3() / body.grid.spacing_mm[axis];
        int low = 0, high = size[axis] - 1;
        while (low < high && counts[low] == 0) ++low;
        while (high > low && counts[high] == 0) --high;
        if (low > 0 && is_cut(counts, low, 1, axis, area)) first[axis] = low;
        if (high < size[axis] - 1 && is_cut(counts, high, -1, axis, area)) last[axis] = high;
        if (first[axis] == low) body.cut_voxels += counts[low];
        if (last[axis] == high) body.cut_voxels += counts[high];
    }
    *first_plane = first;
    *last_plane = last;
}

}  // namespace

Result<SkinField> make_skin_field(const LabelVolume& labels, const SkinSurfaceOptions& options) {
    SkinField body;
    const Grid& source = labels.grid;
    Int3 factor, size;
    for (int a = 0; a < 3; ++a) {
        factor[a] = std::clamp(static_cast<int>(options.working_mm / source.spacing_mm[a] + 0.5), 1,
                               std::max(1, source.size[a] / 4));
        size[a] = source.size[a] / factor[a];
    }
    if (size.x < 4 || size.y < 4 || size.z < 2) {
        return Error{"label map of " + std::to_string(source.size.x) + " x " +
                         std::to_string(source.size.y) + " x " + std::to_string(source.size.z) +
                         " voxels",
                     "", "at least 4 x 4 x 2 are needed to see a surface"};
    }
    body.grid = source;
    body.grid.size = size;
    for (int a = 0; a < 3; ++a) body.grid.spacing_mm[a] = factor[a] * source.spacing_mm[a];
    body.grid.origin_mm =
        source.point_from_voxel({0.5 * (factor.x - 1), 0.5 * (factor.y - 1), 0.5 * (factor.z - 1)});
    std::vector<float> share = averaged(labels, factor, size);

    BodyMasks masks;
    Mask& mask = masks.labelled;
    mask.resize(share.size());
    long labelled = 0;
    for (std::size_t n = 0; n < share.size(); ++n) labelled += mask[n] = share[n] >= 0.5f;
    if (labelled == 0) {
        return Error{"label map holds no body voxel", "",
                     "label 0 must be the outside and the body must carry other labels"};
    }
    if (labelled == static_cast<long>(mask.size())) {
        return Error{"label map is body everywhere, no skin can be seen", "",
                     "label 0 must be the outside of the body"};
    }

    find_trunk(masks, size, body.grid.spacing_mm, options);
    count_left_out(masks, size, body);
    // The field: shares of voxels at the edge of the trunk, one inside it, zero outside.
    const Mask& kept = masks.trunk;
    for (std::size_t m = 0; m < share.size(); ++m) {
        if (kept[m]) {
            if (masks.filled[m] && !mask[m]) share[m] = 1;
        } else if (share[m] >= 0.5f) {
            share[m] = 0;
        }
    }

    Int3 first, last;
    find_cut_planes(kept, body, &first, &last);
    body.round_view_mm = round_view_radius(kept, body.grid);
    if (body.round_view_mm > 0) {
        body.round_view_centre =
            body.grid.point_from_voxel({0.5 * (size.x - 1), 0.5 * (size.y - 1), 0});
    }
    crop(body.grid, share, masks.trunk, first, last);

    Vector3 sigma;
    for (int a = 0; a < 3; ++a) sigma[a] = options.smoothing_mm / body.grid.spacing_mm[a];
    smooth(share, body.grid.size, sigma);
    body.inside = std::move(share);
    return body;
}

}  // namespace sonocase::pipeline::inline registration_skin
