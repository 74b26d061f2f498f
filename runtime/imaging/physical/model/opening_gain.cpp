// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/opening_gain.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace sonocase::runtime::physical {
namespace {

constexpr int kBeams = 49;          // in the middle half of the picture
constexpr std::size_t kPlaces = 5;  // of a script that looks around; they share the beams
constexpr double kStepMm = 1;       // along a beam
constexpr double kSearchMm = 100;   // the skin is looked for this far before and beyond the place
constexpr double kShadowDb = 24;    // a beam that is so much darker than tissue alone makes it
constexpr double kFewest = 0.06;    // share of a depth that must hold tissue for it to count
constexpr double kMaxDb = 30;       // limit of what is added at any depth
constexpr double kSheetsDb = 3;     // what the sheets of the wall add to its ground
constexpr double kMeanOfLogDb = 2;  // a logarithm's mean lies so far below that of the amplitude

constexpr int kBeyond = -1;  // the volume ends: a cut face and no skin

int label_at(const CaseBundle& bundle, Point3 p) {
    const Point3 v = bundle.grid.voxel_from_point(p);
    const Int3 size = bundle.grid.size;
    const int i = static_cast<int>(std::floor(v.x + 0.5)),
              j = static_cast<int>(std::floor(v.y + 0.5)),
              k = static_cast<int>(std::floor(v.z + 0.5));
    if (i < 0 || j < 0 || k < 0 || i >= size.x || j >= size.y || k >= size.z) return kBeyond;
    return bundle.label_bricks.at(i, j, k);
}

// The target or finding that lies at a place of the volume, if any.
const TargetBall* ball_at(const PhysicalScene& scene, Point3 voxel) {
    for (auto ball = scene.targets.rbegin(); ball != scene.targets.rend(); ++ball) {
        const Vector3 f = scene.voxel_mm * (voxel - ball->centre_vx);
        if (dot(f, ball->shape * f) <= ball->radius_mm * ball->radius_mm) return &*ball;
    }
    return nullptr;
}

// The pose on the skin nearest to a place; nothing if its beam does not enter the body.
std::optional<Rigid> pose_on_skin(const CaseBundle& bundle,
                                  Point3 at,
                                  Vector3 beam,
                                  Vector3 lateral) {
    if (!(norm(beam) > 0)) return {};
    const Vector3 z = normalized(beam);
    Vector3 x = lateral - dot(lateral, z) * z;
    x = norm(x) > 1e-6 ? normalized(x) : any_perpendicular(z);
    std::optional<double> nearest;
    bool before = true;  // no skin where the search begins
    for (double t = -kSearchMm; t <= kSearchMm; t += 0.5 * bundle.grid.spacing_mm.x) {
        const int label = label_at(bundle, at + t * z);
        if (label > 0 && !before && (!nearest || std::abs(t) < std::abs(*nearest))) nearest = t;
        before = label != 0;
    }
    if (!nearest) return {};
    return Rigid{Matrix3::from_columns(x, cross(z, x), z), at + *nearest * z - Point3{}};
}

// Where the exercise looks: the middle of its script with a needle; or places all along its first
// script, since one of them may show nothing but gas; and, half as often, where it starts, whose
// picture is the first that anyone sees. Beams take the places in turn.
std::vector<Rigid> opening_poses(const CaseBundle& bundle, const Exercise& exercise) {
    std::vector<Rigid> poses;
    const auto add = [&](Point3 at, Vector3 beam, Vector3 lateral) {
        if (const auto pose = pose_on_skin(bundle, at, beam, lateral)) poses.push_back(*pose);
    };
    const auto add_start = [&] {
        add(exercise.start_probe, exercise.start_beam, exercise.start_lateral);
    };
    const auto needle = std::find_if(exercise.sweeps.begin(), exercise.sweeps.end(),
                                     [](const Sweep& s) { return s.name == "needle"; });
    const bool looks_around = needle == exercise.sweeps.end();
    if (exercise.sweeps.empty() ||
        (looks_around ? exercise.sweeps.front() : *needle).keys.empty()) {
        add_start();
        return poses;
    }
    const auto& keys = (looks_around ? exercise.sweeps.front() : *needle).keys;
    const std::size_t places = looks_around ? std::min(kPlaces, keys.size()) : 1;
    for (std::size_t n = 0; n < places; ++n) {
        const SweepKey& key = keys[(2 * n + 1) * keys.size() / (2 * places)];
        add(key.probe, key.beam, key.lateral);
        add(key.probe, key.beam, key.lateral);
        add_start();
    }
    return poses;
}

// Amplitude at which the machine draws a grey, dB; of organs, whose grey is a mean.
double level_of_grey(const MachineGrey& grey, double wanted) {
    if (grey.map == GreyMap::log)
        return (wanted - grey.level) * grey.dynamic_range_db / 255 + kMeanOfLogDb;
    const double over = std::max(wanted - grey.floor, 1.0) / grey.level;
    return 20 * std::log10(over) / grey.exponent;
}

}  // namespace

