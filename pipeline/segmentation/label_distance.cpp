#include "pipeline/segmentation/label_distance.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

// K of the header, in voxels, normalised; size odd. Empty for sigma = 0.
std::vector<float> smoothing_kernel(double sigma) {
    if (sigma <= 0) return {};
    const double a = 2 + 1 / (3 * sigma * sigma);
    const int reach = std::max(2, static_cast<int>(std::ceil(3.2 * sigma)));
    std::vector<double> gauss(static_cast<std::size_t>(2 * reach + 1));
    double sum = 0;
    for (int i = -reach; i <= reach; ++i) {
        const double g = std::exp(-0.5 * i * i / (sigma * sigma));
        gauss[static_cast<std::size_t>(i + reach)] = g;
        sum += g;
    }
    for (double& g : gauss) g /= sum;
    std::vector<double> kernel(static_cast<std::size_t>(4 * reach + 1));
    for (std::size_t i = 0; i < gauss.size(); ++i) {
        kernel[i + static_cast<std::size_t>(reach)] += a * gauss[i];
        for (std::size_t j = 0; j < gauss.size(); ++j)
            kernel[i + j] -= (a - 1) * gauss[i] * gauss[j];
    }
    // Ends below a thousandth are cut; what is left is brought back to a sum of 1.
    std::size_t cut = 0;
    while (cut + 1 < kernel.size() / 2 && std::abs(kernel[cut]) < 1e-3) ++cut;
    std::vector<float> out;
    double kept = 0;
    for (std::size_t i = cut; i + cut < kernel.size(); ++i) kept += kernel[i];
    for (std::size_t i = cut; i + cut < kernel.size(); ++i)
        out.push_back(static_cast<float>(kernel[i] / kept));
    return out;
}

// out[l] = sum_m kernel[m] in[l + m - reach], lines of `width` values; the border is replicated.
void smooth_lines(const float* in,
                  std::size_t width,
                  int lines,
                  std::size_t stride,
                  const std::vector<float>& kernel,
                  float* out) {
    const int reach = static_cast<int>(kernel.size() / 2);
    for (int l = 0; l < lines; ++l) {
        float* to = out + static_cast<std::size_t>(l) * stride;
        std::fill(to, to + width, 0.0f);
        for (int m = -reach; m <= reach; ++m) {
            const float* from =
                in + static_cast<std::size_t>(std::clamp(l + m, 0, lines - 1)) * stride;
            const float k = kernel[static_cast<std::size_t>(m + reach)];
            for (std::size_t i = 0; i < width; ++i) to[i] += k * from[i];
        }
    }
}

void smooth_rows(
    const float* in, int count, std::size_t rows, const std::vector<float>& kernel, float* out) {
    const int reach = static_cast<int>(kernel.size() / 2);
    std::vector<float> padded(static_cast<std::size_t>(count + 2 * reach));
    for (std::size_t r = 0; r < rows; ++r) {
        const float* row = in + r * static_cast<std::size_t>(count);
        float* to = out + r * static_cast<std::size_t>(count);
        std::fill(padded.begin(), padded.begin() + reach, row[0]);
        std::copy(row, row + count, padded.begin() + reach);
        std::fill(padded.end() - reach, padded.end(), row[count - 1]);
        std::fill(to, to + count, 0.0f);
        for (std::size_t m = 0; m < kernel.size(); ++m) {
            const float k = kernel[m];
            const float* from = padded.data() + m;
            for (int i = 0; i < count; ++i) to[i] += k * from[i];
        }
    }
}

// All three axes; an empty kernel leaves its axis alone.
void smooth_box(const VoxelBox& box,
                const std::vector<float>* kernels,
                std::vector<float>* values,
                std::vector<float>* other) {
    other->resize(values->size());
    const std::size_t nx = static_cast<std::size_t>(box.size.x);
    const std::size_t ny = static_cast<std::size_t>(box.size.y);
    const std::size_t nz = static_cast<std::size_t>(box.size.z);
    if (!kernels[0].empty()) {
        smooth_rows(values->data(), box.size.x, ny * nz, kernels[0], other->data());
        values->swap(*other);
    }
    if (!kernels[1].empty()) {
        for (std::size_t k = 0; k < nz; ++k) {
            const std::size_t at = k * nx * ny;
            smooth_lines(values->data() + at, nx, box.size.y, nx, kernels[1], other->data() + at);
        }
        values->swap(*other);
    }
    if (!kernels[2].empty()) {
        for (std::size_t j = 0; j < ny; ++j) {
            const std::size_t at = j * nx;
            smooth_lines(values->data() + at, nx, box.size.z, nx * ny, kernels[2],
                         other->data() + at);
        }
        values->swap(*other);
    }
}

