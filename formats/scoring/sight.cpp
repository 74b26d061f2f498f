// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/sight.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/base/portable_math.h"

namespace sonocase {
namespace {

double radius_of(const Probe& probe) {
    return probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
}

}  // namespace

bool in_image(const Probe& probe, double x, double z) {
    if (probe.shape == ProbeShape::linear) {
        return std::abs(x) <= 0.5 * probe.width_mm && z >= 0 && z <= probe.depth_mm;
    }
    const double radius = radius_of(probe);
    const double r = hypotenuse(x, z + radius);
    return r >= radius && r <= radius + probe.depth_mm &&
           std::abs(arc_tangent(x, z + radius)) <= 0.5 * probe.field_of_view_rad;
}

double distance_to_image(const Probe& probe, double x, double z) {
    if (probe.shape == ProbeShape::linear) {
        const double dx = std::max(std::abs(x) - 0.5 * probe.width_mm, 0.0);
        const double dz = std::max({-z, z - probe.depth_mm, 0.0});
        return hypotenuse(dx, dz);
    }
    const double radius = radius_of(probe), outer = radius + probe.depth_mm;
    const double half = 0.5 * probe.field_of_view_rad;
    const double u = std::abs(x), w = z + radius;  // the region is the same on both sides
    const double r = hypotenuse(u, w);
    if (arc_tangent(u, w) <= half) return std::max({radius - r, r - outer, 0.0});
    // Beside the fan: its straight edge runs from the inner arc to the outer.
    const double along =
        std::clamp(u * sonocase::sine(half) + w * sonocase::cosine(half), radius, outer);
    return hypotenuse(u - along * sonocase::sine(half), w - along * sonocase::cosine(half));
}

ImageInterval interval_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm) {
    const Vector3 d = b - a;
    if (!(norm(d) > 0)) return {};
    double low = 0, high = 1;
    // Keeps the part where offset + t * slope <= 0.
    const auto clip = [&](double offset, double slope) {
        if (slope > 0) high = std::min(high, -offset / slope);
        if (slope < 0) low = std::max(low, -offset / slope);
        if (slope == 0 && offset > 0) high = -1;
    };
    clip(a.y - half_slab_mm, d.y);
    clip(-a.y - half_slab_mm, -d.y);
    if (probe.shape == ProbeShape::linear) {
        clip(a.x - 0.5 * probe.width_mm, d.x);
        clip(-a.x - 0.5 * probe.width_mm, -d.x);
        clip(-a.z, -d.z);
        clip(a.z - probe.depth_mm, d.z);
        return {low, high};
    }
    const double radius = radius_of(probe), outer = radius + probe.depth_mm;
    const double sine = sonocase::sine(0.5 * probe.field_of_view_rad);
    const double cosine = sonocase::cosine(0.5 * probe.field_of_view_rad);
    const double w = a.z + radius;
    clip(a.x * cosine - w * sine, d.x * cosine - d.z * sine);
    clip(-a.x * cosine - w * sine, -d.x * cosine - d.z * sine);
    // The face's chord keeps out what lies behind the probe.
    clip(radius * cosine - w, -d.z);
    const double qa = d.x * d.x + d.z * d.z, qb = a.x * d.x + w * d.z,
                 qc = a.x * a.x + w * w - outer * outer;
    if (qa == 0) return qc <= 0 ? ImageInterval{low, high} : ImageInterval{};
    const double root = qb * qb - qa * qc;
    if (!(root > 0)) return {};
    low = std::max(low, (-qb - std::sqrt(root)) / qa);
    high = std::min(high, (-qb + std::sqrt(root)) / qa);
    return {low, high};
}

double length_in_image(const Probe& probe, Point3 a, Point3 b, double half_slab_mm) {
    return interval_in_image(probe, a, b, half_slab_mm).share() * norm(b - a);
}

