// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "formats/base/constants.h"
#include "pipeline/import/body/body_field.h"

namespace sonocase::pipeline::inline import_body {

namespace {

double clamp01(double x) {
    return std::clamp(x, 0.0, 1.0);
}

// The height up to which the organs of the belly rise, over each column of voxels, smoothed: the
// dome of the diaphragm.
std::vector<double> dome_heights(const BodyField& body, const LabelSet& belly, double fallback) {
    const Grid& grid = body.grid();
    const auto columns = static_cast<std::size_t>(grid.size.x) * grid.size.y;
    std::vector<double> top(columns, -1e9);
    const auto& voxels = body.labels().voxels;
    for (int k = 0; k < grid.size.z; ++k)
        for (std::size_t c = 0; c < columns; ++c)
            if (belly[voxels[columns * static_cast<std::size_t>(k) + c]])
                top[c] = body.point(0, 0, k).z;
    // Columns beside the organs take the height of those nearby, which falls off by 45 degrees.
    const double v = body.voxel_mm();
    for (double& t : top) t = std::max(t, fallback);
    const auto at = [&](int i, int j) -> double& {
        return top[i + static_cast<std::size_t>(grid.size.x) * j];
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
                line.assign(length, 0);
                for (int n = 0; n < length; ++n) {
                    double sum = 0;
                    for (int o = -reach; o <= reach; ++o) {
                        const int m = std::clamp(n + o, 0, length - 1);
                        sum += axis == 0 ? at(m, l) : at(l, m);
                    }
                    line[n] = sum / (2 * reach + 1);
                }
                for (int n = 0; n < length; ++n) (axis == 0 ? at(n, l) : at(l, n)) = line[n];
            }
        }
    return top;
}

}  // namespace

