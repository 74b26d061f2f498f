// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/analytic_torso.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <random>
#include <variant>

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kHalfHeight = 155;  // of the patient's grid, mm
constexpr double kSkin = 2, kFat = 13,
                 kWall = 25;  // depths below the surface at which layers end, mm

// ---- the trunk
// -------------------------------------------------------------------------------------
// Cross-section at height z: |x / a|^2.3 + |(y - c) / b|^p = 1 with p = 2 in front and 2.8 behind,
// so that the back is flatter than the belly. A layer `depth` mm below the surface shrinks a and b
// by it.

double bump(double z, double centre, double width) {
    const double t = (z - centre) / width;
    return std::exp(-t * t);
}

struct Section {
    double a, b, c;
};

Section section(double z, double depth, double belly_mm) {
    return {150 + 14 * bump(z, 150, 90) + 10 * bump(z, -150, 70) - 4 * bump(z, 10, 50) - depth,
            100 + 6 * bump(z, 140, 80) + belly_mm * bump(z, -40, 70) - depth,
            0.5 * belly_mm * bump(z, -40, 70) + 3 * bump(z, 120, 60)};
}

double trunk(Point3 p, double depth, double belly_mm) {
    const Section s = section(p.z, depth, belly_mm);
    const double y = (p.y - s.c) / s.b;
    return std::pow(std::abs(p.x / s.a), 2.3) + std::pow(std::abs(y), y > 0 ? 2.0 : 2.8) - 1;
}

// Point of a layer in direction theta (0 right, pi/2 front) at height z, by bisection on the
// radius.
Point3 trunk_point(double theta, double z, double depth, double belly_mm) {
    const double c = section(z, depth, belly_mm).c;
    double low = 0, high = 400;
    for (int i = 0; i < 60; ++i) {
        const double r = 0.5 * (low + high);
        const Point3 p{r * std::cos(theta), c + r * std::sin(theta), z};
        (trunk(p, depth, belly_mm) < 0 ? low : high) = r;
    }
    return {low * std::cos(theta), c + low * std::sin(theta), z};
}

// ---- solids
// ----------------------------------------------------------------------------------------

struct Ellipsoid {
    Point3 centre;
    Vector3 axes;
    Matrix3 local_from_ct;  // rotation
};

struct Tube {  // a chain of capsules
    std::vector<Point3> path;
    double radius;
};

struct Layer {  // everything deeper than `depth` below the skin
    double depth;
};

struct Solid {
    int label;
    std::variant<Ellipsoid, Tube, Layer> shape;
    double within_depth;  // the part that lies deeper than this below the skin; < 0: all of it
    Box3 box;
};

double capsule_distance(Point3 p, Point3 a, Point3 b) {
    const Vector3 ab = b - a;
    const double t = std::clamp(dot(p - a, ab) / dot(ab, ab), 0.0, 1.0);
    return distance(p, a + t * ab);
}

double tube_distance(const Tube& tube, Point3 p) {
    double best = INFINITY;
    for (std::size_t i = 0; i + 1 < tube.path.size(); ++i) {
        best = std::min(best, capsule_distance(p, tube.path[i], tube.path[i + 1]));
    }
    return best - tube.radius;
}

double ellipsoid_value(const Ellipsoid& e, Point3 p) {
    const Vector3 q = e.local_from_ct * (p - e.centre);
    return (q.x / e.axes.x) * (q.x / e.axes.x) + (q.y / e.axes.y) * (q.y / e.axes.y) +
           (q.z / e.axes.z) * (q.z / e.axes.z) - 1;
}