namespace {

// The constants of model `physical` and of its default machine that a needle's visibility depends
// on (runtime/imaging/physical/model); tests/runtime/imaging/needle_sight_test.cpp holds the two
// together.
constexpr double kMaxGapMm = 25, kMaxFlatGapMm = 10, kGapStepMm = 0.5;
constexpr double kDeadDb = 96;
constexpr double kGainSlopeFan = 0.50, kGainSlopeLinear = 0.72;  // dB/cm/MHz
constexpr double kFarFromMm = 100, kFarDbPerMm = 0.08, kFarLimitDb = 11;
constexpr double kEdgeFraction = 0.1, kEdgeDb = 10;  // poor contact at the ends of the face
// Tails of bone and gas, and what is left of them after kSightStepMm: e^(-1/90), e^(-1/18).
constexpr double kBoneFloor = 0.075, kBoneFade = 0.98895, kGasTail = 1.4, kGasFade = 0.94596;
constexpr double kApertureMm = 17, kPenumbraMm = 90;
// A needle is thicker than a pulse: its echo, relative to liver's, grows with the roots of its
// diameter, mm, and of the frequency, MHz.
constexpr double kNeedleEcho = 7.5, kOwnShade = 0.5;
constexpr double kLn2 = 0.69314718055994531;
constexpr double kLiverGrey = 80;

// A scan line: where it leaves the face, and its direction; `probe` frame.
struct ScanLine {
    Point3 face;
    Vector3 along;
    double length_mm = 0;  // from the face to the point that it was laid through
    double from_edge = 1;  // share of the face between the line and the face's nearer end
};

ScanLine scan_line(const Probe& probe, Point3 p) {
    if (probe.shape == ProbeShape::linear)
        return {
            {p.x, p.y, 0}, {0, 0, 1}, p.z, 0.5 - std::abs(p.x) / std::max(probe.width_mm, 1e-9)};
    const double radius = radius_of(probe);
    const Vector3 from_apex{p.x, 0, p.z + radius};
    const double r = norm(from_apex);
    if (!(r > radius)) return {p, {0, 0, 1}, 0};
    const Vector3 out = from_apex / r;
    return {{radius * out.x, p.y, radius * out.z - radius},
            out,
            r - radius,
            0.5 - std::abs(arc_tangent(out.x, out.z)) / std::max(probe.field_of_view_rad, 1e-9)};
}

// Distance along the line to the body at rest; negative: farther than contact closes.
double gap_mm(const Anatomy& anatomy, const Probe& probe, Point3 face, Vector3 along) {
    const double most = probe.shape == ProbeShape::linear ? kMaxFlatGapMm : kMaxGapMm;
    for (int step = 0; step * kGapStepMm <= most; ++step)
        if (anatomy.label(face + step * kGapStepMm * along) != 0) return step * kGapStepMm;
    return -1;
}

// Calls meet(label, depth) every kSightStepMm on the way to the point, until it returns false.
// Returns false where the line has no contact.
template <class Meet>
bool walk(const Anatomy& anatomy,
          const Probe& probe,
          const ScanLine& line,
          const Rigid& mannequin_from_probe,
          double time_s,
          Meet meet) {
    const Point3 start = mannequin_from_probe * line.face;
    const Vector3 along = mannequin_from_probe.rotation * line.along;
    const double gap = gap_mm(anatomy, probe, start, along);
    if (gap < 0) return false;
    // The gap closes: tissue behind it moves up to the face, the less the deeper it lies.
    double reach = gap;
    const Vector3 breath_mm = anatomy.breath_mm(time_s);
    constexpr double kFade = 0.97802;  // e^(-kSightStepMm / 45): how far down a gap is felt
    for (double s = 0.5 * kSightStepMm; s < line.length_mm; s += kSightStepMm, reach *= kFade) {
        const Point3 p = start + (s + reach) * along;
        if (!meet(anatomy.label(anatomy.at_rest(p, breath_mm)), s)) break;
    }
    return true;
}

double gain_db(const Probe& probe, double depth_mm) {
    const double slope = probe.shape == ProbeShape::linear ? kGainSlopeLinear : kGainSlopeFan;
    return 0.2 * slope * probe.frequency_mhz * depth_mm -
           std::clamp((depth_mm - kFarFromMm) * kFarDbPerMm, 0.0, kFarLimitDb);
}

double amplitude(double db) {
    return exponential(0.11512925464970229 * db);  // ln 10 / 20
}

// Grey of an echo's power: kLiverGrey times amplitude to the power of 3/4, as the machine maps it.
double grey(double power) {
    const double root = std::sqrt(std::sqrt(power));
    return kLiverGrey * root * std::sqrt(root);
}

}  // namespace