// A Gaussian whose value at two standard deviations is 1: one mark spreads fully over that reach.
std::vector<float> spreading_kernel(double sigma) {
    const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
    std::vector<float> kernel;
    for (int i = -reach; i <= reach; ++i) {
        kernel.push_back(static_cast<float>(std::exp(0.7 - 0.5 * i * i / (sigma * sigma))));
    }
    return kernel;
}

// Distance field of one outline alone, on a window of its slice.
struct OutlineField {
    VoxelBox window;
    std::vector<float> phi;
    float deepest = 0;  // mm, > 0

    float at(double x, double y) const {  // pixels of the slice; clamped to the window
        const double u = std::clamp(x - window.first.x, 0.0, window.size.x - 1.0);
        const double v = std::clamp(y - window.first.y, 0.0, window.size.y - 1.0);
        const int i = std::min(static_cast<int>(u), std::max(0, window.size.x - 2));
        const int j = std::min(static_cast<int>(v), std::max(0, window.size.y - 2));
        const float s = static_cast<float>(u - i), t = static_cast<float>(v - j);
        const int i1 = std::min(i + 1, window.size.x - 1), j1 = std::min(j + 1, window.size.y - 1);
        const float a = phi[window.index(i, j, 0)], b = phi[window.index(i1, j, 0)];
        const float c = phi[window.index(i, j1, 0)], d = phi[window.index(i1, j1, 0)];
        const float low = a + s * (b - a), high = c + s * (d - c);
        return low + t * (high - low);
    }
};

OutlineField outline_field(const LabelVolume& labels,
                           const SliceGroups& groups,
                           int outline,
                           int pad) {
    const Outline& o = groups.outlines[static_cast<std::size_t>(outline)];
    OutlineField field;
    field.window = grow(o.box, {pad, pad, 0}, labels.grid.size);
    LabelVolume mask;
    mask.grid = labels.grid;
    mask.grid.size = {field.window.size.x, field.window.size.y, 1};
    mask.voxels.resize(mask.grid.voxel_count());
    for (int j = 0; j < field.window.size.y; ++j) {
        for (int i = 0; i < field.window.size.x; ++i) {
            mask.voxels[mask.grid.index(i, j, 0)] =
                groups.outline_of_voxel[labels.grid.index(
                    field.window.first.x + i, field.window.first.y + j, o.slice)] == outline;
        }
    }
    signed_distance(mask, 1, {{0, 0, 0}, mask.grid.size}, pad * labels.grid.spacing_mm.x,
                    {true, true, false}, &field.phi);
    for (const float p : field.phi) field.deepest = std::max(field.deepest, -p);
    return field;
}

}  // namespace

LabelVolume slices_last(const LabelVolume& labels) {
    const Grid& g = labels.grid;
    int thick = 2;
    for (const int a : {1, 0}) {
        if (g.spacing_mm[a] > g.spacing_mm[thick] * 1.0001) thick = a;
    }
    if (thick == 2) return labels;
    // A cyclic exchange keeps the frame right-handed, whatever that matters to the caller.
    const int from[3] = {(thick + 1) % 3, (thick + 2) % 3, thick};
    LabelVolume out;
    out.labels = labels.labels;
    out.grid.origin_mm = g.origin_mm;
    for (int a = 0; a < 3; ++a) {
        out.grid.size[a] = g.size[from[a]];
        out.grid.spacing_mm[a] = g.spacing_mm[from[a]];
        for (int r = 0; r < 3; ++r) out.grid.direction(r, a) = g.direction(r, from[a]);
    }
    out.voxels.resize(g.voxel_count());
    for (int k = 0; k < out.grid.size.z; ++k) {
        for (int j = 0; j < out.grid.size.y; ++j) {
            for (int i = 0; i < out.grid.size.x; ++i) {
                Int3 v;
                v[from[0]] = i;
                v[from[1]] = j;
                v[from[2]] = k;
                out.voxels[out.grid.index(i, j, k)] = labels.voxels[g.index(v.x, v.y, v.z)];
            }
        }
    }
    return out;
}

