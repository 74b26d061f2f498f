// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/import/body/body_field.h"

namespace sonocase::pipeline {
namespace {

double clamp01(double x) {
    return std::clamp(x, 0.0, 1.0);
}

// The height up to which the organs of the belly rise, over each column of voxels, smoothed: the
// dome of the diaphragm.
std::vector<double> dome_heights(const BodyField& body, const LabelBits& belly, double fallback) {
    const Grid& grid = body.grid();
    const auto columns =
        static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y);
    std::vector<double> top(columns, -1e9);
    const auto& voxels = const_cast<BodyField&>(body).labels().voxels;
    for (int k = 0; k < grid.size.z; ++k)
        for (std::size_t c = 0; c < columns; ++c)
            if (belly[voxels[columns * static_cast<std::size_t>(k) + c]])
                top[c] = body.point(0, 0, k).z;
    // Columns beside the organs take the height of what lies near, falling by 45 degrees.
    const double v = body.voxel_mm();
    for (double& t : top) t = std::max(t, fallback);
    const auto at = [&](int i, int j) -> double& {
        return top[static_cast<std::size_t>(i) +
                   static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(j)];
    };
    for (int pass = 0; pass < 2; ++pass) {
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                if (i > 0) at(i, j) = std::max(at(i, j), at(i - 1, j) - v);
                if (j > 0) at(i, j) = std::max(at(i, j), at(i, j - 1) - v);
            }
        for (int j = grid.size.y - 1; j >= 0; --j)
            for (int i = grid.size.x - 1; i >= 0; --i) {
                if (i + 1 < grid.size.x) at(i, j) = std::max(at(i, j), at(i + 1, j) - v);
                if (j + 1 < grid.size.y) at(i, j) = std::max(at(i, j), at(i, j + 1) - v);
            }
    }
    // Three box filters along each axis are nearly a Gaussian of 8 mm.
    const int reach = std::max(1, static_cast<int>(8 / v));
    std::vector<double> line;
    for (int pass = 0; pass < 3; ++pass)
        for (int axis = 0; axis < 2; ++axis) {
            const int length = axis == 0 ? grid.size.x : grid.size.y;
            const int lines = axis == 0 ? grid.size.y : grid.size.x;
            for (int l = 0; l < lines; ++l) {
                line.assign(static_cast<std::size_t>(length), 0);
                for (int n = 0; n < length; ++n) {
                    double sum = 0;
                    for (int o = -reach; o <= reach; ++o) {
                        const int m = std::clamp(n + o, 0, length - 1);
                        sum += axis == 0 ? at(m, l) : at(l, m);
                    }
                    line[static_cast<std::size_t>(n)] = sum / (2 * reach + 1);
                }
                for (int n = 0; n < length; ++n)
                    (axis == 0 ? at(n, l) : at(l, n)) = line[static_cast<std::size_t>(n)];
            }
        }
    return top;
}

}  // namespace

// Vertebrae, discs and the canal along the midline, in front of the back.
void add_spine(BodyField& body, const BodyOptions& options) {
    const auto& outlines = body.outlines();
    const LabelBits pelvis = body.with({"sacrum"});
    const Box3 sacrum = body.box_of(pelvis);
    const double bottom = sacrum.empty() ? -1e9 : sacrum.upper.z - 8;
    const std::uint8_t bone = body.make("vertebrae", "bone");
    const std::uint8_t disc = body.make("intervertebral_discs", "cartilage");
    const std::uint8_t canal = body.make("spinal_canal", "cerebrospinal_fluid");
    // The back's outline is that of skin and muscle; its fat varies, so the column runs smoothly.
    const Grid& grid = body.grid();
    std::vector<double> middle_y(outlines.size(), NAN);
    for (std::size_t k = 0; k < outlines.size(); ++k) {
        double sum = 0, count = 0;
        const int reach = static_cast<int>(60 / body.voxel_mm());
        for (int o = -reach; o <= reach; ++o) {
            const int m = static_cast<int>(k) + o;
            if (m < 0 || m >= grid.size.z) continue;
            const auto& line = outlines[static_cast<std::size_t>(m)];
            if (std::isnan(line.back_y)) continue;
            sum += line.back_y;
            ++count;
        }
        if (count > 0) middle_y[k] = sum / count + 66;
    }
    const double pitch = options.disc_pitch_mm;
    const auto slice_of = [&](Point3 p) {
        return static_cast<std::size_t>(std::lround((p.z - grid.origin_mm.z) / body.voxel_mm()));
    };
    const auto in_column = [&](Point3 p, double width, double depth, double behind) {
        const std::size_t k = slice_of(p);
        if (p.z < bottom || k >= outlines.size() || std::isnan(middle_y[k])) return false;
        const double x = (p.x - outlines[k].middle_x) / width;
        const double y = (p.y - middle_y[k] + behind) / depth;
        return x * x + y * y < 1;
    };
    const auto phase = [&](Point3 p) {
        const double up = p.z - std::max(bottom, grid.origin_mm.z);
        const double lumbar = 5 * pitch;
        const double local = up < lumbar ? up / pitch : 5 + (up - lumbar) / (0.7 * pitch);
        return local - std::floor(local);
    };
    body.paint(canal, [&](Point3 p, std::size_t) { return in_column(p, 9, 8, 25); });
    body.paint(disc,
               [&](Point3 p, std::size_t) { return phase(p) > 0.76 && in_column(p, 22, 17, 0); });
    body.paint(bone, [&](Point3 p, std::size_t) {
        if (phase(p) <= 0.76 && in_column(p, 22, 17, 0)) return true;
        if (in_column(p, 14, 13, 26)) return true;  // the arch round the canal
        // Spinous and transverse processes.
        const bool level = phase(p) > 0.2 && phase(p) < 0.6;
        return level && (in_column(p, 3.5, 20, 46) || in_column(p, 38, 5, 22));
    });
}

