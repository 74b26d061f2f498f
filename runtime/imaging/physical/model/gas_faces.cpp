// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/gas_faces.h"

namespace sonocase::runtime::physical {
namespace {

bool joined(const FaceNode& a, const FaceNode& b) {
    return a.depth_mm < kNoFace && b.depth_mm < kNoFace && (a.peak > 0) == (b.peak > 0) &&
           std::abs(a.depth_mm - b.depth_mm) < static_cast<float>(kFaceJoinMm);
}

// Filters neighbours of one face by 1 2 1.
void smooth(std::span<FaceNode> nodes) {
    FaceNode before = nodes.front();
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const FaceNode here = nodes[n];
        const FaceNode& left = n > 0 && joined(before, here) ? before : here;
        const FaceNode& right =
            n + 1 < nodes.size() && joined(here, nodes[n + 1]) ? nodes[n + 1] : here;
        nodes[n].depth_mm = 0.25f * (left.depth_mm + 2 * here.depth_mm + right.depth_mm);
        nodes[n].peak = 0.25f * (left.peak + 2 * here.peak + right.peak);
        before = here;
    }
}

// Smooth noise in [-1, 1]: random numbers at the corners of cubes of edge 1, smooth in between.
double smooth_noise(Point3 p) {
    const double cell[3] = {std::floor(p.x), std::floor(p.y), std::floor(p.z)};
    double part[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double u = p[axis] - cell[axis];
        part[axis] = u * u * (3 - 2 * u);
    }
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        double weight = 1;
        std::uint32_t bits = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const int step = corner >> axis & 1;
            weight *= step != 0 ? part[axis] : 1 - part[axis];
            bits = hash32(bits + static_cast<std::uint32_t>(static_cast<int>(cell[axis]) + step));
        }
        sum += weight * (bits * 0x1p-31 - 1);
    }
    return sum;
}

}  // namespace

void show_lung(const PhysicalScene& s, const PhysicalFrame& f, Point3 voxel, FaceNode& face) {
    face.lung = true;
    const double radius_mm = f.air.radius_mm;
    if (radius_mm > 0) {
        const double mm = s.voxel_mm * norm(voxel - s.grid.voxel_from_point(f.air.centre));
        face.air = static_cast<float>(std::clamp((radius_mm - mm) / kAirEdgeMm, 0.0, 1.0));
    }
    const double streak =
        smooth_noise(Point3{} + (s.voxel_mm / kLungStreakMm) * (voxel - Point3{}));
    const auto air = static_cast<double>(face.air);
    face.tail = static_cast<float>(
        std::exp2((kLungStreakDb * (1 - air) * streak + kAirTailDb * air) / kDbPerLog2));
}

LungGrain lung_grain(const PhysicalFrame& f) {
    if (!f.effects.breathing) return {};
    const double fields = std::min(norm(f.motion.breathing_mm) / kLungGrainMm, 1e6),
                 before = std::floor(fields), part = fields - before;
    return {1 + static_cast<std::uint32_t>(before),
            {static_cast<float>(std::sqrt(1 - part)), static_cast<float>(std::sqrt(part))}};
}

float dome_peak(const PhysicalScene& s, Point3 voxel) {
    const double strength =
        s.layers.empty() ? 0 : std::clamp(s.layers.at(voxel).strength, -2.0, 2.0);
    return static_cast<float>(kDomeAmplitude * std::exp2(kDomeStrengthDb / kDbPerLog2 * strength));
}

