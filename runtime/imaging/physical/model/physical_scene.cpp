// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/model/physical_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "formats/exercise/pool_shift.h"
#include "formats/pathology/pathology_kinds.h"
#include "formats/volume/tissue.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/physical/model/streak_plates.h"
#include "runtime/imaging/physical/model/wall_sheets.h"
#include "runtime/imaging/press/press_bundle.h"

namespace sonocase::runtime {
namespace {

using namespace physical;

bool contains(const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
}

bool is_artery(const std::string& label) {
    return contains(label, "aorta") || contains(label, "artery") || contains(label, "arter");
}

bool is_muscle(const Tissue& t) {
    return t.name == "muscle";
}
bool is_fat(const Tissue& t) {
    return t.name == "fat";
}

// Fat between organs is as bright as they are, that under the skin darker (both assumed); dark, it
// reads as fluid.
constexpr double kVisceralFatDb = 6;

bool is_parenchyma(const Tissue& t) {
    return t.name == "liver" || t.name == "spleen" || t.name == "kidney_cortex";
}

// Adds the wall of a vessel in an organ: portal veins and arteries lie in connective tissue;
// hepatic veins and the cava have no wall that shows in a tracked sweep of a living liver
// (docs/realism.md).
void line_vessel(const std::string& vessel, PairEcho& e) {
    if (contains(vessel, "portal") || is_artery(vessel)) {
        e.amplitude = kVesselWall;
        e.sigma_mm = kVesselWallMm;
        e.diffuse = true;
    } else if (contains(vessel, "hepatic_vein") || contains(vessel, "cava")) {
        e.amplitude = 0;
    }
}

PairEcho pair_echo(const Label& la, const Tissue& a, const Label& lb, const Tissue& b) {
    PairEcho e;
    const bool outside = a.kind == TissueKind::outside || b.kind == TissueKind::outside;
    e.pulse = is_artery(la.name) ? 1 : is_artery(lb.name) ? -1 : 0;
    if (outside) return e;  // gel: no step in impedance
    const auto hard = [](const Tissue& t) {
        return t.kind == TissueKind::bone || t.kind == TissueKind::gas;
    };
    const auto fluid = [](const Tissue& t) { return t.kind == TissueKind::fluid; };
    e.diffuse = hard(a) || hard(b);
    e.refracts = !e.diffuse && fluid(a) != fluid(b);
    double reflection =
        std::abs(a.impedance_mrayl - b.impedance_mrayl) / (a.impedance_mrayl + b.impedance_mrayl);
    e.sigma_mm = e.diffuse ? 0.20 : 0.16;
    // Between muscles, and between muscle and fat, there is a sheet of connective tissue that the
    // label volume does not show.
    if (is_muscle(a) && is_muscle(b) && la.name != lb.name) {
        reflection = std::max(reflection, 0.04);
        e.sigma_mm = 0.128;
        e.split_mm = 0.25;
    } else if ((is_muscle(a) && is_fat(b)) || (is_fat(a) && is_muscle(b))) {
        reflection = std::max(reflection, 0.05);
        e.sigma_mm = 0.128;
        e.split_mm = 0.375;
    }
    // Cortical bone is the brightest arc of a picture.
    constexpr double kMaxOfBone = 0.35;
    const bool bone = a.kind == TissueKind::bone || b.kind == TissueKind::bone;
    if (reflection > 1e-4) {
        const double most = bone ? kMaxOfBone : kMaxReflection;
        e.amplitude = kInterfaceGain * std::pow(std::min(reflection, most), kInterfacePower);
    }
    return e;
}

// Adds what lines an organ against its surroundings and its vessels.
void add_lining(const Label& la, const Tissue& a, const Label& lb, const Tissue& b, PairEcho& e) {
    if (a.kind == TissueKind::outside || b.kind == TissueKind::outside) return;
    const bool fluid = a.kind == TissueKind::fluid || b.kind == TissueKind::fluid;
    if (is_parenchyma(a) && b.name == "blood") line_vessel(lb.name, e);
    if (is_parenchyma(b) && a.name == "blood") line_vessel(la.name, e);
    // Mucosa, muscle and serosa of the gall bladder: a line all round.
    if ((a.name == "bile") != (b.name == "bile") &&
        (contains(la.name, "gall") || contains(lb.name, "gall")) && a.kind != b.kind) {
        e.amplitude = std::max(e.amplitude, kVesselWall);
        e.sigma_mm = kVesselWallMm;
        e.diffuse = true;
    }
    // An organ's capsule, and the peritoneum on it.
    if (is_parenchyma(a) != is_parenchyma(b) && !e.diffuse && !fluid) {
        e.split_mm = kCapsuleMm;
        e.amplitude = std::min(kCapsuleGain * e.amplitude, kMaxCapsule);
        // Between an organ and the wall lies the diaphragm, or a fascia.
        if (is_muscle(a) || is_muscle(b)) e.amplitude = std::max(e.amplitude, kCapsuleOnMuscle);
    }
}

// Weakens the faces of the skin: a fine pulse shows the dermis as sheets of its own
// (wall_sheets.h), and the lower face of a label of whole voxels is not a mirror.
void soften_skin(const Tissue& a, const Tissue& b, PairEcho& e) {
    constexpr double kSkinFace = 0.25;
    if (a.name == "skin" || b.name == "skin") e.amplitude *= kSkinFace;
}

// What a visible target is made of.
struct TargetTissue {
    AcousticProperties acoustics{-8, 0.6, TissueKind::soft};
    double wall = 0.5;
};

TargetTissue tissue_of(const Tissue& tissue) {
    return {{tissue.echo_db, tissue.attenuation_db_cm_mhz, tissue.kind},
            tissue.kind == TissueKind::fluid ? 3 : 0.5};
}

TargetTissue tissue_of_target(TargetLook look) {
    switch (look) {
        case TargetLook::none:
        case TargetLook::lesion: break;
        case TargetLook::marker: return {{12, 0.5, TissueKind::soft}, 12};
        case TargetLook::abscess: return {{-30, 0.2, TissueKind::fluid}, 2};
        case TargetLook::cyst:
        case TargetLook::calyx: return {{-58, 0.02, TissueKind::fluid}, 3};
    }
    return {};
}

void add_ball(
    const Target& t, double radius_mm, const TargetTissue& tissue, int lesion, PhysicalScene& s) {
    if (!(radius_mm > 0) || s.targets.size() >= kMaxTargets || s.acoustics.size() >= 255) return;
    TargetBall ball;
    ball.centre_vx = s.grid.voxel_from_point(t.centre);
    ball.radius_mm = radius_mm;
    const Vector3 l = t.axes.lengths;
    ball.round = l == Vector3{1, 1, 1};
    ball.reach_mm = ball.round ? radius_mm : radius_mm * std::max({l.x, l.y, l.z});
    if (!ball.round) {
        const Vector3 squares{1 / (l.x * l.x), 1 / (l.y * l.y), 1 / (l.z * l.z)};
        ball.shape = t.axes.axes * Matrix3::diagonal(squares) * transpose(t.axes.axes);
    }
    ball.acoustics = static_cast<int>(s.acoustics.size());
    ball.wall = tissue.wall;
    ball.fluid = tissue.acoustics.kind == TissueKind::fluid;
    ball.lesion = lesion;
    s.acoustics.push_back(tissue.acoustics);
    s.targets.push_back(ball);
}

// Adds the parts of each target, from the outermost shell to the core.
void add_targets(const std::vector<Target>& targets, PhysicalScene& s) {
    for (int n = 0; n < static_cast<int>(targets.size()); ++n) {
        const Target& t = targets[static_cast<std::size_t>(n)];
        if (t.look == TargetLook::none) continue;
        const PathologyKind* kind = find_pathology_kind(t.kind);
        if (kind == nullptr) {
            add_ball(t, t.radius_mm, tissue_of_target(t.look), n, s);
            continue;
        }
        for (const LesionPart& part : kind->parts)
            if (part.place == PartPlace::shell && part.size >= kThinShellMm)
                add_ball(t, t.radius_mm + part.size, tissue_of(part.tissue), n, s);
        add_ball(t, t.radius_mm, tissue_of(kind->tissue), n, s);
        for (const LesionPart& part : kind->parts)
            if (part.place == PartPlace::core)
                add_ball(t, t.radius_mm * part.size, tissue_of(part.tissue), n, s);
    }
}

// Local anaesthetic is clear, fresh blood has faint echoes. Levels re liver, dB (assumed).
void add_act_tissues(PhysicalScene& s) {
    if (s.acoustics.size() + 2 > 255) return;
    s.has_acts = true;
    const auto add = [&](const AcousticProperties& a) {
        s.acoustics.push_back(a);
        return static_cast<int>(s.acoustics.size()) - 1;
    };
    s.clear_pool = add({-50, 0.02, TissueKind::fluid});
    s.blood_pool = add({-14, 0.18, TissueKind::fluid});
}

void add_free_fluid(const FreeFluid& fluid, PhysicalScene& s) {
    TargetBall ball;
    for (std::size_t l = 1; l < s.bundle->labels.size(); ++l) {
        if (s.bundle->labels[l].name != fluid.lies_in) continue;
        ball.centre_vx = s.grid.voxel_from_point(fluid.centre);
        const Vector3 h = fluid.half_mm;
        ball.radius_mm = std::cbrt(h.x * h.y * h.z);
        ball.reach_mm = std::max({h.x, h.y, h.z});
        ball.round = false;
        const Matrix3 axes = free_fluid_axes(fluid);
        const auto square = [&](double half) { return std::pow(ball.radius_mm / half, 2); };
        ball.shape =
            axes * Matrix3::diagonal({square(h.x), square(h.y), square(h.z)}) * transpose(axes);
        ball.acoustics = fluid.blood ? s.blood_pool : s.clear_pool;
        ball.fluid = true;
        ball.only_label = static_cast<int>(l);
    }
    s.free_fluids.push_back(ball);  // of no size where no label has the name
}

// Adds the acoustic properties of labels and targets, and the echoes between labels.
void add_tissues(const CaseBundle& bundle,
                 const std::vector<Target>& targets,
                 const PhysicalSceneOptions& options,
                 PhysicalScene& s) {
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    const Tissue nothing{};
    const auto tissue = [&](std::size_t l) -> const Tissue& {
        return tissue_of[l] >= 0 ? bundle.tissues[tissue_of[l]] : nothing;
    };
    const std::size_t count = bundle.labels.size();
    for (std::size_t l = 0; l < count; ++l) {
        const Tissue& t = tissue(l);
        const auto measured = options.tissue_db.find(bundle.labels[l].name);
        double echo_db = t.echo_db;
        if (is_fat(t) && contains(bundle.labels[l].name, "visceral")) echo_db += kVisceralFatDb;
        s.acoustics.push_back({measured != options.tissue_db.end() ? measured->second : echo_db,
                               t.attenuation_db_cm_mhz, l == 0 ? TissueKind::outside : t.kind,
                               t.name == "skin"  ? kWallSkinDb
                               : t.name == "fat" ? kWallFatDb
                                                 : 0});
    }
    s.has_hard =
        std::any_of(s.acoustics.begin(), s.acoustics.end(), [](const AcousticProperties& l) {
            return l.kind == TissueKind::bone || l.kind == TissueKind::gas;
        });
    s.is_vein.assign(256, 0);
    for (std::size_t l = 0; l < count; ++l) {
        s.is_vein[l] = mechanics_of(tissue(l), bundle.labels[l].name).drains ? 1 : 0;
        s.is_lung.push_back(tissue(l).name == "lung");
        s.has_gas = s.has_gas || s.acoustics[l].kind == TissueKind::gas;
    }
    add_targets(targets, s);
    if (options.acts) add_act_tissues(s);
    if (s.has_acts)
        for (const FreeFluid& fluid : options.free_fluids) add_free_fluid(fluid, s);
    for (AcousticProperties& a : s.acoustics) {
        if (a.kind == TissueKind::fluid) a.attenuation += fluid_steepening(a.attenuation);
    }
    s.pairs.resize(count * count);
    for (std::size_t a = 0; a < count; ++a) {
        for (std::size_t b = 0; b < count; ++b) {
            if (a == b) continue;
            PairEcho& pair = s.pairs[a * count + b];
            pair = pair_echo(bundle.labels[a], tissue(a), bundle.labels[b], tissue(b));
            if (options.fine && options.structures.wall) soften_skin(tissue(a), tissue(b), pair);
            if (options.structures.linings)
                add_lining(bundle.labels[a], tissue(a), bundle.labels[b], tissue(b), pair);
        }
    }
}

// The pipeline bakes noise into an organ, and vessels far above that noise. A kidney's pyramids are
// little more than its noise, which therefore stays.
void add_dead_zones(const CaseBundle& bundle, PhysicalScene& s) {
    constexpr double kDeviations = 3;
    const std::vector<int> tissue_of = tissue_of_label(bundle);
    s.structure_dead_db.assign(bundle.labels.size(), 0.0);
    for (std::size_t l = 1; l < bundle.labels.size(); ++l) {
        if (s.fine.frames[l].cube != kParenchymaCube) continue;
        const Tissue& tissue = bundle.tissues[tissue_of[l]];
        if (tissue.name != "kidney_cortex")
            s.structure_dead_db[l] = kDeviations * tissue.structure_db;
    }
}

}  // namespace

Result<PhysicalScene> make_physical_scene(CaseView view,
                                          const std::vector<Target>& targets,
                                          const PhysicalSceneOptions& options) {
    const CaseBundle& bundle = *view;
    JobRunner& jobs = options.jobs != nullptr ? *options.jobs : serial_jobs();
    PhysicalScene s;
    s.bundle = &bundle;
    s.grid = bundle.grid;
    s.voxel_mm = bundle.grid.spacing_mm.x;
    if (bundle.labels.empty() || bundle.label_bricks.table.empty()) {
        return Error{"the bundle holds no label volume", "", "build the case again"};
    }
    add_tissues(bundle, targets, options, s);
    SONOCASE_TRY(BrickTable words, BrickTable::create(bundle));
    s.words = std::move(words);
    if (bundle.region) s.words.mark(marks_of_region(bundle));
    if (view.blocks() == nullptr) s.words.load_all(jobs);
    SONOCASE_TRY(RegionLookUp region, make_region_look_up(bundle, jobs));
    s.region = std::move(region);
    s.textures = options.textures ? options.textures
                                  : std::make_shared<const PhysicalTextures>(physical_textures());
    if (options.fine) s.roughness_mm = kFineRoughnessMm;
    s.fine = make_fine_structure(bundle, jobs);
    if (options.fine) {
        s.fine = ground_of(std::move(s.fine));
        constexpr double kNoLimit = 127;
        for (const FineFrame& f : s.fine.frames)
            s.max_structure_db.push_back(is_muscle_cube(f.cube) || is_fat_cube(f.cube) ? 0
                                                                                       : kNoLimit);
    }
    s.has_parenchyma = std::any_of(s.fine.frames.begin(), s.fine.frames.end(),
                                   [](const FineFrame& f) { return f.cube == kParenchymaCube; });
    if (s.has_parenchyma && options.structures.parenchyma) add_dead_zones(bundle, s);
    if (s.has_parenchyma && options.structures.streaks) s.plate_cells = find_plate_cells(s);
    s.has_septa = std::any_of(s.fine.frames.begin(), s.fine.frames.end(), [](const FineFrame& f) {
        return is_muscle_cube(f.cube) || is_fat_cube(f.cube);
    });
    if (options.structures.wall || options.structures.diaphragm || options.speckle_reduction ||
        (options.structures.streaks && s.has_septa))
        s.layers = make_tissue_layers(bundle, jobs);
    s.closed_label = press::closed_labels(bundle);
    return s;
}

void balls_of_frame(const PhysicalScene& scene,
                    const SceneChange& change,
                    int first_target,
                    const Matrix3* pushed_axes,
                    std::vector<TargetBall>& balls) {
    balls.clear();
    for (std::size_t i = 0; i < scene.free_fluids.size(); ++i) {  // everything else lies in them
        if (static_cast<int>(i) >= change.level_count) break;
        balls.push_back(scene.free_fluids[i]);
        balls.back().level_up = change.levels[i].up;
        balls.back().level_mm = change.levels[i].mm;
    }
    for (TargetBall ball : scene.targets) {
        const int target = ball.lesion - first_target;
        if (target >= 0 && target < SceneChange::kMaxTargets) {
            const double scale = change.target_scale[static_cast<std::size_t>(target)];
            ball.radius_mm *= scale;
            ball.reach_mm *= scale;
        }
        if (ball.radius_mm >= kMinPoolMm) balls.push_back(ball);
    }
    if (!scene.has_acts) return;
    for (int i = 0; i < change.pool_count; ++i) {
        const SceneChange::Pool& pool = change.pools[static_cast<std::size_t>(i)];
        if (pool.radius_mm < kMinPoolMm) continue;
        TargetBall ball;
        ball.centre_vx = scene.grid.voxel_from_point(pool.centre);
        ball.radius_mm = ball.reach_mm = pool.radius_mm;
        if (pushed_axes != nullptr) {  // in the plane, places at rest are at kPoolCore of the way
            ball.radius_mm *= kPoolCore;
            ball.anywhere = true;  // a vessel that is left in the core is not seen
            ball.round = false;
            ball.shape = *pushed_axes * Matrix3::diagonal({1, kPoolCore * kPoolCore, 1}) *
                         transpose(*pushed_axes);
        }
        ball.acoustics = pool.blood ? scene.blood_pool : scene.clear_pool;
        ball.wall = pool.blood ? 0.5 : 2;
        ball.fluid = !pool.blood;
        ball.covers = true;
        balls.push_back(ball);
    }
}

}  // namespace sonocase::runtime