LabelDistance::LabelDistance(const LabelVolume& labels, const LabelDistanceOptions& options)
    : labels_(slices_last(labels)), options_(options) {
    const Vector3 h = labels_.grid.spacing_mm;
    const double pixel = std::max(h.x, h.y);
    nodes_ = labels_.grid;
    if (options.shape_slices && h.z >= options.thick_ratio * pixel && labels_.grid.size.z > 1) {
        factor_ = std::max(2, static_cast<int>(std::lround(h.z / pixel)));
        nodes_.spacing_mm.z = h.z / factor_;
        nodes_.size.z = (labels_.grid.size.z - 1) * factor_ + 1;
        groups_ = find_slice_groups(labels_);
        limit_mm_ = 4 * h.z;
    } else {
        limit_mm_ = (4 + 2 * options.sigma_vx) * pixel;
    }
    boxes_ = label_boxes(labels_);
    for (int a = 0; a < 3; ++a) {
        if (nodes_.size[a] < 2) continue;
        const double per_vx = std::sqrt(h.x * h.y) / nodes_.spacing_mm[a];
        const bool across = a == 2 && factor_ > 1;
        double sigma = options.sigma_vx * per_vx;
        if (across && options.sigma_slices > 0) {
            sigma = options.sigma_slices * factor_;
        } else if (across && h.z >= 3.5 * pixel) {
            // Slices this far apart hold no noise that more would average, only curvature to lose.
            sigma = std::min(sigma, 0.3 * factor_);
        }
        wide_.axis[a] = smoothing_kernel(sigma);
        fine_.axis[a] = smoothing_kernel(std::min(options.detail_vx * per_vx, sigma));
        // What is thin in one slice is thin half-way to the next.
        spread_.axis[a] = spreading_kernel(across ? 0.5 * factor_ : std::max(0.8, 0.7 * sigma));
    }
}

void LabelDistance::blend_group(const SliceGroup& group,
                                bool own_label,
                                const VoxelBox& box,
                                std::vector<float>* phi) const {
    constexpr int kPad = 6;
    if (!own_label) {  // most groups are nowhere near
        Int3 low = box.first, high;
        for (int a = 0; a < 3; ++a) high[a] = box.first[a] + box.size[a];
        if ((group.slice + 1) * factor_ <= low.z || group.slice * factor_ >= high.z) return;
        bool near = false;
        for (const int o : {group.lower, group.upper}) {
            if (o < 0) continue;
            const VoxelBox& b = groups_.outlines[static_cast<std::size_t>(o)].box;
            near = near || (b.first.x < high.x && b.first.x + b.size.x > low.x &&
                            b.first.y < high.y && b.first.y + b.size.y > low.y);
        }
        if (!near) return;
    }
    const OutlineField low =
        group.lower >= 0 ? outline_field(labels_, groups_, group.lower, kPad) : OutlineField{};
    const OutlineField high =
        group.upper >= 0 ? outline_field(labels_, groups_, group.upper, kPad) : OutlineField{};
    for (int step = 1; step < factor_; ++step) {
        const double t = static_cast<double>(step) / factor_;
        const int k = group.slice * factor_ + step - box.first.z;
        if (k < 0 || k >= box.size.z) continue;
        // Where a pixel of this step lies in either slice: turned and shifted back or onwards.
        struct Pose {
            double c, s, from_x, from_y, to_x, to_y;  // pixel - from, turned, + to
        };
        const auto pose = [&](double x, double y, double part) {
            const double angle = part * group.turn_rad;
            return Pose{std::cos(angle),
                        std::sin(angle),
                        x - part * group.shift_x,
                        y - part * group.shift_y,
                        x,
                        y};
        };
        const auto centre = [&](int outline) -> const Outline& {
            return groups_.outlines[static_cast<std::size_t>(std::max(outline, 0))];
        };
        const Pose to_low = pose(centre(group.lower).x, centre(group.lower).y, -t);
        const Pose to_high = pose(centre(group.upper).x, centre(group.upper).y, 1 - t);
        const auto value = [](const OutlineField& f, const Pose& p, int x, int y) {
            const double u = x - p.from_x, v = y - p.from_y;
            return f.at(p.to_x + p.c * u - p.s * v, p.to_y + p.s * u + p.c * v);
        };
        int x0 = 1 << 30, y0 = x0, x1 = -x0, y1 = -x0;
        const auto include = [&](const OutlineField& f, const Pose& p) {
            for (int corner = 0; corner < 4; ++corner) {
                const double u = f.window.first.x + (corner & 1 ? f.window.size.x : 0) - p.to_x;
                const double v = f.window.first.y + (corner & 2 ? f.window.size.y : 0) - p.to_y;
                const double x = p.from_x + p.c * u + p.s * v, y = p.from_y - p.s * u + p.c * v;
                x0 = std::min(x0, static_cast<int>(std::floor(x)));
                y0 = std::min(y0, static_cast<int>(std::floor(y)));
                x1 = std::max(x1, static_cast<int>(std::ceil(x)));
                y1 = std::max(y1, static_cast<int>(std::ceil(y)));
            }
        };
        if (group.lower >= 0) include(low, to_low);
        if (group.upper >= 0) include(high, to_high);
        x0 = std::max(x0, box.first.x);
        y0 = std::max(y0, box.first.y);
        x1 = std::min(x1, box.first.x + box.size.x);
        y1 = std::min(y1, box.first.y + box.size.y);
        const float w = static_cast<float>(t);
        // Share of its depth by which an outline that ends has shrunk here; past the pole it goes
        // on.
        const double beyond = (group.lower >= 0 ? t : 1 - t) / group.end;
        const float shrink =
            static_cast<float>(beyond < 1 ? 1 - std::sqrt(1 - beyond) : 0.5 + 0.5 * beyond);
        for (int y = y0; y < y1; ++y) {
            for (int x = x0; x < x1; ++x) {
                float here = 0;
                if (group.lower >= 0 && group.upper >= 0) {
                    const float a = value(low, to_low, x, y), b = value(high, to_high, x, y);
                    here = a + w * (b - a);
                } else {
                    const bool ends = group.lower >= 0;
                    const OutlineField& own = ends ? low : high;
                    here = value(own, ends ? to_low : to_high, x, y) + own.deepest * shrink;
                }
                float& to = (*phi)[box.index(x - box.first.x, y - box.first.y, k)];
                to = own_label ? std::min(to, here) : std::max(to, -here);
            }
        }
    }
}

