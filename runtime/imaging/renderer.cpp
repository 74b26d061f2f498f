// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/renderer.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "runtime/imaging/core/governor.h"
#include "runtime/imaging/core/host.h"
#include "runtime/imaging/core/image_formation.h"
#include "runtime/imaging/paper/paper_formation.h"
#include "runtime/imaging/physical/physical_formation.h"
#include "runtime/imaging/press/probe_press.h"

namespace sonocase::runtime {
namespace {

// In the order of ImageModel.
const std::array<const ImageModelInfo*, 2> kImageModels{&kPaperModel, &kPhysicalModel};

const ImageModelInfo& info_of(ImageModel model) {
    return *kImageModels[static_cast<std::size_t>(model)];
}

constexpr int kMaxLines = 4096, kMaxSamples = 8192, kMaxPixels = 8192;

bool valid_pose(const Rigid& t) {
    return is_finite(t) && orthonormality_error(t.rotation) < 1e-3 && determinant(t.rotation) > 0;
}

bool finite(double x, double y, double z) {
    return std::isfinite(x) && std::isfinite(y) && std::isfinite(z);
}

Status check_options(const Exercise& exercise, const RenderOptions& o) {
    const Probe& p = exercise.probe;
    if (o.width_px < 1 || o.height_px < 1 || o.width_px > kMaxPixels || o.height_px > kMaxPixels) {
        return Error{"a picture of " + std::to_string(o.width_px) + " x " +
                         std::to_string(o.height_px) + " pixels",
                     "", "give 1 to 8192 pixels each way"};
    }
    if (o.threads < 1 || o.threads > 256)
        return Error{std::to_string(o.threads) + " threads", "", "give 1 to 256"};
    if (o.scanlines < 0 || o.scanlines > kMaxLines || o.samples < 0 || o.samples > kMaxSamples) {
        return Error{
            std::to_string(o.scanlines) + " beams of " + std::to_string(o.samples) + " samples", "",
            "give at most 4096 x 8192"};
    }
    if (o.looks < 0 || o.looks > 16)
        return Error{std::to_string(o.looks) + " looks", "", "give 0 to 16"};
    const bool linear = p.shape == ProbeShape::linear;
    const double extent = linear ? p.width_mm : p.field_of_view_rad;
    const bool radius_fits =
        p.shape != ProbeShape::curvilinear || (p.radius_mm > 0 && p.radius_mm < 1e4);
    if (!(p.depth_mm > 0 && p.depth_mm <= 1000) ||
        !(extent > 0 && extent <= (linear ? 1000 : 6.2)) || !radius_fits ||
        !(p.frequency_mhz > 0.1 && p.frequency_mhz < 100) || !std::isfinite(p.focus_mm) ||
        !(p.elevation_mm >= 0 && p.elevation_mm < 100)) {
        return Error{"the probe of exercise " + exercise.name + " has no area to scan", "",
                     "give depth in (0, 1000] mm, opening, radius, width and frequency above 0"};
    }
    return Done{};
}

Result<EffectChoice> choice_of(const RenderOptions& options) {
    const ImageModelInfo& own = info_of(options.model);
    std::vector<const char*> others;
    for (const ImageModelInfo* info : kImageModels) {
        if (info != &own) others.insert(others.end(), info->effects.begin(), info->effects.end());
    }
    return choose_effects(options.effects, own.effects, others);
}

Result<SimdTarget> simd_of(const RenderOptions& options) {
    std::string known;
    for (const SimdTarget& target : available_simd_targets()) {
        if (options.simd.empty() || options.simd == target.name) return target;
        known += (known.empty() ? "" : ", ") + std::string(target.name);
    }
    return Error{"no instruction set " + options.simd, "", "this machine has " + known};
}

// Console gain and TGC at each depth, dB; what is not finite counts as 0.
void set_gain(const ImageSettings& s, std::span<float> row_gain_db) {
    const auto samples = static_cast<int>(row_gain_db.size());
    for (int k = 0; k < samples; ++k) {
        const double at = (k + 0.5) / samples * 7;  // eight sliders, linear in between
        const auto i = static_cast<std::size_t>(at);
        const double slider =
            s.tgc_db[i] * (1 - (at - static_cast<double>(i))) +
            s.tgc_db[std::min<std::size_t>(i + 1, 7)] * (at - static_cast<double>(i));
        const double db = s.gain_db + slider;
        row_gain_db[k] =
            static_cast<float>(std::isfinite(db) ? std::clamp(db, -100.0, 100.0) : 0.0);
    }
}

void flip(std::span<std::uint8_t> pixels, std::size_t width) {
    for (std::size_t row = 0; row < pixels.size(); row += width) {
        const auto line = pixels.subspan(row, width);
        std::reverse(line.begin(), line.end());
    }
}

// Row of the effect in the model's table; -1: the model has none.
int row_of_effect(const ImageModelInfo& info, std::string_view name) {
    for (std::size_t i = 0; i < info.effects.size(); ++i) {
        if (name == info.effects[i]) return static_cast<int>(i);
    }
    return -1;
}

// True if frames of both inputs show the same tissue, pressed in the same way. Where a number is
// none, it is false.
bool same_tissue(const FrameInput& a, const FrameInput& b) {
    const auto same_needle = [&] {
        const NeedlePose &m = a.needle, &n = b.needle;
        return m.tip == n.tip && m.direction == n.direction && m.bevel == n.bevel &&
               m.tent_mm == n.tent_mm && m.drag_mm == n.drag_mm;
    };
    return a.mannequin_from_probe == b.mannequin_from_probe &&
           a.settings.press_mm == b.settings.press_mm &&
           a.change.venous_pressure_mmhg == b.change.venous_pressure_mmhg &&
           a.has_needle == b.has_needle && (!a.has_needle || same_needle());
}

// The needle in the probe's frame; false if there is none to draw.
bool needle_shown(const FrameInput& input, const NeedleModel& model, NeedleShape& needle) {
    const Vector3 d = input.needle.direction;
    const Point3 tip = input.needle.tip;
    if (!input.has_needle || !finite(tip.x, tip.y, tip.z) || !finite(d.x, d.y, d.z) ||
        !(norm(d) > 0.5))
        return false;
    const Rigid probe_from_mannequin = inverse(input.mannequin_from_probe);
    const Vector3 bevel = input.needle.bevel;
    needle =
        needle_shape(model, probe_from_mannequin * tip, normalized(probe_from_mannequin * d),
                     finite(bevel.x, bevel.y, bevel.z) ? probe_from_mannequin * bevel : Vector3{});
    return needle.radius_mm > 0 && std::isfinite(needle.slab_mm);
}

}  // namespace

struct Renderer::Impl {
    // One level of accuracy.
    struct Level {
        ScanGeometry geometry;
        std::vector<float> row_gain_db;  // # samples
    };

