// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/torso_anatomy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "formats/base/constants.h"

namespace sonocase::pipeline::inline anatomy {

namespace {

double bump(double z, double centre, double width) {
    const double t = (z - centre) / width;
    return std::exp(-t * t);
}

struct Section {  // half-axes and centre, mm
    double a, b, c;
};

Section section(double z, double depth, double belly_mm) {
    return {150 + 14 * bump(z, 150, 90) + 10 * bump(z, -150, 70) - 4 * bump(z, 10, 50) - depth,
            100 + 6 * bump(z, 140, 80) + belly_mm * bump(z, -40, 70) - depth,
            0.5 * belly_mm * bump(z, -40, 70) + 3 * bump(z, 120, 60)};
}

}  // namespace

double trunk(Point3 p, double depth_mm, double belly_mm) {
    const Section s = section(p.z, depth_mm, belly_mm);
    const double y = (p.y - s.c) / s.b;
    return std::pow(std::abs(p.x / s.a), 2.3) + std::pow(std::abs(y), y > 0 ? 2.0 : 2.8) - 1;
}

Point3 trunk_point(double theta, double z, double depth_mm, double belly_mm) {
    const double c = section(z, depth_mm, belly_mm).c;
    double low = 0, high = 400;  // of the radius
    for (int i = 0; i < 60; ++i) {
        const double r = 0.5 * (low + high);
        const Point3 p{r * std::cos(theta), c + r * std::sin(theta), z};
        (trunk(p, depth_mm, belly_mm) < 0 ? low : high) = r;
    }
    return {low * std::cos(theta), c + low * std::sin(theta), z};
}

namespace {

double squared_distance_to_segment(Point3 p, Point3 a, Point3 b) {
    const Vector3 ab = b - a;
    const double t = std::clamp(dot(p - a, ab) / dot(ab, ab), 0.0, 1.0);
    const Vector3 off = p - (a + t * ab);
    return dot(off, off);
}

double tube_distance(const Tube& tube, Point3 p) {
    double best2 = INFINITY;
    for (std::size_t i = 0; i + 1 < tube.path.size(); ++i) {
        best2 = std::min(best2, squared_distance_to_segment(p, tube.path[i], tube.path[i + 1]));
    }
    return std::sqrt(best2) - tube.radius;
}

double ellipsoid_value(const Ellipsoid& e, Point3 p) {
    const Vector3 q = e.local_from_ct * (p - e.centre);
    return (q.x / e.axes.x) * (q.x / e.axes.x) + (q.y / e.axes.y) * (q.y / e.axes.y) +
           (q.z / e.axes.z) * (q.z / e.axes.z) - 1;
}

// Distance from p to the zero set of a smooth implicit function f. The nearest point is found by
// iteration: onto the surface along the gradient, then along the surface towards p, until neither
// step moves it. The sign is that of f(p).
template <class F>
double implicit_distance(const F& f, Point3 p) {
    const auto gradient = [&](Point3 x) {
        constexpr double h = 1e-4;
        return Vector3{f({x.x + h, x.y, x.z}) - f({x.x - h, x.y, x.z}),
                       f({x.x, x.y + h, x.z}) - f({x.x, x.y - h, x.z}),
                       f({x.x, x.y, x.z + h}) - f({x.x, x.y, x.z - h})} /
               (2 * h);
    };
    Point3 nearest = p;
    double best = INFINITY;
    for (int i = 0; i < 400; ++i) {
        for (int k = 0; k < 20; ++k) {
            const Vector3 g = gradient(nearest);
            const double step = f(nearest) / std::max(dot(g, g), 1e-12);
            // At most 20 mm per step: deep inside an ellipsoid the gradient vanishes and the step
            // grows without bound.
            const Vector3 move = step * g;
            const double length = norm(move);
            nearest = nearest - (length > 20 ? 20 / length : 1.0) * move;
            if (length < 1e-10) break;
        }
        const Vector3 n = normalized(gradient(nearest));
        const Vector3 to_p = p - nearest;
        const Vector3 along = to_p - dot(to_p, n) * n;
        best = std::min(best, norm(to_p));
        if (norm(along) < 1e-9) break;
        nearest = nearest + 0.6 * along;
    }
    return f(p) < 0 ? -best : best;
}

}  // namespace

bool inside(const Solid& solid, Point3 p, double belly_mm) {
    if (!solid.box.contains(p)) return false;
    if (const auto* e = std::get_if<Ellipsoid>(&solid.shape)) {
        if (ellipsoid_value(*e, p) >= 0) return false;
    } else if (const auto* tube = std::get_if<Tube>(&solid.shape)) {
        if (tube_distance(*tube, p) >= 0) return false;
    } else {
        return trunk(p, std::get<Layer>(solid.shape).depth, belly_mm) < 0;
    }
    return solid.within_depth < 0 || trunk(p, solid.within_depth, belly_mm) < 0;
}

double solid_distance(const Solid& solid, Point3 p, double belly_mm, double reach_mm) {
    Vector3 gap;
    for (int a = 0; a < 3; ++a) {
        gap[a] = std::max({solid.box.lower[a] - p[a], p[a] - solid.box.upper[a], 0.0});
    }
    if (norm(gap) > reach_mm) return norm(gap);
    const auto layer = [&](double depth) {
        // A layer that is deeper by some length is more than half that length away.
        if (trunk(p, depth + 2 * reach_mm, belly_mm) < 0) return -reach_mm;
        if (trunk(p, depth - 2 * reach_mm, belly_mm) > 0) return reach_mm;
        return implicit_distance([&](Point3 x) { return trunk(x, depth, belly_mm); }, p);
    };
    double d;
    if (const auto* e = std::get_if<Ellipsoid>(&solid.shape)) {
        // The ellipsoid through p is a scaled copy; the two are closest along the shortest axis.
        const double bound = (std::sqrt(ellipsoid_value(*e, p) + 1) - 1) *
                             std::min({e->axes.x, e->axes.y, e->axes.z});
        if (std::abs(bound) > reach_mm) {
            d = bound;
        } else {
            d = implicit_distance([&](Point3 x) { return ellipsoid_value(*e, x); }, p);
        }
    } else if (const auto* tube = std::get_if<Tube>(&solid.shape)) {
        d = tube_distance(*tube, p);
    } else {
        return layer(std::get<Layer>(solid.shape).depth);
    }
    return solid.within_depth < 0 || d > reach_mm ? d : std::max(d, layer(solid.within_depth));
}

namespace {

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
                   double within = kWallDepthMm) {
        const double r = std::max({axes.x, axes.y, axes.z});
        anatomy.solids.push_back({label,
                                  Ellipsoid{centre, axes, transpose(rotation)},
                                  within,
                                  {centre - Vector3{r, r, r}, centre + Vector3{r, r, r}}});
    }