// Ribs, cartilage and sternum in the chest's wall; lungs above the dome, and the diaphragm.
void add_chest(BodyField& body, const BodyOptions& options, const std::vector<float>& depth) {
    const LabelBits belly = body.with({"liver", "spleen", "stomach", "kidney", "colon"});
    const LabelBits upper = body.with({"liver", "spleen"});
    const Box3 liver = body.box_of(upper);
    if (liver.empty()) return;
    const auto& outlines = body.outlines();
    const Grid& grid = body.grid();
    const double dome = liver.upper.z;  // about the height of the xiphoid
    const double margin = dome - 115;   // lowest point of the costal margin, in the flank
    const std::uint8_t rib = body.make("ribs", "bone");
    const std::uint8_t cartilage = body.make("costal_cartilages", "cartilage");
    const std::uint8_t sternum = body.make("sternum", "bone");
    const double shell = options.fat_mm * 0.75;
    const auto angle_front = [&](Point3 p, double& side) {
        const auto k = static_cast<std::size_t>(std::clamp<long>(
            std::lround((p.z - grid.origin_mm.z) / body.voxel_mm()), 0, grid.size.z - 1));
        const auto& line = outlines[k];
        const double cx = line.middle_x, cy = 0.5 * (line.back_y + line.front_y);
        const double half_x = std::max(1.0, 0.5 * (line.right_x - line.left_x));
        const double half_y = std::max(1.0, 0.5 * (line.front_y - line.back_y));
        side = (p.x - cx) / half_x;
        return std::clamp((p.y - cy) / half_y, -1.0, 1.0);  // 1: front, -1: back
    };
    if (options.ribs) {
        // Depths of the wall: fat, then ribs of 8 mm between muscle.
        const auto in_wall = [&](std::size_t n) {
            const double d = static_cast<double>(depth[n]);
            return d > shell && d < shell + 8;
        };
        body.paint(sternum, [&](Point3 p, std::size_t n) {
            double side = 0;
            const double front = angle_front(p, side);
            return front > 0.75 && std::abs(side) < 0.11 && p.z > dome - 8 && in_wall(n);
        });
        const auto band = [&](Point3 p, double& front) {
            double side = 0;
            front = angle_front(p, side);
            // Below the sternum the margin rises towards the middle: an arch.
            const double arch =
                front > 0 ? margin + (dome - 12 - margin) * clamp01(1 - std::abs(side) / 0.62)
                          : margin - 10 * (1 + front);
            if (p.z < arch || std::abs(side) < 0.08) return -1.0;
            // A rib falls by 70 mm from the back to the front.
            const double height = p.z - margin + 35 * (1 + front);
            return std::fmod(height + 1000 * options.rib_pitch_mm, options.rib_pitch_mm);
        };
        double unused = 0;
        body.paint(cartilage, [&](Point3 p, std::size_t n) {
            double front = unused;
            const double at = band(p, front);
            return at >= 0 && at < options.rib_mm && front > 0.62 && in_wall(n);
        });
        body.paint(rib, [&](Point3 p, std::size_t n) {
            double front = 0;
            const double at = band(p, front);
            return at >= 0 && at < options.rib_mm && in_wall(n);
        });
    }
    if (!options.lungs) return;
    const std::vector<double> tops = dome_heights(body, belly, margin - 40);
    const std::uint8_t diaphragm = body.make("diaphragm", "muscle");
    const std::uint8_t right = body.make("lung_right", "lung");
    const std::uint8_t left = body.make("lung_left", "lung");
    const double wall = shell + 14;
    const auto column = [&](std::size_t n) {
        return n % (static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y));
    };
    const LabelBits chest = body.with({"heart", "aort", "trachea", "vertebrae", "atrium",
                                       "ventricle", "pulmonary", "thymus", "cava"});
    const std::vector<float> to_chest = body.distance_to(chest);
    for (const bool is_right : {true, false}) {
        body.paint(is_right ? right : left, [&](Point3 p, std::size_t n) {
            double side = 0;
            angle_front(p, side);
            return (side > 0) == is_right && static_cast<double>(depth[n]) > wall &&
                   p.z > tops[column(n)] + 3 + options.diaphragm_mm &&
                   static_cast<double>(to_chest[n]) > 5;
        });
    }
    body.paint(diaphragm, [&](Point3 p, std::size_t n) {
        return static_cast<double>(depth[n]) > wall && p.z > tops[column(n)] + 3 &&
               p.z <= tops[column(n)] + 3 + options.diaphragm_mm;
    });
    // What is left about the heart is fat of the mediastinum.
    const std::uint8_t fat = body.make("mediastinal_fat", "fat");
    body.paint(fat, [&](Point3 p, std::size_t n) {
        return static_cast<double>(depth[n]) > wall + 5 && p.z > tops[column(n)] + 5;
    });
}

}  // namespace sonocase::pipeline