// Distance to the zero set of a smooth implicit function by foot-point iteration: onto the surface
// along the gradient, then along the surface towards p, until neither moves. The sign is f's.
template <class F>
double implicit_distance(const F& f, Point3 p) {
    const auto gradient = [&](Point3 x) {
        constexpr double h = 1e-4;
        return Vector3{f({x.x + h, x.y, x.z}) - f({x.x - h, x.y, x.z}),
                       f({x.x, x.y + h, x.z}) - f({x.x, x.y - h, x.z}),
                       f({x.x, x.y, x.z + h}) - f({x.x, x.y, x.z - h})} /
               (2 * h);
    };
    Point3 foot = p;
    double best = INFINITY;
    for (int i = 0; i < 400; ++i) {
        for (int k = 0; k < 20; ++k) {
            const Vector3 g = gradient(foot);
            const double step = f(foot) / std::max(dot(g, g), 1e-12);
            // At most 20 mm at once: far inside an ellipsoid the gradient fades and the step
            // explodes.
            const Vector3 move = step * g;
            const double length = norm(move);
            foot = foot - (length > 20 ? 20 / length : 1.0) * move;
            if (length < 1e-10) break;
        }
        const Vector3 n = normalized(gradient(foot));
        const Vector3 to_p = p - foot;
        const Vector3 along = to_p - dot(to_p, n) * n;
        best = std::min(best, norm(to_p));
        if (norm(along) < 1e-9) break;
        foot = foot + 0.6 * along;
    }
    return f(p) < 0 ? -best : best;
}

// ---- anatomy
// ---------------------------------------------------------------------------------------

struct Anatomy {
    std::vector<Label> labels;
    std::vector<Solid> solids;  // later solids win

    int add_label(const std::string& name,
                  const std::string& tissue,
                  std::array<std::uint8_t, 3> colour) {
        labels.push_back({name, tissue, static_cast<int>(labels.size()), colour});
        return static_cast<int>(labels.size()) - 1;
    }

    void layer(int label, double depth) {
        solids.push_back({label, Layer{depth}, -1, {{-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9}}});
    }

    void ellipsoid(
        int label, Point3 centre, Vector3 axes, Matrix3 rotation = {}, double within = kWall) {
        const double r = std::max({axes.x, axes.y, axes.z});
        solids.push_back({label,
                          Ellipsoid{centre, axes, transpose(rotation)},
                          within,
                          {centre - Vector3{r, r, r}, centre + Vector3{r, r, r}}});
    }

    void tube(int label, std::vector<Point3> path, double radius, double within = kWall) {
        Box3 box;
        for (Point3 p : path) {
            box.include(p - Vector3{radius, radius, radius});
            box.include(p + Vector3{radius, radius, radius});
        }
        solids.push_back({label, Tube{std::move(path), radius}, within, box});
    }
};

// A smooth path through control points: Catmull-Rom, eight pieces a span.
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

Anatomy make_anatomy() {
    Anatomy t;
    t.add_label("outside", "outside", {0, 0, 0});
    const int skin = t.add_label("skin", "skin", {233, 194, 166});
    const int fat = t.add_label("other_fat", "fat", {240, 218, 130});
    const int wall = t.add_label("abdominal_wall", "muscle", {178, 72, 66});
    const int inner_fat = t.add_label("visceral_fat", "fat", {226, 200, 116});
    t.layer(skin, 0);
    t.layer(fat, kSkin);
    t.layer(wall, kFat);
    t.layer(inner_fat, kWall);

    const int back_left = t.add_label("autochthon_left", "muscle", {160, 60, 58});
    const int back_right = t.add_label("autochthon_right", "muscle", {160, 60, 58});
    t.ellipsoid(back_left, {-40, -70, 0}, {27, 20, 500}, {}, kFat);
    t.ellipsoid(back_right, {40, -70, 0}, {27, 20, 500}, {}, kFat);
    const int psoas_left = t.add_label("iliopsoas_left", "muscle", {168, 66, 62});
    const int psoas_right = t.add_label("iliopsoas_right", "muscle", {168, 66, 62});
    t.ellipsoid(psoas_left, {-40, -42, -90}, {18, 18, 90});
    t.ellipsoid(psoas_right, {40, -42, -90}, {18, 18, 90});

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

    const int disc = t.add_label("intervertebral_discs", "cartilage", {170, 186, 190});
    t.tube(disc, {{0, -60, -260}, {0, -60, 260}}, 19, kFat);
    const char* const vertebrae[] = {"vertebrae_S1",  "vertebrae_L5",  "vertebrae_L4",
                                     "vertebrae_L3",  "vertebrae_L2",  "vertebrae_L1",
                                     "vertebrae_T12", "vertebrae_T11", "vertebrae_T10"};
    for (int i = 0; i < 9; ++i) {
        const int v = t.add_label(vertebrae[i], "bone", {226, 218, 196});
        const double z = -160 + 40 * i;
        t.ellipsoid(v, {0, -60, z}, {23, 18, 19}, {}, kFat);
        t.tube(v, {{0, -62, z}, {0, -88, z - 8}}, 5, kSkin);
        t.tube(v, {{-34, -70, z}, {34, -70, z}}, 5, kFat);
    }
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
            t.tube(rib, smooth_path(control), 4.5, kFat);
        }
    }
    return t;
}

