// SPDX-License-Identifier: Apache-2.0

// An analytic phantom as a bundle: slightly curved skin, fat, muscle, liver with a vessel, a
// kidney, a cyst, a rib and gas, all given by signed distances, so that labels and boundary records
// are exact.
//
// Frame: the probe face touches the skin near the origin and looks along +z.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "formats/volume/boundary_record.h"
#include "support/random.h"

namespace sonocase::testing {

struct PhantomOptions {
    double voxel_mm = 1;
    Point3 lower{-90, -30, -15}, upper{90, 30, 170};
    bool ribs = true, gas = true, vessels = true, kidney = true, layers = true;
    bool structure = true;  // echo offsets
    bool boundaries = true;
    std::uint64_t seed = 7;
};

class Phantom {
  public:
    enum : std::uint8_t {
        outside,
        skin,
        fat,
        muscle,
        liver,
        blood,
        kidney,
        cyst,
        bone,
        gas,
        count
    };

    explicit Phantom(const PhantomOptions& options = {}) : options_(options) {}

    // Negative inside; later shapes cover earlier ones.
    double distance(int shape, Point3 p) const {
        const double depth = p.z - (p.x * p.x + p.y * p.y) / 900;
        const double none = 1e3;
        const double wave = 1.5 * std::sin(p.x / 11) * std::cos(p.y / 17);
        switch (shape) {
            case skin: return -depth;
            case fat: return options_.layers ? 2 - depth : none;
            case muscle: return options_.layers ? 11 + wave - depth : none;
            case liver: return (options_.layers ? 22 - 0.5 * wave : 2) - depth;
            case blood:
                if (!options_.vessels) return none;
                return std::min(std::hypot(p.x - 5, p.z - 75) - 8,
                                std::hypot(p.y * 0.8 + (p.x + 35) * 0.6, p.z - 60) - 2.5);
            case kidney:
                if (!options_.kidney) return none;
                return (std::hypot((p.x - 45) / 22, p.y / 40, (p.z - 95) / 16) - 1) * 16;
            case cyst: return options_.vessels ? std::hypot(p.x + 40, p.y, p.z - 100) - 12 : none;
            case bone: return options_.ribs ? std::hypot((p.x + 22) / 1.6, p.z - 24) - 3.5 : none;
            case gas: return options_.gas ? std::hypot(p.x - 48, p.y, p.z - 45) - 9 : none;
            default: return none;
        }
    }

    std::uint8_t label(Point3 p) const {
        for (int shape = count - 1; shape > 0; --shape) {
            if (distance(shape, p) < 0) return static_cast<std::uint8_t>(shape);
        }
        return outside;
    }

    CaseBundle bundle() const;

  private:
    std::uint32_t record(Point3 p, std::uint8_t own) const {
        const double h = 1e-3, voxel = options_.voxel_mm;
        const auto gradient = [&](int s) {
            return Vector3{distance(s, p + Vector3{h, 0, 0}) - distance(s, p - Vector3{h, 0, 0}),
                           distance(s, p + Vector3{0, h, 0}) - distance(s, p - Vector3{0, h, 0}),
                           distance(s, p + Vector3{0, 0, h}) - distance(s, p - Vector3{0, 0, h})};
        };
        double best = 2.6 * voxel;
        BoundaryRecord found;
        bool near = false;
        for (int shape = 1; shape < count; ++shape) {
            if (shape < own) continue;  // covered here
            const double f = distance(shape, p);
            if (!(std::abs(f) < 50)) continue;
            const Vector3 g = gradient(shape);
            const double slope = norm(g) / (2 * h);
            if (!(slope > 1e-6) || std::abs(f) / slope >= best) continue;
            const double d = std::abs(f) / slope;
            const Vector3 out = normalized(g);  // away from the shape
            const Point3 beyond = shape == own ? p + (d + 0.05) * out : p - (d + 0.05) * out;
            const std::uint8_t other = label(beyond);
            if (other == own) continue;
            best = d;
            found = {other, d / voxel, shape == own ? -out : out};
            near = true;
        }
        return near ? pack_boundary(found) : kNoBoundary;
    }

