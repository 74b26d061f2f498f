// SPDX-License-Identifier: Apache-2.0

// A second known body, simpler than the analytic torso and independent of it: an elliptic trunk
// with one layer of muscle, eight ellipsoidal organs, eight ribs that close round the front, and
// vessels of 1.5 to 10 mm radius as chains of two or three straight pieces. 25 labels; later solids
// win.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::testing {

class PlainBody {
  public:
    PlainBody() {
        for (const char* name : {"outside", "body", "muscle_wall"}) add(name);
        ellipsoid("liver", {60, 20, 40}, {75, 60, 65}, 0.3);
        ellipsoid("spleen", {-90, -30, 50}, {25, 35, 45}, 0.4);
        ellipsoid("kidney_right", {55, -45, -40}, {24, 20, 50}, 0.3);
        ellipsoid("kidney_left", {-55, -45, -30}, {24, 20, 50}, -0.3);
        ellipsoid("stomach", {-50, 30, 40}, {45, 30, 40}, 0);
        ellipsoid("gallbladder", {50, 60, -20}, {14, 14, 28}, 0);
        ellipsoid("pancreas", {-5, 10, -20}, {55, 11, 13}, 0.2);
        ellipsoid("urinary_bladder", {0, 40, -110}, {35, 28, 25}, 0);
        tube("spine", 20, {{0, -75, -160}, {0, -65, 0}, {0, -75, 160}});
        tube("aorta", 10, {{-12, -35, -160}, {-12, -30, 160}});
        tube("vena_cava", 9, {{15, -32, -160}, {15, -25, 160}});
        tube("portal_vein_5mm", 5, {{0, 5, -30}, {40, 15, 30}, {85, 20, 60}});
        tube("vein_3mm", 3, {{20, -20, 95}, {60, 20, 70}, {100, 40, 30}});
        tube("vein_2mm", 2, {{20, -10, 40}, {60, 45, 50}, {95, 40, 75}});
        tube("artery_1p5mm", 1.5, {{-5, 5, 0}, {30, 30, 35}, {70, 50, 40}});
        for (int n = 0; n < 4; ++n) {
            for (const int side : {-1, 1}) {
                std::vector<Point3> path;
                for (int q = 0; q <= 24; ++q) {
                    const double a = q / 24.0 * 2.6 - 1.2;
                    path.push_back({side * 132 * std::cos(a), -5 + 92 * std::sin(a),
                                    110 - 34 * n - 22 * std::sin(a)});
                }
                tube("rib_" + std::to_string(n) + (side < 0 ? "_left" : "_right"), 5.5,
                     std::move(path));
            }
        }
    }

    const std::vector<Label>& labels() const { return labels_; }

    std::uint8_t label(Point3 ct) const {
        const double r = std::hypot(ct.x / 155, ct.y / 112);
        if (r >= 1) return 0;
        for (auto solid = solids_.rbegin(); solid != solids_.rend(); ++solid) {
            if (solid->box.contains(ct) && solid->holds(ct)) return solid->label;
        }
        return r > 0.75 && r <= 0.9 ? 2 : 1;
    }

    // Cut off at top and bottom like a CT, with air on the other sides; slices along the grid's z.
    // `direction` rotates the grid about the body's middle.
    static Grid grid(Vector3 spacing_mm, const Matrix3& direction = {}) {
        constexpr Vector3 kExtent{320, 240, 300};
        Grid grid;
        grid.spacing_mm = spacing_mm;
        grid.direction = direction;
        Vector3 first;
        for (int a = 0; a < 3; ++a) {
            double extent = 0;  // of the body along the grid's own axis
            for (int b = 0; b < 3; ++b) extent += std::abs(direction(b, a)) * kExtent[b];
            grid.size[a] = static_cast<int>(std::lround(extent / spacing_mm[a]));
            first[a] = -0.5 * spacing_mm[a] * (grid.size[a] - 1);
        }
        grid.origin_mm = Point3{} + direction * first;
        return grid;
    }

    LabelVolume sample(const Grid& grid) const {
        LabelVolume volume{grid, std::vector<std::uint8_t>(grid.voxel_count()), labels_};
        parallel_for(static_cast<std::size_t>(grid.size.z), 1,
                     [&](std::size_t begin, std::size_t end) {
                         for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
                             for (int j = 0; j < grid.size.y; ++j) {
                                 for (int i = 0; i < grid.size.x; ++i) {
                                     volume.voxels[grid.index(i, j, k)] =
                                         label(grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}));
                                 }
                             }
                         }
                     });
        return volume;
    }

  private:
    struct Solid {
        std::uint8_t label;
        Box3 box;
        std::vector<Point3> path;  // of a tube; an ellipsoid's is its middle
        double radius = 0;         // of a tube
        Vector3 axes;              // of an ellipsoid
        Matrix3 turn;              // into its axes

        bool holds(Point3 p) const {
            if (path.size() == 1) {
                const Vector3 q = turn * (p - path[0]);
                return norm({q.x / axes.x, q.y / axes.y, q.z / axes.z}) < 1;
            }
            for (std::size_t i = 0; i + 1 < path.size(); ++i) {
                const Vector3 piece = path[i + 1] - path[i];
                const double t = std::clamp(dot(p - path[i], piece) / dot(piece, piece), 0.0, 1.0);
                if (distance(p, path[i] + t * piece) < radius) return true;
            }
            return false;
        }
    };

    std::uint8_t add(const std::string& name) {
        labels_.push_back({name, "muscle", static_cast<int>(labels_.size()), {}});
        return static_cast<std::uint8_t>(labels_.size() - 1);
    }
    void ellipsoid(const std::string& name, Point3 middle, Vector3 axes, double turn_about_z) {
        const double r = std::max({axes.x, axes.y, axes.z});
        solids_.push_back({add(name),
                           {middle - Vector3{r, r, r}, middle + Vector3{r, r, r}},
                           {middle},
                           0,
                           axes,
                           rotation_about({0, 0, 1}, -turn_about_z)});
    }
    void tube(const std::string& name, double radius, std::vector<Point3> path) {
        Box3 box;
        for (const Point3 p : path) {
            box.include(p - Vector3{radius, radius, radius});
            box.include(p + Vector3{radius, radius, radius});
        }
        solids_.push_back({add(name), box, std::move(path), radius, {}, {}});
    }

    std::vector<Label> labels_;
    std::vector<Solid> solids_;
};

inline const PlainBody& plain_body() {
    static const PlainBody instance;
    return instance;
}

}  // namespace sonocase::pipeline::testing
