// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/torso/torso_anatomy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "pipeline/anatomy/torso/trunk.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Adds labels and solids in order.
struct Builder {
    TorsoAnatomy anatomy;

    int add_label(const std::string& name,
                  const std::string& tissue,
                  std::array<std::uint8_t, 3> colour) {
        anatomy.labels.push_back({name, tissue, static_cast<int>(anatomy.labels.size()), colour});
        return static_cast<int>(anatomy.labels.size()) - 1;
    }

    void layer(int label, double depth) {
        anatomy.solids.push_back({label, Layer{depth}, -1, {{-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9}}});
    }

    void ellipsoid(int label,
                   Point3 centre,
                   Vector3 axes,
                   Matrix3 rotation = {},
                   double within = kWallDepth_mm) {
        const double r = std::max({axes.x, axes.y, axes.z});
        anatomy.solids.push_back({label,
                                  Ellipsoid{centre, axes, transpose(rotation)},
                                  within,
                                  {centre - Vector3{r, r, r}, centre + Vector3{r, r, r}}});
    }

    void tube(int label, std::vector<Point3> path, double radius, double within = kWallDepth_mm) {
        Box3 box;
        for (Point3 p : path) {
            box.include(p - Vector3{radius, radius, radius});
            box.include(p + Vector3{radius, radius, radius});
        }
        anatomy.solids.push_back({label, Tube{std::move(path), radius}, within, box});
    }
};

// A smooth path through control points: Catmull-Rom, eight pieces per span.
std::vector<Point3> smooth_path(const std::vector<Point3>& c) {
    std::vector<Point3> path;
    const auto at = [&](int i) {
        return c[static_cast<std::size_t>(std::clamp(i, 0, static_cast<int>(c.size()) - 1))];
    };
    for (int i = 0; i + 1 < static_cast<int>(c.size()); ++i) {
        for (int k = 0; k < 8; ++k) {
            const double t = k / 8.0, t2 = t * t, t3 = t2 * t;
            Point3 p;
            for (int a = 0; a < 3; ++a) {
                p[a] = 0.5 *
                       (2 * at(i)[a] + (at(i + 1)[a] - at(i - 1)[a]) * t +
                        (2 * at(i - 1)[a] - 5 * at(i)[a] + 4 * at(i + 1)[a] - at(i + 2)[a]) * t2 +
                        (3 * at(i)[a] - at(i - 1)[a] - 3 * at(i + 1)[a] + at(i + 2)[a]) * t3);
            }
            path.push_back(p);
        }
    }
    path.push_back(c.back());
    return path;
}

void add_layers(Builder& t) {
    t.add_label("outside", "outside", {0, 0, 0});
    const int skin = t.add_label("skin", "skin", {233, 194, 166});
    const int fat = t.add_label("other_fat", "fat", {240, 218, 130});
    const int wall = t.add_label("abdominal_wall", "muscle", {178, 72, 66});
    const int inner_fat = t.add_label("visceral_fat", "fat", {226, 200, 116});
    t.layer(skin, 0);
    t.layer(fat, kSkinDepth_mm);
    t.layer(wall, kFatDepth_mm);
    t.layer(inner_fat, kWallDepth_mm);
}

void add_muscles(Builder& t) {
    const int back_left = t.add_label("autochthon_left", "muscle", {160, 60, 58});
    const int back_right = t.add_label("autochthon_right", "muscle", {160, 60, 58});
    t.ellipsoid(back_left, {-40, -70, 0}, {27, 20, 500}, {}, kFatDepth_mm);
    t.ellipsoid(back_right, {40, -70, 0}, {27, 20, 500}, {}, kFatDepth_mm);
    const int psoas_left = t.add_label("iliopsoas_left", "muscle", {168, 66, 62});
    const int psoas_right = t.add_label("iliopsoas_right", "muscle", {168, 66, 62});
    t.ellipsoid(psoas_left, {-40, -42, -90}, {18, 18, 90});
    t.ellipsoid(psoas_right, {40, -42, -90}, {18, 18, 90});
}