    PhantomOptions options_;
};

namespace phantom_detail {

// Smooth noise of unit deviation, period `edge` cells of `cell_mm`.
class SmoothNoise {
  public:
    SmoothNoise(int edge, double cell_mm, std::uint64_t seed) : edge_(edge), cell_(cell_mm) {
        Random random(seed);
        for (int i = 0; i < edge * edge * edge; ++i) values_.push_back(random.gaussian());
    }
    double at(Point3 p) const {
        const auto wrap = [&](int i) { return ((i % edge_) + edge_) % edge_; };
        const double x = p.x / cell_, y = p.y / cell_, z = p.z / cell_;
        const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y)),
                  k = static_cast<int>(std::floor(z));
        const double u = x - i, v = y - j, w = z - k;
        double sum = 0, power = 0;
        for (int c = 0; c < 8; ++c) {
            const double weight = (c & 1 ? u : 1 - u) * (c & 2 ? v : 1 - v) * (c & 4 ? w : 1 - w);
            sum += weight * values_[static_cast<std::size_t>(
                                wrap(i + (c & 1)) +
                                edge_ * (wrap(j + (c >> 1 & 1)) + edge_ * wrap(k + (c >> 2))))];
            power += weight * weight;
        }
        return sum / std::sqrt(power);
    }

  private:
    int edge_;
    double cell_;
    std::vector<double> values_;
};

inline SolidTexture texture(const std::string& name,
                            int edge,
                            double voxel_mm,
                            std::uint64_t seed) {
    SolidTexture t{name, edge, voxel_mm, {}};
    const SmoothNoise noise(edge / 2, 2 * voxel_mm, seed);
    for (int k = 0; k < edge; ++k) {
        for (int j = 0; j < edge; ++j) {
            for (int i = 0; i < edge; ++i) {
                const double v = 128 + 32 * noise.at({i * voxel_mm, j * voxel_mm, k * voxel_mm});
                t.voxels.push_back(static_cast<std::uint8_t>(std::clamp(v, 0.0, 255.0)));
            }
        }
    }
    return t;
}

inline Tissue tissue(const char* name,
                     TissueKind kind,
                     bool shadow,
                     double grey,
                     double sd,
                     double echo,
                     double structure,
                     double attenuation,
                     double impedance,
                     double speed) {
    Tissue t;
    t.name = name;
    t.kind = kind;
    t.casts_shadow = shadow;
    t.texture = kind == TissueKind::fluid ? "" : sd > 22 ? "coarse" : "fine";
    t.grey_mean = grey;
    t.grey_sd = sd;
    t.echo_db = echo;
    t.structure_db = structure;
    t.attenuation_db_cm_mhz = attenuation;
    t.impedance_mrayl = impedance;
    t.sound_speed_m_s = speed;
    return t;
}

}  // namespace phantom_detail

