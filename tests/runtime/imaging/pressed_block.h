// SPDX-License-Identifier: Apache-2.0

// A block of tissue with a vein and an artery as a bundle: skin, fat, muscle below the plane z = 0,
// two vessels along y, bone below if asked for. Labels and boundary records are exact.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "formats/volume/boundary_record.h"
#include "imaging_support.h"

namespace sonocase::testing {

struct PressedBlock {
    double voxel_mm = 0.6;
    double bone_mm = 1e9;  // depth of a plane of bone
    bool vessels = true;
    bool thrombus = false;  // in the vein
    Point3 vein{-6, 0, 20}, artery{7, 0, 21};
    double vein_radius_mm = 5.5, artery_radius_mm = 4.2;

    enum : std::uint8_t { outside, skin, fat, muscle, vein_label, artery_label, bone, count };

    // Negative inside; later shapes cover earlier ones.
    double distance(int shape, Point3 p) const {
        switch (shape) {
            case skin: return -p.z;
            case fat: return 2 - p.z;
            case muscle: return 12 - p.z;
            case vein_label:
                return vessels ? std::hypot(p.x - vein.x, p.z - vein.z) - vein_radius_mm : 1e3;
            case artery_label:
                return vessels ? std::hypot(p.x - artery.x, p.z - artery.z) - artery_radius_mm
                               : 1e3;
            case bone: return bone_mm - p.z;
            default: return 1e3;
        }
    }
    std::uint8_t label(Point3 p) const {
        for (int shape = count - 1; shape > 0; --shape) {
            if (distance(shape, p) < 0) return static_cast<std::uint8_t>(shape);
        }
        return outside;
    }

    CaseBundle bundle() const {
        CaseBundle b = Phantom(phantom_options()).bundle();  // its textures and speckle
        const auto tissue = [&](const char* name) {
            for (const Tissue& t : b.tissues)
                if (t.name == name) return t;
            return Tissue{};
        };
        Tissue vessel = tissue("blood");
        vessel.name = "vessel";
        b.tissues = {tissue("outside"), tissue("skin"), tissue("fat"),
                     tissue("muscle"),  vessel,         tissue("bone")};
        b.labels.clear();
        const auto add = [&](const char* name, const char* of) {
            b.labels.push_back({name, of, static_cast<int>(b.labels.size()), {0, 0, 0}});
        };
        add("outside", "outside");
        add("skin", "skin");
        add("fat", "fat");
        add("muscle", "muscle");
        add(thrombus ? "thrombus_of_vein" : "femoral_vein", "vessel");
        add("femoral_artery", "vessel");
        add("bone", "bone");
        const Vector3 extent{80, 24, 75};
        b.grid.spacing_mm = {voxel_mm, voxel_mm, voxel_mm};
        b.grid.origin_mm = {-40, -12, -10};
        b.grid.size = {int(extent.x / voxel_mm), int(extent.y / voxel_mm),
                       int(extent.z / voxel_mm)};
        std::vector<std::uint8_t> labels(b.grid.voxel_count());
        std::vector<std::uint32_t> records(labels.size(), kNoBoundary);
        std::size_t index = 0;
        for (int k = 0; k < b.grid.size.z; ++k)
            for (int j = 0; j < b.grid.size.y; ++j)
                for (int i = 0; i < b.grid.size.x; ++i, ++index) {
                    const Point3 p = b.grid.point_from_voxel({double(i), double(j), double(k)});
                    labels[index] = label(p);
                    records[index] = record(p, labels[index]);
                }
        b.label_bricks = bricks_from_dense<std::uint8_t>(labels, b.grid.size);
        b.boundary = bricks_from_dense<std::uint32_t>(records, b.grid.size);
        b.echo_offset = {};
        return b;
    }

    static PhantomOptions phantom_options() {
        PhantomOptions o;
        o.voxel_mm = 8;
        o.structure = o.boundaries = false;
        return o;
    }

  private:
    std::uint32_t record(Point3 p, std::uint8_t own) const {
        double best = 2.6 * voxel_mm;
        BoundaryRecord found;
        bool near = false;
        for (int shape = 1; shape < count; ++shape) {
            const double d = std::abs(distance(shape, p));
            if (shape < own || !(d < best)) continue;
            const double h = 1e-3;
            const Vector3 out = normalized(Vector3{
                distance(shape, p + Vector3{h, 0, 0}) - distance(shape, p - Vector3{h, 0, 0}), 0,
                distance(shape, p + Vector3{0, 0, h}) - distance(shape, p - Vector3{0, 0, h})});
            const Point3 beyond = shape == own ? p + (d + 0.05) * out : p - (d + 0.05) * out;
            const std::uint8_t other = label(beyond);
            if (other == own) continue;
            best = d;
            found = {other, d / voxel_mm, shape == own ? -out : out};
            near = true;
        }
        return near ? pack_boundary(found) : kNoBoundary;
    }
};

inline Rigid pressed_by(double mm) {
    Rigid pose;
    pose.translation = {0, 0, mm};
    return pose;
}

// A linear probe of 40 mm on the block.
inline Exercise pressed_exercise() {
    Exercise e = phantom_linear_exercise();
    e.probe.depth_mm = 50;
    return e;
}

// The same with a convex and with a phased array.
inline std::vector<Exercise> block_exercises() {
    std::vector<Exercise> out{pressed_exercise(), pressed_exercise(), pressed_exercise()};
    out[1].probe.shape = ProbeShape::curvilinear;
    out[1].probe.radius_mm = 50;
    out[1].probe.field_of_view_rad = 0.8;
    out[2].probe.shape = ProbeShape::phased;
    out[2].probe.width_mm = 20;
    out[2].probe.field_of_view_rad = 1;
    return out;
}

inline const CaseBundle& pressed_block() {
    static const CaseBundle bundle = PressedBlock().bundle();
    return bundle;
}

inline runtime::RenderOptions block_picture(
    runtime::ImageModel model,
    int scanlines = 96,
    runtime::RendererKind kind = runtime::RendererKind::fast) {
    runtime::RenderOptions o;
    o.model = model;
    o.kind = kind;
    o.width_px = o.height_px = 160;
    o.scanlines = scanlines;
    o.samples = 256;
    return o;
}

// Tissue where the press field puts it and nothing else, sharp enough to measure in.
inline runtime::RenderOptions field_picture() {
    runtime::RenderOptions o = block_picture(runtime::ImageModel::paper, 384);
    o.effects = {"deformation"};
    o.width_px = o.height_px = 400;
    o.samples = 512;
    return o;
}

}  // namespace sonocase::testing