void add_organs(Builder& t) {
    const int bowel = t.add_label("small_bowel", "bowel", {206, 140, 120});
    t.ellipsoid(bowel, {0, 30, -82}, {80, 44, 46});
    const int spleen = t.add_label("spleen", "spleen", {140, 74, 96});
    t.ellipsoid(spleen, {-96, -22, 72}, {28, 40, 50}, rotation_about({0, 1, 0}, 0.25));
    const int liver = t.add_label("liver", "liver", {150, 70, 48});
    t.ellipsoid(liver, {62, 12, 68}, {92, 66, 58}, rotation_about({0, 1, 0}, 0.35));
    const int kidney_left = t.add_label("kidney_left", "kidney_cortex", {186, 92, 74});
    const int kidney_right = t.add_label("kidney_right", "kidney_cortex", {186, 92, 74});
    t.ellipsoid(kidney_left, {-68, -40, 12}, {27, 23, 52}, rotation_about({0, 1, 0}, 0.18));
    t.ellipsoid(kidney_right, {70, -40, 0}, {27, 23, 52}, rotation_about({0, 1, 0}, -0.18));
    const int stomach = t.add_label("stomach", "bowel", {214, 150, 140});
    t.ellipsoid(stomach, {-60, 28, 62}, {44, 34, 46}, rotation_about({0, 1, 0}, 0.5));
    const int pancreas = t.add_label("pancreas", "pancreas", {218, 176, 110});
    t.tube(pancreas, smooth_path({{38, 0, 12}, {10, 12, 22}, {-25, 4, 30}, {-66, -16, 44}}), 10);
    const int gallbladder = t.add_label("gallbladder", "bile", {96, 150, 74});
    t.ellipsoid(gallbladder, {52, 50, 22}, {14, 13, 30}, rotation_about({1, 0, 0}, 0.4));
    const int colon = t.add_label("colon", "bowel", {190, 128, 104});
    const auto colon_path = smooth_path({{98, -6, -125},
                                         {104, 2, -70},
                                         {92, 20, -28},
                                         {40, 58, -34},
                                         {-30, 60, -30},
                                         {-90, 24, -16},
                                         {-104, 0, -70},
                                         {-98, -8, -125}});
    t.tube(colon, colon_path, 17);
    const int bladder = t.add_label("urinary_bladder", "urine", {226, 214, 120});
    t.ellipsoid(bladder, {0, 34, -138}, {36, 30, 28});
    const int lung_left = t.add_label("lung_lower_lobe_left", "lung", {150, 170, 200});
    const int lung_right = t.add_label("lung_lower_lobe_right", "lung", {150, 170, 200});
    t.ellipsoid(lung_left, {-72, -10, 172}, {58, 74, 52});
    t.ellipsoid(lung_right, {72, -10, 186}, {58, 74, 52});

    const int gas = t.add_label("gas_in_body", "gas", {60, 60, 90});
    t.ellipsoid(gas, {-60, 46, 66}, {28, 12, 30}, rotation_about({0, 1, 0}, 0.5));
    t.tube(gas, smooth_path({{92, 26, -26}, {40, 63, -32}, {-30, 65, -28}, {-84, 32, -14}}), 10);
}

void add_vessels(Builder& t) {
    const int aorta = t.add_label("aorta", "blood", {208, 40, 40});
    t.tube(aorta, smooth_path({{-6, -30, 240}, {-9, -26, 100}, {-7, -20, 0}, {-3, -18, -92}}), 10);
    const int iliac_left = t.add_label("iliac_artery_left", "blood", {208, 40, 40});
    const int iliac_right = t.add_label("iliac_artery_right", "blood", {208, 40, 40});
    t.tube(iliac_left, smooth_path({{-3, -18, -92}, {-22, -14, -120}, {-48, 4, -240}}), 5);
    t.tube(iliac_right, smooth_path({{-3, -18, -92}, {18, -14, -120}, {48, 4, -240}}), 5);
    const int cava = t.add_label("inferior_vena_cava", "blood", {60, 80, 190});
    t.tube(cava,
           smooth_path(
               {{26, -14, 240}, {24, -18, 100}, {20, -24, 0}, {18, -26, -96}, {30, -22, -240}}),
           11);
    const int portal = t.add_label("portal_vein_and_splenic_vein", "blood", {70, 96, 200});
    t.tube(portal, smooth_path({{12, 0, 26}, {36, 2, 48}, {66, 4, 64}, {96, -4, 70}}), 5);
    const int hepatic3 = t.add_label("hepatic_vein_3mm", "blood", {84, 110, 206});
    t.tube(hepatic3, smooth_path({{30, -12, 100}, {58, -2, 92}, {96, 14, 84}, {118, 20, 60}}), 3);
    const int hepatic2 = t.add_label("hepatic_vein_2mm", "blood", {98, 124, 212});
    t.tube(hepatic2, smooth_path({{26, -6, 96}, {44, 22, 86}, {62, 46, 62}, {84, 54, 48}}), 2);
    const int artery = t.add_label("hepatic_artery_1p5mm", "blood", {222, 80, 70});
    t.tube(artery, smooth_path({{10, 8, 30}, {40, 16, 44}, {72, 26, 40}, {106, 20, 36}}), 1.5);
}

