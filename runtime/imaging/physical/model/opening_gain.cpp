// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/opening_gain.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

#include "formats/exercise/organ_of_interest.h"

namespace sonocase::runtime::physical {
namespace {

constexpr int kBeams = 33, kOfMany = 24;  // in the middle half of a picture; of each of many
constexpr std::size_t kPlaces = 8;        // of scripts that look around
constexpr double kStepMm = 1;             // along a beam
constexpr double kSkinMm = 4;             // what lies before the skin is that near to it
constexpr double kSearchMm = 100;     // the skin is looked for this far before and beyond the place
constexpr double kShadowDb = 24;      // a beam that is so much darker than tissue alone makes it
constexpr double kFewest = 0.06;      // share of a depth that must hold tissue for it to count
constexpr double kOrganShare = 0.02;  // of a plane that must be the organ for it to count
constexpr double kNearEvened = 1;     // share of the difference where the wall is the brighter
constexpr double kOrganMore = 2;      // weight of the organ in depth gain, beside all tissue
constexpr double kDarkerDb = 2, kBrighterDb = 2;  // than the tissue's middle, of the organ's
constexpr double kMaxDb = 30;                     // limit of what is added at any depth
constexpr double kSinusDb = 2.5;                  // a plane through a kidney shows its bright sinus
constexpr double kMeanOfLogDb = 2;  // a logarithm's mean lies so far below that of the amplitude

// Of a normal deviate, in eight parts of equal chance.
constexpr double kEighths[] = {-1.65, -0.86, -0.48, -0.16, 0.16, 0.48, 0.86, 1.65};

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

double power_of(double db) {
    return std::exp2(2 / kDbPerLog2 * db);
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

// A plane that the picture is opened for.
struct Plane {
    Rigid pose;
    double weight = 1;  // in depth gain
};

// Whether two keys of scripts hold nearly the same plane.
bool same_plane(const SweepKey& a, const SweepKey& b) {
    constexpr double kApartMm = 2, kTurned = 0.05;
    return distance(a.probe, b.probe) < kApartMm &&
           norm(normalized(a.beam) - normalized(b.beam)) < kTurned &&
           norm(normalized(a.lateral) - normalized(b.lateral)) < kTurned;
}

// Where the exercise looks: the middle of its script with a needle; or places all along its first
// script, since one of them may show nothing but gas; and, with half the weight, where it starts,
// whose picture is the first that anyone sees.
std::vector<Plane> opening_planes(const CaseBundle& bundle, const Exercise& exercise) {
    std::vector<Plane> planes;
    const auto add = [&](Point3 at, Vector3 beam, Vector3 lateral, double weight) {
        if (const auto pose = pose_on_skin(bundle, at, beam, lateral))
            planes.push_back({*pose, weight});
    };
    add(exercise.start_probe, exercise.start_beam, exercise.start_lateral, 0.5);
    std::vector<const SweepKey*> keys;
    const auto needle = std::find_if(exercise.sweeps.begin(), exercise.sweeps.end(),
                                     [](const Sweep& s) { return s.name == "needle"; });
    if (needle != exercise.sweeps.end() && !needle->keys.empty()) {
        keys = {&needle->keys[needle->keys.size() / 2]};
    } else {
        for (const Sweep& sweep : exercise.sweeps)
            for (const SweepKey& key : sweep.keys)
                if (std::none_of(keys.begin(), keys.end(),
                                 [&](const SweepKey* k) { return same_plane(*k, key); }))
                    keys.push_back(&key);
    }
    const std::size_t places = std::min(kPlaces, keys.size());
    for (std::size_t n = 0; n < places; ++n) {
        const SweepKey& key = *keys[(2 * n + 1) * keys.size() / (2 * places)];
        add(key.probe, key.beam, key.lateral, 1.0 / static_cast<double>(places));
    }
    return planes;
}

// What a machine's map makes of levels before its knee: grey is even in it. Means are taken of it,
// since a few bright sheets make a picture brighter than the mean of their decibels says.
class Brightness {
  public:
    explicit Brightness(const MachineGrey& grey)
        : grey_(grey), per_db_(grey.exponent / kDbPerLog2), log_(grey.map == GreyMap::log) {}
    double of(double db) const { return log_ ? db : std::exp2(per_db_ * db); }
    double of_power(double power) const {
        return of(0.5 * kDbPerLog2 * std::log2(std::max(power, 1e-30)));
    }
    double level_db(double brightness) const {
        return log_ ? brightness : std::log2(std::max(brightness, 1e-9)) / per_db_;
    }
    // Of the grey at which an organ opens.
    double opening_db() const {
        if (log_)
            return (kOpeningMiddle - grey_.level) * grey_.dynamic_range_db / 255 + kMeanOfLogDb;
        return level_db(std::max(kOpeningGrey - grey_.floor, 1.0) / grey_.level);
    }

  private:
    const MachineGrey& grey_;
    double per_db_;
    bool log_;
};

// What the structure within a label adds to its level: in the wall, and elsewhere.
struct StructureDb {
    double wall = 0, elsewhere = 0;
    bool known = false;
};

StructureDb structure_of(const PhysicalScene& scene,
                         const Tables& tables,
                         const Brightness& brightness,
                         std::size_t label) {
    // Of a normal deviate, in five parts of equal chance.
    constexpr double kFifths[] = {-1.40, -0.53, 0, 0.53, 1.40};
    constexpr int kDraws = 64;
    const CaseBundle& bundle = *scene.bundle;
    double spread_db = 0;
    for (const Tissue& tissue : bundle.tissues)
        if (tissue.name == bundle.labels[label].tissue) spread_db = tissue.structure_db;
    const std::vector<double>& limit = scene.max_structure_db;
    const std::vector<double>& dead = scene.structure_dead_db;
    const int cube = label < scene.fine.frames.size() ? scene.fine.frames[label].cube : -1;
    const bool drawn =
        cube >= 0 && (cube != kParenchymaCube || tables.machine.structures.parenchyma);
    double wall = 0, elsewhere = 0;
    for (int n = 0; n < kDraws; ++n) {
        const int layers = drawn ? kFineLayers[cube] : 1;
        const double fine =
            drawn ? scene.textures->fine[fine_index(11 * n % layers, 29 * n % kFineEdge,
                                                    (13 * n + n / 8) % kFineEdge) +
                                         static_cast<std::size_t>(cube) * kFineEdge * kFineEdge *
                                             kFineEdge] /
                        4.0
                  : 0;
        for (const double part : kFifths) {
            double baked = scene.max_structure_db.empty() ? part * spread_db : 0;
            if (!limit.empty()) baked = std::min(baked, limit[label]);
            if (!dead.empty()) baked -= std::clamp(baked, -dead[label], dead[label]);
            const double db = fine + baked;
            elsewhere += brightness.of(db);
            wall += brightness.of(std::min(db, static_cast<double>(tables.wall.max_structure_db)));
        }
    }
    constexpr double kAll = kDraws * std::size(kFifths);
    const double sinus_db = bundle.labels[label].tissue == "kidney_cortex" ? kSinusDb : 0;
    return {brightness.level_db(wall / kAll), brightness.level_db(elsewhere / kAll) + sinus_db,
            true};
}

// Brightness of soft tissue by depth, one per kStepMm.
struct Levels {
    std::vector<double> sum, count;
    double share = 0;  // of all samples
    void add(std::size_t depth, double brightness) {
        sum[depth] += brightness;
        count[depth] += 1;
    }
};
struct PlaneLevels {
    Levels all, organ;
};

class Tracer {
  public:
    Tracer(const PhysicalScene& scene,
           const Exercise& exercise,
           const Tables& tables,
           const ScanGeometry& geometry)
        : scene_(scene),
          bundle_(*scene.bundle),
          tables_(tables),
          g_(geometry),
          organ_(organ_of_interest(bundle_, exercise)),
          walled_(tables.machine.structures.wall && !scene.layers.empty()),
          brightness_(tables.machine.grey),
          haze_keep_(std::exp(-kStepMm / tables.machine.haze.decay_mm)),
          haze_gain_(tables.machine.haze.fraction * (1 - haze_keep_)),
          structure_(scene.bundle->labels.size()),
          gain_db_(static_cast<std::size_t>(geometry.depth_mm / kStepMm) + 1),
          label_mm_(gain_db_.size()),
          gap_left_(gain_db_.size()) {
        for (std::size_t i = 0; i < gain_db_.size(); ++i) {
            const double r = (static_cast<double>(i) + 0.5) * kStepMm;
            const int sample = std::min(static_cast<int>(r / g_.step_mm), g_.samples - 1);
            const Row& row = tables.rows[static_cast<std::size_t>(sample)];
            gain_db_[i] = 20 * std::log10(row.gain);
            label_mm_[i] = row.label_mm;
            gap_left_[i] = row.contact;
        }
    }

    PlaneLevels trace(const Rigid& pose, int beams) {
        PlaneLevels out;
        for (Levels* levels : {&out.all, &out.organ}) {
            levels->sum.assign(gain_db_.size(), 0);
            levels->count.assign(gain_db_.size(), 0);
        }
        for (int b = 0; b < beams; ++b)
            trace_beam(pose, static_cast<std::size_t>(b),
                       (g_.scanlines - 1) * (0.25 + 0.5 * b / (beams - 1)), out);
        const double whole = beams * static_cast<double>(gain_db_.size());
        for (Levels* levels : {&out.all, &out.organ})
            for (const double n : levels->count) levels->share += n / whole;
        return out;
    }

  private:
    void trace_beam(const Rigid& pose, std::size_t beam, double line, PlaneLevels& out) {
        const PlanePoint o = g_.beam_origin(line), d = g_.beam_direction(line);
        double lost_db = 0, shadow_db = 0, haze = 0;
        WallPlace before;
        const double gap = gap_mm(pose, o, d);
        for (std::size_t i = 0; i < gain_db_.size(); ++i) {
            const double r = (static_cast<double>(i) + 0.5) * kStepMm;
            if (r >= g_.depth_mm) break;
            haze *= haze_keep_;
            // Somewhere in the slab, as the renderer looks labels up: a rib that runs along the
            // plane, half in it, takes its share.
            const double aside = label_mm_[i] * kEighths[(5 * i + 3 * beam) % 8];
            const double at = r + gap * gap_left_[i];
            const Point3 p = pose * Point3{o.x + at * d.x, aside, o.z + at * d.z};
            const int label = label_at(bundle_, p);
            if (label == kBeyond) break;
            const AcousticProperties& a = scene_.acoustics[static_cast<std::size_t>(label)];
            const Point3 voxel = bundle_.grid.voxel_from_point(p);
            if (const TargetBall* ball = ball_at(scene_, voxel)) {
                lost_db += loss_db(scene_.acoustics[static_cast<std::size_t>(ball->acoustics)]);
                continue;  // its echo is its kind's
            }
            if (a.kind == TissueKind::outside) {
                if (r < kSkinMm) continue;
                break;
            }
            lost_db += loss_db(a);
            if (a.kind == TissueKind::bone || a.kind == TissueKind::gas) shadow_db += loss_db(a);
            if (shadow_db > kShadowDb) break;
            if (a.kind != TissueKind::soft) continue;
            StructureDb& structure = structure_[static_cast<std::size_t>(label)];
            if (!structure.known)
                structure =
                    structure_of(scene_, tables_, brightness_, static_cast<std::size_t>(label));
            const double light_db = gain_db_[i] - lost_db;
            const double power = walled_ && r < kWallDepthMm
                                     ? wall_power(a, structure, voxel, before) * power_of(light_db)
                                     : power_of(a.echo_db + structure.elsewhere + light_db);
            haze += haze_gain_ * power;
            const double level = brightness_.of_power(power + haze);
            out.all.add(i, level);
            if (organ_[static_cast<std::size_t>(label)]) out.organ.add(i, level);
        }
    }
    // From the face to the skin along a beam; both come together, and tissue with them.
    double gap_mm(const Rigid& pose, PlanePoint o, PlanePoint d) const {
        for (double r = 0; r < kMaxGapMm; r += kGapStepMm)
            if (label_at(bundle_, pose * Point3{o.x + r * d.x, 0, o.z + r * d.z}) > 0) return r;
        return kMaxGapMm;
    }
    // Of the wall's ground with its sheets, as reference_beams.cpp adds them.
    double wall_power(const AcousticProperties& a,
                      const StructureDb& structure,
                      Point3 voxel,
                      WallPlace& before) const {
        const WallTables& wall = tables_.wall;
        const WallPlace at = wall_place(scene_.layers, wall, voxel);
        const auto sheet = [&](const SheetTable& table, double mm, double before_mm) {
            const double cosine = std::min(std::abs(mm - before_mm) / kStepMm, 1.0);
            return static_cast<double>(table.echo[wall_step(wall, table, at.course, mm)]) * cosine *
                   cosine * cosine * cosine;
        };
        const double share = std::clamp(0.5 + (at.above - at.depth) / kWallBlendMm, 0.0, 1.0);
        const double sheets = sheet(wall.outer, at.depth, before.depth) * share +
                              sheet(wall.inner, at.above, before.above) * (1 - share);
        before = at;
        const double ground_db = a.echo_db + a.wall_db +
                                 (at.above > 0 ? structure.wall : structure.elsewhere) +
                                 wall_ground_db(wall, at.depth, at.above);
        return power_of(ground_db) + sheets * sheets;
    }
    double loss_db(const AcousticProperties& a) const {
        return 0.2 * a.attenuation * tables_.frequency_mhz * kStepMm;
    }

    const PhysicalScene& scene_;
    const CaseBundle& bundle_;
    const Tables& tables_;
    const ScanGeometry& g_;
    std::vector<bool> organ_;
    bool walled_;
    Brightness brightness_;
    double haze_keep_, haze_gain_;                       // from a step to the next
    std::vector<StructureDb> structure_;                 // # labels
    std::vector<double> gain_db_, label_mm_, gap_left_;  // by depth
};

// The even level whose grey is the mean of these.
double mean_level(const Brightness& brightness, const Levels& levels, const OpeningGain& gain) {
    double sum = 0, n = 0;
    for (std::size_t i = 0; i < levels.count.size(); ++i) {
        if (levels.count[i] < 1) continue;
        const double db = brightness.level_db(levels.sum[i] / levels.count[i]);
        const double share =
            (static_cast<double>(i) + 0.5) / static_cast<double>(levels.count.size());
        sum += levels.count[i] * brightness.of(db + gain.at(share));
        n += levels.count[i];
    }
    return brightness.level_db(sum / n);
}

// A level of several planes: the mean of the middle half by weight, so that one plane unlike the
// others does not decide.
class PlaneMiddle {
  public:
    bool empty() const { return of_plane_.empty(); }
    void add(double db, double weight) { of_plane_.emplace_back(db, weight); }
    double db() {
        std::sort(of_plane_.begin(), of_plane_.end());
        double all = 0, sum = 0, before = 0;
        for (const auto& [db, weight] : of_plane_) all += weight;
        for (const auto& [db, weight] : of_plane_) {
            const double from = std::max(before, 0.25 * all),
                         to = std::min(before + weight, 0.75 * all);
            sum += db * std::max(to - from, 0.0);
            before += weight;
        }
        return sum / (0.5 * all);
    }

  private:
    std::vector<std::pair<double, double>> of_plane_;  // with its weight
};

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
    const std::vector<Plane> planes = opening_planes(*scene.bundle, exercise);
    if (planes.empty()) return out;
    Tracer tracer(scene, exercise, tables, g);
    const Brightness brightness(tables.machine.grey);
    const int beams = planes.size() > 2 ? kOfMany : kBeams;
    std::vector<PlaneLevels> levels;
    std::array<double, 8> sum{}, count{};
    double whole = 0;
    for (const Plane& plane : planes) {
        levels.push_back(tracer.trace(plane.pose, beams));
        const Levels& all = levels.back().all;
        for (std::size_t i = 0; i < all.count.size(); ++i) {
            const std::size_t zone = 8 * i / all.count.size();
            const Levels& organ = levels.back().organ;
            sum[zone] += plane.weight * (all.sum[i] + kOrganMore * organ.sum[i]);
            count[zone] += plane.weight * (all.count[i] + kOrganMore * organ.count[i]);
        }
        whole += plane.weight * beams * static_cast<double>(all.count.size()) / 8;
    }
    // Levels of the zones; one without tissue takes over those beside it.
    std::array<std::optional<double>, 8> level;
    double all = 0, n = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        if (count[i] < kFewest * whole) continue;
        level[i] = brightness.level_db(sum[i] / count[i]);
        all += sum[i];
        n += count[i];
    }
    if (!(n > 0)) return out;
    const double mean = brightness.level_db(all / n);
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
        zones[i] = -mean - (i < 2 && near > mean ? kNearEvened : kEvened) * (near - mean);
    }
    for (std::size_t i = 0; i < 8; ++i) {
        const double above = zones[i > 0 ? i - 1 : 0],
                     below = zones[std::min<std::size_t>(i + 1, 7)];
        out.db[i] = 0.25 * above + 0.5 * zones[i] + 0.25 * below;
    }
    // The organ's level, but not where the tissue of the picture would be far from that grey, since
    // muscle is dark by nature.
    PlaneMiddle organ, tissue;
    for (std::size_t p = 0; p < planes.size(); ++p) {
        const PlaneLevels& plane = levels[p];
        if (plane.all.share > kOrganShare)
            tissue.add(mean_level(brightness, plane.all, out), planes[p].weight);
        if (plane.organ.share > kOrganShare)
            organ.add(mean_level(brightness, plane.organ, out), planes[p].weight);
    }
    if (tissue.empty()) return OpeningGain{};
    if (organ.empty()) organ = tissue;
    const double by = brightness.opening_db() -
                      std::clamp(organ.db(), tissue.db() - kDarkerDb, tissue.db() + kBrighterDb);
    for (double& db : out.db) db = std::clamp(db + by, -kMaxDb, kMaxDb);
    return out;
}

}  // namespace sonocase::runtime::physical
