// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "pipeline/import/body/body_field.h"

namespace sonocase::pipeline {
namespace {

// The middle of a set's lowest slice.
Point3 lowest_of(const BodyField& body, const LabelVolume& labels, const LabelBits& bits) {
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

bool has(const LabelVolume& labels, const LabelBits& bits) {
    return std::any_of(labels.voxels.begin(), labels.voxels.end(),
                       [&](std::uint8_t v) { return bits[v]; });
}

Point3 between(Point3 a, Point3 b, double t) {
    return a + t * (b - a);
}

}  // namespace

// A chain of balls from the hiatus, left of the spine under the diaphragm, to the duodenum.
void add_stomach(BodyField& body, const BodyOptions& options) {
    const LabelBits spleen = body.with({"spleen"}), duodenum = body.with({"duodenum"}),
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
        double least = 1e9;
        for (std::size_t n = 0; n + 1 < chain.size(); ++n) {
            const Vector3 along = chain[n + 1].first - chain[n].first;
            const double t =
                std::clamp(dot(p - chain[n].first, along) / dot(along, along), 0.0, 1.0);
            const double r = chain[n].second + t * (chain[n + 1].second - chain[n].second);
            least = std::min(least, norm(p - chain[n].first - t * along) - r);
        }
        return least;
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

// From the end of the aorta along the iliac veins and the groin to the thigh.
void add_leg_vessels(BodyField& body, const BodyOptions& options) {
    LabelVolume& labels = body.labels();
    const LabelBits aorta = body.with({"aorta"}), femur = body.with({"femur"});
    if (!has(labels, aorta)) return;
    const Point3 fork = lowest_of(body, labels, aorta);
    const std::uint8_t arteries[2] = {body.make("iliac_artery_right", "blood"),
                                      body.make("iliac_artery_left", "blood")};
    const std::uint8_t veins[2] = {body.make("femoral_vein_right", "blood"),
                                   body.make("femoral_vein_left", "blood")};
    const Box3 femurs = body.box_of(femur);
    const double radius = 0.5 * options.artery_mm;
    // Bowel lies on the vessels and moves: it must not interrupt them.
    const LabelBits bowel = body.with({"colon", "bowel"});
    for (int side = 0; side < 2; ++side) {
        const double sign = side == 0 ? 1 : -1;
        // The groin: before and inside of the femoral head.
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
    const LabelBits liver = body.with({"liver"});
    if (!has(body.labels(), liver) || has(body.labels(), body.with({"gall"}))) return;
    const LabelBits portal = body.with({"portal"});
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

// Muscles of the back, buttocks and thighs about their bones; psoas and rectus.
void add_muscles(BodyField& body, const BodyOptions& options, const std::vector<float>& depth) {
    LabelVolume& labels = body.labels();
    const LabelBits column = body.with({"vertebrae"});
    const LabelBits bones =
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
        return (legs || behind) &&
               static_cast<double>(
                   to_bone[n])<options.back_muscle_mm&& static_cast<double>(depth[n])> 0.8 *
                   options.fat_mm;
    });
}

// An empty bladder grows evenly, into whatever but bone lies about it.
void fill_bladder(BodyField& body, const BodyOptions& options) {
    LabelVolume& labels = body.labels();
    const LabelBits bladder = body.with({"bladder"}) & ~body.with({"gall"});
    if (options.bladder_ml <= 0 || !has(labels, bladder)) return;
    const double voxel_ml = body.grid().voxel_volume_mm3() / 1000;
    double now = 0;
    for (const std::uint8_t v : labels.voxels) now += bladder[v] ? voxel_ml : 0;
    if (now >= options.bladder_ml) return;
    const LabelBits bones = body.with({"hip", "pelvis", "ilium", "pubis", "ischium", "sacrum"});
    // An ellipsoid about its middle, which rises out of the pelvis as it fills.
    const Box3 box = body.box_of(bladder);
    const double r = std::cbrt(3000 * options.bladder_ml / (4 * 3.14159265));
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

}  // namespace sonocase::pipeline