const Anatomy& anatomy() {
    static const Anatomy instance = make_anatomy();
    return instance;
}

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

// Beyond `reach` a bound stands for the distance: it has its sign and is at least reach.
double solid_distance(const Solid& solid, Point3 p, double reach) {
    Vector3 gap;
    for (int a = 0; a < 3; ++a) {
        gap[a] = std::max({solid.box.lower[a] - p[a], p[a] - solid.box.upper[a], 0.0});
    }
    if (norm(gap) > reach) return norm(gap);
    const double belly_mm = AnalyticBody{}.belly_mm;
    const auto layer = [&](double depth) {
        // A layer a millimetre deeper lies more than half a millimetre away.
        if (trunk(p, depth + 2 * reach, belly_mm) < 0) return -reach;
        if (trunk(p, depth - 2 * reach, belly_mm) > 0) return reach;
        return implicit_distance([&](Point3 x) { return trunk(x, depth, belly_mm); }, p);
    };
    double d;
    if (const auto* e = std::get_if<Ellipsoid>(&solid.shape)) {
        // The ellipsoid through p is a scaled one; along its shortest axis they are closest.
        const double least = (std::sqrt(ellipsoid_value(*e, p) + 1) - 1) *
                             std::min({e->axes.x, e->axes.y, e->axes.z});
        if (std::abs(least) > reach) {
            d = least;
        } else {
            d = implicit_distance([&](Point3 x) { return ellipsoid_value(*e, x); }, p);
        }
    } else if (const auto* tube = std::get_if<Tube>(&solid.shape)) {
        d = tube_distance(*tube, p);
    } else {
        return layer(std::get<Layer>(solid.shape).depth);
    }
    return solid.within_depth < 0 || d > reach ? d : std::max(d, layer(solid.within_depth));
}

// Not std::normal_distribution: its sequence differs between standard libraries.
class Gaussian {
  public:
    explicit Gaussian(std::uint64_t seed) : engine_(seed) {}
    double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    double operator()() {
        const double u = 1 - uniform(), v = uniform();
        return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
    }

  private:
    std::mt19937_64 engine_;
};

// Body to standard torso: organs follow the change of proportion.
Point3 standard_point(Point3 p, const AnalyticBody& body) {
    return {p.x / body.width_scale, p.y / body.depth_scale, p.z};
}

}  // namespace

std::vector<std::string> analytic_body_names() {
    return {"standard", "slender"};
}

std::optional<AnalyticBody> analytic_body(std::string_view name) {
    if (name == "standard") return AnalyticBody{};
    if (name == "slender") return AnalyticBody{0.88, 0.92, 4, 2};
    return std::nullopt;
}

std::vector<Label> analytic_torso_labels() {
    return anatomy().labels;
}