inline CaseBundle Phantom::bundle() const {
    using namespace phantom_detail;
    CaseBundle b;
    b.manifest.case_name = "phantom";
    b.manifest.producer = "test";
    const double h = options_.voxel_mm;
    const Vector3 extent = options_.upper - options_.lower;
    b.grid.size = {static_cast<int>(extent.x / h) + 1, static_cast<int>(extent.y / h) + 1,
                   static_cast<int>(extent.z / h) + 1};
    b.grid.spacing_mm = {h, h, h};
    b.grid.origin_mm = options_.lower;
    using K = TissueKind;
    b.tissues = {tissue("outside", K::outside, false, 0, 0, -60, 0, 0, 0.0004, 340),
                 tissue("skin", K::soft, false, 150, 15, 9, 1.5, 0.35, 1.75, 1615),
                 tissue("fat", K::soft, false, 80, 25, -6, 3.5, 0.63, 1.38, 1460),
                 tissue("muscle", K::soft, false, 70, 28, -6, 5, 1.0, 1.70, 1580),
                 tissue("liver", K::soft, false, 105, 15, 0, 1.3, 0.5, 1.65, 1595),
                 tissue("blood", K::fluid, false, 15, 5, -30, 0, 0.15, 1.61, 1570),
                 tissue("kidney_cortex", K::soft, false, 80, 15, -4, 1.2, 0.7, 1.62, 1560),
                 tissue("urine", K::fluid, false, 5, 2, -60, 0, 0.01, 1.52, 1500),
                 tissue("bone", K::bone, true, 220, 20, -6, 2, 15, 6.5, 3430),
                 tissue("gas", K::gas, true, 180, 25, -14, 3, 7.5, 0.0004, 330)};
    for (const Tissue& t : b.tissues) {
        b.labels.push_back({t.name == "urine"           ? "cyst"
                            : t.name == "blood"         ? "vessel"
                            : t.name == "kidney_cortex" ? "kidney"
                                                        : t.name,
                            t.name,
                            static_cast<int>(b.labels.size()),
                            {0, 0, 0}});
    }
    std::vector<std::uint8_t> labels(b.grid.voxel_count());
    std::vector<std::uint32_t> boundary(labels.size(), kNoBoundary);
    std::vector<std::int8_t> echo(labels.size(), 0);
    const SmoothNoise grain(24, 4, options_.seed), fine(48, 1.5, options_.seed + 1);
    std::size_t index = 0;
    for (int k = 0; k < b.grid.size.z; ++k) {
        for (int j = 0; j < b.grid.size.y; ++j) {
            for (int i = 0; i < b.grid.size.x; ++i, ++index) {
                const Point3 p = b.grid.point_from_voxel({double(i), double(j), double(k)});
                const std::uint8_t own = label(p);
                labels[index] = own;
                if (options_.boundaries) boundary[index] = record(p, own);
                if (!options_.structure || own == outside) continue;
                const double sd = b.tissues[own].structure_db;
                const double db = own == muscle || own == fat ? sd * fine.at({p.x / 4, p.y, p.z})
                                                              : sd * grain.at(p);
                echo[index] =
                    static_cast<std::int8_t>(std::clamp(std::round(4 * db), -127.0, 127.0));
            }
        }
    }
    b.label_bricks = bricks_from_dense<std::uint8_t>(labels, b.grid.size);
    if (options_.structure) b.echo_offset = bricks_from_dense<std::int8_t>(echo, b.grid.size);
    if (options_.boundaries) b.boundary = bricks_from_dense<std::uint32_t>(boundary, b.grid.size);
    b.textures = {texture("fine", 32, 0.5, options_.seed + 2),
                  texture("coarse", 32, 1.0, options_.seed + 3)};
    b.speckle.edge = 64;
    Random random(options_.seed + 4);
    for (int i = 0; i < 2 * 64 * 64 * 64; ++i) {
        b.speckle.voxels.push_back(static_cast<std::int8_t>(
            std::clamp(std::round(32 * random.gaussian()), -127.0, 127.0)));
    }
    return b;
}

// A curvilinear abdominal probe on the phantom's skin.
inline Exercise phantom_exercise() {
    Exercise e;
    e.name = "phantom";
    e.probe.shape = ProbeShape::curvilinear;
    e.probe.radius_mm = 60;
    e.probe.field_of_view_rad = 1.1;
    e.probe.depth_mm = 140;
    e.probe.frequency_mhz = 3.5;
    e.needle.gauge = 18;
    return e;
}

inline Exercise phantom_linear_exercise() {
    Exercise e = phantom_exercise();
    e.probe.shape = ProbeShape::linear;
    e.probe.width_mm = 40;
    e.probe.depth_mm = 45;
    e.probe.frequency_mhz = 8;
    e.probe.focus_mm = 22;
    return e;
}

}  // namespace sonocase::testing