// Vertebrae, discs and the canal along the midline, in front of the back.
void add_spine(BodyField& body, const BodyOptions& options) {
    const auto& outlines = body.outlines();
    const LabelSet pelvis = body.with({"sacrum"});
    const Box3 sacrum = body.box_of(pelvis);
    const double bottom = sacrum.empty() ? -1e9 : sacrum.upper.z - 8;
    const std::uint8_t bone = body.make("vertebrae", "bone");
    const std::uint8_t disc = body.make("intervertebral_discs", "cartilage");
    const std::uint8_t canal = body.make("spinal_canal", "cerebrospinal_fluid");
    // The outline of the back varies with its fat; the column follows its mean over 120 mm.
    const Grid& grid = body.grid();
    std::vector<double> middle_y(outlines.size(), NAN);
    for (std::size_t k = 0; k < outlines.size(); ++k) {
        double sum = 0, count = 0;
        const int reach = static_cast<int>(60 / body.voxel_mm());
        for (int o = -reach; o <= reach; ++o) {
            const int m = static_cast<int>(k) + o;
            if (m < 0 || m >= grid.size.z) continue;
            const auto& line = outlines[m];
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
    const LabelSet belly = body.with({"liver", "spleen", "stomach", "kidney", "colon"});
    const LabelSet upper = body.with({"liver", "spleen"});
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
        return n % (static_cast<std::size_t>(grid.size.x) * grid.size.y);
    };
    const LabelSet chest = body.with({"heart", "aort", "trachea", "vertebrae", "atrium",
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
    // What remains around the heart is fat of the mediastinum.
    const std::uint8_t fat = body.make("mediastinal_fat", "fat");
    body.paint(fat, [&](Point3 p, std::size_t n) {
        return static_cast<double>(depth[n]) > wall + 5 && p.z > tops[column(n)] + 5;
    });
}

namespace {

// The middle of a set's lowest slice.
Point3 lowest_of(const BodyField& body, const LabelVolume& labels, const LabelSet& bits) {
    const Grid& grid = body.grid();
    for (int k = 0; k < grid.size.z; ++k) {
        Vector3 sum;
        double count = 0;
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i)
                if (bits[labels.voxels[grid.index(i, j, k)]]) {
                    sum = sum + (body.point(i, j, k) - Point3{});
                    ++count;
                }
        if (count > 0) return Point3{} + (1 / count) * sum;
    }
    return {};
}

bool has(const LabelVolume& labels, const LabelSet& bits) {
    return std::any_of(labels.voxels.begin(), labels.voxels.end(),
                       [&](std::uint8_t v) { return bits[v]; });
}

Point3 between(Point3 a, Point3 b, double t) {
    return a + t * (b - a);
}

}  // namespace

// A chain of balls from the hiatus, left of the spine under the diaphragm, to the duodenum.
void add_stomach(BodyField& body, const BodyOptions& options) {
    const LabelSet spleen = body.with({"spleen"}), duodenum = body.with({"duodenum"}),
                   liver = body.with({"liver"});
    if (!has(body.labels(), spleen) || !has(body.labels(), duodenum)) return;
    const Point3 s = body.middle_of(spleen);
    const Box3 d = body.box_of(duodenum);
    const Point3 end{d.centre().x, d.centre().y, d.upper.z};
    const Box3 l = body.box_of(liver);
    const Point3 fundus{s.x + 32, s.y + 38, s.z + 18};
    const Point3 antrum{0.5 * (s.x + end.x) + 12, std::max(s.y, end.y) + 34, end.z - 4};
    const double radius[7] = {26, 31, 32, 30, 26, 21, 15};
    std::vector<std::pair<Point3, double>> chain;
    for (int n = 0; n < 7; ++n) {
        const double t = n / 6.0;
        const Point3 p = between(between(fundus, antrum, t), between(antrum, end, t), t);
        chain.push_back({p, radius[n]});
    }
    const auto depth_in = [&](Point3 p) {
        double depth = 1e9;
        for (std::size_t n = 0; n + 1 < chain.size(); ++n) {
            const Vector3 along = chain[n + 1].first - chain[n].first;
            const double t =
                std::clamp(dot(p - chain[n].first, along) / dot(along, along), 0.0, 1.0);
            const double r = chain[n].second + t * (chain[n + 1].second - chain[n].second);
            depth = std::min(depth, norm(p - chain[n].first - t * along) - r);
        }
        return depth;
    };
    // The patient lies: gas gathers in front.
    double front = -1e9, back = 1e9;
    for (const auto& [p, r] : chain) {
        front = std::max(front, p.y + r);
        back = std::min(back, p.y - r);
    }
    const double level = front - options.stomach_gas * (front - back);
    const std::uint8_t wall = body.make("stomach_wall", "bowel");
    const std::uint8_t gas = body.make("stomach_gas", "gas");
    const std::uint8_t content = body.make("stomach_content", "bowel");
    const double top = l.empty() ? 1e9 : l.upper.z;
    body.paint(gas,
               [&](Point3 p, std::size_t) { return p.y > level && p.z < top && depth_in(p) < -4; });
    body.paint(content, [&](Point3 p, std::size_t) { return p.z < top && depth_in(p) < -4; });
    body.paint(wall, [&](Point3 p, std::size_t) { return p.z < top && depth_in(p) < 0; });
}

// Vessels from the end of the aorta along the iliac veins and the groin to the thigh.
void add_leg_vessels(BodyField& body, const BodyOptions& options) {
    LabelVolume& labels = body.labels();
    const LabelSet aorta = body.with({"aorta"}), femur = body.with({"femur"});
    if (!has(labels, aorta)) return;
    const Point3 fork = lowest_of(body, labels, aorta);
    const std::uint8_t arteries[2] = {body.make("iliac_artery_right", "blood"),
                                      body.make("iliac_artery_left", "blood")};
    const std::uint8_t veins[2] = {body.make("femoral_vein_right", "blood"),
                                   body.make("femoral_vein_left", "blood")};
    const Box3 femurs = body.box_of(femur);
    const double radius = 0.5 * options.artery_mm;
    // Bowel lies on the vessels and moves: it must not interrupt them.
    const LabelSet bowel = body.with({"colon", "bowel"});
    for (int side = 0; side < 2; ++side) {
        const double sign = side == 0 ? 1 : -1;
        // The groin: in front of the femoral head and medial to it.
        const double head_x = femurs.empty() ? fork.x + sign * 88
                                             : femurs.centre().x + sign * 0.36 * femurs.extent().x;
        const double head_z = femurs.empty() ? fork.z - 170 : femurs.upper.z - 20;
        const double head_y = femurs.empty() ? fork.y + 45 : femurs.centre().y + 42;
        const Point3 groin{fork.x + 0.82 * (head_x - fork.x), head_y, head_z};
        const Point3 brim{fork.x + sign * 42, fork.y - 4, between(fork, groin, 0.45).z};
        const Point3 thigh{groin.x - sign * 4, groin.y - 8, groin.z - 120};
        std::vector<Point3> path;
        for (int n = 0; n <= 16; ++n) {
            const double t = n / 16.0;
            path.push_back(between(between(fork, brim, t), between(brim, groin, t), t));
        }
        path.push_back(thigh);
        body.paint_tube(arteries[side], path, radius, bowel);
        const Vector3 beside{-sign * (2 * radius + 2), -2, 0};
        std::vector<Point3> vein;
        for (std::size_t n = path.size() / 2; n < path.size(); ++n)
            vein.push_back(path[n] + beside);
        body.paint_tube(veins[side], vein, radius + 1, bowel);
    }
}

// A pear in the fossa under the right lobe: fundus at the front edge, neck towards the porta.
void add_gall_bladder(BodyField& body) {
    const LabelSet liver = body.with({"liver"});
    if (!has(body.labels(), liver) || has(body.labels(), body.with({"gall"}))) return;
    const LabelSet portal = body.with({"portal"});
    const Box3 box = body.box_of(liver);
    const Point3 porta = has(body.labels(), portal)
                             ? body.middle_of(portal)
                             : Point3{box.centre().x - 20, box.centre().y, box.lower.z + 60};
    const Point3 neck{porta.x + 24, porta.y + 14, porta.z - 6};
    const Point3 fundus{neck.x + 14, neck.y + 46, neck.z - 30};
    const std::uint8_t wall = body.make("gallbladder_wall", "bowel");
    const std::uint8_t bile = body.make("gallbladder", "bile");
    const auto depth_in = [&](Point3 p) {
        const Vector3 along = fundus - neck;
        const double t = std::clamp(dot(p - neck, along) / dot(along, along), 0.0, 1.0);
        return norm(p - neck - t * along) - (4 + 10 * std::sqrt(t));
    };
    body.paint(bile, [&](Point3 p, std::size_t) { return depth_in(p) < -2; });
    body.paint(wall, [&](Point3 p, std::size_t) { return depth_in(p) < 0; });
}

// Muscles of the back, buttocks and thighs around their bones; psoas and rectus.
void add_muscles(BodyField& body, const BodyOptions& options, const std::vector<float>& depth) {
    LabelVolume& labels = body.labels();
    const LabelSet column = body.with({"vertebrae"});
    const LabelSet bones =
        body.with({"vertebrae", "sacrum", "hip", "pelvis", "ilium", "pubis", "ischium", "femur"});
    const Box3 spine = body.box_of(column);
    const auto& outlines = body.outlines();
    const Grid& grid = body.grid();
    const auto outline = [&](Point3 p) -> const BodyField::Outline& {
        return outlines[static_cast<std::size_t>(std::clamp<long>(
            std::lround((p.z - grid.origin_mm.z) / body.voxel_mm()), 0, grid.size.z - 1))];
    };
    if (options.psoas && !spine.empty()) {
        const std::uint8_t muscle[2] = {body.make("iliopsoas_right", "muscle"),
                                        body.make("iliopsoas_left", "muscle")};
        const Box3 femurs = body.box_of(body.with({"femur"}));
        const double low = femurs.empty() ? spine.lower.z - 120 : femurs.upper.z - 60;
        for (int side = 0; side < 2; ++side) {
            const double sign = side == 0 ? 1 : -1;
            const double x = spine.centre().x;
            body.paint_tube(muscle[side],
                            {{x + sign * 32, spine.upper.y - 20, spine.lower.z + 150},
                             {x + sign * 42, spine.upper.y - 12, spine.lower.z + 30},
                             {x + sign * 75, spine.upper.y + 20, spine.lower.z - 60},
                             {x + sign * 92, spine.upper.y + 22, low}},
                            17);
        }
    }
    if (options.rectus) {
        const std::uint8_t rectus = body.make("rectus_abdominis", "muscle");
        body.paint(rectus, [&](Point3 p, std::size_t n) {
            const auto& line = outline(p);
            const double side = std::abs(p.x - line.middle_x);
            const double d = static_cast<double>(depth[n]);
            return p.y > 0.5 * (line.back_y + line.front_y) + 30 && side > 5 && side < 52 &&
                   d > options.fat_mm && d < options.fat_mm + 10;
        });
    }
    if (!has(labels, bones)) return;
    const std::vector<float> to_bone = body.distance_to(bones);
    const std::uint8_t back = body.make("muscle_back_and_legs", "muscle");
    body.paint(back, [&](Point3 p, std::size_t n) {
        const auto& line = outline(p);
        const bool legs = p.z < (spine.empty() ? p.z + 1 : spine.lower.z);
        const bool behind = p.y < line.back_y + 0.45 * (line.front_y - line.back_y);
        const double bone_mm = to_bone[n], depth_mm = depth[n];
        return (legs || behind) && bone_mm < options.back_muscle_mm &&
               depth_mm > 0.8 * options.fat_mm;
    });
}

// Enlarges a bladder evenly, into everything around it except bone.
void fill_bladder(BodyField& body, const BodyOptions& options) {
    LabelVolume& labels = body.labels();
    const LabelSet bladder = body.with({"bladder"}) & ~body.with({"gall"});
    if (options.bladder_ml <= 0 || !has(labels, bladder)) return;
    const double voxel_ml = body.grid().voxel_volume_mm3() / 1000;
    double now = 0;
    for (const std::uint8_t v : labels.voxels) now += bladder[v] ? voxel_ml : 0;
    if (now >= options.bladder_ml) return;
    const LabelSet bones = body.with({"hip", "pelvis", "ilium", "pubis", "ischium", "sacrum"});
    // An ellipsoid about its middle, which rises out of the pelvis as it is filled.
    const Box3 box = body.box_of(bladder);
    const double r = std::cbrt(3000 * options.bladder_ml / (4 * kPi));
    const Point3 middle = box.centre() + Vector3{0, 0.1 * r, 0.5 * r};
    std::vector<std::pair<double, std::size_t>> order;
    const Grid& grid = body.grid();
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const std::size_t n = grid.index(i, j, k);
                const Vector3 d = body.point(i, j, k) - middle;
                const double far = std::sqrt(d.x * d.x / 1.2 + d.y * d.y / 0.9 + d.z * d.z / 0.95);
                if (labels.voxels[n] == 0 || bones[labels.voxels[n]] || far > 2 * r) continue;
                order.push_back({far, n});
            }
    std::sort(order.begin(), order.end());
    std::uint8_t label = 0;
    for (std::size_t l = 1; l < 256 && label == 0; ++l)
        if (bladder[l]) label = static_cast<std::uint8_t>(l);
    const auto wanted = static_cast<std::size_t>(options.bladder_ml / voxel_ml);
    for (std::size_t n = 0; n < std::min(wanted, order.size()); ++n)
        labels.voxels[order[n].second] = label;
}

namespace {

// Above the armpits the arms are part of the trunk's slices. There the trunk is taken to be no
// wider than just below them. trunk: x of each slice's largest part; top: the highest slice from
// which an arm was removed.
struct Reach {
    double low = 0, high = 0;
};
void cut_at_armpits(BodyField& body, const std::vector<Reach>& trunk, int top) {
    constexpr double kBelowMm = 20, kSpareMm = 3;
    const Grid& grid = body.grid();
    Reach reach = trunk[top];
    for (int k = std::max(0, top - static_cast<int>(kBelowMm / body.voxel_mm())); k < top; ++k) {
        reach.low = std::min(reach.low, trunk[k].low);
        reach.high = std::max(reach.high, trunk[k].high);
    }
    for (int k = top + 1; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const double x = body.point(i, j, k).x;
                if (x < reach.low - kSpareMm || x > reach.high + kSpareMm)
                    body.labels().voxels[grid.index(i, j, k)] = 0;
            }
}

// Parts of a slice that lie to the side of the trunk become air.
void take_arms_off(BodyField& body, double beyond_mm) {
    LabelVolume& labels = body.labels();
    const Grid& grid = body.grid();
    const auto plane = static_cast<std::size_t>(grid.size.x) * grid.size.y;
    std::vector<int> part(plane);
    std::vector<std::size_t> stack;
    // The midline is that of the bounding box of the whole body.
    const Box3 box = body.box_of(~LabelSet{}.set(0));
    const double middle = box.centre().x;
    std::vector<Reach> trunk;
    int top = -1;
    for (int k = 0; k < grid.size.z; ++k) {
        std::fill(part.begin(), part.end(), -1);
        std::uint8_t* slice = labels.voxels.data() + plane * static_cast<std::size_t>(k);
        struct Part {
            std::size_t count = 0;
            double sum_x = 0;
            Reach reach{1e9, -1e9};
        };
        std::vector<Part> parts;
        for (std::size_t start = 0; start < plane; ++start) {
            if (slice[start] == 0 || part[start] >= 0) continue;
            const int number = static_cast<int>(parts.size());
            parts.push_back({});
            part[start] = number;
            stack.assign(1, start);
            while (!stack.empty()) {
                const std::size_t n = stack.back();
                stack.pop_back();
                const auto sx = static_cast<std::size_t>(grid.size.x);
                ++parts.back().count;
                const double x = body.point(static_cast<int>(n % sx), 0, 0).x;
                parts.back().sum_x += x;
                parts.back().reach.low = std::min(parts.back().reach.low, x);
                parts.back().reach.high = std::max(parts.back().reach.high, x);
                const auto visit = [&](std::size_t m) {
                    if (slice[m] == 0 || part[m] >= 0) return;
                    part[m] = number;
                    stack.push_back(m);
                };
                if (n % sx > 0) visit(n - 1);
                if (n % sx + 1 < sx) visit(n + 1);
                if (n >= sx) visit(n - sx);
                if (n + sx < plane) visit(n + sx);
            }
        }
        std::size_t largest = 0;
        trunk.push_back({});
        for (const Part& p : parts) {
            if (p.count > largest) trunk.back() = p.reach;
            largest = std::max(largest, p.count);
        }
        for (std::size_t n = 0; n < plane; ++n) {
            if (part[n] < 0) continue;
            const Part& p = parts[part[n]];
            const double off = std::abs(p.sum_x / static_cast<double>(p.count) - middle);
            // The two legs are about equally large, and stay.
            if (off > beyond_mm && 100 * p.count < 35 * largest) {
                slice[n] = 0;
                // A hand or a remnant of an arm does not show where the armpit is.
                if (100 * p.count > 3 * largest) top = k;
            }
        }
    }
    if (top >= 0) cut_at_armpits(body, trunk, top);
}

// Fills what remains: visceral fat in the cavity of the organs, subcutaneous fat, and muscle
// between the two.
void add_fat(BodyField& body, const BodyOptions& options, const std::vector<float>& depth) {
    const LabelSet organs =
        body.with({"liver",   "spleen",   "kidney", "pancreas", "colon",  "bowel",    "duodenum",
                   "stomach", "bladder",  "uterus", "ovary",    "aorta",  "cava",     "portal",
                   "artery",  "arteries", "vein",   "ureter",   "rectum", "prostate", "gall"});
    const std::vector<float> to_organs = body.distance_to(organs);
    std::vector<std::uint8_t> far(to_organs.size());
    for (std::size_t n = 0; n < far.size(); ++n)
        far[n] = static_cast<double>(to_organs[n]) > options.cavity_mm;
    const std::vector<float> to_far = body.distance_to(far);
    const double wall_mm = options.fat_mm + 0.6 * options.muscle_mm;
    std::vector<std::uint8_t> cavity(far.size());
    for (std::size_t n = 0; n < cavity.size(); ++n)
        cavity[n] = static_cast<double>(to_far[n]) > options.cavity_mm - 1 &&
                    static_cast<double>(depth[n]) > wall_mm;
    const std::vector<float> to_cavity = body.distance_to(cavity);
    const std::uint8_t visceral = body.make("visceral_fat", "fat");
    body.paint(visceral, [&](Point3, std::size_t n) { return cavity[n] != 0; });
    const std::uint8_t muscle = body.make("muscle_wall", "muscle");
    body.paint(muscle, [&](Point3, std::size_t n) {
        const double cavity_mm = to_cavity[n], depth_mm = depth[n];
        return cavity_mm < options.muscle_mm && depth_mm > 0.6 * options.fat_mm;
    });
    add_muscles(body, options, depth);
    const std::uint8_t fat = body.make("subcutaneous_fat", "fat");
    body.paint(fat, [](Point3, std::size_t) { return true; });
}

void report_shares(const LabelVolume& labels, std::size_t given, StageReport& report) {
    std::vector<std::size_t> count(labels.labels.size(), 0);
    for (const std::uint8_t v : labels.voxels) ++count[v];
    std::size_t meshes = 0, all = 0;
    for (std::size_t l = 1; l < count.size(); ++l) {
        all += count[l];
        if (l < given && labels.labels[l].name != "body") meshes += count[l];
    }
    const double share =
        all == 0 ? 0 : 100 * static_cast<double>(meshes) / static_cast<double>(all);
    report.measures.push_back({"from_meshes_percent", share});
    report.measures.push_back({"by_rule_percent", 100 - share});
    report.measures.push_back(
        {"body_volume_ml", static_cast<double>(all) * labels.grid.voxel_volume_mm3() / 1000});
    const int whole = static_cast<int>(std::lround(share));
    report.notes.push_back({"origin", std::to_string(whole) + " % of this body is from meshes, " +
                                          std::to_string(100 - whole) + " % by rule"});
}

}  // namespace

void fill_body(LabelVolume& labels,
               const BodyOptions& options,
               StageReport& report,
               const Progress& progress) {
    const std::size_t given = labels.labels.size();
    BodyField body(labels);
    if (!options.enabled || body.body() == 0) {
        report_shares(labels, given, report);
        if (body.body() == 0)
            report.warnings.push_back(
                "the table gives no node the role body, so nothing is filled "
                "in between the organs; name the skin's node");
        return;
    }
    if (options.arms_off_mm > 0) take_arms_off(body, options.arms_off_mm);
    fill_bladder(body, options);
    report_progress(progress, 0.1, "skin");
    const std::vector<float> depth = body.distance_to(LabelSet{}.set(0));
    const std::uint8_t skin = body.make("skin", "skin");
    body.paint(skin, [&](Point3, std::size_t n) {
        return static_cast<double>(depth[n]) < std::max(options.skin_mm, 0.9 * body.voxel_mm());
    });
    report_progress(progress, 0.25, "spine and chest");
    if (options.spine) add_spine(body, options);
    if (options.stomach) add_stomach(body, options);
    if (options.gall_bladder) add_gall_bladder(body);
    add_chest(body, options, depth);
    report_progress(progress, 0.5, "vessels");
    if (options.leg_vessels) add_leg_vessels(body, options);
    report_progress(progress, 0.6, "fat and muscle");
    add_fat(body, options, depth);
    report_shares(labels, given, report);
    report_progress(progress, 1, "body filled in");
}

}  // namespace sonocase::pipeline::inline import_body
