// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/spectral_gate.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "runtime/imaging/doppler/colour_box.h"

namespace sonocase::runtime::doppler {
namespace {

constexpr int kMaxPoints = 1024;
constexpr double kChordReachMm = 30, kChordStepMm = 0.1;

Float3 float3(Vector3 v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

float length(Float3 v) {
    return std::sqrt(dot(v, v));
}

}  // namespace

SpectralGate::SpectralGate(const FlowScene& scene) : scene_(scene), blood_(scene) {
    points_.resize(kMaxPoints);
    profile_.resize(kProfilePoints);
    near_.resize(scene.capsules().size());
}

GateContent SpectralGate::aim(const ScanGeometry& geometry,
                              const DopplerSettings& settings,
                              const TissuePlace& place) {
    GateContent found;
    count_ = profile_count_ = 0;
    vessel_ = -1;
    asked_ = std::clamp(settings.gate_points, 8, kMaxPoints);
    const ColourBox lines = colour_box(geometry, settings);
    const double line = setting_within(settings.gate_line, 0, 1, 0.5) * kColourLines - 0.5;
    const double depth = setting_within(settings.gate_depth_mm, 0, geometry.depth_mm,
                                        geometry.depth_mm / 2),
                 gate = setting_within(settings.gate_mm, 0.5, 30, 3);
    const PlanePoint d = lines.direction(line);
    const double slant = lines.fan ? 1 : 1 / d.z;  // a steered line is longer than its depth
    const auto shown = [&](double r, double aside) {
        const PlanePoint p = lines.point(line, r / slant / lines.row_mm - 0.5);
        return PlanePoint{p.x + aside * d.z, p.z - aside * d.x};
    };
    for (double r = 0; r < depth * slant; r += 2)
        if (place.blocks(shown(r, 0))) return found;
    const Rigid pose = place.mannequin_from_probe();
    const Vector3 beam = pose.rotation * Vector3{d.x, 0, d.z}, across = pose.rotation.column(1);
    const Float3 towards = float3(-beam);
    const auto middle = scene_.local(place.rest(shown(depth * slant, 0)));
    const int near =
        scene_.near(middle, static_cast<float>(kChordReachMm + 5), scene_.all(), near_);
    const auto among = std::span<const std::int32_t>(near_).first(near);
    const auto find = [&](double r, double aside, double up, Point& point) {
        const Point3 rest = place.rest(shown(r, aside)) + up * across;
        point.hit = scene_.find(scene_.local(rest), among);
        if (point.hit.vessel < 0) return false;
        if (place.presses() && scene_.vein(point.hit.vessel) && place.closed(rest)) return false;
        point.cosine = dot(point.hit.along, towards) / length(point.hit.along);
        return true;
    };
    int votes[2] = {0, 0};
    for (int i = 0; i < asked_; ++i) {
        const double r = depth * slant + gate * ((i + 0.5) / asked_ - 0.5);
        const auto key = static_cast<std::uint32_t>(i);
        Point& point = points_[count_];
        if (!find(r, kBeamLateralMm * static_cast<double>(normal(mixed(key, 11))),
                  kBeamElevationMm * static_cast<double>(normal(mixed(key, 29))), point))
            continue;
        if (found.vessel < 0) found.vessel = point.hit.vessel;
        ++votes[point.hit.vessel == found.vessel ? 0 : 1];
        ++count_;
    }
    found.two_vessels = votes[1] > 0;
    if (votes[1] > votes[0])
        for (std::size_t i = 0; i < count_; ++i)
            if (points_[i].hit.vessel != found.vessel) {
                found.vessel = points_[i].hit.vessel;
                break;
            }
    found.blood = count_ > 0;
    if (!found.blood) return found;
    found.fill = static_cast<double>(std::max(votes[0], votes[1])) / asked_;
    vessel_ = found.vessel;
    // The lumen along the beam, from a place of the gate in that vessel outwards.
    Point probe;
    double inside = depth * slant, low = inside, high = inside;
    for (int i = 0; i < 32; ++i) {
        const double r = depth * slant + gate * ((i + 0.5) / 32 - 0.5);
        if (find(r, 0, 0, probe) && probe.hit.vessel == found.vessel) {
            inside = low = high = r;
            break;
        }
    }
    const auto of_vessel = [&](double r) {
        return find(r, 0, 0, probe) && probe.hit.vessel == found.vessel;
    };
    while (inside - low < kChordReachMm && of_vessel(low - kChordStepMm)) low -= kChordStepMm;
    while (high - inside < kChordReachMm && of_vessel(high + kChordStepMm)) high += kChordStepMm;
    found.chord_mm = high - low + kChordStepMm;
    const double from = depth * slant - gate / 2, to = depth * slant + gate / 2;
    found.spans = from <= low && to >= high;
    const double centre = (low + high) / 2, first = std::max(from, low), last = std::min(to, high);
    double cosine = 0;
    for (int i = 0; i < kProfilePoints; ++i) {
        const double r = first + (last - first) * (i + 0.5) / kProfilePoints;
        Point& point = profile_[profile_count_];
        if (!find(r, 0, 0, point) || point.hit.vessel != found.vessel) continue;
        point.weight = static_cast<float>(std::abs(r - centre));
        cosine += static_cast<double>(point.cosine);
        found.area_mm2 += 1 / static_cast<double>(point.hit.per_area);  // over the flow, so far
        ++profile_count_;
    }
    const double n = static_cast<double>(std::max<std::size_t>(profile_count_, 1));
    found.angle_deg = std::acos(std::clamp(cosine / n, -1.0, 1.0)) * 180 / kPi;
    per_area_ = found.area_mm2 > 0 ? static_cast<float>(n / found.area_mm2) : 0.0f;
    found.area_mm2 *= 1000 * scene_.mean_ml_s(found.vessel) / n;
    return found;
}

void SpectralGate::spectrum(const DopplerSettings& settings,
                            double phase,
                            double inspired,
                            Spectrum& out) {
    out.fill(0);
    blood_.begin(phase, inspired);
    const auto nyquist =
        static_cast<float>(10 * setting_within(settings.spectral_scale_cm_s, 1, 1000, 100));
    const WallFilter filter(settings.wall_filter);
    const float each = 1 / static_cast<float>(asked_);
    for (std::size_t i = 0; i < count_; ++i) {
        const Point& p = points_[i];
        const float v = blood_.speed(p.hit), turns = v * p.cosine / (2 * nyquist);
        const float gain = filter.gain(
            std::abs(static_cast<float>(unit_circle(static_cast<double>(turns) / 2).sine)));
        const float sine = std::sqrt(std::max(0.0f, 1 - p.cosine * p.cosine));
        const float half =
            std::clamp(std::abs(v) * sine * static_cast<float>(kSinDelta) / (2 * nyquist) * kBins,
                       static_cast<float>(kMinHalfBins), 0.45f * kBins);
        const float centre = turns * kBins + 0.5f * kBins;
        const int low = static_cast<int>(std::ceil(centre - half)),
                  high = static_cast<int>(std::floor(centre + half));
        const float height = each * gain / half;
        for (int b = low; b <= high; ++b)
            out[b & (kBins - 1)] += height * (1 - std::abs(static_cast<float>(b) - centre) / half);
    }
}

double SpectralGate::section_mean_mm_s(double phase, double inspired) {
    blood_.begin(phase, inspired);
    double sum = 0, weight = 0;
    for (std::size_t i = 0; i < profile_count_; ++i) {
        const auto w = static_cast<double>(profile_[i].weight);
        sum += w * static_cast<double>(blood_.speed(profile_[i].hit));
        weight += w;
    }
    return weight > 0 ? sum / weight : 0;
}

double SpectralGate::section_greatest_mm_s(double phase, double inspired) {
    if (vessel_ < 0) return 0;
    blood_.begin(phase, inspired);
    return static_cast<double>(per_area_ * blood_.greatest(vessel_));
}

double SpectralGate::greatest_mm_s(double phase, double inspired) {
    blood_.begin(phase, inspired);
    double fastest = 0;
    for (std::size_t i = 0; i < count_; ++i) {
        const auto v = static_cast<double>(blood_.speed(points_[i].hit));
        if (std::abs(v) > std::abs(fastest)) fastest = v;
    }
    return fastest;
}

}  // namespace sonocase::runtime::doppler