    void tube(int label, std::vector<Point3> path, double radius, double within = kWallDepthMm) {
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
    const auto at = [&](int i) { return c[std::clamp(i, 0, static_cast<int>(c.size()) - 1)]; };
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
    t.layer(fat, kSkinDepthMm);
    t.layer(wall, kFatDepthMm);
    t.layer(inner_fat, kWallDepthMm);
}

void add_muscles(Builder& t) {
    const int back_left = t.add_label("autochthon_left", "muscle", {160, 60, 58});
    const int back_right = t.add_label("autochthon_right", "muscle", {160, 60, 58});
    t.ellipsoid(back_left, {-40, -70, 0}, {27, 20, 500}, {}, kFatDepthMm);
    t.ellipsoid(back_right, {40, -70, 0}, {27, 20, 500}, {}, kFatDepthMm);
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
    t.tube(disc, {{0, -60, -260}, {0, -60, 260}}, 19, kFatDepthMm);
    const char* const vertebrae[] = {"vertebrae_S1",  "vertebrae_L5",  "vertebrae_L4",
                                     "vertebrae_L3",  "vertebrae_L2",  "vertebrae_L1",
                                     "vertebrae_T12", "vertebrae_T11", "vertebrae_T10"};
    for (int i = 0; i < 9; ++i) {
        const int v = t.add_label(vertebrae[i], "bone", {226, 218, 196});
        const double z = -160 + 40 * i;
        t.ellipsoid(v, {0, -60, z}, {23, 18, 19}, {}, kFatDepthMm);
        t.tube(v, {{0, -62, z}, {0, -88, z - 8}}, 5, kSkinDepthMm);
        t.tube(v, {{-34, -70, z}, {34, -70, z}}, 5, kFatDepthMm);
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
                // From the spine forwards.
                const double angle = -0.42 * kPi + s * (end + 0.42 * kPi);
                const double z = 128 - 26 * (n - 8) - 44 * s + 22 * s * s;
                Point3 p = trunk_point(angle, z, 19, 12);
                control.push_back({side * p.x, p.y, p.z});
            }
            t.tube(rib, smooth_path(control), 4.5, kFatDepthMm);
        }
    }
}

// Tubes side by side, each in its own plane x = const: up towards head and front, 50 degrees from
// the y axis, 30 mm below the skin at z = 0.
void add_tubes(Builder& t) {
    constexpr double kPitch = 30, kDeep = 30, kHalfLength = 34, kSkin = kSkinDepthMm;
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
        t.layer(t.add_label("phantom_tissue", "liver", {150, 110, 100}), kSkinDepthMm);
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

}  // namespace sonocase::pipeline::inline anatomy