void add_spine(Builder& t) {
    const int disc = t.add_label("intervertebral_discs", "cartilage", {170, 186, 190});
    t.tube(disc, {{0, -60, -260}, {0, -60, 260}}, 19, kFatDepth_mm);
    const char* const vertebrae[] = {"vertebrae_S1",  "vertebrae_L5",  "vertebrae_L4",
                                     "vertebrae_L3",  "vertebrae_L2",  "vertebrae_L1",
                                     "vertebrae_T12", "vertebrae_T11", "vertebrae_T10"};
    for (int i = 0; i < 9; ++i) {
        const int v = t.add_label(vertebrae[i], "bone", {226, 218, 196});
        const double z = -160 + 40 * i;
        t.ellipsoid(v, {0, -60, z}, {23, 18, 19}, {}, kFatDepth_mm);
        t.tube(v, {{0, -62, z}, {0, -88, z - 8}}, 5, kSkinDepth_mm);
        t.tube(v, {{-34, -70, z}, {34, -70, z}}, 5, kFatDepth_mm);
    }
}

void add_ribs(Builder& t) {
    for (int side = -1; side <= 1; side += 2) {
        for (int n = 8; n <= 11; ++n) {
            const int rib = t.add_label(
                std::string("rib_") + (side < 0 ? "left_" : "right_") + std::to_string(n), "bone",
                {236, 228, 206});
            std::vector<Point3> control;
            const double end = n == 11 ? 0.15 * kPi : 0.3 * kPi;
            for (int k = 0; k <= 8; ++k) {
                const double s = k / 8.0;
                const double angle =
                    -0.42 * kPi + s * (end + 0.42 * kPi);  // from the spine forwards
                const double z = 128 - 26 * (n - 8) - 44 * s + 22 * s * s;
                Point3 p = trunk_point(angle, z, 19, 12);
                control.push_back({side * p.x, p.y, p.z});
            }
            t.tube(rib, smooth_path(control), 4.5, kFatDepth_mm);
        }
    }
}

// Tubes side by side, each in its own plane x = const: up towards head and front, 50 degrees from
// the y axis, 30 mm below the skin at z = 0.
void add_tubes(Builder& t) {
    constexpr double kPitch = 30, kDeep = 30, kHalfLength = 34, kSkin = kSkinDepth_mm;
    const Vector3 along{0, std::cos(kPi * 50 / 180), std::sin(kPi * 50 / 180)};
    const auto at = [&](double x, double s) {
        double low = 0, high = 200;  // the skin above (x, 0)
        for (int i = 0; i < 60; ++i) {
            const double y = 0.5 * (low + high);
            (trunk({x, y, 0}, 0, 0) < 0 ? low : high) = y;
        }
        return Point3{x, low - kDeep, 0} + s * along;
    };
    // A quarter of a millimetre off the lattice of a map of 1 mm: on it, both walls of a tube of 4
    // mm would fall on voxel centres, and 13 % of its section be lost.
    double x = -2 * kPitch + 0.25;
    for (const int diameter : {4, 6, 8, 12}) {
        const int label =
            t.add_label("phantom_tube_" + std::to_string(diameter) + "mm", "blood", {170, 40, 40});
        t.tube(label, {at(x, -kHalfLength), at(x, kHalfLength)}, diameter / 2.0, kSkin);
        x += kPitch;
    }
    // Wide, narrow over 12 mm, wide: round ends of the wide parts make the throat.
    const int label = t.add_label("phantom_stenosis", "blood", {200, 60, 60});
    t.tube(label, {at(x, -kHalfLength), at(x, -11)}, 5, kSkin);
    t.tube(label, {at(x, -11), at(x, 11)}, 3, kSkin);
    t.tube(label, {at(x, 11), at(x, kHalfLength)}, 5, kSkin);
}

}  // namespace

const TorsoAnatomy& tube_phantom() {
    static const TorsoAnatomy instance = [] {
        Builder t;
        t.add_label("outside", "outside", {0, 0, 0});
        t.layer(t.add_label("skin", "skin", {233, 194, 166}), 0);
        t.layer(t.add_label("phantom_tissue", "liver", {150, 110, 100}), kSkinDepth_mm);
        add_tubes(t);
        return std::move(t.anatomy);
    }();
    return instance;
}

const TorsoAnatomy& torso_anatomy() {
    static const TorsoAnatomy instance = [] {
        Builder t;
        add_layers(t);
        add_muscles(t);
        add_organs(t);
        add_vessels(t);
        add_spine(t);
        add_ribs(t);
        return std::move(t.anatomy);
    }();
    return instance;
}

}  // namespace sonocase::pipeline
