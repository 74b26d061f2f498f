// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/motion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/base/portable_math.h"

namespace sonocase {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr int kCellBricks = 2;  // a cell of the field is 2 x 2 x 2 bricks

bool moves_with_diaphragm(const std::string& name) {
    for (const char* part :
         {"liver", "kidney", "spleen", "pancreas", "gallbladder", "stomach", "duodenum", "adrenal",
          "lung", "heart", "portal", "hepatic", "diaphragm", "cyst", "lesion"}) {
        if (name.find(part) != std::string::npos) return true;
    }
    return false;
}

// Running mean over 2 * reach + 1 cells along one axis; the values at the ends are repeated.
void box_filter(std::vector<float>& cells, Int3 size, int axis, int reach) {
    const std::array<std::size_t, 3> stride{
        1, static_cast<std::size_t>(size.x),
        static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y)};
    const std::size_t s = stride[axis];
    const int n = size[axis];
    std::vector<float> line(n);
    for (std::size_t start = 0; start < cells.size(); ++start) {
        if (start / s % static_cast<std::size_t>(n) != 0) continue;
        for (int i = 0; i < n; ++i) line[i] = cells[start + static_cast<std::size_t>(i) * s];
        for (int i = 0; i < n; ++i) {
            float sum = 0;
            for (int j = -reach; j <= reach; ++j) sum += line[std::clamp(i + j, 0, n - 1)];
            cells[start + static_cast<std::size_t>(i) * s] =
                sum / static_cast<float>(2 * reach + 1);
        }
    }
}

}  // namespace

double pulse_wave(double phase) {
    // A raised cosine over the first fifth, then a nearly exponential fall that ends at zero.
    constexpr double kRise = 0.2;
    if (phase < kRise) return 0.5 - 0.5 * cosine(0.5 * kTwoPi * phase / kRise);
    const double t = (phase - kRise) / (1 - kRise);
    return (1 - t) * (1 - t) * (1 + 2 * t);
}

VeinState vein_state(const Deformation& deformation, double head_down_deg, bool strains) {
    constexpr double kColumnMm = 200, kMmhgPerMm = 0.078;  // blood: 1.06 times water
    constexpr double kStrainMmhg = 20, kFullMmhg = 2.7, kMaxDeg = 45;
    const double angle = std::clamp(head_down_deg, -kMaxDeg, kMaxDeg) * kTwoPi / 360;
    const double more = kColumnMm * kMmhgPerMm * sine(angle) + (strains ? kStrainMmhg : 0);
    VeinState out;
    out.pressure_mmhg = std::max(0.5, deformation.venous_pressure_mmhg + more);
    out.wall_mm =
        deformation.vein_level_mm +
        deformation.vein_swell_mm * std::clamp(1 - exponential(-more / kFullMmhg), -0.5, 1.0);
    return out;
}

MotionState motion_at(const BreathingMotion& breathing, const Pulsation& pulsation, double time_s) {
    MotionState m;
    const double length = norm(breathing.direction);
    if (breathing.amplitude_mm != 0 && breathing.period_s > 0 && length > 0) {
        const double a =
            breathing.amplitude_mm * 0.5 * (1 - cosine(kTwoPi * time_s / breathing.period_s));
        m.breathing_mm = (a / length) * breathing.direction;
    }
    if (pulsation.amplitude_mm != 0 && pulsation.rate_per_min > 0) {
        const double beats = time_s * pulsation.rate_per_min / 60;
        m.pulse_mm = pulsation.amplitude_mm * pulse_wave(beats - std::floor(beats));
    }
    return m;
}

BreathingField::BreathingField(const CaseBundle& bundle) {
    const BrickVolume<std::uint8_t>& labels = bundle.label_bricks;
    const Int3 n = brick_count(labels.size);
    Int3 size;
    for (int axis = 0; axis < 3; ++axis) size[axis] = (n[axis] + kCellBricks - 1) / kCellBricks;
    const double edge = kBrickEdge * kCellBricks * bundle.grid.spacing_mm.x;
    grid_ = bundle.grid;
    grid_.size = size;
    grid_.spacing_mm = {edge, edge, edge};
    const double shift = 0.5 * (edge - bundle.grid.spacing_mm.x);
    grid_.origin_mm = bundle.grid.origin_mm + Vector3{shift, shift, shift};

    std::vector<float> moves;
    for (const Label& l : bundle.labels)
        moves.push_back(moves_with_diaphragm(l.name) ? 1.0f : 0.0f);
    cells_.assign(grid_.voxel_count(), 0.0f);
    std::vector<float> count(cells_.size(), 0.0f);
    for (int k = 0; k < n.z; ++k) {
        for (int j = 0; j < n.y; ++j) {
            for (int i = 0; i < n.x; ++i) {
                // One voxel represents its brick.
                const int x = std::min(4 * i + 2, labels.size.x - 1),
                          y = std::min(4 * j + 2, labels.size.y - 1),
                          z = std::min(4 * k + 2, labels.size.z - 1);
                const std::size_t cell =
                    grid_.index(i / kCellBricks, j / kCellBricks, k / kCellBricks);
                cells_[cell] += moves[labels.at(x, y, z)];
                count[cell] += 1;
            }
        }
    }
    for (std::size_t i = 0; i < cells_.size(); ++i) cells_[i] /= std::max(count[i], 1.0f);
    for (int pass = 0; pass < 2; ++pass) {
        for (int axis = 0; axis < 3; ++axis) box_filter(cells_, size, axis, 1);
    }
}

double BreathingField::weight(Point3 p) const {
    const Point3 v = grid_.voxel_from_point(p);
    double sum = 0;
    if (!(v.x >= -1 && v.y >= -1 && v.z >= -1 && v.x < grid_.size.x && v.y < grid_.size.y &&
          v.z < grid_.size.z))
        return 0;
    const auto below = [](double at) {  // std::floor() is a call
        const int whole = static_cast<int>(at);
        return whole - (whole > at ? 1 : 0);
    };
    const int x = below(v.x), y = below(v.y), z = below(v.z);
    const double fx = x, fy = y, fz = z;
    const double across[2] = {1 - (v.x - fx), v.x - fx}, along[2] = {1 - (v.y - fy), v.y - fy},
                 up[2] = {1 - (v.z - fz), v.z - fz};
    const double share[4] = {across[0] * along[0], across[1] * along[0], across[0] * along[1],
                             across[1] * along[1]};
    const std::ptrdiff_t row = grid_.size.x, plane = row * grid_.size.y;
    const std::ptrdiff_t corner = x + row * y + plane * z;
    if (x >= 0 && y >= 0 && z >= 0 && x + 1 < grid_.size.x && y + 1 < grid_.size.y &&
        z + 1 < grid_.size.z) {  // nearly everywhere
        const float* cell = cells_.data() + corner;
        for (int c = 0; c < 2; ++c, cell += plane) {
            sum += share[0] * up[c] * static_cast<double>(cell[0]);
            sum += share[1] * up[c] * static_cast<double>(cell[1]);
            sum += share[2] * up[c] * static_cast<double>(cell[row]);
            sum += share[3] * up[c] * static_cast<double>(cell[row + 1]);
        }
        return sum;
    }
    for (int c = 0; c < 8; ++c) {  // beyond the last cells lie zeros
        if (!grid_.contains(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))) continue;
        const std::ptrdiff_t at = corner + (c & 1) + row * (c >> 1 & 1) + plane * (c >> 2);
        sum +=
            share[c & 3] * up[c >> 2] * static_cast<double>(cells_[static_cast<std::size_t>(at)]);
    }
    return sum;
}

}  // namespace sonocase
