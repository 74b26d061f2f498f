// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/neck_anatomy.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "formats/base/constants.h"
#include "formats/base/portable_math.h"
#include "formats/base/random.h"

namespace sonocase::pipeline::inline anatomy {

namespace {

enum NeckLabel : int {
    kOutside,
    kSkin,
    kFat,
    kDeepFat,
    kMuscles,
    kScalene,
    kLongusColli,
    kStrap,
    kSternomastoid,
    kVertebra,
    kDisc,
    kOesophagus,
    kAirwayCartilage,
    kLarynx,
    kAirway,
    kThyroid,
    kNerve,
    kRib,
    kClavicle,
    kSternum,
    kLungLeft,
    kLungRight,
    kTrunk,
    kSubclavianArteryLeft,
    kSubclavianArteryRight,
    kCarotidLeft,
    kCarotidRight,
    kSubclavianVeinLeft,
    kSubclavianVeinRight,
    kBrachiocephalicLeft,
    kBrachiocephalicRight,
    kJugularLeft,
    kJugularRight,
    kValve,
};

constexpr double kSkinMm = 1.7;
constexpr double kGapMm = 0.8;  // least distance of vein and artery: their walls (assumed)
constexpr double kAxisY = -4;   // centre of the neck's section

// About normal, from sums alone, within three deviations; the same on every machine.
double draw_normal(RandomStream& random, double mean, double deviation, double low, double high) {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += random.unit();
    return std::clamp(mean + deviation * std::clamp(sum, -3.0, 3.0), low, high);
}

double smooth_step(double t) {
    t = std::clamp(t, 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

struct Half {  // half-axes of the neck's section
    double a, b;
};
Half half_axes(double z, double scale) {
    const double shoulder = smooth_step((-20 - z) / 55);
    return {57 * scale + 30 * shoulder, 58 * scale + 3 * shoulder};
}

// Straight between the given heights, constant beyond them; heights fall.
struct Waypoint {
    double z, value;
};
template <std::size_t N>
double along(const Waypoint (&points)[N], double z) {
    if (z >= points[0].z) return points[0].value;
    for (std::size_t i = 0; i + 1 < N; ++i) {
        const Waypoint &from = points[i], &to = points[i + 1];
        if (z < to.z) continue;
        return from.value + (to.value - from.value) * (from.z - z) / (from.z - to.z);
    }
    return points[N - 1].value;
}

// Least distance of the origin from an ellipse at (x, y), to a fiftieth of a millimetre.
double gap_to_ellipse(double x, double y, double a, double b) {
    double best = 1e9;
    for (int i = 0; i < 180; ++i) {
        const double angle = 2 * kPi * i / 180;
        const double u = x + a * cosine(angle), v = y + b * sine(angle);
        best = std::min(best, u * u + v * v);
    }
    const bool inside = x * x / (a * a) + y * y / (b * b) < 1;
    return inside ? -std::sqrt(best) : std::sqrt(best);
}

}  // namespace

const std::vector<Label>& NeckAnatomy::labels() {
    static const std::vector<Label> all = [] {
        const struct {
            const char *name, *tissue;
            std::array<std::uint8_t, 3> colour;
        } rows[] = {{"outside", "outside", {0, 0, 0}},
                    {"skin", "skin", {233, 194, 166}},
                    {"subcutaneous_fat", "fat", {240, 218, 130}},
                    {"deep_neck_fat", "fat", {226, 200, 116}},
                    {"neck_muscles", "muscle", {160, 60, 58}},
                    {"scalene_muscles", "muscle", {168, 66, 62}},
                    {"longus_colli", "muscle", {150, 58, 60}},
                    {"strap_muscles", "muscle", {184, 80, 72}},
                    {"sternocleidomastoid", "muscle", {178, 72, 66}},
                    {"vertebrae_cervical", "bone", {226, 218, 196}},
                    {"intervertebral_discs", "cartilage", {170, 186, 190}},
                    {"esophagus", "bowel", {206, 140, 120}},
                    {"airway_cartilage", "cartilage", {180, 200, 204}},
                    {"larynx_muscle", "muscle", {190, 110, 100}},
                    {"trachea", "gas", {60, 60, 90}},
                    {"thyroid_gland", "gland", {204, 120, 92}},
                    {"vagus_nerve", "nerve", {240, 226, 120}},
                    {"rib_1", "bone", {236, 228, 206}},
                    {"clavicula", "bone", {236, 228, 206}},
                    {"sternum", "bone", {230, 222, 200}},
                    {"lung_upper_lobe_left", "lung", {150, 170, 200}},
                    {"lung_upper_lobe_right", "lung", {150, 170, 200}},
                    {"brachiocephalic_trunk", "blood", {208, 40, 40}},
                    {"subclavian_artery_left", "blood", {208, 40, 40}},
                    {"subclavian_artery_right", "blood", {208, 40, 40}},
                    {"common_carotid_artery_left", "blood", {214, 44, 44}},
                    {"common_carotid_artery_right", "blood", {214, 44, 44}},
                    {"subclavian_vein_left", "blood", {70, 96, 200}},
                    {"subclavian_vein_right", "blood", {70, 96, 200}},
                    {"brachiocephalic_vein_left", "blood", {60, 80, 190}},
                    {"brachiocephalic_vein_right", "blood", {60, 80, 190}},
                    {"internal_jugular_vein_left", "blood", {84, 110, 206}},
                    {"internal_jugular_vein_right", "blood", {84, 110, 206}},
                    {"venous_valve", "fascia", {220, 220, 236}}};
        std::vector<Label> out;
        for (const auto& row : rows)
            out.push_back({row.name, row.tissue, static_cast<int>(out.size()), row.colour});
        return out;
    }();
    return all;
}

NeckAnatomy::NeckAnatomy(std::uint64_t seed) {
    RandomStream random(mix64(seed + kGoldenGamma));
    scale_ = draw_normal(random, 1, 0.04, 0.9, 1.1);
    fat_mm_ = draw_normal(random, 3, 0.8, 1.5, 5);
    sides_[0].sign = -1;
    sides_[1].sign = 1;
    for (Side& side : sides_) draw(side, random.bits());
}

void NeckAnatomy::draw(Side& side, std::uint64_t seed) {
    RandomStream random(seed);
    NeckVessels& v = side.vessels;
    // The left vein is the smaller one in three necks of four.
    const double size = side.sign > 0 ? 1 : draw_normal(random, 0.87, 0.1, 0.6, 1.15);
    v.artery_mm = draw_normal(random, 6.4, 0.7, 4.8, 8.2);
    v.vein_width_mm = size * draw_normal(random, 16.3, 2.8, 10, 23);
    v.vein_height_mm = v.vein_width_mm * draw_normal(random, 0.70, 0.09, 0.5, 0.9);
    v.vein_depth_mm = draw_normal(random, 11.6, 2.4, 7, 18);
    v.overlap = draw_normal(random, 0.40, 0.2, 0.02, 0.9);
    v.outwards = normalized({side.sign * 0.42, 0.907, 0});
    v.sideways = {side.sign * v.outwards.y, -std::abs(v.outwards.x), 0};

    const double radius = 0.5 * v.artery_mm, a = 0.5 * v.vein_width_mm, b = 0.5 * v.vein_height_mm;
    side.sideways_mm = a + radius * (1 - 2 * v.overlap);
    side.along_outwards_mm = draw_normal(random, 1.5, 1.5, -1, 4);
    while (gap_to_ellipse(side.sideways_mm, side.along_outwards_mm, a, b) < radius + kGapMm)
        side.along_outwards_mm += 0.05;

    // Both vessels are moved together, so that the vein lies as deep as was drawn.
    Point3 vein = vein_at(side, 0);
    double low = 0, high = 80;
    for (int i = 0; i < 50; ++i) {
        const double middle = 0.5 * (low + high);
        (skin(vein + middle * v.outwards, 0) < 0 ? low : high) = middle;
    }
    side.shift = (low - b - v.vein_depth_mm) * v.outwards;
    // The sternomastoid takes the room between the fat and the vein.
    const double room = v.vein_depth_mm - kSkinMm - fat_mm_ - 1.6;
    side.muscle_half_mm = std::clamp(0.5 * room, 1.5, 4.5);
    v.artery = artery_at(side, 0);
    v.vein = vein_at(side, 0);
}

double NeckAnatomy::skin(Point3 p, double depth_mm) const {
    const Half half = half_axes(p.z, scale_);
    const double x = p.x / (half.a - depth_mm), y = (p.y - kAxisY) / (half.b - depth_mm);
    return x * x + y * y - 1;
}

Point3 NeckAnatomy::below_skin(double theta, double z, double depth_mm) const {
    const Half half = half_axes(z, scale_);
    return {(half.a - depth_mm) * cosine(theta), kAxisY + (half.b - depth_mm) * sine(theta), z};
}

Point3 NeckAnatomy::skin_point(double theta, double z) const {
    return below_skin(theta, z, 0);
}

Point3 NeckAnatomy::artery_at(const Side& side, double z) const {
    constexpr Waypoint kX[] = {{52, 27.5}, {0, 24}, {-40, 20}, {-58, 17}, {-90, 12}};
    constexpr Waypoint kY[] = {{52, 20}, {0, 23}, {-90, 22}};
    // Towards the chest the pair leaves the skin's neighbourhood, whatever its depth higher up.
    const double share = 1 - smooth_step((-30 - z) / 30);
    return Point3{side.sign * along(kX, z), along(kY, z), z} + share * side.shift;
}

Point3 NeckAnatomy::vein_at(const Side& side, double z) const {
    // Higher up the vein lies farther to the side and behind.
    const double aside = side.sideways_mm + 0.05 * std::max(z, 0.0);
    const double forwards = side.along_outwards_mm - 0.08 * std::max(z, 0.0);
    return artery_at(side, z) + aside * side.vessels.sideways + forwards * side.vessels.outwards;
}

double NeckAnatomy::vein_scale(double z) const {
    const double bulb = (z + 43) / 7;
    return std::clamp(1 - 0.004 * z, 0.8, 1.25) + 0.12 * exponential(-bulb * bulb);
}

namespace {

NeckAnatomy::Ellipse ellipse_along(int label, Point3 centre, double a, double b, Vector3 first) {
    const Vector3 n = normalized({first.x, first.y, 0});
    return {label, centre.x, centre.y, a, b, n.x, n.y, 0};
}

NeckAnatomy::Ellipse upright(int label, double x, double y, double a, double b) {
    return {label, x, y, a, b, 1, 0, 0};
}

// The section of an ellipsoid with axes along x, y and z; empty where it does not reach.
void add_ellipsoid(NeckAnatomy::Section& s, int label, Point3 centre, Vector3 axes) {
    const double t = (s.z - centre.z) / axes.z;
    if (std::abs(t) >= 1) return;
    const double share = std::sqrt(1 - t * t);
    s.ellipses.push_back(upright(label, centre.x, centre.y, share * axes.x, share * axes.y));
}

void add_chain(NeckAnatomy::Section& s, int label, std::initializer_list<Point3> path, double r) {
    const Point3* before = nullptr;
    for (const Point3& p : path) {
        if (before != nullptr && std::min(before->z, p.z) - r < s.z &&
            std::max(before->z, p.z) + r > s.z)
            s.capsules.push_back({label, *before, p, r});
        before = &p;
    }
}

bool inside_ellipse(const NeckAnatomy::Ellipse& e, double x, double y) {
    const double dx = x - e.x, dy = y - e.y;
    const double u = (dx * e.cosine + dy * e.sine) / e.a, v = (dy * e.cosine - dx * e.sine) / e.b;
    const double square = u * u + v * v;
    return square < 1 && square >= e.inner * e.inner;
}

bool inside_capsule(const NeckAnatomy::Capsule& c, Point3 p) {
    const Vector3 along = c.to - c.from;
    const double t = std::clamp(dot(p - c.from, along) / dot(along, along), 0.0, 1.0);
    const Vector3 off = p - (c.from + t * along);
    return dot(off, off) < c.radius * c.radius;
}

}  // namespace

void NeckAnatomy::add_muscles(const Side& side, Section& s) const {
    const double z = s.z, sign = side.sign;
    constexpr Waypoint kFrontScaleneX[] = {{52, 21}, {0, 27}, {-50, 36}};
    constexpr Waypoint kMiddleScaleneX[] = {{52, 27}, {0, 36}, {-50, 48}};
    s.ellipses.push_back(upright(kScalene, sign * along(kMiddleScaleneX, z), -6, 8, 10));
    s.ellipses.push_back(upright(kScalene, sign * along(kFrontScaleneX, z), 5, 6, 6));
    s.ellipses.push_back(upright(kLongusColli, sign * 10, 11, 7, 4.5));
    // Strap muscles, in front of thyroid and larynx.
    const double strap_mm = kSkinMm + fat_mm_ + 2.2;
    const double strap = kPi / 2 - sign * 0.22;
    const Point3 front = below_skin(strap, z, strap_mm);
    s.ellipses.push_back(
        ellipse_along(kStrap, front, 9.5, 2.0, front - below_skin(strap + 0.02, z, strap_mm)));
    // The sternomastoid: one belly above, a head for the breast bone and one for the collar bone
    // below.
    constexpr Waypoint kSternal[] = {{52, 22}, {-18, 52}, {-60, 79}};
    constexpr Waypoint kClavicular[] = {{52, 16}, {-18, 43}, {-60, 55}};
    constexpr Waypoint kSternalWidth[] = {{52, 13}, {-18, 11}, {-60, 5}};
    constexpr Waypoint kClavicularWidth[] = {{52, 13}, {-18, 11}, {-60, 9}};
    const double depth = kSkinMm + fat_mm_ + 0.8 + side.muscle_half_mm;
    const auto head = [&](double degrees, double width) {
        const double theta = sign > 0 ? degrees * kPi / 180 : kPi - degrees * kPi / 180;
        const Point3 centre = below_skin(theta, z, depth);
        s.ellipses.push_back(ellipse_along(kSternomastoid, centre, width, side.muscle_half_mm,
                                           centre - below_skin(theta + 0.02, z, depth)));
    };
    head(along(kClavicular, z), along(kClavicularWidth, z));
    head(along(kSternal, z), along(kSternalWidth, z));
}

void NeckAnatomy::add_middle(Section& s) const {
    const double z = s.z;
    s.ellipses.push_back(upright(kOesophagus, -5, 19, 7.5, 5));
    for (const double sign : {-1.0, 1.0})
        add_ellipsoid(s, kThyroid, {sign * 18, 33, -13}, {8.5, 9.5, 23});
    add_ellipsoid(s, kThyroid, {0, 44.5, -21}, {14, 3.2, 8});
    if (z < -7) {  // trachea
        s.ellipses.push_back(upright(kAirwayCartilage, 0, 34, 10.2, 9.6));
        s.ellipses.push_back(upright(kAirway, 0, 34, 8.4, 7.8));
    } else if (z < 10) {  // cricoid cartilage
        s.ellipses.push_back(upright(kAirwayCartilage, 0, 34, 12.5, 12));
        s.ellipses.push_back(upright(kAirway, 0, 34, 7.5, 8));
    } else {  // thyroid cartilage, open behind
        Ellipse shield = upright(kAirwayCartilage, 0, 31, 19, 16);
        s.ellipses.push_back(upright(kLarynx, 0, 31, 17, 14));
        shield.inner = 0.87;
        s.ellipses.push_back(shield);
        s.ellipses.push_back(upright(kLarynx, 0, 18, 15, 6));
        s.ellipses.push_back(upright(kAirway, 0, 33, 4, 8));
    }
}

void NeckAnatomy::add_bones(Section& s) const {
    s.ellipses.push_back(upright(kDisc, 0, -3, 12, 9));
    for (int level = -4; level <= 3; ++level) {
        const double z = 17.5 * level + 3;
        add_ellipsoid(s, kVertebra, {0, -3, z}, {15, 11, 8.4});
        add_chain(s, kVertebra, {{-27, -4, z}, {27, -4, z}}, 3.5);
        add_chain(s, kVertebra, {{-14, -18, z}, {0, -26, z - 2}, {14, -18, z}}, 3.5);
        add_chain(s, kVertebra, {{0, -26, z - 2}, {0, -40, z - 7}}, 3.5);
    }
    add_ellipsoid(s, kSternum, {0, 38, -76}, {20, 7, 18});
    for (const double sign : {-1.0, 1.0}) {
        add_chain(s, kRib,
                  {{sign * 18, -8, -42},
                   {sign * 48, -8, -50},
                   {sign * 54, 12, -58},
                   {sign * 30, 34, -72}},
                  4);
        add_chain(s, kClavicle, {{sign * 14, 42, -62}, {sign * 40, 40, -60}, {sign * 72, 22, -52}},
                  5.5);
    }
}

void NeckAnatomy::add_inlet(const Side& side, Section& s) const {
    const double sign = side.sign;
    const bool right = sign > 0;
    add_ellipsoid(s, right ? kLungRight : kLungLeft, {sign * 36, 2, -88}, {25, 30, 45});
    const Point3 fork = artery_at(side, -58), root{sign * 8, 24, -96};
    const auto chain = [&](int label, std::initializer_list<Point3> path, double r) {
        add_chain(s, label, path, r);
    };
    chain(right ? kSubclavianArteryRight : kSubclavianArteryLeft,
          {right ? fork : Point3{-24, 10, -96},
           {sign * 31, 14, -47},
           {sign * 46, 8, -48},
           {sign * 68, -2, -62}},
          3.8);
    if (right) chain(kTrunk, {fork, root}, 6);
    const Point3 junction = vein_at(side, -58);
    chain(right ? kSubclavianVeinRight : kSubclavianVeinLeft,
          {junction, {sign * 50, 22, -60}, {sign * 72, 8, -66}}, 4.6);
    chain(right ? kBrachiocephalicRight : kBrachiocephalicLeft, {junction, {sign * 22, 24, -100}},
          7.5);
}

void NeckAnatomy::add_vessels(const Side& side, Section& s) const {
    const double z = s.z;
    const int carotid = side.sign > 0 ? kCarotidRight : kCarotidLeft;
    const int jugular = side.sign > 0 ? kJugularRight : kJugularLeft;
    const NeckVessels& v = side.vessels;
    const Point3 artery = artery_at(side, z), vein = vein_at(side, z);
    if (z > -58) {
        const double wider = std::max(1.0, 1 - 0.003 * z);
        const double radius = 0.5 * v.artery_mm * wider;
        s.ellipses.push_back(upright(carotid, artery.x, artery.y, radius, radius));
    }
    if (z > -60) {
        const double scale = vein_scale(z);
        const double a = 0.5 * v.vein_width_mm * scale, b = 0.5 * v.vein_height_mm * scale;
        s.ellipses.push_back(ellipse_along(jugular, vein, a, b, v.sideways));
        // Two cusps: fixed to the walls above, their edges free below, towards the heart.
        const double down = (-38 - z) / 9;
        if (down > 0 && down < 1) {
            for (const double way : {-1.0, 1.0}) {
                const Point3 cusp = vein + way * b * (0.92 - 0.5 * down) * v.outwards;
                s.ellipses.push_back(ellipse_along(kValve, cusp, 0.75 * a, 0.55, v.sideways));
            }
        }
    }
    // Between the two, behind them.
    const Point3 nerve =
        artery + (0.5 * v.artery_mm + 1.5) * v.sideways - (0.5 * v.artery_mm) * v.outwards;
    s.ellipses.push_back(upright(kNerve, nerve.x, nerve.y, 1.4, 1.4));
}

NeckAnatomy::Section NeckAnatomy::section(double z) const {
    Section s;
    s.z = z;
    const Half half = half_axes(z, scale_);
    const double deep = kSkinMm + fat_mm_;
    s.ellipses.push_back(upright(kSkin, 0, kAxisY, half.a, half.b));
    s.ellipses.push_back(upright(kFat, 0, kAxisY, half.a - kSkinMm, half.b - kSkinMm));
    s.ellipses.push_back(upright(kDeepFat, 0, kAxisY, half.a - deep, half.b - deep));
    s.ellipses.push_back(upright(kMuscles, 0, -26, half.a - deep - 3, half.b - deep - 24));
    for (const Side& side : sides_) add_muscles(side, s);
    add_middle(s);
    add_bones(s);
    // What runs across comes before the great vessels of the neck, which count where they meet.
    for (const Side& side : sides_) add_inlet(side, s);
    s.ellipses_below = s.ellipses.size();
    for (const Side& side : sides_) add_vessels(side, s);
    return s;
}

std::uint8_t NeckAnatomy::label(const Section& s, double x, double y) const {
    if (!inside_ellipse(s.ellipses.front(), x, y)) return kOutside;
    for (std::size_t i = s.ellipses.size(); i-- > 0;) {
        if (i + 1 == s.ellipses_below)
            for (std::size_t n = s.capsules.size(); n-- > 0;)
                if (inside_capsule(s.capsules[n], {x, y, s.z}))
                    return static_cast<std::uint8_t>(s.capsules[n].label);
        if (inside_ellipse(s.ellipses[i], x, y))
            return static_cast<std::uint8_t>(s.ellipses[i].label);
    }
    return kOutside;
}

std::uint8_t NeckAnatomy::label(Point3 ct) const {
    return label(section(ct.z), ct.x, ct.y);
}

}  // namespace sonocase::pipeline::inline anatomy