void LabelDistance::shape_interpolated(std::uint8_t label,
                                       const VoxelBox& box,
                                       std::vector<float>* phi) const {
    // `box` is whole slices: its nodes run from slice `first` to slice `first + slices - 1`.
    const int first = box.first.z / factor_;
    const int slices = (box.size.z - 1) / factor_ + 1;
    const VoxelBox in_slices{{box.first.x, box.first.y, first}, {box.size.x, box.size.y, slices}};
    std::vector<float> flat;
    signed_distance(labels_, label, in_slices, limit_mm_, {true, true, false}, &flat);
    phi->resize(box.count());
    const std::size_t plane =
        static_cast<std::size_t>(box.size.x) * static_cast<std::size_t>(box.size.y);
    for (int k = 0; k < box.size.z; ++k) {
        const int s = std::min(k / factor_, std::max(0, slices - 2));
        const float t = static_cast<float>(k - s * factor_) / static_cast<float>(factor_);
        const auto slice = [&](int i) {
            return flat.data() + static_cast<std::size_t>(std::clamp(i, 0, slices - 1)) * plane;
        };
        const float *a = slice(s - 1), *b = slice(s), *c = slice(s + 1), *d = slice(s + 2);
        const float wa = 0.5f * t * (-1 + t * (2 - t)), wb = 0.5f * (2 + t * t * (-5 + 3 * t));
        const float wc = 0.5f * t * (1 + t * (4 - 3 * t)), wd = 0.5f * t * t * (t - 1);
        float* to = phi->data() + static_cast<std::size_t>(k) * plane;
        for (std::size_t i = 0; i < plane; ++i)
            to[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i];
    }
    // What another label's outline sweeps is its own and not this label's; then this label's own.
    for (const bool own : {false, true}) {
        for (std::size_t l = 0; l < groups_.of_label.size(); ++l) {
            if ((l == label) != own) continue;
            for (const SliceGroup& group : groups_.of_label[l]) {
                const bool moves = group.lower >= 0 && group.upper >= 0;
                if (moves && !options_.follow_shift) continue;
                blend_group(group, own, box, phi);
            }
        }
    }
}