    Impl(const Exercise& e, const RenderOptions& o) : exercise(e), options(o), needle(e.needle) {
        if (options.host.make_workers != nullptr && options.threads > 1) {
            workers = options.host.make_workers(options.threads);
        } else {
            workers = std::make_unique<SerialWorkers>();
        }
    }

    Level& current() { return levels[governor.level()]; }

    Exercise exercise;
    RenderOptions options;
    NeedleModel needle;  // as the model draws it
    EffectChoice effects;
    int deformation = -1;                      // row of the effect in the table
    std::unique_ptr<press::ProbePress> probe;  // null: the effect is off
    bool presses = true;                       // false: it is left out for now
    PressReport press;                         // from the last frame
    Rigid shown_pose;
    FrameInput last;                // of the last frame
    bool last_is_rendered = false;  // nothing was asked for since then
    std::vector<Level> levels;      // finest first; one without a frame budget
    Governor governor;
    std::unique_ptr<Workers> workers;
    std::unique_ptr<ImageFormation> formation;  // ends before the workers that it uses
    std::vector<EffectCost> costs;
};

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Result<Renderer> Renderer::create(CaseView bundle,
                                  const Exercise& exercise,
                                  const RenderOptions& options) {
    SONOCASE_TRY_DONE(check_options(exercise, options));
    SONOCASE_TRY(const SimdTarget simd, simd_of(options));
    SONOCASE_TRY(EffectChoice effects, choice_of(options));
    const ImageModelInfo& info = info_of(options.model);
    const bool reference = options.kind == RendererKind::reference;
    JobRunner& jobs = options.host.jobs ? *options.host.jobs : serial_jobs();
    if (bundle.blocks() != nullptr && reference) bundle.blocks()->load_all(jobs);

    auto impl = std::make_unique<Impl>(exercise, options);
    Impl& m = *impl;
    m.effects = std::move(effects);
    if (!(m.needle.slab_mm > 0)) m.needle.slab_mm = info.needle_slab_mm(exercise);
    for (const char* name : info.effects) m.costs.push_back({name, 0, false, "", false});
    m.deformation = row_of_effect(info, "deformation");
    if (m.deformation >= 0 && m.effects.on[m.deformation])
        m.probe = std::make_unique<press::ProbePress>(bundle, exercise, simd);
    const int lines = options.scanlines > 0 ? options.scanlines : info.scanlines(exercise, options);
    const int samples = options.samples > 0 ? options.samples : info.samples(exercise, options);
    SONOCASE_TRY(std::unique_ptr<ImageFormation> formation,
                 info.create({bundle,
                              m.exercise,
                              m.options,
                              m.effects,
                              lines,
                              {*m.workers, jobs, simd, options.host.clock}}));
    m.formation = std::move(formation);

    const bool governed =
        options.frame_budget_ms > 0 && options.host.clock != nullptr && !reference;
    m.governor = Governor(governed ? options.frame_budget_ms : 0);
    for (const AccuracyLevel& accuracy : kAccuracyLevels) {
        const int l = std::max(1, static_cast<int>(lines * accuracy.lines)),
                  k = std::max(1, static_cast<int>(samples * accuracy.samples));
        Impl::Level& level = m.levels.emplace_back();
        level.geometry =
            make_scan_geometry(exercise.probe, l, k, options.width_px, options.height_px);
        level.row_gain_db.assign(k, 0.0f);
        m.formation->add_level(level.geometry, accuracy.looks);
        if (!governed) break;
    }
    return Renderer(std::move(impl));
}

FrameStatus Renderer::render(const FrameInput& input, std::span<std::uint8_t> pixels) {
    Impl& m = *impl_;
    assert(pixels.size() == static_cast<std::size_t>(m.options.width_px) * m.options.height_px);
    if (!valid_pose(input.mannequin_from_probe)) return FrameStatus::held_bad_pose;
    Impl::Level& level = m.current();
    set_gain(input.settings, level.row_gain_db);
    PassTimer timer(m.options.host.clock);
    FrameInput held = input;
    press_probe(input);
    held.mannequin_from_probe = m.shown_pose;
    const double press_ms = timer.lap_ms();
    NeedleShape needle;
    const bool shown = needle_shown(held, m.needle, needle);
    const press::PressField* pressed = nullptr;
    if (m.probe && m.presses) {
        const NeedlePose& in = input.needle;
        m.probe->dent(shown ? bounded_dent(needle.tip, needle.axis, in.tent_mm, in.drag_mm)
                            : NeedleDent{});
        ImageFormation::Pools pools;
        m.probe->set_pools({pools.data(), m.formation->pools_of(held, pools)});
        pressed = m.probe->moving();
    }
    const FrameRequest request{held, shown ? &needle : nullptr, pressed, level.row_gain_db};
    if (m.options.kind == RendererKind::reference) {
        m.formation->render_reference(request, pixels, m.costs);
        if (input.settings.flip_left_right) flip(pixels, m.options.width_px);
        return FrameStatus::rendered;
    }
    const FrameStatus status =
        m.formation->render_fast(m.governor.level(), request, pixels, m.costs);
    if (pressed != nullptr) m.costs[m.deformation].ms += press_ms;
    m.last = input;
    m.last_is_rendered = m.governor.level() == 0;
    m.governor.frame_took(press_ms + timer.lap_ms());
    return status;
}

void Renderer::press_probe(const FrameInput& input) {
    Impl& m = *impl_;
    if (!valid_pose(input.mannequin_from_probe)) return;
    m.last_is_rendered = false;
    m.shown_pose = input.mannequin_from_probe;
    if (!m.probe || !m.presses) return;
    m.probe->set_venous_pressure(input.change.venous_pressure_mmhg);
    m.shown_pose = m.probe->at(input.mannequin_from_probe, input.settings.press_mm);
    m.press = m.probe->report();
}

std::optional<RenderedFrame> Renderer::rendered(const FrameInput& input) const {
    const Impl& m = *impl_;
    const bool pools = m.last.change.pool_count > 0 || input.change.pool_count > 0;
    if (!m.last_is_rendered || pools || !same_tissue(m.last, input)) return std::nullopt;
    RenderedFrame rendered;
    if (m.presses) rendered.probe = m.probe.get();
    m.formation->describe(rendered);
    return rendered;
}

const PressReport& Renderer::press() const {
    return impl_->press;
}

const Rigid& Renderer::shown_pose() const {
    return impl_->shown_pose;
}

double Renderer::press_mm_for(const Rigid& pose, double force_n, double start_mm) {
    if (!impl_->probe || !(force_n > 0) || !valid_pose(pose)) return 0;
    impl_->last_is_rendered = false;
    return impl_->probe->press_mm_for(pose, force_n, start_mm);
}

Point3 Renderer::at_rest(Point3 now) const {
    return impl_->probe ? impl_->probe->at_rest(now) : now;
}

Point3 Renderer::current_position(Point3 rest) const {
    return impl_->probe ? impl_->probe->current_position(rest) : rest;
}

bool Renderer::closed(Point3 rest) const {
    return impl_->probe && impl_->probe->closed(rest);
}

void Renderer::leave_out(int effect) {
    impl_->last_is_rendered = false;
    impl_->presses = effect != impl_->deformation;
    impl_->formation->leave_out(effect);
}

std::span<const EffectCost> Renderer::costs() const {
    return impl_->costs;
}

Renderer::Accuracy Renderer::accuracy() const {
    const ScanGeometry &g = impl_->current().geometry, &full = impl_->levels.front().geometry;
    return {.level = impl_->governor.level(),
            .levels = static_cast<int>(impl_->levels.size()),
            .scanlines = g.scanlines,
            .samples = g.samples,
            .full_scanlines = full.scanlines,
            .full_samples = full.samples};
}

Renderer::Layout Renderer::layout() const {
    const ScanGeometry& g = impl_->levels.front().geometry;
    return {g.mm_per_px, g.origin_x_px, g.origin_y_px};
}

GainLaw Renderer::gain_law() const {
    return impl_->formation->gain_law();
}

std::span<const char* const> effect_names(ImageModel model) {
    return info_of(model).effects;
}

std::shared_ptr<const PhysicalTextures> make_physical_textures() {
    return shared_physical_textures();
}

std::vector<std::string> simd_targets() {
    std::vector<std::string> names;
    for (const SimdTarget& target : available_simd_targets()) names.emplace_back(target.name);
    return names;
}

}  // namespace sonocase::runtime