double OpeningGain::at(double share) const {
    const double x = std::clamp(share, 0.0, 1.0) * 7;
    const auto i = std::min(static_cast<std::size_t>(x), db.size() - 2);
    const double part = x - static_cast<double>(i);
    return db[i] * (1 - part) + db[i + 1] * part;
}

OpeningGain opening_gain(const PhysicalScene& scene,
                         const Exercise& exercise,
                         const Tables& tables,
                         const ScanGeometry& g) {
    OpeningGain out;
    const CaseBundle& bundle = *scene.bundle;
    const std::vector<Rigid> poses = opening_poses(bundle, exercise);
    if (poses.empty()) return out;
    const Machine& machine = tables.machine;
    const bool walled = machine.structures.wall && !scene.layers.empty();
    std::array<double, 8> sum{}, count{};
    for (int b = 0; b < kBeams; ++b) {
        const Rigid& pose = poses[static_cast<std::size_t>(b) % poses.size()];
        const double line = (g.scanlines - 1) * (0.25 + 0.5 * b / (kBeams - 1));
        const PlanePoint o = g.beam_origin(line), d = g.beam_direction(line);
        double lost_db = 0, shadow_db = 0;
        bool entered = false;
        for (double r = 0.5 * kStepMm; r < g.depth_mm; r += kStepMm) {
            const Point3 p = pose * Point3{o.x + r * d.x, 0, o.z + r * d.z};
            const int label = label_at(bundle, p);
            if (label == kBeyond) break;
            const AcousticProperties& a = scene.acoustics[static_cast<std::size_t>(label)];
            if (const TargetBall* ball = ball_at(scene, bundle.grid.voxel_from_point(p))) {
                lost_db += 0.2 *
                           scene.acoustics[static_cast<std::size_t>(ball->acoustics)].attenuation *
                           tables.frequency_mhz * kStepMm;
                continue;  // its echo is its kind's
            }
            if (a.kind == TissueKind::outside) {
                if (!entered && r < kMaxGapMm) continue;  // skin and face come together
                break;
            }
            entered = true;
            const double loss = 0.2 * a.attenuation * tables.frequency_mhz * kStepMm;
            lost_db += loss;
            if (a.kind == TissueKind::bone || a.kind == TissueKind::gas) shadow_db += loss;
            if (shadow_db > kShadowDb) break;
            if (a.kind != TissueKind::soft) continue;
            const Row& row = tables.rows[static_cast<std::size_t>(
                std::min(static_cast<int>(r / g.step_mm), g.samples - 1))];
            double level = a.echo_db - lost_db + 20 * std::log10(row.gain);
            if (walled && r < kWallDepthMm) {
                const LayerPoint at = scene.layers.at(bundle.grid.voxel_from_point(p));
                if (at.above_organs > 0)
                    level += a.wall_db + kSheetsDb +
                             wall_ground_db(tables.wall, at.depth, at.above_organs);
            }
            const auto zone = static_cast<std::size_t>(std::min(8 * r / g.depth_mm, 7.0));
            sum[zone] += level;
            count[zone] += 1;
        }
    }
    const double whole = kBeams * g.depth_mm / 8 / kStepMm;
    // Levels of the zones; one without tissue takes over those beside it.
    std::array<std::optional<double>, 8> level;
    double all = 0, n = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        if (count[i] < kFewest * whole) continue;
        level[i] = sum[i] / count[i];
        all += sum[i];
        n += count[i];
    }
    if (n < 1) return out;
    const double mean = all / n, wanted = level_of_grey(machine.grey, kOpeningGrey);
    std::array<double, 8> zones;
    for (std::size_t i = 0; i < 8; ++i) {
        double near = mean;
        for (std::size_t apart = 0; apart < 8; ++apart) {
            if (i >= apart && level[i - apart]) {
                near = *level[i - apart];
                break;
            }
            if (i + apart < 8 && level[i + apart]) {
                near = *level[i + apart];
                break;
            }
        }
        zones[i] = wanted - mean - kEvened * (near - mean);
    }
    for (std::size_t i = 0; i < 8; ++i) {
        const double above = zones[i > 0 ? i - 1 : 0],
                     below = zones[std::min<std::size_t>(i + 1, 7)];
        out.db[i] = std::clamp(0.25 * above + 0.5 * zones[i] + 0.25 * below, -kMaxDb, kMaxDb);
    }
    return out;
}

}  // namespace sonocase::runtime::physical