std::uint8_t analytic_torso_label(Point3 ct, const AnalyticBody& body) {
    const Point3 p = standard_point(ct, body);
    const auto& solids = anatomy().solids;
    if (!inside(solids.front(), p, body.belly_mm)) return 0;
    for (auto it = solids.rbegin(); it != solids.rend(); ++it) {
        if (inside(*it, p, body.belly_mm)) return static_cast<std::uint8_t>(it->label);
    }
    return 0;
}

double analytic_torso_signed_distance(int label, Point3 ct, double reach_mm) {
    // Region of a label: the union over its solids of (solid minus all later solids of other
    // labels).
    const auto& solids = anatomy().solids;
    assert(label >= 0 && label < static_cast<int>(anatomy().labels.size()));
    if (label == 0) return -solid_distance(solids.front(), ct, reach_mm);
    double region = INFINITY, later = INFINITY;
    for (auto it = solids.rbegin(); it != solids.rend(); ++it) {
        const double d = solid_distance(*it, ct, reach_mm);
        if (it->label == label) {
            region = std::min(region, std::max(d, -later));
        } else {
            later = std::min(later, d);
        }
    }
    return region;
}

Grid analytic_torso_grid(Vector3 spacing_mm) {
    Grid grid;
    grid.spacing_mm = spacing_mm;
    const Vector3 half{175, 130, kHalfHeight};
    for (int a = 0; a < 3; ++a) {
        grid.size[a] = static_cast<int>(std::floor(2 * half[a] / spacing_mm[a])) + 1;
        grid.origin_mm[a] = -0.5 * spacing_mm[a] * (grid.size[a] - 1);
    }
    return grid;
}

LabelVolume sample_analytic_torso(const Grid& grid, const AnalyticBody& body) {
    LabelVolume out{grid, std::vector<std::uint8_t>(grid.voxel_count()), analytic_torso_labels()};
    parallel_for(static_cast<std::size_t>(grid.size.z), 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                for (int i = 0; i < grid.size.x; ++i) {
                    const Point3 p = grid.point_from_voxel(
                        {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)});
                    out.voxels[grid.index(i, j, k)] = analytic_torso_label(p, body);
                }
            }
        }
    });
    return out;
}

Registration analytic_torso_truth(double strength, const AnalyticBody& body) {
    // The mannequin's axes differ from the patient's: x to his left, y to the head, z to the front.
    const bool second = body.warp == 2;
    const Matrix3 axes = Matrix3::from_columns({-1, 0, 0}, {0, 0, 1}, {0, 1, 0});
    const Matrix3 tilt = second ? rotation_about(normalized({1, -0.3, 0.5}), 0.17)
                                : rotation_about(normalized({0.4, 1, -0.3}), 0.21);
    const Rigid rigid{tilt * axes, second ? Vector3{-48, 15, 30} : Vector3{35, -20, 12}};
    Registration truth;
    truth.mannequin_from_ct = rigid;
    constexpr double kScale = 150;
    truth.quadratic = QuadraticMap::from_rigid(rigid, {0, 0, 0}, kScale);
    // Extra terms in the patient's axes, mm per unit of u = p / 150: x, y, z; xx, yy, zz; xy, xz,
    // yz.
    constexpr double kFirst[3][9] = {{9, 2, -2, 1.5, 1, 3, 4, 6, -2},
                                     {-2, 11, 3, 3, 4, -6, -3, 2, 7},
                                     {1, -3, 6, 4, -2, 3, 2, -3, 4}};
    constexpr double kSecond[3][9] = {{10, -3, 3, -2, 3, -2, -4, 3, 3},
                                      {3, -5, 2, -3, 2, 6, 3, -3, -3},
                                      {-3, 3, -8, 3, 4, -3, -3, 4, 2}};
    const auto& extra = second ? kSecond : kFirst;
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 9; ++c) {
            for (int a = 0; a < 3; ++a) {
                truth.quadratic
                    .coefficients[static_cast<std::size_t>(r)][static_cast<std::size_t>(c + 1)] +=
                    strength * rigid.rotation(r, a) * extra[a][c];
            }
        }
    }
    truth.ct_box = analytic_torso_grid({1, 1, 1}).bounds();
    return truth;
}