VoxelBox LabelDistance::distance(std::uint8_t label, std::vector<float>* phi) const {
    VoxelBox box = boxes_[label];
    phi->clear();
    if (box.empty()) return box;
    const Vector3 h = labels_.grid.spacing_mm;
    // Beyond this the label cannot win; the kernel's reach is added so that its border is not felt.
    Int3 pad;
    for (int a = 0; a < 3; ++a) {
        const double reach =
            std::min(limit_mm_, 6 * h[a]) / h[a] +
            static_cast<double>(wide_.axis[a].size() / 2) * nodes_.spacing_mm[a] / h[a];
        pad[a] = static_cast<int>(std::ceil(reach));
    }
    if (factor_ > 1) pad.z = 2;
    box = grow(box, pad, labels_.grid.size);
    if (factor_ > 1) {
        box.size.z = (box.size.z - 1) * factor_ + 1;
        box.first.z *= factor_;
        shape_interpolated(label, box, phi);
    } else {
        signed_distance(labels_, label, box, limit_mm_, {true, true, true}, phi);
    }
    if (wide_.axis[0].empty() && wide_.axis[1].empty()) return box;
    std::vector<float> smooth = *phi, other;
    smooth_box(box, wide_.axis, &smooth, &other);
    if (options_.detail_vx < options_.sigma_vx) {
        smooth_box(box, fine_.axis, phi, &other);
        keep_detail(label, box, smooth, phi);
    } else {
        phi->swap(smooth);
    }
    return box;
}

void LabelDistance::keep_detail(std::uint8_t label,
                                const VoxelBox& box,
                                const std::vector<float>& smooth,
                                std::vector<float>* phi) const {
    const float pixel = static_cast<float>(std::max(nodes_.spacing_mm.x, nodes_.spacing_mm.y));
    const float tolerance = static_cast<float>(options_.tolerance_vx) * pixel;
    // What is one voxel thick has no depth to give: it must stay inside by a tenth of a voxel. Between
    // thick slices it is the interpolation by shape that keeps what is thin.
    const float thin = -0.1f * pixel;
    const Grid& g = labels_.grid;
    const std::size_t step[3] = {1, static_cast<std::size_t>(g.size.x),
                                 static_cast<std::size_t>(g.size.x) *
                                     static_cast<std::size_t>(g.size.y)};
    const auto one_voxel_thick = [&](Int3 v) {
        if (factor_ > 1) return false;
        const std::uint8_t* at = labels_.voxels.data() + g.index(v.x, v.y, v.z);
        for (int a = 0; a < 3; ++a) {  // a label goes on beyond the border
            if (v[a] == 0 || v[a] + 1 == g.size[a]) continue;
            if (at[-static_cast<std::ptrdiff_t>(step[a])] != label && at[step[a]] != label)
                return true;
        }
        return false;
    };
    std::vector<float> across(phi->size(), 0.0f), other;
    bool any = false;
    for (int k = 0; k < box.size.z; ++k) {
        if ((box.first.z + k) % factor_ != 0) continue;  // only slices are known
        for (int j = 0; j < box.size.y; ++j) {
            const std::uint8_t* row =
                labels_.voxels.data() +
                labels_.grid.index(box.first.x, box.first.y + j, (box.first.z + k) / factor_);
            const std::size_t at = box.index(0, j, k);
            for (std::size_t i = 0; i < static_cast<std::size_t>(box.size.x); ++i) {
                const bool own = row[i] == label;
                const float d = own ? smooth[at + i] : -smooth[at + i];
                if (d > tolerance ||
                    (own && d > thin &&
                     one_voxel_thick({box.first.x + static_cast<int>(i), box.first.y + j,
                                      box.first.z + k}))) {
                    across[at + i] = 1;
                    any = true;
                }
            }
        }
    }
    if (!any) {
        *phi = smooth;
        return;
    }
    smooth_box(box, spread_.axis, &across, &other);
    float* fine = phi->data();
    for (std::size_t i = 0; i < phi->size(); ++i) {
        const float w = std::min(1.0f, across[i]);
        fine[i] = smooth[i] + w * (fine[i] - smooth[i]);
    }
}

}  // namespace sonocase::pipeline