FaceNode find_face(const PhysicalScene& s,
                   const ScanGeometry& g,
                   const NodeSpacing& nodes,
                   const PhysicalFrame& f,
                   const BreathingField* breathing,
                   double gap_mm,
                   int node) {
    if (gap_mm < 0) return {};
    const auto voxel_at = [&](double r) {
        Point3 x = point_on_beam(g, f, nodes.line(node), r, gap_mm * std::exp(-r / kGapReachMm));
        if (breathing != nullptr) x = x - breathing->weight(x) * f.motion.breathing_mm;
        return s.grid.voxel_from_point(x);
    };
    const auto label_of = [&](double r) {
        const Point3 v = voxel_at(r);
        return label_at(s, static_cast<int>(std::nearbyint(v.x)),
                        static_cast<int>(std::nearbyint(v.y)),
                        static_cast<int>(std::nearbyint(v.z)));
    };
    const auto is_gas = [&](int label) { return s.acoustics[label].kind == TissueKind::gas; };
    bool organ = false;  // was met on the way
    for (int row = 1; nodes.r_mm(row + 1) < g.depth_mm; ++row) {
        const int label = label_of(nodes.r_mm(row));
        if (s.acoustics[label].kind == TissueKind::bone) return {};
        organ = organ || s.fine.frames[label].cube == kParenchymaCube;
        if (!is_gas(label) || !is_gas(label_of(nodes.r_mm(row + 1)))) continue;
        double before = nodes.r_mm(row - 1), behind = nodes.r_mm(row);
        for (int halving = 0; halving < kFaceHalvings; ++halving) {
            const double middle = 0.5 * (before + behind);
            (is_gas(label_of(middle)) ? behind : before) = middle;
        }
        FaceNode face{static_cast<float>(0.5 * (before + behind)), 0};
        if (s.is_lung[label] && organ && nodes.r_mm(row) > kDomeFromMm)
            face.peak = dome_peak(s, voxel_at(nodes.r_mm(row)));
        if (s.is_lung[label]) show_lung(s, f, voxel_at(0.5 * (before + behind)), face);
        return face;
    }
    return {};
}

void join_faces(const ScanGeometry& g,
                const NodeSpacing& spacing,
                std::span<FaceNode> nodes,
                GasFaces& faces) {
    for (int pass = 0; pass < 3; ++pass) smooth(nodes);
    faces.any_dome = faces.any_slides = false;
    for (std::size_t l = 0; l < faces.depth_mm.size(); ++l) {
        const int line = std::min(static_cast<int>(l), g.scanlines - 1);
        const int n = spacing.node_of(line);
        const float part = spacing.part(line);
        const FaceNode &a = nodes[n], &b = nodes[n + 1];
        const bool between = joined(a, b);
        const FaceNode& nearest = part < 0.5f ? a : b;
        const float depth =
                        between ? a.depth_mm + (b.depth_mm - a.depth_mm) * part : nearest.depth_mm,
                    peak = between ? a.peak + (b.peak - a.peak) * part : nearest.peak,
                    air = between ? a.air + (b.air - a.air) * part : nearest.air;
        faces.tail[l] = between ? a.tail + (b.tail - a.tail) * part : nearest.tail;
        faces.reverb_loss[l] = static_cast<float>(kReverbLoss) +
                               air * static_cast<float>(kAirReverbLoss - kReverbLoss);
        faces.slides[l] = nearest.lung && nearest.air < 0.5f ? 1 : 0;
        faces.any_slides = faces.any_slides || faces.slides[l] > 0;
        faces.depth_mm[l] = depth;
        faces.peak[l] = depth < kNoFace ? peak : 0;
        faces.dome_mm[l] = faces.peak[l] > 0 ? depth : kNoFace;
        faces.any_dome = faces.any_dome || faces.peak[l] > 0;
        const double pitch =
            std::max(spacing.line(n + 1) - spacing.line(n), 1) *
            (g.fan ? (g.radius_mm + static_cast<double>(std::min(depth, 1e3f))) * g.line_step
                   : g.line_step);
        const double slope =
            between ? static_cast<double>(b.depth_mm - a.depth_mm) / std::max(pitch, 1e-3) : 0;
        faces.cosine[l] = static_cast<float>(1 / std::sqrt(1 + slope * slope));
    }
}

}  // namespace sonocase::runtime::physical
