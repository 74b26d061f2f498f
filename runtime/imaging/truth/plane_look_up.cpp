// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/truth/plane_look_up.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "formats/volume/brick_volume.h"
#include "runtime/imaging/core/effect_table.h"
#include "runtime/imaging/core/image_formation.h"
#include "runtime/imaging/paper/paper_formation.h"
#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/physical/physical_formation.h"
#include "runtime/imaging/press/press_bundle.h"

namespace sonocase::runtime {

Result<MovingEffects> moving_effects(const RenderOptions& options) {
    MovingEffects moves;
    const bool physical = options.model == ImageModel::physical;
    const auto own = physical ? kPhysicalModel.effects : kPaperModel.effects;
    const auto others = physical ? kPaperModel.effects : kPhysicalModel.effects;
    SONOCASE_TRY(const EffectChoice choice, choose_effects(options.effects, own, others));
    for (std::size_t i = 0; i < own.size(); ++i) {
        const std::string name = own[i];
        if (name == "deformation") moves.deformation = choice.on[i];
        if (!physical) continue;
        if (name == "contact") moves.contact = choice.on[i];
        if (name == "breathing") moves.breathing = choice.on[i];
        if (name == "pulsation") moves.pulsation = choice.on[i];
    }
    return moves;
}

ScanGeometry shown_geometry(const Exercise& exercise, const RenderOptions& o) {
    const ImageModelInfo& info = o.model == ImageModel::physical ? kPhysicalModel : kPaperModel;
    return make_scan_geometry(
        exercise.probe, o.scanlines > 0 ? o.scanlines : info.scanlines(exercise, o),
        o.samples > 0 ? o.samples : info.samples(exercise, o), o.width_px, o.height_px);
}

namespace {

constexpr double kEntryReachMm = 30, kEntryStepMm = 1, kEntryErrorMm = 0.01;
constexpr int kEntryEvery = 16;  // rays; the skin is straight in between

BreathingLattice lattice_of(const CaseBundle& bundle, const BreathingField& field) {
    constexpr int kCell = 2 * kBrickEdge;  // voxels of a cell of BreathingField
    const Int3 n = brick_count(bundle.grid.size);
    BreathingLattice lattice;
    for (int axis = 0; axis < 3; ++axis) {
        lattice.size[axis] = (n[axis] + 1) / 2 + 2;  // with the rim
        lattice.first_vx[axis] = 0.5f * (kCell - 1) - kCell;
    }
    lattice.per_voxel = 1.0f / kCell;
    const double first = 0.5 * (kCell - 1) - kCell;
    for (int k = 0; k < lattice.size.z; ++k) {
        for (int j = 0; j < lattice.size.y; ++j) {
            for (int i = 0; i < lattice.size.x; ++i) {
                const bool rim = i == 0 || j == 0 || k == 0 || i + 1 == lattice.size.x ||
                                 j + 1 == lattice.size.y || k + 1 == lattice.size.z;
                if (rim) {
                    lattice.weight.push_back(0);
                    continue;
                }
                const Point3 voxel{first + kCell * i, first + kCell * j, first + kCell * k};
                lattice.weight.push_back(
                    static_cast<float>(field.weight(bundle.grid.point_from_voxel(voxel))));
            }
        }
    }
    return lattice;
}

}  // namespace

PlaneLookUp::PlaneLookUp(CaseView bundle,
                         const Exercise& exercise,
                         bool contact,
                         bool breathing,
                         bool pulsation,
                         const ScanGeometry& geometry,
                         int rays)
    : bundle_(bundle),
      geometry_(geometry),
      contact_on_(contact),
      breathing_on_(breathing && exercise.breathing.amplitude_mm != 0) {
    if (breathing_on_) {
        breathing_motion_ = exercise.breathing;
        field_ = BreathingField(*bundle);
        lattice_ = lattice_of(*bundle, field_);
    }
    if (pulsation) pulsation_ = exercise.pulsation;
    const auto count = static_cast<std::size_t>(rays);
    contact_.gap_mm.assign(count, 0.0f);
    contact_.entry_mm.assign(count, 0.0f);
    raw_.assign(geometry.scanlines, 0.0f);
    gaps_ = raw_;
}

void PlaneLookUp::begin(const Rigid& mannequin_from_probe,
                        double time_s,
                        bool wants_entry,
                        const press::PressField* press,
                        const RenderedFrame& rendered) {
    pose_ = mannequin_from_probe;
    press_ = press;
    motion_ = motion_at(breathing_motion_, pulsation_, std::isfinite(time_s) ? time_s : 0);
    contact_.any_gap = false;
    contact_.touching = geometry_.scanlines;
    if (contact_on_ && !rendered.gaps_mm.empty()) {
        contact_.touching = rendered.touching;
        spread_gaps(rendered.gaps_mm);
    } else if (contact_on_) {
        find_gaps();
        spread_gaps(gaps_);
    }
    if (wants_entry) find_entries();
    if (wants_entry && press_ != nullptr && press_->state().pressed) press_entries();
}

void PlaneLookUp::find_gaps() {
    // The function that finds the picture's gaps reads no more of the scene than this.
    PhysicalScene scene;
    scene.bundle = &*bundle_;
    scene.grid = bundle_->grid;
    scene.voxel_mm = bundle_->grid.spacing_mm.x;
    PhysicalFrame frame;
    frame.volume_from_probe = pose_;
    runtime::find_gaps(scene, geometry_, frame, 0, geometry_.scanlines, raw_);
    contact_.touching = smooth_gaps(geometry_, raw_, gaps_);
    if (press_ != nullptr) press_gaps(*press_, geometry_, gaps_);
}

void PlaneLookUp::spread_gaps(std::span<const float> gaps) {
    const auto rays = contact_.gap_mm.size();
    for (std::size_t i = 0; i < rays; ++i) {
        const double line =
            (static_cast<double>(i) + 0.5) * geometry_.scanlines / static_cast<double>(rays) - 0.5;
        const double at = std::clamp(line, 0.0, geometry_.scanlines - 1.0);
        const auto l = static_cast<std::size_t>(at);
        const std::size_t next = std::min(l + 1, gaps.size() - 1);
        const float part = static_cast<float>(at - static_cast<double>(l));
        // Beside a beam in air the nearer one decides.
        const bool air = gaps[l] < 0 || gaps[next] < 0;
        const float gap =
            air ? gaps[part < 0.5f ? l : next] : gaps[l] + part * (gaps[next] - gaps[l]);
        contact_.gap_mm[i] = gap;
        contact_.any_gap = contact_.any_gap || gap != 0;
    }
}

bool PlaneLookUp::body_at(Point3 p) const {
    const Point3 v = bundle_->grid.voxel_from_point(p);
    if (!(std::abs(v.x) < 1e6 && std::abs(v.y) < 1e6 && std::abs(v.z) < 1e6)) return false;
    const int i = static_cast<int>(std::floor(v.x + 0.5)),
              j = static_cast<int>(std::floor(v.y + 0.5)),
              k = static_cast<int>(std::floor(v.z + 0.5));
    if (!bundle_->grid.contains(i, j, k)) return false;
    // The skin as the probe meets it, like the gaps.
    const std::optional<press::SkinPlane> skin = press::skin_plane_of(bundle_, {i, j, k});
    return skin ? skin->inside(v) >= 0 : bundle_->label_bricks.at(i, j, k) != 0;
}

double PlaneLookUp::entry_along(PlanePoint origin, PlanePoint direction) const {
    const auto body = [&](double s) {
        return body_at(pose_ * Point3{origin.x + s * direction.x, 0, origin.z + s * direction.z});
    };
    // The search goes outwards where the face lies inside the body, and inwards otherwise.
    const bool inside = body(0);
    const double step = inside ? -kEntryStepMm : kEntryStepMm;
    double in = 0, out = 0;
    bool found = false;
    for (double s = step; std::abs(s) <= kEntryReachMm && !found; s += step) {
        found = body(s) != inside;
        (inside ? in : out) = s - step;
        (inside ? out : in) = s;
    }
    if (!found) return std::numeric_limits<double>::quiet_NaN();
    while (std::abs(in - out) > kEntryErrorMm) {
        const double middle = 0.5 * (in + out);
        (body(middle) ? in : out) = middle;
    }
    return 0.5 * (in + out);
}

void PlaneLookUp::find_entries() {
    const auto rays = static_cast<int>(contact_.entry_mm.size());
    const auto entry_of = [&](int ray) {
        const double line = (ray + 0.5) * geometry_.scanlines / static_cast<double>(rays) - 0.5;
        return entry_along(geometry_.beam_origin(line), geometry_.beam_direction(line));
    };
    double before = entry_of(0);
    for (int ray = 0; ray < rays;) {
        const int next = std::min(ray + kEntryEvery, rays - 1), last = std::max(next, ray + 1);
        const double after = entry_of(std::min(last, rays - 1));
        for (int i = ray; i < last; ++i) {
            const double part = static_cast<double>(i - ray) / (last - ray);
            contact_.entry_mm[i] = static_cast<float>(before + part * (after - before));
        }
        if (last >= rays - 1) {
            contact_.entry_mm[rays - 1] = static_cast<float>(after);
            break;
        }
        ray = last;
        before = after;
    }
}

// Beams enter pressed tissue at the skin as it is now.
void PlaneLookUp::press_entries() {
    const auto rays = static_cast<double>(contact_.entry_mm.size());
    for (std::size_t i = 0; i < contact_.entry_mm.size(); ++i) {
        if (std::isnan(contact_.entry_mm[i])) continue;
        const double line = (static_cast<double>(i) + 0.5) * geometry_.scanlines / rays - 0.5;
        const double lateral = press::follows_columns(geometry_)
                                   ? press::lateral_of_line(geometry_, line)
                                   : geometry_.beam_origin(line).x;
        contact_.entry_mm[i] = static_cast<float>(press_->skin_now_mm(lateral));
    }
}

double PlaneLookUp::contact_reach_mm() {
    return physical::kGapReachMm;
}

double PlaneLookUp::ray_of(double line) const {
    return (line + 0.5) * static_cast<double>(contact_.gap_mm.size()) / geometry_.scanlines - 0.5;
}

double PlaneLookUp::gap_at(double ray) const {
    const double last = static_cast<double>(contact_.gap_mm.size()) - 1;
    return static_cast<double>(
        contact_.gap_mm[static_cast<std::size_t>(std::clamp(ray + 0.5, 0.0, last))]);
}

double PlaneLookUp::entry_at(double ray) const {
    const double last = static_cast<double>(contact_.entry_mm.size()) - 1;
    return static_cast<double>(
        contact_.entry_mm[static_cast<std::size_t>(std::clamp(ray + 0.5, 0.0, last))]);
}

Point3 PlaneLookUp::shown(PlanePoint p, double gap_mm) const {
    if (!(gap_mm > 0)) return pose_ * Point3{p.x, 0, p.z};
    const double radius = geometry_.fan ? geometry_.radius_mm : 0;
    const double away = geometry_.fan ? std::hypot(p.x, p.z + radius) : 1;
    const PlanePoint d = geometry_.fan && away > 0 ? PlanePoint{p.x / away, (p.z + radius) / away}
                                                   : PlanePoint{0, 1};
    const double r = geometry_.fan ? away - radius : p.z;
    const double shift = gap_mm * std::exp(-r / physical::kGapReachMm);
    return pose_ * Point3{p.x + shift * d.x, 0, p.z + shift * d.z};
}

Point3 PlaneLookUp::rest(PlanePoint p, double line, double r_mm, double gap_mm) const {
    Point3 at = shown(p, gap_mm);
    if (press_ != nullptr) {
        const ScanGeometry::Beam beam{geometry_.beam_origin(line), geometry_.beam_direction(line)};
        const press::PlaneShift shift = press::plane_shift(*press_, geometry_, beam, line, r_mm);
        const PlanePoint d = beam.direction, n = press::beside(d);
        at = at + pose_.rotation * Vector3{shift.along_mm * d.x + shift.side_mm * n.x, 0,
                                           shift.along_mm * d.z + shift.side_mm * n.z};
    }
    return without_breathing(at);
}

Point3 PlaneLookUp::without_breathing(Point3 now) const {
    if (field_.empty() || !motion_.breathes()) return now;
    return now - field_.weight(now) * motion_.breathing_mm;
}

bool PlaneLookUp::closed(PlanePoint p, double line, double r_mm) const {
    if (press_ == nullptr) return false;
    return press_->closed_in_plane(
        press::follows_columns(geometry_)
            ? press::BeamPoint{press::lateral_of_line(geometry_, line), r_mm}
            : press::BeamPoint{p.x, p.z});
}

}  // namespace sonocase::runtime