Surface analytic_torso_mannequin(const AnalyticMannequinOptions& options,
                                 const AnalyticBody& body) {
    const Registration truth = analytic_torso_truth(options.strength, body);
    const double low = -kHalfHeight - 30, high = kHalfHeight + 30;
    const auto skin_point = [&](double theta, double z) {
        const Point3 p = trunk_point(theta, z, 0, body.belly_mm);
        return mannequin_from_ct(truth, {p.x * body.width_scale, p.y * body.depth_scale, p.z});
    };
    Surface out;
    if (options.mesh) {
        // About square cells: the trunk is 800 mm round and 370 mm tall.
        const int columns =
            std::max(12, static_cast<int>(std::lround(std::sqrt(options.points * 800.0 / 370.0))));
        const int rows = std::max(6, options.points / columns);
        for (int r = 0; r < rows; ++r) {
            for (int c = 0; c < columns; ++c) {
                out.points.push_back(
                    skin_point(2 * kPi * c / columns, low + (high - low) * r / (rows - 1)));
            }
        }
        for (int r = 0; r + 1 < rows; ++r) {
            for (int c = 0; c < columns; ++c) {
                const auto at = [&](int row, int column) {
                    return static_cast<std::uint32_t>(row * columns + column % columns);
                };
                out.triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
                out.triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
            }
        }
        return out;
    }
    Gaussian gaussian(options.seed);
    while (static_cast<int>(out.points.size()) < options.points) {
        const double theta = 2 * kPi * gaussian.uniform();
        const double z = low + (high - low) * gaussian.uniform();
        if (options.front_only && std::sin(theta) < -0.3) continue;
        const Point3 p = skin_point(theta, z);
        const double nx = gaussian(), ny = gaussian(), nz = gaussian();
        out.points.push_back(p + options.noise_mm * Vector3{nx, ny, nz});
    }
    return out;
}

std::vector<AnalyticLandmark> analytic_torso_landmarks(int count,
                                                       double noise_mm,
                                                       const AnalyticMannequinOptions& options,
                                                       const AnalyticBody& body) {
    const struct {
        const char* name;
        double theta, z;  // direction from the axis, 0 right, pi/2 front; height, mm
    } places[] = {{"navel", 0.5 * kPi, -40},
                  {"xiphoid", 0.5 * kPi, 105},
                  {"spinous_process_L4", 1.5 * kPi, -80},
                  {"hip_bone_right", 0.12 * kPi, -105},
                  {"hip_bone_left", 0.88 * kPi, -105},
                  {"costal_margin_right", 0.2 * kPi, 35},
                  {"costal_margin_left", 0.8 * kPi, 35},
                  {"spinous_process_T10", 1.5 * kPi, 120},
                  {"pubis", 0.5 * kPi, -145},
                  {"rib_9_right", 0, 90},
                  {"rib_9_left", kPi, 90},
                  {"loin_right", 1.72 * kPi, -20},
                  {"loin_left", 1.28 * kPi, -20},
                  {"sacrum", 1.5 * kPi, -145}};
    const Registration truth = analytic_torso_truth(options.strength, body);
    Gaussian noise(options.seed + 1000);
    std::vector<AnalyticLandmark> marks;
    for (const auto& place : places) {
        if (static_cast<int>(marks.size()) >= count) break;
        const Point3 p = trunk_point(place.theta, place.z, 0, body.belly_mm);
        const Point3 ct{p.x * body.width_scale, p.y * body.depth_scale, p.z};
        const double nx = noise(), ny = noise(), nz = noise();
        marks.push_back(
            {place.name, ct, mannequin_from_ct(truth, ct) + noise_mm * Vector3{nx, ny, nz}});
    }
    return marks;
}

}  // namespace sonocase::pipeline
