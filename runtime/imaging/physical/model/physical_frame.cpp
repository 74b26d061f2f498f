// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/physical_frame.h"

#include <algorithm>
#include <cmath>

#include "runtime/imaging/press/press_bundle.h"

namespace sonocase::runtime {
namespace {

std::int8_t to_byte(double v) {
    return static_cast<std::int8_t>(std::lround(std::clamp(v, -127.0, 127.0)));
}

// Unit-deviation noise smoothed by a Gaussian of the given width, as bytes of 1/32.
std::vector<std::int8_t> smoothed_tile(std::span<const double> levels,
                                       double sigma,
                                       std::uint32_t seed,
                                       int overhang) {
    const std::vector<std::int8_t> raw = make_noise_tile(levels, 32, seed, 0);
    const int reach = static_cast<int>(std::ceil(3 * sigma));
    std::vector<float> taps;
    float power = 0;
    for (int i = -reach; i <= reach; ++i) {
        taps.push_back(sigma > 0 ? static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma)))
                                 : 1.0f);
        power += taps.back() * taps.back();
    }
    std::vector<std::int8_t> out(kNoiseTile + overhang);
    for (std::uint32_t i = 0; i < kNoiseTile; ++i) {
        float sum = 0;
        for (int j = -reach; j <= reach; ++j) {
            sum += taps[j + reach] *
                   static_cast<float>(raw[(i + static_cast<std::uint32_t>(j)) & (kNoiseTile - 1)]);
        }
        out[i] = to_byte(static_cast<double>(sum) / std::sqrt(static_cast<double>(power)));
    }
    for (int i = 0; i < overhang; ++i) out[kNoiseTile + i] = out[i];
    return out;
}

}  // namespace

PhysicalNoise make_physical_noise(std::span<const double> levels,
                                  std::uint32_t seed,
                                  int overhang) {
    return {smoothed_tile(levels, 0.8, seed + 1, overhang),
            smoothed_tile(levels, 2.5, seed + 2, overhang),
            smoothed_tile(levels, 0, seed + 3, overhang)};
}

void press_gaps(const press::PressField& field, const ScanGeometry& g, std::span<float> gaps) {
    if (!field.state().pressed) return;
    for (int l = 0; l < g.scanlines; ++l) {
        float& gap = gaps[l];
        if (gap < 0) continue;
        const double lateral =
            press::follows_columns(g) ? press::lateral_of_line(g, l) : g.beam_origin(l).x;
        gap = static_cast<float>(field.skin_now_mm(lateral));
    }
}

namespace {

ScanGeometry::Beam beam_of(const ScanGeometry& g, int line) {
    if (line < g.scanlines) return g.beams[line];
    return {g.beam_origin(line), g.beam_direction(line)};
}

}  // namespace

Point3 point_on_beam(const ScanGeometry& g,
                     const PhysicalFrame& f,
                     int line,
                     double r,
                     double gap_mm,
                     const press::PlaneShift& shift) {
    const auto& [o, d] = beam_of(g, line);
    const PlanePoint n = press::beside(d);
    const double s = r + gap_mm + shift.along_mm;
    return f.volume_from_probe *
           Point3{o.x + s * d.x + shift.side_mm * n.x, 0, o.z + s * d.z + shift.side_mm * n.z};
}

Point3 point_on_beam(
    const ScanGeometry& g, const PhysicalFrame& f, int line, double r, double gap_mm) {
    press::PlaneShift shift;
    if (f.press != nullptr) shift = press::plane_shift(*f.press, g, beam_of(g, line), line, r);
    return point_on_beam(g, f, line, r, gap_mm, shift);
}

int label_at(const PhysicalScene& s, int i, int j, int k) {
    if (!s.grid.contains(i, j, k)) return 0;
    return s.bundle->label_bricks.at(i, j, k);
}

void find_gaps(const PhysicalScene& scene,
               const ScanGeometry& g,
               const PhysicalFrame& frame,
               int first,
               int last,
               std::span<float> raw) {
    // Nearest integer of a number below 1e5; cheaper than a call of floor().
    const auto nearest = [](double v) {
        constexpr int kShift = 1 << 18;
        return static_cast<int>(v + (kShift + 0.5)) - kShift;
    };
    const double max_mm = g.fan ? physical::kMaxGapMm : physical::kMaxFlatGapMm;
    for (int l = first; l < last; ++l) {
        float& gap = raw[l];
        gap = -1;
        const auto& [o, d] = g.beams[l];
        const Point3 p = scene.grid.voxel_from_point(frame.volume_from_probe * Point3{o.x, 0, o.z});
        const Vector3 v = (physical::kGapStepMm / scene.voxel_mm) *
                          (frame.volume_from_probe.rotation * Vector3{d.x, 0, d.z});
        if (!(std::abs(p.x) < 1e5 && std::abs(p.y) < 1e5 && std::abs(p.z) < 1e5)) continue;
        for (int step = 0; step * physical::kGapStepMm <= max_mm; ++step) {
            const Point3 q = p + static_cast<double>(step) * v;
            const int label = label_at(scene, nearest(q.x), nearest(q.y), nearest(q.z));
            if (label == 0) continue;
            const double steps = std::max(step + press::steps_to_skin(*scene.bundle, q, v), 0.0);
            gap = static_cast<float>(std::min(steps * physical::kGapStepMm, max_mm));
            break;
        }
    }
}

int smooth_gaps(const ScanGeometry& g, std::span<const float> raw, std::span<float> gaps) {
    const int scanlines = g.scanlines;
    const int reach = std::max(g.fan ? 0 : static_cast<int>(physical::kGapMeanMm / g.line_step), 4);
    int touching = 0;
    for (int l = 0; l < scanlines; ++l) {
        gaps[l] = -1;
        if (raw[l] < 0) continue;
        ++touching;
        float sum = 0;
        int n = 0;
        for (int j = std::max(l - reach, 0); j <= std::min(l + reach, scanlines - 1); ++j) {
            const float gap = raw[j];
            if (gap < 0) continue;
            sum += gap;
            ++n;
        }
        gaps[l] = sum / static_cast<float>(n);
    }
    return touching;
}

}  // namespace sonocase::runtime