bool sound_reaches(const Anatomy& anatomy,
                   const Probe& probe,
                   const Rigid& mannequin_from_probe,
                   Point3 p_probe,
                   double time_s) {
    if (!anatomy.knows_tissue()) return true;
    bool reached = true;
    const bool contact = walk(anatomy, probe, scan_line(probe, p_probe), mannequin_from_probe,
                              time_s, [&](int label, double) {
                                  reached = !anatomy.blocks_sound(label);
                                  return reached;
                              });
    return contact && reached;
}

NeedleSight::NeedleSight(const Anatomy* anatomy, const Exercise& exercise)
    : anatomy_(anatomy),
      probe_(exercise.probe),
      make_(exercise.needle.make),
      length_mm_(exercise.needle.length_mm) {
    const double own = exercise.model == "paper" ? needle_diameter_mm(exercise.needle)
                                                 : exercise.probe.elevation_mm;
    half_slab_mm_ = 0.5 * (exercise.needle.slab_mm > 0 ? exercise.needle.slab_mm : own);
    echo_ =
        kNeedleEcho * std::sqrt(exercise.probe.frequency_mhz * needle_diameter_mm(exercise.needle));
}

namespace {

// What a scan line brings to a depth.
struct Light {
    double lit = 0;            // amplitude after time gain; 0: none
    double bone = 0, gas = 0;  // of the tails behind them
    double echo = 1;           // of the tissue at the depth, relative to liver
    double hidden_mm = -1;     // way since the last bone or gas; negative: neither was met
};

Light light_on(const Anatomy& anatomy,
               const Probe& probe,
               const ScanLine& line,
               const Rigid& mannequin_from_probe,
               double time_s) {
    Light light;
    double loss_db = kEdgeDb * std::max(1 - line.from_edge / kEdgeFraction, 0.0);
    bool in_bone = false, in_gas = false;
    const double per_step = 0.2 * kSightStepMm * probe.frequency_mhz;
    const auto lit = [&](double depth_mm) {
        return loss_db < kDeadDb ? amplitude(gain_db(probe, depth_mm) - loss_db) : 0;
    };
    const auto meet = [&](int label, double depth_mm) {
        const Anatomy::Acoustics at = anatomy.acoustics(label);
        light.bone *= kBoneFade;
        light.gas *= kGasFade;
        if (at.bone && !in_bone)
            light.bone = std::max(light.bone, kBoneFloor * std::min(lit(depth_mm), 1.0));
        if (at.gas && !in_gas) light.gas = std::max(light.gas, kGasTail * lit(depth_mm));
        in_bone = at.bone;
        in_gas = at.gas;
        if (at.bone || at.gas) light.hidden_mm = line.length_mm - depth_mm;
        light.echo = at.echo;
        loss_db += per_step * at.loss_db_cm_mhz;
        return loss_db < kDeadDb;  // a dead line stays dead, and nothing shows on it
    };
    if (!walk(anatomy, probe, line, mannequin_from_probe, time_s, meet)) return {};
    light.lit = lit(line.length_mm);
    return light;
}

// The same line `by_mm` beside it on the face.
Point3 beside(const Probe& probe, const ScanLine& line, double by_mm) {
    if (probe.shape == ProbeShape::linear)
        return {line.face.x + by_mm, line.face.y, line.length_mm};
    const double radius = radius_of(probe);
    const double turn = by_mm / std::max(radius, 0.5 * kPenumbraMm);
    const double sine = sonocase::sine(turn), cosine = sonocase::cosine(turn);
    const double r = radius + line.length_mm;
    return {r * (line.along.x * cosine + line.along.z * sine), line.face.y,
            r * (line.along.z * cosine - line.along.x * sine) - radius};
}

// Light from the lines beside: a shadow softens on the way down, since only a part of the aperture
// is covered. None comes to a line that is dead.
double lit_with_penumbra(const Anatomy& anatomy,
                         const Probe& probe,
                         const ScanLine& line,
                         const Light& own,
                         const Rigid& mannequin_from_probe,
                         double time_s) {
    const double sigma = kApertureMm * std::sqrt(own.hidden_mm / (12 * kPenumbraMm));
    constexpr double kWeights[] = {0.28, 0.17, 0.05};  // at multiples of 0.8 deviations and on both
    double sum = own.lit * 0.34, all = 0.34;           // sides
    for (int step = 1; step <= 3; ++step)
        for (const double side : {-1.0, 1.0}) {
            const ScanLine other = scan_line(probe, beside(probe, line, side * 0.8 * step * sigma));
            const double weight = kWeights[step - 1];
            all += weight;
            if (!(other.from_edge > 0)) continue;
            sum += weight * light_on(anatomy, probe, other, mannequin_from_probe, time_s).lit;
        }
    return sum / all;
}

}  // namespace

double NeedleSight::contrast(const Rigid& mannequin_from_probe,
                             Point3 p_probe,
                             Vector3 axis_probe,
                             Vector3 bevel_probe,
                             double from_tip_mm,
                             double time_s) const {
    const ScanLine line = scan_line(probe_, p_probe);
    Light light{.lit = 1};
    if (anatomy_ != nullptr && anatomy_->knows_tissue()) {
        light = light_on(*anatomy_, probe_, line, mannequin_from_probe, time_s);
        if (light.hidden_mm > 0 && light.lit > 0)
            light.lit =
                lit_with_penumbra(*anatomy_, probe_, line, light, mannequin_from_probe, time_s);
    }
    const double cosine = dot(axis_probe, line.along);
    const double sine2 = std::max(1 - cosine * cosine, 0.0);
    const double mirror =
        exponential(-kLn2 * cosine * cosine / (make_->lobe_sin * make_->lobe_sin));
    const double faces =
        std::clamp(-dot(bevel_probe, line.along) / std::sqrt(std::max(sine2, 0.01)), -1.0, 1.0);
    const double tip = make_->tip_away + (make_->tip_towards - make_->tip_away) * 0.5 * (1 + faces);
    const double base = make_->rough + (tip - make_->rough) * needle_tip_part(from_tip_mm);
    // The needle shades its own far side, the more of it the steeper it runs along the beam.
    const double shade = 1 / (1 + kOwnShade / std::sqrt(std::max(sine2, 0.01)));
    const double needle = shade * light.lit * echo_ * (base + (1 - base) * mirror);
    const double tissue = light.lit * light.echo;
    const double around = tissue * tissue + light.bone * light.bone + light.gas * light.gas;
    return grey(around + needle * needle) - grey(around);
}

bool NeedleSight::tip_visible(const Rigid& mannequin_from_probe,
                              Point3 tip,
                              Vector3 axis,
                              Vector3 bevel,
                              double time_s) const {
    if (!(std::abs(tip.y) <= half_slab_mm_) || !in_image(probe_, tip.x, tip.z)) return false;
    return anatomy_ == nullptr || !anatomy_->knows_tissue() ||
           contrast(mannequin_from_probe, tip, axis, bevel, 0, time_s) >= kShownGrey;
}

double NeedleSight::visible_mm(const Rigid& mannequin_from_probe,
                               Point3 tip,
                               Point3 skin,
                               double time_s) const {
    const ImageInterval part = interval_in_image(probe_, tip, skin, half_slab_mm_);
    const double whole = norm(skin - tip), length = part.share() * whole;
    if (!(length > 0) || anatomy_ == nullptr || !anatomy_->knows_tissue()) return length;
    const Vector3 axis = (tip - skin) / whole;
    const int points = std::max(1, static_cast<int>(std::ceil(length / kSightShaftMm)));
    int seen = 0;
    for (int i = 0; i < points; ++i) {
        const double at = part.low + (part.high - part.low) * (i + 0.5) / points;
        // Of the shaft: what the bevel adds at the tip counts as the tip.
        if (contrast(mannequin_from_probe, tip + at * (skin - tip), axis, {}, at * whole, time_s) >=
            kShownGrey)
            ++seen;
    }
    return length * seen / points;
}

double NeedleSight::in_sector_mm(Point3 tip, Point3 skin) const {
    return length_in_image(probe_, tip, skin, std::numeric_limits<double>::max());
}

bool NeedleSight::on_the_way(Point3 tip, Vector3 axis) const {
    return !in_image(probe_, tip.x, tip.z) &&
           interval_in_image(probe_, tip, tip + length_mm_ * axis, half_slab_mm_).share() > 0;
}

}  // namespace sonocase
